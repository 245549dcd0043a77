//! A selection of models, as a record.

use serde::Serialize;

use super::absolute::RejectedMessage;
use crate::identification::{
    CrossValidation, DistanceStatistics, ModelSelection, NestedModel, ParameterGroup,
};

/// Models with more and more parameters.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModelSelectionMessage {
    /// From frames alone upwards.
    pub nested_models: Vec<NestedModelMessage>,
    /// What makes no nested model.
    pub skipped: Vec<SkippedNestedModelMessage>,
    /// How many blocks of joint space were left out one by one.
    pub blocks: usize,
    /// How many readings all nested models predict from the other blocks.
    pub readings_judged: usize,
    /// The place of the nested model of the smallest cross-validated loss, from 0; null where none could be judged.
    pub best: Option<usize>,
    /// The place of the lowest nested model whose loss is within one standard error of that.
    pub recommended: Option<usize>,
    /// What is recommended, and why.
    pub sentences: Vec<String>,
    /// The readings that were left out of all nested models, since they lie far out of the highest.
    pub rejected: Vec<RejectedMessage>,
}

/// A group of parameters that makes no nested model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SkippedNestedModelMessage {
    /// The group.
    pub added: String,
    /// Why.
    pub reason: String,
}

/// A model of the model selection.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NestedModelMessage {
    /// What it has more than the one below.
    pub added: String,
    /// All that it has, as `--parameters` takes it.
    pub groups: Vec<String>,
    /// The number of unknowns, frames among them.
    pub unknowns: usize,
    /// What the readings do not determine, in sentences.
    pub undetermined: Vec<String>,
    /// Distances of all readings from their fit (mm).
    pub distance_mm: Option<DistanceStatistics>,
    /// Angles from it (mrad); null where positions were read.
    pub angle_mrad: Option<DistanceStatistics>,
    /// The standard deviation of what it does not explain, of each coordinate of a position (mm).
    pub discrepancy_mm: f64,
    /// The same of rotations (mrad).
    pub discrepancy_mrad: f64,
    /// What it leaves of blocks that it was not fitted to; null where it cannot be fitted without one.
    pub cross_validation: Option<CrossValidationMessage>,
    /// Why not.
    pub not_judged: Option<String>,
}

/// What a nested model leaves of blocks that it was not fitted to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CrossValidationMessage {
    /// Distances from the predicted positions (mm).
    pub distance_mm: Option<DistanceStatistics>,
    /// Angles from the predicted orientations (mrad).
    pub angle_mrad: Option<DistanceStatistics>,
    /// The weighted square over the numbers that were read.
    pub loss: f64,
    /// That less the best nested model's.
    pub beyond_best: f64,
    /// The standard error of this difference, from block to block.
    pub standard_error: f64,
    /// The loss of each block.
    pub block_losses: Vec<f64>,
}

impl From<&ModelSelection> for ModelSelectionMessage {
    fn from(model_selection: &ModelSelection) -> Self {
        let recommendation = model_selection.recommendation.as_ref();
        Self {
            nested_models: (model_selection.nested_models.iter())
                .map(Into::into)
                .collect(),
            skipped: (model_selection.skipped.iter())
                .map(|(added, reason)| SkippedNestedModelMessage {
                    added: added.word().to_owned(),
                    reason: reason.clone(),
                })
                .collect(),
            blocks: model_selection.blocks,
            readings_judged: model_selection.judged,
            best: recommendation.map(|each| each.best),
            recommended: recommendation.map(|each| each.nested_model),
            sentences: recommendation.map_or_else(Vec::new, |each| each.sentences.clone()),
            rejected: (model_selection.rejected.iter())
                .map(RejectedMessage::from)
                .collect(),
        }
    }
}

impl From<&NestedModel> for NestedModelMessage {
    fn from(nested_model: &NestedModel) -> Self {
        let words = |groups: &[ParameterGroup]| -> Vec<String> {
            groups.iter().map(|each| each.word().to_owned()).collect()
        };
        let judged = nested_model.cross_validation.as_ref();
        Self {
            added: nested_model.added.word().to_owned(),
            groups: words(&nested_model.groups),
            unknowns: nested_model.unknowns,
            undetermined: nested_model.undetermined.clone(),
            distance_mm: (nested_model.distances.as_ref()).map(DistanceStatistics::in_thousandths),
            angle_mrad: (nested_model.angles.as_ref()).map(DistanceStatistics::in_thousandths),
            discrepancy_mm: nested_model.discrepancy[0] * 1e3,
            discrepancy_mrad: nested_model.discrepancy[1] * 1e3,
            cross_validation: judged.ok().map(Into::into),
            not_judged: judged.err().cloned(),
        }
    }
}

impl From<&CrossValidation> for CrossValidationMessage {
    fn from(judged: &CrossValidation) -> Self {
        Self {
            distance_mm: (judged.distances.as_ref()).map(DistanceStatistics::in_thousandths),
            angle_mrad: (judged.angles.as_ref()).map(DistanceStatistics::in_thousandths),
            loss: judged.loss,
            beyond_best: judged.beyond_best,
            standard_error: judged.standard_error,
            block_losses: judged.block_losses.clone(),
        }
    }
}
