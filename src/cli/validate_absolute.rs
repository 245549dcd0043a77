//! `validate` on absolute readings.

use std::path::Path;

use elastocal::files::FileError;
use elastocal::identification::DistanceStatistics;
use elastocal::measurement::{MeasuredFile, read_measured};
use elastocal::record::absolute::LengthsMessage;
use elastocal::record::messages::ProvenanceMessage;
use elastocal::scenario::Scenario;
use elastocal::text::wording::counted;
use elastocal::workflow::validate_absolute::{
    AbsoluteValidationError, StoredRobot, validate_absolute,
};
use serde_json::json;

use super::identify_absolute::{distances_table, explained};
use super::{Report, results};

/// Holds other readings beside a robot that was identified.
pub fn execute(
    scenario: &Scenario,
    identified: &Path,
    robot: &StoredRobot,
    measurements: Option<&Path>,
) -> anyhow::Result<Report> {
    let belief = &scenario.task.belief;
    if robot.identified_with.robot_sha256 != belief.fingerprint().robot_sha256 {
        let problem = "was identified with another robot: its joints' names, axes or places are not those of the scenario's \
                       model";
        let wrong = FileError::new(identified, problem).at("identified_with.robot_sha256");
        return Err(wrong
            .hint("give the scenario that it was identified under")
            .into());
    }
    let Some(file) = measurements else {
        let problem = "was identified from absolute readings, for which no plan is made";
        let hint = "give other absolute readings with --measurements";
        return Err(FileError::new(identified, problem).hint(hint).into());
    };
    let readings = match read_measured(file, belief.commands())? {
        MeasuredFile::Absolute(readings) => readings,
        MeasuredFile::Deflections(_) => {
            let problem = "holds deflections, and what was identified rests on absolute readings";
            return Err(FileError::new(file, problem).into());
        }
    };
    let validation =
        validate_absolute(belief, identified, robot, &readings).map_err(|error| match error {
            AbsoluteValidationError::File(error) => error,
            AbsoluteValidationError::Readings(error) => explained(file, &error),
        })?;
    let provenance = (ProvenanceMessage::new(scenario).with_input("identified", identified)?)
        .with_input("measurements", file)?;
    let lengths = |statistics: Option<DistanceStatistics>| {
        statistics.as_ref().map(LengthsMessage::in_thousandths)
    };
    let distance_mm = lengths(DistanceStatistics::of_positions(&validation.left));
    let angle_mrad = lengths(DistanceStatistics::of_rotations(&validation.left));
    let residuals_mm: Vec<[f64; 3]> = validation
        .left
        .iter()
        .map(|each| (each.position_m * 1e3).into())
        .collect();
    let mut text = format!(
        "{} that were not fitted\n",
        counted(readings.len() as u64, "reading")
    );
    if let Some(distance_mm) = &distance_mm {
        text += &distances_table(distance_mm, angle_mrad.as_ref());
    }
    if !validation.frames_anew.is_empty() {
        text += &format!(
            "  fitted to these readings: the frames of {}\n",
            validation.frames_anew.join(", ")
        );
    }
    let keys = json!({
        "kind": "absolute",
        "distance_mm": distance_mm,
        "angle_mrad": angle_mrad,
        "frames_anew": validation.frames_anew,
        "residuals_mm": residuals_mm,
    });
    Ok(Report {
        json: results("validate", &provenance, keys),
        text,
        conditions: Vec::new(),
    })
}
