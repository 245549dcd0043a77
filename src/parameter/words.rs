//! Combinations that cannot be separated, in words.

use nalgebra::{DMatrix, DVector};

use super::kind::Owner;
use super::{ElasticArm, Parameter, ParameterKind, ParameterSet};

/// Coefficients below this share of a direction's largest are left by rounding.
const ROUNDING: f64 = 1e-6;
/// In a weak direction, parameters whose effect on the readings is less than this share of the largest are
/// not named.
const MINOR: f64 = 0.3;
/// A typical size with less effect than this does not show (standard deviations of all readings together).
const UNSEEN: f64 = 0.01;

/// In a structural direction, every parameter counts that is not left by rounding.
pub(super) const SPARSE: f64 = 1e-4;

/// A combination of parameters that readings do not show.
#[derive(Debug, Clone, PartialEq)]
pub struct Freedom {
    /// Whether it follows from the robot's structure, whatever the readings are.
    pub is_structural: bool,
    /// Whether it is a compliance that stays as it is believed to be.
    pub stays_nominal: bool,
    /// The parameter that can be left out without loss, as an index.
    pub redundant: usize,
    /// The others that are in it, as indices.
    pub others: Vec<usize>,
    /// By how much all change (p), in their units, for one unit of that; of what stays nominal nothing.
    pub direction: DVector<f64>,
    /// One sentence.
    pub sentence: String,
}

/// Names each of the directions (p x f each, in typical sizes), structural and weak ones. Who has a part in
/// a weak one is judged by the effect on readings of some information (p x p): a part that is small in
/// typical sizes can be all that takes another's effect back.
pub(super) fn sentences(
    belief: &ElasticArm,
    set: &ParameterSet,
    structural: &DMatrix<f64>,
    weak: &DMatrix<f64>,
    information: &DMatrix<f64>,
) -> Vec<Freedom> {
    let effects = information.diagonal().map(|square| square.max(0.0).sqrt());
    let structural = reduced(set, structural, SPARSE);
    let mut weak = weak.clone();
    for (pivot, direction) in &structural {
        for mut other in weak.column_iter_mut() {
            let factor = other[*pivot];
            other.axpy(-factor, direction, 1.0);
        }
    }
    let weak = reduced(set, &weak, MINOR);
    let structural = (structural.iter())
        .map(|(pivot, direction)| describe(belief, set, *pivot, direction, (&effects, true)));
    let weak = (weak.iter())
        .map(|(pivot, direction)| describe(belief, set, *pivot, direction, (&effects, false)));
    structural.chain(weak).collect()
}

/// Names what stays as it is believed to be.
pub(super) fn stays_nominal(belief: &ElasticArm, set: &ParameterSet) -> Vec<Freedom> {
    let of_one = |&redundant: &usize| Freedom {
        is_structural: false,
        stays_nominal: true,
        redundant,
        others: Vec::new(),
        direction: DVector::zeros(set.len()),
        sentence: format!(
            "{} would be negative or uncertain by more than its nominal value: it stays nominal",
            set.parameters()[redundant].kind.words(belief)
        ),
    };
    set.nominal().iter().map(of_one).collect()
}

/// Which parameter of a direction one leaves out first.
fn keep(parameter: &Parameter) -> usize {
    let kind = parameter.kind;
    match kind.owner() {
        _ if parameter.is_found => 7,
        _ if kind.is_of_mass() => 2,
        Owner::Link(_) => 0,
        Owner::Only => 1,
        Owner::Joint(_) if matches!(kind, ParameterKind::JointCompliance { .. }) => 4,
        Owner::Joint(_) | Owner::Spring(_) => 3,
        Owner::Tool(_) => 5,
        Owner::Station(_) => 6,
    }
}

