//! The model's derivatives against differences of its predictions.

use nalgebra::{Matrix6xX, Vector3, Vector6};

use super::rotation::inverse_left_jacobian;
use super::{Hook, LengthKind, ObservationModel, Prediction, ReadingKind, Setup};
use crate::parameter::arms::{Numbers, everything, random, random_elastic, ur10};
use crate::parameter::{ElasticArm, Parameter, ParameterKind, ParameterSet};
use crate::robot::{
    Approach, EquilibriumSolver, KinematicState, Kinematics, Load, ObservationMatrix,
    rotation_vector,
};

const KINDS: [ReadingKind; 6] = [
    ReadingKind::Length(LengthKind::Distance),
    ReadingKind::Length(LengthKind::Height),
    ReadingKind::Deflection,
    ReadingKind::DeflectionAndRotation,
    ReadingKind::Position,
    ReadingKind::Pose,
];

fn setup(numbers: &mut Numbers, belief: &ElasticArm, target: usize, force_n: f64) -> Setup {
    let commanded = belief
        .chain
        .joints
        .iter()
        .filter(|joint| joint.drive.passive_at.is_none());
    let sides = commanded
        .enumerate()
        .map(|(index, _)| !(index + target).is_multiple_of(3));
    Setup {
        approach: Some(Approach(sides.collect())),
        commanded_rad: numbers.configuration(&belief.chain),
        load: Load {
            force_n: numbers.vector(force_n),
            torque_nm: numbers.vector(force_n * 0.3),
        },
        hangs_on: None,
        target,
        station: target % belief.instrument_from_base.len(),
    }
}

/// The difference of two predictions in the rows in which derivatives are given.
fn difference(one: &Prediction, other: &Prediction, kind: ReadingKind) -> Vector6<f64> {
    let position = one.position_m - other.position_m;
    let rotation = if kind.is_deflection() {
        rotation_vector(&one.rotation) - rotation_vector(&other.rotation)
    } else {
        rotation_vector(&(one.rotation * other.rotation.transpose()))
    };
    let [px, py, pz] = position.into();
    let [rx, ry, rz] = rotation.into();
    Vector6::new(px, py, pz, rx, ry, rz)
}

/// A tenth of a metre, of a radian or of itself.
fn step_size(parameter: &Parameter, belief: &ElasticArm) -> f64 {
    match parameter.unit() {
        // To first order in compliance it is a small angle, too.
        _ if matches!(parameter.kind, ParameterKind::JointBacklash { .. }) => 1e-5,
        "rad/(N m)" | "m/N" | "N/m" => parameter.kind.typical_size(belief, false),
        _ => 0.1,
    }
}

