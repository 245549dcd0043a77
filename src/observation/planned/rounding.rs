//! Displacements that are shown in coarse steps: repeats share errors of rounding.

use super::PlannedReadings;
use crate::numeric::quantisation::{rounding_variance, shared_rounding, shared_rounding_slope};
use crate::parameter::{ReadingSource, counted_times};
use crate::robot::Load;

impl PlannedReadings<'_> {
    /// How many times the variance of the instrument's noise counts: repeats of a displacement share errors of rounding to coarse steps.
    pub(super) fn noise_times(&self, load: &Load) -> f64 {
        let step = self.coarse_step();
        let part = if step > 0.0 && self.repeats > 1.0 {
            shared_rounding(step, self.spread_of_repeats(load)) / self.precision.sigma_m.powi(2)
        } else {
            self.unloaded().shared_part()
        };
        counted_times(part, self.repeats)
    }

    /// By how much that follows the variance of a source.
    pub(super) fn slope_of_noise(&self, load: &Load) -> f64 {
        let step = self.coarse_step();
        if step > 0.0 && self.repeats > 1.0 {
            let slope = shared_rounding_slope(step, self.spread_of_repeats(load));
            (self.repeats - 1.0) * slope
        } else {
            0.0
        }
    }

    /// The step of what is read along a direction, in the units of its row, where repeats share errors of rounding; else nothing.
    fn coarse_step(&self) -> f64 {
        let is_coarse = self.is_along && self.precision.along_step_m > 0.0;
        let along_sigma_m = self.precision.along_sigma_m.filter(|_| is_coarse);
        along_sigma_m.map_or(0.0, |sigma_m| {
            self.precision.along_step_m * self.precision.sigma_m / sigma_m
        })
    }

    /// The variance in which repeats of a displacement differ before it is rounded: that of the instrument, and of what is new at each visit.
    fn spread_of_repeats(&self, load: &Load) -> f64 {
        let new = |source: &&ReadingSource| source.shared_part(self.unloaded()) <= 0.0;
        let new = self.sources.iter().filter(new);
        let disturbed: f64 = new.map(|source| self.added::<1>(source, load)[0]).sum();
        self.precision.sigma_m.powi(2) - rounding_variance(self.coarse_step()) + disturbed
    }
}
