//! What is planned of compliances alone against the observation model: what is closed is not another model.

use nalgebra::{DMatrix, Matrix3xX, Matrix6xX, Vector3};

use crate::observation::planned::tests::{DEFLECTIONS, ROTATIONS, arms, configuration, load};
use crate::observation::{BareArm, DeflectionPrecision, PlannedReadings};
use crate::parameter::arms::Numbers;
use crate::parameter::{ElasticArm, ParameterSet};
use crate::robot::{Elements, Load};

/// Compares the two at joint angles, to a share of what is seen; derivatives by joints and forces are asked for with the
/// factor that a cost of the information has.
fn compare(
    numbers: &mut Numbers,
    (arm, q): (&ElasticArm, &[f64]),
    load: &Load,
    precision: DeflectionPrecision,
    room: f64,
) {
    let joints: Vec<usize> = (0..arm.chain.len()).rev().collect();
    let (count, set) = (
        joints.len(),
        ParameterSet::compliances(arm, &joints).expect("a set"),
    );
    let sizes: Vec<f64> = (0..count).map(|_| numbers.between(1e-6, 3e-6)).collect();
    let bare = BareArm {
        chain: &arm.chain,
        compliance_rad_per_nm: &arm.compliance_rad_per_nm,
        tool: &arm.tools[0],
    };
    let mut closed = PlannedReadings::of_compliances(bare, &joints, &sizes, precision);
    let mut observed = PlannedReadings::new(arm, 0, &set, &sizes, precision, &[]);
    closed.move_to(q);
    observed.move_to(q);
    let agree = |what: &str, found: &[f64], expected: &[f64], room: f64| {
        let size = expected
            .iter()
            .fold(0.0_f64, |size, each| size.max(each.abs()));
        for (found, expected) in found.iter().zip(expected) {
            let apart = (found - expected).abs();
            assert!(apart <= room * size, "{what}: {apart:.1e} of {size:.1e}");
        }
    };
    let [mut found, mut expected] = [0, 1].map(|_| Matrix6xX::zeros(count));
    closed.derivatives(load, &mut found);
    observed.derivatives(load, &mut expected);
    let rows = precision.rows();
    for (found, expected) in found.column_iter().zip(expected.column_iter()) {
        agree(
            "rows",
            &found.as_slice()[..rows],
            &expected.as_slice()[..rows],
            room,
        );
    }
    let of_loads = found.fixed_rows::<3>(0).into_owned();
    let [mut whitened, mut expected] = [0, 1].map(|_| Matrix3xX::zeros(rows / 3 * count));
    closed.observe(load, &mut whitened);
    observed.observe(load, &mut expected);
    agree("whitened", whitened.as_slice(), expected.as_slice(), room);
    let [mut found, mut expected] = [0, 1].map(|_| Matrix3xX::zeros(count));
    closed.uncompensated(load, &mut found);
    observed.uncompensated(load, &mut expected);
    agree("uncompensated", found.as_slice(), expected.as_slice(), room);
    if arm.chain.elements.has_springs() {
        // It is another matrix than that of a deflection under the same load.
        assert!((found - &of_loads).amax() > 10.0 * room * of_loads.amax());
        // Of derivatives, the one asks what follows the commanded angles, the other where the arm then rests.
        return;
    }
    let half = DMatrix::from_fn(count, count, |_, _| numbers.between(-1.0, 1.0));
    let weights = &half * half.transpose();
    let mut factor = whitened.clone();
    for block in 0..rows / 3 {
        let product = whitened.columns(block * count, count) * &weights;
        factor.columns_mut(block * count, count).copy_from(&product);
    }
    let mut found = vec![0.0; count];
    closed.pull_back(load, &factor, &mut found);
    let mut expected = vec![0.0; count];
    observed.pull_back(load, &factor, &mut expected);
    agree("by joints", &found, &expected, room.max(1e-5));
    let of_force = observed.force_gradient(load, &factor);
    let found = closed.force_gradient(load, &factor);
    agree(
        "by the force",
        found.as_slice(),
        of_force.as_slice(),
        room.max(1e-5),
    );
}

#[test]
fn rows_are_those_of_the_observation_model() {
    let numbers = &mut Numbers(61);
    for mut arm in arms(numbers) {
        arm.chain.elements = Elements::default();
        // What compensation leaves is seen where the arm stands without the load.
        arm.chain.gravity_m_s2 = Vector3::zeros();
        for precision in [DEFLECTIONS, ROTATIONS] {
            let (q, load) = (configuration(numbers, &arm), load(numbers, true));
            compare(numbers, (&arm, &q), &load, precision, 1e-7);
        }
    }
}
