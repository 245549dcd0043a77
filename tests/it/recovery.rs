//! Known compliances come back: what goes into the virtual robot is what identification finds.

use elastocal::calibration::see;
use elastocal::compensation::{compensate_arm, test_pose_matrix};
use elastocal::identification::{Case, Identification, Sigma};
use elastocal::measurement::Measurement;
use elastocal::plan::{ExperimentModel, Plan};
use elastocal::robot::{Load, ObservationMatrix};
use elastocal::scenario::Scenario;
use elastocal::task::{Belief, Method};
use elastocal::testbed::{TrueRobots, VirtualRobot, add_noise_of};
use nalgebra::{DMatrix, DVector, Vector3};

use crate::support::{
    Workplace, assert_alike, plan, repeated, scenario, scenario_text, shipped, state_at, table4,
};

/// A scenario whose true robot is not the nominal one: each compliance is 20 % larger or smaller.
pub fn differing(name: &str) -> Scenario {
    let mut scenario = scenario(name);
    let factors = [1.2, 0.8].into_iter().cycle();
    for (value, factor) in (scenario.truth.robot.compliance_rad_per_nm.iter_mut()).zip(factors) {
        *value *= factor;
    }
    scenario
}

pub fn noise_free(scenario: &Scenario, plan: &Plan) -> Vec<Measurement> {
    VirtualRobot::new(
        &scenario.truth.robot,
        &scenario.task.belief.calibration_tool.name,
    )
    .expect("the site exists")
    .measure_noise_free(plan, &scenario.task.belief.instrument)
    .expect("stable")
}

/// A belief that leaves open the compliances of these joints, and nothing else.
pub fn of_compliances(belief: &Belief, parameters: &[usize]) -> Belief {
    (belief.of_compliances(parameters.to_vec(), None)).expect("the joints exist")
}

pub fn identified(
    scenario: &Scenario,
    measurements: &[Measurement],
    sigma: Sigma,
    method: Method,
) -> Identification {
    let belief = &scenario.task.belief;
    let belief = of_compliances(belief, &belief.parameters);
    let found = Case::of_belief(&belief, measurements, sigma, method).identify();
    found.expect("something can be identified")
}

fn known(scenario: &Scenario) -> Sigma {
    Sigma::Known(scenario.task.belief.instrument.sigma_m)
}

/// The largest relative difference between estimates and truth.
fn relative_error(scenario: &Scenario, identification: &Identification) -> f64 {
    let error = |parameter: &elastocal::identification::ParameterEstimate| {
        let truth = scenario.truth.robot.compliance_rad_per_nm[parameter.joint];
        let estimate = parameter.estimate.expect("determined");
        (estimate.value / truth - 1.0).abs()
    };
    let errors = identification.parameters.iter().map(error);
    errors.fold(0.0, f64::max)
}

#[test]
fn nonlinear_identification_finds_the_true_compliances() {
    for (name, plan) in [
        ("klimchik2012", table4(3)),
        ("klimchik2012", table4(12)),
        ("kr270_all_joints", plan("kr270_all_joints")),
    ] {
        for rotation_sigma_rad in [None, Some(1e-4)] {
            let mut scenario = differing(name);
            scenario.task.belief.instrument.rotation_sigma_rad = rotation_sigma_rad;
            let measurements = noise_free(&scenario, &plan);
            let found = identified(
                &scenario,
                &measurements,
                known(&scenario),
                Method::Nonlinear,
            );
            let error = relative_error(&scenario, &found);
            assert!(error < 1e-8, "{name}: {error}");
            let left = found
                .residuals_m
                .iter()
                .fold(0.0_f64, |most, each| most.max(each.abs()));
            assert!(left < 1e-10, "{name}: residuals of {left} m");
            assert_eq!(found.compliance_rad_per_nm.len(), 6);
        }
    }
}

/// The same from outside: a scenario file with its own true robot, and files between the steps.
#[test]
fn files_carry_the_true_compliances() {
    let truth = [0.3e-6, 0.25e-6, 0.5e-6, 2.5e-6, 4e-6, 2e-6];
    let workplace = Workplace::new();
    let table = format!("[true_robot]\ncompliance_rad_per_nm = {truth:?}\n[instrument]");
    let text = scenario_text("kr270_all_joints").replace("[instrument]", &table);
    let text = text.replace("tracker_site", "rotation_sigma_mrad = 0.1\ntracker_site");
    workplace.write("s.toml", text);
    let plan = shipped("scenarios/plans/kr270_all_joints.csv");
    let measure = format!("measure s.toml --plan {plan} --noise-free --measurements-out m.csv");
    workplace.done(&measure);
    // Without noise the residuals are too small to be true, and that is said.
    let json = workplace
        .done("identify s.toml --measurements m.csv --json")
        .json();
    let note = json["notes"].to_string();
    assert!(note.contains("residuals too small for sigma"), "{note}");
    for (found, truth) in crate::support::numbers(&json["compliance_rad_per_nm"])
        .iter()
        .zip(truth)
    {
        assert_alike(*found, truth, 1e-8);
    }
}

