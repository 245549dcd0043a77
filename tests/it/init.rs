//! `init`: a scenario for a model that `check` accepts and `plan` plans with, or one clear error.

use std::fmt::Write as _;

use serde_json::Value;

use crate::robots::{Additions, iiwa, ur5e, ur10};
use crate::support::{
    Outcome, Workplace, assert_has, error_message, list, number, numbers, project, shipped,
};

/// What becomes of a model: the scenario is accepted, and quickly planned with.
fn drafted(name: &str, model: &str) -> (Value, String) {
    let place = Workplace::with(name, model);
    let outcome = place.run(&format!("init {name} --scenario-out my.toml --json"));
    let json = outcome.ends_with(0).json();
    place.done("check my.toml --quiet");
    let text = place.read("my.toml");
    let schema = text
        .lines()
        .next()
        .and_then(|line| line.strip_prefix("#:schema "));
    let schema = place.read(schema.expect("the first line names the schema"));
    assert_eq!(schema, place.done("schema").stdout);
    (json, text)
}

fn refused(name: &str, model: &str) -> Outcome {
    let place = Workplace::with(name, model);
    let outcome = place.refused(&format!("init {name} --scenario-out my.toml"));
    assert_eq!(place.listing(), [name], "no half a file");
    assert!(
        error_message(&outcome.stderr).is_some_and(|said| said.starts_with(&format!("{name}: "))),
        "{outcome:#?}"
    );
    assert_eq!(outcome.stderr.matches("error E").count(), 1, "{outcome:#?}");
    outcome
}

fn joints(json: &Value) -> Vec<String> {
    let joints = list(&json["robot"]["joints"]);
    let name = |joint: &Value| joint["name"].as_str().expect("a name").to_owned();
    joints.iter().map(name).collect()
}

#[test]
fn arms_with_sites_and_stiffnesses_are_taken_as_they_are() {
    for (model, names) in [
        ur10(&Additions::default()),
        ur5e(&Additions::default()),
        iiwa(&Additions::default()),
    ] {
        let (json, text) = drafted("arm.xml", &model);
        assert_eq!(joints(&json), names);
        assert!(!text.contains("compliance_rad_per_nm"), "{text}");
        assert!(!text.contains("actuators ="), "{text}");
    }
}

#[test]
fn the_paper_s_robot_gets_its_own_tools() {
    let place = Workplace::new();
    let model = shipped("models/kr270.xml");
    place.done(&format!("init {model} --scenario-out a.toml"));
    let text = place.read("a.toml");
    assert_has(&text, "calibration_site = \"calibration_tcp\"");
    assert_has(&text, "machining_site = \"machining_tcp\"");
    assert!(text.contains("\ncollision_clearance_mm = 10"), "{text}");
    for kind in ["compliance", "joint_zero", "link_position"] {
        let prior = format!("[[uncertainty]]\nkind = \"{kind}\"\njoints = [");
        let (before, _) = text.split_once(&prior).expect("a prior");
        let comment = before.lines().last().expect("a line");
        assert!(comment.starts_with("# GUESS: "), "{comment}");
    }
    // Joint error functions are there for whoever wants them.
    let (before, functions) = text.split_once("# [[uncertainty]]\n").expect("a table");
    let (functions, after) = functions.split_once("\n\n").expect("the next one");
    let functions = functions.replace("# ", "");
    assert!(functions.contains("correlation_deg = 3.5"), "{functions}");
    let with_functions = format!("{before}[[uncertainty]]\n{functions}\n\n{after}");
    place.write("b.toml", &with_functions);
    place.done("check b.toml --quiet");
    place.done("plan a.toml --experiments 4 --no-proof --plan-out p.csv --quiet");
    let again = place.run(&format!("init {model} --scenario-out a.toml"));
    let again = again.ends_with(1);
    again.says("a.toml: is there already");
    again.says("--scenario-out");
    assert_eq!(place.read("a.toml"), text);
}

