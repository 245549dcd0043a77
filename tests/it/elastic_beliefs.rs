//! Beliefs with passive joints, joints that slide, springs, locked branches, tools and payloads: the
//! analytic chain, both ways of the virtual robot and MuJoCo's simulation in time find the same rest.

use elastocal::mujoco::Model;
use elastocal::robot::{EquilibriumSolver, SerialChain, TrueRobot};
use elastocal::testbed::VirtualRobot;
use nalgebra::{DVector, Vector3};

use crate::judge::{Question, judge};
use crate::random_models::{Features, random_model};
use crate::support::{Workplace, assert_has, force, list, number};

#[test]
fn random_beliefs_rest_where_mujoco_does() {
    let workplace = Workplace::new();
    let path = workplace.path("robot.xml");
    let mut features = [0; 4];
    for seed in 0..60 {
        let (mjcf, joints, commanded, force_n) = random_model(seed, Features::Belief);
        workplace.write("robot.xml", &mjcf);
        let model = Model::load(&path).expect("MuJoCo reads it");
        let chain = SerialChain::from_model(&model).unwrap_or_else(|error| panic!("{error}"));
        let tool = SerialChain::tool(&model, "tool").expect("there is");
        let drives = || chain.joints.iter().map(|joint| joint.drive);
        features[0] += usize::from(drives().any(|drive| drive.slides));
        features[1] += usize::from(drives().any(|drive| drive.passive_at.is_some()));
        features[2] += usize::from(!chain.elements.springs.is_empty());
        features[3] += usize::from(!chain.elements.joint_springs.is_empty());
        let compliance: Vec<f64> = (chain.joints.iter())
            .map(|joint| joint.model_compliance_rad_per_nm.expect("each is held"))
            .collect();
        let mut given = commanded.iter();
        let q: Vec<f64> = drives()
            .map(|drive| {
                drive
                    .passive_at
                    .unwrap_or_else(|| *given.next().expect("one each"))
            })
            .collect();
        let robot = TrueRobot::of_chain(model, chain.clone(), compliance.clone());
        let mut by_chain = VirtualRobot::new(&robot, "tool").expect("the site exists");
        let mut by_any = VirtualRobot::of_any_model(&robot, "tool").expect("the site exists");
        let mut solver = EquilibriumSolver::new(chain.len());
        for force_n in [Vector3::zeros(), force_n] {
            let load = force(force_n);
            let analytic = solver.solve(&mut chain.at(&tool), &compliance, &q, &load);
            let q = DVector::from_column_slice(&q);
            let (one, other) = (by_chain.rest(&q, &load), by_any.rest(&q, &load));
            let question = Question {
                site: "tool",
                joints: &joints,
                commanded: &commanded,
                force_n,
            };
            let judged = judge(&path, &question);
            let Ok(_) = analytic else {
                assert!(one.is_err(), "seed {seed}: {analytic:?}, {one:?}");
                println!(
                    "{seed}: {analytic:?}; {:?}; judge {judged:?}",
                    other.is_ok()
                );
                continue;
            };
            let analytic = solver.state().tool_position;
            let (one, other) = (one.expect("stable").0, other.expect("stable").0);
            assert!((analytic - one).norm() < 1e-12, "seed {seed}");
            assert!((one - other).norm() < 1e-12, "seed {seed}");
            let judged = judged.unwrap_or_else(|| panic!("seed {seed}: the judge does not rest"));
            let apart = (one - judged).norm();
            assert!(apart < 1e-9, "seed {seed}: {apart:.1e} m from the judge");
        }
    }
    assert!(features.iter().all(|&count| count > 10), "{features:?}");
}

