//! `run`: the whole loop, and a folder with all that came of it.

use crate::calibration::{Calibration, CompensatedPose, rms_m};
use crate::files::make_folder;
use crate::identification::ReadingWeights;
use crate::measurement::{SimulatedRun, absolute_table, deflection_table};
use crate::plan::search::{Bound, RepeatsNeeded, Watch};
use crate::plan::{UncertaintyBudget, take_nearest_turns};
use crate::record::absolute_plan::AbsolutePlanMessage;
use crate::text::wording::shell_path;
use crate::view::recording::{CarriedOutPlan, Recording};
use crate::view::report::{AbsolutePageRecord, PlanPage, absolute_page, run_page};
use crate::workflow::design::Wanted;
use crate::workflow::run::{
    AbsoluteRun, FailedPlan, RANDOM_PLANS, RUN, RunOutcome, RunStage, TriedPlan, run, run_absolute,
};

use super::command_prelude::*;
use super::identify::{absolute, deflections};
use super::interruption::{STOP, proceed};
use super::plan::design;
use super::plan_args::ReadingsArgs;
use super::planned::{PlannedAccuracy, bound_basis, budget, left_out};
use super::progress;
use super::proof::ProofArgs;
use super::uncertainty_budget::{self, BudgetArgs};
use super::views::{RUN_FILES, TARGETS, ViewerTarget, command_line, show, write_recording};
use super::written::{record_text, warn};

#[derive(Debug, Args)]
pub struct Run {
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    proof: ProofArgs,
    #[command(flatten)]
    budget: BudgetArgs,
    #[command(flatten)]
    readings: ReadingsArgs,
    /// Show the recording in a rerun viewer too: start one, connect to one, or write a file.
    #[arg(long, value_name = TARGETS)]
    rerun: Option<ViewerTarget>,
}

/// The files of the results.
const FILES: [&str; 3] = ["plan.csv", "measurements.csv", "results.json"];

/// What a loop comes to, whatever was measured.
struct Looped<'a> {
    planned: PlannedAccuracy<'a>,
    report: Report,
    /// The rows of measurements.csv.
    measurements: String,
    /// The robot in each configuration (SVG).
    sheet: String,
    page: String,
    shown: Vec<CarriedOutPlan>,
    /// What no plan is below, where that may be proved.
    bound: Option<Bound>,
}

