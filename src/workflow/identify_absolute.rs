//! A robot from absolute readings.

use serde_json::{Value, json};

use crate::identification::{
    AbsoluteCase, AbsoluteError, AbsoluteFit, ParameterGroup, ReadingWeights,
};
use crate::measurement::AbsoluteReading;
use crate::record::absolute::AbsoluteMessage;
use crate::record::json::{merge, results};
use crate::record::messages::{FingerprintMessage, ProvenanceMessage};
use crate::scenario::Scenario;
use crate::task::Belief;

/// What absolute readings say.
#[derive(Debug)]
pub struct IdentifiedRobot<'a> {
    /// The readings, with stations and targets.
    pub case: AbsoluteCase<'a>,
    /// The fit.
    pub fit: AbsoluteFit,
}

/// Fits what a belief leaves open, or groups of parameters, with all frames.
///
/// # Errors
/// See [`AbsoluteError`].
pub fn identify_absolute<'a>(
    belief: &'a Belief,
    readings: &[AbsoluteReading],
    groups: &[ParameterGroup],
    weights: ReadingWeights,
) -> Result<IdentifiedRobot<'a>, AbsoluteError> {
    let mut case = AbsoluteCase::new(belief, readings)?;
    let fit = case.fit(groups, weights)?;
    Ok(IdentifiedRobot { case, fit })
}

impl IdentifiedRobot<'_> {
    /// The record.
    ///
    /// # Errors
    /// None that records of numbers and texts have.
    pub fn json(
        &self,
        scenario: &Scenario,
        provenance: &ProvenanceMessage,
        groups: &[ParameterGroup],
    ) -> serde_json::Result<Value> {
        let keys = json!({
            "kind": "absolute",
            "groups": groups,
            "identified_with": FingerprintMessage::from(scenario.task.belief.fingerprint()),
            "scenario_file": scenario.path.to_str(),
        });
        let mut json = results("identify", provenance, keys);
        merge(
            &mut json,
            serde_json::to_value(AbsoluteMessage::new(&self.case, &self.fit))?,
        );
        Ok(json)
    }
}
