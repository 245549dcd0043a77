//! Absolute readings: where an instrument sees a target, in a frame of its own.

use nalgebra::{DVector, Matrix6, UnitQuaternion, Vector3};

use crate::observation::ReadLength;
use crate::robot::{Approach, CommandPose, Load};

/// One row of a file of absolute readings.
#[derive(Debug, Clone, PartialEq)]
pub struct AbsoluteReading {
    /// The commanded joint angles q (rad; m where a joint slides).
    pub configuration_rad: DVector<f64>,
    /// The load W, in the world frame at the calibration tool; none where the file has no loads.
    pub load: Load,
    /// The site of the model that is read; the calibration tool where there is none.
    pub target: Option<String>,
    /// Where the instrument stands: readings of one station are in one frame.
    pub station: Option<String>,
    /// The visit: the robot has not left the configuration between its readings. Where no reading says it, the k-th of each target in
    /// one configuration, under one load and from one station, is of visit k.
    pub visit: Option<String>,
    /// The target's position in the instrument's frame (m).
    pub position_m: Vector3<f64>,
    /// The target's axes in the instrument's frame, where poses are read.
    pub rotation: Option<UnitQuaternion<f64>>,
    /// The length that ends at the target, where that alone is read: there is no position then.
    pub length: Option<ReadLength>,
    /// The covariance of position (m) and rotation (rad, a rotation vector in the instrument's frame) where it is known
    /// for this reading alone; of a position only the first three rows and columns count, of a length the first.
    pub covariance: Option<Matrix6<f64>>,
    /// From which side the configuration was approached.
    pub approach: Option<Approach>,
    /// When it was read (s).
    pub time_s: Option<f64>,
    /// How warm it was (deg C).
    pub temperature_c: Option<f64>,
}

impl AbsoluteReading {
    /// Its command pose.
    pub const fn pose(&self) -> CommandPose<'_> {
        (&self.configuration_rad, self.approach.as_ref())
    }
}
