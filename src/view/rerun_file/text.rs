//! The texts beside the robot, in Markdown.

use nalgebra::Vector3;

use crate::record::messages::ProvenanceMessage;
use crate::record::run::MeasuredMessage;
use crate::text::markdown_text;
use crate::text::table::RecordTable;
use crate::text::wording::{listed, micrometres, number};
use crate::view::recording::{RecordedCalibration, Recording, Step, StepKind, shown};
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
    let table = match &step.kind {
        StepKind::Experiment {
            number,
            measurements,
        } => {
            let read = record.read_in(*number, measurements.clone());
            let shown: Vec<_> = read.flat_map(|read| shown(&read)).collect();
            let planned = record.plan.get(number - 1);
            let direction = planned.and_then(|planned| planned.direction);
            let along = direction.map_or_else(
                || "length".to_owned(),
                |along| format!("along {}", listed(along, 4)),
            );
            let is_along = shown.iter().any(|each| each.along_mm.is_some());
            let rows = shown.into_iter();
            let rows = rows.map(|each| row(each.label, each.vector_mm, each.along_mm));
            let along = if is_along { &*along } else { "" };
            vectors(along, rows)
        }
        StepKind::TestPose { .. } => {
            let off = (step.displacement_m() * 1e3).into();
            let place = match record.measured {
                MeasuredMessage::Deflections { .. } => "off the wanted place [mm]",
                MeasuredMessage::Readings { .. } => "off the predicted place [mm]",
            };
            vectors("", [row(place, Some(off), None)])
        }
    };
    let joints = calibration.commands.shown(step.commanded_rad.as_slice());
    format!(
        "## {}: {}\n\n{load}\n\n{table}\nCommanded [{}]: {}\n",
        markdown_text(&record.name),
        markdown_text(&calibration.title(step)),
        calibration.commands.unit(),
        listed(joints, 2)
    )
}

/// A table of vectors, and of what a gauge or a ballbar reads under a name, if it does.
fn vectors(along: &str, rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let columns = if along.is_empty() { 5 } else { 6 };
    let table = RecordTable::new(&format!("| x | y | z | length | {along}"), rows);
    table.first(columns).markdown()
}

/// A vector as far as it is known, and what of it is along the direction.
fn row(name: &str, vector: Option<[f64; 3]>, along: Option<f64>) -> Vec<String> {
    let cells = vector.map_or([None; 4], |each| {
        let [x, y, z] = each;
        [x, y, z, Vector3::from(each).norm()].map(Some)
    });
    let cells = cells.into_iter().chain([along]);
    let cells = cells.map(|value| number(value, 3));
    [name.to_owned()].into_iter().chain(cells).collect()
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
pub(super) fn heading(provenance: &ProvenanceMessage, description: &str) -> String {
    let scenario = markdown_text(&provenance.scenario);
    format!("## {scenario}\n\n{}\n\n", markdown_text(description))
}

/// Where a recording comes from.
pub(super) fn origin(provenance: &ProvenanceMessage) -> String {
    format!(
        "elastocal {}, commit {}, seed {}, scenario hash {}\n",
        provenance.version, provenance.commit, provenance.seed, provenance.scenario_sha256
    )
}
