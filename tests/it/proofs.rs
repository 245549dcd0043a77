//! The bound that is proved, from the library and the command line; its proof, checked by another program.

use std::path::Path;
use std::process::Command;

use elastocal::experiment::Loads;
use elastocal::plan::Criterion;
use elastocal::plan::proof::ProofLimits;
use elastocal::plan::search::{Bound, BoundKind};
use serde_json::{Value, json};

use crate::support::{Workplace, project, scenario, shipped, table4};

fn effort(gap: f64, boxes: u64) -> ProofLimits<'static> {
    ProofLimits {
        gap,
        boxes,
        records: false,
        stop: &|| false,
        progress: &|_, _| {},
    }
}

#[test]
fn the_papers_problem_is_proved_to_a_thousandth() {
    let scenario = scenario("klimchik2012");
    let searched = Bound::search(&scenario.task, scenario.seed);
    let proved = Bound::search_and_prove(
        &scenario.task,
        Criterion::TestPose,
        scenario.seed,
        &[],
        Some(effort(1e-3, 150_000)),
    );
    let proof = proved.proof().expect("it was asked for");
    let proof = proof.as_ref().expect("it is proved");
    assert!(proof.largest().gap() <= 1e-3 * (1.0 + 1e-6) && proof.largest().boxes < 150_000);
    for m in [2, 3, 4, 6, 12] {
        let plain = searched.of_size(m).expect("there is a bound");
        let bound = proved.of_size(m).expect("there is a bound");
        assert_eq!(plain.kind, BoundKind::Evidence);
        assert_eq!(bound.kind, BoundKind::Proved);
        // rho0 goes with the root of the derivative.
        let ratio = bound.best / plain.best;
        assert!((1.0 - 0.6e-3..=1.0 + 1e-9).contains(&ratio), "{ratio}");
        assert_eq!(
            bound.proof.as_ref().map(|proof| proof.best),
            Some(bound.best)
        );
        let plan = proved.of_plan(&table4(m)).ok();
        assert!(plan.is_none_or(|plan| plan == bound));
    }
}

/// The angle of the first joint that moves does not matter to the derivative then, and must not take boxes.
#[test]
fn a_force_of_any_direction_takes_few_boxes() {
    let mut scenario = scenario("klimchik2012");
    scenario.task.loads = Loads::Any {
        force_max_n: 2500.0,
    };
    let effort = Some(effort(0.1, 240_000));
    let proved = Bound::search_and_prove(
        &scenario.task,
        Criterion::TestPose,
        scenario.seed,
        &[],
        effort,
    );
    let bound = proved.of_size(3).expect("a bound");
    let proof = bound.proof.expect("a proof");
    assert!(proof.boxes < 100_000, "{}", proof.boxes);
    let ratio = proof.best / bound.best;
    assert!((0.95..1.0).contains(&ratio), "{ratio}");
}

/// Small arms are proved at once, whether or not the first joints are parameters.
#[test]
fn small_arms_are_proved_at_once() {
    for (name, gap) in [("planar_3r", 5e-3), ("spatial_3r", 3e-3)] {
        let scenario = scenario(name);
        let effort = Some(effort(1e-3, 40_000));
        let proved = Bound::search_and_prove(
            &scenario.task,
            Criterion::TestPose,
            scenario.seed,
            &[],
            effort,
        );
        let proof = proved.of_size(3).expect("a bound").proof.expect("a proof");
        // By how much printed loads may be off is bounded roughly.
        assert!(proof.gap < gap && proof.boxes < 10_000, "{name}: {proof:?}");
    }
}

#[test]
fn a_wide_gap_is_told_beside_the_evidence() {
    let place = Workplace::new();
    let scenario = shipped("scenarios/klimchik2012.toml");
    let plan = shipped("scenarios/plans/klimchik2012_m3.csv");
    let evaluate = |options: &str| {
        let arguments = format!("evaluate {scenario} --plan {plan} --json --quiet {options}");
        serde_json::from_str::<Value>(&place.run(&arguments).stdout).expect("it prints JSON")
    };
    let without = evaluate("--no-proof");
    assert_eq!(without["bound_kind"], "evidence");
    assert_eq!(without["proof"], Value::Null);
    assert_eq!(without["proved_lower_bound_rho0_mm"], Value::Null);
    let with = evaluate("--prove 30%");
    assert_eq!(with["bound_kind"], "evidence");
    assert_eq!(with["lower_bound_rho0_mm"], without["lower_bound_rho0_mm"]);
    let number = |value: &Value| value.as_f64().expect("a number");
    assert!(number(&with["proof"]["gap"]) <= 0.3001);
    let ratio = number(&with["proved_lower_bound_rho0_mm"]) / number(&with["lower_bound_rho0_mm"]);
    assert!((0.87..1.0).contains(&ratio), "{ratio}");
}

