//! Candidates as a record.

use serde::Serialize;

use crate::plan::search::{Candidates, LeftOutCandidates};

/// What a plan was chosen from.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CandidatesMessage {
    /// How many there were, each row of the file under each load.
    pub offered: usize,
    /// How many are possible.
    pub possible: usize,
    /// Why others are not.
    pub left_out: Vec<LeftOutCandidates>,
}

impl CandidatesMessage {
    /// The record.
    pub fn new(candidates: &Candidates) -> Self {
        Self {
            offered: candidates.offered,
            possible: candidates.experiments.len(),
            left_out: candidates.left_out.clone(),
        }
    }
}
