//! Setups, readings, and the one model that predicts them with their derivatives.
//!
//! A [`Setup`] is what the robot is told and what hangs on it; a [`Reading`] is what an instrument then
//! says: a deflection, a position or a pose. The [`ObservationModel`] predicts any reading and its
//! derivatives with respect to any [`ParameterSet`](crate::parameter::ParameterSet), in two forms: at
//! the commanded angles to first order in compliance (eqs. 3 to 8, extended), for planning; and through
//! the static equilibrium, for identification.
//!
//! What is planned is seen as [`PlannedReadings`], by that model (`observed`). Two closed forms stand beside it, each tied to it by a
//! test: rows and gradients of compliances alone, where only the instrument's noise disturbs (`compliances`), and the gradient of
//! deflections of an arm without springs beside the joints' own (`gradient`). How sources of errors move a reading, and so any
//! covariance, is told in one place (`reading_errors`): [`ReadingErrors`] are those of absolute readings by level;
//! [`ConfigurationEquations`] say what readings of one configuration tell together, which share them.

mod compliances;
mod gradient;
mod information;
mod length;
mod linear;
mod model;
mod observed;
mod planned;
mod reading;
mod reading_errors;
mod rotation;
mod shared;
mod shown;
mod sweep;
#[cfg(test)]
mod tests;
mod visits;
#[cfg(test)]
mod visits_tests;

pub use compliances::{BareArm, ComplianceColumns};
pub use information::{
    NormalEquations, of_each_prediction, planned_information, planned_positions, planned_rows,
    turning_load_rows,
};
pub use length::{LengthKind, ReadLength};
pub use linear::LinearObservations;
pub use model::{ObservationModel, RestTorques};
pub use planned::{CovarianceTogether, NOTHING_READ, PlannedReadings};
pub use reading::{
    DeflectionPrecision, Hook, Observation, PlannedReading, Prediction, Reading, ReadingKind,
    Setup, Whitener,
};
pub use reading_errors::{ReadingErrors, SharedRounding, turned_columns, turned_covariance};
pub use shared::{SharedErrors, SharingReadings, normal_equations, planned_information_of_groups};
pub use visits::{ConfigurationEquations, SharingReading, Together, Visits, visits_of};
