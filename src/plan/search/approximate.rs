//! The approximate design: a distribution of weights over experiments, which no plan can beat.
//!
//! For weights w on experiments x the information is M = sum w A^T A. The cost `phi` = `rho_0`^2 is
//! convex in M and homogeneous of degree -1, so 1/phi is concave and homogeneous of degree 1, and for
//! any distribution with directional derivatives d(x) = trace(A G A^T), G = -d phi/dM,
//!
//! ```text
//! phi(best distribution) >= phi^2 / max d(x)        (general equivalence theorem)
//! ```
//!
//! where the maximum runs over the whole feasible region. A plan of m experiments is a distribution
//! with weights that are multiples of 1/m, so its `rho_0`^2 is at least phi^2 / (m max d). Mandatory
//! experiments have their own derivatives in place of max d.
//!
//! The maximum is searched where the smooth bounds hold, whether or not there is a collision or the
//! tracker's view is blocked: that region contains the feasible one, so the bound holds there too.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::local::LocalSearch;
use super::problem::{Point, Problem, SearchError, add_information, information_in};
use super::sampling::Sampler;
use crate::random::generator;

/// Rounds of adding experiments and weighting them.
const ROUNDS: usize = 40;
/// The rounds end when no experiment promises more than this share.
const TOLERANCE: f64 = 1e-4;
/// Weights below this are dropped.
const SMALLEST_WEIGHT: f64 = 1e-5;
/// Steps of the multiplicative algorithm in one round.
const WEIGHT_STEPS: usize = 3000;

/// A lower bound for every plan, and what it rests on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Certificate {
    /// The cost phi of the approximate design, for one experiment.
    pub cost: f64,
    /// The largest directional derivative found in the feasible region.
    pub largest_derivative: f64,
    /// The number of local searches for it, from random starts.
    pub searches: usize,
    /// How many of them ended within 0.1 % of the largest.
    pub agreeing: usize,
    /// The number of mandatory measurements, and the sum of their directional derivatives.
    pub mandatory: (u32, f64),
}

impl Certificate {
    /// A lower bound of the cost of any plan of m experiments.
    #[must_use]
    pub fn lower_bound(&self, experiments: u32) -> f64 {
        let (count, derivatives) = self.mandatory;
        let free = f64::from(experiments.saturating_sub(count));
        self.cost * self.cost / (derivatives + self.largest_derivative * free)
    }
}

/// A distribution of experiments with its certificate.
#[derive(Debug, Clone, PartialEq)]
pub struct ApproximateDesign {
    /// The experiments.
    pub support: Vec<Point>,
    /// Their weights, which sum to one.
    pub weights: Vec<f64>,
    /// G: minus the derivative of the cost with respect to the information.
    pub directions: DMatrix<f64>,
    /// The bound that follows.
    pub certificate: Certificate,
}

/// Finds the approximate design by adding the most informative experiments until none promises
/// more.
///
/// # Errors
/// No feasible experiment is found, or the feasible ones do not show what the test poses need.
pub fn approximate_design(
    problem: &Problem<'_>,
    seed: u64,
) -> Result<ApproximateDesign, SearchError> {
    let mut support = initial_support(problem, seed)?;
    let mut weights = vec![(support.len() as f64).recip(); support.len()];
    let mut weighing = Weighing::new(problem);
    for round in 0..ROUNDS {
        let cost = weighing.optimise(&support, &mut weights);
        prune(&mut support, &mut weights);
        let stream = 1 + round as u64;
        let found = climbs(
            problem,
            &support,
            &weighing.directions,
            seed,
            stream,
            problem.effort.probes,
        );
        let threshold = cost * (1.0 + TOLERANCE);
        let mut found: Vec<_> = found
            .into_iter()
            .filter(|(_, value)| *value > threshold)
            .collect();
        if found.is_empty() {
            break;
        }
        found.sort_by(|one, other| other.1.total_cmp(&one.1));
        let mut added = 0;
        for (point, _) in found {
            if added < 8 && !support.iter().any(|known| is_same(known, &point)) {
                support.push(point);
                weights.push(0.0);
                added += 1;
            }
        }
        if added == 0 {
            break;
        }
        let share = 0.5 / added as f64;
        let old = weights.len() - added;
        for (index, weight) in weights.iter_mut().enumerate() {
            *weight = if index < old { *weight * 0.5 } else { share };
        }
    }
    let cost = weighing.optimise(&support, &mut weights);
    let searches = problem.effort.certificate_probes;
    let found = climbs(problem, &support, &weighing.directions, seed, 0, searches);
    let largest_derivative = found.iter().map(|(_, value)| *value).fold(cost, f64::max);
    let mandatory = &problem.scenario.design.mandatory;
    Ok(ApproximateDesign {
        certificate: Certificate {
            mandatory: (
                mandatory.measurements(),
                problem.information(mandatory).dot(&weighing.directions),
            ),
            cost,
            largest_derivative,
            searches,
            agreeing: found
                .iter()
                .filter(|(_, value)| *value > 0.999 * largest_derivative)
                .count(),
        },
        directions: weighing.directions,
        support,
        weights,
    })
}

