//! Readings of robots whose joints err as functions of their own angles, or otherwise than the scenario says: nothing good is left out, nothing
//! is added to what the scenario explains, and what it does not explain is named.

use std::fmt::Write;

use serde_json::Value;

use crate::support::{Workplace, absolute_scenario_text, number};

/// Poses all over the joints' ranges, of both targets in turn.
fn poses(count: usize) -> String {
    let middles = [0.0, -75.0, 70.0, 0.0, 0.0, 0.0];
    let ranges = [170.0, 45.0, 50.0, 170.0, 170.0, 170.0];
    let steps = [2.0_f64, 3.0, 5.0, 7.0, 11.0, 13.0].map(f64::sqrt);
    let mut rows = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,target\n".to_owned();
    for row in 1..=count {
        for joint in 0..6 {
            let share = 2.0 * (row as f64 * steps[joint]).fract() - 1.0;
            let _ = write!(rows, "{:.4},", middles[joint] + ranges[joint] * share);
        }
        rows += ["reflector\n", "spindle\n"][row % 2];
    }
    rows
}

/// The UR10 read anywhere, with these error sources.
fn robot(sources: &[(&str, &str)]) -> String {
    let text = absolute_scenario_text("ur10")
        .replace("tool_height_min_mm = 300", "tool_height_min_mm = -2000")
        .replace("tool_radius_min_mm = 400", "tool_radius_min_mm = 0");
    let each = sources.iter();
    let tables = each.map(|(kind, keys)| format!("\n[[uncertainty]]\nkind = \"{kind}\"\n{keys}\n"));
    text + &tables.collect::<String>()
}

/// What is identified by one scenario of a robot that another one has sampled.
fn identified(place: &Workplace, [truth, belief]: [&str; 2], run: u64) -> Value {
    place.done(&format!(
        "measure {truth} --plan p.csv --run {run} --measurements-out m.csv"
    ));
    let identify = format!("identify {belief} --measurements m.csv --parameters geometry");
    told(place, &identify)
}

fn told(place: &Workplace, arguments: &str) -> Value {
    place.run(&format!("{arguments} --json --quiet")).json()
}

fn has(json: &Value, code: &str) -> bool {
    let conditions = json["conditions"].as_array().expect("conditions");
    conditions.iter().any(|each| each["code"] == code)
}

/// Readings that are off by what joints are off by, further where these move the tool further, are no outliers, whether the scenario lists
/// these functions or not. Where it does, next to nothing is new at the poses besides: without that more than 0.05 mm would be.
#[test]
fn what_joints_are_off_by_is_no_outlier_and_no_remainder() {
    let place = Workplace::with("p.csv", poses(80));
    for hidden in ["hidden = true", ""] {
        let functions = format!("std_mrad = 0.4\ncorrelation_deg = 6\n{hidden}");
        let text = robot(&[
            ("joint_zero", "std_mrad = 1"),
            ("joint_repeatability", "std_mrad = 0.03"),
            ("transmission_error", &functions),
        ]);
        place.write("s.toml", text);
        let mut remainders = Vec::new();
        for run in [0, 1, 2, 3, 22] {
            let found = identified(&place, ["s.toml"; 2], run);
            assert_eq!(found["rejected"], serde_json::json!([]), "run {run}");
            remainders.push(number(&found["discrepancy_model"]["remainder_mm"]));
        }
        let mean = remainders.iter().sum::<f64>() / remainders.len() as f64;
        assert_eq!(mean > 0.05, !hidden.is_empty(), "{remainders:?}");
        assert!(!hidden.is_empty() || mean < 0.02, "{remainders:?}");
    }
}

/// Estimates that lie further from their priors than these allow are named, by `next` as by `identify`, and those of robots that are as the
/// scenario says are not.
#[test]
fn priors_that_are_too_narrow_are_named() {
    let place = Workplace::with("p.csv", poses(40));
    for (name, factor) in [("narrow.toml", 1.0), ("wide.toml", 3.0)] {
        let of = |key: &str, size: f64| format!("{key} = {}", size * factor);
        let text = robot(&[
            ("joint_zero", &of("std_mrad", 0.5)),
            ("link_position", &of("std_mm", 0.3)),
            ("link_rotation", &of("std_mrad", 0.5)),
        ]);
        place.write(name, text);
    }
    for run in 0..6 {
        let same = identified(&place, ["narrow.toml"; 2], run);
        assert!(!has(&same, "C0215"), "{}", same["conditions"]);
        let wide = identified(&place, ["wide.toml", "narrow.toml"], run);
        assert!(has(&wide, "C0215"), "{}", wide["conditions"]);
    }
    let next =
        "next narrow.toml --measurements m.csv --experiments 42 --draw 20 --parameters geometry";
    let found = told(&place, next);
    assert!(has(&found, "C0215") && !has(&found, "C0205"), "{found}");
}

/// `next` predicts by the scenario's error sources, and says where readings contradict them.
#[test]
fn the_next_readings_are_planned_by_errors_that_are_true() {
    let place = Workplace::with("p.csv", poses(40));
    let zeros = ("joint_zero", "std_mrad = 0.5");
    place.write("quiet.toml", robot(&[zeros]));
    let loud = ("discrepancy", "std_mm = 0.3\nof = \"pose\"");
    place.write("loud.toml", robot(&[zeros, loud]));
    let next = "next quiet.toml --measurements m.csv --experiments 42 --draw 20 --parameters zeros";
    for truth in ["quiet.toml", "loud.toml"] {
        place.done(&format!(
            "measure {truth} --plan p.csv --measurements-out m.csv"
        ));
        let found = told(&place, next);
        assert_eq!(has(&found, "C0205"), truth == "loud.toml", "{found}");
    }
}
