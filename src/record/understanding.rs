//! The record of a robot as it was understood: what `check` prints.

use nalgebra::Vector3;
use serde::Serialize;

use crate::understanding::{Bent, Understanding, UnderstoodTruth, Unknowns};

/// What `check` understood of a scenario.
#[derive(Debug, Clone, Serialize)]
pub struct UnderstandingMessage {
    /// The robot.
    pub robot: RobotMessage,
    /// The robot at each test pose.
    pub test_poses: Vec<PoseMessage>,
    /// The virtual robot, where its model is more than a chain.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub true_robot: Option<TrueRobotMessage>,
    /// What is likely to be a mistake.
    pub warnings: Vec<String>,
}

/// A robot.
#[derive(Debug, Clone, Serialize)]
pub struct RobotMessage {
    /// Its joints from the base to the flange.
    pub joints: Vec<JointMessage>,
    /// The longest way from the first joint to a tool along the links (mm).
    pub reach_mm: f64,
    /// The size of gravity's acceleration (m/s^2).
    pub gravity_m_s2: f64,
}

/// A virtual robot that is more than a chain.
#[derive(Debug, Clone, Serialize)]
pub struct TrueRobotMessage {
    /// Why its model is no belief.
    pub reason: String,
    /// What it obeys and a belief would refuse.
    pub beyond_belief: Vec<String>,
    /// How far its equality constraints give way.
    pub gives_way: Vec<GivingWayMessage>,
}

/// An equality constraint that gives way.
#[derive(Debug, Clone, Serialize)]
pub struct GivingWayMessage {
    /// The element of the model.
    pub element: String,
    /// How far (mm), where it ties places.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance_mm: Option<f64>,
    /// How far (deg), where it ties angles, or a weld's orientation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub angle_deg: Option<f64>,
}

impl TrueRobotMessage {
    fn new(truth: &UnderstoodTruth) -> Self {
        let gives_way = truth.gives_way.iter().map(|each| GivingWayMessage {
            element: each.element.clone(),
            distance_mm: (!each.is_angle).then_some(each.distance * 1e3),
            angle_deg: (each.is_angle.then_some(each.distance))
                .or(each.weld_rad)
                .map(f64::to_degrees),
        });
        Self {
            reason: truth.reason.clone(),
            beyond_belief: truth.beyond_belief.clone(),
            gives_way: gives_way.collect(),
        }
    }
}

/// A joint.
#[derive(Debug, Clone, Serialize)]
pub struct JointMessage {
    /// Its name.
    pub name: String,
    /// The range of its commanded angle (deg), or length (mm) for one that slides.
    pub range_deg: [f64; 2],
    /// Whether it slides; stiffness and compliance are then in N/m and m/N.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub slides: bool,
    /// Whether it is passive: nothing commands it.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub passive: bool,
    /// Its stiffness (N m/rad); `null` where it is rigid.
    pub stiffness_nm_per_rad: Option<f64>,
    /// Its compliance (rad/(N m)).
    pub compliance_rad_per_nm: f64,
    /// Whether its compliance is identified.
    pub identified: bool,
    /// The mass that it moves (kg).
    pub moving_mass_kg: f64,
}

/// The robot at a test pose.
#[derive(Debug, Clone, Serialize)]
pub struct PoseMessage {
    /// The pose's name.
    pub name: String,
    /// The calibration tool's position at the commanded angles (mm).
    pub calibration_tool_mm: [f64; 3],
    /// The machining tool's position at the commanded angles (mm).
    pub machining_tool_mm: [f64; 3],
    /// The direction in the world frame along which alone the error counts; `null` where all of it does.
    pub direction: Option<[f64; 3]>,
    /// The machining tool's motion under the robot's own weight (mm); `null` where nothing holds it.
    pub own_weight_mm: Option<[f64; 3]>,
    /// The largest turn of a joint under the own weight (deg).
    pub own_weight_deg: Option<f64>,
    /// The machining tool's further motion under the task load (mm).
    pub task_load_mm: Option<[f64; 3]>,
    /// The largest turn of a joint under the task load (deg).
    pub task_load_deg: Option<f64>,
}

impl UnderstandingMessage {
    /// The record of what was understood.
    pub fn new(understanding: &Understanding) -> Self {
        let joints = understanding.joints.iter().map(|joint| JointMessage {
            name: joint.name.clone(),
            range_deg: joint.range_rad.map(|value| joint.drive.shown(value).0),
            slides: joint.drive.slides,
            passive: joint.drive.passive_at.is_some(),
            stiffness_nm_per_rad: Some(joint.compliance_rad_per_nm.recip())
                .filter(|stiffness| stiffness.is_finite()),
            compliance_rad_per_nm: joint.compliance_rad_per_nm,
            identified: joint.is_parameter,
            moving_mass_kg: joint.moving_mass_kg,
        });
        let turn = |(joint, moved): (usize, f64)| {
            let slides = understanding.joints[joint].drive.slides;
            (!slides).then(|| moved.to_degrees())
        };
        let poses = understanding.poses.iter().map(|pose| {
            let bent = pose.bent.as_ref().ok();
            let moved = |motion: fn(&Bent) -> Vector3<f64>| bent.map(motion).map(millimetres);
            PoseMessage {
                name: pose.name.clone(),
                calibration_tool_mm: millimetres(pose.calibration_tool_m),
                machining_tool_mm: millimetres(pose.machining_tool_m),
                direction: pose.direction.map(Into::into),
                own_weight_mm: moved(|bent| bent.own_weight_m),
                own_weight_deg: bent.and_then(|bent| turn(bent.own_weight_joint)),
                task_load_mm: moved(|bent| bent.task_load_m),
                task_load_deg: bent.and_then(|bent| turn(bent.task_load_joint)),
            }
        });
        Self {
            robot: RobotMessage {
                joints: joints.collect(),
                reach_mm: understanding.reach_m * 1e3,
                gravity_m_s2: understanding.gravity_m_s2,
            },
            test_poses: poses.collect(),
            true_robot: understanding.truth.as_ref().map(TrueRobotMessage::new),
            warnings: understanding.warnings.clone(),
        }
    }
}

fn millimetres(position_m: Vector3<f64>) -> [f64; 3] {
    (position_m * 1e3).into()
}

/// What one kind of reading at the calibration tool can tell of a robot, if all of it were unknown.
#[derive(Debug, Clone, Serialize)]
pub struct UnknownsMessage {
    /// `deflection`, `position` or `pose`.
    pub reading: String,
    /// The number of parameters that were asked about.
    pub parameters: usize,
    /// A largest set of them that can be determined together.
    pub minimal_set: Vec<String>,
    /// The others.
    pub redundant: Vec<RedundantMessage>,
}

/// A parameter that can be left out without loss.
#[derive(Debug, Clone, Serialize)]
pub struct RedundantMessage {
    /// The parameter.
    pub parameter: String,
    /// Whether that follows from the robot's structure, and not from what is read.
    pub structural: bool,
    /// Why.
    pub reason: String,
}

impl From<&Unknowns> for UnknownsMessage {
    fn from(unknowns: &Unknowns) -> Self {
        Self {
            reading: unknowns.reading.name().to_owned(),
            parameters: unknowns.names.len(),
            minimal_set: unknowns.minimal().into_iter().map(str::to_owned).collect(),
            redundant: (unknowns.freedoms.iter())
                .map(|each| RedundantMessage {
                    parameter: unknowns.names[each.redundant].clone(),
                    structural: each.is_structural,
                    reason: each.sentence.clone(),
                })
                .collect(),
        }
    }
}
