//! The approximate design: a distribution of weights over experiments, which no plan can beat.
//!
//! For weights w on experiments x the information is M = sum w A^T A. The cost `phi` = `rho_0`^2 is
//! convex in M and homogeneous of degree -1, so 1/phi is concave and homogeneous of degree 1, and for
//! any distribution with directional derivatives d(x) = trace(A G A^T), G = -d phi/dM (any subgradient, where
//! there is no derivative),
//!
//! ```text
//! phi(best distribution) >= phi^2 / max d(x)        (general equivalence theorem)
//! ```
//!
//! where the maximum runs over all experiments that a plan may have. A plan of m experiments is a
//! distribution with weights that are multiples of 1/m, so its `rho_0`^2 is at least phi^2 / (m max d).
//!
//! Where something is known before the free experiments, M0 of an earlier identification (its precision)
//! and of mandatory experiments, the distribution is that of f = m - m0 free ones beside it, M = M0 / f +
//! sum w A^T A. With B = C M^-1, for any M0 and m, by the inequality of Cauchy and Schwarz,
//!
//! ```text
//! rho_0^2 >= trace(C B^T)^2 / (trace(B M0 B^T) + (m - m0) max d(x)),    d(x) = trace(A B^T B A^T)
//! ```
//!
//! where mandatory experiments have their own derivatives, which may be smaller or larger than max d. That is
//! tightest for the m that the design was made for; without M0 it is the same for all.
//!
//! All that holds for other criteria, whose costs are convex and of degree -1, too: A as it is, det(M)^(-1/p)
//! for D and O1. With G = -d phi/dM at any M*,
//! phi(M) >= phi(M*)^2 / trace(G M) for every M: the tangent plane of 1/phi.
//!
//! The maximum is searched over the class of plans that [`Bound`](super::Bound) speaks about: where the
//! smooth bounds of the region hold, widened by what printing with one decimal may move, whether or
//! not there is a collision or the tracker's view is blocked. That contains the feasible region.

use nalgebra::{DMatrix, Matrix3, Matrix3xX, Vector3};
use rayon::prelude::*;

use super::error::SearchError;
use super::local::{FreeLoad, LocalSearch, Precision};
use super::observation::times;
use super::point::{Point, add_information, information_in};
use super::problem::Problem;
use super::sampling::{RandomPlans, points_inside, starts};
use super::weighing::{Weighing, apportioned, drop_light, normalise};
use crate::experiment::{Experiment, Plan, printed_tolerance};
use crate::numeric::random::generator;
use crate::numeric::random::streams::FIRST_SUPPORT;
use crate::plan::{Criterion, WIDENED_RAD};
use crate::robot::Load;

/// Rounds of adding experiments and weighting them.
const ROUNDS: usize = 60;
/// The rounds end when no experiment adds more than this share.
const TOLERANCE: f64 = 1e-4;
/// Where searches from random starts end this share above, they are missed.
const MISSED: f64 = 3e-4;
/// How often such are added, at most, as long as there is time for more searches.
const RETURNS: usize = 6;
/// As long as experiments of the pool prediction more than this share, there are no local searches.
const ROUGH_TOLERANCE: f64 = 2e-2;
/// Experiments that are added in one round.
const ADDED: usize = 8;
/// Experiments whose information differs by less than this share stand for one another.
const NEAR: f64 = 1e-3;
/// Weights below this are dropped.
const SMALLEST_WEIGHT: f64 = 1e-5;
/// Random local searches between two looks at whether enough are done.
const BATCH: usize = 64;
/// So many random local searches that end in the largest derivative are enough.
const ENOUGH: usize = 50;
/// However much work a search is, there are so many.
const FEWEST: usize = 4 * BATCH;
/// How many of the best different ends of random local searches are searched on to full precision.
const POLISHED: usize = 8;

/// A lower bound for every plan, and what it rests on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Certificate {
    /// The cost phi of the approximate design, for one experiment.
    pub cost: f64,
    /// The largest directional derivative found for any experiment of the class of plans: in the
    /// widened region, under a load of the set or one that is printed as such.
    pub largest_derivative: f64,
    /// The largest found in the region itself: the cost, where the approximate design is optimal (less what
    /// mandatory experiments beside it have of it).
    pub largest_inside: f64,
    /// The number of local searches for it, from random starts.
    pub searches: usize,
    /// How many of them ended within 0.1 % of the largest.
    pub agreeing: usize,
    /// The number of mandatory measurements, and the largest sum of directional derivatives of
    /// experiments that are printed as these.
    pub mandatory: (u32, f64),
    /// trace(B P B^T) for the precision P of what is known before any measurement.
    pub prior: f64,
}

