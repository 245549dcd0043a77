//! Readings that are equal in every digit: copied rows.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use statrs::distribution::{DiscreteCDF, Poisson};

use super::outliers::{RejectedReading, rejected_of};
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
    /// Its place in the table.
    pub place: usize,
    /// Where it was read, and what besides its position.
    pub setup: Vec<u64>,
    pub more: Vec<f64>,
    pub position_m: Vector3<f64>,
    /// Standard deviations of the position.
    pub sigma_m: Vector3<f64>,
}

impl CopiedReadings {
    /// Pairs whose readings are equal in every digit, if chance does not explain them: two readings of the same are equal in a coordinate
    /// with the probability r / (2 sqrt(pi) sigma), for a resolution r; for two readings of different things, sigma is the spread of all
    /// readings. The instrument may be known to have a resolution (m).
    pub(super) fn of(all: &[ReadBits], resolution_m: f64) -> Self {
        let mut by_reading: BTreeMap<Vec<u64>, Vec<&ReadBits>> = BTreeMap::new();
        let mut setups: BTreeMap<&[u64], usize> = BTreeMap::new();
        for each in all {
            let value = each.position_m.iter().chain(&each.more);
            let value = value.map(|value| value.to_bits()).collect();
            by_reading.entry(value).or_default().push(each);
            *setups.entry(&each.setup).or_default() += 1;
        }
        let mut found = Self::default();
        for equal in by_reading.values() {
            let mut firsts = vec![equal[0]];
            for copy in &equal[1..] {
                if let Some(first) = firsts.iter().find(|first| first.setup == copy.setup) {
                    found.rows.push([first.place, copy.place]);
                } else {
                    found.readings.push([equal[0].place, copy.place]);
                    firsts.push(copy);
                }
            }
        }
        let pairs = |count: usize| (count * count.saturating_sub(1)) as f64 / 2.0;
        let of_one_setup: f64 = setups.values().map(|&count| pairs(count)).sum();
        let resolution_m = shown_resolution_m(all).max(resolution_m);
        // Of a setup sigma is that of the noise; of others the spread of all, too.
        let expected = |pairs: f64, deviation: fn(f64, f64) -> f64| {
            pairs * equal_by_chance(all, resolution_m, deviation)
        };
        let of_rows = expected(of_one_setup, |sigma, _| sigma);
        let of_readings = expected(pairs(all.len()) - of_one_setup, f64::max);
        // Those beyond chance stay: as many, or more, are improbable where so many are expected.
        let judge = |found: &mut Vec<[usize; 2]>, expected: f64| {
            let fewer = (found.len() as u64).saturating_sub(1);
            let is_improbable = |law: Poisson| law.sf(fewer) < CHANCE;
            if expected > 0.0 && !Poisson::new(expected).is_ok_and(is_improbable) {
                found.clear();
            }
        };
        judge(&mut found.rows, of_rows);
        judge(&mut found.readings, of_readings);
        found
    }

    /// The places of so many rows that count: others are not the same, and they were not rejected.
    pub(super) fn kept(&self, count: usize, rejected: &[RejectedReading]) -> Vec<usize> {
        let mut is_left_out = rejected_of(count, rejected);
        for &[_, copy] in &self.rows {
            is_left_out[copy] = true;
        }
        let places = 0..count;
        places.filter(|&place| !is_left_out[place]).collect()
    }

    /// What is wrong.
    pub fn conditions(&self, noun: &str) -> Vec<Condition> {
        let condition = |code: ConditionCode, pairs: &[[usize; 2]], at: &str| {
            let pairs = pairs.iter();
            let mut shown: Vec<String> = pairs
                .map(|[first, copy]| format!("{} ({})", copy + 1, first + 1))
                .collect();
            let more = shown.len().saturating_sub(SHOWN);
            shown.truncate(SHOWN);
            let mut text = format!("{noun}s equal to those in brackets to the last digit{at}: ");
            text += &shown.join(", ");
            if more > 0 {
                text += &format!(" and {more} more");
            }
            (!shown.is_empty()).then(|| code.with(text))
        };
        let others = ", at other angles or loads";
        let rows = condition(ConditionCode::CopiedRows, &self.rows, "");
        let readings = condition(ConditionCode::CopiedReadings, &self.readings, others);
        rows.into_iter().chain(readings).collect()
    }
}

/// So many pairs are listed.
const SHOWN: usize = 5;

/// The probability that two readings are equal, whose standard deviation follows from that of the
/// noise and the spread of all readings.
fn equal_by_chance(all: &[ReadBits], resolution_m: f64, deviation: fn(f64, f64) -> f64) -> f64 {
    let count = all.len() as f64;
    (0..3)
        .map(|axis| {
            let readings = || all.iter().map(|each| each.position_m[axis]);
            let mean = readings().sum::<f64>() / count;
            let spread = readings().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
            let sigmas = all.iter().map(|each| each.sigma_m[axis]);
            let sigma = sigmas.fold(f64::INFINITY, f64::min);
            let density = 2.0 * std::f64::consts::PI.sqrt() * deviation(sigma, spread.sqrt());
            (resolution_m / density).min(1.0)
        })
        .product()
}

/// The largest step, one, two or five of the last decimal, of which all of the file's readings are multiples (m).
fn shown_resolution_m(all: &[ReadBits]) -> f64 {
    let is_whole = |step_m: &f64| {
        (all.iter().flat_map(|each| each.position_m.iter())).all(|value| {
            let steps = value / step_m;
            (steps - steps.round()).abs() <= 1e-9 * steps.abs().max(1.0)
        })
    };
    let decimals = (0..=MOST_DECIMALS).map(|decimals| 1e-3 * 10_f64.powi(-decimals));
    let mut steps_m = decimals.flat_map(|last_m| [5.0, 2.0, 1.0].map(|times| times * last_m));
    (steps_m.find(is_whole)).unwrap_or_else(|| 1e-3 * 10_f64.powi(-MOST_DECIMALS - 6))
}
