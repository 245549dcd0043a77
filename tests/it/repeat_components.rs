//! Variance components of repeated visits: how each joint returns, and what readings of one visit do not share.

use std::cell::RefCell;

use elastocal::identification::{AbsoluteCase, ParameterGroup, ReadingWeights, RepeatComponents};
use elastocal::measurement::{AbsoluteReading, absolute_table};
use elastocal::numeric::random::generator;
use elastocal::scenario::Scenario;
use nalgebra::DVector;
use rayon::prelude::*;

use crate::model_selection::read_where;
use crate::one_fit::{between, normal, seen_arm, ur10, workplace};
use crate::support::{
    Workplace, absolute_scenario_text, assert_alike, list, number, numbers, scenario_text,
};

/// How each joint returns (rad).
const RETURNS: [f64; 6] = [5e-5, 3e-5, 4e-5, 1e-4, 8e-5, 1.2e-4];

/// Visits of poses in turn, each read so many times.
fn visits(seed: u64, poses: usize, visits: usize, times: usize) -> Vec<AbsoluteReading> {
    let mut random = generator(51, seed);
    let arm = seen_arm(&mut random, &ur10(), 1, 1);
    let commands: Vec<DVector<f64>> = (0..poses)
        .map(|_| DVector::from_fn(6, |_, _| between(&mut random, -2.6, 2.6)))
        .collect();
    let returns = RefCell::new((generator(52, seed), Vec::new(), 0));
    let gear = |joint: usize, _: f64| {
        let (random, visit, calls) = &mut *returns.borrow_mut();
        // All readings of a visit share it.
        if *calls % (6 * times) == 0 {
            *visit = RETURNS.map(|each| each * normal(random)).to_vec();
        }
        *calls += 1;
        visit[joint]
    };
    let told = |reading: usize, _: &mut _| commands[reading / times % poses].clone();
    let count = poses * visits * times;
    let mut readings = read_where(&mut random, &arm, (count, 0.0), told, &gear);
    for (place, reading) in readings.iter_mut().enumerate() {
        reading.visit = (times > 1).then(|| format!("v{}", place / times));
    }
    readings
}

fn components(scenario: &Scenario, readings: &[AbsoluteReading]) -> RepeatComponents {
    let mut case = AbsoluteCase::new(&scenario.task.belief, readings).expect("readings");
    let fit = case.fit(&[ParameterGroup::Frames], ReadingWeights::AsNeeded);
    case.repeat_components(&fit.expect("a fit"))
        .expect("repeats")
}

/// How many of the joints' intervals of 95 % hold the true standard deviation, of so many.
fn held(campaigns: u64, poses: usize, times: usize) -> [usize; 2] {
    let scenario = ur10();
    let each = (0..campaigns).into_par_iter().map(|seed| {
        let found = components(&scenario, &visits(seed, poses, times, 1));
        assert!(found.components.iter().all(|each| each.level == "visit"));
        assert_eq!(found.poses.len(), poses);
        let joints = found.components.iter();
        let joints = joints.filter(|each| each.joints.len() == 1);
        let is_held = joints.map(|each| {
            let [low, high] = each.interval95.map(|end| end * 1e-3);
            (low..=high).contains(&RETURNS[each.joints[0]])
        });
        let is_held: Vec<bool> = is_held.collect();
        [is_held.iter().filter(|held| **held).count(), is_held.len()]
    });
    each.reduce(
        || [0; 2],
        |one, other| [one[0] + other[0], one[1] + other[1]],
    )
}

/// Intervals of 95 % hold the true standard deviations, where there are few visits and an estimate may be at zero, too: of 240, fewer than
/// 216 with a probability below 1e-3.
#[test]
fn joint_returns_lie_in_their_intervals() {
    for (poses, times) in [(8, 12), (8, 3), (5, 4)] {
        let [held, all] = held(40, poses, times);
        println!("{poses} poses, {times} visits: {held} of {all}");
        assert_eq!(all, 240);
        assert!(
            held >= 216,
            "{poses} poses, {times} visits: {held} of {all}"
        );
    }
}

/// Readings that scatter twice as much as is stated are told from returns where each visit has two.
#[test]
fn readings_of_one_visit_tell_their_noise() {
    let mut readings = visits(50, 8, 12, 2);
    for reading in &mut readings {
        reading.covariance = reading.covariance.map(|covariance| covariance * 0.25);
    }
    let found = components(&ur10(), &readings);
    let reading = &found.components[0];
    assert_eq!(reading.level, "reading");
    // 576 numbers within visits alone: known to 3 %.
    assert_alike(reading.standard_uncertainty, 2.0, 0.12);
    assert!(reading.degrees_of_freedom > 500.0, "{reading:?}");
}

