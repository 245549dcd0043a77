//! The records of what a designed plan is shown beside.

use serde::{Serialize, Serializer};
use serde_json::json;

use super::messages::ExperimentMessage;
use super::study::StudyPlanMessage;
use crate::plan::search::BudgetPoint;

/// What a designed plan is shown beside, and what its bound rests on.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EvidenceMessage {
    /// The number of local searches that the lower bound rests on.
    pub bound_searches: usize,
    /// How many of them ended within 0.1 % of the largest directional derivative.
    pub bound_searches_agreeing: usize,
    /// The number of runs of each plan in `study`.
    pub trials: u64,
    /// Many runs of each plan by the linear model.
    pub study: Vec<StudyPlanMessage>,
    /// The best plans for other criteria.
    pub criteria_compared: Vec<CriterionPlanMessage>,
    /// The best accuracy that was found for other numbers of measurements.
    #[serde(serialize_with = "written")]
    pub accuracy: Vec<BudgetPoint>,
    /// The designed plan, repeated as a whole.
    #[serde(serialize_with = "written")]
    pub repeated: Vec<BudgetPoint>,
    /// The lower bound of `rho0_mm` for 1, 2, 3, ... measurements (mm); null where there is none.
    pub lower_bounds_rho0_mm: Vec<Option<f64>>,
}

/// The best plan for a criterion, judged at the test poses.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CriterionPlanMessage {
    /// The criteria that the plan is best for.
    pub criteria: Vec<String>,
    /// Its predicted rms distance at the test poses (mm).
    pub rho0_mm: Option<f64>,
    /// How many searches ended in a plan as good for these criteria.
    pub searches_agreeing: Option<usize>,
    /// Why there is no plan, where there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub problem: Option<String>,
    /// The plan.
    pub plan: Vec<ExperimentMessage>,
}

/// The accuracy and the bound for each number of measurements and of configurations.
fn written<S: Serializer>(points: &[BudgetPoint], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(points.iter().map(|point| {
        json!({
            "experiments": point.experiments,
            "configurations": point.configurations,
            "rho0_mm": point.rho0_m * 1e3,
            "lower_bound_rho0_mm": point.lower_bound_m().map(|bound_m| bound_m * 1e3),
        })
    }))
}
