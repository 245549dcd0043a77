//! `run` of an absolute accuracy: one loop whose parts are what the commands are one by one, of one virtual robot.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::browser::looks_well;
use crate::recordings::{read_mcap, rerun, rows};
use crate::support::{
    Workplace, absolute_scenario_text, assert_alike_in, assert_near_in, list, number, numbers,
    project, scenario_text,
};

/// What nobody knows exactly, with priors of all that is unknown; each visit of the robot is of one reading.
const KNOWN: &str = r#"
[[station]]
name = "door"
position_mm = [2600, 300, 1200]

[[station]]
name = "wall"
position_mm = [-500, -4000, 1500]

[[uncertainty]]
kind = "joint_zero"
joints = ["shoulder_lift", "elbow", "wrist_1", "wrist_2"]
std_mrad = 0.5

[[uncertainty]]
kind = "compliance"
joints = ["shoulder_lift", "elbow", "wrist_1", "wrist_2"]
std_relative = 0.3

[[test_pose]]
name = "reaming"
q_deg = [30, -70, 90, -100, -70, 30]
force_n = [10, -20, -50]
"#;
const REPEATABILITY: &str = "\n[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.02\n";
const FILES: [&str; 7] = [
    "measurements.csv",
    "plan.csv",
    "report.html",
    "results.json",
    "run.mcap",
    "run.rrd",
    "stills.svg",
];

fn absolute(more: &str) -> String {
    let text = absolute_scenario_text("ur10").replace(", \"wrist_3\"]", "]");
    text.replace("experiments = 4", "experiments = 12") + more
}

/// A workplace with a scenario of which a run was made, and what the run printed.
fn run_of(text: &str, options: &str) -> (Workplace, Value) {
    let place = Workplace::with("s.toml", text);
    let json = place.json(&format!("run s.toml {options}"));
    (place, json)
}

/// The numbers and words of a table, comments left out.
fn fields(place: &Workplace, file: &str) -> Vec<String> {
    let text = place.read(file);
    let rows = text.lines().filter(|line| !line.starts_with('#'));
    rows.flat_map(|row| row.split(',').map(str::to_owned))
        .collect()
}

/// Two tables have the same words, and the same numbers to 1e-9.
fn assert_same_table(place: &Workplace, [one, other]: [&str; 2]) {
    let [one, other] = [one, other].map(|file| fields(place, file));
    assert_eq!(one.len(), other.len());
    for (one, other) in one.iter().zip(&other) {
        match (one.parse::<f64>(), other.parse::<f64>()) {
            (Ok(one), Ok(other)) => assert!((one - other).abs() < 1e-9, "{one} {other}"),
            _ => assert_eq!(one, other),
        }
    }
}

/// What was identified, by name: the value, its standard error where it is determined.
fn unknowns(json: &Value) -> BTreeMap<String, (f64, Option<f64>)> {
    let all = list(&json["unknowns"]).iter();
    let one = |each: &Value| {
        let name = each["name"].as_str().expect("a name").to_owned();
        let value = number(&each["value"]);
        (name, (value, each["standard_error"].as_f64()))
    };
    all.map(one).collect()
}

/// The same was identified, to a millionth of a standard error.
fn assert_same_unknowns(one: &Value, other: &Value) {
    let [one, other] = [one, other].map(unknowns);
    assert!(one.keys().eq(other.keys()));
    for (name, (value, error)) in &one {
        let off = value - other[name].0;
        let room = 1e-6 * error.unwrap_or(1.0);
        assert!(off.abs() < room, "{name}: {off:e} beside {error:?}");
    }
}

