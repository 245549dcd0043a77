//! Likely input errors of measured deflections.
//!
//! Two readings of a file are compared as models of the same numbers. The yardstick are the nominal compliances:
//!
//! ```text
//! dp = A k + e,   k ~ N(k_0, (k_0/2)^2),   e ~ N(0, v sigma^2),   v >= 1
//! ```
//!
//! The half is the trust in nominal compliances, and v, with density v^-2, leaves room for what the model does not explain. The
//! evidence of a reading is the probability density of the numbers in the file, k integrated out and v at its best. An error is
//! named if the evidence for it is more than a million times that for the file as it is, after paying for the number of errors
//! of its kind that were tried. If the file is right, the ratio of two densities exceeds K with a probability of at most
//! 1/K (Markov's inequality): a false alarm in a million files for each kind.
//!
//! What says where and how the robot bends must also halve the rms residual at least: on a real robot
//! the discrepancy is not independent from row to row, and no small improvement is evidence.
//! A unit of all loads or deflections must bring the compliances to half to twice the nominal ones on
//! average, the sign of all must make them positive.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Vector3};

use super::super::copies::{CopiedReadings, ReadBits, may_repeat};
use super::super::discrepancy::three_rows;
use super::super::frames::nearest;
use super::super::outliers::IMPLAUSIBLE;
use super::super::{Case, Identification};
use super::catalogue::{self, Correction, InputError, RowKinds, right_angles};
use super::evidence::{ReadingEvidence, most_probable};
use super::{LikelyInputError, RANGE_SLACK_RAD, outside_limits, unknown_approaches};
use crate::codes::Condition;
use crate::measurement::Measurement;
use crate::robot::Load;

/// The evidence that an error needs, as twice the natural logarithm of a ratio of a million.
const DECISIVE: f64 = 27.6;
/// Errors that are at most a hundred times less probable than the likeliest one are named too.
const AS_GOOD: f64 = 9.2;
/// The share of the residuals' square that may be left: the rms is halved.
const SHARE_LEFT: f64 = 0.25;
/// So many errors are looked for one on top of the other.
const DEPTH: usize = 3;
/// From so many measurements, evenly spread, errors are looked for.
const MOST_MEASUREMENTS: usize = 300;
/// A compliance is implausible where its logarithm is nearer to that of 9.81 times the nominal one, or of its 9.81th part, than to the
/// nominal one's: beyond half of ln 9.81 ...
const IMPLAUSIBLE_RATIO: f64 = 1.1417;
/// ... and beyond so many standard deviations of what is known of it before; so is the mean of those of all, by its own.
const FAR: f64 = 3.29;
/// So many times rotation and compliances are found in turn ...
const TURNS: usize = 20;
/// ... from so many right-angled frames.
const STARTS: usize = 3;
/// Directions in which all deflections are smaller than this share of the largest do not tell a rotation.
const FLAT: f64 = 1e-3;

/// What the table shows by itself: angles outside the joint limits, rows without a side of approach, copied rows.
pub fn conditions_of_table(case: &Case<'_>) -> Vec<Condition> {
    let copies = copied(case).conditions("measurement");
    let sides = case.measurements.iter().map(|each| each.approach.as_ref());
    let unknown = unknown_approaches(&case.belief.uncertain, "measurement", sides);
    let commands = case.measurements.iter();
    let commands = commands.map(|each| &each.configuration_rad);
    let outside = outside_limits(&case.belief.nominal.chain, "measurement", commands);
    (outside.into_iter().chain(unknown)).chain(copies).collect()
}

/// Loaded measurements with the same deflection in every digit. Displacements along a direction are often alike by chance.
fn copied(case: &Case<'_>) -> CopiedReadings {
    let nominal = case.predicted_linearly().values;
    let rows: Vec<_> = case.rows_of_each().collect();
    CopiedReadings::of(&bits(case, false), 3, 0.0, |place| {
        three_rows(&nominal.rows_range(rows[place].clone()).into_owned(), 0)
    })
}

