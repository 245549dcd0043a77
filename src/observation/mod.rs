//! Setups, readings, and the one model that predicts them with their derivatives.
//!
//! A [`Setup`] is what the robot is told and what hangs on it; a [`Reading`] is what an instrument then
//! says: a deflection, a position or a pose. The [`ObservationModel`] predicts any reading and its
//! derivatives with respect to any [`ParameterSet`](crate::parameter::ParameterSet), in two forms: at
//! the commanded angles to first order in compliance (eqs. 3 to 8, extended), for planning; and through
//! the static equilibrium, for identification.
//!
//! What is planned is seen as [`PlannedReadings`]: by that model (`observed`) or in the same form closed, with
//! gradients: where deflections alone are read of an arm without springs beside the joints' own (`first_order`), and
//! where compliances alone are unknown and only the instrument's noise disturbs (`compliances`). Tests hold the
//! three together. [`ReadingErrors`] are those of absolute readings besides the instrument's noise; [`ConfigurationEquations`] say what
//! readings of one configuration tell together, which share them.

mod braced;
mod compliances;
mod first_order;
mod information;
mod model;
mod observed;
mod planned;
mod reading;
mod reading_errors;
mod rotation;
mod shared;
mod sweep;
#[cfg(test)]
mod tests;
mod visits;
#[cfg(test)]
mod visits_tests;

pub use braced::BareArm;
pub use compliances::ComplianceColumns;
pub use first_order::FirstOrder;
pub use information::{
    NormalEquations, normal_equations, planned_information, planned_information_of_each,
    planned_positions, planned_rows,
};
pub use model::{Form, ObservationModel};
pub use planned::{CovarianceTogether, NOTHING_READ, PlannedReadings};
pub use reading::{
    DeflectionPrecision, Observation, PlannedReading, Prediction, Reading, ReadingKind, Setup,
    Whitener,
};
pub use reading_errors::ReadingErrors;
pub use shared::{SharedErrors, SharingReadings, shared_equations};
pub use visits::{ConfigurationEquations, SharingReading, Together, Visits, visits_of};
