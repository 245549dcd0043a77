//! Models that cannot serve, and regions in which everything collides: the error says what to do.

use elastocal::mujoco::{Additions, Model, MountedPayload};
use elastocal::plan::search::random_plan;
use elastocal::robot::SerialChain;
use nalgebra::Vector3;

use crate::support::{Workplace, assert_has, error_message, project, scenario_text};

/// The error and the hint of `check` for a scenario with this model.
fn refusal(name: &str, model: &str) -> (String, String) {
    let workplace = Workplace::with(name, model);
    let text = scenario_text("planar_3r");
    let path = project("models/planar_3r.xml");
    let mine = text.replace(&*path.to_string_lossy(), name);
    assert_ne!(mine, text);
    workplace.write("my.toml", mine);
    let outcome = workplace.refused("check my.toml --quiet");
    let mut lines = outcome.stderr.lines();
    let error = lines.next().unwrap_or_default().to_owned();
    let hint = lines.next().unwrap_or_default().to_owned();
    println!("{error}\n{hint}");
    let said = error_message(&error).unwrap_or_default();
    assert!(said.starts_with("my.toml: robot."), "{error}");
    assert!(error.contains(name), "{error}");
    assert_eq!(lines.next(), None, "{}", outcome.stderr);
    (error, hint)
}

const URDF: &str = r#"<?xml version="1.0"?>
<!-- made by a <mujoco> fan -->
<robot name="arm">
  <link name="base"/>
  <link name="arm"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <visual><geometry><mesh filename="MESH"/></geometry></visual></link>
  <joint name="joint_1" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="100" velocity="1"/></joint>
</robot>"#;

#[test]
fn a_xacro_file_says_to_run_xacro() {
    let xacro = URDF.replace(
        "<link name=\"base\"/>",
        "<xacro:base/><link name=\"base\"/>",
    );
    for (name, text) in [("arm.urdf.xacro", URDF), ("arm.xml", &xacro)] {
        let (error, hint) = refusal(name, text);
        assert!(error.contains("is a xacro file"), "{error}");
        assert!(hint.contains(&format!("{name} > arm.urdf")), "{hint}");
        assert!(hint.starts_with("hint: run xacro first: xacro "), "{hint}");
    }
}

fn planar() -> String {
    std::fs::read_to_string(project("models/planar_3r.xml")).expect("it can be read")
}

/// A payload weighs what the scenario says, or the model is refused.
#[test]
fn a_model_that_scales_payloads_is_refused() {
    let workplace = Workplace::new();
    let scenario = scenario_text("planar_3r");
    let path = project("models/planar_3r.xml");
    let scenario = scenario.replace(&*path.to_string_lossy(), "arm.xml");
    let payload = "\n[[robot.payload]]\non = \"tool\"\nmass_kg = 1.3\ncentre_mm = [0, 0, 0]\n";
    workplace.write("my.toml", scenario + payload);
    for attribute in ["settotalmass=\"100\"", "boundmass=\"2\""] {
        let compiler = format!("<compiler {attribute} ");
        workplace.write("arm.xml", planar().replace("<compiler ", &compiler));
        let outcome = workplace.refused("check my.toml --quiet");
        outcome.says("makes the payload of 1.3 kg one of ");
    }
    // Where geometries alone say what weighs, the payload is added to them.
    let by_geometry = planar().replace("<compiler ", "<compiler inertiafromgeom=\"true\" ");
    workplace.write("arm.xml", by_geometry.replace("mass=\"0\"", "mass=\"1\""));
    workplace.done("check my.toml --quiet");
    let mass = |additions: &Additions| -> f64 {
        let model = Model::load_with(&workplace.path("arm.xml"), additions).expect("a model");
        let chain = SerialChain::from_model(&model).expect("a chain");
        chain.joints.iter().map(|joint| joint.mass_kg).sum()
    };
    let payload = MountedPayload {
        on: "tool".to_owned(),
        mass_kg: 1.3,
        centre_m: Vector3::zeros(),
    };
    let with_payload = Additions {
        payloads: vec![payload],
        ..Additions::default()
    };
    let added = mass(&with_payload) - mass(&Additions::default());
    assert!((added - 1.3).abs() < 1e-9, "{added}");
    // A body that MuJoCo would fuse weighs the same.
    let fused = planar().replace("<compiler ", "<compiler fusestatic=\"true\" ");
    workplace.write("arm.xml", fused);
    workplace.done("check my.toml --quiet");
}

#[test]
fn a_package_in_an_mjcf_file_is_found() {
    let mesh = "<mesh name=\"m\" file=\"package://arm/meshes/arm.stl\"/>\n  </asset>";
    let (error, hint) = refusal("arm.xml", &planar().replace("</asset>", mesh));
    assert!(error.contains("names a file by its ROS package"), "{error}");
    assert!(hint.contains("relative to the file"), "{hint}");
}

#[test]
fn a_model_without_sites_says_to_add_one() {
    let without = planar().replace(
        "<site class=\"point\" name=\"tool\" pos=\"0.500 0 0\"/>",
        "",
    );
    let (error, hint) = refusal("arm.xml", &without);
    assert_has(&error, "no site named \"tool\"; it has: none");
    assert!(hint.contains("<site name="), "{hint}");
}

/// The wrapper keeps 99 characters of MuJoCo's message; the line comes at the end.
#[test]
fn mujocos_messages_are_whole() {
    let attribute =
        "a_very_long_name_of_an_attribute_that_no_joint_of_any_model_has_had_so_far_in_mujoco";
    let wrong = planar().replace(
        "<joint name=\"joint_2\"",
        &format!("<joint {attribute}=\"1\" name=\"joint_2\""),
    );
    let line = 1 + wrong
        .lines()
        .position(|line| line.contains(attribute))
        .expect("there");
    for obstacle in [
        "",
        "[[obstacle]]\nname = \"box\"\nkind = \"sphere\"\nradius_mm = 9\nposition_mm = [9, 9, 9]\n",
    ] {
        let workplace = Workplace::with("arm.xml", &wrong);
        let path = project("models/planar_3r.xml");
        let text = scenario_text("planar_3r").replace(&*path.to_string_lossy(), "arm.xml");
        let text = text.replace(
            "[design]",
            &format!("collision_clearance_mm = 1\n{obstacle}[design]"),
        );
        workplace.write("my.toml", text);
        let outcome = workplace.refused("check my.toml --quiet");
        outcome.says(attribute);
        outcome.says(&format!("line {line}"));
        assert_eq!(outcome.stderr.lines().count(), 1, "{}", outcome.stderr);
    }
}

#[test]
fn pairs_that_collide_everywhere_are_named_with_their_share() {
    let workplace = Workplace::new();
    let ball = "[[obstacle]]\nname = \"bunker\"\nkind = \"sphere\"\nradius_mm = 700\nposition_mm = [0, 0, 600]\n";
    let text = scenario_text("kr270").replace("[design]", &format!("{ball}[design]"));
    workplace.write("my.toml", text);
    let scenario = workplace.scenario("my.toml");
    let error = random_plan(&scenario.task, 1, scenario.seed, 0)
        .expect_err("all collides")
        .to_string();
    println!("{error}");
    let (_, pairs) = error
        .split_once("collision clearance rejects 100.0 % (")
        .expect(&error);
    let (pairs, _) = pairs.split_once(')').expect(&error);
    assert!(pairs.contains("bunker"), "{error}");
    assert!(pairs.contains(" in 100.0 %"), "{error}");
    assert!(pairs.split(", ").count() <= 5, "{error}");
}
