//! The whole loop once: measure a plan on the virtual robot, identify, compensate, and see on the
//! virtual robot what distance is left.

use nalgebra::{DMatrix, DVector, Vector3};
use thiserror::Error;

use crate::codes::{Condition, ConditionCode};
use crate::compensation::{compensate_arm, predicted_error, test_pose_rows};
use crate::files::FileError;
use crate::identification::{
    Case, Identification, IdentificationError, MeasurementResidual, PreparedCase, residuals,
};
use crate::measurement::Measurement;
use crate::numeric::posterior::{NotDetermined, Posterior};
use crate::plan::Plan;
use crate::robot::{EquilibriumError, Load};
use crate::task::{Belief, Method, Task, TestPose};
use crate::testbed::{
    MeasurementError, RunTruth, TrueRobots, Truth, add_noise_of, measurements_of,
};

/// Why the loop could not be closed.
#[derive(Debug, Error)]
pub enum CalibrationError {
    /// The virtual robot's model lacks something.
    #[error(transparent)]
    Model(#[from] FileError),
    /// An experiment cannot be measured.
    #[error(transparent)]
    Measurement(#[from] MeasurementError),
    /// The measurements identify nothing.
    #[error(transparent)]
    Identification(#[from] IdentificationError),
    /// A test pose has no equilibrium.
    #[error("test pose {pose:?}: {source}")]
    TestPose {
        /// The test pose's name.
        pose: String,
        /// What is wrong.
        source: EquilibriumError,
    },
}

/// What compensation achieves at a test pose.
#[derive(Debug, Clone, PartialEq)]
pub struct CompensatedPose {
    /// The test pose's name.
    pub name: String,
    /// Its weight among the test poses.
    pub weight: f64,
    /// The direction along which alone errors count there.
    pub direction: Option<Vector3<f64>>,
    /// The joint angles to command (rad).
    pub commanded_rad: DVector<f64>,
    /// The predicted rms distance `rho_0` (m), eq. 20 with the covariance of this identification; or the
    /// compliances on which the pose depends and that were not determined.
    pub predicted_m: Result<f64, NotDetermined>,
    /// What was seen on the virtual robot.
    pub seen: SeenPose,
}

/// Distances of the loaded tool from where it is wanted, `t_F` - `t_0` (D2), in the world frame; of them what counts at
/// the pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenPose {
    /// Without compensation (m).
    pub uncompensated_m: Vector3<f64>,
    /// With compensation (m).
    pub residual_m: Vector3<f64>,
}

/// One calibration from plan to compensated test poses.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// The plan that was measured.
    pub plan: Plan,
    /// The measurements.
    pub measurements: Vec<Measurement>,
    /// The simulated truth of this run.
    pub truth: RunTruth,
    /// What was identified from the measurements.
    pub identification: Identification,
    /// The residuals, standardised.
    pub residuals: Vec<MeasurementResidual>,
    /// What that achieves at each test pose.
    pub poses: Vec<CompensatedPose>,
}

/// The rms over test poses, by their weights, of distances without compensation and of what is left with it (m).
pub fn rms_m(poses: &[CompensatedPose]) -> [f64; 2] {
    let seen = |pose: &CompensatedPose| [pose.seen.uncompensated_m, pose.seen.residual_m];
    [0, 1].map(|which| {
        let squares = poses.iter();
        let squares = squares.map(|pose| pose.weight * seen(pose)[which].norm_squared());
        squares.sum::<f64>().sqrt()
    })
}

/// Measures, identifies and compensates with the noise of run `run` under a seed: the same as that run of a
/// study on the virtual robot.
pub fn calibrate(
    task: &Task,
    truth: &Truth,
    plan: &Plan,
    seed: u64,
    run: u64,
) -> Result<Calibration, CalibrationError> {
    let mut robots = TrueRobots::new(&task.belief, truth)?;
    let MeasuredRun {
        measurements,
        truth,
    } = measure(&mut robots, task, truth, plan, seed, run, true)?;
    let identification = identify_as_planned(&task.belief, &measurements)?;
    let residuals = residuals(
        &Case::as_believed(&task.belief, &measurements),
        &identification,
        &[],
    )?;
    let poses = compensate_poses(
        task,
        &mut robots,
        &identification.posterior,
        task.belief.method,
    )?;
    Ok(Calibration {
        plan: plan.clone(),
        measurements,
        truth,
        identification,
        residuals,
        poses,
    })
}

/// A plan's measurements in a run, and the truth of that run.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredRun {
    /// The measurements.
    pub measurements: Vec<Measurement>,
    /// The simulated truth.
    pub truth: RunTruth,
}

/// Makes the virtual robot that of run `run` under a seed, and measures a plan on it: with the instrument's errors, or what the robot
/// of that run does.
pub fn measure(
    robots: &mut TrueRobots,
    task: &Task,
    truth: &Truth,
    plan: &Plan,
    seed: u64,
    run: u64,
    has_noise: bool,
) -> Result<MeasuredRun, CalibrationError> {
    let (instrument, count) = (&task.belief.instrument, plan.measurements() as usize);
    let normals = robots.become_run_of(truth, count, seed, run)?;
    let mut measurements = robots.measure_noise_free(plan, instrument, &normals, 0)?;
    let truth = robots.truth(plan, &normals, run)?;
    if has_noise {
        add_noise_of(&mut measurements, instrument, seed, robots.readings_of(run));
    } else {
        for (each, moved_m) in measurements.iter_mut().zip(&truth.deflections_m) {
            each.deflection_m = each.direction.map_or(*moved_m, |d| d * d.dot(moved_m));
        }
    }
    Ok(MeasuredRun {
        measurements,
        truth,
    })
}

