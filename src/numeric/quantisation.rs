//! Quantisation: what errors of rounding to steps have in common.
//!
//! A number x + n with x anywhere within a step D (uniform modulo it) and n normal of standard deviation s is shown as a multiple of D. The
//! error of that has the variance D^2/12, whatever s is, and is not correlated with n. Two such numbers of one x and independent n have
//! errors with the covariance (Widrow and Kollar, Quantization Noise, by the characteristic function of n)
//!
//! ```text
//! v(s^2) = sum over k >= 1 of  D^2 / (2 pi^2 k^2)  exp(-4 pi^2 k^2 s^2 / D^2)
//!        = D^2/12 - D s / sqrt(pi) + s^2   for s far below D :
//! ```
//!
//! all of it where s is nothing, so that repeats err alike; nothing where s is as large as D, so that their mean does not.

use std::f64::consts::PI;

/// Below this share of a step the closed form holds: what it leaves out is a factor exp(-1/(4 share^2)).
const CLOSED: f64 = 0.1;
/// More terms are nothing there.
const TERMS: i32 = 12;
/// Numbers differ by this share of a variance at least.
const LEAST_SPREAD: f64 = 1e-6;
/// Less of the variance than this is no covariance.
const NOTHING: f64 = 1e-9;

/// The variance of rounding to steps.
pub fn rounding_variance(step: f64) -> f64 {
    step * step / 12.0
}

/// v(s^2): the covariance that rounding to steps gives two numbers which are one but for independent errors of a variance s^2.
pub fn shared_rounding(step: f64, spread_squared: f64) -> f64 {
    let spread = spread_squared.max(0.0).sqrt();
    if spread < CLOSED * step {
        return rounding_variance(step) - spread * step / PI.sqrt() + spread * spread;
    }
    let whole = step * step / (2.0 * PI * PI);
    let shared = terms(step, spread).map(|(k, term)| whole * term / (k * k));
    Some(shared.sum())
        .filter(|shared| *shared > NOTHING * rounding_variance(step))
        .unwrap_or(0.0)
}

/// The same of numbers that differ by a variance, rounding among it; less than all of the smaller one's own variance, which may be said to be
/// below that of rounding.
pub fn shared_by_repeats(step: f64, variance: f64, own: f64) -> f64 {
    shared_rounding(step, variance - rounding_variance(step)).min((1.0 - LEAST_SPREAD) * own)
}

/// The derivative of v by s^2, where it is not endless.
pub fn shared_rounding_slope(step: f64, spread_squared: f64) -> f64 {
    let spread = spread_squared.max(0.0).sqrt();
    if spread < CLOSED * step {
        return 1.0 - step / (2.0 * PI.sqrt() * spread.max(NOTHING * step));
    }
    -2.0 * terms(step, spread).map(|(_, term)| term).sum::<f64>()
}

/// k with exp(-4 pi^2 k^2 s^2 / D^2); none without steps.
fn terms(step: f64, spread: f64) -> impl Iterator<Item = (f64, f64)> {
    let size = (2.0 * PI * spread / step).powi(2);
    let is_any = step > 0.0;
    (1..=TERMS)
        .filter(move |_| is_any)
        .map(move |k| (f64::from(k), (-size * f64::from(k * k)).exp()))
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::numeric::random::generator;

    /// Both forms agree where one goes over into the other, with their slopes; ends are as they must be.
    #[test]
    fn forms_agree() {
        let step = 0.05;
        let at = |share: f64| (share * step).powi(2);
        let v = |share: f64| shared_rounding(step, at(share)) / rounding_variance(step);
        assert!((v(0.0) - 1.0).abs() < 1e-15 && v(2.0).abs() < 1e-15);
        assert!((v(CLOSED * (1.0 + 1e-9)) - v(CLOSED * (1.0 - 1e-9))).abs() < 1e-7);
        for share in [0.05, 0.0999, 0.1001, 0.3, 0.6] {
            let [more, less] = [1e-4, -1e-4].map(|by| at(share) * (1.0 + by));
            let change = shared_rounding(step, more) - shared_rounding(step, less);
            let slope = shared_rounding_slope(step, at(share));
            let relative = change / (more - less) / slope;
            assert!((relative - 1.0).abs() < 1e-4, "{share}: {relative}");
        }
        assert!(shared_rounding(0.0, 1.0).abs() < 1e-300);
    }

    /// Numbers that are rounded have it.
    #[test]
    fn rounded_numbers_have_it() {
        const PAIRS: u32 = 100_000;
        let mut random = generator(7, 3);
        for spread in [0.02, 0.08, 0.2, 0.4] {
            let [mut shared, mut own, mut with_noise] = [0.0; 3];
            for _ in 0..PAIRS {
                let place: f64 = random.random();
                let mut error = || {
                    let noise: f64 = StandardNormal.sample(&mut random);
                    let read = place + spread * noise;
                    (read.round() - read, noise)
                };
                let [(one, noise), (other, _)] = [error(), error()];
                shared += one * other;
                own += one * one;
                with_noise += one * noise;
            }
            let mean = |sum: f64| sum / f64::from(PAIRS);
            // Four standard errors of products that are at most 1/12 (root mean square) each.
            let room = 4.0 / 12.0 / f64::from(PAIRS).sqrt();
            let expected = shared_rounding(1.0, spread * spread);
            assert!((mean(shared) - expected).abs() < room, "{spread}");
            assert!((mean(own) - rounding_variance(1.0)).abs() < room);
            assert!(mean(with_noise).abs() < 4.0 * room);
        }
    }
}
