//! The recordings, opened with the tools that their users have: MCAP with the mcap crate's reader,
//! .rrd with the rerun program.
#![allow(clippy::expect_used, reason = "tests fail by panicking")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use elastocal::calibration::calibrate;
use elastocal::plan::{Plan, read_plan};
use elastocal::record::run::RunMessage;
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use elastocal::testbed::VirtualRobot;
use elastocal::view::mcap_file::write_mcap;
use elastocal::view::recording::Recording;
use elastocal::view::rerun_file::write_rerun;
use elastocal::view::stills::Stills;
use foxglove::Decode;
use foxglove::messages::{
    FrameTransform, FrameTransforms, JointState, JointStates, SceneEntity, SceneEntityDeletion,
    SceneUpdate, Timestamp, TriangleListPrimitive,
};
use mcap::MessageStream;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde_json::{Value, json};

use crate::support::{list, project, repeated, scenario, table4};

fn recorded(scenario: &Scenario, plans: &[(&str, Plan)]) -> Recording {
    let calibrations: Vec<RunMessage> = plans
        .iter()
        .map(|(name, plan)| {
            let (task, truth, seed) = (&scenario.task, &scenario.truth, scenario.seed);
            let made = calibrate(task, truth, plan, seed, 0).expect("everything can be measured");
            RunMessage::of_deflections(task, truth, seed, name, &made).expect("it works")
        })
        .collect();
    Recording::new(scenario, &calibrations).expect("what was measured can be recorded")
}

/// The plan of three experiments, the second measured twice.
fn plan_with_a_repeat() -> Plan {
    let mut plan = table4(3);
    plan.experiments[1].repeats = 2;
    plan
}

/// A message of an MCAP file, checked against its schema.
pub struct Message {
    pub topic: String,
    pub time_ns: u64,
    pub json: Value,
}

pub fn read_mcap(bytes: &[u8]) -> Vec<Message> {
    MessageStream::new(bytes)
        .expect("an MCAP file")
        .map(|message| {
            let message = message.expect("whole");
            let schema = message
                .channel
                .schema
                .clone()
                .expect("every channel has a schema");
            let topic = message.channel.topic.clone();
            let json = if message.channel.message_encoding == "json" {
                assert_eq!(schema.encoding, "jsonschema");
                let schema: Value = serde_json::from_slice(&schema.data).expect("JSON");
                let json: Value = serde_json::from_slice(&message.data).expect("JSON");
                check(&schema, &json, &topic);
                json
            } else {
                assert_eq!(message.channel.message_encoding, "protobuf");
                of_foxglove(&schema.name, &message.data)
            };
            Message {
                topic,
                time_ns: message.log_time,
                json,
            }
        })
        .collect()
}

/// A message of one of Foxglove's types, as far as it is looked at here.
fn of_foxglove(name: &str, data: &[u8]) -> Value {
    match name {
        "foxglove.JointStates" => {
            let message = JointStates::decode(data).expect("whole");
            let joint = |each: &JointState| json!({"name": each.name, "position": each.position});
            json!({"joints": message.joints.iter().map(joint).collect::<Vec<_>>()})
        }
        "foxglove.FrameTransforms" => {
            let message = FrameTransforms::decode(data).expect("whole");
            let transform = |each: &FrameTransform| {
                let at = each.translation.as_ref().expect("a translation");
                let turn = each.rotation.as_ref().expect("a rotation");
                json!({
                    "parent_frame_id": each.parent_frame_id,
                    "child_frame_id": each.child_frame_id,
                    "translation": {"x": at.x, "y": at.y, "z": at.z},
                    "rotation": {"x": turn.x, "y": turn.y, "z": turn.z, "w": turn.w},
                })
            };
            json!({"transforms": message.transforms.iter().map(transform).collect::<Vec<_>>()})
        }
        "foxglove.SceneUpdate" => {
            let message = SceneUpdate::decode(data).expect("whole");
            let deletion = |each: &SceneEntityDeletion| {
                let sec = each.timestamp.as_ref().map(Timestamp::sec);
                json!({"id": each.id, "timestamp": {"sec": sec}})
            };
            let surface = |each: &TriangleListPrimitive| {
                let points: Vec<f64> = each.points.iter().map(|point| point.x).collect();
                json!({"points": points, "indices": each.indices})
            };
            let entity = |each: &SceneEntity| {
                json!({
                    "frame_id": each.frame_id,
                    "lines": each.lines.iter().map(|line| line.thickness).collect::<Vec<_>>(),
                    "triangles": each.triangles.iter().map(surface).collect::<Vec<_>>(),
                })
            };
            json!({
                "deletions": message.deletions.iter().map(deletion).collect::<Vec<_>>(),
                "entities": message.entities.iter().map(entity).collect::<Vec<_>>(),
            })
        }
        _ => panic!("unknown type {name}"),
    }
}

