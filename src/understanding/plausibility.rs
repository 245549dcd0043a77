//! What is allowed in a scenario and nevertheless likely to be a mistake.
//!
//! All thresholds are here. They are far outside of what robots are: a warning should be right.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector, Vector3};

use super::{Understanding, UnderstoodPose, bent as bent_at};
use crate::codes::{Condition, ConditionCode};
use crate::compensation::test_pose_rows;
use crate::experiment::Loads;
use crate::robot::{EquilibriumError, Joint, Load};
use crate::scenario::Scenario;
use crate::task::{AccuracyKind, Task, TestPose};
use crate::text::wording::in_um;

/// A robot that sags or bends by more than this at its tool (m) ...
const BENT_M: f64 = 0.05;
/// ... or in a joint (rad) has a simulation's gains for stiffnesses.
const BENT_RAD: f64 = 0.035;
/// A task load that moves the tool by less (m) bends nothing that could be compensated.
const RIGID_M: f64 = 1e-8;
/// What is unknown bends nothing where it moves the tool by less (m): rounding makes as much of zero.
const NOTHING_M: f64 = 1e-15;
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
    let (nominal, truth) = (&scenario.task.belief.nominal, &scenario.truth.robot);
    let doubts = scenario.doubts.iter().map(|each| each.text.clone());
    let mut warnings: Vec<String> = doubts.collect();
    for model in [&nominal.model, &truth.model] {
        for what in model.left_out() {
            let warning = format!("{}: {what}", model.path().display());
            if !warnings.contains(&warning) {
                warnings.push(warning);
            }
        }
    }
    warnings.extend(sizes(understood));
    warnings.extend(impossible(scenario, understood).map(|each| each.text));
    warnings.extend(ranges(scenario));
    let joints = &nominal.chain.joints;
    let soft = compliances("robot", joints, &nominal.compliance_rad_per_nm);
    let is_soft = soft.is_some();
    warnings.extend(soft);
    if truth.compliance_rad_per_nm != nominal.compliance_rad_per_nm {
        let given = &truth.compliance_rad_per_nm;
        warnings.extend(compliances("true_robot", joints, given));
    }
    let poses = scenario.task.test_poses.iter().zip(&understood.poses);
    for (index, (pose, bends)) in poses.enumerate() {
        warnings.extend(radians_for_degrees(scenario, index));
        // What a wrong unit does to the deflection is no news.
        warnings.extend(bent(understood, bends).filter(|_| !is_soft));
        warnings.extend(rigid(bends).filter(|_| pose.load.wrench().norm() > 0.0));
    }
    warnings.extend(pointless(&scenario.task));
    warnings.extend(instrument(scenario));
    // What another mistake does to the deflection is no news, either.
    if warnings.is_empty() {
        warnings.extend(hardly_bent(scenario).map(|each| each.text));
    }
    warnings.extend(upward(&scenario.task).map(|each| each.text));
    warnings
}

/// What every command that relies on a scenario's loads says of them, and of a prior of unknown origin.
pub fn implausible(scenario: &Scenario) -> Vec<Condition> {
    hardly_bent(scenario)
        .chain(upward(&scenario.task))
        .chain(scenario.of_unknown_origin())
        .collect()
}

/// Test poses where the load's effect is within the instrument's noise.
fn hardly_bent(scenario: &Scenario) -> impl Iterator<Item = Condition> {
    let sigma_m = scenario.task.belief.instrument.sigma_m;
    scenario.task.test_poses.iter().filter_map(move |pose| {
        let moved = bent_at(scenario, pose).ok()?.task_load_m.norm();
        (moved < sigma_m && pose.load != Load::NONE).then(|| {
            ConditionCode::SmallDeflection.with(format!(
                "at {:?} the task load moves the tool by {} um, less than sigma = {} um of the instrument: is the load in \
                 another unit, such as kN?",
                pose.name,
                in_um(moved, 3),
                in_um(sigma_m, 3)
            ))
        })
    })
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
        ConditionCode::UpwardLoad.with(
            "load: the force points against gravity, where no weight pulls: is its sign wrong?",
        )
    })
}

/// Why the robot does not stand at a test pose.
pub fn collapse(scenario: &Scenario) -> Option<String> {
    let falls = |pose: &TestPose| Some(no_rest(&pose.name, &bent_at(scenario, pose).err()?));
    scenario.task.test_poses.iter().find_map(falls)
}

