//! Gaussian processes of unit variance over a coordinate that forget, by their states at knots.
//!
//! ```text
//! exponential:  cov(u(a), u(b)) = exp(-x),             x = |a - b| / l
//! Matern 3/2:   cov(u(a), u(b)) = (1 + x) exp(-x)
//! ```
//!
//! The first (of Ornstein and Uhlenbeck) assumes nothing of its shape but how far it reaches, l; the second is smooth: it has a slope
//! everywhere. Both are Markov processes, the first in its value, the second in the state (u, l u'), whose two numbers are independent and
//! of unit variance. Between two knots a value depends on their states alone, so that the precision of the states at knots is block
//! tridiagonal, and a value in between is a weighted sum of the two states beside it and a part of its own.
//!
//! A process may come again with a period P: then its covariance is the sum over all a - b + m P, over what that is at zero; it is Markov
//! around the circle, from each knot to the next and from the last to the first.

mod process;
mod sample;
#[cfg(test)]
mod tests;

use nalgebra::Matrix2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use process::{Between, FIRST_LENGTH, KnotBlocks, MarkovProcess, knots_among};
pub use sample::{ProcessPoint, SampledFunction, root};

/// So many lengths away nothing is left: exp(-x) is 0.
const FORGOTTEN: f64 = 1e3;

/// How smooth a process is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Correlation {
    /// exp(-x): of no shape.
    #[default]
    Exponential,
    /// (1 + x) exp(-x): with a slope everywhere.
    Matern32,
}

impl Correlation {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Exponential, Self::Matern32];

    /// Whether it is the usual one.
    pub fn is_exponential(&self) -> bool {
        *self == Self::Exponential
    }
}

/// A process: how smooth it is, and the length l over which it forgets.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Kernel {
    /// Its correlation.
    #[serde(default, skip_serializing_if = "Correlation::is_exponential")]
    pub correlation: Correlation,
    /// Its length l.
    pub length: f64,
    /// Its period P, if it comes again.
    #[serde(skip)]
    pub period: Option<f64>,
}

/// How a state follows from the one before: the second row and column are nothing where a state is a value alone.
struct Transition {
    /// What is kept of the state before,
    kept: Matrix2<f64>,
    /// and the covariance of what is added.
    added: Matrix2<f64>,
}

/// The first number alone.
const fn alone(value: f64) -> Matrix2<f64> {
    Matrix2::new(value, 0.0, 0.0, 0.0)
}

/// L of L L^T, of a covariance that may be nothing.
fn lower_root(covariance: &Matrix2<f64>) -> Matrix2<f64> {
    let first = covariance[(0, 0)].max(0.0).sqrt();
    let beside = if first > 0.0 {
        covariance[(1, 0)] / first
    } else {
        0.0
    };
    let second = (covariance[(1, 1)] - beside * beside).max(0.0).sqrt();
    Matrix2::new(first, 0.0, beside, second)
}

/// The inverse of a covariance that is positive definite.
fn inverse(covariance: &Matrix2<f64>) -> Matrix2<f64> {
    let [a, b, d] = [(0, 0), (0, 1), (1, 1)].map(|place| covariance[place]);
    Matrix2::new(d, -b, -b, a) / (a * d - b * b)
}

impl Kernel {
    /// An exponential correlation of such a length.
    pub const fn exponential(length: f64) -> Self {
        let correlation = Correlation::Exponential;
        Self {
            correlation,
            length,
            period: None,
        }
    }

    /// The same that comes again with a period, or does not.
    pub const fn again(self, period: Option<f64>) -> Self {
        Self { period, ..self }
    }

    /// By what variances of the line are multiplied where the process comes again.
    fn scale(&self) -> f64 {
        let around = |period| self.around(0.0, period)[0].recip();
        self.period.map_or(1.0, around)
    }

    /// The sums of exp(-x), x exp(-x) and x^2 exp(-x) over a distance and all that are whole periods longer.
    fn sums(&self, apart: f64, period: f64) -> [f64; 3] {
        let [x, step] = [apart, period].map(|each| each / self.length);
        let (kept, again) = ((-x).exp(), (-step).exp());
        let rest = -(-step).exp_m1();
        let more = step * again / rest;
        [
            kept / rest,
            kept * (x + more) / rest,
            kept * (x * x + 2.0 * x * more + step * step * again * (1.0 + again) / (rest * rest))
                / rest,
        ]
    }

    /// The covariance of values so far apart on the line, summed over all periods, and its derivative by the logarithm of the length.
    fn around(&self, apart: f64, period: f64) -> [f64; 2] {
        let [one, other] = [apart, period - apart].map(|apart| self.sums(apart, period));
        let [plain, first, second]: [f64; 3] = std::array::from_fn(|each| one[each] + other[each]);
        match self.correlation {
            Correlation::Exponential => [plain, first],
            Correlation::Matern32 => [plain + first, second],
        }
    }

