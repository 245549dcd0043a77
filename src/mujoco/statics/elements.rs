//! Springs, friction, constraints, wind and what else pulls at an arm beside its actuators.

use std::ops::Range;

use mujoco_rs::prelude::MjtJoint;
use mujoco_rs::wrappers::mj_model::{MjtDisableBit, MjtEnableBit, MjtEq, MjtObjBase, MjtWrap};

use super::super::Model;
use crate::files::FileError;
use crate::mujoco::servo::disabled;

/// What to do about most of them.
const REMOVE: &str = "remove it; what the model leaves out, the virtual robot leaves out, too";

/// A spring along a spatial tendon through sites.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TendonSpring {
    /// The tendon's name.
    pub name: String,
    /// Its stiffness (N/m).
    pub stiffness_n_per_m: f64,
    /// The range of lengths at which it is relaxed (m).
    pub rest_m: [f64; 2],
    /// The sites that it goes through.
    pub sites: Vec<usize>,
}

/// Whether constraints of this kind act.
fn constrains(robot: &Model, bit: MjtDisableBit) -> bool {
    !disabled(&robot.inner, MjtDisableBit::mjDSBL_CONSTRAINT) && !disabled(&robot.inner, bit)
}

impl Model {
    /// An element as a person finds it in the file: its tag and its name, or its number from 0.
    pub(in crate::mujoco) fn element(&self, tag: &str, id: usize) -> String {
        let kind = match tag {
            "joint" => MjtObjBase::mjOBJ_JOINT,
            "actuator" => MjtObjBase::mjOBJ_ACTUATOR,
            "tendon" => MjtObjBase::mjOBJ_TENDON,
            "body" => MjtObjBase::mjOBJ_BODY,
            "flex" => MjtObjBase::mjOBJ_FLEX,
            _ => MjtObjBase::mjOBJ_EQUALITY,
        };
        let name = self.inner.id_to_name(kind, id);
        name.map_or_else(|| format!("{tag} {id}"), |name| format!("{tag} {name:?}"))
    }

    /// The tendons with springs that act.
    fn stiff_tendons(&self) -> impl Iterator<Item = usize> {
        let (stiffness, higher) = (
            self.inner.tendon_stiffness(),
            self.inner.tendon_stiffnesspoly(),
        );
        let acts = !disabled(&self.inner, MjtDisableBit::mjDSBL_SPRING);
        (0..stiffness.len())
            .filter(move |&tendon| acts && stiffens(stiffness[tendon], &higher[tendon]))
    }

    /// What a tendon runs over, by its places among all that tendons do.
    pub(in crate::mujoco) fn wraps(&self, tendon: usize) -> Range<usize> {
        let [first, count] = [self.inner.tendon_adr(), self.inner.tendon_num()]
            .map(|each| each[tendon].unsigned_abs() as usize);
        first..first + count
    }

    /// The sites that a tendon goes through; none where it has anything else on its way.
    fn sites_of_tendon(&self, tendon: usize) -> Option<Vec<usize>> {
        let model = &self.inner;
        let site = |each: usize| {
            (model.wrap_type()[each] == MjtWrap::mjWRAP_SITE)
                .then(|| model.wrap_objid()[each].unsigned_abs() as usize)
        };
        self.wraps(tendon).map(site).collect()
    }

    /// The springs of tendons that the chain knows.
    pub(crate) fn tendon_springs(&self) -> Vec<TendonSpring> {
        let spring = |tendon| {
            Some(TendonSpring {
                name: self.name(MjtObjBase::mjOBJ_TENDON, "tendon", tendon),
                stiffness_n_per_m: self.inner.tendon_stiffness()[tendon],
                rest_m: self.inner.tendon_lengthspring()[tendon],
                sites: self.sites_of_tendon(tendon)?,
            })
        };
        self.stiff_tendons().filter_map(spring).collect()
    }

    /// The equality constraints that act.
    pub(in crate::mujoco) fn equalities(&self) -> impl Iterator<Item = usize> + use<> {
        let acts = constrains(self, MjtDisableBit::mjDSBL_EQUALITY);
        let active: Vec<bool> = self.inner.eq_active0().to_vec();
        (0..active.len()).filter(move |&equality| acts && active[equality])
    }

