//! What `check` says that it understood, and its warnings of what is allowed and likely a mistake.

use elastocal::scenario::Scenario;
use elastocal::understanding::Understanding;

use crate::support::{Workplace, list, number, numbers, project, scenario, scenario_text};

#[test]
fn shipped_scenarios_are_plausible() {
    let files = std::fs::read_dir(project("scenarios")).expect("the folder can be read");
    for file in files {
        let path = file.expect("it can be read").path();
        if path.extension().is_some_and(|ending| ending == "toml") {
            let scenario = Scenario::load(&path).expect("valid");
            let understanding = Understanding::new(&scenario);
            assert_eq!(
                understanding.warnings,
                [] as [&str; 0],
                "{}",
                path.display()
            );
        }
    }
}

/// The planar arm, whose numbers can be read in its file.
#[test]
fn the_robot_is_printed_as_it_was_understood() {
    let workplace = Workplace::with("my.toml", scenario_text("planar_3r"));
    let outcome = workplace.done("check my.toml");
    println!("{}", outcome.stdout);
    for part in [
        "joint_2  -150.0 to 150.0              1.250e5                8.000e-6               9.0  identified",
        "The arm reaches 1700 mm from its first joint; gravity is 9.81 m/s^2.",
        "At the test pose \"milling\" the calibration tool is at (1069.8, 0.0, 1252.2) mm",
        "The robot's own weight bends it by ",
        "the task load by 0.332 mm (joint_",
        "\n\nmy.toml is valid\n",
    ] {
        outcome.prints(part);
    }
    let json = workplace.json("check my.toml");
    let joints = list(&json["robot"]["joints"]);
    let masses: Vec<_> = joints
        .iter()
        .map(|joint| joint["moving_mass_kg"].as_f64())
        .collect();
    assert_eq!(masses, [Some(23.0), Some(9.0), Some(3.0)]);
    assert!((numbers(&joints[1]["range_deg"])[1] - 150.0).abs() < 1e-9);
    assert_eq!(joints[2]["stiffness_nm_per_rad"], 62500.0);
    assert_eq!(joints[0]["identified"], true);
    assert_eq!(json["robot"]["reach_mm"], 1700.0);
    let pose = &json["test_poses"][0];
    // -60, 20 and 60 degrees below the horizontal.
    let [sine, cosine] = [60.0_f64.to_radians().sin(), 20.0_f64.to_radians().cos()];
    let x_mm = 700.0 * 0.5 + 500.0 * cosine + 500.0 * 0.5;
    let z_mm = 1250.0 + 700.0 * sine - 500.0 * 20.0_f64.to_radians().sin() - 500.0 * sine;
    let found = numbers(&pose["machining_tool_mm"]);
    assert!(
        (found[0] - x_mm).abs() < 1e-9 && (found[2] - z_mm).abs() < 1e-9,
        "{found:?}"
    );
    assert_eq!(numbers(&pose["task_load_mm"]).len(), 3);
    assert!(number(&pose["own_weight_deg"]) > 0.0);
    assert_eq!(json["warnings"], serde_json::json!([]));
}

/// The same deflection as the rest of the program has.
#[test]
fn the_kr270_bends_by_about_a_millimetre() {
    let understanding = Understanding::new(&scenario("kr270"));
    let bent = understanding.poses[0].bent.as_ref().expect("it holds");
    let task_mm = bent.task_load_m.norm() * 1e3;
    assert!((task_mm - 1.186).abs() < 0.001, "{task_mm}");
    assert!(!understanding.joints[0].is_parameter && understanding.joints[1].is_parameter);
}

/// One mistake: edits of the model and of the scenario, and what the only warning says.
type Mistake = (
    &'static [(&'static str, &'static str)],
    &'static [(&'static str, &'static str)],
    &'static [&'static str],
);

const TABLE: &str = "parameters = [\"joint_1\", \"joint_2\", \"joint_3\"]";

#[rustfmt::skip]
const MISTAKES: &[Mistake] = &[
    (&[("kp=\"250000\"", "kp=\"2000\"")], &[], &["its own weight bends the robot by", "joint_1", "2.0000e3 N m/rad", "a gain for simulation"]),
    (&[("kp=\"250000\"", "kp=\"300\"")], &[], &["robot: the compliance of joint_1", "300.0000 N m/rad"]),
    (&[], &[(TABLE, "parameters = [\"joint_1\", \"joint_2\", \"joint_3\"]\ncompliance_rad_per_nm = [250000, 125000, 62500]")], &["robot: the compliance of joint_1 is 250000", "its stiffness in N m/rad", "4.0000e-6"]),
    (&[], &[("[instrument]", "[true_robot]\ncompliance_rad_per_nm = [4e-6, 125000, 1.6e-5]\n[instrument]")], &["true_robot: the compliance of joint_2 is 125000"]),
    (&[], &[(TABLE, "parameters = [\"joint_1\", \"joint_2\", \"joint_3\"]\ncompliance_rad_per_nm = [4e-15, 8e-15, 1.6e-14]")], &["the task load bends the robot by", "another unit"]),
    (&[("link_2\" pos=\"0.700", "link_2\" pos=\"700"), ("link_3\" pos=\"0.500", "link_3\" pos=\"500"), ("kp=\"250000\"", "kp=\"2.5e12\""), ("kp=\"125000\"", "kp=\"1.25e12\"")], &[], &["reaches 1200 m", "millimetres"]),
    (&[("gravity=\"0 0 -9.81\"", "gravity=\"0 0 -9810\""), ("kp=\"250000\"", "kp=\"2.5e9\""), ("kp=\"125000\"", "kp=\"2.5e9\""), ("kp=\"62500\"", "kp=\"1e9\"")], &[], &["gravity is 9810 m/s^2"]),
    (&[("mass=\"14\"", "mass=\"3000\""), ("kp=\"250000\"", "kp=\"2.5e7\"")], &[], &["the arm moves 3009 kg"]),
    (&[("range=\"-2.9670597283903604 2.9670597283903604\"", "range=\"-170 170\"")], &[], &["joint_1 turns from -9740 to 9740 deg", "in degrees"]),
    (&[("angle=\"radian\"", "angle=\"degree\""), ("limited=\"false\"", "limited=\"true\"")], &[("q_deg = [-60, 80, 40]", "q_deg = [-1, 1, 0]")], &["no joint turns further than 2.97 deg", "radians"]),
    (&[], &[("q_deg = [-60, 80, 40]", "q_deg = [-1.0472, 1.3963, 0.6981]")], &["test_pose[0].q_deg", "are they radians?"]),
    (&[], &[("sigma_mm = 0.03", "sigma_mm = 30")], &["noise is 30 mm", "micrometres"]),
    (&[], &[("sigma_of", "tracker_site = \"tool\"\nsigma_of")], &["instrument.tracker_site is on link_3"]),
    (&[("</worldbody>", "<site name=\"tracker\" pos=\"0 0.1 1.2\"/></worldbody>")], &[("sigma_of", "tracker_site = \"tracker\"\nsigma_of")], &["the tracker is 112 mm from joint_1"]),
];

