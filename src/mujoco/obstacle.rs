//! Obstacles of the laboratory, added to a model when it is loaded.

use std::path::Path;
use std::sync::Arc;

use mujoco_rs::prelude::MjSpec;
use mujoco_rs::wrappers::mj_editing::SpecItem;
use mujoco_rs::wrappers::mj_model::MjtGeomBase;
use nalgebra::Isometry3;

use super::messages::refusal;
use super::model::{prepare, refused};
use super::{Additions, Model, ModelError, Shape};
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

impl Model {
    /// Compiles the MJCF file with what a scenario adds: obstacles, which stand still and collide with all
    /// that collides, tools and payloads.
    ///
    /// # Errors
    /// The file cannot be read, or MuJoCo refuses it with the additions, as where the model has a
    /// body or a geometry of the same name.
    pub fn load_with(path: &Path, additions: &Additions) -> Result<Self, ModelError> {
        if additions.is_empty() {
            return Self::load(path);
        }
        let refused = |message: String| refused(path, message);
        let (mut spec, left_out) = if let Some(urdf) = prepare(path)? {
            urdf.spec(path)?
        } else {
            let spec = MjSpec::from_xml(path);
            let spec = spec.map_err(|error| refused(refusal(path, &error.to_string())))?;
            (spec, Vec::new())
        };
        for obstacle in &additions.obstacles {
            add(&mut spec, obstacle).map_err(refused)?;
        }
        if !additions.tools.is_empty() || !additions.payloads.is_empty() {
            Self::load(path)?.mount(&mut spec, additions)?;
        }
        let inner = spec.compile().map_err(|error| refused(error.to_string()))?;
        Ok(Self {
            left_out: Arc::new(left_out),
            ..Self::new(inner, path)?
        })
    }
}

/// Adds a body of its own with one geometry of the same name.
fn add(spec: &mut MjSpec, obstacle: &Obstacle) -> Result<(), String> {
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
