//! Outliers among absolute readings.

use nalgebra::{DVector, Matrix6};

use super::super::discrepancy::{discrepancy_covariance, six_rows};
use super::super::fit::{FittedReadings, Haste, LinearReadings, ParameterFit};
use super::super::outliers::{self, LookedOver};
use super::case::whitener;
use super::fit::{FitByKnownErrors, KeptFit};
use super::unknowns::is_geometry;
use super::{AbsoluteCase, RejectedReading};
use crate::numeric::tolerance::median;
use crate::parameter::{ParameterKind, ParameterSet};

/// Reweighted fits of a robust one, of either kind of weights.
const ROBUST_ROUNDS: usize = 4;
/// Where a fit uses up less of its readings than this share, no single one draws it to itself.
const LITTLE: f64 = 0.1;

impl<'a> AbsoluteCase<'a> {
    /// Fits without the readings that lie far out of a first fit with its discrepancy. None where none does and none was left out, where too
    /// many do, or where the others determine less than all.
    pub(super) fn without_far_out(&self, first: &KeptFit<'a>) -> Option<KeptFit<'a>> {
        let (set, rank) = (&first.fit.set, first.fit.posterior.estimable.rank());
        let suspects = self.looked_over(first, &first.fit)?.suspects();
        if !first.rejected.is_empty() {
            // Geometry and elasticity may explain what frames alone do not, and what is known before of all the rest alone.
            let all = self.by_known_errors(&[], set, None).ok();
            let is_none_suspect = suspects.as_ref().is_some_and(Vec::is_empty);
            if is_none_suspect || all.as_ref().is_some_and(FitByKnownErrors::is_explained) {
                let all = self.completed(all?, &[], set).ok()?;
                return Some(self.without_far_out(&all).unwrap_or(all));
            }
        }
        let mut rejected = suspects?;
        if rejected.is_empty()
            && first.discrepancy.is_some()
            && let Some(robust) = self.robust_fit(&first.fit)
        {
            // Many that err alike draw the fit to themselves, too.
            rejected = self.looked_over(first, &robust)?.far_out()?;
        }
        let (rejected, mut found) = outliers::until_the_same(
            rejected,
            |found: &KeptFit<'a>| self.looked_over(found, &found.fit)?.far_out(),
            |rejected, before| {
                let found = (self.fit_without(rejected, set, before)).ok()?;
                (found.fit.posterior.estimable.rank() >= rank).then_some(found)
            },
        )?;
        found.rejected = rejected;
        Some(found)
    }

    /// What lies far out of a fit of frames, geometry and compliances alone, where gross errors drive masses and springs anywhere.
    pub(super) fn far_out_of_fewer(
        &self,
        set: &ParameterSet,
        start: &[RejectedReading],
    ) -> Option<Vec<RejectedReading>> {
        let is_firm = |kind: ParameterKind| {
            let is_compliance = matches!(kind, ParameterKind::JointCompliance { .. });
            kind.is_mounted() || is_geometry(kind) || is_compliance
        };
        let all = set.parameters();
        let firm: Vec<usize> = (0..set.len())
            .filter(|&place| is_firm(all[place].kind))
            .collect();
        let first = self.fit_without(start, &set.subset(&firm), None).ok()?;
        let rejected = self.without_far_out(&first)?.rejected;
        (rejected.len() > start.len()).then_some(rejected)
    }
}

impl AbsoluteCase<'_> {
    /// A fit from near another one that gross errors pull far less: of least absolute deviations (Huber), then with weights that fall with
    /// larger ones (Cauchy), so that those which are alike and close to each other do not pull it either. None of few readings.
    pub(super) fn robust_fit(&self, first: &ParameterFit) -> Option<ParameterFit> {
        if self.is_pulled(first) {
            return None;
        }
        let (mut case, mut fit) = (self.clone(), first.clone());
        for is_huber in [true, false] {
            let mut values = case.rebased(&fit);
            let linear = case.fitted_readings(&first.set).linear_at(&values).ok()?;
            let refit = |case: &Self, linear, values: &DVector<f64>| {
                let readings = FittedReadings {
                    shared: None,
                    linear,
                    ..case.fitted_readings(&first.set)
                };
                readings.fit_from(values, Haste::Weights).ok()
            };
            for _ in 0..ROBUST_ROUNDS {
                case.weigh_robustly(&linear, &values, is_huber)?;
                let found = refit(&case, Some(&linear), &values)?;
                values = DVector::from_vec(found.posterior.mean);
            }
            fit = refit(&case, None, &values)?;
        }
        Some(fit)
    }

    /// Weighs readings by how far they are off at values (p), in medians of that: after Huber, or after Cauchy.
    fn weigh_robustly(
        &mut self,
        linear: &LinearReadings,
        values: &DVector<f64>,
        is_huber: bool,
    ) -> Option<()> {
        let left = self.left_by(linear, values);
        let lengths = left.iter().map(|each| {
            let rotation = each.rotation_rad.map_or(0.0, |each| each.norm());
            [each.position_m.norm(), rotation]
        });
        let lengths: Vec<[f64; 2]> = lengths.collect();
        let each = lengths.iter().zip(&left);
        let of_rotations = each.filter(|(_, each)| each.rotation_rad.is_some());
        let scales_m_rad = [
            median(lengths.iter().map(|each| each[0]).collect())?,
            median(of_rotations.map(|(each, _)| each[1]).collect()).unwrap_or_default(),
        ];
        for (place, lengths) in lengths.iter().enumerate() {
            let mut covariance = self.covariances[place];
            for row in 0..6 {
                let (scale, length) = (scales_m_rad[row / 3], lengths[row / 3]);
                covariance[(row, row)] += if is_huber {
                    scale * length.max(scale)
                } else {
                    scale * scale + length * length / 4.0
                };
            }
            self.observations[place].whitener = whitener(&covariance);
        }
        Some(())
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
        let is_pulled = self.is_pulled(fit);
        let independent = self.independent_rows(fit);
        let spare = (independent - fit.determined).max(1.0) / independent;
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
            spare,
            // Of readings enough for a fit with frames their number makes next to no difference.
            freedom: if is_pulled {
                spare * independent
            } else {
                f64::INFINITY
            },
            is_drawn: is_pulled && found.discrepancy.is_some() && found.rejected.is_empty(),
            plausible: None,
        })
    }

    /// How many of a fit's scalar readings err independently: those at one command pose err alike by what no parameter explains.
    fn independent_rows(&self, fit: &ParameterFit) -> f64 {
        fit.rows as f64 * self.different() as f64 / self.observations.len() as f64
    }

    /// Whether what is read at a single command pose can draw a fit to itself.
    fn is_pulled(&self, fit: &ParameterFit) -> bool {
        fit.determined >= LITTLE * self.independent_rows(fit)
    }
}
