//! The texts beside the robot, in Markdown.

use std::fmt::Write;

use nalgebra::Vector3;

use crate::record::messages::TestPoseMessage;
use crate::text::{markdown_text, wording::number};
use crate::view::charts::short;
use crate::view::recording::{RecordedCalibration, Recording, Step, StepKind};

/// What the robot does in a step.
pub(super) fn step(calibration: &RecordedCalibration, step: &Step) -> String {
    let mut text = format!(
        "## {}: {}\n\nLoad {}. Translucent arm: deflections of joints **{} times** enlarged.\n\n",
        markdown_text(&calibration.record.name),
        markdown_text(&calibration.title(step)),
        step.load_label(),
        step.enlargement,
    );
    match &step.kind {
        StepKind::Experiment {
            number,
            measurements,
        } => {
            let record = &calibration.record;
            let direction = (record.plan.get(number - 1)).and_then(|each| each.direction);
            let along = direction.map(|each| each.map(short).join(", "));
            head(&mut text, along.as_deref());
            let measured: Vec<[f64; 3]> = (record.measurements.iter())
                .map(|each| each.deflection_mm.unwrap_or_default())
                .collect();
            for (name, vectors, is_whole) in [
                ("true deflection [mm]", &record.truth.deflections_mm, true),
                ("measured [mm]", &measured, false),
                ("residual [mm]", &record.identification.residuals_mm, false),
            ] {
                let vector = |index| Some((index, *vectors.get(index)?));
                for (index, vector) in measurements.clone().filter_map(vector) {
                    let (read, along) = calibration.as_read(index, vector);
                    row(
                        &mut text,
                        name,
                        if is_whole { Some(vector) } else { read },
                        along,
                    );
                }
            }
        }
        StepKind::TestPose { .. } => {
            head(&mut text, None);
            let off = step.displacement_m() * 1e3;
            row(
                &mut text,
                "off the wanted place [mm]",
                Some(off.into()),
                None,
            );
        }
    }
    let joints = calibration.commands.shown(step.commanded_rad.as_slice());
    let joints: Vec<_> = joints.iter().map(|shown| format!("{shown:.2}")).collect();
    let unit = calibration.commands.unit();
    let _ = writeln!(text, "\nCommanded [{unit}]: {}", joints.join(", "));
    text
}

/// The columns of vectors, and of what is along a gauge's direction.
fn head(text: &mut String, direction: Option<&str>) {
    *text += "| | x | y | z | length |";
    let _ = match direction {
        Some(direction) => writeln!(text, " along {direction} |\n|:--|--:|--:|--:|--:|--:|"),
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
    let record = &calibration.record;
    let identified = &record.identification;
    let mut text = format!(
        "#### {}: compliances [{}]\n\n| joint | compliance | standard error | 95 % interval | simulated truth |\n|:--|--:|--:|--:|--:|\n",
        markdown_text(&record.name),
        calibration.compliance_unit
    );
    for (index, joint) in identified.parameters.iter().enumerate() {
        let joint = markdown_text(joint);
        let truth = (record.truth.compliance_rad_per_nm.get(index))
            .map_or_else(|| "-".to_owned(), |value| format!("{:.4}", value * 1e6));
        let _ = match (
            identified.compliance_rad_per_nm[index],
            identified.compliance_std_rad_per_nm[index],
            identified.compliance_ci95_rad_per_nm[index],
        ) {
            (Some(value), Some(error), Some([low, high])) => writeln!(
                text,
                "| {joint} | {:.4} | {:.4} | {:.4} to {:.4} | {truth} |",
                value * 1e6,
                error * 1e6,
                low * 1e6,
                high * 1e6
            ),
            _ => writeln!(text, "| {joint} | not identifiable | | | {truth} |"),
        };
    }
    text += "\n#### Test poses\n\n";
    text += "| pose | not compensated | compensated | predicted rms |\n|:--|--:|--:|--:|\n";
    for pose in &record.test_poses {
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
        for pose in &record.test_poses {
            let _ = writeln!(
                text,
                "| {} | {} | {} | {:.2} µm | {} |",
                markdown_text(&record.name),
                record.measurements.len(),
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