/// Checks a value against a JSON Schema of the kind that appears here; another keyword than these
/// fails, so that nothing is left unchecked.
fn check(schema: &Value, value: &Value, place: &str) {
    let Value::Object(schema) = schema else {
        panic!("{place}: not a schema: {schema}");
    };
    // What may be null has no keys then.
    let may_be_null = (schema.get("type").and_then(Value::as_array))
        .is_some_and(|names| names.contains(&Value::from("null")));
    if may_be_null && value.is_null() {
        return;
    }
    for (keyword, rule) in schema {
        let number = |value: &Value| value.as_f64().expect("a number");
        let allowed = match keyword.as_str() {
            "type" => {
                let one = std::slice::from_ref(rule);
                let names = rule.as_array().map_or(one, Vec::as_slice);
                names
                    .iter()
                    .any(|name| has_type(value, name.as_str().unwrap_or_default()))
            }
            "required" => rule.as_array().is_some_and(|keys| {
                keys.iter()
                    .all(|key| value.get(key.as_str().unwrap_or_default()).is_some())
            }),
            "properties" => {
                let rules = rule.as_object().expect("properties are an object");
                for (key, each) in value.as_object().expect("an object") {
                    let rule = rules.get(key);
                    let rule = rule.unwrap_or_else(|| panic!("{place}.{key}: not in the schema"));
                    check(rule, each, &format!("{place}.{key}"));
                }
                true
            }
            // One schema for all, or one for each place.
            "items" if rule.is_array() => {
                let rules = rule.as_array().expect("an array");
                for (rule, each) in rules.iter().zip(value.as_array().into_iter().flatten()) {
                    check(rule, each, &format!("{place}[]"));
                }
                true
            }
            "items" => {
                for each in value.as_array().into_iter().flatten() {
                    check(rule, each, &format!("{place}[]"));
                }
                true
            }
            // One of words that are described one by one.
            "oneOf" => {
                let word = |each: &Value| each.get("const").expect("a word") == value;
                rule.as_array().expect("words").iter().any(word)
            }
            "minItems" => value
                .as_array()
                .is_none_or(|v| Some(v.len() as u64) >= rule.as_u64()),
            "maxItems" => value
                .as_array()
                .is_none_or(|v| Some(v.len() as u64) <= rule.as_u64()),
            "minimum" => value.as_f64().is_none_or(|value| value >= number(rule)),
            "maximum" => value.as_f64().is_none_or(|value| value <= number(rule)),
            "$schema" | "title" | "description" | "format" | "default" => true,
            _ => panic!("{place}: keyword {keyword} is not checked"),
        };
        assert!(allowed, "{place}: {keyword} {rule} does not allow {value}");
    }
}

fn has_type(value: &Value, name: &str) -> bool {
    match name {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "null" => value.is_null(),
        "number" => value.is_number(),
        "integer" => value.is_i64() || value.is_u64(),
        _ => panic!("unknown type {name}"),
    }
}

fn on<'a>(messages: &'a [Message], topic: &'a str) -> impl Iterator<Item = &'a Message> {
    messages
        .iter()
        .filter(move |message| message.topic == topic)
}

fn numbers(json: &Value) -> Vec<f64> {
    let values = json.as_array().expect("an array").iter();
    values
        .map(|value| value.as_f64().expect("a number"))
        .collect()
}

/// The pose of a frame in a message on /tf.
fn pose(transforms: &Value, child: &str) -> Isometry3<f64> {
    let transform = transforms["transforms"]
        .as_array()
        .and_then(|all| all.iter().find(|each| each["child_frame_id"] == child))
        .unwrap_or_else(|| panic!("no frame {child}"));
    assert_eq!(transform["parent_frame_id"], "world");
    let part = |kind: &str, axis: &str| transform[kind][axis].as_f64().expect("a number");
    let [x, y, z] = ["x", "y", "z"].map(|axis| part("translation", axis));
    let [i, j, k, w] = ["x", "y", "z", "w"].map(|axis| part("rotation", axis));
    Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k)),
    )
}

