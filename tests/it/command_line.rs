//! The commands from outside the process: results, diagnostics, exit codes and files.

use std::process::Command;

use elastocal::measurement::read_measurements;
use elastocal::plan::read_plan;
use serde_json::Value;

use crate::support::{Outcome, Workplace, list, number, numbers, project, scenario_text, shipped};

const FULL: &str = "klimchik2012";

/// A folder with the paper's scenario, its plan of three, and a shorter name for each.
fn workplace() -> Workplace {
    let workplace = Workplace::with("s.toml", scenario_text(FULL));
    let plan = std::fs::read(project("scenarios/plans/klimchik2012_m3.csv"));
    workplace.write("plan.csv", plan.expect("can be read"));
    workplace
}

const MEASURE: &str = "measure s.toml --plan plan.csv --measurements-out m.csv";
const IDENTIFY: &str = "identify s.toml --measurements m.csv --identified-out i.json";
const COMPENSATE: &str = "compensate s.toml --identified i.json";

fn measured_and_identified() -> Workplace {
    let workplace = workplace();
    workplace.done(MEASURE);
    workplace.done(IDENTIFY);
    workplace
}

/// Asserts that the JSON object has these keys with values that are not null.
fn has(json: &Value, keys: &[&str]) {
    for key in keys {
        assert!(
            json.get(key).is_some_and(|value| !value.is_null()),
            "no {key} in {json:#}"
        );
    }
}

const EVALUATE_KEYS: [&str; 8] = [
    "experiments",
    "parameters",
    "rho0_mm",
    "compliance_std_rad_per_nm",
    "criteria",
    "lower_bound_rho0_mm",
    "efficiency",
    "violations",
];
const IDENTIFY_KEYS: [&str; 6] = [
    "parameters",
    "compliance_rad_per_nm",
    "compliance_std_rad_per_nm",
    "sigma_mm",
    "rank",
    "condition",
];
const COMPENSATE_KEYS: [&str; 3] = ["q_commanded_deg", "uncompensated_mm", "residual_mm"];

#[test]
fn every_command_prints_its_keys() {
    let workplace = measured_and_identified();
    let json = |arguments: &str, code| {
        let outcome = workplace
            .run(&format!("{arguments} --json --quiet"))
            .ends_with(code);
        if code == 0 {
            assert_eq!(outcome.stderr, "", "{arguments}");
        }
        outcome.json()
    };

    let check = json("check s.toml", 0);
    assert_eq!(
        (&check["ok"], &check["problems"]),
        (&true.into(), &serde_json::json!([]))
    );
    assert_eq!(check["provenance"]["scenario"], "s");
    assert_eq!(
        check["schema"],
        serde_json::json!({ "name": "elastocal.check", "version": 2 })
    );

    let plan = json("plan s.toml --experiments 2", 0);
    has(&plan, &EVALUATE_KEYS);
    has(&plan, &["plan", "elapsed_s", "provenance"]);
    assert_eq!(plan["experiments"], 2);
    for experiment in list(&plan["plan"]) {
        assert_eq!(numbers(&experiment["q_deg"]).len(), 6);
        assert_eq!(
            numbers(&experiment["wrench"]),
            [0.0, 0.0, -2500.0, 0.0, 0.0, 0.0]
        );
        assert!(experiment["repeats"].as_u64().expect("a count") >= 1);
    }

    // One angle of the printed plan is 0.03 degrees beyond its bound.
    let evaluate = json("evaluate s.toml --plan plan.csv", 3);
    has(&evaluate, &EVALUATE_KEYS);
    assert_eq!(evaluate["experiments"], 3);
    assert_eq!(evaluate["violations"].as_array().map(Vec::len), Some(1));
    assert_eq!(evaluate["violations"][0]["experiment"], 2);

    let measure = json("measure s.toml --plan plan.csv --noise-free", 0);
    has(&measure, &["measurements", "provenance"]);
    let measurements = list(&measure["measurements"]);
    assert_eq!(measurements.len(), 3);
    assert_eq!(numbers(&measurements[0]["q_deg"]).len(), 6);
    assert_eq!(numbers(&measurements[0]["wrench"]).len(), 6);
    assert_eq!(numbers(&measurements[0]["deflection_mm"]).len(), 3);

    let identify = json("identify s.toml --measurements m.csv", 0);
    has(&identify, &IDENTIFY_KEYS);
    has(&identify, &["provenance"]);
    assert_eq!(identify["rank"], 5);
    assert_eq!(identify["sigma_mm"], 0.03);
    assert_eq!(
        identify["parameters"],
        serde_json::json!(["joint_2", "joint_3", "joint_4", "joint_5", "joint_6"])
    );

    let compensate = json(COMPENSATE, 0);
    has(&compensate, &COMPENSATE_KEYS);
    has(&compensate, &["provenance"]);
    assert_eq!(numbers(&compensate["q_commanded_deg"]).len(), 6);
    // The design page says: deflections of 1.03 mm at the test pose by eq. 2; more with gravity.
    let uncompensated = number(&compensate["uncompensated_mm"]);
    assert!((1.0..1.3).contains(&uncompensated), "{uncompensated}");
    assert!(number(&compensate["residual_mm"]) < 0.03);
}