/// Combinations of the directions with few parameters each: reduced to echelon form, with the parameter
/// that is left out first as pivot, among those with at least some share of the largest. In typical sizes.
pub(super) fn reduced(
    set: &ParameterSet,
    directions: &DMatrix<f64>,
    least_share: f64,
) -> Vec<(usize, DVector<f64>)> {
    let mut rows: Vec<DVector<f64>> = directions
        .column_iter()
        .map(nalgebra::Matrix::into_owned)
        .collect();
    let mut order: Vec<usize> = (0..set.len()).collect();
    order.sort_by_key(|&index| keep(&set.parameters()[index]));
    let mut done = Vec::new();
    while !rows.is_empty() {
        // The first group of parameters in which something is left, and the largest there.
        let mut best = (usize::MAX, 0.0, 0, 0);
        for &index in &order {
            let group = keep(&set.parameters()[index]);
            for (row, direction) in rows.iter().enumerate() {
                let share = direction[index].abs() / direction.amax();
                if share > least_share
                    && (group < best.0 || (group == best.0 && share > best.1 + 1e-9))
                {
                    best = (group, share, index, row);
                }
            }
        }
        let (group, _, pivot, row) = best;
        if group == usize::MAX {
            break;
        }
        order.retain(|&index| index != pivot);
        let mut direction = rows.swap_remove(row);
        direction /= direction[pivot];
        for other in rows
            .iter_mut()
            .chain(done.iter_mut().map(|(_, other)| other))
        {
            let factor = other[pivot];
            other.axpy(-factor, &direction, 1.0);
            clean(other);
        }
        clean(&mut direction);
        done.push((pivot, direction));
    }
    done.sort_by_key(|(pivot, _)| *pivot);
    done
}

fn clean(direction: &mut DVector<f64>) {
    let least = ROUNDING * direction.amax();
    direction.apply(|value| {
        if value.abs() < least {
            *value = 0.0;
        }
    });
}

fn describe(
    belief: &ElasticArm,
    set: &ParameterSet,
    pivot: usize,
    relative: &DVector<f64>,
    (effects, is_structural): (&DVector<f64>, bool),
) -> Freedom {
    let direction = set.in_units(relative) / set.parameters()[pivot].scale;
    // What the others do, of which what does too little is not named.
    let (effect, least) = if is_structural {
        (relative.abs(), f64::MIN_POSITIVE)
    } else if effects[pivot] < UNSEEN {
        (relative.abs(), f64::INFINITY)
    } else {
        let effect = relative.component_mul(effects).abs();
        let least = MINOR * effect.max();
        (effect, least)
    };
    let others = (0..set.len()).filter(|&index| index != pivot && effect[index] >= least);
    let others: Vec<usize> = others.collect();
    let words = |index: usize| set.parameters()[index].kind.words(belief);
    let sentence = match others.as_slice() {
        [] if is_structural => format!("{} cannot show in any reading", words(pivot)),
        [] => format!("{} does not show in these readings", words(pivot)),
        &[other] if effects[pivot].max(effects[other]) < UNSEEN => {
            let [pivot, other] = [pivot, other].map(words);
            format!("neither {pivot} nor {other} shows in these readings")
        }
        &[other] if is_structural => {
            let is_product = set.parameters()[pivot].is_logarithmic;
            let same_unit = set.parameters()[pivot].unit() == set.parameters()[other].unit();
            let is = |ratio: f64| (direction[other] - ratio).abs() < 1e-6;
            let what = match is_product {
                false if same_unit && is(-1.0) => "their sum is determined",
                false if same_unit && is(1.0) => "their difference is determined",
                true if is(-1.0) => "their product is determined",
                _ => "one combination of them is determined",
            };
            let [pivot, other] = [pivot, other].map(words);
            format!("{pivot} and {other} cannot be separated: {what}")
        }
        others => {
            let names: Vec<String> = others.iter().map(|&index| words(index)).collect();
            let list = and(&names);
            let first = words(pivot);
            if is_product(set, pivot, others) {
                format!("{first} and {list} cannot be separated: their products are determined")
            } else if is_structural {
                format!("{first} is redundant: {list} have the same effect")
            } else {
                format!("{first} is nearly redundant with {list} in these readings")
            }
        }
    };
    Freedom {
        is_structural,
        stays_nominal: false,
        redundant: pivot,
        others,
        direction,
        sentence,
    }
}

/// A factor of all loads against compliances.
fn is_product(set: &ParameterSet, pivot: usize, others: &[usize]) -> bool {
    let kind = |index: usize| set.parameters()[index].kind;
    let is_compliance =
        |&index: &usize| matches!(kind(index), ParameterKind::JointCompliance { .. });
    matches!(
        kind(pivot),
        ParameterKind::LoadScale | ParameterKind::PayloadMass
    ) && others.iter().all(is_compliance)
}

fn and(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}
