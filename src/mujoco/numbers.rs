//! Numbers of a compiled model that no robot has, by name: MuJoCo takes what is not finite, and ranges that are turned round.

use mujoco_rs::wrappers::mj_model::MjtObjBase;

use super::Model;
use super::error::unsuitable;
use crate::files::FileError;

/// Nothing of a laboratory is further away (m).
const FURTHEST_M: f64 = 1e6;

impl Model {
    /// Whether all places are finite, and all ranges go upwards.
    pub(super) fn check_numbers(&self) -> Result<(), FileError> {
        let inner = &self.inner;
        let places = [
            (MjtObjBase::mjOBJ_BODY, "body", "pos", inner.body_pos()),
            (
                MjtObjBase::mjOBJ_BODY,
                "body",
                "centre of mass",
                inner.body_ipos(),
            ),
            (MjtObjBase::mjOBJ_JOINT, "joint", "pos", inner.jnt_pos()),
            (MjtObjBase::mjOBJ_GEOM, "geom", "pos", inner.geom_pos()),
            (MjtObjBase::mjOBJ_SITE, "site", "pos", inner.site_pos()),
        ];
        for (kind, word, key, all) in places {
            let is_wrong = |place: &[f64; 3]| !place.iter().all(|each| each.abs() <= FURTHEST_M);
            if let Some(index) = all.iter().position(is_wrong) {
                let name = self.name(kind, word, index);
                let [x, y, z] = all[index];
                let problem = format!(
                    "{word} {name:?}: {key}: found ({x:e}, {y:e}, {z:e}) m; finite numbers of up to {FURTHEST_M:e} m in size are allowed"
                );
                return Err(unsuitable(self.path(), problem));
            }
        }
        for (joint, [low, high]) in inner.jnt_range().iter().enumerate() {
            if low > high {
                let name = self.joint_name(joint);
                // As in the file: MuJoCo takes the range for none, and leaves its unit.
                let problem = format!(
                    "joint {name:?}: range=\"{low} {high}\": the first number must be the smaller one"
                );
                return Err(unsuitable(self.path(), problem));
            }
        }
        Ok(())
    }
}
