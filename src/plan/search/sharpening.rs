//! Plans for criteria that are the worst of several: refined by smooth stand-ins, sharper and sharper, and from a
//! rounded design.

use rayon::prelude::*;

use super::approximate::ApproximateDesign;
use super::local::Precision;
use super::problem::Problem;
use super::refinement::{Found, Refinement};

/// Powers of the stand-ins that refine what was found.
const SHARPER: [f64; 5] = [32.0, 128.0, 512.0, 2048.0, 16_384.0];
/// Of these, the first for a plan that is near to begin with.
const SHARPEST: usize = 3;
/// A plan whose value is within this factor of its bound needs no search.
const NEAR: f64 = 1.001;

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
    if problem.criterion.bounded_as() != Some(approximate.criterion) {
        return None;
    }
    let experiments = approximate.rounded(free, configurations)?.experiments;
    let as_it_is = Refinement::new(problem).known(&experiments);
    let found = sharpened(problem, &as_it_is, &SHARPER[SHARPEST..]);
    found.cost.is_finite().then(|| RoundedDesign {
        is_enough: is_near(problem, approximate, measurements, found.cost),
        found,
    })
}

/// Plans, refined by all of the stand-ins.
pub(super) fn sharpened_all(problem: &Problem<'_>, plans: &[Found]) -> Vec<Found> {
    (plans.par_iter())
        .map(|plan| sharpened(problem, plan, &SHARPER))
        .collect()
}

/// Whether a cost is within 0.1 % (in the root, as for all costs) of what no plan is better than, as far as is known.
fn is_near(
    problem: &Problem<'_>,
    approximate: &ApproximateDesign,
    experiments: u32,
    cost: f64,
) -> bool {
    let certificate = &approximate.certificate;
    if certificate.mandatory.0 > 0 || certificate.prior > 0.0 {
        return false;
    }
    let least = certificate.cost.powi(2) / (certificate.largest_inside * f64::from(experiments));
    let [best, found] = [
        problem.criterion.value_of_cost(least),
        if problem.criterion.is_maximised() {
            cost.recip()
        } else {
            cost
        },
    ];
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
