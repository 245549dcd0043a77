//! A ladder of models: which groups of parameters the readings pay for.
//!
//! Each rung fits what the rung below does and one group more, all with the same weights: the readings' own covariances and
//! what the highest rung leaves unexplained. What a model leaves is alike in configurations that are near each other, so rungs are
//! compared by blocks of joint space: each block is predicted by a fit to all others. Of the rungs whose loss is
//! within one standard error of the smallest (of the difference, from block to block) the lowest is recommended.
//!
//! Readings that lie far out of the highest rung are no matter of any: all rungs are fitted to the others and judged by them.

mod climb;
mod recommendation;
mod rung;
mod test;

use super::blocks::FEWEST_BLOCKS;
use super::{AbsoluteCase, AbsoluteError, ParameterGroup, ReadingWeights, RejectedReading};
use climb::Climbed;
pub use recommendation::Recommendation;
use recommendation::recommended;
pub use rung::{CrossValidation, ParameterChange, Rung};
use rung::{RungComparison, judged_by_all};
pub use test::RungTest;

/// At most so many blocks, each left out once.
const BLOCKS: usize = 16;
/// So many different configurations in each.
const IN_A_BLOCK: usize = 2;

/// Models of a robot, each with one group of parameters more.
#[derive(Debug, Clone)]
pub struct Ladder {
    /// From frames alone upwards.
    pub rungs: Vec<Rung>,
    /// Groups that make no rung, with the reason.
    pub skipped: Vec<(ParameterGroup, String)>,
    /// The number of blocks of joint space.
    pub blocks: usize,
    /// The number of readings that all rungs predict from the other blocks.
    pub judged: usize,
    /// Which rung to use.
    pub recommendation: Option<Recommendation>,
    /// The readings that were left out of all rungs, since they lie far out of the highest.
    pub rejected: Vec<RejectedReading>,
}

impl AbsoluteCase<'_> {
    /// Fits models with more and more parameters, and compares them. The case is left with the frames of a fit.
    ///
    /// # Errors
    /// See [`AbsoluteError`].
    pub fn ladder(&mut self, weights: ReadingWeights) -> Result<Ladder, AbsoluteError> {
        self.check_frames()?;
        self.ladder_blocks()?;
        let mut case = self.clone();
        let mut climbed = case.climb(weights)?;
        let far_out = (climbed.steps.last())
            .filter(|_| !self.keeps_all)
            .and_then(|top| {
                let misfit = case.misfit(&top.fit).ok();
                self.without_far_out(&top.set, weights, (&top.fit, misfit))
            });
        let mut rejected = Vec::new();
        if let Some((kept, readings, _)) = far_out {
            (case, rejected) = (kept, readings);
            climbed = case.climb(weights)?;
        }
        self.arm.clone_from(&case.arm);
        let blocks = case.ladder_blocks()?;
        let count = blocks.iter().max().map_or(0, |&last| last + 1);
        let Climbed {
            steps,
            skipped,
            shared,
        } = climbed;
        let unfinished = case.unfinished(&steps, shared.as_ref(), &blocks, count);
        let judged = judged_by_all(&unfinished, &blocks);
        let comparison = RungComparison {
            case: &case,
            shared: shared.as_ref(),
            judged: &judged,
            of_readings: &blocks,
        };
        let mut rungs = comparison.finished(&steps, unfinished)?;
        let recommendation = recommended(&mut rungs);
        Ok(Ladder {
            rungs,
            skipped,
            blocks: count,
            judged: judged.iter().filter(|&&is_judged| is_judged).count(),
            recommendation,
            rejected,
        })
    }

    fn ladder_blocks(&self) -> Result<Vec<usize>, AbsoluteError> {
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

impl Ladder {
    /// What the recommended rung fits, as `--parameters` takes it; frames alone where no rung could be judged.
    #[must_use]
    pub fn groups(&self) -> &[ParameterGroup] {
        let rung = (self.recommendation.as_ref()).map(|each| &self.rungs[each.rung]);
        rung.map_or(&[ParameterGroup::Frames], |rung| &rung.groups)
    }
}
