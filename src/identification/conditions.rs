//! The conditions of an identification, by name.

use super::outliers::{IMPLAUSIBLE, RejectedReading};
use super::{Identification, ParameterEstimate, UncertainEstimate};
use crate::codes::{Condition, ConditionCode};
use crate::quantities::plausible::ELASTIC_COMPLIANCE;
use crate::text::wording::p_value;

/// A larger share of the readings than this is not left out without being a condition.
const MANY_LEFT_OUT: f64 = 0.05;
/// So many readings that are outliers at one end of a table are no chance.
const FEWEST_MOVED: usize = 3;
/// Joints that are springs leave less than this share of the deflections of robots (rms of a coordinate).
const SPRINGS_LEAVE: f64 = 0.05;

/// Residuals of a smaller share of their standard deviations are rounding: a thousandth, by another unit, is noise.
const NOISE_FREE: f64 = 1e-4;

/// A compliance that is negative by more standard errors than this is not so by noise (p = 1e-4).
const BY_NOISE: f64 = 3.719;

/// What is told of a fit: a condition where somebody must act, else what the fit counts, in words.
pub(crate) type Told = Result<Condition, String>;

fn told(code: ConditionCode, words: String, must_act: bool) -> Told {
    if must_act {
        Ok(code.with(words))
    } else {
        Err(words)
    }
}

/// Of so many readings those that were left out, if any: a condition where these are more than happens.
pub(crate) fn left_out(rejected: &[RejectedReading], count: usize, noun: &str) -> Option<Told> {
    let share = rejected.len() as f64 / count.max(1) as f64;
    let mut words = RejectedReading::words(rejected, count, noun)?;
    if let Some(which) = at_one_end(rejected, count, noun) {
        words += &format!("; they are all {which}: was an instrument or a target moved there?");
    }
    let is_many = share > MANY_LEFT_OUT;
    Some(told(ConditionCode::Outliers, words, is_many))
}

/// Which readings those that were left out are, if they are all that there are at one end of so many.
fn at_one_end(rejected: &[RejectedReading], count: usize, noun: &str) -> Option<String> {
    let left_out = rejected.len();
    let kept = count
        .checked_sub(left_out)
        .filter(|_| left_out >= FEWEST_MOVED)?;
    if rejected.iter().all(|each| each.reading < left_out) {
        Some(format!("before {noun} {}", left_out + 1))
    } else if rejected.iter().all(|each| each.reading >= kept) {
        Some(format!("from {noun} {} on", kept + 1))
    } else {
        None
    }
}

/// What is told of residuals that are larger, or smaller, than these standard deviations make them, by the probabilities of as large and
/// of as small ones. Small ones are a condition below a share of the standard deviations, unless there is no noise; large ones where what the
/// model leaves is not counted, or is more than robots have it leave: of positions (m) what is left and what is usual, and of rotations (rad).
pub(super) fn inconsistent(
    [larger, smaller]: [Option<f64>; 2],
    deviations: &str,
    left_and_usual: Option<[[f64; 2]; 2]>,
    [share, least]: [f64; 2],
) -> impl Iterator<Item = Told> {
    let words = |size: &str, probability: Option<f64>| {
        let p = p_value(probability.filter(|each| *each < IMPLAUSIBLE)?);
        Some(format!("residuals too {size} for {deviations}, {p}"))
    };
    // Positions alone leave nothing of rotations.
    let parts = left_and_usual.into_iter().flatten().zip(["mm", "mrad"]);
    let parts = parts.filter(|([left, _], unit)| *unit == "mm" || *left > 0.0);
    let mut is_usual = left_and_usual.is_some();
    let parts: Vec<String> = parts
        .map(|([left, usual], unit)| {
            is_usual &= left <= usual && usual > 0.0;
            let than = ["more than", "within"][usize::from(left <= usual)];
            let [left, usual] = [left, usual].map(|each| each * 1e3);
            format!("{left:.4} {unit} in the weights, {than} the usual {usual:.4} {unit}")
        })
        .collect();
    let done = match &parts[..] {
        [] => "no model discrepancy in the weights".to_owned(),
        parts => format!("model discrepancy of {}", parts.join("; ")),
    };
    let is_overstated = NOISE_FREE < share && share < least;
    let large = words("large", larger).map(|words| format!("{words}; {done}"));
    let large = large.map(|words| told(ConditionCode::ResidualsTooLarge, words, !is_usual));
    let small = words("small", smaller)
        .map(|words| told(ConditionCode::ResidualsTooSmall, words, is_overstated));
    large.into_iter().chain(small)
}

