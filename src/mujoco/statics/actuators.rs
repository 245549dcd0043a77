//! Actuators: each joint needs one position actuator, and nothing else may pull.

use mujoco_rs::prelude::MjModel;
use mujoco_rs::wrappers::mj_model::{MjtBias, MjtDisableBit, MjtDyn, MjtGain, MjtObjBase, MjtTrn};

use super::super::Model;
use super::{RefusedElement, Servo, disabled, element};
use crate::mujoco::servo::{acts_on_a_joint, command_range, is_enabled};

/// Ranges of commands that differ by less are the same (rad).
const SAME_RAD: f64 = 1e-9;

fn actuator_element(model: &MjModel, id: usize) -> String {
    element(model, MjtObjBase::mjOBJ_ACTUATOR, "actuator", id)
}

fn joint_element(model: &MjModel, id: usize) -> String {
    element(model, MjtObjBase::mjOBJ_JOINT, "joint", id)
}

/// The actuators that act.
fn acting(model: &MjModel) -> impl Iterator<Item = usize> {
    (0..model.actuator_trntype().len()).filter(|&id| is_enabled(model, id))
}

/// What an actuator acts on must be a joint.
pub(super) fn transmission(robot: &Model) -> Option<RefusedElement> {
    let model = &*robot.inner;
    let id = acting(model).find(|&id| !acts_on_a_joint(model, id))?;
    let target = match model.actuator_trntype()[id] {
        MjtTrn::mjTRN_TENDON => "a tendon",
        MjtTrn::mjTRN_SITE => "a site",
        MjtTrn::mjTRN_BODY => "a body's contacts",
        MjtTrn::mjTRN_SLIDERCRANK => "a slider crank",
        MjtTrn::mjTRN_SO3 => "an orientation",
        _ => "something else",
    };
    Some(RefusedElement::new(
        actuator_element(model, id),
        format!("acts on {target}; the statics know actuators of joints only"),
        "remove it, or disable its group with <option actuatorgroupdisable=\"...\"/>",
    ))
}

/// Each joint must be held by one actuator or, where it is passive, by a spring. A model without any actuator is geometry and masses
/// alone: the scenario then says how the joints are held.
pub(super) fn one_for_each_joint(robot: &Model) -> Option<RefusedElement> {
    let model = &*robot.inner;
    if model.actuator_trntype().is_empty() || robot.ignores_actuators() {
        return None;
    }
    (0..model.jnt_type().len()).find_map(|joint| {
        if robot.locked_at(joint).is_some() {
            return None;
        }
        let servos: Vec<_> = Servo::of(model, joint).collect();
        match servos[..] {
            [_] => None,
            [] if robot.joint_spring(joint).is_some() => None,
            [] => Some(not_held(model, joint)),
            [first, second, ..] => Some(RefusedElement::new(
                actuator_element(model, second.actuator),
                format!(
                    "acts on {} beside {}; one actuator may hold a joint",
                    joint_element(model, joint),
                    actuator_element(model, first.actuator)
                ),
                "leave the one whose kp is the joint's stiffness, and remove the other",
            )),
        }
    })
}

/// A joint without an actuator.
pub(crate) fn not_held(model: &MjModel, joint: usize) -> RefusedElement {
    let name = model.id_to_name(MjtObjBase::mjOBJ_JOINT, joint);
    let idle = (0..model.actuator_trntype().len()).find(|&id| {
        !is_enabled(model, id) && usize::try_from(model.actuator_trnid()[id][0]) == Ok(joint)
    });
    let problem = match idle {
        Some(id) => format!(
            "nothing holds it at its commanded angle: the group of {} is disabled by <option actuatorgroupdisable>",
            actuator_element(model, id)
        ),
        None => "no actuator holds it at its commanded angle".to_owned(),
    };
    let hint = format!(
        "give it one, or a spring (stiffness) if it is passive, or lock it (robot.locked_deg, robot.locked_mm): <actuator><position joint={:?} kp=\"1e6\"/></actuator>, kp being its stiffness in N m/rad, which a scenario's compliance_rad_per_nm replaces",
        name.unwrap_or("...")
    );
    RefusedElement::new(joint_element(model, joint), problem, hint)
}

/// What to write instead of another actuator.
const HINT: &str =
    "write <position joint=\"...\" kp=\"...\"/>, kp being the joint's stiffness in N m/rad";

/// A joint of the virtual robot that is to be commanded.
pub(crate) fn not_commanded(model: &MjModel, joint: usize) -> RefusedElement {
    let refusal = not_held(model, joint);
    let mut position = Servo::of(model, joint).filter(|servo| servo.is_position(model));
    match (position.next(), position.next()) {
        (Some(one), Some(other)) => RefusedElement::new(
            actuator_element(model, other.actuator),
            format!(
                "commands {} beside {}; one position actuator may command a joint",
                joint_element(model, joint),
                actuator_element(model, one.actuator)
            ),
            "leave the one whose kp is the joint's stiffness, and remove the other",
        ),
        _ => refusal,
    }
}

