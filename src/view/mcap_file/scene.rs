//! The robot as transforms and scene entities.

use std::time::Duration;

use foxglove::messages::{
    ArrowPrimitive, Color, FrameTransform, FrameTransforms, LinePrimitive, Point3, Pose,
    Quaternion, SceneEntity, SceneEntityDeletion, SceneUpdate, TextPrimitive, Timestamp,
    TriangleListPrimitive, Vector3 as Vector,
};
use nalgebra::{Isometry3, Rotation3, UnitQuaternion, Vector3};

use crate::view::recording::{Annotation, Body, RecordedCalibration, Recording, ShownTool, Step};

/// The root of all frames: the robot's base, z up.
const WORLD: &str = "world";
/// The frame of the tool's tip in each of the three arms, beside those of the links.
const TOOL: &str = "tool";
/// The arms: without load, under load true to scale, and with deflections enlarged, as drawn.
const ARMS: [&str; 3] = ["unloaded", "loaded", "enlarged"];

const LOADED_RGBA: [f32; 4] = [0.35, 0.65, 1.0, 0.4];
const TITLE_RGB: [u8; 3] = [26; 3];

fn frame(arm: &str, part: &str) -> String {
    format!("{arm}/{part}")
}

/// A time since the recording's beginning.
pub(super) fn stamp(now: Duration) -> Option<Timestamp> {
    Timestamp::new_checked(u32::try_from(now.as_secs()).ok()?, now.subsec_nanos())
}

fn vector(vector: &Vector3<f64>) -> Vector {
    let [x, y, z] = (*vector).into();
    Vector { x, y, z }
}

fn point(vector: &Vector3<f64>) -> Point3 {
    let [x, y, z] = (*vector).into();
    Point3 { x, y, z }
}

fn quaternion(rotation: &UnitQuaternion<f64>) -> Quaternion {
    let [x, y, z, w] = rotation.coords.into();
    Quaternion { x, y, z, w }
}

fn pose(pose: &Isometry3<f64>) -> Pose {
    Pose {
        position: Some(vector(&pose.translation.vector)),
        orientation: Some(quaternion(&pose.rotation)),
    }
}

fn opaque(rgb: [u8; 3]) -> Color {
    let [r, g, b] = rgb.map(|part| f64::from(part) / 255.0);
    Color { r, g, b, a: 1.0 }
}

/// An empty entity that stays until it is replaced or deleted and moves with its frame.
fn entity(now: Duration, frame: &str, id: &str) -> SceneEntity {
    SceneEntity {
        timestamp: stamp(now),
        frame_id: frame.to_owned(),
        id: id.to_owned(),
        frame_locked: true,
        ..SceneEntity::default()
    }
}

/// The frames of all links and of the tool's tip in a step.
pub(super) fn transforms(recording: &Recording, step: &Step, now: Duration) -> FrameTransforms {
    let mut transforms = Vec::new();
    for (arm, stands) in ARMS.iter().zip(&step.arms) {
        let names = recording.links.iter().map(|body| &*body.name);
        let tool = Isometry3::translation(stands.tool_m.x, stands.tool_m.y, stands.tool_m.z);
        let poses = stands.world_from_link.iter().copied().chain([tool]);
        transforms.extend(
            (names.chain([TOOL]).zip(poses)).map(|(part, pose)| FrameTransform {
                timestamp: stamp(now),
                parent_frame_id: WORLD.to_owned(),
                child_frame_id: frame(arm, part),
                translation: Some(vector(&pose.translation.vector)),
                rotation: Some(quaternion(&pose.rotation)),
            }),
        );
    }
    FrameTransforms { transforms }
}

