//! Likely mistakes in a file of measurements: units, signs, frames, columns, copied rows.
//!
//! A mistake is supposed, the measurements are read as it would have them, and the two readings are
//! compared as models of the same numbers. The yardstick are the nominal compliances:
//!
//! ```text
//! dp = A k + e,   k ~ N(k_0, (k_0/2)^2),   e ~ N(0, v sigma^2),   v >= 1
//! ```
//!
//! The half is the trust in nominal compliances, and v, with density v^-2, leaves room for a model that
//! discrepancies. The evidence of a reading is the probability density of the numbers in the file, k
//! integrated out and v at its best. A mistake is named if the evidence for it is more than a million
//! times that for the file as it is, after paying for the number of mistakes of its kind that were
//! tried. If the file is right, the ratio of two densities exceeds K with a probability of at most
//! 1/K (Markov's inequality): a false alarm in a million files for each kind.
//!
//! What says where and how the robot bends must also halve the rms discrepancy at least: on a real robot
//! the model's discrepancy is not independent from row to row, and no small improvement is evidence.
//! A unit of all loads or deflections must bring the compliances to half to twice the nominal ones on
//! average, the sign of all must make them positive.

mod evidence;
mod facts;
mod hypotheses;
mod words;

use nalgebra::{Matrix3, Vector3};

use super::{Case, Identification};
use crate::codes::{Condition, ConditionCode};
use crate::measurement::Measurement;
use crate::robot::Robot;
use evidence::ReadingEvidence;
use hypotheses::{Hypothesis, hypotheses};

/// The evidence that a mistake needs, as twice the natural logarithm of a ratio of a million.
const DECISIVE: f64 = 27.6;
/// Mistakes that are at most a hundred times less probable than the likeliest one are named too.
const AS_GOOD: f64 = 9.2;
/// The share of the discrepancy's square that may be left: the rms is halved.
const SHARE_LEFT: f64 = 0.25;
/// So many mistakes are looked for one on top of the other.
const DEPTH: usize = 3;
/// From so many measurements, evenly spread, mistakes are looked for.
const MOST_MEASUREMENTS: usize = 300;
/// A consistency outside of this and one minus this makes measurements suspicious.
const INCONSISTENT: f64 = 1e-4;
/// A compliance is implausible where it is nearer to 9.81 times the nominal one, or its 9.81th part,
/// than to the nominal one: beyond the root of 9.81.
const IMPLAUSIBLE: f64 = 3.132;

/// A likely mistake.
#[derive(Debug, Clone, PartialEq)]
pub enum Mistake {
    /// All deflections, or all loads, have the wrong sign.
    SignsReversed,
    /// Loads must be multiplied by this to be in N and N m.
    LoadUnit(f64),
    /// Deflections must be multiplied by this to be in mm and mrad.
    DeflectionUnit(f64),
    /// Angles must be multiplied by this to be in degrees.
    AngleUnit(f64),
    /// These joints (indices) turn the other way.
    JointSigns(Vec<usize>),
    /// The columns of these two joints (indices) are swapped.
    JointsSwapped([usize; 2]),
    /// Deflections must be multiplied by this orthogonal matrix to be in the world frame.
    Frame(Matrix3<f64>),
    /// Deflections are in the tool's frame.
    DeflectionsInToolFrame,
    /// Loads are in the tool's frame.
    LoadsInToolFrame,
    /// Commanded angles are outside the joints' ranges.
    AnglesOutsideRange {
        /// How many measurements have such.
        measurements: usize,
        /// The measurement of the angle farthest outside, from 0.
        measurement: usize,
        /// Its joint.
        joint: usize,
        /// The angle (rad).
        angle_rad: f64,
    },
    /// Measurements with the same angles, load and reading to the last digit, as pairs (from 0).
    IdenticalRows(Vec<[usize; 2]>),
    /// Measurements of other angles or loads with the same reading to the last digit, as pairs.
    IdenticalReadings(Vec<[usize; 2]>),
}

/// A mistake with what speaks for it.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnosis {
    /// What may be wrong.
    pub mistake: Mistake,
    /// The natural logarithm of how many times more probable the measurements are with this mistake
    /// than without; `None` for what the file itself shows.
    pub log_evidence_ratio: Option<f64>,
    /// What may be wrong, what shows it and what to do, in words.
    pub text: String,
}

impl Diagnosis {
    /// The same as a condition.
    pub fn condition(&self) -> Condition {
        match self.mistake {
            Mistake::IdenticalRows(_) => ConditionCode::CopiedRows.with(&self.text),
            Mistake::IdenticalReadings(_) => ConditionCode::CopiedReadings.with(&self.text),
            Mistake::AnglesOutsideRange { .. } => {
                ConditionCode::AnglesOutsideLimits.with(&self.text)
            }
            _ => ConditionCode::InputError.with(format!("likely input error: {}", self.text)),
        }
    }
}