/// Why compensation has nothing to find out: nothing that is unknown bends the tool at the test poses, so that no plan is better than another.
pub fn pointless(task: &Task) -> Option<String> {
    let sizes = DVector::from_vec(task.belief.sizes());
    let bent_m = |pose: &TestPose| {
        let rows = test_pose_rows(&task.belief, pose);
        (rows * DMatrix::from_diagonal(&sizes)).norm()
    };
    let is_relative = task.design.accuracy == AccuracyKind::Relative;
    (is_relative && task.test_poses.iter().all(|pose| bent_m(pose) < NOTHING_M)).then(|| {
        "nothing that is unknown bends the tool under the loads of the test poses: there is nothing to compensate".to_owned()
    })
}

fn no_rest(pose: &str, error: &EquilibriumError) -> String {
    format!(
        "at {pose:?} there is {error}: are the joints' stiffnesses gains for simulation, or in another unit?"
    )
}

/// Lengths, gravity and masses in other units.
fn sizes(understood: &Understanding) -> impl Iterator<Item = String> {
    let moving = (understood.joints.first()).map_or(0.0, |joint| joint.moving_mass_kg);
    let (reach, gravity) = (understood.reach_m, understood.gravity_m_s2.norm());
    let rows = [
        (
            reach > REACH_M,
            format!(
                "the arm reaches {reach:.0} m: are the model's lengths in millimetres? MJCF has metres"
            ),
        ),
        (
            reach <= REACH_M && gravity > GRAVITY_M_S2,
            format!("the model's gravity is {gravity} m/s^2: is it in mm/s^2? MJCF has metres"),
        ),
        (
            moving > MASS_KG,
            format!(
                "the arm moves {moving:.0} kg: do shapes that are drawn weigh, too? MuJoCo gives shapes without a mass that of water; give the bodies an <inertial> and the shapes mass=\"0\""
            ),
        ),
    ];
    rows.into_iter()
        .filter_map(|(holds, sentence)| holds.then_some(sentence))
}

/// Why a model cannot be right: a link's mass lies much further from its joint than the arm reaches, or the robot does not stand at
/// a test pose.
pub fn impossible(scenario: &Scenario, understood: &Understanding) -> Option<Condition> {
    let reach = understood.reach_m;
    let joints = scenario.task.belief.nominal.chain.joints.iter();
    let mut centres = joints.map(|joint| (&joint.name, joint.centre_of_mass_m.norm()));
    match centres.find(|(_, far)| *far > FURTHEST_CENTRE * reach.max(1.0)) {
        Some((name, far)) => Some(ConditionCode::ImpossibleMass.with(format!(
            "the centre of mass of what {name} moves with its link lies {far:.1} m from the joint, and the arm reaches \
             {reach:.1} m: is it in millimetres? MJCF has metres"
        ))),
        None => Some(ConditionCode::NoEquilibrium.with(collapse(scenario)?)),
    }
}

fn ranges(scenario: &Scenario) -> Option<String> {
    let joints = scenario.task.belief.nominal.chain.joints.iter();
    let widest = (joints.filter(|joint| !joint.drive.slides)).map(|joint| {
        (
            joint,
            joint.range_rad[0].abs().max(joint.range_rad[1].abs()),
        )
    });
    if let Some((joint, _)) = widest.clone().find(|each| each.1 > RANGE_RAD) {
        let [low, high] = joint.range_rad.map(f64::to_degrees);
        return Some(format!(
            "{} turns from {low:.0} to {high:.0} deg: is its range in degrees? MuJoCo takes radians under angle=\"radian\", and for a joint with limited=\"false\" always",
            joint.name
        ));
    }
    let widest = widest.map(|each| each.1).reduce(f64::max)?;
    (widest <= TAU.to_radians()).then(|| {
        format!(
            "no joint turns further than {:.2} deg: are the model's ranges in radians? MJCF has degrees without <compiler angle=\"radian\"/>",
            widest.to_degrees()
        )
    })
}

