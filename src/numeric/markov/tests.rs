use nalgebra::DMatrix;

use super::*;
use crate::numeric::random::generator;

const LENGTH: f64 = 0.4;

fn kernels() -> [Kernel; 2] {
    Correlation::ALL.map(|correlation| Kernel {
        correlation,
        length: LENGTH,
        period: None,
    })
}

/// Those and the same around a circle, short beside it and not.
fn all_kernels() -> Vec<Kernel> {
    let around = [4.0, 20.0].map(|period| kernels().map(|each| each.again(Some(period))));
    [kernels()].into_iter().chain(around).flatten().collect()
}

fn processes() -> Vec<MarkovProcess> {
    let of = |knots: &[f64]| {
        let knots = knots.to_vec();
        let all = all_kernels().into_iter();
        all.map(move |kernel| MarkovProcess {
            knots: knots.clone(),
            kernel,
        })
    };
    let all = of(&[-1.0, -0.7, 0.1, 0.2, 2.0]).chain(of(&[-1.0, 0.5]));
    all.chain(of(&[0.3])).collect()
}

/// The covariance of values, said once more.
fn expected(kernel: Kernel, one: f64, other: f64) -> f64 {
    let line = |apart: f64| {
        let x = apart.abs() / LENGTH;
        match kernel.correlation {
            Correlation::Exponential => (-x).exp(),
            Correlation::Matern32 => (1.0 + x) * (-x).exp(),
        }
    };
    let Some(period) = kernel.period else {
        return line(one - other);
    };
    let around = |apart: f64| -> f64 {
        let turns = (-40..=40).map(|turn| line(apart + period * f64::from(turn)));
        turns.sum()
    };
    around(one - other) / around(0.0)
}

/// The covariance of l u' at one place with u at another.
fn of_slope(kernel: Kernel, slope: f64, value: f64) -> f64 {
    let step = 1e-5;
    let at = |place: f64| expected(kernel, place, value);
    LENGTH * (at(slope + step) - at(slope - step)) / (2.0 * step)
}

fn covariance_of(process: &MarkovProcess) -> DMatrix<f64> {
    let count = process.states();
    DMatrix::from_fn(count, count, |one, other| process.covariance(one, other))
}

#[test]
fn the_precision_is_the_inverse_of_the_covariance() {
    for process in processes() {
        let covariance = covariance_of(&process);
        let (blocks, logarithm) = process.precision();
        let size = process.states();
        let mut precision = DMatrix::zeros(size, size);
        blocks.add_to(&mut precision, 0, 1.0);
        assert!((&precision * &covariance - DMatrix::identity(size, size)).norm() < 1e-11);
        assert!((logarithm + covariance.determinant().ln()).abs() < 1e-11);
        let order = process.kernel.order();
        let own = KnotBlocks::of(order, size / order, |row, column| covariance[(row, column)]);
        assert!((blocks.product_trace(&own) - size as f64).abs() < 1e-10);
    }
}

/// Weights and spare variance are those of the normal distribution given all knots.
#[test]
fn values_between_knots_follow_from_the_two_beside_them() {
    for process in processes() {
        let (kernel, order) = (process.kernel, process.kernel.order());
        let inverse = covariance_of(&process).try_inverse().expect("regular");
        for at in [-3.0, -1.0, -0.8, 0.0, 0.19, 1.5, 2.0, 2.5] {
            let with = DMatrix::from_fn(1, process.states(), |_, state| {
                let knot = process.knots[state / order];
                if state % order == 0 {
                    expected(kernel, at, knot)
                } else {
                    of_slope(kernel, knot, at)
                }
            });
            let weights = &with * &inverse;
            let between = process.between(at);
            let mut found = DMatrix::zeros(1, process.states());
            for (state, weight) in between.terms() {
                found[(0, state)] += weight;
            }
            assert!((&found - &weights).norm() < 1e-8, "{at}");
            let spare = 1.0 - (weights * with.transpose())[(0, 0)];
            assert!((between.spare - spare).abs() < 1e-8, "{at}");
        }
    }
}

/// A sampled function is the process, and the same whenever it is asked: the mean of n products of normal numbers of correlation c has the
/// variance (1 + c^2) / n (4 standard deviations). The smooth one has a slope, of the variance 1 / l^2; a square has the variance 2.
#[test]
fn sampled_functions_are_the_process() {
    let places = [0.3, -0.2, 0.0, 0.300_001, -6.1];
    let count = 20_000;
    for kernel in all_kernels() {
        let (mut slope, mut products) = (0.0, DMatrix::zeros(5, 5));
        for run in 0..count {
            let random = generator(5, run);
            let functions = [0, 1].map(|each| SampledFunction::new(kernel, random.clone(), each));
            let value = |place: f64| functions[0].at(place);
            let values = DMatrix::from_iterator(5, 1, places.map(value));
            assert!((value(places[1]) - values[1]).abs() < f64::EPSILON);
            assert!((functions[1].at(0.3) - values[0]).abs() > f64::EPSILON);
            products += &values * values.transpose() / count as f64;
            slope += (LENGTH * (values[3] - values[0]) / 1e-6).powi(2) / count as f64;
        }
        for (row, one) in places.iter().enumerate() {
            for (column, other) in places.iter().enumerate() {
                let wanted = expected(kernel, *one, *other);
                let error = (1.0 + wanted * wanted).sqrt() / (count as f64).sqrt();
                let off = products[(row, column)] - wanted;
                assert!(off.abs() < 4.0 * error, "{row} {column}: {off}");
            }
        }
        let has_slope = (slope - 1.0).abs() < 4.0 * (2.0 / count as f64).sqrt();
        assert_eq!(has_slope, kernel.order() > 1, "{slope}");
    }
}

#[test]
fn knots_stand_where_values_are() {
    let values: Vec<f64> = (0..100)
        .map(|index| (f64::from(index) / 99.0).powi(2))
        .collect();
    let knots = knots_among(&values, 5);
    assert_eq!(knots.len(), 5);
    assert!(knots[0].abs() < 1e-12 && (knots[4] - 1.0).abs() < 1e-12 && knots[2] < 0.3);
    assert_eq!(knots_among(&[2.0; 9], 5).len(), 1);
    assert_eq!(knots_among(&[], 5).len(), 1);
}

/// The root of the covariance is one, whatever the order of the places, equal ones and next to equal ones among them.
#[test]
fn roots_are_those_of_the_covariance() {
    let places = [0.3, -0.2, 0.0, 0.3, 1.7, 0.3 + 1e-9];
    for kernel in all_kernels() {
        let root = root(&places, kernel);
        let found = &root * root.transpose();
        for (row, one) in places.iter().enumerate() {
            for (column, other) in places.iter().enumerate() {
                let off = found[(row, column)] - expected(kernel, *one, *other);
                assert!(off.abs() < 1e-12, "{row} {column}: {off}");
            }
        }
    }
}

/// What a length changes is the derivative.
#[test]
fn derivatives_by_lengths_are_derivatives() {
    for kernel in all_kernels() {
        for apart in [0.0, 0.1, 1.3] {
            let longer = |by: f64| {
                let length = LENGTH * f64::exp(by);
                Kernel { length, ..kernel }.correlation(apart)[0]
            };
            let found = (longer(1e-5) - longer(-1e-5)) / 2e-5;
            assert!((found - kernel.correlation(apart)[1]).abs() < 1e-9);
        }
    }
}
