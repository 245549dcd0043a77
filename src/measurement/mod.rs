//! Measurements: what a laboratory or the virtual robot delivers, and the only input of identification.
//!
//! A file holds deflections, loaded minus unloaded ([`Measurement`]), or absolute readings: where an instrument sees a
//! target, in a frame of its own ([`AbsoluteReading`]).

mod absolute;
mod columns;
pub mod foreign;
mod origin;
mod read;
mod read_absolute;
mod write;

use nalgebra::{DVector, Vector3};

use crate::experiment::{is_one_configuration, together};
use crate::robot::{Approach, Load};

pub use absolute::AbsoluteReading;
pub use columns::{POSITION, QUATERNION, rotation_of};
pub use origin::{CONTROLLER_COMPENSATES, Origin, SimulatedRun, controller_compensates};
pub use read::{
    MeasuredArm, MeasuredFile, read_measured, read_measured_so_far, read_measurements,
    read_measurements_so_far,
};
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
    /// Whether both are of one experiment: the same configuration, load, direction and side of approach, to the bit.
    pub fn repeats(&self, other: &Self) -> bool {
        (self.load, self.direction) == (other.load, other.direction)
            && self.stands_at(&other.configuration_rad, other.approach.as_ref())
    }

    /// Whether it was made in a [configuration](is_one_configuration), whatever hung there.
    pub fn stands_at(&self, configuration_rad: &DVector<f64>, approach: Option<&Approach>) -> bool {
        is_one_configuration(
            (&self.configuration_rad, self.approach.as_ref()),
            (configuration_rad, approach),
        )
    }
}

/// The places of measurements, those that [repeat](Measurement::repeats) one another together, experiments in the order of their
/// first measurement.
pub fn by_experiment(measurements: &[Measurement]) -> Vec<Vec<usize>> {
    together(
        measurements.len(),
        |place| &measurements[place].configuration_rad,
        |one, other| measurements[one].repeats(&measurements[other]),
    )
}

/// The places of measurements, those of one configuration together, whatever hung there, in the order of the first.
pub fn by_configuration(measurements: &[Measurement]) -> Vec<Vec<usize>> {
    together(
        measurements.len(),
        |place| &measurements[place].configuration_rad,
        |one, other| {
            let other = &measurements[other];
            measurements[one].stands_at(&other.configuration_rad, other.approach.as_ref())
        },
    )
}

/// A measured rotation of the tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotationMeasurement {
    /// The rotation vector in the world frame (rad).
    pub vector_rad: Vector3<f64>,
    /// The standard deviations of its coordinates (rad).
    pub sigma_rad: Vector3<f64>,
}
