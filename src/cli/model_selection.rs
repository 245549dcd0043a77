//! A selection of models, for a person.

use crate::identification::{DistanceStatistics, ModelSelection, NestedModel};

use super::command_prelude::*;

/// What the row of the recommended model with joint error functions is called.
const JOINT_ERRORS: &str = "that + joint error functions";

/// Nested models, and which one to use.
pub fn describe(model_selection: &ModelSelection) -> String {
    let recommended = model_selection.recommendation.as_ref();
    let row = |name: String, nested_model: &NestedModel, is_recommended: bool| {
        let judged = nested_model.cross_validation.as_ref().ok();
        let predicted = judged.and_then(|judged| judged.distances.as_ref());
        let rms = |lengths: Option<&DistanceStatistics>| {
            number(lengths.map(|lengths| lengths.rms * 1e3), 4)
        };
        let mark = if is_recommended { "  <- use" } else { "" };
        vec![
            name + mark,
            nested_model.unknowns.to_string(),
            rms(nested_model.distances.as_ref()),
            rms(predicted),
            or_dash(judged, |judged| {
                format!("{:.4} +- {:.4}", judged.beyond_best, judged.standard_error)
            }),
        ]
    };
    let nested = model_selection.nested_models.iter().enumerate();
    let nested = nested.map(|(place, model)| {
        let is_recommended = recommended.is_some_and(|each| each.nested_model == place);
        row(model_selection.name(place), model, is_recommended)
    });
    let more = model_selection.with_joint_errors.iter().map(|model| {
        let is_recommended = model_selection.recommends_joint_errors();
        row(JOINT_ERRORS.to_owned(), model, is_recommended)
    });
    let rows = nested.chain(more);
    let header = "model | unknowns | fitted rms [mm] | predicted rms [mm] | loss over the best";
    let mut text = table(header, rows);
    text += &format!(
        "  predicted: each of {} blocks of joint space by a fit to the others ({} readings); loss: weighted squares of \
         that, with the standard error of the difference\n",
        model_selection.blocks, model_selection.judged
    );
    let rejected = model_selection.rejected.iter().map(|each| each.reading + 1);
    let readings = match rejected.len() {
        1 => "  outliers of the largest model, left out of all: reading {}\n",
        _ => "  outliers of the largest model, left out of all: readings {}\n",
    };
    text += &naming(rejected, readings);
    for nested_model in &model_selection.nested_models {
        if let Err(reason) = &nested_model.cross_validation {
            let added = nested_model.added.word();
            text += &format!("  {added} is not compared: {reason}\n");
        }
    }
    for (added, reason) in &model_selection.skipped {
        text += &format!("  no model with {}: {reason}\n", added.word());
    }
    text += "\n";
    for sentence in recommended.map_or(&[][..], |each| &each.sentences) {
        text += &format!("  {sentence}\n");
    }
    text
}
