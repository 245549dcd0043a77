//! The sum of the squares of rows, where what their terms may be off by is told once for all of them.
//!
//! Vectors `v_n` that are within remainders of polynomials, `v_n` = `p_n` + `e_n`, are in every row. With
//! `y_r` = sum over n of `b_rn` `p_n`,
//!
//! ```text
//! sum_r |sum_n b_rn v_n|^2 = sum_r |y_r|^2 + 2 sum_n e_n . w_n + sum_r |sum_n b_rn e_n|^2,    w_n = sum_r b_rn y_r
//! ```
//!
//! In `w_n` the rows may cancel, which they cannot where each of them has a remainder of its own.

use super::rounding::UNIT;
use super::taylor::{LANES, Lanes, ModelVector, ModelWorkspace, TaylorModel, VARIABLES};

/// The sum over rows of |sum over n of `b_n` `v_n`|^2; by how much the variables change the rows is added to the spread.
pub(super) fn squares_of_rows(
    workspace: &mut ModelWorkspace,
    rows: &[Vec<f64>],
    vectors: &[ModelVector],
    spread: &mut [Lanes; VARIABLES],
) -> TaylorModel {
    let polynomials: Vec<ModelVector> = (vectors.iter())
        .map(|vector| vector.map(|part| workspace.polynomial_of(part)))
        .collect();
    let sums: Vec<ModelVector> = (rows.iter())
        .map(|row| {
            std::array::from_fn(|axis| {
                let mut sum = workspace.sum();
                for (factor, vector) in row.iter().zip(&polynomials) {
                    sum = sum.add_constant(*factor, UNIT * factor.abs(), vector[axis]);
                }
                let part = sum.end();
                workspace.add_spread(part, spread);
                part
            })
        })
        .collect();
    let off = remainders(workspace, rows, vectors, &sums);
    let off = workspace.constants(&[0.0; LANES], &off);
    let mut squares = workspace.sum().add(1.0, off);
    for part in sums.iter().flatten() {
        squares = squares.square(*part);
    }
    squares.end()
}

/// A bound of |2 sum of `e_n` . `w_n` + sum of |sum of `b_rn` `e_n`|^2|.
fn remainders(
    workspace: &mut ModelWorkspace,
    factors: &[Vec<f64>],
    vectors: &[ModelVector],
    sums: &[ModelVector],
) -> Lanes {
    let mut total = [0.0; LANES];
    for (n, vector) in vectors.iter().enumerate() {
        for (axis, part) in vector.iter().enumerate() {
            let mut sum = workspace.sum();
            for (row, vector) in factors.iter().zip(sums) {
                sum = sum.add_constant(row[n], UNIT * row[n].abs(), vector[axis]);
            }
            let weight = sum.end();
            let bound = workspace.bound(weight);
            let off = workspace.remainder(*part);
            for lane in 0..LANES {
                total[lane] += 2.0 * off[lane] * bound[lane];
            }
        }
    }
    for row in factors {
        for axis in 0..3 {
            let mut moved = [0.0; LANES];
            for (factor, vector) in row.iter().zip(vectors) {
                let off = workspace.remainder(vector[axis]);
                let factor = factor.abs();
                for lane in 0..LANES {
                    moved[lane] += factor * off[lane];
                }
            }
            for lane in 0..LANES {
                total[lane] += moved[lane] * moved[lane];
            }
        }
    }
    // Roundings one after another of what is not negative: twice those of a row and of its factors, and the terms of the total.
    let roundings = 2 * vectors.len() + 3 * (vectors.len() + factors.len()) + 20;
    total.map(|each| each * (1.0 + 2.0 * UNIT * roundings as f64))
}
