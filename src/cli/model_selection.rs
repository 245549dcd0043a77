//! A selection of models, for a person.

use elastocal::identification::DistanceStatistics;
use elastocal::record::model_selection::ModelSelectionMessage;

use super::table::{number, or_dash, table};

/// Nested models, and which one to use.
pub fn describe(model_selection: &ModelSelectionMessage) -> String {
    let rows = (model_selection.nested_models.iter().enumerate()).map(|(place, nested_model)| {
        let judged = nested_model.cross_validation.as_ref();
        let predicted = judged.and_then(|judged| judged.distance_mm.as_ref());
        let rms =
            |lengths: Option<&DistanceStatistics>| number(lengths.map(|lengths| lengths.rms), 4);
        let is_recommended = model_selection.recommended == Some(place);
        let plus = if place == 0 { "" } else { "+ " };
        let mark = if is_recommended { "  <- use" } else { "" };
        vec![
            format!("{plus}{}{mark}", nested_model.added),
            nested_model.unknowns.to_string(),
            rms(nested_model.distance_mm.as_ref()),
            rms(predicted),
            or_dash(judged, |judged| {
                format!("{:.4} +- {:.4}", judged.beyond_best, judged.standard_error)
            }),
        ]
    });
    let header = "model | unknowns | fitted rms [mm] | predicted rms [mm] | loss over the best";
    let mut text = table(header, rows);
    text += &format!(
        "  predicted: each of {} blocks of joint space by a fit to the others ({} readings); loss: weighted squares of \
         that, with the standard error of the difference\n",
        model_selection.blocks, model_selection.readings_judged
    );
    let rejected = model_selection.rejected.iter();
    let numbers: Vec<String> = rejected.map(|each| each.reading.to_string()).collect();
    if !numbers.is_empty() {
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
