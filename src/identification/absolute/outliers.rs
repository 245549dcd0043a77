//! Outliers among absolute readings.

use nalgebra::Matrix6;

use super::super::discrepancy::{discrepancy_covariance, six_rows};
use super::super::fit::{FittedReadings, Haste, ParameterFit};
use super::super::outliers::LookedOver;
use super::AbsoluteCase;
use super::case::whitener;
use super::fit::KeptFit;
use crate::numeric::tolerance::median;

/// Reweighted fits of a robust one.
const ROBUST_ROUNDS: usize = 8;
/// Where a fit uses up less of its readings than this share, no single one draws it to itself.
const LITTLE: f64 = 0.1;

impl AbsoluteCase<'_> {
    /// A fit from near another one that gross errors pull far less: of least absolute deviations (Huber), then with weights that fall with
    /// larger ones (Cauchy), so that those which are alike and close to each other do not pull it either. None of few readings.
    pub(super) fn robust_fit(&self, first: &ParameterFit) -> Option<ParameterFit> {
        if is_pulled(first) {
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
            let values = case.rebased(&fit);
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
            let readings = FittedReadings {
                shared: None,
                ..case.fitted_readings(&first.set)
            };
            fit = readings.fit_from(&values, Haste::Weights).ok()?;
        }
        Some(fit)
    }

    /// What a fit to all readings but those that were rejected, or another one of these that is robust, says of all.
    pub(super) fn looked_over(
        &self,
        found: &KeptFit<'_>,
        fit: &ParameterFit,
    ) -> Option<LookedOver<'_>> {
        let mut here = self.clone();
        let values = here.rebased(fit);
        if found.case.is_sharing_known {
            // All as those were weighed that were fitted.
            here = here.counting_sources();
        }
        let discrepancy = discrepancy_covariance(found.discrepancy.unwrap_or_default());
        let mut known = vec![Matrix6::zeros(); here.covariances.len()];
        let is_pulled = is_pulled(fit);
        if is_pulled {
            let rows = here.rows_at(&here.arm, &fit.set, values.as_slice(), &[]);
            let rows = rows.ok()?;
            for (known, rows) in known.iter_mut().zip(&rows) {
                let predicted =
                    &rows.columns * &fit.posterior.covariance * rows.columns.transpose();
                *known = six_rows(&predicted);
            }
        }
        let angles = (self.observations.iter()).map(|each| each.setup.commanded_rad.as_slice());
        Some(LookedOver {
            left: self.left(&fit.belief).ok()?,
            weighed: (here.covariances.iter().map(|own| own + discrepancy)).collect(),
            own: here.covariances,
            known,
            rejected: found.rejected.clone(),
            angles: angles.collect(),
            spare: fit.spare(),
            // Of readings enough for a fit with frames their number makes next to no difference.
            freedom: if is_pulled {
                fit.degrees_of_freedom()
            } else {
                f64::INFINITY
            },
            is_drawn: is_pulled && found.discrepancy.is_some() && found.rejected.is_empty(),
            plausible: None,
        })
    }
}

/// Whether a single reading can draw a fit to itself.
fn is_pulled(fit: &ParameterFit) -> bool {
    1.0 - fit.spare() >= LITTLE
}
