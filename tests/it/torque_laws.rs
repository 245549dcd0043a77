//! Joints of the virtual robot that are no springs: they stiffen or soften.

use elastocal::robot::{Kinematics, Load};
use elastocal::scenario::Scenario;
use elastocal::testbed::VirtualRobot;
use serde_json::Value;

use crate::support::{Workplace, assert_near_in, list, table4};
use crate::uncertainties::{expected_mm, loaded, study, with};

const LAWS: &str = "[[true_robot.torque_law]]\njoints = [\"joint_2\", \"joint_4\"]\nstiffens_at_mrad = 2\n\
                      [[true_robot.torque_law]]\njoints = [\"joint_3\"]\nsoftens_at_mrad = 20\n";

fn number(plan: &Value, key: &str) -> f64 {
    plan[key].as_f64().expect("a number")
}

/// The virtual robot at one of Table 4's experiments, where it has weight and load, and how far from the balance of MuJoCo's
/// forces it rests (m).
fn rest(scenario: &Scenario, load: &Load, experiment: usize) -> (Vec<f64>, f64) {
    let (robot, tool) = (
        &scenario.truth.robot,
        &scenario.task.belief.calibration_tool,
    );
    let q = &table4(3).experiments[experiment].configuration_rad;
    let mut virtual_robot = VirtualRobot::new(robot, &tool.name).expect("the site exists");
    let (position, _, _) = virtual_robot.rest(q, load).expect("stable");
    let mut any = VirtualRobot::of_any_model(robot, &tool.name).expect("the site exists");
    let apart = (any.rest(q, load).expect("stable").0 - position).norm();
    (virtual_robot.joint_angles(), apart)
}

/// Where it rests each joint holds the torque of weight and load by its law, and MuJoCo's forces balance there, too.
#[test]
fn joints_hold_by_their_laws() {
    let scenario = loaded(&with(LAWS, "robot", 64));
    let belief = &scenario.task.belief;
    for experiment in 0..3 {
        for load in [Load::NONE, table4(3).experiments[0].load] {
            let (angles, apart) = rest(&scenario, &load, experiment);
            assert!(apart < 1e-9, "{apart} m apart");
            let arm = belief.nominal.chain.at(&belief.calibration_tool);
            let state = arm.state(&angles);
            let gravity = arm.gravity_m_s2();
            let commanded = &table4(3).experiments[experiment].configuration_rad;
            let laws = &scenario.truth.robot.torque_laws;
            assert_eq!(laws.len(), 3);
            for &(joint, law) in laws {
                let torque =
                    state.gravity_torque(joint, &gravity) + state.load_torque(joint, &load);
                let held = torque * belief.nominal.compliance_rad_per_nm[joint];
                // The joint's spring pulls back what the torque has turned.
                let turned = angles[joint] - commanded[joint];
                assert_near_in(&joint, law.held(turned), held, 1e-10);
                assert!((law.deflection(held) - turned).abs() < 1e-10);
            }
        }
    }
}

/// A law so weak that it is a spring's leaves the same rest.
#[test]
fn a_law_that_hardly_differs_leaves_the_rest_as_it_is() {
    let hardly =
        "[[true_robot.torque_law]]\njoints = [\"joint_2\", \"joint_4\"]\nstiffens_at_mrad = 9000\n";
    let scenario = loaded(&with(hardly, "robot", 64));
    let plain = loaded(&with("", "robot", 64));
    let load = table4(3).experiments[0].load;
    let (angles, _) = rest(&scenario, &load, 0);
    let (others, _) = rest(&plain, &load, 0);
    for (one, other) in angles.iter().zip(&others) {
        assert!((one - other).abs() < 1e-8, "{angles:?} {others:?}");
    }
}

/// Studies say what a law costs that the belief does not know of, at both levels what the account computes.
#[test]
fn laws_break_predictions_as_computed() {
    let law =
        "[[true_robot.torque_law]]\njoints = [\"joint_2\", \"joint_3\"]\nstiffens_at_mrad = 10\n";
    for (level, trials, nonlinear) in [("model", 4096, 0.005), ("robot", 96, 0.05)] {
        let plan = study(&with(law, level, trials));
        let contributions = list(&plan["contributions"]);
        let last = contributions.last().expect("a source");
        assert_eq!(last["source"], "torque_law");
        assert_eq!(last["hidden"], true);
        let expected = expected_mm(&plan);
        assert!(expected > 1.5 * number(&plan, "combined_rms_mm"), "{plan}");
        let room = 3.0 * number(&plan, "rms_std_mm") + nonlinear * expected;
        assert_near_in(&level, number(&plan, "rms_mm"), expected, room);
        let verdict = plan["verdict"].as_str().expect("words");
        assert!(verdict.contains("torque_law"), "{verdict}");
    }
}

#[test]
fn wrong_entries() {
    let of = |joints: &str, more: &str| {
        format!("[[true_robot.torque_law]]\njoints = [{joints}]\n{more}\n")
    };
    for (text, key, says) in [
        (
            of("\"joint_9\"", "stiffens_at_mrad = 1"),
            "true_robot.torque_law[0].joints",
            "the robot's joints are: joint_1",
        ),
        (of("", "stiffens_at_mrad = 1"), "joints", "is empty"),
        (
            of("\"joint_2\"", "stiffens_at_mrad = -1"),
            "true_robot.torque_law[0].stiffens_at_mrad",
            "-1",
        ),
        (
            of("\"joint_2\"", "stiffens_at_mm = 1"),
            "true_robot.torque_law[0].stiffens_at_mm",
            "joint_2 turns",
        ),
        (
            of("\"joint_2\"", "stiffens_at_mrad = 1\nsoftens_at_mrad = 1"),
            "softens_at_mrad",
            "either stiffens or softens",
        ),
        (
            of("\"joint_2\"", ""),
            "true_robot.torque_law[0]",
            "says nothing",
        ),
        (
            of("\"joint_2\", \"joint_2\"", "stiffens_at_mrad = 1"),
            "joints",
            "twice",
        ),
        (
            of("\"joint_2\"", "dead_band_mrad = 1"),
            "torque_law",
            "unknown field",
        ),
        (
            of("\"joint_2\"", "stiffens_at_mrad = 1")
                + "[true_robot]\ncompliance_rad_per_nm = [0, 0, 0, 0, 0, 0]\n",
            "true_robot.torque_law[0].joints",
            "joint_2 is rigid",
        ),
    ] {
        let place = Workplace::with("wrong.toml", with(&text, "model", 64));
        let said = place.refused("check wrong.toml").stderr;
        assert!(said.contains(key) && said.contains(says), "{text}: {said}");
    }
}
