//! Tallies that are not as they were written: reading them ends in an error.

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
    workplace.done("study s.toml --quiet --shard 1/1 --tally-out t.json");
    serde_json::from_str(&workplace.read("t.json")).expect("JSON")
}

/// The value at a path such as "study/plans/0/name".
fn at<'a>(json: &'a mut Value, path: &str) -> &'a mut Value {
    json.pointer_mut(&format!("/{path}")).expect("is there")
}

/// One changed number, text or name anywhere, however plausible, is damage.
#[test]
fn changed_tallies() {
    let workplace = Workplace::new();
    let good = tally(&workplace);
    workplace.done("merge t.json");
    for (path, value, says) in [
        ("elastocal_tally", json!(6), "elastocal_tally: found 6"),
        ("sha256", json!("0"), "is not as it was written"),
        ("study/trials", json!(5001), "is not as it was written"),
        ("study/shards", json!(0), "is not as it was written"),
        ("study/parameters/0", json!("x"), "is not as it was written"),
        ("study/scenario", json!("../x"), "study.scenario: found"),
        ("study/plans/0/sigma_m", json!("NaN"), "study.plans[0]"),
        ("blocks_done", json!(2), "is not as it was written"),
        ("tallies", json!([]), "is not as it was written"),
        ("tallies/0/runs", json!(4999), "is not as it was written"),
        ("tallies/0/failed", json!([]), "tallies[0].failed"),
        ("tallies/0/sums/0", json!("1"), "is not as it was written"),
        ("tallies/0/sums/0", json!("x"), "tallies[0].sums"),
        (
            "tallies/0/histogram/0/0",
            json!(1_u64 << 40),
            "tallies[0].histogram",
        ),
    ] {
        let mut bad = good.clone();
        *at(&mut bad, path) = value;
        workplace.write("bad.json", bad.to_string());
        let error = join(&[workplace.path("bad.json")]).expect_err(path);
        assert!(error.to_string().contains(says), "{path}: {error}");
    }
    for command in ["merge bad.json", "study s.toml --quiet --resume bad.json"] {
        workplace.refused(command).says("tallies[0].histogram");
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
