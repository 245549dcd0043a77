//! How large a pattern is, and means of what readings show of it, for its picture.

use nalgebra::{DVector, Vector6};
use serde::Serialize;

use super::against::{Against, Drifting};
use super::rows::{Base, LookedAt};
use crate::numeric::tolerance::ends;

/// Readings are put together in so many bins.
const BINS: usize = 24;

/// The mean of what some readings show.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PatternPoint {
    /// Where on the pattern's scale: angle or phase (deg), torque (N m), sign of approach, place, time (s), temperature (deg C), range (m).
    pub at: f64,
    /// What is seen there: rad, m or 1.
    #[serde(rename = "observed")]
    pub seen: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// What the pattern says.
    pub pattern: f64,
}

/// What one reading shows.
struct Seen {
    at: f64,
    value: f64,
    effect: f64,
    weight: f64,
}

impl LookedAt {
    /// How large a pattern is, the amplitude of waves and of all else the whole range over the readings; and means of what readings show
    /// of it, all other patterns taken off.
    pub(super) fn shown(
        &self,
        against: Against,
        coefficients: &DVector<f64>,
        left: &DVector<f64>,
    ) -> (f64, Vec<PatternPoint>) {
        let columns = self.columns(against);
        let length = coefficients.norm();
        let is_shift = matches!(against, Against::Course(_, Drifting::Base));
        // What an effect of one is made of: an angle or a growth, or a length.
        let parts: Vec<(Base, f64)> = if is_shift {
            let shares = coefficients.iter().map(|each| each / length);
            columns.iter().map(|(base, _)| *base).zip(shares).collect()
        } else {
            let mut bases = columns.iter().rev().map(|(base, _)| (*base, 1.0));
            let turning = bases.find(|(base, _)| !matches!(base, Base::Bent(_)));
            turning.into_iter().collect()
        };
        let effect = |index: usize| {
            if is_shift {
                return columns[0].1[index] * length;
            }
            let terms = columns.iter().zip(coefficients);
            let terms = terms.map(|((base, factors), coefficient)| {
                // A compliance turns the joint by so much for each N m.
                let turned = match base {
                    Base::Bent(joint) => self.readings[index].torques[*joint],
                    _ => 1.0,
                };
                coefficient * factors[index] * turned
            });
            terms.sum()
        };
        let effects: Vec<f64> = (0..self.readings.len()).map(effect).collect();
        let mut seen: Vec<Seen> = Vec::new();
        for (index, (reading, &effect)) in self.readings.iter().zip(&effects).enumerate() {
            let shares = parts.iter();
            let base: Vector6<f64> = shares.map(|(base, share)| base.of(reading) * *share).sum();
            let weight = base.norm_squared();
            if let Some(at) = self.at(against, index).filter(|_| weight > 0.0) {
                let value = effect + base.dot(&left.fixed_rows::<6>(6 * index)) / weight;
                seen.push(Seen {
                    at,
                    value,
                    effect,
                    weight,
                });
            }
        }
        if let Against::Angle { .. } = against {
            return (length, binned(&seen, 1.0_f64.to_degrees()));
        }
        let [lowest, highest] = ends(effects.into_iter());
        ((highest - lowest).max(0.0), binned(&seen, 1.0))
    }
}

/// Means by bins of the scale, in so many times its unit.
fn binned(seen: &[Seen], shown: f64) -> Vec<PatternPoint> {
    let [lowest, highest] = ends(seen.iter().map(|each| each.at));
    let width = ((highest - lowest) / BINS as f64).max(f64::MIN_POSITIVE);
    let of = |bin: usize| {
        let [from, to] = [bin, bin + 1].map(|edge| lowest + edge as f64 * width);
        let is_in =
            |each: &&Seen| (bin == 0 || each.at >= from) && (bin + 1 == BINS || each.at < to);
        let all: Vec<&Seen> = seen.iter().filter(is_in).collect();
        let weight: f64 = all.iter().map(|each| each.weight).sum();
        let mean = |value: fn(&Seen) -> f64| {
            let values = all.iter().map(|each| value(each) * each.weight);
            values.sum::<f64>() / weight
        };
        let squares = (all.iter()).map(|each| (each.weight * (each.value - each.effect)).powi(2));
        (weight > 0.0).then(|| PatternPoint {
            at: mean(|each| each.at) * shown,
            seen: mean(|each| each.value),
            standard_error: squares.sum::<f64>().sqrt() / weight,
            pattern: mean(|each| each.effect),
        })
    };
    (0..BINS).filter_map(of).collect()
}
