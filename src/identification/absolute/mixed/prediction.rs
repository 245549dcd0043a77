//! Prediction regions of a mixed model: how large the errors of readings are that were not fitted.

use nalgebra::{DMatrix, stack};
use rayon::prelude::*;
use statrs::distribution::{Beta, ContinuousCDF};

use super::super::super::spread::ErrorSpread;
use super::super::super::tails::shares_of_tail;
use super::super::joint_errors::{DiscrepancyModel, JointError, SQUARE_95, region_square};
use super::{MixedModel, MixedSolution, MixedVariances, PoseReadings};

/// From so many readings on, regions are scaled by quantiles of what was seen: of 19 the largest stays above 95 % of further ones in the mean,
const SCALED_FROM: usize = 19;
/// and from so many on errors are spread over joint space.
const SPREAD_FROM: usize = 40;
/// Parts of the poses, each predicted by a fit to the others: so many where that takes no more than the fits of so many, and at least two.
const PARTS: usize = 10;
const POSES_OF_PARTS: usize = 1000;
/// A reading that was left out says how large errors are where it stands, if it is likelier one of them than a wrong one.
const LIKELIER: f64 = 0.5;
/// Regions of 95 % hold less than this share with no more than this probability.
const LEAST_HELD: f64 = 0.92;
const SELDOM: f64 = 0.1;

impl MixedModel {
    /// What the likeliest variances say, of some readings that were left out, too; and the shares of readings, and of rotations, that lie in
    /// their regions of 95 % as computed, each predicted by a fit to the others. None where the numbers have no factorisation.
    pub fn fit(&self, left_out: &[PoseReadings]) -> Option<(DiscrepancyModel, [Option<f64>; 2])> {
        let (variances, solved) = self.likeliest()?;
        let mut model = self.model(&variances, &solved);
        let kept = self.squares_by_others();
        let left_out: Vec<PredictedSquares<'_>> = (left_out.iter())
            .flat_map(|visit| self.squares_at(visit, &variances, &solved))
            .collect();
        let predicted_by_others = [0, 1].map(|part| model.seen(part, &kept, &left_out));
        Some((model, predicted_by_others))
    }

    /// What the likeliest variances say, and these.
    pub fn likeliest_model(&self) -> Option<(DiscrepancyModel, MixedVariances)> {
        let (variances, solved) = self.likeliest()?;
        Some((self.model(&variances, &solved), variances))
    }

    pub(super) fn model(
        &self,
        variances: &MixedVariances,
        solved: &MixedSolution,
    ) -> DiscrepancyModel {
        let offsets = self.offsets(variances);
        let fixed = self.units.ncols();
        let knots = solved.mean.len() - fixed;
        let units = stack![self.units, 0; 0, DMatrix::identity(knots, knots)];
        let joints = variances.process.iter().enumerate();
        let mut coordinates = self.visits.iter().flat_map(|visit| &visit.coordinates);
        let has_rotations = coordinates.any(|coordinate| *coordinate >= 3);
        DiscrepancyModel {
            joints: joints
                .map(|(joint, process)| JointError {
                    joint: self.joints[joint],
                    turn_about: self.turn_about[joint],
                    values: solved.mean.as_slice()[offsets[joint]..offsets[joint + 1]].to_vec(),
                    process: process.clone(),
                    deviation: variances.all[2 + joint].sqrt(),
                    repeatability: variances.all[variances.returns() + joint].sqrt(),
                    spread_of_positions: Vec::new(),
                    spread_of_rotations: Vec::new(),
                })
                .collect(),
            shift: &self.units * solved.mean.rows(0, fixed),
            covariance: &units * &solved.covariance * units.transpose(),
            rest: [0, 1].map(|part| {
                let is_read = part == 0 || has_rotations;
                let variance = variances.of_unread(part) + self.within[part];
                if is_read { variance.sqrt() } else { 0.0 }
            }),
            scale: [1.0; 2],
        }
    }

