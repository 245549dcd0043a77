//! Joints that a scenario locks, in a model that is written: their bodies are fixed where they stand, and the joints are gone with what
//! acts on them alone.

use mujoco_rs::error::MjEditError;
use mujoco_rs::prelude::{MjSpec, MjtJoint};
use mujoco_rs::wrappers::mj_editing::{MjsBody, SpecElement};
use mujoco_rs::wrappers::mj_model::{MjtEq, MjtObjBase, MjtTrn};
use nalgebra::{Isometry3, Point3, Quaternion, Unit, UnitQuaternion, Vector3};

use super::beside::delete;

/// Fixes joints by name, each at a coordinate (rad, m), in elements whose bodies have positions and quaternions alone; `tendons` act on
/// no other joint. What else is lost, in words.
///
/// # Errors
/// Something acts on another joint, too, or cannot be deleted, in words.
pub(super) fn fix(
    spec: &mut MjSpec,
    joints: &[(String, f64)],
    tendons: &[String],
) -> Result<Option<String>, String> {
    let failed = |error: MjEditError| error.to_string();
    let is_joint = |name: &str| joints.iter().any(|(joint, _)| joint == name);
    let is_tendon = |name: &str| tendons.iter().any(|tendon| tendon == name);
    for (joint, value) in joints {
        fix_in(spec.world_body_mut(), joint, *value).map_err(failed)?;
    }
    for tendon in tendons {
        if let Some(tendon) = spec.tendon_mut(tendon) {
            delete(tendon).map_err(failed)?;
        }
    }
    let mut actuators = Vec::new();
    while let Some(actuator) = spec.actuator_iter_mut().find(|each| match each.trntype() {
        MjtTrn::mjTRN_JOINT | MjtTrn::mjTRN_JOINTINPARENT => is_joint(each.target()),
        MjtTrn::mjTRN_TENDON => is_tendon(each.target()),
        _ => false,
    }) {
        actuators.push(actuator.name().to_owned());
        delete(actuator).map_err(failed)?;
    }
    while let Some(equality) = spec.equality_iter_mut().find(|each| match each.type_() {
        MjtEq::mjEQ_JOINT => is_joint(each.name1()) || is_joint(each.name2()),
        MjtEq::mjEQ_TENDON => is_tendon(each.name1()) || is_tendon(each.name2()),
        _ => false,
    }) {
        let ends = [equality.name1(), equality.name2()];
        if let Some(other) = (ends.iter())
            .find(|end| equality.active() && !end.is_empty() && !is_joint(end) && !is_tendon(end))
        {
            return Err(format!("{other} is coupled to what is locked"));
        }
        delete(equality).map_err(failed)?;
    }
    while let Some(sensor) = spec.sensor_iter_mut().find(|each| match each.objtype() {
        MjtObjBase::mjOBJ_JOINT => is_joint(each.objname()),
        MjtObjBase::mjOBJ_TENDON => is_tendon(each.objname()),
        MjtObjBase::mjOBJ_ACTUATOR => actuators.iter().any(|name| name == each.objname()),
        _ => false,
    }) {
        delete(sensor).map_err(failed)?;
    }
    let mut lost = None;
    while let Some(key) = spec.key_iter_mut().next() {
        delete(key).map_err(failed)?;
        lost = Some("keyframes, which have coordinates of the locked joints".to_owned());
    }
    Ok(lost)
}

/// Fixes a joint of a body or of one that it carries; whether it is there. With M how the joint displaces its body, the body stands at
/// B M, and the joints before it in the same body turn about what M^-1 makes of their axes.
fn fix_in(body: &mut MjsBody, joint: &str, value: f64) -> Result<bool, MjEditError> {
    let found = body.joint_iter(false).position(|each| each.name() == joint);
    let Some(place) = found else {
        for carried in body.body_iter_mut() {
            if fix_in(carried, joint, value)? {
                return Ok(true);
            }
        }
        return Ok(false);
    };
    let mut by = Isometry3::identity();
    if let Some(own) = body.joint_iter(false).nth(place) {
        let axis = Unit::new_normalize(Vector3::from(*own.axis()));
        let (anchor, by_value) = (Vector3::from(*own.pos()), value - own.ref_());
        by = if own.type_() == MjtJoint::mjJNT_SLIDE {
            (axis.into_inner() * by_value).into()
        } else {
            let turn = UnitQuaternion::from_axis_angle(&axis, by_value);
            Isometry3::from_parts((anchor - turn * anchor).into(), turn)
        };
    }
    let [w, x, y, z] = *body.quat();
    let turn = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
    let stands = Isometry3::from_parts(Vector3::from(*body.pos()).into(), turn) * by;
    *body.pos_mut() = stands.translation.vector.into();
    let [x, y, z, w] = stands.rotation.coords.into();
    *body.quat_mut() = [w, x, y, z];
    for earlier in body.joint_iter_mut(false).take(place) {
        let axis = by.rotation.inverse() * Vector3::from(*earlier.axis());
        let anchor = by.inverse() * Point3::from(*earlier.pos());
        *earlier.axis_mut() = axis.into();
        *earlier.pos_mut() = anchor.coords.into();
    }
    if let Some(own) = body.joint_iter_mut(false).nth(place) {
        delete(own)?;
    }
    Ok(true)
}
