//! What both recordings show: the virtual robot in every experiment and test pose, unloaded and
//! loaded, with the measurements and results.

use std::ops::Range;

use nalgebra::{DVector, Isometry3, Vector3};

use super::mesh::Mesh;
use super::messages::{CalibrationMessage, ProvenanceMessage};
use crate::calibration::{Calibration, CalibrationError};
use crate::mujoco::{Geometry, Model, Shape, State};
use crate::robot::{EquilibriumError, Load};
use crate::scenario::{Scenario, TestPose};
use crate::testbed::{MeasurementError, VirtualRobot};

/// Geometries of the model in groups up to this one are drawn, as MuJoCo does by default.
const LAST_SHOWN_GROUP: i32 = 2;
/// The group of the tool that is not mounted; drawn where that tool is at work.
const UNMOUNTED_GROUP: i32 = 3;
/// The largest deflection of experiments, and that of test poses, is drawn about this long (m).
const DRAWN_DEFLECTION_M: f64 = 0.25;
/// The largest force in experiments, and that in test poses, is drawn this long (m).
const FORCE_ARROW_M: f64 = 0.6;
/// What a plane looks like if its colour comes from a texture, which is not drawn.
const FLOOR_RGBA: [f32; 4] = [0.60, 0.62, 0.65, 1.0];

/// One calibration or several of one scenario, ready to be written.
#[derive(Debug, Clone)]
pub struct Recording {
    /// Where it comes from.
    pub provenance: ProvenanceMessage,
    /// One line on the scenario.
    pub description: String,
    /// The names of the joints.
    pub joints: Vec<String>,
    /// What does not move, in the world frame.
    pub surroundings: Vec<Body>,
    /// What the joints move, each in its own frame, from the base to the tools.
    pub links: Vec<Body>,
    /// Where the tracker stands (m), if the scenario has one.
    pub tracker_m: Option<Vector3<f64>>,
    /// The calibrations; the first is the main one.
    pub calibrations: Vec<RecordedCalibration>,
}

/// A body of the model with all that is drawn of it.
#[derive(Debug, Clone)]
pub struct Body {
    /// Its name in the model.
    pub name: String,
    /// Its index in the model.
    pub id: usize,
    /// The tool that it belongs to, if it is drawn only while that tool is mounted.
    pub only_with: Option<MountedTool>,
    /// Its surfaces.
    pub surfaces: Vec<Surface>,
}

/// A surface in one colour.
#[derive(Debug, Clone)]
pub struct Surface {
    /// Red, green, blue and opacity in 0 to 1.
    pub rgba: [f32; 4],
    /// The triangles.
    pub mesh: Mesh,
}

/// The tool that the robot carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MountedTool {
    /// The calibration tool, in experiments.
    Calibration,
    /// The machining tool, in test poses.
    Machining,
}

/// One calibration with what the robot did.
#[derive(Debug, Clone)]
pub struct RecordedCalibration {
    /// Plan, measurements and results under the name of the plan.
    pub record: CalibrationMessage,
    /// The experiments, repeats left out, then the test poses.
    pub steps: Vec<Step>,
}

/// One experiment or test pose.
#[derive(Debug, Clone)]
pub struct Step {
    /// Which one.
    pub kind: StepKind,
    /// The commanded joint angles (rad).
    pub commanded_rad: DVector<f64>,
    /// The load, in the world frame at the tool.
    pub load: Load,
    /// Where the robot stands without load; at a test pose, where it is wanted.
    pub unloaded: Stance,
    /// Where it stands under the load.
    pub loaded: Stance,
    /// How many times the deflections of the joints are enlarged in `enlarged`.
    pub enlargement: f64,
    /// The loaded arm with its joints' deflections enlarged, as it is drawn.
    pub enlarged: Stance,
}

/// What a step is.
#[derive(Debug, Clone, PartialEq)]
pub enum StepKind {
    /// An experiment of the plan.
    Experiment {
        /// Its number in the plan, from 1.
        number: usize,
        /// Its measurements among those of the calibration.
        measurements: Range<usize>,
    },
    /// A test pose.
    TestPose {
        /// Its place among the test poses.
        index: usize,
        /// Whether the command is compensated.
        compensated: bool,
    },
}

/// The arm standing somewhere.
#[derive(Debug, Clone)]
pub struct Stance {
    /// The joint angles (rad).
    pub q_rad: Vec<f64>,
    /// The pose of each of [`Recording::links`] in the world frame.
    pub world_from_link: Vec<Isometry3<f64>>,
    /// The tool's position (m).
    pub tool_m: Vector3<f64>,
}

impl Step {
    /// The tool that is mounted.
    #[must_use]
    pub fn tool(&self) -> MountedTool {
        match self.kind {
            StepKind::Experiment { .. } => MountedTool::Calibration,
            StepKind::TestPose { .. } => MountedTool::Machining,
        }
    }

