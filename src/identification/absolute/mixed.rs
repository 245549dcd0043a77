//! Variance components of residuals: restricted maximum likelihood (REML) for a linear mixed model with random effects.
//!
//! Parameters (with their priors) are fixed effects, the joints' errors at their knots and what is new at each stand are random
//! ones. With P = V^-1 - V^-1 X (X^T V^-1 X)^-1 X^T V^-1 for the covariance V of all readings, a variance v of a part
//! v D of V is improved by
//!
//! ```text
//! v <- v sqrt(y^T P D P y / trace(P D))
//! ```
//!
//! which never makes the likelihood smaller (the minorisation of H. Zhou, L. Hu, J. Zhou, K. Lange, *MM algorithms for
//! variance components models*, J. Comput. Graph. Stat. 28, 2019). How far the error of a joint reaches follows from its
//! expected squares at the knots, as in the EM algorithm.

use nalgebra::{Cholesky, DMatrix, DVector, DVectorView};
use rayon::prelude::*;
use statrs::distribution::{Beta, ContinuousCDF};

use super::super::spread::ErrorSpread;
use super::super::tails::shares_of_tail;
use super::joint_errors::{DiscrepancyModel, JointError, SQUARE_95, region_square};
use super::rows::LinearReading;
use super::{AbsoluteCase, Discrepancy};
use crate::numeric::ornstein_uhlenbeck::{OrnsteinUhlenbeck, Tridiagonal, knots_among};

/// No joint has more knots.
const MOST_KNOTS: usize = 48;
/// Nor beside slow waves: errors that reach no further than between knots are nearly new at each stand.
const MOST_BESIDE_WAVES: usize = 16;
/// A knot stands for so many stands of the robot.
const STANDS_PER_KNOT: usize = 4;
/// Improvements of the variances; later ones change intervals by a per cent.
const ROUNDS: usize = 14;
/// Deviations that change by less are found.
const FOUND: f64 = 0.02;
/// The smallest variance (m^2, rad^2).
const LEAST: f64 = 1e-18;
/// From so many readings on, regions are scaled by what was seen.
const SCALED_FROM: usize = 40;
/// Parts of the stands, each predicted by a fit to the others: so many where that takes no more than the fits of so many stands, and at least two.
const PARTS: usize = 10;
const STANDS_OF_PARTS: usize = 1000;
/// A reading that was left out says how large errors are where it stands, if it is likelier one of them than a wrong one.
const LIKELIER: f64 = 0.5;
/// Regions of 95 % hold less than this share with no more than this probability.
const LEAST_HELD: f64 = 0.92;
const SELDOM: f64 = 0.1;
/// Waves that come round so often in a turn, or less, hide in parameters: a gear that is not round once in a turn looks like a joint that gives way
/// to gravity. What is left tells next to nothing of them.
const HIDDEN_WAVES: usize = 3;
/// The largest variance of one of them, over that of what the joint is seen to be off by.
const LARGEST_WAVES: f64 = 4.0;
/// Pieces of sums, so that bits do not depend on threads.
const PIECES: usize = 32;

/// Readings that share what is new at a stand.
#[derive(Debug, Clone)]
pub(super) struct ReadingStand {
    /// Read less predicted (m).
    residual: DVector<f64>,
    /// Derivatives by what is determined of the parameters (m x r).
    fixed: DMatrix<f64>,
    /// Derivatives by each joint's angle (m x k).
    joints: DMatrix<f64>,
    /// The same by waves of those joints' errors that have them (m x w).
    waves: DMatrix<f64>,
    /// The readings' own covariance.
    own: DMatrix<f64>,
    /// Which coordinate each row is, from 0 to 5.
    coordinates: Vec<usize>,
    /// The commanded angles of the joints.
    angles: Vec<f64>,
    /// Variances of what is new at it, of positions and of rotations, that its readings were weighed with.
    assumed: [f64; 2],
}

/// The variances that are looked for.
#[derive(Debug, Clone, PartialEq)]
struct MixedVariances {
    rest: [f64; 2],
    joints: Vec<f64>,
    waves: Vec<f64>,
    process: Vec<OrnsteinUhlenbeck>,
}

/// The readings with what is known before of the parameters, in the coordinates of what is determined.
#[derive(Debug, Clone)]
pub(super) struct MixedModel {
    visits: Vec<ReadingStand>,
    /// Precision (r x r) and its pull (r).
    prior: DMatrix<f64>,
    pull: DVector<f64>,
    /// The joints, and how the coordinates become parameters (p x r).
    joints: Vec<usize>,
    units: DMatrix<f64>,
    /// Variances to start from, of positions and of rotations.
    discrepancy_model: [f64; 2],
    /// No joint has more knots.
    most_knots: usize,
    /// The joints with waves, by their places among all.
    waving: Vec<usize>,
}

/// The variances of some sums of parameters, and how well they are known.
pub(super) struct SumVariances {
    /// The variance of each.
    pub variances: Vec<f64>,
    /// Degrees of freedom of each, after F. E. Satterthwaite (*An approximate distribution of estimates of variance components*,
    /// Biometrics Bulletin 2, 1946).
    pub degrees: Vec<f64>,
}

