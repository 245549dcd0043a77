//! Distances between targets and places in the room, as a ballbar or a wire encoder reads them.

use std::path::Path;

use elastocal::experiment::read_candidates;
use elastocal::identification::ParameterGroup;
use elastocal::measurement::{MeasuredFile, read_measured};
use elastocal::plan::absolute::ReadingsWanted;
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use serde_json::Value;

use crate::absolute_campaigns::fits_alike;
use crate::absolute_trials::holds;
use crate::bad_input::{assert_none, complaints};
use crate::support::{
    Workplace, assert_change_refused, assert_has, assert_near, assert_same_rho0, list, number,
    numbers, scenario, scenario_text,
};
use crate::uncertainties::loaded;

const BALLBAR: &str = "ur10_ballbar";

fn ballbar() -> Scenario {
    scenario(BALLBAR)
}

/// A workplace with the scenario and its plan.
fn workplace() -> Workplace {
    let place = Workplace::with("s.toml", scenario_text(BALLBAR));
    let plan = crate::support::project("scenarios/plans/ur10_ballbar.csv");
    place.write("plan.csv", std::fs::read(plan).expect("read"));
    place
}

/// No compliance need be unknown where the accuracy is absolute: a calibration of geometry alone, with the elasticity as it is believed.
#[test]
fn geometry_is_calibrated_alone() {
    let place = workplace();
    let text = scenario_text(BALLBAR);
    let (geometry, others) = text
        .split_once("[[uncertainty]]\nkind = \"compliance\"")
        .expect("a source");
    let (_, others) = others.split_once("[[uncertainty]]").expect("others");
    let text = format!("{geometry}[[uncertainty]]{others}");
    place.write(
        "s.toml",
        text.replacen("[\"shoulder_lift\"]", "[\"shoulder_lift.zero\"]", 1),
    );
    let json = place.json("evaluate s.toml --plan plan.csv --trials 1000");
    holds(&json["trials"]);
    place.json("measure s.toml --plan plan.csv --measurements-out read.csv");
    let json = place.json("identify s.toml --measurements read.csv --identified-out robot.json");
    let unknowns = list(&json["unknowns"]);
    let names: Vec<_> = (unknowns.iter())
        .filter_map(|each| each["name"].as_str())
        .collect();
    assert!(names.contains(&"shoulder_lift.zero"), "{names:?}");
    assert!(
        !names.iter().any(|name| name.ends_with(".compliance")),
        "{names:?}"
    );
    let said = place.done("compensate s.toml --identified robot.json --quiet");
    said.prints("Assumed exact");
    said.prints("--targets");
    // Relative accuracy rests on compliances.
    let relative =
        scenario_text("kr270").replacen("parameters = [", "parameters = [\"joint_2.zero\"] # [", 1);
    place.write("r.toml", relative);
    let says = ["robot.parameters", "joint_2.zero", "at least one joint"];
    assert_none(&complaints(&place, "check r.toml", &says, None));
}

/// The same in a study, whose regions of 95 % hold the place in 95 % of the runs, within three standard errors.
#[test]
fn regions_hold_the_place() {
    let place = workplace();
    let text = scenario_text(BALLBAR);
    let study = "[study]\nlevel = \"robot\"\ntrials = 600\n[[study.plan]]\nkind = \"file\"\nname = \"stored\"\nfile = \"plan.csv\"\n";
    place.write("study.toml", text + study);
    let json = place.json("study study.toml");
    let plan = &json["plans"][0];
    let coverage = number(&plan["coverage95"]);
    assert_near(coverage, 0.95, 3.0 * (0.95 * 0.05 / 600.0_f64).sqrt());
}

/// Configurations are sampled where each cup's ballbar reaches them, and the plan of them is one.
#[test]
fn configurations_are_sampled_within_the_range() {
    let place = workplace();
    let planned = place.json("plan s.toml --draw 12 --experiments 14 --plan-out drawn.csv");
    assert_eq!(planned["experiments"], 14);
    let scenario = ballbar();
    let belief = &scenario.task.belief;
    let rows = read_candidates(&place.path("drawn.csv"), belief.commands()).expect("read");
    assert!(
        rows.iter()
            .all(|row| row.station.is_some() && row.load == Some(Load::NONE))
    );
    for each in list(&planned["plan"]) {
        let length_mm = number(&each["distance_mm"]);
        assert!((290.0..=310.0).contains(&length_mm), "{length_mm}");
    }
    let evaluated = place.json("evaluate s.toml --plan drawn.csv");
    assert_same_rho0(&planned, &evaluated, 1e-6);
}

