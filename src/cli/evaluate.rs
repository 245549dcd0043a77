//! `evaluate`: the predicted accuracy of a plan.

use std::path::PathBuf;

use clap::Args;
use elastocal::compensation::KnownArm;
use elastocal::plan::search::Bound;
use elastocal::plan::{Assessment, Criterion, FurtherError, Plan, posterior, read_plan};
use elastocal::record::messages::{AssessmentMessage, ProvenanceMessage};
use elastocal::record::{candidates::CandidatesMessage, json::merge};
use elastocal::scenario::Scenario;
use elastocal::task::AccuracyKind;
use elastocal::text::wording::counted;
use serde_json::json;

use super::absolute_plan::{
    AbsoluteWanted, EvaluatedAlso, RUN_REPORTS, UnknownArgs, refuse_options, refuse_where_relative,
};
use super::candidates::{CandidateArgs, PoseArgs, told};
use super::conditions::conditions;
use super::interruption::{STOP, proceed};
use super::proof::{ProofArgs, leaving_out};
use super::static_compliance::add_static_compliance;
use super::table::{number, or_dash, table};
use super::uncertainty_budget::{self, BudgetArgs};
use super::written::Written;
use super::{Common, Report, check_outputs, inputs, rests, results, without_effect};

/// Arguments of `evaluate`.
#[derive(Debug, Args)]
#[command(mut_args(without_effect(&["out"])))]
pub struct Evaluate {
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
    /// By which criterion no plan is better than the bound that is searched; of test-pose it is proved
    #[arg(long, value_enum, default_value_t)]
    criterion: Criterion,
    /// With design.accuracy = "absolute", sample so many virtual robots, read each by the plan, identify it, and compare
    /// residual errors with the predicted accuracy
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(2..=1_000_000))]
    trials: Option<u64>,
    /// With design.accuracy = "absolute", where to write a page about the plan (HTML).
    #[arg(long, value_name = "FILE")]
    report_out: Option<PathBuf>,
    /// Also the static compliance of the tool at the test poses (mm/N), with 95 % intervals after the plan.
    #[arg(long)]
    static_compliance: bool,
    /// The plan to assess.
    #[arg(long, value_name = "FILE")]
    plan: PathBuf,
}

impl Evaluate {
    /// What no plan of the region is better than.
    fn searched(&self, scenario: &Scenario, plan: &Plan) -> Bound {
        self.proof.with_effort(&self.common, &STOP, |proof| {
            let sizes = [plan.measurements()];
            Bound::search_and_prove(&scenario.task, self.criterion, scenario.seed, &sizes, proof)
        })
    }

    pub fn execute(&self) -> anyhow::Result<Report> {
        let mut scenario = self.common.load()?;
        let mut roles = inputs(&scenario);
        let outputs = [
            ("--proof-out", self.proof.out()),
            ("--report-out", self.report_out.as_deref()),
            self.budget.out(),
        ];
        roles.reads("the plan", &self.plan);
        roles.may_read("the test poses", self.poses.path());
        roles.may_read("the candidates", self.candidates.path());
        check_outputs(&mut roles, &outputs)?;
        self.poses.replace(&mut scenario.task)?;
        rests(&scenario)?;
        if scenario.task.design.accuracy == AccuracyKind::Absolute {
            let given = [("--criterion", self.criterion != Criterion::TestPose)];
            refuse_options(&scenario, &given)?;
            refuse_options(&scenario, &self.proof.given())?;
            let wanted = AbsoluteWanted {
                common: &self.common,
                scenario: &scenario,
                unknown: &self.unknown,
                candidates: self.candidates.path(),
                poses: &self.poses,
                budget: &self.budget,
            };
            let also = EvaluatedAlso {
                robots: self.trials,
                page: self.report_out.as_deref(),
                static_compliance: self.static_compliance,
            };
            return wanted.evaluate(&self.plan, also);
        }
        self.unknown.refuse(&scenario)?;
        refuse_where_relative(
            &scenario,
            &[
                (
                    "--trials",
                    self.trials.is_some(),
                    "`study` draws robots for plans of deflections",
                ),
                ("--report-out", self.report_out.is_some(), RUN_REPORTS),
            ],
        )?;
        let plan = read_plan(&self.plan, scenario.task.belief.commands())?;
        let candidates = self.candidates.read(&scenario.task)?;
        self.common.say("searching the bound that no plan can beat");
        let bound_by = |criterion: Criterion| match &candidates {
            Some(candidates) => candidates.bound(&scenario.task, criterion, &plan),
            None => Bound::search(&scenario.task, scenario.seed),
        };
        // Without a bound, the rest still holds.
        let bound = if candidates.is_some() {
            bound_by(self.criterion)
        } else {
            self.searched(&scenario, &plan)
        };
        proceed()?;
        let assessment = if self.criterion == Criterion::TestPose {
            Assessment::new(&scenario.task, &plan, Some(&bound))
        } else {
            let rho0 = bound_by(Criterion::TestPose);
            Assessment::new(&scenario.task, &plan, Some(&rho0)).beside(&bound, &plan)
        };
        let message = AssessmentMessage::new(&scenario, &assessment);
        let provenance = ProvenanceMessage::new(&scenario)
            .with_input("plan", &self.plan)?
            .with_optional("candidates", self.candidates.path())?
            .with_optional("test_poses", self.poses.path())?;
        let mut json = results("evaluate", &provenance, json!({ "gate": scenario.gate }));
        merge(&mut json, serde_json::to_value(&message)?);
        let mut written = Written::default();
        let proved = match &candidates {
            Some(candidates) => {
                let message = CandidatesMessage::new(candidates);
                merge(&mut json, json!({ "candidates": message }));
                told(&self.candidates, candidates)
            }
            None => self.proof.tell(&bound, &provenance, &mut written)?,
        };
        let mut text = describe(&scenario, &assessment) + &proved;
        let budget = assessment.uncertainty_budget.as_ref();
        text += &self.budget.write(budget, &mut written);
        let mut conditions = conditions(&scenario, &assessment);
        conditions.extend(written.conditions());
        let mut report = Report::new(json, text, conditions);
        if self.static_compliance {
            let belief = &scenario.task.belief;
            let (arm, set) = belief.parameters_of_arm()?;
            let known = KnownArm {
                tool: arm.tools.len() - 1,
                arm: &arm,
                set: &set,
                posterior: &posterior(belief, &plan),
            };
            add_static_compliance(&mut report, &known, &scenario.task.test_poses)?;
        }
        Ok(report)
    }
}

