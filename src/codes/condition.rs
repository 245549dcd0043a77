//! What must be looked at before a result is relied on.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::ConditionCode;

/// A named condition that does not hold, although there is a result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Condition {
    /// Its kind.
    pub code: ConditionCode,
    /// What was found.
    pub text: String,
    /// Whether it was accepted beforehand (`--allow`).
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub allowed: bool,
}

impl ConditionCode {
    /// A condition of this kind, with what was found.
    pub fn with(self, text: impl Into<String>) -> Condition {
        Condition {
            code: self,
            text: text.into(),
            allowed: false,
        }
    }

    /// Whether it is of an identification: results may hold those of the plan, too.
    pub fn is_of_identification(self) -> bool {
        self.id().starts_with("C02")
    }
}

impl Condition {
    /// The same, found in something that is named before it.
    pub fn within(&self, what: &str) -> Self {
        self.code.with(format!("{what}: {}", self.text))
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        let allowed = if self.allowed { " (allowed)" } else { "" };
        write!(text, "{}{allowed}: {}", self.code, self.text)
    }
}
