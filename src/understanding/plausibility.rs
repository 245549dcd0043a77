//! What is allowed in a scenario and nevertheless likely to be a mistake.
//!
//! All thresholds are here. They are far outside of what robots are: a warning should be right.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::{Understanding, UnderstoodJoint, UnderstoodPose, bent as bent_at};
use crate::codes::{Condition, ConditionCode};
use crate::experiment::Loads;
use crate::robot::{EquilibriumError, Load};
use crate::scenario::Scenario;
use crate::task::{Task, TestPose};

/// A robot that sags or bends by more than this at its tool (m) ...
const BENT_M: f64 = 0.05;
/// ... or in a joint (rad) has a simulation's gains for stiffnesses.
const BENT_RAD: f64 = 0.035;
/// A task load that moves the tool by less (m) bends nothing that could be compensated.
const RIGID_M: f64 = 1e-8;
/// A compliance above this (rad/(N m)) is a stiffness in N m/rad, or in another unit.
const COMPLIANCE_RAD_PER_NM: f64 = 1e-3;
/// No arm is longer than this (m); one in millimetres is.
const REACH_M: f64 = 30.0;
/// Nor has it gravity above this (m/s^2).
const GRAVITY_M_S2: f64 = 20.0;
/// No arm moves more than this (kg); one whose drawn shapes weigh does.
const MASS_KG: f64 = 2500.0;
/// No centre of mass lies further from its joint than so many times the arm's reach.
const FURTHEST_CENTRE: f64 = 2.0;
/// No joint turns further than this (rad); one whose degrees are taken for radians does.
const RANGE_RAD: f64 = 17.5;
/// Angles in degrees that all lie in one turn of radians, of joints that turn further than this (rad), are
/// likely to be radians.
const TURNS_FURTHER_RAD: f64 = 0.6;
/// A tracker nearer than this (m) to a joint of the robot at a test pose stands in the robot.
const TRACKER_M: f64 = 0.3;
/// A force of which more than this share points against gravity points upwards.
const UPWARD: f64 = 0.7;
/// An instrument with more noise than this (m) measures no deflections.
const SIGMA_M: f64 = 1e-3;

/// What is implausible about a scenario, in whole sentences.
pub(super) fn warnings(scenario: &Scenario, understood: &Understanding) -> Vec<String> {
    let mut warnings = scenario.doubts.clone();
    let models = [
        &scenario.task.belief.nominal.model,
        &scenario.truth.robot.model,
    ];
    for model in models {
        for what in model.left_out() {
            let warning = format!("{}: {what}", model.path().display());
            if !warnings.contains(&warning) {
                warnings.push(warning);
            }
        }
    }
    warnings.extend(lengths(understood));
    warnings.extend(masses(understood));
    warnings.extend(impossible(scenario, understood).map(|each| each.text));
    warnings.extend(ranges(scenario));
    let (nominal, truth) = (&scenario.task.belief.nominal, &scenario.truth.robot);
    let names: Vec<String> = (understood.joints.iter())
        .map(|joint| joint.name.clone())
        .collect();
    let soft = compliances("robot", &names, &nominal.compliance_rad_per_nm);
    let is_soft = soft.is_some();
    warnings.extend(soft);
    if truth.compliance_rad_per_nm != nominal.compliance_rad_per_nm {
        let given = &truth.compliance_rad_per_nm;
        warnings.extend(compliances("true_robot", &truth.joint_names(), given));
    }
    for (index, pose) in understood.poses.iter().enumerate() {
        warnings.extend(radians_for_degrees(scenario, index));
        // What a wrong unit does to the deflection is no news.
        if !is_soft {
            warnings.extend(bent(&understood.joints, pose));
        }
        let loaded = scenario.task.test_poses[index].load.wrench().norm() > 0.0;
        if loaded {
            warnings.extend(rigid(pose));
        }
    }
    warnings.extend(instrument(scenario));
    // What another mistake does to the deflection is no news, either.
    if warnings.is_empty() {
        warnings.extend(hardly_bent(scenario).into_iter().map(|each| each.text));
    }
    warnings.extend(upward(&scenario.task).map(|each| each.text));
    warnings
}

/// What every command that relies on a scenario's loads says of them.
pub fn implausible(scenario: &Scenario) -> Vec<Condition> {
    (hardly_bent(scenario).into_iter())
        .chain(upward(&scenario.task))
        .collect()
}

/// Test poses where the load's effect is within the instrument's noise.
fn hardly_bent(scenario: &Scenario) -> Vec<Condition> {
    let task = &scenario.task;
    let sigma_m = task.belief.instrument.sigma_m;
    let said = |pose: &TestPose| {
        let moved = bent_at(scenario, pose).ok()?.task_load_m.norm();
        (moved < sigma_m && pose.load != Load::NONE).then(|| {
            ConditionCode::SmallDeflection.with(format!(
                "at {:?} the task load moves the tool by {:.3} um, less than sigma = {:.3} um of the instrument: is the load in \
                 another unit, such as kN?",
                pose.name,
                moved * 1e6,
                sigma_m * 1e6
            ))
        })
    };
    task.test_poses.iter().filter_map(said).collect()
}

