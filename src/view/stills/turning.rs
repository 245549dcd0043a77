//! The plan in 3D, for the figure of a page whose script draws it to be turned.

use nalgebra::{Isometry3, Point3};
use serde_json::{Value, json};

use super::scene::{Scene, ScenePart, Scenery};

/// Draws the figure; without it the figure stays hidden.
pub(super) const SCRIPT: &str = include_str!("turning.js");

/// What the script draws, as JSON; nothing of no plan.
pub(super) fn plan(scenery: &Scenery) -> Option<String> {
    let parts = scenery.parts.iter().enumerate();
    let parts = parts.map(|(index, part)| surface(scenery, index, part));
    let parts: Vec<Value> = parts.collect();
    let scenes: Vec<Value> = scenery.scenes.iter().map(marks).collect();
    let plan = json!({ "parts": parts, "scenes": scenes });
    (!scenes.is_empty()).then(|| plan.to_string())
}

/// A surface of the model (whole mm) with its colour, and where it is in each scene: rows of the
/// rotation (1e-4), then the translation (mm); once if it does not move.
fn surface(scenery: &Scenery, index: usize, part: &ScenePart) -> Value {
    let count = if part.moves { usize::MAX } else { 1 };
    let poses = scenery.scenes.iter().take(count);
    let poses: Vec<_> = poses.map(|scene| rows(&scene.poses[index])).collect();
    let colour = [0, 1, 2].map(|channel| whole(f64::from(part.rgba[channel]) * 255.0));
    let points: Vec<_> = part.mesh.vertices.iter().map(millimetres).collect();
    json!({
        "colour": colour,
        "points": points,
        "triangles": part.mesh.triangles,
        "poses": poses,
    })
}

/// What is drawn over the robot in a scene (whole mm in the world frame).
fn marks(scene: &Scene) -> Value {
    json!({
        "tool": millimetres(&scene.tool),
        "arrow_end": millimetres(&scene.arrow_end),
        "sight": scene.sight.map(|sight| sight.ends_m.map(|end| millimetres(&end.into()))),
        "is_gauge": scene.sight.is_some_and(|sight| sight.is_gauge),
    })
}

fn rows(pose: &Isometry3<f64>) -> Vec<i32> {
    let turned = pose.rotation.to_rotation_matrix().transpose();
    let entries = turned.matrix().iter().map(|entry| whole(entry * 1e4));
    let place = millimetres(&pose.translation.vector.into());
    entries.chain(place).collect()
}

fn millimetres(point: &Point3<f64>) -> [i32; 3] {
    [point.x, point.y, point.z].map(|metres| whole(metres * 1e3))
}

#[expect(clippy::cast_possible_truncation, reason = "some thousand")]
fn whole(value: f64) -> i32 {
    value.round() as i32
}