/// An arm on a column with a hand of two fingers, driven by motors with friction, without sites.
fn simulated() -> String {
    let mut bodies = String::new();
    let axes = ["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0"];
    for (index, axis) in (1..).zip(axes) {
        let _ = write!(
            bodies,
            "<body name=\"link {index}\" pos=\"0.1 0 0.25\"><joint name=\"axis {index}\" axis=\"{axis}\" range=\"-150 150\" frictionloss=\"1\"/>\
             <geom type=\"capsule\" fromto=\"0 0 0.05 0 0 0.2\" size=\"0.03\" mass=\"{}\"/>",
            6 - index
        );
    }
    for side in [-1, 1] {
        let _ = write!(
            bodies,
            "<body pos=\"0 {} 0.3\"><joint name=\"finger {side}\" type=\"slide\" axis=\"0 1 0\" range=\"0 0.04\"/><geom type=\"box\" size=\"0.01 0.01 0.03\" mass=\"0.1\"/></body>",
            0.05 * f64::from(side)
        );
    }
    let mut motors = String::new();
    for index in 1..=5 {
        let _ = write!(
            motors,
            "<motor joint=\"axis {index}\" ctrlrange=\"-90 90\"/>"
        );
    }
    format!(
        "<mujoco><worldbody><geom type=\"plane\" size=\"2 2 0.1\"/>{bodies}{}</worldbody><actuator>{motors}<motor joint=\"finger 1\"/></actuator></mujoco>",
        "</body>".repeat(5)
    )
}

#[test]
fn a_simulation_s_arm_gets_guesses_and_its_hand_is_locked() {
    let (json, text) = drafted("arm.xml", &simulated());
    assert_eq!(
        joints(&json),
        ["axis 1", "axis 2", "axis 3", "axis 4", "axis 5"]
    );
    assert!(text.contains("actuators = \"ignored\""), "{text}");
    assert!(text.contains("frictionloss"), "{text}");
    assert_has(&text, "locked_mm = { \"finger -1\" = 0, \"finger 1\" = 0 }");
    assert!(text.contains("on = \"link 5\""), "{text}");
    assert!(text.contains("\ncompliance_rad_per_nm = ["), "{text}");
    for joint in list(&json["robot"]["joints"]) {
        let compliance = number(&joint["compliance_rad_per_nm"]);
        assert!((1e-9..=5e-4).contains(&compliance), "{joint}");
    }
}

#[test]
fn the_tip_chooses_among_arms() {
    let arm = |side: &str, y: f64| {
        let mut bodies = String::new();
        for index in 1..=3 {
            let _ = write!(
                bodies,
                "<body name=\"{side}_{index}\" pos=\"0.3 0 0\"><inertial pos=\"0.15 0 0\" mass=\"2\" diaginertia=\"0.1 0.1 0.1\"/><joint name=\"{side}_joint_{index}\" axis=\"{}\" range=\"-90 90\"/>",
                ["0 0 1", "0 1 0", "0 1 0"][index - 1]
            );
        }
        format!(
            "<body pos=\"0 {y} 1\">{bodies}<site name=\"{side}_tool\" pos=\"0.3 0.05 0\"/><site name=\"{side}_probe\" pos=\"0.3 0 0.06\"/>{}</body>",
            "</body>".repeat(3)
        )
    };
    let actuators: String = ["left", "right"]
        .iter()
        .flat_map(|side| {
            (1..=3).map(move |index| {
                format!("<position joint=\"{side}_joint_{index}\" kp=\"50000\"/>")
            })
        })
        .collect();
    let model = format!(
        "<mujoco><worldbody>{}{}</worldbody><actuator>{actuators}</actuator></mujoco>",
        arm("left", 0.3),
        arm("right", -0.3)
    );
    let place = Workplace::with("two.xml", model);
    for (tip, side, site) in [
        ("", "left", "left_tool"),
        ("--tip right_tool", "right", "right_tool"),
        ("--tip right_probe", "right", "right_probe"),
        ("--tip right_3", "right", "right_tool"),
    ] {
        let outcome = place.run(&format!(
            "init two.xml --scenario-out {side}{}.toml --json {tip}",
            tip.len()
        ));
        let json = outcome.ends_with(0).json();
        assert!(
            joints(&json).iter().all(|name| name.starts_with(side)),
            "{json}"
        );
        let scenario = place.read(&format!("{side}{}.toml", tip.len()));
        let wanted = format!("calibration_site = \"{site}\"");
        assert!(scenario.contains(&wanted), "{tip}: {scenario}");
    }
    let outcome = place.refused("init two.xml --scenario-out no.toml --tip nothing");
    outcome
        .says("no site named \"nothing\"")
        .says("nor a body of that name; bodies: ");
}

