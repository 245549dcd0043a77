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

    /// The same by the normal equations, in units of typical sizes: quicker for many unknowns. `None` where they
    /// are singular to rounding. The condition number is that of the information in these units, its root.
    pub fn solve_normal(
        matrix: &DMatrix<f64>,
        right_hand_side: &DVector<f64>,
        estimable: &Estimable,
    ) -> Option<Self> {
        let (within, factor, condition) = Self::factored(matrix, estimable)?;
        let inverse = factor.inverse();
        Some(Self {
            solution: solution(estimable, &within, &factor, right_hand_side),
            covariance: in_units(estimable, in_units(estimable, inverse).transpose()),
            condition,
        })
    }

    /// The solution alone, without its covariance.
    pub fn step_normal(
        matrix: &DMatrix<f64>,
        right_hand_side: &DVector<f64>,
        estimable: &Estimable,
    ) -> Option<DVector<f64>> {
        let (within, factor, _) = Self::factored(matrix, estimable)?;
        Some(solution(estimable, &within, &factor, right_hand_side))
    }

    /// The equations in coordinates of what is determined, in units of typical sizes, their normal equations' factor, and
    /// its condition number.
    fn factored(
        matrix: &DMatrix<f64>,
        estimable: &Estimable,
    ) -> Option<(DMatrix<f64>, Cholesky<f64, Dyn>, f64)> {
        let within = if estimable.is_complete() {
            let mut within = matrix.clone();
            for (mut column, typical) in within.column_iter_mut().zip(estimable.typical()) {
                column *= *typical;
            }
            within
        } else {
            matrix * estimable.basis_in_units()
        };
        let factor = (within.tr_mul(&within)).cholesky()?;
        let pivots = factor.l_dirty().diagonal();
        let condition = pivots.max() / pivots.min();
        let is_sound = condition.powi(2) * ROUNDING <= 1.0;
        is_sound.then_some((within, factor, condition))
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

fn solution(
    estimable: &Estimable,
    within: &DMatrix<f64>,
    factor: &Cholesky<f64, Dyn>,
    right_hand_side: &DVector<f64>,
) -> DVector<f64> {
    let right = DMatrix::from_columns(&[within.tr_mul(right_hand_side)]);
    let solved = in_units(estimable, factor.solve(&right));
    solved.column(0).into_owned()
}

/// Columns in coordinates of what is determined, in the unknowns' own units.
fn in_units(estimable: &Estimable, mut columns: DMatrix<f64>) -> DMatrix<f64> {
    if !estimable.is_complete() {
        return estimable.basis_in_units() * columns;
    }
    for (mut row, typical) in columns.row_iter_mut().zip(estimable.typical()) {
        row *= *typical;
    }
    columns
}
