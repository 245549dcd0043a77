//! Actuators: each joint needs one position actuator, and nothing else may pull.

use mujoco_rs::wrappers::mj_model::{MjtBias, MjtDyn, MjtGain, MjtObjBase, MjtTrn};

use super::super::Model;
use crate::files::FileError;
use crate::mujoco::servo::{Servo, acts_on_a_joint, command_range, is_enabled};

/// Ranges of commands that differ by less are the same (rad).
const SAME_RAD: f64 = 1e-9;
/// What to do about one of two.
const LEAVE_ONE: &str = "leave the one whose kp is the joint's stiffness, and remove the other";
/// What to write instead of another actuator.
const HINT: &str =
    "write <position joint=\"...\" kp=\"...\"/>, kp being the joint's stiffness in N m/rad";

/// The actuators that act.
fn acting(robot: &Model) -> impl Iterator<Item = usize> {
    (0..robot.actuators()).filter(|&id| is_enabled(&robot.inner, id))
}

/// What an actuator acts on must be a joint.
pub(super) fn transmission(robot: &Model) -> Option<FileError> {
    let id = acting(robot).find(|&id| !acts_on_a_joint(&robot.inner, id))?;
    let target = match robot.inner.actuator_trntype()[id] {
        MjtTrn::mjTRN_TENDON => "a tendon",
        MjtTrn::mjTRN_SITE => "a site",
        MjtTrn::mjTRN_BODY => "a body's contacts",
        MjtTrn::mjTRN_SLIDERCRANK => "a slider crank",
        MjtTrn::mjTRN_SO3 => "an orientation",
        _ => "something else",
    };
    Some(robot.not_static(
        robot.element("actuator", id),
        format!("acts on {target}; the statics know actuators of joints only"),
        "remove it, or disable its group with <option actuatorgroupdisable=\"...\"/>",
    ))
}

/// Each joint must be held by one actuator or, where it is passive, by a spring. A model without any actuator is geometry and masses
/// alone: the scenario then says how the joints are held.
pub(super) fn one_for_each_joint(robot: &Model) -> Option<FileError> {
    if robot.actuators() == 0 || robot.ignores_actuators() {
        return None;
    }
    (0..robot.joints()).find_map(|joint| {
        if robot.locked_at(joint).is_some() {
            return None;
        }
        let servos: Vec<_> = Servo::of(&robot.inner, joint).collect();
        match servos[..] {
            [_] => None,
            [] if robot.joint_spring(joint).is_some() => None,
            [] => Some(robot.not_held(joint)),
            [first, second, ..] => Some(two(robot, "acts on", joint, [first, second], "hold")),
        }
    })
}

/// The error for a joint on which two actuators act.
fn two(robot: &Model, acts: &str, joint: usize, [one, other]: [Servo; 2], may: &str) -> FileError {
    let [one, other] = [one, other].map(|servo| robot.element("actuator", servo.actuator));
    let kind = if may == "hold" { "" } else { "position " };
    let joint = robot.element("joint", joint);
    let problem = format!("{acts} {joint} beside {one}; one {kind}actuator may {may} a joint");
    robot.not_static(other, problem, LEAVE_ONE)
}

impl Model {
    /// The error for a joint that no actuator holds.
    pub(crate) fn not_held(&self, joint: usize) -> FileError {
        let idle = (0..self.actuators()).find(|&id| {
            !is_enabled(&self.inner, id)
                && usize::try_from(self.inner.actuator_trnid()[id][0]) == Ok(joint)
        });
        let problem = match idle {
            Some(id) => format!(
                "nothing holds it at its commanded angle: the group of {} is disabled by <option actuatorgroupdisable>",
                self.element("actuator", id)
            ),
            None => "no actuator holds it at its commanded angle".to_owned(),
        };
        let name = self.inner.id_to_name(MjtObjBase::mjOBJ_JOINT, joint);
        let hint = format!(
            "give it one, or a spring (stiffness) if it is passive, or lock it (robot.locked_deg, robot.locked_mm): <actuator><position joint={:?} kp=\"1e6\"/></actuator>, kp being its stiffness in N m/rad, which a scenario's compliance_rad_per_nm replaces",
            name.unwrap_or("...")
        );
        self.not_static(self.element("joint", joint), problem, hint)
    }

