//! Monte Carlo studies: how good are plans over many runs?
//!
//! - `settings`: what a study is made of.
//! - [`model_level`]: a run of the paper's linear model, a few small products of matrices.
//! - [`robot_level`]: a run of the whole loop on the virtual robot in MuJoCo.
//! - [`tally`]: what is kept of the runs; exact, so that threads and order change no bit.
//! - [`runner`]: blocks of runs on all threads.
//! - [`summary`]: means, intervals, quantiles and checks from a tally.
//! - [`verdict`]: whether the observed accuracy is the predicted one.
//! - [`selection`]: readings chosen in several ways, the robot calibrated with each, and validated on all others.
//! - [`absolute`]: robots that are read as a plan of absolute readings says, identified and looked at.
//! - [`virtual_readings`]: what an instrument writes down of such a plan in a run.

pub mod absolute;
pub mod account;
pub mod deviations;
pub mod model_level;
pub mod robot_level;
pub mod runner;
pub mod selection;
mod settings;
pub mod summary;
pub mod tally;
pub mod verdict;
pub mod virtual_readings;

use thiserror::Error;

use crate::files::FileError;
use crate::plan::Plan;
use crate::task::Task;
use crate::testbed::Truth;
use tally::Failure;

pub use settings::{Conditions, Level, StudyPlan, StudySettings, StudySource};

/// A plan that takes part in a study.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Its name.
    pub name: String,
    /// The conditions that it is studied under, as an index.
    pub setting: usize,
    /// What is measured in each run.
    pub kind: EntryKind,
}

/// The task under the conditions of a part of the study, and the virtual robot.
#[derive(Debug, Clone)]
pub struct Setting<'a> {
    /// The conditions.
    pub conditions: Conditions,
    /// The task under these.
    pub task: Task,
    /// The virtual robot.
    pub truth: &'a Truth,
}

impl<'a> Setting<'a> {
    /// A task under some conditions.
    pub fn new(task: &Task, truth: &'a Truth, conditions: Conditions) -> Self {
        Self {
            conditions,
            task: conditions.of(task),
            truth,
        }
    }
}

/// What is measured in each run.
#[derive(Debug, Clone, PartialEq)]
pub enum EntryKind {
    /// A plan of the scenario's or the search's choice.
    Fixed(Plan),
    /// One plan drawn at random for all runs.
    Random(Plan),
    /// A fresh random feasible plan in every run.
    RandomEach,
}

impl EntryKind {
    /// The plan, where all runs have the same.
    pub const fn plan(&self) -> Option<&Plan> {
        match self {
            Self::Fixed(plan) | Self::Random(plan) => Some(plan),
            Self::RandomEach => None,
        }
    }
}

/// Why a study cannot be made.
#[derive(Debug, Clone, Error)]
pub enum StudyError {
    /// A plan fails in every run.
    #[error("plan {plan:?}: {}", failure.text())]
    Plan {
        /// The plan's name.
        plan: String,
        /// What is wrong with it.
        failure: Failure,
    },
    /// A plan has another number of measurements than the study.
    #[error("plan {plan:?}: found {found} measurements; the study's plans have {expected}")]
    Experiments {
        /// The plan's name.
        plan: String,
        /// The number of its measurements.
        found: u32,
        /// The study's number M.
        expected: u32,
    },
    /// There is nothing to compare.
    #[error("a study needs at least one plan")]
    NoPlan,
    /// The virtual robot's model lacks something.
    #[error("{0}")]
    Model(String),
    /// It was asked to stop.
    #[error("the study was stopped")]
    Stopped,
}

impl From<FileError> for StudyError {
    fn from(error: FileError) -> Self {
        Self::Model(error.to_string())
    }
}

/// The plan repeated as a whole until it has so many measurements; `None` where whole repetitions
/// do not make them up.
pub fn repeated(plan: &Plan, experiments: u32) -> Option<Plan> {
    let once = plan.measurements();
    if once == 0 || !experiments.is_multiple_of(once) {
        return None;
    }
    let mut plan = plan.clone();
    for each in &mut plan.experiments {
        each.repeats *= experiments / once;
    }
    Some(plan)
}