/// Plan, readings, identification and compensation are those of the commands, and each takes what the run wrote.
#[test]
fn a_run_is_what_its_commands_are() {
    let (place, run) = run_of(&absolute(&(KNOWN.to_owned() + REPEATABILITY)), "--draw 6");
    let mut listing = place.listing();
    listing.retain(|file| file.starts_with("out/s/"));
    assert_eq!(listing, FILES.map(|file| format!("out/s/{file}")));
    let stored = place.parsed("out/s/results.json");
    assert_eq!(stored, run);

    let planned = place.json("plan s.toml --draw 6 --plan-out plan.csv");
    assert_same_table(&place, ["out/s/plan.csv", "plan.csv"]);
    for key in [
        "accuracy",
        "frame",
        "experiments",
        "rho0_mm",
        "quantile95_mm",
        "uncertainty_budget",
        "lower_bound_rho0_mm",
        "bound_kind",
        "efficiency",
        "drawn",
        "plan",
    ] {
        assert_eq!(run[key], planned[key], "{key}");
    }
    for (own, planned) in (list(&run["test_poses"]).iter()).zip(list(&planned["test_poses"])) {
        let [own, planned] = [own, planned].map(|pose| number(&pose["rho0_mm"]));
        assert!((own / planned - 1.0).abs() < 1e-6, "{own} {planned}");
    }
    let random = number(&run["random_median_rho0_mm"]);
    assert!(random > number(&run["lower_bound_rho0_mm"]), "{random}");

    place.json("measure s.toml --plan out/s/plan.csv --measurements-out read.csv");
    assert_same_table(&place, ["out/s/measurements.csv", "read.csv"]);
    let identified = place.json("identify s.toml --measurements out/s/measurements.csv");
    assert_same_unknowns(&run, &identified);
    let compensated = place.json("compensate s.toml --identified out/s/results.json");
    let poses = list(&compensated["test_poses"]);
    for (own, other) in (list(&run["test_poses"]).iter()).zip(poses) {
        let [own, other] = [own, other].map(|pose| numbers(&pose["q_commanded_deg"]));
        for (own, other) in own.iter().zip(other) {
            assert!((own - other).abs() < 1e-9, "{own} {other}");
        }
    }
    let compared = place.json("compare out/s/results.json out/s/results.json");
    let count = compared["changes"].as_array().map(Vec::len);
    assert_eq!(count, Some(4), "rho0, efficiency and two test poses");
}

/// Recordings of a run, a replay and a study have the robot in each row and at the test poses, where the record has it.
#[test]
fn recordings_show_what_the_robot_did() {
    let study = "\n[study]\nexperiments = 12\ntrials = 20\nlevel = \"robot\"\n[[study.plan]]\nkind = \"random\"\nname = \"any\"\n";
    let (place, run) = run_of(&(absolute(KNOWN) + REPEATABILITY + study), "--draw 12");
    let replayed = place.json("replay s.toml --run 0 --draw 12");
    place.json("study s.toml --draw 12");
    for (file, record) in [
        ("run", &run["plans"][0]),
        ("replay_0", &replayed["plans"][0]),
        ("study", &replayed["plans"][0]),
    ] {
        let rrd = place.path(&format!("out/s/{file}.rrd"));
        let shown = rows(&rerun(&["rrd", "print"], &rrd));
        assert!(shown.len() > 10, "{file}: {shown:?}");
        let bytes = std::fs::read(place.path(&format!("out/s/{file}.mcap"))).expect("a recording");
        let messages = read_mcap(&bytes);
        let on = |topic: &'static str| messages.iter().filter(move |each| each.topic == topic);
        let read: Vec<_> = on("/measurements").collect();
        let measurements = list(&record["measurements"]);
        assert_eq!(read.len(), measurements.len(), "{file}");
        let residuals = &record["identification"]["residuals_mm"];
        let mut seen: Vec<String> = Vec::new();
        for (place, message) in read.iter().enumerate() {
            let position = numbers(&message.json["position_mm"]);
            let same = numbers(&measurements[place]["position_mm"]);
            let mut same = position.iter().zip(same);
            assert!(
                same.all(|(one, other)| (one - other).abs() < 1e-9),
                "{file}"
            );
            let residual = numbers(&message.json["residual_mm"]);
            assert_eq!(residual, numbers(&residuals[place]), "{file}");
            seen.push(
                message.json["station"]
                    .as_str()
                    .expect("a station")
                    .to_owned(),
            );
        }
        let steps: Vec<_> = on("/steps").collect();
        let poses = list(&record["test_poses"]);
        let (rows, at_work) = steps.split_at(steps.len() - 2 * poses.len());
        for (step, station) in rows.iter().zip(&seen) {
            let title = step.json["title"].as_str().expect("a title");
            assert!(title.ends_with(&format!(" from {station}")), "{title}");
        }
        for (pair, pose) in at_work.chunks(2).zip(poses) {
            for (step, key) in pair.iter().zip(["uncompensated_xyz_mm", "residual_xyz_mm"]) {
                let off = numbers(&step.json["displacement_mm"]);
                for (one, other) in off.iter().zip(numbers(&pose[key])) {
                    assert!((one - other).abs() < 1e-9, "{file}: {key} {one} {other}");
                }
            }
        }
    }
}

