//! Variance components of residuals: restricted maximum likelihood (REML) for a linear mixed model with random effects.
//!
//! Parameters (with their priors) are fixed effects, the joints' errors at their knots and what is new at each visit are random
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

mod components;
mod known;
mod pose_readings;
mod prediction;
mod standard_errors;

use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector, RowDVector, UnitQuaternion, stack};
use rayon::prelude::*;

use super::residuals::LinearReading;
use super::{AbsoluteCase, DiscrepancyModel};
use crate::numeric::factorisation::inverse_of;
use crate::numeric::markov::{Kernel, KnotBlocks, MarkovProcess, knots_among};
use crate::numeric::posterior::Posterior;
use crate::parameter::{ParameterKind, ParameterSet};
use crate::robot::Approach;
pub(super) use components::in_blocks;
pub use known::{ComponentIntervals, VarianceComponents};
use pose_readings::{by_pose, sums_of};

/// No joint has more knots.
const MOST_KNOTS: usize = 48;
/// Nor beside slow waves: errors that reach no further than between knots are nearly new at each visit.
const MOST_BESIDE_WAVES: usize = 16;
/// A knot is for so many visits.
const VISITS_PER_KNOT: usize = 4;
/// Improvements of the variances; later ones change intervals by a per cent.
const ROUNDS: usize = 14;
/// Of what is unexplained in a joint, what is new at each visit to start with.
const RETURNS: f64 = 0.05;
/// Deviations that change by less are found.
const FOUND: f64 = 0.02;
/// They follow from no more than so many visits, evenly among all, which determine a deviation to some 2 %.
const VISITS_OF_VARIANCES: usize = 3000;
/// The smallest variance (m^2, rad^2).
const LEAST: f64 = 1e-18;
/// Waves that come round so often in a turn, or less, hide in parameters: a gear that is not round once in a turn looks like a joint that gives way
/// to gravity. What is left tells next to nothing of them.
const HIDDEN_WAVES: usize = 3;
/// The largest variance of one of them, over that of what the joint is seen to be off by.
const LARGEST_WAVES: f64 = 4.0;
/// Pieces of sums, so that bits do not depend on threads, and the fewest visits of one.
const PIECES: usize = 8;
const LEAST_PIECE: usize = 64;
/// Knots around a turn are no nearer (rad).
const SAME: f64 = 1e-3;
/// With fewer poses that are visited again, nothing is told apart that visits share.
const FEWEST_AGAIN: usize = 5;

/// Readings at one command pose, of one visit or of several: all share what is new at a configuration, those of one visit what is new at
/// that.
#[derive(Debug, Clone)]
pub(super) struct PoseReadings {
    /// Read less predicted (m).
    residual: DVector<f64>,
    /// Derivatives by what is determined of the parameters, then by waves of those joints' errors that have them (m x (r + w)).
    dense: DMatrix<f64>,
    /// Derivatives by each joint's angle (m x k).
    joints: DMatrix<f64>,
    /// The readings' own covariance.
    own: DMatrix<f64>,
    /// Which coordinate each row is, from 0 to 5.
    coordinates: Vec<usize>,
    /// The commanded angles of the joints.
    angles: Vec<f64>,
    /// Which visit each row is of, from 0 on.
    visits: Vec<usize>,
    /// The variance of what is new at a visit that each row was weighed with.
    assumed: Vec<f64>,
    /// The command pose.
    commanded_rad: DVector<f64>,
    approach: Option<Approach>,
    /// The axes of the rows, in those of the robot's base.
    axes: UnitQuaternion<f64>,
}

/// The variances that are looked for.
#[derive(Debug, Clone, PartialEq)]
struct MixedVariances {
    /// Of what is new at visits, of positions and of rotations; of each joint's error; of the waves of each joint that has them; of what
    /// is new at configurations, of positions and of rotations, where some are visited again; of how each joint returns at each visit.
    all: Vec<f64>,
    /// Where those of configurations begin.
    of_poses: Option<usize>,
    /// How far each joint's error reaches.
    process: Vec<MarkovProcess>,
}

