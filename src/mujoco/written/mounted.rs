//! Where a calibrated model has what a scenario mounts, in whatever language it is written.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use super::ModelCalibration;
use crate::mujoco::{Model, MountedPayload, MountedTool};

/// A payload on a body.
pub(super) struct PlacedPayload {
    /// The body that carries it.
    pub body: usize,
    /// Its centre of mass in the body's frame (m).
    pub centre_m: Vector3<f64>,
    /// What it weighs (kg).
    pub mass_kg: f64,
}

/// The link that a body belongs to, and the link's axes in the body's; `joints` are the chain's.
pub(super) fn link_of(
    model: &Model,
    joints: &[usize],
    body: usize,
) -> Option<(usize, UnitQuaternion<f64>)> {
    let joints: Vec<Option<usize>> = joints.iter().copied().map(Some).collect();
    (0..joints.len()).find_map(|link| {
        let bodies = model.bodies_of_link(&joints, link).into_iter();
        let mut own = bodies.filter(|(each, _)| *each == body);
        own.next().map(|(_, turn)| (link, turn))
    })
}

impl ModelCalibration {
    /// The body that carries a tool, and the tool's frame in the body's.
    pub(super) fn placed_tool(
        &self,
        model: &Model,
        tool: &MountedTool,
    ) -> Result<(usize, Isometry3<f64>), String> {
        let (body, body_from) = model.carrier(&tool.on).map_err(|error| error.to_string())?;
        let by = (self.sites.iter()).find(|(name, _)| *name == tool.name);
        let by = by.map_or_else(Isometry3::identity, |(_, by)| *by);
        Ok((body, body_from * tool.from_tool * by))
    }

    /// A payload with what was identified of its link's mass.
    pub(super) fn placed_payload(
        &self,
        model: &Model,
        joints: &[usize],
        payload: &MountedPayload,
    ) -> Result<PlacedPayload, String> {
        let carrier = model.carrier(&payload.on);
        let (body, body_from) = carrier.map_err(|error| error.to_string())?;
        let mut placed = PlacedPayload {
            body,
            centre_m: (body_from * Point3::from(payload.centre_m)).coords,
            mass_kg: payload.mass_kg,
        };
        if let Some((link, turn)) = link_of(model, joints, body) {
            placed.mass_kg *= self.mass_factor[link];
            placed.centre_m += turn * self.centre_shift_m[link];
        }
        Ok(placed)
    }
}
