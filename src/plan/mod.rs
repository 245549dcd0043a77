//! Plans of experiments (D1): which configurations and loads to measure.

mod accuracy;
mod assessment;
mod criterion;
mod factorisation;
mod feasibility;
mod file;
pub mod proof;
mod region;
pub mod search;

pub use crate::experiment::{Experiment, Plan};
pub use accuracy::{ExperimentModel, test_pose_weights};
pub use assessment::{Assessment, posterior};
pub use criterion::{Criterion, CriterionFunction};
pub use factorisation::LANES;
pub use feasibility::{Feasibility, Violation};
pub use file::{
    configuration_and_load, experiment_columns, experiment_fields, read_plan, write_plan,
};
pub use region::{SmoothBound, WIDENED_M, WIDENED_RAD, WIDENED_SHARE, bounds_of, widened};
