//! The calibrated robot as MJCF and URDF: read again it stands and bends as the identified one, and what was not
//! identified stays as it was written.

use std::fmt::Write as _;

use elastocal::mujoco::{Model, ModelCalibration, State};
use elastocal::numeric::random::generator;
use elastocal::parameter::{Axis, ElasticArm, ParameterKind, ParameterSet};
use elastocal::robot::{EquilibriumSolver, SerialChain, Tool};
use elastocal::workflow::export::calibration;
use nalgebra::Vector3;
use rand::RngExt;
use serde_json::Value;

use crate::random_models::{Features, random_model};
use crate::support::{Workplace, force, list, number, numbers};

/// An arm as its model says, with a site as its tool, and MuJoCo's identifiers of its joints.
fn arm_of(model: &Model, site: &str) -> ElasticArm {
    let chain = SerialChain::from_model(model).expect("a serial arm");
    let compliance = (chain.joints.iter())
        .map(|joint| joint.model_compliance_rad_per_nm.expect("it is elastic"))
        .collect();
    let tool = SerialChain::tool(model, site).expect("a site");
    ElasticArm::new(chain, compliance, vec![tool])
}

/// Everything that can be unknown about an arm, with values at random.
fn unknowns(arm: &ElasticArm, seed: u64) -> (ParameterSet, Vec<f64>) {
    let mut random = generator(1717, seed);
    let mut kinds = ParameterKind::all_of(arm);
    for (link, joint) in arm.chain.joints.iter().enumerate() {
        if joint.mass_kg > 0.0 {
            kinds.push(ParameterKind::LinkMass { link });
            kinds.extend(Axis::ALL.map(|axis| ParameterKind::LinkCentre { link, axis }));
        }
    }
    let set = ParameterSet::new(arm, kinds.into_iter().map(|kind| (kind, None))).expect("a set");
    let values = set.parameters().iter().map(|parameter| {
        let draw: f64 = random.random_range(-1.0..=1.0);
        match parameter.kind {
            ParameterKind::JointCompliance { .. } | ParameterKind::SpringStiffness { .. } => {
                parameter.nominal * (1.0 + 0.3 * draw)
            }
            _ => parameter.nominal + 0.03 * draw,
        }
    });
    let values = values.collect();
    (set, values)
}

/// How far a tool of an arm and a site of a model lie apart in configurations at random, unloaded and rigid, as MuJoCo
/// sees the model (m).
fn apart(arm: &ElasticArm, model: &Model, place: &dyn Fn(&State) -> Vector3<f64>) -> f64 {
    let mut random = generator(1718, 0);
    let mut state = State::new(model);
    let mut worst: f64 = 0.0;
    for _ in 0..20 {
        let commanded: Vec<f64> = (arm.chain.joints.iter())
            .map(|joint| match joint.drive.passive_at {
                Some(rest) => rest,
                None => random.random_range(-1.5..=1.5),
            })
            .collect();
        let standing: Vec<f64> = (commanded.iter().zip(&arm.zero_rad))
            .map(|(q, zero)| q + zero)
            .collect();
        let ours = arm.chain.at(&arm.tools[0]).state(&standing).tool_position;
        state.move_to(&commanded);
        worst = worst.max((ours - place(&state)).norm());
    }
    worst
}

/// How differently two arms stand under gravity and a load (m).
fn bent_apart(
    arm: &ElasticArm,
    (chain, tool): (&SerialChain, &Tool),
    force_n: Vector3<f64>,
) -> Option<f64> {
    let load = force(force_n);
    let compliance: Vec<f64> = (chain.joints.iter())
        .map(|joint| joint.model_compliance_rad_per_nm.expect("it is elastic"))
        .collect();
    let commanded: Vec<f64> = (arm.chain.joints.iter().enumerate())
        .map(|(index, joint)| joint.drive.passive_at.unwrap_or(0.3 - 0.2 * index as f64))
        .collect();
    let standing: Vec<f64> = (commanded.iter().zip(&arm.zero_rad))
        .map(|(q, zero)| q + zero)
        .collect();
    let mut one = EquilibriumSolver::new(arm.chain.len());
    let mut other = EquilibriumSolver::new(chain.len());
    one.solve(
        &mut arm.chain.at(&arm.tools[0]),
        &arm.compliance_rad_per_nm,
        &standing,
        &load,
    )
    .ok()?;
    other
        .solve(&mut chain.at(tool), &compliance, &commanded, &load)
        .expect("it rests, too");
    Some((one.state().tool_position - other.state().tool_position).norm())
}