/// Variances after one more improvement.
struct ImprovedVariances {
    next: MixedVariances,
    /// How many numbers told each of those before: of what is new at stands, then of the joints.
    told: Vec<f64>,
}

/// What the model says with some variances.
struct MixedSolution {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

/// What a mixed model gives.
pub(super) struct MixedFit {
    pub model: DiscrepancyModel,
    /// The shares of readings, and of rotations, that lie in their regions of 95 % as computed, each predicted by a fit to the others.
    pub predicted_by_others: [Option<f64>; 2],
}

/// A stand's equations at some variances.
struct StandEquations {
    index: Vec<usize>,
    matrix: DMatrix<f64>,
    covariance: DMatrix<f64>,
    spare: Vec<f64>,
}

/// Sums over stands of what improves the variances: numerators and denominators.
#[derive(Clone)]
struct VarianceImprovement {
    rest: [[f64; 2]; 2],
    joints: Vec<[f64; 2]>,
}

impl MixedModel {
    /// Of the readings of a case at what was fitted to them. `units` (p x r) spans what is determined, of which the prior
    /// knows a precision (r x r) and wants a change (r).
    pub fn new(
        case: &AbsoluteCase<'_>,
        rows: &[LinearReading],
        joints: Vec<usize>,
        units: DMatrix<f64>,
        [prior, pull]: [DMatrix<f64>; 2],
        discrepancy: &Discrepancy,
    ) -> Self {
        let assumed = discrepancy.covariance();
        let mut model = Self {
            visits: Vec::new(),
            prior,
            pull: pull.column(0).into_owned(),
            joints,
            units,
            discrepancy_model: [assumed[(0, 0)], assumed[(3, 3)]],
            most_knots: MOST_KNOTS,
            waving: Vec::new(),
        };
        model.visits = model.stands_of(case, rows);
        model
    }

    /// Stands of readings at what was fitted, perhaps to others.
    pub fn stands_of(&self, case: &AbsoluteCase<'_>, rows: &[LinearReading]) -> Vec<ReadingStand> {
        let (joints, units) = (&self.joints, &self.units);
        (case.visits.iter())
            .map(|stand| {
                let size: usize = stand.iter().map(|&index| rows[index].residual.len()).sum();
                let mut all = ReadingStand {
                    residual: DVector::zeros(size),
                    fixed: DMatrix::zeros(size, units.ncols()),
                    joints: DMatrix::zeros(size, joints.len()),
                    waves: DMatrix::zeros(size, 0),
                    own: DMatrix::zeros(size, size),
                    coordinates: Vec::new(),
                    angles: Vec::new(),
                    assumed: self.discrepancy_model.map(|each| each.max(LEAST)),
                };
                for &index in stand {
                    let (rows, at) = (&rows[index], all.coordinates.len());
                    let count = rows.residual.len();
                    all.residual.rows_mut(at, count).copy_from(&rows.residual);
                    let fixed = &rows.columns * units;
                    all.fixed.rows_mut(at, count).copy_from(&fixed);
                    all.joints.rows_mut(at, count).copy_from(&rows.joints);
                    let mut own = all.own.view_mut((at, at), (count, count));
                    own.copy_from(&rows.own);
                    all.coordinates.extend(0..count);
                }
                let first = stand.first().map(|&index| &case.observations[index].setup);
                let angle = |&joint: &usize| first.map_or(0.0, |each| each.commanded_rad[joint]);
                all.angles = joints.iter().map(angle).collect();
                all
            })
            .collect()
    }

    /// The same of some of the stands.
    fn of_stands(&self, is_in: impl Fn(usize) -> bool) -> Self {
        let visits = self.visits.iter().enumerate();
        let visits = visits.filter(|(number, _)| is_in(*number));
        Self {
            visits: visits.map(|(_, stand)| stand.clone()).collect(),
            prior: self.prior.clone(),
            pull: self.pull.clone(),
            joints: self.joints.clone(),
            units: self.units.clone(),
            waving: self.waving.clone(),
            ..*self
        }
    }

    /// The same with slow waves in the error of each joint that turns, as many as hide in parameters.
    pub fn with_waves(mut self, turns: &[bool]) -> Self {
        let turning: Vec<usize> = (0..turns.len()).filter(|&joint| turns[joint]).collect();
        for stand in &mut self.visits {
            let waves = turning.iter().flat_map(|&joint| {
                let (moved, angle) = (stand.joints.column(joint), stand.angles[joint]);
                (1..=HIDDEN_WAVES).flat_map(move |order| {
                    let (sine, cosine) = (order as f64 * angle).sin_cos();
                    [moved * sine, moved * cosine]
                })
            });
            stand.waves = DMatrix::from_iterator(
                stand.residual.len(),
                2 * HIDDEN_WAVES * turning.len(),
                waves.flat_map(|column| column.data.as_vec().clone()),
            );
        }
        self.most_knots = MOST_BESIDE_WAVES;
        self.waving = turning;
        self
    }

    fn without_waves(&self) -> Self {
        let mut model = self.clone();
        for stand in &mut model.visits {
            stand.waves = DMatrix::zeros(stand.residual.len(), 0);
        }
        model.waving.clear();
        model
    }

