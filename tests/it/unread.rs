//! What is uncertain and no reading of a deflection shows, or hardly: the task's force, which acts at the test pose alone;
//! what links weigh, tools' orientations, the base's position.

use elastocal::mujoco::ModelChange;
use elastocal::parameter::{Axis, ElasticArm, ParameterKind, ParameterSet, SourceLevel};
use elastocal::plan::Assessment;
use elastocal::robot::{EquilibriumSolver, Kinematics, Load};
use elastocal::testbed::{TrueRobots, VirtualRobot};
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

use crate::support::{assert_near, table4};
use crate::uncertainties::{assert_holds, assert_refused, entry, expected_mm, loaded, study, with};

const TASK_SIZE: (&str, &str) = ("task_force", "std_relative = 0.05");
const TASK_FORCE: (&str, &str) = ("task_force", "std_n = 10");

/// The joints' own deflection at the test pose for each newton (m/N).
fn compliance_at_test_pose(scenario: &elastocal::scenario::Scenario) -> Matrix3<f64> {
    let belief = &scenario.task.belief;
    let pose = &scenario.task.test_poses[0];
    let mut chain = belief.nominal.chain.at(&belief.machining_tool);
    let mut state = elastocal::robot::KinematicState::new(belief.joints());
    chain.update(pose.configuration_rad.as_slice(), &mut state);
    let joints = belief.nominal.compliance_rad_per_nm.iter().enumerate();
    joints
        .map(|(joint, k)| {
            let column: Vector3<f64> = state.position_column(joint);
            column * column.transpose() * *k
        })
        .sum()
}

/// The share of the task's force is what it bends the robot by, whatever is measured.
#[test]
fn an_uncertain_task_adds_what_it_bends() {
    for source in [TASK_SIZE, TASK_FORCE] {
        let scenario = loaded(&with(&entry(source, ""), "model", 64));
        let softness = compliance_at_test_pose(&scenario);
        let expected = if source == TASK_SIZE {
            (softness * scenario.task.test_poses[0].load.force_n).norm() * 0.05
        } else {
            softness.norm() * 10.0
        };
        for measurements in [2, 12] {
            let assessment = Assessment::new(&scenario.task, &table4(measurements), None);
            let budget = assessment.uncertainty_budget.expect("determined");
            let [noise, task] = [0, 1].map(|place: usize| &budget.sources[place]);
            assert_eq!(
                (&*task.source, task.level),
                ("task_force", SourceLevel::Task)
            );
            let error = task.contribution_um * 1e-6 / expected - 1.0;
            assert!(error.abs() < 1e-9, "{task:?}");
            let whole_um = assessment.rho0_m.expect("determined") * 1e6;
            assert!((whole_um - task.contribution_um.hypot(noise.contribution_um)).abs() < 1e-6);
        }
    }
}

/// Each kind on the virtual robot, on the linear model, and hidden from the belief.
#[test]
fn predictions_about_uncertain_tasks_hold() {
    for source in [TASK_SIZE, TASK_FORCE] {
        assert_holds(&study(&with(&entry(source, ""), "robot", 600)), source.1);
        assert_holds(&study(&with(&entry(source, ""), "model", 40_000)), source.1);
        let hidden = study(&with(&entry(source, "hidden = true"), "robot", 600));
        let number = |value: &Value| value.as_f64().expect("a number");
        let expected = expected_mm(&hidden);
        let room = 3.0 * number(&hidden["rms_std_mm"]) + 0.02 * expected;
        assert_near(number(&hidden["rms_mm"]), expected, room);
        let verdict = hidden["verdict"].as_str().expect("words");
        assert!(
            verdict.starts_with("exceeded") && verdict.contains("task_force"),
            "{verdict}"
        );
    }
    let both = entry(("task_force", "std_relative = 0.05\nstd_n = 10"), "");
    assert_holds(&study(&with(&both, "robot", 600)), "both sizes");
}

/// A run's force acts at the test pose, not in the measurements.
#[test]
fn the_drawn_force_acts_at_the_test_pose_alone() {
    let scenario = loaded(&with(&entry(TASK_FORCE, ""), "robot", 64));
    let (belief, pose) = (&scenario.task.belief, &scenario.task.test_poses[0]);
    let mut robots = TrueRobots::new(belief, &scenario.truth).expect("works");
    let at = |robots: &mut TrueRobots| {
        let rest = robots.machining_tool_at_work(&pose.configuration_rad, pose);
        rest.expect("at rest")
    };
    let plan = table4(4);
    let nominal = at(&mut robots);
    let measured = |robots: &mut TrueRobots, normals: &[_]| {
        let all = robots.measure_noise_free(&plan, &belief.instrument, normals, 0);
        all.expect("at rest")
    };
    let normals = robots
        .become_run_of(&scenario.truth, 4, 1, 3)
        .expect("works");
    let before = measured(&mut robots, &normals);
    assert_eq!(normals.len(), 3);
    let force = Vector3::from_fn(|axis, _| 10.0 * normals[axis][0]);
    let (expected, _) = robots
        .machining_tool(
            &pose.configuration_rad,
            &Load {
                force_n: pose.load.force_n + force,
                torque_nm: pose.load.torque_nm,
            },
        )
        .expect("at rest");
    assert_eq!(at(&mut robots), expected);
    assert!((nominal - expected).norm() > 1e-6);
    robots
        .become_run_of(&scenario.truth, 4, 1, 4)
        .expect("works");
    assert_eq!(measured(&mut robots, &normals), before);
}

