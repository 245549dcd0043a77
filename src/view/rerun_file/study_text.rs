//! The texts beside a study, in Markdown.

use std::fmt::Write;

use super::text::{heading, origin};
use crate::study::account::Contribution;
use crate::task::AccuracyKind;
use crate::text::markdown_text;
use crate::view::markup::for_page;
use crate::view::study_recording::{Snapshot, StudyRecording};
use crate::view::tables;

/// What is shown, and where it comes from.
pub(super) fn about(study: &StudyRecording) -> String {
    let provenance = &study.header.provenance;
    let mut text = heading(provenance, &study.arms.description);
    text += &format!("{}.\n\n", markdown_text(&study.title()));
    text += match study.header.accuracy() {
        AccuracyKind::Relative => {
            "Each run measures a plan with fresh noise, identifies the compliances and compensates; \
             the *distance* is what then remains between the loaded tool and where it should be at \
             the test pose."
        }
        AccuracyKind::Absolute => {
            "Each run reads a plan of another virtual robot and identifies it; the *distance* is that of the \
             loaded tool from where the identified robot predicts it at the test poses."
        }
    };
    text += " All plans see the same noise. Bars: % of runs per \u{b5}m, up to 95 % of them, of a plan and of what it is compared with.\n\n";
    if study.header.shards > 1 {
        let _ = writeln!(
            text,
            "This is one of {} shards of the study.\n",
            study.header.shards
        );
    }
    if study.arms.shows_robot() {
        text += "The robot walks through the plans' experiments and the test poses, one a snapshot; the \
                 timeline `step` has all of them. Red: force. Yellow: enlarged deflection. Translucent: \
                 the loaded arm. Green: the instrument's line of sight, or the way that a gauge reads.\n\n";
    }
    text + &origin(provenance)
}

/// What the runs so far say.
pub(super) fn table(study: &StudyRecording, snapshot: &Snapshot) -> String {
    let failed: u64 = snapshot.plans.iter().map(|plan| plan.failed).sum();
    let plans: Vec<_> = snapshot.plans.iter().collect();
    let mut text = format!(
        "**{} of {} runs**\n\n{}",
        snapshot.runs,
        study.header.trials,
        tables::study(&plans, false).first(5).markdown()
    );
    for plan in &snapshot.plans {
        if let Some(outcome) = plan.outcome() {
            let outcome = for_page(&outcome);
            let _ = writeln!(text, "\n{}: {outcome}.", markdown_text(&plan.name));
        }
    }
    if failed > 0 {
        let _ = writeln!(text, "\n{failed} runs failed.");
    }
    text
}

/// Where each plan's errors come from, where the scenario lists what is uncertain.
pub(super) fn sources(snapshot: &Snapshot) -> Option<String> {
    let is_some = |part: &Contribution| part.contribution_um > Some(0.0);
    let plans = snapshot.plans.iter();
    let plans = plans.filter(|plan| plan.contributions.iter().any(is_some));
    let listed = plans.map(|plan| {
        let table = tables::contributions(&plan.contributions).markdown();
        format!("#### {}\n\n{table}\n", markdown_text(&plan.name))
    });
    let text: String = listed.collect();
    (!text.is_empty()).then_some(text)
}
