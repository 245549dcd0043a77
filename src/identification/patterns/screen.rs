//! F tests of what residuals may correlate with.
//!
//! With whitened residuals r, of which the fit's own directions are taken out, and the columns X of what a candidate does, these
//! directions taken out of them, too:
//!
//! ```text
//! S = X^T X,   g = X^T r,   F = (g^T S^-1 g / q) / ((r^T r - g^T S^-1 g) / (N - p - q)) / d
//! ```
//!
//! d is the design effect of blocks of joint space (never below one): discrepancies that are alike in a block count as what they are,
//! few. The probability is multiplied by the number of candidates that were looked at (Bonferroni).

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix6xX, SymmetricEigen};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::candidates::{Against, Base, PatternColumn};
use super::rows::{LookedAt, Projected};

/// Of a column's square so much has to be left when the fit's directions are taken out: else it cannot be told from them.
const TOLD_APART: f64 = 1e-4;

/// So many candidates are tested in one piece.
const BATCH: usize = 16;

/// What each base and the residuals have in common, reading by reading.
struct Prepared {
    /// r x N: the fit's directions times the base.
    with_fit: DMatrix<f64>,
    /// N: the base times what is left.
    with_left: DVector<f64>,
    /// N: its square.
    squares: Vec<f64>,
}

/// What the fit's directions and what is left have in common with a column.
#[derive(Clone)]
struct PreparedColumn {
    /// r.
    taken: DVector<f64>,
    gradient: f64,
}

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

/// Tests candidates; those that cannot be told from the fit's own directions are left out. The discrepancy counts as independent
/// from reading to reading.
pub(super) fn screened(
    looked: &LookedAt,
    projected: &Projected,
    candidates: &[Against],
) -> Vec<Test> {
    let mut bases: Vec<Base> = (candidates.iter())
        .flat_map(|&against| looked.columns(against))
        .map(|column| column.base)
        .collect();
    bases.sort_unstable();
    bases.dedup();
    let prepared: BTreeMap<Base, Prepared> = (bases.par_iter())
        .map(|&base| (base, prepare(looked, projected, base)))
        .collect();
    let square = projected.square();
    let tests: Vec<Vec<Test>> = (candidates.par_chunks(BATCH))
        .map(|candidates| {
            let columns: Vec<_> = (candidates.iter())
                .map(|&against| looked.columns(against))
                .collect();
            let mut parts = prepared_columns(&prepared, &columns).into_iter();
            let tests = candidates.iter().zip(&columns).map(|(&against, columns)| {
                let parts: Vec<_> = parts.by_ref().take(columns.len()).collect();
                let solved = SolvedPattern::new(looked, &prepared, columns, &parts)?;
                let spare = projected.spare.checked_sub(solved.degrees)?;
                let statistic = statistic(&solved, square, spare, 1.0)?;
                Some(Test {
                    against,
                    degrees: solved.degrees,
                    statistic,
                    probability: probability(statistic, [solved.degrees, spare])?,
                    explained: solved.explained,
                    coefficients: solved.coefficients,
                    design_effect: 1.0,
                })
            });
            tests.flatten().collect()
        })
        .collect();
    tests.into_iter().flatten().collect()
}

/// The columns of some candidates, one after the other; those of one base together, which is quicker.
fn prepared_columns(
    prepared: &BTreeMap<Base, Prepared>,
    candidates: &[Vec<PatternColumn>],
) -> Vec<PreparedColumn> {
    let columns: Vec<&PatternColumn> = candidates.iter().flatten().collect();
    let nothing = PreparedColumn {
        taken: DVector::zeros(0),
        gradient: 0.0,
    };
    let mut parts = vec![nothing; columns.len()];
    for (base, prepared) in prepared {
        let places: Vec<usize> = (0..columns.len())
            .filter(|&place| columns[place].base == *base)
            .collect();
        if places.is_empty() {
            continue;
        }
        let factors: Vec<_> = (places.iter())
            .map(|&place| DVector::from_column_slice(&columns[place].factors))
            .collect();
        let factors = DMatrix::from_columns(&factors);
        let taken = &prepared.with_fit * &factors;
        for (index, &place) in places.iter().enumerate() {
            parts[place] = PreparedColumn {
                taken: taken.column(index).into_owned(),
                gradient: prepared.with_left.dot(&factors.column(index)),
            };
        }
    }
    parts
}

fn statistic(solved: &SolvedPattern, square: f64, spare: usize, design_effect: f64) -> Option<f64> {
    let left = square - solved.explained;
    let is_enough = spare > 0 && left > 0.0;
    let mean_square = left / spare as f64;
    is_enough.then(|| solved.explained / solved.degrees as f64 / mean_square / design_effect)
}

fn probability(statistic: f64, [one, other]: [usize; 2]) -> Option<f64> {
    let distribution = FisherSnedecor::new(one as f64, other as f64).ok()?;
    Some(distribution.sf(statistic))
}

fn prepare(looked: &LookedAt, projected: &Projected, base: Base) -> Prepared {
    let directions = projected.basis.first().map_or(0, Matrix6xX::ncols);
    let mut with_fit = DMatrix::zeros(directions, looked.readings.len());
    let mut with_left = DVector::zeros(looked.readings.len());
    let mut squares = Vec::with_capacity(looked.readings.len());
    for (index, reading) in looked.readings.iter().enumerate() {
        let column = base.of(reading);
        with_fit.set_column(index, &projected.basis[index].tr_mul(&column));
        with_left[index] = column.dot(&projected.left[index]);
        squares.push(column.norm_squared());
    }
    Prepared {
        with_fit,
        with_left,
        squares,
    }
}

