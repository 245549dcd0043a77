//! The records of what a designed plan is shown beside.

use serde::{Serialize, Serializer};
use serde_json::{Value, json};

use super::messages::plan_messages;
use super::study::StudyPlanMessage;
use crate::plan::search::{BudgetPoint, CriterionPlan};
use crate::robot::Commands;

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
    /// The best plans for other criteria, see [`criterion_plan_json`].
    pub criteria_compared: Vec<Value>,
    /// The best accuracy that was found for other numbers of measurements.
    #[serde(serialize_with = "written")]
    pub accuracy: Vec<BudgetPoint>,
    /// The designed plan, repeated as a whole.
    #[serde(serialize_with = "written")]
    pub repeated: Vec<BudgetPoint>,
    /// The lower bound of `rho0_mm` for 1, 2, 3, ... measurements (mm); null where there is none.
    pub lower_bounds_rho0_mm: Vec<Option<f64>>,
}

/// The best plan for some criteria, with what it predicts at the test poses; how many searches ended in a plan as good for these, or why
/// there is none.
pub fn criterion_plan_json(commands: &Commands, best: &CriterionPlan) -> Value {
    let mut record = json!({
        "criteria": best.criteria,
        "rho0_mm": best.rho0_m.map(|value| value * 1e3),
        "searches_agreeing": best.agreeing,
        "plan": plan_messages(commands, &best.plan),
    });
    if let Some(problem) = &best.problem {
        record["problem"] = json!(problem);
    }
    record
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
