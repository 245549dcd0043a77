//! Model selection: which groups of parameters are supported by the readings.
//!
//! Each nested model fits what the nested model below does and one group more, all with the same weights: the readings' own covariances and
//! what the highest nested model leaves unexplained. What a model leaves is alike in configurations that are near each other, so nested models are
//! compared by blocks of joint space: each block is predicted by a fit to all others. Of the nested models whose loss is
//! within one standard error of the smallest (of the difference, from block to block) the lowest is recommended.
//!
//! Readings that lie far out of the highest nested model are no matter of any: all nested models are fitted to the others and judged by them.

mod climb;
mod nested_model;
mod recommendation;
mod test;

use super::blocks::FEWEST_BLOCKS;
use super::{AbsoluteCase, AbsoluteError, ParameterGroup, ReadingWeights, RejectedReading};
use climb::Climbed;
pub use nested_model::{CrossValidation, NestedModel, ParameterChange};
use nested_model::{NestedModelComparison, judged_by_all};
pub use recommendation::Recommendation;
use recommendation::recommended;
pub use test::NestedModelTest;

/// At most so many blocks, each left out once.
const BLOCKS: usize = 16;
/// So many different configurations in each.
const IN_A_BLOCK: usize = 2;

/// Models of a robot, each with one group of parameters more.
#[derive(Debug, Clone)]
pub struct ModelSelection {
    /// From frames alone upwards.
    pub nested_models: Vec<NestedModel>,
    /// Groups that make no nested model, with the reason.
    pub skipped: Vec<(ParameterGroup, String)>,
    /// The number of blocks of joint space.
    pub blocks: usize,
    /// The number of readings that all nested models predict from the other blocks.
    pub judged: usize,
    /// Which nested model to use.
    pub recommendation: Option<Recommendation>,
    /// The readings that were left out of all nested models, since they lie far out of the highest.
    pub rejected: Vec<RejectedReading>,
}

impl AbsoluteCase<'_> {
    /// Fits models with more and more parameters, and compares them. The case is left with the frames of a fit.
    pub fn model_selection(
        &mut self,
        weights: ReadingWeights,
    ) -> Result<ModelSelection, AbsoluteError> {
        self.check_frames()?;
        self.model_selection_blocks()?;
        let start = self.far_from_frames();
        let mut case = self.without(&start);
        let mut climbed = case.climb(weights)?;
        let far_out = (climbed.steps.last())
            .filter(|_| !self.keeps_all)
            .and_then(|top| {
                let discrepancy = case.discrepancy(&top.fit).ok();
                self.without_far_out(&top.set, weights, (&top.fit, discrepancy), &start)
            });
        let mut rejected = start.clone();
        if let Some((kept, readings, _)) = far_out {
            (case, rejected) = (kept, readings);
            climbed = case.climb(weights)?;
        }
        self.arm.clone_from(&case.arm);
        let blocks = case.model_selection_blocks()?;
        let count = blocks.iter().max().map_or(0, |&last| last + 1);
        let Climbed {
            steps,
            skipped,
            shared,
        } = climbed;
        let unfinished = case.unfinished(&steps, shared.as_ref(), &blocks, count);
        let judged = judged_by_all(&unfinished, &blocks);
        let comparison = NestedModelComparison {
            case: &case,
            shared: shared.as_ref(),
            judged: &judged,
            of_readings: &blocks,
        };
        let mut nested_models = comparison.finished(&steps, unfinished)?;
        let recommendation = recommended(&mut nested_models);
        Ok(ModelSelection {
            nested_models,
            skipped,
            blocks: count,
            judged: judged.iter().filter(|&&is_judged| is_judged).count(),
            recommendation,
            rejected,
        })
    }

    fn model_selection_blocks(&self) -> Result<Vec<usize>, AbsoluteError> {
        let different = self.different();
        let needed = FEWEST_BLOCKS * IN_A_BLOCK;
        if different < needed {
            return Err(AbsoluteError::TooFewConfigurations { different, needed });
        }
        // Halves of halves hold the same numbers.
        let mut count = FEWEST_BLOCKS;
        while count < BLOCKS && 2 * count * IN_A_BLOCK <= different {
            count *= 2;
        }
        Ok(self.blocks(count))
    }
}

impl ModelSelection {
    /// What the recommended nested model fits, as `--parameters` takes it; frames alone where no nested model could be judged.
    pub fn groups(&self) -> &[ParameterGroup] {
        let nested_model =
            (self.recommendation.as_ref()).map(|each| &self.nested_models[each.nested_model]);
        nested_model.map_or(&[ParameterGroup::Frames], |nested_model| {
            &nested_model.groups
        })
    }
}
