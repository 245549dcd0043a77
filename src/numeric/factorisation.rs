//! Eigenvalues and singular values of matrices that may hold anything: nalgebra iterates for ever, or
//! panics, on what is not finite or has squares that are not.

use nalgebra::allocator::Allocator;
use nalgebra::{
    Cholesky, DMatrix, DMatrixViewMut, DefaultAllocator, DimDiff, DimSub, Dyn, OMatrix, SVD,
    SymmetricEigen, U1,
};
use rayon::prelude::*;

/// Larger and smaller numbers have squares that are no numbers, or none.
const LARGEST: f64 = 1e150;
/// Columns of larger matrices are made side by side, so many in a strip.
const STRIP: usize = 128;
/// Some ten sweeps are usual for each row.
const MAXIMUM_SWEEPS: usize = 100_000;

/// Whether all numbers are finite, and their squares, too.
fn is_tame<'a>(mut values: impl Iterator<Item = &'a f64>) -> bool {
    values.all(|value| value.abs() <= LARGEST)
}

/// The eigenvalues and eigenvectors of a symmetric matrix; `None` for numbers that have none.
pub fn finite_eigen<D: DimSub<U1>>(matrix: &OMatrix<f64, D, D>) -> Option<SymmetricEigen<f64, D>>
where
    DefaultAllocator: Allocator<D, D> + Allocator<D> + Allocator<DimDiff<D, U1>>,
{
    if matrix.is_empty() || !is_tame(matrix.iter()) {
        return None;
    }
    SymmetricEigen::try_new(matrix.clone_owned(), f64::EPSILON, MAXIMUM_SWEEPS)
}

/// The singular values with both factors; `None` for numbers that have none, and where there are no
/// numbers.
pub fn finite_svd(matrix: DMatrix<f64>) -> Option<SVD<f64, Dyn, Dyn>> {
    if matrix.is_empty() || !is_tame(matrix.iter()) {
        return None;
    }
    // nalgebra's own tolerance.
    SVD::try_new(matrix, true, true, 5.0 * f64::EPSILON, MAXIMUM_SWEEPS)
}

/// The mean of a square matrix and its transpose: what is symmetric but for rounding.
pub fn symmetric(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    (matrix + matrix.transpose()) * 0.5
}

/// A^T A: quicker than column by column.
pub fn gram(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    matrix.transpose() * matrix
}

/// The inverse of a factored matrix L L^T, as L^-T L^-1: quicker than column by column, since half of L^-1 is zero. Strips of columns are
/// made side by side, each from the rows where its first column is not zero.
pub fn inverse_of(factor: &Cholesky<f64, Dyn>) -> DMatrix<f64> {
    let half = inverse_half(factor);
    let size = half.nrows();
    if size <= STRIP {
        return gram(&half);
    }
    let mut inverse = DMatrix::zeros(size, size);
    let strips = inverse.as_mut_slice().par_chunks_mut(size * STRIP);
    strips.enumerate().for_each(|(strip, entries)| {
        let (first, columns) = (STRIP * strip, entries.len() / size);
        let below = half.view((first, first), (size - first, size - first));
        let own = below.columns(0, columns).into_owned();
        let mut strip = DMatrixViewMut::from_slice(entries, size, columns);
        let mut strip = strip.rows_mut(first, size - first);
        strip.gemm(1.0, &below.transpose(), &own, 0.0);
    });
    inverse.fill_upper_triangle_with_lower_triangle();
    inverse
}

/// Its trace alone: the squares of L^-1.
pub fn trace_of_inverse(factor: &Cholesky<f64, Dyn>) -> f64 {
    inverse_half(factor).norm_squared()
}

/// L^-1.
fn inverse_half(factor: &Cholesky<f64, Dyn>) -> DMatrix<f64> {
    let lower = factor.l_dirty();
    let size = lower.nrows();
    let mut inverse = DMatrix::identity(size, size);
    let invert = |(first, column): (usize, &mut [f64])| {
        for pivot in first..size {
            let of_pivot = &lower.as_slice()[size * pivot..size * (pivot + 1)];
            let value = column[pivot] / of_pivot[pivot];
            column[pivot] = value;
            let below = column[pivot + 1..].iter_mut();
            for (other, entry) in below.zip(&of_pivot[pivot + 1..]) {
                *other -= entry * value;
            }
        }
    };
    if size <= STRIP {
        let columns = inverse.as_mut_slice().chunks_exact_mut(size.max(1));
        columns.enumerate().for_each(invert);
    } else {
        let columns = inverse.as_mut_slice().par_chunks_exact_mut(size);
        columns.enumerate().for_each(invert);
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_inverse_is_one() {
        for size in [7, STRIP, 2 * STRIP + 5] {
            let root = DMatrix::from_fn(size, size, |row, column| {
                ((row * size + column) as f64).sin()
            });
            let matrix = &root * root.transpose() / size as f64 + DMatrix::identity(size, size);
            let factor = matrix.clone().cholesky().expect("positive definite");
            let inverse = inverse_of(&factor);
            let product = &inverse * matrix;
            assert!((product - DMatrix::identity(size, size)).amax() < 1e-13);
            assert_eq!(inverse, inverse.transpose());
        }
    }

    #[test]
    fn what_is_not_finite_has_no_eigenvalues() {
        for value in [f64::NAN, f64::INFINITY, -1e308] {
            let mut matrix = DMatrix::identity(5, 5);
            matrix[(2, 3)] = value;
            matrix[(3, 2)] = value;
            assert!(finite_eigen(&matrix).is_none());
            assert!(finite_svd(matrix).is_none());
        }
        let tiny = DMatrix::from_element(5, 5, 1e-308);
        assert!(finite_eigen(&tiny).is_some() && finite_svd(tiny).is_some());
    }
}
