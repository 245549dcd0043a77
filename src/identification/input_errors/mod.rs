//! Likely input errors of a table: units, signs, frames, columns, an instrument that was moved.
//!
//! An error is supposed, the table is read without it, and both readings are judged: deflections by their evidence, absolute
//! readings by what frames alone leave of them. The private `catalogue` lists the errors.

mod catalogue;
mod deflections;
mod evidence;
mod frames;

use serde::Serialize;

use crate::codes::{Condition, ConditionCode};

pub use deflections::{conditions_of_table, likely_input_errors, suspected_input_errors};

/// An input error with what speaks for it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LikelyInputError {
    /// The error's stable word.
    pub kind: &'static str,
    /// What may be wrong, what to do, and what is left then, in words.
    pub text: String,
    /// The natural logarithm of how many times more probable the measurements are with this error than without.
    pub log_evidence_ratio: f64,
}

impl LikelyInputError {
    /// The same as a condition.
    pub fn condition(&self) -> Condition {
        condition(&self.text)
    }
}

fn condition(text: &str) -> Condition {
    ConditionCode::InputError.with(format!("likely input error: {text}"))
}