/// A compliance in its unit that no joint has.
pub fn impossible_compliance(joint: &str, (value, unit): (f64, &str)) -> Option<Condition> {
    let is_negative = if value < 0.0 { "negative, " } else { "" };
    (!ELASTIC_COMPLIANCE.allows(value)).then(|| {
        ConditionCode::ImpossibleCompliance.with(format!(
            "the compliance of {joint} is {is_negative}{value:.3e} {unit}, which no joint has"
        ))
    })
}

/// What a compliance that stays nominal would be; a condition where noise does not explain that it would be negative.
fn stays_nominal(parameter: &ParameterEstimate) -> Option<Told> {
    let ParameterEstimate { name, unit, .. } = parameter;
    let found = parameter.estimate?;
    let (value, error) = (found.value, found.standard_error);
    let is_contradicted = value < -BY_NOISE * error;
    let why = if is_contradicted {
        "negative beyond noise"
    } else {
        "less certain than that"
    };
    let words = format!(
        "the compliance of {name} stays nominal: its estimate {value:.3e} +- {error:.1e} {unit} is {why}"
    );
    let code = ConditionCode::NegativeCompliance;
    Some(told(code, words, is_contradicted))
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
            |each: &&UncertainEstimate| each.prior_deviation.is_none() && each.value.is_none();
        let others = self.uncertain.iter().filter(unknown);
        let undetermined = compliances.chain(others.map(|each| each.words.clone()));
        let undetermined = undetermined.map(|words| {
            ConditionCode::Unidentifiable.with(format!("the measurements do not determine {words}"))
        });
        let doubts = self.told().into_iter().filter_map(Result::ok);
        let doubts = self.far_from_priors.clone().into_iter().chain(doubts);
        undetermined.chain(doubts).collect()
    }

    /// What holds since the fit counts it, and nobody need act on.
    pub fn notes(&self) -> Vec<String> {
        self.told().into_iter().filter_map(Result::err).collect()
    }

    fn told(&self) -> Vec<Told> {
        let estimates = (self.parameters.iter()).filter_map(|each| Some((each, each.estimate?)));
        let impossible = estimates.filter_map(|(parameter, estimate)| {
            impossible_compliance(&parameter.name, (estimate.value, parameter.unit)).map(Ok)
        });
        let nominal = (self.stays_nominal.iter()).filter_map(stays_nominal);
        let mut all: Vec<Told> = impossible.chain(nominal).collect();
        if self.is_all_weak {
            let words = "all compliances are uncertain by more than their nominal values";
            all.push(Ok(ConditionCode::AllUncertain.with(words)));
        }
        let left_and_usual = self
            .discrepancy
            .map(|left| [0, 1].map(|part| [left[part], SPRINGS_LEAVE * self.deflections[part]]));
        let sigma = format!("sigma = {:.4} mm", self.sigma_m * 1e3);
        let probabilities = [self.consistency, self.consistency_lower];
        let share = (self.residual_sigma_m).map_or(1.0, |residual_m| residual_m / self.sigma_m);
        let shares = [share, 1.0];
        all.extend(inconsistent(probabilities, &sigma, left_and_usual, shares));
        all
    }
}
