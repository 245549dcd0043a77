//! A model's joints: their axes and ranges, and what holds them.

use mujoco_rs::prelude::MjtJoint;
use mujoco_rs::wrappers::mj_model::{MjtDisableBit, MjtObjBase};
use nalgebra::Vector3;

use super::Model;
use super::servo::{Servo, command_range, disabled};
use crate::files::FileError;

impl Model {
    /// The joints of a body in the order in which they act.
    pub fn joints_of(&self, body: usize) -> impl Iterator<Item = usize> + use<> {
        let count = self.inner.body_jntnum()[body].unsigned_abs() as usize;
        let first = self.inner.body_jntadr()[body].max(0).unsigned_abs() as usize;
        first..first + count
    }

    /// Whether the joint slides along its axis.
    pub fn is_slide(&self, joint: usize) -> bool {
        self.inner.jnt_type()[joint] == MjtJoint::mjJNT_SLIDE
    }

    /// How many joints that are not locked, from the base, move a body of a serial arm.
    pub fn joints_that_move(&self, mut body: usize) -> usize {
        let mut count = 0;
        while body != 0 {
            let joints = self.joints_of(body);
            count += joints
                .filter(|&joint| self.locked_at(joint).is_none())
                .count();
            body = self.parent(body);
        }
        count
    }

    /// The number of joints.
    pub fn joints(&self) -> usize {
        self.inner.jnt_type().len()
    }

    /// Whether the joint is a hinge.
    pub fn is_hinge(&self, joint: usize) -> bool {
        self.inner.jnt_type()[joint] == MjtJoint::mjJNT_HINGE
    }

    /// Axis (unit vector) and anchor (m) of a joint in its body's frame.
    pub fn joint_axis_and_anchor(&self, joint: usize) -> (Vector3<f64>, Vector3<f64>) {
        (
            Vector3::from(self.inner.jnt_axis()[joint]),
            Vector3::from(self.inner.jnt_pos()[joint]),
        )
    }

    /// The range of a joint's commanded angle (rad), whether or not MuJoCo enforces it on the
    /// elastic joint; where the joint has none, that of its actuator's commands; else one turn each way.
    pub fn joint_range(&self, joint: usize) -> [f64; 2] {
        let [low, high] = self.inner.jnt_range()[joint];
        if low < high {
            return [low, high];
        }
        Servo::of(&self.inner, joint)
            .find_map(|servo| command_range(&self.inner, &servo))
            .unwrap_or([-std::f64::consts::TAU, std::f64::consts::TAU])
    }

    /// The joint coordinate at which the bodies stand as the file draws them (rad).
    pub fn joint_reference(&self, joint: usize) -> f64 {
        self.inner.qpos0()[joint]
    }

    /// The position actuator that holds a joint.
    pub(super) fn position(&self, joint: usize) -> Option<Servo> {
        Servo::of(&self.inner, joint).find(|servo| servo.is_position(&self.inner))
    }

    /// The compliance of a joint (rad/(N m), m/N): one over the stiffness of the position actuator that
    /// holds it at its command or, where it is passive, of its spring; `None` if there is neither.
    pub fn joint_compliance(&self, joint: usize) -> Option<f64> {
        match self.position(joint) {
            Some(servo) => Some(servo.stiffness(&self.inner).recip()),
            None => self
                .joint_spring(joint)
                .map(|[stiffness, _]| stiffness.recip()),
        }
    }

    /// Whether a position actuator holds the joint.
    pub fn is_actuated(&self, joint: usize) -> bool {
        self.position(joint).is_some()
    }

    /// The linear stiffness of the spring in a joint (N m/rad, N/m) and where it is relaxed (rad, m), if
    /// there is one that acts.
    pub fn joint_spring(&self, joint: usize) -> Option<[f64; 2]> {
        let stiffness = self.inner.jnt_stiffness()[joint];
        let acts = stiffness != 0.0 && !disabled(&self.inner, MjtDisableBit::mjDSBL_SPRING);
        let coordinate = self.coordinate_of_joint(joint);
        acts.then(|| [stiffness, self.inner.qpos_spring()[coordinate]])
    }

    /// The constant force on a joint (N m, N) of the actuator that holds it.
    pub fn joint_offset(&self, joint: usize) -> f64 {
        self.position(joint).map_or(0.0, |servo| {
            servo.gear * self.inner.actuator_biasprm()[servo.actuator][0]
        })
    }

    /// The joint's name, or `joint <id>`.
    pub fn joint_name(&self, joint: usize) -> String {
        self.name(MjtObjBase::mjOBJ_JOINT, "joint", joint)
    }

    /// The identifier of a joint.
    pub fn joint(&self, name: &str) -> Result<usize, FileError> {
        (0..self.joints())
            .find(|&joint| self.joint_name(joint) == name)
            .ok_or_else(|| {
                self.unknown(
                    "joint",
                    name,
                    &self.names(MjtObjBase::mjOBJ_JOINT, self.joints()),
                )
            })
    }
}
