//! The whole loop: a designed plan, of deflections with those to compare it with or of absolute readings, is measured on the virtual
//! robot, identified from and compensated with.

use std::fmt::Display;
use std::sync::atomic::AtomicBool;

use nalgebra::Vector3;
use serde_json::{Value, json};

use super::design::Designed;
use super::evidence::{EvidenceMessage, gather};
use super::identify::{IdentifiedRobot, basis, identify_absolute};
use crate::calibration::{
    Calibration, CalibrationError, CompensatedPose, SeenPose, calibrate, pose_conditions, rms_m,
};
use crate::codes::{Condition, ErrorCode};
use crate::compensation::compensate_arm;
use crate::experiment::{Plan, read_plan};
use crate::files::FileError;
use crate::identification::{
    AbsoluteCase, AbsoluteFit, AbsoluteMessage, FitChoices, IdentificationError, ParameterGroup,
    ReadingWeights,
};
use crate::measurement::{AbsoluteReading, SimulatedRun};
use crate::numeric::posterior::NotDetermined;
use crate::parameter::{Parameter, ParameterKind};
use crate::plan::Assessment;
use crate::plan::absolute::{AbsolutePlan, AbsolutePlanning, PredictedAccuracy, ReadingsWanted};
use crate::plan::search::{
    ApproximateDesign, Bound, CandidateError, PlanSize, RepeatsNeeded, SearchError, Watch,
    median_random_plan, random_plan, repeats_needed,
};
use crate::record::absolute_plan::{AbsolutePlanMessage, planned_readings};
use crate::record::messages::{
    PlanRowMessage, ProvenanceMessage, SchemaMessage, TestPoseMessage, assessment_json, results,
};
use crate::record::run::{MeasuredMessage, RunMessage};
use crate::robot::EquilibriumError;
use crate::scenario::Scenario;
use crate::study::absolute::ReadingRuns;
use crate::study::carried_out::CarriedOut;
use crate::study::{Conditions, Setting, TakenReadings};
use crate::task::{Task, TestPose};
use crate::testbed::{RunTruth, TrueRobots, TrueUnknown};
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
    /// What came of it,
    pub calibration: Calibration,
    /// as a record under the plan's name.
    pub record: RunMessage,
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
        .map(|each| (each.record.name.clone(), each.calibration.plan.clone()))
        .collect();
    let beside = (approximate, bound);
    let evidence = gather(scenario, beside, &fixed, Watch::quiet(stop))?;
    let mut conditions = tried[0].record.conditions.clone();
    conditions.extend(loads_outside);
    conditions.extend(tried[0].assessment.violated());
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
    let (task, known) = (&scenario.task, plans.len());
    let plans = plans.into_iter().map(|(name, plan)| (name, Ok(plan)));
    let plans = plans.chain([("random".to_owned(), random)]);
    for (index, (name, plan)) in plans.enumerate() {
        let mut fail = |name, assessment, problem| {
            failed.push(FailedPlan {
                name,
                assessment,
                problem,
            });
        };
        let plan = match plan {
            Ok(plan) => plan,
            Err(problem) => {
                fail(name, None, problem.to_string());
                continue;
            }
        };
        let assessment = Assessment::new(task, &plan, Some(bound));
        // Every plan is measured with the same noise.
        match calibrate(task, &scenario.truth, &plan, scenario.seed, RUN) {
            Ok(calibration) => tried.push(TriedPlan {
                assessment,
                record: RunMessage::of_deflections(
                    task,
                    &scenario.truth,
                    scenario.seed,
                    &name,
                    &calibration,
                )?,
                calibration,
                is_random: index == known,
            }),
            Err(error) if tried.is_empty() => return Err(error),
            Err(error) => fail(name, Some(assessment), error.to_string()),
        }
    }
    Ok((tried, failed))
}

