//! A ladder of models, for a person.

use elastocal::record::absolute::shown_unit;
use elastocal::record::ladder::{LadderMessage, ParameterChangeMessage, RungMessage};

use super::residuals::probability;
use super::table::{number, table};

/// So many changes of parameters are told of each rung.
const TOLD: usize = 3;

/// Rungs, what they change, and which one to use.
pub fn describe(ladder: &LadderMessage) -> String {
    let rows: Vec<Vec<String>> = (ladder.rungs.iter().enumerate())
        .map(|(place, rung)| row(rung, place, ladder.recommended == Some(place)))
        .collect();
    let header = [
        "model",
        "unknowns",
        "fitted rms [mm]",
        "predicted rms [mm]",
        "loss over the best",
        "F",
        "probability",
    ];
    let mut text = table(&header, &rows);
    text += &format!(
        "  predicted: each of {} blocks of joint space by a fit to the others ({} readings); loss: weighted squares of \
         that, with the standard error of the difference\n",
        ladder.blocks, ladder.readings_judged
    );
    if !ladder.rejected.is_empty() {
        let numbers: Vec<String> = (ladder.rejected.iter())
            .map(|each| each.reading.to_string())
            .collect();
        text += &format!(
            "  left out of all, since they lie far out of the highest: {} {}\n",
            if numbers.len() == 1 {
                "reading"
            } else {
                "readings"
            },
            numbers.join(", ")
        );
    }
    for rung in &ladder.rungs {
        if let Some(reason) = &rung.not_judged {
            text += &format!("  {} is not judged: {reason}\n", rung.added);
        }
        if !rung.changes.is_empty() {
            text += &changes(rung);
        }
    }
    for skipped in &ladder.skipped {
        text += &format!("  no rung for {}: {}\n", skipped.added, skipped.reason);
    }
    text += "\n";
    for sentence in &ladder.sentences {
        text += &format!("  {sentence}\n");
    }
    text
}

fn row(rung: &RungMessage, place: usize, is_recommended: bool) -> Vec<String> {
    let rms = |lengths: Option<f64>| number(lengths, 4);
    let judged = rung.cross_validation.as_ref();
    let predicted = judged.and_then(|judged| judged.distance_mm.as_ref());
    let plus = if place == 0 { "" } else { "+ " };
    let mark = if is_recommended { "  <- use" } else { "" };
    vec![
        format!("{plus}{}{mark}", rung.added),
        rung.unknowns.to_string(),
        rms(rung.distance_mm.as_ref().map(|lengths| lengths.rms)),
        rms(predicted.map(|lengths| lengths.rms)),
        judged.map_or_else(
            || "-".to_owned(),
            |judged| format!("{:.4} +- {:.4}", judged.beyond_best, judged.standard_error),
        ),
        number(rung.test.as_ref().map(|test| test.statistic), 1),
        (rung.test.as_ref()).map_or_else(|| "-".to_owned(), |test| probability(test.probability)),
    ]
}

fn changes(rung: &RungMessage) -> String {
    let told = |change: &ParameterChangeMessage| {
        let (factor, unit) = shown_unit(&change.unit);
        let [low, high] = change.interval95;
        format!(
            "{} {:.4} -> {:.4} (+- {:.4}) {unit}",
            change.name,
            change.before * factor,
            change.after * factor,
            (high - low) / 2.0 * factor
        )
    };
    let all: Vec<String> = rung.changes.iter().take(TOLD).map(told).collect();
    let more = match rung.changes.len().saturating_sub(TOLD) {
        0 => String::new(),
        more => format!(", and {more} more"),
    };
    format!("  {} moves {}{more}\n", rung.added, all.join(", "))
}
