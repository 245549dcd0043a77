//! `plan`: design a plan of experiments.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::laboratory::Campaign;
use crate::laboratory::time::{TimedPlan, plans_within};
use crate::plan::search::{
    ApproximateDesign, Bound, BoundKind, Candidates, Certificate, PlanSize, Problem, SearchError,
    Watch,
};
use crate::plan::{Assessment, Criterion, Plan, take_nearest_turns};
use crate::quantities::{limits::MOST_EXPERIMENTS, plausible::MINUTES};
use crate::record::messages::plan_messages;
use crate::task::Task;
use crate::view::stills::Stills;
use crate::workflow::design::{Designed, Wanted, design as design_of, design_among};

use super::command_prelude::*;
use super::interruption::{STOP, ask_search, searched};
use super::plan_args::{PlanArgs, of_any_plan, offered};
use super::planned::{PlannedAccuracy, search_stopped};
use super::progress::{bar, search, show};
use super::proof::ProofArgs;

#[derive(Debug, Args)]
#[command(mut_arg("candidates", of_any_plan), mut_args(without_effect(&["out"])))]
pub struct PlanCommand {
    #[command(flatten)]
    pub args: PlanArgs,
    /// The number m of measurements; the scenario's if not given.
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_EXPERIMENTS)))]
    experiments: Option<u32>,
    /// At most so many different configurations, repeated.
    #[arg(long, value_name = "C", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_EXPERIMENTS)))]
    configurations: Option<u32>,
    /// At most so many minutes, by the table [laboratory] of the scenario, in place of a number of measurements.
    #[arg(long, value_name = "MIN", value_parser = |text: &str| MINUTES.parse(text), conflicts_with_all = ["experiments", "configurations", "criterion", "candidates"])]
    minutes: Option<f64>,
    /// What makes the plan good; any of them with --candidates, and test-pose, a, d or o1 without
    #[arg(long, value_enum, default_value_t)]
    criterion: Criterion,
    /// Where to write the plan.
    #[arg(long, value_name = "FILE")]
    plan_out: Option<PathBuf>,
    /// Where to draw the robot in each configuration of the plan (SVG).
    #[arg(long, value_name = "FILE")]
    stills_out: Option<PathBuf>,
}

/// Designs a plan anywhere in a region, with a progress bar, as long as it is not asked to stop.
pub fn design(
    common: &Common,
    task: &Task,
    seed: u64,
    wanted: Wanted,
    proof: &ProofArgs,
    stop: &AtomicBool,
) -> Result<(Designed, ApproximateDesign), SearchError> {
    let bar = bar(common.quiet, "searching the plan");
    let prove = |bound: Bound, approximate: &ApproximateDesign| {
        let sizes = [wanted.size.measurements];
        proof.with_effort(common, stop, |effort| {
            bound.prove(approximate, seed, &sizes, effort)
        })
    };
    let progress = |bound: &Bound, done: usize, all: usize, cost: f64| {
        show(&bar, done, all);
        if wanted.criterion == Criterion::TestPose {
            let least = bound.of_size(wanted.size.measurements).map_or_else(
                |_| String::new(),
                |bound| format!(", bound {:.4} um", bound.best * 1e6),
            );
            bar.set_message(format!("best {:.4} um{least}", cost.sqrt() * 1e6));
        }
    };
    let designed = design_of(task, seed, wanted, stop, &prove, &progress)?;
    bar.finish_and_clear();
    searched();
    Ok(designed)
}

/// The uncertainties that the search leaves out.
fn left_out(task: &Task) -> String {
    let problem = Problem::new(task, Criterion::TestPose);
    naming(
        problem.left_out(),
        "\nBound and first search assume exact: {}. The predicted accuracy counts them; where they make more than 1 % of the square \
         of it, the search is repeated with them.\n",
    )
}

/// The best plans for each number of configurations within a time, for a person.
fn tell(timed: &[TimedPlan]) -> String {
    if timed.is_empty() {
        return String::new();
    }
    let row = |plan: &TimedPlan| {
        vec![
            plan.configurations.to_string(),
            plan.experiments.to_string(),
            in_um(Some(plan.rho0_m), 3),
            format!("{:.0}", plan.minutes),
        ]
    };
    let header = "configurations | measurements | rho0 [um] | minutes";
    table(header, timed.iter().map(row)) + "\n"
}

/// What the bound rests on, in words.
fn rests_on(certificate: &Certificate, assessment: &Assessment) -> String {
    let bound = assessment
        .asked_for()
        .and_then(|(_, bound)| bound.as_ref().ok());
    let rests = match bound.map(|bound| bound.kind) {
        Some(BoundKind::Proved) => "The largest directional derivative was",
        _ => "The bound rests on the largest directional derivative",
    };
    format!(
        "{rests} found by {} local searches, of which {} ended within 0.1 % of it.\n",
        certificate.searches, certificate.agreeing,
    )
}

