//! `compare` and the table `[gate]`, seen from outside the process.

use std::process::Command;

use serde_json::{Value, json};

use crate::support::{Outcome, Workplace, list, project, scenario_text, shipped};

/// Results of `run` and `study` with three and seven plans.
pub const RUN: &str = "scenarios/baselines/klimchik2012_results.json";
pub const STUDY: &str = "scenarios/baselines/klimchik2012_study.json";

/// Stored results without their gate: the defaults apply.
pub fn stored(file: &str) -> Value {
    let text = std::fs::read_to_string(project(file)).expect("can be read");
    let mut results: Value = serde_json::from_str(&text).expect("JSON");
    results["gate"] = json!({});
    results
}

/// What `evaluate` prints, made from what `run` says of a plan.
pub fn evaluated() -> Value {
    let run = stored(RUN);
    let mut results = run["plans"][0]["assessment"].clone();
    results["schema"] = json!({ "name": "elastocal.evaluate", "version": 2 });
    results["provenance"] = run["provenance"].clone();
    results
}

pub fn at<'a>(results: &'a mut Value, pointer: &str) -> &'a mut Value {
    results
        .pointer_mut(pointer)
        .unwrap_or_else(|| panic!("there is no {pointer}"))
}

/// A folder with two results files.
pub fn pair(base: &Value, new: &Value) -> Workplace {
    let workplace = Workplace::with("base.json", base.to_string());
    workplace.write("new.json", new.to_string());
    workplace
}

pub fn compare(base: &Value, new: &Value, options: &str) -> Outcome {
    pair(base, new).run(&format!("compare base.json new.json {options}"))
}

/// Asserts that exactly these changes are beyond tolerance, as "quantity plan of".
fn assert_broken([base, new]: [&Value; 2], options: &str, expected: &[&str]) {
    let outcome = compare(base, new, &format!("{options} --json --quiet"));
    let outcome = outcome.ends_with(if expected.is_empty() { 0 } else { 3 });
    let json = outcome.json();
    let broken: Vec<String> = (list(&json["changes"]).iter())
        .filter(|change| change["ok"] == false)
        .map(|change| {
            let text = |key: &str| change[key].as_str().unwrap_or("-").to_owned();
            format!("{} {} {}", text("quantity"), text("plan"), text("of"))
        })
        .collect();
    assert_eq!(broken, expected, "{outcome:#?}");
    assert_eq!(json["ok"], expected.is_empty());
    assert_eq!(
        outcome.stderr.is_empty(),
        expected.is_empty(),
        "{outcome:#?}"
    );
}

