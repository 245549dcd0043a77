//! The Ornstein-Uhlenbeck process of unit variance over a coordinate, by its values at knots.
//!
//! ```text
//! cov(u(a), u(b)) = exp(-|a - b| / l)
//! ```
//!
//! Nothing is assumed of its shape but how far it reaches, l. Between two knots it depends on their values alone, so that the
//! precision of the values at knots is tridiagonal, and a value in between is a weighted sum of the two beside it and
//! a part of its own.

use nalgebra::DMatrix;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Lengths that are tried, from the shortest, each so many times the one before.
const FIRST_LENGTH: f64 = 0.01;
const RATIO: f64 = 1.25;
/// The longest, as a share of the range of the knots.
const LONGEST: f64 = 1.0 / 6.0;

/// The process at some knots, of unit variance.
#[derive(Debug, Clone, PartialEq)]
pub struct OrnsteinUhlenbeck {
    /// The knots in ascending order, at least one.
    pub knots: Vec<f64>,
    /// The length l over which it forgets.
    pub length: f64,
}

/// A value between knots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Between {
    /// The two knots on which it depends; the same twice where there is one alone.
    pub knots: [usize; 2],
    /// How it depends on them.
    pub weights: [f64; 2],
    /// The variance of its own part.
    pub spare: f64,
}

/// A symmetric tridiagonal matrix.
#[derive(Debug, Clone, PartialEq)]
pub struct Tridiagonal {
    /// Its diagonal.
    pub diagonal: Vec<f64>,
    /// What stands beside it.
    pub beside: Vec<f64>,
}

impl Tridiagonal {
    /// Adds it to a larger matrix, from this place on its diagonal on.
    pub fn add_to(&self, matrix: &mut DMatrix<f64>, first: usize) {
        for (place, value) in self.diagonal.iter().enumerate() {
            matrix[(first + place, first + place)] += value;
        }
        for (place, value) in self.beside.iter().enumerate() {
            matrix[(first + place, first + place + 1)] += value;
            matrix[(first + place + 1, first + place)] += value;
        }
    }

