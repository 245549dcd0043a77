//! Models that differ from what the file says: links and sites that stand elsewhere, links that weigh more or less,
//! springs that are stiffer.

use std::sync::Arc;

use mujoco_rs::prelude::{MjModel, MjtSameFrame};
use mujoco_rs::wrappers::mj_model::MjtObjBase;
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use super::Model;
use crate::files::FileError;

/// What is not as the file says. Frames stand elsewhere by the displacement from their own place, in their own axes.
#[derive(Debug, Clone, PartialEq)]
pub enum ModelChange {
    /// The frame of the link of one of a belief's joints, at zero angle; its origin lies on the axis.
    Link(usize, Isometry3<f64>),
    /// The frame of a site.
    Site(String, Isometry3<f64>),
    /// What the link of one of a belief's joints weighs, with all that is fixed to it, is so many times as much.
    Mass(usize, f64),
    /// A tendon's spring, by its name, is so many times as stiff, and relaxed at another length by so much (m).
    Spring(String, f64, f64),
    /// Its centre of mass lies elsewhere, by a vector in the link's frame (m).
    Centre(usize, Vector3<f64>),
}

/// Gives a model back what changes alter.
fn restore(model: &mut MjModel, nominal: &MjModel) {
    (model.jnt_pos_mut()).copy_from_slice(nominal.jnt_pos());
    (model.jnt_axis_mut()).copy_from_slice(nominal.jnt_axis());
    (model.body_pos_mut()).copy_from_slice(nominal.body_pos());
    (model.body_quat_mut()).copy_from_slice(nominal.body_quat());
    (model.body_ipos_mut()).copy_from_slice(nominal.body_ipos());
    (model.body_mass_mut()).copy_from_slice(nominal.body_mass());
    (model.body_inertia_mut()).copy_from_slice(nominal.body_inertia());
    (model.body_sameframe_mut()).copy_from_slice(nominal.body_sameframe());
    (model.tendon_stiffness_mut()).copy_from_slice(nominal.tendon_stiffness());
    (model.tendon_lengthspring_mut()).copy_from_slice(nominal.tendon_lengthspring());
    (model.site_pos_mut()).copy_from_slice(nominal.site_pos());
    (model.site_quat_mut()).copy_from_slice(nominal.site_quat());
    (model.site_sameframe_mut()).copy_from_slice(nominal.site_sameframe());
    (model.geom_sameframe_mut()).copy_from_slice(nominal.geom_sameframe());
}

impl Model {
    /// The same model with some changes. `joints` are MuJoCo's identifiers of the belief's; links and
    /// springs that the model does not have stay away.
    ///
    /// # Errors
    /// A site is missing.
    pub fn with_changes(
        &self,
        joints: &[Option<usize>],
        changes: &[ModelChange],
    ) -> Result<Self, FileError> {
        let mut changed = self.clone();
        changed.become_changed(self, joints, changes)?;
        Ok(changed)
    }

    /// Makes this model, which is `nominal` with other changes, the one with these: without a copy of what does not
    /// change, where nobody else has it.
    pub fn become_changed(
        &mut self,
        nominal: &Self,
        joints: &[Option<usize>],
        changes: &[ModelChange],
    ) -> Result<(), FileError> {
        let model = Arc::make_mut(&mut self.inner);
        restore(model, &nominal.inner);
        nominal.apply_changes(model, joints, changes)
    }

    fn apply_changes(
        &self,
        model: &mut MjModel,
        joints: &[Option<usize>],
        changes: &[ModelChange],
    ) -> Result<(), FileError> {
        self.displace_links(model, joints, changes);
        for each in changes {
            match each {
                // All of a body's at once.
                ModelChange::Link(..) => {}
                ModelChange::Site(name, by) => {
                    let site = self.site(name)?;
                    let (_, body_from_site) = self.site_body(site);
                    let frame = body_from_site * by;
                    model.site_pos_mut()[site] = frame.translation.vector.into();
                    let [x, y, z, w] = frame.rotation.coords.into();
                    model.site_quat_mut()[site] = [w, x, y, z];
                    model.site_sameframe_mut()[site] = MjtSameFrame::mjSAMEFRAME_NONE;
                }
                ModelChange::Mass(joint, factor) => {
                    for (body, _) in self.bodies_of_link(joints, *joint) {
                        model.body_mass_mut()[body] *= factor;
                        for moment in &mut model.body_inertia_mut()[body] {
                            *moment *= factor;
                        }
                    }
                }
                ModelChange::Spring(name, factor, longer_m) => {
                    // The bindings' strings end at a zero.
                    let tendon = (!name.contains('\0'))
                        .then(|| self.inner.name_to_id(MjtObjBase::mjOBJ_TENDON, name))
                        .flatten();
                    if let Some(tendon) = tendon {
                        model.tendon_stiffness_mut()[tendon] *= factor;
                        for end in &mut model.tendon_lengthspring_mut()[tendon] {
                            *end += longer_m;
                        }
                    }
                }
                ModelChange::Centre(joint, by) => {
                    for (body, turn) in self.bodies_of_link(joints, *joint) {
                        let centre = Vector3::from(model.body_ipos()[body]) + turn * by;
                        model.body_ipos_mut()[body] = centre.into();
                        self.unalign(model, body);
                    }
                }
            }
        }
        self.add_up_masses(model);
        Ok(())
    }