#[test]
fn whatever_is_identified_comes_back() {
    let place = Workplace::new();
    let (mut bent, folder) = (0, place.path("out"));
    std::fs::create_dir(&folder).expect("a folder");
    for seed in 0..40 {
        let (mjcf, _, _, force_n) = random_model(seed, Features::Belief);
        place.write("arm.xml", &mjcf);
        let model = Model::load(&place.path("arm.xml")).expect("a model");
        let nominal = arm_of(&model, "tool");
        let (set, values) = unknowns(&nominal, seed);
        let arm = set.apply(&nominal, &values);
        let written = model
            .calibrated_mjcf(&calibration(&nominal, &arm), &folder)
            .expect("it can be written");
        assert!(
            written.not_expressed.is_empty(),
            "{:?}",
            written.not_expressed
        );
        place.write("out/arm.xml", &written.text);
        let again = Model::load(&place.path("out/arm.xml")).expect("MuJoCo takes it");
        let site = again.site("tool").expect("a site");
        let off_m = apart(&arm, &again, &|state| state.site(site).0);
        assert!(off_m < 1e-12, "seed {seed}: {off_m:e} m\n{}", written.text);
        let chain = SerialChain::from_model(&again).expect("a serial arm");
        let tool = SerialChain::tool(&again, "tool").expect("a site");
        if let Some(off_m) = bent_apart(&arm, (&chain, &tool), force_n) {
            assert!(
                off_m < 1e-10,
                "seed {seed}: bent {off_m:e} m\n{}",
                written.text
            );
            bent += 1;
        }
    }
    assert!(bent > 25, "{bent}");
}

/// Three joints in one body, one in another inside two frames, classes of defaults, a part that is included with a mesh
/// of its own, degrees, and Euler angles in an order of their own.
fn written_by_hand(place: &Workplace) {
    for folder in ["robot", "robot/parts", "elsewhere"] {
        std::fs::create_dir(place.path(folder)).expect("a folder");
    }
    place.write(
        "robot/parts/hand.xml",
        "<mujocoinclude>\n  <!-- the hand -->\n  <body name=\"hand\" pos=\"0 0 0.4\" euler=\"10 20 30\">\n    <joint name=\"wrist\" axis=\"1 0 0\"/>\n    <geom type=\"mesh\" mesh=\"wedge\" mass=\"2\"/>\n    <site name=\"tip\" pos=\"0.1 0 0.2\" axisangle=\"0 1 0 90\"/>\n  </body>\n</mujocoinclude>\n",
    );
    place.write(
        "robot/parts/wedge.obj",
        "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n",
    );
    place.write(
        "robot/arm.xml",
        r#"<?xml version="1.0"?>
<!-- by hand -->
<mujoco model="by hand">
  <compiler angle="degree" eulerseq="zyx" meshdir="parts" autolimits="true"/>
  <default>
    <joint range="-170 170"/>
    <default class="soft"><position kp="2e5" inheritrange="1"/></default>
    <default class="held"><joint ref="15"/></default>
  </default>
  <asset><mesh name="wedge" file="wedge.obj"/></asset>
  <worldbody>
    <frame pos="0.1 0 0" euler="30 0 0">
      <frame pos="0 0 0.3" zaxis="0.1 0.2 1">
        <body name="base" childclass="held">
          <inertial pos="0 0 0.1" mass="20" diaginertia="1 1 1"/>
          <joint name="turn" axis="0 0 1"/>
          <joint name="lean" axis="0 1 0" pos="0 0 0.1"/>
          <body name="upper" pos="0.1 0 0.5" xyaxes="1 0 0 0 1 1">
            <geom type="capsule" size="0.05" fromto="0 0 0 0 0 0.3" mass="9"/>
            <joint name="bend" axis="0 1 0" class="main"/>
            <include file="parts/hand.xml"/>
          </body>
        </body>
      </frame>
    </frame>
  </worldbody>
  <actuator>
    <position class="soft" joint="turn"/>
    <position class="soft" joint="lean" kp="3e5"/>
    <general joint="bend" gear="2" gainprm="1e5" biastype="affine" biasprm="20 -1e5 -10"/>
    <position class="soft" joint="wrist"/>
  </actuator>
</mujoco>
"#,
    );
    let mut plan =
        String::from("q1_deg,q2_deg,q3_deg,q4_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats\n");
    for turn in 0..12 {
        let angle = |index: i32| (turn * 37 + index * (turn + 50)) % 120 - 60;
        let _ = writeln!(
            plan,
            "{},{},{},{},0,{},-300,0,0,0,1",
            angle(1),
            angle(2),
            angle(3),
            angle(4),
            100 * (turn % 3)
        );
    }
    place.write("plan.csv", plan);
}