const SILENT: [(&str, &str); 2] = [
    ("link_mass", "std_relative = 0.2"),
    ("link_centre", "std_mm = 20"),
];

/// Masses and what no deflection shows leave a prediction as it is, and the robots that are drawn keep it.
#[test]
fn what_links_weigh_costs_nothing() {
    let certain = study(&with("", "robot", 64));
    let number = |plan: &Value, key: &str| plan[key].as_f64().expect("a number");
    let predicted = number(&certain, "predicted_rms_mm");
    for source in SILENT {
        let plan = study(&with(&entry(source, ""), "robot", 600));
        assert_holds(&plan, source.0);
        assert!((number(&plan, "combined_rms_mm") / predicted - 1.0).abs() < 1e-6);
        assert!((number(&plan, "nees_z")).abs() < 5.0, "{plan}");
    }
    let all: String = SILENT.iter().map(|&source| entry(source, "")).collect();
    assert_holds(&study(&with(&all, "robot", 600)), "all of them");
    assert_holds(&study(&with(&all, "model", 20_000)), "the linear model");
}

/// Links that weigh more in MuJoCo's model, with what is welded to them, rest where the arm with the same parameters does.
#[test]
fn masses_in_the_model_are_those_of_the_parameters() {
    let payload = "[[robot.payload]]\non = \"link_3\"\nmass_kg = 80\ncentre_mm = [200, 100, 50]\n";
    let scenario = loaded(&(with(&entry(SILENT[0], ""), "model", 64) + payload));
    let (belief, robot) = (&scenario.task.belief, &scenario.truth.robot);
    let arm = belief.arm();
    let mut unknowns = Vec::new();
    let mut changes = Vec::new();
    let mut values = Vec::new();
    for link in 0..belief.joints() {
        let factor = 1.1 + 0.1 * f64::from(u8::try_from(link).expect("few joints"));
        unknowns.push((ParameterKind::LinkMass { link }, Some(0.1)));
        values.push(factor.ln());
        changes.push(ModelChange::Mass(link, factor));
        for axis in Axis::ALL {
            let by = [0.03, -0.02, 0.05][axis.index()];
            unknowns.push((ParameterKind::LinkCentre { link, axis }, Some(0.1)));
            values.push(by + arm.chain.joints[link].centre_of_mass_m[axis.index()]);
            changes.push(ModelChange::Centre(link, Vector3::ith(axis.index(), by)));
        }
    }
    let set = ParameterSet::new(&arm, unknowns).expect("every link has a mass");
    let other = set.apply(&arm, &values);
    let site = &belief.calibration_tool.name;
    let mut chain = VirtualRobot::new(robot, site).expect("the site exists");
    let mut any = VirtualRobot::of_any_model(robot, site).expect("the site exists");
    for experiment in &table4(4).experiments {
        let commanded = &experiment.configuration_rad;
        let rest = |arm: &ElasticArm| {
            let mut solver = EquilibriumSolver::new(arm.chain.len());
            let compliance = &arm.compliance_rad_per_nm;
            let mut chain = arm.chain.at(&arm.tools[0]);
            let commanded = commanded.as_slice();
            (solver.solve(&mut chain, compliance, commanded, &experiment.load)).expect("at rest");
            solver.state().tool_position
        };
        assert!((rest(&other) - rest(&arm)).norm() > 1e-5);
        for virtual_robot in [&mut chain, &mut any] {
            for (changes, expected) in [(&changes[..], rest(&other)), (&[], rest(&arm))] {
                virtual_robot.change(robot, changes).expect("links exist");
                let (position, _, _) =
                    (virtual_robot.rest(commanded, &experiment.load)).expect("at rest");
                assert!(
                    (position - expected).norm() < 1e-9,
                    "{}",
                    (position - expected).norm()
                );
            }
        }
    }
}

/// Wrong entries are named with their key and what is allowed.
#[test]
fn wrong_entries() {
    for (text, key, says) in [
        ("kind = \"task_force\"", "[0]", "std_relative or std_n"),
        (
            "kind = \"task_force\"\nstd_mm = 1",
            "std_mm",
            "std_relative or std_n",
        ),
        ("kind = \"task_force\"\nstd_n = -1", "std_n", "-1"),
        ("kind = \"link_mass\"\nstd_mm = 1", "std_mm", "std_relative"),
        (
            "kind = \"link_mass\"\nstd_relative = 0.1\njoints = [\"joint_7\"]",
            "joints",
            "joint_7",
        ),
        ("kind = \"link_centre\"\nstd_mm = -2", "std_mm", "-2"),
        ("kind = \"link_centre\"", "[0]", "std_mm"),
        (
            "kind = \"task_force\"\nstd_n = 1\njoints = [\"joint_1\"]",
            "joints",
            "task_force",
        ),
    ] {
        assert_refused(text, key, says);
    }
}
