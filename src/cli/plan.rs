//! `plan`: design a plan of experiments.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args;
use elastocal::codes::ErrorCode;
use elastocal::files::FileError;
use elastocal::laboratory::Campaign;
use elastocal::laboratory::time::{TimedPlan, plans_within};
use elastocal::plan::search::{
    ApproximateDesign, Bound, BoundKind, Candidates, Certificate, ExactDesign, Problem,
    SearchError, Watch,
};
use elastocal::plan::{Assessment, Criterion, Plan, take_nearest_turns, write_plan};
use elastocal::quantities::{limits::MOST_EXPERIMENTS, plausible::MINUTES};
use elastocal::record::messages::{AssessmentMessage, ProvenanceMessage, plan_messages};
use elastocal::record::{candidates::CandidatesMessage, json::merge};
use elastocal::scenario::Scenario;
use elastocal::task::{AccuracyKind, Task};
use elastocal::text::wording::counted;
use elastocal::view::stills;
use elastocal::workflow::design::{Designed, Onlooker, Wanted, design as design_of, design_among};
use serde_json::json;

use super::absolute_plan::{
    AbsoluteOutputs, AbsoluteWanted, RUN_REPORTS, UnknownArgs, refuse_options,
    refuse_where_relative,
};
use super::candidates::{CandidateArgs, PoseArgs, told};
use super::conditions::{conditions, search_stopped};
use super::evaluate::describe;
use super::interruption::ask_search;
use super::progress::{bar, show};
use super::proof::ProofArgs;
use super::table::table;
use super::uncertainty_budget::BudgetArgs;
use super::written::Written;
use super::{Common, Report, check_outputs, inputs, rests, results, without_effect};

/// So many configurations are drawn where nothing else is said.
pub const DRAWN: u32 = 200;

/// Arguments of `plan`.
#[derive(Debug, Args)]
#[command(mut_args(without_effect(&["out"])))]
pub struct PlanCommand {
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    proof: ProofArgs,
    #[command(flatten)]
    candidates: CandidateArgs,
    #[command(flatten)]
    poses: PoseArgs,
    #[command(flatten)]
    unknown: UnknownArgs,
    #[command(flatten)]
    budget: BudgetArgs,
    /// The number m of measurements; the scenario's if not given.
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_EXPERIMENTS)))]
    experiments: Option<u32>,
    /// At most so many different configurations, repeated.
    #[arg(long, value_name = "C", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_EXPERIMENTS)))]
    configurations: Option<u32>,
    /// At most so many minutes, by the table [laboratory] of the scenario, in place of a number of measurements.
    #[arg(long, value_name = "MIN", value_parser = minutes, conflicts_with_all = ["experiments", "configurations", "criterion", "candidates"])]
    minutes: Option<f64>,
    /// With design.accuracy = "absolute" and without --candidates, begin with so many configurations at random [default: 200]
    #[arg(long, value_name = "N", conflicts_with = "candidates", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    draw: Option<u32>,
    /// What makes the plan good; any of them with --candidates, and test-pose, a, d or o1 without
    #[arg(long, value_enum, default_value_t)]
    criterion: Criterion,
    /// Where to write the plan.
    #[arg(long, value_name = "FILE")]
    plan_out: Option<PathBuf>,
    /// Where to draw the robot in each configuration of the plan (SVG).
    #[arg(long, value_name = "FILE")]
    stills_out: Option<PathBuf>,
    /// With design.accuracy = "absolute", where to write a page about the plan (HTML).
    #[arg(long, value_name = "FILE")]
    report_out: Option<PathBuf>,
}

/// Designs a plan with a progress bar, as long as it is not asked to stop.
pub fn design(
    common: &Common,
    task: &Task,
    seed: u64,
    wanted: Wanted,
    proof: &ProofArgs,
    stop: &AtomicBool,
) -> Result<Designed, SearchError> {
    let bar = bar(common.quiet, "searching the plan");
    let prove = |bound: Bound, approximate: &ApproximateDesign| {
        let sizes = [wanted.experiments];
        proof.with_effort(common, stop, |effort| {
            bound.prove(approximate, seed, &sizes, effort)
        })
    };
    let progress = |bound: &Bound, done: usize, all: usize, cost: f64| {
        show(&bar, done, all);
        if wanted.criterion == Criterion::TestPose {
            let least = bound.of_size(wanted.experiments).map_or_else(
                |_| String::new(),
                |bound| format!(", bound {:.4} um", bound.best * 1e6),
            );
            bar.set_message(format!("best {:.4} um{least}", cost.sqrt() * 1e6));
        }
    };
    let onlooker = Onlooker {
        stop,
        prove: &prove,
        progress: &progress,
    };
    let designed = design_of(task, seed, wanted, onlooker)?;
    bar.finish_and_clear();
    super::interruption::searched();
    Ok(designed)
}

