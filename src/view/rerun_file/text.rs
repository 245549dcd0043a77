//! The texts beside the robot, in Markdown.

use std::fmt::Write;

use nalgebra::Vector3;

use crate::quantities::units::shown_unit;
use crate::record::absolute_plan::ReadingsRunMessage;
use crate::record::messages::{CalibrationMessage, TestPoseMessage};
use crate::text::markdown_text;
use crate::text::wording::{dash, number};
use crate::view::charts::short;
use crate::view::recording::{PlanRecord, RecordedCalibration, Recording, Step, StepKind};

/// What the robot does in a step.
pub(super) fn step(calibration: &RecordedCalibration, step: &Step) -> String {
    let mut text = format!(
        "## {}: {}\n\n",
        markdown_text(calibration.record.name()),
        markdown_text(&calibration.title(step)),
    );
    text += &match step.load_label() {
        Some(load) => format!(
            "Load {load}. Translucent arm: deflections of joints **{} times** enlarged.\n\n",
            step.enlargement
        ),
        None => "No load.\n\n".to_owned(),
    };
    match &step.kind {
        StepKind::Experiment {
            number,
            measurements,
        } => {
            let direction = calibration.record.direction(number - 1);
            let along = direction.map(|each| each.map(short).join(", "));
            let shown = measurements.clone();
            let shown: Vec<_> = shown
                .flat_map(|index| calibration.record.shown(index))
                .collect();
            let is_along = shown.iter().any(|each| each.along_mm.is_some());
            let along =
                is_along.then(|| along.map_or("distance".to_owned(), |of| format!("along {of}")));
            head(&mut text, along.as_deref());
            for each in shown {
                row(&mut text, each.label, each.vector_mm, each.along_mm);
            }
        }
        StepKind::TestPose { .. } => {
            head(&mut text, None);
            let off = step.displacement_m() * 1e3;
            let place = match &calibration.record {
                PlanRecord::Deflections(_) => "off the wanted place [mm]",
                PlanRecord::Readings(_) => "off the predicted place [mm]",
            };
            row(&mut text, place, Some(off.into()), None);
        }
    }
    let joints = calibration.commands.shown(step.commanded_rad.as_slice());
    let joints: Vec<_> = joints.iter().map(|shown| format!("{shown:.2}")).collect();
    let unit = calibration.commands.unit();
    let _ = writeln!(text, "\nCommanded [{unit}]: {}", joints.join(", "));
    text
}

/// The columns of vectors, and of what a gauge or a ballbar reads.
fn head(text: &mut String, along: Option<&str>) {
    *text += "| | x | y | z | length |";
    let _ = match along {
        Some(along) => writeln!(text, " {along} |\n|:--|--:|--:|--:|--:|--:|"),
        None => writeln!(text, "\n|:--|--:|--:|--:|--:|"),
    };
}

/// A vector as far as it is known, and what of it is along the direction.
fn row(text: &mut String, name: &str, vector: Option<[f64; 3]>, along: Option<f64>) {
    let cells = vector.map_or([None; 4], |each| {
        let [x, y, z] = each;
        [x, y, z, Vector3::from(each).norm()].map(Some)
    });
    let along = along.map(Some);
    let cells: Vec<String> = (cells.into_iter().chain(along))
        .map(|value| number(value, 3))
        .collect();
    let _ = writeln!(text, "| {name} | {} |", cells.join(" | "));
}

/// What a calibration identified, and what that achieves.
pub(super) fn results(calibration: &RecordedCalibration) -> String {
    let mut text = match &calibration.record {
        PlanRecord::Deflections(record) => compliances(record, &calibration.compliance_unit),
        PlanRecord::Readings(record) => unknowns(record),
    };
    text += "\n#### Test poses\n\n";
    text += "| pose | not compensated | compensated | predicted rms |\n|:--|--:|--:|--:|\n";
    for pose in calibration.record.test_poses() {
        let _ = writeln!(
            text,
            "| {} | {:.1} µm | {:.2} µm | {} |",
            markdown_text(&pose.name),
            pose.uncompensated_mm * 1e3,
            pose.residual_mm * 1e3,
            predicted(pose)
        );
    }
    text
}

