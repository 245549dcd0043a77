//! What repeated visits show, for a person.

use elastocal::identification::{RepeatComponents, RepeatedPose, Repeats};
use elastocal::text::wording::counted;

use super::table::{number, table};

/// More poses are in JSON alone.
const SHOWN: usize = 10;

/// Repeatability, accuracy and drift of `what` is read.
pub fn describe(repeats: Option<&Repeats>, what: &str) -> String {
    let Some(repeats) = repeats else {
        return String::new();
    };
    let visits: usize = repeats.poses.iter().map(|pose| pose.visits).sum();
    let mut text = format!(
        "\n  {} of {}: pose repeatability RP = {:.4} mm of {what} (ISO 9283; pooled, {} of freedom)\n",
        counted(visits as u64, "visit"),
        counted(repeats.poses.len() as u64, "pose"),
        repeats.repeatability_m * 1e3,
        counted(repeats.degrees_of_freedom as u64, "degree"),
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
        text += &format!("  and {} in --json\n", counted(more as u64, "more pose"));
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
