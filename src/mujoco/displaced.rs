//! Models whose links and sites stand elsewhere than the file draws them.

use nalgebra::{Isometry3, UnitQuaternion};

use super::{Model, ModelError};

/// A frame that stands elsewhere, by the displacement from its own place, in its own axes.
#[derive(Debug, Clone, PartialEq)]
pub enum Displaced {
    /// That of the link of one of a belief's joints, at zero angle; its origin lies on the axis.
    Link(usize, Isometry3<f64>),
    /// That of a site.
    Site(String, Isometry3<f64>),
}

impl Model {
    /// The same model in which some frames stand elsewhere. `joints` are MuJoCo's identifiers of the belief's; links
    /// that the model does not have stay away.
    ///
    /// # Errors
    /// A joint is not the first of its body, so that its link has no frame of its own; or a site is missing.
    pub fn with_displaced(
        &self,
        joints: &[Option<usize>],
        displaced: &[Displaced],
    ) -> Result<Self, ModelError> {
        let mut model = (*self.inner).clone();
        for each in displaced {
            match each {
                Displaced::Link(joint, by) => {
                    let Some(joint) = joints[*joint] else {
                        continue;
                    };
                    let body = self.body_of_first_joint(joint)?;
                    // The link's frame in its body's, which a reference angle turns.
                    let (axis, anchor) = self.joint_axis_and_anchor(joint);
                    let axis = nalgebra::Unit::new_normalize(axis);
                    let reference = self.joint_reference(joint);
                    let body_from_link = if self.is_slide(joint) {
                        (anchor - axis.into_inner() * reference).into()
                    } else {
                        let turn = UnitQuaternion::from_axis_angle(&axis, -reference);
                        Isometry3::from_parts(anchor.into(), turn)
                    };
                    let frame = self.parent_from_body(body)
                        * body_from_link
                        * by
                        * body_from_link.inverse();
                    model.body_pos_mut()[body] = frame.translation.vector.into();
                    let [x, y, z, w] = frame.rotation.coords.into();
                    model.body_quat_mut()[body] = [w, x, y, z];
                }
                Displaced::Site(name, by) => {
                    let site = self.site(name)?;
                    let (_, body_from_site) = self.site_body(site);
                    let frame = body_from_site * by;
                    model.site_pos_mut()[site] = frame.translation.vector.into();
                    let [x, y, z, w] = frame.rotation.coords.into();
                    model.site_quat_mut()[site] = [w, x, y, z];
                    model.site_sameframe_mut()[site] =
                        mujoco_rs::prelude::MjtSameFrame::mjSAMEFRAME_NONE;
                }
            }
        }
        Ok(self.changed(model))
    }

    fn body_of_first_joint(&self, joint: usize) -> Result<usize, ModelError> {
        let bodies = 1..self.bodies();
        let mut first = bodies.filter_map(|body| Some((body, self.joints_of(body).next()?)));
        let found = first.find(|(_, first)| *first == joint);
        found.map(|(body, _)| body).ok_or_else(|| ModelError::NotSerial {
            path: self.path().to_owned(),
            reason: format!(
                "joint {:?} shares its body with another before it: its link has no frame of its own that could be \
                 uncertain",
                self.joint_name(joint)
            ),
        })
    }
}
