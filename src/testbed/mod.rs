//! The virtual calibration testbed: a robot in MuJoCo with compliant joints, loaded and measured.
//!
//! [`VirtualRobot`] is the only owner of the true compliances; what leaves this module towards
//! identification are [`Measurement`](crate::measurement::Measurement)s.

mod any_model;
mod chain;
mod circumstances;
mod instrument;
mod rest;
mod robots;
mod truth;
mod virtual_robot;

pub use circumstances::{Circumstances, ReadingNumbers, Visit};
pub use instrument::{add_noise, add_noise_of, measurements_of, numbers};
pub use rest::RestingBody;
pub use robots::{SeenFrom, TrueRobots};
pub use truth::{
    EarlierValues, RunTruth, SampledValue, TrueCompliances, TrueUnknown, Truth, values_of_run,
};
pub use virtual_robot::{Displacement, MeasurementError, VirtualRobot};
