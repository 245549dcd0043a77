//! Wrong readings: fits without what lies far out, until the same lies far out.
//!
//! The yardstick is the median of the squares that are left, which half of the readings being wrong does not spoil, so that a
//! few readings that are wrong by much, all to one side too, hide neither themselves nor others. Readings within five
//! standard deviations count fully, those beyond not at all.

use nalgebra::Matrix6;

use super::{AbsoluteCase, Misfit, ReadingResidual};

/// Beyond so many standard deviations no correct reading lies: the probability is 5.7e-7, one in 1.7 million.
pub const FAR_OUT: f64 = 5.0;
/// The square of three coordinates that is as improbable.
const FAR_SQUARE: f64 = 31.812_3;
/// Half of the squares of three coordinates lie below.
const MEDIAN_SQUARE: f64 = 2.365_973_884_375_34;
/// Fits that are made; the first few leave out nearly all.
pub(super) const ROUNDS: usize = 12;
/// A larger share of readings is not wrong: the model is.
const MOST: f64 = 0.25;

/// A reading that was left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RejectedReading {
    /// Its index, from 0.
    pub reading: usize,
    /// How far out it lies: standard deviations of one coordinate with that probability.
    pub deviations: f64,
}

impl AbsoluteCase<'_> {
    /// The readings that lie far out of what a fit leaves of all; `spare` as in [`Misfit::of`]. None where so many do that
    /// nothing can be said of single ones.
    pub(super) fn far_out(
        &self,
        left: &[ReadingResidual],
        spare: f64,
    ) -> Option<Vec<RejectedReading>> {
        let misfit = robust_misfit(left, &self.covariances, spare).covariance();
        let found: Vec<RejectedReading> = (left.iter().zip(&self.covariances).enumerate())
            .filter_map(|(reading, (left, own))| {
                let square = largest_square(left, &(own + misfit));
                (square > FAR_SQUARE).then(|| RejectedReading {
                    reading,
                    deviations: FAR_OUT * (square / FAR_SQUARE).sqrt(),
                })
            })
            .collect();
        (found.len() as f64 <= MOST * left.len() as f64).then_some(found)
    }

    /// The same case without some of its readings.
    pub(super) fn without(&self, rejected: &[RejectedReading]) -> Self {
        let mut place = vec![None; self.observations.len()];
        let mut case = self.clone();
        case.observations.clear();
        case.covariances.clear();
        for (index, place) in place.iter_mut().enumerate() {
            if rejected.iter().all(|each| each.reading != index) {
                *place = Some(case.observations.len());
                case.observations.push(self.observations[index].clone());
                case.covariances.push(self.covariances[index]);
            }
        }
        case.stands = (self.stands.iter())
            .map(|stand| stand.iter().filter_map(|&index| place[index]).collect())
            .filter(|stand: &Vec<usize>| !stand.is_empty())
            .collect();
        case
    }
}

/// What is unexplained of most readings.
fn robust_misfit(left: &[ReadingResidual], own: &[Matrix6<f64>], spare: f64) -> Misfit {
    let positions = left.iter().map(|each| each.position_m.norm_squared());
    let rotations = left
        .iter()
        .filter_map(|each| Some(each.rotation_rad?.norm_squared()));
    let of = |squares: Vec<f64>, first: usize| {
        let own = own
            .iter()
            .map(|covariance| (covariance.fixed_view::<3, 3>(first, first).trace()) / 3.0);
        let all = median(squares).unwrap_or(0.0) / MEDIAN_SQUARE;
        (all / spare - median(own.collect()).unwrap_or(0.0))
            .max(0.0)
            .sqrt()
    };
    Misfit {
        position_m: of(positions.collect(), 0),
        rotation_rad: of(rotations.collect(), 3),
    }
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Of position and rotation, each over its covariance, the larger square.
fn largest_square(left: &ReadingResidual, covariance: &Matrix6<f64>) -> f64 {
    let square = |vector: nalgebra::Vector3<f64>, first: usize| {
        let own = covariance.fixed_view::<3, 3>(first, first).into_owned();
        own.cholesky()
            .map_or(0.0, |factor| vector.dot(&factor.solve(&vector)))
    };
    let rotation = left.rotation_rad.map_or(0.0, |vector| square(vector, 3));
    square(left.position_m, 0).max(rotation)
}