#[test]
fn likely_mistakes_are_named() {
    let workplace = Workplace::new();
    let model = std::fs::read_to_string(project("models/planar_3r.xml")).expect("it can be read");
    let path = project("models/planar_3r.xml");
    let text = scenario_text("planar_3r").replace(&*path.to_string_lossy(), "arm.xml");
    let mut wrong = Vec::new();
    for (model_edits, edits, says) in MISTAKES {
        let edited = |text: &str, edits: &[(&str, &str)]| {
            edits.iter().fold(text.to_owned(), |text, (from, to)| {
                assert!(text.contains(from), "{from:?}");
                text.replace(from, to)
            })
        };
        workplace.write("arm.xml", edited(&model, model_edits));
        workplace.write("my.toml", edited(&text, edits));
        let outcome = workplace.run("check my.toml");
        let lines = |kind: &str| -> Vec<&str> {
            let lines = outcome.stderr.lines();
            lines.filter_map(|line| line.strip_prefix(kind)).collect()
        };
        // A robot that does not stand cannot be right, whatever the mistake is.
        let (warnings, falls) = (lines("warning: "), lines("condition C0504: "));
        println!("{} {}", warnings.join("\n"), falls.join("\n"));
        assert_eq!(outcome.code, Some(if falls.is_empty() { 0 } else { 3 }));
        let is_said = |text: &&&str| says.iter().all(|part| text.contains(part));
        let said = warnings.iter().chain(&falls).filter(is_said).count();
        if said != 1 || warnings.len() > 1 || falls.len() > 1 {
            wrong.push(format!("{says:?}: {warnings:#?} {falls:#?}"));
        }
        let quiet = workplace.run("check my.toml --json --quiet");
        assert_eq!(quiet.code, outcome.code);
        let listed = quiet.json()["warnings"].clone();
        let listed: Vec<&str> = (listed.as_array().expect("a list").iter())
            .filter_map(serde_json::Value::as_str)
            .collect();
        assert!(warnings.iter().all(|each| listed.contains(each)));
        assert_eq!(quiet.stderr.is_empty(), falls.is_empty());
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// A force in the tool's frame turns with the tool: of one joint its torque is F L however far that turns, by k F L.
#[test]
fn a_load_in_the_tools_frame_turns_with_the_tool() {
    let workplace = Workplace::with(
        "arm.xml",
        r#"<mujoco><option gravity="0 0 0"/><worldbody><body><inertial pos="0.5 0 0" mass="1" diaginertia="1 1 1"/>
<joint name="lift" axis="0 1 0" range="-90 90"/><site name="tool" pos="1 0 0"/></body></worldbody>
<actuator><position joint="lift" kp="1000"/></actuator></mujoco>"#,
    );
    workplace.write(
        "arm.toml",
        r#"seed = 1
[robot]
model = "arm.xml"
calibration_site = "tool"
machining_site = "tool"
parameters = ["lift"]
[instrument]
sigma_mm = 0.02
sigma_of = "position"
[[test_pose]]
name = "drilling"
q_deg = [20]
tool_force_n = [30, 0, -100]
[load]
kind = "fixed"
force_n = [0, 0, -50]
[region]
tool_height_min_mm = -2000
[design]
experiments = 2
"#,
    );
    let outcome = workplace.run("check arm.toml");
    let moved_mm = 2000.0 * 0.05_f64.sin();
    let told = format!("the task load by {moved_mm:.3} mm (lift by 5.7296 deg)");
    outcome.prints(&told);
}

/// A robot on a wall whose model turns gravity: its direction is told, and the first load hangs along it.
#[test]
fn gravity_that_is_turned_is_told() {
    let model = std::fs::read_to_string(project("models/ur10.xml")).expect("a model");
    let place = Workplace::with("arm.xml", model.replace("0 0 -9.81", "9.81 0 0"));
    let told = place.run("init arm.xml --scenario-out arm.toml");
    told.prints("along (1.00, 0.00, 0.00)");
    let drafted = place.read("arm.toml");
    let load = drafted.split("wrenches = [").nth(1).expect("loads");
    let first = load.lines().nth(1).expect("a load");
    assert!(
        first.contains(", 0, 0]") && !first.contains('-'),
        "{drafted}"
    );
}