    /// The sum of the products of its entries with those of another: trace(A B).
    pub fn product_trace(&self, other: &Self) -> f64 {
        let sum = |one: &[f64], other: &[f64]| -> f64 {
            one.iter().zip(other).map(|(one, other)| one * other).sum()
        };
        sum(&self.diagonal, &other.diagonal) + 2.0 * sum(&self.beside, &other.beside)
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

/// What follows independent processes at places of their coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct ProcessPoint {
    /// How its rows follow each process, by one standard deviation of that (r x f),
    pub columns: DMatrix<f64>,
    /// at these places (f).
    pub places: Vec<f64>,
}

impl ProcessPoint {
    /// The covariance with another point (r x r'), of processes with these lengths (f).
    pub fn covariance(&self, other: &Self, lengths: &[f64]) -> DMatrix<f64> {
        let mut covariance = DMatrix::zeros(self.columns.nrows(), other.columns.nrows());
        for (process, length) in lengths.iter().enumerate() {
            let apart = (self.places[process] - other.places[process]).abs();
            let shared = (-apart / length).exp();
            let [mine, theirs] = [self, other].map(|point| point.columns.column(process));
            covariance.ger(shared, &mine, &theirs, 1.0);
        }
        covariance
    }
}

/// The process from each place to the next in rising order: the number of the place, how much it keeps of the value before, and how much
/// of a standard normal number it adds.
fn steps(places: &[f64], length: f64) -> impl Iterator<Item = (usize, [f64; 2])> {
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by(|&one, &other| places[one].total_cmp(&places[other]).then(one.cmp(&other)));
    let mut before: Option<f64> = None;
    order.into_iter().map(move |place| {
        let at = places[place];
        let kept = (before.replace(at)).map_or(0.0, |before| (-(at - before) / length).exp());
        (place, [kept, (1.0 - kept * kept).max(0.0).sqrt()])
    })
}

/// Values of one sample of the process at some places, with this length.
pub fn sampled(places: &[f64], length: f64, random: &mut ChaCha8Rng) -> Vec<f64> {
    let mut values = vec![0.0; places.len()];
    let mut value = 0.0;
    for (place, [kept, added]) in steps(places, length) {
        let new: f64 = StandardNormal.sample(random);
        value = kept * value + added * new;
        values[place] = value;
    }
    values
}

/// How standard normal numbers make the values at some places (n x n), with this length.
pub fn root(places: &[f64], length: f64) -> DMatrix<f64> {
    let mut root = DMatrix::zeros(places.len(), places.len());
    let mut row = DMatrix::zeros(1, places.len());
    for (number, (place, [kept, added])) in steps(places, length).enumerate() {
        row *= kept;
        row[number] = added;
        root.row_mut(place).copy_from(&row);
    }
    root
}

/// A sample of the process of unit variance as a function: its value at a place depends on its random numbers and on the place alone,
/// whatever else it is asked for (P. Levy's construction: halves of a range, each middle given both ends).
#[derive(Debug, Clone)]
pub struct SampledFunction {
    length: f64,
    /// The cipher of its numbers, and where in it they begin.
    random: ChaCha8Rng,
    first: u128,
}

/// A sampled function is known within this distance from zero, and as at the ends beyond; its range is halved so often.
const HALF_RANGE: f64 = 1024.0;
const HALVINGS: usize = 40;
/// A node's numbers are so many words apart, and a function's more than all nodes of one need.
const NODE_WORDS: u128 = 16;
const FUNCTION_WORDS: u128 = 1 << 56;

impl SampledFunction {
    /// The function of such a number among those of a generator, with this length.
    pub const fn new(length: f64, random: ChaCha8Rng, number: usize) -> Self {
        let first = number as u128 * FUNCTION_WORDS;
        Self {
            length,
            random,
            first,
        }
    }

    fn normal(&self, node: u64) -> f64 {
        let mut random = self.random.clone();
        random.set_word_pos(self.first + u128::from(node) * NODE_WORDS);
        StandardNormal.sample(&mut random)
    }

    /// Its value at a place.
    pub fn at(&self, place: f64) -> f64 {
        let step = |distance: f64| (-distance / self.length).exp();
        let mut ends = [-HALF_RANGE, HALF_RANGE];
        let kept = step(2.0 * HALF_RANGE);
        let first = self.normal(0);
        let mut values = [
            first,
            kept * first + (1.0 - kept * kept).sqrt() * self.normal(1),
        ];
        let mut node = 2;
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(ends[0], ends[1]);
            let half = 0.5 * (ends[1] - ends[0]);
            let near = step(half);
            let spare = -(-2.0 * half / self.length).exp_m1() / (1.0 + near * near);
            let mean = near / (1.0 + near * near) * (values[0] + values[1]);
            let value = mean + spare.sqrt() * self.normal(node);
            let side = usize::from(place < middle);
            (ends[side], values[side]) = (middle, value);
            node = 2 * node + side as u64;
        }
        f64::midpoint(values[0], values[1])
    }
}

impl OrnsteinUhlenbeck {
    /// A value at any place.
    pub fn between(&self, at: f64) -> Between {
        let after = self.knots.partition_point(|knot| *knot < at);
        let last = self.knots.len() - 1;
        if after == 0 || after > last {
            let knot = after.min(last);
            let weight = (-(at - self.knots[knot]).abs() / self.length).exp();
            return Between {
                knots: [knot; 2],
                weights: [weight, 0.0],
                spare: 1.0 - weight * weight,
            };
        }
        // The same as sinh(b / l) / sinh(h / l), which would overflow.
        let (left, right) = (at - self.knots[after - 1], self.knots[after] - at);
        let step = |distance: f64| (-distance / self.length).exp();
        let (whole, one, other) = (step(left + right), step(left), step(right));
        let norm = 1.0 - whole * whole;
        let weights = [(one - other * whole) / norm, (other - one * whole) / norm];
        let explained = weights[0] * one + weights[1] * other;
        Between {
            knots: [after - 1, after],
            weights,
            spare: (1.0 - explained).max(0.0),
        }
    }