/// A scenario beside its model's folder names the model from where it stands, and can be moved with it.
#[test]
fn models_are_named_from_the_scenario() {
    let place = Workplace::new();
    for folder in ["robot", "cells"] {
        std::fs::create_dir(place.path(folder)).expect("a folder");
    }
    let model = std::fs::read_to_string(project("models/planar_3r.xml")).expect("a model");
    place.write("robot/arm.xml", model);
    place.run("init robot/arm.xml --scenario-out cells/a.toml --quiet");
    let text = place.read("cells/a.toml");
    assert!(text.contains("model = \"../robot/arm.xml\""), "{text}");
    place.done("check cells/a.toml --quiet");
}

#[test]
fn what_cannot_serve_is_one_error_and_no_file() {
    let still =
        "<mujoco><worldbody><body name=\"a\"><geom size=\"0.1\"/></body></worldbody></mujoco>";
    assert!(refused("a.xml", still).stderr.contains("it has no joint"));
    let floating = "<mujoco><worldbody><body name=\"a\"><freejoint name=\"base\"/><geom size=\"0.1\"/></body></worldbody></mujoco>";
    assert!(
        refused("a.xml", floating)
            .stderr
            .contains("neither a hinge nor a slide")
    );
    assert!(
        refused("a.xml", "<mujoco><worldbody>")
            .stderr
            .contains("XML")
    );
    let place = Workplace::new();
    let outcome = place.refused("init missing.xml");
    outcome.says("missing.xml: cannot be read");
    assert_eq!(place.listing(), Vec::<String>::new());
}

/// An arm as ROS describes it: packages of meshes, efforts, frictions, frames without a mass.
fn described(mesh: &str) -> String {
    let mut text = String::from(
        "<?xml version=\"1.0\"?>\n<robot name=\"arm\" xmlns:xacro=\"http://ros.org/wiki/xacro\">\n<link name=\"base\"><collision><geometry><box size=\"0.3 0.3 0.4\"/></geometry></collision></link>",
    );
    let mut parent = "base".to_owned();
    let axes = ["0 0 1", "0 1 0", "0 1 0", "1 0 0"];
    for (index, axis) in (1..).zip(axes) {
        let _ = write!(
            text,
            "<link name=\"link_{index}\"><inertial><origin xyz=\"0 0 0.2\"/><mass value=\"{}\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial>\
             <visual><geometry><mesh filename=\"package://arm/meshes/seen.dae\"/></geometry></visual>\
             <collision><origin xyz=\"0 0 0.2\"/><geometry><mesh filename=\"{mesh}\"/></geometry></collision></link>\
             <joint name=\"joint_{index}\" type=\"revolute\"><origin xyz=\"0 0 0.4\" rpy=\"0 0 0\"/><parent link=\"{parent}\"/><child link=\"link_{index}\"/><axis xyz=\"{axis}\"/>\
             <limit lower=\"-2\" upper=\"2\" effort=\"100\" velocity=\"1\"/><dynamics damping=\"1\" friction=\"2\"/></joint>",
            10 - index
        );
        parent = format!("link_{index}");
    }
    text + "<link name=\"finger\"><inertial><mass value=\"0.1\"/><inertia ixx=\"0\" ixy=\"1\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"/></inertial></link>\
        <joint name=\"left\" type=\"prismatic\"><origin xyz=\"0 0 0.1\"/><parent link=\"link_4\"/><child link=\"finger\"/><axis xyz=\"0 1 0\"/><limit lower=\"0\" upper=\"0.04\" effort=\"1\" velocity=\"1\"/></joint>\
        <link name=\"thumb\"><inertial><mass value=\"0.1\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link>\
        <joint name=\"right\" type=\"prismatic\"><origin xyz=\"0 0 0.1\"/><parent link=\"link_4\"/><child link=\"thumb\"/><axis xyz=\"0 -1 0\"/><limit lower=\"0\" upper=\"0.04\" effort=\"1\" velocity=\"1\"/><mimic joint=\"left\"/></joint>\
        <link name=\"tool0\"/><joint name=\"flange\" type=\"fixed\"><origin xyz=\"0 0 0.1\"/><parent link=\"link_4\"/><child link=\"tool0\"/></joint></robot>"
}

