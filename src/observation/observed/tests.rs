//! What is planned by the observation model against the closed form, against differences, and against an arm that is
//! brought to rest.

use std::num::NonZeroU32;

use nalgebra::{DMatrix, DVector, Matrix3xX, Matrix6, Matrix6xX, Vector3};

use super::{DeflectionPrecision, ObservedRows};
use crate::observation::first_order::tests::{
    all_arms, arms, every_source, everything, load, stand,
};
use crate::observation::{FirstOrder, ObservationModel, PlannedReadings, ReadingKind, Setup};
use crate::parameter::arms::{Numbers, random_elastic};
use crate::parameter::{ElasticArm, GearWave, ParameterKind, ParameterSet, Unloaded};
use crate::robot::{EquilibriumSolver, Load, Place, Spring};

pub(in crate::observation) const DEFLECTIONS: DeflectionPrecision = DeflectionPrecision {
    sigma_m: 3e-5,
    rotation_sigma_rad: None,
    unloaded: Unloaded::Own,
};
pub(in crate::observation) const ROTATIONS: DeflectionPrecision = DeflectionPrecision {
    sigma_m: 3e-5,
    rotation_sigma_rad: Some(2e-5),
    unloaded: Unloaded::Own,
};

pub(in crate::observation) fn configuration(numbers: &mut Numbers, arm: &ElasticArm) -> Vec<f64> {
    (0..arm.chain.len())
        .map(|_| numbers.between(-1.0, 1.0))
        .collect()
}

/// How the sum of a factor times the whitened rows follows joints and the force, by differences.
pub(in crate::observation) fn differences(
    observed: &mut ObservedRows<'_>,
    q: &[f64],
    load: &Load,
    factor: &Matrix3xX<f64>,
) -> (Vec<f64>, Vector3<f64>) {
    let mut rows = Matrix3xX::zeros(factor.ncols());
    let mut slope = |changed: &dyn Fn(f64) -> (Vec<f64>, Load), shift: f64| {
        let mut at = |shift: f64| {
            let (q, load) = changed(shift);
            observed.move_to(&q);
            observed.observe(&load, &mut rows);
            factor.dot(&rows)
        };
        (at(shift) - at(-shift)) / (2.0 * shift)
    };
    let by_joint = |joint: usize| {
        let moved = |shift: f64| {
            let mut q = q.to_vec();
            q[joint] += shift;
            (q, *load)
        };
        slope(&moved, 1e-5)
    };
    let by_joints = (0..q.len()).map(by_joint).collect();
    let by_force = Vector3::from_fn(|axis, _| {
        let changed = |shift: f64| {
            let mut load = *load;
            load.force_n[axis] += shift;
            (q.to_vec(), load)
        };
        slope(&changed, 1e-3 * load.force_n.norm().max(1.0))
    });
    (by_joints, by_force)
}

/// A compensator between the base and a link, and parameters that it has a part in.
pub(in crate::observation) fn with_a_spring(numbers: &mut Numbers) -> (ElasticArm, ParameterSet) {
    let mut arm = random_elastic(numbers, 4);
    arm.zero_rad.fill(0.0);
    arm.instrument_from_base = vec![nalgebra::Isometry3::identity()];
    arm.load_scale = 1.0;
    for joint in &mut arm.chain.joints {
        joint.drive.slides = false;
        joint.drive.passive_at = None;
    }
    arm.compliance_rad_per_nm = vec![2e-6, 1e-6, 3e-6, 4e-6];
    let place = |joints, x, z| Place {
        joints,
        position_m: Vector3::new(x, 0.1, z),
    };
    arm.chain.elements = crate::robot::Elements::default();
    arm.chain.elements.springs = vec![Spring {
        name: "compensator".to_owned(),
        stiffness_n_per_m: 2e5,
        rest_m: [0.3, 0.3],
        path: vec![place(0, 0.4, 0.2), place(2, 0.1, 0.3)],
    }];
    let kinds = [
        (ParameterKind::JointCompliance { joint: 1 }, None),
        (ParameterKind::JointCompliance { joint: 2 }, Some(0.1)),
        (ParameterKind::JointZero { joint: 1 }, Some(1e-3)),
        // The load turns it over its gap.
        (ParameterKind::JointBacklash { joint: 2 }, Some(1e-4)),
        // A wave that changes within what compensation moves the joint.
        (
            ParameterKind::JointWave {
                joint: 2,
                wave: GearWave::both(NonZeroU32::MIN.saturating_add(39))[0],
            },
            Some(1e-4),
        ),
        (ParameterKind::SpringStiffness { spring: 0 }, Some(0.1)),
        (ParameterKind::SpringRest { spring: 0 }, Some(1e-2)),
        (ParameterKind::LoadScale, Some(0.01)),
    ];
    let set = ParameterSet::new(&arm, kinds).expect("a set");
    (arm, set)
}

