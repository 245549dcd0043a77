//! Likely input errors of a table: units, signs, frames, columns, an instrument that was moved.
//!
//! An error is supposed, the table is read without it, and both readings are judged: deflections by their evidence, absolute
//! readings by what frames alone leave of them. The private `catalogue` lists the errors.

mod catalogue;
mod deflections;
mod evidence;
mod frames;

use nalgebra::DVector;
use serde::Serialize;

use crate::codes::{Condition, ConditionCode};
use crate::robot::{Approach, SerialChain};
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

/// A commanded angle may lie so far outside its range (rad, m): files have one decimal.
const RANGE_SLACK_RAD: f64 = 0.1 * std::f64::consts::PI / 180.0;

/// The rows whose commanded angles (rad, m) are outside the joints' ranges, with the angle that is furthest outside.
pub fn outside_limits<'a>(
    chain: &SerialChain,
    noun: &str,
    commands_rad: impl Iterator<Item = &'a DVector<f64>>,
) -> Option<Condition> {
    let beyond = |commands_rad: &DVector<f64>| {
        let joints = chain.joints.iter().zip(commands_rad).enumerate();
        let beyond = joints.map(|(joint, (each, &angle))| {
            let [from, to] = each.range_rad;
            ((from - angle).max(angle - to), joint, angle)
        });
        beyond.max_by(|one, other| one.0.total_cmp(&other.0))
    };
    let furthest: Vec<_> = commands_rad.map(beyond).collect();
    let all = furthest.len();
    let far = (1..).zip(furthest.into_iter().flatten());
    let outside: Vec<_> = far.filter(|(_, far)| far.0 > RANGE_SLACK_RAD).collect();
    let (row, (_, joint, angle)) =
        (outside.iter().copied()).max_by(|(_, one), (_, other)| one.0.total_cmp(&other.0))?;
    let each = &chain.joints[joint];
    let [angle, from, to] =
        [angle, each.range_rad[0], each.range_rad[1]].map(|value| each.drive.shown(value).0);
    let unit = each.drive.shown(0.0).1;
    Some(ConditionCode::AnglesOutsideLimits.with(format!(
        "{} of {} have commanded angles outside the joint limits: {} of {noun} {row} is {angle:.1} {unit}, allowed are {from:.1} to \
         {to:.1} {unit}",
        outside.len(),
        counted(all as u64, noun),
        catalogue::named(chain, joint),
    )))
}

/// So many rows are named.
const SHOWN: usize = 5;

fn condition(text: &str) -> Condition {
    ConditionCode::InputError.with(format!("likely input error: {text}"))
}
