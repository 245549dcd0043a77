//! The length |e| of a normal error e of mean zero: what a share of errors does not exceed, its mean and standard deviation.
//!
//! |e|^2 is a weighted sum of chi-squares of one degree of freedom each, with the eigenvalues `w_i` of e's covariance as
//! weights. The Laplace transform of its distribution function F is elementary, and all its singularities lie on the
//! negative axis:
//!
//! ```text
//! integral exp(-p x) F(x) dx = 1/p  prod (1 + 2 w_i p)^(-1/2)
//! ```
//!
//! so that the midpoint rule along a cotangent contour inverts it to an error of 3.89^-N for N nodes, whatever the weights
//! are (Trefethen, Weideman and Schmelzer, Talbot quadratures and rational approximations, BIT 46, 2006).

use std::f64::consts::PI;

use nalgebra::{Complex, DMatrix};

use crate::numeric::factorisation::finite_eigen;

/// The squares that 95 % of normal errors of one, two and three coordinates stay below, over their variance.
pub const CHI_SQUARE_95: [f64; 3] = [
    3.841_458_820_694_124,
    5.991_464_547_107_979,
    7.814_727_903_251_18,
];

/// The middle of some values, of an even number the greater of the two in the middle; `None` of none.
#[must_use]
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// The smallest and the largest of some values; infinity and its negative of none.
pub fn ends(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
        [low.min(value), high.max(value)]
    })
}

/// 3.89^-24 is 7e-15; more nodes would lose as much to rounding.
const NODES: u32 = 24;
/// Halvings of the interval in which a quantile lies: to its last digits.
const HALVINGS: usize = 60;
/// Weights below this share of the largest change no digit.
const NOTHING: f64 = 1e-18;