/// An arm on a rail with a flexible link, a gravity compensator, a joint that slides and a gripper. `rail`
/// and `finger` are elements of the carriage and of the gripper, `mounted` of the hand.
fn workshop(carriage: &str, rail: &str, finger_frame: &str, finger: &str, mounted: &str) -> String {
    format!(
        r#"<mujoco><compiler angle="radian"/><option timestep="0.001" integrator="implicitfast"/>
<worldbody>
  <body name="carriage" pos="{carriage}"><inertial pos="0 0 0" mass="80" diaginertia="2 2 2"/>{rail}
    <site name="anchor" pos="-0.4 0 0.9"/>
    <body name="column" pos="0 0 0.4"><inertial pos="0 0 0.1" mass="20" diaginertia="0.3 0.3 0.2"/>
      <joint name="joint_1" axis="0 0 1" range="-3 3" limited="false" armature="20" damping="1500"/>
      <body name="upper_arm" pos="0.1 0 0.2"><inertial pos="0.3 0.02 0" mass="12" diaginertia="0.05 0.3 0.3"/>
        <joint name="joint_2" axis="0 1 0" range="-2 2" limited="false" armature="20" damping="1500"/>
        <site name="lever" pos="0 0 0.15"/>
        <body name="bend" pos="0.35 0 0"><inertial pos="0.1 0 0" mass="2" diaginertia="0.02 0.02 0.02"/>
          <joint name="bend" axis="0 1 0" stiffness="150000" springref="0.004" armature="20" damping="2500"/>
          <body name="forearm" pos="0.3 0 0"><inertial pos="0.2 0 0.03" mass="7" diaginertia="0.02 0.1 0.1"/>
            <joint name="joint_3" axis="0 1 0" range="-2.5 2.5" limited="false" armature="15" damping="900"/>
            <body name="hand" pos="0.3 0 0"><inertial pos="0.1 0 0" mass="4" diaginertia="0.02 0.02 0.02"/>
              <joint name="quill" type="slide" axis="1 0 0" range="0 0.3" limited="false" armature="300" damping="15000"/>
              <site name="flange" pos="0.2 0 0" euler="0 0.3 0"/>{mounted}
              <body name="finger" {finger_frame}>{finger}<inertial pos="0.1 0 0" mass="3" diaginertia="0.01 0.01 0.01"/></body>
            </body></body></body></body></body></body>
</worldbody>
<tendon><spatial name="compensator" stiffness="9000" springlength="0.3"><site site="anchor"/><site site="lever"/></spatial></tendon>
<actuator>
  <position name="axis_1" joint="joint_1" kp="90000"/><position name="axis_2" joint="joint_2" kp="80000"/>
  <position name="axis_3" joint="joint_3" kp="40000"/><position name="axis_4" joint="quill" kp="800000"/>
</actuator></mujoco>"#
    )
}

const WORKSHOP: &str = r#"
[robot]
model = "arm.xml"
calibration_site = "probe"
machining_site = "probe"
parameters = ["joint_2", "joint_3", "bend", "quill"]
locked_deg = { finger = 40 }
locked_mm = { rail = 250 }
[[robot.tool]]
name = "probe"
on = "flange"
position_mm = [60, 20, -10]
rpy_deg = [0, 90, 0]
[[robot.payload]]
on = "hand"
mass_kg = 6
centre_mm = [150, 0, 80]
[instrument]
sigma_mm = 0.03
sigma_of = "deflection"
[[test_pose]]
q_deg = [20, -30, 50, 120]
force_n = [0, 60, -90]
[load]
kind = "fixed"
force_n = [0, 0, -400]
[design]
experiments = 6
"#;

const RAIL: &str = "<joint name=\"rail\" type=\"slide\" axis=\"1 0 0\"/>";
const FINGER: &str = "<joint name=\"finger\" axis=\"0 0 1\" stiffness=\"10\"/>";

#[test]
fn locked_joints_tools_and_payloads_of_a_scenario_are_as_in_a_model() {
    let workplace = Workplace::with(
        "arm.xml",
        workshop("0 0 0", RAIL, "pos=\"0.2 0 0\"", FINGER, ""),
    );
    workplace.write("arm.toml", WORKSHOP);
    // The same by hand.
    let angle = 40_f64.to_radians();
    let finger = format!("pos=\"0.2 0 0\" euler=\"0 0 {angle}\"");
    let mounted = "<body pos=\"0.15 0 0.08\"><inertial pos=\"0 0 0\" mass=\"6\" diaginertia=\"0.1 0.1 0.1\"/></body>\
                   <body pos=\"0.2 0 0\" euler=\"0 0.3 0\"><site name=\"tool\" pos=\"0.06 0.02 -0.01\" euler=\"0 1.5707963267948966 0\"/></body>";
    workplace.write("judge.xml", workshop("0.25 0 0", "", &finger, "", mounted));
    let scenario = workplace.scenario("arm.toml");
    let names = ["joint_1", "joint_2", "joint_3", "quill"].map(str::to_owned);
    let commanded = [0.4, -0.6, 0.9, 0.12];
    let q = DVector::from_column_slice(&[0.4, -0.6, 0.004, 0.9, 0.12]);
    for force_n in [Vector3::zeros(), Vector3::new(60.0, -30.0, -400.0)] {
        let load = force(force_n);
        let question = Question {
            site: "tool",
            joints: &names,
            commanded: &commanded,
            force_n,
        };
        let judged = judge(&workplace.path("judge.xml"), &question).expect("it rests");
        let truth = &scenario.truth.robot;
        for robot in [
            VirtualRobot::new(truth, "probe"),
            VirtualRobot::of_any_model(truth, "probe"),
        ] {
            let mut robot = robot.expect("the site exists");
            let (found, _, _) = robot.rest(&q, &load).expect("stable");
            let apart = (found - judged).norm();
            assert!(apart < 1e-9, "{apart:.1e} m apart");
        }
    }
}

