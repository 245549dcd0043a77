//! Readings that are less precise than the instrument: d = sum over rows of v^T R^-1 v over a box, with the covariance
//! R = s I + G G^T.
//!
//! For any c, which may depend on the configuration,
//!
//! ```text
//! v^T R^-1 v <= |v - G c|^2 / s + |c|^2        (Woodbury; equal for c = G^T R^-1 v)
//! ```
//!
//! so that nothing is inverted rigorously. A joint's share of v is a multiple of its column `J_n`, and so is its column of G where
//! it returns with a deviation: v = `v_0` + G a, where a is torques times constants. With c = a - e
//!
//! ```text
//! v^T R^-1 v <= |v_0 + G e|^2 / s + |a - e|^2
//! ```
//!
//! for any e: G a has cancelled exactly, and with it the products of torques and columns, which have the largest remainders. Here e
//! is a linear function of the coordinates: with its slopes the best one at the box's centre for D in place of 1 in
//!
//! ```text
//! (D + G^T G / s) e = a - G^T v_0 / s          (D = 1 + `RIDGE` x the mean square of each column's change over the box, over s)
//! ```
//!
//! so that over wide boxes, where G's columns are hardly known, e is small. And for any w
//!
//! ```text
//! v^T R^-1 v >= 2 w^T v - w^T R w              (equal for w = R^-1 v)
//! ```

use nalgebra::{Cholesky, Const, Matrix3, Vector3};

use super::form::{Turned, centre};
use super::rounding::UP;
use super::taylor::{LANES, ModelVector, ModelWorkspace, TaylorModel, VARIABLES, linear};

/// What rounding can take from a value at a centre, as a share of all that was added up.
const ROUNDING: f64 = 1e-12;
/// How much the change of G's columns over a box weighs: 1 would be its mean, but a bound is about the worst.
const RIDGE: f64 = 10.0;

/// What a covariance R = s I + G G^T is made of.
#[derive(Debug, Clone)]
pub(super) struct SpreadColumns {
    /// s
    pub everywhere: f64,
    /// The columns of G.
    pub columns: Vec<ModelVector>,
}

/// A vector v = `v_0` + G a.
#[derive(Debug, Clone)]
pub(super) struct WeightedRow {
    /// `v_0`
    pub rest: ModelVector,
    /// a
    pub factors: Vec<TaylorModel>,
}

/// Weighs rows with a covariance.
pub(super) fn weighted(
    workspace: &mut ModelWorkspace,
    rows: &[WeightedRow],
    covariance: &SpreadColumns,
    variables: usize,
) -> Turned {
    let mut at_centre = [0.0; LANES];
    // For every row and column, the constant part of e and its slopes.
    let nothing = [[0.0; LANES]; VARIABLES + 1];
    let mut best = vec![vec![nothing; covariance.columns.len()]; rows.len()];
    for (lane, at_centre) in at_centre.iter_mut().enumerate() {
        // Where nothing is known of a box, e = 0 is as good as any other.
        if let Some(centre) = Centre::new(workspace, covariance, lane, variables) {
            for (row, best) in rows.iter().zip(&mut best) {
                *at_centre += centre.choose(workspace, row, best);
            }
        }
    }
    let mut left = Vec::new();
    let mut missed = Vec::new();
    for (row, best) in rows.iter().zip(&best) {
        let chosen: Vec<TaylorModel> = (best.iter())
            .map(|best| workspace.linear_form(&best[0], &best[1..=variables]))
            .collect();
        for axis in 0..3 {
            let mut sum = workspace.sum().add(1.0, row.rest[axis]);
            for (column, chosen) in covariance.columns.iter().zip(&chosen) {
                sum = sum.product(1.0, column[axis], *chosen);
            }
            left.push(sum.end());
        }
        for (factor, chosen) in row.factors.iter().zip(chosen) {
            missed.push(workspace.sum().add(1.0, *factor).add(-1.0, chosen).end());
        }
    }
    let mut spread = [[0.0; LANES]; VARIABLES];
    for part in left.iter().chain(&missed) {
        workspace.add_spread(*part, &mut spread);
    }
    let mut sum = workspace.sum();
    for part in left {
        sum = sum.square(part);
    }
    let left = sum.end();
    let mut sum = workspace.sum().add(UP / covariance.everywhere, left);
    for part in missed {
        sum = sum.square(part);
    }
    Turned {
        model: sum.end(),
        is_valid: [true; LANES],
        at_centre: Some(at_centre),
        spread: Some(spread),
    }
}

/// A covariance at a box's centre, in doubles: what is chosen with it may be anything.
struct Centre {
    lane: usize,
    variables: usize,
    everywhere: f64,
    columns: Vec<Expanded>,
    /// D
    ridge: Vec<f64>,
    /// R
    own: Cholesky<f64, Const<3>>,
    /// s I + G D^-1 G^T
    ridged: Cholesky<f64, Const<3>>,
}

