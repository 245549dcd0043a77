//! Variance components of an identification as the tables `[[uncertainty]]` of a scenario, which a plan takes as they are.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::identification::{
    ComponentIntervals, RepeatComponent, RepeatComponents, VarianceComponents,
};
use crate::numeric::markov::Correlation;
use crate::parameter::DiscrepancyOf;
use crate::robot::Joint;
use crate::text::wording::joined;

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

/// Tables, and comments before them.
#[derive(Default)]
struct WrittenTables {
    uncertainty: Vec<ComponentMessage>,
    comments: String,
}

impl WrittenTables {
    /// Adds a table with its intervals in words, unless its estimate is at zero or has no interval, beside the upper limit of that: a plan
    /// would take that for exact.
    fn add(&mut self, table: ComponentMessage, most: f64, intervals: &str) {
        let (std, unit) = match table.std_mm {
            Some(std) => (std, "mm"),
            None => (table.std_mrad.unwrap_or(0.0), "mrad"),
        };
        let name = &table.name;
        if std > LEAST.max(NOTHING * most) && !intervals.is_empty() {
            self.comments += &format!("# {name}, 95 %: {intervals}.\n");
            return self.uncertainty.push(table);
        }
        let limit =
            (most > 0.0).then(|| format!(", its upper limit {} {unit} (95 %)", rounded(most)));
        let limit = limit.unwrap_or_default();
        self.comments += &format!("# No table of {name}: its estimate is zero{limit}.\n");
    }

    /// The TOML; comments alone without tables.
    fn text(mut self) -> Result<String, toml::ser::Error> {
        if self.uncertainty.is_empty() {
            let nothing =
                "# None: the readings show nothing beyond their own standard deviations.\n";
            return Ok(self.comments + nothing);
        }
        if !self.comments.is_empty() {
            self.comments.push('\n');
        }
        let tables = toml::to_string(&BTreeMap::from([("uncertainty", self.uncertainty)]))?;
        Ok(self.comments + &tables)
    }
}

/// An interval in such a unit.
fn said(ends: Option<[f64; 2]>, (factor, unit): (f64, &str)) -> Option<String> {
    let [low, high] = ends?.map(|end| rounded(end * factor));
    Some(format!("{low} to {high} {unit}"))
}

/// What an identification found of each joint's error as a function of the joint's own angle or way, of the pose's discrepancy, and of how
/// joints return, as TOML, with intervals as comments. Joints have names, and slide or do not.
///
/// # Errors
/// The TOML cannot be made.
pub fn uncertainty_tables(
    found: Option<&(VarianceComponents, ComponentIntervals)>,
    repeats: Option<&RepeatComponents>,
    joints: &[Joint],
) -> Result<String, toml::ser::Error> {
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
    let mut tables = WrittenTables::default();
    let functions = found.map_or(&[][..], |(found, _)| &found.functions);
    for (each, place) in functions.iter().zip(0..) {
        let (std, length) = (each.deviation_rad * 1e3, each.kernel.length);
        let table = of_joints("transmission_error", "error function", &[each.joint], std);
        let slides = slides(each.joint);
        let table = ComponentMessage {
            correlation_deg: (!slides).then(|| rounded(length.to_degrees())),
            correlation_mm: slides.then(|| rounded(length * 1e3)),
            correlation: each.kernel.correlation,
            ..table
        };
        let turns = [(1e3, "mrad"), (1_f64.to_degrees(), "deg")];
        let units = if slides { [(1e3, "mm"); 2] } else { turns };
        let intervals = found.iter().flat_map(|(_, known)| {
            let both = [known.deviations[place], known.lengths[place]];
            let names = ["standard deviation", "correlation length"];
            let each = names.into_iter().zip(both).zip(units);
            each.filter_map(|((name, ends), unit)| Some(format!("{name} {}", said(ends, unit)?)))
        });
        let is_known = found.is_some_and(|(_, known)| known.deviations[place].is_some());
        let intervals = joined(intervals.take_while(|_| is_known), ", ");
        tables.add(table, 0.0, &intervals);
    }
    let returned = |joints: &[usize], std: f64| {
        let std = std * OF_A_DIFFERENCE;
        of_joints("joint_repeatability", "repeatability", joints, std)
    };
    let components = repeats.iter().flat_map(|repeats| &repeats.components);
    let of_visits: Vec<&RepeatComponent> =
        components.filter(|each| each.level == "visit").collect();
    for (each, place) in functions.iter().zip(0..) {
        // Repeats say it better.
        if !of_visits.iter().any(|of| of.joints.contains(&each.joint)) {
            let unit = (
                1e3 * OF_A_DIFFERENCE,
                if slides(each.joint) { "mm" } else { "mrad" },
            );
            let interval = found.and_then(|(_, known)| known.repeatabilities[place]);
            let most = interval.map_or(0.0, |[_, high]| high * unit.0);
            let table = returned(&[each.joint], each.repeatability_rad * 1e3);
            tables.add(table, most, &said(interval, unit).unwrap_or_default());
        }
    }
    if let Some((found, known)) = found {
        let remainder = ComponentMessage {
            kind: "discrepancy",
            name: "discrepancy".to_owned(),
            of: Some(DiscrepancyOf::Pose),
            std_mm: Some(rounded(found.rest[0] * 1e3)),
            ..ComponentMessage::default()
        };
        let interval = known.rest_of_positions;
        let most = interval.map_or(0.0, |[_, high]| high * 1e3);
        tables.add(
            remainder,
            most,
            &said(interval, (1e3, "mm")).unwrap_or_default(),
        );
    }
    for each in of_visits {
        let (sliding, turning): (Vec<usize>, Vec<usize>) =
            each.joints.iter().partition(|&&joint| slides(joint));
        for own in [turning, sliding].iter().filter(|own| !own.is_empty()) {
            let most = each.interval95[1] * OF_A_DIFFERENCE;
            let unit = if slides(own[0]) { "mm" } else { "mrad" };
            let interval = said(Some(each.interval95), (OF_A_DIFFERENCE, unit));
            let table = returned(own, each.standard_uncertainty);
            tables.add(table, most, &interval.unwrap_or_default());
        }
    }
    tables.text()
}