    /// The first knot and the last.
    pub fn range(&self) -> [f64; 2] {
        [self.knots[0], self.knots[self.knots.len() - 1]]
    }

    /// The correlation of the values at two knots.
    pub fn correlation(&self, one: usize, other: usize) -> f64 {
        (-(self.knots[one] - self.knots[other]).abs() / self.length).exp()
    }

    /// The precision of the values at the knots, and the logarithm of its determinant.
    pub fn precision(&self) -> (Tridiagonal, f64) {
        let mut precision = Tridiagonal {
            diagonal: vec![0.0; self.knots.len()],
            beside: Vec::new(),
        };
        precision.diagonal[0] = 1.0;
        let mut logarithm = 0.0;
        for (place, pair) in self.knots.windows(2).enumerate() {
            let kept = (-(pair[1] - pair[0]) / self.length).exp();
            let new = 1.0 - kept * kept;
            precision.diagonal[place] += kept * kept / new;
            precision.diagonal[place + 1] += 1.0 / new;
            precision.beside.push(-kept / new);
            logarithm -= new.ln();
        }
        (precision, logarithm)
    }

    /// The longest length: what reaches over more of the knots' range looks like a constant and a slope, and is told from none.
    pub fn longest(knots: &[f64]) -> f64 {
        let range = knots[knots.len() - 1] - knots[0];
        (LONGEST * range).max(FIRST_LENGTH)
    }

