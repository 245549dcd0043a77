//! What the texts beside the robot and beside a study show, see `pages/*.md`.

use nalgebra::Vector3;
use re_sdk_types::archetypes::TextDocument;
use serde_json::{Value, json};

use super::curves::shown;
use crate::record::messages::thousandfold;
use crate::record::run::MeasuredMessage;
use crate::study::account::Contribution;
use crate::text::wording::listed;
use crate::view::markup::{PageError, filled};
use crate::view::recording::{RecordedCalibration, Recording, Step};
use crate::view::study_recording::{Snapshot, StudyRecording};
use crate::view::tables;

fn markdown(template: &str, shown: &Value) -> Result<TextDocument, PageError> {
    Ok(TextDocument::from_markdown(filled(template, shown)?))
}

/// What the robot does in a step.
pub(super) fn step(
    recording: &Recording,
    calibration: &RecordedCalibration,
    step: &Step,
) -> Result<TextDocument, PageError> {
    let record = &calibration.record;
    let vector = |label: &str, vector_mm: Option<[f64; 3]>, along_mm: Option<f64>| {
        let length_mm = vector_mm.map(|vector| Vector3::from(vector).norm());
        json!({ "label": label, "vector_mm": vector_mm, "length_mm": length_mm, "along_mm": along_mm })
    };
    let read = calibration.read_in(step).flat_map(|read| shown(&read));
    let read = read.map(|each| vector(each.label, each.vector_mm, each.along_mm));
    let mut vectors: Vec<Value> = read.collect();
    if step.number.is_none() {
        let place = match record.measured {
            MeasuredMessage::Deflections { .. } => "off the wanted place [mm]",
            MeasuredMessage::Readings { .. } => "off the predicted place [mm]",
        };
        let off_mm = thousandfold(&step.did.displacement_m());
        vectors.push(vector(place, Some(off_mm), None));
    }
    let joints = (recording.commands).shown(step.did.commanded_rad.as_slice());
    let shown = json!({
        "plan": record.name,
        "title": step.title,
        "load": step.load_label(),
        "enlargement": step.enlargement,
        "vectors": vectors,
        "direction": step.did.direction.map(<[f64; 3]>::from),
        "unit": recording.commands.unit(),
        "joints": listed(joints, 2),
    });
    markdown("step.md", &shown)
}

/// What a calibration identified, and what that achieves.
pub(super) fn results(
    recording: &Recording,
    calibration: &RecordedCalibration,
) -> Result<TextDocument, PageError> {
    let record = &calibration.record;
    let (identified, without) = match &record.measured {
        MeasuredMessage::Deflections { identification, .. } => {
            let unit = &recording.compliance_unit;
            let table = tables::compliances(identification, &record.truth, unit);
            (table, "uncompensated")
        }
        MeasuredMessage::Readings { identification, .. } => {
            let table = tables::unknowns(identification, &record.truth);
            (table, "of the nominal robot")
        }
    };
    let test_poses = tables::test_poses(&record.test_poses, without);
    let shown = json!({ "plan": record.name, "identified": identified, "test_poses": test_poses });
    markdown("results.md", &shown)
}

/// All calibrations side by side, and where the recording comes from.
pub(super) fn overview(recording: &Recording) -> Result<TextDocument, PageError> {
    let plans = recording.calibrations.iter().map(|calibration| {
        let record = &calibration.record;
        json!({ "name": record.name, "readings": record.readings(), "test_poses": record.test_poses })
    });
    let shown = json!({
        "provenance": recording.provenance,
        "description": recording.description,
        "plans": plans.collect::<Vec<_>>(),
    });
    markdown("overview.md", &shown)
}

/// What is shown of a study, and where it comes from.
pub(super) fn study(study: &StudyRecording) -> Result<TextDocument, PageError> {
    let header = &study.header;
    let shown = json!({
        "header": header,
        "description": study.arms.description,
        "title": header.title(),
        "level": header.level.words(),
        "accuracy": header.accuracy().name(),
        "shows_robot": study.arms.shows_robot(),
    });
    markdown("study.md", &shown)
}

/// What the runs of a study so far say.
pub(super) fn study_table(
    study: &StudyRecording,
    snapshot: &Snapshot,
) -> Result<TextDocument, PageError> {
    let plans = &snapshot.plans;
    let outcomes = (plans.iter())
        .filter_map(|plan| Some(json!({ "name": plan.name, "outcome": plan.outcome()? })));
    let shown = json!({
        "runs": snapshot.runs,
        "trials": study.header.trials,
        "plans": tables::study(plans, false).first(5),
        "outcomes": outcomes.collect::<Vec<_>>(),
        "failed": plans.iter().map(|plan| plan.failed).sum::<u64>(),
    });
    markdown("study_table.md", &shown)
}

/// Where each plan's errors come from, where the scenario lists what is uncertain.
pub(super) fn study_sources(snapshot: &Snapshot) -> Result<Option<TextDocument>, PageError> {
    let is_some = |part: &Contribution| part.contribution_um > Some(0.0);
    let plans = snapshot.plans.iter();
    let plans = plans.filter(|plan| plan.contributions.iter().any(is_some));
    let plans = plans.map(|plan| {
        json!({ "name": plan.name, "contributions": tables::contributions(&plan.contributions) })
    });
    let plans: Vec<Value> = plans.collect();
    let text =
        (!plans.is_empty()).then(|| markdown("study_sources.md", &json!({ "plans": plans })));
    text.transpose()
}