impl Certificate {
    /// A lower bound of the cost of any plan of m measurements with the mandatory ones among them; none
    /// where these are more than m.
    pub fn lower_bound(&self, experiments: u32) -> Option<f64> {
        let (count, derivatives) = self.mandatory;
        let free = f64::from(experiments.checked_sub(count)?);
        let most = self.prior + derivatives + self.largest_derivative * free;
        (most > 0.0).then(|| self.cost * self.cost / most)
    }
}

/// A distribution of experiments with its certificate.
#[derive(Debug, Clone, PartialEq)]
pub struct ApproximateDesign {
    /// The criterion that it is best for.
    pub criterion: Criterion,
    /// The experiments.
    pub support: Vec<Point>,
    /// Their weights, which sum to one.
    pub weights: Vec<f64>,
    /// G: minus the derivative of the cost with respect to the information.
    pub directions: DMatrix<f64>,
    /// The bound that follows.
    pub certificate: Certificate,
    /// The experiments and other informative ones, for the search of plans.
    pub(super) candidates: Vec<Point>,
}

impl ApproximateDesign {
    /// Its information, with what stands beside it.
    pub(super) fn information(&self, problem: &Problem<'_>) -> DMatrix<f64> {
        let nothing = || DMatrix::zeros(problem.parameters(), problem.parameters());
        let mut information = problem.beside.clone().unwrap_or_else(nothing);
        for (point, weight) in self.support.iter().zip(&self.weights) {
            add_information(&mut information, &point.matrix, *weight);
        }
        information
    }

    /// A plan of so many free measurements in at most so many configurations that comes near the weights
    /// (Pukelsheim and Rieder 1992), the heaviest of them where there are too few.
    pub(super) fn rounded(&self, measurements: u32, configurations: u32) -> Plan {
        let mut heaviest: Vec<(&Point, f64)> = (self.support.iter())
            .zip(self.weights.iter().copied())
            .filter(|(_, weight)| weight * f64::from(measurements) > 0.25)
            .collect();
        heaviest.sort_by(|one, other| other.1.total_cmp(&one.1));
        heaviest.truncate(configurations.min(measurements) as usize);
        let weights: Vec<f64> = heaviest.iter().map(|(_, weight)| *weight).collect();
        let repeats = apportioned(&weights, measurements, 0.0, |_| u32::MAX);
        let experiments = heaviest.iter().zip(repeats);
        let experiments = experiments.map(|((point, _), repeats)| point.experiment(repeats));
        Plan {
            experiments: experiments.collect(),
        }
    }
}

/// Finds the approximate design by adding the most informative experiments until none adds
/// more. For criteria that are powers of others it is that of these, with their cost.
///
/// # Errors
/// No feasible experiment is found, the feasible ones do not show what is asked for, or the criterion has no such
/// design ([`Criterion::bounded_as`]).
pub fn approximate_design(
    problem: &Problem<'_>,
    seed: u64,
) -> Result<ApproximateDesign, SearchError> {
    let criterion = problem.optimised_as()?;
    let problem = &problem.by(criterion);
    let mut growing = Growing {
        problem,
        pool: points_inside(problem, problem.effort.pool, seed, 1),
        weights: Vec::new(),
        support: initial_support(problem, seed)?,
        weighing: Weighing::new(problem.cost(), problem.beside.clone(), problem.parameters()),
    };
    growing.weights = vec![(growing.support.len() as f64).recip(); growing.support.len()];
    let mut gap = 1.0;
    let mut returns = 0;
    let mut searches = 0;
    let mut informative: Vec<Point> = Vec::new();
    let certificate = loop {
        growing.grow(gap);
        let cost = growing.optimise(0.1 * TOLERANCE);
        let mean = growing.weighing.mean;
        let (certificate, ends) = growing.certify(seed, searches, cost);
        informative.extend(ends.iter().map(|(point, _)| point.clone()));
        // Where many searches come across more than those that start near the support, it goes on from there.
        let is_over = (ends.first()).is_none_or(|(_, value)| *value <= mean * (1.0 + MISSED));
        searches += certificate.searches;
        let is_afforded = searches < problem.affordable(1);
        if is_over || returns == RETURNS || !is_afforded || problem.is_stopped() {
            break certificate;
        }
        returns += 1;
        gap = certificate.largest_inside / mean - 1.0;
        let more = (ends.into_iter()).filter(|(_, value)| *value > mean * (1.0 + TOLERANCE));
        growing.add(more.collect());
    };
    let mut candidates = growing.support.clone();
    for point in informative {
        if !candidates.iter().any(|known| is_same(known, &point)) {
            candidates.push(point);
        }
    }
    Ok(ApproximateDesign {
        criterion,
        certificate,
        directions: growing.weighing.directions,
        support: growing.support,
        weights: growing.weights,
        candidates,
    })
}

