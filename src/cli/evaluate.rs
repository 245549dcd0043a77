//! `evaluate`: the predicted accuracy of a plan.

use std::path::PathBuf;

use clap::Args;
use elastocal::compensation::KnownArm;
use elastocal::plan::search::{Bound, PlanBound};
use elastocal::plan::{Assessment, Criterion, FurtherError, posterior, read_plan};
use elastocal::record::candidates::CandidatesMessage;
use elastocal::record::json::{merge, results};
use elastocal::record::messages::AssessmentMessage;
use elastocal::scenario::Scenario;
use elastocal::task::AccuracyKind;
use elastocal::text::wording::counted;
use serde_json::json;

use super::conditions::conditions;
use super::interruption::{STOP, proceed};
use super::plan_args::PlanArgs;
use super::proof::leaving_out;
use super::static_compliance::add_static_compliance;
use super::table::{number, or_dash, table};
use super::written::Written;
use super::{Report, uncertainty_budget, without_effect};

/// Arguments of `evaluate`.
#[derive(Debug, Args)]
#[command(mut_args(without_effect(&["out"])))]
pub struct Evaluate {
    #[command(flatten)]
    pub args: PlanArgs,
    /// By which criterion no plan is better than the bound that is searched; of test-pose it is proved
    #[arg(long, value_enum, default_value_t)]
    criterion: Criterion,
    /// With design.accuracy = "absolute", sample so many virtual robots, read each by the plan, identify it, and compare
    /// residual errors with the predicted accuracy
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(2..=1_000_000))]
    trials: Option<u64>,
    /// Also the static compliance of the tool at the test poses (mm/N), with 95 % intervals after the plan.
    #[arg(long)]
    static_compliance: bool,
    /// The plan to assess.
    #[arg(long, value_name = "FILE")]
    plan: PathBuf,
}