const SCENARIO: &str = r#"
[robot]
model = "MODEL"
calibration_site = "reflector"
machining_site = "tip"
parameters = ["turn", "lean", "bend", "wrist"]

TOOLS

[instrument]
sigma_mm = 0.02
sigma_of = "deflection"

[[uncertainty]]
kind = "link_position"
std_mm = 0.5
joints = ["turn", "lean", "bend", "wrist"]

[[uncertainty]]
kind = "link_rotation"
std_mrad = 1
joints = ["turn", "lean", "bend", "wrist"]

[[uncertainty]]
kind = "joint_zero"
std_mrad = 2

[[uncertainty]]
kind = "tool_position"
std_mm = 1

[[uncertainty]]
kind = "link_mass"
std_relative = 0.1

[[uncertainty]]
kind = "load_scale"
std_relative = 0.02

[[test_pose]]
q_deg = [10, 20, 30, 40]
force_n = [0, 100, -200]

[load]
kind = "any"
force_max_n = 400

[design]
experiments = 4
"#;

const TOOLS: &str = "[[robot.tool]]\nname = \"reflector\"\non = \"tip\"\nposition_mm = [10, 20, 30]\nrpy_deg = [10, 80, 5]\n\n[[robot.payload]]\non = \"hand\"\nmass_kg = 3\ncentre_mm = [10, 0, 20]";

fn identified(place: &Workplace) -> Value {
    written_by_hand(place);
    place.write(
        "a.toml",
        SCENARIO
            .replace("MODEL", "robot/arm.xml")
            .replace("TOOLS", TOOLS),
    );
    place.done("measure a.toml --plan plan.csv --measurements-out m.csv --quiet");
    let outcome =
        place.run("identify a.toml --measurements m.csv --identified-out i.json --json --quiet");
    outcome.json()
}

