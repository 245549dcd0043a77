//! Variance components of an identification as the tables `[[uncertainty]]` of a scenario, which a plan takes as they are.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::identification::{RepeatComponent, RepeatComponents, VarianceComponents};
use crate::numeric::markov::Correlation;
use crate::parameter::DiscrepancyOf;
use crate::robot::Joint;

/// A deviation below this (mrad, mm) is none: 0.1 um at a metre.
const LEAST: f64 = 1e-4;
/// Nor is one below this share of its upper limit of 95 %.
const NOTHING: f64 = 0.01;

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
    correlation_mm: Option<f64>,
    #[serde(skip_serializing_if = "Correlation::is_exponential")]
    correlation: Correlation,
    of: Option<DiscrepancyOf>,
    std_mm: Option<f64>,
}

/// Four digits: no variance component is known better.
fn rounded(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// What an identification found of each joint's error as a function of the joint's own angle or way, of the pose's discrepancy, and of how
/// joints return, as TOML; none where it found nothing. Joints have names, and slide or do not.
///
/// # Errors
/// The TOML cannot be made.
pub fn uncertainty_tables(
    found: Option<&VarianceComponents>,
    repeats: Option<&RepeatComponents>,
    joints: &[Joint],
) -> Result<Option<String>, toml::ser::Error> {
    let slides = |joint: usize| joints[joint].drive.slides;
    // A source is of joints that turn, or of joints that slide.
    let of_joints = |kind, what: &str, all: &[usize], std: f64| {
        let slides = all.iter().all(|&joint| slides(joint));
        let names = all.iter().map(|&joint| joints[joint].name.clone());
        let (names, std): (Vec<String>, _) = (names.collect(), Some(rounded(std)));
        ComponentMessage {
            kind,
            name: format!("{} {what}", names.join(", ")),
            joints: Some(names),
            std_mrad: std.filter(|_| !slides),
            std_mm: std.filter(|_| slides),
            ..ComponentMessage::default()
        }
    };
    let (mut uncertainty, mut zeros) = (Vec::new(), String::new());
    // Of an estimate at zero a plan is told nothing, as it would take that for exact.
    let mut add = |table: ComponentMessage, most: f64| {
        let (std, unit) = match table.std_mm {
            Some(std) => (std, "mm"),
            None => (table.std_mrad.unwrap_or(0.0), "mrad"),
        };
        if std > LEAST.max(NOTHING * most) {
            return uncertainty.push(table);
        }
        let limit =
            (most > 0.0).then(|| format!(", its upper limit {} {unit} (95 %)", rounded(most)));
        let (name, limit) = (table.name, limit.unwrap_or_default());
        zeros += &format!("# No table of {name}: its estimate is zero{limit}.\n");
    };
    let functions = || found.iter().flat_map(|found| &found.functions);
    for each in functions() {
        let (std, length) = (each.deviation_rad * 1e3, each.kernel.length);
        let table = of_joints("transmission_error", "error function", &[each.joint], std);
        let slides = slides(each.joint);
        let table = ComponentMessage {
            correlation_deg: (!slides).then(|| rounded(length.to_degrees())),
            correlation_mm: slides.then(|| rounded(length * 1e3)),
            correlation: each.kernel.correlation,
            ..table
        };
        add(table, 0.0);
    }
    let returned = |joints: &[usize], std: f64| {
        let std = std * OF_A_DIFFERENCE;
        of_joints("joint_repeatability", "repeatability", joints, std)
    };
    let components = repeats.iter().flat_map(|repeats| &repeats.components);
    let of_visits: Vec<&RepeatComponent> =
        components.filter(|each| each.level == "visit").collect();
    for each in functions() {
        // Repeats say it better.
        if !of_visits.iter().any(|of| of.joints.contains(&each.joint)) {
            add(returned(&[each.joint], each.repeatability_rad * 1e3), 0.0);
        }
    }
    if let Some(found) = found {
        let remainder = ComponentMessage {
            kind: "discrepancy",
            name: "discrepancy".to_owned(),
            of: Some(DiscrepancyOf::Pose),
            std_mm: Some(rounded(found.rest[0] * 1e3)),
            ..ComponentMessage::default()
        };
        add(remainder, 0.0);
    }
    for each in of_visits {
        let (sliding, turning): (Vec<usize>, Vec<usize>) =
            each.joints.iter().partition(|&&joint| slides(joint));
        for own in [turning, sliding].iter().filter(|own| !own.is_empty()) {
            let most = each.interval95[1] * OF_A_DIFFERENCE;
            add(returned(own, each.standard_uncertainty), most);
        }
    }
    if uncertainty.is_empty() {
        return Ok(None);
    }
    if !zeros.is_empty() {
        zeros.push('\n');
    }
    let tables = toml::to_string(&BTreeMap::from([("uncertainty", uncertainty)]))?;
    Ok(Some(zeros + &tables))
}
