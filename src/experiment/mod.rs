//! Experiments: a configuration and a load, plans of them, and the loads that are allowed.

mod candidates;
mod file;
mod load_set;
mod mandatory;

use nalgebra::DVector;

use crate::robot::{Approach, Load};

pub use candidates::{Candidate, read_candidates, write_candidates};
pub use file::{
    APPROACH, LOAD, approach, configuration, configuration_and_load, experiment_columns,
    experiment_fields, read_plan, write_plan,
};
pub use load_set::{Loads, in_words, is_printed_as, printed_tolerance};
pub use mandatory::{NotMandatory, PRINTED_RAD};

/// One configuration and load of a plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// The commanded joint angles q (rad).
    pub configuration_rad: DVector<f64>,
    /// The load W, in the world frame at the calibration tool.
    pub load: Load,
    /// How often it is measured.
    pub repeats: u32,
    /// From which side the configuration is approached, unloaded and loaded; with all joints turning positively where nothing
    /// is said.
    pub approach: Option<Approach>,
}

/// A plan of experiments (D1).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Plan {
    /// The different configurations and loads.
    pub experiments: Vec<Experiment>,
}

impl Plan {
    /// The number m of measurements, repeats counted.
    #[must_use]
    pub fn measurements(&self) -> u32 {
        self.experiments.iter().map(|each| each.repeats).sum()
    }

    /// Every experiment as often as it is measured.
    pub fn repeated(&self) -> impl Iterator<Item = &Experiment> {
        self.experiments
            .iter()
            .flat_map(|each| std::iter::repeat_n(each, each.repeats as usize))
    }
}
