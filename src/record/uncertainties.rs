//! Variance components of an identification as the tables `[[uncertainty]]` of a scenario, which a plan takes as they are.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::identification::{RepeatComponents, VarianceComponents};
use crate::numeric::markov::Correlation;
use crate::parameter::DiscrepancyOf;
use crate::robot::Joint;

/// A deviation below this (mrad, mm) is none.
const LEAST: f64 = 1e-6;

/// A source says how well joints return between two readings of a deflection: a visit has half the variance.
const OF_A_DIFFERENCE: f64 = std::f64::consts::SQRT_2;

/// One of the tables; what is none is left out.
#[derive(Debug, Default, Serialize)]
struct ComponentMessage {
    kind: &'static str,
    name: String,
    joints: Option<Vec<String>>,
    std_mrad: Option<f64>,
    correlation_deg: Option<f64>,
    #[serde(skip_serializing_if = "Correlation::is_exponential")]
    correlation: Correlation,
    of: Option<DiscrepancyOf>,
    std_mm: Option<f64>,
}

/// Four digits: no variance component is known better.
fn rounded(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// What an identification found of each joint's error as a function of the joint's own angle, of the pose's discrepancy, and of how
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
    let repeatability = |joints: Vec<String>, std_mrad, std_mm| ComponentMessage {
        kind: "joint_repeatability",
        name: format!("{} repeatability", joints.join(", ")),
        joints: Some(joints),
        std_mrad,
        std_mm,
        ..ComponentMessage::default()
    };
    let functions = found.iter().flat_map(|found| &found.functions);
    let mut uncertainty: Vec<ComponentMessage> = functions
        .filter(|each| each.deviation_rad * 1e3 > LEAST)
        .map(|each| ComponentMessage {
            kind: "transmission_error",
            name: format!("{} error function", name(each.joint)),
            joints: Some(vec![name(each.joint)]),
            std_mrad: Some(rounded(each.deviation_rad * 1e3)),
            correlation_deg: Some(rounded(each.kernel.length.to_degrees())),
            correlation: each.kernel.correlation,
            ..ComponentMessage::default()
        })
        .collect();
    let repeated: Vec<usize> = (repeats.iter().flat_map(|repeats| &repeats.components))
        .filter(|each| each.level == "visit")
        .flat_map(|each| each.joints.iter().copied())
        .collect();
    for each in found.iter().flat_map(|found| &found.functions) {
        // Repeats say it better.
        let std = each.repeatability_rad * 1e3 * OF_A_DIFFERENCE;
        if std > LEAST && !repeated.contains(&each.joint) {
            let std_mrad = Some(rounded(std));
            uncertainty.push(repeatability(vec![name(each.joint)], std_mrad, None));
        }
    }
    let remainder_mm = found.map_or(0.0, |found| found.rest[0] * 1e3);
    if remainder_mm > LEAST {
        uncertainty.push(ComponentMessage {
            kind: "discrepancy",
            name: "discrepancy".to_owned(),
            of: Some(DiscrepancyOf::Pose),
            std_mm: Some(rounded(remainder_mm)),
            ..ComponentMessage::default()
        });
    }
    let components = repeats.iter().flat_map(|repeats| &repeats.components);
    for each in components.filter(|each| each.level == "visit") {
        // A source is of joints that turn, or of joints that slide.
        for slides in [false, true] {
            let own = each
                .joints
                .iter()
                .filter(|&&joint| joints[joint].drive.slides == slides);
            let own: Vec<String> = own.map(|&joint| name(joint)).collect();
            let std = each.standard_uncertainty * OF_A_DIFFERENCE;
            let std = Some(rounded(std)).filter(|std| *std > LEAST);
            if !own.is_empty() && std.is_some() {
                let (std_mrad, std_mm) = (std.filter(|_| !slides), std.filter(|_| slides));
                uncertainty.push(repeatability(own, std_mrad, std_mm));
            }
        }
    }
    if uncertainty.is_empty() {
        return Ok(None);
    }
    toml::to_string(&BTreeMap::from([("uncertainty", uncertainty)])).map(Some)
}
