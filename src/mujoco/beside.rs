//! What lies loose beside the arm: free bodies that are tied to nothing, and mocap bodies that something is tied to. Scenes for simulation have them, and no
//! statics: they are left out by name.

use mujoco_rs::prelude::{MjSpec, MjtJoint};
use mujoco_rs::wrappers::mj_editing::{MjsBody, SpecElement, SpecObject};

/// Takes everything loose out of a specification; what was left out, in words.
pub(super) fn leave_out(spec: &mut MjSpec) -> Result<Vec<String>, String> {
    let mut said = Vec::new();
    if !has(
        spec.world_body_mut(),
        true,
        &[MjtJoint::mjJNT_HINGE, MjtJoint::mjJNT_SLIDE],
    ) {
        return Ok(said);
    }
    let mut place = 0;
    loop {
        let beside: Vec<String> = (spec.world_body_mut().body_iter(false))
            .filter(|body| is_beside(body))
            .flat_map(names_in)
            .collect();
        // What is tied among themselves is tied to nothing.
        let tied: Vec<String> = (spec.equality_iter())
            .map(|each| [each.name1().to_owned(), each.name2().to_owned()])
            .filter(|ends| !ends.iter().all(|name| beside.contains(name)))
            .flatten()
            .collect();
        let Some(body) = spec.world_body_mut().body_iter_mut().nth(place) else {
            break;
        };
        let Some(what) = loose(body, &tied) else {
            place += 1;
            continue;
        };
        let names = names_in(body);
        said.push(match body.name() {
            "" => format!("{what} without a name is no part of the arm: it is left out"),
            name => format!("{what} {name:?} is no part of the arm: it is left out"),
        });
        // SAFETY: nothing refers to the body any more once this is over: the iterator and the handle end with the statement.
        #[expect(unsafe_code, reason = "the bindings leave the care to who deletes")]
        let deleted = unsafe { body.delete() };
        deleted.map_err(|error| error.to_string())?;
        let mut index = 0;
        while let Some(equality) = spec.equality_iter_mut().nth(index) {
            if !(names.iter()).any(|name| name == equality.name1() || name == equality.name2()) {
                index += 1;
                continue;
            }
            // SAFETY: as above.
            #[expect(unsafe_code, reason = "the bindings leave the care to who deletes")]
            let deleted = unsafe { equality.delete() };
            deleted.map_err(|error| error.to_string())?;
        }
    }
    if !said.is_empty() {
        // They have coordinates of what is gone.
        while let Some(key) = spec.key_iter_mut().next() {
            // SAFETY: as above.
            #[expect(unsafe_code, reason = "the bindings leave the care to who deletes")]
            let deleted = unsafe { key.delete() };
            deleted.map_err(|error| error.to_string())?;
        }
    }
    Ok(said)
}

/// Whether a body has a joint of these kinds.
fn has(body: &MjsBody, recurse: bool, of: &[MjtJoint]) -> bool {
    (body.joint_iter(recurse)).any(|joint| of.contains(&joint.type_()))
}

/// Whether a body of the world is free, or a mocap body, and nothing in it is an arm.
fn is_beside(body: &MjsBody) -> bool {
    !has(body, true, &[MjtJoint::mjJNT_HINGE, MjtJoint::mjJNT_SLIDE])
        && (has(body, false, &[MjtJoint::mjJNT_FREE]) || body.mocap())
}

/// What a body of the world is, if it is loose.
fn loose(body: &MjsBody, tied: &[String]) -> Option<&'static str> {
    if !is_beside(body) {
        return None;
    }
    let is_tied = names_in(body).iter().any(|name| tied.contains(name));
    if has(body, false, &[MjtJoint::mjJNT_FREE]) {
        // A weight that hangs on the arm is none of these.
        return (!is_tied).then_some("the free body");
    }
    (body.mocap() && is_tied).then_some("the mocap body")
}

/// The names of a body, its joints and those in it.
fn names_in(body: &MjsBody) -> Vec<String> {
    let joints = body.joint_iter(true).map(|each| each.name().to_owned());
    let bodies = body.body_iter(true).map(|each| each.name().to_owned());
    let sites = body.site_iter(true).map(|each| each.name().to_owned());
    let own = std::iter::once(body.name().to_owned());
    own.chain(bodies)
        .chain(joints)
        .chain(sites)
        .filter(|name| !name.is_empty())
        .collect()
}
