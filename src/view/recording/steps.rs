//! What the virtual robot does in each experiment and test pose.

use nalgebra::{DVector, Vector3};

use super::{Body, ReadingLine, RecordedCalibration, ShownTool, Stance, Step, StepKind, tool_name};
use crate::calibration::{Calibration, CalibrationError};
use crate::mujoco::State;
use crate::record::absolute_plan::ReadingsRunMessage;
use crate::robot::Load;
use crate::scenario::Scenario;
use crate::study::carried_out::{AtRest, CarriedOut};
use crate::task::Instrument;
use crate::testbed::{MeasurementError, TrueRobots};

/// The largest deflection of experiments, and that of test poses, is drawn about this long (m).
const DRAWN_DEFLECTION_M: f64 = 0.25;

/// The largest force in experiments, and that in test poses, is drawn this long (m).
const FORCE_ARROW_M: f64 = 0.6;

/// A simulation that is put where the virtual robot has been seen.
pub(super) struct Stage {
    state: State,
    links: Vec<usize>,
    instrument: Instrument,
}

impl Stage {
    pub(super) fn new(scenario: &Scenario, links: &[Body]) -> Self {
        Self {
            state: State::new(&scenario.truth.robot.model),
            links: links.iter().map(|body| body.id).collect(),
            instrument: scenario.task.belief.instrument,
        }
    }

    /// The stance of a virtual robot at rest: the links of a run's robot are elsewhere by what nobody sees, and the tool is where it was
    /// observed.
    fn stance(&mut self, rest: AtRest) -> Stance {
        self.state.set_coordinates(&rest.coordinates);
        self.state.update_kinematics();
        let links = self.links.iter();
        Stance {
            world_from_link: links.map(|&body| self.state.body_pose(body)).collect(),
            q_rad: rest.q_rad,
            coordinates: rest.coordinates,
            tool_m: rest.place_m,
        }
    }

    /// A step from a rest without load to one under it, read along a gauge's direction, from a station (m) or by the model's tracker.
    fn step(
        &mut self,
        kind: StepKind,
        (commanded_rad, load): (&DVector<f64>, Load),
        rests: [AtRest; 2],
        [direction, station_m]: [Option<Vector3<f64>>; 2],
    ) -> Step {
        let [unloaded, loaded] = rests.map(|rest| self.stance(rest));
        let sight = ReadingLine::new(&self.instrument, &self.state, direction, station_m)
            .filter(|_| matches!(kind, StepKind::Experiment { .. }));
        Step {
            kind,
            commanded_rad: commanded_rad.clone(),
            load,
            enlargement: 1.0,
            enlarged: loaded.clone(),
            unloaded,
            loaded,
            force_arrow_m: None,
            sight,
        }
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
    let mut first = 0;
    let mut steps = Vec::new();
    for (number, experiment) in (1..).zip(&calibration.plan.experiments) {
        let measurements = first..first + experiment.repeats as usize;
        // Repeats differ by what is new in each: the first one is shown.
        let visit = &visits[first];
        first = measurements.end;
        let mut rest = |commanded: &DVector<f64>, load: &Load, loaded| {
            let rest = robot.rest(commanded, load);
            let (place_m, ..) = rest.map_err(|source| MeasurementError {
                experiment: number,
                loaded,
                source,
            })?;
            Ok::<_, MeasurementError>(AtRest::of(robot, place_m))
        };
        let [before, under] = &visit.commanded_rad;
        let unloaded = rest(before, &Load::NONE, false)?;
        let mut loaded = rest(under, &visit.load, true)?;
        loaded.place_m += visit.discrepancy_m();
        let kind = StepKind::Experiment {
            number,
            measurements,
        };
        let commanded = (&experiment.configuration_rad, experiment.load);
        let read = [experiment.direction, None];
        steps.push(stage.step(kind, commanded, [unloaded, loaded], read));
    }
    let poses = scenario.task.test_poses.iter().zip(&calibration.poses);
    for (index, (pose, compensated_pose)) in poses.enumerate() {
        let at_pose = |source| CalibrationError::TestPose {
            pose: pose.name.clone(),
            source,
        };
        let configuration_rad = &pose.configuration_rad;
        let wanted = robots.machining_tool(configuration_rad, &Load::NONE);
        let (wanted_m, _) = wanted.map_err(at_pose)?;
        let wanted = AtRest::of(robots.machining(), wanted_m);
        for (compensated, commanded_rad) in [
            (false, configuration_rad),
            (true, &compensated_pose.commanded_rad),
        ] {
            let loaded_m = (robots.machining_tool_at_work(commanded_rad, pose)).map_err(at_pose)?;
            let rests = [wanted.clone(), AtRest::of(robots.machining(), loaded_m)];
            let kind = StepKind::TestPose { index, compensated };
            steps.push(stage.step(kind, (commanded_rad, pose.load), rests, [None; 2]));
        }
    }
    Ok(steps)
}

/// The steps of a plan of absolute readings as it was carried out; at test poses from where the model has the tool to where it is.
pub(super) fn of_readings(
    scenario: &Scenario,
    record: &ReadingsRunMessage,
    carried_out: &CarriedOut,
    stage: &mut Stage,
) -> Vec<Step> {
    let mut steps = Vec::new();
    for (number, row) in (1..).zip(&carried_out.rows) {
        let kind = StepKind::Experiment {
            number,
            measurements: row.readings.clone(),
        };
        let commanded = (&row.commanded_rad, row.load);
        let read = [None, row.station_m];
        steps.push(stage.step(kind, commanded, row.rests.clone(), read));
    }
    let poses = (scenario.task.test_poses.iter())
        .zip(&carried_out.test_poses)
        .zip(&record.test_poses);
    for (index, ((pose, rest), achieved)) in poses.enumerate() {
        for (compensated, off_mm) in [
            (false, achieved.uncompensated_xyz_mm),
            (true, achieved.residual_xyz_mm),
        ] {
            let predicted = AtRest {
                place_m: rest.place_m - Vector3::from(off_mm) * 1e-3,
                ..rest.clone()
            };
            let kind = StepKind::TestPose { index, compensated };
            let commanded = (&pose.configuration_rad, pose.load);
            let rests = [predicted, rest.clone()];
            steps.push(stage.step(kind, commanded, rests, [None; 2]));
        }
    }
    steps
}

/// Gives all steps with the same tool the same enlargement and scale of forces, so that they can be compared.
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
    let forces_n = steps.iter().map(|step| step.load.force_n.norm());
    let largest_n = forces_n.fold(0.0, f64::max);
    for step in &mut steps {
        let (from, to) = (&step.unloaded, &step.loaded);
        let enlarged = |from: &[f64], to: &[f64]| -> Vec<f64> {
            let each = from.iter().zip(to);
            each.map(|(unloaded, loaded)| unloaded + factor * (loaded - unloaded))
                .collect()
        };
        let rest = AtRest {
            q_rad: enlarged(&from.q_rad, &to.q_rad),
            coordinates: enlarged(&from.coordinates, &to.coordinates),
            place_m: Vector3::zeros(),
        };
        step.enlargement = factor;
        step.enlarged = stage.stance(rest);
        step.enlarged.tool_m = stage.state.site(site).0;
        let force_n = step.load.force_n;
        step.force_arrow_m = (force_n.norm() > 0.0).then(|| force_n * (FORCE_ARROW_M / largest_n));
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
