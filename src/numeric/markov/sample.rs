//! Samples of processes, and what follows these at any places.

use nalgebra::{DMatrix, Matrix2, Matrix2xX, RowVector2, Vector2};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::{Kernel, Step, lower_root};

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

/// A process from each place to the next in rising order: the number of the place, how much it keeps of the state before, and how it adds
/// standard normal numbers.
fn steps(places: &[f64], kernel: Kernel) -> impl Iterator<Item = (usize, [Matrix2<f64>; 2])> {
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by(|&one, &other| places[one].total_cmp(&places[other]).then(one.cmp(&other)));
    let mut before: Option<f64> = None;
    order.into_iter().map(move |place| {
        let at = places[place];
        let Step { kept, added } = match before.replace(at) {
            Some(before) => kernel.step(at - before),
            None => Step {
                kept: Matrix2::zeros(),
                added: Matrix2::identity(),
            },
        };
        (place, [kept, lower_root(&added)])
    })
}

/// Values of one sample of a process at some places.
pub fn sampled(places: &[f64], kernel: Kernel, random: &mut ChaCha8Rng) -> Vec<f64> {
    let mut values = vec![0.0; places.len()];
    let mut state = Vector2::zeros();
    for (place, [kept, added]) in steps(places, kernel) {
        let mut new = Vector2::zeros();
        for number in new.iter_mut().take(kernel.order()) {
            *number = StandardNormal.sample(random);
        }
        state = kept * state + added * new;
        values[place] = state.x;
    }
    values
}

/// How standard normal numbers make the values at n places (n x n, or n x 2 n).
pub fn root(places: &[f64], kernel: Kernel) -> DMatrix<f64> {
    let order = kernel.order();
    let mut root = DMatrix::zeros(places.len(), order * places.len());
    let mut state = Matrix2xX::zeros(root.ncols());
    for (number, (place, [kept, added])) in steps(places, kernel).enumerate() {
        state = kept * state;
        let mut own = state.columns_mut(order * number, order);
        own.copy_from(&added.columns(0, order));
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
        let mut ends = [-HALF_RANGE, HALF_RANGE];
        let Step { kept, added } = self.kernel.step(2.0 * HALF_RANGE);
        let first = self.normals(0);
        let mut states = [first, kept * first + lower_root(&added) * self.normals(1)];
        let mut node = 2;
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(ends[0], ends[1]);
            let [by, own] = self.kernel.middle(0.5 * (ends[1] - ends[0]));
            let (sum, difference) = (states[0] + states[1], states[0] - states[1]);
            let mean = Vector2::new(
                by.row(0).dot(&RowVector2::new(sum.x, difference.y)),
                by.row(1).dot(&RowVector2::new(difference.x, sum.y)),
            );
            let state = mean + own * self.normals(node);
            let side = usize::from(place < middle);
            (ends[side], states[side]) = (middle, state);
            node = 2 * node + side as u64;
        }
        f64::midpoint(states[0].x, states[1].x)
    }
}