/// What searches for the plan say, where there were any.
fn searched(searches: usize, agreeing: usize, elapsed_s: f64) -> String {
    let found = if searches == 0 {
        "The plan rounds the weights of the approximate design: no search could end more than 0.1 % lower."
            .to_owned()
    } else {
        format!(
            "Of {searches} independent searches for the plan, {agreeing} ended within 0.1 % of it."
        )
    };
    format!("{found} It took {elapsed_s:.2} s.\n")
}

/// The uncertainties that the search leaves out.
fn left_out(task: &Task) -> String {
    let problem = Problem::new(task, Criterion::TestPose);
    match problem.left_out().as_slice() {
        [] => String::new(),
        names => format!(
            "\nSearch and bound assume exact: {}, together less than 1 % of the variance. The predicted accuracy counts them.\n",
            names.join(", ")
        ),
    }
}

fn minutes(text: &str) -> Result<f64, String> {
    let number = text.parse().map_err(|_| MINUTES.allowed())?;
    MINUTES.check(number)
}

/// Takes the plan of a larger search where it keeps within so many minutes, too, and else the one that is known to; and
/// tells how many it takes.
fn keep_in_time(scenario: &Scenario, exact: &mut ExactDesign, timed: &TimedPlan, most: f64) -> f64 {
    let campaign = Campaign::new(&scenario.task, &scenario.laboratory, &exact.plan, false);
    match campaign {
        Ok(campaign) if campaign.minutes <= most => campaign.minutes,
        _ => {
            exact.plan = timed.plan.clone();
            exact.cost = timed.rho0_m.powi(2);
            timed.minutes
        }
    }
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
            format!("{:.3}", plan.rho0_m * 1e6),
            format!("{:.0}", plan.minutes),
        ]
    };
    let header = "configurations | measurements | rho0 [um] | minutes";
    let rows = timed.iter().map(row);
    table(header, rows) + "\n"
}

/// What the bound rests on, in words.
fn rests_on(certificate: &Certificate, assessment: &Assessment) -> String {
    let asked_for = assessment.asked_for();
    let rests = match asked_for.map(|(_, bound)| bound.as_ref().map(|bound| bound.kind)) {
        Some(Ok(BoundKind::Proved)) => "The largest directional derivative was",
        _ => "The bound rests on the largest directional derivative",
    };
    format!(
        "{rests} found by {} local searches, of which {} ended within 0.1 % of it.\n",
        certificate.searches, certificate.agreeing,
    )
}

impl PlanCommand {
    /// Writes the plan, its budget and its pictures where that is wanted, and tells of it.
    fn write(
        &self,
        scenario: &Scenario,
        (plan, assessment): (&Plan, &Assessment),
        written: &mut Written,
    ) -> String {
        let budget = assessment.uncertainty_budget.as_ref();
        let mut text = self.budget.write(budget, written);
        if let Some(path) = &self.plan_out {
            let rows = write_plan(path, scenario.task.belief.commands(), plan);
            text += &written.noted(path, rows);
        }
        if let Some(path) = &self.stills_out {
            text += &written.save(path, &stills::sheet(scenario, plan));
        }
        text
    }