impl Centre {
    fn new(
        workspace: &ModelWorkspace,
        covariance: &SpreadColumns,
        lane: usize,
        variables: usize,
    ) -> Option<Self> {
        let everywhere = covariance.everywhere;
        let columns: Vec<Expanded> = (covariance.columns.iter())
            .map(|column| Expanded::new(workspace, column, lane, variables))
            .collect();
        let ridge: Vec<f64> = (columns.iter())
            .map(|each| 1.0 + RIDGE * each.change / everywhere)
            .collect();
        let factor = |ridge: &dyn Fn(usize) -> f64| {
            let dyads = (columns.iter().enumerate())
                .map(|(index, each)| each.value * each.value.transpose() / ridge(index));
            Cholesky::new(Matrix3::identity() * everywhere + dyads.sum::<Matrix3<f64>>())
        };
        Some(Self {
            own: factor(&|_| 1.0)?,
            ridged: factor(&|index| ridge[index])?,
            lane,
            variables,
            everywhere,
            columns,
            ridge,
        })
    }

    /// (D + G^T G / s)^-1 of a vector, in its place (Woodbury).
    fn solve(&self, vector: &mut [f64]) {
        let mut moved = Vector3::zeros();
        for ((value, ridge), column) in vector.iter_mut().zip(&self.ridge).zip(&self.columns) {
            *value /= ridge;
            moved += column.value * *value;
        }
        let moved = self.ridged.solve(&moved);
        for ((value, ridge), column) in vector.iter_mut().zip(&self.ridge).zip(&self.columns) {
            *value -= column.value.dot(&moved) / ridge;
        }
    }

    /// Chooses e with its slopes for a row; what v^T R^-1 v is at the centre, at least.
    fn choose(
        &self,
        workspace: &ModelWorkspace,
        row: &WeightedRow,
        best: &mut [[[f64; LANES]; VARIABLES + 1]],
    ) -> f64 {
        let lane = self.lane;
        let rest = Expanded::new(workspace, &row.rest, lane, self.variables);
        let value = |model: &TaylorModel| centre(workspace, *model, lane);
        let factors: Vec<f64> = row.factors.iter().map(value).collect();
        let pull =
            |vector: &Vector3<f64>, column: &Expanded| column.value.dot(vector) / self.everywhere;
        let mut chosen: Vec<f64> = (factors.iter().zip(&self.columns))
            .map(|(factor, column)| factor - pull(&rest.value, column))
            .collect();
        self.solve(&mut chosen);
        for (best, chosen) in best.iter_mut().zip(&chosen) {
            best[0][lane] = *chosen;
        }
        let sum = |part: &dyn Fn(&Expanded) -> Vector3<f64>| -> Vector3<f64> {
            let terms = self.columns.iter().zip(&chosen);
            terms.map(|(column, chosen)| part(column) * *chosen).sum()
        };
        let left = rest.value + sum(&|column| column.value);
        let mut slopes = vec![0.0; chosen.len()];
        for j in 0..self.variables {
            let moved = rest.slopes[j] + sum(&|column| column.slopes[j]);
            for ((slope, factor), column) in slopes.iter_mut().zip(&row.factors).zip(&self.columns)
            {
                let own = workspace.coefficients(*factor)[linear(j)][lane];
                *slope = own - column.slopes[j].dot(&left) / self.everywhere - pull(&moved, column);
            }
            self.solve(&mut slopes);
            for (best, slope) in best.iter_mut().zip(&slopes) {
                best[j + 1][lane] = *slope;
            }
        }
        let mut whole = rest;
        for ((factor, model), column) in factors.iter().zip(&row.factors).zip(&self.columns) {
            let off = workspace.remainder(*model)[lane];
            whole.value += column.value * *factor;
            whole.off += column.off * (factor.abs() + off) + column.value.abs() * off;
            whole.size += column.value.abs() * factor.abs();
        }
        let w = self.own.solve(&whole.value);
        least(&w, &whole, &self.columns, self.everywhere)
    }
}

/// A vector's value at the centre, its slopes there, and what it may be off by.
struct Expanded {
    value: Vector3<f64>,
    slopes: [Vector3<f64>; VARIABLES],
    off: Vector3<f64>,
    /// Bounds of all that was added up to the value.
    size: Vector3<f64>,
    /// How much it changes over the box: the mean of its square, roughly.
    change: f64,
}

impl Expanded {
    fn new(
        workspace: &ModelWorkspace,
        vector: &ModelVector,
        lane: usize,
        variables: usize,
    ) -> Self {
        let part = |axis: usize| vector[axis];
        let value = Vector3::from_fn(|axis, _| centre(workspace, part(axis), lane));
        let off = Vector3::from_fn(|axis, _| workspace.remainder(part(axis))[lane]);
        let bend = Vector3::from_fn(|axis, _| workspace.bend(part(axis))[lane]);
        let slopes: [Vector3<f64>; VARIABLES] = std::array::from_fn(|j| {
            if j < variables {
                Vector3::from_fn(|axis, _| workspace.coefficients(part(axis))[linear(j)][lane])
            } else {
                Vector3::zeros()
            }
        });
        let steepness: f64 = slopes.iter().map(Vector3::norm_squared).sum();
        Self {
            change: steepness / 3.0 + (bend + off).norm_squared(),
            size: value.abs(),
            value,
            slopes,
            off,
        }
    }

    /// Bounds of |w . what it is off by|, and of |w . itself|.
    fn along(&self, w: &Vector3<f64>) -> [f64; 2] {
        let size = w.abs();
        [size.dot(&self.off), size.dot(&(self.size + self.off))]
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
