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

impl Experiment {
    /// Whether both are made in one [configuration](is_one_configuration), whatever hangs there.
    #[must_use]
    pub fn stands_as(&self, other: &Self) -> bool {
        is_one_configuration(
            (&self.configuration_rad, self.approach.as_ref()),
            (&other.configuration_rad, other.approach.as_ref()),
        )
    }
}

/// Whether these are one configuration, of which deflections may share errors: the same commanded angles (rad), to the bit,
/// approached from the same side.
#[must_use]
pub fn is_one_configuration(
    (angles, side): (&DVector<f64>, Option<&Approach>),
    (others, other_side): (&DVector<f64>, Option<&Approach>),
) -> bool {
    angles == others && Approach::is_same(side, other_side)
}

/// So many things by their places, those that are the same together, in the order of the first.
#[must_use]
pub fn together(count: usize, is_same: impl Fn(usize, usize) -> bool) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for index in 0..count {
        match groups.iter_mut().find(|group| is_same(group[0], index)) {
            Some(group) => group.push(index),
            None => groups.push(vec![index]),
        }
    }
    groups
}

impl Plan {
    /// The places of its experiments, those of one configuration together, in the order of the first.
    #[must_use]
    pub fn by_configuration(&self) -> Vec<Vec<usize>> {
        let all = &self.experiments;
        together(all.len(), |one, other| all[one].stands_as(&all[other]))
    }

    /// Two experiments (their places) of one configuration under different loads, where there are such.
    #[must_use]
    pub fn several_loads(&self) -> Option<[usize; 2]> {
        self.by_configuration().into_iter().find_map(|group| {
            let first = &self.experiments[group[0]];
            let other = (group.iter()).find(|&&each| self.experiments[each].load != first.load)?;
            Some([group[0], *other])
        })
    }

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
