//! What both recordings show: the virtual robot in every experiment and test pose, unloaded and
//! loaded, with the measurements and results.

mod annotations;
mod bodies;
mod steps;

use nalgebra::{Isometry3, Vector3};

use crate::calibration::CalibrationError;
use crate::laboratory::Costs;
use crate::mujoco::Mesh;
use crate::record::messages::ProvenanceMessage;
use crate::record::run::{ReadOnce, RunMessage};
use crate::robot::Commands;
use crate::scenario::Scenario;
use crate::study::carried_out::CarriedOutRow;
use crate::text::wording::joined;
pub use annotations::{Annotation, SightLine};
use bodies::bodies;
pub use bodies::{LAST_SHOWN_GROUP, drawn, is_moved};
use steps::{Stage, steps};

/// Half of what is in view, upwards and across, over the distance; and how much farther away the eye is, since arms are thick.
const IN_VIEW: [f64; 2] = [0.52, 0.65];
const FARTHER: f64 = 1.25;

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
    /// How long work takes.
    pub costs: Costs,
    /// How the robot is commanded.
    pub commands: Commands,
    /// The unit of the compliances as they are shown.
    pub compliance_unit: String,
    /// Whether lines of sight are known, and whether a gauge reads.
    pub has_sights: [bool; 2],
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
    /// Plan, readings and results.
    pub record: RunMessage,
    /// The experiments, repeats left out, then the test poses.
    pub steps: Vec<Step>,
}

/// One experiment or test pose.
#[derive(Debug, Clone)]
pub struct Step {
    /// What it is, for people.
    pub title: String,
    /// The number of the experiment, or of the row of absolute readings, in the plan from 1; none of a test pose.
    pub number: Option<usize>,
    /// The tool that is mounted.
    pub tool: ShownTool,
    /// Whether another one was mounted before, or none.
    pub changes_tool: bool,
    /// What the robot did.
    pub did: CarriedOutRow,
    /// The arm without load, at a test pose where it is wanted; under the load; and loaded with its joints' deflections enlarged, as it is
    /// drawn.
    pub arms: [ShownArm; 3],
    /// How many times the deflections are enlarged.
    pub enlargement: f64,
    /// Its force as an arrow (m), if there is one: the largest of all steps with the same tool has a fixed length.
    pub force_arrow_m: Option<Vector3<f64>>,
    /// How it is read, if somebody says.
    pub sight: Option<SightLine>,
}

/// The arm standing somewhere.
#[derive(Debug, Clone)]
pub struct ShownArm {
    /// The pose of each of [`Recording::links`] in the world frame.
    pub world_from_link: Vec<Isometry3<f64>>,
    /// The tool's position (m).
    pub tool_m: Vector3<f64>,
}

impl Step {
    /// The load in words: "2500 N", "300 N and 20 N m"; none without one.
    pub fn load_label(&self) -> Option<String> {
        let load = &self.did.load;
        let parts = [(load.force_n, "N"), (load.torque_nm, "N m")].into_iter();
        let parts = parts.filter(|(part, _)| part.norm() > 0.0);
        let parts = parts.map(|(part, unit)| format!("{:.0} {unit}", part.norm()));
        let words = joined(parts, " and ");
        (!words.is_empty()).then_some(words)
    }
}

impl RecordedCalibration {
    /// What was read in a step, one after the other; nothing at a test pose.
    pub fn read_in(&self, step: &Step) -> impl Iterator<Item = ReadOnce<'_>> {
        let number = step.number.unwrap_or_default();
        self.record.read_in(number, step.did.readings.clone())
    }
}

impl Recording {
    /// Puts the virtual robot into every experiment or row of each plan, and into the test poses.
    ///
    /// # Errors
    /// See [`CalibrationError`]; none that the plans did not have already.
    pub fn new(scenario: &Scenario, plans: &[RunMessage]) -> Result<Self, CalibrationError> {
        let belief = &scenario.task.belief;
        let (surroundings, links) = bodies(scenario)?;
        let rows = plans.iter().flat_map(|plan| &plan.did.rows);
        let mut experiments = Stage::new(scenario, &links, ShownTool::Calibration, rows)?;
        let rows = plans.iter().flat_map(|plan| plan.did.test_poses.iter());
        let mut test_poses = Stage::new(scenario, &links, ShownTool::Machining, rows.flatten())?;
        let calibration = |plan: &RunMessage| RecordedCalibration {
            record: plan.clone(),
            steps: steps(plan, &mut experiments, &mut test_poses),
        };
        let calibrations: Vec<_> = plans.iter().map(calibration).collect();
        let steps = || calibrations.iter().flat_map(|each| &each.steps);
        let has = |is_gauge| {
            let mut sights = steps().filter_map(|step| step.sight);
            sights.any(|sight| sight.is_gauge == is_gauge)
        };
        Ok(Self {
            provenance: ProvenanceMessage::new(scenario),
            description: scenario.description.clone(),
            joints: scenario.truth.robot.joint_names(),
            surroundings,
            links,
            costs: scenario.laboratory.costs,
            commands: belief.commands(),
            compliance_unit: belief.compliance_unit("1e-6"),
            has_sights: [false, true].map(has),
            calibrations,
        })
    }

    /// Whether there is a robot to show: of a study all of whose plans fail there is none.
    pub const fn shows_robot(&self) -> bool {
        !self.calibrations.is_empty()
    }

    /// From where (m) all arms are in view, and the place (m) to look at: across the way from the base to the tools, from somewhat above.
    pub fn eye_m(&self) -> Option<[Vector3<f64>; 2]> {
        let arms = || self.steps().map(|(.., step)| &step.arms[0]);
        let places = arms().flat_map(|arm| {
            let links = arm.world_from_link.iter();
            let links = links.map(|pose| pose.translation.vector);
            links.chain([arm.tool_m])
        });
        let places: Vec<Vector3<f64>> = places.collect();
        let all = || places.iter().copied();
        let low = all().reduce(|one, other| one.inf(&other))?;
        let high = all().reduce(|one, other| one.sup(&other))?;
        let centre = (low + high) / 2.0;
        let reach: Vector3<f64> = arms().map(|arm| arm.tool_m).sum();
        let aside = Vector3::new(reach.y, -reach.x, 0.0).try_normalize(f64::MIN_POSITIVE);
        let towards = (aside.unwrap_or(-Vector3::y()) + Vector3::z() * 0.4).normalize();
        let across = Vector3::z().cross(&towards).normalize();
        let axes = [towards.cross(&across), across];
        let needed = places.iter().map(|place| {
            let seen = axes.map(|axis| axis.dot(&(place - centre)).abs());
            let away = (seen[0] / IN_VIEW[0]).max(seen[1] / IN_VIEW[1]);
            away + towards.dot(&(place - centre))
        });
        let away_m = FARTHER * needed.fold(0.1, f64::max);
        Some([centre + towards * away_m, centre])
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
