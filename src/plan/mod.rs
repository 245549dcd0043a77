//! Plans of experiments (D1): which configurations and loads to measure.

pub mod absolute;
mod accuracy;
mod assessment;
mod conditions;
mod contributions;
mod criterion;
mod factorisation;
mod feasibility;
mod firmness;
mod predicted_accuracy;
pub mod proof;
mod region;
pub mod search;
mod turns;
mod uncertainty_budget;

pub use crate::experiment::{Experiment, Plan, read_plan, write_plan};
use accuracy::rows_of;
pub use accuracy::{ExperimentModel, as_repeats, sharing_groups};
pub use assessment::{Assessment, FurtherError, violated};
pub use conditions::less_than_nominal;
pub use contributions::left_by_readings;
use contributions::parameter_shares;
pub use criterion::{Criterion, CriterionFunction, no_wider_than_high};
pub use factorisation::LANES;
pub use feasibility::{Feasibility, LookingAt, Violation};
pub use predicted_accuracy::{posterior, quantile95_m, rho0_m, task_rows};
pub use region::{Bounded, SmoothBound, WIDENED_M, WIDENED_RAD, WIDENED_SHARE, bounds_of, widened};
pub use turns::take_nearest_turns;
pub use uncertainty_budget::{BudgetSource, EARLIER, Evaluation, NOISE, UncertaintyBudget};
