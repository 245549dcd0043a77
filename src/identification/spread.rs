//! The standard deviation of errors as a function of the joint angles (heteroscedasticity).
//!
//! ```text
//! ln s = b + sum_j f_j(q_j) + e                        s: a square of an error over its computed covariance
//! f_j(q) = sum_k u_jk P_k(u) / k,  k = 1 to 6           P_k: Legendre polynomials, u: the angle from -1 to 1
//! var(u_jk) = t_j,  var(e) = v
//! ```
//!
//! Whatever bends, jams or warms up does so more in one part of joint space than in another, so that regions of one size are
//! too wide here and too small there. What is new is how much: t_j and v are the likeliest ones (restricted maximum likelihood, improved as
//! those of the mixed model are), so that a joint on whose angle nothing depends gets a function that is nearly zero.

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::numeric::factorisation::{gram, inverse_of};

/// So many orders of polynomials of each joint's angle tell how large errors are there.
pub const SPREAD_ORDERS: usize = 6;
/// No square depends more on a joint's angle, as a coefficient of its logarithm: few readings that say so say nothing.
pub const MOST_SPREAD: f64 = 30.0;
/// Improvements of the variances.
const ROUNDS: usize = 40;
/// The variance of a logarithm of a square of three normal coordinates is 0.93.
const FIRST_REST: f64 = 1.0;
/// The first variance of coefficients.
const FIRST: f64 = 0.1;
/// Smaller variances are none.
const LEAST: f64 = 1e-9;

/// Steps of a fit of means: the gamma law's, by Fisher's scoring.
const STEPS: usize = 6;
/// Parts of the squares that are left out, one after the other.
const FOLDS: usize = 10;
/// A square that is larger than expected counts no more than this, in units of what is expected.
const MOST_STEP: f64 = 5.0;

/// The functions of all joints.
pub(super) struct ErrorSpread {
    /// Coefficients of each joint's polynomials, from the first order.
    pub of_joints: Vec<Vec<f64>>,
    /// The logarithm at each place, as the others have it, where that was asked.
    pub by_others: Vec<f64>,
}

/// An angle as a share of a range, from -1 to 1; beyond the range as at its end.
fn share(at: f64, [low, high]: [f64; 2]) -> f64 {
    let half = 0.5 * (high - low);
    if half > 0.0 {
        ((at - low) / half - 1.0).clamp(-1.0, 1.0)
    } else {
        0.0
    }
}

/// Legendre polynomials from the first order, each over its order.
fn polynomials(share: f64) -> [f64; SPREAD_ORDERS] {
    let (mut before, mut last) = (1.0, share);
    std::array::from_fn(|index| {
        let order = (index + 1) as f64;
        let value = last / order;
        let next = ((2.0 * order + 1.0) * share * last - order * before) / (order + 1.0);
        (before, last) = (last, next);
        value
    })
}

/// A joint's function at an angle of a range.
pub(super) fn logarithm(coefficients: &[f64], at: f64, range: [f64; 2]) -> f64 {
    let values = polynomials(share(at, range));
    let terms = coefficients.iter().zip(values);
    terms.map(|(coefficient, value)| coefficient * value).sum()
}

/// Columns of a fit, one of ones before those of each joint.
fn columns_at(angles: &[&[f64]], ranges: &[[f64; 2]]) -> DMatrix<f64> {
    let count = 1 + ranges.len() * SPREAD_ORDERS;
    let mut columns = DMatrix::from_element(angles.len(), count, 1.0);
    for (row, angles) in angles.iter().enumerate() {
        for (joint, (&angle, &range)) in angles.iter().zip(ranges).enumerate() {
            for (order, value) in polynomials(share(angle, range)).into_iter().enumerate() {
                columns[(row, 1 + joint * SPREAD_ORDERS + order)] = value;
            }
        }
    }
    columns
}

fn logarithms(squares: &[f64]) -> DVector<f64> {
    DVector::from_column_slice(squares).map(|square| square.max(f64::MIN_POSITIVE).ln())
}

/// Variances of what is left, and of each joint's coefficients.
struct SpreadVariances {
    rest: f64,
    joints: Vec<f64>,
}

