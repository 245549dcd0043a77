//! `validate`: whether the robot errs as its identification predicts.

use crate::identification::input_errors::measurements_may_repeat;
use crate::identification::{
    Case, DistanceStatistics, IdentifiedRecord, Predicted, Predictions, ReadingResidual,
    StoredRobot, with_discrepancy,
};
use crate::laboratory::validation::{validate, validation_plan};
use crate::measurement::{MeasuredArm, digests_of, read_measured, read_measurements};
use crate::plan::write_plan;
use crate::record::messages::plan_messages;
use crate::workflow::validate_absolute::{
    AbsoluteValidation, prediction_failed, validate_absolute,
};
use nalgebra::{Matrix3, Vector3};

use super::command_prelude::*;
use super::identified::{IdentifiedCompliances, compliances, read_stored, refuse_fitted, trust};
use super::residuals;
use super::table::{DISTANCES, distances, residual_name};
use super::tolerance::{ToleranceArgs, report_judged};

#[derive(Debug, Args)]
#[command(mut_arg("scenario", named_by_file))]
#[command(mut_args(without_effect(&["threads", "out"])))]
pub struct Validate {
    #[command(flatten)]
    pub common: Common,
    /// What `identify --identified-out` wrote.
    #[arg(long, value_name = "FILE")]
    identified: PathBuf,
    /// Measurements that were not identified from: without them, a plan for such is made.
    #[arg(long, value_name = "FILE")]
    measurements: Option<PathBuf>,
    #[command(flatten)]
    tolerance: ToleranceArgs,
    /// The number of measurements to plan.
    #[arg(long, value_name = "M", default_value_t = 3, conflicts_with = "measurements", value_parser = clap::value_parser!(u32).range(1..=100))]
    experiments: u32,
    /// Where to write the plan.
    #[arg(long, value_name = "FILE", conflicts_with = "measurements")]
    plan_out: Option<PathBuf>,
}

/// What measurements show of a prediction.
#[derive(Default)]
struct Validated {
    /// The command's keys, text and conditions.
    report: Report,
    /// Measured less predicted (m), and the covariance of each reading alone (m^2).
    differences: Vec<(Vector3<f64>, Matrix3<f64>)>,
    /// The readings' digests.
    digests: Vec<u64>,
    /// Whether readings are so coarse that chance may repeat them.
    may_repeat: bool,
}

impl Validate {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let path = &*self.identified;
        let (scenario, identified) = read_stored(&self.common, "validate", path)?;
        self.common.check_files(&scenario, None)?;
        if matches!(identified.record, IdentifiedRecord::Readings(_)) {
            // Readings show what masses and compliances that differ cost.
            trust(&identified, &scenario)?;
        }
        let mut validated = match (&identified.record, &self.measurements) {
            (IdentifiedRecord::Readings(robot), Some(file)) => of_absolute(&scenario, robot, file)?,
            (IdentifiedRecord::Readings(_), None) => {
                let problem = "was identified from absolute readings, for which no plan is made";
                let hint = "give other absolute readings with --measurements";
                let wrong = FileError::new(path, problem).hint(hint);
                return Err(wrong.code(ErrorCode::OtherAccuracy).into());
            }
            (_, Some(file)) => {
                of_deflections(&scenario, compliances(&identified, &scenario)?, file)?
            }
            (_, None) => self.plan(&scenario, compliances(&identified, &scenario)?)?,
        };
        if let Some(file) = &self.measurements {
            let as_what = format!("{} was identified from", path.display());
            let hint = "give measurements that were not fitted";
            let fitted = identified.basis.reading_digests.as_deref();
            let digests = [&*validated.digests, fitted.unwrap_or_default()];
            let may_repeat = || validated.may_repeat;
            validated.report.text += &refuse_fitted(file, digests, may_repeat, &as_what, hint)?;
        }
        let mut report = (self.common).report("validate", &scenario, validated.report)?;
        if let Some(tolerance) = self.tolerance.tolerance() {
            report_judged(&mut report, tolerance, validated.differences.into_iter());
        }
        Ok(report)
    }

    /// A plan for measurements where the identified robot is known least.
    fn plan(
        &self,
        scenario: &Scenario,
        identified: IdentifiedCompliances,
    ) -> anyhow::Result<Validated> {
        let (task, commands) = (&scenario.task, scenario.task.belief.commands());
        let plan = validation_plan(task, &identified.posterior, self.experiments, scenario.seed)?;
        if plan.experiments.is_empty() {
            let problem = "every experiment depends on compliances that were not determined: nothing is predicted";
            return Err(FileError::new(&self.identified, problem).into());
        }
        let count = counted(plan.measurements().into(), "measurement");
        let text = format!("{count} where the identified robot is known least\n");
        let keys = json!({ "plan": plan_messages(&commands, &plan) });
        let mut report = Report::new(keys, text, identified.conditions);
        if let Some(path) = &self.plan_out {
            report.noted(path, write_plan(path, commands, &plan));
        }
        Ok(Validated {
            report,
            ..Validated::default()
        })
    }
}

/// Holds other readings beside a robot that was identified.
fn of_absolute(scenario: &Scenario, robot: &StoredRobot, file: &Path) -> anyhow::Result<Validated> {
    let belief = &scenario.task.belief;
    let (robot, mut conditions) = robot.with_possible_compliances(&belief.arm());
    let why = ", and what was identified rests on absolute readings";
    // A station with a new word gets its frame from these readings.
    let of = MeasuredArm {
        stations: Vec::new(),
        ..(&scenario.task).into()
    };
    let readings = read_measured(file, of)?.absolute(file, why)?;
    let validation = validate_absolute(belief, &robot, file, &readings)?;
    conditions.extend(validation.conditions());
    let left = (validation.with_joint_errors.iter()).map(|each| each.position_m);
    let differences = left.zip(validation.readings_m2.iter().copied()).collect();
    let text = describe_readings(&validation, &residual_name(&belief.instrument));
    Ok(Validated {
        report: Report::new(readings_record(&validation), text, conditions),
        differences,
        digests: digests_of(&readings),
        may_repeat: validation.may_repeat,
    })
}

