//! Real readings: 2773 poses of a UR10 by a laser tracker, from the public repository `christianlandgraf/ipa-robot-accuracy`.
//!
//! The project holds none of them. The test looks for `series_c.csv` in the folder that `ELASTOCAL_UR10_IPA` names, or in
//! `data/ur10_ipa` of a folder beside the project, and skips where it is in neither.

use std::path::PathBuf;

use elastocal::identification::{AbsoluteCase, DistanceStatistics, ParameterGroup, ReadingWeights};
use elastocal::measurement::AbsoluteReading;
use elastocal::numeric::random::generator;
use elastocal::scenario::Scenario;
use elastocal::task::Belief;
use nalgebra::{DVector, Matrix6, UnitQuaternion, Vector3};
use rand::RngExt;
use rayon::prelude::*;

use crate::support::{UR10_JOINTS, blank_reading, project, scenario};

const HALVES: u64 = 20;
/// The full model's fits take longest, and nothing is predicted of them.
const FULL_HALVES: u64 = 4;

pub fn found() -> Option<PathBuf> {
    let named = std::env::var_os("ELASTOCAL_UR10_IPA").map(PathBuf::from);
    let beside = std::fs::read_dir(project("..")).ok()?.flatten();
    let beside = beside.map(|entry| entry.path().join("data/ur10_ipa"));
    let file = |folder: PathBuf| folder.join("series_c.csv");
    named
        .into_iter()
        .chain(beside)
        .map(file)
        .find(|file| file.exists())
}

/// The poses of a series: semicolons, decimal commas, joint angles in rad, positions in mm, intrinsic x-y-z angles in deg.
pub fn series(path: &PathBuf) -> Vec<AbsoluteReading> {
    let text = std::fs::read_to_string(path).expect("it can be read");
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(';').collect();
    let rows = lines.map(|line| {
        let fields: Vec<&str> = line.split(';').collect();
        let number = |name: &str| -> f64 {
            let place = header
                .iter()
                .position(|column| *column == name)
                .expect("the column");
            fields[place].replace(',', ".").parse().expect("a number")
        };
        let three = |before: &str, after: &str| {
            Vector3::from(
                ["x", "y", "z"].map(|axis| number(&format!("measurement_{before}{after}{axis}"))),
            )
        };
        let turn = three("", "r").map(f64::to_radians);
        let about = |axis: usize| UnitQuaternion::from_scaled_axis(Vector3::ith(axis, turn[axis]));
        let deviation = three("std_", "") * 1e-3;
        let turned = three("std_", "r").map(f64::to_radians);
        let variances = [deviation, turned].map(|each| each.component_mul(&each));
        AbsoluteReading {
            configuration_rad: DVector::from_fn(6, |joint, _| {
                number(&format!("{}_joint", UR10_JOINTS[joint]))
            }),
            position_m: three("", "") * 1e-3,
            rotation: Some(about(0) * about(1) * about(2)),
            covariance: Some(Matrix6::from_fn(|row, column| {
                if row == column {
                    variances[row / 3][row % 3]
                } else {
                    0.0
                }
            })),
            temperature_c: Some(number("measurement_temperature")),
            ..blank_reading()
        }
    });
    rows.collect()
}

/// Two random halves.
pub fn halves(all: &[AbsoluteReading], seed: u64) -> [Vec<AbsoluteReading>; 2] {
    let mut order: Vec<usize> = (0..all.len()).collect();
    let mut random = generator(seed, 0);
    for last in (1..order.len()).rev() {
        order.swap(last, random.random_range(0..=last));
    }
    let (one, other) = order.split_at(all.len() / 2);
    [one, other].map(|half| half.iter().map(|&index| all[index].clone()).collect())
}

/// The mean distance (mm) that a model fitted to one half leaves of the other.
fn left_mm(belief: &Belief, all: &[AbsoluteReading], groups: &[ParameterGroup], seed: u64) -> f64 {
    let [fitted, judged] = halves(all, seed);
    let fit = AbsoluteCase::new(belief, &fitted)
        .and_then(|mut case| case.fit(groups, ReadingWeights::AsNeeded));
    let fit = fit.expect("a fit");
    let case = AbsoluteCase::placed(belief, &judged).expect("readings");
    let left = case.left(&fit.arm).expect("stable");
    DistanceStatistics::of_positions(&left)
        .expect("readings")
        .mean
        * 1e3
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    f64::midpoint(values[(values.len() - 1) / 2], values[values.len() / 2])
}

/// Medians over 20 random halves: each model's residuals of readings that it was not fitted to.
#[test]
fn models_of_a_real_ur10_leave_what_they_should() {
    let Some(file) = found() else {
        println!(
            "skipped: series_c.csv of ipa-robot-accuracy is not there; ELASTOCAL_UR10_IPA can name its folder"
        );
        return;
    };
    let all = series(&file);
    assert_eq!(all.len(), 2773);
    let elastic = scenario("ur10");
    let mut rigid: Scenario = scenario("ur10");
    rigid.task.belief.nominal.compliance_rad_per_nm.fill(0.0);
    let full = [ParameterGroup::Geometry, ParameterGroup::Compliances];
    for (name, belief, groups, count, most_mm) in [
        (
            "frames",
            &rigid.task.belief,
            &[ParameterGroup::Frames][..],
            HALVES,
            0.92,
        ),
        (
            "geometry",
            &rigid.task.belief,
            &[ParameterGroup::Geometry],
            HALVES,
            0.46,
        ),
        (
            "geometry and compliances",
            &elastic.task.belief,
            &full,
            FULL_HALVES,
            0.45,
        ),
    ] {
        let left: Vec<f64> = (0..count)
            .into_par_iter()
            .map(|seed| left_mm(belief, &all, groups, seed))
            .collect();
        let median_mm = median(left);
        println!("{name}: {median_mm:.4} mm");
        assert!(median_mm < most_mm, "{name}: {median_mm} mm");
    }
}

/// A model selection over all poses: the geometry pays, masses do not; and what is left of it goes with joint angles.
#[test]
fn the_model_selection_of_a_real_ur10_is_climbed_as_far_as_it_carries() {
    let Some(file) = found() else {
        println!("skipped: series_c.csv of ipa-robot-accuracy is not there");
        return;
    };
    let all = series(&file);
    let scenario = scenario("ur10");
    let mut case = AbsoluteCase::new(&scenario.task.belief, &all).expect("readings");
    let model_selection = case
        .model_selection(ReadingWeights::AsNeeded)
        .expect("a model_selection");
    assert_eq!(model_selection.judged, all.len());
    let groups = model_selection.groups();
    assert!(groups.contains(&ParameterGroup::Geometry), "{groups:?}");
    assert!(!groups.contains(&ParameterGroup::Payload), "{groups:?}");
    let predicted: Vec<f64> = (model_selection.nested_models.iter())
        .map(|nested_model| {
            let judged = nested_model.cross_validation.as_ref().expect("judged");
            judged.distances.expect("readings").rms * 1e3
        })
        .collect();
    println!("{predicted:.4?} mm");
    assert!(predicted[0] > 0.7 && predicted[2] < 0.5, "{predicted:?}");
    let mut case = AbsoluteCase::new(&scenario.task.belief, &all).expect("readings");
    let fit = case
        .fit(&[ParameterGroup::Geometry], ReadingWeights::AsNeeded)
        .expect("a fit");
    let patterns = case.looked_at(&fit, &all).expect("stable").patterns(&[]);
    assert!(patterns.share > 0.3, "{}", patterns.share);
    let first = &patterns.found[0];
    assert_eq!(first.against.kind(), "joint angle", "{}", first.sentence);
}