impl Run {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let common = &self.common;
        let scenario = common.open("run")?;
        let folder = common.folder(&scenario);
        let names = [&FILES[..], RUN_FILES].concat();
        common.check_files(&scenario, Some((&folder, &names)))?;
        make_folder(&folder)?;
        let design = &scenario.task.design;
        let measurements = counted(design.experiments.into(), design.accuracy.noun());
        common.say(&format!("designing a plan of {measurements}"));
        let looped = match design.accuracy {
            AccuracyKind::Absolute => self.readings(&scenario)?,
            AccuracyKind::Relative => self.deflections(&scenario)?,
        };
        let mut report = looped.report;
        let [plan, measurements, results] = FILES.map(|name| folder.join(name));
        let written = &mut report.written;
        written.note(&plan, looped.planned.write(&scenario.task, &plan));
        let origin = scenario
            .origin()
            .simulated(SimulatedRun::first(scenario.seed, Some(RUN)));
        written.save(&measurements, &(origin.comments() + &looped.measurements));
        let record = record_text(&mut report.json, &report.conditions)?;
        written.save(&results, &record);
        written.save(&folder.join("stills.svg"), &looped.sheet);
        written.save(&folder.join("report.html"), &looped.page);
        let recording = Recording::new(&scenario, &looped.shown)?;
        write_recording(&recording, &folder.join("run.rrd"), written);
        if let Some(target) = &self.rerun {
            show(target, &recording, written)?;
        }
        report.text += &format!("Results are in {}\n", folder.display());
        if let Some(bound) = &looped.bound {
            let provenance = common.provenance(&scenario)?;
            self.proof.tell(bound, &provenance, &mut report)?;
        }
        self.budget.write(looped.planned.budget(), &mut report);
        common.say(&format!(
            "run sheet, robot program and table to fill in are written by `elastocal lab {} --plan {}`",
            shell_path(&scenario.path),
            shell_path(&plan)
        ));
        Ok(report)
    }

    /// The loop with a plan of deflections.
    fn deflections(&self, scenario: &Scenario) -> anyhow::Result<Looped<'static>> {
        let (common, task, seed) = (&self.common, &scenario.task, scenario.seed);
        let wanted = Wanted::by(task);
        let (mut designed, approximate) = design(common, task, seed, wanted, &self.proof, &STOP)?;
        take_nearest_turns(task, scenario.laboratory.home(), &mut designed.exact.plan);
        proceed()?;
        let outcome = run(scenario, (&designed, &approximate), &STOP, &|stage| {
            tell(common, stage, "measuring");
        });
        let outcome = outcome?;
        proceed()?;
        let main = &outcome.tried[0];
        let made = &main.calibration.1;
        let (assessment, plan) = (Box::new(main.assessment.clone()), made.plan.clone());
        let planned = PlannedAccuracy::Deflections(plan, assessment);
        let stills = planned.stills(scenario);
        let page = PlanPage {
            scenario,
            stills: &stills.figures(),
            conditions: &outcome.conditions,
            provenance: &common.provenance(scenario)?,
            command: &command_line(),
        };
        let page = run_page(&page, &outcome)?;
        let shown = outcome.tried.iter().map(|each| {
            let (name, calibration) = each.calibration.clone();
            CarriedOutPlan::Deflections(name, Box::new(calibration))
        });
        let commands = task.belief.commands();
        let text = deflections::describe(&made.identification, &task.belief);
        let text = text + &of_deflections(&outcome);
        let json = outcome.json(scenario, designed.elapsed_s)?;
        Ok(Looped {
            measurements: deflection_table(&scenario.path, &commands, &made.measurements)?,
            sheet: stills.sheet(),
            page,
            shown: shown.collect(),
            bound: Some(designed.bound),
            report: Report::new(json, text, outcome.conditions),
            planned,
        })
    }

    /// The loop with a plan of absolute readings.
    fn readings<'a>(&'a self, scenario: &'a Scenario) -> anyhow::Result<Looped<'a>> {
        let (common, task, seed) = (&self.common, &scenario.task, scenario.seed);
        let candidates = self.readings.candidates(scenario)?;
        let wanted = self.readings.wanted(scenario, candidates.as_deref());
        let provenance = common.provenance(scenario)?;
        let bar = progress::bar(common.quiet, "searching the plan");
        let watch = Watch {
            stop: &STOP,
            progress: &|done, all, _| progress::show(&bar, done, all),
        };
        let weights = if common.noise_only {
            ReadingWeights::Own
        } else {
            ReadingWeights::AsNeeded
        };
        let stage = |stage: &RunStage<'_>| {
            bar.finish_and_clear();
            tell(common, stage, "reading");
        };
        let ((planning, found), outcome) = run_absolute(scenario, &wanted, weights, watch, &stage)?;
        proceed()?;
        let groups = &*self.readings.parameters;
        let beside = (found.bound.as_ref(), wanted.drawn(seed));
        let planned = PlannedAccuracy::of_readings(task, groups, planning, found.plan, beside);
        let PlannedAccuracy::Readings(_, _, plan) = &planned else {
            anyhow::bail!("a plan of absolute readings has a record of its own");
        };
        let mut conditions = planned.conditions(scenario);
        conditions.extend(outcome.conditions(scenario));
        let stills = planned.stills(scenario);
        let page = absolute_page(&AbsolutePageRecord {
            page: PlanPage {
                scenario,
                stills: &stills.figures(),
                conditions: &conditions,
                provenance: &provenance,
                command: &command_line(),
            },
            plan,
            trials: None,
            run: Some(&outcome),
        })?;
        let sheet = stills.sheet();
        let record = &outcome.record;
        let text = absolute::describe(&record.identification, &scenario.task.belief.instrument)
            + &of_readings(plan, &outcome);
        let json = outcome.json(scenario, &provenance, plan, groups)?;
        Ok(Looped {
            measurements: absolute_table(&task.belief.commands(), &record.readings),
            sheet,
            page,
            shown: vec![CarriedOutPlan::Readings(
                Box::new(outcome.record),
                outcome.carried_out,
            )],
            bound: None,
            report: Report::new(json, text, conditions),
            planned,
        })
    }
}

/// Says on stderr what is being done, and what goes wrong without an end.
fn tell(common: &Common, stage: &RunStage<'_>, measuring: &str) {
    match stage {
        RunStage::Calibrating => {
            common.say(&format!(
                "{measuring}, identifying and compensating in MuJoCo"
            ));
        }
        RunStage::Failed(FailedPlan { name, problem, .. }) => {
            warn(
                &format!("the plan {name:?} cannot be compared: {problem}"),
                None,
            );
        }
        RunStage::Comparing => common.say(&format!("comparing with {RANDOM_PLANS} random plans")),
        RunStage::NoRandomPlans(problem) => {
            warn(&format!("no random plans to compare with: {problem}"), None);
        }
    }
}

/// What a calibration leaves in this run beside what was predicted, in words.
fn leaves(
    (count, noun): (u32, &str),
    residual_m: f64,
    budget: Option<&UncertaintyBudget>,
    [rho0_m, quantile95_m]: [Option<f64>; 2],
) -> String {
    let of = UncertaintyBudget::in_words(budget, noun);
    let tolerance = quantile95_m.map_or_else(String::new, |value_m| {
        format!(", 95 % below {:.1} um", value_m * 1e6)
    });
    format!(
        "After calibration with {}, the residual error after compensation is {:.1} um in this run; predicted {of}: {} um rms{tolerance}",
        counted(count.into(), noun),
        residual_m * 1e6,
        in_um(rho0_m, 1)
    )
}

