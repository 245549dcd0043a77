//! Inconsistencies between series, as a record.

use serde::{Deserialize, Serialize};

use super::absolute::quantity_unit;
use crate::codes::{Condition, ConditionCode};
use crate::identification::Inconsistencies;
use crate::quantities::units::shown_unit;

/// Two series of readings beside each other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct InconsistenciesMessage {
    /// Which series, in words.
    pub between: [String; 2],
    /// How many parameters of the robot both determine whose difference is resolved.
    pub compared: usize,
    /// Those whose difference is all rounding, since both have them from the same prior.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_comparable: Vec<String>,
    /// Those that contradict each other, the surest first.
    pub found: Vec<InconsistencyMessage>,
}

/// A parameter of which two series say different things.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct InconsistencyMessage {
    /// Its name.
    pub name: String,
    /// The unit of its values.
    pub unit: String,
    /// What each series says.
    pub values: [f64; 2],
    /// Their intervals of 95 %, by blocks of joint space.
    pub intervals95: [[f64; 2]; 2],
    /// The probability of a difference as large, of any of those that were compared.
    pub probability: f64,
}

impl InconsistenciesMessage {
    /// The record of a comparison of two series.
    pub fn new(inconsistencies: &Inconsistencies, between: [String; 2]) -> Self {
        let found = inconsistencies.found.iter();
        Self {
            between,
            compared: inconsistencies.compared,
            not_comparable: inconsistencies.not_comparable.clone(),
            found: found
                .map(|each| InconsistencyMessage {
                    name: each.name.clone(),
                    unit: quantity_unit(each.kind).to_owned(),
                    values: each.values,
                    intervals95: each.intervals95,
                    probability: each.probability,
                })
                .collect(),
        }
    }

    /// What must be looked at: each inconsistency.
    pub fn conditions(&self) -> impl Iterator<Item = Condition> {
        self.found.iter().map(|each| {
            let (factor, unit) = shown_unit(&each.unit);
            let side = |side: usize| {
                let [low, high] = each.intervals95[side];
                format!(
                    "{:.4} ({:.4} to {:.4}) {unit} {}",
                    each.values[side] * factor,
                    low * factor,
                    high * factor,
                    self.between[side]
                )
            };
            ConditionCode::Inconsistency.with(format!(
                "inconsistency between series: {} is {} and {}, p = {:.1e}",
                each.name,
                side(0),
                side(1),
                each.probability
            ))
        })
    }
}