/// A^(p) of all measurements (eq. 7), stacked, of an instrument that measures no rotations.
fn stacked(scenario: &Scenario, plan: &Plan) -> DMatrix<f64> {
    let model = ExperimentModel::new(&scenario.task.belief);
    let blocks: Vec<_> = repeated(plan)
        .map(|each| model.observation_matrix(each))
        .collect();
    DMatrix::from_fn(
        3 * blocks.len(),
        scenario.task.belief.parameters.len(),
        |row, column| blocks[row / 3][(row % 3, column)],
    )
}

/// Eq. 2 leaves out what the deflection itself does to the geometry. With e what it misses in each
/// measurement, linear least squares is off by (A^T A)^-1 A^T e exactly, and by `A_0` times that at
/// the test pose.
#[test]
fn linear_identification_is_biased_by_what_linearisation_misses() {
    let scenario = scenario("klimchik2012");
    let truth = DVector::from_iterator(
        5,
        scenario
            .task
            .belief
            .parameters
            .iter()
            .map(|&joint| scenario.truth.robot.compliance_rad_per_nm[joint]),
    );
    let pose = &scenario.task.test_poses[0];
    let at_test_pose = test_pose_matrix(
        &scenario.task.belief,
        pose,
        &scenario.task.belief.parameters,
    );
    let mut largest_missed = 0.0_f64;
    for experiments in [2, 3, 4, 6, 12] {
        let plan = table4(experiments);
        let measurements = noise_free(&scenario, &plan);
        let matrix = stacked(&scenario, &plan);
        let measured = measurements
            .iter()
            .flat_map(|each| each.deflection_m.iter().copied());
        let missed = DVector::from_iterator(matrix.nrows(), measured) - &matrix * &truth;
        for each in missed.as_slice().chunks(3) {
            largest_missed = largest_missed.max(Vector3::from_column_slice(each).norm());
        }
        let normal = matrix.tr_mul(&matrix).try_inverse().expect("regular");
        let bias = normal * matrix.tr_mul(&missed);

        let found = identified(&scenario, &measurements, known(&scenario), Method::Linear);
        for (index, parameter) in found.parameters.iter().enumerate() {
            let estimate = parameter.estimate.expect("determined").value;
            let expected = truth[index] + bias[index];
            assert_alike(estimate, expected, 1e-9);
        }
        let micrometres = (&at_test_pose * bias).norm() * 1e6;
        assert!(
            (0.5..4.0).contains(&micrometres),
            "m = {experiments}: {micrometres} um"
        );
    }
    // Joints that bend by some milliradians under 2500 N and gravity turn deflections of 5 to 8 mm
    // by as much: tens of micrometres.
    assert!(
        (10e-6..50e-6).contains(&largest_missed),
        "{largest_missed} m"
    );
}

#[test]
fn compensation_with_true_compliances() {
    for name in ["klimchik2012", "kr270"] {
        let scenario = differing(name);
        let mut robots =
            TrueRobots::new(&scenario.task.belief, &scenario.truth).expect("the sites exist");
        let pose = &scenario.task.test_poses[0];
        let mut left = |method| {
            let mut arm = scenario.task.belief.arm();
            (arm.compliance_rad_per_nm).clone_from(&scenario.truth.robot.compliance_rad_per_nm);
            let commanded = compensate_arm(&arm, arm.tools.len() - 1, pose, method);
            let seen = see(&mut robots, pose, &commanded.expect("stable")).expect("stable");
            assert!(seen.uncompensated_m.norm() > 0.5e-3, "{seen:?}");
            seen.residual_m.norm()
        };
        let nonlinear = left(Method::Nonlinear);
        assert!(nonlinear < 1e-9, "{nonlinear} m");
        let linear = left(Method::Linear);
        assert!((0.1e-6..10e-6).contains(&linear), "{linear} m");
    }
}