/// What searches for the plan say, where there were any; those in a region know nothing of one another.
fn told(designed: &Designed, is_anywhere: bool) -> String {
    let found = match (designed.exact.searches, is_anywhere) {
        (0, true) => "The plan rounds the weights of the approximate design: no search could end more than 0.1 % lower.".to_owned(),
        (searches, _) => format!(
            "Of {searches} {}searches for the plan, {} ended within 0.1 % of it.",
            if is_anywhere { "independent " } else { "" },
            designed.exact.agreeing
        ),
    };
    format!("{found} It took {:.2} s.\n", designed.elapsed_s)
}

impl PlanCommand {
    /// The best plans within a time, of which there is at least one; none where no time was given.
    fn within(&self, scenario: &Scenario) -> anyhow::Result<Vec<TimedPlan>> {
        let Some(minutes) = self.minutes else {
            return Ok(Vec::new());
        };
        let watch = Watch::quiet(ask_search());
        let searching = format!("searching plans of at most {minutes} minutes");
        self.args.common.say(&searching);
        let (task, laboratory) = (&scenario.task, &scenario.laboratory);
        let timed = plans_within(task, laboratory, minutes, scenario.seed, watch)?;
        if timed.is_empty() {
            let problem = format!("no plan takes at most {minutes} minutes");
            let wrong = FileError::new(&scenario.path, problem).at("laboratory");
            return Err(wrong
                .code(ErrorCode::NoPlan)
                .hint("give more minutes, or look at what work costs")
                .into());
        }
        Ok(timed)
    }

    pub fn execute(&self) -> anyhow::Result<Report> {
        let args = &self.args;
        let mut scenario = args.load()?;
        if let Some(experiments) = self.experiments {
            scenario.task.design.experiments = experiments;
            scenario.task.design.configurations = None;
        }
        args.common.refuse_others("plan", &scenario)?;
        let timed = self.within(&scenario)?;
        let wanted = &mut scenario.task.design;
        wanted.configurations = self.configurations.or(wanted.configurations);
        let (most, found) = (wanted.experiments, wanted.configurations);
        if let Some(found) = found.filter(|found| *found > most) {
            let problem =
                format!("found {found}; at most {most}, the number of measurements, are allowed");
            let wrong = FileError::new(&scenario.path, problem).at("--configurations");
            return Err(wrong.code(ErrorCode::Scenario).into());
        }
        if let Some(best) = timed.first() {
            wanted.experiments = best.experiments;
            wanted.configurations = Some(best.configurations);
        }
        let (planned, besides) = match scenario.task.design.accuracy {
            AccuracyKind::Absolute => self.readings(&scenario)?,
            AccuracyKind::Relative => self.deflections(&scenario, &timed)?,
        };
        let mut report = args.report("plan", &scenario, &planned, besides)?;
        report.text = tell(&timed) + &report.text;
        if let Some(path) = &self.plan_out {
            report.noted(path, planned.plan.write(&scenario.task, path));
        }
        if let Some(path) = &self.stills_out {
            report.save(path, &Stills::of_taken(&scenario, &planned.plan).sheet()?);
        }
        args.finish(
            &scenario,
            (&planned, None),
            self.plan_out.as_deref(),
            report,
        )
    }