#[test]
fn a_urdf_is_a_model_without_stiffnesses_and_tools() {
    let (json, text) = drafted("arm.urdf", &described("package://arm/meshes/none.stl"));
    assert_eq!(joints(&json), ["joint_1", "joint_2", "joint_3", "joint_4"]);
    assert!(text.contains("on = \"tool0\""), "{text}");
    let warnings = list(&json["warnings"]);
    let told = |what: &str| {
        warnings
            .iter()
            .any(|each| each.as_str().is_some_and(|text| text.contains(what)))
    };
    assert!(
        told("1 of its meshes cannot be had, such as package://arm/meshes/none.stl"),
        "{warnings:?}"
    );
    let masses: Vec<f64> = (list(&json["robot"]["joints"]).iter())
        .map(|joint| number(&joint["moving_mass_kg"]))
        .collect();
    for (mass, expected) in masses.iter().zip([30.2, 21.2, 13.2, 6.2]) {
        assert!((mass - expected).abs() < 1e-6, "{masses:?}");
    }
}

/// What generators of descriptions leave in them: their own calls in comments, a base that floats, joints without ends.
#[test]
fn what_generators_leave_in_a_urdf_is_no_hindrance() {
    let plain = described("package://arm/meshes/none.stl");
    let end = plain.find("<link name=\"base\">").expect("a link");
    let floating = "<!-- <xacro:arm prefix=\"${prefix}\"/>\n -->\n<link name=\"world\"/><joint name=\"float\" type=\"floating\"><parent link=\"world\"/><child link=\"base\"/></joint>";
    let text = format!("{}{floating}{}", &plain[..end], &plain[end..])
        .replacen("type=\"revolute\"", "type=\"continuous\"", 1)
        .replacen(
            "<limit lower=\"-2\" upper=\"2\" effort=\"100\" velocity=\"1\"/>",
            "",
            1,
        );
    let (json, _) = drafted("arm.urdf", &text);
    assert_eq!(joints(&json), ["joint_1", "joint_2", "joint_3", "joint_4"]);
    let warnings = json["warnings"].to_string();
    assert!(
        warnings.contains("floating joints are held where they are drawn: float"),
        "{warnings}"
    );
    // What is still to be generated is another matter.
    let outcome = refused(
        "arm.urdf",
        &text
            .replace("<!-- <xacro", "<xacro")
            .replace("/>\n -->", "/>"),
    );
    outcome.says("run xacro first");
}

#[test]
fn meshes_that_are_found_collide_and_belong_to_the_hash() {
    let place = Workplace::new();
    std::fs::create_dir_all(place.path("arm/urdf")).expect("a folder can be made");
    std::fs::create_dir_all(place.path("arm/meshes")).expect("a folder can be made");
    let octahedron = |size: f64| {
        let corners = [
            [1, 0, 0],
            [-1, 0, 0],
            [0, 1, 0],
            [0, -1, 0],
            [0, 0, 1],
            [0, 0, -1],
        ];
        let mut obj = String::new();
        for [x, y, z] in corners.map(|corner| corner.map(|each: i32| f64::from(each) * size)) {
            let _ = writeln!(obj, "v {x} {y} {z}");
        }
        obj + "f 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n"
    };
    place.write("arm/meshes/link.obj", octahedron(0.1));
    place.write(
        "arm/urdf/arm.urdf",
        described("package://arm/meshes/link.obj"),
    );
    let outcome = place.done("init arm/urdf/arm.urdf --scenario-out my.toml --json");
    outcome.does_not_print("cannot be had");
    assert_has(&place.read("my.toml"), "\ncollision_clearance_mm = 10");
    let hash = |place: &Workplace| {
        let json = place.json("check my.toml");
        json["provenance"]["scenario_sha256"].clone()
    };
    let before = hash(&place);
    place.write("arm/meshes/link.obj", octahedron(0.11));
    assert_ne!(hash(&place), before);
    // A mesh that MuJoCo refuses is left out with its words.
    place.write("arm/meshes/link.obj", "v 0 0 0\n");
    let outcome = place.done("check my.toml");
    outcome.says("MuJoCo refuses its meshes");
}

