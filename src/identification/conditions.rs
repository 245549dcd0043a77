//! What is wrong with an identification although there is one, by name.

use super::{Identification, UncertainEstimate};

/// Residuals that are as large, or as small, with less than this probability are no chance: with a
/// thousand calibrations of a correct set-up a year, each side warns wrongly once in ten years. It holds
/// for any number of degrees of freedom, since the probabilities are those of the chi-square
/// distribution itself.
pub const IMPLAUSIBLE: f64 = 1e-4;

impl Identification {
    /// All conditions that do not hold.
    #[must_use]
    pub fn conditions(&self) -> Vec<String> {
        let mut conditions: Vec<String> = (self.unidentifiable().iter())
            .map(|joint| format!("the measurements do not determine the compliance of {joint}"))
            .collect();
        let unknown =
            |each: &&UncertainEstimate| each.prior_deviation.is_none() && each.estimate.is_none();
        let others = self.uncertain.iter().filter(unknown);
        conditions
            .extend(others.map(|each| format!("the measurements do not determine {}", each.words)));
        conditions.extend(self.doubts());
        conditions
    }

    /// Those that put in doubt what is determined.
    #[must_use]
    pub fn doubts(&self) -> Vec<String> {
        let estimates = (self.parameters.iter()).filter_map(|each| Some((each, each.estimate?)));
        let mut doubts: Vec<String> = estimates
            .filter(|(_, estimate)| estimate.value < 0.0)
            .map(|(parameter, _)| {
                format!(
                    "the estimated compliance of {} is negative: too few measurements, or a wrong model",
                    parameter.name
                )
            })
            .collect();
        let sigma_mm = self.sigma_m * 1e3;
        if let Some(probability) = self.consistency
            && probability < IMPLAUSIBLE
        {
            let counted = self.misfit.map_or_else(String::new, |misfit| {
                format!(
                    "; measurements are weighed by the {:.4} mm that are unexplained of each coordinate, too, and errors count \
                     them",
                    misfit.position_m * 1e3
                )
            });
            doubts.push(format!(
                "the residuals are too large for sigma = {sigma_mm:.4} mm (probability {probability:.1e}): the \
                 model or sigma is wrong{counted}"
            ));
        }
        if let Some(probability) = self.consistency_lower
            && probability < IMPLAUSIBLE
        {
            doubts.push(format!(
                "the residuals are too small for sigma = {sigma_mm:.4} mm (probability {probability:.1e}): the \
                 deflections are in another unit, sigma is too large, or they were simulated without noise"
            ));
        }
        doubts
    }
}
