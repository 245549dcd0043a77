//! Variance components of an identification as the tables `[[uncertainty]]` of a scenario, which a plan takes as they are.

use serde::Serialize;

use crate::identification::{EstimatedDeviation, RepeatComponents, VarianceComponents};
use crate::robot::Joint;

/// A deviation below this (mrad, mm) is none.
const LEAST: f64 = 1e-6;

/// A source says how well joints return between two readings of a deflection: a visit has half the variance.
const OF_A_DIFFERENCE: f64 = std::f64::consts::SQRT_2;

/// The tables.
#[derive(Debug, Serialize)]
struct UncertaintiesMessage {
    uncertainty: Vec<ComponentMessage>,
}

/// One of them.
#[derive(Debug, Default, Serialize)]
struct ComponentMessage {
    kind: &'static str,
    name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    joints: Option<Vec<String>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    std_mrad: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    correlation_deg: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    std_mm: Option<f64>,
}

/// Four digits: no variance component is known better.
fn rounded(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// What an identification found of each joint's error as a function of the joint's own angle, of what is new at each position, and of how
/// joints return, as TOML; none where it found nothing. Joints have names, and slide or do not.
///
/// # Errors
/// The TOML cannot be made.
pub fn uncertainty_tables(
    found: Option<&VarianceComponents>,
    repeats: Option<&RepeatComponents>,
    joints: &[Joint],
) -> Result<Option<String>, toml::ser::Error> {
    let name = |joint: usize| joints[joint].name.clone();
    let functions = found.iter().flat_map(|found| &found.functions);
    let mut uncertainty: Vec<ComponentMessage> = functions
        .filter(|each| each.deviation_rad * 1e3 > LEAST)
        .map(|each| ComponentMessage {
            kind: "transmission_error",
            name: format!("{} error function", name(each.joint)),
            joints: Some(vec![name(each.joint)]),
            std_mrad: Some(rounded(each.deviation_rad * 1e3)),
            correlation_deg: Some(rounded(each.correlation_rad.to_degrees())),
            ..ComponentMessage::default()
        })
        .collect();
    let remainder_mm = found.map_or(0.0, |found| found.rest[0] * 1e3);
    if remainder_mm > LEAST {
        uncertainty.push(ComponentMessage {
            kind: "discrepancy",
            name: "discrepancy".to_owned(),
            std_mm: Some(rounded(remainder_mm)),
            ..ComponentMessage::default()
        });
    }
    for each in repeats.iter().flat_map(|repeats| &repeats.visit) {
        // A source is of joints that turn, or of joints that slide.
        for slides in [false, true] {
            let own = each
                .joints
                .iter()
                .filter(|&&joint| joints[joint].drive.slides == slides);
            let own: Vec<String> = own.map(|&joint| name(joint)).collect();
            let std = each.deviation.value * 1e3 * OF_A_DIFFERENCE;
            let std = Some(rounded(std)).filter(|std| *std > LEAST);
            if !own.is_empty() && std.is_some() {
                uncertainty.push(ComponentMessage {
                    kind: "joint_repeatability",
                    name: format!("{} repeatability", own.join(", ")),
                    joints: Some(own),
                    std_mrad: std.filter(|_| !slides),
                    std_mm: std.filter(|_| slides),
                    ..ComponentMessage::default()
                });
            }
        }
    }
    if uncertainty.is_empty() {
        return Ok(None);
    }
    toml::to_string(&UncertaintiesMessage { uncertainty }).map(Some)
}

/// A variance component of repeats.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RepeatComponentMessage {
    /// Where it is new: `reading` or `visit`.
    pub level: &'static str,
    /// The joints that return so; none of readings.
    pub joints: Vec<String>,
    /// The unit of the standard deviation: `mrad`, `mm`, or 1 of what is stated for readings.
    pub unit: &'static str,
    /// The standard deviation.
    pub standard_uncertainty: f64,
    /// Its interval of 95 %.
    pub interval95: [f64; 2],
    /// The effective degrees of freedom of its square.
    pub degrees_of_freedom: f64,
}

/// The pose repeatability of a pose by variance components.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PoseRepeatabilityMessage {
    /// Its first row, from 1.
    pub first: usize,
    /// RP without the instrument's noise.
    pub rp_mm: f64,
}

/// Variance components of repeats.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RepeatComponentsMessage {
    /// Each of them.
    pub components: Vec<RepeatComponentMessage>,
    /// The poses.
    pub poses: Vec<PoseRepeatabilityMessage>,
    /// What is not told apart, and what would tell it.
    pub not_separated: Vec<String>,
}

impl RepeatComponentsMessage {
    /// The record; `rows` are the places of the readings that were fitted, from 0.
    pub fn new(found: &RepeatComponents, joints: &[Joint], rows: &[usize]) -> Self {
        let component =
            |level, names: Vec<String>, unit, factor: f64, deviation: EstimatedDeviation| {
                RepeatComponentMessage {
                    level,
                    joints: names,
                    unit,
                    standard_uncertainty: deviation.value * factor,
                    interval95: deviation.interval95.map(|end| end * factor),
                    degrees_of_freedom: deviation.degrees_of_freedom,
                }
            };
        let mut not_separated = Vec::new();
        let reading = found
            .reading
            .map(|reading| component("reading", Vec::new(), "1", 1.0, reading));
        if reading.is_none() {
            not_separated.push(
                "reading from visit: standard deviations of readings are taken as exact; two readings of a target in one visit would tell"
                    .to_owned(),
            );
        }
        let visits = found.visit.iter().map(|each| {
            let names: Vec<String> = each.joints.iter().map(|&joint| joints[joint].name.clone()).collect();
            if names.len() > 1 {
                not_separated.push(format!(
                    "{} from each other: repeats at poses where they move the target otherwise, or more repeats, would tell",
                    names.join(", ")
                ));
            }
            let slides = each.joints.iter().all(|&joint| joints[joint].drive.slides);
            component("visit", names, if slides { "mm" } else { "mrad" }, 1e3, each.deviation)
        });
        let components = reading.into_iter().chain(visits).collect();
        not_separated.extend(found.hidden.iter().map(|&joint| {
            let name = &joints[joint].name;
            format!("{name} does not show: a target off its axis, or rotations, would tell")
        }));
        Self {
            components,
            poses: (found.poses.iter())
                .map(|&(first, repeatability_m)| PoseRepeatabilityMessage {
                    first: rows[first] + 1,
                    rp_mm: repeatability_m * 1e3,
                })
                .collect(),
            not_separated,
        }
    }
}
