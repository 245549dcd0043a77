//! `measure`: virtual measurements of a plan.

use std::path::PathBuf;

use clap::Args;
use elastocal::calibration::measure;
use elastocal::files::FileError;
use elastocal::measurement::write_measurements_under;
use elastocal::plan::read_plan;
use elastocal::record::messages::{MeasurementMessage, ProvenanceMessage};
use elastocal::study::true_compliances::truth_of_run;
use elastocal::testbed::{TrueRobots, VirtualRobot};
use elastocal::text::wording::counted;
use serde_json::json;

use super::table::table;
use super::{Common, Report, check_outputs, inputs, results, without_effect};

/// Arguments of `measure`.
#[derive(Debug, Args)]
#[command(mut_args(without_effect(&["threads", "out"])))]
pub struct Measure {
    #[command(flatten)]
    pub common: Common,
    /// The plan to measure.
    #[arg(long, value_name = "FILE")]
    plan: PathBuf,
    /// Leave the instrument's noise out.
    #[arg(long)]
    noise_free: bool,
    /// Measure as run R of a study does, from 0: with its random numbers, on its virtual robot.
    #[arg(long, value_name = "R", conflicts_with = "noise_free")]
    run: Option<u64>,
    /// Where to write the measurements.
    #[arg(long, value_name = "FILE")]
    measurements_out: Option<PathBuf>,
}

impl Measure {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let mut scenario = self.common.load()?;
        let plan = read_plan(&self.plan, scenario.task.belief.commands())?;
        let outputs = [("--measurements-out", self.measurements_out.as_deref())];
        let mut roles = inputs(&scenario);
        check_outputs(roles.reads("the plan", &self.plan), &outputs)?;
        self.common.say(&format!(
            "measuring {} on the virtual robot {}",
            counted(plan.measurements().into(), "experiment"),
            scenario.truth.robot.model.path().display()
        ));
        if let Some(run) = self.run {
            scenario.truth = truth_of_run(&scenario.truth, scenario.seed, run);
        }
        let (task, truth) = (&scenario.task, &scenario.truth);
        let wrong = |error: String| FileError::new(&self.plan, error);
        let measurements = if self.noise_free {
            let mut robot = VirtualRobot::new(&truth.robot, &task.belief.calibration_tool.name)?;
            (robot.measure_noise_free(&plan, &task.belief.instrument))
                .map_err(|error| wrong(error.to_string()))?
        } else {
            let mut robots = TrueRobots::new(&task.belief, truth)?;
            measure(
                &mut robots,
                task,
                truth,
                &plan,
                scenario.seed,
                self.run.unwrap_or(0),
            )
            .map_err(|error| wrong(error.to_string()))?
        };
        let rows: Vec<Vec<String>> = measurements
            .iter()
            .enumerate()
            .map(|(index, each)| {
                let mut row = vec![(index + 1).to_string()];
                row.extend(
                    each.deflection_m
                        .iter()
                        .map(|value| format!("{:.4}", value * 1e3)),
                );
                row.push(format!("{:.4}", each.deflection_m.norm() * 1e3));
                row
            })
            .collect();
        let mut text = table(
            &["experiment", "dx [mm]", "dy [mm]", "dz [mm]", "size [mm]"],
            &rows,
        );
        if let Some(path) = &self.measurements_out {
            write_measurements_under(
                &scenario.origin(),
                path,
                scenario.task.belief.commands(),
                &measurements,
            )?;
            text += &format!("wrote {}\n", path.display());
        }
        let dropped = (plan.measurements() as usize).saturating_sub(measurements.len());
        text += &dropped_words(dropped, plan.measurements());
        let commands = scenario.task.belief.commands();
        let messages: Vec<MeasurementMessage> = (measurements.iter())
            .map(|each| MeasurementMessage::new(&commands, each))
            .collect();
        Ok(Report {
            json: results(
                "measure",
                &ProvenanceMessage::new(&scenario).with_input("plan", &self.plan)?,
                json!({ "noise_free": self.noise_free, "run": self.run, "measurements": messages }),
            ),
            text,
            conditions: (scenario.task.loads.outside_plan(&plan, None).into_iter()).collect(),
        })
    }
}

/// How many of a plan's readings were dropped, as a sentence; nothing where none were.
pub fn dropped_words(dropped: usize, all: u32) -> String {
    if dropped == 0 {
        return String::new();
    }
    let were = if dropped == 1 { "was" } else { "were" };
    format!(
        "{dropped} of {} {were} dropped.\n",
        counted(all.into(), "reading")
    )
}
