//! Accuracy along a direction alone, as of a surface along its normal; directions and task loads in the tool's frame.

use elastocal::compensation::test_pose_rows;
use elastocal::plan::Assessment;
use elastocal::scenario::Scenario;
use elastocal::task::TestPose;
use elastocal::testbed::TrueRobots;
use nalgebra::Vector3;
use serde_json::Value;

use crate::proofs::{checked, python};
use crate::support::{Workplace, assert_near_in, numbers, project, shipped, table4};
use crate::uncertainties::{assert_holds, entry, loaded, study, with};

pub const FORCE: &str = "force_n = [0, 280, -180]";

/// The paper's scenario in which more is said of the test pose, and its force maybe otherwise.
pub fn pose(force: &str, more: &str, uncertainties: &str, level: &str, trials: u32) -> String {
    let text = with(uncertainties, level, trials);
    assert!(text.contains(FORCE));
    text.replacen(FORCE, &format!("{force}\n{more}"), 1)
}

fn along(direction: &str) -> String {
    pose(FORCE, direction, "", "model", 64)
}

fn rho0_m(scenario: &Scenario) -> f64 {
    let assessment = Assessment::new(&scenario.task, &table4(4), None);
    assessment.rho0_m.expect("determined")
}

/// Along three directions at right angles, squares add up to that of all of it; their lengths and signs say nothing.
#[test]
fn squares_along_axes_add_up() {
    let whole = rho0_m(&loaded(&along("")));
    for axes in [
        ["[1, 0, 0]", "[0, -2, 0]", "[0, 0, 1e-3]"],
        ["[1, 1, 0]", "[1, -1, 0]", "[0, 0, 1]"],
    ] {
        for key in ["direction", "tool_direction"] {
            let square = |axis| rho0_m(&loaded(&along(&format!("{key} = {axis}")))).powi(2);
            let sum: f64 = axes.into_iter().map(square).sum();
            assert!((sum.sqrt() / whole - 1.0).abs() < 1e-12);
        }
    }
}

/// A file of test poses has no directions: it does not take the place of poses that have one in silence.
#[test]
fn files_of_test_poses_drop_no_direction() {
    let place = Workplace::with(
        "path.csv",
        "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,-90,90,0,30,0\n",
    );
    let plan = project("scenarios/plans/klimchik2012_m3.csv");
    for (direction, code) in [("", 3), ("direction = [0, 0, 1]", 1)] {
        place.write("s.toml", along(direction));
        let plan = plan.display();
        let of = format!("evaluate s.toml --plan {plan} --test-poses path.csv --no-proof --quiet");
        let said = place.run(&of).ends_with(code).stderr;
        assert_eq!(
            said.contains("path.csv: found no directions"),
            code == 1,
            "{said}"
        );
    }
}

/// Test poses that count three to one: three quarters of the square of one alone, and a quarter of that of the other.
#[test]
fn squares_at_test_poses_are_weighed() {
    let mut scenario = loaded(&along(""));
    let one = scenario.task.test_poses[0].clone();
    let mut other = one.clone();
    other.configuration_rad[1] += 0.4;
    let mut square_with = |poses: &[(&TestPose, f64)]| {
        let weighed = poses.iter().map(|&(pose, weight)| TestPose {
            weight,
            ..pose.clone()
        });
        scenario.task.test_poses = weighed.collect();
        rho0_m(&scenario).powi(2)
    };
    let [first, second] = [&one, &other].map(|pose| square_with(&[(pose, 1.0)]));
    assert!((first / second - 1.0).abs() > 0.05, "{first} {second}");
    let both = square_with(&[(&one, 0.75), (&other, 0.25)]);
    let expected = 0.75 * first + 0.25 * second;
    assert!((both / expected - 1.0).abs() < 1e-12, "{both} {expected}");
}

/// A load and a direction in the tool's frame are those that turn with it.
#[test]
fn the_tools_frame_turns_with_the_tool() {
    let world = loaded(&along("direction = [1, 2, 3]"));
    let belief = &world.task.belief;
    let target = &world.task.test_poses[0];
    let chain = belief.nominal.chain.at(&belief.machining_tool);
    let axes = chain
        .state(target.configuration_rad.as_slice())
        .tool_rotation;
    let in_tool = |vector: &Vector3<f64>| {
        let [x, y, z]: [f64; 3] = (axes.transpose() * vector).into();
        format!("[{x:?}, {y:?}, {z:?}]")
    };
    let force = format!("tool_force_n = {}", in_tool(&target.load.force_n));
    let direction = format!("tool_direction = {}", in_tool(&Vector3::new(1.0, 2.0, 3.0)));
    let tool = loaded(&pose(&force, &direction, "", "model", 64));
    let other = &tool.task.test_poses[0];
    assert!((other.load.force_n - target.load.force_n).norm() < 1e-9);
    let apart = other.direction.expect("one") - target.direction.expect("one");
    assert!(apart.norm() < 1e-12);
    // The load turns with what is wrong of the tool's turn, which is of second order in compliance.
    assert!((rho0_m(&tool) / rho0_m(&world) - 1.0).abs() < 5e-3);
}

