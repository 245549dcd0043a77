//! A nested model with its residual errors, cross-validation and F test.

use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::super::without::{Blocks, Without};
use super::super::{
    AbsoluteCase, AbsoluteError, DistanceStatistics, ParameterGroup, ReadingResidual,
};
use super::climb::NestedModelFit;
use super::test::{NestedModelTest, tested};
use crate::observation::SharedErrors;
use crate::parameter::ParameterKind;

/// Of intervals of 95 %.
const UPPER: f64 = 0.975;

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
    /// Whether it explains more than the one below.
    pub test: Option<NestedModelTest>,
    /// The parameters of the robot that it moves out of their intervals, those moved farthest (in interval widths) first.
    pub changes: Vec<ParameterChange>,
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

/// A parameter that a nested model moves out of its interval.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterChange {
    /// Its name.
    pub name: String,
    /// What it is.
    pub kind: ParameterKind,
    /// Whether the nested model below does not have it.
    pub is_new: bool,
    /// Its value on the nested model below, nominal where that does not have it; in its own unit.
    pub before: f64,
    /// Its value on this nested model.
    pub after: f64,
    /// An interval of 95 %, as wide as this nested model's by blocks: about the value below, about this nested model's where it is new.
    pub interval95: [f64; 2],
    /// The change over half the interval's width.
    pub half_widths: f64,
}

/// A nested model with its blocks, not compared yet.
pub(super) struct Unfinished {
    without: Result<Vec<Without>, String>,
    test: Option<NestedModelTest>,
}

impl AbsoluteCase<'_> {
    /// Each nested model without each block, and its test.
    pub(super) fn unfinished(
        &self,
        steps: &[NestedModelFit],
        shared: Option<&SharedErrors>,
        of_readings: &[usize],
        count: usize,
    ) -> Vec<Unfinished> {
        let blocks = Blocks::new(self, shared, of_readings, count);
        (0..steps.len())
            .into_par_iter()
            .map(|place| {
                let step = &steps[place];
                let without = blocks
                    .without(step.fitted())
                    .map_err(|error| error.to_string());
                let below = place.checked_sub(1).map(|below| &steps[below]);
                let test = (below.zip(without.as_ref().ok()))
                    .and_then(|(below, without)| tested(&blocks, below, step, without));
                Unfinished { without, test }
            })
            .collect()
    }
}

/// Which readings all nested models tell from the other blocks.
pub(super) fn judged_by_all(nested_models: &[Unfinished], of_readings: &[usize]) -> Vec<bool> {
    let mut judged = vec![true; of_readings.len()];
    for without in nested_models
        .iter()
        .filter_map(|nested_model| nested_model.without.as_ref().ok())
    {
        let of_blocks = without.iter().map(|each| each.is_told.iter());
        let mut of_blocks: Vec<_> = of_blocks.collect();
        for (judged, &block) in judged.iter_mut().zip(of_readings) {
            *judged &= of_blocks[block].next().copied().unwrap_or(false);
        }
    }
    judged
}

/// The readings as nested models are compared by them.
pub(super) struct NestedModelComparison<'a> {
    pub case: &'a AbsoluteCase<'a>,
    pub shared: Option<&'a SharedErrors>,
    /// Whether all nested models tell a reading from the other blocks.
    pub judged: &'a [bool],
    /// Each reading's block.
    pub of_readings: &'a [usize],
}

