//! Model selection: which groups of parameters are supported by the readings.
//!
//! Each nested model fits what the nested model below does and one group more, all with the same weights: the readings' own covariances and
//! what the highest nested model leaves unexplained. What a model leaves is alike in configurations that are near each other, so nested models are
//! compared by blocks of joint space: each block is predicted by a fit to all others. Of the nested models whose loss is
//! within one standard error of the smallest (of the difference, from block to block) the lowest is recommended. Joint error functions
//! beside it are one model more: they are recommended if their loss is smaller by more than two standard errors.
//!
//! Readings that lie far out of the highest nested model are no matter of any: all nested models are fitted to the others and judged by them.

mod recommendation;

use nalgebra::DVector;
use rayon::prelude::*;

use super::super::fit::{Haste, ParameterFit, fit_parameters};
use super::super::nominal::{UNKNOWN, with_nominal};
use super::blocks::{Blocks, FEWEST_BLOCKS, Without};
use super::fit::{KeptFit, from_its_frames};
use super::{
    AbsoluteCase, DistanceStatistics, FitResult, IdentificationError, ParameterGroup,
    ReadingResidual, ReadingWeights, RejectedReading,
};
use crate::parameter::{ParameterKind, ParameterSet};
pub use recommendation::Recommendation;
use recommendation::recommended;

/// The groups in the order in which nested models add them: what moves everything first.
const ORDER: [ParameterGroup; 6] = [
    ParameterGroup::Frames,
    ParameterGroup::Zeros,
    ParameterGroup::Links,
    ParameterGroup::Compliances,
    ParameterGroup::Springs,
    ParameterGroup::Payload,
];
/// At most so many blocks, each left out once.
const BLOCKS: usize = 16;
/// So many different configurations in each.
const IN_A_BLOCK: usize = 2;
/// Why a group makes no model that is none.
const NOTHING_NEW: &str = "this robot has none, or all models have them";

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
    /// The recommended one with joint error functions beside its parameters, where they can be told.
    pub with_joint_errors: Option<NestedModel>,
    /// The readings that were left out of all nested models, since they lie far out of the highest.
    pub rejected: Vec<RejectedReading>,
}

/// A model of the model selection.
#[derive(Debug, Clone)]
pub struct NestedModel {
    /// What it has more than the one below.
    pub added: ParameterGroup,
    /// All that it has, as `identify --parameters` takes it.
    pub groups: Vec<ParameterGroup>,
    /// The number of unknowns, frames among them.
    pub unknowns: usize,
    /// What the readings do not determine of them, in sentences.
    pub undetermined: Vec<String>,
    /// Distances of the readings from their fit (m).
    pub distances: Option<DistanceStatistics>,
    /// Angles from it (rad); none where positions were read.
    pub angles: Option<DistanceStatistics>,
    /// The standard deviations of what it does not explain, of each coordinate of positions (m) and rotations (rad).
    pub discrepancy: [f64; 2],
    /// What it leaves of blocks that it was not fitted to; none with the reason where it cannot be fitted without one.
    pub cross_validation: Result<CrossValidation, String>,
}

/// What a nested model leaves of readings that it was not fitted to.
#[derive(Debug, Clone, PartialEq)]
pub struct CrossValidation {
    /// Each block's weighted square over its numbers: one where the highest nested model's discrepancy is all that is left.
    pub block_losses: Vec<f64>,
    /// Their mean over all numbers.
    pub loss: f64,
    /// That less the best nested model's.
    pub beyond_best: f64,
    /// The standard error of this difference, from block to block.
    pub standard_error: f64,
    /// Distances from the predicted positions (m).
    pub distances: Option<DistanceStatistics>,
    /// Angles from the predicted orientations (rad).
    pub angles: Option<DistanceStatistics>,
}

impl CrossValidation {
    /// The rms distance from the predicted positions (m) between its ends: it goes with the root of the loss, of which the standard error of
    /// the difference to the best nested model's is taken off and added.
    pub fn rms_interval_m(&self) -> Option<[f64; 3]> {
        let rms = self.distances.as_ref()?.rms;
        let share = self.standard_error / self.loss;
        Some([-1.0, 0.0, 1.0].map(|side| rms * (1.0 + side * share).max(0.0).sqrt()))
    }
}

