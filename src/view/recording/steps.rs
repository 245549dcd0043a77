//! What the virtual robot does in each experiment and test pose.

use nalgebra::Isometry3;

use super::{Body, ShownArm, ShownTool, SightLine, Step, tool_name};
use crate::calibration::CalibrationError;
use crate::mujoco::State;
use crate::record::run::{MeasuredMessage, RunMessage};
use crate::scenario::Scenario;
use crate::study::carried_out::CarriedOutRow;
use crate::task::Instrument;

/// The largest deflection of experiments, and that of test poses, is drawn about this long (m).
const DRAWN_DEFLECTION_M: f64 = 0.25;

/// The largest force in experiments, and that in test poses, is drawn this long (m).
const FORCE_ARROW_M: f64 = 0.6;

/// A simulation that is put where the virtual robot has been seen with one tool. All its steps are drawn to one scale, so that they can be
/// compared.
pub(super) struct Stage {
    state: State,
    links: Vec<usize>,
    instrument: Instrument,
    tool: ShownTool,
    site: usize,
    /// How many times deflections are enlarged.
    enlargement: f64,
    /// The largest force (N).
    largest_n: f64,
}

impl Stage {
    /// For links and for rows as they were carried out.
    pub(super) fn new<'r>(
        scenario: &Scenario,
        links: &[Body],
        tool: ShownTool,
        rows: impl Iterator<Item = &'r CarriedOutRow>,
    ) -> Result<Self, CalibrationError> {
        let model = &scenario.truth.robot.model;
        let [mut largest_m, mut largest_n] = [0.0_f64; 2];
        for row in rows {
            largest_m = largest_m.max(row.displacement_m().norm());
            largest_n = largest_n.max(row.load.force_n.norm());
        }
        Ok(Self {
            state: State::new(model),
            links: links.iter().map(|body| body.id).collect(),
            instrument: scenario.task.belief.instrument,
            tool,
            site: model.site(tool_name(scenario, tool))?,
            enlargement: round_factor(DRAWN_DEFLECTION_M / largest_m),
            largest_n,
        })
    }

    /// Where the links of a robot with these coordinates are.
    fn links(&mut self, coordinates: &[f64]) -> Vec<Isometry3<f64>> {
        self.state.set_coordinates(coordinates);
        self.state.update_kinematics();
        let links = self.links.iter();
        links.map(|&body| self.state.body_pose(body)).collect()
    }

    fn step(&mut self, title: String, number: Option<usize>, did: &CarriedOutRow) -> Step {
        // The links of a run's robot are elsewhere by what nobody sees, and the tool is where it was observed.
        let [unloaded, loaded] = did.rests.each_ref().map(|rest| ShownArm {
            world_from_link: self.links(&rest.coordinates),
            tool_m: rest.place_m,
        });
        let sight = SightLine::new(
            &self.instrument,
            &self.state,
            unloaded.tool_m,
            did.direction,
            did.station_m,
        );
        let [from, to] = did.rests.each_ref().map(|rest| &rest.coordinates);
        let each = from.iter().zip(to);
        let enlarged = each.map(|(from, to)| from + self.enlargement * (to - from));
        let enlarged = ShownArm {
            world_from_link: self.links(&enlarged.collect::<Vec<_>>()),
            tool_m: self.state.site(self.site).0,
        };
        let force_n = did.load.force_n;
        let arrow = || force_n * (FORCE_ARROW_M / self.largest_n);
        Step {
            title,
            number,
            tool: self.tool,
            changes_tool: false,
            did: did.clone(),
            arms: [unloaded, loaded, enlarged],
            enlargement: self.enlargement,
            force_arrow_m: (force_n.norm() > 0.0).then(arrow),
            sight: sight.filter(|_| number.is_some()),
        }
    }
}

/// The steps of a plan as it was carried out, on the stages of experiments and of test poses.
pub(super) fn steps(
    record: &RunMessage,
    experiments: &mut Stage,
    test_poses: &mut Stage,
) -> Vec<Step> {
    let did = &record.did;
    let how = match record.measured {
        MeasuredMessage::Deflections { .. } => ["not compensated", "compensated"],
        MeasuredMessage::Readings { .. } => ["by the nominal robot", "by the identified robot"],
    };
    let mut steps: Vec<Step> = Vec::new();
    for (number, row) in (1..).zip(&did.rows) {
        steps.push(experiments.step(record.row_title(number), Some(number), row));
    }
    for (pose, both) in record.test_poses.iter().zip(&did.test_poses) {
        for (how, row) in how.iter().zip(both) {
            let title = format!("test pose {:?}, {how}", pose.name);
            steps.push(test_poses.step(title, None, row));
        }
    }
    let mut mounted = None;
    for step in &mut steps {
        step.changes_tool = mounted.replace(step.tool) != Some(step.tool);
    }
    steps
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
