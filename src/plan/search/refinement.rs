//! The best plan near a given one: its experiments are improved in turn, and repeats moved.

use std::cell::RefCell;

use nalgebra::{DMatrix, Matrix3xX};

use super::local::Precision;
use super::point::{Point, add_information, in_directions};
use super::problem::Problem;
use super::sampling::RandomPlans;
use crate::plan::{CriterionFunction, Experiment};

/// The most sweeps over the experiments of one plan that refine them.
const SWEEPS: usize = 200;
/// A moved repeat must lower the cost by this share.
const WORTHWHILE: f64 = 1e-3;
/// A refinement has hope as long as so many gains like the last would do.
const HOPE: f64 = 10.0;
/// The longest extrapolation, in sweeps.
const LONGEST_STEP: f64 = 50.0;

/// A plan that a search ended in.
#[derive(Debug, Clone)]
pub(super) struct Found {
    pub cost: f64,
    pub points: Vec<Point>,
    pub repeats: Vec<u32>,
}

/// Refines plans; one for each thread.
pub(super) struct Refinement<'a> {
    pub problem: &'a Problem<'a>,
    pub sampler: RandomPlans<'a>,
    /// The information of the mandatory experiments.
    pub mandatory: DMatrix<f64>,
    pub work: RefCell<Work>,
}

pub(super) struct Work {
    pub cost: CriterionFunction,
    information: DMatrix<f64>,
    directions: DMatrix<f64>,
}

impl<'a> Refinement<'a> {
    pub fn new(problem: &'a Problem<'a>) -> Self {
        let size = problem.parameters();
        Self {
            problem,
            sampler: RandomPlans::new(problem),
            mandatory: problem.information(&problem.task.design.mandatory),
            work: RefCell::new(Work {
                cost: problem.cost(),
                information: DMatrix::zeros(size, size),
                directions: DMatrix::zeros(size, size),
            }),
        }
    }

    /// A plan that is known, without the mandatory experiments.
    pub fn known(&self, experiments: &[Experiment]) -> Found {
        let points = experiments.iter().map(|each| {
            let q = each.configuration_rad.as_slice();
            self.sampler.local.point(q, &each.load, each.direction)
        });
        let repeats = experiments.iter().map(|each| each.repeats).collect();
        self.plan(points.collect(), repeats)
    }

    /// A plan with its cost.
    pub fn plan(&self, points: Vec<Point>, repeats: Vec<u32>) -> Found {
        let mut found = Found {
            cost: f64::INFINITY,
            points,
            repeats,
        };
        let mut information = self.mandatory.clone();
        self.total(&found, None, &mut information);
        found.cost = self.cost(&information);
        found
    }

    /// Refines to full precision, also after moving single repeats from one configuration to another.
    pub fn polish(&mut self, found: Found) -> Found {
        let mut best = self.refine(found, Precision::FINE, f64::INFINITY);
        let count = best.points.len();
        while !self.problem.is_stopped() {
            let mut better: Option<Found> = None;
            for (from, to) in (0..count * count).map(|pair| (pair / count, pair % count)) {
                if from == to || best.repeats[from] == 1 {
                    continue;
                }
                let mut repeats = best.repeats.clone();
                repeats[from] -= 1;
                repeats[to] += 1;
                let lowest = better.as_ref().unwrap_or(&best).cost;
                let moved = self.plan(best.points.clone(), repeats);
                let moved = self.refine(moved, Precision::ROUGH, lowest);
                if moved.cost < lowest * (1.0 - WORTHWHILE) {
                    better = Some(moved);
                }
            }
            let Some(better) = better else { break };
            best = self.refine(better, Precision::FINE, f64::INFINITY);
        }
        best
    }

    /// Improves the experiments in turn, and moves repeats from one to another, until nothing more
    /// is gained, or so little that the cost will not fall below `hopeless`.
    pub fn refine(&mut self, mut best: Found, precision: Precision, hopeless: f64) -> Found {
        let mut information = self.mandatory.clone();
        let mut next = best.clone();
        let mut is_extrapolated = false;
        for _ in 0..SWEEPS {
            if self.problem.is_stopped() && best.cost.is_finite() {
                break;
            }
            next.repeats.clone_from(&best.repeats);
            self.sweep(&mut next, precision, is_extrapolated, &mut information);
            next.cost = self.cost(&information);
            let gain = 1.0 - next.cost / best.cost;
            let before = best.clone();
            if gain > 0.0 {
                best.clone_from(&next);
            }
            next.points.clone_from(&best.points);
            if gain > precision.converged {
                if best.cost * (1.0 - HOPE * gain) > hopeless {
                    break;
                }
                is_extrapolated = self.extrapolate(&before.points, &best, &mut next);
            } else if is_extrapolated {
                is_extrapolated = false;
            } else {
                self.total(&best, None, &mut information);
                if !self.move_repeat(&mut best, &information) {
                    break;
                }
            }
        }
        best
    }

