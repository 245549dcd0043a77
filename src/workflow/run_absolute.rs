//! A plan of absolute readings through the whole loop: designed, read on the virtual robot, identified from, compensated with, and set
//! beside random plans.

use std::fmt::Display;

use nalgebra::Vector3;
use serde_json::{Value, json};

use super::design::Wanted;
use super::identify_absolute::{IdentifiedRobot, identify_absolute};
use super::run::{RANDOM_PLANS, RUN, RunStage};
use crate::calibration::{CompensatedPose, SeenPose, pose_conditions, rms_m};
use crate::codes::{Condition, ErrorCode};
use crate::compensation::compensate_arm;
use crate::files::FileError;
use crate::identification::{
    AbsoluteCase, AbsoluteError, AbsoluteFit, ParameterGroup, ReadingWeights,
};
use crate::measurement::AbsoluteReading;
use crate::numeric::posterior::NotDetermined;
use crate::parameter::{Parameter, ParameterKind};
use crate::plan::absolute::{
    AbsolutePlan, AbsolutePlanError, AbsolutePlanning, PredictedAccuracy, ReadingsWanted,
};
use crate::plan::search::Watch;
use crate::record::absolute::AbsoluteMessage;
use crate::record::absolute_plan::{
    AbsolutePlanMessage, PlannedReadingMessage, ReadingsRunMessage, planned_readings,
};
use crate::record::json::{merge, results};
use crate::record::messages::{ProvenanceMessage, TestPoseMessage, TruthMessage};
use crate::robot::EquilibriumError;
use crate::scenario::Scenario;
use crate::study::absolute::ReadingRuns;
use crate::study::carried_out::CarriedOut;
use crate::study::{Conditions, Setting, StudiedReadings};
use crate::task::{Task, TestPose};
use crate::testbed::TrueRobots;
use crate::understanding::implausible;