    /// The deflection of the tool as it is drawn, in words.
    #[must_use]
    pub fn displacement_label(&self) -> String {
        let micrometres = self.displacement_m().norm() * 1e6;
        let length = if micrometres < 100.0 {
            format!("{micrometres:.1} µm")
        } else {
            format!("{:.3} mm", micrometres * 1e-3)
        };
        format!("{length} (drawn {} times as long)", self.enlargement)
    }

    /// The load in words: "2500 N", "300 N and 20 N m".
    #[must_use]
    pub fn load_label(&self) -> String {
        let (force, torque) = (self.load.force_n.norm(), self.load.torque_nm.norm());
        match (force > 0.0, torque > 0.0) {
            (_, false) => format!("{force:.0} N"),
            (false, true) => format!("{torque:.0} N m"),
            (true, true) => format!("{force:.0} N and {torque:.0} N m"),
        }
    }

    /// Loaded minus unloaded position of the tool (m), true to scale and without noise.
    #[must_use]
    pub fn displacement_m(&self) -> Vector3<f64> {
        self.loaded.tool_m - self.unloaded.tool_m
    }
}

impl RecordedCalibration {
    /// What a step is, for people.
    #[must_use]
    pub fn title(&self, step: &Step) -> String {
        match &step.kind {
            StepKind::Experiment { number, .. } => {
                format!("experiment {number} of {}", self.record.plan.len())
            }
            StepKind::TestPose { index, compensated } => {
                let name = &self.record.test_poses[*index].name;
                let how = if *compensated {
                    "compensated"
                } else {
                    "not compensated"
                };
                format!("test pose {name:?}, {how}")
            }
        }
    }
}

impl Recording {
    /// Puts the scenario's virtual robot into every experiment and test pose of the named
    /// calibrations.
    ///
    /// # Errors
    /// See [`CalibrationError`]; none that the calibrations did not have already.
    pub fn new(
        scenario: &Scenario,
        calibrations: &[(String, Calibration)],
    ) -> Result<Self, CalibrationError> {
        let (surroundings, links) = bodies(scenario)?;
        let mut stage = Stage {
            state: State::new(&scenario.true_robot.model),
            links: links.iter().map(|body| body.id).collect(),
        };
        let mut recorded = Vec::new();
        for (name, calibration) in calibrations {
            let mut steps = experiment_steps(scenario, calibration, &mut stage)?;
            steps.extend(test_pose_steps(scenario, calibration, &mut stage)?);
            recorded.push(RecordedCalibration {
                record: CalibrationMessage::new(name, calibration),
                steps,
            });
        }
        for tool in [MountedTool::Calibration, MountedTool::Machining] {
            enlarge(scenario, tool, &mut recorded, &mut stage)?;
        }
        Ok(Self {
            provenance: ProvenanceMessage::new(scenario),
            description: scenario.description.clone(),
            joints: (scenario.true_robot.chain.joints.iter())
                .map(|joint| joint.name.clone())
                .collect(),
            surroundings,
            links,
            tracker_m: scenario
                .instrument
                .tracker_site
                .map(|site| stage.state.site(site).0),
            calibrations: recorded,
        })
    }

    /// The force of a step as an arrow (m), if there is one: the largest of all steps with the same
    /// tool has a fixed length.
    #[must_use]
    pub fn force_arrow_m(&self, step: &Step) -> Option<Vector3<f64>> {
        let largest_n = self
            .steps()
            .filter(|(_, _, other)| other.tool() == step.tool())
            .map(|(_, _, other)| other.load.force_n.norm())
            .fold(0.0, f64::max);
        (step.load.force_n.norm() > 0.0).then(|| step.load.force_n * (FORCE_ARROW_M / largest_n))
    }

    /// Every step of every calibration, numbered from 1 in the order in which they are shown.
    pub fn steps(&self) -> impl Iterator<Item = (u32, &RecordedCalibration, &Step)> {
        let steps = self.calibrations.iter().flat_map(|calibration| {
            calibration
                .steps
                .iter()
                .map(move |step| (calibration, step))
        });
        (1..)
            .zip(steps)
            .map(|(number, (calibration, step))| (number, calibration, step))
    }
}

/// A simulation that is put where the virtual robot has been seen.
struct Stage {
    state: State,
    links: Vec<usize>,
}