/// Whether other measurements of the same may be these again to the last digit by chance.
pub fn measurements_may_repeat(case: &Case<'_>) -> bool {
    let gauge = case.belief.instrument.gauge;
    let step_m = gauge.map_or(0.0, |gauge| gauge.resolution_m);
    may_repeat([(bits(case, false), 3, 0.0), (bits(case, true), 1, step_m)])
}

/// Loaded measurements to the bit: displacements along a direction as one coordinate, or those of three.
fn bits(case: &Case<'_>, is_along: bool) -> Vec<ReadBits> {
    let of_kind = |each: &Measurement| each.direction.is_some() == is_along;
    let loaded = case.measurements.iter().enumerate();
    let loaded = loaded.filter(|(_, each)| each.load != Load::NONE && of_kind(each));
    let bits = loaded.map(|(place, each)| {
        let wrench = each.load.wrench();
        let setup = each.configuration_rad.iter().chain(wrench.iter());
        let along = |direction: Vector3<f64>| Vector3::ith(0, direction.dot(&each.deflection_m));
        let unknown_m = match each.direction {
            Some(_) => case.belief.instrument.along_sigma_m(),
            None => case.sigma.weight_m(),
        };
        ReadBits {
            place,
            setup: setup.map(|value| value.to_bits()).collect(),
            of: [0; 2],
            more: Vec::new(),
            position_m: each.direction.map_or(each.deflection_m, along),
            sigma_m: (each.sigma_m).unwrap_or_else(|| Vector3::repeat(unknown_m)),
        }
    });
    bits.collect()
}

/// The likely input errors where an identification (`None` if it failed) is suspicious: residuals are too large or too small, or a
/// compliance is negative or implausible.
pub fn suspected_input_errors(
    case: &Case<'_>,
    identification: Option<&Identification>,
) -> Vec<LikelyInputError> {
    let is_off = |found: &Identification| {
        let inconsistent = (found.consistency)
            .is_some_and(|probability| !(IMPLAUSIBLE..=1.0 - IMPLAUSIBLE).contains(&probability));
        inconsistent || is_implausible(case, found)
    };
    if identification.is_none_or(is_off) {
        likely_input_errors(case)
    } else {
        Vec::new()
    }
}

/// Whether compliances are others than nominal ones may be, one of them or all together.
fn is_implausible(case: &Case<'_>, found: &Identification) -> bool {
    let known = case.belief.uncertain.set().prior();
    let (mut sum, mut count) = (0.0_f64, 0.0_f64);
    for (place, parameter) in found.parameters.iter().enumerate() {
        let nominal = case.belief.nominal.compliance_rad_per_nm[parameter.joint];
        let Some(estimate) = parameter.estimate.filter(|_| nominal > 0.0) else {
            continue;
        };
        let off = (estimate.value / nominal).ln();
        let deviation = known.ratio_of(place).unwrap_or(0.0);
        let most = (FAR * deviation).max(IMPLAUSIBLE_RATIO);
        if !(-most..=most).contains(&off) {
            return true;
        }
        if deviation > 0.0 {
            sum += off / deviation;
            count += 1.0;
        }
    }
    sum.abs() > FAR * count.sqrt()
}