/// Two ways to the same rows, covariances and derivatives: what is not closed is not another model.
#[test]
fn deflections_are_those_of_the_closed_form() {
    let numbers = &mut Numbers(41);
    for arm in all_arms(numbers) {
        if arm.chain.elements.has_springs() {
            continue;
        }
        let set = everything(&arm);
        let sizes = vec![0.7; set.len()];
        let sources = every_source(numbers, &arm);
        let mut closed = FirstOrder::new(&arm, 0, &set, &sizes, DEFLECTIONS.sigma_m, &sources);
        let mut observed = ObservedRows::new(&arm, 0, &set, &sizes, DEFLECTIONS, &sources);
        let q = configuration(numbers, &arm);
        let load = load(numbers, true);
        closed.set_repeats(3);
        observed.set_repeats(3);
        stand(&mut closed, &arm, &q);
        observed.move_to(&q);
        for source in 0..sources.len() {
            let expected = closed.covariance_of(source, &load);
            let found = observed.covariance_of(source, &load);
            let error = (found.fixed_view::<3, 3>(0, 0) - expected).norm() / expected.norm();
            assert!(error < 1e-9, "{source}: {error}");
        }
        let mut expected = Matrix3xX::zeros(set.len());
        let mut found = expected.clone();
        closed.observe(&load, &mut expected);
        observed.observe(&load, &mut found);
        assert!((&found - &expected).norm() < 1e-8 * expected.norm());
    }
}

/// Gradients in closed form are those of differences, which the others are.
#[test]
fn closed_gradients_are_those_of_differences() {
    let numbers = &mut Numbers(45);
    for arm in arms(numbers) {
        if arm.chain.elements.has_springs() {
            continue;
        }
        let set = everything(&arm);
        let is_closed = |index: &usize| {
            let kind = set.parameters()[*index].kind;
            let is_wave = matches!(kind, ParameterKind::JointWave { .. });
            !is_wave && !matches!(kind, ParameterKind::JointStiffening { .. })
        };
        let set = set.subset(&(0..set.len()).filter(is_closed).collect::<Vec<_>>());
        let sizes = vec![0.7; set.len()];
        let sources = every_source(numbers, &arm);
        let mut planned = PlannedReadings::new(&arm, 0, &set, &sizes, DEFLECTIONS, &sources);
        let mut whole = ObservedRows::new(&arm, 0, &set, &sizes, DEFLECTIONS, &sources);
        let q = configuration(numbers, &arm);
        let load = load(numbers, true);
        planned.move_to(&q);
        let mut rows = Matrix3xX::zeros(set.len());
        planned.observe(&load, &mut rows);
        let symmetric = DMatrix::from_fn(set.len(), set.len(), |row, column| {
            ((row + 2 * column) % 5 + (2 * row + column) % 5) as f64 / 10.0
        });
        let factor = &rows * symmetric;
        let mut found = vec![0.0; q.len()];
        planned.pull_back(&load, &factor, &mut found);
        let (expected, of_force) = differences(&mut whole, &q, &load, &factor);
        let [found, expected] = [found, expected].map(DVector::from_vec);
        let error = (found - &expected).norm() / expected.norm();
        assert!(error < 1e-4, "{error}");
        let error = (planned.force_gradient(&load, &factor) - of_force).norm() / of_force.norm();
        assert!(error < 1e-4, "{error}");
    }
}

/// Rotations: whitened rows tell as much as the rows with the covariance of all six, and gears' errors move both.
#[test]
fn rotations_have_the_covariance_of_all_rows() {
    let numbers = &mut Numbers(42);
    for arm in arms(numbers) {
        let set = everything(&arm);
        let sizes = vec![1.0; set.len()];
        let sources = every_source(numbers, &arm);
        let mut observed = ObservedRows::new(&arm, 0, &set, &sizes, ROTATIONS, &sources);
        observed.move_to(&configuration(numbers, &arm));
        let load = load(numbers, true);
        let mut rows = Matrix6xX::zeros(set.len());
        observed.derivatives(&load, &mut rows);
        let covariance: Matrix6<f64> = ROTATIONS.covariance()
            + (0..sources.len())
                .map(|source| observed.covariance_of(source, &load))
                .sum::<Matrix6<f64>>();
        let inverse = covariance.try_inverse().expect("regular");
        let expected = rows.transpose() * inverse * &rows;
        let mut matrix = Matrix3xX::zeros(2 * set.len());
        observed.observe(&load, &mut matrix);
        let [moved, turned] = [0, 1].map(|block| matrix.columns(block * set.len(), set.len()));
        let found = moved.tr_mul(&moved) + turned.tr_mul(&turned);
        assert!((&found - &expected).norm() < 1e-6 * expected.norm());
    }
}