#[test]
fn what_was_not_identified_stays_as_it_was() {
    let place = Workplace::new();
    let identified = identified(&place);
    let outcome = place.run(
        "export a.toml --identified i.json --model-out elsewhere/calibrated.xml --json --quiet",
    );
    assert!([Some(0), Some(3)].contains(&outcome.code), "{outcome:?}");
    let json = outcome.json();
    for key in ["place_difference_mm", "deflection_difference_mm"] {
        assert!(number(&json[key]) < 1e-9, "{json}");
    }
    let said = json["not_expressed"].to_string();
    assert!(said.contains("load.scale = "), "{said}");
    assert_eq!(
        json["to_leave_out"],
        serde_json::json!(["[[robot.tool]]", "[[robot.payload]]"])
    );
    let text = place.read("elsewhere/calibrated.xml");
    for kept in [
        "<mujoco model=\"by hand\">",
        "<default class=\"held\">",
        "<mesh name=\"wedge\"",
        "<joint name=\"bend\"",
    ] {
        assert!(text.contains(kept), "{kept} is gone:\n{text}");
    }
    assert!(text.contains("meshdir=\"../robot/parts\""), "{text}");
    assert!(!text.contains("<include"), "{text}");
    // The metadata tell what the identification says.
    let document = kept_in(&text);
    let parameters: Value = serde_json::from_str(&document("elastocal_parameters")).expect("JSON");
    let parameters = parameters.as_array().expect("a list").clone();
    let others = list(&identified["uncertain"]).len();
    assert_eq!(parameters.len(), 4 + others);
    let covariance: Vec<Vec<f64>> =
        serde_json::from_str(&document("elastocal_covariance")).expect("JSON");
    let of_all = list(&identified["covariance_of_all"]);
    assert_eq!(covariance.len(), parameters.len());
    let of_all: Vec<Vec<f64>> = of_all.iter().map(numbers).collect();
    for (row, kept) in covariance.iter().enumerate() {
        for (column, kept) in kept.iter().enumerate() {
            // Correlations are kept: a covariance near zero is a difference.
            let scale = (covariance[row][row] * covariance[column][column]).sqrt();
            assert!(
                (kept - of_all[row][column]).abs() <= 1e-14 * scale,
                "{row} {column}: {kept}"
            );
        }
    }
    assert!(document("elastocal_provenance").contains("scenario_sha256"));
}

/// What the scenario locks is fixed in the file, with what acts on it alone: read without the scenario, it has the robot's other joints,
/// its check is of that, and what is printed stays with the model.
#[test]
fn locked_joints_are_fixed() {
    for (locked, value) in [("turn", -30), ("lean", 25), ("bend", 40)] {
        let place = Workplace::new();
        written_by_hand(&place);
        let arm = place.read("robot/arm.xml").replace(
            "</actuator>",
            &format!(
                "</actuator><sensor><jointpos joint=\"{locked}\"/></sensor><keyframe><key qpos=\"0 0 0 0\"/></keyframe>"
            ),
        );
        place.write("robot/arm.xml", arm);
        let scenario = SCENARIO
            .replace(&format!("\"{locked}\", "), "")
            .replace("q_deg = [10, ", "q_deg = [");
        let lock = format!("locked_deg = {{ {locked} = {value} }}\n{TOOLS}");
        place.write(
            "a.toml",
            (scenario.replace("MODEL", "robot/arm.xml")).replace("TOOLS", &lock),
        );
        for command in [
            "plan a.toml --no-proof --plan-out p.csv",
            "measure a.toml --plan p.csv --measurements-out m.csv",
            "identify a.toml --measurements m.csv --identified-out i.json",
        ] {
            let outcome = place.run(&format!("{command} --quiet"));
            assert!([Some(0), Some(3)].contains(&outcome.code), "{outcome:?}");
        }
        let outcome =
            place.run("export a.toml --identified i.json --model-out out.xml --json --quiet");
        let json = outcome.json();
        for key in ["place_difference_mm", "deflection_difference_mm"] {
            assert!(number(&json[key]) < 1e-9, "{json}");
        }
        let said = format!("{locked} is no joint of it: its body is fixed at {value} deg");
        assert!(json["not_expressed"].to_string().contains(&said), "{json}");
        assert!(
            json["not_expressed"].to_string().contains("keyframes"),
            "{json}"
        );
        let leave_out = list(&json["to_leave_out"]);
        assert!(
            leave_out.iter().any(|key| key == "robot.locked_deg"),
            "{json}"
        );
        let kept = kept_in(&place.read("out.xml"))("elastocal_not_expressed");
        let kept: Value = serde_json::from_str(&kept).expect("JSON");
        assert_eq!(kept, json["not_expressed"]);
        let again = Model::load(&place.path("out.xml")).expect("MuJoCo takes it");
        assert_eq!(again.joints(), 3);
        place.write(
            "b.toml",
            (scenario.replace("MODEL", "out.xml")).replace("TOOLS", ""),
        );
        place.done("check b.toml --quiet");
    }
}