    /// Two series of one robot, which share the errors of its joints and nothing else: all parameters of the one (p) above all
    /// of the other.
    pub fn beside(&self, other: &Self) -> Self {
        let corner = |one: &DMatrix<f64>, other: &DMatrix<f64>| {
            let (rows, columns) = (one.nrows(), one.ncols());
            let mut both = DMatrix::zeros(rows + other.nrows(), columns + other.ncols());
            both.view_mut((0, 0), one.shape()).copy_from(one);
            both.view_mut((rows, columns), other.shape())
                .copy_from(other);
            both
        };
        let (own, others) = (self.units.ncols(), other.units.ncols());
        let wide = |stand: &ReadingStand, before: usize| ReadingStand {
            fixed: (stand.fixed.clone())
                .insert_columns(0, before, 0.0)
                .resize_horizontally(own + others, 0.0),
            ..stand.clone()
        };
        let visits = self.visits.iter().map(|each| wide(each, 0));
        let visits = visits.chain(other.visits.iter().map(|each| wide(each, own)));
        let mut pull = self.pull.clone().resize_vertically(own + others, 0.0);
        pull.rows_mut(own, others).copy_from(&other.pull);
        Self {
            visits: visits.collect(),
            prior: corner(&self.prior, &other.prior),
            pull,
            joints: self.joints.clone(),
            units: corner(&self.units, &other.units),
            discrepancy_model: [0, 1].map(|part| {
                f64::midpoint(self.discrepancy_model[part], other.discrepancy_model[part])
            }),
            most_knots: self.most_knots.min(other.most_knots),
            waving: self.waving.clone(),
        }
    }

    /// The variances of sums of parameters (p x n) that were fitted with readings weighed as independent. None where the numbers have no
    /// factorisation.
    pub fn of_sums(&self, sums: &DMatrix<f64>) -> Option<SumVariances> {
        let (variances, solved) = self.likeliest()?;
        let parts = self.parts(&variances, sums)?;
        let ImprovedVariances { told, .. } = self.improved(&variances, &solved)?;
        let (variances, degrees) = parts
            .column_iter()
            .map(|parts| satterthwaite(parts, &told))
            .unzip();
        Some(SumVariances { variances, degrees })
    }

    /// The covariance (p x p) of parameters that were fitted with readings weighed as independent, with the degrees of freedom of each
    /// variance. None where the numbers have no factorisation.
    pub fn of_parameters(&self) -> Option<(DMatrix<f64>, Vec<f64>)> {
        let (variances, solved) = self.likeliest()?;
        let each = DMatrix::identity(self.units.nrows(), self.units.nrows());
        let ImprovedVariances { told, .. } = self.improved(&variances, &solved)?;
        let parts = self.parts(&variances, &each)?;
        let degrees = parts
            .column_iter()
            .map(|parts| satterthwaite(parts, &told).1);
        Some((self.sandwich(&variances)?, degrees.collect()))
    }

    /// The likeliest variances, with what the model says then. Over a part of a turn large waves add up to next to nothing, and what hides in
    /// parameters is no reason against them: no joint's are more than twice as large as what it is seen to be off by without.
    fn likeliest(&self) -> Option<(MixedVariances, MixedSolution)> {
        let most = if self.waving.is_empty() {
            Vec::new()
        } else {
            let (seen, _) = self.without_waves().likeliest()?;
            self.waving
                .iter()
                .map(|&joint| seen.joints[joint])
                .collect()
        };
        let mut variances = self.first();
        let limit = |variances: &mut MixedVariances| {
            for (variance, &most) in variances.waves.iter_mut().zip(&most) {
                *variance = variance.min(most * LARGEST_WAVES).max(LEAST);
            }
        };
        limit(&mut variances);
        let mut solved = self.solved(&variances)?;
        for _ in 0..ROUNDS {
            let ImprovedVariances { mut next, .. } = self.improved(&variances, &solved)?;
            limit(&mut next);
            let change = next.change_from(&variances);
            variances = next;
            solved = self.solved(&variances)?;
            if change < FOUND {
                break;
            }
        }
        Some((variances, solved))
    }

    /// The likeliest variances with what follows from them; of some readings that were left out, too. None where the numbers have no factorisation.
    pub fn fit(&self, left_out: &[ReadingStand]) -> Option<MixedFit> {
        let (variances, solved) = self.likeliest()?;
        let mut model = self.model(&variances, &solved);
        let kept = self.squares_by_others();
        let left_out: Vec<PredictedSquares<'_>> = (left_out.iter())
            .flat_map(|stand| self.squares_at(stand, &variances, &solved))
            .collect();
        let predicted_by_others = [0, 1].map(|part| model.seen(part, &kept, &left_out));
        Some(MixedFit {
            model,
            predicted_by_others,
        })
    }

