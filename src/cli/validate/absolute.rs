//! `validate` on absolute readings.

use elastocal::codes::ErrorCode;
use elastocal::files::FileError;
use elastocal::identification::{DistanceStatistics, ReadingResidual};
use elastocal::measurement::read_measured;
use elastocal::scenario::Scenario;
use elastocal::text::wording::counted;
use elastocal::workflow::stored_robot::StoredRobot;
use elastocal::workflow::validate_absolute::{
    AbsoluteValidation, AbsoluteValidationError, validate_absolute,
};
use serde_json::{Value, json};

use super::Validate;
use crate::cli::Report;
use crate::cli::identified::trust;
use crate::cli::identify::absolute::explained;
use crate::cli::table::{DISTANCES, distances, table};
use crate::cli::tolerance::report_judged;

impl Validate {
    /// Holds other readings beside a robot that was identified.
    pub(super) fn of_absolute(
        &self,
        scenario: &Scenario,
        robot: &StoredRobot,
    ) -> anyhow::Result<Report> {
        let identified = &*self.identified;
        let belief = &scenario.task.belief;
        // Readings show what masses and compliances that differ cost.
        trust(identified, scenario, Some(&robot.identified_with))?;
        let Some(file) = self.measurements.as_deref() else {
            let problem = "was identified from absolute readings, for which no plan is made";
            let hint = "give other absolute readings with --measurements";
            let wrong = FileError::new(identified, problem).hint(hint);
            return Err(wrong.code(ErrorCode::OtherAccuracy).into());
        };
        let why = ", and what was identified rests on absolute readings";
        let readings = read_measured(file, belief)?.absolute(file, why)?;
        let validation = validate_absolute(belief, identified, robot, &readings).map_err(
            |error| match error {
                AbsoluteValidationError::File(error) => error,
                AbsoluteValidationError::Readings(error) => explained(file, &error),
            },
        )?;
        let provenance = self.common.provenance(scenario)?;
        let text = describe(&validation);
        let conditions = validation.conditions();
        let mut report = Report::of(
            "validate",
            &provenance,
            record(&validation),
            text,
            conditions,
        );
        if let Some(tolerance) = self.tolerance.tolerance() {
            let left = validation.left.iter().map(|each| each.position_m);
            let each = left.zip(validation.readings_m2.iter().copied());
            report_judged(&mut report, tolerance, each);
        }
        Ok(report)
    }
}

fn record(validation: &AbsoluteValidation) -> Value {
    let both = |left: &[ReadingResidual]| {
        let [distance_mm, angle_mrad] = DistanceStatistics::in_mm_and_mrad(left);
        json!({ "distance_mm": distance_mm, "angle_mrad": angle_mrad })
    };
    let with_joints: Vec<ReadingResidual> =
        validation.prognoses.iter().map(|each| each.left).collect();
    let residuals = |left: &[ReadingResidual]| -> Vec<[f64; 3]> {
        let position = |each: &ReadingResidual| (each.position_m * 1e3).into();
        left.iter().map(position).collect()
    };
    let moved: Vec<Value> = (validation.moved.iter())
        .map(|(name, moved)| {
            json!({
                "station": name,
                "position_mm": <[f64; 3]>::from(moved.position_m * 1e3),
                "rotation_mrad": <[f64; 3]>::from(moved.rotation_rad * 1e3),
                "probability": moved.probability,
            })
        })
        .collect();
    let [distance_mm, angle_mrad] = DistanceStatistics::in_mm_and_mrad(&validation.left);
    json!({
        "kind": "absolute",
        "probability": validation.probability,
        "distance_mm": distance_mm,
        "angle_mrad": angle_mrad,
        "before": validation.before.as_deref().map(both),
        "with_joint_errors": both(&with_joints),
        "coverage95": {
            validation.names[0]: validation.coverage(0),
            validation.names[1]: validation.coverage(1),
        },
        "frames_anew": validation.frames_anew,
        "stations_moved": moved,
        "residuals_mm": residuals(&validation.left),
        "residuals_with_joint_errors_mm": residuals(&with_joints),
    })
}

fn describe(validation: &AbsoluteValidation) -> String {
    let with_joints: Vec<ReadingResidual> =
        validation.prognoses.iter().map(|each| each.left).collect();
    let mut rows = Vec::new();
    let mut add = |name: &str, left: &[ReadingResidual]| {
        for (what, lengths) in ["distance [mm]", "angle [mrad]"]
            .into_iter()
            .zip(DistanceStatistics::in_mm_and_mrad(left))
        {
            rows.extend(lengths.map(|each| distances(&format!("{name}: {what}"), &each)));
        }
    };
    if let Some(before) = &validation.before {
        add("nominal, best frames", before);
    }
    add("identified", &validation.left);
    if with_joints != validation.left {
        add("with joint errors", &with_joints);
    }
    let mut text = format!(
        "{} that were not fitted\n{}",
        counted(validation.left.len() as u64, "reading"),
        table(DISTANCES, rows)
    );
    let share = |part: usize| {
        let (share, name) = (validation.coverage(part)?, validation.names[part]);
        Some(format!("{:.1} % of the {name}", share * 100.0))
    };
    let shares: Vec<String> = (0..2).filter_map(share).collect();
    text += &format!("  In their regions of 95 % lie {}.\n", shares.join(" and "));
    if let Some(probability) = validation.probability {
        text += &format!("  predicted and observed differences: p = {probability:.2}\n");
    }
    if !validation.frames_anew.is_empty() {
        text += &format!(
            "  fitted to these readings: the frames of {}\n",
            validation.frames_anew.join(", ")
        );
    }
    text
}