struct NestedModelFit {
    added: ParameterGroup,
    groups: Vec<ParameterGroup>,
    fit: ParameterFit,
}

/// Groups that make no model, with the reason.
type Skipped = Vec<(ParameterGroup, String)>;

impl AbsoluteCase<'_> {
    /// Fits models with more and more parameters, and compares them. The case is left with the frames of a fit.
    pub fn model_selection(&mut self, weights: ReadingWeights) -> FitResult<ModelSelection> {
        self.choices.weights = weights;
        self.check_frames()?;
        self.count_of_blocks()?;
        let start = self.far_from_frames();
        let mut case = self.without(&start);
        let mut steps = Vec::new();
        let mut skipped = case.climb(&mut steps)?;
        let highest = steps.len().saturating_sub(1);
        case.fit_again(&mut steps[highest..])?;
        let far_out = (steps.last())
            .filter(|_| !self.choices.keeps_all)
            .and_then(|top| {
                let first = KeptFit {
                    case: case.clone(),
                    rejected: start.clone(),
                    discrepancy: (case.left(&top.fit.belief).ok())
                        .map(|left| case.discrepancy_of(&left, &top.fit)),
                    fit: top.fit.clone(),
                    discrepancy_model: None,
                    consistency: None,
                };
                self.without_far_out(&first)
            });
        let mut rejected = start;
        if let Some(found) = far_out {
            (case, rejected) = (found.case, found.rejected);
            case.weigh_by(&found.fit)?;
            for step in &mut steps {
                // Near enough to the frames of that fit to begin with.
                step.fit.posterior.mean = from_its_frames(&step.fit).as_slice().to_vec();
            }
            // Without what lies far out groups may be fitted that were not.
            let failed = skipped.iter().find(|(_, reason)| reason != NOTHING_NEW);
            if let Some(&(failed, _)) = failed {
                let below = ORDER.iter().take_while(|group| **group != failed);
                let below: Vec<_> = below.collect();
                steps.retain(|step| below.contains(&&step.added));
                skipped = case.climb(&mut steps)?;
            }
        }
        case.fit_again(&mut steps)?;
        self.arm.clone_from(&case.arm);
        let blocks = Blocks::new(&case, case.count_of_blocks()?);
        let without: Vec<Result<Vec<Without>, String>> = (steps.par_iter())
            .map(|step| blocks.without(&step.fit))
            .map(|found| found.map_err(|error| error.to_string()))
            .collect();
        // Which readings all nested models tell from the other blocks.
        let mut judged = vec![true; blocks.of_readings.len()];
        for without in without.iter().flatten() {
            for (block, without) in without.iter().enumerate() {
                for (place, is_told) in blocks.places(block).zip(&without.is_told) {
                    judged[place] &= is_told;
                }
            }
        }
        let (mut nested_models, mut fits) = (Vec::new(), Vec::new());
        for (step, without) in steps.into_iter().zip(&without) {
            let left = case.left(&step.fit.belief)?;
            let named = step.fit.freedoms.named.iter();
            nested_models.push(NestedModel {
                added: step.added,
                unknowns: step.fit.set.len(),
                undetermined: named.map(|each| each.sentence.clone()).collect(),
                distances: DistanceStatistics::of_positions(&left),
                angles: DistanceStatistics::of_rotations(&left),
                discrepancy: case.discrepancy_of(&left, &step.fit),
                cross_validation: (without.as_ref().map_err(String::clone))
                    .and_then(|without| cross_validation(&blocks, &judged, &step.fit.set, without)),
                groups: step.groups,
            });
            fits.push(step.fit);
        }
        let mut recommendation = recommended(&mut nested_models);
        let with_joint_errors = recommendation.as_mut().and_then(|found| {
            let (place, chosen) = (found.nested_model, &nested_models[found.nested_model]);
            let plain = without[place].as_ref().ok()?;
            let fit = &fits[place];
            // Where the readings' own errors explain what the model leaves there are no others.
            let by_known = self.by_known_errors(&rejected, &fit.set, None).ok()?;
            if by_known.is_explained() || weights == ReadingWeights::Own {
                return None;
            }
            let mut model = with_joint_errors((&blocks, &judged), fit, (chosen, plain))?;
            found.compare_joint_errors(chosen, &mut model);
            Some(model)
        });
        Ok(ModelSelection {
            recommendation,
            with_joint_errors,
            nested_models,
            skipped,
            blocks: blocks.len(),
            judged: judged.iter().filter(|&&is_judged| is_judged).count(),
            rejected,
        })
    }

    fn count_of_blocks(&self) -> FitResult<usize> {
        let different = self.different();
        let needed = FEWEST_BLOCKS * IN_A_BLOCK;
        if different < needed {
            return Err(IdentificationError::TooFewConfigurations { different, needed });
        }
        // Halves of halves hold the same numbers.
        let mut count = FEWEST_BLOCKS;
        while count < BLOCKS && 2 * count * IN_A_BLOCK <= different {
            count *= 2;
        }
        Ok(count)
    }

    /// Fits all nested models beyond those that there are, each from the one below and by what that leaves; the groups that make none.
    fn climb(&mut self, steps: &mut Vec<NestedModelFit>) -> FitResult<Skipped> {
        let mut skipped = Vec::new();
        let there: Vec<ParameterGroup> = steps.iter().map(|step| step.added).collect();
        for added in ORDER.into_iter().filter(|added| !there.contains(added)) {
            let groups = named(steps, added);
            let (set, _) = self.told_apart(&groups, &[])?;
            let fit = if let Some(below) = steps.last() {
                if kinds(&below.fit.set).eq(kinds(&set)) {
                    skipped.push((added, NOTHING_NEW.to_owned()));
                    continue;
                }
                let mut start = set.prior().mean.clone();
                for (place, kind) in kinds(&set).enumerate() {
                    if let Some(known) = below.fit.set.index_of(kind) {
                        start[place] = below.fit.posterior.mean[known];
                    }
                }
                self.fit_near(&set, start.as_slice(), Haste::Weights)
            } else {
                let fit = fit_parameters(&self.arm, &set, &self.observations)?;
                let values = self.rebased(&fit);
                self.weigh_by(&fit)?;
                self.fit_near(&set, values.as_slice(), Haste::Weights)
            };
            match fit.and_then(|fit| self.with_nominal_where_unknown(fit)) {
                Ok(fit) => {
                    self.weigh_by(&fit)?;
                    steps.push(NestedModelFit { added, groups, fit });
                }
                Err(error) if steps.is_empty() => return Err(error),
                Err(error) => skipped.push((added, error.to_string())),
            }
        }
        Ok(skipped)
    }

    /// Fits nested models from where they are, all with the weights that the readings have now.
    fn fit_again(&self, steps: &mut [NestedModelFit]) -> FitResult<()> {
        for step in steps {
            let (set, near) = (&step.fit.set, &step.fit.posterior.mean);
            // By these weights readings may tell what they did not by those of the model below.
            let fit = self.fit_near(&set.clone().without_nominal(), near, Haste::Near);
            step.fit = match fit.and_then(|fit| self.with_nominal_where_unknown(fit)) {
                Err(_) if !set.nominal().is_empty() => self.fit_near(set, near, Haste::Near)?,
                found => found?,
            };
        }
        Ok(())
    }

    /// Weighs readings by what a fit leaves of them, where it is not by their own covariances alone.
    fn weigh_by(&mut self, fit: &ParameterFit) -> FitResult<()> {
        if self.choices.weights != ReadingWeights::Own {
            let discrepancy = self.estimated_discrepancy(fit)?;
            self.weigh(discrepancy);
        }
        Ok(())
    }

    /// The same fit in which compliances stay nominal that it does not tell.
    fn with_nominal_where_unknown(&self, mut fit: ParameterFit) -> FitResult<ParameterFit> {
        while let Some(set) = with_nominal(&fit, &fit.posterior.covariance, UNKNOWN) {
            fit = self.fit_near(&set, &fit.posterior.mean, Haste::Near)?;
        }
        Ok(fit)
    }
}