/// Where nothing but the instrument's noise is new in a reading, the study's fit is the same: run 0 of a study of the plan leaves the same
/// distances at the test poses, of the same robot.
#[test]
fn a_run_is_the_first_of_a_study() {
    let (place, run) = run_of(&absolute(KNOWN), "--draw 12");
    let study = "\n[study]\nexperiments = 12\n[[study.plan]]\nkind = \"file\"\nname = \"own\"\nfile = \"out/s/plan.csv\"\n\
        [[study.plan]]\nkind = \"random\"\nname = \"any\"\n";
    place.write("study.toml", absolute(KNOWN) + study);
    let replayed = place.json("replay study.toml --run 0 --draw 12");
    let own = &replayed["plans"][0];
    for key in ["run", "compliance_rad_per_nm", "sampled"] {
        assert_eq!(run["truth"][key], own["truth"][key], "{key}");
    }
    let poses = list(&own["test_poses"]);
    assert_eq!(poses.len(), 2);
    let (mut before, mut after) = (0.0, 0.0);
    for (mine, other) in (list(&run["test_poses"]).iter()).zip(poses) {
        let [one, another] = [mine, other].map(|pose| numbers(&pose["residual_xyz_mm"]));
        for (one, another) in one.iter().zip(another) {
            assert!((one - another).abs() < 1e-6, "{one} {another}");
        }
        before += number(&mine["uncompensated_mm"]).powi(2) / 2.0;
        after += number(&mine["residual_mm"]).powi(2) / 2.0;
    }
    for (square, key) in [(before, "uncompensated_rms_mm"), (after, "residual_rms_mm")] {
        assert!((square.sqrt() - number(&run[key])).abs() < 1e-9, "{key}");
    }
    // Half a milliradian and a third of the compliances are more than what is left.
    assert!(before > 100.0 * after, "{before} {after}");
}

/// Estimates are beside the truth of their own run: with and without priors, whatever the seed.
#[test]
fn the_truth_is_that_of_the_run() {
    let without = "\n[[station]]\nname = \"door\"\nposition_mm = [2600, 300, 1200]\n";
    for (more, options, expected) in [
        (KNOWN, "--draw 12", 8),
        (without, "--draw 12 --seed 3", 4),
        (without, "--draw 12 --parameters zeros", 4),
    ] {
        let (place, run) = run_of(&absolute(more), options);
        // What to do next is of the same unknowns, and finds its files.
        let page = place.read("out/s/report.html");
        let page = page.replace("<span>", "").replace("</span>", "");
        let asked = options.find("--parameters").map_or("", |at| &options[at..]);
        let identify = format!("identify s.toml --measurements measurements.csv {asked}");
        for command in [identify.trim_end(), "lab s.toml --plan out/s/plan.csv"] {
            assert!(page.contains(command), "{command}");
        }
        let identified = unknowns(&run);
        let truth = list(&run["truth"]["unknowns"]);
        let mut judged = 0;
        for each in truth {
            let name = each["name"].as_str().expect("a name");
            let (Some(truth), (value, Some(error))) = (each["value"].as_f64(), identified[name])
            else {
                continue;
            };
            judged += 1;
            assert_near_in(&name, value, truth, 5.0 * error);
            let sampled = list(&run["truth"]["sampled"]).iter();
            let sampled = sampled.filter(|sampled| sampled["name"] == name);
            let sampled: f64 = sampled.map(|sampled| number(&sampled["value"])).sum();
            assert!(sampled != 0.0, "{name}");
            let unknown = list(&run["unknowns"]).iter();
            let nominal = unknown.filter(|each| each["name"] == name);
            let nominal: f64 = nominal.map(|each| number(&each["nominal"])).sum();
            let wanted = if name.ends_with(".compliance") {
                nominal * sampled.exp()
            } else {
                nominal + sampled
            };
            assert_alike_in(&name, truth, wanted, 1e-9);
        }
        assert_eq!(judged, expected);
        let page = place.read("out/s/report.html");
        crate::report::assert_self_contained(&page);
        for words in [
            "Observed in this run",
            "Against a random plan",
            "<section id=\"poses\">",
            "<section id=\"identified\">",
            "simulated truth",
            "plan.csv has the same numbers",
        ] {
            assert!(page.contains(words), "{words}");
        }
        let stills = page.matches("class=\"still\"").count();
        looks_well(&place.path("out/s/report.html"), stills);
    }
}

