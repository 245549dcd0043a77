//! Plans of many measurements, from a rounded design.

use super::approximate::ApproximateDesign;
use super::local::Precision;
use super::point::Point;
use super::problem::Problem;
use super::refinement::{Found, Refinement};
use crate::plan::Criterion;

/// A plan whose value is within this factor of its bound needs no search.
const NEAR: f64 = 1.001;
/// So many measurements are rounded: fewer are soon searched, and nearer.
const MANY: u32 = 100;

/// The refined plan near the weights of an approximate design for the same criterion, of so many measurements, of them free, and
/// in so many configurations; `None` where searches may end lower.
pub(super) fn rounded_design(
    problem: &Problem<'_>,
    approximate: &ApproximateDesign,
    [measurements, free, configurations]: [u32; 3],
) -> Option<Found> {
    if measurements < MANY || problem.criterion.bounded_as() != Some(approximate.criterion) {
        return None;
    }
    let experiments = approximate.rounded(free, configurations)?.experiments;
    let mut refinement = Refinement::new(problem);
    let as_it_is = refinement.known(&experiments);
    // The design's experiments may collide, or be out of sight.
    let clear = (as_it_is.points.iter()).map(|point| refinement.sampler.clear_variant(point));
    let clear: Option<Vec<Point>> = clear.collect();
    let rounded = refinement.plan(clear?, as_it_is.repeats);
    let found = refinement.refine(rounded, Precision::FINE, f64::INFINITY);
    is_near(problem, approximate, [measurements, free], found.cost).then_some(found)
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
