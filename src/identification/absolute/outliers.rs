//! Outliers among absolute readings.

use nalgebra::{Matrix6, Vector3};

use super::super::gauss_newton::{ParameterFit, fit_for_weights};
use super::super::outliers::{self, LookedOver, squares_of};
use super::case::whitener;
use super::{AbsoluteCase, Discrepancy, ReadingResidual, RejectedReading};
use crate::numeric::tolerance::median;
use crate::parameter::ParameterSet;

/// Reweighted fits of a robust one.
const ROBUST_ROUNDS: usize = 8;
/// Where a fit uses up less of its readings than this share, no single one draws it to itself.
const LITTLE: f64 = 0.1;

/// What a fit says of all readings of a case.
struct JudgedReadings {
    left: Vec<ReadingResidual>,
    /// Their covariances as they were weighed.
    weighed: Vec<Matrix6<f64>>,
    /// Of what is predicted for them, less than nothing for those that were not fitted; nothing where that is little of all.
    known: Option<Vec<Matrix6<f64>>>,
    spare: f64,
    freedom: f64,
}

impl AbsoluteCase<'_> {
    /// The readings that lie far out of what a fit to all but some leaves of all.
    pub(super) fn far_out(
        &self,
        set: &ParameterSet,
        fit: (&ParameterFit, Option<[f64; 2]>),
        rejected: &[RejectedReading],
    ) -> Option<Vec<RejectedReading>> {
        let judged = self.judged(set, fit, rejected)?;
        let angles: Vec<&[f64]> = (self.observations.iter())
            .map(|each| each.setup.commanded_rad.as_slice())
            .collect();
        let readings = LookedOver {
            left: &judged.left,
            own: &self.covariances,
            angles: &angles,
            spare: judged.spare,
            freedom: judged.freedom,
            plausible: None,
        };
        outliers::far_out(&readings, |reading, whole| judged.squares(reading, whole))
    }

    /// A fit from near another one that gross errors pull far less: of least absolute deviations (Huber), then with weights that fall with
    /// larger ones (Cauchy), so that those which are alike and close to each other do not pull it either. None of few readings.
    pub(super) fn robust_fit(
        &self,
        set: &ParameterSet,
        first: &ParameterFit,
    ) -> Option<ParameterFit> {
        if 1.0 - first.spare() >= LITTLE {
            return None;
        }
        let mut case = self.clone();
        let mut fit = first.clone();
        for round in 0..ROBUST_ROUNDS {
            let left = case.left(&fit.belief).ok()?;
            let positions = left.iter().map(|each| each.position_m.norm());
            let rotations = left.iter().filter_map(|each| each.rotation_rad);
            let scales_m_rad = [
                median(positions.collect())?,
                median(rotations.map(|each| each.norm()).collect()).unwrap_or_default(),
            ];
            let values = case.rebased(set, &fit);
            for (place, each) in left.iter().enumerate() {
                let lengths = [
                    each.position_m.norm(),
                    each.rotation_rad.map_or(0.0, |each| each.norm()),
                ];
                let mut covariance = case.covariances[place];
                for row in 0..6 {
                    let (scale, length) = (scales_m_rad[row / 3], lengths[row / 3]);
                    covariance[(row, row)] += if round < ROBUST_ROUNDS / 2 {
                        scale * length.max(scale)
                    } else {
                        scale * scale + length * length / 4.0
                    };
                }
                case.observations[place].whitener = whitener(&covariance);
            }
            fit = fit_for_weights(&case.arm, set, &case.observations, None, &values).ok()?;
        }
        Some(fit)
    }

    /// The reading without which the weighted squares of a fit to all are smallest; none of many, among which none draws the fit to
    /// itself.
    pub(super) fn farthest(
        &self,
        set: &ParameterSet,
        fit: (&ParameterFit, Option<[f64; 2]>),
    ) -> Option<RejectedReading> {
        let judged = self.judged(set, fit, &[])?;
        judged.known.as_ref()?;
        let squares = (judged.weighed.iter().enumerate()).map(|(reading, own)| {
            let [position, rotation] = judged.squares(reading, own);
            (reading, position.max(rotation))
        });
        let (reading, square) = squares.max_by(|one, other| one.1.total_cmp(&other.1))?;
        Some(RejectedReading {
            reading,
            deviations: square.sqrt(),
        })
    }

    fn judged(
        &self,
        set: &ParameterSet,
        (fit, discrepancy): (&ParameterFit, Option<[f64; 2]>),
        rejected: &[RejectedReading],
    ) -> Option<JudgedReadings> {
        let [position_m, rotation_rad] = discrepancy.unwrap_or_default();
        let discrepancy = Discrepancy {
            position_m,
            rotation_rad,
        };
        let own = self.covariances.iter();
        let mut judged = JudgedReadings {
            left: self.left(&fit.belief).ok()?,
            weighed: own.map(|own| own + discrepancy.covariance()).collect(),
            known: None,
            spare: fit.spare(),
            // Of readings enough for a fit with frames their number makes next to no difference.
            freedom: f64::INFINITY,
        };
        if 1.0 - judged.spare >= LITTLE {
            judged.freedom = fit.degrees_of_freedom();
            let covariance = &fit.posterior.covariance;
            let mut here = self.clone();
            let values = here.rebased(set, fit);
            let rows = here.rows_at(&here.arm, set, values.as_slice(), &[]).ok()?;
            let is_rejected = outliers::rejected_of(rows.len(), rejected);
            let known = rows.iter().zip(is_rejected).map(|(rows, is_rejected)| {
                let predicted = &rows.columns * covariance * rows.columns.transpose();
                let sign = if is_rejected { -1.0 } else { 1.0 };
                let mut known = Matrix6::zeros();
                let mut own = known.view_mut((0, 0), predicted.shape());
                own.copy_from(&(predicted * sign));
                known
            });
            judged.known = Some(known.collect());
        }
        Some(judged)
    }
}

impl JudgedReadings {
    fn squares(&self, reading: usize, whole: &Matrix6<f64>) -> [f64; 2] {
        let left = &self.left[reading];
        match &self.known {
            Some(known) => squares_of(left, &self.weighed[reading], whole, &known[reading]),
            None => squares(left, whole),
        }
    }
}

/// Position and rotation, each over its covariance.
fn squares(left: &ReadingResidual, covariance: &Matrix6<f64>) -> [f64; 2] {
    let square = |vector: Vector3<f64>, first: usize| {
        let own = covariance.fixed_view::<3, 3>(first, first).into_owned();
        own.cholesky()
            .map_or(0.0, |factor| vector.dot(&factor.solve(&vector)))
    };
    let rotation = left.rotation_rad.map_or(0.0, |vector| square(vector, 3));
    [square(left.position_m, 0), rotation]
}
