//! The predicted uncertainties are honest: over many seeded runs, intervals cover the truth as often
//! as they say and errors are as large as predicted.
//!
//! A share p seen in N independent runs has the standard deviation sqrt(p (1 - p) / N). It may be
//! off by [`ALLOWED`] of these, which a right program exceeds in one of 150 000 comparisons; the
//! seeds are fixed, so that the tests do not flicker.

use elastocal::calibration::see;
use elastocal::compensation::{compensate_arm, predicted_error, test_pose_matrix};
use elastocal::identification::{Identification, Sigma};
use elastocal::measurement::Measurement;
use elastocal::numeric::random::generator;
use elastocal::plan::{ExperimentModel, posterior};
use elastocal::scenario::Scenario;
use elastocal::task::Method;
use elastocal::testbed::TrueRobots;
use nalgebra::{DVector, Vector3};
use rand_distr::{Distribution, StandardNormal};

use crate::recovery::{identified, noise_free};
use crate::support::{repeated, scenario, table4};

const RUNS: u32 = 2000;
const ALLOWED: f64 = 4.5;

/// Whether `count` of the runs is as much as a probability says.
fn assert_share(count: u32, probability: f64, what: &str) {
    let share = f64::from(count) / f64::from(RUNS);
    let deviation = (probability * (1.0 - probability) / f64::from(RUNS)).sqrt();
    let off = (share - probability) / deviation;
    assert!(
        off.abs() < ALLOWED,
        "{what}: {share} is {off:.1} standard deviations off"
    );
}

/// Identifies with the noise of every run added to the same noise-free measurements.
fn runs(
    scenario: &Scenario,
    measurements: &[Measurement],
    sigma: Sigma,
    method: Method,
) -> Vec<Identification> {
    let run = |run| {
        let mut noise = generator(3, run);
        let mut noisy = measurements.to_vec();
        for each in &mut noisy {
            let noise: Vector3<f64> = Vector3::from_fn(|_, _| StandardNormal.sample(&mut noise));
            each.deflection_m += noise * scenario.task.belief.instrument.sigma_m;
        }
        identified(scenario, &noisy, sigma, method)
    };
    (0..u64::from(RUNS)).map(run).collect()
}

/// Measurements of a robot for which eq. 2 holds exactly.
fn linear_truth(scenario: &Scenario) -> Vec<Measurement> {
    let model = ExperimentModel::new(&scenario.task.belief);
    let compliance = scenario
        .task
        .belief
        .parameters
        .iter()
        .map(|&joint| scenario.truth.robot.compliance_rad_per_nm[joint]);
    let compliance = DVector::from_iterator(scenario.task.belief.parameters.len(), compliance);
    let plan = table4(3);
    let mut measurements = noise_free(scenario, &plan);
    for (each, experiment) in measurements.iter_mut().zip(repeated(&plan)) {
        let deflection = model.observation_matrix(experiment) * &compliance;
        each.deflection_m = Vector3::from_column_slice(deflection.as_slice());
    }
    measurements
}

/// Nine equations for five unknowns: with sigma from four residuals to spare, intervals that took
/// normal quantiles for Student's would cover 88 %, far outside what is allowed.
#[test]
fn intervals_of_95_percent_cover_the_truth_in_95_percent() {
    let scenario = scenario("klimchik2012");
    let known = Sigma::Known(scenario.task.belief.instrument.sigma_m);
    let simulated = noise_free(&scenario, &table4(3));
    for (measurements, sigma, method) in [
        (&linear_truth(&scenario), known, Method::Linear),
        (
            &linear_truth(&scenario),
            Sigma::FromResiduals(3e-5),
            Method::Linear,
        ),
        (&simulated, known, Method::Nonlinear),
        (&simulated, Sigma::FromResiduals(3e-5), Method::Nonlinear),
    ] {
        let mut covered = [0; 5];
        for run in runs(&scenario, measurements, sigma, method) {
            for (count, parameter) in covered.iter_mut().zip(&run.parameters) {
                let truth = scenario.truth.robot.compliance_rad_per_nm[parameter.joint];
                let [low, high] = parameter.estimate.expect("determined").interval95;
                *count += u32::from((low..=high).contains(&truth));
            }
        }
        for (index, count) in covered.into_iter().enumerate() {
            assert_share(
                count,
                0.95,
                &format!("k{}, {sigma:?}, {method:?}", index + 2),
            );
        }
    }
}

/// The error at the test pose is normal with the covariance S = `A_0` cov(k) `A_0^T`, so that its
/// square has the mean trace(S) = `rho_0^2` (eq. 20) and the variance 2 trace(S^2).
#[test]
fn compensation_is_as_good_as_predicted() {
    let scenario = scenario("klimchik2012");
    let pose = &scenario.task.test_poses[0];
    let predicted = posterior(&scenario.task.belief, &table4(3));
    let covariance = &predicted.covariance;
    let matrix = test_pose_matrix(
        &scenario.task.belief,
        pose,
        &scenario.task.belief.parameters,
    );
    let rho0 = predicted_error(&matrix, &predicted).expect("determined");
    let at_pose = &matrix * covariance * matrix.transpose();
    let deviation = (2.0 * (&at_pose * &at_pose).trace() / f64::from(RUNS)).sqrt();

    let mut robot =
        TrueRobots::new(&scenario.task.belief, &scenario.truth).expect("the sites exist");
    let measurements = noise_free(&scenario, &table4(3));
    let known = Sigma::Known(scenario.task.belief.instrument.sigma_m);
    let mut sum = 0.0;
    for run in runs(&scenario, &measurements, known, Method::Nonlinear) {
        let arm = scenario.task.belief.arm_at(&run.posterior.mean);
        let commanded = compensate_arm(&arm, arm.tools.len() - 1, pose, Method::Nonlinear);
        let seen = see(&mut robot, pose, &commanded.expect("stable")).expect("stable");
        sum += seen.residual_m.norm_squared();
    }
    let mean = sum / f64::from(RUNS);
    let off = (mean - rho0.powi(2)) / deviation;
    assert!(
        off.abs() < ALLOWED,
        "rms {} against {rho0}: {off:.1}",
        mean.sqrt()
    );
}

/// If model and sigma are right, the consistency probability is uniform.
#[test]
fn consistency_is_uniform() {
    let scenario = scenario("klimchik2012");
    let measurements = noise_free(&scenario, &table4(3));
    let known = Sigma::Known(scenario.task.belief.instrument.sigma_m);
    let runs = runs(&scenario, &measurements, known, Method::Nonlinear);
    for level in [0.05, 0.25, 0.5, 0.75, 0.95] {
        let below = |run: &&Identification| run.consistency.expect("residuals are left") < level;
        let count = u32::try_from(runs.iter().filter(below).count()).expect("few");
        assert_share(count, level, &format!("consistency below {level}"));
    }
}