    /// The squares of position and rotation of each reading over their covariance, predicted by poses that its own was not among, variances
    /// and knots, too: those are chosen so that they suit what was fitted, at the angles where that stood.
    fn squares_by_others(&self) -> Vec<PredictedSquares<'_>> {
        let parts = (POSES_OF_PARTS / self.visits.len().max(1)).clamp(2, PARTS);
        let each = (0..parts).into_par_iter().map(|part| {
            let others = self.of_visits(|number| number % parts != part);
            let (variances, solved) = others.likeliest()?;
            let own = self.visits.iter().skip(part).step_by(parts);
            let squares = own.flat_map(|pose| {
                means_over_visits(pose, others.squares_at(pose, &variances, &solved))
            });
            Some(squares.collect::<Vec<_>>())
        });
        let all: Vec<Option<Vec<_>>> = each.collect();
        all.into_iter().flatten().flatten().collect()
    }

    /// The same of a visit that was not fitted.
    fn squares_at<'a>(
        &self,
        visit: &'a PoseReadings,
        variances: &MixedVariances,
        solved: &MixedSolution,
    ) -> Vec<PredictedSquares<'a>> {
        let offsets = self.offsets(variances);
        let local = visit.local(variances);
        let by_dense = solved.of_dense(std::slice::from_ref(visit), offsets[0]);
        let (left, known) = visit.beside_known(&local, &offsets, solved, &by_dense);
        let covariance = local.covariance + known;
        let firsts = (visit.coordinates.iter().enumerate()).filter(|(_, each)| **each == 0);
        firsts
            .map(|(at, _)| {
                let next = visit.coordinates[at..].iter().skip(1);
                let rows = 1 + next.take_while(|each| **each > 0).count();
                let left = left.rows(at, rows).into_owned();
                let covariance = covariance.view((at, at), (rows, rows)).into_owned();
                PredictedSquares {
                    angles: &visit.angles,
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

/// The means of what readings of a pose have over its visits, reading by reading: errors of a pose come again with each.
fn means_over_visits<'a>(
    pose: &PoseReadings,
    mut squares: Vec<PredictedSquares<'a>>,
) -> Vec<PredictedSquares<'a>> {
    let visits = pose.visits.last().map_or(1, |last| last + 1);
    if visits == 1 || !squares.len().is_multiple_of(visits) {
        return squares;
    }
    let others = squares.split_off(squares.len() / visits);
    let count = squares.len();
    for (place, each) in squares.iter_mut().enumerate() {
        for part in 0..2 {
            let alike = others.iter().skip(place).step_by(count);
            let sum = alike.fold(each.squares[part], |sum, other| {
                Some(sum? + other.squares[part]?)
            });
            each.squares[part] = sum.map(|sum| sum / visits as f64);
        }
    }
    squares
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
            // So few poses, of many visits: as of few readings that count fully.
            let largest = kept_squares.iter().copied().fold(SQUARE_95, f64::max);
            self.scale[part] = largest / SQUARE_95;
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
        all.extend(doubtful.iter().map(|(angles, square, share)| {
            let relative = self.relative_at(part, angles.iter().copied());
            [square / relative, *share]
        }));
        self.scale[part] = quantile_95(all) / SQUARE_95;
        share
    }

    /// How errors are spread over joint space: by how much larger squares are where each is, as the others have it.
    fn spread(&mut self, part: usize, all: &[(&[f64], f64, f64)]) -> Vec<f64> {
        if all.len() < SPREAD_FROM {
            return vec![1.0; all.len()];
        }
        let angles: Vec<&[f64]> = all.iter().map(|each| each.0).collect();
        let squares: Vec<f64> = all.iter().map(|each| each.1).collect();
        let ranges: Vec<[f64; 2]> = (self.joints.iter())
            .map(|each| each.process.range())
            .collect();
        let Some(spread) = ErrorSpread::of_means(&squares, &angles, &ranges) else {
            return vec![1.0; all.len()];
        };
        for (joint, coefficients) in self.joints.iter_mut().zip(spread.of_joints) {
            *[
                &mut joint.spread_of_positions,
                &mut joint.spread_of_rotations,
            ][part] = coefficients;
        }
        spread.by_others.into_iter().map(f64::exp).collect()
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
