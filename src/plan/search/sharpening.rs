//! Plans of many measurements, from a rounded design; and plans for criteria that are the worst of several: refined by
//! smooth stand-ins, sharper and sharper.

use rayon::prelude::*;

use super::approximate::ApproximateDesign;
use super::local::Precision;
use super::point::Point;
use super::problem::Problem;
use super::refinement::{Found, Refinement};
use crate::plan::Criterion;

/// Powers of the stand-ins that refine what was found.
const SHARPER: [f64; 5] = [32.0, 128.0, 512.0, 2048.0, 16_384.0];
/// Of these, the first for a plan that is near to begin with.
const SHARPEST: usize = 3;
/// A plan whose value is within this factor of its bound needs no search.
const NEAR: f64 = 1.001;
/// By a criterion that is no worst of several, so many measurements are rounded: fewer are soon searched, and nearer.
const MANY: u32 = 100;

/// A plan near the weights of an approximate design.
pub(super) struct RoundedDesign {
    /// Refined.
    pub found: Found,
    /// Whether it is so near to what no plan is better than that nothing is left to be searched.
    pub is_enough: bool,
}

/// Many measurements come near an approximate design for the same criterion: of so many, of them free, and
/// in so many configurations.
pub(super) fn rounded_design(
    problem: &Problem<'_>,
    approximate: &ApproximateDesign,
    [measurements, free, configurations]: [u32; 3],
) -> Option<RoundedDesign> {
    let is_worst = problem.criterion.is_worst_of_several();
    let is_asked_for = is_worst || measurements >= MANY;
    if !is_asked_for || problem.criterion.bounded_as() != Some(approximate.criterion) {
        return None;
    }
    let experiments = approximate.rounded(free, configurations)?.experiments;
    let mut refinement = Refinement::new(problem);
    let as_it_is = refinement.known(&experiments);
    // The design's experiments may collide, or be out of sight.
    let clear = (as_it_is.points.iter()).map(|point| refinement.sampler.clear_variant(point));
    let clear: Option<Vec<Point>> = clear.collect();
    let rounded = refinement.plan(clear?, as_it_is.repeats);
    let found = if is_worst {
        sharpened(problem, &rounded, &SHARPER[SHARPEST..])
    } else {
        refinement.refine(rounded, Precision::FINE, f64::INFINITY)
    };
    let is_enough = is_near(problem, approximate, [measurements, free], found.cost);
    let is_kept = is_enough || (is_worst && found.cost.is_finite());
    is_kept.then_some(RoundedDesign { found, is_enough })
}

/// Plans, refined by all of the stand-ins.
pub(super) fn sharpened_all(problem: &Problem<'_>, plans: &[Found]) -> Vec<Found> {
    (plans.par_iter())
        .map(|plan| sharpened(problem, plan, &SHARPER))
        .collect()
}

/// Whether a plan of such a cost has a value within 0.1 % of what no plan is better than, as far as is known: of so many
/// measurements, of them free.
fn is_near(
    problem: &Problem<'_>,
    approximate: &ApproximateDesign,
    [measurements, free]: [u32; 2],
    cost: f64,
) -> bool {
    let certificate = &approximate.certificate;
    if certificate.mandatory.0 > 0 || certificate.prior > 0.0 || free < measurements {
        return false;
    }
    let least = certificate.cost.powi(2) / (certificate.largest_inside * f64::from(measurements));
    let best = problem.criterion.value_of_cost(least);
    // A plan's cost is the criterion's value, its inverse, or the square of rho_0.
    let found = if problem.criterion == Criterion::TestPose {
        cost.sqrt()
    } else if problem.criterion.is_maximised() {
        cost.recip()
    } else {
        cost
    };
    (found / best).max(best / found) <= NEAR
}

/// A plan of a smooth stand-in, refined by sharper ones and at last by the criterion itself.
fn sharpened(problem: &Problem<'_>, plan: &Found, powers: &[f64]) -> Found {
    let mut found = plan.clone();
    for power in powers {
        let sharper = problem.smoothed(*power);
        let mut refinement = Refinement::new(&sharper);
        let again = refinement.plan(found.points, found.repeats);
        found = refinement.refine(again, Precision::FINE, f64::INFINITY);
    }
    let mut refinement = Refinement::new(problem);
    let again = refinement.plan(found.points, found.repeats);
    refinement.refine(again, Precision::FINE, f64::INFINITY)
}