/// With a spring, derivatives are those of an arm that is brought to rest with other parameters.
#[test]
fn springs_are_seen_at_rest() {
    let numbers = &mut Numbers(43);
    for _ in 0..5 {
        let (arm, set) = with_a_spring(numbers);
        let sizes = vec![1.0; set.len()];
        let mut observed = ObservedRows::new(&arm, 0, &set, &sizes, ROTATIONS, &[]);
        let q = configuration(numbers, &arm);
        let load = load(numbers, true);
        observed.move_to(&q);
        let mut rows = Matrix6xX::zeros(set.len());
        observed.derivatives(&load, &mut rows);
        let nominal: Vec<f64> = set.parameters().iter().map(|each| each.nominal).collect();
        let setup = Setup {
            commanded_rad: DVector::from_vec(q),
            load,
            target: 0,
            station: 0,
            approach: None,
        };
        for (index, parameter) in set.parameters().iter().enumerate() {
            let shift = 1e-4 * parameter.scale;
            let at = |shift: f64| {
                let mut values = nominal.clone();
                values[index] += shift;
                let mut model = ObservationModel::new(&set, &arm, &values);
                let mut unused = Matrix6xX::zeros(set.len());
                let kind = ReadingKind::DeflectionAndRotation;
                model
                    .predict_as_planned(&setup, kind, &mut unused)
                    .position_m
            };
            let expected = (at(shift) - at(-shift)) / (2.0 * shift);
            let found = rows.column(index).fixed_rows::<3>(0).into_owned();
            let error = (found - expected).norm();
            let room = 1e-6 * expected.norm() + 1e-10 / parameter.scale;
            assert!(error < room, "{}: {found} {expected}", parameter.name);
        }
    }
}

/// What compensation leaves, seen by bringing arms to rest: the rows of a test pose.
#[test]
fn what_compensation_leaves_is_what_the_arm_shows() {
    let numbers = &mut Numbers(44);
    for _ in 0..5 {
        let (arm, set) = with_a_spring(numbers);
        let mut observed =
            ObservedRows::new(&arm, 0, &set, &vec![1.0; set.len()], DEFLECTIONS, &[]);
        let q = configuration(numbers, &arm);
        let load = load(numbers, false);
        observed.move_to(&q);
        let mut rows = Matrix3xX::zeros(set.len());
        observed.uncompensated(&load, &mut rows);
        let nominal: Vec<f64> = set.parameters().iter().map(|each| each.nominal).collect();
        let rest = |truth: &ElasticArm, commanded: &[f64], load: &Load| {
            let chain = truth.loaded_chain();
            let mut solver = EquilibriumSolver::new(chain.len());
            let mut at_tool = chain.at(&truth.tools[0]);
            let offsets = truth.offsets_rad(commanded, 0, load, None);
            let commanded: Vec<f64> = (commanded.iter().zip(offsets))
                .map(|(q, offset)| q + offset)
                .collect();
            let compliance = &truth.compliance_rad_per_nm;
            (solver.solve(&mut at_tool, compliance, &commanded, load)).expect("a rest");
            solver.state().clone()
        };
        // The robot is nominal; what is believed of it, and compensated, is not.
        for (index, parameter) in set.parameters().iter().enumerate() {
            let shift = 1e-3 * parameter.scale;
            let left = |shift: f64| {
                let mut values = nominal.clone();
                values[index] += shift;
                let believed = set.apply(&arm, &values);
                let state = rest(&believed, &q, &Load::NONE);
                let crossed =
                    [&load, &Load::NONE].map(|load| believed.offsets_rad(&q, 0, load, None));
                let commanded: Vec<f64> = (q.iter().enumerate())
                    .map(|(joint, q)| {
                        let back = (crossed[0][joint] - crossed[1][joint])
                            + believed.compliance_rad_per_nm[joint]
                                * state.load_torque(joint, &load);
                        let wanted = q + believed.transmission_error_rad(joint, *q) - back;
                        believed.before_gear(joint, wanted)
                    })
                    .collect();
                rest(&arm, &commanded, &load).tool_position
            };
            // The error of the estimate is the estimate less the truth.
            let seen = -(left(shift) - left(-shift)) / (2.0 * shift);
            let found = rows.column(index).into_owned();
            let largest = rows.column_iter().zip(set.parameters());
            let largest = largest.map(|(column, each)| column.norm() * each.scale);
            let room = 0.02 * found.norm() + 1e-3 * largest.fold(0.0, f64::max) / parameter.scale;
            assert!(
                (seen - found).norm() < room,
                "{}: {found} {seen}",
                parameter.name
            );
        }
    }
}