/// A number of the stored results: the file, where it is, its name, and which sign is worse.
type Place = (&'static str, &'static str, &'static str, f64);

const PLACES: [Place; 5] = [
    (RUN, "/plans/0/assessment/rho0_mm", "rho0 optimal -", 1.0),
    (
        RUN,
        "/plans/1/assessment/efficiency",
        "efficiency klimchik2012_m3 -",
        -1.0,
    ),
    (
        RUN,
        "/plans/0/assessment/compliance_std_rad_per_nm/2",
        "standard_error optimal joint_4",
        1.0,
    ),
    (
        RUN,
        "/plans/2/test_poses/0/residual_mm",
        "realised_error random milling",
        1.0,
    ),
    (STUDY, "/plans/1/mean_mm", "mean_error 2a -", 1.0),
];

fn quantity(name: &str) -> &str {
    name.split(' ').next().expect("a word")
}

fn scaled(results: &Value, pointer: &str, factor: f64) -> Value {
    let mut results = results.clone();
    let number = at(&mut results, pointer);
    *number = json!(number.as_f64().expect("a number") * factor);
    results
}

/// Just inside its tolerance a number may get worse, just outside it may not; better it may always
/// get, unless the direction is both.
#[test]
fn each_tolerance_breaks_at_its_edge_and_only_for_the_worse() {
    let defaults = [0.01, 0.01, 0.05, 0.05, 0.05];
    for ((file, pointer, name, worse), default) in PLACES.into_iter().zip(defaults) {
        let base = stored(file);
        for tolerance in [None, Some(0.002)] {
            let relative = tolerance.unwrap_or(default);
            for direction in ["worse", "both", "none"] {
                let gate = match tolerance {
                    None => json!({ quantity(name): { "direction": direction } }),
                    Some(tolerance) => {
                        json!({ quantity(name): { "relative": tolerance, "direction": direction } })
                    }
                };
                let judged = |change: f64, expected: &[&str]| {
                    let mut new = scaled(&base, pointer, 1.0 + change);
                    new["gate"] = gate.clone();
                    assert_broken([&base, &new], "", expected);
                };
                let beyond: &[&str] = if direction == "none" { &[] } else { &[name] };
                let other_way: &[&str] = if direction == "both" { &[name] } else { &[] };
                judged(0.99 * relative * worse, &[]);
                judged(1.01 * relative * worse, beyond);
                judged(-0.99 * relative * worse, &[]);
                judged(-1.01 * relative * worse, other_way);
            }
        }
    }
}

/// With a guard band of r U about an estimated change, it is accepted below the tolerance less that, rejected above the tolerance and
/// that, and inconclusive between (JCGM 106).
#[test]
fn a_guard_band_decides_what_an_estimate_can() {
    let base = stored(STUDY);
    let number = |key: &str| base["plans"][1][key].as_f64().expect("a number");
    let (mean, error) = (number("mean_mm"), number("mean_std_mm"));
    for times in [1.0, 0.5] {
        let guard = times * 1.959_963_984_540_054 * 2.0_f64.sqrt() * error / mean;
        let tolerance = 3.0 * guard;
        let gate = json!({ "mean_error": { "relative": tolerance, "guard_band": times } });
        let judged = |change: f64| {
            let mut new = scaled(&base, "/plans/1/mean_mm", 1.0 + change);
            new["gate"] = gate.clone();
            let outcome = compare(&base, &new, "--json --quiet");
            let json = outcome.json();
            let changes = list(&json["changes"]);
            let changed = (changes.iter())
                .find(|each| each["quantity"] == "mean_error" && each["plan"] == "2a");
            let changed = changed.expect("it is compared");
            let decision = changed["decision"].as_str().expect("a word").to_owned();
            assert_eq!(changed["ok"], decision == "accept");
            (decision, outcome.code, outcome.stderr)
        };
        for (change, decision, says) in [
            (tolerance - 1.01 * guard, "accept", ""),
            (
                tolerance - 0.99 * guard,
                "inconclusive",
                "condition C0405: inconclusive, the tolerance is within",
            ),
            (
                tolerance + 0.99 * guard,
                "inconclusive",
                "condition C0405: inconclusive, the tolerance is within",
            ),
            (
                tolerance + 1.01 * guard,
                "reject",
                "changed beyond tolerance: mean_error, plan 2a",
            ),
        ] {
            let (found, code, stderr) = judged(change);
            assert_eq!(
                (&*found, code),
                (decision, Some(if says.is_empty() { 0 } else { 3 }))
            );
            assert!(stderr.contains(says), "{stderr}");
        }
        let mut same = base.clone();
        same["gate"] = json!({ "mean_error": { "relative": 0.5 * guard, "guard_band": times } });
        assert_eq!(compare(&base, &same, "--quiet").code, Some(0));
    }
}

/// Absolute tolerances are in the unit of their key, and the larger tolerance counts.
#[test]
fn absolute_tolerances_have_units() {
    let units = [
        ("absolute_um", 1e-3, 0.5),
        ("absolute", 1.0, 0.02),
        ("absolute_rad_per_nm", 1.0, 4e-9),
        ("absolute_um", 1e-3, 0.5),
        ("absolute_um", 1e-3, 0.5),
    ];
    for ((file, pointer, name, worse), (key, unit, tolerance)) in PLACES.into_iter().zip(units) {
        let base = stored(file);
        let judged = |gate: Value, change: f64, expected: &[&str]| {
            let mut new = base.clone();
            let number = at(&mut new, pointer);
            *number = json!(number.as_f64().expect("a number") + change * unit * worse);
            new["gate"] = json!({ quantity(name): gate });
            assert_broken([&base, &new], "", expected);
        };
        for gate in [
            json!({ key: tolerance }),
            json!({ key: tolerance, "relative": 1e-6 }),
        ] {
            judged(gate.clone(), 0.99 * tolerance, &[]);
            judged(gate, 1.01 * tolerance, &[name]);
        }
        judged(
            json!({ key: tolerance / 1e3, "relative": 0.5 }),
            tolerance,
            &[],
        );
    }
}

#[test]
fn no_violation_and_no_failed_run_may_be_added() {
    let base = stored(RUN);
    let mut new = base.clone();
    let violations = "/plans/1/assessment/violations";
    let violation = at(&mut new, violations)[0].clone();
    at(&mut new, violations)
        .as_array_mut()
        .expect("an array")
        .push(violation);
    assert_broken([&base, &new], "", &["violations klimchik2012_m3 -"]);
    assert_broken([&new, &base], "", &[]);
    new["gate"] = json!({ "violations": { "absolute": 1 } });
    assert_broken([&base, &new], "", &[]);

    let base = stored(STUDY);
    let mut new = base.clone();
    *at(&mut new, "/plans/6/failed") = json!(1);
    assert_broken([&base, &new], "", &["failed_runs optimal -"]);
    assert_broken([&new, &base], "", &[]);
}

/// A number that is there on one side only cannot be measured.
#[test]
fn null_on_one_side_breaks() {
    for (file, pointer, name, _) in PLACES {
        let base = stored(file);
        let mut null = base.clone();
        *at(&mut null, pointer) = Value::Null;
        assert_broken([&base, &null], "", &[name]);
        assert_broken([&null, &base], "", &[name]);
        assert_broken([&null, &null], "", &[]);
        let mut ignored = null.clone();
        ignored["gate"] = json!({ quantity(name): { "direction": "none" } });
        assert_broken([&base, &ignored], "", &[]);
    }
}

/// Every number is compared, and each once.
#[test]
fn the_output_says_what_was_compared() {
    let (run, study) = (stored(RUN), stored(STUDY));
    let outcome = compare(&run, &run, "").ends_with(0);
    let expected = "27 numbers compared (rho0, efficiency, standard_error, realised_error, violations): all within tolerance.\nAll are the same to the last bit.\n";
    assert!(outcome.stdout.ends_with(expected), "{outcome:#?}");
    let json = compare(&study, &study, "--json").ends_with(0).json();
    assert_eq!(
        json["quantities"],
        json!(["rho0", "mean_error", "failed_runs"])
    );
    assert_eq!(json["changes"].as_array().map(Vec::len), Some(21));
    assert_eq!(json["identical"], true);
    let json = compare(&evaluated(), &evaluated(), "--json")
        .ends_with(0)
        .json();
    assert_eq!(json["changes"].as_array().map(Vec::len), Some(8));
    let rho0 = &json["changes"][0];
    assert_eq!(
        (&rho0["quantity"], &rho0["plan"], &rho0["unit"]),
        (&json!("rho0"), &json!("plan"), &json!("um"))
    );
    assert_eq!(
        rho0["base"].as_f64(),
        evaluated()["rho0_mm"].as_f64().map(|mm| mm * 1e3)
    );
    assert_eq!((&rho0["change"], &rho0["ok"]), (&json!(0.0), &json!(true)));
    assert_eq!(json["base"]["provenance"], evaluated()["provenance"]);
}

/// Plans may share a name, as a scenario's own "random" does with that of `run`.
#[test]
fn plans_of_the_same_name_are_told_apart() {
    let mut base = stored(RUN);
    *at(&mut base, "/plans/1/name") = json!("random");
    let new = scaled(&base, "/plans/2/assessment/rho0_mm", 2.0);
    assert_broken([&base, &new], "", &["rho0 random (2) -"]);
}

#[test]
fn exactness_is_for_the_same_platform() {
    let base = stored(RUN);
    let pointer = "/plans/0/assessment/rho0_mm";
    let mut new = scaled(&base, pointer, 1.0 - f64::EPSILON);
    assert_ne!(new.pointer(pointer), base.pointer(pointer));
    assert_broken([&base, &new], "", &[]);
    assert_broken([&base, &new], "--exact", &["rho0 optimal -"]);
    // Rounding is less than a billionth, and 1 % is more.
    assert_broken([&base, &new], "--within 1e-9", &[]);
    let better = scaled(&base, pointer, 0.995);
    assert_broken([&base, &better], "", &[]);
    assert_broken([&base, &better], "--within 1e-9", &["rho0 optimal -"]);
    new["provenance"]["platform"] = json!("pdp11 unix");
    assert_broken([&base, &new], "--exact", &[]);
    let outcome = compare(&base, &new, "--exact").ends_with(0);
    outcome.prints("The base is of another platform (");
    assert!(!outcome.stdout.contains("last bit"), "{outcome:#?}");
    // Another commit is no other question.
    new["provenance"]["commit"] = json!("feedbeef0123-dirty");
    let outcome = compare(&base, &new, "").ends_with(0);
    outcome.prints("(feedbeef0123-dirty), pdp11 unix");
}

#[test]
fn the_summary_is_markdown() {
    let mut base = stored(RUN);
    *at(&mut base, "/plans/1/name") = json!("a|b<i>");
    let new = scaled(&base, "/plans/1/assessment/rho0_mm", 1.25);
    let workplace = pair(&base, &new);
    let command = "compare base.json new.json --markdown summary.md";
    let outcome = workplace.doubted(&format!("{command} --quiet"));
    assert_eq!(
        outcome.stderr,
        "condition C0404: changed beyond tolerance: rho0, plan a|b<i>\n"
    );
    let summary = workplace.read("summary.md");
    let (top, all) = summary.split_once("<details>").expect("details");
    assert!(
        top.starts_with("### Gate failed: klimchik2012\n\n27 numbers compared ("),
        "{top}"
    );
    assert!(top.contains("): 1 beyond tolerance.\n"), "{top}");
    let row = top
        .lines()
        .find(|line| line.contains("rho0 [um]"))
        .expect("a row");
    assert_eq!(
        row,
        "| a\\|b&lt;i> | rho0 [um] | 6.5882 | 8.2352 | +25.00 % | +1 % |"
    );
    assert_eq!(top.matches("rho0 [um]").count(), 1, "only what is broken");
    assert!(top.contains("| base | base.json | 0.1.0 ("), "{top}");
    assert_eq!(all.matches(" [um] |").count(), 6);
    // Each row of a table has as many cells as its header.
    for table in summary.split("\n\n").filter(|part| part.starts_with('|')) {
        let cells = |line: &str| line.replace("\\|", "").matches('|').count();
        let header = table.lines().next().map(cells);
        assert!(
            table.lines().all(|line| Some(cells(line)) == header),
            "{table}"
        );
    }
    workplace.write("new.json", base.to_string());
    workplace.done(command);
    assert!(
        workplace
            .read("summary.md")
            .starts_with("### Gate passed: klimchik2012\n")
    );
}

/// The scenario's gate arrives where results are compared, and is no part of the question.
#[test]
fn results_carry_the_gate_of_their_scenario() {
    let workplace = Workplace::new();
    let plain = scenario_text("planar_3r");
    workplace.write("s.toml", &plain);
    let study = "study s.toml --trials 64 --json --quiet";
    let first = workplace.done(study).json();
    workplace.done(&format!("{study} --shard 1/2 --tally-out one"));
    let gate = "\n# A comment.\n[gate]\nmean_error = { absolute_um = 0.5, direction = \"both\" }\n";
    workplace.write("s.toml", plain.clone() + gate);
    workplace.done(&format!("{study} --shard 2/2 --tally-out two"));
    let joined = workplace.json("merge two one");
    assert_eq!(first["gate"], json!({}));
    assert_eq!(
        joined["gate"],
        json!({ "mean_error": { "absolute_um": 0.5, "direction": "both" } })
    );
    assert_eq!(
        joined["schema"],
        json!({ "name": "elastocal.study", "version": 2 })
    );
    assert_eq!(first["plans"], joined["plans"]);
    let change = compare(&first, &joined, "--json").ends_with(0).json()["changes"][1].clone();
    assert_eq!(change["quantity"], "mean_error");
    assert_eq!(
        (&change["tolerance"], &change["direction"]),
        (&json!(0.5), &json!("both"))
    );
    // Everything else is.
    workplace.write(
        "s.toml",
        plain.replace("sigma_mm = 0.03", "sigma_mm = 0.031"),
    );
    let other = workplace.done(study).json();
    let refused = compare(&first, &other, "").ends_with(1);
    refused.says("differs from base.json in scenario (s ");
    let partial = workplace
        .run(&format!("{study} --shard 2/2 --tally-out two"))
        .json();
    compare(&partial, &partial, "").ends_with(1);
}

/// What a command prints without how long it took.
fn untimed(text: &str) -> Vec<&str> {
    let timed = ["elapsed_s", "runs_per_s"];
    (text.lines())
        .filter(|line| !timed.iter().any(|key| line.contains(key)))
        .collect()
}

#[test]
fn the_same_command_gives_the_same_bits() {
    let workplace = Workplace::with("s.toml", scenario_text("planar_3r"));
    workplace.done("plan s.toml --plan-out plan.csv --quiet");
    for command in [
        "plan s.toml",
        "evaluate s.toml --plan plan.csv",
        "run s.toml",
        "study s.toml --trials 500",
        "study s.toml --trials 64 --level robot",
    ] {
        let print = || workplace.done(&format!("{command} --json --quiet")).stdout;
        let (one, two) = (print(), print());
        assert_eq!(untimed(&one), untimed(&two), "{command}");
        workplace.write("one.json", one);
        workplace.write("two.json", two);
        let outcome = workplace.done("compare one.json two.json --exact --json");
        assert_eq!(outcome.json()["identical"], true, "{command}");
    }
}

/// On another platform sines and cosines differ in their last bits, and the search may end in an
/// equally good plan. glibc can be told to do as on a processor without fused multiply-adds.
#[test]
#[cfg(all(target_arch = "x86_64", target_env = "gnu"))]
fn another_platform_stays_within_the_gate_of_the_stored_results() {
    let workplace = Workplace::new();
    for arguments in [
        "run scenarios/klimchik2012.toml --quiet",
        "study scenarios/klimchik2012.toml --trials 20000 --quiet",
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_elastocal"))
            .args(arguments.split(' '))
            .arg("--out")
            .arg(workplace.path(""))
            .env("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2")
            .current_dir(project(""))
            .output()
            .expect("the program starts");
        assert!(output.status.success(), "{output:?}");
    }
    for name in ["results", "study"] {
        let base = shipped(&format!("scenarios/baselines/klimchik2012_{name}.json"));
        let command = format!("compare {base} klimchik2012/{name}.json");
        workplace.done(&command);
    }
}
