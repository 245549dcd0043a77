//! The information of each of many candidates, computed once.

use nalgebra::DMatrix;
use rayon::prelude::*;

/// Candidates that one thread looks through at a time.
const CHUNK: usize = 256;

/// The information (p x p, symmetric) that one measurement of each candidate gives.
#[derive(Debug, Clone)]
pub struct CandidateInformation {
    size: usize,
    /// The upper triangles, column by column, one candidate after the other.
    packed: Vec<f64>,
}

/// The upper triangle of a symmetric matrix.
fn triangle(matrix: &DMatrix<f64>) -> impl Iterator<Item = (usize, usize, f64)> {
    let size = matrix.nrows();
    (0..size)
        .flat_map(move |column| (0..=column).map(move |row| (row, column, matrix[(row, column)])))
}

impl CandidateInformation {
    /// Of none yet, about p unknowns.
    pub const fn new(size: usize) -> Self {
        Self {
            size,
            packed: Vec::new(),
        }
    }

    /// Of some, by the information that one measurement of each gives (p x p).
    pub fn of_all<'m>(size: usize, each: impl IntoIterator<Item = &'m DMatrix<f64>>) -> Self {
        let mut all = Self::new(size);
        for information in each {
            all.push(information);
        }
        all
    }

    /// Adds a candidate by the information that one measurement of it gives (p x p).
    pub fn push(&mut self, information: &DMatrix<f64>) {
        self.packed
            .extend(triangle(information).map(|(_, _, value)| value));
    }

    /// The number p of unknowns.
    pub const fn size(&self) -> usize {
        self.size
    }

    const fn entries(&self) -> usize {
        self.size * (self.size + 1) / 2
    }

    /// The number of candidates.
    pub fn count(&self) -> usize {
        self.packed.len() / self.entries().max(1)
    }

    /// Adds so many times what a candidate tells to an information matrix.
    pub fn add_to(&self, sum: &mut DMatrix<f64>, candidate: usize, times: f64) {
        let entries = self.entries();
        let mut packed = self.packed[candidate * entries..(candidate + 1) * entries].iter();
        for column in 0..self.size {
            for (row, value) in (0..=column).zip(&mut packed) {
                sum[(row, column)] += times * value;
                if row < column {
                    sum[(column, row)] += times * value;
                }
            }
        }
    }

    /// What a candidate tells.
    pub fn of(&self, candidate: usize) -> DMatrix<f64> {
        let mut information = DMatrix::zeros(self.size, self.size);
        self.add_to(&mut information, candidate, 1.0);
        information
    }

    /// The mean over all candidates.
    pub fn mean(&self) -> DMatrix<f64> {
        let mut sum = DMatrix::zeros(self.size, self.size);
        for candidate in 0..self.count() {
            self.add_to(&mut sum, candidate, 1.0);
        }
        sum / self.count().max(1) as f64
    }

    /// The directional derivative trace(G I) of each candidate, for symmetric directions G (p x p).
    pub fn derivatives(&self, directions: &DMatrix<f64>) -> Vec<f64> {
        let doubled = doubled(directions);
        let entries = self.entries().max(1);
        (self.packed.par_chunks(CHUNK * entries))
            .flat_map_iter(|many| many.chunks_exact(entries).map(|one| product(one, &doubled)))
            .collect()
    }

    /// The same of some candidates; minus infinity of all others.
    pub fn derivatives_of(&self, directions: &DMatrix<f64>, listed: &[usize]) -> Vec<f64> {
        let doubled = doubled(directions);
        let entries = self.entries();
        let mut derivatives = vec![f64::NEG_INFINITY; self.count()];
        for &candidate in listed {
            let one = &self.packed[candidate * entries..(candidate + 1) * entries];
            derivatives[candidate] = product(one, &doubled);
        }
        derivatives
    }
}

/// The upper triangle, in which both halves of a symmetric matrix count.
fn doubled(matrix: &DMatrix<f64>) -> Vec<f64> {
    triangle(matrix)
        .map(|(row, column, value)| if row < column { 2.0 * value } else { value })
        .collect()
}

/// The sum of products, in parts of four, which compilers make vectors of, in an order that never changes.
fn product(one: &[f64], other: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let ((ones, ones_left), (others, others_left)) = (one.as_chunks::<4>(), other.as_chunks::<4>());
    for (one, other) in ones.iter().zip(others) {
        for lane in 0..4 {
            sums[lane] += one[lane] * other[lane];
        }
    }
    let left = ones_left.iter().zip(others_left);
    let left: f64 = left.map(|(one, other)| one * other).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + left
}
