//! A scenario: everything that a calibration study needs to know, read from one TOML file.
//!
//! [`Scenario::load`] either gives a scenario in which everything is consistent (the models are
//! compiled, every site exists, every number is finite and in SI units), or one error that names
//! the file, the key, what was found and what is allowed.

mod check;
mod file;
mod fingerprint;
mod gate;

use std::path::PathBuf;

use nalgebra::DVector;

use crate::mujoco::Model;
use crate::plan::{Criterion, Plan};
use crate::robot::{Load, SerialChain, Tool, TrueRobot};

pub use crate::experiment::Loads;
pub use file::{Level, LoadKind, Method, SigmaOf};
pub use fingerprint::Fingerprint;
pub use gate::{Direction, Gate, Quantity, Tolerance};

/// A robot: its model, and its joints' compliances.
#[derive(Debug, Clone)]
pub struct Robot {
    /// The MJCF model.
    pub model: Model,
    /// The serial chain read from it.
    pub chain: SerialChain,
    /// The compliance of every joint (rad/(N m)).
    pub compliance_rad_per_nm: Vec<f64>,
}

/// A compliance below this share of the largest says "as good as rigid", and is no measure of what the
/// joint's could be.
const RIGID: f64 = 1e-3;
/// A compliance (rad/(N m)) that stands in where all are zero: that of a small servo, since too large a
/// size only makes the decision on what is determined more generous.
const COMPLIANT: f64 = 1e-2;

impl Robot {
    /// The virtual robot that is just what is believed.
    #[must_use]
    pub fn as_believed(&self) -> TrueRobot {
        let compliance = self.compliance_rad_per_nm.clone();
        TrueRobot::of_chain(self.model.clone(), self.chain.clone(), compliance)
    }

    /// The typical sizes of the compliances of some joints (rad/(N m)), which make them comparable: their
    /// values; for a joint that is held to be rigid, or nearly so, the largest of all.
    #[must_use]
    pub fn typical_rad_per_nm(&self, joints: &[usize]) -> Vec<f64> {
        let all = &self.compliance_rad_per_nm;
        let largest = all.iter().copied().fold(0.0, f64::max);
        let instead = if largest > 0.0 { largest } else { COMPLIANT };
        let typical = |&joint: &usize| match all[joint] {
            value if value > RIGID * largest => value,
            _ => instead,
        };
        joints.iter().map(typical).collect()
    }
}

/// How deflections are measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instrument {
    /// The standard deviation of each coordinate of a deflection (m).
    pub sigma_m: f64,
    /// The standard deviation of each coordinate of a rotation (rad), where rotations are measured.
    pub rotation_sigma_rad: Option<f64>,
    /// The site of the model where the tracker stands.
    pub tracker_site: Option<usize>,
}

/// A test pose (D3): where the robot must machine.
#[derive(Debug, Clone, PartialEq)]
pub struct TestPose {
    /// Its name.
    pub name: String,
    /// The configuration `q_0` (rad).
    pub configuration_rad: DVector<f64>,
    /// The task load `W_0`, in the world frame at the machining tool.
    pub load: Load,
    /// Its weight among the test poses; the weights sum to one.
    pub weight: f64,
}

/// Where experiments are possible.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// The commanded angle of each joint lies in this range (rad).
    pub joint_range_rad: Vec<[f64; 2]>,
    /// Lower and upper bound of the calibration tool's height above the floor, `p_z` of Table 3 (m).
    pub tool_height_m: [Option<f64>; 2],
    /// Lower and upper bound of the calibration tool's distance from axis 1, r of Table 3 (m).
    pub tool_radius_m: [Option<f64>; 2],
    /// Upper bound of the elevation of the tool's z axis over the horizontal, phi of Table 3 (rad).
    pub tool_elevation_max_rad: Option<f64>,
    /// Upper bounds of the joint torques under load and gravity (N m).
    pub joint_torque_max_nm: Option<Vec<f64>>,
    /// Robot, tool and surroundings stay this far apart (m), unloaded and loaded.
    pub collision_clearance_m: Option<f64>,
    /// Whether the tracker must see the reflector at the calibration tool.
    pub line_of_sight: bool,
    /// Configurations to keep away from.
    pub forbidden: Vec<Forbidden>,
}

/// A configuration to keep away from.
#[derive(Debug, Clone, PartialEq)]
pub struct Forbidden {
    /// The configuration (rad).
    pub configuration_rad: DVector<f64>,
    /// Some joint must differ by more than this (rad).
    pub within_rad: f64,
}

/// What the search for a plan needs to know.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    /// The number m of measurements.
    pub experiments: u32,
    /// The number of different configurations, where it is bounded.
    pub configurations: Option<u32>,
    /// Experiments that every plan must contain; they count among its measurements.
    pub mandatory: Plan,
}

