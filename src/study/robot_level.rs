//! A run of the whole loop on the virtual robot: measure in MuJoCo, identify, compensate, command
//! the robot in MuJoCo again, and see what distance is left.

use nalgebra::{DMatrix, DVector};

use super::tally::Failure;
use crate::calibration::{identify_as_planned, see};
use crate::compensation::{compensate, test_pose_matrix};
use crate::mujoco::ModelError;
use crate::plan::Plan;
use crate::random::normal::LANES;
use crate::scenario::Scenario;
use crate::testbed::{VirtualRobot, add_noise};

/// What one thread needs for runs.
#[derive(Debug)]
pub struct RobotRuns<'a> {
    scenario: &'a Scenario,
    measuring: VirtualRobot,
    machining: VirtualRobot,
    true_rad_per_nm: Vec<f64>,
    /// A_0 of each test pose.
    test_poses: Vec<DMatrix<f64>>,
}

impl<'a> RobotRuns<'a> {
    /// The virtual robot with each of the scenario's tools.
    ///
    /// # Errors
    /// The true robot's model lacks a tool.
    pub fn new(scenario: &'a Scenario) -> Result<Self, ModelError> {
        let robot = &scenario.true_robot;
        Ok(Self {
            scenario,
            measuring: VirtualRobot::new(robot, &scenario.calibration_tool.name)?,
            machining: VirtualRobot::new(robot, &scenario.machining_tool.name)?,
            true_rad_per_nm: robot.compliance_rad_per_nm.clone(),
            test_poses: (scenario.test_poses.iter())
                .map(|pose| {
                    let (chain, tool) = (&scenario.nominal.chain, &scenario.machining_tool);
                    test_pose_matrix(chain, tool, pose, &scenario.parameters)
                })
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
        let scenario = self.scenario;
        let mut measurements = self
            .measuring
            .measure_noise_free(plan, &scenario.instrument)
            .map_err(|_| Failure::Measurement)?;
        add_noise(&mut measurements, &scenario.instrument, normals, lane);
        let identification =
            identify_as_planned(scenario, &measurements).map_err(|_| Failure::Identification)?;
        let estimated = &identification.compliance_rad_per_nm;
        let error = DVector::from_iterator(
            scenario.parameters.len(),
            scenario
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
        for pose in &scenario.test_poses {
            let (chain, tool) = (&scenario.nominal.chain, &scenario.machining_tool);
            let seen = compensate(chain, tool, estimated, pose, scenario.method)
                .and_then(|commanded| see(&mut self.machining, pose, &commanded))
                .map_err(|_| Failure::TestPose)?;
            square_m2 += pose.weight * seen.residual_m.norm_squared();
        }
        Ok((square_m2 / scenario.instrument.sigma_m.powi(2), nees))
    }
}
