//! Tallies that cannot be: whatever a tally's JSON says, reading it ends in a study or in an error.

use elastocal::numeric::random::generator;
use elastocal::record::tally_file::join;
use rand::RngExt;
use serde_json::{Value, json};

use crate::support::{Workplace, scenario_text};

const STUDY: &str = r#"
[study]
trials = 5000

[[study.plan]]
name = "random"
kind = "random"

[[study.plan]]
name = "each"
kind = "random_each"
"#;

/// A small study's whole tally.
fn tally(workplace: &Workplace) -> Value {
    let text = scenario_text("klimchik2012");
    let start = text.find("[study]").expect("is there");
    workplace.write("s.toml", text[..start].to_owned() + STUDY);
    workplace
        .run("study s.toml --quiet --shard 1/1 --tally-out t.json")
        .ends_with(0);
    serde_json::from_str(&workplace.read("t.json")).expect("JSON")
}

/// The value at a path such as "study/plans/0/name".
fn at<'a>(json: &'a mut Value, path: &str) -> &'a mut Value {
    json.pointer_mut(&format!("/{path}")).expect("is there")
}

/// What is put where, and what the error says.
#[rustfmt::skip]
fn cases(good: &Value) -> Vec<(&'static str, Value, &'static str)> {
    let text = |path: &str| good.pointer(&format!("/{path}")).expect("is there").clone();
    let sum = |index: usize| -> i128 {
        let text = text(&format!("tallies/0/sums/{index}"));
        text.as_str().expect("text").parse().expect("a number")
    };
    let one_bin_more = {
        let mut bins = text("tallies/0/histogram");
        let first = bins[0].clone();
        bins.as_array_mut().expect("an array").push(first);
        bins
    };
    let name = "\u{1b}[2J";
    vec![
        ("elastocal_tally", json!(4), "elastocal_tally: found 4"),
        ("study/trials", json!(0), "study.trials: found 0; 1 to"),
        ("study/trials", json!(u64::MAX), "study.trials: found 18446744073709551615"),
        ("study/shards", json!(0), "study.shards: found 0"),
        ("study/shards", json!(u64::MAX), "study.shards: found 18446744073709551615"),
        ("study/plans", json!([]), "study.plans: found 0; 1 to"),
        ("study/parameters", json!([]), "study.parameters: found 0"),
        ("study/parameters/0", json!(name), "study.parameters[0]: found"),
        ("study/scenario", json!(name), "study.scenario: found"),
        ("study/platform", json!(name), "study.platform: found"),
        ("study/plans/0/name", json!(name), "study.plans[0].name: found"),
        ("study/plans/0/reference", json!(99), "study.plans[0].reference: found 99; 0 to 1"),
        ("study/plans/0/sigma_m", json!("NaN"), "study.plans[0].sigma_m"),
        ("study/plans/0/sigma_m", json!(1e308), "study.plans[0].sigma_m: found 1e308"),
        ("study/plans/0/load_scale", json!(-1.0), "study.plans[0].load_scale: found -1"),
        ("study/plans/0/experiments", json!(0), "study.plans[0].experiments: found 0"),
        ("study/plans/1/experiments", json!(6), "reference: found 0, a plan under other"),
        ("study/gate", json!({"rho0": {"relative": -1}}), "study.gate.rho0.relative: found -1"),
        ("shard", json!(2), "shard: found 2; 1 to 1"),
        ("blocks_done", json!(4), "blocks_done: found 4; 0 to 3"),
        ("blocks_done", json!(2), "tallies[0].runs: found 5000"),
        ("tallies", json!([]), "tallies: found 0; there are 2 plans"),
        ("tallies/0/runs", json!(0), "tallies[0].runs: found 0"),
        ("tallies/0/runs", json!(u64::MAX), "tallies[0].runs: found 18446744073709551615"),
        ("tallies/0/pairs", json!(5001), "tallies[0].pairs: found 5001; 0 to 5000"),
        ("tallies/0/failed", json!([]), "tallies[0].failed: found 0 numbers"),
        ("tallies/0/failed/0", json!(u64::MAX), "tallies[0].runs"),
        ("tallies/0/sums", json!(["1"]), "tallies[0].sums"),
        ("tallies/0/sums/0", json!("-1"), "tallies[0].sums[0]: found -1"),
        ("tallies/0/sums/0", json!("x"), "tallies[0].sums"),
        ("tallies/0/sums/1", json!(i128::MAX.to_string()), "tallies[0].sums[1]"),
        ("tallies/0/sums/0", json!((sum(0) * 2).to_string()), "tallies[0].sums"),
        ("tallies/0/sums/1", json!((sum(1) / 2).to_string()), "tallies[0].sums[1]"),
        ("tallies/0/sums/2", json!("0"), "tallies[0].sums[2]"),
        ("tallies/0/sums/3", json!((sum(3) * 2).to_string()), "tallies[0].sums[3]"),
        ("tallies/0/sums/7", json!("0"), "tallies[0].sums[7]"),
        ("tallies/0/histogram", json!([]), "tallies[0].histogram: does not count 5000"),
        ("tallies/0/histogram", one_bin_more, "tallies[0].histogram: found"),
        ("tallies/0/histogram/0/0", json!(1_u64 << 40), "tallies[0].histogram: found"),
        ("tallies/0/histogram/0/0", json!(-1), "tallies[0].histogram[0]"),
    ]
}

