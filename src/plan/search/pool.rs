//! A pool of random experiments. The information of each is computed once, so that it is cheap to look for
//! the best one of them.

use nalgebra::DMatrix;

use super::point::Point;
use super::problem::Problem;
use crate::plan::{CriterionFunction, LANES};

/// Experiments with the information that they give.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pool {
    points: Vec<Point>,
    /// A^T A (p x p) of the points, [`LANES`] at a time side by side. Those that fill up the last
    /// ones tell nothing.
    information: Vec<[f64; LANES]>,
    /// p^2.
    entries: usize,
}

impl Pool {
    /// A pool of these experiments.
    pub fn new(problem: &Problem<'_>, points: Vec<Point>) -> Self {
        let entries = problem.parameters().pow(2);
        let mut pool = Self {
            information: vec![[0.0; LANES]; points.len().div_ceil(LANES) * entries],
            points,
            entries,
        };
        for index in 0..pool.points.len() {
            let information = pool.points[index].information();
            for (entry, value) in information.iter().enumerate() {
                *pool.entry(index, entry) = *value;
            }
        }
        pool
    }

    /// The experiments.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// The number of the experiment that gives the lowest cost, measured `weight` times together
    /// with the information of the rest, and that cost.
    pub fn best_addition(
        &self,
        cost: &mut CriterionFunction,
        rest: &DMatrix<f64>,
        weight: f64,
    ) -> Option<(usize, f64)> {
        self.information
            .chunks_exact(self.entries)
            .flat_map(|blocks| cost.costs_of_sums(rest, blocks, weight))
            .take(self.points.len())
            .enumerate()
            .min_by(|one, other| one.1.total_cmp(&other.1))
    }

    /// Puts another experiment that tells the same in an experiment's place.
    pub fn replace(&mut self, index: usize, point: Point) {
        self.points[index] = point;
    }

    /// Takes an experiment out; the last one takes its place.
    pub fn remove(&mut self, index: usize) {
        self.points.swap_remove(index);
        let last = self.points.len();
        for entry in 0..self.entries {
            *self.entry(index, entry) = *self.entry(last, entry);
        }
        self.information
            .truncate(last.div_ceil(LANES) * self.entries);
    }

    fn entry(&mut self, index: usize, entry: usize) -> &mut f64 {
        &mut self.information[index / LANES * self.entries + entry][index % LANES]
    }
}
