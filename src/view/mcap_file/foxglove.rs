//! Foxglove's message types for joints, transforms and scenes, in JSON, with the field names of its published schemas; viewers know
//! them by the names `foxglove.JointStates`, `foxglove.FrameTransforms` and `foxglove.SceneUpdate`, and take what is absent as empty.

use std::time::Duration;

use nalgebra::{Isometry3, Point3, Rotation3, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::Serialize;

/// A moment, or a length of time.
#[derive(Debug, Clone, Copy, Default, Serialize, JsonSchema)]
pub(super) struct Time {
    sec: u32,
    nsec: u32,
}

/// A joint's position (rad, m).
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub(super) struct JointState {
    pub(super) name: String,
    pub(super) position: f64,
}

/// How the joints stand.
#[derive(Debug, Clone, Serialize, JsonSchema)]
#[schemars(title = "foxglove.JointStates")]
pub(super) struct JointStates {
    pub(super) timestamp: Time,
    pub(super) joints: Vec<JointState>,
}

/// A place, a translation or a size.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub(super) struct Vector {
    x: f64,
    y: f64,
    z: f64,
}

/// A rotation.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub(super) struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

/// Position and orientation.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub(super) struct Pose {
    position: Vector,
    orientation: Quaternion,
}

/// Red, green, blue and opacity between 0 and 1.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub(super) struct Color {
    r: f32,
    g: f32,
    b: f32,
    a: f32,
}

/// The pose of a child frame in its parent frame.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub(super) struct FrameTransform {
    timestamp: Time,
    parent_frame_id: String,
    child_frame_id: String,
    translation: Vector,
    rotation: Quaternion,
}

/// Several transforms.
#[derive(Debug, Clone, Serialize, JsonSchema)]
#[schemars(title = "foxglove.FrameTransforms")]
pub(super) struct FrameTransforms {
    pub(super) transforms: Vec<FrameTransform>,
}

/// Entities to remove from and to add to a scene.
#[derive(Debug, Clone, Default, Serialize, JsonSchema)]
#[schemars(title = "foxglove.SceneUpdate")]
pub(super) struct SceneUpdate {
    pub(super) deletions: Vec<SceneEntityDeletion>,
    pub(super) entities: Vec<SceneEntity>,
}

/// Removes the entity with this identifier (type 0) or all (type 1).
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub(super) struct SceneEntityDeletion {
    timestamp: Time,
    #[serde(rename = "type")]
    kind: u8,
    id: String,
}

/// Something to draw in a frame; takes the place of an earlier one with the same identifier.
#[derive(Debug, Clone, Default, Serialize, JsonSchema)]
pub(super) struct SceneEntity {
    timestamp: Time,
    frame_id: String,
    id: String,
    /// Zero: until it is replaced or deleted.
    lifetime: Time,
    /// Whether it follows its frame as that moves.
    frame_locked: bool,
    pub(super) arrows: Vec<ArrowPrimitive>,
    pub(super) lines: Vec<LinePrimitive>,
    pub(super) triangles: Vec<TriangleListPrimitive>,
    pub(super) texts: Vec<TextPrimitive>,
}

/// An arrow from the origin of its pose along its x axis.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub(super) struct ArrowPrimitive {
    pose: Pose,
    shaft_length: f64,
    shaft_diameter: f64,
    head_length: f64,
    head_diameter: f64,
    color: Color,
}

/// A line through points (type 0).
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub(super) struct LinePrimitive {
    #[serde(rename = "type")]
    kind: u8,
    pose: Pose,
    thickness: f64,
    scale_invariant: bool,
    points: Vec<Vector>,
    color: Color,
}

/// A surface of triangles.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub(super) struct TriangleListPrimitive {
    pose: Pose,
    points: Vec<Vector>,
    color: Color,
    indices: Vec<u32>,
}

/// A label.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub(super) struct TextPrimitive {
    pose: Pose,
    billboard: bool,
    font_size: f64,
    scale_invariant: bool,
    color: Color,
    text: String,
}

impl Time {
    /// So many minutes later.
    pub(super) fn later(self, minutes: f64) -> Self {
        let ns = Duration::from_nanos(self.ns()) + Duration::from_secs_f64(60.0 * minutes);
        Self {
            sec: u32::try_from(ns.as_secs()).unwrap_or(u32::MAX),
            nsec: ns.subsec_nanos(),
        }
    }

