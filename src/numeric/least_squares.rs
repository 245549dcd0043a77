//! Weighted linear least squares within what the data determine.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::numeric::estimable::Estimable;
use crate::numeric::factorisation::finite_svd;

/// Singular values of the scaled matrix below this share of the largest are taken as zero: rounding.
const ROUNDING: f64 = 1e-12;

/// The solution of A x = y in the least-squares sense, for whitened rows (unit variance).
#[derive(Debug, Clone, PartialEq)]
pub struct LeastSquares {
    /// The unknowns x; zero in the directions that are not determined.
    pub solution: DVector<f64>,
    /// The covariance of what is determined, p x p: eq. 12, which for whitened rows is eq. 13 with sigma = 1.
    pub covariance: DMatrix<f64>,
    /// The largest over the smallest singular value of the matrix with columns scaled to length one,
    /// in coordinates of what is determined.
    pub condition: f64,
}

impl LeastSquares {
    /// Solves within the directions that are determined, by the singular value decomposition of the
    /// matrix with its columns scaled to length one.
    pub fn solve(
        matrix: &DMatrix<f64>,
        right_hand_side: &DVector<f64>,
        estimable: &Estimable,
    ) -> Self {
        if estimable.is_complete() {
            return Self::solve_all(matrix, right_hand_side);
        }
        let basis = estimable.basis_in_units();
        let within = Self::solve_all(&(matrix * &basis), right_hand_side);
        Self {
            solution: &basis * within.solution,
            covariance: &basis * within.covariance * basis.transpose(),
            condition: within.condition,
        }
    }

    fn solve_all(matrix: &DMatrix<f64>, right_hand_side: &DVector<f64>) -> Self {
        let unknowns = matrix.ncols();
        let mut solution = DVector::zeros(unknowns);
        let mut covariance = DMatrix::zeros(unknowns, unknowns);
        let inverse = |length: f64| if length > 0.0 { length.recip() } else { 0.0 };
        let scale: Vec<f64> = (matrix.column_iter())
            .map(|column| inverse(column.norm()))
            .collect();
        let mut scaled = matrix.clone();
        for (mut column, factor) in scaled.column_iter_mut().zip(&scale) {
            column *= *factor;
        }
        // No unknowns, or numbers without a factorisation: these tell nothing.
        let Some(svd) = finite_svd(scaled).filter(|_| unknowns > 0) else {
            return Self {
                solution,
                covariance,
                condition: f64::INFINITY,
            };
        };
        let (Some(u), Some(v_t)) = (&svd.u, &svd.v_t) else {
            unreachable!("both factors were asked for");
        };
        let tolerance = ROUNDING * svd.singular_values.max();
        let mut smallest = f64::INFINITY;
        for (index, &value) in svd.singular_values.iter().enumerate() {
            if value <= tolerance {
                continue;
            }
            smallest = smallest.min(value);
            let direction = DVector::from_iterator(
                unknowns,
                (0..unknowns).map(|unknown| v_t[(index, unknown)] * scale[unknown]),
            );
            solution.axpy(
                u.column(index).dot(right_hand_side) / value,
                &direction,
                1.0,
            );
            covariance.ger((value * value).recip(), &direction, &direction, 1.0);
        }
        Self {
            solution,
            covariance,
            condition: svd.singular_values.max() / smallest,
        }
    }
}

/// The factor of an information matrix in units of typical sizes: quicker for many unknowns. `None` where that is singular to rounding.
pub fn sound_factor(information: DMatrix<f64>) -> Option<Cholesky<f64, Dyn>> {
    let factor = information.cholesky()?;
    (condition_of(&factor).powi(2) * ROUNDING <= 1.0).then_some(factor)
}

/// The root of the condition number of a factored matrix, as its pivots say.
pub fn condition_of(factor: &Cholesky<f64, Dyn>) -> f64 {
    let pivots = factor.l_dirty().diagonal();
    pivots.max() / pivots.min()
}
