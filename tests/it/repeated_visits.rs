//! Repeatability, accuracy and drift of what a measurement file has more than once (ISO 9283), from simulated repeats.

use elastocal::measurement::{AbsoluteReading, absolute_table};
use elastocal::numeric::random::generator;
use elastocal::numeric::tolerance::pose_repeatability;
use elastocal::observation::{ObservationModel, ReadingKind};
use elastocal::parameter::ParameterSet;
use elastocal::plan::Plan;
use elastocal::robot::Load;
use nalgebra::{DMatrix, DVector, Isometry3, Matrix6xX, Vector3};
use rand::RngExt;
use serde_json::Value;

use crate::one_fit::normal;
use crate::support::{
    Workplace, blank_reading, list, number, numbers, scenario, scenario_text, setup, shipped,
    table4,
};

/// The robot returns to a place so well along each axis (m).
const SCATTER_M: [f64; 3] = [2e-5, 6e-5, 1e-5];
const POSES: usize = 12;
const VISITS: usize = 20;

/// Visits of poses in turn, by a robot that drifts (m/h); each is read so many times.
fn visits(drift_m_per_h: Vector3<f64>, times: usize) -> Vec<AbsoluteReading> {
    let scenario = scenario("klimchik2012");
    let mut random = generator(5, 0);
    let mut arm = scenario.task.belief.arm();
    arm.tools.truncate(1);
    arm.instrument_from_base = vec![Isometry3::new(
        Vector3::new(2.0, -1.0, 0.3),
        Vector3::new(0.1, -0.2, 2.0),
    )];
    let nothing = ParameterSet::empty();
    let mut model = ObservationModel::new(&nothing, &arm, &[]);
    let mut ignored = Matrix6xX::zeros(0);
    let ranges = arm.chain.joints.iter().map(|joint| joint.range_rad);
    let ranges: Vec<[f64; 2]> = ranges.map(|[low, high]| [0.7 * low, 0.7 * high]).collect();
    let commands: Vec<DVector<f64>> = (0..POSES)
        .map(|_| {
            let angles = ranges
                .iter()
                .map(|[low, high]| random.random_range(*low..*high));
            DVector::from_iterator(ranges.len(), angles)
        })
        .collect();
    let mut readings = Vec::new();
    for visit in 0..POSES * VISITS {
        let setup = setup(commands[visit % POSES].clone(), Load::NONE, 0);
        let seen = model.predict(&setup, ReadingKind::Position, &mut ignored);
        let hours = visit as f64 / 60.0;
        let returned = Vector3::from(SCATTER_M).map(|sigma| sigma * normal(&mut random));
        for _ in 0..times {
            readings.push(AbsoluteReading {
                configuration_rad: setup.commanded_rad.clone(),
                visit: (times > 1).then(|| format!("v{visit}")),
                // Read to a tenth of a micrometre.
                position_m: seen.as_ref().expect("stable").position_m
                    + returned
                    + drift_m_per_h * hours
                    + Vector3::from_fn(|_, _| 1e-7 * normal(&mut random)),
                time_s: Some(hours * 3600.0),
                ..blank_reading()
            });
        }
    }
    readings
}

fn identified(readings: &[AbsoluteReading]) -> Value {
    let place = Workplace::with("s.toml", scenario_text("klimchik2012"));
    place.write("m.csv", absolute_table(&6.into(), readings));
    let outcome =
        place.run("identify s.toml --measurements m.csv --parameters frames --json --quiet");
    assert!(matches!(outcome.code, Some(0 | 3)), "{outcome:?}");
    outcome.json()["repeats"].clone()
}

fn expected_rp_mm() -> f64 {
    let variances = SCATTER_M.map(|sigma| sigma * sigma).to_vec();
    let covariance = DMatrix::from_diagonal(&DVector::from_vec(variances));
    pose_repeatability(&covariance).expect("a covariance") * 1e3
}

