//! From which side a configuration is approached.

use nalgebra::DVector;

use super::SerialChain;
use crate::csv::word_field;

/// A command pose: the commanded angles (rad; m where a joint slides), and the side of approach where that is said.
pub type CommandPose<'a> = (&'a DVector<f64>, Option<&'a Approach>);

/// The side from which a configuration is approached: for each commanded joint whether it turns positively in the end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Approach(pub Vec<bool>);

impl Approach {
    /// What a word says for so many commanded joints: one sign for all, or one for each.
    pub fn of_word(word: &str, joints: usize) -> Option<Self> {
        let signs: Option<Vec<bool>> = (word.chars())
            .map(|sign| match sign {
                '+' => Some(true),
                // As typesetters have it, too.
                '-' | '\u{2212}' => Some(false),
                _ => None,
            })
            .collect();
        match signs?.as_slice() {
            &[one] => Some(Self(vec![one; joints])),
            all if all.len() == joints => Some(Self(all.to_vec())),
            _ => None,
        }
    }

    /// The word that is read as this: a sign for each joint.
    pub fn word(&self) -> String {
        (self.0.iter())
            .map(|&positive| if positive { '+' } else { '-' })
            .collect()
    }

    /// The same as a field of CSV, which no spreadsheet takes for a formula.
    pub fn field(&self) -> String {
        word_field(&self.word())
    }

    /// Whether each joint of a chain turns positively in the end. Passive joints do, and all do where nothing is said.
    pub fn of_all(approach: Option<&Self>, chain: &SerialChain) -> Vec<bool> {
        let mut signs = approach.into_iter().flat_map(|approach| &approach.0);
        (chain.joints.iter())
            .map(|joint| match joint.drive.passive_at {
                Some(_) => true,
                None => signs.next().copied().unwrap_or(true),
            })
            .collect()
    }

    /// Whether both are one side: where nothing is said, all joints turn positively in the end.
    pub fn is_same(one: Option<&Self>, other: Option<&Self>) -> bool {
        one == other || (Self::is_usual(one) && Self::is_usual(other))
    }

    /// Whether all joints turn positively in the end, as they are taken to where nothing is said.
    pub fn is_usual(approach: Option<&Self>) -> bool {
        approach.is_none_or(|approach| approach.0.iter().all(|&positive| positive))
    }
}
