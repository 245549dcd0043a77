//! Planned readings against the observation model, differences, and arms that are brought to rest.

use std::num::NonZeroU32;

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Matrix3xX, Matrix6, Matrix6xX, Vector3};

use super::PlannedReadings;
use crate::experiment::Experiment;
use crate::mujoco::TorqueLaw;
use crate::observation::{DeflectionPrecision, ObservationModel, ReadingKind, Setup};
use crate::parameter::arms::{Numbers, heavy, random, random_elastic, ur10};
use crate::parameter::{
    Axis, Backlash, ElasticArm, GearWave, ParameterKind, ParameterSet, RangeNoise, ReadingSource,
    TransmissionError, UnexplainedError, Unloaded, arms,
};
use crate::robot::{Elements, EquilibriumSolver, Load, Place, Spring};

pub(in crate::observation) const DEFLECTIONS: DeflectionPrecision = DeflectionPrecision {
    sigma_m: 3e-5,
    rotation_sigma_rad: None,
    unloaded: Unloaded::Own,
    along_sigma_m: None,
    along_step_m: 0.0,
    reads_all: true,
};
pub(in crate::observation) const ROTATIONS: DeflectionPrecision = DeflectionPrecision {
    sigma_m: 3e-5,
    rotation_sigma_rad: Some(2e-5),
    unloaded: Unloaded::Own,
    along_sigma_m: None,
    along_step_m: 0.0,
    reads_all: true,
};

pub(in crate::observation) fn configuration(numbers: &mut Numbers, arm: &ElasticArm) -> Vec<f64> {
    (0..arm.chain.len())
        .map(|_| numbers.between(-1.0, 1.0))
        .collect()
}

/// Arms as a scenario has them: no zeros, the instrument's frame that of the base; the tool last or in the
/// middle.
pub(in crate::observation) fn arms(numbers: &mut Numbers) -> Vec<ElasticArm> {
    let mut arms = vec![ur10(), heavy()];
    for joints in [2, 4, 7] {
        arms.push(random(numbers, joints));
        arms.push(random_elastic(numbers, joints));
    }
    for arm in &mut arms {
        arm.zero_rad.fill(0.0);
        // The side of approach alone decides, and joints are springs.
        arm.backlash.fill(Backlash::NONE);
        arm.stiffening.fill(TorqueLaw::SPRING);
        arm.instrument_from_base = vec![Isometry3::identity()];
        arm.load_scale = 1.0;
        // Long enough lists of compliances above zero for logarithms.
        for k in &mut arm.compliance_rad_per_nm {
            *k = k.max(1e-7);
        }
    }
    let mut middle = arms[4].clone();
    middle.tools.swap(0, 1);
    arms.push(middle);
    arms
}

/// The same without springs beside the joints' own.
fn bare_arms(numbers: &mut Numbers) -> Vec<ElasticArm> {
    let mut arms = arms(numbers);
    for arm in &mut arms {
        arm.chain.elements = Elements::default();
    }
    arms
}

pub(in crate::observation) fn load(numbers: &mut Numbers, has_torque: bool) -> Load {
    Load {
        force_n: numbers.vector(900.0),
        torque_nm: numbers.vector(if has_torque { 200.0 } else { 0.0 }),
    }
}

pub(in crate::observation) fn everything(arm: &ElasticArm) -> ParameterSet {
    let kinds = arms::everything(arm).into_iter().enumerate();
    let unknowns = kinds.map(|(index, kind)| (kind, (index % 2 == 0).then_some(0.1)));
    ParameterSet::new(arm, unknowns).expect("a set")
}

