//! A force of any direction: the largest eigenvalue of a 3 x 3 form over a box.
//!
//! Turned to the eigenvectors at the box's centre, Q = [[a, b^T], [b, C]] with b small. Its largest eigenvalue is at
//! most t if t - a - b^T (t - C)^-1 b >= 0 and t - C is positive definite (Schur), so if mu > 0 is a bound
//! of t - C from below for some threshold t, it is at most the larger of t and sup(a + |b|^2 / mu).

use nalgebra::{Matrix3, Vector3};

use super::rounding::{UNIT, UP};
use super::taylor::{LANES, Lanes, ModelWorkspace, TaylorModel, VARIABLES};

/// A scalar whose largest value bounds the derivative.
#[derive(Debug, Clone)]
pub(super) struct Turned {
    pub model: TaylorModel,
    /// Whether it does.
    pub is_valid: [bool; LANES],
    /// The derivative at the centre from below, where it does not follow from the model.
    pub at_centre: Option<Lanes>,
    /// How much each variable changes what it is made of, roughly.
    pub spread: [Lanes; VARIABLES],
}

/// Eigenvectors are unit vectors at right angles to within this, or they are not used.
const ORTHONORMAL: f64 = 1e-13;

pub(super) const ENTRIES: [[usize; 2]; 6] = [[0, 0], [1, 1], [2, 2], [0, 1], [0, 2], [1, 2]];

pub(super) const fn place(i: usize, j: usize) -> usize {
    if i == j { i } else { i + j + 2 }
}

/// Turns a form (entries 11, 22, 33, 12, 13, 23), and adds what the rest of it can add to the first entry.
pub(super) fn turned_form(
    workspace: &mut ModelWorkspace,
    form: &[TaylorModel; 6],
    threshold: f64,
    spread: &[Lanes; VARIABLES],
) -> Turned {
    let mut vectors = [[[0.0; LANES]; 3]; 3];
    let mut at_centre = [f64::NEG_INFINITY; LANES];
    let mut is_valid = [false; LANES];
    for lane in 0..LANES {
        let matrix = Matrix3::from_fn(|i, j| centre(workspace, form[place(i, j)], lane));
        let Some((eigenvectors, largest)) = eigenvectors(&matrix) else {
            continue;
        };
        is_valid[lane] = true;
        let off: f64 = (form.iter())
            .map(|&entry| workspace.remainder(entry)[lane])
            .sum();
        // Any unit vector's value bounds the largest eigenvalue from below.
        let size: f64 = (form.iter())
            .map(|&entry| workspace.bound(entry)[lane])
            .sum();
        at_centre[lane] = largest - 2.0 * off * UP - 1e-12 * size;
        for column in 0..3 {
            for row in 0..3 {
                vectors[column][row][lane] = eigenvectors[(row, column)];
            }
        }
    }
    let sizes: Vec<Lanes> = form.iter().map(|&entry| workspace.bound(entry)).collect();
    // What the vectors lack to be orthonormal: |U^T Q U - V^T Q V| <= (2 e + e^2) |Q| for the next orthonormal V.
    let off: Lanes = std::array::from_fn(|lane| {
        2.0 * sizes.iter().map(|size| size[lane]).sum::<f64>() * UP * 4.0 * ORTHONORMAL
    });
    let off = workspace.constants(&[0.0; LANES], &off);
    let entries = ENTRIES.map(|[i, j]| {
        let mut sum = workspace.sum().add(1.0, off);
        for k in 0..3 {
            for l in 0..3 {
                let product: Lanes =
                    std::array::from_fn(|lane| vectors[i][k][lane] * vectors[j][l][lane]);
                sum = sum.add_lanes(&product, UNIT, form[place(k, l)]);
            }
        }
        sum.end()
    });
    let [first, second, third, one, other, between] = entries;
    let bounds = [second, third, between].map(|entry| workspace.bound(entry));
    let mut inverse = [0.0; LANES];
    for lane in 0..LANES {
        // Gershgorin
        let largest = bounds[0][lane].max(bounds[1][lane]) + bounds[2][lane];
        let least = threshold * (1.0 - 4.0 * UNIT) - largest * UP;
        if least > 0.0 {
            inverse[lane] = UP / least;
        } else {
            is_valid[lane] = false;
        }
    }
    let squares = workspace.sum().square(one).square(other).end();
    let model = workspace
        .sum()
        .add(1.0, first)
        .add_lanes(&inverse, 0.0, squares)
        .end();
    Turned {
        model,
        is_valid,
        at_centre: Some(at_centre),
        spread: *spread,
    }
}

/// The value of a model at the centre.
pub(super) fn centre(workspace: &ModelWorkspace, model: TaylorModel, lane: usize) -> f64 {
    let coefficients = workspace.coefficients(model);
    let mut value = coefficients[0][lane];
    for j in 0.. {
        let place = super::taylor::second(j, j);
        let Some(own) = coefficients.get(place) else {
            break;
        };
        value -= own[lane];
    }
    value
}

/// Eigenvectors, that of the largest eigenvalue first, and that eigenvalue; `None` where they are not orthonormal.
fn eigenvectors(matrix: &Matrix3<f64>) -> Option<(Matrix3<f64>, f64)> {
    if !matrix.iter().all(|value| value.is_finite()) {
        return None;
    }
    let eigen = matrix.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&one, &other| eigen.eigenvalues[other].total_cmp(&eigen.eigenvalues[one]));
    let columns: Vec<Vector3<f64>> = order
        .iter()
        .map(|&index| eigen.eigenvectors.column(index).into_owned())
        .collect();
    let vectors = Matrix3::from_columns(&columns);
    let off = (vectors.transpose() * vectors - Matrix3::identity())
        .abs()
        .max();
    // Four roundings of each entry of the product.
    (off + 8.0 * UNIT < ORTHONORMAL / 3.0).then(|| (vectors, eigen.eigenvalues[order[0]]))
}
