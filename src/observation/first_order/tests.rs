//! The first-order form against the observation model and against differences.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3xX, Matrix6xX, Vector3};

use super::FirstOrder;
use crate::observation::{ObservationModel, ReadingKind, Setup};
use crate::parameter::arms::{Numbers, heavy, random, random_elastic, ur10};
use crate::parameter::{
    Axis, Backlash, ElasticArm, ParameterKind, ParameterSet, RangeNoise, ReadingSource, Stiffening,
    TransmissionError, arms,
};
use crate::robot::{Approach, KinematicState, Load};

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
        arm.stiffening.fill(Stiffening::NONE);
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

/// The same where joints stand off their springs as weight and load have it.
pub(in crate::observation) fn arms_off_springs(numbers: &mut Numbers) -> Vec<ElasticArm> {
    let mut arms = arms(numbers);
    for arm in &mut arms {
        // What an arm carries is then its own weight.
        arm.payload = None;
        for (joint, gap) in arm.backlash.iter_mut().enumerate() {
            gap.turned_over_at_nm = (joint % 3 != 1).then(|| numbers.between(30.0, 300.0));
        }
        for each in &mut arm.stiffening {
            each.at_nm = Some(numbers.between(500.0, 2000.0));
        }
    }
    arms
}

/// All of them.
pub(in crate::observation) fn all_arms(numbers: &mut Numbers) -> Vec<ElasticArm> {
    let mut all = arms(numbers);
    all.extend(arms_off_springs(numbers));
    all
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
        ReadingSource::TransmissionError(TransmissionError::independent(
            (0..arm.chain.len())
                .map(|_| numbers.between(0.0, 1e-2))
                .collect(),
        )),
        ReadingSource::Discrepancy(1e-5),
    ]
}

/// Two independent derivations of the same derivatives.
#[test]
fn derivatives_are_those_of_the_observation_model() {
    let mut numbers = Numbers(5);
    for arm in all_arms(&mut numbers) {
        let set = everything(&arm);
        let values = set.prior().mean.clone();
        let mut model = ObservationModel::new(&set, &arm, values.as_slice());
        let sizes = vec![1.0; set.len()];
        let mut first = FirstOrder::new(&arm, 0, &set, &sizes, 1e-5, &[]);
        for has_torque in [false, true] {
            let q = numbers.configuration(&arm.chain);
            let load = load(&mut numbers, has_torque);
            let mut expected = Matrix6xX::zeros(set.len());
            let joints = arm.chain.joints.iter();
            let commanded = joints.filter(|joint| joint.drive.passive_at.is_none());
            let sides = commanded.enumerate().map(|(index, _)| index % 2 == 0);
            let approach = has_torque.then(|| Approach(sides.collect()));
            first.come_from(approach.as_ref());
            let setup = Setup {
                commanded_rad: q.clone(),
                load,
                target: 0,
                station: 0,
                approach,
            };
            let prediction =
                model.predict_first_order(&setup, ReadingKind::Deflection, &mut expected);
            let mut found = Matrix3xX::zeros(set.len());
            stand(&mut first, &arm, q.as_slice());
            first.derivatives(&load, &mut found);
            assert!((first.deflection(&load) - prediction.position_m).norm() < 1e-13);
            for (index, parameter) in set.parameters().iter().enumerate() {
                let expected = expected.fixed_view::<3, 1>(0, index);
                let error = (found.column(index) - expected).norm();
                let allowed = 1e-10 * (expected.norm() + prediction.position_m.norm() * 1e-3);
                assert!(error <= allowed, "{}: {error}", parameter.name);
            }
        }
    }
}