impl RunOutcome {
    /// results.json: the designed plan's keys by stage, then every plan, then what it is shown beside.
    pub fn json(&self, scenario: &Scenario, elapsed_s: f64) -> serde_json::Result<Value> {
        let mut all = Vec::new();
        for each in &self.tried {
            let mut plan = serde_json::to_value(&each.record)?;
            plan["assessment"] = assessment_json(scenario, &each.assessment);
            all.push(plan);
        }
        let mut main = all[0].clone();
        let first = json!({
            "gate": scenario.gate,
            "simulated": SimulatedRun::first(scenario.seed, Some(RUN)),
            "plan": main["plan"].take(),
            "elapsed_s": elapsed_s,
            "measurements": main["measurements"].take(),
            "truth": main["truth"].take(),
            "residuals": main["residuals"].take(),
        });
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
        // The order matters where keys coincide: rho0_mm is the predicted accuracy of the plan, and the standard
        // errors are those of the identification.
        let all = [
            first,
            main["test_poses"][0].take(),
            main["assessment"].take(),
            main["identification"].take(),
            json!(basis(scenario, &self.tried[0].calibration.measurements)),
            keys,
            serde_json::to_value(&self.evidence)?,
        ];
        Ok(results("run", &ProvenanceMessage::new(scenario), all))
    }
}

/// What a run of absolute accuracy comes to.
#[derive(Debug)]
pub struct AbsoluteRun<'a> {
    /// How many searches for the plan there were, and how many ended within 0.1 %.
    pub searches: [usize; 2],
    /// The run of the plan: readings each by itself, the simulated truth, what was identified, and what that achieves.
    pub record: RunMessage,
    /// What was read.
    pub readings: Vec<AbsoluteReading>,
    /// What was identified.
    pub identified: IdentifiedRobot<'a>,
    /// What that achieves at each test pose; without compensation, the nominal robot in the frames that suit the readings best.
    pub poses: Vec<CompensatedPose>,
    /// The median of what random plans of the same candidates predict (m), if there is one.
    pub random_rho0_m: Option<f64>,
}

/// The designed plan, with what it was chosen from.
pub type DesignedReadings<'a> = (AbsolutePlanning<'a>, AbsolutePlan);

/// Designs a plan of as many readings as a scenario wants, reads the robot of run 0 of its studies by it, identifies that robot,
/// compensates, sees where the tool is, and compares with random plans.
///
/// # Errors
/// There is no such plan, the robot cannot be read, or the readings do not determine what the test poses need.
pub fn run_absolute<'a>(
    scenario: &'a Scenario,
    wanted: &ReadingsWanted<'_>,
    weights: ReadingWeights,
    watch: Watch<'_>,
    stage: &dyn Fn(&RunStage<'_>),
) -> Result<(DesignedReadings<'a>, AbsoluteRun<'a>), FileError> {
    let (task, seed, groups) = (&scenario.task, scenario.seed, wanted.groups);
    let belief = &task.belief;
    let no_plan = |error: CandidateError| error.in_file(wanted.path);
    let unread = |error: &dyn Display| {
        FileError::new(&scenario.path, error.to_string()).code(ErrorCode::Simulation)
    };
    let unidentified = |error: IdentificationError| error.in_file(&scenario.path);

    // Design.
    let size = PlanSize::wanted_by(task);
    let (planning, found) = (wanted.design(task, size, seed, watch)).map_err(no_plan)?;

    // Read, as the plan's file says.
    stage(&RunStage::Calibrating);
    let rows = planning.rows(&found.plan);
    let read = AbsolutePlanning::of_plan(task, groups, &rows).map_err(no_plan)?;
    let studied = TakenReadings {
        plan: read.whole(),
        planning: read,
        groups,
    };
    let conditions = Conditions::plain(task, size.measurements);
    let setting = Setting::new(task, &scenario.truth, conditions);
    let runs = ReadingRuns::new(&setting, &studied).map_err(|error| unread(&error))?;
    let mut robots = runs.robots()?;
    let readings = (runs.measure(&mut robots, seed, RUN)).map_err(|error| unread(&error))?;
    let did = (runs.carried_out(&mut robots)).map_err(|error| unread(&error))?;

    // Identify.
    let identified = identify_absolute(belief, &readings, groups, FitChoices::weighed(weights));
    let identified = identified.map_err(unidentified)?;
    let (case, fit) = (&identified.case, &identified.fit);
    let nominal = AbsoluteCase::new(belief, &readings).and_then(|case| case.in_best_frames());
    let nominal = nominal.map_err(unidentified)?;

    // Compensate, and see where the tool is.
    let frames = runs.read.frames(&robots, seed, RUN);
    let mut seen = |arm, joints| runs.residuals(&mut robots, &frames, case, arm, joints);
    let before_m = seen(&nominal, &[]).map_err(|error| unread(&error))?;
    // What joints are off by counts as the prediction has it: where the planner's model has it as functions.
    let after_m = seen(&fit.arm, fit.known_joint_errors(belief)).map_err(|error| unread(&error))?;
    let poses = compensated(task, (case, fit), &runs.prediction, [&before_m, &after_m]);
    let poses = poses.map_err(|error| unread(&error))?;

    // Compare.
    stage(&RunStage::Comparing);
    let random = planning.median_random_rho0_m(size.measurements, RANDOM_PLANS, seed);
    let none = |problem: CandidateError| stage(&RunStage::NoRandomPlans(problem.to_string()));
    let plan = planned_readings(task, &planning, &found.plan);
    let run = AbsoluteRun {
        searches: found.searches,
        record: record(
            scenario,
            (&robots, RUN),
            ("optimal", plan),
            (case, fit, &poses),
            (readings.clone(), did.off_by([&before_m, &after_m])),
        ),
        readings,
        identified,
        poses,
        random_rho0_m: random.map_err(none).ok(),
    };
    Ok(((planning, found), run))
}