    /// The likeliest length, up to the longest, for values with these expected squares and products of neighbours.
    pub fn likeliest_length(&self, squares: &Tridiagonal) -> f64 {
        let count = self.knots.len() as f64;
        let mut best = (f64::NEG_INFINITY, self.length);
        let mut tried = Self {
            knots: self.knots.clone(),
            length: FIRST_LENGTH,
        };
        let longest = Self::longest(&self.knots);
        while tried.length <= longest {
            let (precision, logarithm) = tried.precision();
            let variance = precision.product_trace(squares) / count;
            let likelihood = 0.5 * (logarithm - count * variance.ln());
            if likelihood > best.0 {
                best = (likelihood, tried.length);
            }
            tried.length *= RATIO;
        }
        best.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn process() -> OrnsteinUhlenbeck {
        OrnsteinUhlenbeck {
            knots: vec![-1.0, -0.7, 0.1, 0.2, 2.0],
            length: 0.4,
        }
    }

    #[test]
    fn the_precision_is_the_inverse_of_the_covariance() {
        let process = process();
        let covariance = DMatrix::from_fn(5, 5, |row, column| process.correlation(row, column));
        let (precision, logarithm) = process.precision();
        let precision = DMatrix::from_fn(5, 5, |row, column| match row.abs_diff(column) {
            0 => precision.diagonal[row],
            1 => precision.beside[row.min(column)],
            _ => 0.0,
        });
        assert!((&precision * &covariance - DMatrix::identity(5, 5)).norm() < 1e-12);
        assert!((logarithm + covariance.determinant().ln()).abs() < 1e-12);
    }

    /// Weights and spare variance are those of the normal distribution given all knots.
    #[test]
    fn values_between_knots_follow_from_the_two_beside_them() {
        let process = process();
        let covariance = DMatrix::from_fn(5, 5, |row, column| process.correlation(row, column));
        let inverse = covariance.try_inverse().expect("regular");
        for at in [-3.0, -1.0, -0.8, 0.0, 0.19, 1.5, 2.0, 2.5] {
            let with = DMatrix::from_fn(1, 5, |_, knot| {
                (-(at - process.knots[knot]).abs() / process.length).exp()
            });
            let weights = &with * &inverse;
            let between = process.between(at);
            let mut found = DMatrix::zeros(1, 5);
            for (knot, weight) in between.knots.into_iter().zip(between.weights) {
                found[(0, knot)] += weight;
            }
            assert!((&found - &weights).norm() < 1e-12, "{at}");
            let spare = 1.0 - (weights * with.transpose())[(0, 0)];
            assert!((between.spare - spare).abs() < 1e-12, "{at}");
        }
    }

    /// Samples are of unit variance, and correlated as the process is, whatever the order of the places.
    #[test]
    fn samples_are_correlated_as_the_process_is() {
        let places = [0.3, -0.2, 0.0];
        let mut random = crate::numeric::random::generator(3, 0);
        let count = 20_000;
        let mut products = DMatrix::zeros(3, 3);
        for _ in 0..count {
            let values = DMatrix::from_vec(3, 1, sampled(&places, 0.4, &mut random));
            products += &values * values.transpose() / f64::from(count);
        }
        for (row, one) in places.iter().enumerate() {
            for (column, other) in places.iter().enumerate() {
                let expected = (-(one - other).abs() / 0.4_f64).exp();
                let error = (1.0 + expected * expected).sqrt() / f64::from(count).sqrt();
                assert!((products[(row, column)] - expected).abs() < 4.0 * error);
            }
        }
    }

    /// A sampled function is the process, and the same whenever it is asked.
    #[test]
    fn sampled_functions_are_the_process() {
        let places = [0.3, -0.2, 0.0, 0.300_001, -6.1];
        let count = 20_000;
        let mut products = DMatrix::zeros(5, 5);
        for run in 0..count {
            let random = crate::numeric::random::generator(5, run);
            let functions = [0, 1].map(|each| SampledFunction::new(0.4, random.clone(), each));
            let value = |place: f64| functions[0].at(place);
            let values = DMatrix::from_iterator(5, 1, places.map(value));
            assert!((value(places[1]) - values[1]).abs() < f64::EPSILON);
            assert!((functions[1].at(0.3) - values[0]).abs() > f64::EPSILON);
            products += &values * values.transpose() / count as f64;
        }
        for (row, one) in places.iter().enumerate() {
            for (column, other) in places.iter().enumerate() {
                let expected = (-(one - other).abs() / 0.4_f64).exp();
                let error = (1.0 + expected * expected).sqrt() / (count as f64).sqrt();
                let off = products[(row, column)] - expected;
                assert!(off.abs() < 4.0 * error, "{row} {column}: {off}");
            }
        }
    }

    #[test]
    fn knots_stand_where_values_are() {
        let values: Vec<f64> = (0..100)
            .map(|index| (f64::from(index) / 99.0).powi(2))
            .collect();
        let knots = knots_among(&values, 5);
        assert_eq!(knots.len(), 5);
        assert!(knots[0].abs() < 1e-12 && (knots[4] - 1.0).abs() < 1e-12 && knots[2] < 0.3);
        assert_eq!(knots_among(&[2.0; 9], 5).len(), 1);
        assert_eq!(knots_among(&[], 5).len(), 1);
    }

    /// The root of the covariance is one, whatever the order of the places, equal ones among them.
    #[test]
    fn roots_are_those_of_the_covariance() {
        let places = [0.3, -0.2, 0.0, 0.3, 1.7];
        let point = |place: &f64| ProcessPoint {
            columns: DMatrix::identity(1, 1),
            places: vec![*place],
        };
        let root = root(&places, 0.4);
        let found = &root * root.transpose();
        for (row, one) in places.iter().enumerate() {
            for (column, other) in places.iter().enumerate() {
                let expected = point(one).covariance(&point(other), &[0.4])[0];
                assert!((found[(row, column)] - expected).abs() < 1e-12);
            }
        }
    }
}
