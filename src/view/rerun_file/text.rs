//! The texts beside the robot, in Markdown.

use std::fmt::Write;

use nalgebra::Vector3;

use crate::record::messages::{CalibrationMessage, TestPoseMessage};
use crate::view::recording::{RecordedCalibration, Recording, Step, StepKind};

/// What the robot does in a step.
pub(super) fn step(calibration: &RecordedCalibration, step: &Step) -> String {
    let mut text = format!(
        "## {}: {}\n\nLoad {}. Translucent arm: deflections of joints **{} times** enlarged.\n\n",
        calibration.record.name,
        calibration.title(step),
        step.load_label(),
        step.enlargement,
    );
    text += "| | x | y | z | length |\n|:--|--:|--:|--:|--:|\n";
    match &step.kind {
        StepKind::Experiment { measurements, .. } => {
            let record = &calibration.record;
            let measured: Vec<[f64; 3]> = (record.measurements.iter())
                .map(|each| each.deflection_mm)
                .collect();
            for (name, vectors) in [
                ("true deflection [mm]", &record.truth.deflections_mm),
                ("measured [mm]", &measured),
                ("residual [mm]", &record.identification.residuals_mm),
            ] {
                for vector in measurements.clone().filter_map(|index| vectors.get(index)) {
                    row(&mut text, name, &Vector3::from(*vector));
                }
            }
        }
        StepKind::TestPose { .. } => {
            let off = step.displacement_m() * 1e3;
            row(&mut text, "off the wanted place [mm]", &off);
        }
    }
    let joints = calibration.commands.shown(step.commanded_rad.as_slice());
    let joints: Vec<_> = joints.iter().map(|shown| format!("{shown:.2}")).collect();
    let unit = calibration.commands.unit();
    let _ = writeln!(text, "\nCommanded [{unit}]: {}", joints.join(", "));
    text
}

fn row(text: &mut String, name: &str, vector: &Vector3<f64>) {
    let [x, y, z] = (*vector).into();
    let _ = writeln!(
        text,
        "| {name} | {x:.3} | {y:.3} | {z:.3} | {:.3} |",
        vector.norm()
    );
}

/// What a calibration identified, and what that achieves.
pub(super) fn results(record: &CalibrationMessage) -> String {
    let identified = &record.identification;
    let mut text = format!(
        "#### {}: compliances [1e-6 rad/(N m)]\n\n| joint | compliance | standard error | 95 % interval | simulated truth |\n|:--|--:|--:|--:|--:|\n",
        record.name
    );
    for (index, joint) in identified.parameters.iter().enumerate() {
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
            pose.name,
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
        provenance.scenario, recording.description
    );
    text += "| plan | measurements | test pose | compensated | predicted rms |\n";
    text += "|:--|--:|:--|--:|--:|\n";
    for calibration in &recording.calibrations {
        let record = &calibration.record;
        for pose in &record.test_poses {
            let _ = writeln!(
                text,
                "| {} | {} | {} | {:.2} µm | {} |",
                record.name,
                record.measurements.len(),
                pose.name,
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
