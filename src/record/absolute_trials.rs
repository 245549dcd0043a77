//! What was seen of a plan of absolute readings, as a record.

use serde::Serialize;

use crate::study::absolute::AbsoluteTrials;

/// Robots that were drawn, read as the plan says, identified and looked at.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "view", derive(schemars::JsonSchema))]
pub struct AbsoluteTrialsMessage {
    /// How many robots were drawn.
    pub robots: u64,
    /// How many of them could not be identified, or not looked at.
    pub failed: u64,
    /// What the first of these failed by.
    pub first_failure: Option<String>,
    /// The promised rms distance (mm).
    pub promised_rms_mm: f64,
    /// The rms distance that was left (mm).
    pub rms_mm: f64,
    /// Its standard error (mm).
    pub rms_std_mm: f64,
    /// The share of robots that stayed below what 95 % were promised to.
    pub below_quantile95: Option<f64>,
    /// `holds`: within three standard errors and 2 %; `broken`, or `too careful`.
    pub promise: &'static str,
}

impl AbsoluteTrialsMessage {
    /// The record of trials.
    #[must_use]
    pub fn new(trials: &AbsoluteTrials) -> Self {
        Self {
            robots: trials.robots,
            failed: trials.failed,
            first_failure: trials.first_failure.clone(),
            promised_rms_mm: trials.promised_m * 1e3,
            rms_mm: trials.seen_m * 1e3,
            rms_std_mm: trials.seen_std_m * 1e3,
            below_quantile95: trials.below_quantile95,
            promise: trials.kept().name(),
        }
    }
}