/// What turns the whole robot about the vertical leaves nothing at a test pose whose load turns with the tool, to first order in compliance;
/// where the load stays, it does.
#[test]
fn predictions_count_that_loads_turn_with_the_tool() {
    let list = entry(("joint_zero", "joints = [\"joint_1\"]\nstd_mrad = 2"), "");
    let left_m = |force: &str| {
        let scenario = loaded(&pose(force, "", &list, "model", 64));
        let rows = test_pose_rows(&scenario.task.belief, &scenario.task.test_poses[0]);
        rows.column(rows.ncols() - 1).norm()
    };
    let [turns, stays] = ["tool_", ""].map(|of| left_m(&format!("{of}force_n = [280, 100, -180]")));
    assert!(turns < 0.01 * stays, "{turns} {stays}");
}

/// On a virtual robot that stands turned about its first axis, a load in the tool's frame turns with the tool: all of the robot is
/// turned, and nothing else. One in the world frame does not.
#[test]
fn loads_in_the_tools_frame_turn_with_the_true_tool() {
    let list = entry(("joint_zero", "joints = [\"joint_1\"]\nstd_mrad = 200"), "");
    let at_work = |force: &str| {
        let scenario = loaded(&pose(force, "", &list, "robot", 64));
        let (belief, target) = (&scenario.task.belief, &scenario.task.test_poses[0]);
        let mut robots = TrueRobots::new(belief, &scenario.truth).expect("works");
        let q = &target.configuration_rad;
        let nominal = robots.machining_tool_at_work(q, target).expect("rests");
        (robots.become_run_of(&scenario.truth, 1, 1, 3)).expect("works");
        let seen = [
            nominal,
            robots.machining_tool_at_work(q, target).expect("rests"),
        ];
        let turned = seen[1].y.atan2(seen[1].x) - seen[0].y.atan2(seen[0].x);
        assert!(turned.abs() > 0.01, "{turned}");
        let of_axis = |place: &Vector3<f64>| (place.x.hypot(place.y), place.z);
        let [one, other] = [of_axis(&seen[0]), of_axis(&seen[1])];
        (one.0 - other.0).hypot(one.1 - other.1)
    };
    assert!(at_work("tool_force_n = [280, 100, -180]") < 1e-9);
    assert!(at_work("force_n = [280, 100, -180]") > 1e-7);
}

/// What is predicted along a direction is seen in studies at both levels, also where more than the noise is uncertain.
#[test]
fn predictions_along_a_direction_hold() {
    let direction = "direction = [1, 2, -1]";
    let number = |plan: &Value, key: &str| plan[key].as_f64().expect("a number");
    for (level, trials) in [("model", 40_000), ("robot", 800)] {
        let plan = study(&pose(FORCE, direction, "", level, trials));
        let (rms, predicted) = (number(&plan, "rms_mm"), number(&plan, "predicted_rms_mm"));
        let room = 3.0 * number(&plan, "rms_std_mm") + 0.02 * predicted;
        assert_near_in(&level, rms, predicted, room);
        let scenario = loaded(&pose(FORCE, direction, "", level, trials));
        assert!((predicted / (rho0_m(&scenario) * 1e3) - 1.0).abs() < 1e-9);
        let list = entry(("load_scale", "std_relative = 0.01"), "")
            + &entry(("joint_repeatability", "std_mrad = 0.03"), "")
            + &entry(("task_force", "std_n = 5"), "")
            + &entry(
                ("compliance", "joints = [\"joint_1\"]\nstd_relative = 0.1"),
                "",
            );
        let plan = study(&pose(FORCE, direction, &list, level, trials));
        assert_holds(&plan, level);
    }
}

