//! The robot as transforms and scene entities.

use nalgebra::{Isometry3, Vector3};

use super::foxglove::{
    ArrowPrimitive, FrameTransform, FrameTransforms, LinePrimitive, SceneEntity,
    SceneEntityDeletion, SceneUpdate, TextPrimitive, Time, TriangleListPrimitive,
};
use crate::view::recording::{Body, RecordedCalibration, Recording, ShownTool, Step};

/// The root of all frames: the robot's base, z up.
const WORLD: &str = "world";
/// The frame of the tool's tip in each of the three arms, beside those of the links.
const TOOL: &str = "tool";
/// The arms: without load, under load true to scale, and with deflections enlarged, as drawn.
const ARMS: [&str; 3] = ["unloaded", "loaded", "enlarged"];

const LOADED_RGBA: [f32; 4] = [0.35, 0.65, 1.0, 0.4];
const FORCE_RGBA: [f32; 4] = [0.9, 0.2, 0.2, 1.0];
const DEFLECTION_RGBA: [f32; 4] = [0.95, 0.7, 0.1, 1.0];
const TRACKER_RGBA: [f32; 4] = [0.15, 0.75, 0.4, 1.0];

fn frame(arm: &str, part: &str) -> String {
    format!("{arm}/{part}")
}

/// The frames of all links and of the tool's tip in a step.
pub(super) fn transforms(recording: &Recording, step: &Step, now: Time) -> FrameTransforms {
    let stances = [&step.unloaded, &step.loaded, &step.enlarged];
    let transforms = ARMS.iter().zip(stances).flat_map(|(arm, stance)| {
        let links = recording.links.iter().zip(&stance.world_from_link);
        let tool = Isometry3::translation(stance.tool_m.x, stance.tool_m.y, stance.tool_m.z);
        links
            .map(|(body, pose)| FrameTransform::new(now, WORLD, frame(arm, &body.name), pose))
            .chain([FrameTransform::new(now, WORLD, frame(arm, TOOL), &tool)])
            .collect::<Vec<_>>()
    });
    FrameTransforms {
        transforms: transforms.collect(),
    }
}

/// All that is there from the first step on: surroundings and links, without tools.
pub(super) fn scenery(recording: &Recording, now: Time) -> SceneUpdate {
    let surroundings = recording.surroundings.iter().map(|body| {
        let mut entity = SceneEntity::new(now, WORLD, &frame("surroundings", &body.name));
        entity.triangles = surfaces(body, None);
        entity
    });
    let links = (recording.links.iter())
        .filter(|body| body.only_with.is_none())
        .flat_map(|body| link(body, now));
    SceneUpdate {
        deletions: Vec::new(),
        entities: surroundings.chain(links).collect(),
    }
}

/// Takes the tool that was at work off the arms and puts the other one on.
pub(super) fn change_tool(recording: &Recording, tool: ShownTool, now: Time) -> SceneUpdate {
    let mut update = SceneUpdate::default();
    for body in &recording.links {
        if body.only_with == Some(tool) {
            update.entities.extend(link(body, now));
        } else if body.only_with.is_some() {
            update.deletions.extend(
                [ARMS[0], ARMS[2]].map(|arm| SceneEntityDeletion::of(now, frame(arm, &body.name))),
            );
        }
    }
    update
}

/// Arrows of force and deflection, the tracker's line, and a title.
pub(super) fn annotations(
    recording: &Recording,
    calibration: &RecordedCalibration,
    step: &Step,
    now: Time,
) -> SceneUpdate {
    let mut update = SceneUpdate::default();
    let mut entity = SceneEntity::new(now, WORLD, "force");
    if let Some((force, label)) = recording.force_arrow_m(step).zip(step.load_label()) {
        let from = step.enlarged.tool_m;
        let to = from + force;
        entity.arrows = vec![ArrowPrimitive::between(&from, &to, 0.035, FORCE_RGBA)];
        entity.texts = vec![TextPrimitive::at(&to, FORCE_RGBA, label)];
    }
    update.entities.push(entity);

    let mut entity = SceneEntity::new(now, WORLD, "deflection");
    if let Some(label) = step.displacement_label() {
        let from = step.unloaded.tool_m;
        let to = from + step.displacement_m() * step.enlargement;
        entity.arrows = vec![ArrowPrimitive::between(&from, &to, 0.028, DEFLECTION_RGBA)];
        let beside = from + Vector3::z() * 0.1;
        entity.texts = vec![TextPrimitive::at(&beside, DEFLECTION_RGBA, label)];
    }
    update.entities.push(entity);

    if recording.has_lines_of_sight() {
        let mut entity = SceneEntity::new(now, WORLD, "tracker_line");
        let line = |from| LinePrimitive::between(from, &step.unloaded.tool_m, 0.01, TRACKER_RGBA);
        entity.lines = step.instrument_m.iter().map(line).collect();
        update.entities.push(entity);
    }

    let mut entity = SceneEntity::new(now, WORLD, "title");
    let title = format!(
        "{}: {}; joint deflections enlarged {} times",
        calibration.record.name(),
        calibration.title(step),
        step.enlargement
    );
    let highest = step.unloaded.world_from_link.iter();
    let height = highest.map(|pose| pose.translation.z).fold(0.0, f64::max);
    let above = Vector3::new(0.0, 0.0, height + 0.6);
    entity.texts = vec![TextPrimitive::at(&above, [0.1, 0.1, 0.1, 1.0], title)];
    update.entities.push(entity);
    update
}

/// A link in the unloaded arm and, translucent, in the enlarged one.
fn link(body: &Body, now: Time) -> [SceneEntity; 2] {
    [(ARMS[0], None), (ARMS[2], Some(LOADED_RGBA))].map(|(arm, rgba)| {
        let id = frame(arm, &body.name);
        let mut entity = SceneEntity::new(now, &id, &id);
        entity.triangles = surfaces(body, rgba);
        entity
    })
}

fn surfaces(body: &Body, rgba: Option<[f32; 4]>) -> Vec<TriangleListPrimitive> {
    (body.surfaces.iter())
        .map(|surface| {
            let mesh = &surface.mesh;
            let rgba = rgba.unwrap_or(surface.rgba);
            TriangleListPrimitive::new(&mesh.vertices, &mesh.triangles, rgba)
        })
        .collect()
}