/// An actuator with a state of its own rests where its history says.
pub(super) fn state(robot: &Model) -> Option<RefusedElement> {
    let model = &*robot.inner;
    acting(model).find_map(|id| {
        let refused = |problem: String| {
            Some(RefusedElement::new(actuator_element(model, id), problem, HINT))
        };
        let dynamics = model.actuator_dyntype()[id];
        if dynamics != MjtDyn::mjDYN_NONE || model.actuator_actnum()[id] != 0 {
            return refused("has a state of its own (a filter, an integrator, a muscle or a motor); a position actuator without one is needed".to_owned());
        }
        if model.actuator_delay()[id] != 0.0 || model.actuator_history()[id][0] != 0 {
            return refused("has a delay; a position actuator without one is needed".to_owned());
        }
        if model.actuator_plugin()[id] >= 0 {
            return refused("is a plugin; its force is not known".to_owned());
        }
        None
    })
}

/// The actuator's force must be that of a spring between commanded and actual angle: kp (u - length).
#[expect(
    clippy::float_cmp,
    reason = "a position actuator has the same number twice"
)]
pub(super) fn law(robot: &Model) -> Option<RefusedElement> {
    let model = &*robot.inner;
    acting(model).find_map(|id| {
        let refused = |problem: String| {
            Some(RefusedElement::new(actuator_element(model, id), problem, HINT))
        };
        let gain = model.actuator_gainprm()[id];
        let bias = model.actuator_biasprm()[id];
        if model.actuator_gaintype()[id] != MjtGain::mjGAIN_FIXED
            || model.actuator_biastype()[id] != MjtBias::mjBIAS_AFFINE
            || gain[0] <= 0.0
            || bias[1] != -gain[0]
        {
            return refused(format!(
                "is no position actuator: its force is not kp (command - length) with one positive kp (gainprm {}, biasprm {} {} {})",
                gain[0], bias[0], bias[1], bias[2]
            ));
        }
        let servo = Servo::new(model, id);
        (servo.gear == 0.0 || !servo.gear.is_finite()).then(|| {
            let problem = format!("has the gear {}; it holds nothing", servo.gear);
            RefusedElement::new(actuator_element(model, id), problem, HINT)
        })
    })
}

/// A force that is cut off is no spring's.
pub(super) fn force_limits(robot: &Model) -> Option<RefusedElement> {
    const HINT: &str = "remove it, and bound the joint torques of plans with region.joint_torque_max_nm in the scenario";
    let model = &*robot.inner;
    let actuator = acting(model).find(|&id| model.actuator_forcelimited()[id]);
    if let Some(id) = actuator {
        let [low, high] = model.actuator_forcerange()[id];
        return Some(RefusedElement::new(
            actuator_element(model, id),
            format!(
                "forcerange=\"{low} {high}\" cuts its force off; an elastic joint has no such limit"
            ),
            HINT,
        ));
    }
    let joint = model
        .jnt_actfrclimited()
        .iter()
        .position(|&limited| limited)?;
    let [low, high] = model.jnt_actfrcrange()[joint];
    Some(RefusedElement::new(
        joint_element(model, joint),
        format!(
            "actuatorfrcrange=\"{low} {high}\" (in a URDF: effort) cuts the actuator's force off; an elastic joint has no such limit"
        ),
        HINT,
    ))
}

/// Where commands are clamped inside the joint's range, MuJoCo's arm does not go where it is sent.
pub(super) fn command_limits(robot: &Model) -> Option<RefusedElement> {
    let model = &*robot.inner;
    (0..model.jnt_type().len()).find_map(|joint| {
        let [low, high] = model.jnt_range()[joint];
        let servo = Servo::of(model, joint).next()?;
        let [first, last] = command_range(model, &servo)?;
        let ends = [low, high].map(|end| servo.gear * end);
        let narrower = low < high && (first > low + SAME_RAD || last < high - SAME_RAD);
        narrower.then(|| {
            RefusedElement::new(
                actuator_element(model, servo.actuator),
                format!(
                    "ctrlrange clamps the commanded angle to {first} to {last} rad; the range of {} is {low} to {high} rad",
                    joint_element(model, joint)
                ),
                format!(
                    "give the joint that range, or the actuator ctrlrange=\"{} {}\"",
                    ends[0].min(ends[1]),
                    ends[0].max(ends[1])
                ),
            )
        })
    })
}

/// `<option><flag actuation="disable"/>` lets every joint go.
pub(super) fn actuation_off(robot: &Model) -> Option<RefusedElement> {
    let model = &*robot.inner;
    disabled(model, MjtDisableBit::mjDSBL_ACTUATION).then(|| {
        RefusedElement::new(
            "option/flag".to_owned(),
            "actuation=\"disable\" lets go of every joint",
            "remove the flag",
        )
    })
}
