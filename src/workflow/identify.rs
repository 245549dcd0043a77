//! Compliances from measurements, with residuals and likely mistakes.

use serde_json::{Value, json};

use crate::identification::diagnoses::{Diagnosis, diagnoses};
use crate::identification::patterns::{BLOCKS, looked_at};
use crate::identification::{
    Case, Identification, IdentificationError, RejectedReading, Residuals, Robustness, Sigma,
    joint_space_blocks, residuals,
};
use crate::measurement::Measurement;
use crate::record::absolute::RejectedMessage;
use crate::record::json::{merge, results};
use crate::record::messages::{FingerprintMessage, IdentificationMessage, ProvenanceMessage};
use crate::record::patterns::PatternsMessage;
use crate::record::residuals::ResidualsMessage;
use crate::scenario::Scenario;
use crate::task::{Belief, Method};

/// How measurements are identified from.
#[derive(Debug, Clone, Copy)]
pub struct HowIdentified {
    /// The method.
    pub method: Method,
    /// Whether sigma is that of the residuals.
    pub sigma_from_residuals: bool,
    /// What is done about wrong measurements and about what the model leaves.
    pub robustness: Robustness,
}

impl HowIdentified {
    /// All measurements by what is believed of them alone.
    #[must_use]
    pub const fn plainly(method: Method) -> Self {
        Self {
            method,
            sigma_from_residuals: false,
            robustness: Robustness {
                keeps_all: true,
                counts_misfit: false,
            },
        }
    }
}

/// What measurements say.
#[derive(Debug)]
pub struct Identified {
    /// The compliances, and how well they are known.
    pub identification: Identification,
    /// The measurements that were left out, since they lie far out.
    pub rejected: Vec<RejectedReading>,
    /// What is left of each measurement.
    pub residuals: Residuals,
    /// Likely mistakes in the measurements.
    pub diagnoses: Vec<Diagnosis>,
    /// What the residuals go with.
    pub patterns: PatternsMessage,
}

/// Why nothing was identified.
#[derive(Debug)]
pub struct NotIdentified {
    /// The reason.
    pub error: IdentificationError,
    /// Likely mistakes in the measurements.
    pub diagnoses: Vec<Diagnosis>,
}

/// Identifies what a belief leaves open, with its sigma or with that of the residuals. Likely mistakes are looked for in all
/// measurements, patterns in those that were not left out.
///
/// # Errors
/// Nothing can be identified.
pub fn identify_measurements(
    belief: &Belief,
    measurements: &[Measurement],
    how: HowIdentified,
) -> Result<Identified, NotIdentified> {
    let sigma_m = belief.instrument.sigma_m;
    let sigma = if how.sigma_from_residuals {
        Sigma::FromResiduals(sigma_m)
    } else {
        Sigma::Known(sigma_m)
    };
    let case = Case::of_belief(belief, measurements, sigma, how.method);
    let failed = |error| NotIdentified {
        error,
        diagnoses: diagnoses(&case, None),
    };
    let robust = case.identify_robustly(how.robustness).map_err(failed)?;
    let identification = &robust.identification;
    let weighed = case.with(&robust.weighed);
    let kept = robust.of_kept(&robust.weighed);
    let residuals = residuals(&case.with(&kept), identification)
        .and_then(|of_kept| of_kept.with_rejected(&weighed, identification, &robust.rejected))
        .map_err(failed)?;
    let diagnoses = diagnoses(&case, Some(&robust.of_all));
    let kept = robust.of_kept(measurements);
    let configurations: Vec<_> = kept.iter().map(|each| &each.configuration_rad).collect();
    let blocks = joint_space_blocks(&configurations, BLOCKS.min(configurations.len() / 2));
    let left_m: Vec<[f64; 3]> = robust.of_kept(identification.residuals_m.as_chunks().0);
    let patterns = looked_at(&case.with(&kept), identification, &left_m, &blocks).patterns();
    let joints = belief.nominal.chain.joints.iter();
    let joints: Vec<String> = joints.map(|joint| joint.name.clone()).collect();
    Ok(Identified {
        patterns: PatternsMessage::new(&patterns, &joints, true).without(&robust.rejected),
        identification: robust.identification,
        rejected: robust.rejected,
        residuals,
        diagnoses,
    })
}

/// A diagnosis as a condition that does not hold.
#[must_use]
pub fn likely(diagnosis: &Diagnosis) -> String {
    format!("likely mistake: {}", diagnosis.text)
}

impl Identified {
    /// The named conditions that do not hold.
    pub fn conditions(&self) -> impl Iterator<Item = String> {
        let conditions = self.identification.conditions().into_iter();
        conditions.chain(self.further_doubts())
    }

    /// Those besides the identification's own.
    fn further_doubts(&self) -> impl Iterator<Item = String> {
        let left_out = RejectedReading::condition(&self.rejected, "measurement").into_iter();
        left_out.chain(self.diagnoses.iter().map(likely))
    }

    /// The record for `compensate`, and for whoever looks at it.
    ///
    /// # Errors
    /// None that records of numbers and texts have.
    pub fn json(
        &self,
        scenario: &Scenario,
        provenance: &ProvenanceMessage,
        sigma_from_residuals: bool,
    ) -> serde_json::Result<Value> {
        let mut message = IdentificationMessage::from(&self.identification);
        message.conditions.extend(self.further_doubts());
        let misfit = self.identification.misfit;
        let has_rotations =
            (self.residuals.measurements.iter()).any(|each| each.standardised.len() > 3);
        let rejected: Vec<RejectedMessage> = self.rejected.iter().map(Into::into).collect();
        let keys = json!({
            "sigma_from_residuals": sigma_from_residuals,
            "identified_with": FingerprintMessage::from(scenario.task.belief.fingerprint()),
            // Null where it is no text, which JSON could not hold.
            "scenario_file": scenario.path.to_str(),
        });
        let mut json = results("identify", provenance, keys);
        merge(&mut json, serde_json::to_value(&message)?);
        let more = ResidualsMessage::new(&self.residuals, &self.diagnoses);
        merge(&mut json, serde_json::to_value(&more)?);
        let more = json!({
            "misfit_mm": misfit.map(|misfit| misfit.position_m * 1e3),
            "misfit_mrad": misfit.filter(|_| has_rotations).map(|misfit| misfit.rotation_rad * 1e3),
            "rejected": rejected,
            "patterns": self.patterns,
        });
        merge(&mut json, more);
        Ok(json)
    }
}