    /// Half of what is unexplained in the joints.
    fn first(&self) -> MixedVariances {
        let count = (self.visits.len() / STANDS_PER_KNOT).clamp(2, self.most_knots);
        let process: Vec<OrnsteinUhlenbeck> = (0..self.joints.len())
            .map(|joint| {
                let angles: Vec<f64> = self.visits.iter().map(|each| each.angles[joint]).collect();
                let knots = knots_among(&angles, count);
                OrnsteinUhlenbeck {
                    length: OrnsteinUhlenbeck::longest(&knots),
                    knots,
                }
            })
            .collect();
        let (mut moved, mut rows) = (0.0, 0.0);
        for stand in &self.visits {
            for (row, _) in (stand.coordinates.iter().enumerate()).filter(|(_, each)| **each < 3) {
                moved += stand.joints.row(row).norm_squared();
                rows += 1.0;
            }
        }
        let [position, rotation] = self.discrepancy_model;
        let of_joints = 0.5 * position * rows / f64::max(moved, f64::MIN_POSITIVE);
        MixedVariances {
            rest: [0.5 * position, 0.5 * rotation].map(|each| each.max(LEAST)),
            joints: vec![of_joints.clamp(LEAST, 1e-4); process.len()],
            waves: vec![of_joints.clamp(LEAST, 1e-4); self.waves() / (2 * HIDDEN_WAVES)],
            process,
        }
    }

    /// The number of waves of all joints.
    fn waves(&self) -> usize {
        self.visits.first().map_or(0, |stand| stand.waves.ncols())
    }

    /// Where the knots of each joint begin among all unknowns, where all waves do, and the number of unknowns.
    fn offsets(&self, variances: &MixedVariances) -> Vec<usize> {
        let mut offsets = vec![self.units.ncols()];
        for each in &variances.process {
            offsets.push(offsets[offsets.len() - 1] + each.knots.len());
        }
        offsets.push(offsets[offsets.len() - 1] + self.waves());
        offsets
    }

    fn solved(&self, variances: &MixedVariances) -> Option<MixedSolution> {
        let offsets = self.offsets(variances);
        let size = *offsets.last()?;
        let pieces: Vec<Option<(DMatrix<f64>, DVector<f64>)>> = (self.pieces())
            .map(|visits| {
                let mut information = DMatrix::zeros(size, size);
                let mut gradient = DVector::zeros(size);
                for stand in visits {
                    let local = stand.local(variances, &offsets);
                    let factor = Cholesky::new(local.covariance)?;
                    let weighed = factor.solve(&local.matrix);
                    // Many columns, few rows: faster than `tr_mul`.
                    let own = weighed.transpose() * &local.matrix;
                    let pull = weighed.tr_mul(&stand.residual);
                    for (column, &to) in local.index.iter().enumerate() {
                        gradient[to] += pull[column];
                        for (row, &from) in local.index.iter().enumerate() {
                            information[(from, to)] += own[(row, column)];
                        }
                    }
                }
                Some((information, gradient))
            })
            .collect();
        let mut information = DMatrix::zeros(size, size);
        let mut gradient = DVector::zeros(size);
        for piece in pieces {
            let (one, other) = piece?;
            information += one;
            gradient += other;
        }
        let fixed = self.units.ncols();
        let mut before = information.view_mut((0, 0), (fixed, fixed));
        before += &self.prior;
        let mut pull = gradient.rows_mut(0, fixed);
        pull += &self.pull;
        for (joint, process) in variances.process.iter().enumerate() {
            let (precision, _) = process.precision();
            let (at, variance) = (offsets[joint], variances.joints[joint]);
            for (knot, value) in precision.diagonal.iter().enumerate() {
                information[(at + knot, at + knot)] += value / variance;
            }
            for (knot, value) in precision.beside.iter().enumerate() {
                information[(at + knot, at + knot + 1)] += value / variance;
                information[(at + knot + 1, at + knot)] += value / variance;
            }
        }
        let first = offsets[variances.process.len()];
        for at in first..size {
            information[(at, at)] += variances.of_wave(at - first).recip();
        }
        // Units apart: parameters in typical sizes, joints in rad.
        let sizes = information.diagonal().map(|each| each.sqrt().recip());
        for (index, mut column) in information.column_iter_mut().enumerate() {
            column.component_mul_assign(&sizes);
            column *= sizes[index];
        }
        let mut covariance = Cholesky::new(information)?.inverse();
        for (index, mut column) in covariance.column_iter_mut().enumerate() {
            column.component_mul_assign(&sizes);
            column *= sizes[index];
        }
        Some(MixedSolution {
            mean: &covariance * gradient,
            covariance,
        })
    }

    fn pieces(&self) -> impl IndexedParallelIterator<Item = &[ReadingStand]> {
        let size = self.visits.len().div_ceil(PIECES).max(1);
        self.visits.par_chunks(size)
    }