#[test]
fn impossible_tallies() {
    let workplace = Workplace::new();
    let good = tally(&workplace);
    workplace.run("merge t.json").ends_with(0);
    let mut wrong = Vec::new();
    for (path, value, says) in cases(&good) {
        let mut bad = good.clone();
        *at(&mut bad, path) = value;
        workplace.write("bad.json", bad.to_string());
        match join(&[workplace.path("bad.json")]) {
            Err(error) if error.to_string().contains(says) && error.hint.is_some() => {}
            other => wrong.push(format!("{path}: {says:?} is not in {other:?}")),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let mut bad = good.clone();
    *at(&mut bad, "study/plans/0/reference") = json!(99);
    workplace.write("bad.json", bad.to_string());
    for command in ["merge bad.json", "study s.toml --quiet --resume bad.json"] {
        let outcome = workplace.run(command).ends_with(1);
        assert!(
            outcome.stderr.contains("reference: found 99"),
            "{outcome:#?}"
        );
    }
}

/// Every number and text of a tally, put out of order in many ways: nothing panics, and nothing takes
/// memory or time that the file has not.
#[test]
fn mutated_tallies() {
    let workplace = Workplace::new();
    let mut good = tally(&workplace);
    // Most of a tally is its histogram.
    for plan in 0..2 {
        let bins = at(&mut good, &format!("tallies/{plan}/histogram"));
        bins.as_array_mut().expect("an array").truncate(3);
    }
    let mut paths = Vec::new();
    collect("", &good, &mut paths);
    let values = [
        json!(null),
        json!(0),
        json!(-1),
        json!(1),
        json!(u64::MAX),
        json!(1e308),
        json!(""),
        json!("NaN"),
        json!("-1e-320"),
        json!("170141183460469231731687303715884105727"),
        json!("../../../x"),
        json!([]),
        json!([[0, 0], [3071, u64::MAX], [3071, u64::MAX]]),
        json!({}),
    ];
    let mut random = generator(1, 0);
    for _ in 0..1500 {
        let mut bad = good.clone();
        for _ in 0..random.random_range(1..4) {
            let path = &paths[random.random_range(0..paths.len())];
            if let Some(place) = bad.pointer_mut(path) {
                *place = values[random.random_range(0..values.len())].clone();
            }
        }
        workplace.write("bad.json", bad.to_string());
        // The truncated histograms alone make it wrong.
        let error = join(&[workplace.path("bad.json")]).expect_err("cannot be");
        assert!(!error.problem.is_empty());
    }
    // Text that is cut off anywhere is no tally.
    let text = good.to_string();
    for _ in 0..100 {
        let end = random.random_range(0..text.len());
        workplace.write("bad.json", &text.as_bytes()[..end]);
        join(&[workplace.path("bad.json")]).expect_err("is cut off");
    }
}

fn collect(path: &str, value: &Value, paths: &mut Vec<String>) {
    paths.push(path.to_owned());
    match value {
        Value::Array(values) => {
            for (index, value) in values.iter().enumerate() {
                collect(&format!("{path}/{index}"), value, paths);
            }
        }
        Value::Object(values) => {
            for (key, value) in values {
                collect(&format!("{path}/{key}"), value, paths);
            }
        }
        _ => {}
    }
}