/// Largest differences between derivatives and central differences, relative to each parameter's
/// effect.
fn worst_of_arm(numbers: &mut Numbers, belief: &ElasticArm, at_rest: bool, softness: f64) -> f64 {
    let mut belief = belief.clone();
    for compliance in &mut belief.compliance_rad_per_nm {
        *compliance *= softness;
    }
    let kinds = everything(&belief);
    // Some compliances in their logarithm, values away from the nominal ones.
    let unknowns = kinds
        .iter()
        .enumerate()
        .map(|(index, &kind)| (kind, (index % 2 == 0).then_some(0.1)));
    let set = ParameterSet::new(&belief, unknowns).expect("a set");
    let mut values: Vec<f64> = set.parameters().iter().map(|each| each.nominal).collect();
    for (value, parameter) in values.iter_mut().zip(set.parameters()) {
        let size = step_size(parameter, &belief);
        *value += numbers.between(-0.2, 0.2) * size;
        if parameter.nominal > 0.0 {
            *value = value.max(0.0);
        }
    }
    let predict = |values: &[f64], setup: &Setup, kind, derivatives: &mut Matrix6xX<f64>| {
        let mut model = ObservationModel::new(&set, &belief, values);
        if at_rest {
            let seen = model.predict(setup, kind, derivatives);
            seen.expect("an equilibrium")
        } else {
            model.predict_first_order(None, setup, kind, derivatives)
        }
    };
    let mut worst: f64 = 0.0;
    let own = (0..belief.tools.len()).map(|target| (target, None));
    let others = belief.tools.iter().enumerate().flat_map(|(place, hook)| {
        let targets = belief.tools.iter().enumerate();
        let inside =
            targets.filter(move |(_, tool)| tool.joints <= hook.joints && tool.name != hook.name);
        inside.map(move |(target, _)| (target, Some(Hook::Tool(place))))
    });
    for (target, hangs_on) in own.chain(others) {
        let setup = Setup {
            hangs_on,
            ..setup(numbers, &belief, target, 300.0)
        };
        for kind in KINDS {
            let rows = kind.rows();
            let mut derivatives = Matrix6xX::zeros(set.len());
            let mut ignored = derivatives.clone();
            predict(&values, &setup, kind, &mut derivatives);
            for (index, parameter) in set.parameters().iter().enumerate() {
                let size = step_size(parameter, &belief);
                let h = 3e-3 * size;
                let mut at = |shift: f64| {
                    let mut moved = values.clone();
                    moved[index] += shift;
                    predict(&moved, &setup, kind, &mut ignored)
                };
                let once = difference(&at(h), &at(-h), kind) / (2.0 * h);
                let twice = difference(&at(2.0 * h), &at(-2.0 * h), kind) / (4.0 * h);
                let slope = (once * 4.0 - twice) / 3.0;
                let error = (slope - derivatives.column(index)).rows(0, rows).amax();
                let effect = slope.rows(0, rows).amax();
                // Differences of predictions carry 1e-16 m or so, a micrometre's relative 1e-10.
                let floor = 1e-6 / size;
                let relative = error / (effect + floor);
                if relative > 1e-5 && std::env::var("SHOW").is_ok() {
                    println!(
                        "{at_rest} {kind:?} {target} {} {slope} {}",
                        parameter.name,
                        derivatives.column(index)
                    );
                }
                worst = worst.max(relative);
            }
        }
    }
    worst
}

/// The same with joints that slide, passive joints and springs.
#[test]
fn derivatives_of_elastic_arms_are_those_of_predictions() {
    let mut numbers = Numbers(11);
    for joints in [1, 2, 4, 7] {
        for _ in 0..2 {
            let belief = random_elastic(&mut numbers, joints);
            let worst = worst_of_arm(&mut numbers, &belief, true, 1.0);
            assert!(worst < 1e-5, "{joints} joints: {worst:.1e}");
            let worst = worst_of_arm(&mut numbers, &belief, false, 1e-4);
            assert!(worst < 1e-5, "{joints} joints, first order: {worst:.1e}");
        }
    }
}

#[test]
fn derivatives_at_rest_are_those_of_predictions() {
    let mut numbers = Numbers(1);
    for joints in [1, 2, 3, 5, 6, 7] {
        for _ in 0..4 {
            let belief = random(&mut numbers, joints);
            let worst = worst_of_arm(&mut numbers, &belief, true, 1.0);
            assert!(worst < 1e-5, "{joints} joints: {worst:.1e}");
        }
    }
}

/// The orientation of the first-order form is exp(phi) R, of which only the first order in phi is
/// meant: with a tenth of the compliance the error is a tenth.
#[test]
fn derivatives_to_first_order_are_those_of_predictions() {
    let mut numbers = Numbers(2);
    for joints in [1, 2, 3, 6, 7] {
        for _ in 0..4 {
            let belief = random(&mut numbers, joints);
            let worst = worst_of_arm(&mut numbers, &belief, false, 1e-4);
            assert!(worst < 1e-5, "{joints} joints: {worst:.1e}");
        }
    }
}

