//! Patterns in residuals: what a fit leaves, looked at against joint angles, torques, the side of approach, order, time,
//! temperature and the distance from the instrument.
//!
//! A joint whose gear is not round, for example, turns by a sin(k q) + b cos(k q) more than it is told; what that does to a reading
//! is its own Jacobian times that, and whether residuals go with it is an F test with two degrees of freedom. All
//! candidates are looked at, the strongest is named if chance would make any of them as strong with a probability below
//! [`LEVEL`], and taken out of the residuals; then the next is looked for.

mod against;
mod deflections;
mod points;
mod rows;
mod screen;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;

use serde::Serialize;

pub use against::{Against, Course, Drifting};
pub use deflections::looked_at;
pub use points::PatternPoint;
use rows::Projected;
pub use rows::{LookedAt, ReadingRows};
use screen::{Test, judged, screened};

use super::outliers::RejectedReading;
use crate::numeric::tolerance::ends;

/// Residuals without any pattern are said to have one in one of a hundred files.
pub const LEVEL: f64 = 0.01;
/// So many blocks of joint space tell how far configurations are independent, where there are two of them for each.
pub(super) const BLOCKS: usize = 16;
/// More patterns than these are not named.
const MOST: usize = 8;
/// Of those that pass alone so many are looked at together.
const LIKELY: usize = 60;

/// A mean whitened square below this is none.
const NOTHING: f64 = 0.01;

/// Something that residuals go with.
#[derive(Debug, Clone, Serialize)]
pub struct Pattern {
    /// What.
    #[serde(skip)]
    pub against: Against,
    /// In a word: `joint angle`, `joint torque`, `approach`, `order`, `time`, `temperature` or `range`.
    #[serde(rename = "against")]
    pub kind: &'static str,
    /// The joint; none where it is none's.
    pub joint: Option<String>,
    /// How many waves in a revolution, against a joint's angle.
    pub harmonic: Option<usize>,
    /// What drifts, with order, time and temperature: `base`, `size` or `joint`.
    pub drifting: Option<&'static str>,
    /// What it does, in words.
    pub sentence: String,
    /// What may cause it.
    pub cause: &'static str,
    /// The cosine's and the sine's part of waves.
    #[serde(skip)]
    pub wave: Option<[f64; 2]>,
    /// How large it is: the amplitude of waves, else the whole range over these readings.
    pub size: f64,
    /// The share of the weighted squares that it explains.
    pub share: f64,
    /// The statistic F, over the design effect.
    pub statistic: f64,
    /// Its first number of degrees of freedom.
    pub degrees_of_freedom: usize,
    /// By how much errors that are larger where it shows, or alike in a configuration or a block of joint space, count less than
    /// independent ones that are all alike.
    pub design_effect: f64,
    /// The probability that chance makes any of all that were looked at as strong.
    pub probability: f64,
    /// The unit of its size: `rad`, `m`, `1` or, of deflections, `rad/(N m)`.
    pub unit: &'static str,
    /// The unit of `at` in the points.
    pub at_unit: &'static str,
    /// Means over the readings, for a picture.
    pub points: Vec<PatternPoint>,
}

impl Pattern {
    /// Where it is along the scale of its points, in the units of these: waves `a cos(k q) + b sin(k q)` at so many places and one more, another
    /// pattern at its points.
    pub fn curve(&self, places: u32) -> Vec<(f64, f64)> {
        // What is no angle goes over one turn.
        let waves = match self.at_unit {
            "deg" => self.harmonic.map(|harmonic| harmonic as f64),
            _ => Some(1.0),
        };
        let (Some([cosine, sine]), Some(waves)) = (self.wave, waves) else {
            let points = self.points.iter();
            return points.map(|point| (point.at, point.pattern)).collect();
        };
        let [from, to] = ends(self.points.iter().map(|point| point.at));
        let value = |place: u32| {
            let at = from + (to - from) * f64::from(place) / f64::from(places);
            let (sin, cos) = (waves * at.to_radians()).sin_cos();
            (at, cosine * cos + sine * sin)
        };
        (0..=places).map(value).collect()
    }
}

