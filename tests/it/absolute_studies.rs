//! Studies of absolute plans, and their pages: the same runs as `evaluate --trials`, in shards and resumed to the same bits; what is
//! predicted is the sum of what it is made of; and what there is for deflections alone is refused by its name.

use std::collections::BTreeSet;

use serde_json::{Value, json};

use crate::browser::looks_well;
use crate::recordings::read_mcap;
use crate::support::{
    Workplace, absolute_scenario_text, assert_alike, assert_has, list, number, numbers,
    scenario_text,
};
use crate::uncertainties::expected_mm;

const KNOWN: &str = r#"
[[uncertainty]]
kind = "joint_zero"
std_mrad = 1

[[uncertainty]]
kind = "joint_repeatability"
std_mrad = 0.05

[[uncertainty]]
kind = "transmission_error"
std_mrad = 0.03

[[uncertainty]]
kind = "task_force"
std_n = 5

[[station]]
name = "near"
position_mm = [-1800, 500, 900]

[[station]]
name = "far"
position_mm = [-7000, -3000, 1500]
"#;

fn absolute(more: &str) -> String {
    absolute_scenario_text("ur10").replace("experiments = 4", "experiments = 14") + more
}

/// A folder with a plan from two stations that was designed from few drawn configurations, and a path.
fn planned() -> (Workplace, Value) {
    let place = Workplace::with("s.toml", absolute(KNOWN));
    let poses = (0..13).map(|each| format!("{},{},80,-110,-70,30\n", 20 + each, -60 - each));
    let path =
        "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n".to_owned() + &poses.collect::<String>();
    place.write("path.csv", path);
    // Whether so few readings determine the last joint's compliance is not asked here.
    let planned = place.run(
        "plan s.toml --draw 20 --test-poses path.csv --plan-out p.csv --stills-out p.svg --report-out p.html --json --quiet",
    );
    let planned = planned.json();
    (place, planned)
}

#[test]
fn a_prediction_is_split_and_shown() {
    let (place, planned) = planned();
    let sources = planned["uncertainty_budget"]["sources"].as_array();
    let sources = sources.expect("a list");
    let names: Vec<&str> = (sources.iter())
        .map(|each| each["source"].as_str().expect("a name"))
        .collect();
    assert_eq!(
        names,
        [
            "noise",
            "joint_repeatability",
            "transmission_error",
            "joint_zero",
            "task_force"
        ]
    );
    let contribution = |each: &Value| number(&each["contribution_um"]);
    assert!(sources.iter().all(|each| contribution(each) > 0.0));
    let task = contribution(&sources[4]) * 1e-3 / number(&planned["task_force_mm"]);
    assert!((task - 1.0).abs() < 1e-9, "{task}");

    // The line of sight goes to where the plan has the instrument stand.
    let rows = list(&planned["plan"]);
    let svg = place.read("p.svg");
    assert_eq!(svg.matches("class=\"station\"").count(), rows.len());
    for row in rows {
        let (target, station) = (&row["target"], &row["station"]);
        let words = format!(
            "reads {} from {}",
            target.as_str().expect("a target"),
            station.as_str().expect("a station")
        );
        assert!(svg.contains(&words), "{words}");
    }
    let page = place.read("p.html");
    crate::report::assert_self_contained(&page);
    for words in [
        "an absolute accuracy",
        "evidence, no proof",
        "<section id=\"sources\">",
        "<section id=\"poses\">",
        "<section id=\"readings\">",
        "<section id=\"unknowns\">",
        "line 3",
    ] {
        assert!(page.contains(words), "{words}");
    }
    let stills = place.read("p.html").matches("class=\"still\"").count();
    // With the figure of the path.
    looks_well(&place.path("p.html"), 1 + stills);
}

