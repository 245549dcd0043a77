//! The simulated truth of a run: what results, pages and recordings show beside estimates is what that run sampled.

use elastocal::calibration::{Calibration, calibrate};
use elastocal::plan::Plan;
use elastocal::record::run::{MeasuredMessage, RunMessage};
use elastocal::scenario::Scenario;
use elastocal::view::recording::Recording;
use nalgebra::Vector3;

use crate::support::{Workplace, assert_near_in, scenario, scenario_text, shipped, table4};

const SEEDS: u64 = 200;
/// A share of so many seeds may be off by so many of its standard deviations: a right program exceeds them in one of 150 000
/// comparisons.
const ALLOWED: f64 = 4.5;

/// How far a share of [`SEEDS`] seeds with a probability may be off.
fn binomial(probability: f64) -> f64 {
    ALLOWED * (probability * (1.0 - probability) / SEEDS as f64).sqrt()
}

fn assert_share(held: u64, what: &str) {
    let share = held as f64 / SEEDS as f64;
    assert!((share - 0.95).abs() < binomial(0.95), "{what}: {share}");
}

fn runs(scenario: &Scenario, plan: &Plan) -> Vec<Calibration> {
    let run = |seed| calibrate(&scenario.task, &scenario.truth, plan, seed, 0).expect("works");
    (0..SEEDS).map(run).collect()
}

/// In how many records each compliance's interval holds the truth beside it.
fn held(scenario: &Scenario, runs: &[Calibration]) -> Vec<(String, u64)> {
    let mut held: Vec<(String, u64)> = Vec::new();
    let (task, truth) = (&scenario.task, &scenario.truth);
    for (seed, run) in (0..).zip(runs) {
        let record = RunMessage::of_deflections(task, truth, seed, "plan", run).expect("works");
        let MeasuredMessage::Deflections { identification, .. } = &record.measured else {
            panic!("deflections were measured");
        };
        let all = identification.parameters.iter().enumerate();
        for (index, name) in all {
            let [low, high] = identification.compliance_ci95_rad_per_nm[index].expect("determined");
            let truth = record.truth.compliance_rad_per_nm[index];
            if held.len() == index {
                held.push((name.clone(), 0));
            }
            held[index].1 += u64::from((low..=high).contains(&truth));
        }
    }
    held
}

/// With all that the default scenario samples, and without the errors of the tracker beside its noise, of which no record
/// gives a size.
#[test]
fn intervals_hold_the_truth_beside_them_and_residuals_are_as_large_as_predicted() {
    let mut scenario = scenario("kr270");
    (scenario.truth.uncertainties).retain(|each| each.name != "tracker_range");
    let sigma_m = scenario.task.belief.instrument.sigma_m;
    let plan = table4(3);
    let runs = runs(&scenario, &plan);
    for (name, held) in held(&scenario, &runs) {
        assert_share(held, &name);
    }
    for (reading, axis) in (0..3).flat_map(|reading| [0, 1, 2].map(|axis| (reading, axis))) {
        let is_held = |run: &&Calibration| {
            let measured = run.measurements[reading].deflection_m[axis];
            (measured - run.truth.deflections_m[reading][axis]).abs() < 1.96 * sigma_m
        };
        let held = runs.iter().filter(is_held).count() as u64;
        assert_share(held, &format!("deflection {reading}, axis {axis}"));
        // The mean of squares whose expectation is one, by its own spread.
        let squares: Vec<f64> = (runs.iter())
            .map(|run| run.residuals[reading].standardised[axis].expect("to spare"))
            .map(|value| value * value)
            .collect();
        let mean = squares.iter().sum::<f64>() / SEEDS as f64;
        let spread = squares.iter().map(|square| (square - mean).powi(2));
        let deviation = (spread.sum::<f64>() / SEEDS as f64 / SEEDS as f64).sqrt();
        assert_near_in(&(reading, axis), mean, 1.0, ALLOWED * deviation);
    }
    // What the fit takes up is less than what there is.
    for run in &runs {
        let effective: f64 = run.residuals.iter().map(|each| each.leverage).sum();
        assert!(effective > 0.0 && effective < 9.0, "{effective}");
    }
}