/// A plan for a direction is better along it than one for all, keeps its bound, and the proof holds for another program.
#[test]
fn plans_are_made_for_the_direction() {
    let place = Workplace::with("all.toml", along(""));
    place.write("along.toml", along("direction = [0, 0, 1]"));
    let run = |arguments: &str| place.json(arguments);
    run("plan all.toml --experiments 3 --no-proof --plan-out all.csv");
    let best = run("plan along.toml --experiments 3 --prove 30% --proof-out proof.json");
    let other = run("evaluate along.toml --plan all.csv --no-proof");
    let number = |value: &Value| value.as_f64().expect("a number");
    assert!(number(&best["rho0_mm"]) < 0.97 * number(&other["rho0_mm"]));
    assert!(number(&best["lower_bound_rho0_mm"]) <= number(&best["rho0_mm"]));
    assert!(number(&best["efficiency"]) > 0.9, "{best}");
    let proved = number(&best["proved_lower_bound_rho0_mm"]);
    assert!(proved > 0.7 * number(&best["rho0_mm"]) && proved <= number(&best["rho0_mm"]));
    let text = place.run("evaluate along.toml --plan all.csv --no-proof --quiet");
    text.prints("um at the test pose along its direction");
    let Some(python) = python() else { return };
    let check = |name: &str| checked(&python, &place.path(name)).0;
    assert_eq!(check("proof.json"), Some(0));
    let mut file = place.parsed("proof.json");
    file["targets"][0]["direction"][2] = serde_json::json!(2.0);
    place.write("tampered.json", file.to_string());
    assert_ne!(check("tampered.json"), Some(0));
}

/// What is seen at a test pose is what counts there, and results name the direction.
#[test]
fn results_are_along_the_direction() {
    let place = Workplace::with("along.toml", along("direction = [3, 0, 4]"));
    let plan = shipped("scenarios/plans/klimchik2012_m4.csv");
    let run = |arguments: &str| place.json(arguments);
    run(&format!(
        "measure along.toml --plan {plan} --measurements-out m.csv"
    ));
    run("identify along.toml --measurements m.csv --identified-out i.json");
    let found = run("compensate along.toml --identified i.json");
    let seen = &found["test_poses"][0];
    assert_eq!(numbers(&seen["direction"]), [0.6, 0.0, 0.8]);
    for (vector, size) in [
        ("uncompensated_xyz_mm", "uncompensated_mm"),
        ("residual_xyz_mm", "residual_mm"),
    ] {
        let vector = Vector3::from_column_slice(&numbers(&seen[vector]));
        let size = seen[size].as_f64().expect("a number");
        let direction = Vector3::new(0.6, 0.0, 0.8);
        assert!((vector - direction * direction.dot(&vector)).norm() < 1e-12);
        assert!((vector.norm() - size).abs() < 1e-12 && size > 0.0);
    }
    let text = place.done("check along.toml");
    text.prints("Only the error along (0.6000, 0.0000, 0.8000) counts.");
}

/// Wrong entries are named with their key and what is allowed.
#[test]
fn wrong_entries() {
    for (force, more, key, says) in [
        (
            FORCE,
            "direction = [0, 0, 0]",
            "test_pose[0].direction",
            "a direction is needed",
        ),
        (
            FORCE,
            "tool_direction = [0, 1]",
            "test_pose[0].tool_direction",
            "2 numbers; 3",
        ),
        (
            FORCE,
            "direction = [0, 0, nan]",
            "test_pose[0].direction",
            "NaN",
        ),
        (
            FORCE,
            "direction = [0, 0, 1]\ntool_direction = [0, 0, 1]",
            "test_pose[0]",
            "tool_direction in the machining tool's",
        ),
        (
            FORCE,
            "tool_torque_nm = [0, 0, 1]",
            "test_pose[0]",
            "given in two frames",
        ),
        ("", "", "test_pose[0].force_n", "is missing"),
        (
            "",
            "tool_torque_nm = [0, 0, 1]",
            "test_pose[0].tool_force_n",
            "is missing",
        ),
        (
            "tool_force_n = [0, 0, 0]",
            "",
            "test_pose[0]",
            "a load of zero",
        ),
        (
            "tool_force_n = [0, 0]",
            "",
            "test_pose[0].tool_force_n",
            "2 numbers",
        ),
    ] {
        let place = Workplace::with("wrong.toml", pose(force, more, "", "model", 64));
        let outcome = place.refused("check wrong.toml");
        let found = &outcome.stderr;
        assert!(
            found.contains(key) && found.contains(says),
            "{key}: {found}"
        );
    }
    // Joint 1 turns about the vertical.
    let text = along("direction = [0, 0, 1]").replacen(
        "parameters = [\"joint_2\", \"joint_3\", \"joint_4\", \"joint_5\", \"joint_6\"]",
        "parameters = [\"joint_1\"]",
        1,
    );
    let place = Workplace::with("wrong.toml", text);
    let outcome = place.refused("check wrong.toml");
    outcome.says("nothing that is unknown bends the tool along the direction");
}
