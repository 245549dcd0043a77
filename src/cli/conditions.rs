//! Conditions that several commands name.

use elastocal::codes::{Condition, ConditionCode};
use elastocal::plan::Assessment;
use elastocal::scenario::Scenario;
use elastocal::text::wording::counted;
use elastocal::understanding::implausible;

/// Efficiencies are rounded by less.
const BEYOND_ROUNDING: f64 = 1e-6;

/// What must be looked at of a plan.
pub fn conditions(scenario: &Scenario, assessment: &Assessment) -> Vec<Condition> {
    let undetermined = assessment.undetermined(&scenario.task.belief);
    let mut conditions: Vec<Condition> = (undetermined.iter())
        .map(|words| undetermined_by_plan(words))
        .collect();
    if assessment.violations.is_empty() {
        conditions.extend(below_bound(assessment.criterion_efficiency()));
    } else {
        // The bound is of plans without any.
        conditions.push(violated(assessment.violations.len()));
    }
    conditions.extend(assessment.conditions.iter().cloned());
    conditions.extend(implausible(scenario));
    conditions
}

/// That a plan has violations.
pub fn violated(count: usize) -> Condition {
    let violations = counted(count as u64, "violation");
    ConditionCode::Violation.with(format!("the plan has {violations}"))
}

/// That a plan does not determine something, in words.
pub fn undetermined_by_plan(words: &str) -> Condition {
    ConditionCode::PlanUnidentifiable.with(format!("the plan does not determine {words}"))
}

/// That a plan of an efficiency is better than the bound beside it, by more than rounding.
pub fn below_bound(efficiency: Option<f64>) -> Option<Condition> {
    let beyond = efficiency? - 1.0;
    (beyond > BEYOND_ROUNDING).then(|| {
        ConditionCode::BelowBound.with(format!(
            "the plan is better than the bound beside it by {:.2e} %",
            1e2 * beyond
        ))
    })
}

/// That a search was stopped.
pub fn search_stopped() -> Condition {
    ConditionCode::SearchStopped.with("the search was stopped: a better plan may exist")
}
