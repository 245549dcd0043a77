//! Random feasible experiments.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;
use rand::{Rng, RngExt};
use rand_distr::{Distribution, UnitSphere};
use rayon::prelude::*;

use super::error::SearchError;
use super::local::LocalSearch;
use super::point::{Point, experiment, force};
use super::problem::Problem;
use crate::experiment::Loads;
use crate::numeric::random::{generator, streams};
use crate::plan::feasibility::COLLISION;
use crate::plan::{Criterion, Experiment, Feasibility, Plan, Violation};
use crate::robot::Load;
use crate::task::Task;

/// Random experiments that are tried before the region is held to be empty.
const ATTEMPTS: usize = 20_000;

/// So many colliding pairs are named where nothing is feasible.
const PAIRS: usize = 5;

/// How many other angles of the joints that do not matter are tried to get clear of an obstacle.
const VARIANTS: usize = 24;

/// Draws configurations uniformly from the joint ranges, and loads from those that are allowed: what a laboratory without a plan
/// would measure.
#[derive(Debug)]
pub struct RandomPlans<'a> {
    problem: &'a Problem<'a>,
    pub(super) local: LocalSearch<'a>,
    feasibility: Feasibility<'a>,
}

impl<'a> RandomPlans<'a> {
    /// Of a problem.
    pub fn new(problem: &'a Problem<'a>) -> Self {
        Self {
            local: LocalSearch::new(problem),
            feasibility: Feasibility::new(problem.task),
            problem,
        }
    }

    /// A configuration that keeps the smooth bounds and is clear of collisions, with a load and a direction; `None`
    /// after many attempts.
    pub(super) fn draw_one(&mut self, random: &mut impl Rng) -> Option<Experiment> {
        (0..ATTEMPTS).find_map(|_| {
            let drawn = self.inside(random)?;
            let (q, direction) = (drawn.configuration_rad.as_slice(), drawn.direction.as_ref());
            (self.feasibility.is_clear(q, &drawn.load, direction)).then_some(drawn)
        })
    }

    /// A draw, where it keeps the smooth bounds.
    fn inside(&self, random: &mut impl Rng) -> Option<Experiment> {
        let q = uniform(&self.problem.ranges, random);
        let load = self.load(&q, random)?;
        let direction = self.direction(random);
        (self.local.is_inside(&q, &load)).then(|| experiment(&q, load, direction, 1))
    }

    /// Random plan number `run` under a seed.
    ///
    /// # Errors
    /// No feasible experiment is found.
    pub fn draw(&mut self, experiments: u32, seed: u64, run: u64) -> Result<Plan, SearchError> {
        self.draw_of(experiments, seed, streams::random_plan(run))
    }

    /// A random plan of a stream under a seed.
    pub(in crate::plan) fn draw_of(
        &mut self,
        experiments: u32,
        seed: u64,
        stream: u64,
    ) -> Result<Plan, SearchError> {
        let mut random = generator(seed, stream);
        let experiments = (0..experiments)
            .map(|_| (self.draw_one(&mut random)).ok_or_else(|| self.explain_empty(seed)));
        Ok(Plan {
            experiments: experiments.collect::<Result<_, _>>()?,
        })
    }

    /// The same experiment, clear of collisions and in sight: itself, or one that tells the same at
    /// other angles of the joints that do not matter. `None` where there is none among a fixed set.
    pub(super) fn clear_variant(&mut self, point: &Point) -> Option<Point> {
        self.variant_beside(point, &[])
    }

    /// The same in none of the configurations that are taken.
    pub(super) fn variant_beside(&mut self, point: &Point, taken: &[Point]) -> Option<Point> {
        let direction = point.direction;
        let mut is_clear = |q: &[f64]| {
            let is_free = taken.iter().all(|other| other.q != q);
            is_free && (self.feasibility).is_clear(q, &point.load, direction.as_ref())
        };
        if is_clear(&point.q) {
            return Some(point.clone());
        }
        let free = &self.problem.indifferent;
        if free.is_empty() {
            return None;
        }
        let mut random = generator(streams::FIXED_SEED, streams::VARIANTS);
        (0..VARIANTS + taken.len()).find_map(|_| {
            let mut q = point.q.clone();
            for &joint in free {
                let (low, high) = self.problem.ranges[joint];
                q[joint] = low + (high - low) * random.random::<f64>();
            }
            (self.local.is_inside(&q, &point.load) && is_clear(&q))
                .then(|| self.local.point(&q, &point.load, direction))
        })
    }

