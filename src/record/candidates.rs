//! Candidates as a record.

use serde::Serialize;

use crate::plan::search::{Candidates, LeftOutCandidates};

/// What a plan was chosen from.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "view", derive(schemars::JsonSchema))]
pub struct CandidatesMessage {
    /// How many there were, each row of the file under each load.
    pub offered: usize,
    /// How many are possible.
    pub possible: usize,
    /// Why others are not.
    pub left_out: Vec<LeftOutCandidatesMessage>,
}

/// Candidates that are not possible for one reason.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "view", derive(schemars::JsonSchema))]
pub struct LeftOutCandidatesMessage {
    /// What is violated.
    pub what: String,
    /// How many.
    pub count: usize,
    /// The line of the first in its file.
    pub line: usize,
    /// What is wrong with that.
    pub first: String,
}

impl LeftOutCandidatesMessage {
    /// The record.
    #[must_use]
    pub fn new(each: &LeftOutCandidates) -> Self {
        Self {
            what: each.what.clone(),
            count: each.count,
            line: each.line,
            first: each.first.clone(),
        }
    }
}

impl CandidatesMessage {
    /// The record.
    #[must_use]
    pub fn new(candidates: &Candidates) -> Self {
        Self {
            offered: candidates.offered,
            possible: candidates.experiments.len(),
            left_out: (candidates.left_out.iter())
                .map(LeftOutCandidatesMessage::new)
                .collect(),
        }
    }
}
