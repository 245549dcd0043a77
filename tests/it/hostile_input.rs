//! Names, fields and numbers that somebody means ill with, or that grew beyond what a person reads.

use serde_json::{Value, json};

use crate::support::{Workplace, project, scenario_text, shipped};

/// However long a field is, an error can be read.
#[test]
fn errors_do_not_repeat_files() {
    let place = Workplace::new();
    let long = "x".repeat(300_000);
    place.write("s.toml", scenario_text("planar_3r"));
    place.write("p.csv", format!("q1_deg,q2_deg,q3_deg\n0,{long},0\n"));
    place.write("h.csv", format!("q1_deg,{long}\n0,0\n"));
    place.write(
        "k.toml",
        scenario_text("planar_3r") + &format!("\n[{long}]\na = 1\n"),
    );
    place.write(
        "v.toml",
        scenario_text("planar_3r").replace("\"fixed\"", &format!("\"{long}\"")),
    );
    place.write(
        "i.json",
        json!({ "schema": { "name": long, "version": 2 } }).to_string(),
    );
    for command in [
        "evaluate s.toml --plan p.csv",
        "evaluate s.toml --plan h.csv",
        "check k.toml",
        "check v.toml",
        "compensate s.toml --identified i.json",
    ] {
        let outcome = place.run(command);
        assert!(
            matches!(outcome.code, Some(1 | 3)),
            "{command}: {:?}",
            outcome.code
        );
        let said = outcome.stdout.len() + outcome.stderr.len();
        assert!(said < 10_000, "{command}: {said} characters");
    }
}

/// Results stay below the folder for results, whatever a scenario is called.
#[test]
fn no_name_of_a_scenario_leaves_the_folder() {
    let place = Workplace::new();
    for name in ["...toml", "....toml"] {
        place.write(name, scenario_text("planar_3r"));
        let before = place.listing();
        let outcome = place.run(&format!("run {name} --quiet --out out"));
        if outcome.code == Some(0) {
            let all = place.listing();
            let new = all.iter().filter(|path| !before.contains(path));
            assert!(new.clone().all(|path| path.starts_with("out")), "{all:?}");
        } else {
            assert_eq!(place.listing(), before);
            outcome.ends_with(1).says("names another folder");
        }
    }
}

/// A file is no option, whatever it is called.
#[test]
fn no_name_of_a_model_is_an_option() {
    let place = Workplace::new();
    let model = std::fs::read_to_string(project("models/planar_3r.xml")).expect("the model");
    for name in ["-m.xml", "--help.xml"] {
        place.write(name, &model);
        let named = format!("model = {name:?}");
        let text = scenario_text("planar_3r");
        let line = text.lines().find(|line| line.starts_with("model = "));
        place.write("s.toml", text.replace(line.expect("a model"), &named));
        place.done("check s.toml --quiet");
    }
}

/// What is compared with next to nothing is told as a difference.
#[test]
fn no_change_is_infinite() {
    let place = Workplace::with("s.toml", scenario_text("klimchik2012"));
    let plan = shipped("scenarios/plans/klimchik2012_m4.csv");
    let new = place.json(&format!("evaluate s.toml --plan {plan}"));
    place.write("new.json", new.to_string());
    for tiny in [1e-310, 5e-324, 0.0] {
        let mut base: Value = new.clone();
        base["rho0_mm"] = json!(tiny);
        base["compliance_std_rad_per_nm"][0] = json!(tiny);
        place.write("base.json", base.to_string());
        let outcome = place.doubted("compare base.json new.json --markdown m.md");
        for text in [&outcome.stdout, &outcome.stderr, &place.read("m.md")] {
            assert!(!text.contains("inf ") && !text.contains("NaN"), "{text}");
        }
    }
}