#[test]
fn options_of_the_proof_are_understood_or_refused() {
    let place = Workplace::new();
    for (options, wanted) in [
        ("--prove nothing", "a share"),
        ("--prove 0", "a share"),
        ("--prove-time soon", "a time"),
        ("--prove-time 0s", "a time"),
        ("--no-proof --prove 1%", "cannot be used with"),
        ("--no-proof --proof-out proof.json", "cannot be used with"),
    ] {
        let outcome = place.run(&format!("plan {options}"));
        assert_eq!(outcome.code, Some(2), "{options}");
        assert!(
            outcome.stderr.contains(wanted),
            "{options}: {}",
            outcome.stderr
        );
    }
}

/// What is not in the prover is refused by name, and the bound that searches find stands.
#[test]
fn arms_of_more_than_hinges_have_no_proof() {
    let place = Workplace::new();
    for name in ["kr270_compensator", "kr270_flexible"] {
        let arguments = format!(
            "plan {} --experiments 3 --quiet",
            project(&format!("scenarios/{name}.toml")).display()
        );
        let told = place.done(&arguments);
        told.prints("there is no proof for arms with springs beside the joints' own");
        told.prints("no plan of as many can be below");
    }
}

/// Python, if it has `NumPy`; else it is said that something is skipped.
pub fn python() -> Option<String> {
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let has_numpy = Command::new(&python).args(["-c", "import numpy"]).output();
    let has_numpy = has_numpy.is_ok_and(|output| output.status.success());
    if !has_numpy {
        eprintln!("skipped: no Python with NumPy (pip install numpy, or PYTHON=...)");
    }
    has_numpy.then_some(python)
}

#[test]
fn another_program_checks_the_proof_and_refuses_what_was_tampered_with() {
    let Some(python) = python() else { return };
    let place = Workplace::new();
    let scenario = shipped("scenarios/spatial_3r.toml");
    let arguments =
        format!("plan {scenario} --experiments 3 --prove 30% --proof-out proof.json --quiet");
    place.run(&arguments).prints("wrote proof.json");
    let check = |name: &str| checked(&python, &place.path(name));
    let (code, text) = check("proof.json");
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("the proof holds"), "{text}");
    let whole = place.parsed("proof.json");
    // The question that is answered.
    let plan = place.run(&(arguments + " --json")).json();
    let hash = &plan["provenance"]["scenario_sha256"];
    for words in [
        &format!(
            "scenario spatial_3r, SHA-256 {}",
            hash.as_str().expect("a text")
        ),
        "test pose 1: [",
        "weight 1.0000",
        "loads: any force up to 400.0 N",
        "region: joints [",
        "sigma of each coordinate of a deflection 30.000 um",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let tampered: [(&str, Edit); 12] = [
        ("a heavier test pose, whose bounds are doubled", &|file| {
            scale(&mut file["targets"][0]["weight"], 4.0);
            for bound in file["bounds"].as_array_mut().expect("an array") {
                scale(&mut bound[1], 2.0);
            }
        }),
        ("a test pose of no weight", &|file| {
            let mut weightless = file["targets"][0].clone();
            weightless["weight"] = json!(0.0);
            file["targets"]
                .as_array_mut()
                .expect("an array")
                .push(weightless);
        }),
        ("a smaller largest derivative", &|file| {
            scale(&mut file["proof"]["largest"], 0.7);
        }),
        ("a cut tree", &|file| {
            edit_tree(file, |tree| tree.truncate(tree.len() / 2));
        }),
        ("a longer tree", &|file| {
            edit_tree(file, |tree| tree.push('.'));
        }),
        ("one box for all", &|file| {
            edit_tree(file, |tree| ".".clone_into(tree));
        }),
        ("a variable that there is not", &|file| {
            edit_tree(file, |tree| tree.replace_range(0..1, "7"));
        }),
        ("a smaller region", &|file| {
            scale(&mut file["proof"]["parts"][0]["ranges"][0][1], 0.5);
        }),
        ("a joint left out", &|file| {
            file["proof"]["parts"][0]["variables"][1] = Value::Null;
        }),
        ("a load left out", &|file| {
            file["proof"]["parts"] = json!([]);
        }),
        ("a larger bound", &|file| {
            scale(&mut file["bounds"][3][1], 1.001);
        }),
        ("a larger force", &|file| {
            scale(&mut file["proof"]["question"]["loads"]["any_force"], 1.5);
        }),
    ];
    for (what, tamper) in tampered {
        let mut file = whole.clone();
        tamper(&mut file);
        assert_ne!(file, whole, "{what}");
        place.write("tampered.json", file.to_string());
        let (code, text) = check("tampered.json");
        assert_eq!(code, Some(1), "{what}: {text}");
        assert!(text.contains("refused"), "{what}: {text}");
    }
}

