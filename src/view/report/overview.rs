//! What a run's report answers first: which plan, how accurate, proved by what; and what to do.

use std::path::Path;

use super::{PlanPage, bound_card, checks_card, random_card};
use crate::plan::search::{BoundKind, RepeatsNeeded};
use crate::plan::{Assessment, UncertaintyBudget};
use crate::record::evidence::EvidenceMessage;
use crate::scenario::Scenario;
use crate::text::wording::{counted, micrometres, naming, shell_path};
use crate::view::markup::{card, escaped, heading, paragraph, section};
use crate::workflow::run::{RunOutcome, TriedPlan};

/// Searches of which at least this share agree count as agreeing.
const MANY: f64 = 0.05;

/// A length (m), for a person.
fn length(value_m: Option<f64>) -> String {
    micrometres(value_m.map(|value_m| value_m * 1e3))
}

/// What holds where there is nothing to look at.
const ALL_HOLD: &str = "On the virtual robot: every compliance that was asked for is determined, the residuals fit the instrument, and \
                        the plan keeps all bounds of the scenario.";

/// Title and cards.
pub fn overview(shown: &PlanPage<'_>, outcome: &RunOutcome, own: &TriedPlan) -> String {
    let (scenario, assessment) = (shown.scenario, &own.assessment);
    let violating = (outcome.tried.iter().skip(1))
        .filter(|plan| plan.assessment.violated().is_some())
        .map(|plan| &plan.record.name);
    let of_others = naming(
        violating,
        " Of the plans beside it, {} keep not all of them.",
    );
    let answer = match &*of_others {
        "" => "all hold",
        _ => "all hold for this plan",
    };
    let (median_m, own_m) = (outcome.random_rho0_m, assessment.rho0_m);
    let repeats = repeats(outcome.random_repeats);
    let holds = format!("{ALL_HOLD}{of_others}");
    let cards = [
        plan_card(scenario, own),
        accuracy_card(own),
        proof_card(&outcome.evidence, assessment),
        random_card(median_m, own_m, "", &repeats),
        checks_card(shown.conditions, (answer, &holds)),
    ];
    let title = format!("Calibration plan: {}", scenario.name);
    heading(&title, &scenario.description, &cards.concat())
}

fn plan_card(scenario: &Scenario, own: &TriedPlan) -> String {
    let measurements = counted(own.assessment.experiments.into(), "measurement");
    let configurations = counted(own.record.plan.len() as u64, "configuration");
    let parameters = scenario.task.belief.parameter_names();
    let about = naming(parameters, "Identifies the compliance of {}.");
    card(
        "",
        "Plan",
        &format!("{measurements} in {configurations}"),
        &about,
    )
}

fn accuracy_card(own: &TriedPlan) -> String {
    let (assessment, poses) = (&own.assessment, &*own.record.test_poses);
    let largest = poses.iter().map(|pose| pose.uncompensated_mm);
    let bent = micrometres(largest.max_by(f64::total_cmp));
    let uncompensated = match poses {
        [pose] => format!("at \u{201c}{}\u{201d} it bends by {bent}", pose.name),
        _ => format!("it bends by up to {bent}"),
    };
    let about = format!(
        "\u{3c1}\u{2080}, the rms distance between the loaded tool and its place, predicted {}{}: a relative accuracy, of what the load bends. Uncompensated, {}.",
        UncertaintyBudget::in_words(assessment.uncertainty_budget.as_ref(), "measurement"),
        (assessment.quantile95_m).map_or_else(String::new, |value_m| format!(
            "; 95 % stay below {}",
            length(Some(value_m))
        )),
        uncompensated
    );
    let answer = length(assessment.rho0_m) + " rms";
    card("", "Accuracy after compensation", &answer, &about)
}