/// What is commanded at each test pose by what was identified, and how far off (m) the tool is of the nominal and of the identified robot.
fn compensated(
    task: &Task,
    (case, fit): (&AbsoluteCase<'_>, &AbsoluteFit),
    prediction: &PredictedAccuracy,
    [before_m, after_m]: [&[Vector3<f64>]; 2],
) -> Result<Vec<CompensatedPose>, EquilibriumError> {
    let belief = &task.belief;
    let tool = (case.targets.iter()).position(|name| *name == belief.machining_tool.name);
    let compensated = |(place, pose): (usize, &TestPose)| {
        Ok(CompensatedPose {
            name: pose.name.clone(),
            weight: pose.weight,
            direction: pose.direction,
            commanded_rad: compensate_arm(&fit.arm, tool.unwrap_or(0), pose, belief.method)?,
            predicted_m: prediction.poses_m[place].ok_or_else(|| NotDetermined {
                parameters: prediction.left.as_ref().err().cloned().unwrap_or_default(),
            }),
            seen: SeenPose {
                uncompensated_m: before_m[place],
                residual_m: after_m[place],
            },
        })
    };
    task.test_poses
        .iter()
        .enumerate()
        .map(compensated)
        .collect()
}

/// One run of a study of absolute readings, with all that its robot did.
pub fn replay_readings(
    scenario: &Scenario,
    setting: &Setting<'_>,
    name: &str,
    studied: &TakenReadings<'_>,
    seed: u64,
    number: u64,
) -> anyhow::Result<RunMessage> {
    let (task, belief) = (&setting.task, &setting.task.belief);
    let runs = ReadingRuns::new(setting, studied)?;
    let mut robots = runs.robots()?;
    let (run, before_m, carried_out) = runs.shown(&mut robots, seed, number)?;
    let case = AbsoluteCase::new(belief, &run.readings)?;
    let seen_m = [&*before_m, &run.residuals_m];
    let poses = compensated(task, (&case, &run.fit), &runs.prediction, seen_m)?;
    let plan = planned_readings(task, &studied.planning, &studied.plan);
    let found = (&case, &run.fit, poses.as_slice());
    let carried_out = (run.readings, carried_out);
    Ok(record(
        scenario,
        (&robots, number),
        (name, plan),
        found,
        carried_out,
    ))
}

/// What is kept of a run: the plan, what its robot truly was, what it was found to be, and what that achieves.
fn record(
    scenario: &Scenario,
    (robots, number): (&TrueRobots, u64),
    (name, plan): (&str, Vec<PlanRowMessage>),
    (case, fit, poses): (&AbsoluteCase<'_>, &AbsoluteFit, &[CompensatedPose]),
    (readings, did): (Vec<AbsoluteReading>, CarriedOut),
) -> RunMessage {
    let belief = &scenario.task.belief;
    let commands = belief.commands();
    let pose = |pose| TestPoseMessage::new(&commands, pose);
    let mut conditions = fit.conditions();
    conditions.extend(pose_conditions(belief, poses));
    RunMessage {
        name: name.to_owned(),
        plan,
        measured: MeasuredMessage::Readings {
            measurements: readings,
            identification: Box::new(AbsoluteMessage::new(case, fit)),
        },
        truth: RunTruth {
            unknowns: Some(true_unknowns(scenario, robots, fit)),
            ..robots.sampled(number)
        },
        test_poses: poses.iter().map(pose).collect(),
        conditions,
        did,
    }
}

/// The true quantities of what was identified, in this run.
fn true_unknowns(scenario: &Scenario, robots: &TrueRobots, fit: &AbsoluteFit) -> Vec<TrueUnknown> {
    let belief = &scenario.task.belief;
    // Of another model than the nominal one a run says compliances alone. Zeros that are left out as redundant are in the frames,
    // and with links in these, too.
    let is_own = scenario.truth.robot.model.path() == belief.nominal.model.path();
    let is_link = |each: &Parameter| {
        use ParameterKind::{LinkPosition, LinkRotation};
        matches!(each.kind, LinkPosition { .. } | LinkRotation { .. })
    };
    let has_links = fit.set.parameters().iter().any(is_link);
    let is_said = is_own && (fit.left_out.is_empty() || !has_links);
    let value = |parameter: &Parameter| match parameter.kind {
        ParameterKind::JointCompliance { joint } => Some(robots.compliance_rad_per_nm()[joint]),
        kind if !is_said || kind.is_mounted() => None,
        _ => Some(parameter.quantity(&fit.reference, robots.value(belief, parameter))),
    };
    let unknown = |parameter: &Parameter| TrueUnknown {
        name: parameter.name.clone(),
        value: value(parameter),
    };
    fit.set.parameters().iter().map(unknown).collect()
}

impl AbsoluteRun<'_> {
    /// What must be looked at, besides what the plan does not determine.
    pub fn conditions(&self, scenario: &Scenario) -> Vec<Condition> {
        let mut conditions = self.identified.conditions();
        conditions.extend(pose_conditions(&scenario.task.belief, &self.poses));
        conditions.extend(implausible(scenario));
        conditions
    }

    /// results.json: the keys of the plan, of its readings and of their identification, by stage.
    pub fn json(
        &self,
        scenario: &Scenario,
        provenance: &ProvenanceMessage,
        plan: &AbsolutePlanMessage,
        groups: &[ParameterGroup],
    ) -> serde_json::Result<Value> {
        let identification = self
            .identified
            .json(scenario, &self.readings, provenance, groups)?;
        let [before_mm, after_mm] = rms_m(&self.poses).map(|value| value * 1e3);
        let mut own = serde_json::to_value(&self.record)?;
        own["assessment"] = json!(plan);
        // The order matters where keys coincide: rho0_mm is the predicted accuracy of the plan, and the unknowns are those of the
        // identification.
        let first = own["test_poses"][0].clone();
        let last = json!({
            "schema": SchemaMessage::new("run"),
            "gate": scenario.gate,
            "searches": self.searches[0],
            "searches_agreeing": self.searches[1],
            "measurements": own["measurements"],
            "truth": own["truth"],
            "test_poses": own["test_poses"],
            "uncompensated_rms_mm": before_mm,
            "residual_rms_mm": after_mm,
            "random_plans": RANDOM_PLANS,
            "random_median_rho0_mm": self.random_rho0_m.map(|value| value * 1e3),
            "plans": [own],
        });
        let all = [first, serde_json::to_value(plan)?, identification, last];
        Ok(results("run", provenance, all))
    }
}
