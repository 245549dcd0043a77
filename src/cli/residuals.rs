//! What residuals and repeats show, for a person.

use std::collections::BTreeSet;

use crate::identification::patterns::Patterns;
use crate::identification::{
    Identification, MeasurementResidual, RejectedReading, RepeatComponents, RepeatedPose, Repeats,
};
use crate::measurement::Measurement;
use crate::text::wording::percent;
use nalgebra::Vector3;

use super::command_prelude::*;

/// So many measurements are listed, those that fit least first.
const LISTED: usize = 6;

/// The residuals that are farthest from what chance explains.
pub fn residuals(
    identification: &Identification,
    measurements: &[Measurement],
    left: &[MeasurementResidual],
    rejected: &[RejectedReading],
) -> String {
    let mut order: Vec<usize> = (0..left.len()).collect();
    let rank = |index: usize| left[index].probability.unwrap_or(1.0);
    let far = |index: usize| left[index].distance;
    order.sort_by(|&one, &other| {
        (rank(one).total_cmp(&rank(other))).then(far(other).total_cmp(&far(one)))
    });
    let all = order.len();
    order.truncate(LISTED);
    let rows = order.into_iter().map(|index| {
        let residual = &left[index];
        let is_rejected = rejected.iter().any(|each| each.reading == index);
        let residual_m = Vector3::from_column_slice(&identification.residuals_m[3 * index..][..3]);
        let read_m = match measurements[index].direction {
            Some(direction) => vec![direction.dot(&residual_m)],
            None => residual_m.as_slice().to_vec(),
        };
        let standardised = residual.standardised.iter();
        vec![
            format!(
                "{}{}",
                index + 1,
                if is_rejected { " (left out)" } else { "" }
            ),
            joined(
                read_m.iter().map(|value| format!("{:7.4}", value * 1e3)),
                " ",
            ),
            joined(
                standardised.map(|value| format!("{:>5}", number(*value, 1))),
                " ",
            ),
            or_dash(residual.probability, probability),
        ]
    });
    let is_along = |each: &&Measurement| each.direction.is_some();
    let coordinates = match measurements.iter().filter(is_along).count() {
        0 => "x, y, z",
        all if all == measurements.len() => "along the gauge",
        _ => "x, y, z, or along the gauge",
    };
    let header = format!(
        "measurement | residual {coordinates} [mm] | over its standard deviation | probability"
    );
    let mut text = table(&header, rows);
    if all > LISTED {
        text += &format!("  ({} more fit better)\n", all - LISTED);
    }
    text
}

/// A probability with two digits.
pub fn probability(value: f64) -> String {
    if value >= 0.01 {
        format!("{value:.2}")
    } else {
        format!("{value:.1e}")
    }
}

/// What residuals go with; that they go with nothing where much was looked at.
pub fn patterns(found: &Patterns) -> String {
    listed(
        found,
        ["No pattern in the residuals", "Residuals have patterns"],
    )
}

/// What goes with order, time or temperature beside joint error functions, where there are some.
pub fn drifts(found: Option<&Patterns>) -> String {
    let words = [
        "No drift beside joint error functions",
        "Beside joint error functions residuals drift",
    ];
    found.map_or_else(String::new, |found| listed(found, words))
}

/// Patterns, after words for none and for some.
fn listed(found: &Patterns, [none, some]: [&str; 2]) -> String {
    if found.looked_at == 0 {
        return String::new();
    }
    let mut looked = format!(
        "{} looked at ({}), false alarms in {} of files",
        found.looked_at,
        found.kinds.join(", "),
        percent(Some(found.false_alarm_rate), 0)
    );
    if !found.without.is_empty() {
        let without = counted(found.without.len() as u64, "rejected reading");
        looked += &format!(", without {without}");
    }
    if found.found.is_empty() {
        return format!("  {none}: {looked}.\n");
    }
    let mut text = format!("  {some} ({looked}), against\n");
    for pattern in &found.found {
        text += &format!(
            "    {}; {} of the residuals' variance, p = {}\n",
            pattern.sentence,
            percent(Some(pattern.share), 1),
            probability(pattern.probability)
        );
    }
    let mut causes: Vec<&str> = found.found.iter().map(|each| each.cause).collect();
    let mut named = BTreeSet::new();
    causes.retain(|cause| named.insert(*cause));
    text + &format!("    perhaps {}\n", causes.join("; "))
}

/// More poses are in JSON alone.
const SHOWN: usize = 10;

/// Repeatability, accuracy and drift of `what` is read.
pub fn repeats(found: Option<&Repeats>, what: &str) -> String {
    let Some(repeats) = found else {
        return String::new();
    };
    let (visits, freedom) = (repeats.visits, repeats.degrees_of_freedom);
    let mut text = format!(
        "\n  {} of {}: pose repeatability RP = {:.4} mm of {what} (ISO 9283; pooled, {} of freedom)\n",
        counted(visits as u64, "visit"),
        counted((visits - freedom) as u64, "pose"),
        repeats.repeatability_m * 1e3,
        counted(freedom as u64, "degree"),
    );
    if let Some(drift) = &repeats.drift {
        let [x, y, z] = <[f64; 3]>::from(drift.slope_m).map(|slope| format!("{:.2e}", slope * 1e3));
        let [sx, sy, sz] =
            <[f64; 3]>::from(drift.standard_error_m).map(|error| format!("{:.1e}", error * 1e3));
        let p = drift
            .probability
            .map_or_else(String::new, |p| format!("; p = {p:.2e}"));
        text += &format!(
            "  drift by {}: {x}, {y}, {z} mm (standard errors {sx}, {sy}, {sz}{p})\n",
            drift.by
        );
    }
    let row = |pose: &RepeatedPose| {
        vec![
            (pose.first + 1).to_string(),
            pose.visits.to_string(),
            number(pose.repeatability_m.map(|length| length * 1e3), 4),
            number(pose.accuracy_m.map(|length| length * 1e3), 4),
        ]
    };
    let rows = repeats.poses.iter().take(SHOWN).map(row);
    text += &table("first row | visits | RP [mm] | AP [mm]", rows);
    if repeats.poses.len() > SHOWN {
        let more = repeats.poses.len() - SHOWN;
        text += &format!("  and {} in --json\n", counted(more as u64, "more row"));
    }
    text
}

/// Variance components of repeats.
pub fn components(found: Option<&RepeatComponents>) -> String {
    let Some(found) = found else {
        return String::new();
    };
    let rows = found.components.iter().map(|each| {
        let [low, high] = each.interval95;
        vec![
            each.level.to_owned(),
            each.names.join(", "),
            number(Some(each.standard_uncertainty), 4),
            format!("{low:.4} to {high:.4}"),
            format!("{:.1}", each.degrees_of_freedom),
            each.unit.to_owned(),
        ]
    });
    let header = "level | joints | u(x) | 95 % interval | degrees of freedom | unit";
    let mut text = format!(
        "\n  Variance components of repeats (REML):\n{}",
        table(header, rows)
    );
    for sentence in &found.not_separated {
        text += &format!("  not separated: {sentence}\n");
    }
    text
}
