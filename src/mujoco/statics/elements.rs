//! Springs, friction, constraints, wind and what else pulls at an arm beside its actuators.

use mujoco_rs::prelude::{MjModel, MjtJoint};
use mujoco_rs::wrappers::mj_model::{MjtDisableBit, MjtEnableBit, MjtEq, MjtObjBase, MjtWrap};

use super::super::Model;
use super::{RefusedElement, TendonSpring, disabled, element};

/// What to do about most of them.
const REMOVE: &str = "remove it; what the model leaves out, the virtual robot leaves out, too";

/// Whether constraints of this kind act.
fn constrains(model: &MjModel, bit: MjtDisableBit) -> bool {
    !disabled(model, MjtDisableBit::mjDSBL_CONSTRAINT) && !disabled(model, bit)
}

/// A spring in a joint whose force is not linear.
pub(super) fn joint_springs(robot: &Model) -> Option<RefusedElement> {
    let model = &*robot.inner;
    let (stiffness, higher) = (model.jnt_stiffness(), model.jnt_stiffnesspoly());
    let joint = (0..stiffness.len()).find(|&joint| stiffens(0.0, &higher[joint]))?;
    let acts = !disabled(model, MjtDisableBit::mjDSBL_SPRING);
    acts.then(|| {
        let element = element(model, MjtObjBase::mjOBJ_JOINT, "joint", joint);
        let found = list(stiffness[joint], &higher[joint]);
        let problem = format!(
            "stiffness=\"{found}\" is a spring whose force is not linear; the statics know linear ones"
        );
        RefusedElement::new(element, problem, "give it one stiffness")
    })
}

/// A spring in a tendon that is not linear, or that does not run straight from site to site.
pub(super) fn tendon_springs(robot: &Model) -> Option<RefusedElement> {
    let model = &*robot.inner;
    stiff_tendons(model).find_map(|tendon| {
        let higher = &model.tendon_stiffnesspoly()[tendon];
        let found = list(model.tendon_stiffness()[tendon], higher);
        let what = if stiffens(0.0, higher) {
            "whose force is not linear"
        } else if sites_of(model, tendon).is_none() {
            "that does not run straight from site to site"
        } else {
            return None;
        };
        let problem = format!(
            "stiffness=\"{found}\" is a spring {what}; the statics know linear springs through sites"
        );
        Some(RefusedElement::new(tendon_element(model, tendon), problem, REMOVE))
    })
}

/// The tendons with springs that act.
fn stiff_tendons(model: &MjModel) -> impl Iterator<Item = usize> + '_ {
    let (stiffness, higher) = (model.tendon_stiffness(), model.tendon_stiffnesspoly());
    let acts = !disabled(model, MjtDisableBit::mjDSBL_SPRING);
    (0..stiffness.len()).filter(move |&tendon| acts && stiffens(stiffness[tendon], &higher[tendon]))
}

/// The sites that a tendon goes through; none where it has anything else on its way.
fn sites_of(model: &MjModel, tendon: usize) -> Option<Vec<usize>> {
    let first = model.tendon_adr()[tendon].unsigned_abs() as usize;
    let count = model.tendon_num()[tendon].unsigned_abs() as usize;
    (first..first + count)
        .map(|each| {
            (model.wrap_type()[each] == MjtWrap::mjWRAP_SITE)
                .then(|| model.wrap_objid()[each].unsigned_abs() as usize)
        })
        .collect()
}

/// The springs that the chain knows.
pub(super) fn springs_between_sites(robot: &Model) -> Vec<TendonSpring> {
    let model = &*robot.inner;
    stiff_tendons(model)
        .filter_map(|tendon| {
            let name = model.id_to_name(MjtObjBase::mjOBJ_TENDON, tendon);
            Some(TendonSpring {
                name: name.map_or_else(|| format!("tendon {tendon}"), str::to_owned),
                stiffness_n_per_m: model.tendon_stiffness()[tendon],
                rest_m: model.tendon_lengthspring()[tendon],
                sites: sites_of(model, tendon)?,
            })
        })
        .collect()
}

fn stiffens(linear: f64, higher: &[f64]) -> bool {
    linear != 0.0 || higher.iter().any(|&each| each != 0.0)
}

/// Numbers as the attribute has them; the higher ones only where they are given.
fn list(linear: f64, higher: &[f64]) -> String {
    let mut text = linear.to_string();
    if higher.iter().any(|&each| each != 0.0) {
        for each in higher {
            text += &format!(" {each}");
        }
    }
    text
}

fn tendon_element(model: &MjModel, tendon: usize) -> String {
    element(model, MjtObjBase::mjOBJ_TENDON, "tendon", tendon)
}

/// A tendon that can become taut.
pub(super) fn tendon_limits(robot: &Model) -> Option<RefusedElement> {
    let model = &*robot.inner;
    let tendon = model.tendon_limited().iter().position(|&limited| limited)?;
    constrains(model, MjtDisableBit::mjDSBL_LIMIT).then(|| {
        let [low, high] = model.tendon_range()[tendon];
        let problem = format!("range=\"{low} {high}\" holds the arm where it becomes taut");
        RefusedElement::new(tendon_element(model, tendon), problem, REMOVE)
    })
}

/// Dry friction lets an arm rest in many places.
pub(super) fn joint_friction(robot: &Model) -> Option<RefusedElement> {
    let model = &*robot.inner;
    let friction = model.dof_frictionloss();
    let dof = friction.iter().position(|&loss| loss != 0.0)?;
    constrains(model, MjtDisableBit::mjDSBL_FRICTIONLOSS).then(|| {
        let joint = model.dof_jntid()[dof].unsigned_abs() as usize;
        let element = element(model, MjtObjBase::mjOBJ_JOINT, "joint", joint);
        let problem = format!(
            "frictionloss=\"{}\" lets it stick away from its equilibrium",
            friction[dof]
        );
        RefusedElement::new(element, problem, "set it to 0; damping may stay")
    })
}

