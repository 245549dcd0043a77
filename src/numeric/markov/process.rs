//! A process by its states at knots.

use nalgebra::{DMatrix, Matrix2, RowVector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Kernel, Transition};

/// Lengths that are tried, from the shortest, each so many times the one before.
pub const FIRST_LENGTH: f64 = 0.01;
const RATIO: f64 = 1.25;
/// The longest, as a share of the range of the knots.
const LONGEST: f64 = 1.0 / 6.0;

/// A process at some knots, of unit variance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MarkovProcess {
    /// The knots in ascending order, at least one.
    pub knots: Vec<f64>,
    /// What it is.
    #[serde(flatten)]
    pub kernel: Kernel,
}

/// A value between knots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Between {
    /// The numbers of the states of two knots on which it depends, and how; the same twice where there is one alone.
    weights: [(usize, f64); 4],
    /// The variance of its own part.
    pub spare: f64,
    /// How many numbers a state has.
    order: usize,
}

impl Between {
    /// The numbers of states on which it depends, and how.
    pub fn terms(&self) -> impl ExactSizeIterator<Item = (usize, f64)> + Clone + use<> {
        self.weights.into_iter().take(2 * self.order)
    }
}

/// A symmetric matrix of blocks of one number or of four, on its diagonal and beside it.
#[derive(Debug, Clone, PartialEq)]
pub struct KnotBlocks {
    order: usize,
    diagonal: Vec<Matrix2<f64>>,
    /// Each above the diagonal.
    beside: Vec<Matrix2<f64>>,
    /// That of the last knot (rows) and the first.
    around: Matrix2<f64>,
}

impl KnotBlocks {
    /// Of so many numbers for each of so many knots, by entries.
    pub fn of(order: usize, knots: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        let block = |one: usize, other: usize| {
            Matrix2::from_fn(|row, column| {
                if row.max(column) < order {
                    entry(order * one + row, order * other + column)
                } else {
                    0.0
                }
            })
        };
        Self {
            order,
            diagonal: (0..knots).map(|knot| block(knot, knot)).collect(),
            beside: (1..knots).map(|knot| block(knot - 1, knot)).collect(),
            around: block(knots - 1, 0),
        }
    }

    /// Adds it over a variance to a larger matrix, from this place on its diagonal on.
    pub fn add_to(&self, matrix: &mut DMatrix<f64>, first: usize, variance: f64) {
        let order = self.order;
        let entries = || (0..order).flat_map(|row| (0..order).map(move |column| (row, column)));
        for (knot, block) in self.diagonal.iter().enumerate() {
            for (row, column) in entries() {
                let at = first + order * knot;
                matrix[(at + row, at + column)] += block[(row, column)] / variance;
            }
        }
        let last = self.diagonal.len() - 1;
        let beside = self.beside.iter().enumerate();
        let beside = beside.map(|(knot, block)| (knot, knot + 1, block));
        for (knot, next, block) in beside.chain([(last, 0, &self.around)]) {
            for (row, column) in entries() {
                let (at, next) = (first + order * knot + row, first + order * next + column);
                matrix[(at, next)] += block[(row, column)] / variance;
                matrix[(next, at)] += block[(row, column)] / variance;
            }
        }
    }

    /// Multiplies it.
    fn scale(&mut self, by: f64) {
        let blocks = self.diagonal.iter_mut().chain(&mut self.beside);
        blocks
            .chain([&mut self.around])
            .for_each(|block| *block *= by);
    }

    /// The sum of the products of its entries with those of another: trace(A B).
    pub fn product_trace(&self, other: &Self) -> f64 {
        let sum = |one: &[Matrix2<f64>], other: &[Matrix2<f64>]| -> f64 {
            one.iter()
                .zip(other)
                .map(|(one, other)| one.dot(other))
                .sum()
        };
        let beside = sum(&self.beside, &other.beside) + self.around.dot(&other.around);
        sum(&self.diagonal, &other.diagonal) + 2.0 * beside
    }
}

/// So many knots, or fewer, among values: each stands for as many of them.
pub fn knots_among(values: &[f64], count: usize) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else {
        return vec![0.0];
    };
    let intervals = count.saturating_sub(1).max(1);
    // Between values, so that none is nearer to a knot than others that follow the same law.
    let place = |knot: usize| knot * last / intervals;
    let mut knots: Vec<f64> = (0..=intervals)
        .map(|knot| f64::midpoint(sorted[place(knot)], sorted[last.min(place(knot) + 1)]))
        .collect();
    knots[0] = sorted[0];
    // Knots nearer than any length that is tried tell nothing apart.
    knots.dedup_by(|one, other| *one - *other < 0.1 * FIRST_LENGTH);
    knots
}