/// The data of what a model keeps by its name.
fn kept_in(text: &str) -> impl Fn(&str) -> String {
    move |name| {
        let start = text.find(&format!("name=\"{name}\"")).expect("it is there");
        let data = &text[start + name.len() + 7..];
        // MuJoCo writes texts with quotes as character data.
        match data.strip_prefix("><![CDATA[") {
            Some(data) => data[..data.find("]]></text>").expect("an end")].to_owned(),
            None => data.split('"').nth(1).expect("data").to_owned(),
        }
    }
}

#[test]
fn the_written_model_is_a_scenario_s_again() {
    let place = Workplace::new();
    identified(&place);
    place.run("export a.toml --identified i.json --model-out b.xml --quiet");
    place.write(
        "b.toml",
        SCENARIO.replace("MODEL", "b.xml").replace("TOOLS", ""),
    );
    let check = place.json("check b.toml");
    let record = place.parsed("i.json");
    let applied = list(&record["compliance_applied_rad_per_nm"]);
    for (joint, applied) in list(&check["robot"]["joints"]).iter().zip(applied) {
        let [now, then] =
            [&joint["compliance_rad_per_nm"], applied].map(|each| each.as_f64().expect("a number"));
        assert!((now / then - 1.0).abs() < 1e-14, "{joint} {then}");
    }
    // Identified and exported once more, it keeps what the last identification said alone.
    place.done("measure b.toml --plan plan.csv --measurements-out m2.csv --quiet");
    place.run("identify b.toml --measurements m2.csv --identified-out i2.json --quiet");
    place.run("export b.toml --identified i2.json --model-out c.xml --quiet");
    let again = place.read("c.xml");
    for once in [
        "elastocal_provenance",
        "elastocal_covariance",
        "elastocal_payload_1",
        "name=\"reflector\"",
    ] {
        assert_eq!(again.matches(once).count(), 1, "{once}");
    }
    // What is in it already is not mounted twice.
    for (kept, said) in [
        (TOOLS, "it has a site named \"reflector\" already"),
        (
            TOOLS.split_once("\n\n").expect("two tables").1,
            "leave [[robot.payload]] out",
        ),
    ] {
        place.write(
            "d.toml",
            SCENARIO.replace("MODEL", "b.xml").replace("TOOLS", kept),
        );
        place.refused("check d.toml --quiet").says(said);
    }
}

const URDF: &str = r#"<?xml version="1.0"?>
<robot name="small">
  <!-- the maker's -->
  <link name="base_link"><visual><geometry><mesh filename="package://small/base.dae"/></geometry></visual></link>
  <link name="one"><inertial><origin xyz="0 0 0.1"/><mass value="8"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="two"><inertial><mass value="4"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="three"><inertial><mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="flange"/>
  <joint name="j1" type="revolute"><parent link="base_link"/><child link="one"/><origin xyz="0 0 0.3" rpy="0 0 0.1"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="100" velocity="2"/></joint>
  <joint name="j2" type="revolute"><parent link="one"/><child link="two"/><origin xyz="0.1 0 0.2" rpy="0.2 1.5707963267948966 0"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="100" velocity="2"/></joint>
  <joint name="j3" type="continuous"><parent link="two"/><child link="three"/><axis xyz="0 0.6 0.8"/></joint>
  <joint name="tip" type="fixed"><parent link="three"/><child link="flange"/><origin xyz="0 0.4 0.1"/></joint>
</robot>
"#;

