//! A pool of random experiments. What each tells is worked out once, so that it is cheap to look for
//! the best one of them.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::problem::{Point, Problem};
use super::sampling::Sampler;
use crate::plan::CriterionFunction;
use crate::random::generator;

/// Experiments with the information that they give.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pool {
    points: Vec<Point>,
    /// A^T A of every point (p x p), one after the other.
    information: Vec<f64>,
    parameters: usize,
}

impl Pool {
    /// So many random experiments within the smooth bounds, fewer if they are hard to find, drawn on
    /// all threads. `stream` numbers the random numbers.
    pub fn draw(problem: &Problem<'_>, size: usize, seed: u64, stream: u64) -> Self {
        let points: Vec<Point> = (0..size as u64)
            .into_par_iter()
            .map_init(
                || Sampler::new(problem),
                |sampler, index| sampler.draw_inside(&mut generator(seed, (stream << 32) + index)),
            )
            .flatten()
            .collect();
        Self::new(problem, points)
    }

    /// A pool of these experiments.
    pub fn new(problem: &Problem<'_>, points: Vec<Point>) -> Self {
        let mut information = Vec::new();
        for point in &points {
            information.extend_from_slice(point.information().as_slice());
        }
        Self {
            points,
            information,
            parameters: problem.parameters(),
        }
    }

    /// The experiments.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// The experiments in descending order of their directional derivatives trace(A G A^T), with
    /// these.
    pub fn by_derivative(&self, directions: &DMatrix<f64>) -> Vec<(&Point, f64)> {
        let dot = |information: &[f64]| -> f64 {
            let pairs = information.iter().zip(directions.as_slice());
            pairs.map(|(one, other)| one * other).sum()
        };
        let derivatives = self.blocks().map(dot);
        let mut sorted: Vec<_> = self.points.iter().zip(derivatives).collect();
        sorted.sort_by(|one, other| other.1.total_cmp(&one.1));
        sorted
    }

    /// The number of the experiment that gives the lowest cost, measured `weight` times together
    /// with the information of the rest, and that cost.
    pub fn best_addition(
        &self,
        cost: &mut CriterionFunction,
        rest: &DMatrix<f64>,
        weight: f64,
    ) -> Option<(usize, f64)> {
        self.blocks()
            .map(|block| cost.cost_of_sum(rest, block, weight))
            .enumerate()
            .min_by(|one, other| one.1.total_cmp(&other.1))
    }

    /// Puts another experiment that tells the same in an experiment's place.
    pub fn replace(&mut self, index: usize, point: Point) {
        self.points[index] = point;
    }

    /// Takes an experiment out.
    pub fn remove(&mut self, index: usize) {
        self.points.remove(index);
        let size = self.parameters * self.parameters;
        self.information.drain(index * size..(index + 1) * size);
    }

    fn blocks(&self) -> impl Iterator<Item = &[f64]> {
        self.information
            .chunks_exact(self.parameters * self.parameters)
    }
}
