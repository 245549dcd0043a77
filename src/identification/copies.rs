//! Readings that are equal in every digit: copied rows.
//!
//! That chance alone makes two readings equal, of a step r and with a standard deviation sigma without rounding, has a probability q in
//! each coordinate. Of two readings of the same their difference is normal with s = sqrt(2) sigma, and rounded from anywhere in a step:
//!
//! ```text
//! q = E[max(0, 1 - |D| / r)] = erf(x / sqrt(2)) - sqrt(2 / pi) (1 - exp(-x^2 / 2)) / x,   x = r / s
//! ```
//!
//! Of readings of different things, which differ by d as the nominal robot has it, the robot's own error is of a size that is not known: a
//! normal density about d is nowhere larger at zero than where its standard deviation is |d|, so that q <= r / (sqrt(2 pi e) |d|), too.
//! What is copied, of N pairs each with probability w and equal then, is as likely as
//!
//! ```text
//! E(w) = (1 - w)^(N - K) prod (1 - w + w / q)   over the K equal pairs
//! ```
//!
//! times what it is without copies. Without copies the mean of E over some w exceeds a million with a probability of at most 1e-6 (Markov's
//! inequality), however different the pairs are.

use std::collections::BTreeMap;
use std::f64::consts::{E, FRAC_1_SQRT_2, FRAC_2_PI, SQRT_2, TAU};

use nalgebra::Vector3;
use statrs::function::erf::erf;

use super::outliers::{RejectedReading, rejected_of};
use crate::codes::{Condition, ConditionCode};

/// Equal readings are copies where chance makes them equal with a smaller probability.
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
    /// At which angles and under which load it was read,
    pub setup: Vec<u64>,
    /// of what: station and target,
    pub of: [usize; 2],
    /// and what besides its position.
    pub more: Vec<f64>,
    pub position_m: Vector3<f64>,
    /// Standard deviations of the position, rounding among them.
    pub sigma_m: Vector3<f64>,
}

