//! A model whose actuators do not count: its joints are as stiff as a scenario says.

use super::Model;

/// The group of actuators that do not act.
pub(super) const IDLE: i32 = 30;

impl Model {
    /// The same model in which no actuator acts, no force of a joint's drive is cut off, and no hinge or
    /// slide has dry friction: what a simulation needs of them is not a stiffness.
    pub fn without_actuators(&self) -> Self {
        let mut model = (*self.inner).clone();
        model.actuator_group_mut().fill(IDLE);
        model.opt_mut().disableactuator |= 1 << IDLE;
        model.jnt_actfrclimited_mut().fill(false);
        for joint in 0..self.joints() {
            if self.is_hinge(joint) || self.is_slide(joint) {
                model.dof_frictionloss_mut()[self.degree_of_joint(joint)] = 0.0;
            }
        }
        Self {
            without_actuators: true,
            ..self.changed(model)
        }
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