/// An arm with all of its geometry at random, a calibration that makes it so, and the tool on its flange.
fn urdf_arm(place: &Workplace) -> (Model, ElasticArm, ModelCalibration) {
    place.write("small.urdf", URDF);
    let model = Model::load(&place.path("small.urdf"))
        .expect("a model")
        .without_actuators();
    let chain = SerialChain::from_model(&model).expect("an arm");
    let flange = (1..model.bodies())
        .find(|&body| model.body_name(body) == "flange")
        .expect("a link");
    let tool = SerialChain::on_body(&model, flange).expect("it moves");
    let nominal = ElasticArm::new(chain, vec![1e-5, 2e-5, 3e-5], vec![tool]);
    let (set, mut values) = unknowns(&nominal, 3);
    // The flange is a link of the maker's, not a tool that is mounted.
    for (parameter, value) in set.parameters().iter().zip(&mut values) {
        if matches!(
            parameter.kind,
            ParameterKind::ToolPosition { .. } | ParameterKind::ToolRotation { .. }
        ) {
            *value = 0.0;
        }
    }
    let arm = set.apply(&nominal, &values);
    let mut calibration = calibration(&nominal, &arm);
    calibration.sites.clear();
    (model, arm, calibration)
}

#[test]
fn a_description_is_written_with_stiffnesses() {
    let place = Workplace::new();
    let (model, arm, calibration) = urdf_arm(&place);
    // With the stiffnesses that a description does not have.
    let written = model
        .calibrated_mjcf(&calibration, &place.path(""))
        .expect("it can be written");
    place.write("again.xml", &written.text);
    let again = Model::load(&place.path("again.xml")).expect("MuJoCo takes it");
    let flange = (1..again.bodies())
        .find(|&body| again.body_name(body) == "flange")
        .expect("a body");
    let chain = SerialChain::from_model(&again).expect("an arm whose joints are held");
    let tool = SerialChain::on_body(&again, flange).expect("it moves");
    let off_m =
        bent_apart(&arm, (&chain, &tool), Vector3::new(10.0, -20.0, 30.0)).expect("it rests");
    assert!(off_m < 1e-10, "{off_m:e} m\n{}", written.text);
}

#[test]
fn what_cannot_be_written_is_refused_by_name() {
    let place = Workplace::new();
    identified(&place);
    for (name, said) in [
        ("calibrated.sdf", "end it in .xml"),
        ("calibrated.urdf", "URDF has no stiffnesses"),
        ("robot/arm.xml", "robot/arm.xml"),
        ("missing/a.xml", "missing/a.xml"),
    ] {
        let before = place.read("robot/arm.xml");
        let refused = place.run(&format!(
            "export a.toml --identified i.json --model-out {name} --quiet"
        ));
        let refused = refused.ends_with(1);
        refused.says(said);
        assert_eq!(place.read("robot/arm.xml"), before);
    }
}

/// A body that is one of several copies has no place of its own in the author's file, and one in the written one.
#[test]
fn copies_are_written_out() {
    let place = Workplace::new();
    written_by_hand(&place);
    let copied = place.read("robot/arm.xml").replace(
        "<include file=\"parts/hand.xml\"/>",
        "<replicate count=\"1\"><body name=\"hand\"><joint name=\"wrist\"/><geom size=\"0.1\" mass=\"2\"/><site name=\"tip\" pos=\"0 0 0.2\"/></body></replicate>",
    ).replace("joint=\"wrist\"", "joint=\"wrist0\"");
    place.write("robot/copied.xml", copied);
    let model = Model::load(&place.path("robot/copied.xml")).expect("a model");
    let nominal = arm_of(&model, "tip0");
    let (set, values) = unknowns(&nominal, 1);
    let arm = set.apply(&nominal, &values);
    let written = model
        .calibrated_mjcf(&calibration(&nominal, &arm), &place.path(""))
        .expect("it can be written");
    place.write("b.xml", &written.text);
    let again = Model::load(&place.path("b.xml")).expect("MuJoCo takes it");
    let site = again.site("tip0").expect("a site");
    let off_m = apart(&arm, &again, &|state| state.site(site).0);
    assert!(off_m < 1e-12, "{off_m:e} m\n{}", written.text);
}
