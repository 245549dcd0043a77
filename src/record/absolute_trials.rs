//! The reference simulation of a plan of absolute readings, as a record.

use serde::Serialize;

use super::account::{ContributionMessage, verdict};
use super::study::{HistogramMessage, StudyPlanMessage};
use crate::study::{Conditions, absolute::AbsoluteTrials, account::Account};

/// Robots that were drawn, read as the plan says, identified and looked at.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AbsoluteTrialsMessage {
    /// How many robots were drawn.
    pub robots: u64,
    /// How many of them could not be identified, or not looked at.
    pub failed: u64,
    /// What the first of these failed by.
    pub first_failure: Option<String>,
    /// The predicted rms distance (mm).
    pub predicted_rms_mm: f64,
    /// The rms distance that was left (mm).
    pub rms_mm: f64,
    /// Its standard error (mm).
    pub rms_std_mm: f64,
    /// The share of robots that stayed below what 95 % were predicted to.
    pub below_quantile95: Option<f64>,
    /// The share of test poses at which the tool was within the region of 95 % that was predicted there.
    pub coverage95: Option<f64>,
    /// `holds`: within three standard errors and 2 %; `exceeded`, or `conservative`.
    pub prediction: &'static str,
    /// The same in words, with what breaks it most.
    pub verdict: String,
    /// The contributions that are predicted, and those of what the planner's model does not know.
    pub contributions: Vec<ContributionMessage>,
    /// How often which distances were left.
    pub histogram: HistogramMessage,
}

impl AbsoluteTrialsMessage {
    /// The record of trials, and what is predicted and hidden.
    pub fn new(trials: &AbsoluteTrials, account: &Account) -> Self {
        let seen_m = trials.summary.rms_m;
        Self {
            robots: trials.robots,
            failed: trials.tally.failures(),
            first_failure: trials.first_failure.clone(),
            predicted_rms_mm: trials.predicted_m * 1e3,
            rms_mm: seen_m.value * 1e3,
            rms_std_mm: seen_m.standard_error * 1e3,
            below_quantile95: trials.below_quantile95(),
            coverage95: trials.tally.coverage(),
            prediction: trials.kept().name(),
            verdict: verdict(account, seen_m),
            contributions: (account.parts.iter())
                .map(ContributionMessage::from)
                .collect(),
            histogram: HistogramMessage::new(&trials.tally, trials.sigma_m),
        }
    }
}

/// The same as what a study says of a plan of so many readings.
pub fn as_study(trials: &AbsoluteTrials, account: &Account, readings: u32) -> StudyPlanMessage {
    let conditions = Conditions {
        sigma_m: trials.sigma_m,
        experiments: readings,
        load_scale: 1.0,
    };
    StudyPlanMessage::new(
        "virtual robots",
        &conditions,
        0,
        (&trials.tally, None),
        (Some(account), trials.quantile95_m),
    )
}