#[test]
fn mcap_holds_the_calibration_in_messages_that_meet_their_schemas() {
    let scenario = scenario("klimchik2012");
    let plan = plan_with_a_repeat();
    let recording = recorded(&scenario, &[("first", plan.clone()), ("second", table4(2))]);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.mcap");
    write_mcap(&path, &recording).expect("it can be written");
    let bytes = std::fs::read(&path).expect("it is there");
    let messages = read_mcap(&bytes);

    let mut counts = BTreeMap::new();
    for message in &messages {
        *counts.entry(message.topic.as_str()).or_insert(0) += 1;
    }
    // Steps: 3 experiments and the test pose twice, then 2 and the same.
    let expected = BTreeMap::from([
        ("/provenance", 1),
        ("/plan", 2),
        ("/steps", 9),
        ("/measurements", 4 + 2),
        ("/identification", 2),
        ("/test_poses", 2),
        ("/tf", 9),
        // Without a load and under it.
        ("/joint_states", 18),
        // The arm once, a change of tools four times, and arrows in every step.
        ("/scene", 1 + 4 + 9),
    ]);
    assert_eq!(counts, expected);

    let planned = on(&messages, "/plan").next().expect("there is");
    assert_eq!(planned.json["plan"][1]["repeats"], 2);
    for (measured, given) in on(&messages, "/measurements").zip(repeated(&plan)) {
        for (q, given) in numbers(&measured.json["q_deg"])
            .iter()
            .zip(&given.configuration_rad)
        {
            assert!((q.to_radians() - given).abs() < 1e-12);
        }
        assert_eq!(measured.json["wrench"][2], -2500.0);
        let near = numbers(&measured.json["deflection_mm"]);
        let exact = numbers(&measured.json["true_deflection_mm"]);
        for (near, exact) in near.iter().zip(exact) {
            assert!((near - exact).abs() < 6.0 * 0.03, "{near} against {exact}");
        }
    }
    // A minute to go there, as many readings without a load, ten minutes to hang it, and half a minute a reading.
    let minutes: Vec<_> = on(&messages, "/measurements")
        .map(|each| each.time_ns as f64 / 60e9)
        .collect();
    assert_eq!(minutes[..4], [12.0, 24.5, 25.0, 37.0]);
    let loaded = on(&messages, "/joint_states").skip(1).step_by(2);
    for (joints, step) in loaded.zip(on(&messages, "/steps")) {
        assert!(joints.time_ns > step.time_ns);
        let joints = list(&joints.json["joints"]);
        for (joint, deg) in joints.iter().zip(numbers(&step.json["q_loaded_deg"])) {
            let position = joint["position"].as_f64().expect("a number");
            assert!((position.to_degrees() - deg).abs() < 1e-9, "{joint}");
        }
    }
    assert_layout_fits(&bytes, &messages);
    let identified = &on(&messages, "/identification")
        .next()
        .expect("there is")
        .json;
    assert_eq!(identified["rank"], 5);
    assert_eq!(numbers(&identified["compliance_rad_per_nm"]).len(), 5);
    let achieved = &on(&messages, "/test_poses").next().expect("there is").json;
    let [before, after] =
        ["uncompensated_mm", "residual_mm"].map(|key| achieved[key].as_f64().expect("a number"));
    assert!(after < before / 10.0, "{before} to {after}");

    let summary = mcap::Summary::read(&bytes)
        .expect("whole")
        .expect("there is a summary");
    let [index] = summary.metadata_indexes.as_slice() else {
        panic!("one record of metadata");
    };
    let provenance = mcap::read::metadata(&bytes, index).expect("readable");
    assert_eq!(provenance.metadata["scenario_sha256"], scenario.sha256);
    assert_eq!(provenance.metadata["seed"], scenario.seed.to_string());
}

