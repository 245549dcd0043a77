//! What repeats of an experiment share they do not average: the model's discrepancy and the gears' errors, another one in each
//! configuration.

use elastocal::experiment::{Experiment, Plan};
use elastocal::identification::{Case, Robustness, Sigma};
use elastocal::laboratory::next::measured_plan;
use elastocal::measurement::{Measurement, RotationMeasurement, by_experiment};
use elastocal::observation::{NOTHING_READ, ObservationModel, PlannedReadings, ReadingKind};
use elastocal::parameter::{ElasticArm, ParameterSet};
use elastocal::plan::posterior;
use elastocal::robot::{Approach, Load};
use elastocal::scenario::Scenario;
use elastocal::task::{Belief, Method};
use elastocal::testbed::{TrueRobots, add_noise_of};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix6xX, Vector3};
use serde_json::Value;

use crate::support::{Workplace, setup, table4};
use crate::uncertainties::{assert_holds, loaded, repeated_in_study, study, with};

const MISFIT: &str = "[[uncertainty]]\nkind = \"discrepancy\"\nstd_mm = 0.04\n";
const GEARS: &str = "[[uncertainty]]\nkind = \"transmission_error\"\nstd_mrad = 3\n";

fn repeated(repeats: u32) -> Plan {
    let experiments = table4(4).experiments.into_iter();
    Plan {
        experiments: experiments
            .map(|each| Experiment { repeats, ..each })
            .collect(),
    }
}

/// The deflection (m) of an arm's first tool, to first order.
pub fn deflection(arm: &ElasticArm, q: &DVector<f64>, load: &Load) -> Vector3<f64> {
    let (nothing, mut ignored) = (ParameterSet::empty(), Matrix6xX::zeros(0));
    let setup = setup(q.clone(), *load, 0);
    ObservationModel::new(&nothing, arm, &[])
        .predict_first_order(None, &setup, ReadingKind::Deflection, &mut ignored)
        .position_m
}

/// What measurements say of all that a belief has unknown, to first order: a row for each number that was measured, and what is left of it
/// at what is believed.
pub fn linear_equations(
    belief: &Belief,
    measurements: &[Measurement],
) -> (DMatrix<f64>, DVector<f64>) {
    let extended = &belief.uncertain;
    let (size, arm) = (belief.unknowns(), extended.arm());
    let sizes = vec![1.0; size];
    let mut model = PlannedReadings::new(arm, 0, extended.set(), &sizes, NOTHING_READ, &[]);

    let count = 3 * measurements.len();
    let (mut rows, mut right) = (DMatrix::zeros(count, size), DVector::zeros(count));
    let mut jacobian = Matrix6xX::zeros(size);
    for (index, each) in measurements.iter().enumerate() {
        model.move_to(each.configuration_rad.as_slice());
        model.derivatives(&each.load, &mut jacobian);
        rows.rows_mut(3 * index, 3)
            .copy_from(&jacobian.fixed_rows::<3>(0));
        let left = each.deflection_m - deflection(arm, &each.configuration_rad, &each.load);
        right.rows_mut(3 * index, 3).copy_from(&left);
    }
    (rows, right)
}

/// On the virtual robot, drawn in every run, and in the linear model: what is seen is what is predicted.
#[test]
fn predictions_hold_for_repeats() {
    for uncertainties in [
        MISFIT.to_owned(),
        GEARS.to_owned(),
        format!("{MISFIT}{GEARS}"),
    ] {
        for (level, trials) in [("robot", 600), ("model", 20_000)] {
            let plan = study(&repeated_in_study(3, &uncertainties, level, trials));
            assert_holds(&plan, &format!("{uncertainties} {level}"));
            assert!(
                plan["nees_z"].as_f64().expect("a number").abs() < 5.0,
                "{uncertainties} {level}: {plan}"
            );
        }
    }
}

/// Many repeats leave what they share, and one leaves as much more as its noise.
#[test]
fn repeats_average_noise_alone() {
    let scenario = loaded(&with(MISFIT, "model", 64));
    let belief = &scenario.task.belief;
    let (sigma, discrepancy): (f64, f64) = (belief.instrument.sigma_m, 4e-5);
    let standard_error = |repeats| {
        let known = posterior(belief, &repeated(repeats));
        known.standard_error(2).expect("it is determined")
    };
    let expected = |repeats: f64| discrepancy.hypot(sigma / repeats.sqrt());
    let of_one = standard_error(1) / expected(1.0);
    for repeats in [2, 5, 1000] {
        let ratio = standard_error(repeats) / expected(f64::from(repeats)) / of_one;
        assert!((ratio - 1.0).abs() < 1e-9, "{repeats}: {ratio}");
    }
}