/// What a run of deflections means, for a person.
fn of_deflections(outcome: &RunOutcome) -> String {
    let TriedPlan {
        assessment,
        calibration: (_, Calibration { poses, .. }),
        ..
    } = &outcome.tried[0];
    let rows = outcome.tried.iter().map(|entry| {
        let [_, residual_m] = rms_m(&entry.calibration.1.poses);
        vec![
            entry.calibration.0.clone(),
            in_um(entry.assessment.rho0_m, 2),
            number(entry.assessment.efficiency(), 4),
            in_um(Some(residual_m), 2),
            entry.assessment.violations.len().to_string(),
        ]
    });
    let header = "plan | predicted rms [um] | efficiency | observed in this run [um] | violations";
    let mut text = format!("\n{}", table(header, rows));
    if poses.len() > 1 {
        text += &at_test_poses(poses, "uncompensated");
    }
    for entry in &outcome.tried {
        if let Some(reason) = entry.assessment.no_bound() {
            let name = &entry.calibration.0;
            text += &format!("plan {name:?} has no efficiency: {reason}\n");
        }
    }
    text += &budget(assessment);
    let [uncompensated_m, residual_m] = rms_m(poses);
    let (at, rms) = match poses.as_slice() {
        [only] => (format!("the test pose {:?}", only.name), ""),
        several => (
            counted(several.len() as u64, "test pose"),
            " (rms by their weights)",
        ),
    };
    let along = match poses.iter().filter(|pose| pose.direction.is_some()).count() {
        0 => "",
        1 if poses.len() == 1 => " along its direction",
        _ => " along the directions that test poses have",
    };
    text += &format!(
        "\nAt {at} the task load bends the robot by {:.0} um{rms}{along}. {}",
        uncompensated_m * 1e6,
        leaves(
            (assessment.experiments, AccuracyKind::Relative.noun()),
            residual_m,
            assessment.uncertainty_budget.as_ref(),
            [assessment.rho0_m, assessment.quantile95_m],
        )
    );
    if let Some(bound_m) = assessment.bound_m() {
        text += &format!(
            "; no plan of as many measurements can do better than {:.1} um",
            bound_m * 1e6
        );
    }
    text += ".\n";
    if let Some((rho0_m, repeats)) = outcome.random_rho0_m.zip(outcome.random_repeats) {
        let words = match repeats {
            RepeatsNeeded::Times(times) => {
                format!("measured {times} times as a whole it has the same accuracy")
            }
            RepeatsNeeded::Never(limit_m) => format!(
                "however often it is measured as a whole, {:.1} um remain",
                limit_m * 1e6
            ),
        };
        text += &random("", rho0_m, &format!(": {words}"));
    }
    text
}

/// What was predicted and observed at each test pose, and under a name without what was identified.
fn at_test_poses(poses: &[CompensatedPose], without: &str) -> String {
    let row = |pose: &CompensatedPose| {
        let [before_m, after_m] = [pose.seen.uncompensated_m, pose.seen.residual_m];
        let predicted_m = pose.predicted_m.as_ref().ok().copied();
        let distances = [predicted_m, Some(after_m.norm()), Some(before_m.norm())];
        let distances = distances.map(|distance_m| in_um(distance_m, 2));
        [vec![pose.name.clone()], distances.to_vec()].concat()
    };
    let header =
        format!("test pose | predicted rms [um] | observed in this run [um] | {without} [um]");
    format!("\n{}", table(&header, poses.iter().map(row)))
}

/// What random plans predict, for a person.
fn random(of: &str, rho0_m: f64, words: &str) -> String {
    format!(
        "Predicted accuracy of a random plan of as many{of}: {:.1} um (median of {RANDOM_PLANS}){words}.\n",
        rho0_m * 1e6
    )
}

/// What a run of absolute readings means, for a person.
fn of_readings(plan: &AbsolutePlanMessage, outcome: &AbsoluteRun<'_>) -> String {
    let mut text = at_test_poses(&outcome.poses, "of the nominal robot");
    text += &uncertainty_budget::describe(plan.uncertainty_budget.as_ref());
    text += &left_out(plan);
    let [before_m, after_m] = rms_m(&outcome.poses);
    text += &format!(
        "\nThe loaded tool is {:.0} um rms from where the nominal robot has it, in the frames that suit the readings best. {}",
        before_m * 1e6,
        leaves(
            (plan.experiments, AccuracyKind::Absolute.noun()),
            after_m,
            plan.uncertainty_budget.as_ref(),
            [plan.rho0_mm, plan.quantile95_mm].map(|value| value.map(|mm| mm * 1e-3)),
        )
    );
    if let Some(bound_mm) = plan.lower_bound_rho0_mm {
        text += &format!(
            "; no plan of as many candidates is below {:.1} um ({})",
            bound_mm * 1e3,
            bound_basis(plan)
        );
    }
    text += ".\n";
    if let Some(median_m) = outcome.random_rho0_m {
        text += &random(" of the same candidates", median_m, "");
    }
    text
}
