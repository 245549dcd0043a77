//! F tests of what residuals may correlate with.
//!
//! With whitened residuals r, of which the fit's own directions are taken out, and the columns X of what a candidate does, these
//! directions taken out of them, too:
//!
//! ```text
//! S = X^T X,   g = X^T r,   F = (g^T S^-1 g / q) / ((r^T r - g^T S^-1 g) / (N - p - q)) / d
//! ```
//!
//! d is the design effect (never below one): errors may be larger where a candidate shows, and alike in what one configuration or a
//! block of joint space has read. With X's orthonormal directions D, what they leave e, and A = (the fit's directions, D), summed over
//! the readings of each group b:
//!
//! ```text
//! s_b = D_b^T e_b,   G_b = D_b^T D_b,   K_b = D_b^T A_b,   M = sum K_b^T K_b
//! d   = (sum |s_b|^2 / (q - tr M)) / (e^T e / (N - p - q))
//! nu  = (q - tr M)^2 / (sum tr G_b^2 - 2 sum tr(G_b K_b K_b^T) + tr M^2)
//! ```
//!
//! which is one, known as a variance with nu degrees of freedom is, if errors are independent and alike (Bell and McCaffrey 2002).
//! Groups are readings of one configuration, and blocks where they vary more than that; of both counts by which chance is likelier.
//! The probability is multiplied by the number of candidates that were looked at (Bonferroni).

use nalgebra::{DMatrix, DVector, Vector6};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::against::{Against, PatternColumn};
use super::rows::{Base, LookedAt, Projected, orthonormal};
use crate::experiment::numbered;

/// Of a column's square so much has to be left when the fit's directions are taken out: else it cannot be told from them.
const TOLD_APART: f64 = 1e-4;
/// Of a candidate's directions more than this share has to be left to compare groups by.
const COMPARED: f64 = 1e-9;
/// So many candidates are tested in one piece, or fewer so that there are so many pieces.
const BATCH: usize = 60;
const PIECES: usize = 4;

/// How strongly residuals go with something.
#[derive(Debug, Clone)]
pub(super) struct Test {
    pub against: Against,
    /// Directions that were told apart, q.
    pub degrees: usize,
    pub statistic: f64,
    /// Before correction.
    pub probability: f64,
    /// The sum of squares that it explains.
    pub explained: f64,
    /// The columns' coefficients.
    pub coefficients: DVector<f64>,
    pub design_effect: f64,
}

/// A candidate with what the fit's directions take of its columns X (r x c), and orthonormal combinations of what is left of them (c x q).
struct TestedPattern {
    against: Against,
    taken: DMatrix<f64>,
    combinations: DMatrix<f64>,
    /// Coordinates of the residuals along the combinations.
    shares: DVector<f64>,
}

/// What a base's rows are in each reading.
struct BaseRows {
    base: Base,
    rows: Vec<Vector6<f64>>,
    /// Their squares, and their products with what is left of the residuals.
    squares: Vec<f64>,
    left: Vec<f64>,
}

impl BaseRows {
    fn new(base: Base, looked: &LookedAt, projected: &Projected) -> Self {
        let rows: Vec<_> = looked.readings.iter().map(|each| base.of(each)).collect();
        let left = |(index, row): (usize, &Vector6<f64>)| {
            (projected.left.fixed_rows::<6>(6 * index)).dot(row)
        };
        Self {
            base,
            squares: rows.iter().map(Vector6::norm_squared).collect(),
            left: rows.iter().enumerate().map(left).collect(),
            rows,
        }
    }
}

fn sum_of_products(one: &[f64], other: impl Iterator<Item = f64>) -> f64 {
    one.iter().zip(other).map(|(one, other)| one * other).sum()
}

impl TestedPattern {
    /// Some candidates, without those that cannot be told from the fit's own directions. Columns are multiples of few bases, whose products
    /// with these directions serve all harmonics.
    fn of(looked: &LookedAt, projected: &Projected, candidates: &[Against]) -> Vec<Self> {
        let columns = looked.columns_of(candidates);
        let all: Vec<&PatternColumn> = columns.iter().flatten().collect();
        let (count, size) = (looked.readings.len(), projected.directions.nrows());
        let mut bases: Vec<BaseRows> = Vec::new();
        let mut taken = DMatrix::zeros(size, all.len());
        let mut shown = DMatrix::zeros(size, count);
        let mut first = 0;
        for alike in all.chunk_by(|one, other| one.0 == other.0) {
            let base = alike[0].0;
            let rows = BaseRows::new(base, looked, projected);
            for (index, row) in rows.rows.iter().enumerate() {
                let directions = projected.directions.fixed_columns::<6>(6 * index);
                shown.column_mut(index).gemv(1.0, &directions, row, 0.0);
            }
            bases.push(rows);
            let factors = alike.iter().flat_map(|column| &column.1).copied();
            let factors = DMatrix::from_iterator(count, alike.len(), factors);
            (taken.columns_mut(first, alike.len())).gemm(1.0, &shown, &factors, 0.0);
            first += alike.len();
        }
        let rows_of = |base: Base| bases.iter().find(|each| each.base == base);
        let mut first = 0;
        let tested = candidates.iter().zip(&columns);
        let tested = tested.filter_map(|(&against, columns)| {
            let product = |row: usize, column: usize| -> f64 {
                let [(base, factors), (other, others)] = [&columns[row], &columns[column]];
                let by = factors.iter().zip(others).map(|(factor, by)| factor * by);
                match (rows_of(*base), rows_of(*other)) {
                    (Some(one), Some(_)) if base == other => sum_of_products(&one.squares, by),
                    (Some(one), Some(other)) => {
                        let rows = one.rows.iter().zip(&other.rows);
                        let squares: Vec<f64> = rows.map(|(row, other)| row.dot(other)).collect();
                        sum_of_products(&squares, by)
                    }
                    _ => 0.0,
                }
            };
            let along = |row: usize, _| -> f64 {
                let (base, factors) = &columns[row];
                let rows = rows_of(*base);
                rows.map_or(0.0, |rows| {
                    sum_of_products(&rows.left, factors.iter().copied())
                })
            };
            let size = columns.len();
            first += size;
            let whole = DMatrix::from_fn(size, size, product);
            let taken = taken.columns(first - size, size).into_owned();
            let left = &whole - taken.tr_mul(&taken);
            let combinations = orthonormal(&left, &whole, |_| TOLD_APART)?;
            Some(Self {
                against,
                shares: combinations.tr_mul(&DVector::from_fn(size, along)),
                taken,
                combinations,
            })
        });
        tested.collect()
    }