/// Repeats with standard deviations of their own: generalised least squares with the whole covariance of all readings,
/// written out, gives the same estimate, and residuals that are chi-square.
#[test]
fn identification_weighs_repeats_as_generalised_least_squares() {
    let scenario = loaded(&with(MISFIT, "model", 64));
    let (belief, plan) = (&scenario.task.belief, repeated(3));
    let mut robots = TrueRobots::new(belief, &scenario.truth).expect("a robot");
    let normals = robots
        .become_run_of(&scenario.truth, 12, 1, 0)
        .expect("a run");
    let mut measurements = robots
        .measure_noise_free(&plan, &belief.instrument, &normals, 0)
        .expect("measurements");
    add_noise_of(&mut measurements, &belief.instrument, 1, 0);
    for (index, each) in measurements.iter_mut().enumerate() {
        each.sigma_m = Some(nalgebra::Vector3::repeat(1e-5 * (1.0 + index as f64)));
    }
    let sigma = Sigma::Known(belief.instrument.sigma_m);
    let case = Case::of_belief(belief, &measurements, sigma, Method::Linear);
    let found = case.identify().expect("an identification");

    let size = belief.unknowns();
    let (rows, right) = linear_equations(belief, &measurements);
    let mut covariance = DMatrix::zeros(36, 36);
    let values = belief.values();
    for (index, each) in measurements.iter().enumerate() {
        for (other, another) in measurements.iter().enumerate() {
            let mut block = Matrix3::zeros();
            if another.configuration_rad == each.configuration_rad {
                block += Matrix3::identity() * 4e-5_f64.powi(2);
            }
            if index == other {
                let sigma = each.sigma_m.expect("its own");
                block += Matrix3::from_diagonal(&sigma.component_mul(&sigma));
            }
            let mut place = covariance.view_mut((3 * index, 3 * other), (3, 3));
            place.copy_from(&block);
        }
    }
    let inverse = covariance.clone().try_inverse().expect("regular");
    let information = rows.tr_mul(&inverse) * &rows;
    let change =
        information.clone().try_inverse().expect("regular") * rows.tr_mul(&inverse) * &right;
    for (index, nominal) in values.iter().enumerate() {
        let expected = nominal + change[index];
        let error = (found.posterior.mean[index] / expected - 1.0).abs();
        assert!(error < 1e-8, "{index}: {error}");
    }
    let left = &right - &rows * change;
    let square = (left.transpose() * inverse * &left)[0];
    let spare = (36 - size) as f64;
    let ratio = found.residual_sigma_m.expect("residuals") / found.sigma_m;
    assert!((ratio.powi(2) * spare / square - 1.0).abs() < 1e-8);
    // Residuals are told as they are, and so is what other measurements differ by from their predictions.
    for (index, residual) in found.residuals_m.iter().enumerate() {
        assert!((residual - left[index]).abs() < 1e-12, "{index}");
    }
    let predicted = case.predictions(&found.posterior).expect("predictions");
    for (index, each) in predicted.each.iter().enumerate() {
        let apart = each.difference_m - left.fixed_view::<3, 1>(3 * index, 0);
        assert!(apart.norm() < 1e-12, "{index}");
        let of_reading = covariance.fixed_view::<3, 3>(3 * index, 3 * index);
        let error = (each.reading_m2 - of_reading).norm() / of_reading.norm();
        assert!(error < 1e-9, "{index}: {error}");
    }
    let all = &covariance + &rows * &found.posterior.covariance * rows.transpose();
    let solved = all.cholesky().expect("a covariance").solve(&left);
    assert!((predicted.square / left.dot(&solved) - 1.0).abs() < 1e-8);
}

/// Where repeats average little, the best plan of twelve measurements in four configurations still has to be found: no
/// worse than that for noise alone, judged by the whole; and its prediction is the one that is searched for.
#[test]
fn plans_know_of_what_repeats_share() {
    let place = Workplace::new();
    let list = format!("{MISFIT}{GEARS}");
    place.write("s.toml", with(&list, "model", 64));
    let run = |arguments: &str| place.json(arguments);
    let number = |value: &Value, key: &str| value[key].as_f64().expect("a number");
    let planned =
        run("plan s.toml --experiments 12 --configurations 4 --no-proof --plan-out whole.csv");
    run(
        "plan s.toml --experiments 12 --configurations 4 --no-proof --noise-only --plan-out noise.csv",
    );
    let of = |plan: &str| {
        number(
            &run(&format!("evaluate s.toml --plan {plan} --no-proof")),
            "rho0_mm",
        )
    };
    let (whole, noise) = (of("whole.csv"), of("noise.csv"));
    assert!((whole / number(&planned, "rho0_mm") - 1.0).abs() < 1e-9);
    assert!(whole <= noise * (1.0 + 1e-6), "{whole} against {noise}");
    assert!(number(&planned, "lower_bound_rho0_mm") <= whole);
    let sources = &planned["uncertainty_budget"]["sources"];
    let named: Vec<&str> = (sources.as_array().expect("a list").iter())
        .filter_map(|each| each["source"].as_str())
        .collect();
    assert_eq!(named, ["noise", "discrepancy", "transmission_error"]);
}

