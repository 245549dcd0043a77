//! A plan with what is predicted of it: of deflections, or of absolute readings.

use crate::compensation::KnownArm;
use crate::identification::ParameterGroup;
use crate::parameter::ParameterKind;
use crate::plan::absolute::{AbsolutePlanning, DrawnWanted, PredictedAccuracy};
use crate::plan::search::{CandidatePlan, PlanBound};
use crate::plan::{
    Assessment, FurtherError, Plan, UncertaintyBudget, less_than_nominal, posterior,
};
use crate::record::absolute_plan::AbsolutePlanMessage;
use crate::record::messages::{assessment_json, merge};
use crate::record::robot_trials::RobotTrials;
use crate::study::verdict::Kept;
use crate::study::{Conditions, Setting, StudyError, TakenPlan};
use crate::task::Task;
use crate::understanding::implausible;
use crate::view::report::{ABSOLUTE_ACCURACY, PlanPage, absolute_page};
use crate::view::stills::Stills;
use crate::workflow::study::try_plan;

use super::command_prelude::*;
use super::interruption::{Interrupted, STOP, searched};
use super::plan_args::PlanArgs;
use super::progress::bar;
use super::proof::leaving_out;
use super::static_compliance::add_static_compliance;
use super::uncertainty_budget;
use super::views::command_line;

/// What a relative accuracy is.
pub const RELATIVE: &str =
    "A relative accuracy: of the deflection by the load, whatever the pose without it.\n";

/// A plan with what is predicted of it.
pub struct PlannedAccuracy<'a> {
    /// The plan.
    pub plan: TakenPlan<'a>,
    /// The prediction as keys and for a person.
    json: Value,
    text: String,
    /// What must be looked at.
    pub conditions: Vec<Condition>,
    /// The uncertainty budget.
    pub budget: Option<UncertaintyBudget>,
    /// The record of a plan of absolute readings.
    pub record: Option<AbsolutePlanMessage>,
}

impl<'a> PlannedAccuracy<'a> {
    /// What is predicted of a plan of deflections.
    pub fn of_deflections(scenario: &Scenario, plan: Plan, assessment: &Assessment) -> Self {
        let noted = noted(assessment.less_than_nominal.as_slice());
        Self {
            plan: TakenPlan::Deflections(plan),
            json: assessment_json(scenario, assessment),
            text: describe(scenario, assessment) + &noted,
            conditions: conditions(scenario, assessment),
            budget: assessment.uncertainty_budget.clone(),
            record: None,
        }
    }

    /// What is predicted of a plan of absolute readings, of candidates that may be drawn.
    pub fn of_readings(
        task: &Task,
        groups: &'a [ParameterGroup],
        planning: AbsolutePlanning<'a>,
        plan: CandidatePlan,
        (bound, drawn): (Option<&PlanBound>, Option<DrawnWanted>),
    ) -> Self {
        let prediction = planning.prediction(&plan);
        let mut record = AbsolutePlanMessage::new(task, &planning, &plan, &prediction, bound);
        record.drawn = drawn;
        let set = planning.set();
        let less = less_than_nominal(set, &set.prior().precision, &prediction.posterior);
        Self {
            json: json!(record),
            text: describe_readings(&record) + &noted(less.as_slice()),
            conditions: conditions_of_readings(&planning, &plan, &prediction, &record),
            budget: record.uncertainty_budget.clone(),
            record: Some(record),
            plan: TakenPlan::of_readings(plan, planning, groups),
        }
    }

    /// Adds the static compliance at the test poses, as it is known after the plan.
    pub fn add_static_compliance(&self, report: &mut Report, task: &Task) -> anyhow::Result<()> {
        let belief = &task.belief.uncertain;
        let posterior = match &self.plan {
            TakenPlan::Deflections(plan) => posterior(&task.belief, plan),
            TakenPlan::Readings(taken) => taken.planning.prediction(&taken.plan).posterior,
        };
        let known = match &self.plan {
            TakenPlan::Deflections(_) => KnownArm {
                tool: belief.arm().tools.len() - 1,
                arm: belief.arm(),
                set: belief.set(),
                posterior: &posterior,
            },
            TakenPlan::Readings(taken) => taken.planning.known_arm(&posterior),
        };
        Ok(add_static_compliance(report, &known, &task.test_poses)?)
    }
}

impl PlanArgs {
    /// What is predicted of a plan that a command designed, or read from a file, and what it says besides.
    pub fn report(
        &self,
        command: &str,
        scenario: &Scenario,
        planned: &PlannedAccuracy<'_>,
        mut report: Report,
    ) -> anyhow::Result<Report> {
        report.json["gate"] = json!(scenario.gate);
        merge(&mut report.json, planned.json.clone());
        report.text.insert_str(0, &planned.text);
        self.budget.write(planned.budget.as_ref(), &mut report);
        report.conditions.splice(0..0, planned.conditions.clone());
        Ok((self.common).report(command, scenario, report)?)
    }