/// Loads of which none hangs.
fn upward(task: &Task) -> Option<Condition> {
    let gravity = task.belief.nominal.chain.gravity_m_s2;
    let is_up = |force_n: &Vector3<f64>| {
        force_n.dot(&gravity) < -UPWARD * force_n.norm() * gravity.norm() && force_n.norm() > 0.0
    };
    let all_up = match &task.loads {
        Loads::Fixed(load) => is_up(&load.force_n),
        Loads::Direction { direction, .. } => is_up(direction),
        Loads::List(loads) => !loads.is_empty() && loads.iter().all(|load| is_up(&load.force_n)),
        Loads::Any { .. } => false,
    };
    all_up.then(|| {
        let text =
            "load: the force points upwards, where no weight pulls: is its sign wrong? z is up";
        ConditionCode::UpwardLoad.with(text)
    })
}

/// Why the robot does not stand at a test pose.
pub fn collapse(scenario: &Scenario) -> Option<String> {
    let falls = |pose: &TestPose| {
        let error = bent_at(scenario, pose).err()?;
        Some(no_rest(&pose.name, &error))
    };
    scenario.task.test_poses.iter().find_map(falls)
}

fn no_rest(pose: &str, error: &EquilibriumError) -> String {
    format!(
        "at {pose:?} there is {error}: are the joints' stiffnesses gains for simulation, or in another unit?"
    )
}

fn lengths(understood: &Understanding) -> Option<String> {
    if understood.reach_m > REACH_M {
        return Some(format!(
            "the arm reaches {:.0} m: are the model's lengths in millimetres? MJCF has metres",
            understood.reach_m
        ));
    }
    (understood.gravity_m_s2 > GRAVITY_M_S2).then(|| {
        format!(
            "the model's gravity is {} m/s^2: is it in mm/s^2? MJCF has metres",
            understood.gravity_m_s2
        )
    })
}

fn masses(understood: &Understanding) -> Option<String> {
    let moving = understood.joints.first()?.moving_mass_kg;
    (moving > MASS_KG).then(|| {
        format!(
            "the arm moves {moving:.0} kg: do shapes that are drawn weigh, too? MuJoCo gives shapes without a mass that of water; give the bodies an <inertial> and the shapes mass=\"0\""
        )
    })
}

/// Why a model cannot be right: a link's mass lies much further from its joint than the arm reaches, or the robot does not stand at
/// a test pose.
pub fn impossible(scenario: &Scenario, understood: &Understanding) -> Option<Condition> {
    let falls = || Some(ConditionCode::NoEquilibrium.with(collapse(scenario)?));
    impossible_mass(scenario, understood).or_else(falls)
}

fn impossible_mass(scenario: &Scenario, understood: &Understanding) -> Option<Condition> {
    let joints = &scenario.task.belief.nominal.chain.joints;
    let furthest = FURTHEST_CENTRE * understood.reach_m.max(1.0);
    let joint = (joints.iter()).find(|joint| joint.centre_of_mass_m.norm() > furthest)?;
    Some(ConditionCode::ImpossibleMass.with(format!(
        "the centre of mass of what {} moves with its link lies {:.1} m from the joint, and the arm reaches {:.1} m: is it in \
         millimetres? MJCF has metres",
        joint.name,
        joint.centre_of_mass_m.norm(),
        understood.reach_m
    )))
}

fn ranges(scenario: &Scenario) -> Option<String> {
    let joints = &scenario.task.belief.nominal.chain.joints;
    let joints = || joints.iter().filter(|joint| !joint.drive.slides);
    let far = |range: &[f64; 2]| range[0].abs().max(range[1].abs());
    if let Some(joint) = joints().find(|joint| far(&joint.range_rad) > RANGE_RAD) {
        let [low, high] = joint.range_rad.map(f64::to_degrees);
        return Some(format!(
            "{} turns from {low:.0} to {high:.0} deg: is its range in degrees? MuJoCo takes radians under angle=\"radian\", and for a joint with limited=\"false\" always",
            joint.name
        ));
    }
    let widest = joints()
        .map(|joint| far(&joint.range_rad))
        .reduce(f64::max)?;
    (widest <= TAU.to_radians()).then(|| {
        format!(
            "no joint turns further than {:.2} deg: are the model's ranges in radians? MJCF has degrees without <compiler angle=\"radian\"/>",
            widest.to_degrees()
        )
    })
}