/// Deflections of a plan without the instrument's noise, each with this standard deviation (m).
fn noise_free(scenario: &Scenario, plan: &Plan, sigma_m: f64) -> Vec<Measurement> {
    let belief = &scenario.task.belief;
    let mut robots = TrueRobots::new(belief, &scenario.truth).expect("a robot");
    let count = plan.measurements() as usize;
    let normals = (robots.become_run_of(&scenario.truth, count, 1, 0)).expect("a run");
    let measured = robots.measure_noise_free(plan, &belief.instrument, &normals, 0);
    let mut measurements = measured.expect("measurements");
    for each in &mut measurements {
        each.sigma_m = Some(Vector3::repeat(sigma_m));
    }
    measurements
}

/// The standard error of a compliance.
fn standard_error(scenario: &Scenario, measurements: &[Measurement]) -> f64 {
    let belief = &scenario.task.belief;
    let sigma = Sigma::Known(belief.instrument.sigma_m);
    let case = Case::of_belief(belief, measurements, sigma, Method::Linear);
    let found = case.identify().expect("an identification");
    found.posterior.standard_error(2).expect("it is determined")
}

/// What is one experiment is the same for the plan that is measured, for what repeats share, and for what the model leaves: a
/// configuration, a load, and a side of approach, all joints turning positively where none is told.
#[test]
fn the_side_of_approach_makes_another_experiment() {
    let (sigma, discrepancy): (f64, f64) = (1e-5, 4e-5);
    let scenario = loaded(&with(MISFIT, "model", 64));
    let with_sides = |second: Option<&str>| {
        let mut measurements = noise_free(&scenario, &repeated(2), sigma);
        for each in measurements.iter_mut().skip(1).step_by(2) {
            each.approach = second.map(|word| Approach::of_word(word, 6).expect("signs"));
        }
        measurements
    };
    let [silent, usual, other] = [None, Some("+"), Some("-")].map(with_sides);
    for (measurements, experiments) in [(&silent, 4), (&usual, 4), (&other, 8)] {
        assert_eq!(by_experiment(measurements).len(), experiments);
        assert_eq!(measured_plan(measurements).experiments.len(), experiments);
        assert_eq!(measured_plan(measurements).measurements(), 8);
    }
    let [silent_error, usual_error, other_error] =
        [&silent, &usual, &other].map(|each| standard_error(&scenario, each));
    assert!((usual_error / silent_error - 1.0).abs() < 1e-9);
    // Of one experiment noise alone is averaged, of two all.
    let shared = discrepancy.hypot(sigma / 2.0_f64.sqrt());
    let apart = discrepancy.hypot(sigma) / 2.0_f64.sqrt();
    let ratio = other_error / silent_error / (apart / shared);
    assert!((ratio - 1.0).abs() < 1e-9, "{ratio}");

    // The same where it is the residuals that tell of a discrepancy.
    let plain = loaded(&with("", "model", 64));
    let counted = |measurements: &[Measurement]| {
        let mut measurements = measurements.to_vec();
        for (index, each) in measurements.iter_mut().enumerate() {
            // Another discrepancy in each pair.
            let off = [0.31, -0.27, 0.22, -0.35][index / 2] * 1e-3;
            each.deflection_m += Vector3::new(off, -off, off);
        }
        let belief = &plain.task.belief;
        let sigma = Sigma::Known(belief.instrument.sigma_m);
        let case = Case::of_belief(belief, &measurements, sigma, Method::Linear);
        let asked = Robustness {
            keeps_all: true,
            counts_discrepancy: true,
            holds_nominal: false,
        };
        let found = case.identify_robustly(asked).expect("identified");
        let [position_m, _] = found.identification.discrepancy.expect("a discrepancy");
        let weighed = found.weighed[0].sigma_m.expect("its own").x;
        weighed.powi(2) / position_m.powi(2)
    };
    assert!((counted(&silent) - 2.0).abs() < 0.02);
    assert!((counted(&other) - 1.0).abs() < 0.02);
}

/// Of two readings of one experiment one lacks the rotation: they share the discrepancy all the same.
#[test]
fn repeats_share_their_discrepancy_with_rotations_or_without() {
    let scenario = loaded(&with(MISFIT, "model", 64));
    let without = noise_free(&scenario, &repeated(2), 1e-8);
    let mixed: Vec<Measurement> = (without.iter().enumerate())
        .map(|(index, each)| Measurement {
            // So uncertain that it tells nothing.
            rotation: (index % 2 == 1).then_some(RotationMeasurement {
                vector_rad: Vector3::zeros(),
                sigma_rad: Vector3::repeat(10.0),
            }),
            ..each.clone()
        })
        .collect();
    let ratio = standard_error(&scenario, &mixed) / standard_error(&scenario, &without);
    assert!((ratio - 1.0).abs() < 1e-6, "{ratio}");
}