    fn improved(
        &self,
        variances: &MixedVariances,
        solved: &MixedSolution,
    ) -> Option<ImprovedVariances> {
        let offsets = self.offsets(variances);
        let nothing = VarianceImprovement {
            rest: [[0.0; 2]; 2],
            joints: vec![[0.0; 2]; self.joints.len()],
        };
        let pieces: Vec<Option<VarianceImprovement>> = (self.pieces())
            .map(|visits| {
                let mut sum = nothing.clone();
                for stand in visits {
                    stand.improve(&stand.local(variances, &offsets), solved, &mut sum)?;
                }
                Some(sum)
            })
            .collect();
        let mut sum = nothing;
        for piece in pieces {
            let piece = piece?;
            for (sum, each) in (sum.rest.iter_mut().chain(&mut sum.joints))
                .zip(piece.rest.iter().chain(&piece.joints))
            {
                sum[0] += each[0];
                sum[1] += each[1];
            }
        }
        let better = |variance: f64, [square, trace]: [f64; 2]| {
            let ratio = if trace > 0.0 { square / trace } else { 1.0 };
            (variance * ratio.max(0.0).sqrt()).max(LEAST)
        };
        let mut next = variances.clone();
        let mut told = Vec::new();
        for part in 0..2 {
            told.push(variances.rest[part] * sum.rest[part][1]);
            next.rest[part] = better(variances.rest[part], sum.rest[part]);
        }
        for (joint, process) in variances.process.iter().enumerate() {
            let (at, count) = (offsets[joint], process.knots.len());
            let variance = variances.joints[joint];
            let product = |one: usize, other: usize| solved.mean[one] * solved.mean[other];
            let mut values = Tridiagonal {
                diagonal: (at..at + count).map(|each| product(each, each)).collect(),
                beside: (at + 1..at + count)
                    .map(|each| product(each - 1, each))
                    .collect(),
            };
            let covariance = Tridiagonal {
                diagonal: (at..at + count)
                    .map(|each| solved.covariance[(each, each)])
                    .collect(),
                beside: (at + 1..at + count)
                    .map(|each| solved.covariance[(each - 1, each)])
                    .collect(),
            };
            let (precision, _) = process.precision();
            let square = precision.product_trace(&values) / (variance * variance);
            let known = precision.product_trace(&covariance) / variance;
            let mut own = sum.joints[joint];
            own[0] += square;
            own[1] += (count as f64 - known).max(0.0) / variance;
            told.push(variance * own[1]);
            next.joints[joint] = better(variance, own);
            let all = values.diagonal.iter_mut().chain(&mut values.beside);
            for (value, known) in all.zip(covariance.diagonal.iter().chain(&covariance.beside)) {
                *value += known;
            }
            next.process[joint].length = process.likeliest_length(&values);
        }
        for (joint, &variance) in variances.waves.iter().enumerate() {
            let count = 2 * HIDDEN_WAVES;
            let at = offsets[variances.process.len()] + joint * count;
            let square = solved.mean.rows(at, count).norm_squared() / (variance * variance);
            let own = solved.covariance.view((at, at), (count, count)).trace();
            let trace = (count as f64 - own / variance).max(0.0) / variance;
            told.push(variance * trace);
            next.waves[joint] = better(variance, [square, trace]);
        }
        Some(ImprovedVariances { next, told })
    }

    /// The covariance (p x p) of a fit that took readings of different stands as independent with this discrepancy, where the
    /// variances are these: H^-1 (sum A^T V A) H^-1.
    fn sandwich(&self, variances: &MixedVariances) -> Option<DMatrix<f64>> {
        let offsets = self.offsets(variances);
        let fixed = self.units.ncols();
        let knots = offsets.last()? - fixed;
        let pieces: Vec<Option<[DMatrix<f64>; 3]>> = (self.pieces())
            .map(|visits| {
                let mut sums = [
                    DMatrix::zeros(fixed, fixed),
                    DMatrix::zeros(fixed, fixed),
                    DMatrix::zeros(fixed, knots),
                ];
                for stand in visits {
                    let local = stand.local(variances, &offsets);
                    let weighed = stand.weighed()?;
                    sums[0] += weighed.tr_mul(&stand.fixed);
                    sums[1] += weighed.tr_mul(&(&local.covariance * &weighed));
                    let through = weighed.tr_mul(&local.matrix);
                    for (column, &to) in local.index.iter().enumerate().skip(fixed) {
                        let mut sum = sums[2].column_mut(to - fixed);
                        sum += through.column(column);
                    }
                }
                Some(sums)
            })
            .collect();
        let mut curvature = self.prior.clone();
        let mut square = self.prior.clone();
        let mut through = DMatrix::zeros(fixed, knots);
        for piece in pieces {
            let [one, other, joints] = piece?;
            curvature += one;
            square += other;
            through += joints;
        }
        for (joint, process) in variances.process.iter().enumerate() {
            let count = process.knots.len();
            let own = through.columns(offsets[joint] - fixed, count);
            let among = DMatrix::from_fn(count, count, |row, column| {
                variances.joints[joint] * process.correlation(row, column)
            });
            square += own * among * own.transpose();
        }
        let first = offsets[variances.process.len()] - fixed;
        for wave in 0..self.waves() {
            let own = through.column(first + wave);
            square += own * variances.of_wave(wave) * own.transpose();
        }
        let inverse = &self.units * Cholesky::new(curvature)?.inverse();
        Some(&inverse * square * inverse.transpose())
    }

