//! Patterns in residuals, for a person.

use std::collections::BTreeSet;

use elastocal::identification::patterns::Patterns;
use elastocal::text::wording::{counted, percent};

use super::residuals::probability;

/// What residuals go with; that they go with nothing where much was looked at.
pub fn describe(patterns: &Patterns) -> String {
    if patterns.looked_at == 0 {
        return String::new();
    }
    let mut looked = format!(
        "{} looked at ({}), false alarms in {} of files",
        patterns.looked_at,
        patterns.kinds.join(", "),
        percent(Some(patterns.false_alarm_rate), 0)
    );
    if !patterns.without.is_empty() {
        let without = counted(patterns.without.len() as u64, "rejected reading");
        looked += &format!(", without {without}");
    }
    if patterns.found.is_empty() {
        return format!("  No pattern in the residuals: {looked}.\n");
    }
    let mut text = format!("  Residuals have patterns ({looked}), against\n");
    for pattern in &patterns.found {
        text += &format!(
            "    {}; {} of the residuals' variance, p = {}\n",
            pattern.sentence,
            percent(Some(pattern.share), 1),
            probability(pattern.probability)
        );
    }
    let mut causes: Vec<&str> = patterns.found.iter().map(|each| each.cause).collect();
    let mut named = BTreeSet::new();
    causes.retain(|cause| named.insert(*cause));
    text + &format!("    perhaps {}\n", causes.join("; "))
}
