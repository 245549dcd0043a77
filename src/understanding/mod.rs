//! The robot as the program understands a scenario, and what is implausible about it.
//!
//! Everything here is of the planner's model (the nominal robot), except that the warnings look at the virtual robot, too, and
//! that a virtual robot that is more than a chain is described.

mod plausibility;
mod truth;
mod unknowns;

use nalgebra::Vector3;

use crate::robot::{Drive, EquilibriumError, EquilibriumSolver, Load, SerialChain, Spring, Tool};
use crate::scenario::Scenario;
use crate::task::TestPose;

pub use plausibility::{collapse, implausible, impossible, pointless};
pub use truth::UnderstoodTruth;
pub use unknowns::{Unknowns, unknowns};

/// What a scenario was understood to say.
#[derive(Debug, Clone, PartialEq)]
pub struct Understanding {
    /// The joints from the base to the flange.
    pub joints: Vec<UnderstoodJoint>,
    /// The springs between places of the arm.
    pub springs: Vec<Spring>,
    /// The joints that the scenario locks, each with its coordinate (deg, mm) and unit.
    pub locked: Vec<(String, f64, &'static str)>,
    /// The longest way from the first joint to a tool along the links (m).
    pub reach_m: f64,
    /// Gravity's acceleration in the world frame (m/s^2).
    pub gravity_m_s2: Vector3<f64>,
    /// The robot at each test pose.
    pub poses: Vec<UnderstoodPose>,
    /// The virtual robot, where it is more than a chain.
    pub truth: Option<UnderstoodTruth>,
    /// What is allowed and nevertheless likely to be a mistake, with what it may come from.
    pub warnings: Vec<String>,
}

/// A joint as it was understood.
#[derive(Debug, Clone, PartialEq)]
pub struct UnderstoodJoint {
    /// Its name.
    pub name: String,
    /// How it moves, and what holds it.
    pub drive: Drive,
    /// The range of its commanded angle (rad, m), as the scenario's region narrows it.
    pub range_rad: [f64; 2],
    /// Its compliance (rad/(N m)).
    pub compliance_rad_per_nm: f64,
    /// Whether its compliance is identified.
    pub is_parameter: bool,
    /// The mass that it moves (kg), whether or not the model compensates its weight.
    pub moving_mass_kg: f64,
}

/// The robot at a test pose.
#[derive(Debug, Clone, PartialEq)]
pub struct UnderstoodPose {
    /// The pose's name.
    pub name: String,
    /// The calibration tool's position at the commanded angles (m, world frame).
    pub calibration_tool_m: Vector3<f64>,
    /// The machining tool's position at the commanded angles (m, world frame).
    pub machining_tool_m: Vector3<f64>,
    /// The direction in the world frame along which alone the error counts, where there is one.
    pub direction: Option<Vector3<f64>>,
    /// What bends there, or why nothing holds.
    pub bent: Result<Bent, EquilibriumError>,
}

/// How far a robot bends at a pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Bent {
    /// The machining tool's motion under the robot's own weight, from the commanded angles (m).
    pub own_weight_m: Vector3<f64>,
    /// The joint that turns most under the own weight, and its angle (rad); where all slide, which slides
    /// most (m).
    pub own_weight_joint: (usize, f64),
    /// The machining tool's motion under the task load, beside the own weight (m).
    pub task_load_m: Vector3<f64>,
    /// The same under the task load.
    pub task_load_joint: (usize, f64),
}

impl Understanding {
    /// What a scenario says of its robot.
    pub fn new(scenario: &Scenario) -> Self {
        let chain = &scenario.task.belief.nominal.chain;
        let mut understanding = Self {
            joints: joints(scenario),
            springs: chain.elements.springs.clone(),
            locked: locked(scenario),
            reach_m: [
                &scenario.task.belief.calibration_tool,
                &scenario.task.belief.machining_tool,
            ]
            .map(|tool| chain.reach_m(tool))
            .into_iter()
            .fold(0.0, f64::max),
            gravity_m_s2: chain.gravity_m_s2,
            poses: (scenario.task.test_poses.iter())
                .map(|pose| understood_pose(scenario, pose))
                .collect(),
            truth: UnderstoodTruth::new(scenario),
            warnings: Vec::new(),
        };
        understanding.warnings = plausibility::warnings(scenario, &understanding);
        let of_truth = (understanding.truth.iter()).flat_map(UnderstoodTruth::warnings);
        let of_truth: Vec<String> = of_truth.collect();
        understanding.warnings.extend(of_truth);
        understanding
    }
}