    /// Writes the page of a plan that is in a file, where it is wanted.
    pub fn finish(
        &self,
        scenario: &Scenario,
        (planned, trials): (&PlannedAccuracy<'_>, Option<&RobotTrials>),
        plan: Option<&Path>,
        mut report: Report,
    ) -> anyhow::Result<Report> {
        if let (Some(path), Some(record)) = (&self.report_out, &planned.record) {
            let page = PlanPage {
                scenario,
                stills: &Stills::of_taken(scenario, &planned.plan).figures(),
                conditions: &report.conditions,
                provenance: &self.common.provenance(scenario)?,
                command: &command_line(),
                plan: plan.unwrap_or("plan.csv".as_ref()),
                parameters: &self.readings.parameters,
            };
            let page = absolute_page(&page, record, trials, None)?;
            report.save(path, &page);
        }
        Ok(report)
    }

    /// Tries a plan on so many virtual robots, and adds what is seen of them.
    pub fn add_trials(
        &self,
        report: &mut Report,
        scenario: &Scenario,
        planned: &PlannedAccuracy<'_>,
        robots: u64,
    ) -> anyhow::Result<RobotTrials> {
        let (plan, measurements) = (planned.plan.clone(), planned.plan.measurements());
        let conditions = Conditions::plain(&scenario.task, measurements);
        let setting = Setting::new(&scenario.task, &scenario.truth, conditions);
        let bar = bar(self.common.quiet, "robots");
        bar.set_length(robots);
        let progress = |done| bar.inc(done);
        let trials = try_plan(&setting, scenario.seed, plan, robots, &STOP, &progress);
        bar.finish_and_clear();
        searched();
        let trials = match trials {
            Err(StudyError::Stopped) => return Err(Interrupted.into()),
            trials => trials?,
        };
        report.text += &format!("\n{}\n", trials.outcome());
        report.conditions.extend(unkept(&trials));
        Ok(trials)
    }
}

/// What must be looked at of a plan of absolute readings.
fn conditions_of_readings(
    planning: &AbsolutePlanning<'_>,
    plan: &[(usize, u32)],
    prediction: &PredictedAccuracy,
    record: &AbsolutePlanMessage,
) -> Vec<Condition> {
    let left = prediction.left.as_ref().err().map(|names| {
        let place = "the tool's place at the test poses, which depends on";
        format!("{place} {}", names.join(", "))
    });
    let unknowns = planning.set().parameters().iter().enumerate();
    // The compliances that it was to determine.
    let missing = unknowns.filter(|(index, each)| {
        matches!(each.kind, ParameterKind::JointCompliance { .. })
            && !planning.is_elsewhere(*index, plan)
            && prediction.posterior.standard_error(*index).is_none()
    });
    let missing: Vec<String> = missing.map(|(index, _)| planning.words(index)).collect();
    let unplaced = planning.unplaced_stations(plan).into_iter();
    let below_bound = below_bound(record.efficiency, missing.is_empty());
    (left.into_iter().chain(unplaced))
        .map(|words| undetermined_by_plan(&words))
        .chain(below_bound)
        .chain(missing.iter().map(|words| undetermined_by_plan(words)))
        .collect()
}

/// What is predicted of a plan of absolute readings, for a person.
fn describe_readings(message: &AbsolutePlanMessage) -> String {
    let frame = message.frame.as_ref().map_or_else(
        || "the instrument's frame".to_owned(),
        |station| format!("the frame of station {station:?}"),
    );
    let mut text = format!(
        "{}: rho0 = {} mm in {frame}",
        counted(message.experiments.into(), "absolute reading"),
        number(message.rho0_mm, 5)
    );
    if let (Some(bound), Some(efficiency)) = (message.lower_bound_rho0_mm, message.efficiency) {
        let basis = match message.drawn {
            Some(_) => "which were sampled: evidence, no proof",
            None => "proved by looking at all",
        };
        text += &format!(
            "; no plan of as many candidates is below {bound:.5} mm (efficiency {efficiency:.4}), {basis}"
        );
    }
    text.push('\n');
    if let Some(quantile) = message.quantile95_mm {
        text += &format!("95 % stay below {quantile:.5} mm\n");
    }
    text += &format!("{ABSOLUTE_ACCURACY}\n");
    if message.task_force_mm > 0.0 {
        text += &format!(
            "Of it, {:.5} mm are what the task's force is uncertain by, whatever is read\n",
            message.task_force_mm
        );
    }
    text += &uncertainty_budget::describe(message.uncertainty_budget.as_ref());
    text += &left_out(message);
    if message.test_poses.len() > 1 {
        let rows = (message.test_poses.iter())
            .map(|pose| vec![pose.name.clone(), number(pose.rho0_mm, 5)]);
        text += &format!("\n{}", table("test pose | rho0 [mm]", rows));
    }
    let rows = (message.unknowns.iter()).map(|each| {
        let error = each.standard_error;
        let error = or_dash(error, |error| format!("{error:.3e}"));
        vec![each.name.clone(), error, each.unit.clone()]
    });
    text += &format!("\n{}\n", table("unknown | standard error | unit", rows));
    text
}

/// What a prediction leaves out, a line of each.
pub fn left_out(message: &AbsolutePlanMessage) -> String {
    let exact = message.assumed_exact.iter();
    let exact = exact.map(|each| format!("Assumed exact: {each}\n"));
    let not_counted = message.not_counted.iter();
    let not_counted = not_counted.map(|each| format!("Not counted: {each}\n"));
    exact.chain(not_counted).collect()
}

/// What must be looked at of simulated robots.
fn unkept(trials: &RobotTrials) -> Vec<Condition> {
    let runs = &trials.runs;
    let mut conditions = Vec::new();
    if runs.failed > 0 {
        let first = trials.first_failure.as_deref().unwrap_or_default();
        conditions.push(ConditionCode::FailedRuns.with(format!(
            "{} of {} gave no result; the first: {first}",
            runs.failed,
            counted(runs.runs + runs.failed, "simulated robot")
        )));
    }
    if trials.prediction == Kept::Exceeded {
        let micro = |value_mm: Option<f64>| in_um(value_mm.map(|value_mm| value_mm * 1e-3), 2);
        conditions.push(ConditionCode::PredictionExceeded.with(format!(
            "residual error of simulated robots {} +- {} um rms, predicted {} um",
            micro(runs.rms_mm),
            micro(runs.rms_std_mm),
            micro(runs.combined_rms_mm)
        )));
    }
    conditions
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
fn describe(scenario: &Scenario, assessment: &Assessment) -> String {
    let mut text = format!(
        "{}: rho0 = {} um at the test pose{}",
        counted(assessment.experiments.into(), "experiment"),
        in_um(assessment.rho0_m, 3),
        scenario.task.counted_words()
    );
    let shown = |value_m: f64| format!("{} um", in_um(Some(value_m), 3));
    text += &match assessment.bound() {
        Some(bound) => bounded(bound, assessment.efficiency(), "below", &shown),
        None => "\n".to_owned(),
    };
    if let Some(reason) = assessment.no_bound() {
        text += &format!("no bound and no efficiency: {reason}\n");
    } else if scenario.task.has_one_load_each() {
        text += "The bound is of plans that hang one load in each configuration.\n";
    }
    if let Some(quantile_m) = assessment.quantile95_m {
        text += &format!("95 % stay below {}\n", shown(quantile_m));
    }
    text += RELATIVE;
    text += &uncertainty_budget::describe(assessment.uncertainty_budget.as_ref());
    text += &describe_criterion(assessment);
    let names = scenario.task.belief.parameter_names().into_iter();
    let rows = (names.zip(&assessment.standard_errors))
        .map(|(name, error)| vec![name, number(error.map(|error| error * 1e9), 2)]);
    let unit = scenario.task.belief.compliance_unit("1e-9");
    let header = format!("joint | standard error [{unit}]");
    text += &format!("\n{}\n", table(&header, rows));
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

/// Efficiencies are rounded by less.
const BEYOND_ROUNDING: f64 = 1e-6;

/// What must be looked at of a plan.
fn conditions(scenario: &Scenario, assessment: &Assessment) -> Vec<Condition> {
    let undetermined = assessment.undetermined(&scenario.task.belief);
    let mut conditions: Vec<Condition> = (undetermined.iter())
        .map(|words| undetermined_by_plan(words))
        .collect();
    // The bound is of plans without violations.
    let violated = assessment.violated();
    let below = || below_bound(assessment.criterion_efficiency(), undetermined.is_empty());
    conditions.extend(violated.or_else(below));
    conditions.extend(assessment.conditions.iter().cloned());
    conditions.extend(implausible(scenario));
    conditions
}

/// That a plan does not determine something, in words.
pub fn undetermined_by_plan(words: &str) -> Condition {
    ConditionCode::PlanUnidentifiable.with(format!("the plan does not determine {words}"))
}

/// That a plan of an efficiency is better than the bound beside it, by more than rounding.
fn below_bound(efficiency: Option<f64>, determines_all: bool) -> Option<Condition> {
    let beyond = efficiency? - 1.0;
    (beyond > BEYOND_ROUNDING).then(|| {
        let why = if determines_all {
            ""
        } else {
            ", which counts what the plan does not determine"
        };
        ConditionCode::BelowBound.with(format!(
            "the plan is better than the bound beside it{why}, by {:.2e} %",
            1e2 * beyond
        ))
    })
}

/// That a search was stopped.
pub fn search_stopped() -> Condition {
    ConditionCode::SearchStopped.with("the search was stopped: a better plan may exist")
}
