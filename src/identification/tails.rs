//! Outliers, or the tail of a distribution that all errors have (Student's t)?
//!
//! ```text
//! p(u) = (1 - w) t(u) + w g(u)                   u: the length of an error of three coordinates over its computed deviations
//! t: Student's t of three coordinates, of so many degrees of freedom, times a scale
//! g = 1 / (u ln 1000)                            wrong readings: any size from the median's on, as likely each as ten times that
//! ```
//!
//! A fit is the better for leaving both out; what is predicted of other readings must count the tail. How heavy it is, most
//! errors tell: ones that are normal else have no tail, ones that are now and then three times as large have one that reaches
//! farther. The freedoms from those of Cauchy's law to the normal one are believed as much as the errors are likely with each.

use std::f64::consts::PI;

use statrs::function::gamma::ln_gamma;

/// Degrees of freedom that are tried; with the last the law is the normal one.
const FREEDOMS: [f64; 12] = [
    1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 20.0, 40.0, 100.0, 1e6,
];
/// Improvements of the scale and of the share of wrong readings.
const ROUNDS: usize = 60;
/// The first share of wrong readings.
const FIRST_WRONG: f64 = 0.05;
/// Wrong readings are so many times as far off as the median is, or less.
const FARTHEST: f64 = 1000.0;

/// For each of the squares (of three coordinates, over their computed covariance) of readings that were left out: the probability that it is
/// of the tail of the errors of all readings, and not wrong. `kept` are those of the others.
pub(super) fn shares_of_tail(kept: &[f64], left_out: &[f64]) -> Vec<f64> {
    if left_out.is_empty() {
        return Vec::new();
    }
    let all: Vec<f64> = kept.iter().chain(left_out).copied().collect();
    let found = FREEDOMS.map(|freedom| explained(&all, freedom));
    let best = (found.iter().map(|each| each.0)).fold(f64::NEG_INFINITY, f64::max);
    let weights = found.each_ref().map(|each| (each.0 - best).exp());
    let whole: f64 = weights.iter().sum();
    (kept.len()..all.len())
        .map(|index| {
            let each = found.iter().zip(weights);
            let shares = each.map(|(each, weight)| weight * each.1[index]);
            shares.sum::<f64>() / whole
        })
        .collect()
}

/// The logarithm of the likelihood of squares with so many degrees of freedom, and the probability of each that it is of the tail of the
/// errors and not a wrong reading's.
fn explained(squares: &[f64], freedom: f64) -> (f64, Vec<f64>) {
    let mut sorted = squares.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted[sorted.len() / 2].max(f64::MIN_POSITIVE);
    let farthest = (sorted[sorted.len() - 1] / middle).sqrt().max(FARTHEST);
    let constant =
        ln_gamma(0.5 * (freedom + 3.0)) - ln_gamma(0.5 * freedom) - 1.5 * (freedom * PI).ln();
    let (mut scale, mut wrong) = (middle / 3.0, FIRST_WRONG);
    let (mut logarithm, mut of_tail) = (0.0, Vec::new());
    for _ in 0..ROUNDS {
        let (mut square, mut count) = (0.0, 0.0);
        logarithm = 0.0;
        of_tail.clear();
        for &each in squares {
            let relative = each / scale;
            // Densities of the logarithm of u.
            let law = constant + (4.0 * PI).ln() + 1.5 * relative.max(f64::MIN_POSITIVE).ln()
                - 0.5 * (freedom + 3.0) * (relative / freedom).ln_1p();
            let right = (1.0 - wrong) * law.exp();
            let other = if each > middle {
                wrong / farthest.ln()
            } else {
                0.0
            };
            let both = (right + other).max(f64::MIN_POSITIVE);
            let share = right / both;
            logarithm += both.ln();
            of_tail.push(share);
            square += share * (freedom + 3.0) / (freedom + relative) * each;
            count += share;
        }
        scale = (square / (3.0 * count)).max(f64::MIN_POSITIVE);
        wrong = 1.0 - count / squares.len() as f64;
    }
    (logarithm, of_tail)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::generator;
    use rand::RngExt;
    use rand_distr::StandardNormal;

    /// Squares of errors, each three normal numbers of a size; those beyond five deviations are left out.
    fn errors(seed: u64, size: impl Fn(f64) -> f64) -> [Vec<f64>; 2] {
        let mut random = generator(73, seed);
        let all: Vec<f64> = (0..200)
            .map(|_| {
                let size = size(random.random_range(0.0..1.0));
                (0..3)
                    .map(|_| (size * random.sample::<f64, _>(StandardNormal)).powi(2))
                    .sum()
            })
            .collect();
        let (far, near) = all.iter().partition(|square| **square > 31.8);
        [near, far]
    }

    /// One error in ten is four times as large: what lies far out is of the tail. One reading in twenty is wrong by 10 to 500 deviations:
    /// none is.
    #[test]
    fn tails_are_told_from_wrong_readings() {
        const SEEDS: u64 = 20;
        let mut counted = 0.0;
        for seed in 0..SEEDS {
            let [kept, far] = errors(seed, |share| if share < 0.1 { 4.0 } else { 1.0 });
            let shares = shares_of_tail(&kept, &far);
            counted += shares.iter().sum::<f64>() / far.len() as f64;
            let [mut kept, mut far] = errors(seed, |_| 1.0);
            kept.truncate(190);
            far.extend((0..10_i32).map(|each| 100.0 * 2500.0_f64.powf(f64::from(each) / 9.0)));
            let shares = shares_of_tail(&kept, &far);
            assert!(
                shares.iter().all(|share| *share < 0.1),
                "{seed}: {shares:.2?}"
            );
        }
        assert!(counted > 0.8 * SEEDS as f64, "{counted}");
    }
}
