//! Prediction regions of a mixed model: how large the errors of readings are that were not fitted.

use nalgebra::stack;
use rayon::prelude::*;
use statrs::distribution::{Beta, ContinuousCDF};

use super::super::super::spread::ErrorSpread;
use super::super::super::tails::shares_of_tail;
use super::super::joint_errors::{DiscrepancyModel, JointError, SQUARE_95, region_square};
use super::{MixedModel, MixedSolution, MixedVariances, PoseReadings};

/// From so many poses on, regions are scaled by quantiles of what was seen: of 19 the largest stays above 95 % of further ones in the mean,
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
        let solved = self.likeliest()?;
        let mut model = self.model(&solved);
        let kept = self.squares_by_others();
        let left_out: Vec<_> = (left_out.iter())
            .map(|pose| solved.squares_at(pose))
            .collect();
        let predicted_by_others = [0, 1].map(|part| {
            let [kept, left_out]: [Vec<_>; 2] = [&kept, &left_out]
                .map(|all| all.iter().filter_map(|pose| pose[part].clone()).collect());
            model.seen(part, kept, &left_out)
        });
        Some((model, predicted_by_others))
    }

    pub(super) fn model(&self, solved: &MixedSolution) -> DiscrepancyModel {
        let MixedSolution {
            variances, offsets, ..
        } = solved;
        let fixed = self.units.ncols();
        let knots = solved.mean.len() - fixed;
        let among = |from: (usize, usize), size: (usize, usize)| solved.covariance.view(from, size);
        let own = &self.units * among((0, 0), (fixed, fixed)) * self.units.transpose();
        let crossed = &self.units * among((0, fixed), (fixed, knots));
        let of_knots = among((fixed, fixed), (knots, knots)).into_owned();
        let joints = variances.process.iter().enumerate();
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
            covariance: stack![own, crossed; crossed.transpose(), of_knots],
            rest: self.rest_by(variances),
            scale: [1.0; 2],
            mean_scale: [1.0; 2],
        }
    }

    /// The standard deviations of what is new where no reading is, of positions (m) and rotations (rad).
    fn rest_by(&self, variances: &MixedVariances) -> [f64; 2] {
        let mut coordinates = self.visits.iter().flat_map(|visit| &visit.coordinates);
        let has_rotations = coordinates.any(|coordinate| *coordinate >= 3);
        [0, 1].map(|part| {
            let is_read = part == 0 || has_rotations;
            let variance = variances.of_unread(part) + self.within[part];
            if is_read { variance.sqrt() } else { 0.0 }
        })
    }

    /// The squares of position and rotation of each reading over their covariance, predicted by poses that its own was not among, variances
    /// and knots, too: those are chosen so that they suit what was fitted, at the angles where that stood.
    fn squares_by_others(&self) -> Vec<[Option<PoseSquares<'_>>; 2]> {
        let parts = (POSES_OF_PARTS / self.visits.len().max(1)).clamp(2, PARTS);
        let each = (0..parts).into_par_iter().map(|part| {
            let others = self.of_visits(|number| number % parts != part);
            let solved = others.likeliest()?;
            let own = self.visits.iter().skip(part).step_by(parts);
            let squares = own.map(|pose| solved.squares_at(pose));
            Some(squares.collect::<Vec<_>>())
        });
        let all: Vec<Option<Vec<_>>> = each.collect();
        all.into_iter().flatten().flatten().collect()
    }
}

impl MixedSolution {
    /// The squares of position and rotation over their covariance, of each reading of a pose that was not fitted.
    fn squares_at<'a>(&self, visit: &'a PoseReadings) -> [Option<PoseSquares<'a>>; 2] {
        let local = visit.local(&self.variances);
        let by_dense = self.of_dense(std::slice::from_ref(visit));
        let (left, known) = visit.beside_known(&local, self, &by_dense);
        let covariance = local.covariance + known;
        let firsts = (visit.coordinates.iter().enumerate()).filter(|(_, each)| **each == 0);
        let squares = firsts.map(|(at, _)| {
            let next = visit.coordinates[at..].iter().skip(1);
            let rows = 1 + next.take_while(|each| **each > 0).count();
            let left = left.rows(at, rows).into_owned();
            let covariance = covariance.view((at, at), (rows, rows)).into_owned();
            [0, 3].map(|first| region_square(&left, &covariance, first))
        });
        let squares: Vec<[Option<f64>; 2]> = squares.collect();
        [0, 1].map(|part| {
            let squares: Vec<f64> = squares.iter().filter_map(|each| each[part]).collect();
            (!squares.is_empty()).then(|| PoseSquares {
                angles: &visit.angles,
                weight: 1.0 / squares.len() as f64,
                squares,
                is_kept: true,
            })
        })
    }
}

/// The squares of a pose's readings, of positions or of rotations, over the covariance of what was predicted for them.
#[derive(Clone)]
struct PoseSquares<'a> {
    /// The commanded angles of the joints.
    angles: &'a [f64],
    /// Of each reading of each visit.
    squares: Vec<f64>,
    /// Of how many poses each tells.
    weight: f64,
    /// Whether they were fitted.
    is_kept: bool,
}

impl PoseSquares<'_> {
    fn mean(&self) -> f64 {
        self.squares.iter().sum::<f64>() / self.squares.len() as f64
    }
}

/// A square relative to what is expected where it is.
struct RelativeSquare {
    square: f64,
    /// Of how many poses it tells.
    weight: f64,
    /// Whether it was fitted.
    is_kept: bool,
}

