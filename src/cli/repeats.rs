//! What repeated visits show, for a person.

use elastocal::record::repeats::{RepeatedPoseMessage, RepeatsMessage};
use elastocal::text::wording::counted;

use super::table::{number, table};

/// More poses are in JSON alone.
const SHOWN: usize = 10;

/// Repeatability, accuracy and drift of `what` is read.
pub fn describe(repeats: Option<&RepeatsMessage>, what: &str) -> String {
    let Some(repeats) = repeats else {
        return String::new();
    };
    let visits: usize = repeats.poses.iter().map(|pose| pose.visits).sum();
    let mut text = format!(
        "\n  {} of {}: pose repeatability RP = {:.4} mm of {what} (ISO 9283; pooled, {} of freedom)\n",
        counted(visits as u64, "visit"),
        counted(repeats.poses.len() as u64, "pose"),
        repeats.rp_mm,
        counted(repeats.degrees_of_freedom as u64, "degree"),
    );
    if let Some(drift) = &repeats.drift {
        let [x, y, z] = drift.slope_mm.map(|slope| format!("{slope:.2e}"));
        let [sx, sy, sz] = drift.standard_error_mm.map(|error| format!("{error:.1e}"));
        let p = drift
            .probability
            .map_or_else(String::new, |p| format!("; p = {p:.2e}"));
        text += &format!(
            "  drift by {}: {x}, {y}, {z} mm (standard errors {sx}, {sy}, {sz}{p})\n",
            drift.by
        );
    }
    let row = |pose: &RepeatedPoseMessage| {
        vec![
            pose.first.to_string(),
            pose.visits.to_string(),
            number(pose.rp_mm, 4),
            number(pose.ap_mm, 4),
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
