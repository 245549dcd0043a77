//! How frames differ from the nominal ones.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

/// How the frames of links, tools and bases differ from the nominal ones.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Displacements {
    pub links: Vec<FrameChange>,
    pub tools: Vec<FrameChange>,
    pub bases: Vec<FrameChange>,
}

/// How a frame differs from its nominal one, along its own axes.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct FrameChange {
    pub position_m: Vector3<f64>,
    pub rotation_rad: Vector3<f64>,
}

impl FrameChange {
    /// From the nominal frame to the other one.
    pub fn isometry(&self) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::from(self.position_m),
            UnitQuaternion::from_scaled_axis(self.rotation_rad),
        )
    }

    /// Leaves the bits of a frame as they are where nothing is different.
    pub fn apply(&self, frame: &mut Isometry3<f64>) {
        if *self != Self::default() {
            *frame *= self.isometry();
        }
    }
}