/// The least-squares solution of a candidate.
struct SolvedPattern {
    degrees: usize,
    explained: f64,
    coefficients: DVector<f64>,
    /// What the fit's directions take of each column (r x q).
    taken: DMatrix<f64>,
    /// Orthonormal directions as combinations of the columns (q x d).
    combinations: DMatrix<f64>,
}

impl SolvedPattern {
    fn new(
        looked: &LookedAt,
        prepared: &BTreeMap<Base, Prepared>,
        columns: &[PatternColumn],
        parts: &[PreparedColumn],
    ) -> Option<Self> {
        let size = columns.len();
        let mut whole = DMatrix::zeros(size, size);
        for row in 0..size {
            for column in 0..=row {
                let (one, other) = (&columns[row], &columns[column]);
                let pairs = one.factors.iter().zip(&other.factors);
                let product: f64 = if one.base == other.base {
                    let squares = &prepared.get(&one.base)?.squares;
                    pairs
                        .zip(squares)
                        .map(|((a, b), square)| a * b * square)
                        .sum()
                } else {
                    let both = |reading| one.base.of(reading).dot(&other.base.of(reading));
                    let pairs = pairs.zip(&looked.readings);
                    pairs.map(|((a, b), reading)| a * b * both(reading)).sum()
                };
                whole[(row, column)] = product;
                whole[(column, row)] = product;
            }
        }
        let scale = DVector::from_fn(size, |place, _| {
            let square = whole[(place, place)];
            if square > 0.0 {
                square.sqrt().recip()
            } else {
                0.0
            }
        });
        let apart = DMatrix::from_fn(size, size, |row, column| {
            let taken = parts[row].taken.dot(&parts[column].taken);
            (whole[(row, column)] - taken) * scale[row] * scale[column]
        });
        if !apart.iter().all(|value| value.is_finite()) {
            return None;
        }
        let eigen = SymmetricEigen::new(apart);
        let scaled = DVector::from_fn(size, |place, _| parts[place].gradient * scale[place]);
        let kept: Vec<usize> = (0..size)
            .filter(|&place| eigen.eigenvalues[place] > TOLD_APART)
            .collect();
        if kept.is_empty() {
            return None;
        }
        let mut combinations = DMatrix::zeros(size, kept.len());
        let mut coefficients = DVector::zeros(size);
        let mut explained = 0.0;
        for (direction, &place) in kept.iter().enumerate() {
            let vector = eigen.eigenvectors.column(place);
            let value = eigen.eigenvalues[place];
            let share = vector.dot(&scaled);
            explained += share * share / value;
            let combination = vector.component_mul(&scale) / value.sqrt();
            coefficients += &combination * (share / value.sqrt());
            combinations.set_column(direction, &combination);
        }
        let taken: Vec<_> = parts.iter().map(|part| part.taken.clone()).collect();
        Some(Self {
            degrees: kept.len(),
            explained,
            coefficients,
            taken: DMatrix::from_columns(&taken),
            combinations,
        })
    }
}

/// A candidate again, with the design effect of the blocks of joint space, and its orthonormal directions (6 x d for each reading).
pub(super) fn judged(
    looked: &LookedAt,
    projected: &Projected,
    against: Against,
) -> Option<(Test, Vec<Matrix6xX<f64>>)> {
    let candidates = [looked.columns(against)];
    let [columns] = &candidates;
    let prepared: BTreeMap<Base, Prepared> = (columns.iter())
        .map(|column| (column.base, prepare(looked, projected, column.base)))
        .collect();
    let parts = prepared_columns(&prepared, &candidates);
    let solved = SolvedPattern::new(looked, &prepared, columns, &parts)?;
    let taken = &solved.taken * &solved.combinations;
    let directions: Vec<Matrix6xX<f64>> = (looked.readings.iter().enumerate())
        .map(|(index, reading)| {
            let mut rows = Matrix6xX::zeros(columns.len());
            for (place, column) in columns.iter().enumerate() {
                rows.set_column(place, &(column.base.of(reading) * column.factors[index]));
            }
            rows * &solved.combinations - &projected.basis[index] * &taken
        })
        .collect();
    let mut shares = DVector::<f64>::zeros(solved.degrees);
    for (directions, left) in directions.iter().zip(&projected.left) {
        shares += directions.tr_mul(left);
    }
    let blocks = looked.readings.iter().map(|each| each.block).max()? + 1;
    let mut scores = DMatrix::<f64>::zeros(solved.degrees, blocks);
    for (index, reading) in looked.readings.iter().enumerate() {
        let left = projected.left[index] - &directions[index] * &shares;
        let score = directions[index].tr_mul(&left);
        let mut sum = scores.column_mut(reading.block);
        sum += score;
    }
    let square = projected.square();
    let spare = projected
        .spare
        .checked_sub(solved.degrees)
        .filter(|&spare| spare > 0)?;
    let mean_square = (square - solved.explained).max(0.0) / spare as f64;
    let count = blocks as f64;
    let degrees = solved.degrees as f64;
    let is_many = blocks > 1 && mean_square > 0.0;
    let effect = if is_many {
        scores.norm_squared() * count / (count - 1.0) / degrees / mean_square
    } else {
        1.0
    };
    let design_effect = effect.max(1.0);
    let statistic = statistic(&solved, square, spare, design_effect)?;
    let by_blocks = solved.degrees * blocks.saturating_sub(1).max(1);
    let test = Test {
        against,
        degrees: solved.degrees,
        statistic,
        // Where blocks say that readings are not independent, blocks are what counts.
        probability: if effect > 1.0 {
            let spare = spare.min(by_blocks);
            probability(statistic, [solved.degrees, spare])?
        } else {
            probability(statistic, [solved.degrees, spare])?
        },
        explained: solved.explained,
        coefficients: solved.coefficients,
        design_effect,
    };
    Some((test, directions))
}
