//! Exact designs: plans of whole experiments, by exchange with gradient refinement.

use std::sync::atomic::Ordering;

use rayon::prelude::*;

use super::approximate::ApproximateDesign;
use super::error::SearchError;
use super::exact_plan::ExactDesign;
use super::local::{LocalSearch, Precision};
use super::point::Point;
use super::problem::Problem;
use super::refinement::{Found, Refinement};
use super::several_loads::with_several_loads;
use super::size::PlanSize;
use super::watch::Watch;
use crate::numeric::random::{generator, streams};
use crate::plan::Plan;

/// Searches that know nothing of one another, between two looks at whether enough are done.
const INDEPENDENT: usize = 8;
/// Searches after these that exchange experiments of the best plans found so far.
const RECOMBINED: usize = 4;
/// So many experiments that searches met are chosen from.
const MET: usize = 200;
/// How many plans they take experiments from.
const PARENTS: usize = 16;
/// So many independent searches must agree on the best plan.
const ENOUGH: usize = 8;
/// Costs within this factor agree: 0.1 % in `rho_0`, the cost's root.
const SAME: f64 = 1.002;
/// How many of the best plans are refined to full precision.
const POLISHED: usize = 2;

/// A plan whose value is within this factor of its bound needs no search.
const NEAR: f64 = 1.001;
/// So many measurements are rounded: fewer are soon searched, and nearer.
const MANY: u32 = 100;

/// Searches the best plan of a size, the mandatory experiments of the task among it, from many starts: no worse than plans of as many
/// measurements in at most as many configurations that are known.
///
/// The result is a function of the problem, the known plans and the seed alone, unless it is stopped.
///
/// # Errors
/// No plan determines the compliances.
pub fn exact_design(
    problem: &Problem<'_>,
    approximate: &ApproximateDesign,
    size: PlanSize,
    seed: u64,
    watch: Watch<'_>,
    known: &[Plan],
) -> Result<ExactDesign, SearchError> {
    problem.optimised_as()?;
    let mandatory = &problem.task.design.mandatory;
    let singular = SearchError::Singular {
        experiments: size.measurements,
        parameters: problem.parameters(),
    };
    let beside = size.beside(mandatory);
    let near = rounded_design(problem, approximate, size.measurements, beside);
    let mut design = if let Some(near) = near {
        Some(ExactDesign::ended(problem, &near, [0, 0]))
    } else {
        let known = known_plans(problem, known);
        let searched = search_plans(problem, approximate, beside, seed, watch, known);
        let best = (searched.ends.iter()).min_by(|one, other| one.cost.total_cmp(&other.cost));
        let best = best.map(|best| ExactDesign::ended(problem, best, searched.counts));
        let other = with_several_loads(problem, size, &searched.met, seed, watch);
        match (best, other) {
            (Some(best), Some(other)) if other.cost >= best.cost => Some(best),
            (best, other) => other.or(best),
        }
    };
    design.take_if(|design| !problem.is_determined_by(&design.plan));
    design.ok_or(singular)
}