/// Identifies the parameters of a belief by its method, with its sigma. Compliances of which the measurements tell less stay nominal.
pub fn identify_as_planned(
    belief: &Belief,
    measurements: &[Measurement],
) -> Result<Identification, IdentificationError> {
    PreparedCase::new(Case::as_believed(belief, &[]), measurements).identify_all(measurements)
}

/// The same over and over from measurements of one plan.
pub(crate) fn prepared_as_planned<'a>(belief: &'a Belief, plan: &Plan) -> PreparedCase<'a> {
    let measurements = measurements_of(plan, &belief.instrument);
    PreparedCase::new(Case::as_believed(belief, &[]), &measurements)
}

/// Compensates every test pose with what was identified of the belief's unknowns, and sees on the virtual robot what distance is left.
pub fn compensate_poses(
    task: &Task,
    robots: &mut TrueRobots,
    posterior: &Posterior,
    method: Method,
) -> Result<Vec<CompensatedPose>, CalibrationError> {
    let belief = &task.belief;
    let arm = belief.arm_at(&posterior.mean);
    // Derivatives where the covariance is that of.
    let nothing = DMatrix::zeros(belief.unknowns(), belief.unknowns());
    let identified = belief.informed(&arm.compliance_rad_per_nm, &nothing);
    compensate_poses_by(task, robots, &|pose| {
        let commanded_rad = compensate_arm(&arm, arm.tools.len() - 1, pose, method)?;
        let matrix = test_pose_rows(&identified, pose);
        Ok((commanded_rad, predicted_error(&matrix, posterior)))
    })
}

/// The angles to command at a test pose (rad), and the predicted rms distance (m) that they leave there.
pub type CompensatedCommand = (DVector<f64>, Result<f64, NotDetermined>);

/// The same with commands of any identification.
pub fn compensate_poses_by(
    task: &Task,
    robots: &mut TrueRobots,
    command: &dyn Fn(&TestPose) -> Result<CompensatedCommand, EquilibriumError>,
) -> Result<Vec<CompensatedPose>, CalibrationError> {
    task.test_poses
        .iter()
        .map(|pose| {
            let at_pose = |source| CalibrationError::TestPose {
                pose: pose.name.clone(),
                source,
            };
            let (commanded_rad, predicted_m) = command(pose).map_err(at_pose)?;
            Ok(CompensatedPose {
                name: pose.name.clone(),
                weight: pose.weight,
                direction: pose.direction,
                predicted_m,
                seen: see(robots, pose, &commanded_rad).map_err(at_pose)?,
                commanded_rad,
            })
        })
        .collect()
}

/// What does not hold for commanded test poses: angles beyond the joints' limits, and what is needed and was not determined.
pub fn pose_conditions(belief: &Belief, poses: &[CompensatedPose]) -> Vec<Condition> {
    let mut conditions = Vec::new();
    for pose in poses {
        for (joint, &angle) in (belief.nominal.chain.joints.iter()).zip(&pose.commanded_rad) {
            let [low, high] = joint.range_rad;
            if !(low..=high).contains(&angle) {
                let [(angle, unit), (low, _), (high, _)] =
                    [angle, low, high].map(|value| joint.drive.shown(value));
                conditions.push(ConditionCode::BeyondLimits.with(format!(
                    "test pose {:?}: {} would be commanded to {angle:.4} {unit}; its limits are {low:.4} to {high:.4} {unit}",
                    pose.name, joint.name,
                )));
            }
        }
        if let Err(missing) = &pose.predicted_m {
            conditions.push(ConditionCode::TaskUnidentifiable.with(format!(
                "test pose {:?} depends on what is not determined: {}; no accuracy is predicted",
                pose.name,
                missing.parameters.join(", ")
            )));
        }
    }
    conditions
}

/// Commands the virtual robot at a test pose under the task load as it is in this run, without and with compensation.
/// The wanted place `t_0` is that of the unloaded tool.
pub fn see(
    robots: &mut TrueRobots,
    pose: &TestPose,
    commanded_rad: &DVector<f64>,
) -> Result<SeenPose, EquilibriumError> {
    Ok(SeenPose {
        uncompensated_m: see_residual(robots, pose, &pose.configuration_rad)?,
        residual_m: see_residual(robots, pose, commanded_rad)?,
    })
}

/// How far the loaded tool is from where it is wanted (m) with one of these commands.
pub fn see_residual(
    robots: &mut TrueRobots,
    pose: &TestPose,
    commanded_rad: &DVector<f64>,
) -> Result<Vector3<f64>, EquilibriumError> {
    let (wanted, _) = robots.machining_tool(&pose.configuration_rad, &Load::NONE)?;
    let loaded = robots.machining_tool_at_work(commanded_rad, pose)?;
    Ok(pose.counted(&(loaded - wanted)))
}