    /// A plan of absolute readings, of candidates or of configurations that are drawn.
    fn readings<'a>(
        &'a self,
        scenario: &'a Scenario,
    ) -> anyhow::Result<(PlannedAccuracy<'a>, Report)> {
        let (args, task, seed) = (&self.args, &scenario.task, scenario.seed);
        let size = PlanSize::wanted_by(task);
        let readings = counted(size.measurements.into(), "absolute reading");
        let rows = args.readings.candidates(scenario)?;
        let chosen = args.readings.wanted(scenario, rows.as_deref());
        let count = |rows: &Vec<_>| counted(rows.len() as u64, "candidate");
        let among = rows.as_ref().map(|rows| format!("among {}", count(rows)));
        let place = among.as_deref().unwrap_or("at sampled configurations");
        let says = format!("designing a plan of {readings} {place}");
        let (planning, found) = search(&args.common, &says, |watch| {
            chosen.design(task, size, seed, watch)
        })
        .map_err(|error| error.in_file(chosen.path))?;
        let drawn = chosen.drawn(seed);
        let offer = offered(drawn, args.readings.candidates.as_deref(), &planning.offer);
        let [searches, agreeing] = found.searches;
        let json = json!({ "searches": searches, "searches_agreeing": agreeing });
        let told =
            format!("Of {searches} searches for the plan, {agreeing} ended within 0.1 % of it.\n");
        // One that goes on from the last plan agrees with nothing but itself.
        let after = if searches > 1 { offer + &told } else { offer };
        let beside = (found.bound.as_ref(), drawn);
        let planned = PlannedAccuracy::of_readings(
            task,
            &args.readings.parameters,
            planning,
            found.plan,
            beside,
        );
        let conditions = Vec::from_iter(STOP.load(Ordering::Relaxed).then(search_stopped));
        Ok((planned, Report::new(json, after, conditions)))
    }

    /// A plan of deflections, of candidates or anywhere in the scenario's region.
    fn deflections(
        &self,
        scenario: &Scenario,
        timed: &[TimedPlan],
    ) -> anyhow::Result<(PlannedAccuracy<'static>, Report)> {
        let (args, task, seed) = (&self.args, &scenario.task, scenario.seed);
        let candidates = args.read_candidates(task)?;
        let wanted = Wanted {
            criterion: self.criterion,
            size: PlanSize::wanted_by(task),
        };
        let of = match (&candidates, task.design.configurations) {
            (Some(all), _) => format!(
                " among {}",
                counted(all.experiments.len() as u64, "candidate")
            ),
            (None, Some(count)) => format!(" in {}", counted(count.into(), "configuration")),
            (None, None) => String::new(),
        };
        let says = format!(
            "designing a plan of {}{of} for the criterion {}",
            counted(wanted.size.measurements.into(), "measurement"),
            self.criterion.name()
        );
        let (mut designed, certificate) = if let Some(candidates) = &candidates {
            (self.among(scenario, candidates, wanted, &says)?, None)
        } else {
            let stop = ask_search();
            args.common.say(&says);
            let (designed, approximate) =
                design(&args.common, task, seed, wanted, &args.proof, stop)?;
            (designed, Some(approximate.certificate))
        };
        let plan = &mut designed.exact.plan;
        let turned = |plan: &mut Plan| {
            if candidates.is_none() {
                take_nearest_turns(task, scenario.laboratory.home(), plan);
            }
        };
        turned(plan);
        let minutes = (self.minutes.zip(timed.first()))
            .map(|(most, timed)| keep_in_time(scenario, plan, timed, &turned, most));
        let assessment = designed.assessment(task);
        let json = json!({
            "plan": plan_messages(&task.belief.commands(), &designed.exact.plan),
            "criterion": self.criterion.name(),
            "minutes": minutes,
            "configurations": wanted.size.configurations,
            "elapsed_s": designed.elapsed_s,
            "searches": designed.exact.searches,
            "searches_agreeing": designed.exact.agreeing,
            "bound_searches": certificate.map_or(0, |certificate| certificate.searches),
            "bound_searches_agreeing": certificate.map_or(0, |certificate| certificate.agreeing),
        });
        let conditions = Vec::from_iter(designed.is_cut_short.then(search_stopped));
        let mut report = Report::new(json, left_out(task) + "\n", conditions);
        if let Some(candidates) = &candidates {
            report.text += &args.told(&candidates.offer);
            report.json["candidates"] = json!(candidates.offer);
        }
        if let Some(certificate) = &certificate {
            let provenance = args.common.provenance(scenario)?;
            let bound = designed.by_criterion.as_ref().unwrap_or(&designed.bound);
            args.proof.tell(bound, &provenance, &mut report)?;
            report.text += &rests_on(certificate, &assessment);
        }
        report.text += &told(&designed, candidates.is_none());
        let planned = PlannedAccuracy::of_deflections(scenario, designed.exact.plan, &assessment);
        Ok((planned, report))
    }

    /// The best plan of candidates, with a progress bar.
    fn among(
        &self,
        scenario: &Scenario,
        candidates: &Candidates,
        wanted: Wanted,
        says: &str,
    ) -> anyhow::Result<Designed> {
        let designed = search(&self.args.common, says, |watch| {
            design_among(&scenario.task, candidates, scenario.seed, wanted, watch)
        });
        designed.map_err(|error| match &self.args.readings.candidates {
            Some(path) => FileError::new(path, error.to_string())
                .code(ErrorCode::NoPlan)
                .into(),
            None => anyhow::Error::from(error),
        })
    }
}

/// Takes the plan of a larger search where it keeps within so many minutes, too, and else the one that is known to; and
/// tells how many it takes.
fn keep_in_time(
    scenario: &Scenario,
    plan: &mut Plan,
    timed: &TimedPlan,
    turned: &dyn Fn(&mut Plan),
    most: f64,
) -> f64 {
    let in_time = |plan: &Plan| {
        let campaign = Campaign::new(&scenario.task, &scenario.laboratory, plan, false);
        let minutes = campaign.ok().map(|campaign| campaign.minutes);
        minutes.filter(|minutes| *minutes <= most)
    };
    let mut smaller = timed.plan.clone();
    turned(&mut smaller);
    // Nearer turns may take longer ways.
    let plans = [plan.clone(), smaller, timed.plan.clone()];
    let found = plans
        .into_iter()
        .find_map(|each| Some((in_time(&each)?, each)));
    let (minutes, kept) = found.unwrap_or_else(|| (timed.minutes, timed.plan.clone()));
    *plan = kept;
    minutes
}
