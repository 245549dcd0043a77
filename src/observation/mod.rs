//! Setups, readings, and the one model that predicts them with their derivatives.
//!
//! A [`Setup`] is what the robot is told and what hangs on it; a [`Reading`] is what an instrument then
//! says: a deflection, a position or a pose. The [`ObservationModel`] predicts any reading and its
//! derivatives with respect to any [`ParameterSet`](crate::parameter::ParameterSet), in two forms: at
//! the commanded angles to first order in compliance (eqs. 3 to 8, extended), for planning; and through
//! the static equilibrium, for identification.
//!
//! What is planned is seen as [`PlannedReadings`]: by that model ([`ObservedRows`]) or, where deflections alone are read of
//! an arm without springs beside the joints' own, in the same form closed ([`FirstOrder`]), with gradients; tests hold the
//! two together.

mod first_order;
mod information;
mod model;
mod observed;
mod planned;
mod reading;
mod rotation;
mod shared;
mod sweep;
#[cfg(test)]
mod tests;

pub use first_order::FirstOrder;
pub use information::{
    NormalEquations, normal_equations, planned_information, planned_information_of_each,
    planned_positions,
};
pub use model::{Form, ObservationModel};
pub use observed::ObservedRows;
pub use planned::PlannedReadings;
pub use reading::{
    DeflectionPrecision, Observation, PlannedReading, Prediction, Reading, ReadingKind, Setup,
    Whitener,
};
pub use shared::{SharedErrors, shared_equations};
