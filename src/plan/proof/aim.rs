//! From a bound of the derivative to one of a criterion, with every rounding.
//!
//! For every plan trace(B M B^T) <= S, S the sum of bounds of its derivatives, whatever B. In relative units (M's
//! and B's entries in those of compliances of a typical size each), with p compliances,
//!
//! ```text
//! A   trace(M^-1)            >= trace(B)^2 / S                          (Cauchy and Schwarz, B p x p)
//! G   max_j (M^-1)_jj        >= (sum_r c_r B_r,j(r))^2 / (S sum_r c_r^2)  (the same for the weighted mean)
//! D   det(M)^(-1/p)          >= p |det B|^(2/p) / S                      (means: det(B M B^T)^(1/p) <= S/p)
//! E   1 / smallest eigenvalue >= trace(B B^T) / S                        (trace(B M B^T) >= lambda trace(B B^T))
//! O5  trace(M^-1/2)^2        >= (sum of the 2/3 powers of B's singular values)^3 / S
//! ```
//!
//! The last: trace(M^-1/2) is convex, and its tangent at N, for L = N^-1/2 = t (B^T B)^(1/3), is
//! trace(M^-1/2) >= 3/2 trace(L) - 1/2 trace(L^3 M); the best t gives it. O1 is the root of D, O3 that of E.

use serde::Serialize;

use super::rounding::{UNIT, UP};
use crate::numeric::factorisation::finite_svd;

/// What a plan is to be good for, with what its bound needs beside B.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Aim {
    /// `rho_0`, see [`super::Ingredients`].
    TestPoses,
    /// A: the trace of M^-1.
    TotalVariance,
    /// G: the largest variance. For each row of B, the place of the compliance that it stands for, and its c.
    LargestVariance(Vec<(usize, f64)>),
    /// D, with the cost det(M)^(-1/p); B is lower triangular.
    Determinant,
    /// E, with the cost 1/smallest eigenvalue.
    SmallestEigenvalue,
    /// O5, with the cost trace(M^-1/2)^2.
    InverseRoots,
}

impl Aim {
    /// No plan has a smaller cost whose derivatives add up to at most `derivatives`, for rows of B as a question has
    /// them and the typical sizes (rad/(N m)) of its compliances; rounded down. `None` for test poses, and where B does not
    /// have the form that is needed.
    #[must_use]
    pub fn least_cost(
        &self,
        rows: &[Vec<f64>],
        typical_rad_per_nm: &[f64],
        sigma_m: f64,
        derivatives: f64,
    ) -> Option<f64> {
        let size = typical_rad_per_nm.len();
        if rows.iter().any(|row| row.len() != size) || derivatives.is_nan() || derivatives <= 0.0 {
            return None;
        }
        // Off by less than three roundings each, as a share.
        let entry =
            |row: usize, column: usize| rows[row][column] * (sigma_m / typical_rad_per_nm[column]);
        // Off by less than `roundings` roundings, as a share.
        let (over, roundings) = match self {
            Self::TestPoses => return None,
            Self::TotalVariance => {
                if rows.len() != size {
                    return None;
                }
                let trace = sum_below((0..size).map(|index| entry(index, index)));
                (trace * trace, 8)
            }
            Self::LargestVariance(weights) => {
                if rows.len() != weights.len() || weights.iter().any(|(at, _)| *at >= size) {
                    return None;
                }
                let terms = weights.iter().enumerate();
                let trace = sum_below(terms.map(|(row, &(at, root))| root * entry(row, at)));
                let total: f64 = weights.iter().map(|(_, root)| root * root).sum();
                (trace * trace / total, 12 + weights.len())
            }
            Self::Determinant => {
                let is_triangular = rows.len() == size
                    && (0..size).all(|row| rows[row][row + 1..].iter().all(|above| *above == 0.0));
                if !is_triangular {
                    return None;
                }
                let product: f64 = (0..size).map(|index| entry(index, index).abs()).product();
                let product = product * (1.0 - UNIT * (5 * size + 4) as f64);
                let root = root_below(product * product, size);
                (size as f64 * root, 6)
            }
            Self::SmallestEigenvalue => {
                let squares = (0..rows.len())
                    .flat_map(|row| (0..size).map(move |column| (row, column)))
                    .map(|(row, column)| entry(row, column).powi(2));
                (squares.sum(), 12 + rows.len() * size)
            }
            Self::InverseRoots => {
                if rows.len() != size {
                    return None;
                }
                let matrix = nalgebra::DMatrix::from_fn(size, size, entry);
                let values = singular_values_below(&matrix)?;
                let powers = values
                    .iter()
                    .map(|value| root_below(value * value * (1.0 - 2.0 * UNIT), 3));
                let sum: f64 = powers.sum();
                (sum * sum * sum, 8 + 3 * size)
            }
        };
        let least = over / derivatives * (1.0 - UNIT * (roundings + 8) as f64);
        (least.is_finite() && least > 0.0).then_some(least)
    }
}

