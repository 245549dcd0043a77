//! What the virtual robot does in each experiment and test pose.

use nalgebra::Vector3;

use super::{Body, ReadingLine, RecordedCalibration, ShownArm, ShownTool, Step, tool_name};
use crate::calibration::CalibrationError;
use crate::mujoco::State;
use crate::record::run::{MeasuredMessage, RunMessage};
use crate::scenario::Scenario;
use crate::study::carried_out::{CarriedOut, CarriedOutRow};
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

    /// The arm of a virtual robot at rest: the links of a run's robot are elsewhere by what nobody sees, and the tool is where it was
    /// observed.
    fn arm(&mut self, coordinates: &[f64], tool_m: Vector3<f64>) -> ShownArm {
        self.state.set_coordinates(coordinates);
        self.state.update_kinematics();
        let links = self.links.iter();
        ShownArm {
            world_from_link: links.map(|&body| self.state.body_pose(body)).collect(),
            tool_m,
        }
    }

    fn step(&mut self, title: String, number: Option<usize>, did: &CarriedOutRow) -> Step {
        let arms = (did.rests.each_ref()).map(|rest| self.arm(&rest.coordinates, rest.place_m));
        let sight = ReadingLine::new(&self.instrument, &self.state, did.direction, did.station_m);
        let [unloaded, loaded] = arms;
        Step {
            title,
            number,
            did: did.clone(),
            arms: [unloaded, loaded.clone(), loaded],
            enlargement: 1.0,
            force_arrow_m: None,
            sight: sight.filter(|_| number.is_some()),
        }
    }

    /// The steps of a plan as it was carried out.
    pub(super) fn steps(&mut self, record: &RunMessage, did: &CarriedOut) -> Vec<Step> {
        let how = match record.measured {
            MeasuredMessage::Deflections { .. } => ["not compensated", "compensated"],
            MeasuredMessage::Readings { .. } => ["by the nominal robot", "by the identified robot"],
        };
        let mut steps = Vec::new();
        for (number, row) in (1..).zip(&did.rows) {
            steps.push(self.step(record.row_title(number), Some(number), row));
        }
        for (pose, both) in record.test_poses.iter().zip(&did.test_poses) {
            for (how, row) in how.iter().zip(both) {
                let title = format!("test pose {:?}, {how}", pose.name);
                steps.push(self.step(title, None, row));
            }
        }
        steps
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
    let forces_n = steps.iter().map(|step| step.did.load.force_n.norm());
    let largest_n = forces_n.fold(0.0, f64::max);
    for step in &mut steps {
        let [from, to] = &step.did.rests;
        let each = from.coordinates.iter().zip(&to.coordinates);
        let enlarged = each.map(|(unloaded, loaded)| unloaded + factor * (loaded - unloaded));
        let enlarged: Vec<f64> = enlarged.collect();
        step.enlargement = factor;
        step.arms[2] = stage.arm(&enlarged, Vector3::zeros());
        step.arms[2].tool_m = stage.state.site(site).0;
        let force_n = step.did.load.force_n;
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