impl Stage {
    fn stance(&mut self, q_rad: &[f64], site: usize) -> Stance {
        self.state.move_to(q_rad);
        Stance {
            q_rad: q_rad.to_vec(),
            world_from_link: (self.links.iter())
                .map(|&body| self.state.body_pose(body))
                .collect(),
            tool_m: self.state.site(site).0,
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
        Ok(self.stance(robot.joint_angles(), site))
    }
}

fn experiment_steps(
    scenario: &Scenario,
    calibration: &Calibration,
    stage: &mut Stage,
) -> Result<Vec<Step>, CalibrationError> {
    let tool = &scenario.calibration_tool.name;
    let site = scenario.true_robot.model.site(tool)?;
    let mut robot = VirtualRobot::new(&scenario.true_robot, tool)?;
    let mut first = 0;
    let mut steps = Vec::new();
    for (number, experiment) in (1..).zip(&calibration.plan.experiments) {
        let measurements = first..first + experiment.repeats as usize;
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

fn test_pose_steps(
    scenario: &Scenario,
    calibration: &Calibration,
    stage: &mut Stage,
) -> Result<Vec<Step>, CalibrationError> {
    let tool = &scenario.machining_tool.name;
    let site = scenario.true_robot.model.site(tool)?;
    let mut robot = VirtualRobot::new(&scenario.true_robot, tool)?;
    let mut steps = Vec::new();
    let poses = scenario.test_poses.iter().zip(&calibration.poses);
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
fn enlarge(
    scenario: &Scenario,
    tool: MountedTool,
    calibrations: &mut [RecordedCalibration],
    stage: &mut Stage,
) -> Result<(), CalibrationError> {
    let site = scenario.true_robot.model.site(tool_name(scenario, tool))?;
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
        let q: Vec<_> = step
            .unloaded
            .q_rad
            .iter()
            .zip(&step.loaded.q_rad)
            .map(|(unloaded, loaded)| unloaded + factor * (loaded - unloaded))
            .collect();
        step.enlargement = factor;
        step.enlarged = stage.stance(&q, site);
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

fn tool_name(scenario: &Scenario, tool: MountedTool) -> &str {
    match tool {
        MountedTool::Calibration => &scenario.calibration_tool.name,
        MountedTool::Machining => &scenario.machining_tool.name,
    }
}

/// The bodies that stand still and those that the joints move, with their surfaces.
fn bodies(scenario: &Scenario) -> Result<(Vec<Body>, Vec<Body>), CalibrationError> {
    let model = &scenario.true_robot.model;
    let tool_body = |tool| -> Result<usize, CalibrationError> {
        Ok(model.site_body(model.site(tool_name(scenario, tool))?).0)
    };
    let calibration = tool_body(MountedTool::Calibration)?;
    let machining = tool_body(MountedTool::Machining)?;
    // A tool is unmounted only where it is a body of its own.
    let only_with = |body| match body {
        _ if calibration == machining => None,
        body if body == calibration && !carries(model, body, machining) => {
            Some(MountedTool::Calibration)
        }
        body if body == machining && !carries(model, body, calibration) => {
            Some(MountedTool::Machining)
        }
        _ => None,
    };
    let mut state = State::new(model);
    state.move_to(&vec![0.0; model.joints()]);
    let scenery = model.scenery();
    let (mut surroundings, mut links) = (Vec::new(), Vec::new());
    for id in 0..model.bodies() {
        let moves = moves(model, id);
        let world_from_frame = if moves {
            state.body_pose(id)
        } else {
            Isometry3::identity()
        };
        let shown = |each: &&Geometry| {
            model.geometry_body(each.id) == id
                && (each.group <= LAST_SHOWN_GROUP
                    || each.group == UNMOUNTED_GROUP && only_with(id).is_some())
        };
        let surfaces: Vec<_> = scenery
            .iter()
            .filter(shown)
            .map(|each| Surface {
                rgba: colour(each),
                mesh: Mesh::new(&each.shape)
                    .transformed(&world_from_frame.inv_mul(&state.geometry_pose(each.id))),
            })
            .collect();
        if surfaces.is_empty() {
            continue;
        }
        let body = Body {
            name: model.body_name(id),
            id,
            only_with: only_with(id),
            surfaces,
        };
        if moves { &mut links } else { &mut surroundings }.push(body);
    }
    Ok((surroundings, links))
}

/// The model's colour, except that of a textured plane, which would be plain white.
fn colour(geometry: &Geometry) -> [f32; 4] {
    let white = geometry.rgba.iter().all(|share| *share >= 1.0);
    if geometry.shape == Shape::Plane && white {
        FLOOR_RGBA
    } else {
        geometry.rgba
    }
}

/// Whether a joint moves the body.
fn moves(model: &Model, mut body: usize) -> bool {
    while body != 0 {
        if model.joints_of(body).next().is_some() {
            return true;
        }
        body = model.parent(body);
    }
    false
}

/// Whether one body is another's ancestor.
fn carries(model: &Model, body: usize, mut other: usize) -> bool {
    while other != 0 {
        other = model.parent(other);
        if other == body {
            return true;
        }
    }
    false
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
