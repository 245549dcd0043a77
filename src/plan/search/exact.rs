//! Exact designs: plans of whole experiments, by exchange with gradient refinement.

use std::cell::RefCell;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::{DMatrix, Matrix3xX};
use rand::{Rng, RngExt};
use rayon::prelude::*;

use super::approximate::ApproximateDesign;
use super::local::LocalSearch;
use super::problem::{add_information, Point, Problem, SearchError};
use super::sampling::Sampler;
use crate::plan::{CriterionFunction, Plan};
use crate::random::generator;

/// Sweeps over the experiments of one plan.
const SWEEPS: usize = 200;
/// The sweeps end when one improves the cost by less than this share.
const CONVERGED: f64 = 1e-7;
/// How many of the best plans are searched further.
const PARENTS: usize = 6;

/// A plan with its cost.
#[derive(Debug, Clone, PartialEq)]
pub struct ExactDesign {
    /// The plan.
    pub plan: Plan,
    /// Its cost.
    pub cost: f64,
    /// How many starts ended within 0.1 % of that cost.
    pub agreeing: usize,
}

/// Searches the best plan with the given repeats, one for each configuration, from many starts.
///
/// The result is a function of the problem and the seed alone. When `stop` is set, searches that
/// have not begun are left out.
///
/// # Errors
/// No plan determines the compliances.
pub fn exact_design(
    problem: &Problem<'_>,
    approximate: &ApproximateDesign,
    repeats: &[u32],
    seed: u64,
    stop: &AtomicBool,
) -> Result<ExactDesign, SearchError> {
    let candidates = clear_candidates(problem, approximate);
    let starts = problem.effort.starts_for(repeats.len());
    let search = |indices: std::ops::Range<usize>, known: &[Found]| -> Vec<Found> {
        indices
            .into_par_iter()
            .map_init(
                || Refinement::new(problem),
                |refinement, start| {
                    if start > 0 && stop.load(Ordering::Relaxed) {
                        return None;
                    }
                    let mut random = generator(seed, (1 << 48) + start as u64);
                    let points = match known.get(start % PARENTS) {
                        Some(parent) => refinement.mutate(parent, &mut random)?,
                        None => refinement.draw(&candidates, repeats.len(), &mut random)?,
                    };
                    // Every other search may exchange experiments for the approximate design's.
                    let offered = if start % 2 == 0 { &*candidates } else { &[] };
                    refinement.refine(points, offered, repeats)
                },
            )
            .flatten()
            .collect()
    };
    // First from anywhere; then from the best plans found, each with one experiment drawn anew.
    let mut results = search(0..starts / 2, &[]);
    results.sort_by(|one, other| one.cost.total_cmp(&other.cost));
    let parents = distinct(&results);
    results.extend(search(starts / 2..starts, &parents));
    let best = results
        .iter()
        .min_by(|one, other| one.cost.total_cmp(&other.cost))
        .ok_or_else(|| SearchError::Singular {
            experiments: u32::try_from(repeats.len()).unwrap_or(u32::MAX),
            parameters: problem.parameters(),
        })?;
    let experiments = best
        .points
        .iter()
        .zip(repeats)
        .map(|(point, &repeats)| point.experiment(repeats))
        .collect();
    Ok(ExactDesign {
        plan: Plan { experiments },
        cost: best.cost,
        agreeing: results
            .iter()
            .filter(|found| found.cost < best.cost * 1.002)
            .count(),
    })
}

/// A plan that a search ended in.
struct Found {
    cost: f64,
    points: Vec<Point>,
}

/// The best few plans that differ in cost, from plans sorted by cost.
fn distinct(sorted: &[Found]) -> Vec<Found> {
    let mut parents: Vec<Found> = Vec::new();
    for found in sorted {
        let is_new = parents
            .last()
            .is_none_or(|last| found.cost > last.cost * (1.0 + 1e-5));
        if is_new && parents.len() < PARENTS {
            parents.push(Found {
                cost: found.cost,
                points: found.points.clone(),
            });
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
    fn mutate(&mut self, parent: &Found, random: &mut impl Rng) -> Option<Vec<Point>> {
        let mut points = parent.points.clone();
        let index = random.random_range(0..points.len());
        points[index] = self.draw_point(random)?;
        Some(points)
    }

    fn draw_point(&mut self, random: &mut impl Rng) -> Option<Point> {
        let (q, load) = self.sampler.draw(random)?;
        Some(self.local.point(&q, &load))
    }

    /// Improves the experiments in turn until nothing more is gained.
    fn refine(
        &mut self,
        mut points: Vec<Point>,
        offered: &[(Point, f64)],
        repeats: &[u32],
    ) -> Option<Found> {
        let size = self.work.borrow().information.nrows();
        let mut information = DMatrix::zeros(size, size);
        let mut last = f64::INFINITY;
        for _ in 0..SWEEPS {
            for index in 0..points.len() {
                self.rest(&points, repeats, index, &mut information);
                let repeats = f64::from(repeats[index]);
                points[index] = self.exchange(&points[index], offered, &information, repeats);
            }
            information.fill(0.0);
            for (point, &repeats) in points.iter().zip(repeats) {
                add_information(&mut information, &point.matrix, f64::from(repeats));
            }
            let cost = self.cost(&information);
            let improved = cost < last * (1.0 - CONVERGED);
            last = last.min(cost);
            if !improved {
                break;
            }
        }
        last.is_finite().then_some(Found { cost: last, points })
    }

    fn cost(&self, information: &DMatrix<f64>) -> f64 {
        let Work {
            cost, directions, ..
        } = &mut *self.work.borrow_mut();
        cost.cost(information, directions)
    }

    /// The information of all experiments but one.
    fn rest(&self, points: &[Point], repeats: &[u32], left_out: usize, rest: &mut DMatrix<f64>) {
        rest.fill(0.0);
        for (index, (point, &repeats)) in points.iter().zip(repeats).enumerate() {
            if index != left_out {
                add_information(rest, &point.matrix, f64::from(repeats));
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