    /// The F test, with the degrees of freedom of the denominator where they are fewer than those that are left.
    fn test(&self, projected: &Projected, design_effect: f64, known: f64) -> Option<Test> {
        let degrees = self.shares.len();
        let spare = projected.spare.checked_sub(degrees)? as f64;
        let explained = self.shares.norm_squared();
        let left = projected.left.norm_squared() - explained;
        let statistic = explained / degrees as f64 / (left / spare) / design_effect;
        let law = FisherSnedecor::new(degrees as f64, known.min(spare)).ok()?;
        (spare > 0.0 && left > 0.0).then(|| Test {
            against: self.against,
            degrees,
            statistic,
            probability: law.sf(statistic),
            explained,
            coefficients: &self.combinations * &self.shares,
            design_effect,
        })
    }
}

/// Tests candidates; those that cannot be told from the fit's own directions are left out. The discrepancy counts as independent
/// from reading to reading.
pub(super) fn screened(
    looked: &LookedAt,
    projected: &Projected,
    candidates: &[Against],
) -> Vec<Test> {
    // One product of many columns is faster than many.
    let batch = candidates.len().div_ceil(PIECES).clamp(1, BATCH);
    let tests = candidates.par_chunks(batch).map(|candidates| {
        let tested = TestedPattern::of(looked, projected, candidates).into_iter();
        let tests = tested.filter_map(|each| each.test(projected, 1.0, f64::INFINITY));
        tests.collect::<Vec<_>>()
    });
    tests.collect::<Vec<_>>().concat()
}

/// A candidate again, with its design effect, and its orthonormal directions (6 N x q).
pub(super) fn judged(
    looked: &LookedAt,
    projected: &Projected,
    against: Against,
) -> Option<(Test, DMatrix<f64>)> {
    let candidate = TestedPattern::of(looked, projected, &[against]).pop()?;
    let taken = &candidate.taken * &candidate.combinations;
    let directions =
        looked.rows_of(against) * &candidate.combinations - projected.directions.tr_mul(&taken);
    let blocks: Vec<usize> = looked.readings.iter().map(|each| each.block).collect();
    let effect_of = |groups: &[usize]| design_effect(groups, projected, &directions);
    let q = |reading: usize| &looked.readings[reading].angles;
    let (pose, is_alike) = (|each| (q(each), None), |one, other| q(one) == q(other));
    let visits = numbered(blocks.len(), pose, is_alike);
    let by_visits = effect_of(&visits)?;
    let by_blocks = effect_of(&blocks).filter(|(effect, _)| *effect > 1.0);
    let tests = [Some(by_visits), by_blocks].into_iter().flatten();
    let test = tests
        .filter_map(|(effect, known)| candidate.test(projected, effect.max(1.0), known))
        .max_by(|one, other| {
            (one.probability.total_cmp(&other.probability))
                .then(one.design_effect.total_cmp(&other.design_effect))
        })?;
    Some((test, directions))
}

/// How many times more a candidate's scores vary from group to group than independent errors that are alike would let them, and
/// with how many degrees of freedom that is known; nothing where one group has them all.
fn design_effect(
    groups: &[usize],
    projected: &Projected,
    directions: &DMatrix<f64>,
) -> Option<(f64, f64)> {
    let (taken, size) = (projected.directions.nrows(), directions.ncols());
    let left = &projected.left - directions * directions.tr_mul(&projected.left);
    let spare = projected.spare.checked_sub(size)? as f64;
    let mean_square = left.norm_squared() / spare;
    let count = groups.iter().max()? + 1;
    let mut scores = DMatrix::<f64>::zeros(size, count);
    // The K_b^T, side by side; the G_b are their last rows.
    let mut shared = DMatrix::<f64>::zeros(taken + size, size * count);
    for (index, &group) in groups.iter().enumerate() {
        let own = directions.rows(6 * index, 6);
        let mut score = scores.column_mut(group);
        score += own.tr_mul(&left.rows(6 * index, 6));
        let mut with_fit = shared.view_mut((0, group * size), (taken, size));
        with_fit += projected.directions.columns(6 * index, 6) * own;
        let mut with_own = shared.view_mut((taken, group * size), (size, size));
        with_own += own.tr_mul(&own);
    }
    let expected = size as f64 - shared.norm_squared();
    let mut variance = (&shared * shared.transpose()).norm_squared();
    for group in 0..count {
        let columns = shared.columns(group * size, size);
        let own = columns.rows(taken, size).into_owned();
        variance += own.norm_squared() - 2.0 * columns.tr_mul(&columns).dot(&own);
    }
    let is_known = expected > COMPARED * size as f64 && variance > 0.0;
    is_known.then(|| {
        let effect = scores.norm_squared() / expected / mean_square;
        (effect, expected.powi(2) / variance)
    })
}
