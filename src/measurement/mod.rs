//! Measurements: what a laboratory or the virtual robot delivers, and the only input of identification.
//!
//! A file holds deflections, loaded minus unloaded ([`Measurement`]), or absolute readings: where an instrument sees a
//! target, in a frame of its own ([`AbsoluteReading`]).

mod columns;
mod digest;
pub mod foreign;
mod origin;
mod read;
mod read_absolute;
mod write;

use nalgebra::{DVector, Matrix6, UnitQuaternion, Vector3};

use crate::experiment::together;
use crate::observation::ReadLength;
use crate::robot::{Approach, CommandPose, Load};

pub use columns::{POSITION, QUATERNION, rotation_of};
pub use digest::{Digested, count_among, digests_of};
pub use origin::{CONTROLLER_COMPENSATES, Origin, SimulatedRun, controller_compensates};
pub use read::{MeasuredArm, MeasuredFile, read_measured, read_measured_so_far, read_measurements};
pub use write::{
    RowToFillIn, absolute_table, deflection_table, readings_to_fill_in, table_to_fill_in,
};

/// One calibration experiment's outcome (A2).
#[derive(Debug, Clone, PartialEq)]
pub struct Measurement {
    /// The commanded joint angles q (rad).
    pub configuration_rad: DVector<f64>,
    /// The load W, in the world frame at the calibration tool.
    pub load: Load,
    /// Loaded minus unloaded position of the tool in the world frame, dp (m).
    pub deflection_m: Vector3<f64>,
    /// Standard deviations of the deflection's coordinates (m), where they are known for this
    /// measurement alone.
    pub sigma_m: Option<Vector3<f64>>,
    /// The tool's rotation from unloaded to loaded as a rotation vector in the world frame (rad)
    /// with its standard deviations, where rotations are measured too.
    pub rotation: Option<RotationMeasurement>,
    /// From which side the configuration was approached, unloaded and loaded, where that is known.
    pub approach: Option<Approach>,
    /// The direction (unit vector, world frame) along which alone a gauge has read the deflection; none where it is all of it.
    pub direction: Option<Vector3<f64>>,
}

impl Measurement {
    /// Its command pose.
    pub const fn pose(&self) -> CommandPose<'_> {
        (&self.configuration_rad, self.approach.as_ref())
    }
}

/// The places of measurements, those of one experiment together: of the same configuration, load and direction, in the order of the first.
pub fn by_experiment(measurements: &[Measurement]) -> Vec<Vec<usize>> {
    let pose = |place: usize| measurements[place].pose();
    let hung = |place: usize| (measurements[place].load, measurements[place].direction);
    together(measurements.len(), pose, |one, other| {
        hung(one) == hung(other)
    })
}

/// The places of measurements, those of one configuration together, whatever hung there, in the order of the first.
pub fn by_configuration(measurements: &[Measurement]) -> Vec<Vec<usize>> {
    let pose = |place: usize| measurements[place].pose();
    together(measurements.len(), pose, |_, _| true)
}

/// A measured rotation of the tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotationMeasurement {
    /// The rotation vector in the world frame (rad).
    pub vector_rad: Vector3<f64>,
    /// The standard deviations of its coordinates (rad).
    pub sigma_rad: Vector3<f64>,
}

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