fn proof_card(evidence: &EvidenceMessage, assessment: &Assessment) -> String {
    let (searches, agreeing) = (evidence.bound_searches, evidence.bound_searches_agreeing);
    let (Some(bound), Some(efficiency)) = (assessment.bound_m(), assessment.efficiency()) else {
        let reason = assessment.no_bound().map(|reason| format!(": {reason}"));
        let reason = reason.unwrap_or_default();
        let about = format!("Nothing is known about better plans{reason}.");
        return card("bad", "Is it the best?", "no bound", &about);
    };
    let found = assessment.bound();
    let proved = found.filter(|bound| bound.kind == BoundKind::Proved);
    let proved = proved.and_then(|bound| bound.proof.as_ref());
    let basis = match proved {
        Some(proof) => format!(
            "That is proved, by branch and bound over {} boxes of configurations.",
            proof.boxes
        ),
        None => format!(
            "The bound rests on {searches} local searches for a more telling experiment; {agreeing} ended in the same \
             best one: strong evidence. {}",
            proved_of_it(assessment)
        ),
    };
    let tone = if proved.is_some() || agreeing as f64 >= MANY * searches as f64 {
        "good"
    } else {
        ""
    };
    bound_card(tone, bound * 1e3, efficiency, "measurements", &basis)
}

/// What a proof says that does not reach the bound, and what it takes for certain.
fn proved_of_it(assessment: &Assessment) -> String {
    let Some(proof) = assessment.bound().and_then(|bound| bound.proof.as_ref()) else {
        return "There is no proof.".to_owned();
    };
    let certain = naming(&proof.left_out, ", with {} assumed exact");
    format!(
        "Proved, by branch and bound over {} boxes of configurations: none can be below {}{certain}.",
        proof.boxes,
        length(Some(proof.best)),
    )
}

/// How often a random plan is to be repeated for the accuracy of the designed one.
fn repeats(needed: Option<RepeatsNeeded>) -> String {
    match needed {
        Some(RepeatsNeeded::Times(times)) => {
            format!(" That plan gets as far if it is measured {times} times as a whole.")
        }
        Some(RepeatsNeeded::Never(limit_m)) => format!(
            " No number of repeats of that plan gets as far: {} remain however often it is measured.",
            length(Some(limit_m))
        ),
        None => String::new(),
    }
}

/// What to do with a plan of a scenario in the laboratory, and how to get a better one.
pub fn next_steps(scenario: &Path, more: Option<(String, String)>) -> String {
    let path = shell_path(scenario);
    let step = |(text, command): (String, String)| {
        let command = escaped(&format!("elastocal {command}"));
        format!("<li>{}<code>{command}</code></li>\n", escaped(&text))
    };
    let steps = [
        (
            "Make the run sheet, the robot's program and the table to fill in:",
            format!("lab {path} --plan plan.csv"),
        ),
        (
            "Identify the robot from the table, with uncertainty and a check of the residuals:",
            format!(
                "identify {path} --measurements measurements.csv --identified-out identified.json"
            ),
        ),
        (
            "Validate it by measurements that were not fitted:",
            format!("validate {path} --identified identified.json --measurements others.csv"),
        ),
        (
            "Compute the joint angles to command at the test poses:",
            format!("compensate {path} --identified identified.json"),
        ),
    ];
    let steps = steps.map(|(text, command)| (text.to_owned(), command));
    let more = more.map(|(text, options)| (text, format!("plan {path} {options}")));
    let lead = paragraph("Instead of the virtual robot, on yours:");
    let steps: String = steps.into_iter().chain(more).map(step).collect();
    let body = format!("{lead}<ol class=\"next\">\n{steps}</ol>\n");
    section("next", "What to do next", &body)
}

/// The next larger plan that was searched.
pub fn more_accurate(
    evidence: &EvidenceMessage,
    assessment: &Assessment,
) -> Option<(String, String)> {
    let larger =
        (evidence.accuracy.iter()).find(|point| point.experiments > assessment.experiments)?;
    let m = larger.experiments;
    let text = format!(
        "If {} is not enough: {m} measurements reach {}.",
        length(assessment.rho0_m),
        length(Some(larger.rho0_m))
    );
    Some((text, format!("--experiments {m} --plan-out plan.csv")))
}