/// The frames of the tool's body, with the tool's place in it, against the virtual robot.
#[test]
fn mcap_frames_are_where_mujoco_puts_the_tool() {
    let scenario = scenario("klimchik2012");
    let plan = table4(3);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.mcap");
    write_mcap(&path, &recorded(&scenario, &[("plan", plan.clone())])).expect("it can be written");
    let messages = read_mcap(&std::fs::read(&path).expect("it is there"));
    let robot = &scenario.truth.robot;
    let tool = &scenario.task.belief.calibration_tool.name;
    let mut virtual_robot = VirtualRobot::new(robot, tool).expect("the site exists");
    let (body, body_from_tool) = robot
        .model
        .site_body(robot.model.site(tool).expect("there is"));
    let body = robot.model.body_name(body);
    for (message, experiment) in on(&messages, "/tf").zip(&plan.experiments) {
        for (arm, load) in [("unloaded", &Load::NONE), ("loaded", &experiment.load)] {
            let (place, axes, _) = virtual_robot
                .rest(&experiment.configuration_rad, load)
                .expect("stable");
            let pose = pose(&message.json, &format!("{arm}/{body}")) * body_from_tool;
            assert!((pose.translation.vector - place).amax() < 1e-12);
            let rotation = pose.rotation.to_rotation_matrix();
            assert!((rotation.matrix() - axes).amax() < 1e-12);
        }
    }
}

#[test]
fn mcap_scene_is_drawn_in_frames_that_exist() {
    let scenario = scenario("kr270");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.mcap");
    write_mcap(&path, &recorded(&scenario, &[("plan", table4(2))])).expect("it can be written");
    let messages = read_mcap(&std::fs::read(&path).expect("it is there"));
    let mut frames = BTreeSet::from(["world".to_owned()]);
    for message in on(&messages, "/tf") {
        for transform in list(&message.json["transforms"]) {
            frames.insert(
                transform["child_frame_id"]
                    .as_str()
                    .expect("a name")
                    .to_owned(),
            );
        }
    }
    let mut drawn = BTreeSet::new();
    let mut lines = 0;
    for message in on(&messages, "/scene") {
        for entity in list(&message.json["entities"]) {
            let frame = entity["frame_id"].as_str().expect("a name");
            assert!(frames.contains(frame), "no frame {frame}");
            lines += list(&entity["lines"]).len();
            for surface in list(&entity["triangles"]) {
                let points = list(&surface["points"]).len();
                let corners = list(&surface["indices"]);
                assert!(corners.len().is_multiple_of(3) && !corners.is_empty());
                assert!(
                    corners
                        .iter()
                        .all(|corner| corner.as_u64().is_some_and(|corner| corner < points as u64))
                );
                drawn.insert(frame.to_owned());
            }
        }
    }
    for link in ["link_1", "link_6", "calibration_tool", "machining_tool"] {
        assert!(
            drawn.contains(&format!("unloaded/{link}")),
            "{link} is not drawn"
        );
        assert!(
            drawn.contains(&format!("enlarged/{link}")),
            "{link} is not drawn"
        );
    }
    assert_eq!(
        lines, 2,
        "the tracker's line in each experiment, and no other"
    );
    let test_pose = on(&messages, "/steps").nth(2).expect("there is").time_ns / 1_000_000_000;
    let taken_off: Vec<_> = on(&messages, "/scene")
        .flat_map(|message| list(&message.json["deletions"]))
        .filter(|deletion| deletion["timestamp"]["sec"] == test_pose)
        .map(|deletion| deletion["id"].as_str().expect("a name"))
        .collect();
    assert_eq!(
        taken_off,
        ["unloaded/calibration_tool", "enlarged/calibration_tool"]
    );
}

#[test]
fn mcap_is_the_same_to_the_byte_each_time() {
    let scenario = scenario("klimchik2012");
    let folder = tempfile::tempdir().expect("a folder");
    let [first, second] = ["a.mcap", "b.mcap"].map(|name| {
        let path = folder.path().join(name);
        write_mcap(&path, &recorded(&scenario, &[("plan", table4(2))])).expect("it can be written");
        std::fs::read(path).expect("it is there")
    });
    assert!(first == second);
}