/// A file of repeats gives tables that a plan takes as they are; what few poses do not tell apart is said.
#[test]
fn repeats_become_error_sources() {
    let place = workplace(&visits(60, 8, 12, 1));
    let identify =
        "identify s.toml --measurements m.csv --parameters frames --uncertainties-out u.toml";
    let found = place.record(identify);
    let components = &found["repeat_components"];
    assert_eq!(components["components"].as_array().map(Vec::len), Some(6));
    let sentences = list(&components["not_separated"]);
    assert_eq!(sentences.len(), 1, "{components}");
    let tables = place.read("u.toml");
    assert_eq!(tables.matches("joint_repeatability").count(), 6, "{tables}");
    place.write("f.toml", scenario_text("ur10") + &tables);
    let planned = place.record("plan f.toml --no-proof --experiments 4");
    let sources = planned["uncertainty_budget"].to_string();
    assert!(sources.contains("elbow repeatability"), "{sources}");
    // A source is of the difference of two visits.
    let of = &components["components"][0];
    let visit_rad = number(&of["standard_uncertainty"]) * 1e-3;
    let told = format!("{:.3e}", visit_rad * std::f64::consts::SQRT_2 * 1e3);
    let told = format!("std_mrad = {}", told.parse::<f64>().expect("a number"));
    assert!(tables.contains(&told), "{told}: {tables}");
    // What a scenario lists already would count twice beside them.
    assert!(!tables.contains("In place of"), "{tables}");
    let listed = "\n[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.1\n";
    let scenario = place.read("s.toml");
    place.write("s.toml", format!("{scenario}{listed}"));
    place.run(&format!("{identify} --quiet"));
    let told = "# In place of what the scenario lists, not beside it: joint_repeatability.";
    let tables = place.read("u.toml");
    assert!(tables.contains(told), "{tables}");
    place.write("s.toml", scenario);
    // Few numbers: all joints have one variance.
    place.write("m.csv", absolute_table(&6.into(), &visits(61, 4, 2, 1)));
    let few = place.record(identify);
    let few = &few["repeat_components"];
    let sentences = list(&few["not_separated"]);
    assert!(sentences.len() > 1, "{few}");
}

/// Errors of the tracker that are listed are new in each reading, and no joint's return: with 10 um of noise and some 30 um of range, intervals of
/// 95 % hold the true returns. Of 120, fewer than 105 with a probability below 1e-3.
#[test]
fn a_tracker_s_listed_errors_are_no_returns() {
    const RUNS: usize = 20;
    const LISTED: &str = r#"
[[station]]
name = "far"
position_mm = [-6000, -3000, 1500]

[[uncertainty]]
kind = "tracker_range"
std_um_per_m = 5

[[uncertainty]]
kind = "joint_repeatability"
std_mrad = 0.03
"#;
    let truth_mrad = 0.03 / std::f64::consts::SQRT_2;
    let place = Workplace::new();
    let text = absolute_scenario_text("ur10").replace("sigma_mm = 0.02", "sigma_mm = 0.01");
    // Anywhere: the arm alone is looked at.
    let (head, region) = text.split_once("[region]").expect("a region");
    let (_, tail) = region.split_once("[design]").expect("a design");
    place.write("s.toml", format!("{head}[design]{tail}{LISTED}"));
    let mut random = generator(57, 0);
    let mut plan = String::from("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,repeats\n");
    for _ in 0..8 {
        let q =
            [170.0, 80.0, 140.0, 170.0, 170.0, 170.0].map(|most| between(&mut random, -most, most));
        let [q1, q2, q3, q4, q5, q6] = q;
        plan += &format!(
            "{q1:.2},{:.2},{q3:.2},{q4:.2},{q5:.2},{q6:.2},12\n",
            q2 - 90.0
        );
    }
    place.write("p.csv", plan);
    let (mut count, mut within) = (0, 0);
    for run in 0..RUNS {
        place.json(&format!(
            "measure s.toml --plan p.csv --run {run} --measurements-out m.csv"
        ));
        let identify = "identify s.toml --measurements m.csv --parameters frames --json --quiet";
        let found = place.run(identify).json();
        let components = found["repeat_components"]["components"].as_array();
        for each in components.expect("components") {
            let interval = numbers(&each["interval95"]);
            count += 1;
            within += usize::from(interval[0] <= truth_mrad && truth_mrad <= interval[1]);
        }
    }
    println!("{within} of {count}");
    assert!(count == 6 * RUNS && within >= 105, "{within} of {count}");
}
