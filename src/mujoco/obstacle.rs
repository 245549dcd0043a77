//! Obstacles of the laboratory, added to a model when it is loaded.

use mujoco_rs::prelude::MjSpec;
use mujoco_rs::wrappers::mj_editing::SpecItem;
use mujoco_rs::wrappers::mj_model::MjtGeomBase;
use nalgebra::Isometry3;

use super::Shape;
use crate::text::wrong_name;

/// The colour of obstacles: red, green, blue and opacity.
const COLOUR: [f32; 4] = [0.75, 0.35, 0.30, 1.0];

/// Something that stands in the laboratory.
#[derive(Debug, Clone, PartialEq)]
pub struct Obstacle {
    /// Its name, for messages.
    pub name: String,
    /// Its shape: a box, sphere, cylinder or capsule.
    pub shape: Shape,
    /// Where it stands, in the world frame.
    pub world_from_obstacle: Isometry3<f64>,
}

/// Adds a body of its own with one geometry of the same name.
pub(super) fn add(spec: &mut MjSpec, obstacle: &Obstacle) -> Result<(), String> {
    let (kind, size) = match &obstacle.shape {
        Shape::Sphere(radius) => (MjtGeomBase::mjGEOM_SPHERE, [*radius, 0.0, 0.0]),
        Shape::Capsule(radius, half) => (MjtGeomBase::mjGEOM_CAPSULE, [*radius, *half, 0.0]),
        Shape::Cylinder(radius, half) => (MjtGeomBase::mjGEOM_CYLINDER, [*radius, *half, 0.0]),
        Shape::Box(half) => (MjtGeomBase::mjGEOM_BOX, (*half).into()),
        other => return Err(format!("an obstacle cannot have the shape {other:?}")),
    };
    if let Some(problem) = wrong_name(&obstacle.name) {
        return Err(problem);
    }
    let place = &obstacle.world_from_obstacle;
    let [x, y, z, w] = place.rotation.coords.into();
    let named = |error: mujoco_rs::error::MjEditError| format!("{}: {error}", obstacle.name);
    let body = spec.world_body_mut().add_body();
    body.set_name(&obstacle.name).map_err(named)?;
    body.with_pos(place.translation.vector.into())
        .with_quat([w, x, y, z]);
    let geometry = body.add_geom();
    geometry.set_name(&obstacle.name).map_err(named)?;
    geometry
        .with_type(kind)
        .with_size(size)
        .with_group(0)
        .with_rgba(COLOUR)
        .with_mass(0.0)
        .with_contype(i32::MAX)
        .with_conaffinity(i32::MAX);
    Ok(())
}