/// A drift is seen as it is, in the instrument's frame and whatever is measured, and nothing of it is left at a test pose.
#[test]
fn drifts_are_seen_as_they_are() {
    let mut numbers = Numbers(18);
    for arm in arms(&mut numbers) {
        let kinds = Axis::ALL.map(|axis| ParameterKind::Drift { axis });
        let set = ParameterSet::new(&arm, kinds.map(|kind| (kind, Some(1e-5)))).expect("a set");
        let mut first = FirstOrder::new(&arm, 0, &set, &[1.0; 3], 1e-5, &[]);
        let q = numbers.configuration(&arm.chain);
        let load = load(&mut numbers, true);
        stand(&mut first, &arm, q.as_slice());
        let mut matrix = Matrix3xX::zeros(3);
        first.derivatives(&load, &mut matrix);
        assert!((&matrix - Matrix3xX::identity(3)).amax() == 0.0);
        first.uncompensated(&load, &mut matrix);
        assert!(matrix.amax() == 0.0);
        let setup = Setup {
            commanded_rad: q,
            load,
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
                    .predict_first_order(&setup, kind, &mut seen)
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
    for arm in arms(&mut numbers) {
        let axes = Axis::ALL.map(|axis| ParameterKind::TaskForce { axis });
        let kinds = [ParameterKind::TaskScale].into_iter().chain(axes);
        let set = ParameterSet::new(&arm, kinds.map(|kind| (kind, Some(0.1)))).expect("a set");
        let mut first = FirstOrder::new(&arm, 0, &set, &[1.0; 4], 1e-5, &[]);
        let q = numbers.configuration(&arm.chain);
        let load = load(&mut numbers, true);
        stand(&mut first, &arm, q.as_slice());
        let mut matrix = Matrix3xX::zeros(4);
        first.derivatives(&load, &mut matrix);
        assert!(matrix.iter().all(|value| *value == 0.0));
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
            let slope =
                (first.deflection(&changed(h)) - first.deflection(&changed(-h))) / (2.0 * h);
            assert!((slope - found).norm() < 1e-8 * first.deflection(&load).norm().max(1e-6));
        }
    }
}

/// Moves a model of an arm at its first tool to joint angles (rad).
pub(in crate::observation) fn stand(
    first: &mut FirstOrder<'_>,
    arm: &ElasticArm,
    q: &[f64],
) -> KinematicState {
    let state = arm.chain.at(&arm.tools[0]).state(q);
    first.stand(q, &state);
    state
}

/// trace(G A^T A) for a symmetric G, with the whitened derivatives A.
fn cost(first: &FirstOrder<'_>, load: &Load, weights: &DMatrix<f64>) -> f64 {
    let mut matrix = Matrix3xX::zeros(weights.nrows());
    first.observe(load, &mut matrix);
    (&matrix * weights * matrix.transpose()).trace()
}

/// The gradient of such a cost against central differences, for every kind of parameter and every source
/// alone and for all of them.
#[test]
fn gradients_are_those_of_differences() {
    let mut numbers = Numbers(6);
    for arm in arms(&mut numbers) {
        let (all, sources) = (everything(&arm), every_source(&mut numbers, &arm));
        let steady = |index: &usize| {
            let kind = all.parameters()[*index].kind;
            let is_wave = matches!(kind, ParameterKind::JointWave { .. });
            !is_wave && !matches!(kind, ParameterKind::JointStiffening { .. })
        };
        let all = all.subset(&(0..all.len()).filter(steady).collect::<Vec<_>>());
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
    let mut first = FirstOrder::new(arm, 0, set, &sizes, 2e-5, sources);
    let q = numbers.configuration(&arm.chain);
    let load = load(numbers, sources.len().is_multiple_of(2));
    let half = DMatrix::from_fn(set.len(), set.len(), |_, _| numbers.between(-1.0, 1.0));
    let weights = &half * half.transpose();
    stand(&mut first, arm, q.as_slice());
    let value = cost(&first, &load, &weights);
    let mut matrix = Matrix3xX::zeros(set.len());
    first.observe(&load, &mut matrix);
    let factor = &matrix * &weights * 2.0;
    let mut gradient = vec![0.0; q.len()];
    let of_force = first.pull_back(&load, &factor, &mut gradient);
    let mut slope = |at: &dyn Fn(f64) -> (DVector<f64>, Load), size: f64| {
        let mut central = |h: f64| {
            let mut value = |h: f64| {
                let (q, load) = at(h);
                stand(&mut first, arm, q.as_slice());
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
    for arm in arms(&mut numbers) {
        let set = ParameterSet::compliances(&arm, &[0]).expect("a set");
        let sources = every_source(&mut numbers, &arm);
        let mut first = FirstOrder::new(&arm, 0, &set, &[1.0], 3e-5, &sources);
        let q = numbers.configuration(&arm.chain);
        let load = load(&mut numbers, true);
        let state = stand(&mut first, &arm, q.as_slice());
        let by = |changed: &dyn Fn(f64) -> Load, h: f64| {
            (first.deflection(&changed(h)) - first.deflection(&changed(-h))) / (2.0 * h)
        };
        let mut expected = nalgebra::Matrix3::identity() * 9e-10;
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
        let mut moved = FirstOrder::new(&arm, 0, &set, &[1.0], 3e-5, &[]);
        for (joint, deviation) in gears.deviations.iter().enumerate() {
            let mut at = |h: f64| {
                let mut q = q.clone();
                q[joint] += h;
                stand(&mut moved, &arm, q.as_slice());
                moved.deflection(&load)
            };
            let column = (at(1e-4) - at(-1e-4)) / 2e-4 * *deviation;
            expected += column * column.transpose();
        }
        expected += nalgebra::Matrix3::identity() * discrepancy.powi(2);
        let error = (first.covariance(&load) - expected).amax();
        assert!(error < 1e-6 * expected.amax(), "{error}");
        // Of three repeats as of so many independent readings: what they share counts three times.
        let shared = first.covariance_shared([&load, &load]);
        first.set_repeats(3);
        let error = (first.covariance(&load) - expected - shared * 2.0).amax();
        assert!(error < 1e-6 * expected.amax(), "{error}");
    }
}