/// The same of tendons.
pub(super) fn tendon_friction(robot: &Model) -> Option<RefusedElement> {
    let model = &*robot.inner;
    let friction = model.tendon_frictionloss();
    let tendon = friction.iter().position(|&loss| loss != 0.0)?;
    constrains(model, MjtDisableBit::mjDSBL_FRICTIONLOSS).then(|| {
        let problem = format!(
            "frictionloss=\"{}\" lets the arm stick away from its equilibrium",
            friction[tendon]
        );
        RefusedElement::new(tendon_element(model, tendon), problem, REMOVE)
    })
}

/// The equality constraints that act.
pub(super) fn acting_equalities(model: &MjModel) -> impl Iterator<Item = usize> + use<> {
    let acts = constrains(model, MjtDisableBit::mjDSBL_EQUALITY);
    let active: Vec<bool> = model.eq_active0().to_vec();
    (0..active.len()).filter(move |&equality| acts && active[equality])
}

/// An equality constraint as a person finds it in the file.
pub(super) fn equality_element(model: &MjModel, equality: usize) -> String {
    let kind = match model.eq_type()[equality] {
        MjtEq::mjEQ_CONNECT => "connect",
        MjtEq::mjEQ_WELD => "weld",
        MjtEq::mjEQ_JOINT => "joint",
        MjtEq::mjEQ_TENDON => "tendon",
        _ => "constraint",
    };
    let tag = format!("equality/{kind}");
    element(model, MjtObjBase::mjOBJ_EQUALITY, &tag, equality)
}

/// What multiplies the sine of half the angle in a weld's residual (m).
pub(super) fn weld_scale(model: &MjModel, equality: usize) -> Option<f64> {
    // Where MuJoCo has the attribute torquescale.
    let scale = model.eq_data()[equality][10];
    (model.eq_type()[equality] == MjtEq::mjEQ_WELD && scale > 0.0).then_some(scale)
}

/// Whether the residual of an equality constraint is an angle (true) or a length (false).
pub(super) fn couples_angles(model: &MjModel, equality: usize) -> Option<bool> {
    match model.eq_type()[equality] {
        MjtEq::mjEQ_CONNECT | MjtEq::mjEQ_WELD | MjtEq::mjEQ_TENDON => Some(false),
        MjtEq::mjEQ_JOINT => {
            let joint = model.eq_obj1id()[equality].unsigned_abs() as usize;
            Some(model.jnt_type()[joint] == MjtJoint::mjJNT_HINGE)
        }
        _ => None,
    }
}

/// Joints that are coupled, bodies that are tied to each other.
pub(super) fn equalities(robot: &Model) -> Option<RefusedElement> {
    let model = &*robot.inner;
    let equality = acting_equalities(model).next()?;
    Some(RefusedElement::new(
        equality_element(model, equality),
        "ties joints or bodies to each other; the statics know a free serial chain only",
        "remove it, or give it active=\"false\"",
    ))
}

/// A body whose weight is compensated by more than itself, or less than nothing.
pub(super) fn buoyancy(robot: &Model) -> Option<RefusedElement> {
    let model = &*robot.inner;
    let compensation = model.body_gravcomp();
    let body = (compensation.iter()).position(|share| !(0.0..=1.0).contains(share))?;
    let problem = format!("gravcomp=\"{}\"; 0 to 1 is allowed", compensation[body]);
    Some(RefusedElement::new(
        element(model, MjtObjBase::mjOBJ_BODY, "body", body),
        problem,
        "a part of its own weight is all that can be taken off a body",
    ))
}

/// Wind pulls at a robot at rest, where there is a medium.
pub(super) fn wind(robot: &Model) -> Option<RefusedElement> {
    let model = &*robot.inner;
    let option = model.opt();
    let blows = option.wind.iter().any(|&speed| speed != 0.0)
        && (option.density > 0.0 || option.viscosity > 0.0);
    blows.then(|| {
        let [x, y, z] = option.wind;
        let problem = format!("wind=\"{x} {y} {z}\" with density or viscosity pulls at the robot");
        RefusedElement::new("option".to_owned(), problem, "remove the wind")
    })
}

/// A simulation that may fall asleep before it rests.
pub(super) fn sleep(robot: &Model) -> Option<RefusedElement> {
    let model = &*robot.inner;
    (model.opt().enableflags & MjtEnableBit::mjENBL_SLEEP as i32 != 0).then(|| {
        RefusedElement::new(
            "option/flag".to_owned(),
            "sleep=\"enable\" stops the robot before it has come to rest",
            "remove the flag",
        )
    })
}

/// Bodies that bend by themselves.
pub(super) fn flexes(robot: &Model) -> Option<RefusedElement> {
    let model = &*robot.inner;
    (model.ffi().nflex > 0).then(|| {
        RefusedElement::new(
            element(model, MjtObjBase::mjOBJ_FLEX, "flex", 0),
            "is a deformable body; the statics know rigid links only",
            REMOVE,
        )
    })
}

/// Plugins that pull at bodies.
pub(super) fn plugins(robot: &Model) -> Option<RefusedElement> {
    let model = &*robot.inner;
    let body = model.body_plugin().iter().position(|&plugin| plugin >= 0)?;
    Some(RefusedElement::new(
        element(model, MjtObjBase::mjOBJ_BODY, "body", body),
        "has a plugin; its force is not known",
        REMOVE,
    ))
}