    /// Displaces the frames of links: with D the displacement of the link of a body's last joint, in the body's axes, the
    /// body stands at B D, and the joints before it in the same body turn about what D^-1 makes of their axes.
    fn displace_links(
        &self,
        model: &mut MjModel,
        joints: &[Option<usize>],
        changes: &[ModelChange],
    ) {
        let by = |joint: usize| {
            let is_it = |index: usize| joints[index] == Some(joint);
            changes.iter().rev().find_map(|change| match change {
                ModelChange::Link(index, by) if is_it(*index) => Some(by),
                _ => None,
            })
        };
        for body in 1..self.bodies() {
            let mut all: Option<Isometry3<f64>> = None;
            let own: Vec<usize> = self.joints_of(body).collect();
            for &joint in own.iter().rev() {
                if let Some(all) = &all {
                    let (axis, anchor) = self.joint_axis_and_anchor(joint);
                    let back = all.inverse();
                    model.jnt_axis_mut()[joint] = (back.rotation * axis).into();
                    model.jnt_pos_mut()[joint] = (back * Point3::from(anchor)).coords.into();
                }
                if let Some(by) = by(joint) {
                    let body_from_link = self.body_from_link(joint);
                    let moved = body_from_link * by * body_from_link.inverse();
                    all = Some(all.map_or(moved, |all| moved * all));
                }
            }
            if let Some(all) = all {
                let frame = self.parent_from_body(body) * all;
                model.body_pos_mut()[body] = frame.translation.vector.into();
                let [x, y, z, w] = frame.rotation.coords.into();
                model.body_quat_mut()[body] = [w, x, y, z];
            }
        }
    }

    /// The frame of the link of a joint in its body's, which a reference angle turns.
    pub fn body_from_link(&self, joint: usize) -> Isometry3<f64> {
        let (axis, anchor) = self.joint_axis_and_anchor(joint);
        let axis = nalgebra::Unit::new_normalize(axis);
        let reference = self.joint_reference(joint);
        if self.is_slide(joint) {
            (anchor - axis.into_inner() * reference).into()
        } else {
            let turn = UnitQuaternion::from_axis_angle(&axis, -reference);
            Isometry3::from_parts(anchor.into(), turn)
        }
    }

    /// The bodies that a joint moves, and none of the other `joints` beyond it does; with the rotations that turn
    /// vectors of the link's frame into theirs.
    pub(super) fn bodies_of_link(
        &self,
        joints: &[Option<usize>],
        index: usize,
    ) -> Vec<(usize, UnitQuaternion<f64>)> {
        let Some(joint) = joints[index] else {
            return Vec::new();
        };
        let is_known = |joint: &usize| joints.contains(&Some(*joint));
        let mut found = Vec::new();
        let mut turn_of: Vec<Option<UnitQuaternion<f64>>> = vec![None; self.bodies()];
        for body in 1..self.bodies() {
            turn_of[body] = match self.joints_of(body).filter(is_known).last() {
                // Beyond its joint the link's frame is parallel to the body's, whatever the reference is.
                Some(last) if last == joint => Some(UnitQuaternion::identity()),
                Some(_) => None,
                None => turn_of[self.parent(body)]
                    .map(|turn| self.parent_from_body(body).rotation.inverse() * turn),
            };
            found.extend(turn_of[body].map(|turn| (body, turn)));
        }
        found
    }

    /// Makes MuJoCo compute the places of a body's centre of mass and of what may share its frame by themselves.
    fn unalign(&self, model: &mut MjModel, body: usize) {
        let none = MjtSameFrame::mjSAMEFRAME_NONE;
        model.body_sameframe_mut()[body] = none;
        for site in (0..self.sites()).filter(|&site| self.site_body(site).0 == body) {
            model.site_sameframe_mut()[site] = none;
        }
        for geometry in (0..self.geometries()).filter(|&each| self.geometry_body(each) == body) {
            // Where they are in the statics of a chain is no matter.
            if model.geom_sameframe()[geometry] != MjtSameFrame::mjSAMEFRAME_BODY {
                model.geom_sameframe_mut()[geometry] = none;
            }
        }
    }
}