/// The whole way through files, with a step of what is shown.
#[test]
fn files_of_distances_are_read_as_they_are_written() {
    let place = workplace();
    place.json("measure s.toml --plan plan.csv --measurements-out read.csv");
    assert!(place.read("read.csv").contains("station,distance_mm,s_mm"));
    let scenario = ballbar();
    let MeasuredFile::Absolute(readings) =
        read_measured(&place.path("read.csv"), &scenario.task.belief).expect("read")
    else {
        panic!("distances are absolute readings");
    };
    for each in &readings {
        let distance_m = each.length.expect("a distance").length_m;
        // The bar is 300 mm long, and robots differ by millimetres.
        assert!((distance_m - 0.3).abs() < 0.01, "{distance_m}");
        let steps = distance_m / 1e-6;
        assert!((steps - steps.round()).abs() < 1e-4, "{steps}");
    }
    let json = place.json("identify s.toml --measurements read.csv --identified-out robot.json");
    assert_eq!(json["numbers"], 24);
    let stations = list(&json["stations"]);
    assert_eq!(stations.len(), 2);
    for (station, cup) in stations.iter().zip(&scenario.task.belief.stations) {
        assert!(station["quaternion"].is_null() && station["rotation_std_mrad"].is_null());
        // Where the robot's base is, from the cup.
        let found = numbers(&station["position_mm"]);
        let cup = (scenario.task.belief.stations.iter())
            .find(|each| station["name"] == *each.name)
            .unwrap_or(cup);
        for (found, nominal) in found.iter().zip(&cup.position_m) {
            assert!((found + nominal * 1e3).abs() < 10.0, "{station}");
        }
    }
    place.json("compensate s.toml --identified robot.json");
}

/// No reading shows the task's force: what it is uncertain by counts in compensation beside what was identified.
#[test]
fn the_force_of_the_task_counts() {
    let force = "\n[[uncertainty]]\nkind = \"task_force\"\nstd_relative = 0.05\n";
    let [without, with] = ["", force].map(|more| {
        let place = workplace();
        place.write("s.toml", scenario_text(BALLBAR) + more);
        place.json("measure s.toml --plan plan.csv --measurements-out read.csv");
        place.json("identify s.toml --measurements read.csv --identified-out robot.json");
        let compensated = place.json("compensate s.toml --identified robot.json");
        (number(&compensated["rho0_mm"]), place)
    });
    let evaluated = with.1.json("evaluate s.toml --plan plan.csv");
    let sources = list(&evaluated["uncertainty_budget"]["sources"]);
    let mut sources = sources.iter();
    let source = sources
        .find(|each| each["source"] == "task_force")
        .expect("a source");
    let force_mm = number(&source["contribution_um"]) * 1e-3;
    let found = (with.0.powi(2) - without.0.powi(2)) / force_mm.powi(2);
    assert!((found - 1.0).abs() < 0.1, "{found} for {force_mm}");
}

/// A header without what is read is told what the scenario reads.
#[test]
fn a_header_is_that_of_what_the_scenario_reads() {
    let place = workplace();
    let header = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,L\n1,2,3,4,5,6,900\n";
    place.write("m.csv", header);
    let commands = ["identify s.toml", "next s.toml"];
    let wrong = commands.map(|command| {
        let command = format!("{command} --measurements m.csv");
        complaints(&place, &command, &["\"L\""], Some("q6_deg,distance_mm"))
    });
    assert_none(&wrong.concat());
}

/// Whatever is read, distances show neither the direction of the base's axes nor where it is: joint 1's zero and its link stay as they
/// are, and all else is found that the ball shows, three coordinates of each cup among it.
#[test]
fn the_base_is_where_joint_1_has_it() {
    let scenario = with_sources("");
    let wanted = ReadingsWanted {
        groups: &[ParameterGroup::Geometry],
        measured: &[],
        candidates: None,
        path: Path::new("scenarios"),
        configurations: 60,
    };
    let planning = wanted.planning(&scenario.task, 1).expect("candidates");
    let parameters = planning.set().parameters();
    let names: Vec<&str> = parameters.iter().map(|each| each.name.as_str()).collect();
    let is_base = |name: &&str| name.starts_with("link_1.") || name.starts_with("shoulder_pan");
    assert!(!names.iter().any(is_base), "{names:?}");
    let cups = names.iter().filter(|name| name.starts_with("base"));
    assert_eq!(cups.count(), 6, "{names:?}");
    let posterior = planning.prediction(&planning.whole()).posterior;
    let is_left = |index: &usize| posterior.standard_error(*index).is_none();
    let left: Vec<&str> = (0..names.len())
        .filter(is_left)
        .map(|index| names[index])
        .collect();
    // The ball is on the last joint's axis: what tilts that axis moves the ball as what shifts it.
    assert_eq!(left, ["link_6.y", "link_6.rx"], "of {names:?}");
}

