//! Outliers among absolute readings.

use nalgebra::{DVector, Matrix6};

use super::super::discrepancy::{discrepancy_covariance, six_rows};
use super::super::fit::{FittedReadings, Haste, LinearReadings, ParameterFit};
use super::super::outliers::{self, FAR_FOR_POSES, LookedOver};
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
    ///
    /// What no parameter explains is alike in the readings of a command pose. Whether all of them lie far out is therefore judged by the
    /// number of poses, unless they do by far, and a single one that contradicts the others by that of readings.
    pub(super) fn without_far_out(&self, first: &KeptFit<'a>) -> Option<KeptFit<'a>> {
        let found = self.without_far_out_by(first, 1.0)?;
        let mut is_out = vec![false; self.observations.len()];
        let doubtful = found
            .rejected
            .iter()
            .filter(|each| each.deviations < FAR_FOR_POSES);
        doubtful.for_each(|each| is_out[each.reading] = true);
        let mut poses = self.command_poses();
        let alone = poses.len() as f64 / self.observations.len() as f64;
        poses.retain(|pose| pose.len() > 1 && pose.iter().all(|&reading| is_out[reading]));
        if poses.is_empty() {
            return Some(found);
        }
        let by_poses = self.without_far_out_by(first, alone);
        let mut rejected = (by_poses.as_ref()).map_or_else(Vec::new, |each| each.rejected.clone());
        let is_known = outliers::rejected_of(self.observations.len(), &rejected);
        let single = found.rejected.iter().filter(|each| {
            let is_whole = poses.iter().any(|pose| pose.contains(&each.reading));
            !is_whole && !is_known[each.reading]
        });
        let before = rejected.len();
        rejected.extend(single.copied());
        if rejected.len() == before {
            return by_poses;
        }
        rejected.sort_by_key(|each| each.reading);
        self.fit_without(&rejected, &first.fit.set, Some(&found))
            .ok()
    }

    /// The same, where so large a share of the readings errs independently.
    fn without_far_out_by(&self, first: &KeptFit<'a>, alone: f64) -> Option<KeptFit<'a>> {
        let (set, rank) = (&first.fit.set, first.fit.posterior.estimable.rank());
        let suspects = self.looked_over(first, &first.fit, alone)?.suspects();
        if !first.rejected.is_empty() {
            // Geometry and elasticity may explain what frames alone do not, and what is known before of all the rest alone.
            let all = self.by_known_errors(&[], set, None).ok();
            let is_none_suspect = suspects.as_ref().is_some_and(Vec::is_empty);
            if is_none_suspect || all.as_ref().is_some_and(FitByKnownErrors::is_explained) {
                let all = self.completed(all?, &[], set).ok()?;
                return Some(self.without_far_out_by(&all, alone).unwrap_or(all));
            }
        }
        let mut rejected = suspects?;
        if rejected.is_empty()
            && first.discrepancy.is_some()
            && let Some(robust) = self.robust_fit(&first.fit, alone)
        {
            // Many that err alike draw the fit to themselves, too.
            rejected = self.looked_over(first, &robust, alone)?.far_out()?;
        }
        let (rejected, mut found) = outliers::until_the_same(
            rejected,
            |found: &KeptFit<'a>| self.looked_over(found, &found.fit, alone)?.far_out(),
            |rejected, before| {
                let found = (self.fit_without(rejected, set, before)).ok()?;
                (found.fit.posterior.estimable.rank() >= rank).then_some(found)
            },
        )?;
        found.rejected = rejected;
        Some(found)
    }

    /// Those rejected readings that lie far out of what the model of the others' residuals predicts, too: what joints are off by moves a tool
    /// further the further it is from their axes. None where all do, or there is no such model.
    pub(super) fn far_out_of_model(&self, found: &KeptFit<'a>) -> Option<Vec<RejectedReading>> {
        let (fit, model) = (&found.fit, &found.discrepancy_model.as_ref()?.model);
        if found.rejected.is_empty() {
            return None;
        }
        let joints: Vec<usize> = model.joints.iter().map(|each| each.joint).collect();
        let out = self.part_of(|place| found.rejected.iter().any(|each| each.reading == place));
        let rows = out.rows_at(&found.case.arm, &fit.set, &fit.posterior.mean, &joints);
        let rows = rows.ok()?;
        let places: Vec<usize> = (0..fit.set.len()).collect();
        let is_out = rows.iter().zip(&out.observations).map(|(rows, each)| {
            let q = each.setup.commanded_rad.as_slice();
            model.is_far_out(&model.local(rows, &places, q), q)
        });
        let mut rejected = found.rejected.clone();
        let mut is_out = is_out.collect::<Vec<bool>>().into_iter();
        rejected.retain(|_| is_out.next().unwrap_or(true));
        (rejected.len() < found.rejected.len()).then_some(rejected)
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
    fn robust_fit(&self, first: &ParameterFit, alone: f64) -> Option<ParameterFit> {
        if is_pulled(first, alone) {
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

    /// What a fit to all readings but those that were rejected, or another one of these that is robust, says of all, where so large a share
    /// of them errs independently.
    fn looked_over(
        &self,
        found: &KeptFit<'_>,
        fit: &ParameterFit,
        alone: f64,
    ) -> Option<LookedOver<'_>> {
        let mut here = self.clone();
        let values = here.rebased(fit);
        if found.case.is_sharing_known {
            // All as those were weighed that were fitted.
            here = here.counting_sources();
        }
        let discrepancy = discrepancy_covariance(found.discrepancy.unwrap_or_default());
        let mut known = vec![Matrix6::zeros(); here.covariances.len()];
        let is_pulled = is_pulled(fit, alone);
        let independent = fit.rows as f64 * alone;
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
}

/// Whether a single reading, of which so large a share errs independently, can draw a fit to itself.
fn is_pulled(fit: &ParameterFit, alone: f64) -> bool {
    fit.determined >= LITTLE * fit.rows as f64 * alone
}