/// The identified compliances beside the simulated truth.
fn compliances(record: &CalibrationMessage, unit: &str) -> String {
    let identified = &record.identification;
    let rows = identified.parameters.iter().enumerate();
    let rows = rows.map(|(index, joint)| {
        let micro = |value: Option<f64>| value.map(|value| value * 1e6);
        let interval = identified.compliance_ci95_rad_per_nm[index];
        let truth = record.truth.compliance_rad_per_nm.get(index).copied();
        let numbers = [
            micro(identified.compliance_rad_per_nm[index]),
            micro(identified.compliance_std_rad_per_nm[index]),
        ];
        let interval = interval.map(|ends| ends.map(|end| end * 1e6));
        estimate(joint, numbers, interval, micro(truth), |value| {
            format!("{value:.4}")
        })
    });
    let title = format!("{}: compliances [{unit}]", markdown_text(&record.name));
    estimates(&title, "joint | compliance", rows)
}

/// The identified unknowns beside the simulated truth, each in its unit.
fn unknowns(record: &ReadingsRunMessage) -> String {
    let rows = record.identification.unknowns.iter().enumerate();
    let rows = rows.map(|(index, each)| {
        let (factor, unit) = shown_unit(&each.unit);
        let shown = |value: f64| value * factor;
        let name = format!("{} [{}]", each.name, unit);
        let numbers = [each.standard_error.map(|_| each.value), each.standard_error];
        let truth = record.true_values.get(index).copied().flatten();
        estimate(
            &name,
            numbers.map(|value| value.map(shown)),
            each.interval95.map(|ends| ends.map(shown)),
            truth.map(shown),
            short,
        )
    });
    let title = markdown_text(&record.name);
    estimates(&title, "unknown | value", rows)
}

/// A table of estimates.
fn estimates(title: &str, columns: &str, rows: impl Iterator<Item = String>) -> String {
    format!(
        "#### {title}\n\n| {columns} | standard error | 95 % interval | simulated truth |\n|:--|--:|--:|--:|--:|\n{}",
        rows.collect::<String>()
    )
}

/// A row of it: value and standard error, interval and truth.
fn estimate(
    name: &str,
    numbers: [Option<f64>; 2],
    interval: Option<[f64; 2]>,
    truth: Option<f64>,
    shown: impl Fn(f64) -> String,
) -> String {
    let name = markdown_text(name);
    let truth = truth.map_or_else(dash, &shown);
    match (numbers, interval.map(|ends| ends.map(&shown))) {
        ([Some(value), Some(error)], Some([low, high])) => format!(
            "| {name} | {} | {} | {low} to {high} | {truth} |\n",
            shown(value),
            shown(error)
        ),
        _ => format!("| {name} | not identifiable | | | {truth} |\n"),
    }
}

/// The predicted rms of a test pose, which there is where all needed compliances are identified.
fn predicted(pose: &TestPoseMessage) -> String {
    pose.rho0_mm
        .map_or_else(|| "-".to_owned(), |value| format!("{:.2} µm", value * 1e3))
}

/// All calibrations side by side, and where the recording comes from.
pub(super) fn overview(recording: &Recording) -> String {
    let provenance = &recording.provenance;
    let mut text = format!(
        "## {}\n\n{}\n\n",
        markdown_text(&provenance.scenario),
        markdown_text(&recording.description)
    );
    text += "| plan | measurements | test pose | compensated | predicted rms |\n";
    text += "|:--|--:|:--|--:|--:|\n";
    for calibration in &recording.calibrations {
        let record = &calibration.record;
        for pose in record.test_poses() {
            let _ = writeln!(
                text,
                "| {} | {} | {} | {:.2} µm | {} |",
                markdown_text(record.name()),
                record.measured(),
                markdown_text(&pose.name),
                pose.residual_mm * 1e3,
                predicted(pose)
            );
        }
    }
    let _ = write!(
        text,
        "\nelastocal {}, commit {}, seed {}, scenario hash {}\n",
        provenance.version, provenance.commit, provenance.seed, provenance.scenario_sha256
    );
    text
}
