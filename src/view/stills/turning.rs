//! The plan in 3D: a figure of a page whose script draws it to be turned, without anything from elsewhere.

use nalgebra::{Isometry3, Point3};
use serde::Serialize;

use super::scene::{Part, Scene, Stage};

/// Draws the figure; without it the figure stays hidden.
const SCRIPT: &str = include_str!("turning.js");

/// What the script draws; lengths in whole millimetres in the world frame, z up.
#[derive(Serialize)]
struct Plan {
    parts: Vec<Surface>,
    scenes: Vec<Marks>,
}

/// A surface of the model.
#[derive(Serialize)]
struct Surface {
    /// Red, green and blue in 0 to 255.
    colour: [u8; 3],
    /// Whether it has to be in the picture.
    framed: bool,
    points: Vec<[i32; 3]>,
    triangles: Vec<[u32; 3]>,
    /// Where it is in each scene: rows of the rotation (1e-4), then the translation; once if it does not move.
    poses: Vec<[i32; 12]>,
}

/// What is drawn over the robot in a scene.
#[derive(Serialize)]
struct Marks {
    tool: [i32; 3],
    arrow_end: [i32; 3],
    read: [i32; 3],
    instrument: Option<[i32; 3]>,
}

/// The figure of a plan; nothing of none.
pub(super) fn view(stage: &Stage) -> String {
    if stage.scenes.is_empty() {
        return String::new();
    }
    let plan = Plan {
        parts: (stage.parts.iter().enumerate())
            .map(|(index, part)| surface(stage, index, part))
            .collect(),
        scenes: stage.scenes.iter().map(marks).collect(),
    };
    let plan = serde_json::to_string(&plan).unwrap_or_default();
    format!(
        "<figure class=\"turning\" hidden><canvas tabindex=\"0\" role=\"img\" aria-label=\"The plan in 3D\"></canvas>\n\
         <figcaption><button type=\"button\" aria-label=\"previous\">\u{25c2}</button>\
         <button type=\"button\" aria-label=\"next\">\u{25b8}</button> <span></span></figcaption></figure>\n\
         <script type=\"application/json\">{plan}</script>\n<script>\n{SCRIPT}</script>\n"
    )
}

fn surface(stage: &Stage, index: usize, part: &Part) -> Surface {
    let scenes = if part.moves {
        &stage.scenes[..]
    } else {
        &stage.scenes[..1]
    };
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "0 to 255"
    )]
    let channel = |share: f32| (share.clamp(0.0, 1.0) * 255.0).round() as u8;
    Surface {
        colour: [part.rgba[0], part.rgba[1], part.rgba[2]].map(channel),
        framed: part.is_robot,
        points: part.mesh.vertices.iter().map(millimetres).collect(),
        triangles: part.mesh.triangles.clone(),
        poses: scenes
            .iter()
            .map(|scene| rows(&scene.poses[index]))
            .collect(),
    }
}

fn marks(scene: &Scene) -> Marks {
    Marks {
        tool: millimetres(&scene.tool),
        arrow_end: millimetres(&scene.arrow_end),
        read: millimetres(&scene.read),
        instrument: scene.tracker.as_ref().map(millimetres),
    }
}

fn rows(pose: &Isometry3<f64>) -> [i32; 12] {
    let turned = pose.rotation.to_rotation_matrix().transpose();
    let [x, y, z] = millimetres(&pose.translation.vector.into());
    let entries = turned.matrix().iter().map(|entry| whole(entry * 1e4));
    let mut all = entries.chain([x, y, z]);
    std::array::from_fn(|_| all.next().unwrap_or(0))
}

fn millimetres(point: &Point3<f64>) -> [i32; 3] {
    [point.x, point.y, point.z].map(|metres| whole(metres * 1e3))
}

#[expect(clippy::cast_possible_truncation, reason = "some thousand")]
fn whole(value: f64) -> i32 {
    value.round() as i32
}
