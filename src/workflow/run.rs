//! A designed plan and those to compare it with are measured, identified from and compensated with.

use std::sync::atomic::AtomicBool;

use serde_json::{Value, json};

use super::design::Designed;
use super::evidence::gather;
use crate::calibration::{Calibration, CalibrationError, calibrate, pose_conditions};
use crate::codes::Condition;
use crate::experiment::{Plan, read_plan};
use crate::files::FileError;
use crate::plan::Assessment;
use crate::plan::search::{
    ApproximateDesign, Bound, RepeatsNeeded, SearchError, Watch, median_random_plan, random_plan,
    repeats_needed,
};
use crate::record::evidence::EvidenceMessage;
use crate::record::json::{merge, results};
use crate::record::messages::{CalibrationMessage, ProvenanceMessage, assessment_json};
use crate::scenario::Scenario;
use crate::understanding::implausible;

/// So many random plans stand for what a laboratory without a plan would do.
pub const RANDOM_PLANS: u64 = 99;

/// The number of the run, as studies count them.
pub const RUN: u64 = 0;

/// A plan that took part.
#[derive(Debug)]
pub struct TriedPlan {
    /// What it predicted.
    pub assessment: Assessment,
    /// Its name, and what came of it,
    pub calibration: (String, Calibration),
    /// as a record.
    pub record: CalibrationMessage,
    /// Whether it was drawn at random.
    pub is_random: bool,
}

/// A plan that was to be compared and could not be measured, identified or compensated.
#[derive(Debug)]
pub struct FailedPlan {
    /// Its name.
    pub name: String,
    /// What it predicted, where there is a plan.
    pub assessment: Option<Assessment>,
    /// Why it failed.
    pub problem: String,
}

/// What somebody who waits hears of.
#[derive(Debug)]
pub enum RunStage<'a> {
    /// The plans are tried on the virtual robot.
    Calibrating,
    /// A plan cannot be compared.
    Failed(&'a FailedPlan),
    /// The designed plan is set beside random plans, other criteria and other numbers of measurements.
    Comparing,
    /// There are no random plans to compare with.
    NoRandomPlans(String),
}

/// What a run comes to.
#[derive(Debug)]
pub struct RunOutcome {
    /// The plans that took part, the designed one first.
    pub tried: Vec<TriedPlan>,
    /// Those that could not.
    pub failed: Vec<FailedPlan>,
    /// The median of what random plans prediction (m), if there is one.
    pub random_rho0_m: Option<f64>,
    /// How often the plan of that median is to be repeated for the accuracy of the designed one.
    pub random_repeats: Option<RepeatsNeeded>,
    /// What the designed plan is shown beside.
    pub evidence: EvidenceMessage,
    /// What must be looked at.
    pub conditions: Vec<Condition>,
}

