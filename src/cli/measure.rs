//! `measure`: virtual measurements of a plan.

use std::fmt::Display;

use crate::calibration::{MeasuredRun, measure};
use crate::measurement::{SimulatedRun, absolute_table, deflection_table};
use crate::plan::{Feasibility, Plan, Violation, absolute::AbsolutePlanning};
use crate::record::messages::MeasurementMessage;
use crate::robot::ReadsAlong;
use crate::study::{TakenPlan, virtual_readings::virtual_readings};
use crate::task::{Belief, Task};
use crate::testbed::{RunTruth, TrueRobots, VirtualRobot};
use crate::workflow::identify::{beyond_gauge, beyond_stations};

use super::command_prelude::*;

#[derive(Debug, Args)]
#[command(mut_args(without_effect(&["threads", "out"])))]
pub struct Measure {
    #[command(flatten)]
    pub common: Common,
    /// The plan to measure.
    #[arg(long, value_name = "FILE")]
    plan: PathBuf,
    /// Leave the instrument's errors out, and without --run all else that is sampled.
    #[arg(long)]
    noise_free: bool,
    /// Measure as run R of a study does, from 0, which is taken where none is named: with its random numbers, on its virtual robot. Of
    /// absolute readings what has no prior is nominal here, and sampled there.
    #[arg(long, value_name = "R")]
    run: Option<u64>,
    /// Read the same virtual robot in another campaign, numbered from 0: all that is new in campaigns, readings, visits
    /// and configurations is sampled anew.
    #[arg(long, value_name = "C", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..1 << 20))]
    campaign: u64,
    /// Read in the same campaign once more, numbered from 0: all that is new in readings, visits and configurations is sampled anew.
    #[arg(long, value_name = "S", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..16))]
    series: u64,
    /// Where to write the measurements.
    #[arg(long, value_name = "FILE")]
    measurements_out: Option<PathBuf>,
}

/// What was measured: the command's keys, text and conditions; the run whose robot it was of, where one was sampled; and the rows of a
/// file of measurements.
type VirtualMeasurements = (Report, Option<u64>, String);

