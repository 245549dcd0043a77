//! Exact designs: plans of whole experiments, by exchange with gradient refinement.

use std::cell::RefCell;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::{DMatrix, Matrix3xX};
use rand::{Rng, RngExt};
use rayon::prelude::*;

use super::approximate::ApproximateDesign;
use super::local::LocalSearch;
use super::problem::{Point, Problem, SearchError, add_information};
use super::sampling::Sampler;
use crate::plan::{CriterionFunction, Plan};
use crate::random::generator;

/// Sweeps over the experiments of one plan.
const SWEEPS: usize = 200;
/// The sweeps end when one improves the cost by less than this share.
const CONVERGED: f64 = 1e-7;
/// How many of the best plans are searched further.
const PARENTS: usize = 6;
/// Searches between two looks at whether enough is done.
const BATCH: usize = 12;
/// So many searches from independent starts must agree on the best plan, divided by the number of
/// configurations: plans of few configurations have rare optima, and searches for them are short.
const ENOUGH: usize = 60;
/// Costs within this factor agree: 0.1 % in `rho_0`, the cost's root.
const SAME: f64 = 1.002;

/// A plan with its cost.
#[derive(Debug, Clone, PartialEq)]
pub struct ExactDesign {
    /// The plan.
    pub plan: Plan,
    /// Its cost.
    pub cost: f64,
    /// How many searches there were.
    pub searches: usize,
    /// How many of them ended within 0.1 % of that cost's root.
    pub agreeing: usize,
}

/// How a search is watched and stopped.
#[derive(Clone, Copy)]
pub struct Watch<'a> {
    /// When set, searches that have not begun are left out.
    pub stop: &'a AtomicBool,
    /// Called after every search with the number of those done, of all, and the lowest cost so far.
    pub progress: &'a (dyn Fn(usize, usize, f64) + Sync),
}

/// Searches the best plan of `experiments` measurements in `configurations` different
/// configurations, the mandatory ones of the scenario among them, from many starts.
///
/// The result is a function of the problem and the seed alone, unless it is stopped.
///
/// # Errors
/// No plan determines the compliances.
pub fn exact_design(
    problem: &Problem<'_>,
    approximate: &ApproximateDesign,
    experiments: u32,
    configurations: u32,
    seed: u64,
    watch: Watch<'_>,
) -> Result<ExactDesign, SearchError> {
    let mandatory = &problem.scenario.design.mandatory;
    let singular = SearchError::Singular {
        experiments,
        parameters: problem.parameters(),
    };
    let free = experiments.saturating_sub(mandatory.measurements());
    let count = u32::try_from(mandatory.experiments.len()).unwrap_or(u32::MAX);
    let configurations = configurations.saturating_sub(count).min(free);
    let repeats = even_repeats(free, configurations);
    let candidates = clear_candidates(problem, approximate);
    let starts = if free == 0 {
        1
    } else {
        problem.effort.starts_for(repeats.len())
    };
    let seen = Mutex::new((0, f64::INFINITY));
    let search = |starts_of_batch: std::ops::Range<usize>, parents: &[Found]| -> Vec<Found> {
        starts_of_batch
            .into_par_iter()
            .map_init(
                || Refinement::new(problem),
                |refinement, start| {
                    if start > 0 && watch.stop.load(Ordering::Relaxed) {
                        return None;
                    }
                    let mut random = generator(seed, (1 << 48) + start as u64);
                    let (points, repeats) = if let Some(parent) = parents.get(start % PARENTS) {
                        refinement.mutate(parent, &mut random)?
                    } else {
                        let points = refinement.draw(&candidates, repeats.len(), &mut random)?;
                        (points, repeats.clone())
                    };
                    // Every other search may exchange experiments for the approximate design's.
                    let offered = if start % 2 == 0 { &*candidates } else { &[] };
                    let found = refinement.refine(points, offered, repeats);
                    if let Ok(mut seen) = seen.lock() {
                        seen.0 += 1;
                        seen.1 = found.iter().fold(seen.1, |low, found| low.min(found.cost));
                        (watch.progress)(seen.0, starts, seen.1);
                    }
                    found
                },
            )
            .flatten()
            .collect()
    };
    // Batches from anywhere and batches from the best plans found, each with one experiment drawn
    // anew, take turns. Enough is done when independent searches agree on the best plan.
    let enough = (ENOUGH / repeats.len().max(1)).max(4);
    let mut results: Vec<Found> = Vec::new();
    let mut independent: Vec<f64> = Vec::new();
    for (batch, first) in (0..starts).step_by(BATCH).enumerate() {
        let is_independent = batch % 2 == 0 || free == 0;
        let parents = if is_independent {
            Vec::new()
        } else {
            distinct(&results)
        };
        let found = search(first..starts.min(first + BATCH), &parents);
        if is_independent {
            independent.extend(found.iter().map(|found| found.cost));
        }
        results.extend(found);
        results.sort_by(|one, other| one.cost.total_cmp(&other.cost));
        let agrees = |cost: &&f64| {
            results
                .first()
                .is_some_and(|best| **cost < best.cost * SAME)
        };
        if !is_independent && independent.iter().filter(agrees).count() >= enough {
            break;
        }
    }
    let best = results.first().ok_or(singular)?;
    let found = best
        .points
        .iter()
        .zip(&best.repeats)
        .map(|(point, &repeats)| point.experiment(repeats));
    Ok(ExactDesign {
        plan: Plan {
            experiments: mandatory.experiments.iter().cloned().chain(found).collect(),
        },
        cost: best.cost,
        searches: results.len(),
        agreeing: results
            .iter()
            .filter(|found| found.cost < best.cost * SAME)
            .count(),
    })
}

