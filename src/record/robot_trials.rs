//! Virtual robots on which one plan was tried, as a record.

use serde_json::{Value, json};

use super::study::StudyPlanMessage;
use crate::study::account::{Account, predicted_quantile95_m};
use crate::study::runner::Runner;
use crate::study::summary::Measured;
use crate::study::{StudyError, tally::Tally, verdict::Kept};
use crate::task::AccuracyKind;
use crate::text::wording::counted;

/// Robots that were drawn, measured as the plan says, identified and looked at.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotTrials {
    /// What a study says of as many runs; there is at least one.
    pub runs: StudyPlanMessage,
    /// What the first robot failed by that could not be identified, or not looked at.
    pub first_failure: Option<String>,
    /// The share of robots that stayed below what 95 % were predicted to.
    pub below_quantile95: Option<f64>,
    /// Whether the prediction holds: within three standard errors and 2 %.
    pub prediction: Kept,
}

impl RobotTrials {
    /// The runs of the only plan of a study, with what was predicted, and is hidden.
    ///
    /// # Errors
    /// Nothing is predicted, or no run says anything.
    pub fn new(runner: &Runner<'_>, tally: &Tally) -> Result<Self, StudyError> {
        let only = runner.plans().next().ok_or(StudyError::NoPlan)?;
        let account = Account::of_plan(only).ok_or(StudyError::NoPrediction)?;
        let quantile95_m = predicted_quantile95_m(only);
        let conditions = only.setting.conditions;
        let predicted = (Some(&account), quantile95_m);
        let runs = StudyPlanMessage::new(
            &only.entry.name,
            (&conditions, AccuracyKind::Absolute),
            0,
            (tally, None),
            predicted,
        );
        let first_failure = runner.first_failure();
        let (Some(value), Some(standard_error)) = (runs.rms_mm, runs.rms_std_mm) else {
            return Err(StudyError::AllFailed {
                robots: runs.failed,
                first: first_failure.unwrap_or_default(),
            });
        };
        let observed_mm = Measured {
            value,
            standard_error,
        };
        let below = |quantile95_m: f64| tally.share_below(quantile95_m / conditions.sigma_m);
        Ok(Self {
            first_failure,
            below_quantile95: quantile95_m.and_then(below),
            prediction: Kept::of(
                account.predicted_m * 1e3,
                observed_mm,
                tally.runs,
                tally.failed_share(),
            ),
            runs,
        })
    }

    /// What was seen beside what was predicted, in words.
    pub fn outcome(&self) -> String {
        let runs = &self.runs;
        let [rms, std, predicted] = [runs.rms_mm, runs.rms_std_mm, runs.combined_rms_mm]
            .map(|value_mm| format!("{:.5}", value_mm.unwrap_or(f64::NAN)));
        let below = self.below_quantile95.map(|share| {
            let percent = share * 100.0;
            format!("; {percent:.1} % stay below what 95 % should")
        });
        let is = match self.prediction {
            Kept::Holds => "",
            Kept::Exceeded | Kept::Conservative | Kept::Undecided => "is ",
        };
        format!(
            "Of {} sampled, read by the plan and identified: residual error {rms} +- {std} mm rms, predicted {predicted} mm{}. \
             The prediction {is}{}.",
            counted(runs.runs, "virtual robot"),
            below.unwrap_or_default(),
            runs.verdict.as_deref().unwrap_or_default()
        )
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