/// The likely mistakes in measurements. `identification` is what was identified from them, `None` if
/// that failed. What shows in the file alone is always named; the other mistakes only where the
/// identification is suspicious.
pub fn diagnoses(case: &Case<'_>, identification: Option<&Identification>) -> Vec<Diagnosis> {
    let mut found = facts::facts(case);
    if identification.is_none_or(|found| is_suspicious(found, case.nominal)) {
        found.extend(likely_mistakes(case));
    }
    found
}

/// Whether residuals are too large or too small, or a compliance is negative or implausible.
fn is_suspicious(identification: &Identification, nominal: &Robot) -> bool {
    let inconsistent = (identification.consistency)
        .is_some_and(|probability| !(INCONSISTENT..=1.0 - INCONSISTENT).contains(&probability));
    inconsistent
        || identification.parameters.iter().any(|parameter| {
            let nominal = nominal.compliance_rad_per_nm[parameter.joint];
            parameter.estimate.is_some_and(|estimate| {
                let ratio = estimate.value / nominal;
                nominal > 0.0 && !(IMPLAUSIBLE.recip()..=IMPLAUSIBLE).contains(&ratio)
            })
        })
}

/// The mistakes that explain the measurements decisively better than reading them as they are, one
/// on top of the other, whether the measurements are suspicious or not.
pub fn likely_mistakes(case: &Case<'_>) -> Vec<Diagnosis> {
    let step = case.measurements.len().div_ceil(MOST_MEASUREMENTS).max(1);
    let mut read: Vec<Measurement> = case.measurements.iter().step_by(step).cloned().collect();
    let mut all = case.measurements.to_vec();
    let mut found = Vec::new();
    for _ in 0..DEPTH {
        let best = best(case, &read);
        let Some((first, _)) = best.first() else {
            break;
        };
        let corrected = first.apply(case, &all);
        // Where nothing can be identified, the words say so.
        let before = case.with(&all).identify().ok();
        let after = case.with(&corrected).identify().ok();
        found.push(Diagnosis {
            mistake: first.mistake.clone(),
            log_evidence_ratio: Some(best[0].1 / 2.0),
            text: words::likely(case, &best, before.as_ref(), after.as_ref()),
        });
        read = first.apply(case, &read);
        all = corrected;
    }
    found
}

/// The likeliest mistake and those that are as good, if one is decisively better than none, with
/// their gain of evidence.
fn best(case: &Case<'_>, measurements: &[Measurement]) -> Vec<(Hypothesis, f64)> {
    let as_it_is = ReadingEvidence::new(case, measurements, measurements);
    let mut decisive: Vec<(Hypothesis, f64)> = hypotheses(case, measurements)
        .into_iter()
        .filter_map(|hypothesis| {
            let corrected = hypothesis.apply(case, measurements);
            let evidence = ReadingEvidence::new(case, measurements, &corrected);
            let gain = as_it_is.value - evidence.value - hypothesis.price;
            let explains = match hypothesis.mistake {
                Mistake::SignsReversed => evidence.scale > 0.0,
                Mistake::LoadUnit(_) | Mistake::DeflectionUnit(_) => {
                    (0.5..=2.0).contains(&evidence.scale.abs())
                }
                _ => evidence.discrepancy <= SHARE_LEFT * as_it_is.discrepancy,
            };
            (gain > DECISIVE && explains).then_some((hypothesis, gain))
        })
        .collect();
    decisive.sort_by(|one, other| other.1.total_cmp(&one.1));
    let largest = decisive.first().map_or(0.0, |(_, gain)| *gain);
    decisive.retain(|(_, gain)| largest - gain < AS_GOOD);
    let first = decisive.first().map(|(first, _)| first.mistake.clone());
    // Joints whose signs do not show are no other explanation.
    decisive.retain(|(other, _)| match (&first, &other.mistake) {
        (Some(Mistake::JointSigns(first)), Mistake::JointSigns(joints)) => {
            first == joints || !first.iter().all(|joint| joints.contains(joint))
        }
        _ => true,
    });
    decisive
}

/// A vector turned into another frame, and the standard deviations of its coordinates there.
fn turned(
    rotation: &Matrix3<f64>,
    vector: &Vector3<f64>,
    sigma: &Vector3<f64>,
) -> (Vector3<f64>, Vector3<f64>) {
    let variance = rotation.component_mul(rotation) * sigma.component_mul(sigma);
    (rotation * vector, variance.map(f64::sqrt))
}
