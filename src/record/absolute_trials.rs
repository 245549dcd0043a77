//! The reference simulation of a plan of absolute readings, as a record.

use serde::Serialize;

use super::study::{HistogramMessage, StudyPlanMessage};
use crate::plan::absolute::PredictedAccuracy;
use crate::study::account::{Account, Contribution};
use crate::study::summary::Measured;
use crate::study::{Conditions, tally::Tally, verdict::Kept};
use crate::task::Task;

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
    pub prediction: Kept,
    /// The same in words, with what breaks it most.
    pub verdict: String,
    /// The contributions that are predicted, and those of what the planner's model does not know.
    pub contributions: Vec<Contribution>,
    /// How often which distances were left.
    pub histogram: HistogramMessage,
    /// The same as a study has it.
    #[serde(skip)]
    pub as_study: StudyPlanMessage,
}

impl AbsoluteTrialsMessage {
    /// The record of a plan's runs, with what was predicted, and is hidden; `None` where no run says anything.
    pub fn new(
        task: &Task,
        prediction: &PredictedAccuracy,
        account: &Account,
        (tally, first_failure): (&Tally, Option<String>),
    ) -> Option<Self> {
        let conditions = Conditions::plain(task, prediction.readings);
        let predicted = (Some(account), prediction.quantile95_m);
        let name = "virtual robots";
        let as_study = StudyPlanMessage::new(name, &conditions, 0, (tally, None), predicted);
        let predicted_rms_mm = account.predicted_m * 1e3;
        let observed_mm = Measured {
            value: as_study.rms_mm?,
            standard_error: as_study.rms_std_mm?,
        };
        let below = |quantile95_m: f64| tally.share_below(quantile95_m / conditions.sigma_m);
        Some(Self {
            robots: tally.runs + tally.failures(),
            failed: as_study.failed,
            first_failure,
            predicted_rms_mm,
            rms_mm: observed_mm.value,
            rms_std_mm: observed_mm.standard_error,
            below_quantile95: prediction.quantile95_m.and_then(below),
            coverage95: as_study.coverage95,
            prediction: Kept::of(predicted_rms_mm, observed_mm),
            verdict: as_study.verdict.clone()?,
            contributions: as_study.contributions.clone(),
            histogram: as_study.histogram.clone(),
            as_study,
        })
    }
}
