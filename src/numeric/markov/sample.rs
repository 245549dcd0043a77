//! Samples of processes, and what follows these at any places.

use nalgebra::{DMatrix, Matrix2xX, RowVector2, SymmetricEigen, Vector2};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::{Kernel, Transition, lower_root};

/// What follows independent processes at places of their coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct ProcessPoint {
    /// How its rows follow each process, by one standard deviation of that (r x f),
    pub columns: DMatrix<f64>,
    /// at these places (f).
    pub places: Vec<f64>,
}

impl ProcessPoint {
    /// The covariance with another point (r x r'), of such processes (f).
    pub fn covariance(&self, other: &Self, kernels: &[Kernel]) -> DMatrix<f64> {
        let mut covariance = DMatrix::zeros(self.columns.nrows(), other.columns.nrows());
        for (process, kernel) in kernels.iter().enumerate() {
            let apart = (self.places[process] - other.places[process]).abs();
            let [shared, _] = kernel.correlation(apart);
            let [mine, theirs] = [self, other].map(|point| point.columns.column(process));
            covariance.ger(shared, &mine, &theirs, 1.0);
        }
        covariance
    }
}

/// How standard normal numbers make the values at n places (n x n, or n x 2 n).
pub fn root(places: &[f64], kernel: Kernel) -> DMatrix<f64> {
    if kernel.period.is_some() {
        let correlation = DMatrix::from_fn(places.len(), places.len(), |one, other| {
            kernel.correlation((places[one] - places[other]).abs())[0]
        });
        let eigen = SymmetricEigen::new(correlation);
        let roots = eigen.eigenvalues.map(|each| each.max(0.0).sqrt());
        return eigen.eigenvectors * DMatrix::from_diagonal(&roots);
    }
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by(|&one, &other| places[one].total_cmp(&places[other]).then(one.cmp(&other)));
    let numbers = kernel.order();
    let mut root = DMatrix::zeros(places.len(), numbers * places.len());
    // From each place to the next; before the first nothing is known.
    let mut state = Matrix2xX::zeros(root.ncols());
    let mut before = f64::NEG_INFINITY;
    for (number, place) in order.into_iter().enumerate() {
        let Transition { kept, added } = kernel.step(places[place] - before);
        before = places[place];
        state = kept * state;
        let own = lower_root(&added);
        (state.columns_mut(numbers * number, numbers)).copy_from(&own.columns(0, numbers));
        root.row_mut(place).copy_from(&state.row(0));
    }
    root
}

/// A sample of a process of unit variance as a function: its value at a place depends on its random numbers and on the place alone,
/// whatever else it is asked for (P. Levy's construction: halves of a range, each middle given both ends).
#[derive(Debug, Clone)]
pub struct SampledFunction {
    kernel: Kernel,
    /// The cipher of its numbers, and where in it they begin.
    random: ChaCha8Rng,
    first: u128,
}

/// A sampled function is known within this distance from zero, and as at the ends beyond; its range is halved so often.
const HALF_RANGE: f64 = 1024.0;
const HALVINGS: usize = 40;
/// A node's numbers are so many words apart, and a function's more than all nodes of one need.
const NODE_WORDS: u128 = 16;
const FUNCTION_WORDS: u128 = 1 << 56;

impl SampledFunction {
    /// The function of such a number among those of a generator.
    pub const fn new(kernel: Kernel, random: ChaCha8Rng, number: usize) -> Self {
        let first = number as u128 * FUNCTION_WORDS;
        Self {
            kernel,
            random,
            first,
        }
    }

    fn normals(&self, node: u64) -> Vector2<f64> {
        let mut random = self.random.clone();
        random.set_word_pos(self.first + u128::from(node) * NODE_WORDS);
        let mut numbers = Vector2::zeros();
        for number in numbers.iter_mut().take(self.kernel.order()) {
            *number = StandardNormal.sample(&mut random);
        }
        numbers
    }

    /// Its value at a place.
    pub fn at(&self, place: f64) -> f64 {
        let kernel = self.kernel;
        let (place, half, scale) = match kernel.period {
            Some(period) => {
                let place = place.rem_euclid(period) - 0.5 * period;
                (place, 0.5 * period, kernel.scale().sqrt())
            }
            None => (place, HALF_RANGE, 1.0),
        };
        let mut ends = [-half, half];
        let first = self.normals(0);
        let mut states = if kernel.period.is_some() {
            // Around a circle both ends are one.
            [lower_root(&kernel.covariance(0.0)) * first; 2]
        } else {
            let Transition { kept, added } = kernel.step(2.0 * half);
            [first, kept * first + lower_root(&added) * self.normals(1)]
        };
        let mut node = 2;
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(ends[0], ends[1]);
            let [by, own] = kernel.middle(0.5 * (ends[1] - ends[0]));
            let (sum, difference) = (states[0] + states[1], states[0] - states[1]);
            let mean = Vector2::new(
                by.row(0).dot(&RowVector2::new(sum.x, difference.y)),
                by.row(1).dot(&RowVector2::new(difference.x, sum.y)),
            );
            let state = mean + own * self.normals(node) * scale;
            let side = usize::from(place < middle);
            (ends[side], states[side]) = (middle, state);
            node = 2 * node + side as u64;
        }
        f64::midpoint(states[0].x, states[1].x)
    }
}