/// The refined plan near the weights of an approximate design for the same criterion, of so many measurements, of which so many are free
/// in so many configurations; `None` where searches may end lower: more than 0.1 % above what no plan is better than, as far as is
/// known.
fn rounded_design(
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

/// What searches found.
struct SearchedPlans {
    /// The best plans, refined to full precision.
    ends: Vec<Found>,
    /// How many searches there were that knew nothing of one another, and how many of them ended in the best plan.
    counts: [usize; 2],
    /// Experiments of the best plans, and some of those that searches chose from.
    met: Vec<Point>,
}

/// Searches plans of so many free measurements in so many configurations, beside those that are known.
fn search_plans(
    problem: &Problem<'_>,
    approximate: &ApproximateDesign,
    free: PlanSize,
    seed: u64,
    watch: Watch<'_>,
    mut results: Vec<Found>,
) -> SearchedPlans {
    let (free, configurations) = (free.measurements, free.configurations);
    let searches = if free == 0 {
        1
    } else {
        let affordable = problem.affordable(configurations as usize);
        (problem.effort.searches).min(affordable.max(INDEPENDENT + RECOMBINED))
    };
    // The problem of an approximate design may consider other unknowns.
    let local = LocalSearch::new(problem);
    let [candidates, support] = [&approximate.candidates, &approximate.support].map(|points| {
        let here = points
            .iter()
            .map(|point| local.point(&point.q, &point.load, point.direction));
        here.collect::<Vec<Point>>()
    });
    let tell = watch.counted(searches);
    let search = |refinement: &mut Refinement<'_>, index: usize, given: Option<&[Point]>| {
        if index > 0 && watch.stop.load(Ordering::Relaxed) {
            return None;
        }
        let mut random = generator(seed, streams::search(index as u64));
        let given = given.unwrap_or(if index.is_multiple_of(2) {
            &candidates
        } else {
            &support
        });
        let found = refinement.search(given, free, configurations, &mut random);
        tell(found.as_ref().map_or(f64::INFINITY, |found| found.cost));
        found
    };
    let run = |from: usize, count: usize, given: Option<&[Point]>| -> Vec<Found> {
        (from..searches.min(from + count))
            .into_par_iter()
            .map_init(
                || Refinement::new(problem),
                |refinement, index| search(refinement, index, given),
            )
            .flatten()
            .collect()
    };
    // Plans of few configurations have many optima that are nearly as good as the best.
    let fewest = match configurations {
        0..=2 => 48,
        3 => 96,
        _ => INDEPENDENT,
    };
    let mut independent: Vec<f64> = Vec::new();
    let mut done = 0;
    while done < searches {
        let found = run(done, INDEPENDENT, None);
        done += INDEPENDENT;
        independent.extend(found.iter().map(|found| found.cost));
        results.extend(found);
        sort(&mut results);
        let is_enough = independent.len() >= fewest && agreeing(&independent, &results) >= ENOUGH;
        if results.is_empty() || is_enough {
            break;
        }
        let best = results.iter().take(PARENTS);
        let given: Vec<Point> = best.flat_map(|found| found.points.clone()).collect();
        results.extend(run(done, RECOMBINED, Some(&given)));
        done += RECOMBINED;
        sort(&mut results);
    }
    let polished = results.par_iter().take(POLISHED);
    let polished: Vec<Found> = polished
        .map(|found| Refinement::new(problem).polish(found.clone()))
        .collect();
    let best = polished.iter().chain(results.iter().take(PARENTS));
    let best = best.flat_map(|found| &found.points);
    SearchedPlans {
        counts: [independent.len(), agreeing(&independent, &polished)],
        met: (best.chain(&support).chain(&candidates).take(MET).cloned()).collect(),
        ends: polished,
    }
}

/// Plans of earlier searches, refined beside the mandatory experiments.
fn known_plans(problem: &Problem<'_>, known: &[Plan]) -> Vec<Found> {
    let mandatory = problem.task.design.mandatory.experiments.len();
    let refined = known.par_iter().map(|plan| {
        let mut refinement = Refinement::new(problem);
        let found = refinement.known(&plan.experiments[mandatory..]);
        refinement.refine(found, Precision::ROUGH, f64::INFINITY)
    });
    refined.filter(|found| found.cost.is_finite()).collect()
}

fn sort(results: &mut [Found]) {
    results.sort_by(|one, other| one.cost.total_cmp(&other.cost));
}

/// How many costs are as good as the best plan's.
fn agreeing(costs: &[f64], plans: &[Found]) -> usize {
    let best = plans.iter().map(|plan| plan.cost);
    let best = best.fold(f64::INFINITY, f64::min);
    costs.iter().filter(|cost| **cost < best * SAME).count()
}
