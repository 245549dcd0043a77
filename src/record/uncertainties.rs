//! Variance components of an identification as the tables `[[uncertainty]]` of a scenario, which a plan takes as they are.

use serde::Serialize;

use crate::identification::VarianceComponents;

/// A deviation below this (mrad, mm) is none.
const LEAST: f64 = 1e-6;

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
    joints: Option<[String; 1]>,
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

/// What an identification found of each joint's error as a function of the joint's own angle, and of what is new at each position, as TOML;
/// none where it found neither. `name` gives the joints' names.
///
/// # Errors
/// The TOML cannot be made.
pub fn uncertainty_tables(
    found: &VarianceComponents,
    name: impl Fn(usize) -> String,
) -> Result<Option<String>, toml::ser::Error> {
    let functions = found.functions.iter();
    let mut uncertainty: Vec<ComponentMessage> = functions
        .filter(|each| each.deviation_rad * 1e3 > LEAST)
        .map(|each| ComponentMessage {
            kind: "transmission_error",
            name: format!("{} error function", name(each.joint)),
            joints: Some([name(each.joint)]),
            std_mrad: Some(rounded(each.deviation_rad * 1e3)),
            correlation_deg: Some(rounded(each.correlation_rad.to_degrees())),
            ..ComponentMessage::default()
        })
        .collect();
    let remainder_mm = found.rest[0] * 1e3;
    if remainder_mm > LEAST {
        uncertainty.push(ComponentMessage {
            kind: "discrepancy",
            name: "discrepancy".to_owned(),
            std_mm: Some(rounded(remainder_mm)),
            ..ComponentMessage::default()
        });
    }
    if uncertainty.is_empty() {
        return Ok(None);
    }
    toml::to_string(&UncertaintiesMessage { uncertainty }).map(Some)
}