/// Results go to stdout, diagnostics to stderr.
#[test]
fn results_and_diagnostics_do_not_mix() {
    let workplace = measured_and_identified();
    for arguments in ["check s.toml", MEASURE, IDENTIFY, COMPENSATE] {
        let loud = workplace.done(arguments);
        assert!(
            !loud.stdout.is_empty() && loud.stderr.starts_with("scenario s.toml: "),
            "{loud:#?}"
        );
        let quiet = workplace.done(&format!("{arguments} --quiet"));
        assert_eq!(quiet.stderr, "");
        let untimed = |outcome: &Outcome| outcome.stdout.split("It took").next().map(str::to_owned);
        assert_eq!(untimed(&quiet), untimed(&loud), "{arguments}");
    }
    // A condition is said even if nothing else is.
    let outcome = workplace.doubted("check s.toml --plan plan.csv --quiet");
    assert_eq!(
        outcome.stderr,
        "condition C0102: the plan has 1 violation\n"
    );
    outcome.prints("experiment 2: tool elevation is 30.033 deg");
}

#[test]
fn check_tells_a_program_what_is_wrong() {
    let workplace = workplace();
    workplace.write(
        "bad.toml",
        scenario_text(FULL).replace("sigma_mm", "sigma_um"),
    );
    let outcome = workplace.refused("check bad.toml --json --quiet");
    let json = outcome.json();
    assert_eq!(json["ok"], false);
    assert_eq!(json["provenance"]["scenario"], "bad");
    let pretty = serde_json::to_string_pretty(&json).expect("JSON");
    assert_eq!(outcome.stdout, pretty + "\n");
    assert_eq!(json["code"], "E0101");
    let problem = json["problems"][0].as_str().expect("a text");
    assert!(problem.contains("sigma_um"), "{problem}");
    assert_eq!(
        outcome.stderr.lines().next(),
        Some(format!("error E0101: {problem}").as_str())
    );
}

/// Standard deviations that a file brings count, and are what `identify` names.
#[test]
fn a_files_own_standard_deviations_are_named() {
    let workplace = measured_and_identified();
    let plain = workplace.run(&format!("{IDENTIFY} --json")).json();
    let mut own = String::new();
    for line in workplace.read("m.csv").lines() {
        let is_header = line.starts_with("q1_deg");
        let columns = if is_header {
            "sx_mm,sy_mm,sz_mm"
        } else {
            "0.06,0.06,0.06"
        };
        own += &format!("{line},{columns}\n");
    }
    workplace.write("m.csv", own);
    let json = workplace.done(&format!("{IDENTIFY} --json")).json();
    let of = |json: &Value, key: &str| number(&json[key]);
    assert!((of(&json, "sigma_mm") - 0.06).abs() < 1e-12, "{json:#}");
    // The residuals are what they were.
    let change = of(&json, "residual_sigma_mm") / of(&plain, "residual_sigma_mm");
    assert!((change - 1.0).abs() < 1e-6, "{change}");
    let text = workplace.run(IDENTIFY);
    text.prints("sigma 0.0600 mm, from residuals 0.0");
}

#[test]
fn the_seed_is_all_that_chance_depends_on() {
    let workplace = workplace();
    let measured = |options: &str| {
        workplace.done(&format!("{MEASURE} {options}"));
        workplace.read("m.csv")
    };
    let first = measured("");
    assert_eq!(measured(""), first);
    assert_eq!(measured("--seed 1"), first, "the scenario's own seed");
    assert_ne!(measured("--seed 2"), first);
    let [noise_free, of_another_seed] = ["--noise-free", "--seed 2 --noise-free"].map(|options| {
        let rows = measured(options);
        rows.lines()
            .filter(|line| !line.starts_with('#'))
            .map(str::to_owned)
            .collect::<Vec<_>>()
    });
    assert_eq!(of_another_seed, noise_free);
    let outcome =
        workplace.run("measure s.toml --plan plan.csv --json --seed 18446744073709551615");
    let json = outcome.ends_with(0).json();
    assert_eq!(json["provenance"]["seed"], u64::MAX);
}

