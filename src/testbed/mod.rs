//! The virtual calibration testbed: a robot in MuJoCo with compliant joints, loaded and measured.
//!
//! [`VirtualRobot`] is the only owner of the true compliances; what leaves this module towards
//! identification are [`Measurement`](crate::measurement::Measurement)s.

mod any_model;
mod arm;
mod chain;
mod circumstances;
mod instrument;
mod rest;
mod robots;
mod true_compliances;
mod truth;
mod virtual_robot;

pub use circumstances::{Circumstances, ReadingNumbers, Visit};
pub use instrument::{add_noise, add_noise_of, measurements_of, numbers};
pub use rest::RestingBody;
pub use robots::{SeenFrom, TrueRobots};
pub use true_compliances::{TrueCompliances, values_of_run};
pub use truth::{EarlierValues, RunTruth, SampledValue, TrueUnknown, Truth};
pub use virtual_robot::{Displacement, MeasurementError, VirtualRobot};