    /// Whether the model has equality constraints that act.
    pub fn has_equalities(&self) -> bool {
        self.equalities().next().is_some()
    }

    /// An equality constraint as a person finds it in the file.
    pub(in crate::mujoco) fn equality_element(&self, equality: usize) -> String {
        let kind = match self.inner.eq_type()[equality] {
            MjtEq::mjEQ_CONNECT => "connect",
            MjtEq::mjEQ_WELD => "weld",
            MjtEq::mjEQ_JOINT => "joint",
            MjtEq::mjEQ_TENDON => "tendon",
            _ => "constraint",
        };
        self.element(&format!("equality/{kind}"), equality)
    }

    /// What multiplies the sine of half the angle in a weld's residual (m); none for other constraints, and
    /// where a weld leaves the orientation free.
    pub(in crate::mujoco) fn weld_scale(&self, equality: usize) -> Option<f64> {
        // Where MuJoCo has the attribute torquescale.
        let scale = self.inner.eq_data()[equality][10];
        (self.inner.eq_type()[equality] == MjtEq::mjEQ_WELD && scale > 0.0).then_some(scale)
    }

    /// Whether the residual of an equality constraint is an angle (true) or a length (false); none where it is neither.
    pub(in crate::mujoco) fn couples_angles(&self, equality: usize) -> Option<bool> {
        let turns = |joint: i32| {
            self.inner.jnt_type()[joint.unsigned_abs() as usize] == MjtJoint::mjJNT_HINGE
        };
        let first = self.inner.eq_obj1id()[equality];
        match self.inner.eq_type()[equality] {
            MjtEq::mjEQ_CONNECT | MjtEq::mjEQ_WELD => Some(false),
            MjtEq::mjEQ_JOINT => Some(turns(first)),
            MjtEq::mjEQ_TENDON => {
                // The length of a fixed tendon is a sum over joints.
                let wraps = self.wraps(first.unsigned_abs() as usize);
                let is_sum = wraps
                    .clone()
                    .all(|each| self.inner.wrap_type()[each] == MjtWrap::mjWRAP_JOINT);
                let mut angles = wraps.map(|each| is_sum && turns(self.inner.wrap_objid()[each]));
                let is_angle = angles.next()?;
                angles.all(|each| each == is_angle).then_some(is_angle)
            }
            _ => None,
        }
    }
}

fn stiffens(linear: f64, higher: &[f64]) -> bool {
    linear != 0.0 || higher.iter().any(|&each| each != 0.0)
}

/// Numbers as the attribute has them; the higher ones only where they are given.
fn list(linear: f64, higher: &[f64]) -> String {
    let higher = if stiffens(0.0, higher) { higher } else { &[] };
    let all = std::iter::once(&linear).chain(higher);
    all.map(f64::to_string).collect::<Vec<_>>().join(" ")
}

/// A spring in a joint whose force is not linear.
pub(super) fn joint_springs(robot: &Model) -> Option<FileError> {
    let higher = robot.inner.jnt_stiffnesspoly();
    let joint = higher.iter().position(|higher| stiffens(0.0, higher))?;
    (!disabled(&robot.inner, MjtDisableBit::mjDSBL_SPRING)).then(|| {
        let found = list(robot.inner.jnt_stiffness()[joint], &higher[joint]);
        let problem = format!(
            "stiffness=\"{found}\" is a spring whose force is not linear; the statics know linear ones"
        );
        robot.not_static(robot.element("joint", joint), problem, "give it one stiffness")
    })
}

/// A spring in a tendon that is not linear, or that does not run straight from site to site.
pub(super) fn tendon_springs(robot: &Model) -> Option<FileError> {
    robot.stiff_tendons().find_map(|tendon| {
        let higher = &robot.inner.tendon_stiffnesspoly()[tendon];
        let found = list(robot.inner.tendon_stiffness()[tendon], higher);
        let what = if stiffens(0.0, higher) {
            "whose force is not linear"
        } else if robot.sites_of_tendon(tendon).is_none() {
            "that does not run straight from site to site"
        } else {
            return None;
        };
        let problem = format!(
            "stiffness=\"{found}\" is a spring {what}; the statics know linear springs through sites"
        );
        Some(robot.not_static(robot.element("tendon", tendon), problem, REMOVE))
    })
}