impl SpreadVariances {
    fn first(ranges: &[[f64; 2]]) -> Self {
        Self {
            rest: FIRST_REST,
            joints: vec![FIRST; ranges.len()],
        }
    }

    /// The coefficients (p) with their covariance, by the products of columns with each other and with what is wanted.
    fn fit(
        &self,
        products: &DMatrix<f64>,
        pull: &DVector<f64>,
    ) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let mut precision = products / self.rest;
        for (joint, variance) in self.joints.iter().enumerate() {
            for order in 0..SPREAD_ORDERS {
                let place = 1 + joint * SPREAD_ORDERS + order;
                precision[(place, place)] += 1.0 / variance;
            }
        }
        let covariance = inverse_of(&Cholesky::new(precision)?);
        Some((&covariance * pull / self.rest, covariance))
    }

    /// The likeliest ones, with the coefficients.
    fn likeliest(
        mut self,
        columns: &DMatrix<f64>,
        wanted: &DVector<f64>,
    ) -> Option<(Self, DVector<f64>)> {
        let (products, pull) = (gram(columns), columns.tr_mul(wanted));
        for _ in 0..ROUNDS {
            let (mean, covariance) = self.fit(&products, &pull)?;
            let left = (wanted - columns * &mean).norm_squared();
            let mut free = columns.nrows() as f64 - 1.0;
            for (joint, variance) in self.joints.iter_mut().enumerate() {
                let first = 1 + joint * SPREAD_ORDERS;
                let square = mean.rows(first, SPREAD_ORDERS).norm_squared();
                let own = covariance.view((first, first), (SPREAD_ORDERS, SPREAD_ORDERS));
                let told = SPREAD_ORDERS as f64 - own.trace() / *variance;
                free -= told;
                if told > 0.0 {
                    *variance = (*variance * square / told).sqrt().max(LEAST);
                }
            }
            self.rest = (self.rest * left / free.max(1.0)).sqrt().max(LEAST);
        }
        let (mean, _) = self.fit(&products, &pull)?;
        Some((self, mean))
    }
}

/// What a step of Fisher's scoring takes for logarithms of squares that are expected to have these (logarithms of) means.
fn of_step(squares: &[f64], expected: &DVector<f64>) -> DVector<f64> {
    let each = squares.iter().zip(expected);
    let each = each.map(|(square, one)| one + (square / one.exp() - 1.0).min(MOST_STEP));
    DVector::from_iterator(squares.len(), each)
}

impl ErrorSpread {
    /// Of some squares, each with the angles of the joints there; `ranges` are those of the joints' angles. By logarithms, which wrong
    /// readings hardly move. None where the numbers have no factorisation, or are too few to tell.
    pub fn of_logarithms(squares: &[f64], angles: &[&[f64]], ranges: &[[f64; 2]]) -> Option<Self> {
        let columns = columns_at(angles, ranges);
        let (_, mean) = SpreadVariances::first(ranges).likeliest(&columns, &logarithms(squares))?;
        Self::new(&mean, Vec::new())
    }

    /// The same by means, as regions that shall hold most of the squares need, and the logarithm at each place as the others have it.
    pub fn of_means(squares: &[f64], angles: &[&[f64]], ranges: &[[f64; 2]]) -> Option<Self> {
        let columns = columns_at(angles, ranges);
        let wanted = logarithms(squares);
        let (mut variances, mut mean) =
            SpreadVariances::first(ranges).likeliest(&columns, &wanted)?;
        // The mean of a square is larger than what its logarithm's mean says, by as much everywhere at first.
        let expected = &columns * &mean;
        let ratios = (squares.iter().zip(&expected)).map(|(square, one)| square / one.exp());
        let more = ratios.sum::<f64>() / squares.len() as f64;
        mean[0] += more.max(f64::MIN_POSITIVE).ln();
        for _ in 0..STEPS {
            let wanted = of_step(squares, &(&columns * &mean));
            (variances, mean) = variances.likeliest(&columns, &wanted)?;
        }
        let mut by_others = vec![0.0; squares.len()];
        for fold in 0..FOLDS {
            let (own, others): (Vec<usize>, Vec<usize>) =
                (0..squares.len()).partition(|each| each % FOLDS == fold);
            let part = columns.select_rows(&others);
            let products = gram(&part);
            let squares: Vec<f64> = others.iter().map(|&each| squares[each]).collect();
            let mut found = mean.clone();
            for _ in 0..STEPS {
                let wanted = of_step(&squares, &(&part * &found));
                (found, _) = variances.fit(&products, &part.tr_mul(&wanted))?;
            }
            for row in own {
                by_others[row] = (columns.row(row) * &found)[(0, 0)] - found[0];
            }
        }
        Self::new(&mean, by_others)
    }

