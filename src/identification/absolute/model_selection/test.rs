//! Whether a nested model explains more than the one below: an F test with the discrepancy's variance as yardstick.
//!
//! ```text
//! F = (Q_0 - Q_1) / q / s^2 / d,      s^2 = Q_1 / (N - p)
//! ```
//!
//! with the weighted sums of squares Q_0 below and Q_1 above, q parameters more, and the nested model's own mean square s^2 in place of
//! the instrument's noise. Were discrepancies independent from reading to reading, d would be one. It is the design
//! effect of Rao and Scott: how much the q directions change when blocks of joint space are left out one by one, over what
//! independent discrepancies would make of that; the second number of degrees of freedom counts blocks.

use nalgebra::{Cholesky, DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::super::super::gauss_newton::ParameterFit;
use super::super::without::{Blocks, Without};
use super::climb::{NestedModelFit, carried};
use crate::parameter::{ElasticArm, ParameterSet, relative_precision};
use serde::{Deserialize, Serialize};

/// A nested model beside the one below it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct NestedModelTest {
    /// How many more combinations of parameters are determined.
    pub more: usize,
    /// F, over the design effect.
    pub statistic: f64,
    /// Its degrees of freedom.
    pub degrees_of_freedom: [usize; 2],
    /// By how much discrepancies that are alike within a block count less than independent ones.
    pub design_effect: f64,
    /// The probability of a statistic at least as large if the nested model explains nothing more.
    pub probability: f64,
}

/// The cost of a fit: weighted squares with the prior's.
fn cost(step: &NestedModelFit) -> f64 {
    let set = &step.set;
    let values = DVector::from_column_slice(&step.fit.posterior.mean);
    let off = (values - &set.prior().mean).component_div(&set.scales());
    step.fit.square + off.dot(&(relative_precision(set) * &off))
}

/// Readings, and what is known before of each parameter, less what is determined.
fn spare(step: &NestedModelFit) -> usize {
    let known =
        (0..step.set.len()).filter(|&place| step.set.prior().precision[(place, place)] > 0.0);
    let ParameterFit { rows, .. } = step.fit;
    (rows + known.count()).saturating_sub(step.fit.posterior.estimable.rank())
}

/// Tests a nested model; none where it determines no more than the one below, or too little is left over.
pub(super) fn tested(
    blocks: &Blocks<'_>,
    below: &NestedModelFit,
    step: &NestedModelFit,
    without: &[Without],
) -> Option<NestedModelTest> {
    let [low, high] = [below, step].map(|each| each.fit.posterior.estimable.rank());
    let more = high.checked_sub(low).filter(|&more| more > 0)?;
    let spare = spare(step);
    if spare == 0 {
        return None;
    }
    let mean_square = cost(step) / spare as f64;
    let explained = (cost(below) - cost(step)).max(0.0) / more as f64;
    let effect = design_effect(blocks, below, step, without)? / mean_square;
    let design_effect = effect.max(1.0);
    let statistic = explained / mean_square / design_effect;
    let degrees_of_freedom = [more, spare.min(more * (without.len() - 1))];
    let [one, other] = degrees_of_freedom.map(|degrees| degrees as f64);
    let distribution = FisherSnedecor::new(one, other).ok()?;
    Some(NestedModelTest {
        more,
        statistic,
        degrees_of_freedom,
        design_effect,
        probability: distribution.sf(statistic),
    })
}

/// The variance, block by block, of the directions that a nested model adds, over that of independent readings of unit variance; the mean
/// over the directions.
fn design_effect(
    blocks: &Blocks<'_>,
    below: &NestedModelFit,
    step: &NestedModelFit,
    without: &[Without],
) -> Option<f64> {
    let arm = &blocks.case.arm;
    let union = union(arm, &below.set, &step.set)?;
    let values = carried(&step.set, &step.fit.posterior.mean, &union);
    let mut information = relative_precision(&union);
    for part in &blocks.parts {
        information += part.equations(&union, arm, &values).ok()?.information;
    }
    let [low, high] = [below, step].map(|each| {
        let places = places(&each.set, &union);
        let basis = each.fit.posterior.estimable.basis();
        let mut embedded = DMatrix::zeros(union.len(), basis.ncols());
        for (row, &place) in places.iter().enumerate() {
            embedded.set_row(place, &basis.row(row));
        }
        embedded
    });
    // What the nested model adds, seen so that the nested model below has no part in it.
    let factor = Cholesky::new(low.tr_mul(&information) * &low)?;
    let beside = &high - &low * factor.solve(&(low.tr_mul(&information) * &high));
    let own = beside.tr_mul(&information) * &beside;
    let scales = step.set.scales();
    let basis = step.fit.posterior.estimable.basis();
    let all = DVector::from_column_slice(&step.fit.posterior.mean);
    let squares = without.iter().map(|each| {
        let change = basis.tr_mul(&(&each.values - &all).component_div(&scales));
        change.dot(&(&own * &change))
    });
    let count = without.len() as f64;
    let added = (high.ncols() - low.ncols()) as f64;
    Some(squares.sum::<f64>() * (count - 1.0) / count / added)
}

fn union(arm: &ElasticArm, one: &ParameterSet, other: &ParameterSet) -> Option<ParameterSet> {
    let more = other.parameters().iter();
    let more = more.filter(|each| one.index_of(each.kind).is_none());
    let all = one.parameters().iter().chain(more);
    ParameterSet::new(arm, all.map(|each| (each.kind, each.prior_deviation))).ok()
}

fn places(set: &ParameterSet, within: &ParameterSet) -> Vec<usize> {
    let kinds = set.parameters().iter();
    kinds
        .filter_map(|each| within.index_of(each.kind))
        .collect()
}