/// All that is there from the first step on: surroundings and links, without tools.
pub(super) fn scenery(recording: &Recording, now: Duration) -> SceneUpdate {
    let surroundings = recording.surroundings.iter().map(|body| SceneEntity {
        triangles: surfaces(body, None),
        ..entity(now, WORLD, &frame("surroundings", &body.name))
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
pub(super) fn change_tool(recording: &Recording, tool: ShownTool, now: Duration) -> SceneUpdate {
    let mut update = SceneUpdate::default();
    for (body, is_on) in recording.tools(tool) {
        if is_on {
            update.entities.extend(link(body, now));
            continue;
        }
        update
            .deletions
            .extend([ARMS[0], ARMS[2]].map(|arm| SceneEntityDeletion {
                timestamp: stamp(now),
                id: frame(arm, &body.name),
                ..SceneEntityDeletion::default()
            }));
    }
    update
}

/// What acts on the arms, and a title.
pub(super) fn annotations(
    recording: &Recording,
    calibration: &RecordedCalibration,
    step: &Step,
    now: Duration,
) -> SceneUpdate {
    let drawn = recording.annotations(step);
    let mut entities: Vec<SceneEntity> = drawn.iter().map(|each| drawing(each, now)).collect();
    let title = format!(
        "{}: {}; joint deflections enlarged {} times",
        calibration.record.name, step.title, step.enlargement
    );
    let highest = step.arms[0].world_from_link.iter();
    let height = highest.map(|pose| pose.translation.z).fold(0.0, f64::max);
    let above = Vector3::new(0.0, 0.0, height + 0.6);
    entities.push(SceneEntity {
        texts: vec![text(&above, TITLE_RGB, title)],
        ..entity(now, WORLD, "title")
    });
    SceneUpdate {
        deletions: Vec::new(),
        entities,
    }
}

/// An arrow or a line with its label; nothing takes the place of what is not in a step.
fn drawing(drawn: &Annotation, now: Duration) -> SceneEntity {
    let mut entity = entity(now, WORLD, drawn.name);
    let color = Some(opaque(drawn.rgb));
    let thickness = 2.0 * f64::from(drawn.radius_m);
    match &drawn.ends_m {
        Some([from, to]) if drawn.is_arrow => {
            let along = to - from;
            let head_length = (4.0 * thickness).min(along.norm() / 2.0);
            // There is no unique rotation if the arrow points backwards along x; any will do.
            let rotation = Rotation3::rotation_between(&Vector3::x(), &along)
                .unwrap_or_else(|| Rotation3::new(Vector3::z() * std::f64::consts::PI));
            entity.arrows.push(ArrowPrimitive {
                pose: Some(pose(&Isometry3::from_parts(
                    (*from).into(),
                    rotation.into(),
                ))),
                shaft_length: along.norm() - head_length,
                shaft_diameter: thickness,
                head_length,
                head_diameter: 2.0 * thickness,
                color,
            });
        }
        Some(ends) => entity.lines.push(LinePrimitive {
            pose: Some(pose(&Isometry3::identity())),
            thickness,
            points: ends.iter().map(point).collect(),
            color,
            ..LinePrimitive::default()
        }),
        None => {}
    }
    let label = drawn.label.iter();
    (entity.texts).extend(label.map(|(place, label)| text(place, drawn.rgb, label.clone())));
    entity
}

/// A label that faces the viewer, 8 cm high.
fn text(place: &Vector3<f64>, rgb: [u8; 3], text: String) -> TextPrimitive {
    TextPrimitive {
        pose: Some(pose(&Isometry3::translation(place.x, place.y, place.z))),
        billboard: true,
        font_size: 0.08,
        scale_invariant: false,
        color: Some(opaque(rgb)),
        text,
    }
}

/// A link in the unloaded arm and, translucent, in the enlarged one.
fn link(body: &Body, now: Duration) -> [SceneEntity; 2] {
    [(ARMS[0], None), (ARMS[2], Some(LOADED_RGBA))].map(|(arm, rgba)| {
        let id = frame(arm, &body.name);
        SceneEntity {
            triangles: surfaces(body, rgba),
            ..entity(now, &id, &id)
        }
    })
}

fn surfaces(body: &Body, rgba: Option<[f32; 4]>) -> Vec<TriangleListPrimitive> {
    (body.surfaces.iter())
        .map(|surface| {
            let [r, g, b, a] = rgba.unwrap_or(surface.rgba).map(f64::from);
            let vertices = surface.mesh.vertices.iter();
            TriangleListPrimitive {
                pose: Some(pose(&Isometry3::identity())),
                points: vertices.map(|vertex| point(&vertex.coords)).collect(),
                color: Some(Color { r, g, b, a }),
                indices: surface.mesh.triangles.iter().flatten().copied().collect(),
                ..TriangleListPrimitive::default()
            }
        })
        .collect()
}
