//! A selection of models, for a person.

use elastocal::quantities::units::shown_unit;
use elastocal::record::model_selection::{
    ModelSelectionMessage, NestedModelMessage, ParameterChangeMessage,
};

use super::residuals::probability;
use super::table::{number, or_dash, table};

/// So many changes of parameters are told of each nested model.
const TOLD: usize = 3;

/// Nested models, what they change, and which one to use.
pub fn describe(model_selection: &ModelSelectionMessage) -> String {
    let rows = (model_selection.nested_models.iter().enumerate()).map(|(place, nested_model)| {
        row(
            nested_model,
            place,
            model_selection.recommended == Some(place),
        )
    });
    let header = "model | unknowns | fitted rms [mm] | predicted rms [mm] | loss over the best | F | probability";
    let mut text = table(header, rows);
    text += &format!(
        "  predicted: each of {} blocks of joint space by a fit to the others ({} readings); loss: weighted squares of \
         that, with the standard error of the difference\n",
        model_selection.blocks, model_selection.readings_judged
    );
    if !model_selection.rejected.is_empty() {
        let numbers: Vec<String> = (model_selection.rejected.iter())
            .map(|each| each.reading.to_string())
            .collect();
        text += &format!(
            "  outliers of the largest model, left out of all: {} {}\n",
            if numbers.len() == 1 {
                "reading"
            } else {
                "readings"
            },
            numbers.join(", ")
        );
    }
    for nested_model in &model_selection.nested_models {
        if let Some(reason) = &nested_model.not_judged {
            text += &format!("  {} is not compared: {reason}\n", nested_model.added);
        }
        if !nested_model.changes.is_empty() {
            text += &changes(nested_model);
        }
    }
    for skipped in &model_selection.skipped {
        text += &format!("  no model with {}: {}\n", skipped.added, skipped.reason);
    }
    text += "\n";
    for sentence in &model_selection.sentences {
        text += &format!("  {sentence}\n");
    }
    text
}

fn row(nested_model: &NestedModelMessage, place: usize, is_recommended: bool) -> Vec<String> {
    let rms = |lengths: Option<f64>| number(lengths, 4);
    let judged = nested_model.cross_validation.as_ref();
    let predicted = judged.and_then(|judged| judged.distance_mm.as_ref());
    let plus = if place == 0 { "" } else { "+ " };
    let mark = if is_recommended { "  <- use" } else { "" };
    vec![
        format!("{plus}{}{mark}", nested_model.added),
        nested_model.unknowns.to_string(),
        rms(nested_model.distance_mm.as_ref().map(|lengths| lengths.rms)),
        rms(predicted.map(|lengths| lengths.rms)),
        or_dash(judged, |judged| {
            format!("{:.4} +- {:.4}", judged.beyond_best, judged.standard_error)
        }),
        number(nested_model.test.as_ref().map(|test| test.statistic), 1),
        or_dash(nested_model.test.as_ref(), |test| {
            probability(test.probability)
        }),
    ]
}

fn changes(nested_model: &NestedModelMessage) -> String {
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
    let all: Vec<String> = nested_model.changes.iter().take(TOLD).map(told).collect();
    let more = match nested_model.changes.len().saturating_sub(TOLD) {
        0 => String::new(),
        more => format!(", and {more} more"),
    };
    format!("  {} moves {}{more}\n", nested_model.added, all.join(", "))
}
