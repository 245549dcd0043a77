//! A pool of random experiments. The information of each is computed once, so that it is cheap to look for
//! the best one of them.

use nalgebra::DMatrix;

use super::point::Point;
use super::problem::Problem;
use crate::plan::{CriterionFunction, LANES};

/// With so many unknowns an update of low rank is less work than a factorisation.
const UPDATED: usize = 8;

/// Experiments with the information that they give.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pool {
    /// The experiments; another one that tells the same may stand in the place of each.
    pub points: Vec<Point>,
    /// A^T A (p x p) of the points, [`LANES`] at a time side by side. Those that fill up the last
    /// ones tell nothing.
    information: Vec<[f64; LANES]>,
    /// A^T of the points, side by side (p x r n), each with r rows.
    rows: DMatrix<f64>,
    /// The most that one of them gives of each unknown alone (p).
    most: Vec<f64>,
    rank: usize,
    /// p^2.
    entries: usize,
}

impl Pool {
    /// A pool of these experiments.
    pub fn new(problem: &Problem<'_>, points: Vec<Point>) -> Self {
        let size = problem.parameters();
        let entries = size.pow(2);
        let rank = 3 * points.first().map_or(0, |point| point.blocks);
        let mut rows = DMatrix::zeros(size, rank * points.len());
        for (index, point) in points.iter().enumerate() {
            for row in 0..rank {
                let block = point.matrix.columns(row / 3 * size, size);
                rows.set_column(rank * index + row, &block.row(row % 3).transpose());
            }
        }
        let each: Vec<DMatrix<f64>> = points.iter().map(Point::information).collect();
        let own = |index| each.iter().map(move |each| each[(index, index)]);
        let mut pool = Self {
            information: vec![[0.0; LANES]; points.len().div_ceil(LANES) * entries],
            rows,
            most: (0..size)
                .map(|index| own(index).fold(0.0, f64::max))
                .collect(),
            rank,
            points,
            entries,
        };
        for (index, information) in each.iter().enumerate() {
            for (entry, value) in information.iter().enumerate() {
                *pool.entry(index, entry) = *value;
            }
        }
        pool
    }

    /// The number of the experiment that gives the lowest cost, measured `weight` times together
    /// with the information of the rest, and that cost.
    pub fn best_addition(
        &self,
        cost: &mut CriterionFunction,
        rest: &DMatrix<f64>,
        weight: f64,
    ) -> Option<(usize, f64)> {
        let rows = self.rows.columns(0, self.rank * self.points.len());
        let best = match self.rank {
            _ if rest.nrows() < UPDATED => None,
            3 => cost.best_update::<3>(rest, &rows, &self.most, weight),
            6 => cost.best_update::<6>(rest, &rows, &self.most, weight),
            _ => None,
        };
        if let Some(index) = best {
            let block = &self.information[index / LANES * self.entries..][..self.entries];
            return Some((
                index,
                cost.costs_of_sums(rest, block, weight)[index % LANES],
            ));
        }
        self.information
            .chunks_exact(self.entries)
            .flat_map(|blocks| cost.costs_of_sums(rest, blocks, weight))
            .take(self.points.len())
            .enumerate()
            .min_by(|one, other| one.1.total_cmp(&other.1))
    }

    /// Takes an experiment out; the last one takes its place.
    pub fn remove(&mut self, index: usize) {
        self.points.swap_remove(index);
        let last = self.points.len();
        for row in 0..self.rank {
            let of_last = self.rows.column(self.rank * last + row).into_owned();
            self.rows.set_column(self.rank * index + row, &of_last);
        }
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
