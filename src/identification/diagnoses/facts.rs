//! What a file of measurements shows by itself: angles out of range, copied rows.

use std::collections::BTreeMap;

use statrs::distribution::{DiscreteCDF, Poisson};

use super::hypotheses::is_inside;
use super::{Case, Diagnosis, Mistake, words};
use crate::measurement::Measurement;
use crate::robot::Load;

/// Equal readings are copies where chance makes as many equal ones with a smaller probability.
const CHANCE: f64 = 1e-6;
/// Readings of a file have at most so many decimals of a millimetre, or all that a computer has.
const MOST_DECIMALS: i32 = 9;

pub fn facts(case: &Case<'_>) -> Vec<Diagnosis> {
    let mistakes = outside_range(case).into_iter().chain(copies(case));
    mistakes
        .map(|mistake| Diagnosis {
            text: words::fact(case, &mistake),
            mistake,
            log_evidence_ratio: None,
        })
        .collect()
}

fn outside_range(case: &Case<'_>) -> Option<Mistake> {
    let joints = &case.nominal.chain.joints;
    let outside: Vec<(usize, usize, f64)> = (case.measurements.iter().enumerate())
        .flat_map(|(measurement, each)| {
            let angles = each.configuration_rad.iter().enumerate();
            angles.map(move |(joint, &angle)| (measurement, joint, angle))
        })
        .filter(|&(_, joint, angle)| !is_inside(angle, joints[joint].range_rad))
        .collect();
    let beyond = |&(_, joint, angle): &(usize, usize, f64)| {
        let [from, to] = joints[joint].range_rad;
        (from - angle).max(angle - to)
    };
    let farthest = (outside.iter()).max_by(|one, other| beyond(one).total_cmp(&beyond(other)))?;
    let mut measurements: Vec<usize> = outside.iter().map(|each| each.0).collect();
    measurements.dedup();
    let &(measurement, joint, angle_rad) = farthest;
    Some(Mistake::AnglesOutsideRange {
        measurements: measurements.len(),
        measurement,
        joint,
        angle_rad,
    })
}

/// Pairs of loaded measurements whose deflections are equal in every digit, if chance does not explain
/// them: two readings of the same are equal in a coordinate with the probability
/// r / (2 sqrt(pi) sigma), for a resolution r; for two readings of different things, sigma is the
/// spread of all readings.
fn copies(case: &Case<'_>) -> Vec<Mistake> {
    let mut by_reading: BTreeMap<[u64; 3], Vec<usize>> = BTreeMap::new();
    for (index, each) in case.measurements.iter().enumerate() {
        if each.load != Load::NONE {
            let bits = each.deflection_m.map(f64::to_bits);
            by_reading.entry(bits.into()).or_default().push(index);
        }
    }
    let setup = |index: usize| {
        let each = &case.measurements[index];
        let angles = each.configuration_rad.iter().map(|angle| angle.to_bits());
        let wrench = each.load.wrench();
        angles
            .chain(wrench.iter().map(|value| value.to_bits()))
            .collect::<Vec<u64>>()
    };
    let [mut rows, mut readings] = [Vec::new(), Vec::new()];
    for equal in by_reading.values() {
        for &copy in &equal[1..] {
            if setup(copy) == setup(equal[0]) {
                rows.push([equal[0], copy]);
            } else {
                readings.push([equal[0], copy]);
            }
        }
    }
    let mut setups: BTreeMap<Vec<u64>, usize> = BTreeMap::new();
    for index in 0..case.measurements.len() {
        *setups.entry(setup(index)).or_default() += 1;
    }
    let pairs = |count: usize| (count * count.saturating_sub(1)) as f64 / 2.0;
    let of_one_setup: f64 = setups.values().map(|&count| pairs(count)).sum();
    let of_others = pairs(case.measurements.len()) - of_one_setup;
    let by_noise = of_one_setup * equal_by_chance(case, |sigma, _| sigma);
    let by_spread = of_others * equal_by_chance(case, f64::max);
    let mut mistakes = Vec::new();
    if is_beyond_chance(rows.len(), by_noise) {
        mistakes.push(Mistake::IdenticalRows(rows));
    }
    if is_beyond_chance(readings.len(), by_spread) {
        mistakes.push(Mistake::IdenticalReadings(readings));
    }
    mistakes
}

/// The probability that two readings are equal, whose standard deviation follows from that of the
/// noise and the spread of all readings.
fn equal_by_chance(case: &Case<'_>, deviation: fn(f64, f64) -> f64) -> f64 {
    let resolution = resolution_m(case.measurements);
    let count = case.measurements.len() as f64;
    (0..3)
        .map(|axis| {
            let readings = || case.measurements.iter().map(|each| each.deflection_m[axis]);
            let mean = readings().sum::<f64>() / count;
            let spread = readings().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
            let sigma = (case.measurements.iter())
                .map(|each| {
                    each.sigma_m
                        .map_or(case.sigma.weight_m(), |sigma| sigma[axis])
                })
                .fold(f64::INFINITY, f64::min);
            let density = 2.0 * std::f64::consts::PI.sqrt() * deviation(sigma, spread.sqrt());
            (resolution / density).min(1.0)
        })
        .product()
}

/// The last decimal that the file's readings have (m).
fn resolution_m(measurements: &[Measurement]) -> f64 {
    let is_whole = |scale: f64| {
        (measurements
            .iter()
            .flat_map(|each| each.deflection_m.iter()))
        .all(|value| {
            let steps = value * 1e3 * scale;
            (steps - steps.round()).abs() <= 1e-9 * steps.abs().max(1.0)
        })
    };
    let decimals = (0..=MOST_DECIMALS).find(|&decimals| is_whole(10_f64.powi(decimals)));
    1e-3 * 10_f64.powi(-decimals.unwrap_or(MOST_DECIMALS + 6))
}

fn is_beyond_chance(found: usize, expected: f64) -> bool {
    let Some(fewer) = found.checked_sub(1) else {
        return false;
    };
    // As many or more with a probability of one less that of fewer.
    expected <= 0.0 || Poisson::new(expected).is_ok_and(|chance| chance.sf(fewer as u64) < CHANCE)
}