pub(in crate::observation) fn every_source(
    numbers: &mut Numbers,
    arm: &ElasticArm,
) -> Vec<ReadingSource> {
    vec![
        ReadingSource::JointRepeatability(
            (0..arm.chain.len())
                .map(|_| numbers.between(0.0, 1e-4))
                .collect(),
        ),
        ReadingSource::LoadDirection(0.02),
        ReadingSource::LoadPoint(0.05),
        ReadingSource::Range(RangeNoise {
            from_m: numbers.vector(3.0),
            per_metre: 2e-5,
            along_per_metre: 5e-6,
        }),
        ReadingSource::TransmissionError(TransmissionError {
            deviations: (0..arm.chain.len())
                .map(|_| numbers.between(0.0, 1e-2))
                .collect(),
            kernel: None,
        }),
        ReadingSource::Discrepancy(UnexplainedError {
            deviation_m: 1e-5,
            of: None,
        }),
    ]
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

/// The deflection (m) at an arm's first tool, to first order in compliance.
fn deflection(arm: &ElasticArm, q: &[f64], load: &Load) -> Vector3<f64> {
    let (nothing, mut ignored) = (ParameterSet::empty(), Matrix6xX::zeros(0));
    let setup = Setup {
        commanded_rad: DVector::from_column_slice(q),
        load: *load,
        hangs_on: None,
        target: 0,
        station: 0,
        approach: None,
    };
    ObservationModel::new(&nothing, arm, &[])
        .predict_first_order(None, &setup, ReadingKind::Deflection, &mut ignored)
        .position_m
}

/// trace(G A^T A) for a symmetric G, with the whitened derivatives A.
fn cost(readings: &PlannedReadings<'_>, load: &Load, weights: &DMatrix<f64>) -> f64 {
    let size = weights.nrows();
    let mut matrix = Matrix3xX::zeros(readings.rows() / 3 * size);
    readings.observe(load, &mut matrix);
    let blocks = (0..readings.rows() / 3).map(|block| matrix.columns(block * size, size));
    blocks
        .map(|rows| (rows * weights * rows.transpose()).trace())
        .sum()
}

/// A drift is seen as it is, in the instrument's frame and whatever is measured, and nothing of it is left at a test pose.
#[test]
fn drifts_are_seen_as_they_are() {
    let mut numbers = Numbers(18);
    for arm in bare_arms(&mut numbers) {
        let kinds = Axis::ALL.map(|axis| ParameterKind::Drift { axis });
        let set = ParameterSet::new(&arm, kinds.map(|kind| (kind, Some(1e-5)))).expect("a set");
        let mut first = PlannedReadings::new(&arm, 0, &set, &[1.0; 3], DEFLECTIONS, &[]);
        let q = numbers.configuration(&arm.chain);
        let load = load(&mut numbers, true);
        first.move_to(q.as_slice());
        let (mut rows, mut matrix) = (Matrix6xX::zeros(3), Matrix3xX::zeros(3));
        first.derivatives(&load, &mut rows);
        assert!((rows.fixed_rows::<3>(0) - Matrix3xX::identity(3)).amax() == 0.0);
        first.uncompensated(&load, &mut matrix);
        assert!(matrix.amax() == 0.0);
        let setup = Setup {
            commanded_rad: q,
            load,
            hangs_on: None,
            target: 0,
            station: 0,
            approach: None,
        };
        let drift = numbers.vector(1e-4);
        for kind in [
            ReadingKind::Deflection,
            ReadingKind::DeflectionAndRotation,
            ReadingKind::Position,
        ] {
            let mut seen = Matrix6xX::zeros(3);
            let mut at = |values: Vector3<f64>| {
                let mut model = ObservationModel::new(&set, &arm, values.as_slice());
                model
                    .predict_first_order(None, &setup, kind, &mut seen)
                    .position_m
            };
            let moved = at(drift) - at(Vector3::zeros());
            let expected = if kind.is_deflection() { 1.0 } else { 0.0 };
            assert!((moved - drift * expected).norm() < 1e-15);
            let expected = Matrix3xX::identity(3) * expected;
            assert!((seen.fixed_rows::<3>(0) - expected).amax() == 0.0);
            assert!(seen.fixed_rows::<3>(3).amax() == 0.0);
        }
    }
}

/// The task's force does not show in readings, and changes what is left at a test pose as more load does.
#[test]
fn the_tasks_force_acts_at_test_poses_alone() {
    let mut numbers = Numbers(8);
    for arm in bare_arms(&mut numbers) {
        let axes = Axis::ALL.map(|axis| ParameterKind::TaskForce { axis });
        let kinds = [ParameterKind::TaskScale].into_iter().chain(axes);
        let set = ParameterSet::new(&arm, kinds.map(|kind| (kind, Some(0.1)))).expect("a set");
        let mut first = PlannedReadings::new(&arm, 0, &set, &[1.0; 4], DEFLECTIONS, &[]);
        let q = numbers.configuration(&arm.chain);
        let load = load(&mut numbers, true);
        first.move_to(q.as_slice());
        let (mut rows, mut matrix) = (Matrix6xX::zeros(4), Matrix3xX::zeros(4));
        first.derivatives(&load, &mut rows);
        assert!(rows.fixed_rows::<3>(0).iter().all(|value| *value == 0.0));
        first.uncompensated(&load, &mut matrix);
        for (column, found) in matrix.column_iter().enumerate() {
            let changed = |h: f64| match column {
                0 => load.scaled(h.exp()),
                axis => Load {
                    force_n: load.force_n + Vector3::ith(axis - 1, h),
                    ..load
                },
            };
            let h = 1e-5;
            let at = |h: f64| deflection(&arm, q.as_slice(), &changed(h));
            let slope = (at(h) - at(-h)) / (2.0 * h);
            assert!((slope - found).norm() < 1e-8 * at(0.0).norm().max(1e-6));
        }
    }
}

/// The gradient of such a cost against central differences, for every kind of parameter and every source
/// alone and for all of them.
#[test]
fn gradients_are_those_of_differences() {
    let mut numbers = Numbers(6);
    for arm in bare_arms(&mut numbers) {
        let (all, sources) = (everything(&arm), every_source(&mut numbers, &arm));
        let steady = |index: &usize| {
            let kind = all.parameters()[*index].kind;
            let is_wave = matches!(kind, ParameterKind::JointWave { .. });
            !is_wave && !matches!(kind, ParameterKind::JointStiffening { .. })
        };
        let all = all.subset(&(0..all.len()).filter(steady).collect::<Vec<_>>());
        let err = |source: &ReadingSource| matches!(source, ReadingSource::TransmissionError(_));
        let sources: Vec<ReadingSource> = sources.into_iter().filter(|each| !err(each)).collect();
        let each_parameter = (0..all.len()).map(|index| (vec![index], Vec::new()));
        let each_source = (sources.iter()).map(|source| {
            let compliances = (0..all.len()).filter(|&index| {
                matches!(
                    all.parameters()[index].kind,
                    ParameterKind::JointCompliance { .. }
                )
            });
            (compliances.collect(), vec![source.clone()])
        });
        let everything = ((0..all.len()).collect(), sources.clone());
        let cases: Vec<(Vec<usize>, Vec<ReadingSource>)> = each_parameter
            .chain(each_source)
            .chain([everything])
            .collect();
        for (indices, sources) in cases {
            assert_gradient(&mut numbers, &arm, &all.subset(&indices), &sources);
        }
    }
}

/// Differences are as precise as the cost.
fn assert_gradient(
    numbers: &mut Numbers,
    arm: &ElasticArm,
    set: &ParameterSet,
    sources: &[ReadingSource],
) {
    let sizes: Vec<f64> = (set.parameters().iter())
        .map(|each| each.kind.typical_size(arm, each.is_logarithmic))
        .collect();
    let mut first = PlannedReadings::new(arm, 0, set, &sizes, DEFLECTIONS, sources);
    let q = numbers.configuration(&arm.chain);
    let load = load(numbers, sources.len().is_multiple_of(2));
    let half = DMatrix::from_fn(set.len(), set.len(), |_, _| numbers.between(-1.0, 1.0));
    let weights = &half * half.transpose();
    first.move_to(q.as_slice());
    let value = cost(&first, &load, &weights);
    let mut matrix = Matrix3xX::zeros(set.len());
    first.observe(&load, &mut matrix);
    let factor = &matrix * &weights * 2.0;
    let mut gradient = vec![0.0; q.len()];
    first.pull_back(&load, &factor, &mut gradient);
    let of_force = first.force_gradient(&load, &factor);
    let mut slope = |at: &dyn Fn(f64) -> (DVector<f64>, Load), size: f64| {
        let mut central = |h: f64| {
            let mut value = |h: f64| {
                let (q, load) = at(h);
                first.move_to(q.as_slice());
                cost(&first, &load, &weights)
            };
            (value(h) - value(-h)) / (2.0 * h)
        };
        let h = 5e-4 * size;
        (central(h) * 4.0 - central(2.0 * h)) / 3.0
    };
    let names: Vec<&str> = set.parameters().iter().map(|each| &*each.name).collect();
    let size = value.abs().max(1e-12);
    for joint in 0..q.len() {
        let at = |h: f64| {
            let mut q = q.clone();
            q[joint] += h;
            (q, load)
        };
        let error = (slope(&at, 1.0) - gradient[joint]).abs();
        assert!(
            error < 1e-6 * size,
            "{names:?} {sources:?} joint {joint}: {error}"
        );
    }
    for axis in 0..3 {
        let at = |h: f64| {
            let mut load = load;
            load.force_n += Vector3::ith(axis, h);
            (q.clone(), load)
        };
        let error = (slope(&at, 100.0) - of_force[axis]).abs();
        assert!(
            error < 1e-6 * size,
            "{names:?} {sources:?} force {axis}: {error}"
        );
    }
}

/// The covariance is that of deflections whose joints, loads and readings are changed at random as the
/// sources say, to first order: with their derivatives by differences.
#[test]
fn covariances_are_those_of_what_changes() {
    let mut numbers = Numbers(7);
    for arm in bare_arms(&mut numbers) {
        let set = ParameterSet::compliances(&arm, &[0]).expect("a set");
        let sources = every_source(&mut numbers, &arm);
        let mut first = PlannedReadings::new(&arm, 0, &set, &[1.0], DEFLECTIONS, &sources);
        let q = numbers.configuration(&arm.chain);
        let load = load(&mut numbers, true);
        first.move_to(q.as_slice());
        let state = first.state().clone();
        let by = |changed: &dyn Fn(f64) -> Load, h: f64| {
            let at = |h: f64| deflection(&arm, q.as_slice(), &changed(h));
            (at(h) - at(-h)) / (2.0 * h)
        };
        let mut expected = Matrix3::zeros();
        for axis in 0..3 {
            let unit = Vector3::ith(axis, 1.0);
            let turned = |h: f64| {
                let turn = nalgebra::Rotation3::new(unit * h);
                Load {
                    force_n: turn * load.force_n,
                    torque_nm: turn * load.torque_nm,
                }
            };
            let shifted = |h: f64| Load {
                torque_nm: load.torque_nm + (unit * h).cross(&load.force_n),
                ..load
            };
            for (column, deviation) in [(by(&turned, 1e-4), 0.02), (by(&shifted, 1e-3), 0.05)] {
                expected += column * column.transpose() * f64::powi(deviation, 2);
            }
        }
        let ReadingSource::JointRepeatability(deviations) = &sources[0] else {
            panic!("returning joints come first");
        };
        for (joint, deviation) in deviations.iter().enumerate() {
            let column = state.position_column(joint) * *deviation;
            expected += column * column.transpose();
        }
        let ReadingSource::Range(range) = &sources[3] else {
            panic!("then the range");
        };
        // Axes of which the first is the line of sight.
        let apart = state.tool_position - range.from_m;
        let across = apart.cross(&Vector3::x()).normalize();
        for (axis, per_metre) in [
            (apart.normalize(), range.along_per_metre),
            (across, range.per_metre),
            (apart.normalize().cross(&across), range.per_metre),
        ] {
            let column = axis * (apart.norm() * per_metre);
            expected += column * column.transpose();
        }
        let (ReadingSource::TransmissionError(gears), ReadingSource::Discrepancy(discrepancy)) =
            (&sources[4], &sources[5])
        else {
            panic!("gears and discrepancy come last");
        };
        // The deflection where a joint stands elsewhere, loaded and unloaded.
        for (joint, deviation) in gears.deviations.iter().enumerate() {
            let at = |h: f64| {
                let mut q = q.clone();
                q[joint] += h;
                deflection(&arm, q.as_slice(), &load)
            };
            let column = (at(1e-4) - at(-1e-4)) / 2e-4 * *deviation;
            expected += column * column.transpose();
        }
        expected += Matrix3::identity() * discrepancy.deviation_m.powi(2);
        let covariance = |readings: &PlannedReadings<'_>| -> Matrix3<f64> {
            let all = readings.covariance_of_all(&load);
            all.fixed_view::<3, 3>(0, 0).into_owned()
        };
        let error = (covariance(&first) - expected).amax();
        assert!(error < 1e-6 * expected.amax(), "{error}");
        // Of three repeats as of so many independent readings: what they share counts three times.
        let shared = first.covariance_shared([(&load, None); 2]);
        let shared = shared.fixed_view::<3, 3>(0, 0).into_owned();
        first.set_repeats(3);
        let error = (covariance(&first) - expected - shared * 2.0).amax();
        assert!(error < 1e-6 * expected.amax(), "{error}");
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
        let mut observed = PlannedReadings::new(&arm, 0, &set, &sizes, ROTATIONS, &sources);
        observed.move_to(&configuration(numbers, &arm));
        let load = load(numbers, true);
        let mut rows = Matrix6xX::zeros(set.len());
        observed.derivatives(&load, &mut rows);
        let covariance: Matrix6<f64> = ROTATIONS.covariance() + observed.covariance_of_all(&load);
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
        let mut observed = PlannedReadings::new(&arm, 0, &set, &sizes, ROTATIONS, &[]);
        let q = configuration(numbers, &arm);
        let load = load(numbers, true);
        observed.move_to(&q);
        let mut rows = Matrix6xX::zeros(set.len());
        observed.derivatives(&load, &mut rows);
        let nominal: Vec<f64> = set.parameters().iter().map(|each| each.nominal).collect();
        let setup = Setup {
            commanded_rad: DVector::from_vec(q),
            load,
            hangs_on: None,
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
                    .predict_as_planned(None, &setup, kind, &mut unused)
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
    for number in 0..10 {
        let (mut arm, mut set) = with_a_spring(numbers);
        if number % 2 == 0 {
            // Without springs the closed form is asked.
            arm.chain.elements = Elements::default();
            arm.chain.gravity_m_s2 = Vector3::zeros();
            set = set.subset(&[0, 1, 2, 3, 4, 7]);
        }
        let sizes = vec![1.0; set.len()];
        let mut observed = PlannedReadings::new(&arm, 0, &set, &sizes, DEFLECTIONS, &[]);
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

/// What gauges along several directions read in one configuration shares errors as the coordinates do that a tracker would read there.
#[test]
fn directions_of_one_configuration_share_errors() {
    let mut numbers = Numbers(77);
    let along_sigma_m = 7e-6;
    let gauge = DeflectionPrecision {
        along_sigma_m: Some(along_sigma_m),
        ..DEFLECTIONS
    };
    for arm in bare_arms(&mut numbers) {
        let set = ParameterSet::compliances(&arm, &[0, 1]).expect("a set");
        let sources: Vec<ReadingSource> = (every_source(&mut numbers, &arm).into_iter())
            .filter(|source| source.is_of_deflection(true) && source.is_of_deflection(false))
            .collect();
        let q = configuration(&mut numbers, &arm);
        let directions = [Vector3::x(), Vector3::z(), Vector3::new(0.6, 0.0, 0.8)];
        let read = directions.map(|direction| Experiment {
            configuration_rad: DVector::from_column_slice(&q),
            load: load(&mut numbers, false),
            repeats: 1,
            approach: None,
            direction: Some(direction),
        });
        let read: Vec<&Experiment> = read.iter().collect();
        let whole = read.iter().map(|each| Experiment {
            direction: None,
            ..(*each).clone()
        });
        let whole: Vec<Experiment> = whole.collect();
        let whole: Vec<&Experiment> = whole.iter().collect();
        let [mut along, mut all] = [gauge, DEFLECTIONS].map(|precision| {
            let mut readings = PlannedReadings::new(&arm, 0, &set, &[1e-6; 2], precision, &sources);
            readings.stand_at(read[0]);
            readings
        });
        let mut shown = DMatrix::zeros(3, 9);
        for (place, direction) in directions.iter().enumerate() {
            (shown.fixed_view_mut::<1, 3>(place, 3 * place)).copy_from(&direction.transpose());
        }
        let seen = &shown * all.derivatives_together(&whole);
        let sources = all.covariance_together(&whole).sources;
        let sources = (sources.iter()).fold(DMatrix::zeros(9, 9), |sum, source| sum + source);
        let covariance =
            &shown * sources * shown.transpose() + DMatrix::identity(3, 3) * along_sigma_m.powi(2);
        let inverse = covariance.try_inverse().expect("regular");
        let expected = seen.transpose() * inverse * seen;
        let told = along.observe_together(&read);
        let told = (told.iter()).fold(DMatrix::zeros(2, 2), |sum, rows| sum + rows.tr_mul(rows));
        let error = (&told - &expected).amax();
        assert!(error < 1e-9 * expected.amax(), "{told} {expected}");
    }
}
