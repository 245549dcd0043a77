//! Patterns in residuals: what a fit leaves, looked at against joint angles, torques, the side of approach, order, time,
//! temperature and the distance from the instrument.
//!
//! A joint whose gear is not round, for example, turns by a sin(k q) + b cos(k q) more than it is told; what that does to a reading
//! is its own Jacobian times that, and whether residuals go with it is an F test with two degrees of freedom. All
//! candidates are looked at, the strongest is named if chance would make any of them as strong with a probability below
//! [`LEVEL`], and taken out of the residuals; then the next is looked for.

mod candidates;
mod deflections;
mod points;
mod rows;
mod screen;
#[cfg(test)]
mod tests;
mod words;

use std::collections::BTreeSet;

use serde::Serialize;

pub use candidates::{Against, Course, Drifting};
pub use deflections::looked_at;
pub use points::{PatternPoint, WAVES_TO_SEE};
use rows::Projected;
pub(super) use rows::unit;
pub use rows::{LookedAt, ReadingRows};
use screen::{Test, judged, screened};

/// Residuals without any pattern are said to have one in one of a hundred files.
pub const LEVEL: f64 = 0.01;
/// So many blocks of joint space tell how far configurations are independent, where there are two of them for each.
pub const BLOCKS: usize = 16;
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
    /// What it does, in words.
    pub sentence: String,
    /// What may cause it.
    pub cause: &'static str,
    /// How large it is: the amplitude of waves, else the whole range over these readings; rad, m, or 1.
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
    /// Means over the readings, for a picture.
    #[serde(skip)]
    pub points: Vec<PatternPoint>,
}

/// What residuals go with.
#[derive(Debug, Clone)]
pub struct Patterns {
    /// The strongest first.
    pub found: Vec<Pattern>,
    /// How many candidates were looked at.
    pub looked_at: usize,
    /// Which kinds of them.
    pub kinds: Vec<&'static str>,
    /// The share of the weighted squares that all found explain together.
    pub share: f64,
}

impl LookedAt {
    /// Looks for patterns.
    pub fn patterns(&self) -> Patterns {
        let candidates = self.candidates();
        let mut projected = Projected::new(self);
        let square = projected.left.norm_squared();
        // Residuals that are nothing beside the instrument's noise are rounding.
        let tests = if square > NOTHING * projected.spare as f64 {
            screened(self, &projected, &candidates)
        } else {
            Vec::new()
        };
        let looked_at = tests.len();
        let level = LEVEL / looked_at.max(1) as f64;
        let mut kinds: Vec<&'static str> = tests.iter().map(|test| test.against.kind()).collect();
        let mut named = BTreeSet::new();
        kinds.retain(|kind| named.insert(*kind));
        let mut likely = tests;
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
        let mut found: Vec<Pattern> = (found.iter())
            .map(|test| Pattern {
                against: test.against,
                sentence: self.sentence(test.against, &test.coefficients),
                cause: self.cause(test.against),
                size: self.size(test.against, &test.coefficients),
                share: test.explained / square,
                statistic: test.statistic,
                degrees_of_freedom: test.degrees,
                design_effect: test.design_effect,
                probability: (test.probability * looked_at as f64).min(1.0),
                points: self.points(test.against, &test.coefficients, &projected.left),
            })
            .collect();
        found.sort_by(|one, other| other.share.total_cmp(&one.share));
        Patterns {
            found,
            looked_at,
            kinds,
            share: if square > 0.0 {
                1.0 - left / square
            } else {
                0.0
            },
        }
    }
}
