//! A run of the whole loop on the virtual robot: measure in MuJoCo, identify, compensate, command
//! the robot in MuJoCo again, and see what distance is left.

use nalgebra::{DMatrix, DVector};

use super::tally::Failure;
use crate::calibration::{identify_as_planned, see};
use crate::compensation::{compensate, test_pose_matrix};
use crate::mujoco::ModelError;
use crate::plan::Plan;
use crate::random::normal::LANES;
use crate::task::Task;
use crate::testbed::{Truth, VirtualRobot, add_noise};

/// What one thread needs for runs.
#[derive(Debug)]
pub struct RobotRuns<'a> {
    task: &'a Task,
    measuring: VirtualRobot,
    machining: VirtualRobot,
    true_rad_per_nm: Vec<f64>,
    /// A_0 of each test pose.
    test_poses: Vec<DMatrix<f64>>,
}

impl<'a> RobotRuns<'a> {
    /// The virtual robot with each of the task's tools.
    ///
    /// # Errors
    /// The true robot's model lacks a tool.
    pub fn new(task: &'a Task, truth: &Truth) -> Result<Self, ModelError> {
        let robot = &truth.robot;
        let belief = &task.belief;
        Ok(Self {
            task,
            measuring: VirtualRobot::new(robot, &belief.calibration_tool.name)?,
            machining: VirtualRobot::new(robot, &belief.machining_tool.name)?,
            true_rad_per_nm: robot.compliance_rad_per_nm.clone(),
            test_poses: (task.test_poses.iter())
                .map(|pose| test_pose_matrix(belief, pose, &belief.parameters))
                .collect(),
        })
    }

    /// Gives the virtual robot other compliances (rad/(N m)): those of a lane.
    pub fn set_compliance(&mut self, true_rad_per_nm: &[[f64; LANES]], lane: usize) {
        for (mine, lanes) in self.true_rad_per_nm.iter_mut().zip(true_rad_per_nm) {
            *mine = lanes[lane];
        }
        self.measuring.set_compliance(&self.true_rad_per_nm);
        self.machining.set_compliance(&self.true_rad_per_nm);
    }

    /// One run with the normals of a lane: the squared distance in sigma^2, weighted over the test
    /// poses, and the normalised estimation error squared of what the measurements determine. The rest
    /// keeps its nominal value, which the test poses must not need.
    ///
    /// # Errors
    /// Why the run failed.
    pub fn run(
        &mut self,
        plan: &Plan,
        normals: &[[f64; LANES]],
        lane: usize,
    ) -> Result<(f64, f64), Failure> {
        let belief = &self.task.belief;
        let mut measurements = self
            .measuring
            .measure_noise_free(plan, &belief.instrument)
            .map_err(|_| Failure::Measurement)?;
        add_noise(&mut measurements, &belief.instrument, normals, lane);
        let identification =
            identify_as_planned(belief, &measurements).map_err(|_| Failure::Identification)?;
        let estimated = &identification.compliance_rad_per_nm;
        let error = DVector::from_iterator(
            belief.parameters.len(),
            belief
                .parameters
                .iter()
                .map(|&joint| estimated[joint] - self.true_rad_per_nm[joint]),
        );
        let posterior = &identification.posterior;
        let is_determined = |pose: &DMatrix<f64>| posterior.variance_of(pose).is_ok();
        if !posterior.estimable.is_complete() && !self.test_poses.iter().all(is_determined) {
            return Err(Failure::Undetermined);
        }
        let nees = (posterior.normalised_square(&error)).ok_or(Failure::Undetermined)?;
        let mut square_m2 = 0.0;
        for pose in &self.task.test_poses {
            let (chain, tool) = (&belief.nominal.chain, &belief.machining_tool);
            let seen = compensate(chain, tool, estimated, pose, belief.method)
                .and_then(|commanded| see(&mut self.machining, pose, &commanded))
                .map_err(|_| Failure::TestPose)?;
            square_m2 += pose.weight * seen.residual_m.norm_squared();
        }
        Ok((square_m2 / belief.instrument.sigma_m.powi(2), nees))
    }
}
