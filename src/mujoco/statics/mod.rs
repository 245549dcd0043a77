//! What a model says that can move the arm's rest: honoured, or refused by name.
//!
//! The belief about the robot is a chain of joints, each an elastic element between its commanded
//! and its actual angle, under gravity and a load. MuJoCo can say much more. [`fields`] puts every
//! field of MuJoCo's model into one of four classes; for those that are refused, a check tells
//! whether the value that a model gives can move the arm at all, and the element that gives it.

mod actuators;
mod elements;
mod fields;
mod servo;

use mujoco_rs::prelude::MjModel;
use mujoco_rs::wrappers::mj_model::{MjtDisableBit, MjtObjBase};

use super::{Model, ModelError};

pub(super) use actuators::command_range;
pub(super) use servo::Servo;

/// What becomes of a group of fields of MuJoCo's model.
#[derive(Debug, Clone, Copy)]
enum Treatment {
    /// The chain, the virtual robot and the instrument's view use it.
    Honoured,
    /// It acts where contacts or joint limits do, and these are switched off in the statics.
    SwitchedOff,
    /// It moves no arm at rest.
    WithoutInfluence,
    /// A model in which it can move the arm's rest is refused.
    Refused(fn(&MjModel) -> Option<Refusal>),
}

/// An element of the model that the statics cannot honour.
#[derive(Debug)]
struct Refusal {
    /// The element as the file has it, such as `joint "joint_2"`.
    element: String,
    /// What it says and what that would do.
    problem: String,
    /// What to do about it.
    hint: String,
}

impl Refusal {
    fn new(element: String, problem: impl Into<String>, hint: impl Into<String>) -> Self {
        Self {
            element,
            problem: problem.into(),
            hint: hint.into(),
        }
    }
}

impl Model {
    /// Refuses a model in which something moves the arm's rest that the statics do not know.
    ///
    /// # Errors
    /// [`ModelError::Statics`] with the first such element.
    pub fn check_statics(&self) -> Result<(), ModelError> {
        let refusal = fields::OPTION
            .iter()
            .chain(fields::MODEL)
            .find_map(|treatment| match treatment {
                Treatment::Refused(check) => check(&self.inner),
                _ => None,
            });
        refusal.map_or(Ok(()), |refusal| Err(self.refused(refusal)))
    }

    /// The error for a joint that no actuator holds.
    pub(super) fn not_held(&self, joint: usize) -> ModelError {
        self.refused(actuators::not_held(&self.inner, joint))
    }

    fn refused(&self, refusal: Refusal) -> ModelError {
        ModelError::Statics {
            path: self.path.clone(),
            element: refusal.element,
            problem: refusal.problem,
            hint: refusal.hint,
        }
    }
}

/// Whether `<option><flag .../>` disables what the bit stands for.
pub(super) fn disabled(model: &MjModel, bit: MjtDisableBit) -> bool {
    model.opt().disableflags & bit as i32 != 0
}

/// An element as a person finds it in the file: its tag and its name, or its number from 0.
fn element(model: &MjModel, kind: MjtObjBase, tag: &str, id: usize) -> String {
    model
        .id_to_name(kind, id)
        .map_or_else(|| format!("{tag} {id}"), |name| format!("{tag} {name:?}"))
}