/// Shares m measurements evenly among c configurations.
fn even_repeats(measurements: u32, configurations: u32) -> Vec<u32> {
    (0..configurations)
        .map(|index| {
            let extra = u32::from(index < measurements % configurations);
            measurements / configurations + extra
        })
        .collect()
}

/// A plan that a search ended in.
#[derive(Clone)]
struct Found {
    cost: f64,
    points: Vec<Point>,
    repeats: Vec<u32>,
}

/// The best few plans that differ in cost, from plans sorted by cost.
fn distinct(sorted: &[Found]) -> Vec<Found> {
    let mut parents: Vec<Found> = Vec::new();
    for found in sorted {
        let is_new = parents
            .last()
            .is_none_or(|last| found.cost > last.cost * (1.0 + 1e-5));
        if is_new && parents.len() < PARENTS {
            parents.push(found.clone());
        }
    }
    parents
}

/// The experiments of the approximate design that are clear of collisions, with their weights.
fn clear_candidates(problem: &Problem<'_>, approximate: &ApproximateDesign) -> Vec<(Point, f64)> {
    let mut sampler = Sampler::new(problem);
    approximate
        .support
        .iter()
        .zip(&approximate.weights)
        .filter_map(|(point, weight)| Some((sampler.clear_variant(point)?, *weight)))
        .collect()
}

/// Refines plans; one for each thread.
struct Refinement<'a> {
    local: LocalSearch<'a>,
    sampler: Sampler<'a>,
    /// The information of the mandatory experiments.
    mandatory: DMatrix<f64>,
    work: RefCell<Work>,
}

struct Work {
    cost: CriterionFunction,
    information: DMatrix<f64>,
    directions: DMatrix<f64>,
}

impl<'a> Refinement<'a> {
    fn new(problem: &'a Problem<'a>) -> Self {
        let size = problem.parameters();
        Self {
            local: LocalSearch::new(problem),
            sampler: Sampler::new(problem),
            mandatory: problem.information(&problem.scenario.design.mandatory),
            work: RefCell::new(Work {
                cost: problem.cost(),
                information: DMatrix::zeros(size, size),
                directions: DMatrix::zeros(size, size),
            }),
        }
    }

    /// A plan of c experiments, half of them from the approximate design, half from anywhere.
    fn draw(
        &mut self,
        candidates: &[(Point, f64)],
        count: usize,
        random: &mut impl Rng,
    ) -> Option<Vec<Point>> {
        (0..count)
            .map(|_| {
                let from_candidates = (random.random::<f64>() < 0.5)
                    .then(|| draw_candidate(candidates, random))
                    .flatten();
                match from_candidates {
                    Some(point) => Some(point),
                    None => self.draw_point(random),
                }
            })
            .collect()
    }

    /// A plan with one of its experiments drawn anew.
    fn mutate(&mut self, parent: &Found, random: &mut impl Rng) -> Option<(Vec<Point>, Vec<u32>)> {
        let mut points = parent.points.clone();
        let index = random.random_range(0..points.len());
        points[index] = self.draw_point(random)?;
        Some((points, parent.repeats.clone()))
    }