impl DiscrepancyModel {
    /// Takes over how large errors of positions (0) or rotations (1) were that were seen: of readings that were fitted, and of others that were left
    /// out and count as far as they are no wrong ones but of a tail that the errors have. All readings of a pose count as one together: their
    /// errors are alike. Returns the share of the former that lies in regions of 95 % as computed.
    fn seen<'a>(
        &mut self,
        part: usize,
        mut poses: Vec<PoseSquares<'a>>,
        left_out: &[PoseSquares<'a>],
    ) -> Option<f64> {
        let squares: Vec<f64> = poses
            .iter()
            .flat_map(|pose| &pose.squares)
            .copied()
            .collect();
        if squares.is_empty() {
            return None;
        }
        let within = squares.iter().filter(|each| **each <= SQUARE_95);
        let share = Some(within.count() as f64 / squares.len() as f64);
        let count = poses.len() as f64;
        let means = poses.iter().map(PoseSquares::mean).sum::<f64>();
        self.mean_scale[part] = means / (3.0 * count);
        if poses.len() < SCALED_FROM {
            let largest = squares.iter().copied().fold(SQUARE_95, f64::max);
            self.scale[part] = largest / SQUARE_95;
            return share;
        }
        let each = left_out.iter();
        let each = each.flat_map(|pose| pose.squares.iter().map(|square| (pose.angles, *square)));
        let each: Vec<(&[f64], f64)> = each.collect();
        let others: Vec<f64> = each.iter().map(|(_, square)| *square).collect();
        let mut doubtful = Vec::new();
        for ((angles, square), share) in each.iter().zip(shares_of_tail(&squares, &others)) {
            let to = if share > LIKELIER {
                &mut poses
            } else {
                &mut doubtful
            };
            to.push(PoseSquares {
                angles,
                squares: vec![*square],
                weight: share * count / squares.len() as f64,
                is_kept: false,
            });
        }
        let mut factors = self.spread(part, &poses);
        let at = |pose: &PoseSquares<'_>| self.relative_at(part, pose.angles.iter().copied());
        factors.extend(doubtful.iter().map(at));
        let all = poses.iter().chain(&doubtful).zip(factors);
        let relative = all.flat_map(|(pose, factor)| {
            pose.squares.iter().map(move |square| RelativeSquare {
                square: square / factor,
                weight: pose.weight,
                is_kept: pose.is_kept,
            })
        });
        let relative: Vec<RelativeSquare> = relative.collect();
        let all = relative.iter().map(|each| each.weight).sum::<f64>();
        let whole = relative.iter().map(|each| each.weight * each.square);
        self.mean_scale[part] = whole.sum::<f64>() / (3.0 * all);
        self.scale[part] = quantile_95(relative) / SQUARE_95;
        share
    }

    /// How errors are spread over joint space: by how much larger squares are where each is, as the others have it.
    fn spread(&mut self, part: usize, all: &[PoseSquares<'_>]) -> Vec<f64> {
        if all.len() < SPREAD_FROM {
            return vec![1.0; all.len()];
        }
        let means = all.iter().map(|pose| (pose.angles, pose.mean()));
        let (angles, squares): (Vec<&[f64]>, Vec<f64>) = means.unzip();
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

/// What a new square stays below with a probability of 95 %, as squares say that have weights: of n that count fully, the one with
/// the rank 0.95 (n + 1). Of few, the share that stays below it is uncertain, beta distributed: then a larger one, so that it is seldom much
/// smaller; the largest that was fitted where that is beyond all.
fn quantile_95(mut squares: Vec<RelativeSquare>) -> f64 {
    squares.sort_by(|one, other| one.square.total_cmp(&other.square));
    let all = squares.iter().map(|each| each.weight).sum::<f64>();
    let is_enough = |below: f64| {
        let held = Beta::new(below, all + 1.0 - below);
        below >= 0.95 * (all + 1.0) && held.is_ok_and(|held| held.cdf(LEAST_HELD) <= SELDOM)
    };
    let mut below = 0.0;
    let found = squares.iter().find(|each| {
        below += each.weight;
        is_enough(below)
    });
    let largest = || squares.iter().rfind(|each| each.is_kept);
    found.or_else(largest).map_or(SQUARE_95, |each| each.square)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 998 squares the 950th, of 60 the last but one, since 58 hold less than 92 % of others with a probability of 13 %; one that hardly
    /// counts is none of them. Where each pose has five readings, these are those of so many poses.
    #[test]
    fn quantiles_of_few_are_larger_ones() {
        let square = |square: f64, weight: f64| RelativeSquare {
            square,
            weight,
            is_kept: weight > 1e-2,
        };
        let squares = |count: i32, readings: i32| -> Vec<RelativeSquare> {
            (1..=count * readings)
                .map(|each| {
                    square(
                        f64::from(each) / f64::from(readings),
                        1.0 / f64::from(readings),
                    )
                })
                .collect()
        };
        for (count, expected) in [(998, 950.0), (250, 239.0), (60, 59.0), (40, 40.0)] {
            assert!(
                (quantile_95(squares(count, 1)) - expected).abs() < 0.5,
                "{count}"
            );
            assert!(
                (quantile_95(squares(count, 5)) - expected).abs() < 1.0,
                "{count}"
            );
            let mut all = squares(count, 1);
            all.push(square(1e6, 1e-3));
            assert!((quantile_95(all) - expected).abs() < 0.5, "{count}");
        }
    }
}
