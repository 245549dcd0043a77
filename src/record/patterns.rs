//! Patterns in residuals, as a record.

use serde::Serialize;

use crate::identification::RejectedReading;
use crate::identification::patterns::{
    Against, Course, Drifting, LEVEL, Pattern, PatternPoint, Patterns, WAVES_TO_SEE,
};

/// What residuals go with.
#[derive(Debug, Clone, Serialize)]
pub struct PatternsMessage {
    /// What was found, the strongest first.
    pub found: Vec<PatternMessage>,
    /// How many candidates were looked at.
    pub looked_at: usize,
    /// Against which things.
    pub kinds: Vec<&'static str>,
    /// The probability that anything at all is found in residuals without a pattern.
    pub false_alarm_rate: f64,
    /// The share of the residuals' weighted squares that all found explain together.
    pub share: f64,
    /// The numbers, from 1, of readings that were not looked at, since they lie far out of what the others leave.
    pub without: Vec<usize>,
}

/// Something that residuals go with.
#[derive(Debug, Clone, Serialize)]
pub struct PatternMessage {
    /// Against what: `joint angle`, `joint torque`, `approach`, `order`, `time`, `temperature` or `range`.
    pub against: &'static str,
    /// The joint; null where it is none's.
    pub joint: Option<String>,
    /// How many waves in a revolution, against a joint's angle.
    pub harmonic: Option<usize>,
    /// What drifts, with order, time and temperature: `base`, `size` or `joint`.
    pub drifting: Option<&'static str>,
    /// Its words and numbers.
    #[serde(flatten)]
    pub pattern: Pattern,
    /// The unit of its size: `rad`, `m`, `1` or, of deflections, `rad/(N m)`.
    pub unit: &'static str,
    /// The unit of `at` in the points.
    pub at_unit: &'static str,
    /// Means over the readings.
    pub points: Vec<PatternPoint>,
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
            kinds: patterns.kinds.clone(),
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
    let (at_factor, at_unit) = match against {
        Against::Angle { waves, .. } if waves > WAVES_TO_SEE => {
            (1.0_f64.to_degrees(), "deg of one wave")
        }
        Against::Angle { .. } => (1.0_f64.to_degrees(), "deg"),
        Against::Torque { .. } => (1.0, "N m"),
        Against::Approach { .. } => (1.0, "sign"),
        Against::Course(Course::Order, _) => (1.0, "reading"),
        Against::Course(Course::Time, _) => (1.0, "s"),
        Against::Course(Course::Temperature, _) => (1.0, "deg C"),
        Against::Range => (1.0, "m"),
    };
    let points = pattern.points.iter();
    PatternMessage {
        against: against.kind(),
        joint: against.joint().and_then(|joint| joints.get(joint).cloned()),
        harmonic: match against {
            Against::Angle { waves, .. } => Some(waves),
            _ => None,
        },
        drifting: match against {
            Against::Course(_, drifting) => Some(drifting.word()),
            _ => None,
        },
        pattern: pattern.clone(),
        unit,
        at_unit,
        points: points
            .map(|point| PatternPoint {
                at: point.at * at_factor,
                ..*point
            })
            .collect(),
    }
}
