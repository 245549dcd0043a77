//! What to do next, and what holds of a run.

use super::PlanPage;
use super::cards::{conditions_card, length};
use crate::plan::Assessment;
use crate::record::evidence::EvidenceMessage;
use crate::text::wording::{joined, naming, shell_path};
use crate::view::card::Card;
use crate::view::markup::{escaped, paragraph, section};
use crate::workflow::run::RunOutcome;

/// What holds where there is nothing to look at.
const ALL_HOLD: &str = "On the virtual robot: every compliance that was asked for is determined, the residuals fit the instrument, and \
                        the plan keeps all bounds of the scenario.";

/// A card of what must be looked at, or that all holds.
pub fn checks_card(shown: &PlanPage<'_>, outcome: &RunOutcome) -> Card {
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
    let holds = || Card::new("good", "Checks", answer, ALL_HOLD.to_owned() + &of_others);
    conditions_card(shown.conditions).unwrap_or_else(holds)
}

/// What to do with a plan of a scenario in the laboratory, and how to get a better one.
pub fn next_steps(shown: &PlanPage<'_>, more: Option<(String, String)>) -> String {
    let [path, plan] = [shown.scenario.path.as_path(), shown.plan].map(shell_path);
    let groups = shown.parameters.iter().map(|group| group.word());
    let groups = match joined(groups, ",") {
        none if none.is_empty() => none,
        groups => format!(" --parameters {groups}"),
    };
    let step = |(text, command): (String, String)| {
        let command = escaped(&format!("elastocal {command}"));
        format!("<li>{}<code>{command}</code></li>\n", escaped(&text))
    };
    let steps = [
        (
            "Make the run sheet, the robot's program and the table to fill in:",
            format!("lab {path} --plan {plan}"),
        ),
        (
            "Identify the robot from the table, with uncertainty and a check of the residuals:",
            format!(
                "identify {path} --measurements measurements.csv{groups} --identified-out identified.json"
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