impl Evaluate {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let scenario = self.args.load(Some(&self.plan), &[])?;
        let of_deflections = [("--criterion", self.criterion != Criterion::TestPose)];
        let instead = "`study` draws robots for plans of deflections";
        let of_readings = [("--trials", self.trials.is_some(), instead)];
        self.args
            .refuse_others(&scenario, &of_deflections, &of_readings)?;
        match scenario.task.design.accuracy {
            AccuracyKind::Absolute => (self.args).evaluate_readings(
                &scenario,
                &self.plan,
                self.trials,
                self.static_compliance,
            ),
            AccuracyKind::Relative => self.deflections(&scenario),
        }
    }

    /// The predicted accuracy of a plan of deflections.
    fn deflections(&self, scenario: &Scenario) -> anyhow::Result<Report> {
        let (args, task, seed) = (&self.args, &scenario.task, scenario.seed);
        let plan = read_plan(&self.plan, task.belief.commands())?;
        let candidates = args.read_candidates(task)?;
        args.common.say("searching the bound that no plan can beat");
        // Without a bound, the rest still holds.
        let bound = match &candidates {
            Some(candidates) => candidates.bound(task, self.criterion, &plan),
            None => args.proof.with_effort(&args.common, &STOP, |proof| {
                let sizes = [plan.measurements()];
                Bound::search_and_prove(task, self.criterion, seed, &sizes, proof)
            }),
        };
        proceed()?;
        let assessment = if self.criterion == Criterion::TestPose {
            Assessment::new(task, &plan, Some(&bound))
        } else {
            let rho0 = match &candidates {
                Some(candidates) => candidates.bound(task, Criterion::TestPose, &plan),
                None => Bound::search(task, seed),
            };
            Assessment::new(task, &plan, Some(&rho0)).beside(&bound, &plan)
        };
        let message = AssessmentMessage::new(scenario, &assessment);
        let provenance = args.provenance(scenario, Some(&self.plan))?;
        let mut json = results("evaluate", &provenance, json!({ "gate": scenario.gate }));
        merge(&mut json, serde_json::to_value(&message)?);
        let mut written = Written::default();
        let proved = match &candidates {
            Some(candidates) => {
                let message = CandidatesMessage::new(candidates);
                merge(&mut json, json!({ "candidates": message }));
                args.told(candidates)
            }
            None => args.proof.tell(&bound, &provenance, &mut written)?,
        };
        let budget = assessment.uncertainty_budget.as_ref();
        let text =
            describe(scenario, &assessment) + &proved + &args.budget.write(budget, &mut written);
        let mut conditions = conditions(scenario, &assessment);
        conditions.extend(written.conditions());
        let mut report = Report::new(json, text, conditions);
        if self.static_compliance {
            let (arm, set) = task.belief.parameters_of_arm()?;
            let known = KnownArm {
                tool: arm.tools.len() - 1,
                arm: &arm,
                set: &set,
                posterior: &posterior(&task.belief, &plan),
            };
            add_static_compliance(&mut report, &known, &task.test_poses)?;
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

/// What no plan is better than, in words that follow the plan's own value.
fn bounded(
    bound: &PlanBound,
    efficiency: Option<f64>,
    beyond: &str,
    shown: &dyn Fn(f64) -> String,
) -> String {
    let efficiency = efficiency.map_or_else(String::new, |each| format!(" (efficiency {each:.4})"));
    let mut text = format!(
        "; no plan of as many can be {beyond} {}{efficiency}\n",
        shown(bound.best)
    );
    if let Some(proof) = &bound.proof {
        text += &format!(
            "proved: no plan of as many is {beyond} {}{}\n",
            shown(proof.best),
            leaving_out(&proof.left_out)
        );
    }
    text
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
    let shown = |value: f64| format!("{value:.6e}");
    let beyond = if criterion.is_maximised() {
        "above"
    } else {
        "below"
    };
    let value = or_dash(assessment.value(*criterion), shown);
    let efficiency = assessment.criterion_efficiency();
    format!("{name} = {value}") + &bounded(bound, efficiency, beyond, &shown)
}

/// An assessment for a person.
pub fn describe(scenario: &Scenario, assessment: &Assessment) -> String {
    let mut text = format!(
        "{}: rho0 = {} um at the test pose{}",
        counted(assessment.experiments.into(), "experiment"),
        number(assessment.rho0_m.map(|value| value * 1e6), 3),
        scenario.task.counted_words()
    );
    let shown = |value_m: f64| format!("{:.3} um", value_m * 1e6);
    text += &match assessment.bound() {
        Some(bound) => bounded(bound, assessment.efficiency(), "below", &shown),
        None => "\n".to_owned(),
    };
    if let Some(reason) = assessment.no_bound() {
        text += &format!("no bound and no efficiency: {reason}\n");
    }
    if let Some(quantile_m) = assessment.quantile95_m {
        text += &format!("95 % stay below {}\n", shown(quantile_m));
    }
    text += "A relative accuracy: of the deflection by the load, whatever the pose without it.\n";
    text += &budget(assessment);
    text += &describe_criterion(assessment);
    let names = scenario.task.belief.parameter_names().into_iter();
    let rows = (names.zip(&assessment.standard_errors))
        .map(|(name, error)| vec![name, number(error.map(|error| error * 1e9), 2)]);
    text += &format!(
        "\n{}\n",
        table("joint | standard error [1e-9 rad/(N m)]", rows)
    );
    text += &further(assessment);
    let rows = assessment.criteria.iter().map(|(criterion, value)| {
        let better = if criterion.is_maximised() {
            "larger"
        } else {
            "smaller"
        };
        let value = or_dash(*value, |value| format!("{value:.6e}"));
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
        let error = each.standard_error.map(|error| format!("{error:.3e}"));
        let error = error.unwrap_or_else(|| "not determined".to_owned());
        vec![each.name.clone(), error, each.unit.to_owned()]
    };
    let rows = assessment.further.iter().map(row);
    table("also to be found | standard error | unit", rows) + "\n"
}