    /// The parts of the variances of sums (p x n) of parameters: what is known before and of the readings themselves, what is new at
    /// stands, of positions and of rotations, and each joint's error.
    fn parts(&self, variances: &MixedVariances, sums: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let offsets = self.offsets(variances);
        let fixed = self.units.ncols();
        let mut curvature = self.prior.clone();
        for stand in &self.visits {
            curvature += stand.weighed()?.tr_mul(&stand.fixed);
        }
        let sums = Cholesky::new(curvature)?.solve(&self.units.tr_mul(sums));
        let joints = variances.process.len();
        let mut parts = DMatrix::zeros(3 + joints + variances.waves.len(), sums.ncols());
        let mut through = DMatrix::zeros(sums.ncols(), offsets.last()? - fixed);
        for stand in &self.visits {
            let local = stand.local(variances, &offsets);
            let gains = stand.weighed()? * &sums;
            let moved = gains.tr_mul(&local.matrix);
            for (column, &to) in local.index.iter().enumerate().skip(fixed) {
                let mut sum = through.column_mut(to - fixed);
                sum += moved.column(column);
            }
            for (at, gain) in gains.column_iter().enumerate() {
                parts[(0, at)] += gain.dot(&(&stand.own * gain));
                for coordinate in 0..6 {
                    let rows = stand.coordinates.iter().zip(gain.iter());
                    let shared = rows.filter(|(each, _)| **each == coordinate);
                    let shared = shared.map(|(_, gain)| gain).sum::<f64>();
                    let part = coordinate / 3;
                    parts[(1 + part, at)] += variances.rest[part] * shared * shared;
                }
                for joint in 0..joints {
                    let own = variances.joints[joint] * local.spare[joint];
                    parts[(3 + joint, at)] += own * gain.dot(&stand.joints.column(joint)).powi(2);
                }
            }
        }
        for (at, sum) in sums.column_iter().enumerate() {
            parts[(0, at)] += sum.dot(&(&self.prior * sum));
            for (joint, process) in variances.process.iter().enumerate() {
                let count = process.knots.len();
                let own = through.view((at, offsets[joint] - fixed), (1, count));
                let among = DMatrix::from_fn(count, count, |row, column| {
                    variances.joints[joint] * process.correlation(row, column)
                });
                parts[(3 + joint, at)] += (own * among * own.transpose())[(0, 0)];
            }
            for wave in 0..self.waves() {
                let own = through[(at, offsets[joints] - fixed + wave)];
                let part = 3 + joints + wave / (2 * HIDDEN_WAVES);
                parts[(part, at)] += variances.of_wave(wave) * own * own;
            }
        }
        Some(parts)
    }

    fn model(&self, variances: &MixedVariances, solved: &MixedSolution) -> DiscrepancyModel {
        let offsets = self.offsets(variances);
        let fixed = self.units.ncols();
        let (parameters, knots) = (self.units.nrows(), solved.mean.len() - fixed);
        let mut units = DMatrix::zeros(parameters + knots, fixed + knots);
        units
            .view_mut((0, 0), (parameters, fixed))
            .copy_from(&self.units);
        units
            .view_mut((parameters, fixed), (knots, knots))
            .fill_with_identity();
        let joints = variances.process.iter().enumerate();
        let [position_m, rotation_rad] = variances.rest.map(f64::sqrt);
        DiscrepancyModel {
            joints: joints
                .map(|(joint, process)| JointError {
                    joint: self.joints[joint],
                    values: (solved.mean.rows_range(offsets[joint]..offsets[joint + 1]))
                        .iter()
                        .copied()
                        .collect(),
                    process: process.clone(),
                    deviation: variances.joints[joint].sqrt(),
                    spread: [Vec::new(), Vec::new()],
                })
                .collect(),
            shift: &self.units * solved.mean.rows(0, fixed),
            covariance: &units * &solved.covariance * units.transpose(),
            rest: Discrepancy {
                position_m,
                rotation_rad: if self.has_rotations() {
                    rotation_rad
                } else {
                    0.0
                },
            },
            scale: [1.0; 2],
        }
    }

    fn has_rotations(&self) -> bool {
        let mut coordinates = self.visits.iter().flat_map(|stand| &stand.coordinates);
        coordinates.any(|coordinate| *coordinate >= 3)
    }

    /// The squares of position and rotation of each reading over their covariance, predicted by stands that its own was not among, variances
    /// and knots, too: those are chosen so that they suit what was fitted, at the angles where that stood.
    fn squares_by_others(&self) -> Vec<PredictedSquares<'_>> {
        let parts = (STANDS_OF_PARTS / self.visits.len().max(1)).clamp(2, PARTS);
        let each = (0..parts).into_par_iter().map(|part| {
            let others = self.of_stands(|number| number % parts != part);
            let (variances, solved) = others.likeliest()?;
            let own = self.visits.iter().skip(part).step_by(parts);
            let squares = own.flat_map(|stand| others.squares_at(stand, &variances, &solved));
            Some(squares.collect::<Vec<_>>())
        });
        let all: Vec<Option<Vec<_>>> = each.collect();
        all.into_iter().flatten().flatten().collect()
    }

    /// The same of a stand that was not fitted.
    fn squares_at<'a>(
        &self,
        stand: &'a ReadingStand,
        variances: &MixedVariances,
        solved: &MixedSolution,
    ) -> Vec<PredictedSquares<'a>> {
        let local = stand.local(variances, &self.offsets(variances));
        let left = &stand.residual - &local.matrix * local.mean(solved);
        let covariance = &local.covariance + local.known(solved);
        let firsts = (stand.coordinates.iter().enumerate()).filter(|(_, each)| **each == 0);
        firsts
            .map(|(at, _)| {
                let next = stand.coordinates[at..].iter().skip(1);
                let rows = 1 + next.take_while(|each| **each > 0).count();
                let left = left.rows(at, rows).into_owned();
                let covariance = covariance.view((at, at), (rows, rows)).into_owned();
                PredictedSquares {
                    angles: &stand.angles,
                    squares: [0, 3].map(|first| region_square(&left, &covariance, first)),
                }
            })
            .collect()
    }
}