/// A sum from below, of terms that are off by less than eight roundings each.
fn sum_below(terms: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut size, mut count) = (0.0, 0.0_f64, 0);
    for term in terms {
        sum += term;
        size += term.abs();
        count += 1;
    }
    f64::max(sum - size * UNIT * f64::from(count + 10) * UP, 0.0)
}

/// A number whose n-th power is not above a value, and nearly that.
fn root_below(value: f64, n: usize) -> f64 {
    let mut root = value.powf((n as f64).recip());
    while root > 0.0 {
        let power: f64 = std::iter::repeat_n(root, n).product();
        if power * (1.0 + 2.0 * UNIT * n as f64) <= value {
            return root;
        }
        root *= 1.0 - 4.0 * UNIT;
    }
    0.0
}

/// Bounds from below of the singular values of a matrix whose entries are off by less than three roundings
/// each.
///
/// With approximate factors U S V^T those of the matrix differ by no more than the length of the difference (Weyl), and
/// those of U S V^T are at least S times the smallest of U and V, whose squares are 1 but for the length of
/// U^T U - 1.
fn singular_values_below(matrix: &nalgebra::DMatrix<f64>) -> Option<Vec<f64>> {
    let size = matrix.nrows();
    let svd = finite_svd(matrix.clone())?;
    let (u, v_t) = (svd.u?, svd.v_t?);
    let steps = UNIT * (2 * size + 16) as f64;
    let mut square = 0.0;
    for row in 0..size {
        for column in 0..size {
            let mut left = matrix[(row, column)];
            let mut width = left.abs();
            for (k, value) in svd.singular_values.iter().enumerate() {
                let term = u[(row, k)] * value * v_t[(k, column)];
                left -= term;
                width += term.abs();
            }
            square += (left.abs() + steps * width).powi(2);
        }
    }
    let off = square.sqrt() * UP;
    let shrunk = |columns: &nalgebra::DMatrix<f64>| {
        let mut square = 0.0;
        for one in 0..size {
            for other in 0..size {
                let mut left = if one == other { -1.0 } else { 0.0 };
                let mut width = 1.0;
                for k in 0..size {
                    let term = columns[(k, one)] * columns[(k, other)];
                    left += term;
                    width += term.abs();
                }
                square += (left.abs() + steps * width).powi(2);
            }
        }
        // The root of 1 - e is at least 1 - e.
        1.0 - square.sqrt() * UP
    };
    let factor = shrunk(&u) * shrunk(&v_t.transpose());
    let below = |value: &f64| ((value * factor - off) * (1.0 - 8.0 * UNIT)).max(0.0);
    (factor > 0.0).then(|| svd.singular_values.iter().map(below).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use rand::RngExt;

    /// Costs of an information matrix, by their definitions.
    fn cost(aim: &Aim, information: &DMatrix<f64>) -> f64 {
        let eigen = information.clone().symmetric_eigen().eigenvalues;
        let inverse = information.clone().try_inverse().expect("regular");
        match aim {
            Aim::TestPoses => f64::NAN,
            Aim::TotalVariance => inverse.trace(),
            Aim::LargestVariance(_) => inverse.diagonal().max(),
            Aim::Determinant => eigen.product().powf(-1.0 / eigen.len() as f64),
            Aim::SmallestEigenvalue => eigen.min().recip(),
            Aim::InverseRoots => eigen.map(|value| value.powf(-0.5)).sum().powi(2),
        }
    }

    fn aims(size: usize) -> [Aim; 5] {
        [
            Aim::TotalVariance,
            Aim::LargestVariance((0..size).map(|index| (index, 0.3 + index as f64)).collect()),
            Aim::Determinant,
            Aim::SmallestEigenvalue,
            Aim::InverseRoots,
        ]
    }

    fn rows_of(matrix: &DMatrix<f64>, typical: &[f64], sigma_m: f64) -> Vec<Vec<f64>> {
        let row = |row: nalgebra::DVector<f64>| {
            let pairs = row.iter().zip(typical);
            pairs
                .map(|(value, typical)| value * typical / sigma_m)
                .collect()
        };
        matrix
            .row_iter()
            .map(|each| row(each.transpose()))
            .collect()
    }

    /// Random B and M: no bound is above the cost.
    #[test]
    fn no_information_has_a_cost_below_its_bound() {
        let mut random = crate::numeric::random::generator(3, 0);
        for round in 0..600 {
            let size = 1 + round % 6;
            let mut number = || random.random::<f64>() - 0.5;
            let typical: Vec<f64> = (0..size).map(|_| 1e-6 * (1.0 + number())).collect();
            let sigma_m = 3e-5;
            let half = DMatrix::from_fn(size + 1, size, |_, _| number());
            let information = half.tr_mul(&half);
            for aim in aims(size) {
                let mut b = DMatrix::from_fn(size, size, |_, _| number());
                if aim == Aim::Determinant {
                    b.fill_upper_triangle(0.0, 1);
                }
                let rows = rows_of(&b, &typical, sigma_m);
                let derivatives = (&b * &information * b.transpose()).trace();
                let cost = cost(&aim, &information);
                let bound = aim.least_cost(&rows, &typical, sigma_m, derivatives * (1.0 + 1e-12));
                assert!(
                    bound.is_none_or(|bound| bound <= cost),
                    "{aim:?}: {bound:?} {cost}"
                );
            }
        }
    }

    /// With the best B, the bound is the cost itself.
    #[test]
    fn the_best_rows_lose_nothing() {
        let mut random = crate::numeric::random::generator(4, 0);
        for size in 1..6 {
            let mut number = || random.random::<f64>() - 0.5;
            let half = DMatrix::from_fn(size + 3, size, |_, _| number());
            let information = half.tr_mul(&half) + DMatrix::identity(size, size) * 0.01;
            let typical = vec![0.5; size];
            let eigen = information.clone().symmetric_eigen();
            let inverse = information.clone().try_inverse().expect("regular");
            let power = |exponent: f64| {
                let values =
                    DMatrix::from_diagonal(&eigen.eigenvalues.map(|value| value.powf(exponent)));
                &eigen.eigenvectors * values * eigen.eigenvectors.transpose()
            };
            let worst = inverse.diagonal().imax();
            let least = eigen
                .eigenvectors
                .column(eigen.eigenvalues.imin())
                .transpose();
            let lower = information.clone().cholesky().expect("regular").l();
            let best = [
                (Aim::TotalVariance, inverse.clone()),
                (
                    Aim::LargestVariance(vec![(worst, 2.0)]),
                    inverse.rows(worst, 1) * 2.0,
                ),
                (
                    Aim::Determinant,
                    lower.try_inverse().expect("regular").lower_triangle(),
                ),
                (Aim::SmallestEigenvalue, DMatrix::from_rows(&[least])),
                (Aim::InverseRoots, power(-0.75)),
            ];
            for (aim, b) in best {
                let derivatives = (&b * &information * b.transpose()).trace();
                let rows = rows_of(&b, &typical, 0.25);
                let bound = aim
                    .least_cost(&rows, &typical, 0.25, derivatives)
                    .expect("a bound");
                let cost = cost(&aim, &information);
                assert!((bound / cost - 1.0).abs() < 1e-9, "{aim:?}: {bound} {cost}");
            }
        }
    }

    #[test]
    fn singular_values_are_bounded_from_below() {
        // A matrix of integers with singular values 3 and 1, and one that is singular.
        let matrix = DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 1.0, 2.0]);
        let mut values = singular_values_below(&matrix).expect("finite");
        values.sort_by(f64::total_cmp);
        for (value, exact) in values.iter().zip([1.0, 3.0]) {
            assert!(*value < exact && *value > exact - 1e-13, "{value}");
        }
        let singular = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 0.0]));
        assert!(
            singular_values_below(&singular)
                .expect("finite")
                .contains(&0.0)
        );
        for (value, n) in [(2.0_f64, 2), (1e-30, 5), (7.0, 3), (0.0, 4)] {
            let root = root_below(value, n);
            assert!(root.powi(i32::try_from(n).expect("small")) <= value);
            assert!((root - value.powf(1.0 / n as f64)).abs() <= 1e-14 * root);
        }
    }

    #[test]
    fn rows_of_another_form_give_no_bound() {
        let full = vec![vec![1.0, 2.0], vec![3.0, 4.0]];
        let typical = [1.0, 1.0];
        assert_eq!(Aim::Determinant.least_cost(&full, &typical, 1.0, 1.0), None);
        assert_eq!(Aim::TestPoses.least_cost(&full, &typical, 1.0, 1.0), None);
        assert_eq!(
            Aim::TotalVariance.least_cost(&full[..1], &typical, 1.0, 1.0),
            None
        );
        assert_eq!(
            Aim::TotalVariance.least_cost(&full, &typical, 1.0, 0.0),
            None
        );
        let there_is_not = Aim::LargestVariance(vec![(0, 1.0), (2, 1.0)]);
        assert_eq!(there_is_not.least_cost(&full, &typical, 1.0, 1.0), None);
    }
}