#[test]
fn deflections_are_drawn_in_the_right_direction_and_size() {
    let scenario = scenario("klimchik2012");
    let recording = recorded(&scenario, &[("plan", table4(12))]);
    let mut largest = 0.0_f64;
    for (_, _, step) in recording.steps() {
        let drawn: Vector3<f64> = step.arms[2].tool_m - step.arms[0].tool_m;
        let exact = step.did.displacement_m() * step.enlargement;
        // Enlarged turns of joints are not small any more: the tool goes along arcs.
        assert!(
            (drawn - exact).norm() < 0.1 * exact.norm() + 1e-4,
            "{drawn} against {exact}"
        );
        largest = largest.max(drawn.norm());
    }
    assert!((0.1..0.5).contains(&largest), "{largest}");
}

#[test]
fn an_unwritable_place_is_an_error_that_names_it() {
    let scenario = scenario("klimchik2012");
    let recording = recorded(&scenario, &[("plan", table4(2))]);
    let folder = tempfile::tempdir().expect("a folder");
    let missing = folder.path().join("missing");
    for error in [
        write_mcap(&missing.join("run.mcap"), &recording).expect_err("no folder"),
        write_rerun(&missing.join("run.rrd"), &recording).expect_err("no folder"),
    ] {
        assert!(error.to_string().contains("missing"), "{error}");
    }
    let entries = std::fs::read_dir(folder.path()).expect("readable").count();
    assert_eq!(entries, 0, "nothing is left behind");
}

/// The rerun program that tools/install-rerun puts in place, or the user's own.
pub fn rerun_program() -> PathBuf {
    let program =
        std::env::var_os("ELASTOCAL_RERUN").map_or_else(|| project(".rerun/rerun"), PathBuf::from);
    assert!(
        program.is_file(),
        "{} is missing: run `make test`, which installs it with tools/install-rerun",
        program.display()
    );
    program
}

pub fn rerun(arguments: &[&str], path: &Path) -> String {
    let output = Command::new(rerun_program())
        .args(arguments)
        .arg(path)
        .env("RERUN_ANALYTICS", "0")
        .output()
        .expect("rerun starts");
    let text = |bytes| String::from_utf8_lossy(bytes).into_owned();
    assert!(
        output.status.success(),
        "{arguments:?}: {}",
        text(&output.stderr)
    );
    text(&output.stdout)
}

/// The rows of each entity of a recording, static ones included, from `rerun rrd print`.
pub fn rows(printed: &str) -> BTreeMap<String, usize> {
    let mut rows = BTreeMap::new();
    for line in printed.lines().filter(|line| line.starts_with("Chunk(")) {
        let (_, line) = line.split_once(" with ").expect("a chunk has rows");
        let (count, line) = line.split_once(" rows ").expect("a chunk has rows");
        let entity = line.split(" - ").nth(1).expect("a chunk has an entity");
        *rows.entry(entity.to_owned()).or_default() += count.parse::<usize>().expect("a number");
    }
    rows
}

#[test]
fn rerun_reads_the_stream() {
    let scenario = scenario("klimchik2012");
    let recording = recorded(&scenario, &[("plan", plan_with_a_repeat())]);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.rrd");
    write_rerun(&path, &recording).expect("it can be written");
    rerun(&["rrd", "verify"], &path);
    assert!(rerun(&["rrd", "stats"], &path).contains("num_chunks"));

    let rows = rows(&rerun(&["rrd", "print"], &path));
    // Three experiments and the test pose twice.
    let steps = 5;
    for entity in [
        "/world/force",
        "/world/deflection",
        "/world/labels",
        "/text/step",
    ] {
        assert_eq!(rows.get(entity), Some(&steps), "{entity}");
    }
    for link in 1..=6 {
        // A mesh and a transform a step; the loaded arm also has an opacity a step.
        assert_eq!(rows[&format!("/world/robot/link_{link}")], 1 + steps);
        assert_eq!(rows[&format!("/world/loaded/link_{link}")], 1 + 2 * steps);
    }
    for axis in ["x", "y", "z"] {
        for group in ["deflection_mm", "residual_mm"] {
            let entity = format!("/measurements/{group}/{axis}");
            assert_eq!(
                rows[&entity],
                1 + 4,
                "a style and four measurements of {entity}"
            );
        }
    }
    for entity in [
        "/world/surroundings/base",
        "/text/results",
        "/text/overview",
    ] {
        assert_eq!(rows.get(entity), Some(&1), "{entity}");
    }
    assert!(
        !rows.contains_key("/world/tracker_line"),
        "the scenario has no tracker"
    );

    let print = |entity| rerun(&["rrd", "print", "-vvv", "--entity", entity], &path);
    let labels = print("/world/labels");
    assert_eq!(labels.matches("2500 N").count(), 3);
    assert_eq!(labels.matches("333 N").count(), 2);
    assert!(print("/text/results").contains("| joint | compliance ["));

    // Two files of the same recording differ in the numbers of their rows at most.
    let again = folder.path().join("again.rrd");
    write_rerun(&again, &recording).expect("it can be written");
    let again = again.to_str().expect("UTF-8");
    rerun(&["rrd", "compare", "--unordered", again], &path);
}

