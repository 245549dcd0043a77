//! Compliances from measurements, with residuals and likely mistakes.

use serde_json::{Value, json};

use crate::identification::diagnoses::{Diagnosis, diagnoses};
use crate::identification::patterns::{BLOCKS, looked_at};
use crate::identification::{
    Case, Identification, IdentificationError, Residuals, Sigma, joint_space_blocks, residuals,
};
use crate::measurement::Measurement;
use crate::record::json::{merge, results};
use crate::record::messages::{FingerprintMessage, IdentificationMessage, ProvenanceMessage};
use crate::record::patterns::PatternsMessage;
use crate::record::residuals::ResidualsMessage;
use crate::scenario::Scenario;
use crate::task::{Belief, Method};

/// What measurements say.
#[derive(Debug)]
pub struct Identified {
    /// The compliances, and how well they are known.
    pub identification: Identification,
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

/// Identifies what a belief leaves open, with its sigma or with that of the residuals.
///
/// # Errors
/// Nothing can be identified.
pub fn identify_measurements(
    belief: &Belief,
    measurements: &[Measurement],
    method: Method,
    sigma_from_residuals: bool,
) -> Result<Identified, NotIdentified> {
    let sigma_m = belief.instrument.sigma_m;
    let sigma = if sigma_from_residuals {
        Sigma::FromResiduals(sigma_m)
    } else {
        Sigma::Known(sigma_m)
    };
    let case = Case::of_belief(belief, measurements, sigma, method);
    let failed = |error| NotIdentified {
        error,
        diagnoses: diagnoses(&case, None),
    };
    let identification = case.identify().map_err(failed)?;
    let residuals = residuals(&case, &identification).map_err(failed)?;
    let diagnoses = diagnoses(&case, Some(&identification));
    let configurations: Vec<_> = (measurements.iter())
        .map(|each| &each.configuration_rad)
        .collect();
    let blocks = joint_space_blocks(&configurations, BLOCKS.min(configurations.len() / 2));
    let patterns = looked_at(&case, &identification, &blocks).patterns();
    let joints = belief.nominal.chain.joints.iter();
    let joints: Vec<String> = joints.map(|joint| joint.name.clone()).collect();
    Ok(Identified {
        patterns: PatternsMessage::new(&patterns, &joints, true),
        identification,
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
        let doubts = self.diagnoses.iter().map(likely);
        self.identification.conditions().into_iter().chain(doubts)
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
        message.conditions.extend(self.diagnoses.iter().map(likely));
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
        merge(&mut json, json!({ "patterns": self.patterns }));
        Ok(json)
    }
}