/// Random feasible experiments, each under the load that tells most of all compliances alike.
fn initial_support(problem: &Problem<'_>, seed: u64) -> Result<Vec<Point>, SearchError> {
    let mut sampler = Sampler::new(problem);
    let mut random = generator(seed, u64::MAX);
    let local = LocalSearch::new(problem);
    let support: Vec<Point> = (0..40)
        .map(|_| {
            let (q, load) = sampler
                .draw(&mut random)
                .ok_or_else(|| sampler.explain_empty(seed))?;
            Ok(local.point(&q, &load))
        })
        .collect::<Result<_, _>>()?;
    check_excited(problem, &support)?;
    Ok(support)
}

/// Every compliance must show in some experiment.
fn check_excited(problem: &Problem<'_>, support: &[Point]) -> Result<(), SearchError> {
    let shown = |parameter: usize| {
        let lengths = support
            .iter()
            .map(|point| point.matrix.column(parameter).norm());
        lengths.fold(0.0, f64::max)
    };
    let shown: Vec<f64> = (0..problem.parameters()).map(shown).collect();
    let largest = shown.iter().copied().fold(0.0, f64::max);
    let joints: Vec<String> = problem
        .scenario
        .parameter_names()
        .into_iter()
        .zip(shown)
        .filter(|(_, shown)| *shown <= 1e-9 * largest)
        .map(|(name, _)| name)
        .collect();
    if joints.is_empty() {
        Ok(())
    } else {
        Err(SearchError::NotExcited { joints })
    }
}

/// Local searches for the largest derivative, from the support and from random starts.
fn climbs(
    problem: &Problem<'_>,
    support: &[Point],
    directions: &DMatrix<f64>,
    seed: u64,
    stream: u64,
    probes: usize,
) -> Vec<(Point, f64)> {
    (0..support.len() + probes)
        .into_par_iter()
        .map_init(
            || (LocalSearch::new(problem), Sampler::new(problem)),
            |(local, sampler), index| {
                let start = if let Some(point) = support.get(index) {
                    point.q.clone()
                } else {
                    let run = (stream << 32) + index as u64;
                    sampler.draw_inside(&mut generator(seed, run))?
                };
                local.most_informative(&start, directions)
            },
        )
        .flatten()
        .collect()
}

/// Whether two experiments tell the same: the arm has many configurations, mirrored or turned, that
/// give the same information.
fn is_same(one: &Point, other: &Point) -> bool {
    let (first, second) = (one.information(), other.information());
    (&first - second).norm() < 1e-3 * first.norm()
}

fn prune(support: &mut Vec<Point>, weights: &mut Vec<f64>) {
    let kept: Vec<bool> = weights
        .iter()
        .map(|weight| *weight > SMALLEST_WEIGHT)
        .collect();
    let mut keep = kept.iter();
    support.retain(|_| keep.next().copied().unwrap_or(false));
    weights.retain(|weight| *weight > SMALLEST_WEIGHT);
    let total: f64 = weights.iter().sum();
    for weight in weights {
        *weight /= total;
    }
}

/// Finds the best weights on given experiments.
struct Weighing {
    cost: crate::plan::CriterionFunction,
    information: DMatrix<f64>,
    directions: DMatrix<f64>,
}

impl Weighing {
    fn new(problem: &Problem<'_>) -> Self {
        let size = problem.parameters();
        Self {
            cost: problem.cost(),
            information: DMatrix::zeros(size, size),
            directions: DMatrix::zeros(size, size),
        }
    }

    /// The multiplicative algorithm: each weight grows with the root of its derivative (Fellman;
    /// Yu 2010 shows that the cost never rises). Returns the cost.
    fn optimise(&mut self, support: &[Point], weights: &mut [f64]) -> f64 {
        let mut cost = f64::INFINITY;
        for _ in 0..WEIGHT_STEPS {
            self.information.fill(0.0);
            for (point, weight) in support.iter().zip(weights.iter()) {
                add_information(&mut self.information, &point.matrix, *weight);
            }
            cost = self.cost.cost(&self.information, &mut self.directions);
            if !cost.is_finite() {
                return cost;
            }
            let mut largest = 0.0_f64;
            let mut total = 0.0;
            for (point, weight) in support.iter().zip(weights.iter_mut()) {
                let derivative = information_in(&point.matrix, &self.directions);
                largest = largest.max(derivative);
                *weight *= derivative.max(0.0).sqrt();
                total += *weight;
            }
            for weight in weights.iter_mut() {
                *weight /= total;
            }
            if largest <= cost * (1.0 + 0.1 * TOLERANCE) {
                break;
            }
        }
        cost
    }
}
