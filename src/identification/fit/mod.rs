//! Fits: one Gauss-Newton, for deflections and for any parameters and readings.

mod deflections;
mod gauss_newton;
mod readings;

pub(super) use deflections::{FitStart, fit_linear, fit_nonlinear};
pub(super) use gauss_newton::FitProblem;
pub(super) use readings::{FittedReadings, Haste, LinearReadings, ReadingProblem};
pub use readings::{ParameterFit, fit_parameters};
