//! Joints that a scenario locks: they do not move, and what holds or couples them no longer counts.

use std::sync::Arc;

use mujoco_rs::wrappers::mj_model::{MjtEq, MjtObjBase, MjtWrap};

use super::Model;
use super::servo::acts_on;
use crate::files::FileError;

impl Model {
    /// The same model with locked joints, by name, each at a coordinate (rad or m).
    ///
    /// # Errors
    /// There is no such joint, or it is neither a hinge nor a slide.
    pub fn with_locked(&self, joints: &[(String, f64)]) -> Result<Self, FileError> {
        if joints.is_empty() {
            return Ok(self.clone());
        }
        let mut locked = Vec::new();
        for (name, value) in joints {
            let joint = self.joint(name)?;
            if !self.is_hinge(joint) && !self.is_slide(joint) {
                return Err(self.not_static(
                    self.element("joint", joint),
                    "is neither a hinge nor a slide and cannot be locked",
                    "remove it from the model",
                ));
            }
            locked.push((joint, *value));
        }
        let mut model = (*self.inner).clone();
        let held: Vec<usize> = (0..model.actuator_trntype().len())
            .filter(|&actuator| {
                (locked.iter()).any(|&(joint, _)| acts_on(&self.inner, actuator, joint))
            })
            .collect();
        let idle = (0..=30)
            .find(|group| !model.actuator_group().contains(group))
            .unwrap_or(30);
        for actuator in held {
            model.actuator_group_mut()[actuator] = idle;
            model.opt_mut().disableactuator |= 1 << idle;
        }
        let is_locked = |joint: i32| {
            // A joint equality with one joint alone has none for its second.
            joint < 0 || (locked.iter()).any(|&(each, _)| usize::try_from(joint) == Ok(each))
        };
        for equality in 0..model.eq_type().len() {
            if model.eq_type()[equality] == MjtEq::mjEQ_JOINT
                && is_locked(model.eq_obj1id()[equality])
                && is_locked(model.eq_obj2id()[equality])
            {
                model.eq_active0_mut()[equality] = false;
            }
        }
        for &(joint, _) in &locked {
            let degree = self.degree_of_joint(joint);
            model.jnt_stiffness_mut()[joint] = 0.0;
            model.jnt_stiffnesspoly_mut()[joint] = [0.0; 2];
            model.dof_frictionloss_mut()[degree] = 0.0;
        }
        Ok(Self {
            locked: Arc::new(locked),
            ..self.changed(model)
        })
    }

    /// The locked joints, each with its coordinate (rad or m).
    pub fn locked(&self) -> &[(usize, f64)] {
        &self.locked
    }

    /// The same by name.
    pub fn locked_by_name(&self) -> Vec<(String, f64)> {
        let named = |&(joint, value): &(usize, f64)| (self.joint_name(joint), value);
        self.locked.iter().map(named).collect()
    }

    /// The tendons that run over locked joints alone.
    pub(super) fn tendons_of_locked(&self) -> Vec<String> {
        let model = &self.inner;
        let is_locked = |place: usize| {
            let joint = usize::try_from(model.wrap_objid()[place]);
            model.wrap_type()[place] == MjtWrap::mjWRAP_JOINT
                && joint.is_ok_and(|joint| self.locked_at(joint).is_some())
        };
        let is_theirs = |&tendon: &usize| self.wraps(tendon).all(is_locked);
        let tendons = (0..model.tendon_adr().len()).filter(is_theirs);
        let name = |tendon| model.id_to_name(MjtObjBase::mjOBJ_TENDON, tendon);
        tendons.filter_map(name).map(str::to_owned).collect()
    }

    /// Where a joint is locked (rad or m).
    pub fn locked_at(&self, joint: usize) -> Option<f64> {
        let found = self.locked.iter().find(|(locked, _)| *locked == joint);
        found.map(|(_, value)| *value)
    }

    /// MuJoCo's identifiers of the chain's joints: of those that are not locked.
    pub fn chain_joints(&self) -> Vec<usize> {
        (0..self.joints())
            .filter(|&joint| self.locked_at(joint).is_none())
            .collect()
    }

    /// The coordinates at which the bodies stand as the file draws them, but for locked joints.
    pub fn start_coordinates(&self) -> Vec<f64> {
        let mut coordinates = self.reference_coordinates().to_vec();
        for &(joint, value) in self.locked.iter() {
            coordinates[self.coordinate_of_joint(joint)] = value;
        }
        coordinates
    }
}