fn kinds(set: &ParameterSet) -> impl Iterator<Item = ParameterKind> {
    set.parameters().iter().map(|each| each.kind)
}

/// The nested models below and one group more, in the words of the command line.
fn named(steps: &[NestedModelFit], added: ParameterGroup) -> Vec<ParameterGroup> {
    let has = |group| steps.iter().any(|step| step.added == group) || added == group;
    let mut groups = ORDER[1..].to_vec();
    groups.retain(|&group| has(group));
    if groups.starts_with(&[ParameterGroup::Zeros, ParameterGroup::Links]) {
        groups.splice(..2, [ParameterGroup::Geometry]);
    }
    if groups.is_empty() {
        groups.push(ParameterGroup::Frames);
    }
    groups
}

/// What a nested model leaves of each block that it was not fitted to, of the readings that are judged.
fn cross_validation(
    blocks: &Blocks<'_>,
    judged: &[bool],
    set: &ParameterSet,
    without: &[Without],
) -> Result<CrossValidation, String> {
    let mut left: Vec<ReadingResidual> = Vec::new();
    let (mut block_losses, mut square, mut numbers) = (Vec::new(), 0.0, 0);
    for (block, each) in without.iter().enumerate() {
        let own = blocks.places(block).zip(&each.left);
        left.extend(
            own.filter(|(index, _)| judged[*index])
                .map(|(_, left)| left),
        );
        let part =
            (blocks.case).part_of(|index| blocks.of_readings[index] == block && judged[index]);
        let part = part.displaced(&each.joint_errors);
        let readings = part.fitted_readings(set);
        let rows = readings.rows();
        if rows == 0 {
            continue;
        }
        let own = readings.equations(&each.values);
        let own = own.map_err(|error| error.to_string())?.square;
        block_losses.push(own / rows as f64);
        square += own;
        numbers += rows;
    }
    if block_losses.len() < 2 {
        return Err("no block of readings is determined by the others".to_owned());
    }
    Ok(CrossValidation {
        block_losses,
        loss: square / numbers as f64,
        beyond_best: 0.0,
        standard_error: 0.0,
        distances: DistanceStatistics::of_positions(&left),
        angles: DistanceStatistics::of_rotations(&left),
    })
}

