//! Readings that are less precise than the instrument: d = sum over rows of v^T R^-1 v over a box, with the covariance
//! R = s I + G G^T.
//!
//! For any c, which may depend on the configuration,
//!
//! ```text
//! v^T R^-1 v <= |v - G c|^2 / s + |c|^2        (Woodbury; equal for c = G^T R^-1 v)
//! ```
//!
//! so that nothing is inverted rigorously. Here c is what is best at the box's centre with its slopes there, a linear
//! function of the coordinates: what it misses is of fourth order. And for any w
//!
//! ```text
//! v^T R^-1 v >= 2 w^T v - w^T R w              (equal for w = R^-1 v)
//! ```

use nalgebra::{Cholesky, Matrix3, Vector3};

use super::form::{Turned, centre};
use super::rounding::UP;
use super::taylor::{LANES, ModelVector, ModelWorkspace, TaylorModel, TermSign, VARIABLES, linear};

/// What rounding can take from a value at a centre, as a share of all that was added up.
const ROUNDING: f64 = 1e-12;

/// What a covariance R = s I + G G^T is made of.
#[derive(Debug, Clone)]
pub(super) struct SpreadColumns {
    /// s
    pub everywhere: f64,
    /// The columns of G.
    pub columns: Vec<ModelVector>,
}

/// Weighs rows v with a covariance.
pub(super) fn weighted(
    workspace: &mut ModelWorkspace,
    rows: &[ModelVector],
    covariance: &SpreadColumns,
    variables: usize,
) -> Turned {
    let mut at_centre = [0.0; LANES];
    // For every row and column, the constant part of c and its slopes.
    let nothing = [[0.0; LANES]; VARIABLES + 1];
    let mut best = vec![vec![nothing; covariance.columns.len()]; rows.len()];
    for lane in 0..LANES {
        let columns: Vec<Expanded> = (covariance.columns.iter())
            .map(|column| Expanded::new(workspace, column, lane, variables))
            .collect();
        let own = Matrix3::identity() * covariance.everywhere;
        let dyads = columns
            .iter()
            .map(|each| each.value * each.value.transpose());
        let Some(factor) = Cholesky::new(own + dyads.sum::<Matrix3<f64>>()) else {
            // Nothing is known of such a box: c = 0 is as good as any other.
            continue;
        };
        for (row, best) in rows.iter().zip(&mut best) {
            let row = Expanded::new(workspace, row, lane, variables);
            let w = factor.solve(&row.value);
            at_centre[lane] += least(&w, &row, &columns, covariance.everywhere);
            for (column, best) in columns.iter().zip(best.iter_mut()) {
                best[0][lane] = column.value.dot(&w);
            }
            for j in 0..variables {
                // R^-1 (dv - dR w)
                let turned: Vector3<f64> = (columns.iter())
                    .map(|each| {
                        each.slopes[j] * each.value.dot(&w) + each.value * each.slopes[j].dot(&w)
                    })
                    .sum();
                let follows = factor.solve(&(row.slopes[j] - turned));
                for (column, best) in columns.iter().zip(best.iter_mut()) {
                    best[j + 1][lane] = column.slopes[j].dot(&w) + column.value.dot(&follows);
                }
            }
        }
    }
    let mut left = Vec::new();
    let mut sizes = Vec::new();
    for (row, best) in rows.iter().zip(&best) {
        let factors: Vec<TaylorModel> = (best.iter())
            .map(|best| workspace.linear_form(&best[0], &best[1..=variables]))
            .collect();
        for axis in 0..3 {
            let mut sum = workspace.sum().add(1.0, row[axis]);
            for (column, factor) in covariance.columns.iter().zip(&factors) {
                sum = sum.product(TermSign::Minus, column[axis], *factor);
            }
            left.push(sum.end());
        }
        sizes.extend(factors);
    }
    let mut spread = [[0.0; LANES]; VARIABLES];
    for part in &left {
        workspace.add_spread(*part, &mut spread);
    }
    let mut sum = workspace.sum();
    for part in left {
        sum = sum.square(part);
    }
    let left = sum.end();
    let mut sum = workspace.sum().add(UP / covariance.everywhere, left);
    for factor in sizes {
        sum = sum.square(factor);
    }
    Turned {
        model: sum.end(),
        is_valid: [true; LANES],
        at_centre: Some(at_centre),
        spread: Some(spread),
    }
}

/// A vector's value at the centre, its slopes there, and what it may be off by.
struct Expanded {
    value: Vector3<f64>,
    slopes: [Vector3<f64>; VARIABLES],
    off: Vector3<f64>,
}

impl Expanded {
    fn new(
        workspace: &ModelWorkspace,
        vector: &ModelVector,
        lane: usize,
        variables: usize,
    ) -> Self {
        let part = |axis: usize| vector[axis];
        Self {
            value: Vector3::from_fn(|axis, _| centre(workspace, part(axis), lane)),
            slopes: std::array::from_fn(|j| {
                if j < variables {
                    Vector3::from_fn(|axis, _| workspace.coefficients(part(axis))[linear(j)][lane])
                } else {
                    Vector3::zeros()
                }
            }),
            off: Vector3::from_fn(|axis, _| workspace.remainder(part(axis))[lane]),
        }
    }

    /// Bounds of |w . what it is off by|, and of |w . itself|.
    fn along(&self, w: &Vector3<f64>) -> [f64; 2] {
        let size = w.abs();
        [
            size.dot(&self.off),
            size.dot(&(self.value.abs() + self.off)),
        ]
    }
}

/// 2 w^T v - w^T R w at the centre, from below.
fn least(w: &Vector3<f64>, row: &Expanded, columns: &[Expanded], everywhere: f64) -> f64 {
    let [off, size] = row.along(w);
    let own = everywhere * w.norm_squared();
    let mut sum = 2.0 * (w.dot(&row.value) - off) - own;
    let mut all = 2.0 * (size + off) + own;
    for column in columns {
        let [off, size] = column.along(w);
        sum -= (w.dot(&column.value).abs() + off).powi(2);
        all += size * size;
    }
    sum - ROUNDING * all
}
