//! Series that contradict each other, as a record.

use serde::{Deserialize, Serialize};

use super::absolute::{quantity_unit, shown_unit};
use crate::identification::Contradictions;

/// Two series of readings beside each other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "view", derive(schemars::JsonSchema))]
pub struct ContradictionsMessage {
    /// Which series, in words.
    pub between: [String; 2],
    /// How many parameters of the robot both tell.
    pub compared: usize,
    /// Those that contradict each other, the surest first.
    pub found: Vec<ContradictionMessage>,
}

/// A parameter of which two series say different things.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "view", derive(schemars::JsonSchema))]
pub struct ContradictionMessage {
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

impl ContradictionsMessage {
    /// The record of a comparison of two series.
    #[must_use]
    pub fn new(contradictions: &Contradictions, between: [String; 2]) -> Self {
        let found = contradictions.found.iter();
        Self {
            between,
            compared: contradictions.compared,
            found: found
                .map(|each| ContradictionMessage {
                    name: each.name.clone(),
                    unit: quantity_unit(each.kind).to_owned(),
                    values: each.values,
                    intervals95: each.intervals95,
                    probability: each.probability,
                })
                .collect(),
        }
    }

    /// What does not hold: each contradiction in words.
    pub fn conditions(&self) -> impl Iterator<Item = String> {
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
            format!(
                "contradiction: {} is {} and {}: by chance with a probability of {:.1e}",
                each.name,
                side(0),
                side(1),
                each.probability
            )
        })
    }
}