/// What residuals go with.
#[derive(Debug, Clone, Serialize)]
pub struct Patterns {
    /// The strongest first.
    pub found: Vec<Pattern>,
    /// How many candidates were looked at.
    pub looked_at: usize,
    /// Which kinds of them.
    pub kinds: Vec<&'static str>,
    /// The probability that anything at all is found in residuals without a pattern.
    pub false_alarm_rate: f64,
    /// The share of the weighted squares that all found explain together.
    pub share: f64,
    /// The numbers, from 1, of readings that were not looked at, since they lie far out of what the others leave.
    pub without: Vec<usize>,
}

impl LookedAt {
    /// Looks for patterns in what a fit without outliers leaves of the others.
    pub fn patterns(&self, rejected: &[RejectedReading]) -> Patterns {
        self.patterns_among(&self.candidates(), rejected)
    }

    /// The same of what goes with order, time or temperature alone.
    pub fn drifts(&self, rejected: &[RejectedReading]) -> Patterns {
        let mut candidates = self.candidates();
        candidates.retain(|each| matches!(each, Against::Course(..)));
        self.patterns_among(&candidates, rejected)
    }

    fn patterns_among(&self, candidates: &[Against], rejected: &[RejectedReading]) -> Patterns {
        let mut projected = Projected::new(self);
        let square = projected.left.norm_squared();
        // Residuals that are nothing beside the instrument's noise are rounding.
        let mut likely = if square > NOTHING * projected.spare as f64 {
            screened(self, &projected, candidates)
        } else {
            Vec::new()
        };
        let looked_at = likely.len();
        let level = LEVEL / looked_at.max(1) as f64;
        let mut kinds: Vec<&'static str> = likely.iter().map(|test| test.against.kind()).collect();
        let mut named = BTreeSet::new();
        kinds.retain(|kind| named.insert(*kind));
        let mut found: Vec<Test> = Vec::new();
        while found.len() < MOST {
            likely.retain(|test| test.probability < level);
            likely.sort_by(|one, other| {
                (one.probability.total_cmp(&other.probability))
                    .then(other.statistic.total_cmp(&one.statistic))
            });
            likely.truncate(LIKELY);
            let next = likely.iter().enumerate().find_map(|(place, test)| {
                let (test, directions) = judged(self, &projected, test.against)?;
                (test.probability < level).then_some((place, test, directions))
            });
            let Some((place, test, directions)) = next else {
                break;
            };
            projected.add(&directions);
            found.push(test);
            likely.remove(place);
            let others: Vec<Against> = likely.iter().map(|test| test.against).collect();
            likely = screened(self, &projected, &others);
        }
        let left = projected.left.norm_squared();
        let pattern = |test: Test| {
            let against = test.against;
            let (size, points) = self.shown(against, &test.coefficients, &projected.left);
            let (sentence, cause, [unit, at_unit]) = self.words(against, size);
            Pattern {
                kind: against.kind(),
                joint: against.joint().map(|joint| self.joints[joint].0.clone()),
                harmonic: match against {
                    Against::Angle { waves, .. } => Some(waves),
                    _ => None,
                },
                wave: match (against, test.coefficients.as_slice()) {
                    (Against::Angle { .. }, &[cosine, sine]) => Some([cosine, sine]),
                    _ => None,
                },
                drifting: against.drifting(),
                share: test.explained / square,
                statistic: test.statistic,
                degrees_of_freedom: test.degrees,
                design_effect: test.design_effect,
                probability: (test.probability * looked_at as f64).min(1.0),
                points,
                against,
                sentence,
                cause,
                size,
                unit,
                at_unit,
            }
        };
        let mut found: Vec<Pattern> = found.into_iter().map(pattern).collect();
        found.sort_by(|one, other| other.share.total_cmp(&one.share));
        Patterns {
            found,
            looked_at,
            kinds,
            false_alarm_rate: LEVEL,
            share: if square > 0.0 {
                1.0 - left / square
            } else {
                0.0
            },
            without: rejected.iter().map(|each| each.reading + 1).collect(),
        }
    }
}
