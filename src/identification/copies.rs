//! Readings that are equal in every digit: copied rows.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use statrs::distribution::{DiscreteCDF, Poisson};

use crate::codes::{Condition, ConditionCode};

/// Equal readings are copies where chance makes as many equal ones with a smaller probability.
const CHANCE: f64 = 1e-6;
/// Readings of a file have at most so many decimals of a millimetre, or all that a computer has.
const MOST_DECIMALS: i32 = 9;

/// Copies beyond chance, as pairs: what was first, and its copy (from 0).
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct CopiedReadings {
    /// Of the same angles and load.
    pub rows: Vec<[usize; 2]>,
    /// Of others.
    pub readings: Vec<[usize; 2]>,
}

/// A reading to the bit.
pub(super) struct ReadBits {
    setup: Vec<u64>,
    value: Vec<u64>,
    position_m: Vector3<f64>,
    sigma_m: Vector3<f64>,
}

impl ReadBits {
    /// What was read, `more` of it besides the position (m), where, with the standard deviations of the position (m).
    pub fn new(
        setup: Vec<u64>,
        more: &[f64],
        position_m: Vector3<f64>,
        sigma_m: Vector3<f64>,
    ) -> Self {
        let value = position_m.iter().chain(more);
        Self {
            value: value.map(|value| value.to_bits()).collect(),
            setup,
            position_m,
            sigma_m,
        }
    }
}

impl CopiedReadings {
    /// Pairs whose readings are equal in every digit, if chance does not explain them: two readings of the same are equal in a coordinate
    /// with the probability r / (2 sqrt(pi) sigma), for a resolution r; for two readings of different things, sigma is the spread of all
    /// readings.
    pub(super) fn of(all: &[ReadBits]) -> Self {
        let mut by_reading: BTreeMap<&[u64], Vec<usize>> = BTreeMap::new();
        let mut setups: BTreeMap<&[u64], usize> = BTreeMap::new();
        for (index, each) in all.iter().enumerate() {
            by_reading.entry(&each.value).or_default().push(index);
            *setups.entry(&each.setup).or_default() += 1;
        }
        let mut found = Self::default();
        for equal in by_reading.values() {
            let mut firsts: Vec<usize> = vec![equal[0]];
            for &copy in &equal[1..] {
                let same = firsts
                    .iter()
                    .find(|&&first| all[first].setup == all[copy].setup);
                if let Some(&first) = same {
                    found.rows.push([first, copy]);
                } else {
                    found.readings.push([equal[0], copy]);
                    firsts.push(copy);
                }
            }
        }
        let pairs = |count: usize| (count * count.saturating_sub(1)) as f64 / 2.0;
        let of_one_setup: f64 = setups.values().map(|&count| pairs(count)).sum();
        let of_others = pairs(all.len()) - of_one_setup;
        if !is_beyond_chance(found.rows.len(), || {
            of_one_setup * equal_by_chance(all, |sigma, _| sigma)
        }) {
            found.rows.clear();
        }
        if !is_beyond_chance(found.readings.len(), || {
            of_others * equal_by_chance(all, f64::max)
        }) {
            found.readings.clear();
        }
        found
    }

    /// The same of the whole table, of which the readings were at these places.
    pub(super) fn at(self, places: &[usize]) -> Self {
        let of = |pairs: Vec<[usize; 2]>| -> Vec<[usize; 2]> {
            (pairs.into_iter())
                .map(|pair| pair.map(|place| places[place]))
                .collect()
        };
        Self {
            rows: of(self.rows),
            readings: of(self.readings),
        }
    }

    /// The rows that count no more, since others are the same.
    pub fn is_copy(&self, count: usize) -> Vec<bool> {
        let mut of_all = vec![false; count];
        for &[_, copy] in &self.rows {
            of_all[copy] = true;
        }
        of_all
    }

    /// What is wrong.
    pub fn conditions(&self, noun: &str) -> Vec<Condition> {
        let list = |pairs: &[[usize; 2]]| {
            let shown = pairs
                .iter()
                .take(SHOWN)
                .map(|[first, copy]| format!("{} ({})", copy + 1, first + 1));
            let shown: Vec<String> = shown.collect();
            let more = pairs.len().saturating_sub(SHOWN);
            let more = if more > 0 {
                format!(" and {more} more")
            } else {
                String::new()
            };
            shown.join(", ") + &more
        };
        let mut found = Vec::new();
        if !self.rows.is_empty() {
            found.push(ConditionCode::CopiedRows.with(format!(
                "{noun}s equal to those in brackets to the last digit: {}",
                list(&self.rows)
            )));
        }
        if !self.readings.is_empty() {
            found.push(ConditionCode::CopiedReadings.with(format!(
                "{noun}s equal to those in brackets to the last digit, at other angles or loads: {}",
                list(&self.readings)
            )));
        }
        found
    }
}

/// So many pairs are listed.
const SHOWN: usize = 5;

/// The probability that two readings are equal, whose standard deviation follows from that of the
/// noise and the spread of all readings.
fn equal_by_chance(all: &[ReadBits], deviation: fn(f64, f64) -> f64) -> f64 {
    let resolution = resolution_m(all);
    let count = all.len() as f64;
    (0..3)
        .map(|axis| {
            let readings = || all.iter().map(|each| each.position_m[axis]);
            let mean = readings().sum::<f64>() / count;
            let spread = readings().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
            let sigmas = all.iter().map(|each| each.sigma_m[axis]);
            let sigma = sigmas.fold(f64::INFINITY, f64::min);
            let density = 2.0 * std::f64::consts::PI.sqrt() * deviation(sigma, spread.sqrt());
            (resolution / density).min(1.0)
        })
        .product()
}

/// The last decimal that the file's readings have (m).
fn resolution_m(all: &[ReadBits]) -> f64 {
    let is_whole = |scale: f64| {
        (all.iter().flat_map(|each| each.position_m.iter())).all(|value| {
            let steps = value * 1e3 * scale;
            (steps - steps.round()).abs() <= 1e-9 * steps.abs().max(1.0)
        })
    };
    let decimals = (0..=MOST_DECIMALS).find(|&decimals| is_whole(10_f64.powi(decimals)));
    1e-3 * 10_f64.powi(-decimals.unwrap_or(MOST_DECIMALS + 6))
}

fn is_beyond_chance(found: usize, expected: impl Fn() -> f64) -> bool {
    let Some(fewer) = found.checked_sub(1) else {
        return false;
    };
    let expected = expected();
    // As many or more with a probability of one less that of fewer.
    expected <= 0.0 || Poisson::new(expected).is_ok_and(|chance| chance.sf(fewer as u64) < CHANCE)
}
