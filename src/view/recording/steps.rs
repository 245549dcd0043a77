//! What the virtual robot does in each experiment and test pose.

use nalgebra::Vector3;

use super::{Body, ReadingLine, RecordedCalibration, ShownTool, Stance, Step, StepKind, tool_name};
use crate::calibration::CalibrationError;
use crate::mujoco::State;
use crate::scenario::Scenario;
use crate::study::carried_out::{AtRest, CarriedOut, CarriedOutRow};
use crate::task::Instrument;

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

    fn step(&mut self, kind: StepKind, row: &CarriedOutRow) -> Step {
        let [unloaded, loaded] = row.rests.clone().map(|rest| self.stance(rest));
        let is_read = matches!(kind, StepKind::Experiment { .. });
        let sight = ReadingLine::new(&self.instrument, &self.state, row.direction, row.station_m);
        Step {
            kind,
            commanded_rad: row.commanded_rad.clone(),
            load: row.load,
            enlargement: 1.0,
            enlarged: loaded.clone(),
            unloaded,
            loaded,
            force_arrow_m: None,
            sight: sight.filter(|_| is_read),
        }
    }

    /// The steps of a plan as it was carried out.
    pub(super) fn steps(&mut self, did: &CarriedOut) -> Vec<Step> {
        let rows = (1..).zip(&did.rows).map(|(number, row)| {
            let measurements = row.readings.clone();
            (
                StepKind::Experiment {
                    number,
                    measurements,
                },
                row,
            )
        });
        let poses = did.test_poses.iter().enumerate().flat_map(|(index, both)| {
            let kind = |compensated| StepKind::TestPose { index, compensated };
            [false, true].map(kind).into_iter().zip(both)
        });
        (rows.chain(poses))
            .map(|(kind, row)| self.step(kind, row))
            .collect()
    }
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