/// The length (in the unit of e) that this share of the draws of e stays below; `None` where the covariance (r x r) is no
/// finite one. Its relative error is below 1e-9 for shares from 1 to 99 %.
pub fn length_quantile(covariance: &DMatrix<f64>, share: f64) -> Option<f64> {
    let weights = finite_eigen(covariance)?.eigenvalues;
    let largest = weights.max();
    if largest <= 0.0 {
        return Some(0.0);
    }
    let weights: Vec<f64> = (weights.iter())
        .map(|weight| weight / largest)
        .filter(|weight| *weight > NOTHING)
        .collect();
    // Markov's inequality, and nothing less than nothing.
    let mut low = 0.0;
    let mut high = weights.iter().sum::<f64>() / (1.0 - share);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if distribution(&weights, middle) < share {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some((largest * 0.5 * (low + high)).sqrt())
}

/// The mean and the standard deviation of |e| (in the unit of e); `None` where the covariance (r x r) is no finite one.
///
/// With x = |e|^2 and sqrt(x) = 1/sqrt(pi) integral over u > 0 of (1 - exp(-x u^2)) / u^2 du,
///
/// ```text
/// E|e| = 1/sqrt(pi) integral over s of (1 - prod (1 + 2 w_i exp(2 s))^(-1/2)) exp(-s) ds,   var |e| = sum w_i - (E|e|)^2
/// ```
///
/// whose integrand is analytic for |Im s| < pi/2 and falls as exp(-|s|): the trapezoidal rule with steps h is off by
/// exp(-pi^2/h).
pub fn length_moments(covariance: &DMatrix<f64>) -> Option<[f64; 2]> {
    let weights = finite_eigen(covariance)?.eigenvalues;
    let largest = weights.max();
    if largest <= 0.0 {
        return Some([0.0, 0.0]);
    }
    let weights = weights.map(|weight| weight.max(0.0) / largest);
    let sum: f64 = (-STEPS..=STEPS)
        .map(|step| {
            let s = f64::from(step) * STEP;
            let squared = (2.0 * s).exp();
            let logarithm: f64 = weights.iter().map(|w| (2.0 * w * squared).ln_1p()).sum();
            -(-0.5 * logarithm).exp_m1() * (-s).exp()
        })
        .sum();
    let mean = sum * STEP / PI.sqrt();
    let variance = (weights.sum() - mean * mean).max(0.0);
    Some([mean * largest.sqrt(), (variance * largest).sqrt()])
}

/// The steps of the rule, and how many there are to each side: to exp(-37), 1e-16.
const STEP: f64 = 0.25;
const STEPS: i32 = 148;

/// The pose repeatability RP (ISO 9283) of places that scatter with a covariance (r x r): the mean distance from their
/// centre and three of its standard deviations, in the unit of the covariance's root; `None` where it is no finite one. It is
/// 3.62 standard deviations of a coordinate where three are alike, and 2.61 along one line.
pub fn pose_repeatability(covariance: &DMatrix<f64>) -> Option<f64> {
    let [mean, deviation] = length_moments(covariance)?;
    Some(mean + 3.0 * deviation)
}

/// The share of weighted sums of chi-squares that does not exceed x > 0.
fn distribution(weights: &[f64], x: f64) -> f64 {
    let nodes = f64::from(NODES);
    let one = Complex::new(1.0, 0.0);
    let mut sum = 0.0;
    // Nodes come in conjugate pairs: the upper half, twice.
    for node in 0..NODES / 2 {
        let angle = (2.0 * f64::from(node) + 1.0) * PI / nodes;
        let (sine, cosine) = (0.6407 * angle).sin_cos();
        let cotangent = cosine / sine;
        let z = Complex::new(0.5017 * angle * cotangent - 0.6122, 0.2645 * angle) * nodes;
        let slope = Complex::new(
            0.5017 * (cotangent - 0.6407 * angle / (sine * sine)),
            0.2645,
        ) * nodes;
        let p = z / x;
        let transform = (weights.iter()).fold(one / p, |product, weight| {
            product / (one + p * (2.0 * weight)).sqrt()
        });
        // exp(z) transform(z / x) slope / (x i N), of which the pair leaves twice the real part.
        sum += 2.0 * (z.exp() * transform * slope / x).im / nodes;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    fn diagonal(variances: &[f64]) -> DMatrix<f64> {
        DMatrix::from_diagonal(&variances.to_vec().into())
    }

    /// The published quantiles of chi-square with one to six degrees of freedom.
    #[test]
    fn equal_variances_give_chi_squares() {
        for (share, squares) in [
            (
                0.95,
                [
                    3.841_458_821,
                    5.991_464_547,
                    7.814_727_903,
                    9.487_729_037,
                    11.070_497_694,
                    12.591_587_244,
                ],
            ),
            (
                0.5,
                [
                    0.454_936_423,
                    1.386_294_361,
                    2.365_973_884,
                    3.356_693_980,
                    4.351_460_191,
                    5.348_120_627,
                ],
            ),
            (
                0.99,
                [
                    6.634_896_601,
                    9.210_340_372,
                    11.344_866_730,
                    13.276_704_136,
                    15.086_272_469,
                    16.811_893_830,
                ],
            ),
        ] {
            for (index, square) in squares.into_iter().enumerate() {
                let found = length_quantile(&diagonal(&vec![4.0; index + 1]), share);
                let found = found.expect("a covariance").powi(2) / 4.0;
                assert!(
                    (found / square - 1.0).abs() < 1e-8,
                    "{share} {index}: {found}"
                );
            }
        }
    }

    /// Two unequal pairs have an elementary distribution: a mixture of exponentials. Directions without any variance,
    /// or hardly any, change nothing.
    #[test]
    fn pairs_are_mixtures_of_exponentials() {
        for ratio in [0.9, 0.3, 1e-3, 1e-9] {
            let variances = [1.0, 1.0, ratio, ratio, 0.0, 1e-30];
            let x = length_quantile(&diagonal(&variances), 0.95)
                .expect("a covariance")
                .powi(2);
            let above = ((-x / 2.0).exp() - ratio * (-x / (2.0 * ratio)).exp()) / (1.0 - ratio);
            assert!((above - 0.05).abs() < 1e-11, "{ratio}: {above}");
        }
    }

    /// Equal coordinates and one line have the moments of the Maxwell and of the half-normal distribution; two equal ones those of
    /// Rayleigh's.
    #[test]
    fn repeatabilities_of_known_distributions() {
        let (pi, root): (f64, fn(f64) -> f64) = (PI, f64::sqrt);
        for (variances, mean, square) in [
            (&[4.0, 4.0, 4.0][..], 2.0 * root(8.0 / pi), 12.0),
            (&[4.0, 0.0, 0.0], 2.0 * root(2.0 / pi), 4.0),
            (&[4.0, 4.0, 0.0], 2.0 * root(pi / 2.0), 8.0),
        ] {
            let [found, deviation] = length_moments(&diagonal(variances)).expect("a covariance");
            assert!((found / mean - 1.0).abs() < 1e-12, "{variances:?}: {found}");
            let expected = root(square - mean * mean);
            assert!((deviation / expected - 1.0).abs() < 1e-11, "{deviation}");
        }
        let ratio = |variances: &[f64]| pose_repeatability(&diagonal(variances)).expect("one");
        assert!((ratio(&[1.0, 1.0, 1.0]) - 3.616).abs() < 1e-3);
        assert!((ratio(&[1.0, 0.0, 0.0]) - 2.606).abs() < 1e-3);
        assert!(ratio(&[0.0, 0.0, 0.0]).abs() < 1e-300);
        assert_eq!(pose_repeatability(&diagonal(&[f64::NAN, 0.0])), None);
    }

    /// Between these, the moments of a million draws, within four of their standard errors.
    #[test]
    fn repeatabilities_of_draws() {
        use crate::numeric::random::generator;
        use rand_distr::{Distribution, StandardNormal};
        let variances = [1.0, 0.3, 0.02];
        let mut random = generator(7, 0);
        let count = 1_000_000;
        let mut sums = [0.0, 0.0];
        for _ in 0..count {
            let square: f64 = (variances.iter())
                .map(|variance| {
                    let normal: f64 = StandardNormal.sample(&mut random);
                    variance * normal * normal
                })
                .sum();
            sums[0] += square.sqrt();
            sums[1] += square;
        }
        let [mean, square] = sums.map(|sum| sum / f64::from(count));
        let [expected, deviation] = length_moments(&diagonal(&variances)).expect("a covariance");
        let error = deviation / f64::from(count).sqrt();
        assert!((mean - expected).abs() < 4.0 * error, "{mean} {expected}");
        let drawn = mean + 3.0 * (square - mean * mean).sqrt();
        let found = pose_repeatability(&diagonal(&variances)).expect("one");
        assert!((drawn - found).abs() < 12.0 * error, "{drawn} {found}");
    }

    #[test]
    fn what_is_no_covariance_has_no_quantile() {
        assert_eq!(
            length_quantile(&diagonal(&[0.0, 0.0, 0.0]), 0.95),
            Some(0.0)
        );
        assert_eq!(length_quantile(&diagonal(&[1.0, f64::NAN]), 0.95), None);
    }
}
