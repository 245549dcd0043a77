//! The model discrepancy of absolute readings: by how much residuals exceed the readings' covariances, and what of that one visit
//! shares.

use nalgebra::Vector3;

use super::super::discrepancy::WEIGHINGS;
use super::super::gauss_newton::{
    FitError, ParameterFit, fit_for_weights, fit_from, fit_parameters,
};
use super::{AbsoluteCase, AbsoluteError, Discrepancy, ReadingResidual};
use crate::parameter::ParameterSet;

impl AbsoluteCase<'_> {
    /// A fit that weighs readings by what the model leaves, too; the first weight comes from another fit, or from the frames alone
    /// where there is none.
    pub(super) fn with_discrepancy(
        &mut self,
        set: &ParameterSet,
        other: Option<ParameterFit>,
    ) -> Result<(ParameterFit, Option<[f64; 2]>), AbsoluteError> {
        let (mut found, mut values) = if let Some(fit) = other {
            (self.estimated_discrepancy(&fit)?, self.rebased(set, &fit))
        } else {
            let (frames, fit) = self.fit_of_frames()?;
            let found = self.estimated_discrepancy(&fit)?;
            self.rebased(&frames, &fit);
            (found, set.prior().mean.clone())
        };
        for _ in 0..WEIGHINGS {
            let shared = self.weigh(found);
            let fit =
                fit_for_weights(&self.arm, set, &self.observations, shared.as_ref(), &values)?;
            found = self.estimated_discrepancy(&fit)?;
            values = self.rebased(set, &fit);
        }
        let shared = self.weigh(found);
        let fit = fit_from(&self.arm, set, &self.observations, shared.as_ref(), &values)?;
        Ok((fit, Some(found)))
    }

    /// The frames of stations and targets alone that suit the readings best, all else as it is.
    fn fit_of_frames(&self) -> Result<(ParameterSet, ParameterFit), AbsoluteError> {
        let kinds = self.frame_kinds().into_iter().map(|kind| (kind, None));
        let frames = ParameterSet::new(&self.arm, kinds)?;
        let fit = fit_parameters(&self.arm, &frames, &self.observations)?;
        Ok((frames, fit))
    }

    /// What the robot as it is leaves of the readings in the frames that suit them best.
    ///
    /// # Errors
    /// The readings do not determine frames.
    pub fn left_in_best_frames(&self) -> Result<Vec<ReadingResidual>, AbsoluteError> {
        self.check_frames()?;
        let (_, fit) = self.fit_of_frames()?;
        Ok(self.left_by(&fit)?)
    }

    /// What residuals are larger than the readings' own covariances make them, as standard deviations of position (m) and
    /// rotation (rad).
    pub(super) fn discrepancy(&self, fit: &ParameterFit) -> Result<[f64; 2], FitError> {
        Ok(self.discrepancy_of(&self.left_by(fit)?, fit))
    }

    /// The same, and what of it readings of one visit do not share.
    pub(super) fn estimated_discrepancy(
        &mut self,
        fit: &ParameterFit,
    ) -> Result<[f64; 2], FitError> {
        let left = self.left_by(fit)?;
        self.within = self.within_visits(&left, fit.spare());
        Ok(self.discrepancy_of(&left, fit))
    }

    fn discrepancy_of(&self, left: &[ReadingResidual], fit: &ParameterFit) -> [f64; 2] {
        // Each reading has its part in what was fitted.
        let discrepancy = Discrepancy::of(left, &self.covariances, fit.spare());
        [discrepancy.position_m, discrepancy.rotation_rad]
    }

    /// By how much residuals within visits differ more than the readings' own covariances make them: standard deviations of each
    /// coordinate of the position (m) and of the rotation (rad). `spare` is the share of the numbers that the fit did not use up.
    pub(super) fn within_visits(&self, left: &[ReadingResidual], spare: f64) -> [f64; 2] {
        let mut sums = [[0.0; 3]; 2];
        for visit in self.visits.iter().filter(|visit| visit.len() > 1) {
            let positions = visit.iter().map(|&index| (index, left[index].position_m));
            let turned = |&index: &usize| Some((index, left[index].rotation_rad?));
            let rotations = visit.iter().filter_map(turned);
            let parts: [Vec<(usize, Vector3<f64>)>; 2] = [positions.collect(), rotations.collect()];
            for ((first, part), sum) in [0, 3].into_iter().zip(parts).zip(&mut sums) {
                let count = part.len() as f64;
                if part.len() < 2 {
                    continue;
                }
                let mean = part.iter().map(|(_, each)| each).sum::<Vector3<f64>>() / count;
                for (index, each) in &part {
                    let own = &self.covariances[*index];
                    let own: f64 = (first..first + 3).map(|row| own[(row, row)]).sum();
                    sum[0] += (each - mean).norm_squared();
                    sum[1] += own * (1.0 - 1.0 / count);
                }
                sum[2] += 3.0 * (count - 1.0);
            }
        }
        sums.map(|[square, own, freedom]| {
            ((square / spare - own) / f64::max(freedom, 1.0))
                .max(0.0)
                .sqrt()
        })
    }
}