/// The input errors that explain the measurements decisively better than reading them as they are, one
/// on top of the other, whether the measurements are suspicious or not.
pub fn likely_input_errors(case: &Case<'_>) -> Vec<LikelyInputError> {
    let mut found = Vec::new();
    // What is known before is wider here.
    let Ok(belief) = (case.belief).of_compliances(case.belief.parameters.clone(), None) else {
        return found;
    };
    let belief = &belief;
    let held = &[];
    let case = &Case {
        belief,
        held,
        ..*case
    };
    let step = case.measurements.len().div_ceil(MOST_MEASUREMENTS).max(1);
    let mut read: Vec<Measurement> = case.measurements.iter().step_by(step).cloned().collect();
    for _ in 0..DEPTH {
        let now = case.with(&read);
        let as_it_is = ReadingEvidence::new(&now, &read);
        let best = best(&now, &as_it_is);
        let Some(likeliest) = best.first() else {
            break;
        };
        let (error, gain) = (&likeliest.error, likeliest.gain);
        let [without, as_read] = [likeliest.evidence.rms, as_it_is.rms];
        // Of another unit residuals may be the smaller ones of what is the less probable.
        let why = if without < as_read {
            format!(
                "Weighted residuals with nominal compliances as prior: {without:.3} so, {as_read:.3} as read (rms)"
            )
        } else {
            format!("Log evidence ratio: {:.0}", gain / 2.0)
        };
        let mut text = format!("{}. {why}", error.words);
        let others = best.iter().skip(1).take(2);
        let others: Vec<&str> = others.map(|other| other.error.question()).collect();
        if !others.is_empty() {
            text += &format!(". As likely: {}", others.join("; "));
        }
        let next = corrected(&now, error);
        found.push(LikelyInputError {
            kind: error.kind,
            text,
            log_evidence_ratio: gain / 2.0,
        });
        read = next;
    }
    found
}

/// An error with the evidence for it, and by how much that is better.
struct LikelyError {
    error: InputError,
    evidence: ReadingEvidence,
    gain: f64,
}

/// The measurements of a case without an error.
fn corrected(case: &Case<'_>, error: &InputError) -> Vec<Measurement> {
    let mut all = case.measurements.to_vec();
    for each in &mut all {
        error.correct_commands(&mut each.configuration_rad);
        if let Correction::Deflection(change) = &error.change {
            let arm = case.belief.nominal.chain.at(&case.belief.calibration_tool);
            let axes = arm.state(each.configuration_rad.as_slice()).tool_rotation;
            change(each, &axes);
        }
    }
    all
}

/// The likeliest error and those that are as good, if one is decisively better than none.
fn best(case: &Case<'_>, as_it_is: &ReadingEvidence) -> Vec<LikelyError> {
    let judge = |(error, price): (InputError, f64)| {
        let corrected = corrected(case, &error);
        if !is_possible(case, &corrected) {
            return None;
        }
        let evidence = ReadingEvidence::new(case, &corrected);
        let gain = as_it_is.value - evidence.value - price;
        let explains = match error.kind {
            "signs_reversed" => evidence.scale > 0.0,
            "load_unit" | "deflection_unit" => (0.5..=2.0).contains(&evidence.scale.abs()),
            _ => evidence.square <= SHARE_LEFT * as_it_is.square,
        };
        (gain > DECISIVE && explains).then_some(LikelyError {
            error,
            evidence,
            gain,
        })
    };
    let mut decisive: Vec<LikelyError> = (hypotheses(case).into_iter()).filter_map(judge).collect();
    decisive.sort_by(|one, other| other.gain.total_cmp(&one.gain));
    let largest = decisive.first().map_or(0.0, |first| first.gain);
    decisive.retain(|each| largest - each.gain < AS_GOOD);
    // Joints whose signs do not show are no other explanation.
    let first = (decisive.first()).map_or_else(Vec::new, |first| first.error.reversed.clone());
    decisive.retain(|LikelyError { error, .. }| {
        let is_more = first.iter().all(|joint| error.reversed.contains(joint));
        first.is_empty() || first == error.reversed || !is_more
    });
    decisive
}

/// Whether the joints' ranges allow the angles that a correction made of the file's.
fn is_possible(case: &Case<'_>, after: &[Measurement]) -> bool {
    let is_allowed = |joint: usize, before: f64, after: f64| {
        let [from, to] = case.belief.nominal.chain.joints[joint].range_rad;
        let is_inside = (from - RANGE_SLACK_RAD..=to + RANGE_SLACK_RAD).contains(&after);
        (after - before).abs() < f64::EPSILON || is_inside
    };
    case.measurements.iter().zip(after).all(|(before, after)| {
        let [before, after] = [before, after].map(|each| &each.configuration_rad);
        (0..before.len()).all(|joint| is_allowed(joint, before[joint], after[joint]))
    })
}