/// The first compliance that is none.
fn compliances(table: &str, joints: &[Joint], compliance_rad_per_nm: &[f64]) -> Option<String> {
    let mut all = joints.iter().zip(compliance_rad_per_nm);
    let (Joint { name, drive, .. }, compliance) =
        all.find(|each| *each.1 > COMPLIANCE_RAD_PER_NM)?;
    let (stiffness, unit) = (compliance.recip(), drive.compliance_unit());
    let inverse = if drive.slides { "N/m" } else { "N m/rad" };
    Some(if *compliance > 1.0 {
        format!(
            "{table}: the compliance of {name} is {compliance} {unit}: is that its stiffness in {inverse}? Then its compliance is {stiffness:.4e}"
        )
    } else {
        format!(
            "{table}: the compliance of {name} is {compliance:.3e} {unit}, a stiffness of {stiffness:.4} {inverse}: is it a gain for simulation, or in another unit? Joints of robots have 1e4 to 1e7 {inverse}"
        )
    })
}

/// A test pose in degrees whose numbers are all small, of joints that turn far.
fn radians_for_degrees(scenario: &Scenario, index: usize) -> Option<String> {
    let pose = &scenario.task.test_poses[index];
    let mut joints = scenario.task.belief.nominal.chain.joints.iter();
    let q_deg = pose.configuration_rad.map(f64::to_degrees);
    let is_written = |angle: &f64| (angle - angle.round()).abs() > 1e-9;
    (q_deg.len() > 1
        && q_deg.iter().all(|angle| angle.abs() <= TAU)
        && q_deg.iter().any(is_written)
        && joints.all(|joint| joint.range_rad[1] - joint.range_rad[0] > TURNS_FURTHER_RAD))
    .then(|| {
        format!(
            "test_pose[{index}].q_deg: all angles of {:?} are within {TAU:.2} deg of zero: are they radians?",
            pose.name
        )
    })
}

/// Whether the robot bends as robots do.
fn bent(understood: &Understanding, pose: &UnderstoodPose) -> Option<String> {
    let bent = match &pose.bent {
        Ok(bent) => bent,
        Err(error) => return Some(no_rest(&pose.name, error)),
    };
    let found = [
        ("its own weight", &bent.own_weight_m, bent.own_weight_joint),
        ("the task load", &bent.task_load_m, bent.task_load_joint),
    ];
    let (what, moved, (joint, turned)) =
        found.into_iter().find(|(_, moved, (joint, turned))| {
            let turns = !understood.joints[*joint].drive.slides;
            moved.norm() > BENT_M || (*turned > BENT_RAD && turns)
        })?;
    let joint = &understood.joints[joint];
    let (turned, unit) = joint.drive.shown(turned);
    let of_stiffness = if joint.drive.slides { "N/m" } else { "N m/rad" };
    Some(format!(
        "at {:?} {what} bends the robot by {:.0} mm, and {} (stiffness {:.4e} {of_stiffness}) by {turned:.1} {unit}: is its actuator's kp a gain for simulation? It must be the joint's stiffness",
        pose.name,
        moved.norm() * 1e3,
        joint.name,
        joint.compliance_rad_per_nm.recip(),
    ))
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

/// An instrument that is too noisy, or that stands in the robot.
fn instrument(scenario: &Scenario) -> Vec<String> {
    let (belief, model) = (&scenario.task.belief, &scenario.task.belief.nominal.model);
    let mut warnings = Vec::new();
    let sigma_m = belief.instrument.sigma_m;
    if sigma_m > SIGMA_M {
        let sigma_mm = sigma_m * 1e3;
        warnings.push(format!(
            "the instrument's noise is {sigma_mm} mm: is it in micrometres?"
        ));
    }
    let Some(site) = belief.instrument.tracker_site else {
        return warnings;
    };
    let (body, _) = model.site_body(site);
    if model.joints_that_move(body) > 0 {
        let body = model.body_name(body);
        warnings.push(format!(
            "instrument.tracker_site is on {body}, which the robot moves"
        ));
        return warnings;
    }
    let mut simulation = crate::mujoco::State::new(model);
    for pose in &scenario.task.test_poses {
        simulation.move_to(pose.configuration_rad.as_slice());
        let (tracker, _) = simulation.site(site);
        let joints = belief.nominal.chain.joints.iter().enumerate();
        let nearest = joints
            .map(|(index, joint)| ((simulation.joint(index).0 - tracker).norm(), &joint.name))
            .min_by(|one, other| one.0.total_cmp(&other.0));
        if let Some((distance, name)) = nearest.filter(|(distance, _)| *distance < TRACKER_M) {
            warnings.push(format!(
                "at {:?} the tracker is {:.0} mm from {name}: is it inside the robot?",
                pose.name,
                distance * 1e3
            ));
        }
    }
    warnings
}