/// Holds other deflections beside compliances that were identified.
fn of_deflections(
    scenario: &Scenario,
    identified: IdentifiedCompliances,
    file: &Path,
) -> anyhow::Result<Validated> {
    let belief = &scenario.task.belief;
    let measured = read_measurements(file, belief)?;
    let beside = |measurements: &[_]| {
        validate(belief, &identified.posterior, measurements).map_err(|error| error.in_file(file))
    };
    // What the model left unexplained is in other measurements, too.
    let sigma_m = belief.instrument.sigma_m;
    let weighed = with_discrepancy(identified.discrepancy, &measured, sigma_m);
    let validation = beside(&weighed)?;
    // The model discrepancy is the robot's, and no uncertainty of the measurement.
    let bare = beside(&measured)?.each;
    let mut conditions = identified.conditions;
    conditions.extend(prediction_failed(validation.probability()));
    let differences = (bare.iter()).map(|each| (each.difference_m, each.reading_m2));
    Ok(Validated {
        report: Report::new(record(&validation), describe(&validation), conditions),
        differences: differences.collect(),
        digests: digests_of(&measured),
        may_repeat: measurements_may_repeat(&Case::as_believed(belief, &measured)),
    })
}

/// The predicted standard deviation of a difference's length, and what of it the robot makes (m).
fn predicted_m(each: &Predicted) -> [f64; 2] {
    let known_m2 = each.known_m2.trace();
    [known_m2 + each.reading_m2.trace(), known_m2].map(f64::sqrt)
}

fn record(validation: &Predictions) -> Value {
    let milli = |vector: Vector3<f64>| -> Vec<f64> { (vector * 1e3).iter().copied().collect() };
    let each: Vec<Value> = (validation.each.iter().enumerate())
        .map(|(index, each)| {
            let [predicted_m, left_m] = predicted_m(each);
            let mut record = json!({
                "measurement": index + 1,
                "difference_mm": milli(each.difference_m),
                "predicted_rms_mm": predicted_m * 1e3,
                "residual_rms_mm": left_m * 1e3,
            });
            if let Some(difference_rad) = each.rotation_difference_rad {
                record["rotation_difference_mrad"] = milli(difference_rad).into();
            }
            record
        })
        .collect();
    json!({ "probability": validation.probability(), "measurements": each })
}

fn describe(validation: &Predictions) -> String {
    let has_rotation = (validation.each.iter()).any(|each| each.rotation_difference_rad.is_some());
    let rows = (validation.each.iter().enumerate()).map(|(index, each)| {
        let micro = |value_m: f64| in_um(Some(value_m), 1);
        let [predicted_m, left_m] = predicted_m(each);
        let mut row = vec![
            (index + 1).to_string(),
            micro(each.difference_m.norm()),
            micro(predicted_m),
            micro(left_m),
        ];
        if has_rotation {
            let rotation_rad = each.rotation_difference_rad;
            row.push(or_dash(rotation_rad, |each| micro(each.norm())));
        }
        row
    });
    let rotation = has_rotation.then_some(" | rotation, measured less predicted [urad]");
    let header = "measurement | measured less predicted [um] | predicted rms [um] | contribution of the robot [um]";
    format!(
        "{}\nPredicted and observed differences: p = {}.\n",
        table(&(header.to_owned() + rotation.unwrap_or_default()), rows),
        residuals::probability(validation.probability())
    )
}

fn readings_record(validation: &AbsoluteValidation) -> Value {
    let both = |left: &[ReadingResidual]| {
        let [distance_mm, angle_mrad] = DistanceStatistics::in_mm_and_mrad(left);
        json!({ "distance_mm": distance_mm, "angle_mrad": angle_mrad })
    };
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
        "with_joint_errors": both(&validation.with_joint_errors),
        "coverage95": {
            validation.names[0].as_str(): validation.coverage(0),
            validation.names[1].as_str(): validation.coverage(1),
        },
        "frames_anew": validation.frames_anew,
        "stations_moved": moved,
        "residuals_mm": residuals(&validation.left),
        "residuals_with_joint_errors_mm": residuals(&validation.with_joint_errors),
    })
}

fn describe_readings(validation: &AbsoluteValidation, distance: &str) -> String {
    let mut rows = Vec::new();
    let mut add = |name: &str, left: &[ReadingResidual]| {
        for (what, lengths) in [distance, "angle [mrad]"]
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
    if validation.with_joint_errors != validation.left {
        add("with joint errors", &validation.with_joint_errors);
    }
    let mut text = format!(
        "{} beside their predictions\n{}",
        counted(validation.left.len() as u64, "reading"),
        table(DISTANCES, rows)
    );
    let share = |part: usize| {
        let (share, name) = (validation.coverage(part)?, &validation.names[part]);
        Some(format!("{:.1} % of the {name}", share * 100.0))
    };
    let shares = joined((0..2).filter_map(share), " and ");
    text += &format!("  In their regions of 95 % lie {shares}.\n");
    if let Some(p) = validation.probability.map(residuals::probability) {
        text += &format!("  predicted and observed differences: p = {p}\n");
    }
    text + &naming(
        &validation.frames_anew,
        "  fitted to these readings: the frames of {}\n",
    )
}