/// What a run of absolute accuracy comes to.
#[derive(Debug)]
pub struct AbsoluteRun<'a> {
    /// How many searches for the plan there were, and how many ended within 0.1 %.
    pub searches: [usize; 2],
    /// The run of the plan: readings each by itself, the simulated truth, what was identified, and what that achieves.
    pub record: ReadingsRunMessage,
    /// What was identified.
    pub identified: IdentifiedRobot<'a>,
    /// What that achieves at each test pose; without compensation, the nominal robot in the frames that suit the readings best.
    pub poses: Vec<CompensatedPose>,
    /// What the robot did.
    pub carried_out: CarriedOut,
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
    (watch, stage): (Watch<'_>, &dyn Fn(&RunStage<'_>)),
) -> Result<(DesignedReadings<'a>, AbsoluteRun<'a>), FileError> {
    let (task, seed, groups) = (&scenario.task, scenario.seed, wanted.groups);
    let belief = &task.belief;
    let no_plan = |error: AbsolutePlanError| error.in_file(wanted.path);
    let unread = |error: &dyn Display| {
        FileError::new(&scenario.path, error.to_string()).code(ErrorCode::Simulation)
    };
    let unidentified = |error: AbsoluteError| error.in_file(&scenario.path);

    // Design.
    let size = Wanted::by(task).size();
    let (planning, found) = (wanted.design(task, size, seed, watch)).map_err(no_plan)?;

    // Read, as the plan's file says.
    stage(&RunStage::Calibrating);
    let rows = planning.rows(&found.plan);
    let read = AbsolutePlanning::of_plan(task, groups, &rows).map_err(no_plan)?;
    let studied = StudiedReadings {
        plan: read.whole(),
        planning: read,
        groups,
        is_random: false,
    };
    let conditions = Conditions::plain(task, size.measurements);
    let setting = Setting::new(task, &scenario.truth, conditions);
    let runs = ReadingRuns::new(&setting, &studied).map_err(|error| unread(&error))?;
    let mut robots = runs.robots()?;
    let readings = (runs.measure(&mut robots, seed, RUN)).map_err(|error| unread(&error))?;
    let carried_out = (runs.carried_out(&mut robots)).map_err(|error| unread(&error))?;

    // Identify.
    let identified = identify_absolute(belief, &readings, groups, (weights, false));
    let identified = identified.map_err(unidentified)?;
    let (case, fit) = (&identified.case, &identified.fit);
    let nominal = AbsoluteCase::new(belief, &readings).and_then(|case| case.in_best_frames());
    let nominal = nominal.map_err(unidentified)?;

    // Compensate, and see where the tool is.
    let frames = runs.frames(seed, RUN);
    let mut seen = |arm, joints| runs.residuals(&mut robots, &frames, case, arm, joints);
    let before_m = seen(&nominal, &[]).map_err(|error| unread(&error))?;
    // What joints are off by counts as the prediction has it: where the planner's model has it as functions.
    let after_m = seen(&fit.arm, fit.known_joint_errors(belief)).map_err(|error| unread(&error))?;
    let poses = compensated(task, (case, fit), &runs.prediction, [&before_m, &after_m]);
    let poses = poses.map_err(|error| unread(&error))?;

    // Compare.
    stage(&RunStage::Comparing);
    let random = planning.median_random_rho0_m(size.measurements, RANDOM_PLANS, seed);
    let none = |problem: AbsolutePlanError| stage(&RunStage::NoRandomPlans(problem.to_string()));
    let plan = planned_readings(task, &planning, &found.plan);
    let run = AbsoluteRun {
        searches: found.searches,
        record: record(
            scenario,
            (&robots, RUN),
            ("optimal", plan),
            (case, fit, &poses),
            readings,
        ),
        carried_out,
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
            predicted_m: predicted(prediction, place),
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

/// The predicted rms distance (m) at a test pose, by its place.
fn predicted(prediction: &PredictedAccuracy, place: usize) -> Result<f64, NotDetermined> {
    prediction.poses_m[place].ok_or_else(|| NotDetermined {
        parameters: prediction.left.as_ref().err().cloned().unwrap_or_default(),
    })
}

/// One run of a study of absolute readings, with all that its robot did.
///
/// # Errors
/// What it failed by.
pub fn replay_readings(
    scenario: &Scenario,
    setting: &Setting<'_>,
    name: &str,
    studied: &StudiedReadings<'_>,
    seed: u64,
    number: u64,
) -> anyhow::Result<(ReadingsRunMessage, CarriedOut)> {
    let (task, belief) = (&setting.task, &setting.task.belief);
    let runs = ReadingRuns::new(setting, studied)?;
    let mut robots = runs.robots()?;
    let shown = runs.shown(&mut robots, seed, number)?;
    let run = shown.run;
    let case = AbsoluteCase::new(belief, &run.readings)?;
    let seen_m = [&*shown.before_m, &run.residuals_m];
    let poses = compensated(task, (&case, &run.fit), &runs.prediction, seen_m)?;
    let plan = planned_readings(task, &studied.planning, &studied.plan);
    let found = (&case, &run.fit, poses.as_slice());
    let record = record(
        scenario,
        (&robots, number),
        (name, plan),
        found,
        run.readings,
    );
    Ok((record, shown.carried_out))
}

/// What is kept of a run: the plan, what its robot truly was, what it was found to be, and what that achieves.
fn record(
    scenario: &Scenario,
    (robots, number): (&TrueRobots, u64),
    (name, plan): (&str, Vec<PlannedReadingMessage>),
    (case, fit, poses): (&AbsoluteCase<'_>, &AbsoluteFit, &[CompensatedPose]),
    readings: Vec<AbsoluteReading>,
) -> ReadingsRunMessage {
    let belief = &scenario.task.belief;
    let (commands, joints) = (belief.commands(), belief.parameters.iter().copied());
    let pose = |pose| TestPoseMessage::new(&commands, pose);
    ReadingsRunMessage {
        name: name.to_owned(),
        plan,
        truth: TruthMessage::new(joints, &robots.sampled(number)),
        true_values: true_values(scenario, robots, fit),
        identification: AbsoluteMessage::new(case, fit),
        test_poses: poses.iter().map(pose).collect(),
        readings,
    }
}

/// The true quantities of what was identified, in this run.
fn true_values(scenario: &Scenario, robots: &TrueRobots, fit: &AbsoluteFit) -> Vec<Option<f64>> {
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
    fit.set.parameters().iter().map(value).collect()
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
        let identification = self.identified.json(scenario, provenance, groups)?;
        let [before_mm, after_mm] = rms_m(&self.poses).map(|value| value * 1e3);
        let mut own = self.record.json()?;
        merge(&mut own, json!({ "assessment": plan }));
        // The order matters where keys coincide: rho0_mm is the predicted accuracy of the plan, and the unknowns are those of the
        // identification.
        let mut json = json!({ "gate": scenario.gate });
        merge(&mut json, own["test_poses"][0].clone());
        merge(&mut json, serde_json::to_value(plan)?);
        merge(&mut json, identification);
        merge(
            &mut json,
            json!({
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
            }),
        );
        merge(&mut json, results("run", provenance, json!({})));
        Ok(json)
    }
}
