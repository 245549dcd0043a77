//! What both recordings show: the virtual robot in every experiment and test pose, unloaded and
//! loaded, with the measurements and results.

mod bodies;
mod steps;

use std::ops::Range;

use nalgebra::{DVector, Isometry3, Vector3};

use super::mesh::Mesh;
use crate::calibration::{Calibration, CalibrationError};
use crate::laboratory::Costs;
use crate::record::messages::{CalibrationMessage, ProvenanceMessage};
use crate::robot::{Commands, Load};
use crate::scenario::Scenario;
use bodies::bodies;
pub use bodies::{LAST_SHOWN_GROUP, is_moved};
use steps::{Stage, enlarge};

/// The largest force in experiments, and that in test poses, is drawn this long (m).
const FORCE_ARROW_M: f64 = 0.6;

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
    /// How long work takes.
    pub costs: Costs,
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
    pub only_with: Option<ShownTool>,
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
pub enum ShownTool {
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
    /// How the robot is commanded.
    pub commands: Commands,
    /// The unit of the compliances as they are shown.
    pub compliance_unit: String,
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
    /// MuJoCo's coordinates of all joints (rad, m); more than the angles where the virtual robot is more
    /// than a chain.
    pub coordinates: Vec<f64>,
    /// The pose of each of [`Recording::links`] in the world frame.
    pub world_from_link: Vec<Isometry3<f64>>,
    /// The tool's position (m).
    pub tool_m: Vector3<f64>,
}

impl Step {
    /// The tool that is mounted.
    pub fn tool(&self) -> ShownTool {
        match self.kind {
            StepKind::Experiment { .. } => ShownTool::Calibration,
            StepKind::TestPose { .. } => ShownTool::Machining,
        }
    }

    /// How often the tool is read, without a load and under it.
    pub fn readings(&self) -> usize {
        match &self.kind {
            StepKind::Experiment { measurements, .. } => measurements.len(),
            StepKind::TestPose { .. } => 1,
        }
    }

    /// The deflection of the tool as it is drawn, in words.
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
    pub fn load_label(&self) -> String {
        let (force, torque) = (self.load.force_n.norm(), self.load.torque_nm.norm());
        match (force > 0.0, torque > 0.0) {
            (_, false) => format!("{force:.0} N"),
            (false, true) => format!("{torque:.0} N m"),
            (true, true) => format!("{force:.0} N and {torque:.0} N m"),
        }
    }

    /// Loaded minus unloaded position of the tool (m), true to scale and without the instrument's errors.
    pub fn displacement_m(&self) -> Vector3<f64> {
        self.loaded.tool_m - self.unloaded.tool_m
    }
}

impl RecordedCalibration {
    /// A vector of a measurement (mm) as far as it is read: whole, or of a gauge what is along its direction.
    pub fn as_read(
        &self,
        measurement: usize,
        vector_mm: [f64; 3],
    ) -> (Option<[f64; 3]>, Option<f64>) {
        let direction = (self.record.measurements.get(measurement)).and_then(|each| each.direction);
        match direction {
            Some(along) => (
                None,
                Some(Vector3::from(along).dot(&Vector3::from(vector_mm))),
            ),
            None => (Some(vector_mm), None),
        }
    }

    /// What a step is, for people.
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
    /// Puts the virtual robot of each named calibration's run into every experiment and test pose.
    ///
    /// # Errors
    /// See [`CalibrationError`]; none that the calibrations did not have already.
    pub fn new(
        scenario: &Scenario,
        calibrations: &[(String, Calibration)],
    ) -> Result<Self, CalibrationError> {
        let (surroundings, links) = bodies(scenario)?;
        let mut stage = Stage::new(&scenario.truth.robot.model, &links);
        let mut recorded = Vec::new();
        let commands = scenario.task.belief.commands();
        for (name, calibration) in calibrations {
            let steps = steps::steps(scenario, calibration, &mut stage)?;
            recorded.push(RecordedCalibration {
                record: CalibrationMessage::new(&commands, name, calibration),
                commands: commands.clone(),
                compliance_unit: scenario.task.belief.compliance_unit("1e-6"),
                steps,
            });
        }
        for tool in [ShownTool::Calibration, ShownTool::Machining] {
            enlarge(scenario, tool, &mut recorded, &mut stage)?;
        }
        Ok(Self {
            provenance: ProvenanceMessage::new(scenario),
            description: scenario.description.clone(),
            joints: scenario.truth.robot.joint_names(),
            surroundings,
            links,
            tracker_m: scenario
                .task
                .belief
                .instrument
                .tracker_site
                .map(|site| stage.place(site)),
            costs: scenario.laboratory.costs,
            calibrations: recorded,
        })
    }

    /// Whether there is a robot to show: plans of absolute readings have no calibration here.
    pub const fn shows_robot(&self) -> bool {
        !self.calibrations.is_empty()
    }

    /// The force of a step as an arrow (m), if there is one: the largest of all steps with the same
    /// tool has a fixed length.
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
            (calibration.steps.iter()).map(move |step| (calibration, step))
        });
        (1..)
            .zip(steps)
            .map(|(number, (calibration, step))| (number, calibration, step))
    }
}

fn tool_name(scenario: &Scenario, tool: ShownTool) -> &str {
    match tool {
        ShownTool::Calibration => &scenario.task.belief.calibration_tool.name,
        ShownTool::Machining => &scenario.task.belief.machining_tool.name,
    }
}
