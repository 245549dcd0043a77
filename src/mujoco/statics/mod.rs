//! What a model says that can move the arm's rest: honoured, or refused by name.
//!
//! The belief about the robot is a chain of joints, each an elastic element between its commanded and its actual angle,
//! under gravity and a load. MuJoCo can say much more. Of its model's fields
//!
//! - the chain, its masses, frames and names, gravity, linear springs and position actuators are honoured,
//! - contacts and joint limits are switched off in the statics,
//! - inertia, damping, sensors, pictures and how MuJoCo steps and solves move no arm at rest,
//! - and whatever else can move it is found by one of [`CHECKS`], which tells whether the value that a model gives can
//!   move the arm at all, and the element that gives it. The virtual robot obeys more than the belief does.

mod actuators;
mod elements;

use mujoco_rs::mujoco_c::mjVERSION_HEADER;

use super::Model;
use crate::files::FileError;

/// A new version of MuJoCo may bring fields and flags that move an arm's rest: each needs a check, or a reason for none.
const _: () = assert!(mjVERSION_HEADER == 3_017_000);

/// Where an element is obeyed that a belief would refuse.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Obeyed {
    /// By the virtual robot, since it rests where MuJoCo's own acceleration vanishes.
    InTruth,
    /// Nowhere.
    Never,
}

/// Finds the first element of a kind that can move the rest.
type StaticsCheck = fn(&Model) -> Option<FileError>;

const CHECKS: [(Obeyed, StaticsCheck); 16] = [
    (Obeyed::InTruth, elements::wind),
    (Obeyed::Never, elements::flags),
    (Obeyed::InTruth, elements::joint_springs),
    (Obeyed::InTruth, elements::tendon_springs),
    (Obeyed::Never, elements::tendon_limits),
    (Obeyed::Never, elements::friction),
    (Obeyed::InTruth, elements::equalities),
    (Obeyed::InTruth, elements::buoyancy),
    (Obeyed::Never, elements::flexes),
    (Obeyed::Never, elements::plugins),
    (Obeyed::InTruth, actuators::transmission),
    (Obeyed::InTruth, actuators::one_for_each_joint),
    (Obeyed::Never, actuators::state),
    (Obeyed::InTruth, actuators::law),
    (Obeyed::InTruth, actuators::force_limits),
    (Obeyed::InTruth, actuators::command_limits),
];

impl Model {
    /// Refuses a model of a belief in which something moves the arm's rest that its statics do not know.
    ///
    /// # Errors
    /// The first such element.
    pub fn check_statics(&self) -> Result<(), FileError> {
        self.found(&[Obeyed::InTruth, Obeyed::Never])
            .next()
            .map_or(Ok(()), Err)
    }

    /// Refuses a model of a virtual robot in which something moves its rest that no static equilibrium
    /// tells: forces with a state of their own, dry friction, deformable bodies.
    ///
    /// # Errors
    /// The first such element.
    pub fn check_rest(&self) -> Result<(), FileError> {
        self.found(&[Obeyed::Never]).next().map_or(Ok(()), Err)
    }

    /// What the virtual robot obeys of this model and a belief would refuse: an element of each kind, in
    /// words.
    pub fn beyond_belief(&self) -> Vec<String> {
        (self.found(&[Obeyed::InTruth]).map(|each| each.problem)).collect()
    }

    fn found(&self, kinds: &[Obeyed]) -> impl Iterator<Item = FileError> {
        let checks = CHECKS.iter().filter(|(kind, _)| kinds.contains(kind));
        checks.filter_map(|(_, check)| check(self))
    }
}
