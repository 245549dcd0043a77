//! Patterns in residuals, for a person.

use elastocal::identification::patterns::Pattern;
use elastocal::record::patterns::PatternsMessage;
use elastocal::text::wording::{counted, percent};

use super::residuals::probability;

/// What residuals go with; that they go with nothing where much was looked at.
pub fn describe(patterns: &PatternsMessage) -> String {
    if patterns.looked_at == 0 {
        return String::new();
    }
    let looked = format!(
        "{} looked at ({}), false alarms in {} of files",
        patterns.looked_at,
        patterns.kinds.join(", "),
        percent(Some(patterns.false_alarm_rate), 0)
    );
    let looked = match patterns.without.len() {
        0 => looked,
        count => format!(
            "{looked}, without {}",
            counted(count as u64, "rejected reading")
        ),
    };
    if patterns.found.is_empty() {
        return format!("  No pattern in the residuals: {looked}.\n");
    }
    let found = || patterns.found.iter().map(|each| &each.pattern);
    let row = |pattern: &Pattern| {
        format!(
            "    {}; {} of the residuals' variance, p = {}\n",
            pattern.sentence,
            percent(Some(pattern.share), 1),
            probability(pattern.probability)
        )
    };
    let rows: String = found().map(row).collect();
    let mut causes: Vec<&str> = Vec::new();
    for pattern in found() {
        if !causes.contains(&pattern.cause) {
            causes.push(pattern.cause);
        }
    }
    format!(
        "  Residuals have patterns ({looked}), against\n{rows}    perhaps {}\n",
        causes.join("; ")
    )
}