/// RP has a standard error of about 1/sqrt(2 f) of itself, with f of 228 degrees of freedom in three coordinates.
#[test]
fn repeatability_is_that_of_the_returns() {
    let repeats = identified(&visits(Vector3::zeros(), 1));
    assert_eq!(repeats["degrees_of_freedom"], 228);
    let found = number(&repeats["rp_mm"]) / expected_rp_mm();
    assert!((found - 1.0).abs() < 4.0 / 456.0_f64.sqrt(), "{found}");
    let poses = list(&repeats["poses"]);
    assert_eq!(poses.len(), POSES);
    let mut sum = 0.0;
    for (index, pose) in poses.iter().enumerate() {
        assert_eq!(pose["first"], index + 1);
        assert_eq!(pose["visits"], VISITS);
        // Frames alone are fitted: the means of 20 returns are where they are predicted.
        assert!(number(&pose["ap_mm"]) < 0.06, "{pose}");
        sum += number(&pose["rp_mm"]) / POSES as f64;
    }
    assert!((sum / expected_rp_mm() - 1.0).abs() < 0.15, "{sum}");
    let drift = &repeats["drift"];
    assert_eq!(drift["by"], "hour");
    assert!(number(&drift["probability"]) > 1e-3, "{drift}");
}

#[test]
fn drift_is_found_with_its_standard_error() {
    let drift_m_per_h = Vector3::new(1.5e-5, -3e-5, 5e-6);
    let mut readings = visits(drift_m_per_h, 1);
    let drift = identified(&readings)["drift"].clone();
    let [slope, error] = ["slope_mm", "standard_error_mm"].map(|key| numbers(&drift[key]));
    for axis in 0..3 {
        let off = slope[axis] - drift_m_per_h[axis] * 1e3;
        assert!(off.abs() < 4.0 * error[axis], "{drift}");
        // Of 240 visits within four hours, those of one pose apart by a fifth of an hour.
        let spread = 240.0_f64.sqrt() * 4.0 / 12.0_f64.sqrt();
        let expected = SCATTER_M[axis] * 1e3 / spread;
        assert!((error[axis] / expected - 1.0).abs() < 0.25, "{drift}");
    }
    assert!(number(&drift["probability"]) < 1e-4, "{drift}");
    // Without times it is by rows, of which there are sixty in an hour.
    for reading in &mut readings {
        reading.time_s = None;
    }
    let by_row = identified(&readings)["drift"].clone();
    assert_eq!(by_row["by"], "row");
    for (per_row, per_hour) in numbers(&by_row["slope_mm"]).iter().zip(&slope) {
        assert!((60.0 * per_row / per_hour - 1.0).abs() < 1e-6);
    }
}

/// Readings of one visit say nothing of how the robot returns.
#[test]
fn readings_of_one_visit_are_no_repeats() {
    let twice = identified(&visits(Vector3::zeros(), 2));
    assert_eq!(twice["degrees_of_freedom"], 228);
    let found = number(&twice["rp_mm"]) / expected_rp_mm();
    assert!((found - 1.0).abs() < 4.0 / 456.0_f64.sqrt(), "{found}");
    let mut once = visits(Vector3::zeros(), 2);
    once.truncate(2 * POSES);
    assert_eq!(identified(&once), Value::Null);
}

/// Of deflections the scatter of both readings shows: here the instrument's alone, of 0.03 mm in each coordinate.
#[test]
fn deflections_repeat_as_well_as_they_are_read() {
    let place = Workplace::with("s.toml", scenario_text("klimchik2012"));
    let mut plan = table4(4);
    plan.experiments
        .iter_mut()
        .for_each(|each| each.repeats = 40);
    let plan = Plan {
        experiments: plan.experiments,
    };
    place.write_plan("p.csv", 6, &plan);
    place.done("measure s.toml --plan p.csv --measurements-out m.csv --quiet");
    let outcome = place.done("identify s.toml --measurements m.csv --quiet");
    outcome.prints("160 visits of 4 poses");
    let repeats = place.json("identify s.toml --measurements m.csv")["repeats"].clone();
    assert_eq!(repeats["degrees_of_freedom"], 156);
    let found = number(&repeats["rp_mm"]) / (0.03 * 3.616);
    assert!((found - 1.0).abs() < 4.0 / 936.0_f64.sqrt(), "{found}");
    assert_eq!(repeats["poses"][0]["ap_mm"], Value::Null);
    assert_eq!(repeats["drift"]["by"], "row");
    // None where nothing is repeated.
    let once = shipped("scenarios/plans/klimchik2012_m4.csv");
    place.done(&format!(
        "measure s.toml --plan {once} --measurements-out o.csv --quiet"
    ));
    let json = place.record("identify s.toml --measurements o.csv");
    assert_eq!(json["repeats"], Value::Null);
}