/// Everything but the time that it took.
fn timeless(outcome: Outcome) -> Value {
    let mut json = outcome.ends_with(0).json();
    json.as_object_mut()
        .expect("an object")
        .remove("elapsed_s")
        .expect("is there");
    json
}

#[test]
fn threads_change_no_bit() {
    let workplace = workplace();
    let [one, two] = [1, 2]
        .map(|threads| timeless(workplace.run(&format!("run s.toml --json --threads {threads}"))));
    assert_eq!(one, two);
}

fn folder_of_run(workplace: &Workplace) -> Value {
    let outcome = workplace.done("run s.toml --json --out results");
    let printed = outcome.json();
    let written = workplace.parsed("results/s/results.json");
    assert_eq!(printed, written);
    // As in an identified file, so that it can be a prior.
    assert!(written["identified_with"]["robot_sha256"].is_string());
    assert!(written["error_sources"].is_array());
    written
}

#[test]
fn run_writes_files_that_agree() {
    let workplace = workplace();
    let results = folder_of_run(&workplace);
    assert!(!workplace.path("out").exists(), "--out names the folder");
    has(
        &results,
        &["plan", "measurements", "elapsed_s", "provenance", "plans"],
    );
    has(&results, &EVALUATE_KEYS);
    has(&results, &IDENTIFY_KEYS);
    has(&results, &COMPENSATE_KEYS);
    assert_eq!(results["provenance"]["seed"], 1);
    assert_eq!(results["provenance"]["scenario"], "s");
    assert_eq!(
        results["provenance"]["scenario_sha256"]
            .as_str()
            .map(str::len),
        Some(64)
    );

    let plan = read_plan(&workplace.path("results/s/plan.csv"), 6).expect("valid");
    let listed = list(&results["plan"]);
    assert_eq!(plan.experiments.len(), listed.len());
    for (experiment, listed) in plan.experiments.iter().zip(listed) {
        let angles = numbers(&listed["q_deg"]);
        for (angle, listed) in experiment.configuration_rad.iter().zip(angles) {
            assert!((angle.to_degrees() - listed).abs() < 1e-12);
        }
        assert_eq!(
            experiment.load.wrench().as_slice(),
            numbers(&listed["wrench"])
        );
        assert_eq!(listed["repeats"], experiment.repeats);
    }
    let path = workplace.path("results/s/measurements.csv");
    let measurements = read_measurements(&path, 6).expect("valid");
    let listed = list(&results["measurements"]);
    assert_eq!(measurements.len(), 3);
    for (measurement, listed) in measurements.iter().zip(listed) {
        for (value, listed) in measurement
            .deflection_m
            .iter()
            .zip(numbers(&listed["deflection_mm"]))
        {
            assert!((value * 1e3 - listed).abs() < 1e-12);
        }
    }
    let names: Vec<_> = (list(&results["plans"]).iter())
        .map(|plan| plan["name"].as_str().expect("a name"))
        .collect();
    assert_eq!(names, ["optimal", "klimchik2012_m3", "random"]);
    assert_eq!(
        results["plans"][0]["assessment"]["rho0_mm"],
        results["rho0_mm"]
    );
    assert!(
        results["efficiency"].as_f64() > results["plans"][1]["assessment"]["efficiency"].as_f64()
    );
}

fn assert_close(one: &Value, other: &Value, key: &str) {
    let flat = |value: &Value| {
        if value.is_array() {
            numbers(value)
        } else {
            vec![value.as_f64().expect("a number")]
        }
    };
    let (one, other) = (flat(&one[key]), flat(&other[key]));
    assert_eq!(one.len(), other.len(), "{key}");
    for (one, other) in one.iter().zip(other) {
        assert!(
            (one - other).abs() <= 1e-9 * one.abs().max(1e-3),
            "{key}: {one}, {other}"
        );
    }
}

/// Step by step with files in between, it is the same calibration.
#[test]
fn the_steps_make_the_run() {
    let workplace = workplace();
    let results = folder_of_run(&workplace);
    workplace.done("measure s.toml --plan results/s/plan.csv --measurements-out m.csv");
    let identified = workplace.done(&format!("{IDENTIFY} --json")).json();
    let compensated = workplace.done(&format!("{COMPENSATE} --json")).json();
    for key in [
        "compliance_rad_per_nm",
        "compliance_std_rad_per_nm",
        "consistency",
        "residual_sigma_mm",
    ] {
        let scaled = |json: &Value| {
            let values = if json[key].is_array() {
                numbers(&json[key])
            } else {
                vec![number(&json[key])]
            };
            let unit = if key.ends_with("per_nm") { 1e6 } else { 1.0 };
            serde_json::json!({ key: values.iter().map(|value| value * unit).collect::<Vec<_>>() })
        };
        assert_close(&scaled(&identified), &scaled(&results), key);
    }
    for key in ["q_commanded_deg", "uncompensated_mm", "residual_mm"] {
        assert_close(&compensated, &results, key);
    }
    let written = workplace.parsed("i.json");
    assert_eq!(written, identified);
}

