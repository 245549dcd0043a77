//! The record of what exchanges of one measurement can gain.

use serde::{Deserialize, Serialize};

use super::messages::ProofMessage;
use crate::plan::Criterion;
use crate::plan::search::{Exchanges, NoBound, OneExchange};

/// What exchanging any one measurement of a plan can gain. Values are `rho0_mm` for the criterion `test_pose`, and for others
/// as in `criteria`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "view", derive(schemars::JsonSchema))]
pub struct ExchangesMessage {
    /// No exchange has a better value; null where that is not proved for every experiment, or none may be exchanged.
    pub proved_best: Option<f64>,
    /// By what share of its value an exchange can make the plan better, at most; as for `proved_best`.
    pub proved_largest_gain: Option<f64>,
    /// The number of boxes that the proofs took.
    pub boxes: u64,
    /// For each experiment that may be exchanged.
    pub experiments: Vec<ExchangeMessage>,
    /// Why nothing can be said; null where something is.
    pub reason: Option<String>,
}

/// What one measurement of an experiment can be exchanged for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "view", derive(schemars::JsonSchema))]
pub struct ExchangeMessage {
    /// The experiment's number, from 1.
    pub experiment: usize,
    /// The value of the best exchange that was come across.
    pub found: f64,
    /// No exchange has a better value; null where that is not proved.
    pub proved: Option<f64>,
    /// How near the proof is; null where there is none.
    pub proof: Option<ProofMessage>,
    /// Why it is not proved; null where it is.
    pub no_proof_reason: Option<String>,
}

impl ExchangesMessage {
    /// The record of what exchanges can gain.
    #[must_use]
    pub fn new(exchanges: &Result<Exchanges, NoBound>) -> Self {
        let exchanges = match exchanges {
            Ok(exchanges) => exchanges,
            Err(reason) => {
                return Self {
                    proved_best: None,
                    proved_largest_gain: None,
                    boxes: 0,
                    experiments: Vec::new(),
                    reason: Some(reason.to_string()),
                };
            }
        };
        let unit = if exchanges.criterion == Criterion::TestPose {
            1e3
        } else {
            1.0
        };
        let message = |each: &OneExchange| {
            let proof = each.proof.as_ref().ok();
            ExchangeMessage {
                experiment: each.experiment + 1,
                found: each.found * unit,
                proved: proof.map(|proof| proof.best * unit),
                proof: proof.map(ProofMessage::from),
                no_proof_reason: each.proof.as_ref().err().map(ToString::to_string),
            }
        };
        Self {
            proved_best: exchanges.best().map(|best| best * unit),
            proved_largest_gain: exchanges.largest_gain(),
            boxes: exchanges.boxes(),
            experiments: exchanges.each.iter().map(message).collect(),
            reason: None,
        }
    }
}
