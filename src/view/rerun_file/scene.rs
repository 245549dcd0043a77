//! The robot with what acts on it.

use nalgebra::{Isometry3, Vector3};
use re_sdk::{EntityPath, RecordingStream, entity_path};
use re_sdk_types::archetypes::{
    Arrows3D, Clear, LineStrips3D, Mesh3D, Points3D, Transform3D, ViewCoordinates,
};
use re_sdk_types::datatypes::Quaternion;

use super::{Logged, text};
use crate::view::recording::{Body, RecordedCalibration, Recording, ShownTool, Step};

/// The loaded arm is light blue and translucent.
const LOADED_RGBA: [u8; 4] = [110, 180, 255, 130];

/// What does not change: surroundings and links, without tools.
pub(super) fn log_bodies(stream: &RecordingStream, recording: &Recording) -> Logged {
    stream.log_static("world", &ViewCoordinates::RIGHT_HAND_Z_UP())?;
    for body in &recording.surroundings {
        stream.log_static(
            entity_path!["world", "surroundings", body.name],
            &mesh(body, true),
        )?;
    }
    for body in &recording.links {
        if body.only_with.is_none() {
            put_on(stream, body, true)?;
        }
    }
    Ok(())
}

/// The arms and what acts on them in a step, and the step in words.
pub(super) fn log_step(
    stream: &RecordingStream,
    recording: &Recording,
    calibration: &RecordedCalibration,
    step: &Step,
) -> Logged {
    if step.changes_tool {
        log_tools(stream, recording, step.tool)?;
    }
    log_arms(stream, recording, step)?;
    let drawn = recording.annotations(step);
    for each in &drawn {
        let path = entity_path!["world", each.name];
        let Some([from, to]) = each.ends_m else {
            stream.log(path, &Clear::flat())?;
            continue;
        };
        if each.is_arrow {
            let arrow = Arrows3D::from_vectors([single(&(to - from))])
                .with_origins([single(&from)])
                .with_radii([each.radius_m])
                .with_colors([each.rgb]);
            stream.log(path, &arrow)?;
        } else {
            let line = LineStrips3D::new([[single(&from), single(&to)]])
                .with_radii([each.radius_m])
                .with_colors([each.rgb]);
            stream.log(path, &line)?;
        }
    }
    let labels = || (drawn.iter()).filter_map(|each| Some((each.rgb, each.label.as_ref()?)));
    let points = Points3D::new(labels().map(|(_, (place, _))| single(place)))
        .with_radii([0.0])
        .with_colors(labels().map(|(rgb, _)| rgb))
        .with_labels(labels().map(|(_, (_, text))| text.as_str()));
    stream.log("world/labels", &points)?;
    stream.log("text/step", &text::step(recording, calibration, step)?)?;
    Ok(())
}

fn link_path(arm: &str, body: &Body) -> EntityPath {
    entity_path!["world", arm, body.name]
}

/// Draws a link of both arms.
fn put_on(stream: &RecordingStream, body: &Body, is_static: bool) -> Logged {
    for (arm, has_colours) in [("robot", true), ("loaded", false)] {
        let mesh = mesh(body, has_colours);
        stream.log_with_static(link_path(arm, body), is_static, &mesh)?;
    }
    Ok(())
}

/// Takes the tool that was at work off the arms and puts the other one on.
fn log_tools(stream: &RecordingStream, recording: &Recording, tool: ShownTool) -> Logged {
    for (body, is_on) in recording.tools(tool) {
        if is_on {
            put_on(stream, body, false)?;
            continue;
        }
        for arm in ["robot", "loaded"] {
            stream.log(link_path(arm, body), &Mesh3D::clear_fields())?;
        }
    }
    Ok(())
}

fn log_arms(stream: &RecordingStream, recording: &Recording, step: &Step) -> Logged {
    let [unloaded, _, enlarged] = (step.arms.each_ref()).map(|arm| &arm.world_from_link);
    for (body, (unloaded, enlarged)) in recording.links.iter().zip(unloaded.iter().zip(enlarged)) {
        stream.log(link_path("robot", body), &transform(unloaded))?;
        stream.log(link_path("loaded", body), &transform(enlarged))?;
        // Two surfaces in the same place flicker: a link that does not move is drawn once.
        let apart = unloaded.inv_mul(enlarged);
        let moves = apart.translation.vector.norm() > 1e-3 || apart.rotation.angle() > 1e-3;
        let [red, green, blue, alpha] = LOADED_RGBA;
        let colour = [red, green, blue, if moves { alpha } else { 0 }];
        let colour = Mesh3D::update_fields().with_albedo_factor(colour);
        stream.log(link_path("loaded", body), &colour)?;
    }
    Ok(())
}

/// All of a body, in the model's colours or without any.
fn mesh(body: &Body, has_colours: bool) -> Mesh3D {
    let (mut vertices, mut normals, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    let mut colours = Vec::new();
    for surface in &body.surfaces {
        let shaded = surface.mesh.shaded();
        let first = u32::try_from(vertices.len()).unwrap_or(u32::MAX);
        triangles.extend((shaded.triangles.iter()).map(|each| each.map(|corner| first + corner)));
        vertices.extend(shaded.vertices.iter().map(|vertex| single(&vertex.coords)));
        normals.extend(shaded.normals.iter().map(single));
        colours.resize(vertices.len(), surface.rgba.map(byte));
    }
    let mesh = Mesh3D::new(vertices)
        .with_vertex_normals(normals)
        .with_triangle_indices(triangles);
    if has_colours {
        mesh.with_vertex_colors(colours)
    } else {
        mesh
    }
}

fn transform(pose: &Isometry3<f64>) -> Transform3D {
    let rotation = pose.rotation.coords;
    Transform3D::new()
        .with_translation(single(&pose.translation.vector))
        .with_quaternion(Quaternion::from_xyzw(
            [rotation.x, rotation.y, rotation.z, rotation.w].map(narrow),
        ))
}

pub(super) fn single(vector: &Vector3<f64>) -> [f32; 3] {
    (*vector).map(narrow).into()
}

#[expect(clippy::cast_possible_truncation, reason = "for drawing")]
pub(super) fn narrow(value: f64) -> f32 {
    value as f32
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to a byte's range"
)]
fn byte(share: f32) -> u8 {
    (share.clamp(0.0, 1.0) * 255.0).round() as u8
}