/// A tendon that can become taut.
pub(super) fn tendon_limits(robot: &Model) -> Option<FileError> {
    let limited = robot.inner.tendon_limited();
    let tendon = limited.iter().position(|&limited| limited)?;
    constrains(robot, MjtDisableBit::mjDSBL_LIMIT).then(|| {
        let [low, high] = robot.inner.tendon_range()[tendon];
        let problem = format!("range=\"{low} {high}\" holds the arm where it becomes taut");
        robot.not_static(robot.element("tendon", tendon), problem, REMOVE)
    })
}

/// Dry friction, in joints or tendons, lets an arm rest in many places.
pub(super) fn friction(robot: &Model) -> Option<FileError> {
    let loss = |all: &[f64]| all.iter().copied().enumerate().find(|each| each.1 != 0.0);
    let (element, what, loss, hint) =
        if let Some((degree, found)) = loss(robot.inner.dof_frictionloss()) {
            let element = robot.element("joint", robot.joint_of_degree(degree));
            (element, "it", found, "set it to 0; damping may stay")
        } else {
            let (tendon, found) = loss(robot.inner.tendon_frictionloss())?;
            (robot.element("tendon", tendon), "the arm", found, REMOVE)
        };
    constrains(robot, MjtDisableBit::mjDSBL_FRICTIONLOSS).then(|| {
        let problem =
            format!("frictionloss=\"{loss}\" lets {what} stick away from its equilibrium");
        robot.not_static(element, problem, hint)
    })
}

/// Joints that are coupled, bodies that are tied to each other.
pub(super) fn equalities(robot: &Model) -> Option<FileError> {
    let equality = robot.equalities().next()?;
    Some(robot.not_static(
        robot.equality_element(equality),
        "ties joints or bodies to each other; the statics know a free serial chain only",
        "remove it, in a URDF the <mimic> of its joint, or give it active=\"false\"",
    ))
}

/// A body whose weight is compensated by more than itself, or less than nothing.
pub(super) fn buoyancy(robot: &Model) -> Option<FileError> {
    let compensation = robot.inner.body_gravcomp();
    let body = (compensation.iter()).position(|share| !(0.0..=1.0).contains(share))?;
    Some(robot.not_static(
        robot.element("body", body),
        format!("gravcomp=\"{}\"; 0 to 1 is allowed", compensation[body]),
        "a part of its own weight is all that can be taken off a body",
    ))
}

/// Wind pulls at a robot at rest, where there is a medium.
pub(super) fn wind(robot: &Model) -> Option<FileError> {
    let option = robot.inner.opt();
    let [x, y, z] = option.wind;
    let blows = option.wind.iter().any(|&speed| speed != 0.0)
        && (option.density > 0.0 || option.viscosity > 0.0);
    blows.then(|| {
        let problem = format!("wind=\"{x} {y} {z}\" with density or viscosity pulls at the robot");
        robot.not_static("option", problem, "remove the wind")
    })
}

/// Flags by which every joint is let go, or the robot falls asleep before it rests.
pub(super) fn flags(robot: &Model) -> Option<FileError> {
    let problem = if disabled(&robot.inner, MjtDisableBit::mjDSBL_ACTUATION) {
        "actuation=\"disable\" lets go of every joint"
    } else if robot.inner.opt().enableflags & MjtEnableBit::mjENBL_SLEEP as i32 != 0 {
        "sleep=\"enable\" stops the robot before it has come to rest"
    } else {
        return None;
    };
    Some(robot.not_static("option/flag", problem, "remove the flag"))
}

/// Bodies that bend by themselves.
pub(super) fn flexes(robot: &Model) -> Option<FileError> {
    (robot.inner.ffi().nflex > 0).then(|| {
        let problem = "is a deformable body; the statics know rigid links only";
        robot.not_static(robot.element("flex", 0), problem, REMOVE)
    })
}

/// Plugins that pull at bodies.
pub(super) fn plugins(robot: &Model) -> Option<FileError> {
    let plugins = robot.inner.body_plugin();
    let body = plugins.iter().position(|&plugin| plugin >= 0)?;
    let problem = "has a plugin; its force is not known";
    Some(robot.not_static(robot.element("body", body), problem, REMOVE))
}
