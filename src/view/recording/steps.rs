//! What the virtual robot does in each experiment and test pose.

use nalgebra::{DVector, Vector3};

use super::{Body, RecordedCalibration, ShownTool, Stance, Step, StepKind, tool_name};
use crate::calibration::{Calibration, CalibrationError};
use crate::mujoco::{Model, State};
use crate::record::absolute_plan::ReadingsRunMessage;
use crate::robot::Load;
use crate::scenario::Scenario;
use crate::study::carried_out::{AtRest, CarriedOut};
use crate::testbed::{MeasurementError, TrueRobots, VirtualRobot, Visit};

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
    fn place(&self, site: usize) -> Vector3<f64> {
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

    /// The stance of a virtual robot at rest: the links of a run's robot are elsewhere by what nobody sees, and the tool is where it was
    /// observed.
    fn at_rest(&mut self, rest: &AtRest, site: usize) -> Stance {
        Stance {
            tool_m: rest.place_m,
            ..self.stance(rest.q_rad.clone(), &rest.coordinates, site)
        }
    }

    /// The same as it came to rest last, with its tool there (m).
    fn rest(&mut self, robot: &VirtualRobot, site: usize, tool_m: Vector3<f64>) -> Stance {
        self.at_rest(&AtRest::of(robot, tool_m), site)
    }
}

/// The steps of a calibration, made by the robot of its run.
pub(super) fn of_deflections(
    scenario: &Scenario,
    calibration: &Calibration,
    stage: &mut Stage,
) -> Result<Vec<Step>, CalibrationError> {
    let mut robots = TrueRobots::new(&scenario.task.belief, &scenario.truth)?;
    let readings = calibration.plan.measurements() as usize;
    let (seed, run) = (scenario.seed, calibration.truth.run);
    let normals = robots.become_run_of(&scenario.truth, readings, seed, run)?;
    let (visits, robot) = robots.visits(&calibration.plan, &normals);
    let mut steps = experiment_steps(scenario, calibration, (&visits, robot), stage)?;
    steps.extend(test_pose_steps(scenario, calibration, &mut robots, stage)?);
    Ok(steps)
}

fn experiment_steps(
    scenario: &Scenario,
    calibration: &Calibration,
    (visits, robot): (&[Visit<'_>], &mut VirtualRobot),
    stage: &mut Stage,
) -> Result<Vec<Step>, CalibrationError> {
    let tool = &scenario.task.belief.calibration_tool.name;
    let site = scenario.truth.robot.model.site(tool)?;
    let tracker = scenario.task.belief.instrument.tracker_site;
    let mut first = 0;
    let mut steps = Vec::new();
    for (number, experiment) in (1..).zip(&calibration.plan.experiments) {
        let measurements = first..first + experiment.repeats as usize;
        // Repeats differ by what is new in each: the first one is shown.
        let visit = &visits[first];
        first = measurements.end;
        let mut rest = |commanded: &DVector<f64>, load: &Load, loaded| {
            let (tool_m, ..) = robot
                .rest(commanded, load)
                .map_err(|source| MeasurementError {
                    experiment: number,
                    loaded,
                    source,
                })?;
            Ok::<_, MeasurementError>(stage.rest(robot, site, tool_m))
        };
        let [before, under] = &visit.commanded_rad;
        let unloaded = rest(before, &Load::NONE, false)?;
        let mut loaded = rest(under, &visit.load, true)?;
        loaded.tool_m += visit.discrepancy_m();
        steps.push(Step {
            kind: StepKind::Experiment {
                number,
                measurements,
            },
            commanded_rad: experiment.configuration_rad.clone(),
            load: experiment.load,
            enlargement: 1.0,
            enlarged: loaded.clone(),
            unloaded,
            loaded,
            instrument_m: tracker.map(|site| stage.place(site)),
        });
    }
    Ok(steps)
}

/// The steps of a plan of absolute readings as it was carried out; at test poses from where the model has the tool to where it is.
pub(super) fn of_readings(
    scenario: &Scenario,
    record: &ReadingsRunMessage,
    carried_out: &CarriedOut,
    stage: &mut Stage,
) -> Result<Vec<Step>, CalibrationError> {
    let model = &scenario.truth.robot.model;
    let tracker = scenario.task.belief.instrument.tracker_site;
    let mut steps = Vec::new();
    for (number, row) in (1..).zip(&carried_out.rows) {
        let site = model.site(&row.target)?;
        let [unloaded, loaded] = row.rests.each_ref().map(|rest| stage.at_rest(rest, site));
        steps.push(Step {
            kind: StepKind::Experiment {
                number,
                measurements: row.readings.clone(),
            },
            commanded_rad: row.commanded_rad.clone(),
            load: row.load,
            enlargement: 1.0,
            enlarged: loaded.clone(),
            unloaded,
            loaded,
            instrument_m: (row.station_m).or_else(|| tracker.map(|site| stage.place(site))),
        });
    }
    let site = model.site(tool_name(scenario, ShownTool::Machining))?;
    let poses = (scenario.task.test_poses.iter())
        .zip(&carried_out.test_poses)
        .zip(&record.test_poses);
    for (index, ((pose, rest), achieved)) in poses.enumerate() {
        let loaded = stage.at_rest(rest, site);
        for (compensated, off_mm) in [
            (false, achieved.uncompensated_xyz_mm),
            (true, achieved.residual_xyz_mm),
        ] {
            let predicted_m = loaded.tool_m - Vector3::from(off_mm) * 1e-3;
            steps.push(Step {
                kind: StepKind::TestPose { index, compensated },
                commanded_rad: pose.configuration_rad.clone(),
                load: pose.load,
                unloaded: Stance {
                    tool_m: predicted_m,
                    ..loaded.clone()
                },
                enlargement: 1.0,
                enlarged: loaded.clone(),
                loaded: loaded.clone(),
                instrument_m: None,
            });
        }
    }
    Ok(steps)
}

fn test_pose_steps(
    scenario: &Scenario,
    calibration: &Calibration,
    robots: &mut TrueRobots,
    stage: &mut Stage,
) -> Result<Vec<Step>, CalibrationError> {
    let tool = &scenario.task.belief.machining_tool.name;
    let site = scenario.truth.robot.model.site(tool)?;
    let mut steps = Vec::new();
    let poses = scenario.task.test_poses.iter().zip(&calibration.poses);
    for (index, (pose, compensated_pose)) in poses.enumerate() {
        let at_pose = |source| CalibrationError::TestPose {
            pose: pose.name.clone(),
            source,
        };
        let configuration_rad = &pose.configuration_rad;
        let wanted_m = (robots.machining_tool(configuration_rad, &Load::NONE)).map_err(at_pose)?;
        let wanted = stage.rest(robots.machining(), site, wanted_m);
        for (compensated, commanded_rad) in [
            (false, configuration_rad),
            (true, &compensated_pose.commanded_rad),
        ] {
            let loaded_m = (robots.machining_tool_at_work(commanded_rad, pose)).map_err(at_pose)?;
            let loaded = stage.rest(robots.machining(), site, loaded_m);
            steps.push(Step {
                kind: StepKind::TestPose { index, compensated },
                commanded_rad: commanded_rad.clone(),
                load: pose.load,
                unloaded: wanted.clone(),
                enlargement: 1.0,
                enlarged: loaded.clone(),
                loaded,
                instrument_m: None,
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
    let mut steps: Vec<_> = (calibrations.iter_mut())
        .flat_map(|calibration| &mut calibration.steps)
        .filter(|step| step.tool() == tool)
        .collect();
    let largest = (steps.iter())
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