/// What `evaluate --trials` sees is what a study of the same readings sees, which shards and interruptions leave as it is.
#[test]
fn a_study_is_of_the_same_robots() {
    let place = Workplace::with("k.toml", absolute(KNOWN));
    place.run("plan k.toml --draw 20 --plan-out p.csv --quiet");
    let study = "\n[study]\nexperiments = 14\ntrials = 40\n[[study.plan]]\nkind = \"file\"\nname = \"mine\"\nfile = \"p.csv\"\n\
        [[study.plan]]\nkind = \"random\"\nname = \"any\"\n";
    place.write("s.toml", absolute(KNOWN) + study);
    let asked = "study s.toml --draw 30";
    let whole = place.json(asked);
    assert_eq!(whole["accuracy"], "absolute");
    assert_eq!(whole["level"], "robot");
    assert_eq!(whole["reference"], "any");
    let plan = &whole["plans"][0];
    assert_eq!((&plan["name"], &plan["runs"]), (&json!("mine"), &json!(40)));
    let judged = place.record("evaluate s.toml --plan p.csv --trials 40 --report-out t.html");
    for key in ["rms_mm", "rms_std_mm", "coverage95"] {
        assert_eq!(plan[key], judged["trials"][key], "{key}");
    }
    assert_eq!(
        plan["combined_rms_mm"],
        judged["trials"]["predicted_rms_mm"]
    );
    assert_eq!(plan["verdict"], judged["trials"]["verdict"]);
    assert_eq!(plan["histogram"], judged["trials"]["histogram"]);
    assert_eq!(plan["contributions"].as_array().map(Vec::len), Some(5));
    let (seen, nees) = (number(&plan["rms_mm"]), number(&plan["nees"]));
    let predicted = number(&plan["combined_rms_mm"]);
    // Forty robots: the mean square of three numbers is right within four of its standard errors.
    let room = 4.0 * (2.0_f64 / 3.0 / 40.0).sqrt();
    assert!((nees / 3.0 - 1.0).abs() < room, "{nees}");
    assert!(((seen / predicted).powi(2) - 1.0).abs() < 4.0 * (2.0_f64 / 40.0).sqrt());
    let stills = place.read("t.html").matches("class=\"still\"").count();
    looks_well(&place.path("t.html"), 1 + stills);
    assert!(place.read("t.html").contains("Do virtual robots keep it?"));
    let page = place.read("out/s/study.html");
    assert!(page.contains("An absolute accuracy: where the loaded tool is"));
    assert!(place.path("out/s/study.rrd").exists());
    // The robot of run 0 reads what the plans say.
    let recorded = std::fs::read(place.path("out/s/study.mcap")).expect("it is there");
    let messages = read_mcap(&recorded).into_iter();
    let topics: BTreeSet<String> = messages.map(|each| each.topic).collect();
    for topic in [
        "/provenance",
        "/measurements",
        "/steps",
        "/study",
        "/study/progress",
    ] {
        assert!(topics.contains(topic), "{topic}");
    }

    for shard in [1, 2] {
        place.done(&format!(
            "{asked} --shard {shard}/2 --tally-out {shard}.json --quiet"
        ));
    }
    let merged = place.json("merge 1.json 2.json");
    assert_eq!(merged["plans"], whole["plans"]);
    let resumed = place.json(&format!("{asked} --resume r.json"));
    assert_eq!(resumed["plans"], whole["plans"]);
    assert_eq!(
        place.json(&format!("{asked} --resume r.json"))["plans"],
        whole["plans"]
    );
    let other = place.run(&format!(
        "{asked} --parameters zeros --resume r.json --quiet"
    ));
    other.ends_with(1).says("is of another study: absolute is");
    let quantiles = numbers(&plan["quantiles_mm"]);
    assert!(quantiles[0] < seen && seen < quantiles[3]);
}

/// Conditions of a sweep are the study under these alone, on any number of threads and in shards; and a replay is one of its
/// runs.
#[test]
fn sweeps_and_replays_are_of_the_same_runs() {
    let place = Workplace::with("k.toml", absolute(KNOWN));
    place.run("plan k.toml --draw 20 --plan-out p.csv --quiet");
    let study = |more: &str| {
        let file = "[[study.plan]]\nkind = \"file\"\nname = \"mine\"\nfile = \"p.csv\"\n";
        // What the study says is that of a reading.
        let known = absolute(KNOWN).replace("\"deflection\"", "\"position\"");
        known + "\n[study]\nexperiments = 14\ntrials = 20\n" + more + file
    };
    let plans = |text: String, arguments: &str| {
        place.write("s.toml", text);
        place.json(&format!("study s.toml {arguments}"))["plans"].clone()
    };
    let swept =
        "sweep = { sigma_mm = [0.02, 0.04], load_scale = [0.5, 1], experiments = [14, 28] }\n";
    let all = plans(study(swept), "--threads 1");
    assert_eq!(all.as_array().map(Vec::len), Some(8));
    assert_eq!(all, plans(study(swept), "--threads 3"));
    for shard in [1, 2] {
        place.done(&format!(
            "study s.toml --shard {shard}/2 --tally-out {shard}.json --quiet"
        ));
    }
    assert_eq!(all, place.json("merge 1.json 2.json")["plans"]);
    for each in all.as_array().expect("a list").iter().step_by(5) {
        let (sigma, scale) = (number(&each["sigma_mm"]), number(&each["load_scale"]));
        let alone = format!(
            "sweep = {{ sigma_mm = [{sigma}], load_scale = [{scale}], experiments = [{}] }}\n",
            each["experiments"]
        );
        assert_eq!(*each, plans(study(&alone), "")[0]);
    }
    // Less noise and more readings are better, and so is a larger load where compliances are found.
    let predicted = |place: usize| number(&all[place]["combined_rms_mm"]);
    for (better, worse) in [(0, 1), (2, 3), (4, 0), (6, 2), (2, 0)] {
        assert!(
            predicted(better) < predicted(worse),
            "{better} {worse}: {all}"
        );
    }

    // So few readings do not determine the last joint's compliance, which is said of a fit.
    // A replay has the first conditions, and says what their noise is of a reading.
    place.write("s.toml", study(swept));
    let replayed = place.json_with_conditions("replay s.toml --run 0");
    assert_eq!(replayed["sigma_mm"], all[0]["sigma_mm"]);
    let notes = replayed["notes"].to_string();
    assert_has(&notes, "sigma 0.0200 mm");
    assert_has(&notes, "sigma 0.0400 mm");

    let one = plans(study(""), "--trials 1");
    let replayed = place.json_with_conditions("replay s.toml --run 0");
    let replayed = &replayed["plans"][0];
    let distance = number(&replayed["test_poses"][0]["residual_mm"]);
    assert!((number(&one[0]["rms_mm"]) / distance - 1.0).abs() < 1e-9);
    let readings = list(&replayed["measurements"]);
    let left = &replayed["identification"]["residuals_mm"];
    assert_eq!(left.as_array().map(Vec::len), Some(readings.len()));
    assert_ne!(
        place.json_with_conditions("replay s.toml --run 1")["plans"][0],
        *replayed
    );
    place.misused("replay s.toml --run 0 --parameters zeros --candidates p.csv --draw 3");
}

