//! Plans of many measurements, from a rounded design.

use super::approximate::ApproximateDesign;
use super::local::Precision;
use super::point::Point;
use super::problem::Problem;
use super::refinement::{Found, Refinement};
use super::size::PlanSize;

/// A plan whose value is within this factor of its bound needs no search.
const NEAR: f64 = 1.001;
/// So many measurements are rounded: fewer are soon searched, and nearer.
const MANY: u32 = 100;

/// The refined plan near the weights of an approximate design for the same criterion, of so many measurements, of which so many are free
/// in so many configurations; `None` where searches may end lower: more than 0.1 % above what no plan is better than, as far as is
/// known.
pub(super) fn rounded_design(
    problem: &Problem<'_>,
    approximate: &ApproximateDesign,
    measurements: u32,
    free: PlanSize,
) -> Option<Found> {
    let certificate = &approximate.certificate;
    let is_beside =
        certificate.mandatory.0 > 0 || certificate.prior > 0.0 || free.measurements < measurements;
    let criterion = problem.criterion;
    if measurements < MANY || is_beside || criterion.bounded_as() != Some(approximate.criterion) {
        return None;
    }
    let experiments = approximate
        .rounded(free.measurements, free.configurations)
        .experiments;
    let mut refinement = Refinement::new(problem);
    let as_it_is = refinement.known(&experiments);
    // The design's experiments may collide, or be out of sight.
    let clear = (as_it_is.points.iter()).map(|point| refinement.sampler.clear_variant(point));
    let clear: Option<Vec<Point>> = clear.collect();
    let rounded = refinement.plan(clear?, as_it_is.repeats);
    let found = refinement.refine(rounded, Precision::FINE, f64::INFINITY);
    let least = certificate.cost.powi(2) / (certificate.largest_inside * f64::from(measurements));
    let best = criterion.value_of_cost(least);
    let value = criterion.value_of_own_cost(found.cost);
    ((value / best).max(best / value) <= NEAR).then_some(found)
}