/// Tries a designed plan, those of the scenario with as many measurements, and a random one.
///
/// # Errors
/// The designed plan fails, a plan file cannot be read, or there is nothing to compare with.
pub fn run(
    scenario: &Scenario,
    (designed, approximate): (&Designed, &ApproximateDesign),
    stop: &AtomicBool,
    stage: &dyn Fn(&RunStage<'_>),
) -> anyhow::Result<RunOutcome> {
    let (task, bound) = (&scenario.task, &designed.bound);
    let plans = plans_to_compare(scenario, designed.exact.plan.clone())?;
    stage(&RunStage::Calibrating);
    let outside = |(name, plan): &(String, Plan)| task.loads.outside_plan(plan, Some(name));
    let loads_outside: Vec<Condition> = plans.iter().filter_map(outside).collect();
    let experiments = designed.exact.plan.measurements();
    let random = random_plan(task, experiments, scenario.seed, 0);
    let (tried, failed) = calibrate_all(scenario, plans, random, bound)?;
    for each in &failed {
        stage(&RunStage::Failed(each));
    }
    stage(&RunStage::Comparing);
    let random = median_random_plan(task, experiments, RANDOM_PLANS, scenario.seed)
        .map_err(|problem| stage(&RunStage::NoRandomPlans(problem.to_string())))
        .ok()
        .filter(|(median, _)| median.is_finite());
    let random_repeats = (random.as_ref())
        .zip(tried[0].assessment.rho0_m)
        .and_then(|((_, plan), rho0_m)| repeats_needed(task, plan, rho0_m));
    // The study draws random plans of its own.
    let fixed: Vec<(String, Plan)> = (tried.iter().filter(|each| !each.is_random))
        .map(|each| {
            let (name, made) = &each.calibration;
            (name.clone(), made.plan.clone())
        })
        .collect();
    let beside = (approximate, bound);
    let evidence = gather(scenario, beside, &fixed, Watch::quiet(stop))?;
    let main = &tried[0].calibration.1;
    let mut conditions = main.identification.conditions();
    conditions.extend(pose_conditions(&task.belief, &main.poses));
    conditions.extend(loads_outside);
    conditions.extend(tried[0].assessment.conditions.iter().cloned());
    conditions.extend(implausible(scenario));
    Ok(RunOutcome {
        evidence,
        tried,
        failed,
        random_rho0_m: random.map(|(median, _)| median),
        random_repeats,
        conditions,
    })
}

/// The designed plan and those of the scenario with as many measurements.
fn plans_to_compare(scenario: &Scenario, optimal: Plan) -> Result<Vec<(String, Plan)>, FileError> {
    let experiments = optimal.measurements();
    let mut plans = vec![("optimal".to_owned(), optimal)];
    for file in &scenario.plans {
        let plan = read_plan(&file.path, scenario.task.belief.commands())?;
        if plan.measurements() == experiments {
            plans.push((file.name.clone(), plan));
        }
    }
    Ok(plans)
}

/// Calibrates with every plan. The first must succeed; another that fails is compared no further.
fn calibrate_all(
    scenario: &Scenario,
    plans: Vec<(String, Plan)>,
    random: Result<Plan, SearchError>,
    bound: &Bound,
) -> Result<(Vec<TriedPlan>, Vec<FailedPlan>), CalibrationError> {
    let (mut tried, mut failed) = (Vec::new(), Vec::new());
    let random = (
        "random".to_owned(),
        random.map_err(|error| error.to_string()),
    );
    let (known, commands) = (plans.len(), scenario.task.belief.commands());
    let plans = plans.into_iter().map(|(name, plan)| (name, Ok(plan)));
    for (index, (name, plan)) in plans.chain([random]).enumerate() {
        let assessment = |plan: &Plan| Assessment::new(&scenario.task, plan, Some(bound));
        // Every plan is measured with the same noise.
        match plan
            .as_ref()
            .map(|plan| calibrate(&scenario.task, &scenario.truth, plan, scenario.seed, RUN))
        {
            Ok(Ok(calibration)) => tried.push(TriedPlan {
                assessment: assessment(&calibration.plan),
                record: CalibrationMessage::new(&commands, &name, &calibration),
                calibration: (name, calibration),
                is_random: index == known,
            }),
            Ok(Err(error)) if tried.is_empty() => return Err(error),
            Ok(Err(error)) => failed.push(FailedPlan {
                name,
                assessment: plan.as_ref().ok().map(assessment),
                problem: error.to_string(),
            }),
            Err(problem) => failed.push(FailedPlan {
                name,
                assessment: None,
                problem: problem.clone(),
            }),
        }
    }
    Ok((tried, failed))
}

impl RunOutcome {
    /// results.json: the designed plan's keys by stage, then every plan, then what it is shown beside.
    pub fn json(&self, scenario: &Scenario, elapsed_s: f64) -> serde_json::Result<Value> {
        let TriedPlan {
            record: main,
            assessment,
            ..
        } = &self.tried[0];
        let json = json!({
            "gate": scenario.gate,
            "plan": main.plan,
            "elapsed_s": elapsed_s,
            "measurements": main.measurements,
            "truth": main.truth,
            "residuals": main.residuals,
        });
        let mut json = results("run", &ProvenanceMessage::new(scenario), json);
        // The order matters where keys coincide: rho0_mm is the predicted accuracy of the plan, and the standard
        // errors are those of the identification.
        merge(&mut json, serde_json::to_value(&main.test_poses[0])?);
        merge(&mut json, assessment_json(scenario, assessment));
        merge(&mut json, serde_json::to_value(&main.identification)?);
        let mut all = Vec::new();
        for each in &self.tried {
            let mut plan = serde_json::to_value(&each.record)?;
            let assessment = assessment_json(scenario, &each.assessment);
            merge(&mut plan, json!({ "assessment": assessment }));
            all.push(plan);
        }
        for each in &self.failed {
            let Some(assessment) = &each.assessment else {
                continue;
            };
            let assessment = assessment_json(scenario, assessment);
            let (name, problem) = (&each.name, &each.problem);
            all.push(
                json!({ "name": name, "assessment": assessment, "test_poses": [], "problem": problem }),
            );
        }
        let random_mm = self.random_rho0_m.map(|value| value * 1e3);
        let (times, limit_mm) = match self.random_repeats {
            Some(RepeatsNeeded::Times(times)) => (Some(times), None),
            Some(RepeatsNeeded::Never(limit_m)) => (None, Some(limit_m * 1e3)),
            None => (None, None),
        };
        let keys = json!({ "plans": all, "random_plans": RANDOM_PLANS, "random_median_rho0_mm": random_mm,
            "random_median_repeats": times, "random_median_limit_rho0_mm": limit_mm });
        merge(&mut json, keys);
        merge(&mut json, serde_json::to_value(&self.evidence)?);
        Ok(json)
    }
}
