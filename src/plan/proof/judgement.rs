//! What a box's enclosure says: no experiment in it, no derivative above the threshold, or how to halve it.

use super::enclosure::{Cell, Enclosure, ProofTask};
use super::polynomial::Polynomial;
use super::taylor::{LANES, Lanes, ModelWorkspace};

/// What is known of a box.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Judgement {
    /// No derivative in the box is above this; minus infinity where there is no experiment.
    pub largest: f64,
    /// The multipliers of the margins that it rests on; where there is no experiment, that of the
    /// margin that shows it is infinite.
    pub multipliers: Vec<(usize, f64)>,
    /// The derivative at the centre is at least this, if experiments are possible there.
    pub at_centre: f64,
    /// The variable to halve.
    pub halve: usize,
}

/// How many margins are added at most, one of them twice perhaps.
const ROUNDS: usize = 4;
/// Boxes wider than this (rad, half of the width) are halved first of all.
const WIDE: f64 = 1.0;
/// How much the remainder weighs against the linear part where it is chosen what to halve.
const REMAINDER_WEIGHT: f64 = 1.5;

/// Judges boxes; those whose largest derivative is not above the threshold need no more thought.
pub(super) fn judge(
    task: &ProofTask<'_>,
    workspace: &mut ModelWorkspace,
    cells: &[Cell; LANES],
    used: usize,
    threshold: f64,
) -> Vec<Judgement> {
    let enclosure = task.enclose(workspace, cells, threshold);
    (0..used)
        .map(|lane| judge_one(task, workspace, &enclosure, &cells[lane], lane, threshold))
        .collect()
}

fn judge_one(
    task: &ProofTask<'_>,
    workspace: &ModelWorkspace,
    enclosure: &Enclosure,
    cell: &Cell,
    lane: usize,
    threshold: f64,
) -> Judgement {
    let (variables, turned) = (task.variables(), &enclosure.derivative);
    let polynomial = |model| Polynomial::new(workspace, model, lane, variables);
    let margins: Vec<Polynomial> = enclosure.margins.iter().copied().map(polynomial).collect();
    let mut judgement = Judgement {
        largest: f64::NEG_INFINITY,
        multipliers: Vec::new(),
        at_centre: f64::NEG_INFINITY,
        halve: 0,
    };
    if let Some(index) = margins.iter().position(|margin| margin.largest() < 0.0) {
        judgement.multipliers.push((index, f64::INFINITY));
        return judgement;
    }
    let mut sum = polynomial(turned.model);
    let at_centre = match &turned.at_centre {
        Some(at_centre) => at_centre[lane],
        None => sum.least_at_centre(),
    };
    if margins.iter().all(|margin| margin.least_at_centre() >= 0.0) {
        judgement.at_centre = at_centre;
    }
    let bound = |sum: &Polynomial| {
        let largest = sum.largest();
        if largest.is_nan() || !turned.is_valid[lane] {
            f64::INFINITY
        } else {
            largest
        }
    };
    let alone = bound(&sum);
    judgement.largest = alone;
    if judgement.largest > threshold && judgement.largest.is_finite() {
        for _ in 0..ROUNDS {
            let is_lower = add_margin(&mut judgement, &mut sum, &margins, variables, &bound);
            if !is_lower || judgement.largest <= threshold {
                break;
            }
        }
    }
    if judgement.largest > threshold
        && judgement.largest.is_finite()
        && sum.middle() + sum.remainder <= threshold
    {
        judgement.largest = judgement.largest.min(sum.largest_of_concave());
    }
    let is_to_be_left_out = at_centre > threshold && judgement.multipliers.is_empty();
    let outside = (margins.iter())
        .filter(|margin| is_to_be_left_out && margin.middle() < 0.0)
        .min_by(|one, other| {
            let least = |margin: &Polynomial| margin.largest() / -margin.middle();
            least(one).total_cmp(&least(other))
        });
    judgement.halve = match outside {
        Some(margin) => choose_for_margin(task, margin, cell),
        None => choose(task, &sum, &turned.spread, (cell, lane)),
    };
    judgement
}

/// The variable to halve of a box whose derivative is too large and that lies outside of a limit: that which this margin
/// depends on most. The derivative may not depend on it at all.
fn choose_for_margin(task: &ProofTask<'_>, margin: &Polynomial, cell: &Cell) -> usize {
    let shares = margin.shares();
    let width = |variable: usize| task.half_width(cell, variable);
    let total: f64 = (0..task.variables()).map(width).sum();
    let share = |variable: usize| shares[variable] + margin.remainder * width(variable) / total;
    (0..task.variables())
        .max_by(|&one, &other| share(one).total_cmp(&share(other)))
        .unwrap_or(0)
}

/// Adds the one margin that lowers the bound most, and so many times: one after another would let the first take away the slopes
/// by which a better one shows. By the linear parts the bound has its kinks where a slope vanishes. Whether there is one.
fn add_margin(
    judgement: &mut Judgement,
    sum: &mut Polynomial,
    margins: &[Polynomial],
    variables: usize,
    bound: &dyn Fn(&Polynomial) -> f64,
) -> bool {
    let mut best = None;
    for (index, margin) in margins.iter().enumerate() {
        let slopes: f64 = (0..variables).map(|j| margin.slope(j).abs()).sum();
        if margin.constant() > slopes {
            continue;
        }
        let mut kinks: Vec<f64> = (0..variables)
            .map(|j| -sum.slope(j) / margin.slope(j))
            .filter(|kink| kink.is_finite() && *kink > 0.0)
            .map(short)
            .collect();
        kinks.sort_by(f64::total_cmp);
        let mut last = f64::INFINITY;
        for kink in kinks {
            let trial = sum.plus(kink, margin);
            let largest = bound(&trial);
            if largest < judgement.largest {
                judgement.largest = largest;
                best = Some((index, kink, trial));
            } else if largest > last {
                break;
            }
            last = largest;
        }
    }
    let Some((index, multiplier, trial)) = best else {
        return false;
    };
    *sum = trial;
    judgement.multipliers.push((index, multiplier));
    true
}

/// A multiplier is written down in six hexadecimal digits: twelve bits behind the point.
fn short(multiplier: f64) -> f64 {
    f64::from_bits(multiplier.to_bits() >> 40 << 40)
}

/// The variable to halve: that which adds most to the bound; of the remainder as much as it changes the deflections.
fn choose(
    task: &ProofTask<'_>,
    sum: &Polynomial,
    spread: &[Lanes],
    (cell, lane): (&Cell, usize),
) -> usize {
    let variables = task.variables();
    let most = |values: &dyn Fn(usize) -> f64| {
        (0..variables)
            .max_by(|&one, &other| values(one).total_cmp(&values(other)))
            .unwrap_or(0)
    };
    let width = |variable: usize| task.half_width(cell, variable);
    let widest = most(&width);
    let shares = sum.shares();
    let total: f64 = spread[..variables].iter().map(|each| each[lane]).sum();
    if width(widest) > WIDE || !(total > 0.0 && total.is_finite() && sum.remainder.is_finite()) {
        return widest;
    }
    most(&|variable| {
        shares[variable] + REMAINDER_WEIGHT * sum.remainder * spread[variable][lane] / total
    })
}
