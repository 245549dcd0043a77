//! The best weights on given experiments.

use nalgebra::DMatrix;

use crate::plan::CriterionFunction;

/// Accelerated cycles of the multiplicative algorithm in one round, three steps each.
const WEIGHT_CYCLES: usize = 1000;

/// So many sums are made at once.
const SIDE_BY_SIDE: usize = 4;

/// Finds the best weights on given experiments.
pub(super) struct Weighing {
    cost: CriterionFunction,
    /// What is told beside the experiments.
    beside: Option<DMatrix<f64>>,
    information: DMatrix<f64>,
    pub directions: DMatrix<f64>,
    /// The mean derivative of the experiments: the cost, where nothing is told beside them.
    pub mean: f64,
}

impl Weighing {
    /// For a cost that goes with the inverse of the information, see [`Criterion::bounded_as`](crate::plan::Criterion::bounded_as), of
    /// so many unknowns, with what is told beside.
    pub fn new(cost: CriterionFunction, beside: Option<DMatrix<f64>>, size: usize) -> Self {
        Self {
            cost,
            beside,
            mean: 0.0,
            information: DMatrix::zeros(size, size),
            directions: DMatrix::zeros(size, size),
        }
    }

    /// Returns the cost, which belongs to the derivatives in `directions`; it is met where no derivative of these
    /// experiments, given by what they tell (p x p), is above their mean by more than the tolerance, as a share. By the
    /// multiplicative algorithm; as its steps converge slowly, it is accelerated: after two steps it goes on in their direction
    /// where that lowers the cost (Varadhan and Roland 2008, scheme S3).
    pub fn weigh(&mut self, blocks: &[DMatrix<f64>], weights: &mut [f64], tolerance: f64) -> f64 {
        let [mut before, mut once, mut twice] = [(); 3].map(|()| weights.to_vec());
        let is_best = |mean: f64, largest: f64| largest <= mean * (1.0 + tolerance);
        for _ in 0..WEIGHT_CYCLES {
            before.copy_from_slice(weights);
            let (cost, largest) = self.step(blocks, weights);
            if !cost.is_finite() || is_best(self.mean, largest) {
                return cost;
            }
            once.copy_from_slice(weights);
            let (cost, largest) = self.step(blocks, weights);
            if is_best(self.mean, largest) {
                return cost;
            }
            twice.copy_from_slice(weights);
            extrapolate(&before, &once, weights);
            let (far, largest) = self.step(blocks, weights);
            if far.is_nan() || far > cost {
                weights.copy_from_slice(&twice);
            } else if is_best(self.mean, largest) {
                return far;
            }
        }
        self.step(blocks, weights).0
    }

    /// A step: each weight grows with the root of its derivative (Fellman; Yu 2010 shows that the cost
    /// never rises). Returns the cost before it, and the largest derivative.
    fn step(&mut self, blocks: &[DMatrix<f64>], weights: &mut [f64]) -> (f64, f64) {
        match &self.beside {
            Some(beside) => self.information.copy_from(beside),
            None => self.information.fill(0.0),
        }
        for (block, weight) in blocks.iter().zip(weights.iter()) {
            let sums = self.information.as_mut_slice().iter_mut();
            for (sum, value) in sums.zip(block.as_slice()) {
                *sum += weight * value;
            }
        }
        let cost = self.cost.cost(&self.information, &mut self.directions);
        let (mut largest, mut mean) = (0.0_f64, 0.0);
        if cost.is_finite() {
            let four = blocks
                .chunks(SIDE_BY_SIDE)
                .zip(weights.chunks_mut(SIDE_BY_SIDE));
            for (blocks, weights) in four {
                let derivatives = derivatives(blocks, &self.directions);
                for (derivative, weight) in derivatives.into_iter().zip(weights) {
                    largest = largest.max(derivative);
                    mean += *weight * derivative;
                    *weight *= derivative.max(0.0).sqrt();
                }
            }
            normalise(weights);
        }
        // Where nothing is told beside the experiments, the mean is the cost but for rounding.
        self.mean = if self.beside.is_some() { mean } else { cost };
        (cost, largest)
    }
}

/// The derivatives trace(G I) of some experiments by what they tell: sums side by side, each in the order of the matrices.
fn derivatives(blocks: &[DMatrix<f64>], directions: &DMatrix<f64>) -> [f64; SIDE_BY_SIDE] {
    let mut sums = [0.0; SIDE_BY_SIDE];
    let directions = directions.as_slice();
    if let [a, b, c, d] = blocks {
        let [a, b, c, d] = [a, b, c, d].map(DMatrix::as_slice);
        let first = a.iter().zip(b).zip(c.iter().zip(d));
        for (((a, b), (c, d)), weight) in first.zip(directions) {
            for (sum, value) in sums.iter_mut().zip([a, b, c, d]) {
                *sum += value * weight;
            }
        }
        return sums;
    }
    for (sum, block) in sums.iter_mut().zip(blocks) {
        let pairs = block.as_slice().iter().zip(directions);
        *sum = pairs.map(|(one, other)| one * other).sum();
    }
    sums
}

/// From weights before, after one step and after two (`weights`), those further on in that direction.
fn extrapolate(before: &[f64], once: &[f64], weights: &mut [f64]) {
    let (mut first, mut second) = (0.0, 0.0);
    for ((before, once), twice) in before.iter().zip(once).zip(weights.iter()) {
        first += (once - before).powi(2);
        second += (twice - 2.0 * once + before).powi(2);
    }
    let length = (first / second).sqrt();
    if !length.is_finite() || length <= 1.0 {
        return;
    }
    for ((before, once), weight) in before.iter().zip(once).zip(weights.iter_mut()) {
        let curvature = *weight - 2.0 * once + before;
        let far = before + length * (2.0 * (once - before) + length * curvature);
        // No weight vanishes at once.
        *weight = far.max(0.1 * *weight);
    }
    normalise(weights);
}

/// Drops experiments whose weights are no more than this, and their weights.
pub(super) fn drop_light<T>(support: &mut Vec<T>, weights: &mut Vec<f64>, most: f64) {
    let mut each = weights.iter();
    support.retain(|_| each.next().is_some_and(|weight| *weight > most));
    weights.retain(|weight| *weight > most);
}

/// Shares measurements out by weights, one at a time to the largest weight over so many as it has, and `plus` (0: the efficient
/// rounding, where each has one at least; 1: the greatest divisors); as often as each may be, at most.
pub(super) fn apportioned(
    weights: &[f64],
    measurements: u32,
    plus: f64,
    most: impl Fn(usize) -> u32,
) -> Vec<u32> {
    let mut times = vec![0; weights.len()];
    for _ in 0..measurements {
        let share = |place: usize| weights[place] / (f64::from(times[place]) + plus);
        let next = (0..weights.len())
            .filter(|&place| times[place] < most(place))
            .max_by(|&one, &other| share(one).total_cmp(&share(other)).then(other.cmp(&one)));
        let Some(next) = next else { break };
        times[next] += 1;
    }
    times
}

pub(super) fn normalise(weights: &mut [f64]) {
    let total: f64 = weights.iter().sum();
    for weight in weights {
        *weight /= total;
    }
}
