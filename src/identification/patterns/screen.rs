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

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix6xX, SymmetricEigen, Vector6};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::candidates::{Against, Base, PatternColumn};
use super::rows::{LookedAt, Projected, ReadingRows};

/// Of a column's square so much has to be left when the fit's directions are taken out: else it cannot be told from them.
const TOLD_APART: f64 = 1e-4;

/// Of a candidate's directions more than this share has to be left to compare groups by.
const COMPARED: f64 = 1e-9;

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
                    probability: probability(statistic, solved.degrees, spare as f64)?,
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

fn probability(statistic: f64, one: usize, other: f64) -> Option<f64> {
    let distribution = FisherSnedecor::new(one as f64, other).ok()?;
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

/// A candidate again, with its design effect, and its orthonormal directions (6 x d for each reading).
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
    let left: Vec<Vector6<f64>> = (projected.left.iter().zip(&directions))
        .map(|(left, directions)| left - directions * &shares)
        .collect();
    let square = projected.square();
    let spare = projected.spare.checked_sub(solved.degrees)?;
    let alone = statistic(&solved, square, spare, 1.0)?;
    let mean_square = (square - solved.explained) / spare as f64;
    let blocks: Vec<usize> = looked.readings.iter().map(|each| each.block).collect();
    let effect_of =
        |groups: &[usize]| design_effect(groups, &projected.basis, &directions, &left, mean_square);
    let by_visits = effect_of(&visits(looked))?;
    let by_blocks = effect_of(&blocks).filter(|(effect, _)| *effect > 1.0);
    let judgements = [Some(by_visits), by_blocks].into_iter().flatten();
    let judgements = judgements.filter_map(|(effect, known)| {
        let design_effect = effect.max(1.0);
        let other = known.min(spare as f64);
        let probability = probability(alone / design_effect, solved.degrees, other)?;
        Some((probability, design_effect))
    });
    let (probability, design_effect) = judgements
        .max_by(|one, other| (one.0.total_cmp(&other.0)).then(one.1.total_cmp(&other.1)))?;
    let test = Test {
        against,
        degrees: solved.degrees,
        statistic: alone / design_effect,
        probability,
        explained: solved.explained,
        coefficients: solved.coefficients,
        design_effect,
    };
    Some((test, directions))
}

/// Which readings are of one configuration.
fn visits(looked: &LookedAt) -> Vec<usize> {
    let mut known = BTreeMap::new();
    let number = |each: &ReadingRows| {
        let angles: Vec<u64> = each.angles.iter().map(|angle| angle.to_bits()).collect();
        let next = known.len();
        *known.entry(angles).or_insert(next)
    };
    looked.readings.iter().map(number).collect()
}

/// How many times more a candidate's scores vary from group to group than independent errors that are alike would let them, and
/// with how many degrees of freedom that is known; nothing where one group has them all.
fn design_effect(
    groups: &[usize],
    basis: &[Matrix6xX<f64>],
    directions: &[Matrix6xX<f64>],
    left: &[Vector6<f64>],
    mean_square: f64,
) -> Option<(f64, f64)> {
    let [taken, size] = [basis, directions].map(|each| each.first().map_or(0, Matrix6xX::ncols));
    let count = groups.iter().max()? + 1;
    let mut scores = DMatrix::<f64>::zeros(size, count);
    // The K_b^T, side by side; the G_b are their last rows.
    let mut shared = DMatrix::<f64>::zeros(taken + size, size * count);
    for (index, &group) in groups.iter().enumerate() {
        let own = &directions[index];
        let mut score = scores.column_mut(group);
        score += own.tr_mul(&left[index]);
        let mut with_fit = shared.view_mut((0, group * size), (taken, size));
        with_fit += basis[index].tr_mul(own);
        let mut with_own = shared.view_mut((taken, group * size), (size, size));
        with_own += own.tr_mul(own);
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
