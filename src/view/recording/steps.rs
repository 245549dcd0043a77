//! What the virtual robot does in each experiment and test pose.

use nalgebra::{DVector, Vector3};

use super::{Body, RecordedCalibration, ShownTool, Stance, Step, StepKind, tool_name};
use crate::calibration::{Calibration, CalibrationError};
use crate::measurement::Measurement;
use crate::mujoco::{Model, State};
use crate::robot::{EquilibriumError, Load};
use crate::scenario::Scenario;
use crate::task::TestPose;
use crate::testbed::{MeasurementError, VirtualRobot};

/// The largest deflection of experiments, and that of test poses, is drawn about this long (m).
const DRAWN_DEFLECTION_M: f64 = 0.25;

/// A simulation that is put where the virtual robot has been seen.
pub(super) struct Stage {
    state: State,
    links: Vec<usize>,
}

impl Stage {
    pub(super) fn new(model: &Model, links: &[Body]) -> Self {
        Self {
            state: State::new(model),
            links: links.iter().map(|body| body.id).collect(),
        }
    }

    /// Where a site is now (m).
    pub(super) fn place(&self, site: usize) -> Vector3<f64> {
        self.state.site(site).0
    }

    fn stance(&mut self, q_rad: Vec<f64>, coordinates: &[f64], site: usize) -> Stance {
        self.state.set_coordinates(coordinates);
        self.state.update_kinematics();
        Stance {
            q_rad,
            coordinates: coordinates.to_vec(),
            world_from_link: (self.links.iter())
                .map(|&body| self.state.body_pose(body))
                .collect(),
            tool_m: self.place(site),
        }
    }

    /// The stance at the static equilibrium of the virtual robot.
    fn rest(
        &mut self,
        robot: &mut VirtualRobot,
        site: usize,
        commanded_rad: &DVector<f64>,
        load: &Load,
    ) -> Result<Stance, EquilibriumError> {
        robot.rest(commanded_rad, load)?;
        Ok(self.stance(robot.joint_angles(), robot.coordinates(), site))
    }
}

pub(super) fn experiment_steps(
    scenario: &Scenario,
    calibration: &Calibration,
    stage: &mut Stage,
) -> Result<Vec<Step>, CalibrationError> {
    let tool = &scenario.task.belief.calibration_tool.name;
    let site = scenario.truth.robot.model.site(tool)?;
    let mut robot = VirtualRobot::new(&scenario.truth.robot, tool)?;
    let mut first = 0;
    let mut steps = Vec::new();
    for (number, experiment) in (1..).zip(&calibration.plan.experiments) {
        // Readings may have been dropped.
        let is_own = |each: &&Measurement| each.is_of(experiment);
        let left = calibration.measurements.iter().skip(first);
        let own = left.take(experiment.repeats as usize).take_while(is_own);
        let measurements = first..first + own.count();
        first = measurements.end;
        let q = &experiment.configuration_rad;
        let mut rest = |load: &Load, loaded| {
            stage
                .rest(&mut robot, site, q, load)
                .map_err(|source| MeasurementError {
                    experiment: number,
                    loaded,
                    source,
                })
        };
        let unloaded = rest(&Load::NONE, false)?;
        let loaded = rest(&experiment.load, true)?;
        steps.push(Step {
            kind: StepKind::Experiment {
                number,
                measurements,
            },
            commanded_rad: q.clone(),
            load: experiment.load,
            enlargement: 1.0,
            enlarged: loaded.clone(),
            unloaded,
            loaded,
        });
    }
    Ok(steps)
}

pub(super) fn test_pose_steps(
    scenario: &Scenario,
    calibration: &Calibration,
    stage: &mut Stage,
) -> Result<Vec<Step>, CalibrationError> {
    let tool = &scenario.task.belief.machining_tool.name;
    let site = scenario.truth.robot.model.site(tool)?;
    let mut robot = VirtualRobot::new(&scenario.truth.robot, tool)?;
    let mut steps = Vec::new();
    let poses = scenario.task.test_poses.iter().zip(&calibration.poses);
    for (index, (pose, compensated_pose)) in poses.enumerate() {
        let TestPose {
            configuration_rad,
            load,
            ..
        } = pose;
        let mut rest = |commanded_rad: &DVector<f64>, load: &Load| {
            stage
                .rest(&mut robot, site, commanded_rad, load)
                .map_err(|source| CalibrationError::TestPose {
                    pose: pose.name.clone(),
                    source,
                })
        };
        let wanted = rest(configuration_rad, &Load::NONE)?;
        for (compensated, commanded_rad) in [
            (false, configuration_rad),
            (true, &compensated_pose.commanded_rad),
        ] {
            let loaded = rest(commanded_rad, load)?;
            steps.push(Step {
                kind: StepKind::TestPose { index, compensated },
                commanded_rad: commanded_rad.clone(),
                load: *load,
                unloaded: wanted.clone(),
                enlargement: 1.0,
                enlarged: loaded.clone(),
                loaded,
            });
        }
    }
    Ok(steps)
}

/// Gives all steps with the same tool the same enlargement, so that they can be compared.
pub(super) fn enlarge(
    scenario: &Scenario,
    tool: ShownTool,
    calibrations: &mut [RecordedCalibration],
    stage: &mut Stage,
) -> Result<(), CalibrationError> {
    let site = scenario.truth.robot.model.site(tool_name(scenario, tool))?;
    let mut steps: Vec<_> = calibrations
        .iter_mut()
        .flat_map(|calibration| &mut calibration.steps)
        .filter(|step| step.tool() == tool)
        .collect();
    let largest = steps
        .iter()
        .map(|step| step.displacement_m().norm())
        .fold(0.0, f64::max);
    let factor = round_factor(DRAWN_DEFLECTION_M / largest);
    for step in &mut steps {
        let (from, to) = (&step.unloaded, &step.loaded);
        let enlarged = |from: &[f64], to: &[f64]| -> Vec<f64> {
            let each = from.iter().zip(to);
            each.map(|(unloaded, loaded)| unloaded + factor * (loaded - unloaded))
                .collect()
        };
        let q_rad = enlarged(&from.q_rad, &to.q_rad);
        let coordinates = enlarged(&from.coordinates, &to.coordinates);
        step.enlargement = factor;
        step.enlarged = stage.stance(q_rad, &coordinates, site);
    }
    Ok(())
}

/// The nearest of 1, 2, 3, 5, 10, 20, 30, 50 and so on; 1 where there is nothing to enlarge.
fn round_factor(factor: f64) -> f64 {
    if !factor.is_finite() || factor <= 1.0 {
        return 1.0;
    }
    let decade = 10_f64.powf(factor.log10().floor());
    let apart = |candidate: f64| (candidate / factor).ln().abs();
    [1.0, 2.0, 3.0, 5.0, 10.0]
        .map(|step| step * decade)
        .into_iter()
        .min_by(|a, b| apart(*a).total_cmp(&apart(*b)))
        .unwrap_or(decade)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(clippy::float_cmp, reason = "the factors are exact")]
    fn factors_are_round() {
        assert_eq!(round_factor(18.3), 20.0);
        assert_eq!(round_factor(145.0), 200.0);
        assert_eq!(round_factor(3.3), 3.0);
        assert_eq!(round_factor(0.2), 1.0);
        assert_eq!(round_factor(f64::INFINITY), 1.0);
    }
}
