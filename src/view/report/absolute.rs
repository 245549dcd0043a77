//! The page of a plan of absolute readings: what is predicted, of what it is made, what to read, and what virtual robots make of it.

use serde_json::{Value, json};

use super::PlanPage;
use super::cards::of_readings;
use super::distances::{distances, lines};
use super::test_poses::test_poses;
use crate::identification::AbsoluteMessage;
use crate::quantities::units::shown_unit;
use crate::record::absolute_plan::{AbsolutePlanMessage, PredictedUnknownMessage};
use crate::record::robot_trials::RobotTrials;
use crate::view::markup::{PageError, micro_sign, page};
use crate::view::tables;
use crate::workflow::run::{AbsoluteRun, RUN};

/// Which accuracy a page of absolute readings is about.
pub const ABSOLUTE_ACCURACY: &str = "An absolute accuracy: where the loaded tool is, with frames, geometry and elasticity as far as they are unknown.";

/// The page of a plan of absolute readings as HTML; with what virtual robots made of it, where some were drawn, and of its run, where it was
/// carried out.
///
/// # Errors
/// See [`PageError`].
pub fn absolute_page(
    shown: &PlanPage<'_>,
    plan: &AbsolutePlanMessage,
    trials: Option<&RobotTrials>,
    run: Option<&AbsoluteRun<'_>>,
) -> Result<String, PageError> {
    let scenario = shown.scenario;
    let has_poses = plan.test_poses.len() > 1 || run.is_some();
    let test_poses = has_poses.then(|| {
        let predicted_mm = plan.test_poses.iter().map(|pose| pose.rho0_mm);
        let observed = run.map(|run| (&*run.record.test_poses, "of the nominal robot"));
        let poses = &scenario.task.test_poses;
        test_poses(poses, predicted_mm, plan.rho0_mm, observed)
    });
    let budget = plan.uncertainty_budget.as_ref();
    let of_plan = shown.shown(budget, test_poses.as_ref(), &plan.plan);
    let json = json!({
        "page": of_plan,
        "readings": of_readings(plan, run),
        "trials": trials.map(of_trials),
        "run": run.map(identified),
        "unknowns": plan.unknowns.iter().map(unknown).collect::<Vec<_>>(),
    });
    let tab = match run {
        Some(_) => "calibration report",
        None => "plan of absolute readings",
    };
    let title = format!("{}: {tab}", scenario.name);
    page(&title, "readings.html", &json)
}

/// The verdict in words, the distances that were left, and the numbers.
fn of_trials(trials: &RobotTrials) -> Value {
    let only = std::slice::from_ref(&trials.runs);
    json!({
        "outcome": trials.outcome(),
        "prediction": trials.prediction,
        "runs": trials.runs,
        "distances": distances(only, &lines(only, |_| false)),
    })
}

/// How well an unknown is known afterwards.
fn unknown(unknown: &PredictedUnknownMessage) -> Value {
    let (factor, unit) = shown_unit(&unknown.unit);
    json!({
        "name": unknown.name,
        "error": unknown.standard_error.map(|error| error * factor),
        "unit": micro_sign(unit),
        "what": unknown.what,
        "mounted": unknown.mounted,
    })
}

/// What was identified, beside the simulated truth.
fn identified(run: &AbsoluteRun<'_>) -> Value {
    let found = AbsoluteMessage::new(&run.identified.case, &run.identified.fit);
    json!({
        "number": RUN,
        "found": found,
        "table": tables::unknowns(&found, &run.record.truth),
    })
}