impl CopiedReadings {
    /// Pairs whose readings are equal in every digit, if chance does not explain them. They have so many coordinates, and the instrument
    /// may be known to have a resolution (m). What the nominal robot has of a reading is asked by its place in the table (m).
    pub(super) fn of(
        all: &[ReadBits],
        coordinates: usize,
        resolution_m: f64,
        mut predicted: impl FnMut(usize) -> Vector3<f64>,
    ) -> Self {
        let mut by_reading: BTreeMap<_, Vec<&ReadBits>> = BTreeMap::new();
        let mut setups: BTreeMap<_, Vec<&ReadBits>> = BTreeMap::new();
        let mut counts: BTreeMap<[usize; 2], usize> = BTreeMap::new();
        for each in all {
            let value = each.position_m.iter().chain(&each.more);
            let value: Vec<u64> = value.map(|value| value.to_bits()).collect();
            by_reading.entry((each.of, value)).or_default().push(each);
            setups.entry((each.of, &each.setup)).or_default().push(each);
            *counts.entry(each.of).or_default() += 1;
        }
        let step_m = shown_resolution_m(all).max(resolution_m);
        let noise_m = noise_of_repeats_m(setups.values());
        let [mut rows, mut readings] = [EqualPairs::default(), EqualPairs::default()];
        let pairs = |count: usize| (count * count.saturating_sub(1)) as f64 / 2.0;
        rows.among = setups.values().map(|alike| pairs(alike.len())).sum();
        readings.among = counts.values().map(|&count| pairs(count)).sum::<f64>() - rows.among;
        for equal in by_reading.values() {
            let mut firsts = vec![equal[0]];
            for copy in &equal[1..] {
                let same = firsts
                    .iter()
                    .copied()
                    .find(|first| first.setup == copy.setup);
                let first = same.unwrap_or(equal[0]);
                let (apart_m, found) = if same.is_some() {
                    (Vector3::zeros(), &mut rows)
                } else {
                    firsts.push(copy);
                    (
                        predicted(first.place) - predicted(copy.place),
                        &mut readings,
                    )
                };
                let sigma_m = first.sigma_m.inf(&copy.sigma_m).inf(&noise_m);
                let of_one = |axis| equal_by_chance(step_m, sigma_m[axis], apart_m[axis]);
                found.pairs.push([first.place, copy.place]);
                found.chances.push((0..coordinates).map(of_one).product());
            }
        }
        Self {
            rows: rows.beyond_chance(),
            readings: readings.beyond_chance(),
        }
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

/// Whether chance explains that other readings of the same are these again, each number as it was, of so many coordinates and a resolution
/// (m) each: they are coarse.
pub(super) fn may_repeat(kinds: impl IntoIterator<Item = (Vec<ReadBits>, usize, f64)>) -> bool {
    let again = |(all, coordinates, resolution_m): (Vec<ReadBits>, usize, f64)| {
        let step_m = shown_resolution_m(&all).max(resolution_m);
        let sigmas = (all.iter()).flat_map(|each| each.sigma_m.into_iter().take(coordinates));
        let chances = sigmas.map(|&sigma_m| equal_by_chance(step_m, sigma_m, 0.0));
        chances.product::<f64>()
    };
    kinds.into_iter().map(again).product::<f64>() >= CHANCE
}

/// Pairs of readings that are equal.
#[derive(Default)]
struct EqualPairs {
    pairs: Vec<[usize; 2]>,
    /// The probability of each by chance,
    chances: Vec<f64>,
    /// and among how many pairs, equal or not, they are.
    among: f64,
}

impl EqualPairs {
    /// The pairs, if there are copies among them.
    fn beyond_chance(self) -> Vec<[usize; 2]> {
        let others = self.among - self.chances.len() as f64;
        let shares = (0..).map(|power| 2.0_f64.powi(power) / (self.among + 1.0));
        let ratios: Vec<f64> = (shares.take_while(|share| *share < 1.0))
            .map(|share| {
                let of_pair = |chance: &f64| (share / chance - share).ln_1p();
                others * (-share).ln_1p() + self.chances.iter().map(of_pair).sum::<f64>()
            })
            .collect();
        let needed = (ratios.len() as f64 / CHANCE).ln();
        let largest = ratios.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let relative: f64 = ratios.iter().map(|ratio| (ratio - largest).exp()).sum();
        if !ratios.is_empty() && largest + relative.ln() > needed {
            self.pairs
        } else {
            Vec::new()
        }
    }
}

/// The probability that two readings with a standard deviation (m), rounding among it, of what is so far apart (m) are equal in one
/// coordinate.
fn equal_by_chance(step_m: f64, sigma_m: f64, apart_m: f64) -> f64 {
    let noise_m = (sigma_m.powi(2) - step_m.powi(2) / 12.0).max(0.0).sqrt();
    let steps = step_m / (SQRT_2 * noise_m);
    let of_same = if steps.is_finite() {
        let beside = (-steps.powi(2) / 2.0).exp_m1() / steps;
        erf(steps * FRAC_1_SQRT_2) + FRAC_2_PI.sqrt() * beside
    } else {
        1.0
    };
    of_same.min(step_m / ((TAU * E).sqrt() * apart_m.abs()))
}

/// The standard deviation of each coordinate that readings of the same show where they are not equal (m), which may be less than what a
/// certificate promises; without bound where there are none.
fn noise_of_repeats_m<'a>(alike: impl Iterator<Item = &'a Vec<&'a ReadBits>>) -> Vector3<f64> {
    let apart = alike.flat_map(|alike| alike.windows(2));
    let apart: Vec<Vector3<f64>> = (apart.map(|pair| pair[0].position_m - pair[1].position_m))
        .filter(|apart_m| *apart_m != Vector3::zeros())
        .collect();
    if apart.is_empty() {
        return Vector3::repeat(f64::INFINITY);
    }
    let squares: Vector3<f64> = apart
        .iter()
        .map(|apart_m| apart_m.component_mul(apart_m))
        .sum();
    (squares / (2.0 * apart.len() as f64)).map(f64::sqrt)
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Lengths (m) with a standard deviation (m) to a step of 0.01 mm, read at setups of these numbers.
    fn lengths(of: impl IntoIterator<Item = (u64, f64)>, sigma_m: f64) -> Vec<ReadBits> {
        (of.into_iter().enumerate())
            .map(|(place, (setup, length_m))| ReadBits {
                place,
                setup: vec![setup],
                of: [0; 2],
                more: Vec::new(),
                position_m: Vector3::ith(0, (length_m * 1e5).round() / 1e5),
                sigma_m: Vector3::repeat(sigma_m),
            })
            .collect()
    }

    fn copies(read: &[ReadBits], predicted_m: impl Fn(usize) -> f64) -> CopiedReadings {
        CopiedReadings::of(read, 1, 1e-5, |place| Vector3::ith(0, predicted_m(place)))
    }

    /// That two readings are equal to a step is as probable as it is sampled.
    #[test]
    fn the_probability_of_equal_readings_is_that_of_rounded_noise() {
        // The difference of two rounded numbers by the middles of the cells of both their errors and of where they begin.
        let quantile = |share: f64| SQRT_2 * statrs::function::erf::erf_inv(2.0 * share - 1.0);
        let count: u16 = 120;
        for sigma in [0.2, 0.7, 2.0] {
            let cell = |index: usize| (index as f64 + 0.5) / f64::from(count);
            let cells = 0..usize::from(count);
            let normal: Vec<f64> = cells
                .clone()
                .map(|index| sigma * quantile(cell(index)))
                .collect();
            let mut equal = 0;
            for begin in cells.map(cell) {
                for one in &normal {
                    let first = (begin + one).round();
                    let others = normal
                        .iter()
                        .filter(|other| ((begin + *other).round() - first).abs() < 0.5);
                    equal += others.count();
                }
            }
            let sampled = equal as f64 / f64::from(count).powi(3);
            let with_rounding = sigma.hypot(12.0_f64.sqrt().recip());
            let found = equal_by_chance(1.0, with_rounding, 0.0);
            assert!(
                (found / sampled - 1.0).abs() < 0.02,
                "{sigma}: {found} {sampled}"
            );
        }
    }

    /// Five of twelve pairs of repeats are equal where the step is two thirds of their standard deviation: one in five is by chance.
    #[test]
    fn repeats_to_a_step_are_no_copies() {
        let of = |pair: u64| {
            let length_m = 0.2 + 0.031 * pair as f64;
            let other_m = if pair < 5 { length_m } else { length_m + 2e-5 };
            [(pair, length_m), (pair, other_m)]
        };
        let found = copies(&lengths((0..12).flat_map(of), 1.47e-5), |_| 0.0);
        assert_eq!(found, CopiedReadings::default());
    }

    /// Where a plan has the same length in many configurations, readings of it are equal; and readings of lengths that differ are copies.
    #[test]
    fn equal_lengths_are_no_copies_where_they_are_predicted() {
        let at_limit = |place: usize| {
            0.155_73
                + if place < 8 {
                    1e-6 * place as f64
                } else {
                    0.05 * place as f64
                }
        };
        let of = |place: usize| (place as u64, at_limit(place));
        let read = lengths((0..16).map(of), 2.9e-6);
        assert_eq!(copies(&read, at_limit), CopiedReadings::default());
        let mut copied = read;
        for place in 12..16 {
            copied[place].position_m = copied[place - 4].position_m;
        }
        let found = copies(&copied, at_limit).readings;
        for place in 12..16 {
            assert!(found.contains(&[place - 4, place]), "{found:?}");
        }
    }

    /// One reading of five digits that another one has, too, is little evidence.
    #[test]
    fn one_coincidence_is_no_copy() {
        let length_m = |place: usize| 0.1 + 0.0173 * place as f64;
        let mut read = lengths((0..30).map(|place| (place as u64, length_m(place))), 1e-5);
        read[20].position_m = read[3].position_m;
        assert_eq!(copies(&read, length_m), CopiedReadings::default());
    }
}