/// The readings with what is known before of the parameters, in the coordinates of what is determined.
#[derive(Debug, Clone)]
pub(super) struct MixedModel {
    /// Those of one command pose together; parts of a model share them.
    visits: Vec<Arc<PoseReadings>>,
    /// Precision (r x r) and its pull (r).
    prior: DMatrix<f64>,
    pull: DVector<f64>,
    /// Priors of the robot's own parameters one by one, each a row (r) whose square is its precision,
    priors: Vec<(ParameterKind, RowDVector<f64>)>,
    /// and the covariance (r x r) of all their pulls: of two series one prior pulls both alike.
    pulls: DMatrix<f64>,
    /// The joints, and how the coordinates become parameters (p x r).
    joints: Vec<usize>,
    units: DMatrix<f64>,
    /// The middle of the turn in which each joint's angle counts, if it has several.
    turn_about: Vec<Option<f64>>,
    /// Variances to start from, of positions and of rotations, that readings of one visit share,
    shared: [f64; 2],
    /// and those that they do not share.
    within: [f64; 2],
    /// No joint has more knots.
    most_knots: usize,
    /// The joints with waves, by their places among all.
    waving: Vec<usize>,
}

/// What the model says with some variances.
struct MixedSolution {
    variances: MixedVariances,
    /// Where the knots of each joint begin among all unknowns, behind the parameters and all waves, and the number of unknowns.
    offsets: Vec<usize>,
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl MixedModel {
    /// Of a case's readings, each to first order (`rows`), at a fit to them with this discrepancy.
    pub fn new(
        case: &AbsoluteCase<'_>,
        rows: &[LinearReading],
        joints: Vec<usize>,
        (set, posterior): (&ParameterSet, &Posterior),
        discrepancy: [f64; 2],
    ) -> Option<Self> {
        let values = DVector::from_column_slice(&posterior.mean);
        let known = set.prior().at(&values, set.scales().as_slice())?;
        let basis = posterior.estimable.basis();
        let prior = basis.tr_mul(&known.precision) * basis;
        let mut model = Self {
            visits: Vec::new(),
            pulls: prior.clone(),
            prior,
            priors: known_alone(set, &posterior.mean)
                .map(|(kind, place, _)| {
                    let root = known.precision[(place, place)].sqrt();
                    (kind, basis.row(place) * root)
                })
                .collect(),
            pull: -basis.tr_mul(&known.pull),
            turn_about: (joints.iter())
                .map(|&joint| case.arm.chain.joints[joint].turn_about())
                .collect(),
            joints,
            units: posterior.estimable.basis_in_units(),
            shared: [0, 1].map(|part| discrepancy[part].powi(2) - case.within[part].powi(2)),
            within: case.within.map(|each| each * each),
            most_knots: MOST_KNOTS,
            waving: Vec::new(),
        };
        model.visits = shared(by_pose(&model.visits_of(case, rows)));
        Some(model)
    }

    /// Visits of readings at what was fitted, perhaps to others.
    pub fn visits_of(&self, case: &AbsoluteCase<'_>, rows: &[LinearReading]) -> Vec<PoseReadings> {
        let reading = |index: usize, within: [f64; 2]| {
            let (rows, setup) = (&rows[index], &case.observations[index].setup);
            let count = rows.residual.len();
            let station = case.arm.instrument_from_base[setup.station];
            let joints = &case.arm.chain.joints;
            let angle = |&joint: &usize| joints[joint].in_turn(setup.commanded_rad[joint]);
            PoseReadings {
                residual: rows.residual.clone(),
                dense: &rows.columns * &self.units,
                joints: rows.joints.clone(),
                own: &rows.own
                    + DMatrix::from_diagonal(&DVector::from_fn(count, |row, _| within[row / 3])),
                coordinates: (0..count).collect(),
                angles: self.joints.iter().map(angle).collect(),
                visits: vec![0; count],
                assumed: (0..count)
                    .map(|row| self.shared[row / 3].max(LEAST))
                    .collect(),
                commanded_rad: setup.commanded_rad.clone(),
                approach: setup.approach.clone(),
                axes: station.rotation.inverse(),
            }
        };
        let visit = |visit: &Vec<usize>| {
            let within = if visit.len() > 1 {
                self.within
            } else {
                [0.0; 2]
            };
            let readings = visit.iter().map(|&index| reading(index, within));
            readings.reduce(PoseReadings::above)
        };
        case.visits.iter().filter_map(visit).collect()
    }

    /// The same of some of the visits.
    fn of_visits(&self, is_in: impl Fn(usize) -> bool) -> Self {
        let mut model = self.clone();
        let mut numbers = 0..self.visits.len();
        model.visits.retain(|_| numbers.next().is_some_and(&is_in));
        model
    }

    /// The same of those visits that variances follow from, where these are not all.
    fn sampled(&self) -> Option<Self> {
        let count = self.visits.len();
        let is_in = |number: usize| number * VISITS_OF_VARIANCES % count < VISITS_OF_VARIANCES;
        (count > VISITS_OF_VARIANCES).then(|| self.of_visits(is_in))
    }

    /// The same with slow waves in the error of each joint that turns, as many as hide in parameters.
    pub fn with_waves(mut self, turns: &[bool]) -> Self {
        let turning: Vec<usize> = (0..turns.len()).filter(|&joint| turns[joint]).collect();
        let fixed = self.units.ncols();
        for visit in self.visits.iter_mut().map(Arc::make_mut) {
            let rows = visit.residual.len();
            let waves = turning.iter().flat_map(|&joint| {
                let (moved, angle) = (visit.joints.column(joint), visit.angles[joint]);
                (1..=HIDDEN_WAVES).flat_map(move |order| {
                    let (sine, cosine) = (order as f64 * angle).sin_cos();
                    [moved * sine, moved * cosine]
                })
            });
            let of_parameters = visit.dense.as_slice()[..rows * fixed].iter().copied();
            let waves = waves.flat_map(|column| column.data.as_vec().clone());
            let columns = fixed + 2 * HIDDEN_WAVES * turning.len();
            visit.dense = DMatrix::from_iterator(rows, columns, of_parameters.chain(waves));
        }
        self.most_knots = MOST_BESIDE_WAVES;
        self.waving = turning;
        self
    }

    /// Two series of one robot, which share the errors of its joints, what is new at configurations that both visit, and what is known
    /// before of the robot: all parameters of the one (p) above all of the other.
    pub fn beside(&self, other: &Self) -> Self {
        let (own, others) = (self.units.ncols(), other.units.ncols());
        // Where the other's parameters are among its columns, and how many.
        let wide = |visit: &PoseReadings, at: usize, count: usize| PoseReadings {
            dense: visit.dense.clone().insert_columns(at, count, 0.0),
            ..visit.clone()
        };
        let visits = self.visits.iter().map(|each| wide(each, own, others));
        let visits = visits.chain(other.visits.iter().map(|each| wide(each, 0, own)));
        let mut pulls = stack![self.pulls, 0; 0, other.pulls];
        for (kind, row) in &self.priors {
            if let Some((_, twin)) = other.priors.iter().find(|(each, _)| each == kind) {
                let common = row.tr_mul(twin);
                let mut among = pulls.view_mut((0, own), (own, others));
                among += &common;
                let mut among = pulls.view_mut((own, 0), (others, own));
                among += common.transpose();
            }
        }
        Self {
            visits: shared(by_pose(&visits.collect::<Vec<_>>())),
            prior: stack![self.prior, 0; 0, other.prior],
            pull: stack![self.pull; other.pull],
            priors: Vec::new(),
            pulls,
            joints: self.joints.clone(),
            units: stack![self.units, 0; 0, other.units],
            turn_about: self.turn_about.clone(),
            shared: [0, 1].map(|part| f64::midpoint(self.shared[part], other.shared[part])),
            within: [0, 1].map(|part| f64::midpoint(self.within[part], other.within[part])),
            most_knots: self.most_knots.min(other.most_knots),
            waving: self.waving.clone(),
        }
    }

    /// What the model says with the likeliest variances. Over a part of a turn large waves add up to next to nothing, and what hides in
    /// parameters is no reason against them: no joint's are more than twice as large as what it is seen to be off by without.
    fn likeliest(&self) -> Option<MixedSolution> {
        let mut variances = self.first();
        let most = if self.waving.is_empty() {
            Vec::new()
        } else {
            let sample = self.sampled().unwrap_or_else(|| self.clone());
            let seen = sample.with_waves(&[]).likeliest()?;
            let joints = self.waving.iter();
            joints.map(|&joint| seen.variances.all[2 + joint]).collect()
        };
        let limit = |variances: &mut MixedVariances| {
            let waves = variances.all.iter_mut().skip(2 + self.joints.len());
            for (variance, &most) in waves.zip(&most) {
                *variance = variance.min(most * LARGEST_WAVES).max(LEAST);
            }
        };
        limit(&mut variances);
        Some(self.settled(variances, limit, ROUNDS, FOUND)?.0)
    }

    /// Variances that are improved, each time within limits, so often or until their deviations change by less than this, by those visits that
    /// they follow from: what all say then, and how many numbers told each.
    fn settled(
        &self,
        variances: MixedVariances,
        limit: impl Fn(&mut MixedVariances),
        rounds: usize,
        found: f64,
    ) -> Option<(MixedSolution, Vec<f64>)> {
        if let Some(sample) = self.sampled() {
            let (settled, told) = sample.settled(variances, limit, rounds, found)?;
            return Some((self.solved(settled.variances)?, told));
        }
        let mut solved = self.solved(variances)?;
        let mut told = Vec::new();
        for _ in 0..rounds {
            let (mut next, numbers) = self.improved(&solved)?;
            limit(&mut next);
            // The largest change of a deviation that matters, as a share of it.
            let change = (next.all.iter().zip(&solved.variances.all))
                .filter(|(one, _)| **one > 10.0 * LEAST)
                .map(|(one, other)| ((one / other).sqrt() - 1.0).abs())
                .fold(0.0, f64::max);
            (solved, told) = (self.solved(next)?, numbers);
            if change < found {
                break;
            }
        }
        Some((solved, told))
    }

    /// Half of what is unexplained in the joints.
    fn first(&self) -> MixedVariances {
        let count = (self.visits.len() / VISITS_PER_KNOT).clamp(2, self.most_knots);
        let process: Vec<MarkovProcess> = (0..self.joints.len())
            .map(|joint| {
                let knots = self.distinct(joint, knots_among(&self.angles(joint), count));
                MarkovProcess {
                    kernel: Kernel::exponential(MarkovProcess::longest(&knots))
                        .again(self.period(joint)),
                    knots,
                }
            })
            .collect();
        let (mut moved, mut rows) = (0.0, 0.0);
        for visit in &self.visits {
            for (row, _) in (visit.coordinates.iter().enumerate()).filter(|(_, each)| **each < 3) {
                moved += visit.joints.row(row).norm_squared();
                rows += 1.0;
            }
        }
        let of_joints = 0.5 * self.shared[0] * rows / f64::max(moved, f64::MIN_POSITIVE);
        let visits = self.shared.map(|each| (0.5 * each).max(LEAST));
        let mut all = visits.to_vec();
        let count = all.len() + process.len() + self.waving.len();
        all.resize(count, of_joints.clamp(LEAST, 1e-4));
        let again = self.visits.iter().filter(|each| each.is_visited_again());
        let of_poses = (again.count() >= FEWEST_AGAIN).then_some(count);
        all.extend(visits.iter().filter(|_| of_poses.is_some()));
        all.resize(
            all.len() + process.len(),
            (RETURNS * of_joints).clamp(LEAST, 1e-4),
        );
        MixedVariances {
            all,
            of_poses,
            process,
        }
    }

    fn solved(&self, variances: MixedVariances) -> Option<MixedSolution> {
        let mut offsets = vec![self.units.ncols() + 2 * HIDDEN_WAVES * self.waving.len()];
        for each in &variances.process {
            offsets.push(offsets[offsets.len() - 1] + each.states());
        }
        let of_visits = |visits: &[Arc<PoseReadings>]| sums_of(visits, &variances, &offsets);
        let (mut information, mut gradient) = self.sum_of(of_visits, |sum, piece| {
            sum.0 += piece.0;
            sum.1 += piece.1;
        })?;
        information.fill_lower_triangle_with_upper_triangle();
        let fixed = self.units.ncols();
        let mut before = information.view_mut((0, 0), (fixed, fixed));
        before += &self.prior;
        let mut pull = gradient.rows_mut(0, fixed);
        pull += &self.pull;
        for (joint, process) in variances.process.iter().enumerate() {
            let (precision, _) = process.precision();
            precision.add_to(&mut information, offsets[joint], variances.all[2 + joint]);
        }
        for at in fixed..offsets[0] {
            let wave = 2 + self.joints.len() + (at - fixed) / (2 * HIDDEN_WAVES);
            information[(at, at)] += variances.all[wave].recip();
        }
        let covariance = inverse_of(&Cholesky::new(information)?);
        Some(MixedSolution {
            mean: &covariance * gradient,
            covariance,
            offsets,
            variances,
        })
    }

    /// What the likeliest variances say of all readings, and of those without each of some parts, by the same variances and knots of their own:
    /// knots suit the angles where readings stand.
    pub fn without_each(
        &self,
        parts: &[Self],
    ) -> Option<(DiscrepancyModel, Vec<DiscrepancyModel>)> {
        let solved = self.likeliest()?;
        let without = |part: usize| {
            let others = parts.iter().enumerate().filter(|(other, _)| *other != part);
            let visits = others.flat_map(|(_, other)| other.visits.iter().cloned());
            let others = Self {
                visits: visits.collect(),
                ..self.of_visits(|_| false)
            };
            let mut variances = solved.variances.clone();
            for (joint, process) in variances.process.iter_mut().enumerate() {
                let knots = knots_among(&others.angles(joint), process.knots.len());
                process.knots = self.distinct(joint, knots);
            }
            Some(others.model(&others.solved(variances)?))
        };
        let without = (0..parts.len()).into_par_iter().map(without);
        Some((self.model(&solved), without.collect::<Option<_>>()?))
    }

    /// Knots of a joint, the last of which is not the first again.
    fn distinct(&self, joint: usize, mut knots: Vec<f64>) -> Vec<f64> {
        while let (Some(period), [first, .., last]) = (self.period(joint), &*knots)
            && first + period - last < SAME
        {
            knots.pop();
        }
        knots
    }

    /// The period of a joint's error.
    fn period(&self, joint: usize) -> Option<f64> {
        self.turn_about[joint].map(|_| TAU)
    }

    fn angles(&self, joint: usize) -> Vec<f64> {
        self.visits.iter().map(|each| each.angles[joint]).collect()
    }

    /// A sum over all visits, in pieces side by side.
    fn sum_of<Sum: Send>(
        &self,
        of_visits: impl Fn(&[Arc<PoseReadings>]) -> Option<Sum> + Sync + Send,
        add: impl Fn(&mut Sum, Sum),
    ) -> Option<Sum> {
        let size = self.visits.len().div_ceil(PIECES).max(LEAST_PIECE);
        let pieces: Vec<Option<Sum>> = self.visits.par_chunks(size).map(of_visits).collect();
        let both = |sum: Option<Sum>, piece: Option<Sum>| {
            let mut sum = sum?;
            add(&mut sum, piece?);
            Some(sum)
        };
        pieces.into_iter().reduce(both)?
    }

    /// Likelier variances, and how many numbers told each of those before.
    fn improved(&self, solved: &MixedSolution) -> Option<(MixedVariances, Vec<f64>)> {
        let MixedSolution {
            variances, offsets, ..
        } = solved;
        // Numerators and denominators of what improves each variance.
        let of_visits = |visits: &[Arc<PoseReadings>]| {
            let mut sums = vec![[0.0; 2]; variances.all.len()];
            let mut at = 0;
            let known = solved.of_dense(visits);
            for visit in visits {
                let local = visit.local(variances);
                let known = known.rows(at, visit.residual.len()).into_owned();
                visit.improve(&local, solved, &known, &mut sums)?;
                at += visit.residual.len();
            }
            Some(sums)
        };
        let mut sums = self.sum_of(of_visits, |sums, piece| {
            for (sum, [square, trace]) in sums.iter_mut().zip(piece) {
                *sum = [sum[0] + square, sum[1] + trace];
            }
        })?;
        let mut next = variances.clone();
        for (joint, process) in variances.process.iter().enumerate() {
            let (at, count) = (offsets[joint], process.states());
            let variance = variances.all[2 + joint];
            let neighbours = |of: &dyn Fn(usize, usize) -> f64| {
                let (order, knots) = (process.kernel.order(), process.knots.len());
                KnotBlocks::of(order, knots, |one, other| of(at + one, at + other))
            };
            let values = neighbours(&|one, other| solved.mean[one] * solved.mean[other]);
            let covariance = neighbours(&|one, other| solved.covariance[(one, other)]);
            let (precision, _) = process.precision();
            let known = precision.product_trace(&covariance) / variance;
            let sum = &mut sums[2 + joint];
            sum[0] += precision.product_trace(&values) / (variance * variance);
            sum[1] += (count as f64 - known).max(0.0) / variance;
            let expected = neighbours(&|one, other| {
                solved.mean[one] * solved.mean[other] + solved.covariance[(one, other)]
            });
            next.process[joint].kernel.length = process.likeliest_length(&expected);
        }
        for joint in 0..self.waving.len() {
            let count = 2 * HIDDEN_WAVES;
            let at = self.units.ncols() + joint * count;
            let place = 2 + self.joints.len() + joint;
            let variance = variances.all[place];
            let own = solved.covariance.view((at, at), (count, count)).trace();
            sums[place] = [
                solved.mean.rows(at, count).norm_squared() / (variance * variance),
                (count as f64 - own / variance).max(0.0) / variance,
            ];
        }
        let mut told = Vec::new();
        for (variance, [square, trace]) in next.all.iter_mut().zip(sums) {
            told.push(*variance * trace);
            let ratio = if trace > 0.0 { square / trace } else { 1.0 };
            *variance = (*variance * ratio.max(0.0).sqrt()).max(LEAST);
        }
        Some((next, told))
    }
}

impl MixedVariances {
    /// Where those of joint repeatability begin.
    fn returns(&self) -> usize {
        self.all.len() - self.process.len()
    }

    /// Of what is new where no reading is: of a visit, and of its configuration.
    fn of_unread(&self, part: usize) -> f64 {
        self.all[part] + self.of_poses.map_or(0.0, |first| self.all[first + part])
    }
}

fn shared(visits: Vec<PoseReadings>) -> Vec<Arc<PoseReadings>> {
    visits.into_iter().map(Arc::new).collect()
}

/// The robot's own parameters that are known before, apart from all others: places and precisions where they have these values (p).
pub(super) fn known_alone(
    set: &ParameterSet,
    values: &[f64],
) -> impl Iterator<Item = (ParameterKind, usize, f64)> {
    let precision = &set.prior().precision;
    let all = set.parameters().iter().enumerate();
    all.filter_map(|(place, each)| {
        let own = set.prior().own_at(place, values[place]);
        let column = precision.column(place);
        let is_alone = column.iter().filter(|each| **each != 0.0).count() == 1;
        (!each.kind.is_mounted() && is_alone && own > 0.0).then_some((each.kind, place, own))
    })
}