impl NestedModelComparison<'_> {
    /// All that is told of the nested models, but for what compares them with the best.
    pub fn finished(
        &self,
        steps: &[NestedModelFit],
        unfinished: Vec<Unfinished>,
    ) -> Result<Vec<NestedModel>, AbsoluteError> {
        let mut nested_models: Vec<NestedModel> = Vec::new();
        for (place, (step, unfinished)) in steps.iter().zip(unfinished).enumerate() {
            let left = self.case.left_by(&step.fit)?;
            let Unfinished { without, test } = unfinished;
            let changes = match (&without, place.checked_sub(1)) {
                (Ok(without), Some(below)) => self.changes(&steps[below], step, without),
                _ => Vec::new(),
            };
            let cross_validation = without.and_then(|without| self.judge(step, &without));
            let named = step.fit.freedoms.named.iter();
            nested_models.push(NestedModel {
                added: step.added,
                groups: step.groups.clone(),
                unknowns: step.set.len(),
                undetermined: named.map(|each| each.sentence.clone()).collect(),
                distances: DistanceStatistics::of_positions(&left),
                angles: DistanceStatistics::of_rotations(&left),
                discrepancy: self.case.discrepancy(&step.fit)?,
                cross_validation,
                test,
                changes,
            });
        }
        Ok(nested_models)
    }

    /// What a nested model leaves of each block that it was not fitted to.
    fn judge(&self, step: &NestedModelFit, without: &[Without]) -> Result<CrossValidation, String> {
        let mut left: Vec<ReadingResidual> = Vec::new();
        let (mut block_losses, mut square, mut rows) = (Vec::new(), 0.0, 0);
        for (block, each) in without.iter().enumerate() {
            let is_in = |index: usize| self.of_readings[index] == block;
            let part = (self.case).part(self.shared, |index| is_in(index) && self.judged[index]);
            let of_block = (0..self.judged.len()).filter(|&index| is_in(index));
            let told = each.left.iter().zip(of_block);
            left.extend(
                told.filter(|(_, index)| self.judged[*index])
                    .map(|(left, _)| *left),
            );
            if part.rows() == 0 {
                continue;
            }
            let own = part.equations(&step.set, &self.case.arm, &each.values);
            let own = own.map_err(|error| error.to_string())?.square;
            block_losses.push(own / part.rows() as f64);
            square += own;
            rows += part.rows();
        }
        if block_losses.len() < 2 {
            return Err("no block of readings is determined by the others".to_owned());
        }
        Ok(CrossValidation {
            block_losses,
            loss: square / rows as f64,
            beyond_best: 0.0,
            standard_error: 0.0,
            distances: DistanceStatistics::of_positions(&left),
            angles: DistanceStatistics::of_rotations(&left),
        })
    }

    /// The parameters of the robot that a nested model moves out of their intervals.
    fn changes(
        &self,
        below: &NestedModelFit,
        step: &NestedModelFit,
        without: &[Without],
    ) -> Vec<ParameterChange> {
        let degrees = without.len() as f64 - 1.0;
        let Some(half) = StudentsT::new(0.0, 1.0, degrees)
            .ok()
            .map(|distribution| distribution.inverse_cdf(UPPER))
        else {
            return Vec::new();
        };
        let reference = &self.case.arm;
        let mut changes: Vec<ParameterChange> = Vec::new();
        for (place, parameter) in step.set.parameters().iter().enumerate() {
            if parameter.kind.is_mounted() {
                continue;
            }
            let after = step.fit.posterior.mean[place];
            let known = below.set.index_of(parameter.kind);
            let before = known.map_or(parameter.nominal, |known| below.fit.posterior.mean[known]);
            let Some(error) = step.fitted().standard_error(place, without) else {
                continue;
            };
            let middle = if known.is_some() { before } else { after };
            let quantity = |value: f64| parameter.quantity(reference, value);
            let half_widths = (after - before).abs() / (half * error);
            if half_widths > 1.0 {
                changes.push(ParameterChange {
                    name: parameter.name.clone(),
                    kind: parameter.kind,
                    is_new: known.is_none(),
                    before: quantity(before),
                    after: quantity(after),
                    interval95: [middle - half * error, middle + half * error].map(quantity),
                    half_widths,
                });
            }
        }
        changes.sort_by(|one, other| other.half_widths.total_cmp(&one.half_widths));
        changes
    }
}
