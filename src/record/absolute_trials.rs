//! The reference simulation of a plan of absolute readings, as a record.

use serde_json::{Value, json};

use super::study::StudyPlanMessage;
use crate::plan::absolute::PredictedAccuracy;
use crate::study::summary::Measured;
use crate::study::{Conditions, account::Account, tally::Tally, verdict::Kept};
use crate::task::Task;

/// Robots that were drawn, read as the plan says, identified and looked at.
#[derive(Debug, Clone, PartialEq)]
pub struct AbsoluteTrials {
    /// What a study says of as many runs; there is at least one.
    pub runs: StudyPlanMessage,
    /// What the first robot failed by that could not be identified, or not looked at.
    pub first_failure: Option<String>,
    /// The share of robots that stayed below what 95 % were predicted to.
    pub below_quantile95: Option<f64>,
    /// Whether the prediction holds: within three standard errors and 2 %.
    pub prediction: Kept,
}

impl AbsoluteTrials {
    /// A plan's runs, with what was predicted, and is hidden; `None` where no run says anything.
    pub fn new(
        task: &Task,
        prediction: &PredictedAccuracy,
        account: &Account,
        (tally, first_failure): (&Tally, Option<String>),
    ) -> Option<Self> {
        let conditions = Conditions::plain(task, prediction.readings);
        let predicted = (Some(account), prediction.quantile95_m);
        let name = "virtual robots";
        let runs = StudyPlanMessage::new(name, &conditions, 0, (tally, None), predicted);
        let observed_mm = Measured {
            value: runs.rms_mm?,
            standard_error: runs.rms_std_mm?,
        };
        let below = |quantile95_m: f64| tally.share_below(quantile95_m / conditions.sigma_m);
        Some(Self {
            first_failure,
            below_quantile95: prediction.quantile95_m.and_then(below),
            prediction: Kept::of(account.predicted_m * 1e3, observed_mm),
            runs,
        })
    }

    /// What became of the prediction, in words that follow it.
    pub fn outcome(&self) -> String {
        let verdict = self.runs.verdict.as_deref().unwrap_or_default();
        match self.prediction {
            Kept::Holds => verdict.to_owned(),
            Kept::Exceeded | Kept::Conservative => format!("is {verdict}"),
        }
    }

    /// The record.
    pub fn json(&self) -> Value {
        let runs = &self.runs;
        json!({
            "robots": runs.runs + runs.failed,
            "failed": runs.failed,
            "first_failure": self.first_failure,
            "predicted_rms_mm": runs.combined_rms_mm,
            "rms_mm": runs.rms_mm,
            "rms_std_mm": runs.rms_std_mm,
            "below_quantile95": self.below_quantile95,
            "coverage95": runs.coverage95,
            "prediction": self.prediction,
            "verdict": runs.verdict,
            "contributions": runs.contributions,
            "histogram": runs.histogram,
        })
    }
}
