//! The factorisation of information matrices, one or several side by side, for traces
//! trace(C M^-1 C^T), such as `rho_0`^2 (eq. 20), and determinants.

use multiversion::multiversion;
use nalgebra::DMatrix;

/// Information matrices that are judged at a time.
pub const LANES: usize = 8;

/// The least share of its information that a parameter keeps when those before it are unknown. Rounding
/// makes up shares of up to 1e-11. This keeps a search off singular plans; what the plan that it ends in
/// determines is decided by [`Estimable`](crate::numeric::estimable::Estimable).
const REGULAR: f64 = 1e-9;

/// trace(C M^-1 C^T) for each M that is `rest` plus `weight` times a block (all p x p), infinite for
/// singular ones. `right` is C^T. `room`, for twice as many numbers as a block or C have, begins with
/// the factors afterwards.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2", "aarch64+neon"))]
pub(super) fn traces_of_sums(
    rest: &DMatrix<f64>,
    blocks: &[[f64; LANES]],
    weight: f64,
    right: &[f64],
    room: &mut [[f64; LANES]],
) -> [f64; LANES] {
    let (sums, solved) = room.split_at_mut(room.len() / 2);
    for ((sum, rest), block) in sums.iter_mut().zip(rest.as_slice()).zip(blocks) {
        for lane in 0..LANES {
            sum[lane] = rest + weight * block[lane];
        }
    }
    half_solve_unrolled(rest.nrows(), sums, right, solved)
}

/// 1/det(M) of matrices that are factorised.
#[inline(always)]
pub(super) fn inverse_determinant<const L: usize>(size: usize, factors: &[[f64; L]]) -> [f64; L] {
    let mut product = [1.0; L];
    for diagonal in factors.iter().take(size * size).step_by(size + 1) {
        for lane in 0..L {
            product[lane] *= diagonal[lane];
        }
    }
    product
}

/// [`half_solve`], unrolled for the usual numbers of parameters.
#[inline(always)]
pub(super) fn half_solve_unrolled<const L: usize>(
    size: usize,
    matrix: &mut [[f64; L]],
    right: &[f64],
    solved: &mut [[f64; L]],
) -> [f64; L] {
    match size {
        3 => half_solve(3, matrix, right, solved),
        5 => half_solve(5, matrix, right, solved),
        6 => half_solve(6, matrix, right, solved),
        size => half_solve(size, matrix, right, solved),
    }
}

/// Factorises L matrices M (p x p, symmetric) side by side into L D L^T in their place, with 1/D on the
/// diagonal, and solves L Y = C^T. Returns trace(C M^-1 C^T), the sum of Y^2 / D; infinite unless every
/// parameter keeps information beyond rounding when those before it are unknown: D is that
/// information, the diagonal of M is the information when they are known.
#[inline(always)]
fn half_solve<const L: usize>(
    size: usize,
    matrix: &mut [[f64; L]],
    right: &[f64],
    solved: &mut [[f64; L]],
) -> [f64; L] {
    let mut is_regular = [true; L];
    for row in 0..size {
        let (above, here) = matrix.split_at_mut(row * size);
        let here = &mut here[..size];
        let known = here[row];
        let mut pivot = known;
        for column in 0..row {
            let other = &above[column * size..(column + 1) * size];
            for each in 0..column {
                for lane in 0..L {
                    here[column][lane] -= here[each][lane] * other[each][lane];
                }
            }
        }
        for column in 0..row {
            let inverse = above[column * size + column];
            for lane in 0..L {
                let scaled = here[column][lane] * inverse[lane];
                pivot[lane] -= scaled * here[column][lane];
                here[column][lane] = scaled;
            }
        }
        for lane in 0..L {
            is_regular[lane] &= pivot[lane] > REGULAR * known[lane];
            here[row][lane] = pivot[lane].recip();
        }
    }
    let mut cost = [0.0; L];
    for (solved, right) in solved.chunks_exact_mut(size).zip(right.chunks_exact(size)) {
        for row in 0..size {
            let factor = &matrix[row * size..(row + 1) * size];
            let mut value = [right[row]; L];
            for each in 0..row {
                for lane in 0..L {
                    value[lane] -= factor[each][lane] * solved[each][lane];
                }
            }
            for lane in 0..L {
                cost[lane] += value[lane] * value[lane] * factor[row][lane];
            }
            solved[row] = value;
        }
    }
    for lane in 0..L {
        if !is_regular[lane] {
            cost[lane] = f64::INFINITY;
        }
    }
    cost
}

/// Goes on from Y to X = M^-1 C^T = L^-T D^-1 Y.
pub(super) fn solve_transposed(factor: &[f64], solved: &mut [f64]) {
    let size = factor.len().isqrt();
    for solved in solved.chunks_exact_mut(size) {
        for row in (0..size).rev() {
            let mut value = solved[row] * factor[row * size + row];
            for below in row + 1..size {
                value -= factor[below * size + row] * solved[below];
            }
            solved[row] = value;
        }
    }
}

/// X X^T, p x p, from the columns of X.
pub(super) fn sum_of_squares(columns: &[f64], squares: &mut [f64]) {
    let size = squares.len().isqrt();
    squares.fill(0.0);
    for column in columns.chunks_exact(size) {
        for (row, squares) in squares.chunks_exact_mut(size).enumerate() {
            for (square, value) in squares.iter_mut().zip(column) {
                *square += column[row] * value;
            }
        }
    }
}
