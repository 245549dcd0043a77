//! A robot's model as a file again, with what was identified: MJCF, or URDF.
//!
//! MuJoCo writes MJCF itself. Of a URDF only the numbers that were identified change; all else stays as it is written.

mod mjcf;
mod urdf;

use std::path::{Path, PathBuf};

use crate::codes::ErrorCode;
use crate::files::FileError;
use nalgebra::{Isometry3, Vector3};

use super::{Additions, Model};

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
    ) -> Result<WrittenModel, FileError> {
        mjcf::written(self, calibration, folder)
    }

    /// The same as URDF, of a model that is one.
    ///
    /// # Errors
    /// Something of it cannot be changed in the file, by name.
    pub fn calibrated_urdf(
        &self,
        calibration: &ModelCalibration,
        folder: &Path,
    ) -> Result<WrittenModel, FileError> {
        urdf::written(self, calibration, folder)
    }

    /// MuJoCo's identifiers of the chain's joints: of those that are not locked.
    pub(super) fn chain_joints(&self) -> Vec<usize> {
        (0..self.joints())
            .filter(|&joint| self.locked_at(joint).is_none())
            .collect()
    }

    /// The error for a file that cannot be written again with other numbers.
    fn not_written(&self, problem: impl Into<String>) -> FileError {
        let problem = problem.into();
        let problem = format!("cannot be written with what was identified: {problem}");
        FileError::new(self.path(), problem).code(ErrorCode::ModelNotWritten)
    }
}

/// How a file is named from a folder: relative to it where both hang on the same root.
fn way(folder: &Path, file: &Path) -> PathBuf {
    let absolute = |path: &Path| {
        let is_here = path.as_os_str().is_empty();
        let path = if is_here { Path::new(".") } else { path };
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        path.canonicalize().unwrap_or(path)
    };
    let (folder, file) = (absolute(folder), absolute(file));
    let same = (folder.components().zip(file.components()))
        .take_while(|(one, other)| one == other)
        .count();
    let mut way: PathBuf = folder.components().skip(same).map(|_| "..").collect();
    way.extend(file.components().skip(same));
    way
}

/// The folder of a file.
fn folder_of(path: &Path) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).to_owned()
}