    /// The sum of what is kept of a state after so far and after all whole periods more.
    fn images(&self, apart: f64, period: f64) -> Matrix2<f64> {
        let [sum, moment, _] = self.sums(apart, period);
        match self.correlation {
            Correlation::Exponential => alone(sum),
            Correlation::Matern32 => Matrix2::new(sum + moment, moment, -moment, sum - moment),
        }
    }

    /// The covariance of a state with another so far before it, within a period.
    fn covariance(&self, apart: f64) -> Matrix2<f64> {
        let Some(period) = self.period else {
            return self.step(apart).kept;
        };
        let both = self.images(apart, period) + self.images(period - apart, period).transpose();
        both * self.scale()
    }

    /// How many numbers a state has.
    pub const fn order(&self) -> usize {
        match self.correlation {
            Correlation::Exponential => 1,
            Correlation::Matern32 => 2,
        }
    }

    /// The correlation of two values so far apart, and its derivative by the logarithm of the length.
    pub fn correlation(&self, apart: f64) -> [f64; 2] {
        if let Some(period) = self.period {
            let [[own, by], [whole, of_whole]] =
                [apart % period, 0.0].map(|apart| self.around(apart, period));
            return [own / whole, (by - own * of_whole / whole) / whole];
        }
        let x = apart / self.length;
        let kept = (-x).exp();
        match self.correlation {
            Correlation::Exponential => [kept, x * kept],
            Correlation::Matern32 => [(1.0 + x) * kept, x * x * kept],
        }
    }

    /// The variance of the logarithm of a process's variance, or of its length, that its course over such a range leaves: 2 / N, where N is the
    /// range over the integral of the squared correlation.
    pub fn variance_of_course(&self, range: f64) -> f64 {
        let integral = match self.correlation {
            Correlation::Exponential => self.length,
            Correlation::Matern32 => 2.5 * self.length,
        };
        2.0 * integral / range.max(integral)
    }

    fn step(&self, apart: f64) -> Transition {
        let x = (apart / self.length).min(FORGOTTEN);
        let kept = (-x).exp();
        match self.correlation {
            Correlation::Exponential => Transition {
                kept: alone(kept),
                added: alone(1.0 - kept * kept),
            },
            Correlation::Matern32 => {
                // exp(2 x) - 1 - 2 x - 2 x^2 times exp(-2 x), which loses no digits where x is small.
                let square = kept * kept;
                let rest = if x > 0.5 {
                    1.0 - square * (1.0 + 2.0 * x + 2.0 * x * x)
                } else {
                    let mut term = 2.0 * x * x;
                    let terms = (3..20).map(|order| {
                        term *= 2.0 * x / f64::from(order);
                        term
                    });
                    square * terms.sum::<f64>()
                };
                let beside = 2.0 * x * x * square;
                Transition {
                    kept: Matrix2::new(1.0 + x, x, -x, 1.0 - x) * kept,
                    added: Matrix2::new(rest, beside, beside, rest + 4.0 * x * square),
                }
            }
        }
    }

    /// The same against the coordinate: slopes count the other way.
    fn step_back(&self, apart: f64) -> Transition {
        let Transition { kept, added } = self.step(apart);
        let turned = Matrix2::new(1.0, -1.0, -1.0, 1.0);
        Transition {
            kept: kept.component_mul(&turned),
            added: added.component_mul(&turned),
        }
    }

    /// A state between two others, so far behind the one and before the other: how it follows each, and the covariance of its own part; of
    /// states that are more than a value.
    fn bridge(&self, left: f64, right: f64) -> ([Matrix2<f64>; 2], Matrix2<f64>) {
        let [one, other, whole] = [left, right, left + right].map(|apart| self.step(apart));
        let gain = one.added * other.kept.transpose() * inverse(&whole.added);
        let spare = one.added - gain * whole.added * gain.transpose();
        ([one.kept - gain * whole.kept, gain], spare)
    }

    /// How a state in the middle follows the one before it, so far away, which is how it follows the other but for the signs of slopes; and
    /// the root of its own covariance.
    fn middle(&self, half: f64) -> [Matrix2<f64>; 2] {
        if self.order() > 1 {
            let ([before, _], spare) = self.bridge(half, half);
            return [before, lower_root(&spare)];
        }
        let near = (-half / self.length).exp();
        let spare = -(-2.0 * half / self.length).exp_m1() / (1.0 + near * near);
        [alone(near / (1.0 + near * near)), alone(spare.sqrt())]
    }

    /// What a step adds to the precision of the state before, of both, and of the state after; and the logarithm of its determinant.
    fn tie(&self, apart: f64) -> ([Matrix2<f64>; 3], f64) {
        let Transition { kept, added } = self.step(apart);
        if self.order() > 1 {
            let after = inverse(&added);
            let across = -kept.transpose() * after;
            return ([-across * kept, across, after], -added.determinant().ln());
        }
        let [kept, new] = [kept[(0, 0)], added[(0, 0)]];
        (
            [kept * kept / new, -kept / new, 1.0 / new].map(alone),
            -new.ln(),
        )
    }
}
