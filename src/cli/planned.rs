//! A plan with what is predicted of it: of deflections, or of absolute readings.

use std::sync::Arc;

use crate::compensation::KnownArm;
use crate::experiment::write_candidates;
use crate::identification::ParameterGroup;
use crate::parameter::ParameterKind;
use crate::plan::absolute::{AbsolutePlanning, DrawnWanted, PredictedAccuracy};
use crate::plan::search::PlanBound;
use crate::plan::{
    Assessment, FurtherError, Plan, UncertaintyBudget, less_than_nominal, posterior, write_plan,
};
use crate::record::absolute_plan::AbsolutePlanMessage;
use crate::record::messages::{assessment_json, merge};
use crate::record::robot_trials::RobotTrials;
use crate::study::verdict::Kept;
use crate::study::{Conditions, EntryKind, Setting, StudiedReadings, StudyError};
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
pub enum PlannedAccuracy<'a> {
    /// Of deflections.
    Deflections(Plan, Box<Assessment>),
    /// Of absolute readings.
    Readings(
        Arc<StudiedReadings<'a>>,
        Box<PredictedAccuracy>,
        Box<AbsolutePlanMessage>,
    ),
}

impl<'a> PlannedAccuracy<'a> {
    /// What is predicted of a plan of absolute readings, of candidates that may be drawn.
    pub fn of_readings(
        task: &Task,
        groups: &'a [ParameterGroup],
        planning: AbsolutePlanning<'a>,
        plan: Vec<(usize, u32)>,
        (bound, drawn): (Option<&PlanBound>, Option<DrawnWanted>),
    ) -> Self {
        let prediction = planning.prediction(&plan);
        let mut record = AbsolutePlanMessage::new(task, &planning, &plan, &prediction, bound);
        record.drawn = drawn;
        let studied = StudiedReadings {
            planning,
            plan,
            groups,
            is_random: false,
        };
        Self::Readings(Arc::new(studied), Box::new(prediction), Box::new(record))
    }

    fn json(&self, scenario: &Scenario) -> serde_json::Result<Value> {
        match self {
            Self::Deflections(_, assessment) => Ok(assessment_json(scenario, assessment)),
            Self::Readings(_, _, record) => serde_json::to_value(record),
        }
    }

    fn describe(&self, scenario: &Scenario) -> String {
        match self {
            Self::Deflections(_, assessment) => {
                describe(scenario, assessment) + &noted(assessment.less_than_nominal.as_slice())
            }
            Self::Readings(studied, prediction, record) => {
                let set = studied.planning.set();
                let less = less_than_nominal(set, &set.prior().precision, &prediction.posterior);
                describe_readings(record) + &noted(less.as_slice())
            }
        }
    }

    /// What must be looked at.
    pub fn conditions(&self, scenario: &Scenario) -> Vec<Condition> {
        let (studied, prediction, record) = match self {
            Self::Deflections(_, assessment) => return conditions(scenario, assessment),
            Self::Readings(studied, prediction, record) => (studied, prediction, record),
        };
        let left = prediction.left.as_ref().err().map(|names| {
            let place = "the tool's place at the test poses, which depends on";
            undetermined_by_plan(&format!("{place} {}", names.join(", ")))
        });
        let compliances = undetermined_compliances(studied, prediction);
        let unplaced = studied.planning.unplaced_stations(&studied.plan);
        let unplaced = unplaced.iter().map(|words| undetermined_by_plan(words));
        (left.into_iter())
            .chain(unplaced)
            .chain(below_bound(record.efficiency, compliances.is_empty()))
            .chain(compliances)
            .collect()
    }

    /// Its uncertainty budget.
    pub fn budget(&self) -> Option<&UncertaintyBudget> {
        match self {
            Self::Deflections(_, assessment) => assessment.uncertainty_budget.as_ref(),
            Self::Readings(_, _, record) => record.uncertainty_budget.as_ref(),
        }
    }

    /// The robot in each configuration.
    pub fn stills<'b>(&'b self, scenario: &'b Scenario) -> Stills<'b> {
        match self {
            Self::Deflections(plan, _) => Stills::of_plan(scenario, plan),
            Self::Readings(studied, ..) => {
                Stills::of_readings(scenario, &studied.planning.readings(&studied.plan))
            }
        }
    }

    /// Writes the plan.
    pub fn write(&self, task: &Task, path: &Path) -> Result<(), FileError> {
        match self {
            Self::Deflections(plan, _) => write_plan(path, task.belief.commands(), plan),
            Self::Readings(studied, ..) => {
                let rows = studied.planning.rows(&studied.plan);
                write_candidates(path, task.belief.commands(), &rows)
            }
        }
    }

    /// Adds the static compliance at the test poses, as it is known after the plan.
    pub fn add_static_compliance(&self, report: &mut Report, task: &Task) -> anyhow::Result<()> {
        match self {
            Self::Deflections(plan, _) => {
                let (arm, set) = (task.belief.uncertain.arm(), task.belief.uncertain.set());
                let known = KnownArm {
                    tool: arm.tools.len() - 1,
                    arm,
                    set,
                    posterior: &posterior(&task.belief, plan),
                };
                add_static_compliance(report, &known, &task.test_poses)?;
            }
            Self::Readings(studied, prediction, _) => {
                let known = studied.planning.known_arm(&prediction.posterior);
                add_static_compliance(report, &known, &task.test_poses)?;
            }
        }
        Ok(())
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
        merge(&mut report.json, planned.json(scenario)?);
        report.text.insert_str(0, &planned.describe(scenario));
        self.budget.write(planned.budget(), &mut report);
        report.conditions.splice(0..0, planned.conditions(scenario));
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
        if let (Some(path), PlannedAccuracy::Readings(_, _, record)) = (&self.report_out, planned) {
            let page = PlanPage {
                scenario,
                stills: &planned.stills(scenario).figures(),
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
        let (kind, measurements) = match planned {
            PlannedAccuracy::Deflections(plan, _) => {
                (EntryKind::Fixed(plan.clone()), plan.measurements())
            }
            PlannedAccuracy::Readings(studied, prediction, _) => {
                (EntryKind::Readings(studied.clone()), prediction.readings)
            }
        };
        let conditions = Conditions::plain(&scenario.task, measurements);
        let setting = Setting::new(&scenario.task, &scenario.truth, conditions);
        let bar = bar(self.common.quiet, "robots");
        bar.set_length(robots);
        let progress = |done| bar.inc(done);
        let trials = try_plan(&setting, scenario.seed, kind, robots, &STOP, &progress);
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

/// The compliances that a plan was to determine and does not, by name.
fn undetermined_compliances(
    studied: &StudiedReadings<'_>,
    prediction: &PredictedAccuracy,
) -> Vec<Condition> {
    let (planning, plan) = (&studied.planning, &studied.plan);
    let unknowns = planning.set().parameters().iter().enumerate();
    let missing = unknowns.filter(|(index, each)| {
        matches!(each.kind, ParameterKind::JointCompliance { .. })
            && !planning.is_elsewhere(*index, plan)
            && prediction.posterior.standard_error(*index).is_none()
    });
    missing
        .map(|(index, _)| undetermined_by_plan(&planning.words(index)))
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
pub fn conditions(scenario: &Scenario, assessment: &Assessment) -> Vec<Condition> {
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
