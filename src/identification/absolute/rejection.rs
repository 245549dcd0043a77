//! Absolute readings that lie far out.

use nalgebra::{Matrix6, Vector3};

use super::super::gauss_newton::ParameterFit;
use super::super::rejection;
use super::{AbsoluteCase, AbsoluteFit, ReadingResidual, RejectedReading};

impl AbsoluteCase<'_> {
    /// The readings that lie far out of what a fit leaves of all.
    pub(super) fn far_out(&self, fit: &ParameterFit) -> Option<Vec<RejectedReading>> {
        let left = self.left(&fit.belief).ok()?;
        // Of readings enough for a fit with frames their number makes next to no difference.
        let spare = (fit.spare(), f64::INFINITY);
        rejection::far_out(&left, &self.covariances, spare, |reading, all| {
            largest_square(&left[reading], all)
        })
    }

    /// The same case with the readings that were fitted alone.
    #[must_use]
    pub fn kept(&self, fit: &AbsoluteFit) -> Self {
        self.without(&fit.rejected)
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

/// Of position and rotation, each over its covariance, the larger square.
fn largest_square(left: &ReadingResidual, covariance: &Matrix6<f64>) -> f64 {
    let square = |vector: Vector3<f64>, first: usize| {
        let own = covariance.fixed_view::<3, 3>(first, first).into_owned();
        own.cholesky()
            .map_or(0.0, |factor| vector.dot(&factor.solve(&vector)))
    };
    let rotation = left.rotation_rad.map_or(0.0, |vector| square(vector, 3));
    square(left.position_m, 0).max(rotation)
}
