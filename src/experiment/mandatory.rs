//! Whether a plan contains the experiments that every plan must contain.

use thiserror::Error;

use super::{Experiment, Plan, is_one_direction, is_printed_as};

/// Angles are printed alike within this (rad): plans have one decimal of a degree.
pub const PRINTED_RAD: f64 = 0.1_f64.to_radians();

/// A plan lacks a mandatory experiment.
#[derive(Debug, Clone, Copy, Error, PartialEq, Eq)]
#[error(
    "mandatory experiment {experiment} is measured {} in the plan; {needed} {} needed",
    times(*found),
    if *needed == 1 { "is" } else { "are" }
)]
pub struct NotMandatory {
    /// The number of the mandatory experiment, from 1.
    pub experiment: usize,
    /// How often it is measured.
    pub found: u32,
    /// How often it must be.
    pub needed: u32,
}

fn times(count: u32) -> String {
    match count {
        1 => "once".to_owned(),
        count => format!("{count} times"),
    }
}

impl Plan {
    /// How often the plan measures each of its experiments beside the mandatory ones. An experiment is the
    /// mandatory one where its angles are within [`PRINTED_RAD`] and its load is printed alike; the
    /// nearest counts first.
    ///
    /// # Errors
    /// The first mandatory experiment that is measured less often than it must be.
    pub fn beside_mandatory(&self, mandatory: &Self) -> Result<Vec<u32>, NotMandatory> {
        let mut free: Vec<u32> = self.experiments.iter().map(|each| each.repeats).collect();
        for (number, wanted) in mandatory.experiments.iter().enumerate() {
            let apart = |each: &Experiment| {
                let angles = &each.configuration_rad - &wanted.configuration_rad;
                let printed_alike = is_printed_as(&each.load, &wanted.load);
                let near = angles.amax();
                let is_along = is_one_direction(each.direction.as_ref(), wanted.direction.as_ref());
                (printed_alike && is_along && near <= PRINTED_RAD).then_some(near)
            };
            let mut same: Vec<(usize, f64)> = (self.experiments.iter().enumerate())
                .filter_map(|(index, each)| Some((index, apart(each)?)))
                .collect();
            same.sort_by(|one, other| one.1.total_cmp(&other.1));
            let mut needed = wanted.repeats;
            for (index, _) in same {
                let taken = needed.min(free[index]);
                free[index] -= taken;
                needed -= taken;
            }
            if needed > 0 {
                return Err(NotMandatory {
                    experiment: number + 1,
                    found: wanted.repeats - needed,
                    needed: wanted.repeats,
                });
            }
        }
        Ok(free)
    }
}