/// The uncertainty budget of a plan, where it is more than the instrument's noise.
pub fn budget(assessment: &Assessment) -> String {
    let common = assessment.common_sources.as_ref();
    uncertainty_budget::describe(
        assessment.uncertainty_budget.as_ref(),
        common.map(|common| (&*common.names, common.rho0_m * 1e3)),
    )
}

/// What no plan is better than by another criterion, for a person.
fn describe_criterion(assessment: &Assessment) -> String {
    let Some((criterion, bound)) = &assessment.criterion_bound else {
        return String::new();
    };
    let name = criterion.name();
    let bound = match bound {
        Ok(bound) => bound,
        Err(reason) => return format!("{name}: no bound and no efficiency: {reason}\n"),
    };
    let beyond = if criterion.is_maximised() {
        "above"
    } else {
        "below"
    };
    let value = assessment.value(*criterion);
    let mut text = format!(
        "{name} = {}; no plan of as many can be {beyond} {:.6e}",
        or_dash(value, |value| format!("{value:.6e}")),
        bound.best
    );
    if let Some(efficiency) = assessment.criterion_efficiency() {
        text += &format!(" (efficiency {efficiency:.4})");
    }
    text.push('\n');
    if let Some(proof) = &bound.proof {
        text += &format!(
            "proved: no plan of as many is {beyond} {:.6e}{}\n",
            proof.best,
            leaving_out(&proof.left_out)
        );
    }
    text
}

/// An assessment for a person.
pub fn describe(scenario: &Scenario, assessment: &Assessment) -> String {
    let mut text = format!(
        "{}: rho0 = {} um at the test pose{}",
        counted(assessment.experiments.into(), "experiment"),
        number(assessment.rho0_m.map(|value| value * 1e6), 3),
        scenario.task.counted_words()
    );
    if let (Some(bound), Some(efficiency)) = (assessment.bound_m(), assessment.efficiency()) {
        text += &format!(
            "; no plan of as many can be below {:.3} um (efficiency {efficiency:.4})",
            bound * 1e6
        );
    }
    text.push('\n');
    if let Some(proof) = assessment.bound().and_then(|bound| bound.proof.as_ref()) {
        text += &format!(
            "proved: no plan of as many is below {:.3} um{}\n",
            proof.best * 1e6,
            leaving_out(&proof.left_out)
        );
    }
    if let Some(reason) = assessment.no_bound() {
        text += &format!("no bound and no efficiency: {reason}\n");
    }
    if let Some(quantile_m) = assessment.quantile95_m {
        text += &format!("95 % stay below {:.3} um\n", quantile_m * 1e6);
    }
    text += "A relative accuracy: of the deflection by the load, whatever the pose without it.\n";
    text += &budget(assessment);
    text += &describe_criterion(assessment);
    text.push('\n');
    let rows = scenario
        .task
        .belief
        .parameter_names()
        .into_iter()
        .zip(&assessment.standard_errors)
        .map(|(name, error)| vec![name, number(error.map(|error| error * 1e9), 2)]);
    text += &table("joint | standard error [1e-9 rad/(N m)]", rows);
    text.push('\n');
    text += &further(assessment);
    let rows = assessment.criteria.iter().map(|(criterion, value)| {
        let value = or_dash(*value, |value| format!("{value:.6e}"));
        let better = if criterion.is_maximised() {
            "larger"
        } else {
            "smaller"
        };
        vec![criterion.name().to_owned(), value, better.to_owned()]
    });
    text += &table("criterion | value | better", rows);
    for violation in &assessment.violations {
        text += &format!("\nviolation: {violation}");
    }
    if !assessment.violations.is_empty() {
        text.push('\n');
    }
    text
}

/// What is to be found besides compliances.
fn further(assessment: &Assessment) -> String {
    if assessment.further.is_empty() {
        return String::new();
    }
    let row = |each: &FurtherError| {
        let error = each.standard_error;
        let error = error.map_or_else(
            || "not determined".to_owned(),
            |error| format!("{error:.3e}"),
        );
        vec![each.name.clone(), error, each.unit.to_owned()]
    };
    let rows = assessment.further.iter().map(row);
    table("also to be found | standard error | unit", rows) + "\n"
}