    /// Since the recording's beginning (ns).
    pub(super) fn ns(self) -> u64 {
        u64::from(self.sec) * 1_000_000_000 + u64::from(self.nsec)
    }
}

impl From<Vector3<f64>> for Vector {
    fn from(vector: Vector3<f64>) -> Self {
        let [x, y, z] = vector.into();
        Self { x, y, z }
    }
}

impl From<UnitQuaternion<f64>> for Quaternion {
    fn from(rotation: UnitQuaternion<f64>) -> Self {
        let [x, y, z, w] = rotation.coords.into();
        Self { x, y, z, w }
    }
}

impl From<Isometry3<f64>> for Pose {
    fn from(pose: Isometry3<f64>) -> Self {
        Self {
            position: pose.translation.vector.into(),
            orientation: pose.rotation.into(),
        }
    }
}

impl From<[f32; 4]> for Color {
    fn from([r, g, b, a]: [f32; 4]) -> Self {
        Self { r, g, b, a }
    }
}

impl FrameTransform {
    pub(super) fn new(now: Time, parent: &str, child: String, pose: &Isometry3<f64>) -> Self {
        Self {
            timestamp: now,
            parent_frame_id: parent.to_owned(),
            child_frame_id: child,
            translation: pose.translation.vector.into(),
            rotation: pose.rotation.into(),
        }
    }
}

impl SceneEntityDeletion {
    pub(super) fn of(now: Time, id: String) -> Self {
        Self {
            timestamp: now,
            kind: 0,
            id,
        }
    }
}

impl SceneEntity {
    /// An empty entity that stays until it is replaced or deleted and moves with its frame.
    pub(super) fn new(now: Time, frame: &str, id: &str) -> Self {
        Self {
            timestamp: now,
            frame_id: frame.to_owned(),
            id: id.to_owned(),
            frame_locked: true,
            ..Self::default()
        }
    }
}

impl ArrowPrimitive {
    /// An arrow between two points, in metres.
    pub(super) fn between(
        from: &Vector3<f64>,
        to: &Vector3<f64>,
        diameter: f64,
        color: [f32; 4],
    ) -> Self {
        let along = to - from;
        let length = along.norm();
        let head_length = (4.0 * diameter).min(length / 2.0);
        // There is no unique rotation if the arrow points backwards along x; any will do.
        let rotation = Rotation3::rotation_between(&Vector3::x(), &along)
            .unwrap_or_else(|| Rotation3::new(Vector3::z() * std::f64::consts::PI));
        Self {
            pose: Isometry3::from_parts((*from).into(), rotation.into()).into(),
            shaft_length: length - head_length,
            shaft_diameter: diameter,
            head_length,
            head_diameter: 2.0 * diameter,
            color: color.into(),
        }
    }
}

impl LinePrimitive {
    /// A line between two points, in metres.
    pub(super) fn between(
        from: &Vector3<f64>,
        to: &Vector3<f64>,
        thickness: f64,
        color: [f32; 4],
    ) -> Self {
        Self {
            kind: 0,
            pose: Isometry3::identity().into(),
            thickness,
            scale_invariant: false,
            points: vec![(*from).into(), (*to).into()],
            color: color.into(),
        }
    }
}

impl TriangleListPrimitive {
    /// A surface in one colour, its points rounded to a hundredth of a millimetre.
    pub(super) fn new(points: &[Point3<f64>], triangles: &[[u32; 3]], color: [f32; 4]) -> Self {
        let round = |value: f64| (value * 1e5).round() / 1e5;
        Self {
            pose: Isometry3::identity().into(),
            points: (points.iter())
                .map(|point| point.coords.map(round).into())
                .collect(),
            color: color.into(),
            indices: triangles.iter().flatten().copied().collect(),
        }
    }
}

impl TextPrimitive {
    /// A label that faces the viewer, 8 cm high.
    pub(super) fn at(place: &Vector3<f64>, color: [f32; 4], text: String) -> Self {
        Self {
            pose: Isometry3::from_parts((*place).into(), UnitQuaternion::identity()).into(),
            billboard: true,
            font_size: 0.08,
            scale_invariant: false,
            color: color.into(),
            text,
        }
    }
}
