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
use crate::robot::Approach;
use crate::task::Extended;
use crate::text::wording::counted;

pub use deflections::{
    conditions_of_table, likely_input_errors, measurements_may_repeat, suspected_input_errors,
};

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

/// Where joints have gaps by what is believed, the rows that do not say from which side they were approached as others do.
pub fn unknown_approaches<'a>(
    uncertain: &Extended,
    noun: &str,
    sides: impl Iterator<Item = Option<&'a Approach>>,
) -> Option<Condition> {
    let has_backlash = uncertain.has_backlash();
    let (said, unsaid): (Vec<_>, Vec<_>) = (1..)
        .zip(sides)
        .partition(|(_, side): &(usize, _)| side.is_some());
    (has_backlash && !said.is_empty() && !unsaid.is_empty()).then(|| {
        let mut numbers: Vec<String> = unsaid.iter().map(|(row, _)| row.to_string()).collect();
        numbers.truncate(SHOWN);
        let words = format!(
            "{} of {} do not say from which side they were approached: all joints are taken to have turned positively, \
             and backlash may have either sign (the first: {})",
            unsaid.len(),
            counted((said.len() + unsaid.len()) as u64, noun),
            numbers.join(", ")
        );
        ConditionCode::UnknownApproach.with(words)
    })
}

/// So many rows are named.
const SHOWN: usize = 5;

fn condition(text: &str) -> Condition {
    ConditionCode::InputError.with(format!("likely input error: {text}"))
}
