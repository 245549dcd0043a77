//! Every operation against exact rationals.

use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{Signed, Zero};

use super::bound::{Ingredients, Target};
use super::constant::{Constant, IDENTITY, rotation_of, towards, turned, vector};
use super::polynomial::Polynomial;
use super::question::{Arm, ProofJoint};
use super::rounding::{SIN_COS_ERROR, Waves, sin_cos};
use super::rows::squares_of_rows;
use super::taylor::{
    LANES, Lanes, ModelVector, ModelWorkspace, TaylorModel, VARIABLES, linear, second,
};

/// Random numbers, as many as wanted.
pub struct Random(pub u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    pub fn vector(&mut self) -> [f64; 3] {
        std::array::from_fn(|_| self.number())
    }

    pub fn below(&mut self, count: usize) -> usize {
        usize::try_from(self.bits() >> 40).unwrap_or_default() % count
    }

    /// Between -1 and 1.
    pub fn number(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

fn exact(value: f64) -> BigRational {
    BigRational::from_float(value).unwrap_or_else(BigRational::zero)
}

/// Whether a bound, which may be none, holds.
fn is_at_least(bound: f64, value: &BigRational) -> bool {
    bound == f64::INFINITY || exact(bound) >= *value
}

fn whole(value: i32) -> BigRational {
    BigRational::from_integer(BigInt::from(value))
}

/// The value of a polynomial of n variables at a point, exactly.
fn value(coefficients: &dyn Fn(usize) -> f64, x: &[BigRational]) -> BigRational {
    let mut sum = exact(coefficients(0));
    for j in 0..x.len() {
        sum += exact(coefficients(linear(j))) * &x[j];
        for i in 0..j {
            sum += exact(coefficients(second(i, j))) * &x[i] * &x[j];
        }
        let t2 = whole(2) * &x[j] * &x[j] - whole(1);
        sum += exact(coefficients(second(j, j))) * t2;
    }
    sum
}

/// A model of random coefficients of second order, as large as its scale each, without a remainder, over
/// `first..last`.
fn model(
    workspace: &mut ModelWorkspace,
    random: &mut Random,
    scales: [f64; 3],
    n: usize,
) -> TaylorModel {
    let mut terms = Vec::new();
    let constant: Lanes = std::array::from_fn(|_| scales[0] * random.number());
    terms.push(workspace.constants(&constant, &[0.0; LANES]));
    let mut sum = Vec::new();
    for j in 0..n {
        let half: Lanes = std::array::from_fn(|_| scales[1] * random.number());
        sum.push(workspace.variable(j, &[0.0; LANES], &half));
        let one = workspace.variable(j, &[0.0; LANES], &[1.0; LANES]);
        for i in 0..=j {
            let half: Lanes = std::array::from_fn(|_| scales[2] * random.number());
            let other = workspace.variable(i, &[0.0; LANES], &half);
            sum.push(workspace.sum().product(1.0, one, other).end());
        }
    }
    terms.extend(sum);
    let mut all = workspace.sum();
    for term in terms {
        all = all.add(1.0, term);
    }
    let model = all.end();
    workspace.forget_remainder(model);
    model
}

/// Points of the box: corners, and others.
fn points(random: &mut Random, n: usize) -> Vec<Vec<BigRational>> {
    (0..4)
        .map(|kind| {
            (0..n)
                .map(|_| {
                    let number = random.number();
                    exact(if kind == 0 { number.signum() } else { number })
                })
                .collect()
        })
        .collect()
}

fn assert_inside(
    workspace: &ModelWorkspace,
    model: TaylorModel,
    lane: usize,
    x: &[BigRational],
    truth: &BigRational,
) {
    let here = value(&|k| workspace.coefficients(model)[k][lane], x);
    let off = (here - truth).abs();
    let remainder = exact(workspace.remainder(model)[lane]);
    assert!(off <= remainder, "off by {off} of {remainder}");
    let bound = exact(workspace.bound(model)[lane]);
    assert!(truth.abs() <= bound);
}

/// Sizes of the constants, the linear and the second part: where there is a constant only in one factor,
/// nothing but rounding is left for the remainder.
const SCALES: [([f64; 3], [f64; 3]); 6] = [
    ([1.0, 0.0, 0.0], [1.0, 1.0, 1.0]),
    ([1.0, 1.0, 1.0], [1.0, 0.0, 0.0]),
    ([1.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
    ([1.0, 1.0, 0.0], [1.0, 1.0, 0.0]),
    ([1.0, 0.1, 0.01], [1.0, 0.1, 0.01]),
    ([1.0, 1.0, 1.0], [1.0, 1.0, 1.0]),
];

#[test]
fn products_squares_and_sums_enclose_the_truth() {
    let mut random = Random(1);
    for round in 0..60 {
        let n = 1 + round % 4;
        let (one_scales, other_scales) = SCALES[round % SCALES.len()];
        let mut workspace = ModelWorkspace::new(n);
        let one = model(&mut workspace, &mut random, one_scales, n);
        let other = model(&mut workspace, &mut random, other_scales, n);
        let factor = random.number();
        let product = workspace.sum().product(1.0, one, other).end();
        let minus = workspace.sum().product(-1.0, one, other).end();
        let square = workspace.sum().square(one).end();
        let sum = workspace.sum().add(factor, one).add(1.0, other).end();
        let several = workspace
            .sum()
            .product(1.0, one, other)
            .square(other)
            .add(factor, one)
            .end();
        for x in points(&mut random, n) {
            for lane in 0..LANES {
                let a = value(&|k| workspace.coefficients(one)[k][lane], &x);
                let b = value(&|k| workspace.coefficients(other)[k][lane], &x);
                let f = exact(factor);
                assert_inside(&workspace, product, lane, &x, &(&a * &b));
                assert_inside(&workspace, minus, lane, &x, &(whole(0) - &a * &b));
                assert_inside(&workspace, square, lane, &x, &(&a * &a));
                assert_inside(&workspace, sum, lane, &x, &(&f * &a + &b));
                assert_inside(
                    &workspace,
                    several,
                    lane,
                    &x,
                    &(&a * &b + &b * &b + &f * &a),
                );
            }
        }
    }
}

/// Each product of a coordinate and one of second order, alone, up to the corners; and what cancels leaves nothing but rounding.
#[test]
fn terms_of_third_order_are_told_apart_and_cancel() {
    let n = 4;
    let corners: Vec<Vec<BigRational>> = (0..1 << n)
        .map(|corner| {
            (0..n)
                .map(|j| whole(if corner >> j & 1 == 0 { 1 } else { -1 }))
                .collect()
        })
        .chain(points(&mut Random(8), n))
        .collect();
    let mut workspace = ModelWorkspace::new(n);
    let coordinates: Vec<TaylorModel> = (0..n)
        .map(|j| workspace.variable(j, &[0.0; LANES], &[1.0; LANES]))
        .collect();
    for i in 0..n {
        for j in 0..n {
            for k in 0..=j {
                let pair = (workspace.sum())
                    .product(1.0, coordinates[j], coordinates[k])
                    .end();
                let product = (workspace.sum()).product(1.0, coordinates[i], pair).end();
                for x in &corners {
                    let truth = &x[i] * &x[j] * &x[k];
                    assert_inside(&workspace, product, 0, x, &truth);
                }
                // 1 where all three differ, or half of 1 and of what stays linear.
                assert!(workspace.remainder(product)[0] < 1.0 + 1e-9);
            }
        }
    }
    let mut random = Random(9);
    let [one, other] = [(); 2].map(|()| model(&mut workspace, &mut random, [1.0, 1.0, 0.25], n));
    let nothing = (workspace.sum())
        .product(1.0, one, other)
        .product(-1.0, one, other)
        .end();
    let fourth = workspace.bend(one)[0] * workspace.bend(other)[0];
    assert!(workspace.remainder(nothing)[0] < 2.0 * fourth + 1e-12);
}

#[test]
fn remainders_and_errors_of_constants_are_passed_on() {
    let mut random = Random(2);
    for round in 0..40 {
        let n = 2;
        let mut workspace = ModelWorkspace::new(n);
        let (scales, _) = SCALES[round % SCALES.len()];
        let one = model(&mut workspace, &mut random, scales, n);
        let other = model(&mut workspace, &mut random, scales, n);
        let width = 0.125;
        let loose = workspace.constants(&[0.0; LANES], &[width; LANES]);
        // Their remainder is the width: the truth may be anywhere within.
        let [one, other] =
            [one, other].map(|each| workspace.sum().add(1.0, each).add(1.0, loose).end());
        let product = workspace.sum().product(1.0, one, other).end();
        let square = workspace.sum().square(one).end();
        let factor = random.number();
        let scaled = workspace.sum().add_constant(factor, width, one).end();
        for x in points(&mut random, n) {
            for lane in 0..LANES {
                let shift = |random: &mut Random| {
                    exact(width) * whole(if random.number() > 0.0 { 1 } else { -1 })
                };
                let a = value(&|k| workspace.coefficients(one)[k][lane], &x) + shift(&mut random);
                let b = value(&|k| workspace.coefficients(other)[k][lane], &x) + shift(&mut random);
                let f = exact(factor) + shift(&mut random);
                assert_inside(&workspace, product, lane, &x, &(&a * &b));
                assert_inside(&workspace, square, lane, &x, &(&a * &a));
                assert_inside(&workspace, scaled, lane, &x, &(&f * &a));
            }
        }
    }
}

/// Vectors that are anywhere within their remainders, in rows that share them.
#[test]
fn squares_of_rows_enclose_the_truth() {
    let mut random = Random(10);
    for round in 0..30 {
        let n = 2;
        let mut workspace = ModelWorkspace::new(n);
        let (scales, _) = SCALES[round % SCALES.len()];
        // Without a width, nothing but rounding is left for remainders where there are only constants.
        let width = if round < 12 { 0.0 } else { 0.125 };
        let loose = workspace.constants(&[0.0; LANES], &[width; LANES]);
        let plain: [ModelVector; 2] = std::array::from_fn(|_| {
            std::array::from_fn(|_| model(&mut workspace, &mut random, scales, n))
        });
        let vectors = plain
            .map(|vector| vector.map(|part| workspace.sum().add(1.0, part).add(1.0, loose).end()));
        let rows: Vec<Vec<f64>> = (0..3)
            .map(|_| vec![random.number(), random.number()])
            .collect();
        let mut spread = [[0.0; LANES]; VARIABLES];
        let total = squares_of_rows(&mut workspace, &rows, &vectors, &mut spread);
        for x in points(&mut random, n) {
            for lane in 0..LANES {
                let values = vectors.map(|vector| {
                    vector.map(|part| {
                        let sign = whole(if random.number() > 0.0 { 1 } else { -1 });
                        value(&|k| workspace.coefficients(part)[k][lane], &x) + exact(width) * sign
                    })
                });
                let mut truth = whole(0);
                for row in &rows {
                    for (one, other) in values[0].iter().zip(&values[1]) {
                        let sum = exact(row[0]) * one + exact(row[1]) * other;
                        truth += &sum * &sum;
                    }
                }
                assert_inside(&workspace, total, lane, &x, &truth);
            }
        }
    }
}

/// What is in two rows with opposite signs can be off by anything there: it cancels.
#[test]
fn remainders_cancel_between_rows() {
    let mut workspace = ModelWorkspace::new(1);
    let far = workspace.constant(1.0, 0.0);
    let loose = workspace.constants(&[0.0; LANES], &[1e-3; LANES]);
    let vectors = [[far, far, far], [loose, loose, loose]];
    let rows = vec![vec![1.0, 1.0], vec![1.0, -1.0]];
    let mut spread = [[0.0; LANES]; VARIABLES];
    let total = squares_of_rows(&mut workspace, &rows, &vectors, &mut spread);
    assert!(workspace.remainder(total)[0] < 6.001e-6);
}

/// Sine and cosine of a rational of at most 130, to 2^-300.
fn waves_of(angle: &BigRational) -> [BigRational; 2] {
    let bits = 400_u32;
    let one = BigInt::from(1) << bits;
    let x = (angle * BigRational::from_integer(one.clone())).to_integer();
    let (mut term, mut sums) = (one.clone(), [BigInt::zero(), BigInt::zero()]);
    for k in 0..600_u32 {
        let sign = if (k / 2) % 2 == 0 { 1 } else { -1 };
        sums[usize::from(k % 2 == 0)] += &term * sign;
        term = ((&term * &x) >> bits) / BigInt::from(k + 1);
    }
    sums.map(|sum| BigRational::new(sum, one.clone()))
}

fn tiny() -> BigRational {
    BigRational::new(BigInt::from(1), BigInt::from(1) << 250_u32)
}

#[test]
fn sine_and_cosine_are_as_near_as_they_say() {
    let mut random = Random(3);
    let quarter = std::f64::consts::FRAC_PI_2;
    let mut angles: Vec<f64> = (0..400).map(|_| random.number() * 60.0).collect();
    angles.extend((0..200).map(|_| random.number() * 4.0));
    angles.extend((-38..=38).map(|k| f64::from(k) * quarter));
    angles.extend((-38..=38).map(|k| f64::from(k) * quarter * (1.0 + 1e-13)));
    angles.extend((-75..=75).map(|k| f64::from(k) * quarter / 2.0));
    angles.extend([0.0, 1e-300, -1e-9, 60.0, -60.0]);
    for angle in angles {
        let (sine, cosine) = sin_cos(angle);
        let truth = waves_of(&exact(angle));
        for (here, truth) in [sine, cosine].into_iter().zip(truth) {
            let off = (exact(here) - truth).abs();
            assert!(off < exact(SIN_COS_ERROR), "{angle}: {off}");
        }
    }
}

#[test]
fn waves_enclose_sine_and_cosine() {
    let mut random = Random(4);
    let mut widths = vec![0.0, 1e-12, 1e-5, 1e-3, 0.01, 0.1, 0.3, 1.0, 2.0, 3.0];
    widths.extend((0..30).map(|_| 2.0 * random.number().abs()));
    for width in widths {
        let waves = Waves::new(width);
        for _ in 0..10 {
            let x = random.number();
            let [sine, cosine] = waves_of(&(exact(width) * exact(x)));
            let t2 = whole(2) * exact(x) * exact(x) - whole(1);
            let here = exact(waves.cosine[0]) + exact(waves.cosine[1]) * t2;
            assert!(
                (here - cosine).abs() <= exact(waves.cosine_error) + tiny(),
                "{width} {x}"
            );
            let here = exact(waves.sine) * exact(x);
            assert!(
                (here - sine).abs() <= exact(waves.sine_error) + tiny(),
                "{width} {x}"
            );
            // The models of sine and cosine about any centre; that of a point has no error but rounding.
            let waves = if width == 0.0 {
                Waves {
                    cosine_error: 0.0,
                    sine_error: 0.0,
                    ..waves
                }
            } else {
                waves
            };
            let centre = 4.0 * random.number();
            let mut workspace = ModelWorkspace::new(1);
            let models = workspace.sin_cos(0, &[sin_cos(centre); LANES], &[waves; LANES]);
            let angle = exact(centre) + exact(width) * exact(x);
            for (model, truth) in models.into_iter().zip(waves_of(&angle)) {
                assert_inside(&workspace, model, 0, &[exact(x)], &truth);
            }
        }
    }
}

#[test]
fn polynomials_are_bounded_over_the_box_and_at_its_centre() {
    let mut random = Random(5);
    for round in 0..200 {
        let n = 1 + round % 5;
        let mut workspace = ModelWorkspace::new(n);
        // Without a second part the largest value is in a corner, and only rounding is between.
        let scales = if round % 2 == 0 {
            [1.0, 1.0, 0.0]
        } else {
            [1.0, 0.3, 1.0]
        };
        let one = model(&mut workspace, &mut random, scales, n);
        let other = model(&mut workspace, &mut random, scales, n);
        let [a, b] = [one, other].map(|each| Polynomial::new(&workspace, each, 0, n));
        let factor = random.number();
        let sum = a.plus(factor, &b);
        // What the other one may be off by is as many times in the sum.
        let mut loose = b;
        loose.remainder = 0.5;
        assert!(a.plus(factor, &loose).remainder >= 0.5 * factor.abs());
        let mut all = points(&mut random, n);
        all.push((0..n).map(|j| exact(a.slope(j).signum())).collect());
        all.push((0..n).map(|j| exact(sum.slope(j).signum())).collect());
        for x in &all {
            let here = value(&|k| workspace.coefficients(one)[k][0], x);
            let there = value(&|k| workspace.coefficients(other)[k][0], x);
            assert!(exact(a.largest()) >= here);
            assert!(is_at_least(a.largest_of_concave(), &here));
            let total = here + exact(factor) * there;
            assert!(exact(sum.largest()) >= total);
            assert!(is_at_least(sum.largest_of_concave(), &total));
            let stored = value(&|k| sum.coefficient(k), x);
            assert!((stored - total).abs() <= exact(sum.remainder));
        }
        let centre: Vec<BigRational> = (0..n).map(|_| whole(0)).collect();
        let here = value(&|k| workspace.coefficients(one)[k][0], &centre);
        assert!(exact(a.least_at_centre()) <= here);
    }
}

/// p = x/10 - (x + y + z)^2 - (x^2 + y^2 + z^2)/10, largest at x = 10.5/31, y = z = -5/31.
#[test]
fn coupled_concave_polynomials_are_bounded_by_their_largest_value() {
    let mut workspace = ModelWorkspace::new(3);
    let all: Vec<TaylorModel> = (0..3)
        .map(|j| workspace.variable(j, &[0.0; LANES], &[1.0; LANES]))
        .collect();
    let mut sum = workspace.sum();
    for each in &all {
        sum = sum.add(1.0, *each);
    }
    let together = sum.end();
    let mut squares = workspace.sum();
    for each in &all {
        squares = squares.square(*each);
    }
    let squares = squares.end();
    let own = workspace.sum().add(0.1, all[0]).add(-0.1, squares);
    let model = own.product(-1.0, together, together).end();
    let polynomial = Polynomial::new(&workspace, model, 0, 3);
    let largest = 0.05 * 10.5 / 31.0;
    assert!((polynomial.largest_of_concave() - largest).abs() < 1e-9);
    assert!(polynomial.largest() > 2.7);
}

#[test]
fn constant_rotations_enclose_the_exact_ones() {
    let mut random = Random(6);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let mut quaternions: Vec<[f64; 4]> = (0..200)
        .map(|_| std::array::from_fn(|_| random.number()))
        .collect();
    quaternions.extend([
        [half, 0.0, 0.0, half],
        [0.5, -0.5, 0.5, 0.5],
        [0.0, 0.0, 1.0, 0.0],
    ]);
    quaternions.push([0.0, 0.0, 1e-9, 1.0]);
    for [x, y, z, w] in quaternions {
        let rotation = rotation_of([x, y, z, w]);
        let [x, y, z, w] = [x, y, z, w].map(exact);
        let squared = &x * &x + &y * &y + &z * &z + &w * &w;
        let entries = [
            (rotation[0][0], &w * &w + &x * &x - &y * &y - &z * &z),
            (rotation[0][1], whole(2) * (&x * &y + &w * &z)),
            (rotation[2][1], whole(2) * (&y * &z - &w * &x)),
            (rotation[1][2], whole(2) * (&y * &z + &w * &x)),
            (rotation[2][2], &w * &w - &x * &x - &y * &y + &z * &z),
        ];
        for (constant, truth) in entries {
            let off = (exact(constant.value) - truth / &squared).abs();
            assert!(off <= exact(constant.error));
        }
    }
    for _ in 0..100 {
        let [a, b, c, d, e] = [(); 5].map(|()| random.vector());
        let turned = turned(&[a, b, c].map(vector), &vector(d));
        for row in 0..3 {
            let truth: BigRational = ([a, b, c].iter().zip(d))
                .map(|(column, factor)| exact(column[row]) * exact(factor))
                .sum();
            assert!((exact(turned[row].value) - truth).abs() <= exact(turned[row].error));
        }
        let loose = e.map(|error| Constant {
            value: 1.0,
            error: error.abs(),
        });
        let turned = super::constant::turned(&IDENTITY, &loose);
        assert!((0..3).all(|row| turned[row].error >= loose[row].error));
    }
    for _ in 0..200 {
        let direction: [f64; 3] = std::array::from_fn(|_| random.number());
        let column = towards(direction)[2];
        let [d, c] = [direction, column.map(|each| each.value)].map(|each| each.map(exact));
        let error = exact(column[0].error + column[1].error + column[2].error);
        // Parallel to the direction: the cross product is within the error times its length.
        for k in 0..3 {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let off = (&c[i] * &d[j] - &c[j] * &d[i]).abs();
            assert!(off <= &error * whole(2));
        }
    }
}

/// One joint at zero angle, whose matrix is known exactly, and rows of B whose parts of the trace cancel but for a
/// millionth: the bound is below the exact one, and near.
#[test]
fn the_bound_of_rho0_is_below_the_exact_one() {
    let mut random = Random(17);
    for _ in 0..200 {
        let [x, y, force] = random.vector();
        let target = Target {
            arm: Arm {
                joints: vec![ProofJoint {
                    offset_m: [0.0; 3],
                    rotation: [0.0, 0.0, 0.0, 1.0],
                    axis: [0.0, 0.0, 1.0],
                    range_rad: [-1.0, 1.0],
                }],
                tool_joints: 1,
                tool_offset_m: [x, y, 0.0],
                tool_rotation: [0.0, 0.0, 0.0, 1.0],
            },
            configuration_rad: vec![0.0],
            wrench: [0.0, force, 0.0, 0.0, 0.0, 0.0],
            weight: 1.0,
            direction: None,
        };
        // The lever is (-y, x, 0), its moment x times the force.
        let rows = [vec![x], vec![y * (1.0 + 1e-6 * random.number())], vec![1.0]];
        let moment = exact(x) * exact(force);
        let trace = (exact(rows[1][0]) * exact(x) - exact(rows[0][0]) * exact(y)) * &moment;
        let ingredients = Ingredients {
            targets: &[target],
            parameters: &[0],
            rows: &rows,
            sigma_m: 1.0,
        };
        let bound = exact(ingredients.least_rho0_m(1.0).unwrap_or(f64::NAN));
        assert!(bound <= trace.abs());
        assert!(trace.abs() - bound <= exact(1e-12));
    }
}