    /// Improves each experiment in turn, and leaves the information of all; none where one is
    /// infeasible. Those that are not improved may collide only if they were `extrapolated`.
    fn sweep(
        &mut self,
        found: &mut Found,
        precision: Precision,
        extrapolated: bool,
        information: &mut DMatrix<f64>,
    ) {
        for index in 0..found.points.len() {
            self.total(found, Some(index), information);
            let (present, repeats) = (&found.points[index], found.repeats[index]);
            if let Some(better) = self.improve(present, information, repeats, precision) {
                found.points[index] = better;
                continue;
            }
            let is_inside = self.sampler.local.is_inside(&present.q, &present.load);
            if is_inside && !extrapolated {
                continue;
            }
            let clear = is_inside.then(|| self.sampler.clear_variant(present));
            let Some(clear) = clear.flatten() else {
                information.fill(0.0);
                return;
            };
            found.points[index] = clear;
        }
        self.total(found, None, information);
    }

    /// Goes on in the direction of a sweep's whole step as long as that lowers the cost, be it a
    /// little out of bounds: the next sweep starts there. Sweeps alone converge slowly.
    fn extrapolate(&mut self, before: &[Point], best: &Found, next: &mut Found) -> bool {
        let mut lowest = best.cost;
        let mut factor = 1.0;
        while factor < LONGEST_STEP {
            let points = before.iter().zip(&best.points).map(|(before, after)| {
                let q = (before.q.iter().zip(&after.q))
                    .map(|(before, after)| after + factor * (after - before));
                let q = self.sampler.local.in_ranges(q.collect());
                self.sampler.local.point(&q, &after.load, after.direction)
            });
            let found = self.plan(points.collect(), best.repeats.clone());
            if found.cost >= lowest {
                break;
            }
            lowest = found.cost;
            *next = found;
            factor *= 2.0;
        }
        lowest < best.cost
    }

    /// Moves one repeat between two configurations where that lowers the cost of a plan that tells so much most.
    pub fn move_repeat(&self, found: &mut Found, information: &DMatrix<f64>) -> bool {
        let Found {
            cost: lowest,
            points,
            repeats,
        } = found;
        if self.has_coincident(points) {
            return false;
        }
        let mut best = None;
        let mut moved = information.clone();
        for from in (0..points.len()).filter(|&from| repeats[from] > 1) {
            for to in (0..points.len()).filter(|&to| to != from) {
                moved.copy_from(information);
                self.change_repeats(&mut moved, &points[from], repeats[from], -1);
                self.change_repeats(&mut moved, &points[to], repeats[to], 1);
                let cost = self.cost(&moved);
                if cost < *lowest * (1.0 - 1e-7) {
                    *lowest = cost;
                    best = Some((from, to));
                }
            }
        }
        if let Some((from, to)) = best {
            repeats[from] -= 1;
            repeats[to] += 1;
        }
        best.is_some()
    }

    /// A point in a configuration of its own beside some, where those of one configuration share errors and another tells the same.
    pub fn apart(&mut self, point: Point, others: &[Point]) -> Point {
        let apart = (self.problem.is_shared_by_configuration())
            .then(|| self.sampler.variant_beside(&point, others));
        apart.flatten().unwrap_or(point)
    }

    /// Adds what one repeat more or less of a point tells.
    fn change_repeats(&self, sum: &mut DMatrix<f64>, point: &Point, repeats: u32, change: i32) {
        if self.problem.is_shared_by_repeats() {
            self.add(sum, point, repeats, -1.0);
            self.add(sum, point, repeats.saturating_add_signed(change), 1.0);
        } else {
            add_information(sum, &point.matrix, f64::from(change));
        }
    }

    /// Adds so many times what a point tells that is repeated so often.
    fn add(&self, sum: &mut DMatrix<f64>, point: &Point, repeats: u32, times: f64) {
        let weight = times * f64::from(repeats);
        match self.repeated(point, repeats) {
            Some(repeated) => add_information(sum, &repeated.matrix, weight),
            None => add_information(sum, &point.matrix, weight),
        }
    }

