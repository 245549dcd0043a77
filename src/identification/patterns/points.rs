//! Means of what readings show of a pattern, for its picture.

use nalgebra::{DVector, Vector6};
use serde::Serialize;

use super::candidates::{Against, Base, Course, Drifting};
use super::rows::LookedAt;
use crate::numeric::tolerance::ends;

/// Readings are put together in so many bins.
const BINS: usize = 24;
/// With more waves than these in a revolution the phase within one is drawn in place of the angle.
pub const WAVES_TO_SEE: usize = 8;

/// The mean of what some readings show.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PatternPoint {
    /// Against which value: angle or phase (rad), torque (N m), sign of approach, place, time (s), temperature (deg C), range (m).
    pub at: f64,
    /// What is seen there: rad, m or 1.
    #[serde(rename = "observed")]
    pub seen: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// What the pattern says.
    pub pattern: f64,
}

impl LookedAt {
    /// Means of what readings show, all other patterns taken off.
    pub(super) fn points(
        &self,
        against: Against,
        coefficients: &DVector<f64>,
        left: &DVector<f64>,
    ) -> Vec<PatternPoint> {
        let columns = self.columns(against);
        let effects = self.effects(against, coefficients);
        let mut seen: Vec<Seen> = Vec::new();
        for (index, reading) in self.readings.iter().enumerate() {
            // What it does to the reading for an effect of one.
            let base = if let Against::Course(_, Drifting::Base) = against {
                let length = coefficients.norm();
                let parts = columns.iter().zip(coefficients.iter());
                parts
                    .map(|(column, coefficient)| column.base.of(reading) * (coefficient / length))
                    .sum()
            } else {
                let mut bases = columns.iter().rev().map(|column| column.base);
                let moved = bases.find(|base| !matches!(base, Base::Bent(_)));
                moved.map_or_else(Vector6::zeros, |base| base.of(reading))
            };
            let weight = base.norm_squared();
            if let Some(at) = self.at(against, index).filter(|_| weight > 0.0) {
                let effect = effects[index];
                let value = effect + base.dot(&left.fixed_rows::<6>(6 * index)) / weight;
                seen.push(Seen {
                    at,
                    value,
                    effect,
                    weight,
                });
            }
        }
        binned(&seen)
    }

    /// Against which value a reading is drawn.
    fn at(&self, against: Against, index: usize) -> Option<f64> {
        let reading = &self.readings[index];
        match against {
            Against::Angle { joint, waves } => {
                let angle = reading.angles[joint];
                let is_seen = waves <= WAVES_TO_SEE;
                Some(if is_seen {
                    angle
                } else {
                    (waves as f64 * angle).rem_euclid(std::f64::consts::TAU)
                })
            }
            Against::Torque { joint } => Some(reading.torques[joint]),
            Against::Approach { joint } => {
                let sign = *reading.approach.as_ref()?.get(joint)?;
                Some(if sign { 1.0 } else { -1.0 })
            }
            Against::Course(Course::Order, _) => Some(index as f64 + 1.0),
            Against::Course(Course::Time, _) => reading.time_s,
            Against::Course(Course::Temperature, _) => reading.temperature_c,
            Against::Range => reading.range_m,
        }
    }
}

struct Seen {
    at: f64,
    value: f64,
    effect: f64,
    weight: f64,
}

fn binned(seen: &[Seen]) -> Vec<PatternPoint> {
    let [lowest, highest] = ends(seen.iter().map(|each| each.at));
    let width = ((highest - lowest) / BINS as f64).max(f64::MIN_POSITIVE);
    let of = |bin: usize| {
        let [from, to] = [bin, bin + 1].map(|edge| lowest + edge as f64 * width);
        let is_in =
            |each: &&Seen| (bin == 0 || each.at >= from) && (bin + 1 == BINS || each.at < to);
        let all: Vec<&Seen> = seen.iter().filter(is_in).collect();
        let weight: f64 = all.iter().map(|each| each.weight).sum();
        let mean = |value: &dyn Fn(&Seen) -> f64| {
            all.iter()
                .map(|each| value(each) * each.weight)
                .sum::<f64>()
                / weight
        };
        let value = mean(&|each| each.value);
        let squares = all.iter().map(|each| {
            let off = each.value - each.effect;
            (each.weight * off).powi(2)
        });
        (weight > 0.0).then(|| PatternPoint {
            at: mean(&|each| each.at),
            seen: value,
            standard_error: squares.sum::<f64>().sqrt() / weight,
            pattern: mean(&|each| each.effect),
        })
    };
    (0..BINS).filter_map(of).collect()
}