/// A plan that the scenario brings.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlanFile {
    /// Its name.
    pub name: String,
    /// The plan file.
    pub path: PathBuf,
}

/// Which plans a Monte Carlo study compares, and over how many runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Study {
    /// The number of runs.
    pub trials: u64,
    /// What the runs are made of.
    pub level: Level,
    /// The virtual robot's compliances vary from run to run about those of the true robot, log-normally:
    /// the standard deviation of each joint's logarithm.
    pub compliance_spread: Vec<f64>,
    /// The conditions that every plan is studied under.
    pub conditions: Vec<Conditions>,
    /// The plans.
    pub plans: Vec<StudyPlan>,
}

/// Conditions of a study, which a sweep varies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conditions {
    /// The standard deviation of each coordinate of a deflection (m).
    pub sigma_m: f64,
    /// The number M of measurements that every plan is repeated to.
    pub experiments: u32,
    /// All calibration loads are so many times what the scenario and its plans say.
    pub load_scale: f64,
}

/// A plan of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyPlan {
    /// Its name.
    pub name: String,
    /// Where it comes from.
    pub source: StudySource,
}

/// Where a plan of a study comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum StudySource {
    /// A plan file, repeated as a whole.
    File(Plan),
    /// The best plan of m measurements, repeated as a whole.
    Optimal {
        /// What makes it good.
        criterion: Criterion,
        /// The number of different configurations, where it is bounded.
        configurations: Option<u32>,
        /// The number m of measurements that are designed; as many as are made if not given.
        experiments: Option<u32>,
    },
    /// One random feasible plan for all runs.
    Random,
    /// A fresh random feasible plan in every run.
    RandomEach,
}

impl StudySource {
    /// Whether whole repetitions of the plan make up so many measurements.
    #[must_use]
    pub fn fits(&self, experiments: u32) -> bool {
        let once = match self {
            Self::File(plan) => plan.measurements(),
            Self::Optimal { experiments, .. } => experiments.unwrap_or(1),
            Self::Random | Self::RandomEach => 1,
        };
        once > 0 && experiments.is_multiple_of(once)
    }
}

/// A checked scenario, in SI units.
#[derive(Debug, Clone)]
pub struct Scenario {
    /// The scenario file.
    pub path: PathBuf,
    /// The files that it names, with those that its models are made of.
    pub files: Vec<PathBuf>,
    /// The file's name without folder and ending; names the output folder.
    pub name: String,
    /// One line on what it is.
    pub description: String,
    /// SHA-256 of the scenario's keys and values, without `[gate]`, and of the bytes of all files that it
    /// names: models with what they include and their meshes and height fields, and plans; in
    /// hexadecimal.
    pub sha256: String,
    /// The seed of all random numbers.
    pub seed: u64,
    /// What the planner and the identification believe.
    pub nominal: Robot,
    /// The virtual robot, which only the testbed sees.
    pub true_robot: TrueRobot,
    /// The tool that carries the reflector and the weight.
    pub calibration_tool: Tool,
    /// The tool that machines.
    pub machining_tool: Tool,
    /// The joints whose compliances are identified, as indices.
    pub parameters: Vec<usize>,
    /// How deflections are measured.
    pub instrument: Instrument,
    /// The method of identification and compensation.
    pub method: Method,
    /// Where the robot must machine.
    pub test_poses: Vec<TestPose>,
    /// The loads that a plan may use.
    pub loads: Loads,
    /// Where experiments are possible.
    pub region: Region,
    /// What the search for a plan needs to know.
    pub design: Design,
    /// The plans that the scenario brings.
    pub plans: Vec<PlanFile>,
    /// Which plans a Monte Carlo study compares.
    pub study: Study,
    /// How much worse results may get.
    pub gate: Gate,
}

impl Scenario {
    /// The number of joints.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.nominal.chain.len()
    }

    /// The scenario under other conditions.
    #[must_use]
    pub fn under(&self, conditions: &Conditions) -> Self {
        let mut scenario = self.clone();
        scenario.instrument.sigma_m = conditions.sigma_m;
        scenario.loads = self.loads.scaled(conditions.load_scale);
        for experiment in &mut scenario.design.mandatory.experiments {
            experiment.load = experiment.load.scaled(conditions.load_scale);
        }
        scenario
    }

    /// The names of the identified joints.
    #[must_use]
    pub fn parameter_names(&self) -> Vec<String> {
        self.parameters
            .iter()
            .map(|&joint| self.nominal.chain.joints[joint].name.clone())
            .collect()
    }
}