/// A nested model with joint error functions beside its parameters, by the same readings; none where they cannot be told.
fn with_joint_errors(
    (blocks, judged): (&Blocks<'_>, &[bool]),
    fit: &ParameterFit,
    (chosen, without): (&NestedModel, &[Without]),
) -> Option<NestedModel> {
    let of_fit = (fit, chosen.discrepancy);
    let (all, without) = blocks.with_joint_errors(of_fit, without)?;
    let values = DVector::from_column_slice(&fit.posterior.mean) + &all.shift;
    let case = blocks.case.clone().displaced(&all.joints);
    let left = case
        .left(&fit.set.apply(&case.arm, values.as_slice()))
        .ok()?;
    Some(NestedModel {
        distances: DistanceStatistics::of_positions(&left),
        angles: DistanceStatistics::of_rotations(&left),
        discrepancy: all.rest,
        cross_validation: cross_validation(blocks, judged, &fit.set, &without),
        ..chosen.clone()
    })
}

impl ModelSelection {
    /// What a nested model adds, by its place.
    pub fn name(&self, place: usize) -> String {
        let plus = if place > 0 { "+ " } else { "" };
        format!("{plus}{}", self.nested_models[place].added.word())
    }

    /// Whether joint error functions predict blocks that they were not fitted to.
    pub fn recommends_joint_errors(&self) -> bool {
        let recommended = self.recommendation.as_ref();
        recommended.is_none_or(|each| each.with_joint_errors)
    }

    /// What the recommended nested model fits, as `--parameters` takes it; frames alone where no nested model could be judged.
    pub fn groups(&self) -> &[ParameterGroup] {
        let recommended = self.recommendation.as_ref();
        recommended.map_or(&[ParameterGroup::Frames], |each| {
            &self.nested_models[each.nested_model].groups
        })
    }
}