#[test]
fn a_urdf_s_arm_is_where_its_frames_say() {
    let place = Workplace::with("arm.urdf", described("none.stl"));
    place.write(
        "my.toml",
        r#"[robot]
model = "arm.urdf"
calibration_site = "tip"
machining_site = "tip"
parameters = ["joint_2"]
compliance_rad_per_nm = [1e-6, 1e-6, 1e-6, 1e-6]
locked_mm = { left = 0, right = 20 }
[[robot.tool]]
name = "tip"
on = "tool0"
position_mm = [50, 0, 0]
[instrument]
sigma_mm = 0.03
sigma_of = "deflection"
[[test_pose]]
q_deg = [90, 90, 0, 0]
force_n = [0, 0, -10]
[load]
kind = "fixed"
force_n = [0, 0, -100]
[design]
experiments = 2
"#,
    );
    let json = place.json("check my.toml");
    // Joint 1 turns to +y, joint 2 lies at 0.8 m: 0.4 + 0.4 + 0.1 m along y, and the tip 50 mm below.
    let tool = numbers(&json["test_poses"][0]["calibration_tool_mm"]);
    for (found, expected) in tool.iter().zip([0.0, 900.0, 750.0]) {
        assert!((found - expected).abs() < 1e-6, "{tool:?}");
    }
}

/// A robot of three links, with more in the scene, at its end, and behind the world.
fn scene(before: &str, range: &str, centre: &str, end: &str, after: &str) -> String {
    format!(
        "<mujoco><compiler angle=\"radian\"/><worldbody>{before}\
         <body name=\"l1\" pos=\"0 0 0.3\"><joint name=\"j1\" axis=\"0 0 1\" range=\"{range}\"/><inertial pos=\"0 0 0.1\" mass=\"8\" diaginertia=\"0.1 0.1 0.1\"/>\
         <body name=\"l2\" pos=\"0 0 0.3\"><joint name=\"j2\" axis=\"0 1 0\" range=\"-2 2\"/><inertial pos=\"{centre} 0 0.1\" mass=\"4\" diaginertia=\"0.1 0.1 0.1\"/>\
         <body name=\"l3\" pos=\"0 0 0.4\"><joint name=\"j3\" axis=\"0 1 0\" range=\"-2 2\"/><inertial pos=\"0 0 0.1\" mass=\"2\" diaginertia=\"0.1 0.1 0.1\"/>\
         {end}</body></body></body></worldbody>{after}</mujoco>"
    )
}

const END: &str = "<site name=\"tool\" pos=\"0 0 0.2\"/>";

/// Numbers that are none, or turned round, are refused by name and at once, wherever they stand.
#[test]
fn numbers_that_no_robot_has_are_refused_by_name() {
    let site = |place: &str| format!("<site name=\"tool\" pos=\"{place} 0 0.2\"/>");
    for (model, says) in [
        (
            scene("", "-2 2", "0", &site("nan"), ""),
            "pos=\"nan 0 0.2\"",
        ),
        (
            scene("", "-2 2", "0", &site("1e308"), ""),
            "site \"tool\": pos: found (1e308",
        ),
        (
            scene("", "-2 2", "0", &site("inf"), ""),
            "site \"tool\": pos: found (inf",
        ),
        (scene("", "-2 2", "nan", END, ""), "pos=\"nan 0 0.1\""),
        (
            scene("", "-2 2", "1e308", END, ""),
            "body \"l2\": centre of mass",
        ),
        (
            scene("", "2 -2", "0", END, ""),
            "arm.xml: joint \"j1\": range=\"2 -2\": the first number must be",
        ),
        (scene("", "nan 2", "0", END, ""), "range=\"nan 2\""),
    ] {
        let outcome = refused("arm.xml", &model);
        outcome.says(says);
    }
    let place = Workplace::with("arm.xml", scene("", "-2 2", "500", END, ""));
    let outcome = place.done("init arm.xml --scenario-out a.toml");
    outcome.says(
        "warning: the centre of mass of what j2 moves with its link lies 500.0 m from the joint",
    );
    let checked = place.doubted("check a.toml");
    assert!(!checked.stdout.contains("is valid"), "{checked:#?}");
    checked.says("condition C0503: the centre of mass of what j2 moves with its link lies 500.0 m");
}