/// The ballbar's scenario with these error sources alone.
pub fn with_sources(sources: &str) -> Scenario {
    let text = scenario_text(BALLBAR);
    let (head, tail) = text.split_once("# What nobody").expect("a comment");
    let (_, tail) = tail.split_once("[design]").expect("a table");
    loaded(&format!("{head}{sources}[design]{tail}"))
}

/// The table to fill in takes a length at each stop, and is read as it is.
#[test]
fn distances_go_to_the_laboratory() {
    let place = workplace();
    let json = place.json("lab s.toml --plan plan.csv");
    assert_eq!(json["set_ups"], 2);
    assert_eq!(json["readings"], 24);
    let empty = place.read("out/s/lab/measurements.csv");
    assert_has(&empty, "target,visit,station,distance_mm\n");
    // What is about to be read stands beside each blank.
    let sheet = place.read("out/s/lab/run_sheet.html");
    let near: Vec<f64> = (sheet.split("<small>near ").skip(1))
        .filter_map(|rest| rest.split('<').next()?.parse().ok())
        .collect();
    assert!(
        near.len() == 24 && near.iter().all(|mm| (297.9..302.1).contains(mm)),
        "{near:?}"
    );
    fits_alike(&place, "s", "");
}

/// What positions are asked, distances are: a discrepancy, models, other series, other readings, a choice.
#[test]
fn distances_are_asked_what_positions_are() {
    let place = workplace();
    let plan = place.read("plan.csv");
    for half in [0, 1] {
        let rows = plan.lines().skip(1 + half).step_by(2);
        let rows: Vec<&str> = plan.lines().take(1).chain(rows).collect();
        place.write("half.csv", rows.join("\n") + "\n");
        let measure = "measure s.toml --plan half.csv --measurements-out";
        place.json(&format!("{measure} read_{half}.csv"));
    }
    place.json("measure s.toml --plan plan.csv --measurements-out read.csv");
    let identify = |more: &str| {
        let command = format!("identify s.toml --measurements read{more} --quiet --json");
        place.run(&command).json()
    };
    assert!(identify(".csv --sigma-from-residuals")["discrepancy_mm"].is_number());
    let models = &identify(".csv --model-selection")["model_selection"]["nested_models"];
    let judged = &models[0]["cross_validation"]["distance_mm"]["rms"];
    assert!(number(judged) > 0.0, "{models:#}");
    let beside = identify("_0.csv --against read_1.csv --identified-out robot.json");
    let inconsistencies = list(&beside["inconsistencies"]);
    assert!(list(&inconsistencies[0]["found"]).is_empty(), "{beside:#}");
    let validate =
        "validate s.toml --identified robot.json --measurements read_1.csv --quiet --json";
    let other = place.run(validate).json();
    assert!(number(&other["probability"]) > 1e-3, "{other:#}");
    assert!(number(&other["coverage95"]["distances"]) > 0.5, "{other:#}");
    let chosen =
        place.json("select s.toml --measurements read.csv --sizes 14 --draws 2 --campaigns 2");
    let best = &chosen["sizes"][0]["planned"][0];
    assert!(
        number(&best["predicted_rms_mm"]) >= number(&best["rho0_mm"]),
        "{best:#}"
    );
}

