//! What commanded joints do about passive ones, which cannot be commanded.

use nalgebra::{DMatrix, DVector, Matrix6xX, Vector6};

use super::SerialChain;

/// Directions that the tool cannot be moved in, relative to the easiest.
const SINGULAR: f64 = 1e-9;

/// What the commanded joints must do (rad, m) for a small motion of the tool: the smallest that does it,
/// or that comes nearest. With fewer than six commanded joints the tool's position alone counts.
pub fn commands_for(
    jacobian: &Matrix6xX<f64>,
    commanded: &[usize],
    motion: &Vector6<f64>,
) -> DVector<f64> {
    let rows = if commanded.len() < 6 { 3 } else { 6 };
    let matrix = DMatrix::from_fn(rows, commanded.len(), |row, column| {
        jacobian[(row, commanded[column])]
    });
    let svd = matrix.svd(true, true);
    let tolerance = SINGULAR * svd.singular_values.max();
    let motion = DVector::from_iterator(rows, motion.iter().take(rows).copied());
    svd.solve(&motion, tolerance)
        .unwrap_or_else(|_| DVector::zeros(commanded.len()))
}

/// How deflections (rad, m) of passive joints are made up for: these, and for each commanded joint what it is commanded beside the
/// taking back of its own; all together leave the tool where it is. Nothing where all joints are commanded.
pub fn made_up(
    chain: &SerialChain,
    jacobian: &Matrix6xX<f64>,
    deflections: &[f64],
) -> Option<DVector<f64>> {
    let commanded: Vec<usize> = chain.commanded().collect();
    if commanded.len() == chain.len() {
        return None;
    }
    let mut moved = DVector::from_column_slice(deflections);
    for &joint in &commanded {
        moved[joint] = 0.0;
    }
    let more = commands_for(jacobian, &commanded, &(jacobian * &moved));
    for (&joint, more) in commanded.iter().zip(&more) {
        moved[joint] = -more;
    }
    Some(moved)
}