/// Turned and oblique frames are known to the checker, too.
#[test]
fn another_program_checks_arms_of_every_kind() {
    let Some(python) = python() else { return };
    let place = Workplace::new();
    let model = std::fs::read_to_string(project("models/spatial_3r.xml")).expect("it is there");
    let turned = model
        .replace(
            r#"<body name="link_2">"#,
            r#"<body name="link_2" quat="0.9 0.1 0.2 -0.3">"#,
        )
        .replace(
            r#"name="joint_3" axis="0 1 0""#,
            r#"name="joint_3" axis="0.2 1 -0.3""#,
        );
    assert_ne!(turned, model);
    place.write("turned.xml", turned);
    let text = std::fs::read_to_string(project("scenarios/spatial_3r.toml")).expect("it is there");
    let text = text
        .replace("../models/spatial_3r.xml", "turned.xml")
        .replace(
            "kind = \"any\"\nforce_max_n = 400",
            "kind = \"fixed\"\nforce_n = [0, 100, -300]",
        );
    place.write("plain.toml", text.as_str());
    let arguments = "plan plain.toml --experiments 3 --prove 1% --proof-out proof.json --quiet";
    place.run(arguments).prints("wrote proof.json");
    let (code, text) = checked(&python, &place.path("proof.json"));
    assert_eq!(code, Some(0), "{text}");
    let whole = place.parsed("proof.json");
    let tampered: [(&str, Edit); 5] = [
        ("a frame that is turned otherwise", &|file| {
            scale(
                &mut file["proof"]["question"]["arm"]["joints"][1]["rotation"][2],
                -1.0,
            );
        }),
        ("a longer link", &|file| {
            scale(
                &mut file["proof"]["question"]["arm"]["joints"][2]["offset_m"][0],
                1.1,
            );
        }),
        ("less of what is known before", &|file| {
            file["prior_precision"] = json!([[1e12, 0, 0], [0, 1e12, 0], [0, 0, 1e12]]);
        }),
        ("a longer arm at the test poses alone", &|file| {
            scale(
                &mut file["targets"][0]["arm"]["joints"][2]["offset_m"][0],
                1.1,
            );
        }),
        ("less than nothing known before", &|file| {
            file["prior_precision"] = json!([[-1e9, 0, 0], [0, -1e9, 0], [0, 0, -1e9]]);
            file["prior"] = json!(-1.0);
        }),
    ];
    all_are_refused(&place, &python, &whole, &tampered);
    // JSON has no such numbers, but Python reads them; nothing is above or below them.
    for number in ["NaN", "Infinity", "1e999"] {
        let mut file = whole.clone();
        file["targets"][0]["wrench"][1] = json!("a number");
        let text = file.to_string().replace("\"a number\"", number);
        place.write("tampered.json", text);
        let (code, text) = checked(&python, &place.path("tampered.json"));
        assert_eq!(code, Some(1), "{number}: {text}");
        assert!(text.contains("is no number"), "{number}: {text}");
    }
}

/// What the checker says of a proof.
pub fn checked(python: &str, proof: &Path) -> (Option<i32>, String) {
    let output = Command::new(python)
        .arg(project("tools/check_proof.py"))
        .arg(proof)
        .output()
        .expect("Python starts");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    (output.status.code(), text)
}

/// Something that is done to a proof.
pub type Edit<'a> = &'a dyn Fn(&mut Value);

/// Each change makes another file, which the checker refuses.
pub fn all_are_refused(place: &Workplace, python: &str, whole: &Value, changes: &[(&str, Edit)]) {
    for (what, tamper) in changes {
        let mut file = whole.clone();
        tamper(&mut file);
        assert_ne!(file, *whole, "{what}");
        place.write("tampered.json", file.to_string());
        let (code, text) = checked(python, &place.path("tampered.json"));
        assert_eq!(code, Some(1), "{what}: {text}");
        assert!(text.contains("refused"), "{what}: {text}");
    }
}

pub fn scale(value: &mut Value, factor: f64) {
    *value = json!(value.as_f64().expect("a number") * factor);
}

fn edit_tree(file: &mut Value, edit: impl FnOnce(&mut String)) {
    let tree = &mut file["proof"]["parts"][0]["tree"];
    let mut text = tree.as_str().expect("a tree").to_owned();
    edit(&mut text);
    *tree = json!(text);
}
