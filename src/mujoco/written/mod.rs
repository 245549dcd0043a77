//! A robot's model as a file again, with what was identified: MJCF, or URDF.
//!
//! MuJoCo writes MJCF itself. Of a URDF only the numbers that were identified change; all else stays as it is written.

mod edits;
mod mjcf;
mod mounted;
mod paths;
mod pose;
mod urdf;

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Vector3};

use super::{Additions, Model, ModelError};

/// What a written model says that the file does not. Joints are counted as in the chain of the model, without
/// those that are locked.
#[derive(Debug, Clone, Default)]
pub struct ModelCalibration {
    /// How the frame of each joint's link is displaced, along its own axes, the joint's zero included.
    pub links: Vec<Isometry3<f64>>,
    /// What is added to each joint's commanded coordinate (rad, m); it is in `links` already.
    pub zero: Vec<f64>,
    /// The compliance of each joint (rad/(N m), m/N).
    pub compliance: Vec<f64>,
    /// What each link weighs with all that is fixed to it, over what it weighs in the file.
    pub mass_factor: Vec<f64>,
    /// How far the centre of that mass lies from where it is in the file (m, link's frame).
    pub centre_shift_m: Vec<Vector3<f64>>,
    /// Sites that stand elsewhere: displacements along their own axes.
    pub sites: Vec<(String, Isometry3<f64>)>,
    /// Springs of tendons by name: stiffness (N/m) and lengths at which they are relaxed (m).
    pub springs: Vec<(String, f64, [f64; 2])>,
    /// What a scenario mounts: it stands in the written model. Obstacles do not.
    pub additions: Additions,
    /// Texts to keep with the model, by name.
    pub texts: Vec<(String, String)>,
}

/// The stiffness of a joint that is held to be rigid (N m/rad, N/m).
pub const RIGID: f64 = 1e14;

/// A written model.
#[derive(Debug, Clone)]
pub struct WrittenModel {
    /// Its text.
    pub text: String,
    /// What of the calibration or of the model the format has no words for.
    pub not_expressed: Vec<String>,
}

impl Model {
    /// The model's file as MJCF, calibrated, for a folder. This model has been read from that file, and may have locked
    /// joints and additions.
    ///
    /// # Errors
    /// Something of it cannot be changed in the file, by name.
    pub fn calibrated_mjcf(
        &self,
        calibration: &ModelCalibration,
        folder: &Path,
    ) -> Result<WrittenModel, ModelError> {
        mjcf::written(self, calibration, folder)
    }

    /// The same as URDF.
    ///
    /// # Errors
    /// Something of it cannot be changed in the file, by name.
    pub fn calibrated_urdf(
        &self,
        calibration: &ModelCalibration,
        folder: &Path,
    ) -> Result<WrittenModel, ModelError> {
        urdf::written(self, calibration, folder)
    }

    /// MuJoCo's identifiers of the chain's joints: of those that are not locked.
    pub(super) fn chain_joints(&self) -> Vec<usize> {
        (0..self.joints())
            .filter(|&joint| self.locked_at(joint).is_none())
            .collect()
    }

    fn not_written(&self, problem: impl Into<String>) -> ModelError {
        ModelError::NotWritten {
            path: PathBuf::from(self.path()),
            problem: problem.into(),
        }
    }
}
