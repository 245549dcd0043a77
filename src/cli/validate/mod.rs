//! `validate`: whether the robot errs as its identification predicts.

mod absolute;

use std::path::PathBuf;

use clap::Args;
use elastocal::files::FileError;
use elastocal::identification::{Predicted, StoredIdentification};
use elastocal::laboratory::validation::{Validation, validate, validation_plan};
use elastocal::measurement::read_measurements;
use elastocal::plan::write_plan;
use elastocal::record::messages::plan_messages;
use elastocal::text::wording::counted;
use elastocal::workflow::stored_robot::StoredRobot;
use elastocal::workflow::validate_absolute::prediction_failed;
use nalgebra::Vector3;
use serde_json::{Value, json};

use super::identified::read_identified;
use super::table::{or_dash, table_of};
use super::tolerance::{ToleranceArgs, report_judged};
use super::written::Written;
use super::{Common, Report, named_by_file, without_effect};

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

impl Validate {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let input = ["validate", "--identified"];
        if let Some(robot) = StoredRobot::read(&self.identified)? {
            let scenario =
                (self.common).load_for(input, &self.identified, robot.origin.as_ref())?;
            let (robot, held) = robot.with_possible_compliances(&scenario.task.belief.arm());
            let mut report = self.of_absolute(&scenario, &robot)?;
            report.conditions.splice(0..0, held);
            return Ok(report);
        }
        let origin = StoredIdentification::origin(&self.identified)?;
        let scenario = (self.common).load_for(input, &self.identified, origin.as_ref())?;
        let identified = read_identified(&self.identified, &scenario)?;
        self.common.check_files(&scenario, None)?;
        let provenance = self.common.provenance(&scenario)?;
        let mut conditions = identified.conditions;
        let (task, commands) = (&scenario.task, scenario.task.belief.commands());
        let Some(path) = &self.measurements else {
            let (posterior, seed) = (&identified.posterior, scenario.seed);
            let plan = validation_plan(task, posterior, self.experiments, seed)?;
            if plan.experiments.is_empty() {
                let problem = "every experiment depends on compliances that were not determined: nothing is predicted";
                return Err(FileError::new(&self.identified, problem).into());
            }
            let count = counted(plan.measurements().into(), "measurement");
            let mut text = format!("{count} where the identified robot is known least\n");
            let mut written = Written::default();
            if let Some(path) = &self.plan_out {
                text += &written.noted(path, write_plan(path, commands.clone(), &plan));
            }
            conditions.extend(written.conditions());
            let keys = json!({ "plan": plan_messages(&commands, &plan) });
            return Ok(Report::of("validate", &provenance, keys, text, conditions));
        };
        let measured = read_measurements(path, &task.belief)?;
        // What the model left unexplained is in other measurements, too.
        let sigma_m = task.belief.instrument.sigma_m;
        let measurements = identified.discrepancy.weighed(&measured, sigma_m);
        let validation = validate(&task.belief, &identified.posterior, &measurements)
            .map_err(|error| FileError::new(path, error.to_string()))?;
        conditions.extend(prediction_failed(validation.probability));
        let mut report = Report::of(
            "validate",
            &provenance,
            record(&validation),
            describe(&validation),
            conditions,
        );
        if let Some(tolerance) = self.tolerance.tolerance() {
            // The model discrepancy is the robot's, and no uncertainty of the measurement.
            let bare = validate(&task.belief, &identified.posterior, &measured)
                .map_err(|error| FileError::new(path, error.to_string()))?;
            let each = (bare.each.iter()).map(|each| (each.difference_m, each.reading_m2));
            report_judged(&mut report, tolerance, each);
        }
        Ok(report)
    }
}

/// The predicted standard deviation of a difference's length, and what of it the robot makes (m).
fn predicted_m(each: &Predicted) -> [f64; 2] {
    let known_m2 = each.known_m2.trace();
    [known_m2 + each.reading_m2.trace(), known_m2].map(f64::sqrt)
}

fn record(validation: &Validation) -> Value {
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
    json!({ "probability": validation.probability, "measurements": each })
}

fn describe(validation: &Validation) -> String {
    let has_rotation = (validation.each.iter()).any(|each| each.rotation_difference_rad.is_some());
    let rows = (validation.each.iter().enumerate()).map(|(index, each)| {
        let micro = |value: f64| format!("{:.1}", value * 1e6);
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
    let mut header = vec![
        "measurement",
        "measured less predicted [um]",
        "predicted rms [um]",
        "contribution of the robot [um]",
    ];
    if has_rotation {
        header.push("rotation, measured less predicted [urad]");
    }
    format!(
        "{}\nPredicted and observed differences: p = {:.2}.\n",
        table_of(&header, rows),
        validation.probability
    )
}