/// The first compliance that is none.
fn compliances(table: &str, names: &[String], compliance_rad_per_nm: &[f64]) -> Option<String> {
    let joint = (compliance_rad_per_nm.iter())
        .position(|&compliance| compliance > COMPLIANCE_RAD_PER_NM)?;
    let compliance = compliance_rad_per_nm[joint];
    let name = &names[joint];
    let stiffness = compliance.recip();
    Some(if compliance > 1.0 {
        format!(
            "{table}: the compliance of {name} is {compliance} rad/(N m): is that its stiffness in N m/rad? Then its compliance is {stiffness:.4e}"
        )
    } else {
        format!(
            "{table}: the compliance of {name} is {compliance:.3e} rad/(N m), a stiffness of {stiffness:.4} N m/rad: is it a gain for simulation, or in another unit? Joints of robots have 1e4 to 1e7 N m/rad"
        )
    })
}

/// A test pose in degrees whose numbers are all small, of joints that turn far.
fn radians_for_degrees(scenario: &Scenario, index: usize) -> Option<String> {
    let pose = &scenario.task.test_poses[index];
    let joints = &scenario.task.belief.nominal.chain.joints;
    let q_deg = pose.configuration_rad.map(f64::to_degrees);
    let written = |angle: f64| (angle - angle.round()).abs() > 1e-9;
    let small =
        q_deg.iter().all(|angle| angle.abs() <= TAU) && q_deg.iter().any(|&angle| written(angle));
    let turn_far =
        (joints.iter()).all(|joint| joint.range_rad[1] - joint.range_rad[0] > TURNS_FURTHER_RAD);
    (small && turn_far && q_deg.len() > 1).then(|| {
        format!(
            "test_pose[{index}].q_deg: all angles of {:?} are within {TAU:.2} deg of zero: are they radians?",
            pose.name
        )
    })
}

/// Whether the robot bends as robots do.
fn bent(joints: &[UnderstoodJoint], pose: &UnderstoodPose) -> Option<String> {
    const GAIN: &str =
        "is its actuator's kp a gain for simulation? It must be the joint's stiffness";
    let bent = match &pose.bent {
        Ok(bent) => bent,
        Err(error) => {
            return Some(no_rest(&pose.name, error));
        }
    };
    [
        ("its own weight", &bent.own_weight_m, bent.own_weight_joint),
        ("the task load", &bent.task_load_m, bent.task_load_joint),
    ]
    .into_iter()
    .find(|(_, moved, (joint, turned))| {
        moved.norm() > BENT_M || (*turned > BENT_RAD && !joints[*joint].drive.slides)
    })
    .map(|(what, moved, (joint, turned))| {
        let UnderstoodJoint {
            name,
            compliance_rad_per_nm,
            drive,
            ..
        } = &joints[joint];
        let (turned, unit) = drive.shown(turned);
        let of_stiffness = if drive.slides { "N/m" } else { "N m/rad" };
        format!(
            "at {:?} {what} bends the robot by {:.0} mm, and {name} (stiffness {:.4e} {of_stiffness}) by {turned:.1} {unit}: {GAIN}",
            pose.name,
            moved.norm() * 1e3,
            compliance_rad_per_nm.recip(),
        )
    })
}

fn rigid(pose: &UnderstoodPose) -> Option<String> {
    let moved = pose.bent.as_ref().ok()?.task_load_m.norm();
    (moved < RIGID_M).then(|| {
        format!(
            "at {:?} the task load bends the robot by {:.1e} mm: are the compliances in another unit, or is the load?",
            pose.name,
            moved * 1e3
        )
    })
}

fn instrument(scenario: &Scenario) -> Vec<String> {
    let mut warnings = Vec::new();
    let sigma_m = scenario.task.belief.instrument.sigma_m;
    if sigma_m > SIGMA_M {
        warnings.push(format!(
            "the instrument's noise is {} mm: is it in micrometres?",
            sigma_m * 1e3
        ));
    }
    let Some(site) = scenario.task.belief.instrument.tracker_site else {
        return warnings;
    };
    let model = &scenario.task.belief.nominal.model;
    let (body, _) = model.site_body(site);
    if model.joints_that_move(body) > 0 {
        warnings.push(format!(
            "instrument.tracker_site is on {}, which the robot moves",
            model.body_name(body)
        ));
        return warnings;
    }
    let mut simulation = crate::mujoco::State::new(model);
    for pose in &scenario.task.test_poses {
        simulation.move_to(pose.configuration_rad.as_slice());
        let (tracker, _) = simulation.site(site);
        let near = (scenario.task.belief.nominal.chain.joints.iter().enumerate())
            .map(|(index, joint)| ((simulation.joint(index).0 - tracker).norm(), joint))
            .min_by(|one, other| one.0.total_cmp(&other.0))
            .filter(|(distance, _)| *distance < TRACKER_M);
        if let Some((distance, joint)) = near {
            warnings.push(format!(
                "at {:?} the tracker is {:.0} mm from {}: is it inside the robot?",
                pose.name,
                distance * 1e3,
                joint.name
            ));
        }
    }
    warnings
}
