//! What the cards say that a page begins with and a terminal shows, see `pages/cards.html`.

use serde_json::{Value, json};

use super::each_once;
use crate::calibration::rms_m;
use crate::plan::UncertaintyBudget;
use crate::plan::search::RepeatsNeeded;
use crate::record::absolute_plan::AbsolutePlanMessage;
use crate::record::messages::assessment_json;
use crate::scenario::Scenario;
use crate::text::for_terminal;
use crate::view::markup::{PageError, filled};
use crate::workflow::run::{AbsoluteRun, RANDOM_PLANS, RUN, RunOutcome};

/// Cards for a terminal, each a line: `of_run`, `of_readings` or `of_best`, a plan of a study.
///
/// # Errors
/// See [`PageError`].
pub fn cards(kind: &str, shown: &Value) -> Result<String, PageError> {
    let text = filled("cards.txt", &json!({ "kind": kind, "shown": shown }))?;
    Ok(for_terminal(&text))
}

/// A run of deflections.
pub fn of_run(scenario: &Scenario, outcome: &RunOutcome) -> Value {
    let own = &outcome.tried[0];
    let (assessment, made) = (&own.assessment, &own.calibration);
    let violating = (outcome.tried.iter().skip(1))
        .filter(|plan| plan.assessment.violated().is_some())
        .map(|plan| &plan.record.name);
    let undetermined = (made.identification.parameters.iter())
        .filter(|each| each.estimate.is_none())
        .map(|each| &each.name);
    let [_, after_m] = rms_m(&made.poses);
    let budget = assessment.uncertainty_budget.as_ref();
    let (median_m, repeats) = (outcome.random_rho0_m, outcome.random_repeats);
    json!({
        "assessment": assessment_json(scenario, assessment),
        "counts": UncertaintyBudget::in_words(budget, "measurement"),
        "calibration": own.record,
        "number": RUN,
        "residual_mm": after_m * 1e3,
        "evidence": outcome.evidence,
        "random": random(median_m, assessment.rho0_m, repeats),
        "violating": violating.collect::<Vec<_>>(),
        "undetermined": undetermined.collect::<Vec<_>>(),
    })
}

/// A plan of absolute readings, and its run, where there was one.
pub fn of_readings(plan: &AbsolutePlanMessage, run: Option<&AbsoluteRun<'_>>) -> Value {
    let rows = || plan.plan.iter();
    let reads = || rows().filter_map(|row| row.reads.as_ref());
    let run = run.map(|run| {
        let rho0_m = plan.rho0_mm.map(|value| value * 1e-3);
        let [before_m, after_m] = rms_m(&run.poses);
        json!({
            "number": RUN,
            "residual_mm": after_m * 1e3,
            "nominal_mm": before_m * 1e3,
            "random": random(run.random_rho0_m, rho0_m, None),
        })
    });
    json!({
        "plan": plan,
        "configurations": each_once(rows().map(|row| &row.q_deg)).len(),
        "loaded": rows().filter(|row| row.wrench.is_some()).count(),
        "targets": each_once(reads().filter_map(|reads| reads.target.as_ref())),
        "stations": each_once(reads().filter_map(|reads| reads.station.as_ref())),
        "counts": UncertaintyBudget::in_words(plan.uncertainty_budget.as_ref(), "reading"),
        "run": run,
    })
}

/// What random plans predict (m) in the median, beside a plan's own, and how often such a plan is to be repeated for that; nothing where
/// there are none.
fn random(
    median_m: Option<f64>,
    own_m: Option<f64>,
    repeats: Option<RepeatsNeeded>,
) -> Option<Value> {
    let (median_m, own_m) = median_m.zip(own_m)?;
    Some(json!({
        "plans": RANDOM_PLANS,
        "median_mm": median_m * 1e3,
        "times": median_m / own_m,
        "repeats": repeats,
    }))
}
