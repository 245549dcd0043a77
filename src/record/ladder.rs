//! A ladder of models, as a record.

use serde::{Deserialize, Serialize};

use super::absolute::{LengthsMessage, RejectedMessage, quantity_unit};
use crate::identification::{
    CrossValidation, Ladder, ParameterChange, ParameterGroup, Rung, RungTest,
};

/// Models with more and more parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "view", derive(schemars::JsonSchema))]
pub struct LadderMessage {
    /// From frames alone upwards.
    pub rungs: Vec<RungMessage>,
    /// What makes no rung.
    pub skipped: Vec<SkippedRungMessage>,
    /// How many blocks of joint space were left out one by one.
    pub blocks: usize,
    /// How many readings all rungs predict from the other blocks.
    pub readings_judged: usize,
    /// The place of the rung of the smallest cross-validated loss, from 0; null where none could be judged.
    pub best: Option<usize>,
    /// The place of the lowest rung whose loss is within one standard error of that.
    pub recommended: Option<usize>,
    /// What is recommended, and why.
    pub sentences: Vec<String>,
    /// The readings that were left out of all rungs, since they lie far out of the highest.
    #[serde(default)]
    pub rejected: Vec<RejectedMessage>,
}

/// A group of parameters that makes no rung.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "view", derive(schemars::JsonSchema))]
pub struct SkippedRungMessage {
    /// The group.
    pub added: String,
    /// Why.
    pub reason: String,
}

/// A model of the ladder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "view", derive(schemars::JsonSchema))]
pub struct RungMessage {
    /// What it has more than the one below.
    pub added: String,
    /// All that it has, as `--parameters` takes it.
    pub groups: Vec<String>,
    /// The number of unknowns, frames among them.
    pub unknowns: usize,
    /// What the readings do not determine, in sentences.
    pub undetermined: Vec<String>,
    /// Distances of all readings from their fit (mm).
    pub distance_mm: Option<LengthsMessage>,
    /// Angles from it (mrad); null where positions were read.
    pub angle_mrad: Option<LengthsMessage>,
    /// The standard deviation of what it does not explain, of each coordinate of a position (mm).
    pub misfit_mm: f64,
    /// The same of rotations (mrad).
    pub misfit_mrad: f64,
    /// What it leaves of blocks that it was not fitted to; null where it cannot be fitted without one.
    pub cross_validation: Option<CrossValidationMessage>,
    /// Why not.
    pub not_judged: Option<String>,
    /// Whether it explains more than the one below; null for the lowest.
    pub test: Option<RungTestMessage>,
    /// The parameters that it moves out of their intervals, those moved farthest first.
    pub changes: Vec<ParameterChangeMessage>,
}

/// What a rung leaves of blocks that it was not fitted to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "view", derive(schemars::JsonSchema))]
pub struct CrossValidationMessage {
    /// Distances from the predicted positions (mm).
    pub distance_mm: Option<LengthsMessage>,
    /// Angles from the predicted orientations (mrad).
    pub angle_mrad: Option<LengthsMessage>,
    /// The weighted square over the numbers that were read.
    pub loss: f64,
    /// That less the best rung's.
    pub beyond_best: f64,
    /// The standard error of this difference, from block to block.
    pub standard_error: f64,
    /// The loss of each block.
    pub block_losses: Vec<f64>,
}

/// An F test with the misfit's variance as yardstick.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "view", derive(schemars::JsonSchema))]
pub struct RungTestMessage {
    /// How many more combinations of parameters are determined.
    pub more: usize,
    /// F, over the design effect.
    pub statistic: f64,
    /// Its degrees of freedom.
    pub degrees_of_freedom: [usize; 2],
    /// By how much misfits that are alike within a block count less than independent ones.
    pub design_effect: f64,
    /// The probability of a statistic at least as large if the rung explains nothing more.
    pub probability: f64,
}

/// A parameter that a rung moves out of its interval.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "view", derive(schemars::JsonSchema))]
pub struct ParameterChangeMessage {
    /// Its name.
    pub name: String,
    /// The unit of its values.
    pub unit: String,
    /// Whether the rung below does not have it.
    pub is_new: bool,
    /// Its value on the rung below, nominal where that does not have it.
    pub before: f64,
    /// Its value on this rung.
    pub after: f64,
    /// An interval of 95 %, as wide as this rung's by blocks: about the value on the rung below, about this rung's where
    /// it is new.
    pub interval95: [f64; 2],
    /// The change over half that interval.
    pub half_widths: f64,
}

impl From<&Ladder> for LadderMessage {
    fn from(ladder: &Ladder) -> Self {
        let recommendation = ladder.recommendation.as_ref();
        Self {
            rungs: ladder.rungs.iter().map(Into::into).collect(),
            skipped: (ladder.skipped.iter())
                .map(|(added, reason)| SkippedRungMessage {
                    added: added.word().to_owned(),
                    reason: reason.clone(),
                })
                .collect(),
            blocks: ladder.blocks,
            readings_judged: ladder.judged,
            best: recommendation.map(|each| each.best),
            recommended: recommendation.map(|each| each.rung),
            sentences: recommendation.map_or_else(Vec::new, |each| each.sentences.clone()),
            rejected: ladder.rejected.iter().map(RejectedMessage::from).collect(),
        }
    }
}

impl From<&Rung> for RungMessage {
    fn from(rung: &Rung) -> Self {
        let words = |groups: &[ParameterGroup]| -> Vec<String> {
            groups.iter().map(|each| each.word().to_owned()).collect()
        };
        let judged = rung.cross_validation.as_ref();
        Self {
            added: rung.added.word().to_owned(),
            groups: words(&rung.groups),
            unknowns: rung.unknowns,
            undetermined: rung.undetermined.clone(),
            distance_mm: rung.distances.as_ref().map(LengthsMessage::in_thousandths),
            angle_mrad: rung.angles.as_ref().map(LengthsMessage::in_thousandths),
            misfit_mm: rung.misfit[0] * 1e3,
            misfit_mrad: rung.misfit[1] * 1e3,
            cross_validation: judged.ok().map(Into::into),
            not_judged: judged.err().cloned(),
            test: rung.test.as_ref().map(Into::into),
            changes: rung.changes.iter().map(Into::into).collect(),
        }
    }
}

impl From<&CrossValidation> for CrossValidationMessage {
    fn from(judged: &CrossValidation) -> Self {
        Self {
            distance_mm: (judged.distances.as_ref()).map(LengthsMessage::in_thousandths),
            angle_mrad: judged.angles.as_ref().map(LengthsMessage::in_thousandths),
            loss: judged.loss,
            beyond_best: judged.beyond_best,
            standard_error: judged.standard_error,
            block_losses: judged.block_losses.clone(),
        }
    }
}

impl From<&RungTest> for RungTestMessage {
    fn from(test: &RungTest) -> Self {
        Self {
            more: test.more,
            statistic: test.statistic,
            degrees_of_freedom: test.degrees_of_freedom,
            design_effect: test.design_effect,
            probability: test.probability,
        }
    }
}

impl From<&ParameterChange> for ParameterChangeMessage {
    fn from(change: &ParameterChange) -> Self {
        Self {
            name: change.name.clone(),
            unit: quantity_unit(change.kind).to_owned(),
            is_new: change.is_new,
            before: change.before,
            after: change.after,
            interval95: change.interval95,
            half_widths: change.half_widths,
        }
    }
}
