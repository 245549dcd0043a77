//! The best plan near a given one: its experiments are improved in turn, and repeats moved.

use std::cell::RefCell;

use nalgebra::{DMatrix, Matrix3xX};

use super::local::{LocalSearch, Precision};
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
    pub local: LocalSearch<'a>,
    pub sampler: RandomPlans<'a>,
    /// Whether a point tells something else where it is repeated more often.
    is_shared_by_configuration: bool,
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
            local: LocalSearch::new(problem),
            sampler: RandomPlans::new(problem),
            is_shared_by_configuration: problem.is_shared_by_configuration(),
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
        let points: Vec<Point> = experiments
            .iter()
            .map(|each| {
                self.local
                    .point(each.configuration_rad.as_slice(), &each.load)
            })
            .collect();
        let repeats = experiments.iter().map(|each| each.repeats).collect();
        self.plan(points, repeats)
    }

    /// A plan with its cost.
    pub fn plan(&self, points: Vec<Point>, repeats: Vec<u32>) -> Found {
        let mut information = self.mandatory.clone();
        self.total(&points, &repeats, None, &mut information);
        Found {
            cost: self.cost(&information),
            points,
            repeats,
        }
    }

    /// Refines to full precision, also after moving single repeats from one configuration to another.
    pub fn polish(&mut self, found: Found) -> Found {
        let mut best = self.refine(found, Precision::FINE, f64::INFINITY);
        let count = best.points.len();
        loop {
            if self.problem.is_stopped() {
                return best;
            }
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
            match better {
                Some(better) => best = self.refine(better, Precision::FINE, f64::INFINITY),
                None => return best,
            }
        }
    }

    /// Improves the experiments in turn, and moves repeats from one to another, until nothing more
    /// is gained, or so little that the cost will not fall below `hopeless`.
    pub fn refine(&mut self, mut best: Found, precision: Precision, hopeless: f64) -> Found {
        let mut information = self.mandatory.clone();
        let mut next = best.points.clone();
        let mut is_extrapolated = false;
        for _ in 0..SWEEPS {
            if self.problem.is_stopped() && best.cost.is_finite() {
                break;
            }
            let swept = self.sweep(
                std::mem::take(&mut next),
                &best.repeats,
                precision,
                is_extrapolated,
                &mut information,
            );
            let cost = self.cost(&information);
            let gain = 1.0 - cost / best.cost;
            let before = if gain > 0.0 {
                best.cost = cost;
                std::mem::replace(&mut best.points, swept)
            } else {
                best.points.clone()
            };
            next.clone_from(&best.points);
            if gain > precision.converged {
                if best.cost * (1.0 - HOPE * gain) > hopeless {
                    break;
                }
                is_extrapolated = self.extrapolate(&before, &best, &mut next);
            } else if is_extrapolated {
                is_extrapolated = false;
            } else {
                self.total(&best.points, &best.repeats, None, &mut information);
                let Found {
                    cost,
                    points,
                    repeats,
                } = &mut best;
                if !self.move_repeat(points, repeats, &information, cost) {
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
        mut points: Vec<Point>,
        repeats: &[u32],
        precision: Precision,
        extrapolated: bool,
        information: &mut DMatrix<f64>,
    ) -> Vec<Point> {
        for index in 0..points.len() {
            self.total(&points, repeats, Some(index), information);
            let present = &points[index];
            if let Some(better) = self.improve(present, information, repeats[index], precision) {
                points[index] = better;
            } else if !self.local.is_inside(&present.q, &present.load) {
                information.fill(0.0);
                return points;
            } else if extrapolated {
                let Some(clear) = self.sampler.clear_variant(present) else {
                    information.fill(0.0);
                    return points;
                };
                points[index] = clear;
            }
        }
        self.total(&points, repeats, None, information);
        points
    }

    /// Goes on in the direction of a sweep's whole step as long as that lowers the cost, be it a
    /// little out of bounds: the next sweep starts there. Sweeps alone converge slowly.
    fn extrapolate(&mut self, before: &[Point], best: &Found, next: &mut Vec<Point>) -> bool {
        let mut information = self.mandatory.clone();
        let mut lowest = best.cost;
        let mut factor = 1.0;
        while factor < LONGEST_STEP {
            let points: Vec<Point> = before
                .iter()
                .zip(&best.points)
                .map(|(before, after)| {
                    let q: Vec<f64> = (before.q.iter().zip(&after.q))
                        .map(|(before, after)| after + factor * (after - before))
                        .collect();
                    self.local.point(&self.local.in_ranges(q), &after.load)
                })
                .collect();
            self.total(&points, &best.repeats, None, &mut information);
            let cost = self.cost(&information);
            if cost >= lowest {
                break;
            }
            lowest = cost;
            *next = points;
            factor *= 2.0;
        }
        lowest < best.cost
    }

    /// Moves one repeat between two configurations where that lowers the cost most.
    pub fn move_repeat(
        &self,
        points: &[Point],
        repeats: &mut [u32],
        information: &DMatrix<f64>,
        lowest: &mut f64,
    ) -> bool {
        let mut best = None;
        if self.has_coincident(points) {
            return false;
        }
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
        let Some((from, to)) = best else {
            return false;
        };
        repeats[from] -= 1;
        repeats[to] += 1;
        true
    }

    /// Adds what one repeat more or less of a point tells.
    fn change_repeats(
        &self,
        information: &mut DMatrix<f64>,
        point: &Point,
        repeats: u32,
        change: i32,
    ) {
        if self.is_shared_by_configuration {
            self.add(information, point, repeats, -1.0);
            self.add(
                information,
                point,
                repeats.saturating_add_signed(change),
                1.0,
            );
        } else {
            add_information(information, &point.matrix, f64::from(change));
        }
    }

    /// Adds so many times what a point tells that is repeated so often.
    fn add(&self, information: &mut DMatrix<f64>, point: &Point, repeats: u32, times: f64) {
        let weight = times * f64::from(repeats);
        if self.is_shared_by_configuration && repeats != 1 {
            add_information(information, &self.repeated(point, repeats).matrix, weight);
        } else {
            add_information(information, &point.matrix, weight);
        }
    }

    /// How many readings of a point that share nothing so many repeats are worth.
    pub fn worth_of_repeats(&self, point: &Point, repeats: u32) -> f64 {
        if self.is_shared_by_configuration && repeats != 1 {
            let repeated = self.repeated(point, repeats).matrix.norm_squared();
            f64::from(repeats) * repeated / point.matrix.norm_squared()
        } else {
            f64::from(repeats)
        }
    }

    /// A point as one that is repeated so often.
    fn repeated(&self, point: &Point, repeats: u32) -> Point {
        self.local.set_repeats(repeats);
        let repeated = self.local.point(&point.q, &point.load);
        self.local.set_repeats(1);
        repeated
    }

    /// The cost of an information matrix.
    pub fn cost(&self, information: &DMatrix<f64>) -> f64 {
        let Work {
            cost, directions, ..
        } = &mut *self.work.borrow_mut();
        cost.cost(information, directions)
    }

    /// The information of the mandatory and all other experiments but one.
    pub fn total(
        &self,
        points: &[Point],
        repeats: &[u32],
        left_out: Option<usize>,
        total: &mut DMatrix<f64>,
    ) {
        total.copy_from(&self.mandatory);
        if self.has_coincident(points) {
            let left = points.iter().zip(repeats).enumerate();
            let left = left.filter(|(index, _)| Some(*index) != left_out);
            *total += (self.problem).told_by(
                left.map(|(_, (point, &repeats))| point.experiment(repeats))
                    .collect(),
            );
            return;
        }
        for (index, (point, &repeats)) in points.iter().zip(repeats).enumerate() {
            if Some(index) != left_out {
                self.add(total, point, repeats, 1.0);
            }
        }
    }

    /// Whether some points are one configuration, where those share errors.
    fn has_coincident(&self, points: &[Point]) -> bool {
        let is_earlier =
            |(place, point): (usize, &Point)| points[..place].iter().any(|each| each.q == point.q);
        self.is_shared_by_configuration && points.iter().enumerate().any(is_earlier)
    }

    /// The cost of a plan with a point in place of another, beside the information of the rest; `apart` where experiments share
    /// nothing.
    pub fn cost_in_place(
        &self,
        (points, repeats): (&[Point], &[u32]),
        (index, point): (usize, &Point),
        rest: &DMatrix<f64>,
        apart: f64,
    ) -> f64 {
        if !self.is_shared_by_configuration {
            return apart;
        }
        let mut points = points.to_vec();
        points[index] = point.clone();
        if self.has_coincident(&points) {
            return self.plan(points, repeats.to_vec()).cost;
        }
        if repeats[index] == 1 {
            return apart;
        }
        let mut information = rest.clone();
        self.add(&mut information, point, repeats[index], 1.0);
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
        let is_repeated = self.is_shared_by_configuration && repeats != 1;
        let repeated = is_repeated.then(|| self.repeated(present, repeats));
        let present = repeated.as_ref().unwrap_or(present);
        let weight = f64::from(repeats);
        let cost = |matrix: &Matrix3xX<f64>, slope: Option<(&mut Matrix3xX<f64>, f64)>| {
            let Work {
                cost,
                information,
                directions,
            } = &mut *self.work.borrow_mut();
            information.copy_from(rest);
            add_information(information, matrix, weight);
            let value = cost.cost(information, directions);
            if let Some((slope, unit)) = slope {
                if value.is_finite() {
                    in_directions(slope, -2.0 * weight, matrix, directions);
                } else {
                    slope.fill(0.0);
                }
                *slope *= unit;
            }
            value
        };
        let is_outside = !self.local.is_inside(&present.q, &present.load);
        let before = cost(&present.matrix, None);
        if is_repeated {
            self.local.set_repeats(repeats);
        }
        let improved = (self.local.improve(present, &cost, precision))
            .filter(|improved| is_outside || cost(&improved.matrix, None) < before);
        if !is_repeated {
            return self.sampler.clear_variant(&improved?);
        }
        // A point keeps what it tells once: its repeats may move.
        self.local.set_repeats(1);
        let clear = self.sampler.clear_variant(&improved?)?;
        Some(self.local.point(&clear.q, &clear.load))
    }
}