/// Compliances that vary from run to run of a study vary in a single run, too.
#[test]
fn a_single_run_samples_compliances_as_studies_do() {
    let mut scenario = scenario("klimchik2012");
    scenario.truth.compliance_spread.fill(0.2);
    let runs = runs(&scenario, &table4(3));
    for (name, held) in held(&scenario, &runs) {
        assert_share(held, &name);
    }
    let first = |run: &Calibration| run.truth.compliance_rad_per_nm[1];
    assert!(first(&runs[0]).to_bits() != first(&runs[1]).to_bits());
}

/// A recording stands the robot where the run had it.
#[test]
fn a_recording_shows_the_deflections_of_its_run() {
    let scenario = scenario("kr270");
    let mut plan = table4(3);
    plan.experiments[1].repeats = 2;
    let run = calibrate(&scenario.task, &scenario.truth, &plan, scenario.seed, 0).expect("works");
    let (task, truth, seed) = (&scenario.task, &scenario.truth, scenario.seed);
    let shown = RunMessage::of_deflections(task, truth, seed, "plan", &run).expect("works");
    let recording = Recording::new(&scenario, &[shown]).expect("works");
    let (experiments, test_poses): (Vec<_>, Vec<_>) =
        (recording.calibrations[0].steps.iter()).partition(|step| step.number.is_some());
    assert_eq!(
        [experiments.len(), test_poses.len()],
        [3, 2 * run.poses.len()]
    );
    for step in experiments {
        let truth = run.truth.deflections_m[step.did.readings.start];
        assert!((step.did.displacement_m() - truth).norm() < 1e-9);
    }
    for (steps, pose) in test_poses.chunks(2).zip(&run.poses) {
        for (step, seen) in (steps.iter()).zip([pose.seen.uncompensated_m, pose.seen.residual_m]) {
            assert!((step.did.displacement_m() - seen).norm() < 1e-9);
        }
    }
}

/// What an instrument drifts between two readings is in the deflection: by metres here, beside its noise.
#[test]
fn deflections_are_off_by_the_drift_of_their_run() {
    let place = Workplace::new();
    let drift = "\n[[uncertainty]]\nkind = \"drift\"\nstd_um_per_h = 1e6\n";
    place.write("s.toml", scenario_text("klimchik2012") + drift);
    let scenario = place.scenario("s.toml");
    let run = calibrate(&scenario.task, &scenario.truth, &table4(3), 0, 0).expect("works");
    let drift_m: Vec<f64> = run.truth.sampled.iter().map(|each| each.value).collect();
    assert_eq!(drift_m.len(), 3);
    for (measured, moved) in run.measurements.iter().zip(&run.truth.deflections_m) {
        let off_m = measured.deflection_m - moved - Vector3::from_column_slice(&drift_m);
        let noise_m = scenario.task.belief.instrument.sigma_m;
        assert!(off_m.amax() < 6.0 * noise_m, "{off_m} beside {drift_m:?}");
        assert!(
            drift_m
                .iter()
                .all(|drift_m| drift_m.abs() > 100.0 * noise_m)
        );
    }
}

/// `measure --noise-free --run` shows what the run of that number is.
#[test]
fn the_truth_of_a_run_can_be_measured_without_noise() {
    let workplace = Workplace::new();
    let scenario_file = shipped("scenarios/kr270.toml");
    let plan_file = shipped("scenarios/plans/klimchik2012_m3.csv");
    let shown = workplace.run(&format!(
        "measure {scenario_file} --plan {plan_file} --run 0 --noise-free --json"
    ));
    let json = shown.json();
    let scenario = scenario("kr270");
    let run = calibrate(
        &scenario.task,
        &scenario.truth,
        &table4(3),
        scenario.seed,
        0,
    )
    .expect("works");
    for (index, moved) in run.truth.deflections_m.iter().enumerate() {
        for axis in 0..3 {
            let shown = json["measurements"][index]["deflection_mm"][axis].as_f64();
            assert!((shown.expect("a number") - moved[axis] * 1e3).abs() < 1e-9);
        }
    }
    let shown = json["truth"]["compliance_rad_per_nm"][0].as_f64();
    assert!((shown.expect("a number") / run.truth.compliance_rad_per_nm[0] - 1.0).abs() < 1e-12);
}
