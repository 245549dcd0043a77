//! Compliances from measurements, with residuals and likely input errors.

use serde_json::{Value, json};

use crate::codes::Condition;
use crate::identification::input_errors::{
    LikelyInputError, conditions_of_table, suspected_input_errors,
};
use crate::identification::patterns::{BLOCKS, Patterns, looked_at};
use crate::identification::{
    Case, Identification, IdentificationError, MeasurementResidual, RejectedReading, Repeats,
    Robustness, Sigma, Told, joint_space_blocks, left_out, residuals,
};
use crate::measurement::Measurement;
use crate::record::json::{merge, results};
use crate::record::messages::{IdentificationMessage, ProvenanceMessage};
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
    pub const fn plainly(method: Method) -> Self {
        Self {
            method,
            sigma_from_residuals: false,
            robustness: Robustness {
                keeps_all: true,
                counts_discrepancy: false,
                holds_nominal: false,
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
    pub residuals: Vec<MeasurementResidual>,
    /// What the table shows by itself.
    pub of_table: Vec<Condition>,
    /// Likely input errors.
    pub input_errors: Vec<LikelyInputError>,
    /// What the residuals go with.
    pub patterns: Patterns,
    /// What repeated measurements show, where there are some.
    pub repeats: Option<Repeats>,
}

/// Why nothing was identified.
#[derive(Debug)]
pub struct NotIdentified {
    /// The reason.
    pub error: IdentificationError,
    /// What the table shows by itself, and likely input errors.
    pub conditions: Vec<Condition>,
}

/// Identifies what a belief leaves open, with its sigma or with that of the residuals. Input errors are looked for in all
/// measurements, patterns in those that were not left out.
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
        conditions: conditions_of_table(&case)
            .into_iter()
            .chain(
                suspected_input_errors(&case, None)
                    .iter()
                    .map(LikelyInputError::condition),
            )
            .collect(),
    };
    let robust = case.identify_robustly(how.robustness).map_err(failed)?;
    let identification = &robust.identification;
    let all = case;
    let case = Case {
        held: &robust.held,
        ..all
    };
    let weighed = case.with(&robust.weighed);
    let residuals = residuals(&weighed, identification, &robust.rejected).map_err(failed)?;
    let of_table = conditions_of_table(&all);
    let input_errors = suspected_input_errors(&all, Some(&robust.of_all));
    let kept = robust.of_kept(measurements);
    let configurations: Vec<_> = kept.iter().map(|each| &each.configuration_rad).collect();
    let blocks = joint_space_blocks(&configurations, BLOCKS.min(configurations.len() / 2));
    let left_m: Vec<[f64; 3]> = robust.of_kept(identification.residuals_m.as_chunks().0);
    let looked = looked_at(&case.with(&kept), identification, &left_m, &blocks);
    let all: Vec<usize> = (0..measurements.len()).collect();
    let repeats = Repeats::of_deflections(measurements, &robust.of_kept(&all));
    Ok(Identified {
        repeats,
        patterns: looked.patterns(&robust.rejected),
        identification: robust.identification,
        rejected: robust.rejected,
        residuals,
        of_table,
        input_errors,
    })
}

impl Identified {
    /// What must be looked at.
    pub fn conditions(&self) -> impl Iterator<Item = Condition> {
        let conditions = self.identification.conditions().into_iter();
        conditions.chain(self.further_doubts())
    }

    /// Those besides the identification's own.
    fn further_doubts(&self) -> impl Iterator<Item = Condition> {
        let left_out = self.left_out().and_then(Result::ok).into_iter();
        let input_errors = self.input_errors.iter().map(LikelyInputError::condition);
        (left_out.chain(self.of_table.iter().cloned())).chain(input_errors)
    }

    /// What holds since the fit counts it, and nobody need act on.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = self.identification.notes();
        notes.extend(self.left_out().and_then(Result::err));
        notes
    }

    fn left_out(&self) -> Option<Told> {
        left_out(&self.rejected, self.residuals.len(), "measurement")
    }

    /// The record for `compensate`, and for whoever looks at it.
    pub fn json(
        &self,
        scenario: &Scenario,
        provenance: &ProvenanceMessage,
        sigma_from_residuals: bool,
    ) -> serde_json::Result<Value> {
        let mut message = IdentificationMessage::from(&self.identification);
        message.conditions.extend(self.further_doubts());
        let discrepancy = self.identification.discrepancy;
        let has_rotations = (self.residuals.iter()).any(|each| each.standardised.len() > 3);
        let rejected: Vec<Value> = self.rejected.iter().map(RejectedReading::json).collect();
        let keys = json!({
            "sigma_from_residuals": sigma_from_residuals,
            "identified_with": scenario.task.belief.fingerprint(),
            // Null where it is no text, which JSON could not hold.
            "scenario_file": scenario.path.to_str(),
        });
        let mut json = results("identify", provenance, keys);
        merge(&mut json, serde_json::to_value(&message)?);
        let more = json!({
            "residuals": self.residuals,
            "diagnoses": self.input_errors,
            "discrepancy_mm": discrepancy.map(|discrepancy| discrepancy.position_m * 1e3),
            "discrepancy_mrad": discrepancy.filter(|_| has_rotations).map(|discrepancy| discrepancy.rotation_rad * 1e3),
            "rejected": rejected,
            "patterns": self.patterns,
            "repeats": self.repeats,
            "notes": self.notes(),
        });
        merge(&mut json, more);
        Ok(json)
    }
}
