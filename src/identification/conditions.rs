//! The conditions of an identification, by name.

use super::outliers::{IMPLAUSIBLE, RejectedReading};
use super::{Identification, NominalCompliance, UncertainEstimate};
use crate::codes::{Condition, ConditionCode};
use crate::quantities::plausible::ELASTIC_COMPLIANCE;

/// A larger share of the readings than this is not left out without being a condition.
const MANY_LEFT_OUT: f64 = 0.05;
/// Joints that are springs leave less than this share of the deflections of robots (rms of a coordinate).
const SPRINGS_LEAVE: f64 = 0.05;

/// What is told of a fit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Told {
    /// What somebody must act on.
    Condition(Condition),
    /// What the fit counts.
    Note(String),
}

impl Told {
    /// A condition where somebody must act, else a note.
    pub fn new(code: ConditionCode, words: String, must_act: bool) -> Self {
        if must_act {
            Self::Condition(code.with(words))
        } else {
            Self::Note(words)
        }
    }

    /// The condition, if it is one.
    pub fn condition(self) -> Option<Condition> {
        match self {
            Self::Condition(condition) => Some(condition),
            Self::Note(_) => None,
        }
    }

    /// The words of a note.
    pub fn note(self) -> Option<String> {
        match self {
            Self::Note(words) => Some(words),
            Self::Condition(_) => None,
        }
    }
}

/// Of so many readings those that were left out, if any: a condition where these are more than happens.
pub(crate) fn left_out(rejected: &[RejectedReading], count: usize, noun: &str) -> Option<Told> {
    let share = rejected.len() as f64 / count.max(1) as f64;
    let words = RejectedReading::words(rejected, count, noun)?;
    Some(Told::new(
        ConditionCode::Outliers,
        words,
        share > MANY_LEFT_OUT,
    ))
}

/// What is done about residuals that are too large: what the model leaves and how much robots have it leave (m), where it is counted. A
/// condition where it is not, or is more.
pub(super) fn too_large(words: &str, left_and_usual_m: Option<[f64; 2]>) -> Told {
    let is_usual = left_and_usual_m.is_some_and(|[left_m, usual_m]| left_m <= usual_m);
    let done = match left_and_usual_m {
        None => "no model discrepancy in the weights".to_owned(),
        Some([left_m, usual_m]) => format!(
            "model discrepancy of {:.4} mm in the weights, {} the usual {:.4} mm",
            left_m * 1e3,
            if is_usual { "within" } else { "more than" },
            usual_m * 1e3
        ),
    };
    Told::new(
        ConditionCode::ResidualsTooLarge,
        format!("{words}; {done}"),
        !is_usual,
    )
}

/// A compliance (rad/(N m)) that no joint has.
pub fn impossible_compliance(joint: &str, value: f64) -> Option<Condition> {
    let is_negative = if value < 0.0 { "negative, " } else { "" };
    (!ELASTIC_COMPLIANCE.allows(value)).then(|| {
        ConditionCode::ImpossibleCompliance.with(format!(
            "the compliance of {joint} is {is_negative}{value:.3e} rad/(N m), which no joint has"
        ))
    })
}

impl Identification {
    /// All conditions that do not hold.
    pub fn conditions(&self) -> Vec<Condition> {
        let is_nominal = |joint: &&str| self.stays_nominal.iter().any(|each| each.name == **joint);
        let unknown = self.unidentifiable();
        let compliances = (unknown.iter())
            .filter(|joint| !is_nominal(joint))
            .map(|joint| format!("the compliance of {joint}"));
        let unknown =
            |each: &&UncertainEstimate| each.prior_deviation.is_none() && each.estimate.is_none();
        let others = self.uncertain.iter().filter(unknown);
        let undetermined = compliances.chain(others.map(|each| each.words.clone()));
        let undetermined = undetermined.map(|words| {
            ConditionCode::Unidentifiable.with(format!("the measurements do not determine {words}"))
        });
        undetermined.chain(self.doubts()).collect()
    }

    /// Those that put in doubt what is determined.
    pub fn doubts(&self) -> Vec<Condition> {
        self.told()
            .into_iter()
            .filter_map(Told::condition)
            .collect()
    }

    /// What holds since the fit counts it, and nobody need act on.
    pub fn notes(&self) -> Vec<String> {
        self.told().into_iter().filter_map(Told::note).collect()
    }

    fn told(&self) -> Vec<Told> {
        let estimates = (self.parameters.iter()).filter_map(|each| Some((each, each.estimate?)));
        let impossible = estimates.filter_map(|(parameter, estimate)| {
            impossible_compliance(&parameter.name, estimate.value).map(Told::Condition)
        });
        let nominal = (self.stays_nominal.iter()).map(|each: &NominalCompliance| {
            let code = ConditionCode::NegativeCompliance;
            Told::new(code, each.words(), each.is_contradicted())
        });
        let mut told: Vec<Told> = impossible.chain(nominal).collect();
        if self.is_all_weak {
            let words = "all compliances are uncertain by more than their nominal values";
            told.push(Told::Condition(ConditionCode::AllUncertain.with(words)));
        }
        let sigma_mm = self.sigma_m * 1e3;
        if let Some(probability) = self.consistency
            && probability < IMPLAUSIBLE
        {
            let words =
                format!("residuals too large for sigma = {sigma_mm:.4} mm, p = {probability:.1e}");
            let left_and_usual_m = (self.discrepancy)
                .map(|discrepancy| [discrepancy.position_m, SPRINGS_LEAVE * self.deflection_m]);
            told.push(too_large(&words, left_and_usual_m));
        }
        if let Some(probability) = self.consistency_lower
            && probability < IMPLAUSIBLE
        {
            told.push(Told::Condition(ConditionCode::ResidualsTooSmall.with(
                format!("residuals too small for sigma = {sigma_mm:.4} mm, p = {probability:.1e}"),
            )));
        }
        told
    }
}