/// The layout for Foxglove shows topics that there are, each in a panel for its type, and keys that messages have.
fn assert_layout_fits(bytes: &[u8], messages: &[Message]) {
    let text = std::fs::read_to_string(project("docs/foxglove_layout.json")).expect("it is there");
    let layout: Value = serde_json::from_str(&text).expect("JSON");
    let summary = mcap::Summary::read(bytes).expect("whole").expect("there");
    let types: BTreeMap<&str, &str> = (summary.channels.values())
        .map(|each| (&*each.topic, &*each.schema.as_ref().expect("a schema").name))
        .collect();
    let mut shown = BTreeSet::new();
    let panels = layout["configById"].as_object().expect("panels");
    for (panel, config) in panels {
        let topics = config["topics"].as_object().into_iter().flatten();
        let drawn = topics.map(|(topic, _)| (topic.as_str(), "foxglove.SceneUpdate"));
        let paths = config["paths"].as_array().into_iter().flatten();
        let raw = config["topicPath"].as_str();
        for path in paths.filter_map(|each| each["value"].as_str()).chain(raw) {
            let (topic, keys) = path.split_once('.').unwrap_or((path, ""));
            assert!(types.contains_key(topic), "{panel}: {topic}");
            shown.insert(topic);
            // A seventh joint is of other robots, and lengths of absolute readings.
            let is_other = ["joints[6]", ".distance_mm", ".length_"]
                .map(|part| path.contains(part))
                .contains(&true);
            let pointer = format!("/{}", keys.replace(['.', '['], "/").replace(']', ""));
            let has = |each: &Message| keys.is_empty() || each.json.pointer(&pointer).is_some();
            assert!(is_other || on(messages, topic).any(has), "{path}");
        }
        for (topic, of_type) in drawn {
            assert_eq!(types.get(topic), Some(&of_type), "{panel}");
            shown.insert(topic);
        }
    }
    assert!(shown.len() >= 5, "{shown:?}");
    // A 3D panel takes the frames from wherever they are, and joints are a type that other panels know.
    assert_eq!(types["/tf"], "foxglove.FrameTransforms");
    assert_eq!(types["/joint_states"], "foxglove.JointStates");
}

#[test]
fn the_stream_shows_a_gauge_and_no_tracker_where_a_gauge_reads() {
    let scenario = scenario("kr270_gauge");
    let plan = project("scenarios/plans/kr270_gauge_m9.csv");
    let plan = read_plan(&plan, scenario.task.belief.commands()).expect("a plan");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.rrd");
    let steps = plan.experiments.len() + 2;
    write_rerun(&path, &recorded(&scenario, &[("plan", plan.clone())])).expect("written");
    let rows = rows(&rerun(&["rrd", "print"], &path));
    assert_eq!(rows["/world/gauge"], steps);
    assert!(!rows.contains_key("/world/tracker_line"));
    assert!(!rows.contains_key("/world/surroundings/tracker"));
    let sheet = Stills::of_plan(&scenario, &plan)
        .sheet()
        .expect("it can be drawn");
    assert!(!sheet.contains("stroke-dasharray"));
}

#[test]
fn the_stream_shows_the_tracker_that_the_scenario_has() {
    let scenario = scenario("kr270");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.rrd");
    write_rerun(&path, &recorded(&scenario, &[("plan", table4(2))])).expect("it can be written");
    rerun(&["rrd", "verify"], &path);
    let rows = rows(&rerun(&["rrd", "print"], &path));
    assert_eq!(rows["/world/tracker_line"], 4);
    assert_eq!(rows["/world/surroundings/tracker"], 1);
}