/// A support that grows, with its weights.
struct Growing<'a> {
    problem: &'a Problem<'a>,
    pool: Vec<Point>,
    support: Vec<Point>,
    weights: Vec<f64>,
    weighing: Weighing,
}

impl Growing<'_> {
    fn optimise(&mut self, tolerance: f64) -> f64 {
        let blocks: Vec<DMatrix<f64>> = self.support.iter().map(Point::information).collect();
        self.weighing.weigh(&blocks, &mut self.weights, tolerance)
    }

    /// Adds the most informative experiments until none adds more; the best adds `gap` more to begin with.
    fn grow(&mut self, mut gap: f64) {
        for _ in 0..ROUNDS {
            self.optimise(0.1 * gap);
            let cost = self.weighing.mean;
            drop_light(&mut self.support, &mut self.weights, SMALLEST_WEIGHT);
            normalise(&mut self.weights);
            let directions = &self.weighing.directions;
            let derivative = |point: &Point| information_in(&point.matrix, directions);
            let mut ranked: Vec<(&Point, f64)> = self
                .pool
                .iter()
                .map(|point| (point, derivative(point)))
                .collect();
            ranked.sort_by(|one, other| other.1.total_cmp(&one.1));
            let much = cost * (1.0 + ROUGH_TOLERANCE);
            let best = ranked.iter().take(ADDED).filter(|(_, value)| *value > much);
            let best = best.map(|&(point, value)| (point.clone(), value));
            let mut found: Vec<(Point, f64)> = best.collect();
            if found.is_empty() {
                let promising = ranked.iter().take(self.problem.effort.probes);
                let promising = promising.map(|(point, _)| *point);
                let starts: Vec<&Point> = self.support.iter().chain(promising).collect();
                found = climbs(self.problem, &starts, directions, Precision::FINE);
                found.retain(|(_, value)| *value > cost * (1.0 + TOLERANCE));
            }
            let largest = found.iter().map(|(_, value)| *value).fold(0.0, f64::max);
            gap = (largest / cost - 1.0).clamp(TOLERANCE, gap.max(TOLERANCE));
            if !self.add(found) || self.problem.is_stopped() {
                break;
            }
        }
    }

    /// Adds the most informative of the experiments that were found, or puts them in the place of those
    /// that tell the same; whether there are any.
    fn add(&mut self, mut found: Vec<(Point, f64)>) -> bool {
        found.sort_by(|one, other| other.1.total_cmp(&one.1));
        let (support, weights) = (&mut self.support, &mut self.weights);
        let old = support.len();
        let mut taken: Vec<Point> = Vec::new();
        for (point, _) in found {
            if taken.len() == ADDED || taken.iter().any(|known| is_same(known, &point)) {
                continue;
            }
            taken.push(point.clone());
            match support.iter_mut().find(|known| is_same(known, &point)) {
                Some(known) => *known = point,
                None => support.push(point),
            }
        }
        let added = support.len() - old;
        if added > 0 {
            for weight in weights.iter_mut() {
                *weight *= 0.5;
            }
            weights.resize(support.len(), 0.5 / added as f64);
        }
        !taken.is_empty()
    }

    /// Searches the largest derivative in the region, from random starts until enough of these agree, and
    /// goes on from the best ends and from the support in the widened region. Returns also where the
    /// random searches ended. The starts are others than those of the searches before.
    fn certify(&self, seed: u64, before: usize, cost: f64) -> (Certificate, Vec<(Point, f64)>) {
        let (problem, mean) = (self.problem, self.weighing.mean);
        let directions = &self.weighing.directions;
        let mut ends: Vec<(Point, f64)> = Vec::new();
        let mut searches = 0;
        let most = (problem.effort.certificate_probes).min(problem.affordable(1).max(FEWEST));
        let is_enough = |ends: &[(Point, f64)]| agreeing(ends) >= ENOUGH || problem.is_stopped();
        while searches < most && (searches == 0 || !is_enough(&ends)) {
            let starts = starts(problem, BATCH, seed, 2 + (before + searches) as u64);
            let starts: Vec<&Point> = starts.iter().collect();
            ends.extend(climbs(problem, &starts, directions, Precision::ROUGH));
            searches += BATCH;
        }
        ends.sort_by(|one, other| other.1.total_cmp(&one.1));
        let mut starts: Vec<&Point> = Vec::new();
        for (point, _) in &ends {
            if starts.len() < POLISHED && !starts.iter().any(|known| is_same(known, point)) {
                starts.push(point);
            }
        }
        starts.extend(&self.support);
        let widened = problem.widened();
        let polished = climbs(&widened, &starts, directions, Precision::FINE);
        let local = LocalSearch::new(&widened);
        let printed = polished.iter();
        let printed = printed.map(|(point, _)| printed_derivative(&local, point, directions));
        let certificate = Certificate {
            mandatory: mandatory(problem, directions),
            prior: directions.dot(&problem.prior),
            cost,
            largest_derivative: printed.fold(mean, f64::max),
            largest_inside: ends.first().map_or(mean, |(_, value)| value.max(mean)),
            searches,
            agreeing: agreeing(&ends),
        };
        (certificate, ends)
    }
}

