//! The mistakes that are looked for, and how measurements read if one was made.

use nalgebra::{DVector, Matrix3, Vector3};

use super::evidence::{ReadingEvidence, most_probable};
use super::{Case, Mistake, turned};
use crate::measurement::Measurement;
use crate::robot::{Load, ObservationMatrix};

/// The standard gravity (m/s^2): one kilogram weighs 9.81 N.
pub const GRAVITY: f64 = 9.81;
/// Up to so many joints every set of joints is tried with the other sign, beyond that single joints.
const JOINTS_WITH_ALL_SIGNS: usize = 7;
/// A commanded angle may lie so far outside its range (rad): files have one decimal.
pub const RANGE_SLACK_RAD: f64 = 0.1 * std::f64::consts::PI / 180.0;

/// A supposed mistake.
#[derive(Debug, Clone)]
pub struct Hypothesis {
    pub mistake: Mistake,
    /// Twice the logarithm of the number of mistakes of its kind, and of what its parameters cost.
    pub price: f64,
}

impl Hypothesis {
    /// The measurements without the mistake.
    pub fn apply(&self, case: &Case<'_>, measurements: &[Measurement]) -> Vec<Measurement> {
        let correct = |each: &Measurement| {
            let mut each = each.clone();
            match &self.mistake {
                Mistake::SignsReversed => turn(&mut each, &-Matrix3::identity(), 1.0),
                Mistake::LoadUnit(factor) => each.load = each.load.scaled(*factor),
                Mistake::DeflectionUnit(factor) => stretch(&mut each, *factor),
                Mistake::AngleUnit(factor) => each.configuration_rad *= *factor,
                Mistake::JointSigns(joints) => {
                    for &joint in joints {
                        each.configuration_rad[joint] *= -1.0;
                    }
                }
                Mistake::JointsSwapped([one, other]) => {
                    each.configuration_rad.swap_rows(*one, *other);
                }
                Mistake::Frame(matrix) => turn(&mut each, matrix, matrix.determinant()),
                Mistake::DeflectionsInToolFrame => {
                    let axes = tool_axes(case, &each.configuration_rad);
                    turn(&mut each, &axes, 1.0);
                }
                Mistake::LoadsInToolFrame => {
                    let axes = tool_axes(case, &each.configuration_rad);
                    each.load = Load {
                        force_n: axes * each.load.force_n,
                        torque_nm: axes * each.load.torque_nm,
                    };
                }
                Mistake::AnglesOutsideRange { .. }
                | Mistake::IdenticalRows(_)
                | Mistake::IdenticalReadings(_) => {}
            }
            each
        };
        measurements.iter().map(correct).collect()
    }

    /// Whether the joints' ranges allow the angles that it would make of the file's.
    fn is_possible(&self, case: &Case<'_>, measurements: &[Measurement]) -> bool {
        let ranges = case
            .nominal
            .chain
            .joints
            .iter()
            .map(|joint| joint.range_rad);
        let before = measurements.iter().map(|each| &each.configuration_rad);
        let after = self.apply(case, measurements);
        before.zip(&after).all(|(before, after)| {
            let angles = before.iter().zip(after.configuration_rad.iter());
            (angles.zip(ranges.clone())).all(|((before, after), range)| {
                (after - before).abs() < f64::EPSILON || is_inside(*after, range)
            })
        })
    }
}

/// Whether a commanded angle lies in its joint's range.
pub fn is_inside(angle_rad: f64, [from, to]: [f64; 2]) -> bool {
    (from - RANGE_SLACK_RAD..=to + RANGE_SLACK_RAD).contains(&angle_rad)
}

/// Turns readings; rotation vectors are multiplied by `parity`, too.
fn turn(measurement: &mut Measurement, matrix: &Matrix3<f64>, parity: f64) {
    match &mut measurement.sigma_m {
        Some(sigma) => {
            (measurement.deflection_m, *sigma) = turned(matrix, &measurement.deflection_m, sigma);
        }
        None => measurement.deflection_m = matrix * measurement.deflection_m,
    }
    if let Some(rotation) = &mut measurement.rotation {
        let (vector, sigma) = turned(matrix, &rotation.vector_rad, &rotation.sigma_rad);
        (rotation.vector_rad, rotation.sigma_rad) = (vector * parity, sigma);
    }
}