    /// Whether experiments are clear of collisions and in sight.
    pub(super) fn are_clear(&mut self, experiments: &[Experiment]) -> bool {
        experiments.iter().all(|each| {
            let (q, direction) = (each.configuration_rad.as_slice(), each.direction.as_ref());
            self.feasibility.is_clear(q, &each.load, direction)
        })
    }

    /// An experiment that keeps the smooth bounds only.
    pub(super) fn draw_inside(&self, random: &mut impl Rng) -> Option<Point> {
        let drawn = (0..ATTEMPTS).find_map(|_| self.inside(random))?;
        let q = drawn.configuration_rad.as_slice();
        Some(self.local.point(q, &drawn.load, drawn.direction))
    }

    /// An experiment within the joint ranges, whatever the other bounds.
    fn draw_in_ranges(&self, random: &mut impl Rng) -> Point {
        let q = uniform(&self.problem.ranges, random);
        let load = (self.load(&q, random)).unwrap_or_else(|| self.least_load());
        let direction = self.direction(random);
        self.local.point(&q, &load, direction)
    }

    /// Why nothing feasible was found: the share of random experiments that each constraint rejects,
    /// and the pairs of geometries that collide most often.
    pub(super) fn explain_empty(&mut self, seed: u64) -> SearchError {
        const SAMPLES: usize = 2000;
        let mut random = generator(seed, streams::EMPTY_REGION);
        let mut rejected = BTreeMap::<String, usize>::new();
        let mut colliding = BTreeMap::<[String; 2], usize>::new();
        for _ in 0..SAMPLES {
            let q = uniform(&self.problem.ranges, &mut random);
            let load = self
                .load(&q, &mut random)
                .unwrap_or_else(|| self.least_load());
            let experiment = experiment(&q, load, self.direction(&mut random), 1);
            let violations = self.feasibility.violations_of(1, &experiment);
            let kinds: BTreeSet<String> = violations.iter().map(Violation::kind).collect();
            for what in kinds {
                *rejected.entry(what).or_default() += 1;
            }
            for pair in self.feasibility.colliding_pairs(&experiment) {
                *colliding.entry(pair).or_default() += 1;
            }
        }
        let share = |count: usize| 100.0 * count as f64 / SAMPLES as f64;
        let pairs = most_often(colliding).into_iter().take(PAIRS);
        let pairs: Vec<String> = pairs
            .map(|([one, other], count)| format!("{one} and {other} in {:.1} %", share(count)))
            .collect();
        let rejection = |(what, count): (String, usize)| {
            let mut text = format!("{what} rejects {:.1} %", share(count));
            if what == COLLISION {
                text += &format!(" ({})", pairs.join(", "));
            }
            text
        };
        let rejections = most_often(rejected).into_iter().map(rejection).collect();
        SearchError::EmptyRegion {
            samples: SAMPLES,
            rejections,
        }
    }

    /// A load at joint angles `q`. Where its size is free, the largest that the torque bounds allow;
    /// none where they allow none.
    fn load(&self, q: &[f64], random: &mut impl Rng) -> Option<Load> {
        let (direction, sizes) = match &self.problem.task.loads {
            Loads::Direction { direction, force_n } => (*direction, *force_n),
            Loads::Any { force_max_n } => {
                let direction: [f64; 3] = UnitSphere.sample(random);
                (direction.into(), [0.0, *force_max_n])
            }
            listed => {
                let loads = listed.listed()?;
                return Some(loads[random.random_range(0..loads.len())]);
            }
        };
        let size = self.local.largest_size(q, &direction, sizes)?;
        Some(force(&direction, size))
    }

