//! What `compare` and `[gate]` refuse, seen from outside the process.

use serde_json::{Value, json};

use crate::gate::{RUN, STUDY, at, compare, evaluated, pair, stored};
use crate::support::{Workplace, error_message, list, scenario_text};

/// Of which results an edit asks another question, where, how, the name of the difference, and what the error says.
fn other_questions() -> [(
    &'static str,
    &'static str,
    Value,
    &'static str,
    &'static str,
); 10] {
    [
        (
            RUN,
            "/provenance/scenario_sha256",
            json!("0123456789abcdef"),
            "scenario",
            "klimchik2012 0123456789ab, not klimchik2012",
        ),
        (RUN, "/provenance/seed", json!(7), "seed", "seed (7, not 1)"),
        (
            RUN,
            "/experiments",
            json!(4),
            "experiments",
            "experiments (4, not 3)",
        ),
        (
            RUN,
            "/plans/1/name",
            json!("mine"),
            "plans",
            "optimal, mine, random, not optimal, klimchik2012_m3, random",
        ),
        (
            RUN,
            "/provenance/noise_only",
            json!(true),
            "errors",
            "errors (noise alone, not those of the scenario)",
        ),
        (
            RUN,
            "/provenance/inputs_sha256",
            json!({"test_poses": "0123456789abcdef", "plan": "0"}),
            "inputs",
            "inputs (test_poses 0123456789ab, not none)",
        ),
        (
            STUDY,
            "/trials",
            json!(4000),
            "trials",
            "trials (4000, not 20000)",
        ),
        (
            STUDY,
            "/level",
            json!("robot"),
            "level",
            "level (robot, not model)",
        ),
        (
            "plan",
            "/criterion",
            json!("d"),
            "criterion",
            "criterion (d, not test_pose)",
        ),
        (
            "plan",
            "/schema/name",
            json!("elastocal.evaluate"),
            "schema,criterion",
            "elastocal.evaluate 1, not elastocal.plan 1",
        ),
    ]
}

/// Each is refused, or named where it is allowed.
#[test]
fn answers_to_other_questions_are_refused_or_named() {
    for (file, pointer, value, setting, says) in other_questions() {
        let base = if file == "plan" {
            let mut planned = evaluated();
            planned["schema"]["name"] = json!("elastocal.plan");
            planned["criterion"] = json!("test_pose");
            planned
        } else {
            stored(file)
        };
        let mut new = base.clone();
        let (parent, key) = pointer.rsplit_once('/').expect("a path");
        new.pointer_mut(parent).expect("there")[key] = value;
        let outcome = compare(&base, &new, "--quiet").ends_with(1);
        assert!(outcome.stdout.is_empty(), "{outcome:#?}");
        let lines: Vec<_> = outcome.stderr.lines().collect();
        assert_eq!(lines.len(), 2, "{outcome:#?}");
        assert!(
            lines[0].starts_with("error E0703: new.json: differs from base.json in "),
            "{lines:?}"
        );
        let hint = format!("--allow-different {setting} compares");
        if !setting.starts_with("schema") {
            assert!(
                lines[0].contains(says) && lines[1].contains(&hint),
                "{lines:?}"
            );
        }
        let options = format!("--allow-different {setting}");
        let allowed = compare(&base, &new, &options).ends_with(0);
        let first = setting.split(',').next().expect("a name");
        allowed.prints(&format!("They differ in {first}, as allowed: "));
        let json = compare(&base, &new, &format!("{options} --json")).json();
        assert_eq!(json["allowed_differences"][0]["setting"], first);
    }
}

#[test]
fn what_only_one_file_has_is_named() {
    let base = stored(RUN);
    let mut new = base.clone();
    new["plans"].as_array_mut().expect("an array").remove(1);
    for (base, new) in [(&base, &new), (&new, &base)] {
        let refused = compare(base, new, "--quiet").ends_with(1);
        refused.says(" in plans (");
        let json = compare(base, new, "--allow-different plans --json")
            .ends_with(0)
            .json();
        let missing = list(&json["not_compared"]);
        assert!(missing.len() == 9 && missing.iter().all(|key| key["plan"] == "klimchik2012_m3"));
        assert_eq!(json["changes"].as_array().map(Vec::len), Some(18));
    }
    // A joint that is missing within a plan is damage, if the scenario is the same.
    let mut new = base.clone();
    let assessment = at(&mut new, "/plans/0/assessment");
    for key in ["parameters", "compliance_std_rad_per_nm"] {
        assessment[key].as_array_mut().expect("an array").pop();
    }
    let refused = compare(&base, &new, "--quiet").ends_with(1);
    refused.says("standard_error of joint_6, plan optimal: only one");
}

#[test]
fn files_that_are_no_results_are_refused() {
    let workplace = pair(&stored(RUN), &stored(RUN));
    std::fs::create_dir(workplace.path("folder")).expect("can be made");
    for (name, content, says) in not_results() {
        workplace.write(name, content);
        for pair in [format!("{name} new.json"), format!("base.json {name}")] {
            let outcome = workplace.refused(&format!("compare {pair}"));
            let start = format!("{name}: {says}");
            assert!(
                error_message(&outcome.stderr).is_some_and(|said| said.starts_with(&start)),
                "{start}\n{}",
                outcome.stderr
            );
            assert!(outcome.stdout.is_empty());
        }
    }
    for (name, says) in [
        ("missing.json", "cannot be read"),
        ("folder", "is a folder"),
    ] {
        let outcome = workplace.refused(&format!("compare base.json {name}"));
        assert!(
            outcome
                .stderr
                .starts_with(&format!("error E0601: {name}: {says}")),
            "{outcome:#?}"
        );
    }
    let before = workplace.listing();
    workplace.refused("compare base.json new.json --markdown nowhere/s.md");
    workplace.misused("compare base.json");
    workplace.misused("compare base.json new.json --allow-different sead");
    assert_eq!(workplace.listing(), before);
}

