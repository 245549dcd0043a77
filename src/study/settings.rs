//! What a study is made of: its runs, the conditions, and the plans that it compares.

use std::f64::consts::FRAC_1_SQRT_2;

use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::Candidate;
use crate::plan::{Criterion, Plan};
use crate::task::{AccuracyKind, Task};
use crate::text::wording::counted;

/// What the runs of a study are made of.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema, Serialize, ValueEnum,
)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// The linear model of the paper: noise, eq. 9 and eq. 15 as matrices.
    #[default]
    Model,
    /// The virtual robot in MuJoCo: measured, identified, compensated and seen again.
    Robot,
}

impl Level {
    /// What runs are made of, for people.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Model => "by the linear model",
            Self::Robot => "on the virtual robot",
        }
    }
}

/// Which plans a Monte Carlo study compares, and over how many runs.
#[derive(Debug, Clone, PartialEq)]
pub struct StudySettings {
    /// The number of runs.
    pub trials: u64,
    /// What the runs are made of, where the scenario says.
    pub level: Option<Level>,
    /// The conditions that every plan is studied under.
    pub conditions: Vec<Conditions>,
    /// The plans.
    pub plans: Vec<StudyPlan>,
}

/// Conditions of a study, which a sweep varies.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Conditions {
    /// The standard deviation of each coordinate of a deflection (m).
    pub sigma_m: f64,
    /// The number M of measurements that every plan is repeated to.
    pub experiments: u32,
    /// All calibration loads are so many times what the scenario and its plans say.
    pub load_scale: f64,
}

impl Conditions {
    /// The standard deviation (mm) of each coordinate of what is measured: of a deflection, or of a reading, of which two make one.
    pub fn sigma_mm(&self, accuracy: AccuracyKind) -> f64 {
        let share = match accuracy {
            AccuracyKind::Relative => 1.0,
            AccuracyKind::Absolute => FRAC_1_SQRT_2,
        };
        (self.sigma_m * share * 1e15).round() / 1e12
    }

    /// In words.
    pub fn described(&self, accuracy: AccuracyKind) -> String {
        format!(
            "{}, sigma {:.4} mm, load {}",
            counted(self.experiments.into(), accuracy.noun()),
            self.sigma_mm(accuracy),
            self.load_scale
        )
    }

    /// Those of a task as it is, with so many measurements in each run.
    pub const fn plain(task: &Task, experiments: u32) -> Self {
        Self {
            sigma_m: task.belief.instrument.sigma_m,
            experiments,
            load_scale: 1.0,
        }
    }

    /// The task under these conditions.
    pub fn of(&self, task: &Task) -> Task {
        let mut task = task.clone();
        let belief = &mut task.belief;
        belief.instrument.sigma_m = self.sigma_m;
        let along_step_m = belief.instrument.along_step_m();
        belief.uncertain = belief.uncertain.clone().shown_in_steps(along_step_m);
        task.loads = task.loads.scaled(self.load_scale);
        for experiment in &mut task.design.mandatory.experiments {
            experiment.load = experiment.load.scaled(self.load_scale);
        }
        task
    }
}

/// A plan of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyPlan {
    /// Its name.
    pub name: String,
    /// Where it comes from.
    pub source: StudySource,
}

/// Where a plan of a study comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum StudySource {
    /// A plan file, repeated as a whole.
    File {
        /// What is measured.
        plan: Plan,
        /// The same with what is read from where, of absolute readings; nothing of deflections.
        readings: Vec<Candidate>,
    },
    /// The best plan of m measurements, repeated as a whole.
    Optimal {
        /// What makes it good.
        criterion: Criterion,
        /// The number of different configurations, where it is bounded.
        configurations: Option<u32>,
        /// The number m of measurements that are designed; as many as are made if not given.
        experiments: Option<u32>,
        /// Whether it is designed for the instrument's noise alone, whatever else is uncertain.
        noise_only: bool,
    },
    /// One random feasible plan for all runs.
    Random,
    /// A fresh random feasible plan in every run.
    RandomEach,
}

impl StudySource {
    /// Whether whole repetitions of the plan make up so many measurements.
    pub fn fits(&self, experiments: u32) -> bool {
        let once = match self {
            Self::File { plan, .. } => plan.measurements(),
            Self::Optimal { experiments, .. } => experiments.unwrap_or(1),
            Self::Random | Self::RandomEach => 1,
        };
        once > 0 && experiments.is_multiple_of(once)
    }
}
