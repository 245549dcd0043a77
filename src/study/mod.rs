//! Monte Carlo studies: how good are plans over many runs?
//!
//! - `settings`: what a study is made of.
//! - [`model_level`]: a run of the paper's linear model, a few small products of matrices.
//! - [`robot_level`]: a run of the whole loop on the virtual robot in MuJoCo.
//! - [`tally`]: what is kept of the runs; exact, so that threads and order change no bit.
//! - [`runner`]: blocks of runs on all threads.
//! - [`snapshots`]: after which of them it is looked at how far the study has come.
//! - [`summary`]: means, intervals, quantiles and checks from a tally.
//! - [`verdict`]: whether the observed accuracy is the predicted one.
//! - [`absolute`]: a run of a plan of absolute readings: the virtual robot is read, identified and looked at.
//! - [`carried_out`]: what its robot does in each row and at the test poses.
//! - [`selection`]: readings chosen in several ways, the robot calibrated with each, and validated on all others.
//! - [`virtual_readings`]: what an instrument writes down of such a plan in a run.

pub mod absolute;
pub mod account;
pub mod carried_out;
pub mod deviations;
pub mod model_level;
pub mod robot_level;
pub mod runner;
pub mod selection;
mod settings;
pub mod snapshots;
pub mod summary;
pub mod tally;
pub mod verdict;
pub mod virtual_readings;

use std::path::Path;
use std::sync::Arc;

use thiserror::Error;

use crate::experiment::{Plan, read_plan, write_candidates, write_plan};
use crate::files::FileError;
use crate::identification::ParameterGroup;
use crate::plan::absolute::AbsolutePlanning;
use crate::plan::search::{CandidatePlan, measurements_in};
use crate::task::{AccuracyKind, Task};
use crate::testbed::Truth;
use tally::Failure;

pub use settings::{Conditions, Level, StudyPlan, StudySettings, StudySource};

/// A plan that takes part in a study.
#[derive(Debug)]
pub struct Entry<'a> {
    /// Its name.
    pub name: String,
    /// The conditions that it is studied under, as an index.
    pub setting: usize,
    /// What is measured in each run; none where every run has a fresh random feasible plan.
    pub plan: Option<TakenPlan<'a>>,
    /// Whether it was drawn at random: others are compared with it.
    pub is_random: bool,
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

/// A plan, whatever is measured.
#[derive(Debug, Clone)]
pub enum TakenPlan<'a> {
    /// Deflections.
    Deflections(Plan),
    /// Absolute readings.
    Readings(Arc<TakenReadings<'a>>),
}

/// A plan of absolute readings.
#[derive(Debug)]
pub struct TakenReadings<'a> {
    /// The readings that there may be.
    pub planning: AbsolutePlanning<'a>,
    /// The plan: candidates by their places, and how often each is read.
    pub plan: CandidatePlan,
    /// What is unknown besides what the belief says.
    pub groups: &'a [ParameterGroup],
}

impl<'a> TakenPlan<'a> {
    /// The plan in a file, of what a task measures.
    ///
    /// # Errors
    /// The file is none, or has readings that cannot be taken.
    pub fn read(
        task: &'a Task,
        groups: &'a [ParameterGroup],
        path: &Path,
    ) -> Result<Self, FileError> {
        if task.design.accuracy == AccuracyKind::Relative {
            return read_plan(path, task.belief.commands()).map(Self::Deflections);
        }
        let planning = AbsolutePlanning::of_file(task, groups, path)?;
        Ok(Self::of_readings(planning.whole(), planning, groups))
    }

    /// Absolute readings.
    pub fn of_readings(
        plan: CandidatePlan,
        planning: AbsolutePlanning<'a>,
        groups: &'a [ParameterGroup],
    ) -> Self {
        Self::Readings(Arc::new(TakenReadings {
            planning,
            plan,
            groups,
        }))
    }

    /// Writes it.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, task: &Task, path: &Path) -> Result<(), FileError> {
        let commands = task.belief.commands();
        match self {
            Self::Deflections(plan) => write_plan(path, commands, plan),
            Self::Readings(taken) => {
                write_candidates(path, commands, &taken.planning.rows(&taken.plan))
            }
        }
    }

    /// How often something is measured.
    pub fn measurements(&self) -> u32 {
        match self {
            Self::Deflections(plan) => plan.measurements(),
            Self::Readings(taken) => measurements_in(&taken.plan),
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
    #[error(transparent)]
    Model(#[from] FileError),
    /// It was asked to stop.
    #[error("the study was stopped")]
    Stopped,
    /// Nothing tells where the machining tool is.
    #[error("no reading of the plan is of {0}, whose place is predicted: no run can show it")]
    Unread(String),
    /// Nothing is predicted of a plan of absolute readings.
    #[error("there is no predicted accuracy: the plan does not determine the tool's place")]
    NoPrediction,
    /// No virtual robot could be judged.
    #[error("no robot of {robots} could be identified and looked at: {first}")]
    AllFailed {
        /// How many there were.
        robots: u64,
        /// What the first failed by.
        first: String,
    },
}

impl StudyError {
    /// What to do about it.
    pub const fn hint(&self) -> Option<&'static str> {
        match self {
            Self::Plan {
                failure: Failure::Undetermined,
                ..
            } => Some(
                "plan more experiments, or give the study another seed: random plans of few experiments may determine too little",
            ),
            _ => None,
        }
    }
}

/// The plan repeated as a whole until it has so many measurements; `None` where whole repetitions
/// do not make them up.
pub fn repeated(plan: &Plan, experiments: u32) -> Option<Plan> {
    let once = plan.measurements();
    if once == 0 || !experiments.is_multiple_of(once) {
        return None;
    }
    Some(plan.repeated(experiments / once))
}