/// Two measurements of one experiment, one of them 10 % too long and 100 times as uncertain: the
/// estimate of the only unknown is the mean weighted by 1/sigma^2.
#[test]
fn an_uncertain_measurement_hardly_counts() {
    let scenario = scenario("klimchik2012_joint1");
    let experiment = &plan("kr270_joint1").experiments[0];
    let state = state_at(&scenario, &experiment.configuration_rad);
    let column = ObservationMatrix::new(&state, &experiment.load, &[0]).position;
    let column = Vector3::from_column_slice(column.as_slice());
    // What the other joints do is known.
    let others = ObservationMatrix::new(&state, &experiment.load, &[1, 2, 3, 4, 5]).position
        * DVector::from_column_slice(&scenario.task.belief.nominal.compliance_rad_per_nm[1..]);
    assert!(others.norm() > 1e-4);
    let measurement = |deflection_m: Vector3<f64>, sigma_m: f64| Measurement {
        configuration_rad: experiment.configuration_rad.clone(),
        load: experiment.load,
        deflection_m: deflection_m + others,
        sigma_m: Some(Vector3::repeat(sigma_m)),
        rotation: None,
        approach: None,
        direction: None,
    };
    let (compliance, sigma_m) = (0.3e-6, 2e-5);
    let measurements = [
        measurement(column * compliance, sigma_m),
        measurement(column * compliance * 1.1, 100.0 * sigma_m),
    ];
    // The measurements bring their own sigma: the instrument's is not used.
    let found = identified(&scenario, &measurements, Sigma::Known(1.0), Method::Linear);
    let estimate = found.parameters[0].estimate.expect("determined");
    let expected =
        compliance * (1.0 + 0.1 * 1e-4) / (1.0 + 1e-4) + 1e-4 * compliance / (1.0 + 1e-4);
    assert_alike(estimate.value, expected, 1e-12);
    let standard_error = sigma_m / column.norm() / 1.0001_f64.sqrt();
    assert_alike(estimate.standard_error, standard_error, 1e-12);
    let alone = identified(
        &scenario,
        &measurements[..1],
        Sigma::Known(1.0),
        Method::Linear,
    );
    let alone = alone.parameters[0].estimate.expect("determined").value;
    assert_alike(estimate.value, alone, 1.001e-5);
}

/// The relative standard deviation of an estimated sigma is 1/sqrt(2 (n - p)): 2.6 % here.
#[test]
fn residuals_tell_sigma() {
    let mut scenario = scenario("klimchik2012");
    scenario.task.belief.instrument.sigma_m = 0.07e-3;
    let mut plan = table4(12);
    for experiment in &mut plan.experiments {
        experiment.repeats = 20;
    }
    let belief = &scenario.task.belief;
    let mut measurements = VirtualRobot::new(&scenario.truth.robot, &belief.calibration_tool.name)
        .expect("the site exists")
        .measure_noise_free(&plan, &belief.instrument)
        .expect("stable");
    add_noise_of(&mut measurements, &belief.instrument, 11, 0);
    let found = identified(
        &scenario,
        &measurements,
        Sigma::FromResiduals(3e-5),
        Method::Nonlinear,
    );
    let freedom = f64::from(3 * 12 * 20 - 5_i32);
    let allowed = 4.0 / (2.0 * freedom).sqrt();
    assert_alike(found.sigma_m, 0.07e-3, allowed);
    assert_eq!(found.residual_sigma_m, Some(found.sigma_m));
    assert_eq!(
        found.consistency, None,
        "nothing is known to be consistent with"
    );

    let wrong = identified(
        &scenario,
        &measurements,
        Sigma::Known(0.03e-3),
        Method::Nonlinear,
    );
    assert!(wrong.consistency.expect("residuals are left") < 1e-6);
    assert!((wrong.residual_sigma_m.expect("are left") / found.sigma_m - 1.0).abs() < 1e-9);
    // The estimates themselves do not depend on sigma, their uncertainties do.
    for (one, other) in wrong.parameters.iter().zip(&found.parameters) {
        let (one, other) = (one.estimate.expect("is"), other.estimate.expect("is"));
        assert!((one.value / other.value - 1.0).abs() < 1e-9);
        let ratio = other.standard_error / one.standard_error;
        assert!((ratio / (found.sigma_m / 0.03e-3) - 1.0).abs() < 1e-9);
    }
}

/// The load of an experiment acts: without it there is nothing to see.
#[test]
fn no_load_no_deflection() {
    let scenario = scenario("klimchik2012");
    let mut plan = table4(3);
    for experiment in &mut plan.experiments {
        experiment.load = Load::NONE;
    }
    for each in noise_free(&scenario, &plan) {
        assert_eq!(each.deflection_m, Vector3::zeros());
    }
}