/// All errors that are looked for, the simple ones first, with what each costs: twice the logarithm of the number of errors of its kind,
/// of sets of joints that turn the other way of those as large, and of what its parameters cost.
fn hypotheses(case: &Case<'_>) -> Vec<(InputError, f64)> {
    let chain = &case.belief.nominal.chain;
    let [reversed, _, units, swapped, _] = catalogue::of_commands(chain);
    let rows = RowKinds::of(case.measurements);
    let kinds = (catalogue::of_deflections(rows).into_iter()).chain([units, swapped]);
    let price = |count: usize| 2.0 * (count as f64).ln();
    let mut all: Vec<(InputError, f64)> = Vec::new();
    for errors in kinds {
        let price = price(errors.len());
        all.extend(errors.into_iter().map(|error| (error, price)));
    }
    let as_large = |size: usize| {
        let own = reversed.iter().filter(|error| error.reversed.len() == size);
        own.count()
    };
    let sizes: Vec<usize> = (0..=chain.len()).map(as_large).collect();
    all.extend(reversed.into_iter().map(|error| {
        let price = price(sizes[error.reversed.len()] * chain.len());
        (error, price)
    }));
    if rows == RowKinds::Deflections {
        all.extend(rotation(case));
    }
    all
}

/// The rotation that takes the measured deflections nearest to predicted ones (Wahba's problem, by
/// Kabsch's singular value decomposition), with the compliances that then fit, in turns. It starts
/// from the turned frames of right angles that fit best. What its three angles cost is the share of all
/// rotations that fit as well: (2 pi)^(3/2) det(I)^(-1/2) of 8 pi^2, for their information matrix I.
fn rotation(case: &Case<'_>) -> Option<(InputError, f64)> {
    let measurements = case.measurements;
    let information: Matrix3<f64> = (measurements.iter())
        .map(|each| {
            let sigma = (each.sigma_m).map_or(case.sigma.weight_m(), |sigma| sigma.amax());
            let moved = each.deflection_m.cross_matrix() / sigma;
            moved.transpose() * moved
        })
        .sum();
    let price = information.determinant().ln() - 3.0 * TAU.ln() + 2.0 * (2.0 * TAU * TAU).ln();
    let read = |matrix| corrected(case, &catalogue::in_frame(matrix));
    let square = |matrix: Matrix3<f64>| ReadingEvidence::new(case, &read(matrix)).square;
    let refined = |mut matrix: Matrix3<f64>| {
        for _ in 0..TURNS {
            let predicted = most_probable(case, &read(matrix))?;
            let turned = measurements.iter().zip(predicted).map(|(each, predicted)| {
                let sigma = (each.sigma_m).map_or(case.sigma.weight_m(), |sigma| sigma.norm());
                predicted * each.deflection_m.transpose() / (sigma * sigma)
            });
            let correlation: Matrix3<f64> = turned.sum();
            let values = correlation.singular_values();
            let tells_rotation = values[1] >= FLAT * values[0];
            matrix = tells_rotation.then(|| nearest(&correlation).into_inner())?;
        }
        Some((square(matrix), matrix))
    };
    let mut starts: Vec<(f64, Matrix3<f64>)> = (right_angles().into_iter())
        .filter(|matrix| matrix.determinant() > 0.0)
        .chain([Matrix3::identity()])
        .map(|matrix| (square(matrix), matrix))
        .collect();
    starts.sort_by(|one, other| one.0.total_cmp(&other.0));
    let best = (starts.into_iter().take(STARTS))
        .filter_map(|(_, start)| refined(start))
        .min_by(|one, other| one.0.total_cmp(&other.0))?;
    Some((catalogue::in_frame(best.1), price.max(0.0)))
}