/// What distances are not, or need, is refused with the key.
#[test]
fn what_no_ballbar_can_do_is_refused() {
    assert_change_refused(
        BALLBAR,
        ["accuracy = \"absolute\"\n", ""],
        ["design.accuracy", "\"distance\""],
    );
    assert_change_refused(
        BALLBAR,
        ["sigma_of = \"distance\"", "sigma_of = \"position\""],
        ["instrument.sigma_of", "\"distance\""],
    );
    let with = |key: &str| format!("resolution_mm = 0.001\n{key}");
    for (key, value) in [
        ("range_mm", "range_mm = 1"),
        ("rotation_sigma_mrad", "rotation_sigma_mrad = 1"),
    ] {
        assert_change_refused(
            BALLBAR,
            ["resolution_mm = 0.001", &with(value)],
            [&format!("instrument.{key}"), "\"distance\""],
        );
    }
    let text = scenario_text(BALLBAR);
    let stations = text.find("[[station]]").expect("a table");
    let after = text.find("[[test_pose]]").expect("a table");
    assert_change_refused(
        BALLBAR,
        [&text[stations..after], ""],
        ["station", "where distances are read from"],
    );

    let place = workplace();
    place.json("measure s.toml --plan plan.csv --measurements-out read.csv");
    // A reading out of the bar's range, and one from nowhere.
    place.write(
        "short.toml",
        text.replace("range_min_mm = 290", "range_min_mm = 301.9"),
    );
    let said = place.refused("evaluate short.toml --plan plan.csv");
    said.says("range from station");
    place.write(
        "moved.csv",
        place.read("read.csv").replace(",shelf,", ",back,"),
    );
    place
        .refused("identify s.toml --measurements moved.csv")
        .says("\"back\"");
    // Without a standard deviation they are no tracker's.
    let bare: Vec<String> = (place.read("read.csv").lines())
        .map(|line| {
            line.rsplit_once(',')
                .map_or(line, |(row, _)| row)
                .to_owned()
        })
        .collect();
    place.write("bare.csv", bare.join("\n") + "\n");
    place.write("tracker.toml", scenario_text("ur10"));
    place
        .refused("identify tracker.toml --measurements bare.csv")
        .says("how precise the distances are");
}

/// A coarse step is counted as the noise that it is.
#[test]
fn a_coarse_ballbar_is_predicted_to_be_one() {
    let place = workplace();
    let coarse = scenario_text(BALLBAR).replace("resolution_mm = 0.001", "resolution_mm = 0.1");
    place.write("coarse.toml", coarse);
    let rho0 = |json: &Value| number(&json["rho0_mm"]);
    let fine = place.json("evaluate s.toml --plan plan.csv");
    let coarse = place.json("evaluate coarse.toml --plan plan.csv --trials 300");
    assert!(rho0(&coarse) > 1.2 * rho0(&fine));
    holds(&coarse["trials"]);
}

/// Distances that a coarse instrument shows are often equal where a visit is repeated: that is chance, and all of them count.
#[test]
fn equal_distances_of_a_coarse_instrument_are_no_copies() {
    let place = workplace();
    let text = scenario_text(BALLBAR);
    place.write(
        "s.toml",
        text.replace("resolution_mm = 0.001", "resolution_mm = 0.05"),
    );
    let plan = place.read("plan.csv").replace(",1,spindle,", ",3,spindle,");
    place.write("plan.csv", plan);
    place.json("measure s.toml --plan plan.csv --measurements-out m.csv");
    let table = place.read("m.csv");
    let rows: Vec<&str> = table
        .lines()
        .filter(|line| !line.starts_with('#'))
        .collect();
    let mut different = rows.clone();
    different.sort_unstable();
    different.dedup();
    assert!(different.len() + 5 < rows.len(), "some are equal");
    let json = place.json("identify s.toml --measurements m.csv");
    assert_eq!(json["numbers"], rows.len() - 1, "{json}");
}

/// Lengths that no bar shows where they were read are noted, by who measures and by who identifies.
#[test]
fn lengths_beyond_the_range_are_noted() {
    let place = workplace();
    let text = place
        .read("s.toml")
        .replace("range_max_mm = 310", "range_max_mm = 302");
    place.write("short.toml", text);
    for told in [
        "measure short.toml --plan plan.csv --run 1 --measurements-out short.csv",
        "identify short.toml --measurements short.csv",
    ] {
        let told = place.run(told);
        told.prints("lengths outside of the range of their stations");
    }
}

/// Other readings may be those that were fitted where they are coarse, and not where they have digits.
#[test]
fn a_validation_by_the_same_readings_is_refused_where_chance_would_not_repeat_them() {
    let place = workplace();
    let validate = "validate s.toml --identified robot.json --measurements read.csv";
    let identify = |resolution: &str| {
        let text = scenario_text(BALLBAR).replace("resolution_mm = 0.001", resolution);
        place.write("s.toml", text);
        place.json("measure s.toml --plan plan.csv --measurements-out read.csv");
        place.run("identify s.toml --measurements read.csv --identified-out robot.json");
        place.run(validate)
    };
    (identify("resolution_mm = 0.001").ends_with(1)).says("E0302");
    let coarse = identify("resolution_mm = 0.5");
    assert!(!coarse.stderr.contains("E0302"), "{coarse:?}");
    coarse.prints("may be the same by chance");
    place.json("measure s.toml --plan plan.csv --series 1 --measurements-out other.csv");
    assert!(place.read("other.csv").contains("\"series\":1}"));
}