/// Squares of a position and a rotation over the covariance of what was predicted for them.
struct PredictedSquares<'a> {
    /// The commanded angles of the joints.
    angles: &'a [f64],
    squares: [Option<f64>; 2],
}

/// The sum of a variance's parts, the first of them known and the others told by so many numbers, by one at least, and its degrees
/// of freedom: no end of them where all is known.
fn satterthwaite(parts: DVectorView<'_, f64>, told: &[f64]) -> (f64, f64) {
    let variance = parts.sum();
    let estimated = parts.iter().skip(1).zip(told);
    let spread: f64 = estimated
        .filter(|(part, _)| **part > 0.0)
        .map(|(part, told)| part * part / told.max(1.0))
        .sum();
    let freedom = if spread > 0.0 {
        variance * variance / spread
    } else {
        f64::INFINITY
    };
    (variance, freedom)
}

impl DiscrepancyModel {
    /// Takes over how large errors of positions (0) or rotations (1) were that were seen: of readings that were fitted, and of others that were left
    /// out and count as far as they are no wrong ones but of a tail that the errors have. Returns the share of the former that lies in regions of
    /// 95 % as computed.
    fn seen(
        &mut self,
        part: usize,
        kept: &[PredictedSquares<'_>],
        left_out: &[PredictedSquares<'_>],
    ) -> Option<f64> {
        let squares = |all: &[PredictedSquares<'_>]| -> Vec<f64> {
            all.iter().filter_map(|each| each.squares[part]).collect()
        };
        let kept_squares = squares(kept);
        if kept_squares.is_empty() {
            return None;
        }
        let count = kept_squares.len();
        let within = kept_squares.iter().filter(|each| **each <= SQUARE_95);
        let share = Some(within.count() as f64 / count as f64);
        if count < SCALED_FROM {
            return share;
        }
        let of_tail = shares_of_tail(&kept_squares, &squares(left_out));
        let has_part = |each: &&PredictedSquares<'_>| each.squares[part].is_some();
        let (sure, doubtful): (Vec<_>, Vec<_>) =
            (kept.iter().filter(has_part).zip(vec![1.0; count]))
                .chain(left_out.iter().filter(has_part).zip(of_tail))
                .map(|(each, share)| (each.angles, each.squares[part].unwrap_or_default(), share))
                .partition(|(.., share)| *share > LIKELIER);
        let mut all: Vec<[f64; 2]> = (sure.iter().zip(self.spread(part, &sure)))
            .map(|((_, square, share), factor)| [square / factor, *share])
            .collect();
        all.extend(
            doubtful
                .iter()
                .map(|(angles, square, share)| [square / self.relative_at(part, angles), *share]),
        );
        self.scale[part] = quantile_95(all) / SQUARE_95;
        share
    }

    /// How errors are spread over joint space: by how much larger squares are where each is, as the others have it.
    fn spread(&mut self, part: usize, all: &[(&[f64], f64, f64)]) -> Vec<f64> {
        let angles: Vec<&[f64]> = all.iter().map(|each| each.0).collect();
        let squares: Vec<f64> = all.iter().map(|each| each.1).collect();
        let ranges: Vec<[f64; 2]> = (self.joints.iter())
            .map(|each| each.process.range())
            .collect();
        let Some(spread) = ErrorSpread::of_means(&squares, &angles, &ranges) else {
            return vec![1.0; all.len()];
        };
        for (joint, coefficients) in self.joints.iter_mut().zip(spread.of_joints) {
            joint.spread[part] = coefficients;
        }
        spread.by_others.into_iter().map(f64::exp).collect()
    }

    /// The same at the angles (of these joints) of one that is none of them.
    fn relative_at(&self, part: usize, angles: &[f64]) -> f64 {
        let joints = self.joints.iter().zip(angles);
        let logarithm: f64 = joints
            .map(|(joint, &angle)| joint.spread_at(part, angle))
            .sum();
        logarithm.exp()
    }
}

/// What a new square stays below with a probability of 95 %, as squares say that count by shares: of n that count fully, the one with
/// the rank 0.95 (n + 1). Of few, the share that stays below it is uncertain, beta distributed: then a larger one, so that it is seldom much
/// smaller; the largest that counts fully where that is beyond all.
fn quantile_95(mut squares: Vec<[f64; 2]>) -> f64 {
    squares.sort_by(|one, other| one[0].total_cmp(&other[0]));
    let all = squares.iter().map(|each| each[1]).sum::<f64>();
    let is_enough = |below: f64| {
        let held = Beta::new(below, all + 1.0 - below);
        below >= 0.95 * (all + 1.0) && held.is_ok_and(|held| held.cdf(LEAST_HELD) <= SELDOM)
    };
    let mut below = 0.0;
    let found = squares.iter().find(|[_, share]| {
        below += share;
        is_enough(below)
    });
    let largest = || squares.iter().rfind(|[_, share]| *share >= 1.0);
    found.or_else(largest).map_or(SQUARE_95, |each| each[0])
}

impl MixedVariances {
    /// Of a wave: all of one joint have one.
    fn of_wave(&self, wave: usize) -> f64 {
        self.waves[wave / (2 * HIDDEN_WAVES)]
    }

    /// The largest change of a deviation that matters, as a share of it.
    fn change_from(&self, other: &Self) -> f64 {
        let rest = self.rest.iter().zip(&other.rest);
        let joints = self.joints.iter().zip(&other.joints);
        let waves = self.waves.iter().zip(&other.waves);
        rest.chain(joints)
            .chain(waves)
            .filter(|(one, _)| **one > 10.0 * LEAST)
            .map(|(one, other)| ((one / other).sqrt() - 1.0).abs())
            .fold(0.0, f64::max)
    }
}

impl StandEquations {
    fn mean(&self, solved: &MixedSolution) -> DVector<f64> {
        DVector::from_iterator(
            self.index.len(),
            self.index.iter().map(|&at| solved.mean[at]),
        )
    }

    /// The covariance of what is predicted.
    fn known(&self, solved: &MixedSolution) -> DMatrix<f64> {
        let index = &self.index;
        let among = DMatrix::from_fn(index.len(), index.len(), |row, column| {
            solved.covariance[(index[row], index[column])]
        });
        &self.matrix * among * self.matrix.transpose()
    }
}

impl ReadingStand {
    /// What is determined of the parameters (m x r), weighed as it was fitted.
    fn weighed(&self) -> Option<DMatrix<f64>> {
        let mut by = self.own.clone();
        self.add_shared(&mut by, self.assumed);
        Some(Cholesky::new(by)?.solve(&self.fixed))
    }

    /// Adds what is new at the stand: variances of positions and rotations.
    fn add_shared(&self, covariance: &mut DMatrix<f64>, variances: [f64; 2]) {
        for (row, one) in self.coordinates.iter().enumerate() {
            for (column, other) in self.coordinates.iter().enumerate() {
                if one == other {
                    covariance[(row, column)] += variances[one / 3];
                }
            }
        }
    }

    fn local(&self, variances: &MixedVariances, offsets: &[usize]) -> StandEquations {
        let fixed = self.fixed.ncols();
        let mut index: Vec<usize> = (0..fixed).collect();
        let mut matrix = self
            .fixed
            .clone()
            .resize_horizontally(fixed + 2 * self.angles.len() + self.waves.ncols(), 0.0);
        let mut covariance = self.own.clone();
        self.add_shared(&mut covariance, variances.rest);
        let mut spare = Vec::new();
        for (joint, process) in variances.process.iter().enumerate() {
            let between = process.between(self.angles[joint]);
            let moved = self.joints.column(joint);
            for (knot, weight) in between.knots.into_iter().zip(between.weights) {
                matrix.column_mut(index.len()).copy_from(&(moved * weight));
                index.push(offsets[joint] + knot);
            }
            let own = variances.joints[joint] * between.spare;
            covariance.ger(own, &moved, &moved, 1.0);
            spare.push(between.spare);
        }
        let first = offsets[variances.process.len()];
        for (wave, moved) in self.waves.column_iter().enumerate() {
            matrix.column_mut(index.len()).copy_from(&moved);
            index.push(first + wave);
        }
        StandEquations {
            index,
            matrix,
            covariance,
            spare,
        }
    }

    fn improve(
        &self,
        local: &StandEquations,
        solved: &MixedSolution,
        sum: &mut VarianceImprovement,
    ) -> Option<()> {
        let weight = Cholesky::new(local.covariance.clone())?.inverse();
        let left = &weight * (&self.residual - &local.matrix * local.mean(solved));
        let projected = &weight - &weight * local.known(solved) * &weight;
        for coordinate in 0..6 {
            let rows: Vec<usize> = (self.coordinates.iter().enumerate())
                .filter(|(_, each)| **each == coordinate)
                .map(|(row, _)| row)
                .collect();
            let part = &mut sum.rest[coordinate / 3];
            part[0] += rows.iter().map(|&row| left[row]).sum::<f64>().powi(2);
            for &row in &rows {
                part[1] += rows
                    .iter()
                    .map(|&other| projected[(row, other)])
                    .sum::<f64>();
            }
        }
        for (joint, part) in sum.joints.iter_mut().enumerate() {
            let moved = self.joints.column(joint);
            part[0] += local.spare[joint] * moved.dot(&left).powi(2);
            part[1] += local.spare[joint] * moved.dot(&(&projected * moved));
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 998 squares the 950th, of 60 the last but one, since 58 hold less than 92 % of others with a probability of 13 %; one that hardly
    /// counts is none of them.
    #[test]
    fn quantiles_of_few_are_larger_ones() {
        let squares = |count: i32| (1..=count).map(|each| [f64::from(each), 1.0]).collect();
        for (count, expected) in [(998, 950.0), (250, 239.0), (60, 59.0), (40, 40.0)] {
            let mut all: Vec<[f64; 2]> = squares(count);
            assert!((quantile_95(all.clone()) - expected).abs() < 0.5, "{count}");
            all.push([1e6, 1e-3]);
            assert!((quantile_95(all) - expected).abs() < 0.5, "{count}");
        }
    }
}
