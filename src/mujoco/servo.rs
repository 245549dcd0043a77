//! The position actuator that holds a joint: the elastic element of the belief.

use mujoco_rs::prelude::MjModel;
use mujoco_rs::wrappers::mj_model::{MjtBias, MjtDisableBit, MjtGain, MjtTrn};

/// A position actuator that holds a joint. With the gear g and the gain kp its torque on the joint
/// is g kp (u - g q) = g^2 kp (u / g - q): the commanded angle is u / g, and the stiffness g^2 kp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Servo {
    /// MuJoCo's identifier of the actuator.
    pub actuator: usize,
    /// The index of its control u.
    pub control: usize,
    /// The gear g, from the joint's angle to the actuator's length.
    pub gear: f64,
}

impl Servo {
    /// The servos of a joint: all actuators that are not disabled and act on it alone.
    pub fn of(model: &MjModel, joint: usize) -> impl Iterator<Item = Self> {
        (0..model.actuator_trntype().len())
            .filter(move |&actuator| is_enabled(model, actuator) && acts_on(model, actuator, joint))
            .map(|actuator| Self::new(model, actuator))
    }

    /// Whether its force grows against a deviation from its control, and with the control.
    pub fn is_position(&self, model: &MjModel) -> bool {
        model.actuator_gaintype()[self.actuator] == MjtGain::mjGAIN_FIXED
            && model.actuator_biastype()[self.actuator] == MjtBias::mjBIAS_AFFINE
            && model.actuator_gainprm()[self.actuator][0] > 0.0
            && model.actuator_biasprm()[self.actuator][1] < 0.0
    }

    /// The stiffness that it gives its joint (N m/rad, N/m).
    pub fn stiffness(&self, model: &MjModel) -> f64 {
        -model.actuator_biasprm()[self.actuator][1] * self.gear * self.gear
    }

    pub fn new(model: &MjModel, actuator: usize) -> Self {
        let output = model.actuator_outadr()[actuator].unsigned_abs() as usize;
        Self {
            actuator,
            control: model.actuator_ctrladr()[actuator].unsigned_abs() as usize,
            gear: model.actuator_gear()[output][0],
        }
    }
}

/// Whether the actuator's group is not disabled.
pub(crate) fn is_enabled(model: &MjModel, actuator: usize) -> bool {
    let group = model.actuator_group()[actuator];
    // MuJoCo disables groups 0 to 30, one bit each.
    !(0..=30).contains(&group) || model.opt().disableactuator & (1 << group) == 0
}

/// Whether an actuator drives this joint.
pub(crate) fn acts_on(model: &MjModel, actuator: usize, joint: usize) -> bool {
    acts_on_a_joint(model, actuator)
        && usize::try_from(model.actuator_trnid()[actuator][0]) == Ok(joint)
}

/// Whether the actuator drives one joint, and no tendon, site or body.
pub(crate) fn acts_on_a_joint(model: &MjModel, actuator: usize) -> bool {
    matches!(
        model.actuator_trntype()[actuator],
        MjtTrn::mjTRN_JOINT | MjtTrn::mjTRN_JOINTINPARENT
    )
}

/// The range that MuJoCo clamps a commanded angle to (rad), where it does.
pub(crate) fn command_range(model: &MjModel, servo: &Servo) -> Option<[f64; 2]> {
    if !model.actuator_ctrllimited()[servo.control]
        || disabled(model, MjtDisableBit::mjDSBL_CLAMPCTRL)
    {
        return None;
    }
    let [one, other] = model.actuator_ctrlrange()[servo.control].map(|end| end / servo.gear);
    Some([one.min(other), one.max(other)])
}

/// Whether `<option><flag .../>` disables what the bit stands for.
pub(crate) fn disabled(model: &MjModel, bit: MjtDisableBit) -> bool {
    model.opt().disableflags & bit as i32 != 0
}
