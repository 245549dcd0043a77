//! A selection of models, as a record.

use serde_json::{Value, json};

use crate::identification::{
    CrossValidation, DistanceStatistics, ModelSelection, NestedModel, ParameterGroup,
};

/// Models with more and more parameters: distances in mm, angles in mrad; places of models from 0.
pub fn model_selection_json(model_selection: &ModelSelection) -> Value {
    let recommendation = model_selection.recommendation.as_ref();
    let skipped = |(added, reason): &(ParameterGroup, String)| json!({ "added": added.word(), "reason": reason });
    json!({
        "nested_models": model_selection.nested_models.iter().map(nested_model).collect::<Vec<_>>(),
        "skipped": model_selection.skipped.iter().map(skipped).collect::<Vec<_>>(),
        "blocks": model_selection.blocks,
        "readings_judged": model_selection.judged,
        "best": recommendation.map(|each| each.best),
        "recommended": recommendation.map(|each| each.nested_model),
        "with_joint_errors": model_selection.with_joint_errors.as_ref().map(nested_model),
        "recommends_joint_errors": (model_selection.with_joint_errors.as_ref())
            .map(|_| model_selection.recommends_joint_errors()),
        "sentences": recommendation.map_or(&[][..], |each| &each.sentences),
        "rejected": model_selection.rejected,
    })
}

fn nested_model(model: &NestedModel) -> Value {
    let judged = model.cross_validation.as_ref();
    json!({
        "added": model.added.word(),
        "groups": model.groups.iter().map(|each| each.word()).collect::<Vec<_>>(),
        "unknowns": model.unknowns,
        "undetermined": model.undetermined,
        "distance_mm": model.distances.map(DistanceStatistics::in_thousandths),
        "angle_mrad": model.angles.map(DistanceStatistics::in_thousandths),
        "discrepancy_mm": model.discrepancy[0] * 1e3,
        "discrepancy_mrad": model.discrepancy[1] * 1e3,
        "cross_validation": judged.ok().map(cross_validation),
        "not_judged": judged.err(),
    })
}

fn cross_validation(judged: &CrossValidation) -> Value {
    json!({
        "distance_mm": judged.distances.map(DistanceStatistics::in_thousandths),
        "angle_mrad": judged.angles.map(DistanceStatistics::in_thousandths),
        "loss": judged.loss,
        "beyond_best": judged.beyond_best,
        "standard_error": judged.standard_error,
        "block_losses": judged.block_losses,
    })
}