    fn draw_point(&mut self, random: &mut impl Rng) -> Option<Point> {
        let (q, load) = self.sampler.draw(random)?;
        Some(self.local.point(&q, &load))
    }

    /// Improves the experiments in turn, and moves repeats from one to another, until nothing more
    /// is gained.
    fn refine(
        &mut self,
        mut points: Vec<Point>,
        offered: &[(Point, f64)],
        mut repeats: Vec<u32>,
    ) -> Option<Found> {
        let mut information = self.mandatory.clone();
        let mut last = f64::INFINITY;
        for _ in 0..SWEEPS {
            for index in 0..points.len() {
                self.total(&points, &repeats, Some(index), &mut information);
                let repeats = f64::from(repeats[index]);
                points[index] = self.exchange(&points[index], offered, &information, repeats);
            }
            self.total(&points, &repeats, None, &mut information);
            let cost = self.cost(&information);
            let improved = cost < last * (1.0 - CONVERGED);
            last = last.min(cost);
            if !improved && !self.move_repeat(&points, &mut repeats, &information, last) {
                break;
            }
        }
        last.is_finite().then_some(Found {
            cost: last,
            points,
            repeats,
        })
    }

    /// Moves one repeat between two configurations where that lowers the cost most.
    fn move_repeat(
        &self,
        points: &[Point],
        repeats: &mut [u32],
        information: &DMatrix<f64>,
        cost: f64,
    ) -> bool {
        let mut best = (cost * (1.0 - CONVERGED), None);
        let mut moved = information.clone();
        for from in (0..points.len()).filter(|&from| repeats[from] > 1) {
            for to in (0..points.len()).filter(|&to| to != from) {
                moved.copy_from(information);
                add_information(&mut moved, &points[from].matrix, -1.0);
                add_information(&mut moved, &points[to].matrix, 1.0);
                let cost = self.cost(&moved);
                if cost < best.0 {
                    best = (cost, Some((from, to)));
                }
            }
        }
        let Some((from, to)) = best.1 else {
            return false;
        };
        repeats[from] -= 1;
        repeats[to] += 1;
        true
    }

    fn cost(&self, information: &DMatrix<f64>) -> f64 {
        let Work {
            cost, directions, ..
        } = &mut *self.work.borrow_mut();
        cost.cost(information, directions)
    }

    /// The information of the mandatory and all other experiments but one.
    fn total(
        &self,
        points: &[Point],
        repeats: &[u32],
        left_out: Option<usize>,
        total: &mut DMatrix<f64>,
    ) {
        total.copy_from(&self.mandatory);
        for (index, (point, &repeats)) in points.iter().zip(repeats).enumerate() {
            if Some(index) != left_out {
                add_information(total, &point.matrix, f64::from(repeats));
            }
        }
    }

    /// The best experiment to join the rest: the present one or one of the candidates, refined.
    fn exchange(
        &mut self,
        present: &Point,
        candidates: &[(Point, f64)],
        rest: &DMatrix<f64>,
        repeats: f64,
    ) -> Point {
        let cost = |matrix: &Matrix3xX<f64>, factor: &mut Matrix3xX<f64>| {
            let Work {
                cost,
                information,
                directions,
            } = &mut *self.work.borrow_mut();
            information.copy_from(rest);
            add_information(information, matrix, repeats);
            let value = cost.cost(information, directions);
            if value.is_finite() {
                factor.gemm(-2.0 * repeats, matrix, directions, 0.0);
            } else {
                factor.fill(0.0);
            }
            value
        };
        let mut factor = present.matrix.clone();
        let mut best = present.clone();
        let mut lowest = cost(&present.matrix, &mut factor);
        for (candidate, _) in candidates {
            let value = cost(&candidate.matrix, &mut factor);
            if value < lowest * (1.0 - 1e-3) {
                lowest = value;
                best = candidate.clone();
            }
        }
        self.local
            .improve(&best, &cost)
            .filter(|improved| cost(&improved.matrix, &mut factor) < lowest)
            .and_then(|improved| self.sampler.clear_variant(&improved))
            .unwrap_or(best)
    }
}

/// An experiment of the approximate design, drawn by its weight.
fn draw_candidate(candidates: &[(Point, f64)], random: &mut impl Rng) -> Option<Point> {
    let total: f64 = candidates.iter().map(|(_, weight)| weight).sum();
    let mut share = total * random.random::<f64>();
    candidates
        .iter()
        .find(|(_, weight)| {
            share -= weight;
            share <= 0.0
        })
        .map(|(point, _)| point.clone())
}
