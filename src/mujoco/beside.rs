//! What lies loose beside the arm: free bodies that are tied to nothing, and mocap bodies that something is tied to. Scenes for simulation have them, and no
//! statics: they are left out by name.

use mujoco_rs::error::MjEditError;
use mujoco_rs::prelude::{MjSpec, MjtJoint};
use mujoco_rs::wrappers::mj_editing::{MjsBody, SpecElement, SpecObject};

/// The joints of arms.
const OF_ARM: [MjtJoint; 2] = [MjtJoint::mjJNT_HINGE, MjtJoint::mjJNT_SLIDE];

/// Takes everything loose out of a specification; what was left out, in words.
pub(super) fn leave_out(spec: &mut MjSpec) -> Result<Vec<String>, MjEditError> {
    let mut said = Vec::new();
    if !has(spec.world_body_mut(), true, &OF_ARM) {
        return Ok(said);
    }
    loop {
        let beside: Vec<String> = (spec.world_body_mut().body_iter(false))
            .filter(|body| is_beside(body))
            .flat_map(names_in)
            .collect();
        // What is tied among themselves is tied to nothing.
        let (before, constraints) = (tendons(spec), constraints(spec));
        let tied: Vec<String> = (constraints.iter())
            .filter(|ends| !ends.iter().all(|name| beside.contains(name)))
            .flatten()
            .cloned()
            .collect();
        let mut bodies = spec.world_body_mut().body_iter_mut();
        let found = bodies.find_map(|body| loose(body, &tied).map(|what| (body, what)));
        let Some((body, what)) = found else { break };
        let names = names_in(body);
        let called = match body.name() {
            "" => "without a name".to_owned(),
            name => format!("{name:?}"),
        };
        delete(body)?;
        let left = tendons(spec);
        let gone: Vec<String> = (before.into_iter())
            .filter(|tendon| !left.contains(tendon))
            .map(|tendon| format!("{tendon:?}"))
            .collect();
        let mut with = match gone.as_slice() {
            [] => String::new(),
            gone => format!(" with what hangs on it, tendon {}", gone.join(", ")),
        };
        let is_of_it = |name: &str| names.iter().any(|each| each == name);
        for ends in constraints
            .iter()
            .filter(|ends| ends.iter().any(|name| is_of_it(name)))
        {
            let ends = ends.each_ref().map(|name| format!("{name:?}"));
            with += &format!(", with the equality constraint of {}", ends.join(" and "));
        }
        while let Some(equality) =
            (spec.equality_iter_mut()).find(|each| is_of_it(each.name1()) || is_of_it(each.name2()))
        {
            delete(equality)?;
        }
        said.push(format!(
            "{what} {called} is no part of the arm: it is left out{with}"
        ));
        // What would look at it plays no part in statics.
        while let Some(camera) =
            (spec.world_body_mut().camera_iter_mut(true)).find(|each| is_of_it(each.targetbody()))
        {
            delete(camera)?;
        }
        while let Some(light) =
            (spec.world_body_mut().light_iter_mut(true)).find(|each| is_of_it(each.targetbody()))
        {
            delete(light)?;
        }
        // They have coordinates of what is gone.
        while let Some(key) = spec.key_iter_mut().next() {
            delete(key)?;
        }
    }
    Ok(said)
}

/// The names of all tendons.
fn tendons(spec: &MjSpec) -> Vec<String> {
    spec.tendon_iter()
        .map(|each| each.name().to_owned())
        .collect()
}

/// The names of what each equality constraint ties.
fn constraints(spec: &MjSpec) -> Vec<[String; 2]> {
    spec.equality_iter()
        .map(|each| [each.name1(), each.name2()].map(str::to_owned))
        .collect()
}

/// Deletes an element.
pub(super) fn delete(element: &mut impl SpecObject) -> Result<(), MjEditError> {
    // SAFETY: each caller has found it just now by the only handle, which it gives up.
    #[expect(unsafe_code, reason = "the bindings leave the care to who deletes")]
    unsafe {
        element.delete()
    }
}

/// Whether a body has a joint of these kinds.
fn has(body: &MjsBody, recurse: bool, of: &[MjtJoint]) -> bool {
    (body.joint_iter(recurse)).any(|joint| of.contains(&joint.type_()))
}

/// Whether a body of the world is free, or a mocap body, and nothing in it is an arm.
fn is_beside(body: &MjsBody) -> bool {
    !has(body, true, &OF_ARM) && (has(body, false, &[MjtJoint::mjJNT_FREE]) || body.mocap())
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