    /// One of the directions that a gauge may read along.
    fn direction(&self, random: &mut impl Rng) -> Option<Vector3<f64>> {
        match &self.problem.task.directions[..] {
            [only] => *only,
            several => several[random.random_range(0..several.len())],
        }
    }

    /// What is least likely to break a torque bound.
    fn least_load(&self) -> Load {
        match &self.problem.task.loads {
            Loads::Any { .. } => Load::NONE,
            Loads::Direction { direction, force_n } => force(direction, force_n[0]),
            listed => listed.samples()[0],
        }
    }
}

/// So many random experiments within the smooth bounds, fewer if they are hard to find, drawn on all threads. Each `number` has
/// experiments of its own, from 1.
pub(super) fn points_inside(
    problem: &Problem<'_>,
    size: usize,
    seed: u64,
    number: u64,
) -> Vec<Point> {
    drawn(problem, size, |sampler, index| {
        sampler.draw_inside(&mut generator(seed, streams::pool(number, index)))
    })
}

/// Starts of searches over one experiment: half of them within the smooth bounds, half anywhere in the joint ranges, from where
/// searches come into parts of a narrow region that random experiments within it miss.
pub(super) fn starts(problem: &Problem<'_>, size: usize, seed: u64, number: u64) -> Vec<Point> {
    drawn(problem, size, |sampler, index| {
        let random = &mut generator(seed, streams::pool(number, index));
        if index % 2 == 0 {
            sampler.draw_inside(random)
        } else {
            Some(sampler.draw_in_ranges(random))
        }
    })
}

/// What is drawn by number, on all threads.
fn drawn<'a>(
    problem: &'a Problem<'a>,
    size: usize,
    draw: impl Fn(&mut RandomPlans<'a>, u64) -> Option<Point> + Sync + Send,
) -> Vec<Point> {
    (0..size as u64)
        .into_par_iter()
        .map_init(|| RandomPlans::new(problem), draw)
        .flatten()
        .collect()
}

/// A random feasible plan, number `run` under a seed; see [`RandomPlans::draw`].
///
/// # Errors
/// No feasible experiment is found.
pub fn random_plan(
    task: &Task,
    experiments: u32,
    seed: u64,
    run: u64,
) -> Result<Plan, SearchError> {
    let problem = Problem::new(task, Criterion::TestPose);
    RandomPlans::new(&problem).draw(experiments, seed, run)
}

/// Of so many random plans, sampled on all threads, the one with the median of the predicted accuracies `rho_0`, and that (m).
///
/// # Errors
/// No feasible experiment is found.
pub fn median_random_plan(
    task: &Task,
    experiments: u32,
    plans: u64,
    seed: u64,
) -> Result<(f64, Plan), SearchError> {
    let problem = Problem::new(task, Criterion::TestPose);
    let mut predicted = (0..plans)
        .into_par_iter()
        .map_init(
            || (RandomPlans::new(&problem), problem.cost()),
            |(random, cost), run| {
                let plan = random.draw(experiments, seed, run)?;
                let rho0 = cost.value(&problem.information(&plan));
                Ok((rho0.unwrap_or(f64::INFINITY), plan))
            },
        )
        .collect::<Result<Vec<(f64, Plan)>, SearchError>>()?;
    predicted.sort_by(|one, other| one.0.total_cmp(&other.0));
    Ok(predicted.swap_remove(predicted.len() / 2))
}

/// Counts, the largest first.
fn most_often<K: Ord>(counts: BTreeMap<K, usize>) -> Vec<(K, usize)> {
    let mut counts: Vec<_> = counts.into_iter().collect();
    counts.sort_by_key(|(_, count)| Reverse(*count));
    counts
}

fn uniform(ranges: &[(f64, f64)], random: &mut impl Rng) -> Vec<f64> {
    ranges
        .iter()
        .map(|&(low, high)| low + (high - low) * random.random::<f64>())
        .collect()
}
