//! Weighted linear least squares that says which unknowns the data determine.

use nalgebra::{DMatrix, DVector};

use crate::factorisation::finite_svd;

/// Columns whose effect is this much smaller than the largest one's are taken as zero.
const NO_EFFECT: f64 = 1e-9;
/// Singular values of the scaled matrix below this share of the largest are taken as zero.
const RANK_TOLERANCE: f64 = 1e-8;
/// An unknown with a larger share in the null space than this is not determined.
const NULL_SPACE_TOLERANCE: f64 = 1e-6;

/// The solution of A x = y in the least-squares sense, for whitened rows (unit variance).
///
/// The columns are scaled to length one before the rank is judged, so that the judgement does not
/// depend on the unknowns' units.
#[derive(Debug, Clone, PartialEq)]
pub struct LeastSquares {
    /// The unknowns x; the undetermined ones have their smallest admissible size.
    pub solution: DVector<f64>,
    /// Which unknowns the data determine.
    pub determined: Vec<bool>,
    /// (A^T A)^+, the covariance of the determined unknowns (eq. 13 with sigma = 1).
    pub covariance: DMatrix<f64>,
    /// The number of independent combinations of unknowns that the data determine.
    pub rank: usize,
    /// The largest over the smallest non-zero singular value of the scaled matrix.
    pub condition: f64,
}

impl LeastSquares {
    /// What numbers without a factorisation tell.
    fn of_nothing(unknowns: usize) -> Self {
        Self {
            solution: DVector::zeros(unknowns),
            determined: vec![false; unknowns],
            covariance: DMatrix::zeros(unknowns, unknowns),
            rank: 0,
            condition: f64::INFINITY,
        }
    }

    /// Solves by the singular value decomposition of the scaled matrix. `typical` are typical sizes
    /// of the unknowns, against which a column's effect is judged to be nothing.
    #[must_use]
    pub fn solve(matrix: &DMatrix<f64>, right_hand_side: &DVector<f64>, typical: &[f64]) -> Self {
        let unknowns = matrix.ncols();
        let length: Vec<f64> = matrix.column_iter().map(|column| column.norm()).collect();
        let effect: Vec<f64> = length.iter().zip(typical).map(|(l, t)| l * t).collect();
        let largest_effect = effect.iter().copied().fold(0.0, f64::max);
        let scale: Vec<f64> = (0..unknowns)
            .map(|unknown| {
                if effect[unknown] > NO_EFFECT * largest_effect {
                    length[unknown].recip()
                } else {
                    0.0
                }
            })
            .collect();
        let mut scaled = matrix.clone();
        for (mut column, factor) in scaled.column_iter_mut().zip(&scale) {
            column *= *factor;
        }
        let Some(svd) = finite_svd(scaled) else {
            return Self::of_nothing(unknowns);
        };
        let (Some(u), Some(v_t)) = (&svd.u, &svd.v_t) else {
            unreachable!("both factors were asked for");
        };
        let tolerance = RANK_TOLERANCE * svd.singular_values.max();
        let kept: Vec<usize> = (0..svd.singular_values.len())
            .filter(|&index| svd.singular_values[index] > tolerance)
            .collect();

        let mut solution = DVector::zeros(unknowns);
        let mut covariance = DMatrix::zeros(unknowns, unknowns);
        let mut share_in_range = vec![0.0; unknowns];
        for &index in &kept {
            let value = svd.singular_values[index];
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
            for (unknown, share) in share_in_range.iter_mut().enumerate() {
                *share += v_t[(index, unknown)].powi(2);
            }
        }
        let determined = (0..unknowns)
            .map(|unknown| {
                scale[unknown] > 0.0 && 1.0 - share_in_range[unknown] < NULL_SPACE_TOLERANCE
            })
            .collect();
        let smallest = kept
            .iter()
            .map(|&index| svd.singular_values[index])
            .fold(f64::INFINITY, f64::min);
        Self {
            solution,
            determined,
            covariance,
            rank: kept.len(),
            condition: svd.singular_values.max() / smallest,
        }
    }
}