#[test]
fn compliances_alone_give_the_observation_matrix_and_its_nonlinear_form() {
    let mut numbers = Numbers(3);
    for belief in [ur10(), crate::parameter::arms::heavy()] {
        let joints = [1, 2, 3, 5];
        let set = ParameterSet::compliances(&belief, &joints).expect("joints");
        let values: Vec<f64> = joints
            .iter()
            .map(|&j| belief.compliance_rad_per_nm[j])
            .collect();
        let mut model = ObservationModel::new(&set, &belief, &values);
        let mut derivatives = Matrix6xX::zeros(joints.len());
        let mut arm = belief.chain.at(&belief.tools[0]);
        let mut state = KinematicState::new(6);
        for _ in 0..20 {
            let setup = setup(&mut numbers, &belief, 0, 200.0);
            let q = setup.commanded_rad.as_slice();
            let kind = ReadingKind::DeflectionAndRotation;
            arm.update(q, &mut state);
            let linear = ObservationMatrix::new(&state, &setup.load, &joints);
            model.predict_first_order(None, &setup, kind, &mut derivatives);
            assert_eq!(derivatives.fixed_rows::<3>(0), linear.position);
            assert_eq!(derivatives.fixed_rows::<3>(3), linear.rotation);

            let predicted = model
                .predict(&setup, kind, &mut derivatives)
                .expect("stable");
            let compliance = &belief.compliance_rad_per_nm;
            let mut solver = EquilibriumSolver::of_derivatives(6);
            let mut rest = |load: &Load| {
                solver.solve(&mut arm, compliance, q, load).expect("stable");
                let sensitivity = solver.sensitivity(compliance).select_columns(&joints);
                (solver.state().clone(), sensitivity)
            };
            let (unloaded, from) = rest(&Load::NONE);
            let (loaded, to) = rest(&setup.load);
            assert_eq!(
                predicted.position_m,
                loaded.tool_position - unloaded.tool_position
            );
            let rotation = loaded.tool_rotation * unloaded.tool_rotation.transpose();
            assert_eq!(predicted.rotation, rotation);
            let position = to.fixed_rows::<3>(0) - from.fixed_rows::<3>(0);
            let size = position.amax();
            assert!((derivatives.fixed_rows::<3>(0) - position).amax() < 1e-12 * size);
            // What is new: the rotation vector's own derivative instead of a difference of velocities.
            let turned = inverse_left_jacobian(&rotation_vector(&rotation))
                * (to.fixed_rows::<3>(3) - rotation * from.fixed_rows::<3>(3));
            assert!((derivatives.fixed_rows::<3>(3) - turned).amax() < 1e-12 * to.amax());
        }
    }
}

/// The base turns what the instrument says, and nothing else.
#[test]
fn an_instrument_elsewhere_sees_the_same_arm() {
    let mut numbers = Numbers(4);
    let mut belief = random(&mut numbers, 6);
    let set = ParameterSet::new(&belief, []).expect("nothing unknown");
    let setup = setup(&mut numbers, &belief, 0, 100.0);
    let mut nothing = Matrix6xX::zeros(0);
    let mut see = |belief: &ElasticArm, kind| {
        ObservationModel::new(&set, belief, &[])
            .predict(&setup, kind, &mut nothing)
            .expect("stable")
    };
    let base = belief.instrument_from_base[0];
    let pose = see(&belief, ReadingKind::Pose);
    let deflection = see(&belief, ReadingKind::Deflection);
    belief.instrument_from_base = vec![nalgebra::Isometry3::identity()];
    let there = see(&belief, ReadingKind::Pose);
    let bent = see(&belief, ReadingKind::Deflection);
    let expected: Vector3<f64> = (base * nalgebra::Point3::from(there.position_m)).coords;
    assert!((pose.position_m - expected).amax() < 1e-12);
    assert!((pose.rotation - base.rotation.to_rotation_matrix() * there.rotation).amax() < 1e-12);
    assert!((deflection.position_m - base.rotation * bent.position_m).amax() < 1e-12);
}