fn joints(scenario: &Scenario) -> Vec<UnderstoodJoint> {
    let robot = &scenario.task.belief.nominal;
    let mut moving = vec![0.0; robot.chain.len()];
    // Bodies come in the order of the tree, and joints are numbered along the series.
    for body in 0..robot.model.bodies() {
        let carried_by = robot.model.joints_that_move(body);
        for mass in &mut moving[..carried_by] {
            *mass += robot.model.mass(body).0;
        }
    }
    (robot.chain.joints.iter().enumerate())
        .map(|(index, joint)| UnderstoodJoint {
            name: joint.name.clone(),
            drive: joint.drive,
            range_rad: scenario.task.region.joint_range_rad[index],
            compliance_rad_per_nm: robot.compliance_rad_per_nm[index],
            is_parameter: scenario.task.belief.parameters.contains(&index),
            moving_mass_kg: moving[index],
        })
        .collect()
}

fn locked(scenario: &Scenario) -> Vec<(String, f64, &'static str)> {
    let model = &scenario.task.belief.nominal.model;
    let locked = model.locked().iter().map(|&(joint, value)| {
        let slides = model.is_slide(joint);
        let drive = Drive {
            slides,
            ..Drive::default()
        };
        let (shown, unit) = drive.shown(value);
        (model.joint_name(joint), shown, unit)
    });
    locked.collect()
}

fn understood_pose(scenario: &Scenario, pose: &TestPose) -> UnderstoodPose {
    let q = pose.configuration_rad.as_slice();
    let chain = &scenario.task.belief.nominal.chain;
    let place = |tool: &Tool| chain.at(tool).state(q).tool_position;
    UnderstoodPose {
        name: pose.name.clone(),
        calibration_tool_m: place(&scenario.task.belief.calibration_tool),
        machining_tool_m: place(&scenario.task.belief.machining_tool),
        direction: pose.direction,
        bent: bent(scenario, pose),
    }
}

fn bent(scenario: &Scenario, pose: &TestPose) -> Result<Bent, EquilibriumError> {
    let robot = &scenario.task.belief.nominal;
    let commanded = pose.configuration_rad.as_slice();
    let mut arm = robot.chain.at(&scenario.task.belief.machining_tool);
    let mut solver = EquilibriumSolver::new(commanded.len());
    let mut rest = |load: &Load| {
        solver.solve(&mut arm, &robot.compliance_rad_per_nm, commanded, load)?;
        let state = solver.state();
        Ok((
            (solver.q().to_vec(), state.tool_position),
            state.tool_rotation,
        ))
    };
    let ((unloaded, unloaded_m), _) = rest(&Load::NONE)?;
    let (loaded, loaded_m) = pose.at_rest(&pose.load, rest)?;
    let commanded_m = arm.state(commanded).tool_position;
    Ok(Bent {
        own_weight_m: unloaded_m - commanded_m,
        own_weight_joint: largest_turn(&robot.chain, &unloaded, commanded),
        task_load_m: loaded_m - unloaded_m,
        task_load_joint: largest_turn(&robot.chain, &loaded, &unloaded),
    })
}

/// The joint whose angles differ most, and by how much (rad); where all slide, by their lengths (m).
fn largest_turn(chain: &SerialChain, to: &[f64], from: &[f64]) -> (usize, f64) {
    let slides = |joint: usize| chain.joints[joint].drive.slides;
    let all_slide = (0..chain.len()).all(slides);
    let turns = to.iter().zip(from).map(|(to, from)| (to - from).abs());
    let turns = (turns.enumerate()).filter(|turn| all_slide || !slides(turn.0));
    let larger = |most: (usize, f64), turn: (usize, f64)| if turn.1 > most.1 { turn } else { most };
    turns.reduce(larger).unwrap_or((0, 0.0))
}
