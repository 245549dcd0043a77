//! The texts beside a study, in Markdown.

use std::fmt::Write;

use crate::task::AccuracyKind;
use crate::text::markdown_text;
use crate::view::study_recording::{Snapshot, StudyRecording};

/// What is shown, and where it comes from.
pub(super) fn about(study: &StudyRecording) -> String {
    let provenance = &study.header.provenance;
    let mut text = format!(
        "## {}\n\n{}\n\n{}.\n\n",
        markdown_text(&provenance.scenario),
        markdown_text(&study.arms.description),
        markdown_text(&study.title())
    );
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
    text += " All plans see the same noise.\n\n";
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
                 the loaded arm. Green: the tracker's line of sight.\n\n";
    }
    let _ = writeln!(
        text,
        "elastocal {}, commit {}, seed {}, scenario hash {}",
        provenance.version, provenance.commit, provenance.seed, provenance.scenario_sha256
    );
    text
}

/// What the runs so far say.
pub(super) fn table(study: &StudyRecording, snapshot: &Snapshot) -> String {
    let micro = |value: Option<f64>| {
        value.map_or_else(|| "-".to_owned(), |value| format!("{:.2}", value * 1e3))
    };
    let failed: u64 = snapshot.plans.iter().map(|plan| plan.failed).sum();
    let mut text = format!(
        "**{} of {} runs**\n\n| plan | mean [µm] | 95 % interval | rms [µm] | expected rms [µm] |\n|:--|--:|--:|--:|--:|\n",
        snapshot.runs, study.header.trials
    );
    for plan in &snapshot.plans {
        let interval = plan.mean_ci95_mm.map_or_else(
            || "-".to_owned(),
            |[low, high]| format!("{} to {}", micro(Some(low)), micro(Some(high))),
        );
        let _ = writeln!(
            text,
            "| {} | {} | {interval} | {} | {} |",
            markdown_text(&plan.name),
            micro(plan.mean_mm),
            micro(plan.rms_mm),
            micro(plan.predicted_rms_mm)
        );
    }
    for plan in &snapshot.plans {
        if let (Some(predicted_mm), Some(verdict)) = (plan.combined_rms_mm, &plan.verdict) {
            let predicted = micro(Some(predicted_mm));
            let _ = writeln!(
                text,
                "\n{}: predicted {predicted} µm; the prediction {verdict}.",
                markdown_text(&plan.name)
            );
        }
    }
    if failed > 0 {
        let _ = writeln!(text, "\n{failed} runs failed.");
    }
    text
}