/// What lies loose beside the arm, or drags it in a simulation, is left out by name.
#[test]
fn loose_bodies_are_left_out_by_name() {
    let loose = "<camera mode=\"targetbody\" target=\"cube\"/><light mode=\"targetbody\" target=\"cube\"/>\
                 <body name=\"cube\" pos=\"1 0 0.1\"><freejoint/><geom size=\"0.05\"/></body>\
                 <body pos=\"1 1 0.1\"><freejoint/><geom size=\"0.05\"/></body>\
                 <body name=\"drag\" mocap=\"true\" pos=\"0 0 1.2\"><geom size=\"0.05\" contype=\"0\" conaffinity=\"0\"/></body>";
    let tied = "<equality><weld body1=\"drag\" body2=\"l3\"/></equality>\
                <keyframe><key qpos=\"0 0 0 1 0 0 0 0 0 0 1 0 0 0 0 0 0\"/></keyframe>";
    // What lies beside the arm is loose where it is tied to what lies beside it, too.
    let among = tied.replace("l3", "cube");
    for tied in [tied, &among] {
        let (json, _) = drafted("scene.xml", &scene(loose, "-2 2", "0", END, tied));
        assert_eq!(joints(&json), ["j1", "j2", "j3"]);
        let warnings = json["warnings"].to_string();
        let free = ["the free body \\\"cube", "free body without a name"];
        // A mocap body that drags nothing of the arm stands in the scene as any other.
        let dragging = "the mocap body \\\"drag\\\" is no part of the arm: it is left out, with the equality constraint of \\\"drag\\\"";
        let dragging = tied.contains("l3").then_some(dragging);
        for name in free.into_iter().chain(dragging) {
            assert!(warnings.contains(name), "{warnings}");
        }
    }
}

/// The first test pose may be compensated: no joint stands at the end of its range.
#[test]
fn the_first_test_pose_has_room_to_either_side() {
    let (json, text) = drafted("arm.xml", &scene("", "-2 2", "0", END, ""));
    let q = text.lines().find_map(|line| line.strip_prefix("q_deg = "));
    let q: Vec<f64> = serde_json::from_str(q.expect("a pose")).expect("numbers");
    assert_eq!(q.len(), joints(&json).len());
    let end = 2.0_f64.to_degrees();
    assert!(q.iter().all(|q| q.abs() <= 0.98 * end), "{q:?} of {end}");
}

/// A gripper's moving jaw that is called so is no joint of the arm; who says that it is gets it.
#[test]
fn a_moving_jaw_is_no_joint_of_the_arm() {
    let hand = |site: &str, joint: &str, range: &str| {
        format!(
            "<body name=\"l4\" pos=\"0 0 0.1\"><joint name=\"j4\" axis=\"0 0 1\" range=\"-3 3\"/><geom type=\"cylinder\" size=\"0.05 0.05\" mass=\"0.5\"/>\
             <body name=\"l5\" pos=\"0 0 0.1\"><joint name=\"j5\" axis=\"0 1 0\" range=\"-3 3\"/><geom type=\"box\" size=\"0.02 0.01 0.05\" pos=\"0.05 0 0.1\" mass=\"0.3\"/>{site}\
             <body name=\"b6\" pos=\"-0.03 0 0.05\"><joint name=\"{joint}\" axis=\"0 1 0\" range=\"{range}\"/><geom type=\"box\" size=\"0.01 0.01 0.05\" pos=\"0 0 0.05\" mass=\"0.05\"/>\
             </body></body></body>"
        )
    };
    let frame = "<site name=\"ee_frame\" pos=\"0 0 0.15\"/>";
    let arm = ["j1", "j2", "j3", "j4", "j5"];
    let whole = [&arm[..], &["j6"]].concat();
    for (hand, expected) in [
        (hand(frame, "jaw_6", "-0.17 1.7"), &arm[..]),
        (hand("", "gripper", "-1 1"), &arm[..]),
        (hand(frame, "j6", "-3 3"), &whole[..]),
    ] {
        let (json, _) = drafted("arm.xml", &scene("", "-2 2", "0", &hand, ""));
        assert_eq!(joints(&json), expected);
    }
    let place = Workplace::with(
        "arm.xml",
        scene("", "-2 2", "0", &hand(frame, "jaw_6", "-0.17 1.7"), ""),
    );
    let json = place.json("init arm.xml --tip b6 --scenario-out a.toml");
    assert_eq!(joints(&json), [&arm[..], &["jaw_6"]].concat());
}
