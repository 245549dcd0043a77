//! A run of the whole loop on the virtual robot: measure in MuJoCo, identify, compensate, command
//! the robot in MuJoCo again, and see what distance is left.

use nalgebra::{DMatrix, DVector};

use crate::files::FileError;
use crate::identification::{Identification, PreparedCase};

use super::tally::{FailedRun, Failure, Outcome};
use crate::calibration::{prepared_as_planned, see_residual};
use crate::compensation::{compensate_arm, test_pose_rows};
use crate::numeric::random::normal::LANES;
use crate::parameter::ElasticArm;
use crate::plan::Plan;
use crate::task::Task;
use crate::testbed::{TrueRobots, Truth, add_noise};

/// A plan with what its runs have in common, whatever is drawn.
#[derive(Debug)]
pub struct PreparedPlan<'a> {
    plan: &'a Plan,
    identification: PreparedCase<'a>,
}

impl<'a> PreparedPlan<'a> {
    /// A plan for a task.
    pub fn new(task: &'a Task, plan: &'a Plan) -> Self {
        Self {
            plan,
            identification: prepared_as_planned(&task.belief, plan),
        }
    }
}

/// What one thread needs for runs.
#[derive(Debug)]
pub struct RobotRuns<'a> {
    task: &'a Task,
    robots: TrueRobots,
    /// The compliance of every joint in a run (rad/(N m)), then what sources have in common with an earlier campaign.
    values: Vec<f64>,
    /// A_0 of each test pose.
    test_poses: Vec<DMatrix<f64>>,
    /// The arm as it was identified in a run.
    identified: ElasticArm,
}

impl<'a> RobotRuns<'a> {
    /// The virtual robot with each of the task's tools.
    ///
    /// # Errors
    /// The true robot's model lacks a tool, or something that is uncertain.
    pub fn new(task: &'a Task, truth: &Truth) -> Result<Self, FileError> {
        let belief = &task.belief;
        Ok(Self {
            task,
            robots: TrueRobots::new(belief, truth)?,
            values: vec![0.0; belief.joints() + truth.kept().len()],
            test_poses: (task.test_poses.iter())
                .map(|pose| test_pose_rows(belief, pose))
                .collect(),
            identified: belief.arm(),
        })
    }

    /// How many normal numbers a run's laboratory takes for so many measurements.
    pub fn numbers(&self, measurements: usize) -> usize {
        self.robots.numbers(measurements)
    }

    /// Makes the virtual robot that of a lane: with its compliances (rad/(N m)) and what sources have in common with an earlier campaign,
    /// and with what the normals say of its laboratory.
    ///
    /// # Errors
    /// A link of the model has no frame of its own.
    pub fn become_run(
        &mut self,
        values: &[[f64; LANES]],
        laboratory: &[[f64; LANES]],
        lane: usize,
    ) -> Result<(), FileError> {
        for (mine, lanes) in self.values.iter_mut().zip(values) {
            *mine = lanes[lane];
        }
        (self.robots).become_run(&self.values, laboratory, lane)
    }

    /// One run with the normals of a lane, those of the noise and of the laboratory. What the measurements do not determine
    /// keeps its nominal value, which the test poses must not need.
    pub fn run(
        &mut self,
        PreparedPlan {
            plan,
            identification,
        }: &PreparedPlan<'_>,
        noise: &[[f64; LANES]],
        laboratory: &[[f64; LANES]],
        lane: usize,
    ) -> Result<Outcome, FailedRun> {
        let belief = &self.task.belief;
        let mut measurements = (self.robots)
            .measure_noise_free(plan, &belief.instrument, laboratory, lane)
            .map_err(|error| Failure::Measurement.because(&error))?;
        add_noise(&mut measurements, &belief.instrument, noise, lane);
        let identification = (identification.identify(&measurements))
            .map_err(|error| Failure::Identification.because(&error))?;
        let posterior = &identification.posterior;
        let truth = self.robots.unknowns(belief);
        let values = posterior.mean.iter().zip(&truth);
        let error = DVector::from_iterator(truth.len(), values.map(|(value, truth)| value - truth));
        let is_determined = |pose: &DMatrix<f64>| posterior.variance_of(pose).is_ok();
        // What stays nominal is compensated so.
        let is_open = identification.stays_nominal.is_empty() && !posterior.estimable.is_complete();
        if is_open && !self.test_poses.iter().all(is_determined) {
            return Err(Failure::Undetermined.into());
        }
        let nees = (posterior.normalised_square(&error)).ok_or(Failure::Undetermined)?;
        let arm = &mut self.identified;
        belief.set_values(arm, &posterior.mean);
        let mut square_m2 = 0.0;
        for pose in &self.task.test_poses {
            let seen = compensate_arm(arm, arm.tools.len() - 1, pose, belief.method)
                .and_then(|commanded| see_residual(&mut self.robots, pose, &commanded))
                .map_err(|error| Failure::TestPose.because(&error))?;
            square_m2 += pose.weight * seen.norm_squared();
        }
        Ok(Outcome {
            square: square_m2 / belief.instrument.sigma_m.powi(2),
            nees,
            freedom: posterior.estimable.rank(),
            intervals: intervals(&identification, &truth),
        })
    }
}

/// The 95 % intervals of compliances, and how many of them hold the true one.
fn intervals(identification: &Identification, truth: &[f64]) -> [u32; 2] {
    let mut counts = [0; 2];
    for (parameter, truth) in identification.parameters.iter().zip(truth) {
        if let Some(estimate) = parameter.estimate {
            let [low, high] = estimate.interval95;
            counts[0] += 1;
            counts[1] += u32::from((low..=high).contains(truth));
        }
    }
    counts
}