#[test]
fn every_command_works_with_passive_joints_slides_and_springs() {
    let workplace = Workplace::with(
        "arm.xml",
        workshop("0 0 0", RAIL, "pos=\"0.2 0 0\"", FINGER, ""),
    );
    workplace.write("arm.toml", WORKSHOP);
    let checked = workplace.done("check arm.toml");
    for part in ["passive", "mm", "compensator"] {
        checked.prints(part);
    }
    let planned = workplace.run("plan arm.toml --plan-out plan.csv --quiet --json");
    let planned = planned.ends_with(0).json();
    assert_eq!(list(&planned["plan"][0]["q_deg"]).len(), 4);
    let plan = workplace.read("plan.csv");
    assert!(
        plan.starts_with("q1_deg,q2_deg,q3_deg,q4_mm,fx_n"),
        "{plan}"
    );
    // A slide's violations are in its own unit.
    let mut lines: Vec<String> = plan.lines().map(str::to_owned).collect();
    let mut numbers: Vec<&str> = lines[1].split(',').collect();
    numbers[3] = "312.5";
    lines[1] = numbers.join(",");
    workplace.write("beyond.csv", lines.join("\n"));
    let beyond = workplace.doubted("check arm.toml --plan beyond.csv");
    let said = format!("{}{}", beyond.stdout, beyond.stderr);
    assert_has(&said, "quill is 312.500 mm; the bound is 300.000 mm");
    workplace.done("measure arm.toml --plan plan.csv --measurements-out measured.csv --quiet");
    let identified =
        workplace.json("identify arm.toml --measurements measured.csv --identified-out found.json");
    assert_eq!(list(&identified["parameters"]).len(), 4);
    let printed = workplace.run("identify arm.toml --measurements measured.csv --quiet");
    let unit = "compliance [1e-6 rad/(N m); slides 1e-6 m/N]";
    printed.prints(unit);
    workplace.write("loud.toml", WORKSHOP.replace("0.03", "2"));
    let loud = workplace.run("identify loud.toml --measurements measured.csv --quiet");
    let notes = loud.stdout.lines();
    let of_slide: Vec<&str> = notes.filter(|line| line.contains("quill stays")).collect();
    assert!(
        of_slide.len() == 1 && of_slide[0].contains(" m/N is"),
        "{loud:#?}"
    );
    workplace.done("compensate arm.toml --identified found.json --quiet");
    let run = workplace.json("run arm.toml --out out");
    let pose = &run["plans"][0]["test_poses"][0];
    let [before, after] = ["uncompensated_mm", "residual_mm"].map(|key| number(&pose[key]));
    // The passive joint cannot be commanded: the others make up for it.
    assert!(after < 0.05 * before, "{before} mm, then {after} mm");
}

#[test]
fn wrong_locks_tools_and_payloads_are_refused_by_name() {
    let workplace = Workplace::with(
        "arm.xml",
        workshop("0 0 0", RAIL, "pos=\"0.2 0 0\"", FINGER, ""),
    );
    for (from, to, says) in [
        ("finger = 40", "thumb = 40", "robot.locked_deg.thumb"),
        ("locked_mm = { rail = 250 }", "", "\"rail\""),
        (
            "rail = 250",
            "rail = 7000",
            "robot.locked_mm.rail: found 7000.000; the model's range",
        ),
        (
            "{ finger = 40 }",
            "{ finger = 40, rail = 3 }",
            "robot.locked_deg.rail",
        ),
        ("on = \"flange\"", "on = \"flansch\"", "flansch"),
        ("name = \"probe\"", "name = \"flange\"", "flange"),
        ("mass_kg = 6", "mass_kg = -6", "robot.payload[0].mass_kg"),
        ("mass_kg = 6", "mass_kg = 0", "robot.payload[0].mass_kg"),
        (
            "q_deg = [20, -30, 50, 120]",
            "q_deg = [20, -30, 50, 400]",
            "quill",
        ),
        (
            "q_deg = [20, -30, 50, 120]",
            "q_deg = [20, -30, 0, 50, 120]",
            "5 numbers",
        ),
    ] {
        let text = WORKSHOP.replace(from, to);
        assert_ne!(text, WORKSHOP, "{from}");
        workplace.write("arm.toml", text);
        let refused = workplace.refused("check arm.toml");
        assert!(
            refused.stderr.contains(says),
            "{from} -> {to}: {refused:#?}"
        );
    }
}