/// Takes deflections and standard deviations that the file brings for larger ones.
fn stretch(measurement: &mut Measurement, factor: f64) {
    measurement.deflection_m *= factor;
    if let Some(sigma) = &mut measurement.sigma_m {
        *sigma *= factor;
    }
}

fn tool_axes(case: &Case<'_>, configuration_rad: &DVector<f64>) -> Matrix3<f64> {
    let arm = case.nominal.chain.at(case.tool);
    arm.state(configuration_rad.as_slice()).tool_rotation
}

/// All mistakes that are looked for, the simple ones first.
pub fn hypotheses(case: &Case<'_>, measurements: &[Measurement]) -> Vec<Hypothesis> {
    let mut all = vec![free(Mistake::SignsReversed)];
    let kind = |mistakes: Vec<Mistake>| -> Vec<Hypothesis> {
        let price = 2.0 * (mistakes.len() as f64).ln();
        let priced = |mistake| Hypothesis { mistake, price };
        mistakes.into_iter().map(priced).collect()
    };
    let units = [GRAVITY, GRAVITY.recip(), 1000.0, 0.001];
    all.extend(kind(units.map(Mistake::LoadUnit).into()));
    all.extend(kind([1000.0, 0.001].map(Mistake::DeflectionUnit).into()));
    let degrees = 1_f64.to_degrees();
    all.extend(kind(
        [degrees, degrees.recip()].map(Mistake::AngleUnit).into(),
    ));
    all.extend(joint_signs(case.nominal.chain.len()));
    let joints = 0..case.nominal.chain.len();
    let pairs = joints
        .clone()
        .flat_map(|one| (0..one).map(move |other| [other, one]));
    all.extend(kind(pairs.map(Mistake::JointsSwapped).collect()));
    all.extend(kind(vec![
        Mistake::DeflectionsInToolFrame,
        Mistake::LoadsInToolFrame,
    ]));
    all.extend(kind(columns().into_iter().map(Mistake::Frame).collect()));
    all.extend(rotation(case, measurements));
    all.retain(|hypothesis| hypothesis.is_possible(case, measurements));
    all
}

fn free(mistake: Mistake) -> Hypothesis {
    Hypothesis {
        mistake,
        price: 0.0,
    }
}

/// Joints that turn the other way: sets of them, priced by the number of sets as large.
fn joint_signs(joints: usize) -> Vec<Hypothesis> {
    let set = |bits: usize| -> Vec<usize> {
        (0..joints).filter(|joint| bits >> joint & 1 == 1).collect()
    };
    let sets: Vec<Vec<usize>> = if joints <= JOINTS_WITH_ALL_SIGNS {
        (1..1 << joints).map(set).collect()
    } else {
        (0..joints).map(|joint| vec![joint]).collect()
    };
    let as_large = |size: usize| sets.iter().filter(|set| set.len() == size).count() as f64;
    let prices: Vec<f64> = (0..=joints)
        .map(|size| 2.0 * (as_large(size).max(1.0) * joints as f64).ln())
        .collect();
    sets.into_iter()
        .map(|joints| Hypothesis {
            price: prices[joints.len()],
            mistake: Mistake::JointSigns(joints),
        })
        .collect()
}

/// The ways to put three columns in another order and change their signs, but for those that change
/// nothing or all signs.
fn columns() -> Vec<Matrix3<f64>> {
    let orders = [
        [0, 1, 2],
        [0, 2, 1],
        [1, 0, 2],
        [1, 2, 0],
        [2, 0, 1],
        [2, 1, 0],
    ];
    let mut all = Vec::new();
    for order in orders {
        for bits in 0..8_u8 {
            let mut matrix = Matrix3::zeros();
            for (row, &column) in order.iter().enumerate() {
                matrix[(row, column)] = if bits >> row & 1 == 1 { -1.0 } else { 1.0 };
            }
            let is_trivial = matrix == Matrix3::identity() || matrix == -Matrix3::identity();
            if !is_trivial {
                all.push(matrix);
            }
        }
    }
    all
}