/// What the belief does not know of is named, with what it leaves.
#[test]
fn what_breaks_a_prediction_is_named() {
    let place = Workplace::new();
    let hidden =
        "\n[[uncertainty]]\nkind = \"transmission_error\"\nstd_mrad = 0.3\nhidden = true\n";
    let more = "\n[study]\ntrials = 40\n[[study.plan]]\nkind = \"optimal\"\nname = \"best\"\n";
    place.write("s.toml", absolute(hidden) + more);
    let study = place.json("study s.toml --parameters zeros --draw 20");
    let plan = &study["plans"][0];
    let verdict = plan["verdict"].as_str().expect("words");
    assert!(
        verdict.starts_with("exceeded: ")
            && verdict.contains("hidden contribution is \"transmission_error\""),
        "{verdict}"
    );
    let contributions = list(&plan["contributions"]);
    assert_eq!(
        contributions.last().expect("the hidden one")["hidden"],
        true
    );
    // To first order, what is seen is what is predicted and what is hidden.
    let squares = expected_mm(plan).powi(2);
    let seen = number(&plan["rms_mm"]).powi(2);
    assert_alike(seen, squares, 4.0 * (2.0_f64 / 40.0).sqrt());
}

/// What is there for deflections alone is refused by its name, and what is for absolute readings where deflections are studied.
#[test]
fn what_does_not_fit_is_refused() {
    let place = Workplace::new();
    let plan = |kind: &str| format!("[[study.plan]]\nname = \"p\"\n{kind}\n");
    let text = |study: String| absolute("\n[study]\n") + &study;
    place.write("r.toml", scenario_text("ur10"));
    place.write(
        "c.csv",
        "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,target,repeats\n\
         -10,-65,110,-160,120,-20,reflector,2\n70,-120,100,-150,-60,-50,reflector,1\n",
    );
    place.write("a.toml", absolute(""));
    for (study, arguments, words) in [
        (
            plan("kind = \"random\""),
            "--level model",
            "--level model is for plans of deflections",
        ),
        ("level = \"model\"\n".to_owned(), "", "study.level"),
        (plan("kind = \"random_each\""), "", "study.plan[0].kind"),
        (
            plan("kind = \"optimal\"\ncriterion = \"d\""),
            "",
            "study.plan[0].criterion",
        ),
        (
            plan("kind = \"optimal\"\nnoise_only = true"),
            "",
            "study.plan[0].noise_only",
        ),
        (
            plan("kind = \"file\"\nfile = \"c.csv\""),
            "",
            "whole repetitions must make up",
        ),
    ] {
        place.write("s.toml", text(study));
        place
            .refused(&format!("study s.toml --quiet {arguments}"))
            .says(words);
    }
    for (arguments, words) in [
        (
            "study r.toml --draw 20",
            "--draw is for plans of absolute readings",
        ),
        (
            "study r.toml --candidates c.csv",
            "--candidates is for plans of absolute readings",
        ),
        (
            "study r.toml --parameters zeros",
            "--parameters is for plans of absolute readings",
        ),
        (
            "plan r.toml --report-out a.html",
            "--report-out is for plans of absolute readings",
        ),
        (
            "evaluate a.toml --parameters frames --plan c.csv --trials 10",
            "no reading of the plan is of spindle, whose place is predicted: no run can show it",
        ),
    ] {
        place.refused(&format!("{arguments} --quiet")).says(words);
    }
}