/// Paths inside a scenario are relative to it, those on the command line to the working folder.
#[test]
fn works_from_another_folder() {
    let workplace = Workplace::new();
    let shipped = shipped("scenarios/klimchik2012.toml");
    workplace.done(&format!("check {shipped}"));
    let elsewhere = workplace.refused("check");
    elsewhere.says("error E0601: scenarios/kr270.toml: cannot be read");
    elsewhere.says("hint: give the path of a scenario file");
    assert_eq!(workplace.listing(), [] as [&str; 0]);

    let output = Command::new(env!("CARGO_BIN_EXE_elastocal"))
        .arg("check")
        .current_dir(project(""))
        .output()
        .expect("starts");
    let stdout = String::from_utf8_lossy(&output.stdout);
    assert!(
        stdout.ends_with("\nscenarios/kr270.toml is valid\n"),
        "{stdout}"
    );
}

/// MuJoCo warns of this model, whose two first joints share an axis and have no inertia between
/// them; by itself it would do so in a file in the working folder.
#[test]
fn mujoco_writes_no_file() {
    let workplace = Workplace::with("twins.xml", crate::identifiability::TWINS);
    workplace.write("twins.toml", crate::identifiability::TWINS_SCENARIO);
    let before = workplace.listing();
    let outcome = workplace.done("check twins.toml");
    outcome.says("warning: MuJoCo: Inertia matrix");
    assert_eq!(workplace.done("check twins.toml --quiet").stderr, "");
    assert_eq!(workplace.listing(), before);
}

#[test]
fn budget_says_how_many_measurements_are_needed() {
    let place = Workplace::new();
    let scenario = shipped("scenarios/klimchik2012.toml");
    let arguments =
        format!("budget {scenario} --up-to 4 --accuracy-um 7 --plot-out plot.svg --json --quiet");
    let json = place.done(&arguments).json();
    let points = list(&json["budget"]);
    let rho0 = |m: u64, c: u64| {
        let point = points.iter().find(|point| {
            point["experiments"].as_u64() == Some(m) && point["configurations"].as_u64() == Some(c)
        });
        number(&point.expect("there is")["rho0_mm"])
    };
    // More measurements tell more, and so do more configurations.
    assert!(rho0(3, 3) < rho0(2, 2) && rho0(4, 4) < rho0(3, 3));
    assert!(rho0(4, 4) < 1.001 * rho0(4, 3) && rho0(4, 3) < rho0(4, 2));
    assert_eq!(json["needed"]["experiments"], 3);
    // At the scenario's own size it is searched as a plan is.
    let text = scenario_text("klimchik2012").replacen("experiments = 3", "experiments = 2", 1);
    place.write("two.toml", text);
    let planned = place.json("plan two.toml --no-proof")["rho0_mm"].clone();
    let two = place.json("budget two.toml --up-to 2 --no-proof --allow C0107");
    let found = number(&two["budget"][0]["rho0_mm"]);
    assert!(
        found <= planned.as_f64().expect("a number") * (1.0 + 1e-9),
        "{two} {planned}"
    );
    let plot = place.read("plot.svg");
    assert!(plot.starts_with("<svg") && plot.contains("wanted: 7 \u{b5}m"));
    assert!(plot.contains(">needed<"));
    crate::browser::plot_looks_well(&place.path("plot.svg"));
    let arguments = arguments.replace("--accuracy-um 7", "--accuracy-um 1");
    let outcome = place.doubted(&arguments);
    assert!(outcome.json()["needed"].is_null());
    outcome.says("condition C0107: no plan of up to 4 measurements reaches 1 um\n");
}

/// What `budget` shows an accuracy of is a plan in a scenario, too: compliances that are known before need no measurement.
#[test]
fn one_measurement_is_a_plan_where_the_rest_is_known() {
    let workplace = Workplace::new();
    let text = scenario_text("kr270").replace("experiments = 3", "experiments = 1");
    let end = text.find("[[plan]]").expect("plans");
    workplace.write("s.toml", &text[..end]);
    workplace.done("plan s.toml --no-proof --quiet --plan-out p.csv");
}
