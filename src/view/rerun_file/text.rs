//! The texts beside the robot, in Markdown.

use nalgebra::Vector3;

use crate::record::messages::{ProvenanceMessage, thousandfold};
use crate::record::run::MeasuredMessage;
use crate::text::markdown_text;
use crate::text::table::RecordTable;
use crate::text::wording::{listed, micrometres, number};
use crate::view::recording::{RecordedCalibration, Recording, ShownVector, Step, shown};
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