/// The number of mandatory measurements, and the largest sum of derivatives of experiments that are
/// printed as these.
fn mandatory(problem: &Problem<'_>, directions: &DMatrix<f64>) -> (u32, f64) {
    let plan = &problem.task.design.mandatory;
    let derivative = |experiment: &Experiment| {
        let (q, load) = (experiment.configuration_rad.as_slice(), &experiment.load);
        let near = problem.near(experiment, WIDENED_RAD);
        let local = LocalSearch::new(&near);
        let point = local.point(q, load, experiment.direction);
        let here = printed_derivative(&local, &point, directions);
        let found = local.climb(&point, load, FreeLoad::None, directions, Precision::FINE);
        let near = found.map_or(0.0, |(point, _)| {
            printed_derivative(&local, &point, directions)
        });
        f64::from(experiment.repeats) * here.max(near)
    };
    let sum = plan.experiments.iter().map(derivative).sum();
    (plan.measurements(), sum)
}

/// The largest derivative under loads that are printed as that of an experiment. Its root is a norm of
/// the load, so that it is at most the sum of those of the load and of what printing may add.
fn printed_derivative(local: &LocalSearch<'_>, point: &Point, directions: &DMatrix<f64>) -> f64 {
    let shown: Vec<Matrix3xX<f64>> = (0..6)
        .map(|axis| {
            let unit = Vector3::ith(axis % 3, 1.0);
            let mut load = Load::NONE;
            *(if axis < 3 {
                &mut load.force_n
            } else {
                &mut load.torque_nm
            }) = unit;
            local.point(&point.q, &load, point.direction).matrix
        })
        .collect();
    let largest = |first: usize| {
        let form = Matrix3::from_fn(|row, column| {
            let shown_there = &shown[first + row];
            let mut product = shown_there.clone();
            times(shown_there, directions, &mut product);
            product.dot(&shown[first + column])
        });
        form.symmetric_eigenvalues().max().max(0.0).sqrt()
    };
    let own = information_in(&point.matrix, directions).max(0.0).sqrt();
    (own + printed_tolerance(&point.load) * (largest(0) + largest(3))).powi(2)
}

/// How many searches ended within 0.1 % of the largest derivative found.
fn agreeing(ends: &[(Point, f64)]) -> usize {
    let largest = ends.iter().map(|(_, value)| *value).fold(0.0, f64::max);
    ends.iter()
        .filter(|(_, value)| *value > 0.999 * largest)
        .count()
}

/// Random feasible experiments, each under the load that tells most of all compliances alike.
fn initial_support(problem: &Problem<'_>, seed: u64) -> Result<Vec<Point>, SearchError> {
    let mut sampler = RandomPlans::new(problem);
    let mut random = generator(seed, FIRST_SUPPORT);
    let local = LocalSearch::new(problem);
    (0..40)
        .map(|_| {
            let drawn =
                (sampler.draw_one(&mut random)).ok_or_else(|| sampler.explain_empty(seed))?;
            let q = drawn.configuration_rad.as_slice();
            Ok(local.point(q, &drawn.load, drawn.direction))
        })
        .collect()
}

/// Local searches for the largest derivative.
fn climbs(
    problem: &Problem<'_>,
    starts: &[&Point],
    directions: &DMatrix<f64>,
    precision: Precision,
) -> Vec<(Point, f64)> {
    starts
        .par_iter()
        .map_init(
            || LocalSearch::new(problem),
            |local, start| local.most_informative(start, directions, precision),
        )
        .flatten()
        .collect()
}

/// Whether two experiments tell the same: the arm has many configurations, mirrored or turned, that
/// give the same information.
fn is_same(one: &Point, other: &Point) -> bool {
    // Informations that are so near have traces that are: of most pairs these tell, and no matrices have to be made.
    let [trace, beside] = [one, other].map(|point| point.matrix.norm_squared());
    let size = one.matrix.ncols() as f64;
    if (trace - beside).abs() > 1.001 * size.sqrt() * NEAR * trace {
        return false;
    }
    let (first, second) = (one.information(), other.information());
    (&first - second).norm() < NEAR * first.norm()
}