    /// The best plans within a time, of which there is at least one.
    fn within(
        &self,
        scenario: &Scenario,
        minutes: f64,
        stop: &AtomicBool,
    ) -> anyhow::Result<Vec<TimedPlan>> {
        self.common
            .say(&format!("searching plans of at most {minutes} minutes"));
        let watch = Watch {
            stop,
            progress: &|_, _, _| {},
        };
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

    /// A plan of absolute readings.
    fn absolute(&self, scenario: &Scenario, sizes: [u32; 2]) -> anyhow::Result<Report> {
        let given = [
            ("--minutes", self.minutes.is_some()),
            ("--criterion", self.criterion != Criterion::TestPose),
        ];
        refuse_options(scenario, &given)?;
        refuse_options(scenario, &self.proof.given())?;
        let wanted = AbsoluteWanted {
            common: &self.common,
            scenario,
            unknown: &self.unknown,
            candidates: self.candidates.path(),
            poses: &self.poses,
            budget: &self.budget,
        };
        let outputs = AbsoluteOutputs {
            plan: self.plan_out.as_deref(),
            stills: self.stills_out.as_deref(),
            report: self.report_out.as_deref(),
        };
        wanted.design(sizes, self.draw.unwrap_or(DRAWN), outputs)
    }

    /// A plan of candidates.
    fn among(
        &self,
        scenario: &Scenario,
        candidates: &Candidates,
        wanted: Wanted,
    ) -> anyhow::Result<Report> {
        self.common.say(&format!(
            "designing a plan of {} among {} for the criterion {}",
            counted(wanted.experiments.into(), "measurement"),
            counted(candidates.experiments.len() as u64, "candidate"),
            self.criterion.name()
        ));
        let bar = bar(self.common.quiet, "searching the plan");
        let progress = |done: usize, all: usize, _: f64| show(&bar, done, all);
        let watch = Watch {
            stop: ask_search(),
            progress: &progress,
        };
        let designed = design_among(&scenario.task, candidates, scenario.seed, wanted, watch)
            .map_err(|error| self.candidates.wrong(error))?;
        bar.finish_and_clear();
        super::interruption::searched();
        let plan = &designed.exact.plan;
        let mut assessment = Assessment::new(&scenario.task, plan, Some(&designed.bound));
        if let Some(bound) = &designed.by_criterion {
            assessment = assessment.beside(bound, plan);
        }
        let mut text = describe(scenario, &assessment) + &left_out(&scenario.task) + "\n";
        text += &told(&self.candidates, candidates);
        text += &format!(
            "Of {} searches for the plan, {} ended within 0.1 % of it. It took {:.2} s.\n",
            designed.exact.searches, designed.exact.agreeing, designed.elapsed_s
        );
        let mut written = Written::default();
        text += &self.write(scenario, (plan, &assessment), &mut written);
        let different = wanted.configurations.unwrap_or(wanted.experiments);
        let json = json!({
            "gate": scenario.gate,
            "plan": plan_messages(&scenario.task.belief.commands(), plan),
            "criterion": self.criterion.name(),
            "minutes": null,
            "configurations": different.min(wanted.experiments),
            "elapsed_s": designed.elapsed_s,
            "searches": designed.exact.searches,
            "searches_agreeing": designed.exact.agreeing,
            "bound_searches": 0,
            "bound_searches_agreeing": 0,
            "candidates": CandidatesMessage::new(candidates),
        });
        let provenance = ProvenanceMessage::new(scenario)
            .with_optional("test_poses", self.poses.path())?
            .with_optional("candidates", self.candidates.path())?;
        let json = results("plan", &provenance, json);
        let mut report = reported(scenario, &assessment, designed.is_cut_short, (json, text))?;
        report.conditions.extend(written.conditions());
        Ok(report)
    }

    pub fn execute(&self) -> anyhow::Result<Report> {
        let mut scenario = self.common.load()?;
        let outputs = [
            ("--plan-out", self.plan_out.as_deref()),
            ("--stills-out", self.stills_out.as_deref()),
            ("--report-out", self.report_out.as_deref()),
            ("--proof-out", self.proof.out()),
            self.budget.out(),
        ];
        let mut roles = inputs(&scenario);
        roles.may_read("the test poses", self.poses.path());
        roles.may_read("the candidates", self.candidates.path());
        check_outputs(&mut roles, &outputs)?;
        self.poses.replace(&mut scenario.task)?;
        rests(&scenario)?;
        if let Some(experiments) = self.experiments {
            scenario.task.design.experiments = experiments;
            scenario.task.design.configurations = None;
        }
        let experiments = scenario.task.design.experiments;
        let configurations = self.configurations.or(scenario.task.design.configurations);
        if scenario.task.design.accuracy == AccuracyKind::Absolute {
            return self.absolute(
                &scenario,
                [experiments, configurations.unwrap_or(experiments)],
            );
        }
        self.unknown.refuse(&scenario)?;
        let instead = "plans of deflections are searched in the whole region";
        let given = [
            ("--draw", self.draw.is_some(), instead),
            ("--report-out", self.report_out.is_some(), RUN_REPORTS),
        ];
        refuse_where_relative(&scenario, &given)?;
        if let Some(candidates) = self.candidates.read(&scenario.task)? {
            let wanted = Wanted {
                criterion: self.criterion,
                experiments,
                configurations,
            };
            return self.among(&scenario, &candidates, wanted);
        }
        self.anywhere(scenario, experiments, configurations)
    }

    /// A plan anywhere in the scenario's region.
    fn anywhere(
        &self,
        mut scenario: Scenario,
        experiments: u32,
        configurations: Option<u32>,
    ) -> anyhow::Result<Report> {
        let stop = ask_search();
        let (timed, experiments, configurations) = match self.minutes {
            Some(minutes) => {
                let timed = self.within(&scenario, minutes, stop)?;
                let best = &timed[0];
                let (experiments, configurations) = (best.experiments, best.configurations);
                scenario.task.design.experiments = experiments;
                (timed, experiments, Some(configurations))
            }
            None => (Vec::new(), experiments, configurations),
        };
        self.common.say(&format!(
            "designing a plan of {}{} for the criterion {}",
            counted(experiments.into(), "measurement"),
            configurations.map_or_else(String::new, |count| format!(
                " in {}",
                counted(count.into(), "configuration")
            )),
            self.criterion.name()
        ));
        let mut designed = design(
            &self.common,
            &scenario.task,
            scenario.seed,
            Wanted {
                criterion: self.criterion,
                experiments,
                configurations,
            },
            &self.proof,
            stop,
        )?;
        let minutes = (self.minutes)
            .map(|most| keep_in_time(&scenario, &mut designed.exact, &timed[0], most));
        let home = scenario.laboratory.home();
        take_nearest_turns(&scenario.task, home, &mut designed.exact.plan);
        let plan = &designed.exact.plan;
        let mut assessment = Assessment::new(&scenario.task, plan, Some(&designed.bound));
        if let Some((_, bound)) = &designed.by_criterion {
            assessment = assessment.beside(bound, plan);
        }
        let mut text = tell(&timed) + &describe(&scenario, &assessment);
        text += &(left_out(&scenario.task) + "\n");
        let mut written = Written::default();
        let provenance =
            ProvenanceMessage::new(&scenario).with_optional("test_poses", self.poses.path())?;
        text += &(self.proof).tell(designed.wanted_bound(), &provenance, &mut written)?;
        let certificate = &designed.wanted_approximate().certificate;
        text += &rests_on(certificate, &assessment);
        text += &searched(
            designed.exact.searches,
            designed.exact.agreeing,
            designed.elapsed_s,
        );
        text += &self.write(&scenario, (plan, &assessment), &mut written);
        let json = json!({
            "gate": scenario.gate,
            "plan": plan_messages(&scenario.task.belief.commands(), plan),
            "criterion": self.criterion.name(),
            "minutes": minutes,
            "configurations": configurations.unwrap_or(experiments).min(experiments),
            "elapsed_s": designed.elapsed_s,
            "searches": designed.exact.searches,
            "searches_agreeing": designed.exact.agreeing,
            "bound_searches": certificate.searches,
            "bound_searches_agreeing": certificate.agreeing,
        });
        let json = results("plan", &provenance, json);
        let mut report = reported(&scenario, &assessment, designed.is_cut_short, (json, text))?;
        report.conditions.extend(written.conditions());
        Ok(report)
    }
}

/// The predicted accuracy of a plan, beside what else is told of it.
fn reported(
    scenario: &Scenario,
    assessment: &Assessment,
    is_cut_short: bool,
    (mut json, text): (serde_json::Value, String),
) -> anyhow::Result<Report> {
    let message = AssessmentMessage::new(scenario, assessment);
    merge(&mut json, serde_json::to_value(message)?);
    let mut conditions = conditions(scenario, assessment);
    if is_cut_short {
        conditions.push(search_stopped());
    }
    Ok(Report::new(json, text, conditions))
}
