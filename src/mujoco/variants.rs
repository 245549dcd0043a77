//! The same model where MuJoCo shall do something else with it: ignore contacts, let compensated masses weigh nothing,
//! keep distances, or hold joints with other compliances.

use std::sync::Arc;

use mujoco_rs::prelude::{MjModel, MjtSameFrame};
use mujoco_rs::wrappers::mj_model::MjtDisableBit;

use super::Model;
use crate::files::FileError;

/// The group of actuators that do not act.
pub(super) const IDLE: i32 = 30;

impl Model {
    /// The same model in which other numbers stand.
    pub(super) fn changed(&self, model: MjModel) -> Self {
        Self {
            inner: Arc::new(model),
            ..self.clone()
        }
    }

    /// The same model without contacts and joint limits.
    pub fn without_contacts_and_limits(&self) -> Self {
        let mut model = (*self.inner).clone();
        model.opt_mut().disableflags |=
            MjtDisableBit::mjDSBL_CONTACT as i32 | MjtDisableBit::mjDSBL_LIMIT as i32;
        self.changed(model)
    }

    /// The same model for the statics of a chain, and for nothing else: each body has the mass that weighs on the arm, without the share
    /// that the model compensates (`gravcomp`), and geometries, which take most of MuJoCo's position stage, stand at their
    /// bodies' frames.
    pub fn for_chain_statics(&self) -> Self {
        let mut model = (*self.inner).clone();
        for (body, mass) in model.body_mass_mut().iter_mut().enumerate() {
            *mass *= self.weighing_share(body);
        }
        self.add_up_masses(&mut model);
        (model.geom_sameframe_mut()).fill(MjtSameFrame::mjSAMEFRAME_BODY);
        self.changed(model)
    }

    /// Sums up what hangs on each body, in a model with other masses.
    pub(super) fn add_up_masses(&self, model: &mut MjModel) {
        let masses = model.body_mass().to_vec();
        let subtrees = model.body_subtreemass_mut();
        subtrees.copy_from_slice(&masses);
        for body in (1..masses.len()).rev() {
            subtrees[self.parent(body)] += subtrees[body];
        }
    }

    /// The same model in which geometries that collide come into contact at this distance (m).
    pub fn with_clearance(&self, clearance_m: f64) -> Self {
        let mut model = (*self.inner).clone();
        model.geom_margin_mut().fill(clearance_m);
        model.body_margin_mut().fill(clearance_m);
        self.changed(model)
    }

    /// The same model in which some joints have other compliances (rad/(N m)); their commands mean the
    /// same. A compliance of zero changes nothing.
    ///
    /// # Errors
    /// For a joint that no position actuator holds.
    pub fn with_joint_compliance(
        &self,
        joints: &[usize],
        compliance: &[f64],
    ) -> Result<Self, FileError> {
        let mut model = (*self.inner).clone();
        for (&joint, value) in joints.iter().zip(compliance) {
            if *value == 0.0 {
                continue;
            }
            let Some(servo) = self.position(joint) else {
                self.joint_spring(joint)
                    .ok_or_else(|| self.not_held(joint))?;
                model.jnt_stiffness_mut()[joint] = value.recip();
                continue;
            };
            let gain = value.recip() / (servo.gear * servo.gear);
            let command = self.inner.actuator_gainprm()[servo.actuator][0];
            let spring = -self.inner.actuator_biasprm()[servo.actuator][1];
            // SAFETY: gains and biases are plain numbers; no index or size depends on them.
            #[expect(unsafe_code, reason = "the wrapper has no safe setter")]
            unsafe {
                model.actuator_gainprm_mut()[servo.actuator][0] = gain * (command / spring);
                model.actuator_biasprm_mut()[servo.actuator][1] = -gain;
            }
        }
        Ok(self.changed(model))
    }

    /// The same model in which no actuator acts, no force of a joint's drive is cut off, and no hinge or
    /// slide has dry friction: what a simulation needs of them is not a stiffness.
    pub fn without_actuators(&self) -> Self {
        let mut model = self.without_friction_and_limits();
        model.actuator_group_mut().fill(IDLE);
        model.opt_mut().disableactuator |= 1 << IDLE;
        Self {
            without_actuators: true,
            ..self.changed(model)
        }
    }

    /// The same model in which position actuators do no more than hold their joints: without limits, constant forces, and the joints'
    /// dry friction.
    pub fn with_plain_actuators(&self) -> Self {
        let mut model = self.without_friction_and_limits();
        model.actuator_forcelimited_mut().fill(false);
        model.actuator_ctrllimited_mut().fill(false);
        for joint in 0..self.joints() {
            if let Some(servo) = self.position(joint) {
                model.actuator_biasprm_mut()[servo.actuator][0] = 0.0;
            }
        }
        self.changed(model)
    }

    fn without_friction_and_limits(&self) -> MjModel {
        let mut model = (*self.inner).clone();
        model.jnt_actfrclimited_mut().fill(false);
        for joint in 0..self.joints() {
            if self.is_hinge(joint) || self.is_slide(joint) {
                model.dof_frictionloss_mut()[self.degree_of_joint(joint)] = 0.0;
            }
        }
        model
    }

    /// Whether it is such a model.
    pub const fn ignores_actuators(&self) -> bool {
        self.without_actuators
    }

    /// What was left out when the file was read, in words.
    pub fn left_out(&self) -> &[String] {
        &self.left_out
    }
}
