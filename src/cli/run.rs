//! `run`: the whole loop, and a folder with all that came of it.

use crate::identification::{AbsoluteMessage, ReadingWeights};
use crate::measurement::{SimulatedRun, absolute_table, deflection_table};
use crate::plan::search::{Bound, PlanSize, Watch};
use crate::plan::{Criterion, take_nearest_turns};
use crate::record::{absolute_plan::AbsolutePlanMessage, run::RunMessage};
use crate::text::wording::shell_path;
use crate::view::markup::PageError;
use crate::view::recording::Recording;
use crate::view::report::{PlanPage, absolute_page, cards, of_readings, of_run, run_page};
use crate::view::stills::Stills;
use crate::view::tables;
use crate::workflow::design::Wanted;
use crate::workflow::run::{
    AbsoluteRun, FailedPlan, RANDOM_PLANS, RUN, RunOutcome, RunStage, run, run_absolute,
};

use super::command_prelude::*;
use super::identify::{absolute, deflections};
use super::interruption::{STOP, proceed};
use super::plan::design;
use super::plan_args::ReadingsArgs;
use super::planned::{PlannedAccuracy, left_out};
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

/// Makes the page of a loop.
type PageOf<'a> = Box<dyn Fn(&PlanPage<'_>) -> Result<String, PageError> + 'a>;

/// What a loop comes to, whatever was measured.
struct Looped<'a> {
    planned: PlannedAccuracy<'a>,
    report: Report,
    /// The rows of measurements.csv.
    measurements: String,
    page: PageOf<'a>,
    shown: Vec<RunMessage>,
    /// What no plan is below, where that may be proved.
    bound: Option<Bound>,
}

impl Run {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let common = &self.common;
        let scenario = common.open("run")?;
        let folder = common.results_folder(&scenario, &[&FILES[..], RUN_FILES].concat())?;
        let design = &scenario.task.design;
        let measurements = counted(design.experiments.into(), design.accuracy.noun());
        common.say(&format!("designing a plan of {measurements}"));
        let looped = match design.accuracy {
            AccuracyKind::Absolute => self.readings(&scenario)?,
            AccuracyKind::Relative => self.deflections(&scenario)?,
        };
        let mut report = looped.report;
        let stills = Stills::of_taken(&scenario, &looped.planned.plan);
        let [plan, measurements, results] = FILES.map(|name| folder.join(name));
        let page = (looped.page)(&PlanPage {
            scenario: &scenario,
            stills: &stills.figures(),
            conditions: &report.conditions,
            provenance: &common.provenance(&scenario)?,
            command: &command_line(),
            plan: &plan,
            parameters: &self.readings.parameters,
        })?;
        let written = &mut report.written;
        written.note(&plan, looped.planned.plan.write(&scenario.task, &plan));
        let origin = scenario
            .origin()
            .simulated(SimulatedRun::first(scenario.seed, Some(RUN)));
        written.save(&measurements, &(origin.comments() + &looped.measurements));
        let record = record_text(&mut report.json, &report.conditions)?;
        written.save(&results, &record);
        written.save(&folder.join("stills.svg"), &stills.sheet()?);
        written.save(&folder.join("report.html"), &page);
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
        let budget = looped.planned.budget.as_ref();
        self.budget.write(budget, &mut report);
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
        let wanted = Wanted {
            criterion: Criterion::TestPose,
            size: PlanSize::wanted_by(task),
        };
        let (mut designed, approximate) = design(common, task, seed, wanted, &self.proof, &STOP)?;
        take_nearest_turns(task, scenario.laboratory.home(), &mut designed.exact.plan);
        proceed()?;
        let outcome = run(scenario, (&designed, &approximate), &STOP, &|stage| {
            tell(common, stage, "measuring");
        });
        let outcome = outcome?;
        proceed()?;
        let main = &outcome.tried[0];
        let made = &main.calibration;
        let planned =
            PlannedAccuracy::of_deflections(scenario, made.plan.clone(), &main.assessment);
        let shown = outcome.tried.iter().map(|each| each.record.clone());
        let commands = task.belief.commands();
        let text = deflections::describe(&made.identification, &task.belief);
        let text = text + &told_of_deflections(scenario, &outcome)?;
        let json = outcome.json(scenario, designed.elapsed_s)?;
        Ok(Looped {
            measurements: deflection_table(&scenario.path, &commands, &made.measurements)?,
            shown: shown.collect(),
            bound: Some(designed.bound),
            report: Report::new(json, text, outcome.conditions.clone()),
            planned,
            page: Box::new(move |page| run_page(page, &outcome)),
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
        let Some(plan) = planned.record.clone() else {
            anyhow::bail!("a plan of absolute readings has a record of its own");
        };
        let mut conditions = planned.conditions.clone();
        conditions.extend(outcome.conditions(scenario));
        let found = AbsoluteMessage::new(&outcome.identified.case, &outcome.identified.fit);
        let told = told_of_readings(&plan, &outcome)?;
        let text = absolute::describe(&found, &task.belief) + &told;
        let json = outcome.json(scenario, &provenance, &plan, groups)?;
        Ok(Looped {
            measurements: absolute_table(&task.belief.commands(), &outcome.readings),
            shown: vec![outcome.record.clone()],
            bound: None,
            report: Report::new(json, text, conditions),
            page: Box::new(move |page| absolute_page(page, &plan, None, Some(&outcome))),
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

/// What a run of deflections means, for a person.
fn told_of_deflections(scenario: &Scenario, outcome: &RunOutcome) -> Result<String, PageError> {
    let mut text = format!("\n{}", tables::tried(&outcome.tried).plain());
    let own = &outcome.tried[0];
    if own.record.test_poses.len() > 1 {
        let poses = tables::test_poses(&own.record.test_poses, "uncompensated");
        text += &format!("\n{}", poses.plain());
    }
    for entry in &outcome.tried {
        if let Some(reason) = entry.assessment.no_bound() {
            let name = &entry.record.name;
            text += &format!("plan {name:?} has no efficiency: {reason}\n");
        }
    }
    text += &uncertainty_budget::describe(own.assessment.uncertainty_budget.as_ref());
    let cards = cards("of_run", &of_run(scenario, outcome))?;
    Ok(format!("{text}\n{cards}"))
}

/// What a run of absolute readings means, for a person.
fn told_of_readings(
    plan: &AbsolutePlanMessage,
    outcome: &AbsoluteRun<'_>,
) -> Result<String, PageError> {
    let poses = tables::test_poses(&outcome.record.test_poses, "of the nominal robot");
    let mut text = format!("\n{}", poses.plain());
    text += &uncertainty_budget::describe(plan.uncertainty_budget.as_ref());
    let cards = cards("of_readings", &of_readings(plan, Some(outcome)))?;
    Ok(format!("{text}{}\n{cards}", left_out(plan)))
}
