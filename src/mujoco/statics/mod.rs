//! What a model says that can move the arm's rest: honoured, or refused by name.
//!
//! The belief about the robot is a chain of joints, each an elastic element between its commanded
//! and its actual angle, under gravity and a load. MuJoCo can say much more. [`fields`] puts every
//! field of MuJoCo's model into one of five classes; for those that are refused, a check tells
//! whether the value that a model gives can move the arm at all, and the element that gives it. The
//! virtual robot obeys more than the belief does.

mod actuators;
mod elements;
mod fields;

use mujoco_rs::prelude::MjModel;
use mujoco_rs::wrappers::mj_model::MjtObjBase;

use super::servo::{Servo, disabled};
use super::{Model, ModelError};

/// What becomes of a group of fields of MuJoCo's model.
#[derive(Debug, Clone, Copy)]
enum Treatment {
    /// The chain, the virtual robot and the instrument's view use it.
    Honoured,
    /// It acts where contacts or joint limits do, and these are switched off in the statics.
    SwitchedOff,
    /// It moves no arm at rest.
    WithoutInfluence,
    /// The virtual robot obeys it, since it rests where MuJoCo's own acceleration vanishes; a belief in
    /// which it can move the arm's rest is refused.
    InTruth(fn(&Model) -> Option<RefusedElement>),
    /// A model in which it can move the arm's rest is refused.
    Refused(fn(&Model) -> Option<RefusedElement>),
}

/// An element of the model that the statics cannot honour.
#[derive(Debug)]
struct RefusedElement {
    /// The element as the file has it, such as `joint "joint_2"`.
    element: String,
    /// What it says and what that would do.
    problem: String,
    /// What to do about it.
    hint: String,
}

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

impl RefusedElement {
    fn new(element: String, problem: impl Into<String>, hint: impl Into<String>) -> Self {
        Self {
            element,
            problem: problem.into(),
            hint: hint.into(),
        }
    }
}

impl Model {
    /// Refuses a model of a belief in which something moves the arm's rest that its statics do not know.
    ///
    /// # Errors
    /// [`ModelError::Statics`] with the first such element.
    pub fn check_statics(&self) -> Result<(), ModelError> {
        let refusal = treatments().find_map(|treatment| match treatment {
            Treatment::InTruth(check) | Treatment::Refused(check) => check(self),
            _ => None,
        });
        refusal.map_or(Ok(()), |refusal| Err(self.refused(refusal)))
    }

    /// Refuses a model of a virtual robot in which something moves its rest that no static equilibrium
    /// tells: forces with a state of their own, dry friction, deformable bodies.
    ///
    /// # Errors
    /// [`ModelError::Statics`] with the first such element.
    pub fn check_rest(&self) -> Result<(), ModelError> {
        let refusal = treatments().find_map(|treatment| match treatment {
            Treatment::Refused(check) => check(self),
            _ => None,
        });
        refusal.map_or(Ok(()), |refusal| Err(self.refused(refusal)))
    }

    /// What the virtual robot obeys of this model and a belief would refuse: an element of each kind, in
    /// words.
    pub fn beyond_belief(&self) -> Vec<String> {
        treatments()
            .filter_map(|treatment| match treatment {
                Treatment::InTruth(check) => check(self),
                _ => None,
            })
            .map(|refusal| format!("{}: {}", refusal.element, refusal.problem))
            .collect()
    }

    /// The equality constraints that act.
    pub(super) fn equalities(&self) -> impl Iterator<Item = usize> + use<> {
        elements::acting_equalities(&self.inner)
    }

    /// Whether the model has equality constraints that act.
    pub fn has_equalities(&self) -> bool {
        self.equalities().next().is_some()
    }

    /// An equality constraint as a person finds it in the file.
    pub(super) fn equality_element(&self, equality: usize) -> String {
        elements::equality_element(&self.inner, equality)
    }

    /// Whether an equality constraint ties angles to each other; none where its residual is neither an
    /// angle nor a length.
    pub(super) fn couples_angles(&self, equality: usize) -> Option<bool> {
        elements::couples_angles(&self.inner, equality)
    }

    /// What multiplies the sine of half the angle in a weld's residual (m); none for other constraints, and
    /// where a weld leaves the orientation free.
    pub(super) fn weld_scale(&self, equality: usize) -> Option<f64> {
        elements::weld_scale(&self.inner, equality)
    }

    /// The error for a joint of a virtual robot that is to be commanded and that is not held by one
    /// position actuator.
    pub(crate) fn check_commanded(&self, joint: usize) -> Result<(), ModelError> {
        let position = Servo::of(&self.inner, joint).filter(|servo| servo.is_position(&self.inner));
        match position.count() {
            1 => Ok(()),
            _ => Err(self.refused(actuators::not_commanded(&self.inner, joint))),
        }
    }

    /// The error for a joint that cannot be locked.
    pub(super) fn not_lockable(&self, joint: usize) -> ModelError {
        self.refused(RefusedElement::new(
            element(&self.inner, MjtObjBase::mjOBJ_JOINT, "joint", joint),
            "is neither a hinge nor a slide and cannot be locked",
            "remove it from the model",
        ))
    }

    /// The springs of tendons, each with its name and what the chain needs to know of it.
    pub(crate) fn tendon_springs(&self) -> Vec<TendonSpring> {
        elements::springs_between_sites(self)
    }

    /// The error for a joint that no actuator holds.
    pub(super) fn not_held(&self, joint: usize) -> ModelError {
        self.refused(actuators::not_held(&self.inner, joint))
    }

    fn refused(&self, refusal: RefusedElement) -> ModelError {
        ModelError::Statics {
            path: self.path.clone(),
            element: refusal.element,
            problem: refusal.problem,
            hint: refusal.hint,
        }
    }
}

/// What becomes of every field.
fn treatments() -> impl Iterator<Item = &'static Treatment> {
    fields::OPTION.iter().chain(fields::MODEL)
}

/// An element as a person finds it in the file: its tag and its name, or its number from 0.
fn element(model: &MjModel, kind: MjtObjBase, tag: &str, id: usize) -> String {
    model
        .id_to_name(kind, id)
        .map_or_else(|| format!("{tag} {id}"), |name| format!("{tag} {name:?}"))
}