/// Distances, among candidates of a file, of which all are read: there is nothing to choose.
#[test]
fn a_ballbar_is_run() {
    let place = Workplace::with("s.toml", scenario_text("ur10_ballbar"));
    let plan = project("scenarios/plans/ur10_ballbar.csv");
    place.write("c.csv", std::fs::read(plan).expect("read"));
    let run = place.json("run s.toml --candidates c.csv");
    assert_eq!(run["bound_kind"], "proved");
    assert!(number(&run["efficiency"]) <= 1.0);
    assert!(run["drawn"].is_null());
    // No station has as many rows: there are no random plans, which read from one.
    assert!(run["random_median_rho0_mm"].is_null());
    assert!(run["measurements"][0]["distance_mm"].is_number());
    let identified = place.json("identify s.toml --measurements out/s/measurements.csv");
    assert_same_unknowns(&run, &identified);
    let input = &run["provenance"]["inputs_sha256"]["candidates"];
    assert!(input.is_string(), "{input}");
}

/// What the plan does not determine is a condition, and what cannot be run one error.
#[test]
fn what_is_wrong_is_said_once() {
    let place = Workplace::new();
    let all = absolute_scenario_text("ur10").replace("experiments = 4", "experiments = 12");
    place.write("all.toml", &all);
    let outcome = place.doubted("run all.toml --draw 12 --quiet");
    let outcome = outcome.says("condition C0101").says("condition C0201");
    outcome.prints("not determined");
    place.write(
        "few.toml",
        all.replace("experiments = 12", "experiments = 2"),
    );
    place.write("relative.toml", scenario_text("ur10"));
    place.write("c.csv", "q1_deg,q2_deg\n1,2\n");
    for (arguments, wanted) in [
        ("run few.toml --draw 12", "error E0402: few.toml: "),
        ("run all.toml --candidates no.csv", "error E0601: no.csv"),
        ("run all.toml --candidates c.csv", "error E0301: c.csv"),
        (
            "run all.toml --prove 1",
            "--prove is for plans of deflections",
        ),
        (
            "run relative.toml --draw 12",
            "--draw is for plans of absolute readings",
        ),
    ] {
        let outcome = place.refused(&format!("{arguments} --quiet"));
        let errors = outcome.stderr.matches("error E").count();
        assert_eq!(errors, 1, "{}", outcome.stderr);
        outcome.says(wanted);
    }
}

/// Records and recordings of poses have the orientation of each reading, and what is left of it.
#[test]
fn recordings_of_poses_have_orientations() {
    let poses = "[instrument]\nrotation_sigma_mrad = 0.1";
    let text = absolute(KNOWN).replace("[instrument]", poses);
    let (place, run) = run_of(&text, "--draw 6");
    let record = &run["plans"][0];
    let bytes = std::fs::read(place.path("out/s/run.mcap")).expect("a recording");
    let messages = read_mcap(&bytes);
    let read = messages.iter().filter(|each| each.topic == "/measurements");
    let read: Vec<_> = read.collect();
    let residuals = &record["identification"]["rotation_residuals_mrad"];
    assert_eq!(residuals.as_array().map(Vec::len), Some(read.len()));
    for (place, message) in read.iter().enumerate() {
        let turned = &record["measurements"][place]["quaternion"];
        assert_eq!(numbers(&message.json["quaternion"]), numbers(turned));
        let residual = numbers(&message.json["rotation_residual_mrad"]);
        assert_eq!(residual, numbers(&residuals[place]));
        let size = residual.iter().map(|each| each * each).sum::<f64>().sqrt();
        assert!(size > 0.0 && size < 1.0, "{residual:?}");
    }
    let shown = rows(&rerun(&["rrd", "print"], &place.path("out/s/run.rrd")));
    assert!(shown.len() > 10);
}
