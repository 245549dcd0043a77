//! The texts beside the robot and beside a study, in Markdown.

use nalgebra::Vector3;

use super::curves::{ShownVector, shown};
use crate::record::messages::{ProvenanceMessage, thousandfold};
use crate::record::run::MeasuredMessage;
use crate::study::account::Contribution;
use crate::task::AccuracyKind;
use crate::text::markdown_text;
use crate::text::table::RecordTable;
use crate::text::wording::{listed, micrometres, number};
use crate::view::markup::for_page;
use crate::view::recording::{RecordedCalibration, Recording, Step};
use crate::view::study_recording::{Snapshot, StudyRecording};
use crate::view::tables;

/// What the robot does in a step.
pub(super) fn step(calibration: &RecordedCalibration, step: &Step) -> String {
    let record = &calibration.record;
    let load = match step.load_label() {
        Some(load) => format!(
            "Load {load}. Translucent arm: deflections of joints **{} times** enlarged.",
            step.enlargement
        ),
        None => "No load.".to_owned(),
    };
    let place = match record.measured {
        MeasuredMessage::Deflections { .. } => "off the wanted place [mm]",
        MeasuredMessage::Readings { .. } => "off the predicted place [mm]",
    };
    let shown: Vec<ShownVector> = match step.number {
        Some(_) => (calibration.read_in(step))
            .flat_map(|read| shown(&read))
            .collect(),
        None => vec![ShownVector {
            label: place,
            group: None,
            vector_mm: Some(thousandfold(&step.displacement_m())),
            along_mm: None,
        }],
    };
    let along = step.did.direction.map_or_else(
        || "length".to_owned(),
        |along| format!("along {}", listed(along.iter().copied(), 4)),
    );
    let columns = 5 + usize::from(shown.iter().any(|each| each.along_mm.is_some()));
    let header = format!("| x | y | z | length | {along}");
    let table = RecordTable::new(&header, shown.iter().map(row)).first(columns);
    let joints = (calibration.commands).shown(step.did.commanded_rad.as_slice());
    format!(
        "## {}: {}\n\n{load}\n\n{}\nCommanded [{}]: {}\n",
        markdown_text(&record.name),
        markdown_text(&step.title),
        table.markdown(),
        calibration.commands.unit(),
        listed(joints, 2)
    )
}

/// A vector as far as it is known, and what of it is along a direction.
fn row(shown: &ShownVector) -> Vec<String> {
    let cells = shown.vector_mm.map_or([None; 4], |each| {
        let [x, y, z] = each;
        [x, y, z, Vector3::from(each).norm()].map(Some)
    });
    let cells = cells.into_iter().chain([shown.along_mm]);
    let cells = cells.map(|value| number(value, 3));
    [shown.label.to_owned()].into_iter().chain(cells).collect()
}

/// What a calibration identified, and what that achieves.
pub(super) fn results(calibration: &RecordedCalibration) -> String {
    let record = &calibration.record;
    let (table, without) = match &record.measured {
        MeasuredMessage::Deflections { identification, .. } => {
            let unit = &calibration.compliance_unit;
            let table = tables::compliances(identification, &record.truth, unit);
            (table, "uncompensated")
        }
        MeasuredMessage::Readings { identification, .. } => {
            let table = tables::unknowns(identification, &record.truth);
            (table, "of the nominal robot")
        }
    };
    let poses = tables::test_poses(&record.test_poses, without);
    format!(
        "#### {}\n\n{}\n#### Test poses\n\n{}",
        markdown_text(&record.name),
        table.markdown(),
        poses.markdown()
    )
}

/// All calibrations side by side, and where the recording comes from.
pub(super) fn overview(recording: &Recording) -> String {
    let rows = recording.calibrations.iter().flat_map(|calibration| {
        let record = &calibration.record;
        record.test_poses.iter().map(|pose| {
            vec![
                record.name.clone(),
                record.readings().to_string(),
                pose.name.clone(),
                micrometres(Some(pose.residual_mm)),
                micrometres(pose.rho0_mm),
            ]
        })
    });
    let table = RecordTable::new(
        "plan | measurements | test pose | compensated | predicted rms",
        rows,
    );
    format!(
        "{}{}\n{}",
        heading(&recording.provenance, &recording.description),
        table.markdown(),
        origin(&recording.provenance)
    )
}

/// The scenario and what it is about.
fn heading(provenance: &ProvenanceMessage, description: &str) -> String {
    let scenario = markdown_text(&provenance.scenario);
    format!("## {scenario}\n\n{}\n\n", markdown_text(description))
}

/// Where a recording comes from.
fn origin(provenance: &ProvenanceMessage) -> String {
    format!(
        "elastocal {}, commit {}, seed {}, scenario hash {}\n",
        provenance.version, provenance.commit, provenance.seed, provenance.scenario_sha256
    )
}

/// What is shown of a study, and where it comes from.
pub(super) fn study(study: &StudyRecording) -> String {
    let header = &study.header;
    let mut text = heading(&header.provenance, &study.arms.description);
    let (title, level) = (markdown_text(&header.title()), header.level.words());
    text += &format!("{} runs of {title}, {level}.\n\n", header.trials);
    text += match header.accuracy() {
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
    if header.shards > 1 {
        text += &format!("This is one of {} shards of the study.\n\n", header.shards);
    }
    if study.arms.shows_robot() {
        text += "The robot walks through the plans' experiments and the test poses, one a snapshot; the \
                 timeline `step` has all of them. Red: force. Yellow: enlarged deflection. Translucent: \
                 the loaded arm. Green: the instrument's line of sight, or the way that a gauge reads.\n\n";
    }
    text + &origin(&header.provenance)
}

/// What the runs of a study so far say.
pub(super) fn study_table(study: &StudyRecording, snapshot: &Snapshot) -> String {
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
            text += &format!("\n{}: {}.\n", markdown_text(&plan.name), for_page(&outcome));
        }
    }
    if failed > 0 {
        text += &format!("\n{failed} runs failed.\n");
    }
    text
}

/// Where each plan's errors come from, where the scenario lists what is uncertain.
pub(super) fn study_sources(snapshot: &Snapshot) -> Option<String> {
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