#[test]
fn a_wrong_gate_is_an_error_with_its_key() {
    let cases = [
        (
            "rho = { relative = 0.1 }",
            "unknown field `rho`",
            Some("did you mean `rho0`?"),
        ),
        (
            "standard_errors = { relative = 0.1 }",
            "unknown field `standard_errors`",
            Some("did you mean `standard_error`?"),
        ),
        (
            "rho0 = { relativ = 0.1 }",
            "gate.rho0.relativ (line 3): unknown field `relativ`",
            Some("did you mean `relative`?"),
        ),
        (
            "rho0 = { relative = -0.1 }",
            "gate.rho0.relative: found -0.1; zero or a positive number is allowed",
            None,
        ),
        (
            "rho0 = { relative = nan }",
            "gate.rho0.relative: found NaN",
            None,
        ),
        (
            "mean_error = { absolute_um = inf }",
            "gate.mean_error.absolute_um: found inf",
            None,
        ),
        (
            "rho0 = { absolute = 1 }",
            "gate.rho0.absolute: unknown field `absolute`, expected `relative`, `absolute_um` or `direction`",
            Some("did you mean `absolute_um`?"),
        ),
        (
            "violations = { absolute_um = 1 }",
            "gate.violations.absolute_um: unknown field `absolute_um`",
            Some("did you mean `absolute`?"),
        ),
        (
            "rho0 = { direction = \"larger\" }",
            "unknown variant `larger`, expected one of `worse`, `both`, `none`",
            None,
        ),
        (
            "rho0 = { guard_band = 1 }",
            "gate.rho0.guard_band: is not estimated and has no uncertainty; mean_error has",
            None,
        ),
        ("rho0 = 0.01", "gate.rho0 (line 3)", None),
    ];
    let workplace = Workplace::new();
    for (gate, says, hint) in cases {
        let text = scenario_text("planar_3r").replacen('\n', &format!("\ngate.{gate}\n"), 1);
        let text = text.replacen("gate.", "\ngate.", 1);
        workplace.write("s.toml", text);
        let outcome = workplace.refused("check s.toml --quiet");
        let mut lines = outcome.stderr.lines();
        let error = lines.next().unwrap_or_default();
        assert!(
            error.starts_with("error E0101: s.toml: gate") && error.contains(says),
            "{error}"
        );
        let hint = hint.map(|hint| format!("hint: {hint}"));
        assert_eq!(lines.next().map(str::to_owned), hint, "{error}");
    }
}

/// Files that are no results: their names, what is in them, and what the error says.
fn not_results() -> Vec<(&'static str, String, &'static str)> {
    let edited = |pointer: &str, value: Value| {
        let mut results = stored(RUN);
        *at(&mut results, pointer) = value;
        results.to_string()
    };
    let mut no_rho0 = stored(RUN);
    at(&mut no_rho0, "/plans/0/assessment")
        .as_object_mut()
        .expect("an object")
        .remove("rho0_mm");
    let gate = |gate: Value| edited("/gate", gate);
    let nan = edited("/efficiency", json!(1)).replace("\"efficiency\":1,", "\"efficiency\":NaN,");
    let twice = edited("/efficiency", json!(1));
    let twice = twice.replace("\"efficiency\":1,", "\"efficiency\":1,\"efficiency\":2,");
    vec![
        ("twice.json", twice, "found the key `efficiency` twice"),
        ("empty.json", String::new(), "is not JSON: EOF"),
        ("nan.json", nan, "is not JSON: expected value at line 1"),
        (
            "text.json",
            "rho0 = 6".into(),
            "is not JSON: expected value at line 1 column 1",
        ),
        (
            "other.json",
            json!({ "name": "other", "version": 3 }).to_string(),
            "schema.name: is not a results file of elastocal",
        ),
        (
            "array.json",
            "[1, 2]".into(),
            "schema.name: is not a results file of elastocal",
        ),
        (
            "future.json",
            edited("/schema/version", json!(3)),
            "schema.version: found 3; this elastocal (0.1.0) reads up to 2",
        ),
        (
            "measure.json",
            edited("/schema/name", json!("elastocal.measure")),
            "schema.name: found \"elastocal.measure\"; results of run, plan, evaluate and study",
        ),
        (
            "no_seed.json",
            edited("/provenance", json!({ "version": "0.1.0" })),
            "provenance: missing field `commit`",
        ),
        (
            "word.json",
            edited("/plans/0/assessment/rho0_mm", json!("six")),
            "plans[0].assessment.rho0_mm: invalid type: string \"six\"",
        ),
        (
            "negative.json",
            edited("/plans/0/assessment/rho0_mm", json!(-0.5)),
            "plans[0].assessment.rho0_mm: found -0.5; zero or a positive number",
        ),
        (
            "no_rho0.json",
            no_rho0.to_string(),
            "plans[0].assessment: missing field `rho0_mm`",
        ),
        (
            "few.json",
            edited("/plans/2/assessment/parameters", json!(["joint_2"])),
            "plans[2].assessment.compliance_std_rad_per_nm: found 5 numbers for 1 joints",
        ),
        (
            "gate.json",
            gate(json!({ "rho": {} })),
            "gate.rho: unknown field `rho`",
        ),
        (
            "minus.json",
            gate(json!({ "rho0": { "relative": -1 } })),
            "gate.rho0.relative: found -1; zero or a positive number",
        ),
    ]
}
