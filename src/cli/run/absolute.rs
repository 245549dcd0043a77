//! `run` for an absolute accuracy: a plan of absolute readings.

use std::path::Path;

use elastocal::files::output::write_whole;
use elastocal::identification::ReadingWeights;
use elastocal::measurement::absolute_table;
use elastocal::plan::UncertaintyBudget;
use elastocal::plan::search::Watch;
use elastocal::record::absolute_plan::AbsolutePlanMessage;
use elastocal::scenario::Scenario;
use elastocal::text::wording::counted;
use elastocal::view::recording::{CarriedOutPlan, Recording};
use elastocal::view::report::{AbsolutePageRecord, absolute_page};
use elastocal::workflow::run::{RANDOM_PLANS, RunStage};
use elastocal::workflow::run_absolute::{AbsoluteRun, RUN, run_absolute};

use super::{FILES, Run, say_laboratory};
use crate::cli::identify::absolute::describe;
use crate::cli::interruption::{STOP, proceed};
use crate::cli::planned::{PlannedAccuracy, left_out};
use crate::cli::progress;
use crate::cli::table::{number, table};
use crate::cli::uncertainty_budget;
use crate::cli::views::{command_line, show, write_recording};
use crate::cli::written::{Written, record_text, warn};
use crate::cli::{Common, Report};

impl Run {
    /// The loop, and all files.
    pub(super) fn of_readings(&self, scenario: &Scenario, folder: &Path) -> anyhow::Result<Report> {
        let (common, task, seed) = (&self.common, &scenario.task, scenario.seed);
        let candidates = self.readings.candidates(scenario)?;
        let wanted = self.readings.wanted(scenario, candidates.as_deref());
        let provenance = common.provenance(scenario)?;
        let readings = counted(task.design.experiments.into(), "absolute reading");
        common.say(&format!("designing a plan of {readings}"));
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
        let ((planning, found), outcome) = run_absolute(
            scenario,
            &wanted,
            weights,
            (watch, &|stage| {
                bar.finish_and_clear();
                tell(common, stage);
            }),
        )?;
        proceed()?;
        if let Err(problem) = &outcome.random_rho0_m {
            warn(&format!("no random plans to compare with: {problem}"), None);
        }
        let beside = (found.bound.as_ref(), wanted.drawn(seed));
        let planned =
            PlannedAccuracy::of_readings(task, wanted.groups, planning, found.plan, beside);
        let PlannedAccuracy::Readings(_, _, plan) = &planned else {
            anyhow::bail!("a plan of absolute readings has a record of its own");
        };
        let mut conditions = planned.conditions(scenario);
        conditions.extend(outcome.conditions(scenario));
        let mut json = outcome.json(scenario, &provenance, plan, wanted.groups)?;
        let stills = planned.stills(scenario);
        let page = absolute_page(&AbsolutePageRecord {
            scenario,
            plan,
            trials: None,
            run: Some(&outcome),
            provenance: &provenance,
            stills: &stills.figures(),
            conditions: &conditions,
            command: &command_line(),
        })?;
        let mut written = Written::default();
        let [plan_file, measurements, results] = FILES.map(|name| folder.join(name));
        written.note(&plan_file, planned.write(task, &plan_file));
        let origin = scenario.origin().simulated(seed, Some(RUN));
        let rows =
            origin.comments() + &absolute_table(&task.belief.commands(), &outcome.record.readings);
        written.note(&measurements, write_whole(&measurements, rows.as_bytes()));
        written.save(&results, &record_text(&mut json, &conditions)?);
        written.save(&folder.join("stills.svg"), &stills.sheet());
        written.save(&folder.join("report.html"), &page);
        let mut text = describe(&outcome.record.identification) + &summary(plan, &outcome);
        let shown = CarriedOutPlan::Readings(Box::new(outcome.record), outcome.carried_out);
        let recording = Recording::new(scenario, &[shown])?;
        write_recording(&recording, &folder.join("run.rrd"), &mut written);
        if let Some(target) = &self.rerun {
            show(target, &recording, &mut written)?;
        }
        text += &format!("Results are in {}\n", folder.display());
        text += &self.budget.write(planned.budget(), &mut written);
        say_laboratory(common, scenario, folder);
        conditions.extend(written.conditions());
        Ok(Report::new(json, text, conditions))
    }
}

/// Says on stderr what is being done.
fn tell(common: &Common, stage: &RunStage<'_>) {
    match stage {
        RunStage::Calibrating => common.say("reading, identifying and compensating in MuJoCo"),
        _ => common.say(&format!("comparing with {RANDOM_PLANS} random plans")),
    }
}

/// What it means, for a person.
fn summary(plan: &AbsolutePlanMessage, outcome: &AbsoluteRun<'_>) -> String {
    let micro = |value_mm: Option<f64>| number(value_mm.map(|value_mm| value_mm * 1e3), 2);
    let rows = outcome.record.test_poses.iter().map(|pose| {
        let distances = [
            pose.rho0_mm,
            Some(pose.residual_mm),
            Some(pose.uncompensated_mm),
        ];
        let distances = distances.map(micro);
        [vec![pose.name.clone()], distances.to_vec()].concat()
    });
    let header =
        "test pose | predicted rms [um] | observed in this run [um] | of the nominal robot [um]";
    let common = plan.common_sources.as_ref();
    let budget = uncertainty_budget::describe(
        plan.uncertainty_budget.as_ref(),
        common.map(|common| (&*common.names, common.rho0_mm)),
    );
    let mut text = format!("\n{}{budget}", table(header, rows));
    text += &left_out(plan);
    let uncertain = plan.uncertainty_budget.as_ref();
    let leaves = if uncertain.is_some_and(UncertaintyBudget::has_more_than_noise) {
        "with the whole uncertainty budget"
    } else {
        "for the readings' noise alone"
    };
    let [before_m, after_m] = outcome.observed_rms_m();
    text += &format!(
        "\nThe loaded tool is {:.0} um rms from where the nominal robot has it, in the frames that suit the readings best. After \
         calibration with {}, the residual error is {:.1} um in this run; predicted {leaves}: {} um rms",
        before_m * 1e6,
        counted(plan.experiments.into(), "absolute reading"),
        after_m * 1e6,
        micro(plan.rho0_mm)
    );
    if let Some(quantile_mm) = plan.quantile95_mm {
        text += &format!(", 95 % below {:.1} um", quantile_mm * 1e3);
    }
    if let Some(bound_mm) = plan.lower_bound_rho0_mm {
        let basis = if plan.drawn.is_some() {
            "evidence, no proof"
        } else {
            "proved by looking at all"
        };
        text += &format!(
            "; no plan of as many candidates is below {:.1} um ({basis})",
            bound_mm * 1e3
        );
    }
    text += ".\n";
    if let Some(median_mm) = outcome.random_rho0_mm() {
        text += &format!(
            "Predicted accuracy of a random plan of as many of the same candidates: {:.1} um (median of {RANDOM_PLANS}).\n",
            median_mm * 1e3
        );
    }
    text
}