impl MarkovProcess {
    /// A value at any place.
    pub fn between(&self, at: f64) -> Between {
        let kernel = &self.kernel;
        let order = kernel.order();
        let between = |knots: [usize; 2], weights: [RowVector2<f64>; 2], spare: f64| Between {
            weights: std::array::from_fn(|each| {
                let (end, number) = (each / order % 2, each % order);
                (order * knots[end] + number, weights[end][number])
            }),
            spare,
            order,
        };
        let last = self.knots.len() - 1;
        let at = match kernel.period {
            Some(period) => self.knots[0] + (at - self.knots[0]).rem_euclid(period),
            None => at,
        };
        let after = self.knots.partition_point(|knot| *knot < at);
        let is_outside = after == 0 || after > last;
        if is_outside && kernel.period.is_none() {
            let knot = after.min(last);
            let Transition { kept, added } = if after == 0 {
                kernel.step_back(self.knots[knot] - at)
            } else {
                kernel.step(at - self.knots[knot])
            };
            let weights = [kept.row(0).into_owned(), RowVector2::zeros()];
            return between([knot; 2], weights, added[(0, 0)]);
        }
        let scale = kernel.scale();
        let (left, right, knots) = if is_outside {
            // On the way around.
            let left = (at - self.knots[last]).rem_euclid(kernel.period.unwrap_or(f64::MAX));
            let whole = kernel.period.unwrap_or(f64::MAX) - (self.knots[last] - self.knots[0]);
            (left.min(whole), (whole - left).max(0.0), [last, 0])
        } else {
            let [before, next] = [after - 1, after].map(|knot| self.knots[knot]);
            (at - before, next - at, [after - 1, after])
        };
        if order > 1 {
            let (by, spare) = kernel.bridge(left, right);
            let weights = by.map(|each| each.row(0).into_owned());
            return between(knots, weights, scale * spare[(0, 0)].max(0.0));
        }
        // The same as sinh(b / l) / sinh(h / l), which would overflow.
        let step = |distance: f64| (-distance / kernel.length).exp();
        let (whole, one, other) = (step(left + right), step(left), step(right));
        let norm = 1.0 - whole * whole;
        let weights = [(one - other * whole) / norm, (other - one * whole) / norm];
        let explained = weights[0] * one + weights[1] * other;
        let weights = weights.map(|weight| RowVector2::new(weight, 0.0));
        between(knots, weights, scale * (1.0 - explained).max(0.0))
    }

    /// How many numbers the states at all knots have.
    pub fn states(&self) -> usize {
        self.kernel.order() * self.knots.len()
    }

    /// The first knot and the last.
    pub fn range(&self) -> [f64; 2] {
        [self.knots[0], self.knots[self.knots.len() - 1]]
    }

    /// The covariance of two numbers of the states.
    pub fn covariance(&self, one: usize, other: usize) -> f64 {
        let order = self.kernel.order();
        let (first, next) = (one.min(other), one.max(other));
        let apart = self.knots[next / order] - self.knots[first / order];
        self.kernel.covariance(apart)[(next % order, first % order)]
    }

    /// The precision of the states at the knots, and the logarithm of its determinant.
    pub fn precision(&self) -> (KnotBlocks, f64) {
        let order = self.kernel.order();
        let is_first = |row, column| row == column && row < order && self.kernel.period.is_none();
        let mut precision = KnotBlocks::of(order, self.knots.len(), |row, column| {
            f64::from(u8::from(is_first(row, column)))
        });
        precision.around.fill(0.0);
        let mut logarithm = 0.0;
        for (place, pair) in self.knots.windows(2).enumerate() {
            let ([before, across, after], own) = self.kernel.tie(pair[1] - pair[0]);
            precision.diagonal[place] += before;
            precision.diagonal[place + 1] += after;
            precision.beside[place] = across;
            logarithm += own;
        }
        if let Some(period) = self.kernel.period {
            let (last, [low, high]) = (self.knots.len() - 1, self.range());
            let ([before, across, after], own) = self.kernel.tie(period - (high - low));
            precision.diagonal[last] += before;
            precision.diagonal[0] += after;
            precision.around = across;
            let kept = self.kernel.step(period).kept;
            let left = if order > 1 {
                (Matrix2::identity() - kept).determinant()
            } else {
                1.0 - kept[(0, 0)]
            };
            let scale = self.kernel.scale();
            precision.scale(scale.recip());
            logarithm += own + 2.0 * left.ln() - self.states() as f64 * scale.ln();
        }
        (precision, logarithm)
    }

    /// The longest length: what reaches over more of the knots' range looks like a constant and a slope, and is told from none.
    pub fn longest(knots: &[f64]) -> f64 {
        let range = knots[knots.len() - 1] - knots[0];
        (LONGEST * range).max(FIRST_LENGTH)
    }

    /// The likeliest length, up to the longest, for values with these expected squares and products of neighbours.
    pub fn likeliest_length(&self, squares: &KnotBlocks) -> f64 {
        let count = self.states() as f64;
        let mut best = (f64::NEG_INFINITY, self.kernel.length);
        let mut tried = self.clone();
        tried.kernel.length = FIRST_LENGTH;
        let longest = Self::longest(&self.knots);
        while tried.kernel.length <= longest {
            let (precision, logarithm) = tried.precision();
            let variance = precision.product_trace(squares) / count;
            let likelihood = 0.5 * (logarithm - count * variance.ln());
            if likelihood > best.0 {
                best = (likelihood, tried.kernel.length);
            }
            tried.kernel.length *= RATIO;
        }
        best.1
    }
}