    fn new(mean: &DVector<f64>, by_others: Vec<f64>) -> Option<Self> {
        let coefficients = &mean.as_slice()[1..];
        let is_told = coefficients.iter().all(|each| each.abs() <= MOST_SPREAD);
        let of_joints = coefficients.chunks(SPREAD_ORDERS);
        is_told.then(|| Self {
            of_joints: of_joints.map(<[f64]>::to_vec).collect(),
            by_others,
        })
    }

    /// The logarithm at other angles.
    pub fn logarithm_at(&self, angles: &[f64], ranges: &[[f64; 2]]) -> f64 {
        let joints = self.of_joints.iter().zip(angles.iter().zip(ranges));
        (joints.map(|(coefficients, (&angle, &range))| logarithm(coefficients, angle, range))).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Squares of three numbers from a simple generator of uniform numbers, as large as a function of the first of two angles says.
    fn squares(count: usize, function: impl Fn(f64) -> f64) -> (Vec<f64>, Vec<[f64; 2]>) {
        let mut state = 7_u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        };
        (0..count)
            .map(|_| {
                let angles = [2.0 * uniform() - 1.0, 5.0 * uniform()];
                let mut normal =
                    || (-2.0 * uniform().ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos();
                let square = normal().powi(2) + normal().powi(2) + normal().powi(2);
                (square * function(angles[0]).exp(), angles)
            })
            .unzip()
    }

    #[test]
    fn polynomials_are_those_of_legendre() {
        let at = 0.3_f64;
        let [first, second, third, ..] = polynomials(at);
        assert!((first - at).abs() < 1e-15);
        assert!((2.0 * second - 0.5 * (3.0 * at * at - 1.0)).abs() < 1e-15);
        assert!((3.0 * third - 0.5 * (5.0 * at.powi(3) - 3.0 * at)).abs() < 1e-15);
        assert!(
            (share(7.0, [0.0, 4.0]) - 1.0).abs() < 1e-15 && share(3.0, [3.0, 3.0]).abs() < 1e-15
        );
    }

    /// What no joint does is taken for nothing.
    #[test]
    fn what_is_too_much_tells_nothing() {
        let (squares, angles) = squares(300, |angle| 60.0 * angle);
        let angles: Vec<&[f64]> = angles.iter().map(<[f64; 2]>::as_slice).collect();
        let found = ErrorSpread::of_logarithms(&squares, &angles, &[[-1.0, 1.0], [0.0, 5.0]]);
        assert!(found.is_none());
    }

    /// A function of one joint's angle is found, and none of the other's; where there is none, none is.
    #[test]
    fn what_errors_depend_on_is_found() {
        let ranges = [[-1.0, 1.0], [0.0, 5.0]];
        let ways = [ErrorSpread::of_logarithms, ErrorSpread::of_means];
        for (size, way) in ([0.0, 1.5].into_iter()).flat_map(|size| ways.map(|way| (size, way))) {
            let law = |angle: f64| size * (2.0 * angle).sin();
            let (squares, angles) = squares(300, law);
            let angles: Vec<&[f64]> = angles.iter().map(<[f64; 2]>::as_slice).collect();
            let found = way(&squares, &angles, &ranges).expect("a factorisation");
            for step in 0..=10_u8 {
                let at = -0.9 + 0.18 * f64::from(step);
                let [zero, here] =
                    [0.0, at].map(|at| logarithm(&found.of_joints[0], at, ranges[0]));
                assert!((here - zero - law(at)).abs() < 0.5, "{size} {at}: {here}");
                let other = logarithm(&found.of_joints[1], 2.5 + 2.5 * at, ranges[1]);
                assert!(other.abs() < 0.25, "{size} {at}: {other}");
            }
        }
    }
}
