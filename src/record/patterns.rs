//! Patterns in residuals, as a record.

use serde::{Deserialize, Serialize};

use crate::identification::RejectedReading;
use crate::identification::patterns::{Against, Drifting, LEVEL, Pattern, Patterns};

/// What residuals go with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct PatternsMessage {
    /// What was found, the strongest first.
    pub found: Vec<PatternMessage>,
    /// How many candidates were looked at.
    pub looked_at: usize,
    /// Against which things.
    pub kinds: Vec<String>,
    /// The probability that anything at all is found in residuals without a pattern.
    pub false_alarm_rate: f64,
    /// The share of the residuals' weighted squares that all found explain together.
    pub share: f64,
    /// The numbers, from 1, of readings that were not looked at, since they lie far out of what the others leave.
    #[serde(default)]
    pub without: Vec<usize>,
}

/// Something that residuals go with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct PatternMessage {
    /// Against what: `joint angle`, `joint torque`, `approach`, `order`, `time`, `temperature` or `range`.
    pub against: String,
    /// The joint; null where it is none's.
    pub joint: Option<String>,
    /// How many waves in a revolution, against a joint's angle.
    pub harmonic: Option<usize>,
    /// What drifts, with order, time and temperature: `base`, `size` or `joint`.
    pub drifting: Option<String>,
    /// The pattern in words.
    pub sentence: String,
    /// What may cause it.
    pub cause: String,
    /// How large it is: the amplitude of waves, the whole range of all else.
    pub size: f64,
    /// The unit of that: `rad`, `m`, `1` or, of deflections, `rad/(N m)`.
    pub unit: String,
    /// The share of the residuals' weighted squares that it explains.
    pub share: f64,
    /// F, over the design effect.
    pub statistic: f64,
    /// Its first number of degrees of freedom.
    pub degrees_of_freedom: usize,
    /// By how much discrepancies that are alike in a block of joint space count less than independent ones.
    pub design_effect: f64,
    /// The probability that chance makes any of all that were looked at as strong.
    pub probability: f64,
}

impl PatternsMessage {
    /// The record of patterns of a robot with these joints; of deflections, or of absolute readings.
    pub fn new(patterns: &Patterns, joints: &[String], is_of_deflections: bool) -> Self {
        let found = patterns.found.iter();
        Self {
            found: found
                .map(|pattern| message(pattern, joints, is_of_deflections))
                .collect(),
            looked_at: patterns.looked_at,
            kinds: patterns.kinds.iter().map(|&kind| kind.to_owned()).collect(),
            false_alarm_rate: LEVEL,
            share: patterns.share,
            without: Vec::new(),
        }
    }

    /// The same of a fit that left out some readings.
    pub fn without(self, rejected: &[RejectedReading]) -> Self {
        Self {
            without: rejected.iter().map(|each| each.reading + 1).collect(),
            ..self
        }
    }
}

fn message(pattern: &Pattern, joints: &[String], is_of_deflections: bool) -> PatternMessage {
    let against = pattern.against;
    let unit = match against {
        Against::Range | Against::Course(_, Drifting::Base) => "m",
        Against::Course(_, Drifting::Size) => "1",
        _ if is_of_deflections => "rad/(N m)",
        _ => "rad",
    };
    PatternMessage {
        against: against.kind().to_owned(),
        joint: against.joint().and_then(|joint| joints.get(joint).cloned()),
        harmonic: match against {
            Against::Angle { waves, .. } => Some(waves),
            _ => None,
        },
        drifting: match against {
            Against::Course(_, drifting) => Some(drifting.word().to_owned()),
            _ => None,
        },
        sentence: pattern.sentence.clone(),
        cause: pattern.cause.to_owned(),
        size: pattern.size,
        unit: unit.to_owned(),
        share: pattern.share,
        statistic: pattern.statistic,
        degrees_of_freedom: pattern.degrees_of_freedom,
        design_effect: pattern.design_effect,
        probability: pattern.probability,
    }
}