    /// How many readings of a point that share nothing so many repeats are worth.
    pub fn worth_of_repeats(&self, point: &Point, repeats: u32) -> f64 {
        let repeated = self.repeated(point, repeats);
        repeated.map_or(f64::from(repeats), |repeated| {
            f64::from(repeats) * repeated.matrix.norm_squared() / point.matrix.norm_squared()
        })
    }

    /// A point as one that is repeated so often, where it then tells something else.
    fn repeated(&self, point: &Point, repeats: u32) -> Option<Point> {
        (self.problem.is_shared_by_repeats() && repeats != 1).then(|| {
            self.sampler.local.set_repeats(repeats);
            let repeated = (self.sampler.local).point(&point.q, &point.load, point.direction);
            self.sampler.local.set_repeats(1);
            repeated
        })
    }

    /// The cost of an information matrix.
    pub fn cost(&self, information: &DMatrix<f64>) -> f64 {
        let work = &mut *self.work.borrow_mut();
        work.cost.cost(information, &mut work.directions)
    }

    /// The information of the mandatory and all other experiments but one.
    pub fn total(&self, found: &Found, left_out: Option<usize>, total: &mut DMatrix<f64>) {
        total.copy_from(&self.mandatory);
        let all = found.points.iter().zip(&found.repeats).enumerate();
        let others = all.filter(|(index, _)| Some(*index) != left_out);
        if self.has_coincident(&found.points) {
            let others = others.map(|(_, (point, &repeats))| point.experiment(repeats));
            *total += self.problem.told_by(others.collect());
        } else {
            for (_, (point, &repeats)) in others {
                self.add(total, point, repeats, 1.0);
            }
        }
    }

    /// Whether some points are one configuration, where those share errors, or would be one with repeats, where these do.
    fn has_coincident(&self, points: &[Point]) -> bool {
        let is_one = |one: &Point, other: &Point| {
            if self.problem.is_shared_by_configuration() {
                return one.q == other.q;
            }
            one.load == other.load
                && one.direction == other.direction
                && one.experiment(1).stands_as(&other.experiment(1))
        };
        let is_earlier = |(place, point): (usize, &Point)| {
            points[..place].iter().any(|each| is_one(each, point))
        };
        self.problem.is_shared_by_repeats() && points.iter().enumerate().any(is_earlier)
    }

    /// The cost of a plan with a point in place of another, beside the information of the rest; `apart` where experiments share
    /// nothing.
    pub fn cost_in_place(
        &self,
        found: &Found,
        index: usize,
        point: &Point,
        rest: &DMatrix<f64>,
        apart: f64,
    ) -> f64 {
        if !self.problem.is_shared_by_repeats() {
            return apart;
        }
        let mut points = found.points.clone();
        points[index] = point.clone();
        if self.has_coincident(&points) {
            return self.plan(points, found.repeats.clone()).cost;
        }
        if found.repeats[index] == 1 {
            return apart;
        }
        let mut information = rest.clone();
        self.add(&mut information, point, found.repeats[index], 1.0);
        self.cost(&information)
    }

    /// A better experiment near the present one to join the rest, if there is one.
    fn improve(
        &mut self,
        present: &Point,
        rest: &DMatrix<f64>,
        repeats: u32,
        precision: Precision,
    ) -> Option<Point> {
        let repeated = self.repeated(present, repeats);
        let is_repeated = repeated.is_some();
        let present = repeated.as_ref().unwrap_or(present);
        let weight = f64::from(repeats);
        let cost = |matrix: &Matrix3xX<f64>, slope: Option<(&mut Matrix3xX<f64>, f64)>| {
            let work = &mut *self.work.borrow_mut();
            work.information.copy_from(rest);
            add_information(&mut work.information, matrix, weight);
            let value = work.cost.cost(&work.information, &mut work.directions);
            if let Some((slope, unit)) = slope {
                if value.is_finite() {
                    in_directions(slope, -2.0 * weight, matrix, &work.directions);
                } else {
                    slope.fill(0.0);
                }
                *slope *= unit;
            }
            value
        };
        let is_outside = !self.sampler.local.is_inside(&present.q, &present.load);
        let before = cost(&present.matrix, None);
        if is_repeated {
            self.sampler.local.set_repeats(repeats);
        }
        let improved = (self.sampler.local.improve(present, &cost, precision))
            .filter(|improved| is_outside || cost(&improved.matrix, None) < before);
        if !is_repeated {
            return self.sampler.clear_variant(&improved?);
        }
        // A point keeps what it tells once: its repeats may move.
        self.sampler.local.set_repeats(1);
        let clear = self.sampler.clear_variant(&improved?)?;
        Some((self.sampler.local).point(&clear.q, &clear.load, clear.direction))
    }
}