    /// The error for a joint of a virtual robot that is to be commanded and that is not held by one
    /// position actuator.
    pub(crate) fn check_commanded(&self, joint: usize) -> Result<(), FileError> {
        if self.ignores_actuators() && self.joint_spring(joint).is_none() {
            return Ok(());
        }
        let position = Servo::of(&self.inner, joint).filter(|servo| servo.is_position(&self.inner));
        match position.collect::<Vec<_>>()[..] {
            [_] => Ok(()),
            [] => Err(self.not_held(joint)),
            [one, other, ..] => Err(two(self, "commands", joint, [one, other], "command")),
        }
    }
}

/// An actuator with a state of its own rests where its history says.
pub(super) fn state(robot: &Model) -> Option<FileError> {
    let model = &*robot.inner;
    acting(robot).find_map(|id| {
        let problem = if model.actuator_dyntype()[id] != MjtDyn::mjDYN_NONE
            || model.actuator_actnum()[id] != 0
        {
            "has a state of its own (a filter, an integrator, a muscle or a motor); a position actuator without one is needed"
        } else if model.actuator_delay()[id] != 0.0 || model.actuator_history()[id][0] != 0 {
            "has a delay; a position actuator without one is needed"
        } else if model.actuator_plugin()[id] >= 0 {
            "is a plugin; its force is not known"
        } else {
            return None;
        };
        Some(robot.not_static(robot.element("actuator", id), problem, HINT))
    })
}

/// The actuator's force must be that of a spring between commanded and actual angle: kp (u - length).
#[expect(
    clippy::float_cmp,
    reason = "a position actuator has the same number twice"
)]
pub(super) fn law(robot: &Model) -> Option<FileError> {
    let model = &*robot.inner;
    acting(robot).find_map(|id| {
        let (gain, bias) = (model.actuator_gainprm()[id], model.actuator_biasprm()[id]);
        let gear = Servo::new(model, id).gear;
        let problem = if model.actuator_gaintype()[id] != MjtGain::mjGAIN_FIXED
            || model.actuator_biastype()[id] != MjtBias::mjBIAS_AFFINE
            || gain[0] <= 0.0
            || bias[1] != -gain[0]
        {
            format!(
                "is no position actuator: its force is not kp (command - length) with one positive kp (gainprm {}, biasprm {} {} {})",
                gain[0], bias[0], bias[1], bias[2]
            )
        } else if gear == 0.0 || !gear.is_finite() {
            format!("has the gear {gear}; it holds nothing")
        } else {
            return None;
        };
        Some(robot.not_static(robot.element("actuator", id), problem, HINT))
    })
}

/// A force that is cut off is no spring's.
pub(super) fn force_limits(robot: &Model) -> Option<FileError> {
    const HINT: &str = "remove it, and bound the joint torques of plans with region.joint_torque_max_nm in the scenario";
    let model = &*robot.inner;
    let actuator = acting(robot).find(|&id| model.actuator_forcelimited()[id]);
    if let Some(id) = actuator {
        let [low, high] = model.actuator_forcerange()[id];
        let problem = format!(
            "forcerange=\"{low} {high}\" cuts its force off; an elastic joint has no such limit"
        );
        return Some(robot.not_static(robot.element("actuator", id), problem, HINT));
    }
    let limited = model.jnt_actfrclimited();
    let joint = limited.iter().position(|&limited| limited)?;
    let [low, high] = model.jnt_actfrcrange()[joint];
    let problem = format!(
        "actuatorfrcrange=\"{low} {high}\" (in a URDF: effort) cuts the actuator's force off; an elastic joint has no such limit"
    );
    Some(robot.not_static(robot.element("joint", joint), problem, HINT))
}

/// Where commands are clamped inside the joint's range, MuJoCo's arm does not go where it is sent.
pub(super) fn command_limits(robot: &Model) -> Option<FileError> {
    let model = &*robot.inner;
    (0..robot.joints()).find_map(|joint| {
        let [low, high] = model.jnt_range()[joint];
        let servo = Servo::of(model, joint).next()?;
        let [first, last] = command_range(model, &servo)?;
        let [one, other] = [low, high].map(|end| servo.gear * end);
        let narrower = low < high && (first > low + SAME_RAD || last < high - SAME_RAD);
        narrower.then(|| {
            let joint = robot.element("joint", joint);
            let problem = format!(
                "ctrlrange clamps the commanded angle to {first} to {last} rad; the range of {joint} is {low} to {high} rad"
            );
            let (least, most) = (one.min(other), one.max(other));
            let hint = format!(
                "give the joint that range, or the actuator ctrlrange=\"{least} {most}\""
            );
            robot.not_static(robot.element("actuator", servo.actuator), problem, hint)
        })
    })
}