/// The rotation that takes the measured deflections nearest to predicted ones (Wahba's problem, by
/// Kabsch's singular value decomposition), with the compliances that then fit, in turns. It starts
/// from the turned frames of right angles that fit best. What its three angles cost is the share of all
/// rotations that fit as well: (2 pi)^(3/2) det(I)^(-1/2) of 8 pi^2, for their information matrix I.
fn rotation(case: &Case<'_>, measurements: &[Measurement]) -> Option<Hypothesis> {
    let right_angles = columns()
        .into_iter()
        .filter(|matrix| matrix.determinant() > 0.0);
    let information: Matrix3<f64> = (measurements.iter())
        .map(|each| {
            let sigma = (each.sigma_m).map_or(case.sigma.weight_m(), |sigma| sigma.amax());
            let moved = each.deflection_m.cross_matrix() / sigma;
            moved.transpose() * moved
        })
        .sum();
    let circle = std::f64::consts::TAU;
    let price =
        information.determinant().ln() - 3.0 * circle.ln() + 2.0 * (2.0 * circle * circle).ln();
    let hypothesis = |matrix| Hypothesis {
        mistake: Mistake::Frame(matrix),
        price: price.max(0.0),
    };
    let discrepancy = |matrix: &Matrix3<f64>| {
        let read = hypothesis(*matrix).apply(case, measurements);
        ReadingEvidence::new(case, measurements, &read).discrepancy
    };
    let refined = |start: Matrix3<f64>| {
        let mut matrix = start;
        for _ in 0..TURNS {
            let read = hypothesis(matrix).apply(case, measurements);
            matrix = nearest_rotation(case, measurements, &read)?;
        }
        Some((discrepancy(&matrix), matrix))
    };
    let mut starts: Vec<(f64, Matrix3<f64>)> = right_angles
        .chain([Matrix3::identity()])
        .map(|matrix| (discrepancy(&matrix), matrix))
        .collect();
    starts.sort_by(|one, other| one.0.total_cmp(&other.0));
    let best = (starts.into_iter().take(STARTS))
        .filter_map(|(_, start)| refined(start))
        .min_by(|one, other| one.0.total_cmp(&other.0))?;
    Some(hypothesis(best.1))
}

/// So many times rotation and compliances are found in turn.
const TURNS: usize = 20;
/// From so many right-angled frames.
const STARTS: usize = 3;
/// Directions in which all deflections are smaller than this share of the largest do not tell a
/// rotation.
const FLAT: f64 = 1e-3;

/// The rotation of the file's deflections nearest to the model's with the compliances that fit the
/// deflections as `read`.
fn nearest_rotation(
    case: &Case<'_>,
    file: &[Measurement],
    read: &[Measurement],
) -> Option<Matrix3<f64>> {
    let all: Vec<usize> = (0..case.nominal.chain.len()).collect();
    let compliance = DVector::from_vec(most_probable(case, read)?);
    let arm = case.nominal.chain.at(case.tool);
    let mut correlation = Matrix3::zeros();
    for each in file {
        let mut state = arm.state(each.configuration_rad.as_slice());
        let [left, _] = state.brace_under(compliance.as_slice(), &each.load);
        let predicted = ObservationMatrix::new(&state, &each.load, &all).position * &compliance;
        let predicted = Vector3::new(predicted[0], predicted[1], predicted[2]) + left;
        let sigma = (each.sigma_m).map_or(case.sigma.weight_m(), |sigma| sigma.norm());
        correlation += predicted * each.deflection_m.transpose() / (sigma * sigma);
    }
    let svd = correlation.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    if svd.singular_values[1] < FLAT * svd.singular_values[0] {
        return None;
    }
    let parity = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * v_t).determinant()));
    Some(u * parity * v_t)
}