impl Measure {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let scenario = self.common.load()?;
        self.common.refuse_others("measure", &scenario)?;
        self.common.check_files(&scenario, None)?;
        let (mut shown, run, rows) = match TakenPlan::read(&scenario.task, &[], &self.plan)? {
            TakenPlan::Deflections(plan) => self.deflections(&scenario, &plan)?,
            TakenPlan::Readings(taken) => self.readings(&scenario, &taken.planning)?,
        };
        if let Some(path) = &self.measurements_out {
            let origin = scenario.origin().simulated(SimulatedRun {
                campaign: self.campaign,
                series: self.series,
                ..SimulatedRun::first(scenario.seed, run)
            });
            shown.write(path, &(origin.comments() + &rows))?;
        }
        Ok((self.common).report("measure", &scenario, shown)?)
    }

    fn wrong(&self, error: &dyn Display) -> FileError {
        FileError::new(&self.plan, error.to_string()).code(ErrorCode::Simulation)
    }

    /// A plan of deflections.
    fn deflections(&self, scenario: &Scenario, plan: &Plan) -> anyhow::Result<VirtualMeasurements> {
        let commands = scenario.task.belief.commands();
        self.common.say(&format!(
            "measuring {} on the virtual robot {}",
            counted(plan.measurements().into(), "experiment"),
            scenario.truth.robot.model.path().display()
        ));
        let (task, truth) = (&scenario.task, &scenario.truth);
        let (measurements, of_run) = if self.noise_free && self.run.is_none() {
            let mut robot = VirtualRobot::new(&truth.robot, &task.belief.calibration_tool.name)?;
            let measured = robot.measure_noise_free(plan, &task.belief.instrument);
            (measured.map_err(|error| self.wrong(&error))?, None)
        } else {
            let robots = TrueRobots::new(&task.belief, truth)?;
            let mut robots = robots.in_series(self.campaign, self.series);
            let run = self.run.unwrap_or(0);
            let MeasuredRun {
                measurements,
                truth,
            } = measure(
                &mut robots,
                task,
                truth,
                plan,
                scenario.seed,
                run,
                !self.noise_free,
            )
            .map_err(|error| self.wrong(&error))?;
            (measurements, Some(truth))
        };
        let reads_along = task.belief.instrument.reads_along();
        let is_along = reads_along == ReadsAlong::Always;
        let rows = measurements.iter().enumerate().map(|(index, each)| {
            let mut row = vec![(index + 1).to_string()];
            let size_m = if let Some(direction) = each.direction {
                let along = |value: &f64| {
                    if is_along {
                        format!("{value:.4}")
                    } else {
                        "-".to_owned()
                    }
                };
                row.extend(direction.iter().map(along));
                direction.dot(&each.deflection_m)
            } else {
                row.extend((each.deflection_m.iter()).map(|value| format!("{:.4}", value * 1e3)));
                each.deflection_m.norm()
            };
            row.push(format!("{:.4}", size_m * 1e3));
            row
        });
        let header = match reads_along {
            ReadsAlong::Always => "experiment | along x | y | z | displacement [mm]",
            ReadsAlong::Sometimes => {
                "experiment | dx [mm] | dy [mm] | dz [mm] | size, or displacement along the gauge [mm]"
            }
            ReadsAlong::Never => "experiment | dx [mm] | dy [mm] | dz [mm] | size [mm]",
        };
        let mut text = table(header, rows);
        text += &noted(beyond_gauge(task.belief.instrument.gauge, &measurements).as_slice());
        if let Some(truth) = of_run.as_ref().filter(|_| self.noise_free) {
            text += &truth_words(&task.belief, truth);
        }
        let messages: Vec<MeasurementMessage> = (measurements.iter())
            .map(|each| MeasurementMessage::new(&commands, each))
            .collect();
        let keys = json!({ "noise_free": self.noise_free, "run": self.run, "measurements": messages, "truth": of_run });
        let outside = task.loads.outside_plan(plan, None).into_iter();
        let conditions = outside.chain(not_shown(task, plan)).collect();
        let rows = deflection_table(&self.plan, &commands, &measurements)?;
        let run = of_run.map(|truth| truth.run);
        Ok((Report::new(keys, text, conditions), run, rows))
    }

    /// A plan of absolute readings, each by itself.
    fn readings(
        &self,
        scenario: &Scenario,
        planning: &AbsolutePlanning<'_>,
    ) -> anyhow::Result<VirtualMeasurements> {
        let (task, seed, run) = (&scenario.task, scenario.seed, self.run.unwrap_or(0));
        let readings = virtual_readings(
            task,
            &scenario.truth,
            planning,
            seed,
            run,
            self.campaign,
            self.series,
        )
        .map_err(|error| self.wrong(&error))?;
        let keys = json!({ "accuracy": "absolute", "run": run, "readings": readings.len() });
        let count = counted(readings.len() as u64, "absolute reading");
        let text = format!(
            "{count} of the virtual robot of run {run}, nominal but for what the scenario lists\n"
        ) + &noted(beyond_stations(&task.belief, &readings).as_slice());
        let rows = absolute_table(&task.belief.commands(), &readings);
        Ok((Report::new(keys, text, Vec::new()), Some(run), rows))
    }
}

/// What a gauge cannot show of a plan.
fn not_shown(task: &Task, plan: &Plan) -> Vec<Condition> {
    if !task.reads_along() {
        return Vec::new();
    }
    let violations = Feasibility::new(task).violations(plan).into_iter();
    let of_gauge = violations.filter(Violation::is_of_gauge);
    of_gauge
        .map(|each| ConditionCode::Violation.with(each.to_string()))
        .collect()
}

/// What a run's virtual robot is: its compliances, and what else the run samples.
fn truth_words(belief: &Belief, truth: &RunTruth) -> String {
    let compliances = belief.parameters.iter().zip(&truth.compliance_rad_per_nm);
    let compliance = |(&joint, value): (&usize, &f64)| {
        let joint = &belief.nominal.chain.joints[joint];
        let unit = format!("1e-6 {}", joint.drive.compliance_unit());
        vec![joint.name.clone(), format!("{:.4}", value * 1e6), unit]
    };
    let sampled = truth.sampled.iter().map(|each| {
        let unit = if each.unit == "1" { "ln" } else { each.unit };
        vec![
            each.name.clone(),
            format!("{:.4e}", each.value),
            unit.to_owned(),
        ]
    });
    let rows = compliances.map(compliance).chain(sampled);
    format!(
        "\nThe simulated truth of run {}:\n{}",
        truth.run,
        table("parameter | value | unit", rows)
    )
}
