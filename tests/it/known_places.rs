//! Cups and tables that are known before: what is predicted holds, and counts as what it is.

use elastocal::experiment::read_candidates;
use elastocal::identification::{AbsoluteCase, ReadingWeights};
use elastocal::measurement::{MeasuredFile, read_measured};
use elastocal::parameter::ParameterKind;
use elastocal::plan::absolute::AbsolutePlanning;
use nalgebra::{DVector, Vector3};
use serde_json::Value;

use crate::absolute_trials::holds;
use crate::bad_input::{assert_none, complaints};
use crate::support::{
    Workplace, assert_alike, assert_alike_in, list, number, numbers, project, scenario_text,
};
use crate::uncertainties::loaded;

/// A source of stations, with more keys.
fn source(kind: &str, keys: &str) -> String {
    format!("\n[[uncertainty]]\nkind = \"station_{kind}\"\n{keys}\n")
}

/// A workplace with one of the scenarios of lengths, more of it, and its plan.
fn workplace(name: &str, more: &str) -> Workplace {
    let place = Workplace::with("s.toml", scenario_text(name) + more);
    let plan = project(&format!("scenarios/plans/{name}.csv"));
    place.write("plan.csv", std::fs::read(plan).expect("read"));
    place
}

fn evaluated(name: &str, more: &str, trials: &str) -> Value {
    let place = workplace(name, more);
    // Few readings tell less of places than what is known.
    let plan = place.read("plan.csv");
    let few: Vec<&str> = plan.lines().take(13).collect();
    place.write("few.csv", few.join("\n") + "\n");
    place.json(&format!("evaluate s.toml --plan few.csv{trials}"))
}

fn rho0_mm(json: &Value) -> f64 {
    number(&json["rho0_mm"])
}

/// What contributes by its name (um); all together are rho0.
fn contribution_um(json: &Value, name: &str) -> f64 {
    let sources = json["uncertainty_budget"]["sources"].as_array();
    let sources = sources.expect("a list");
    let own = |each: &Value| number(&each["contribution_um"]);
    let square: f64 = sources.iter().map(|each| own(each).powi(2)).sum();
    let whole_um = rho0_mm(json) * 1e3;
    assert_alike_in(&sources, square.sqrt(), whole_um, 1e-6);
    let found = sources.iter().find(|each| each["source"] == name);
    own(found.unwrap_or_else(|| panic!("no {name}: {sources:#?}")))
}

/// Cups, a table's tilt, its height and tilt: less is left than where they are found from readings alone, and as much as is predicted.
#[test]
fn what_is_known_lowers_what_is_left_as_predicted() {
    let cups = source("position", "std_mm = 0.2");
    let tilt = source("rotation", "std_mrad = 0.2");
    let both = source("position", "std_mm = 0.05") + &tilt;
    for (name, more, names) in [
        ("ur10_ballbar", &cups, &["station_position"][..]),
        ("ur10_height_gauge", &tilt, &["station_rotation"]),
        (
            "ur10_height_gauge",
            &both,
            &["station_position", "station_rotation"],
        ),
    ] {
        let without = evaluated(name, "", "");
        let with = evaluated(name, more, " --trials 600");
        assert!(rho0_mm(&with) < 0.7 * rho0_mm(&without), "{name} {more}");
        for source in names {
            assert!(contribution_um(&with, source) > 0.0);
        }
        holds(&with["trials"]);
    }
}

/// Nothing changes where it is known to ten metres.
#[test]
fn a_vague_place_is_none() {
    let vague = source("position", "std_mm = 10000");
    let [without, with] = ["", &vague].map(|more| evaluated("ur10_ballbar", more, ""));
    let ratio = rho0_mm(&with) / rho0_mm(&without);
    assert!((ratio - 1.0).abs() < 1e-6, "{ratio}");
}

/// A table's height is known where it stands, beside the robot; how it is tilted makes it less known under the robot.
#[test]
fn a_height_is_known_where_the_table_is() {
    let more = source("position", "std_mm = 0.05") + &source("rotation", "std_mrad = 0.2");
    let scenario = loaded(&(scenario_text("ur10_height_gauge") + &more));
    let plan = project("scenarios/plans/ur10_height_gauge.csv");
    let rows = read_candidates(&plan, scenario.task.belief.commands()).expect("a plan");
    let planning = AbsolutePlanning::new(&scenario.task, &[], &rows).expect("a plan");
    let set = planning.set();
    let [position, rotation] = ParameterKind::of_base(0);
    let places =
        [position[2], rotation[0], rotation[1]].map(|kind| set.index_of(kind).expect("one"));
    let precision = set
        .prior()
        .precision
        .select_rows(&places)
        .select_columns(&places);
    let covariance = precision.try_inverse().expect("known");
    let place_m = scenario.task.belief.stations[0].position_m;
    let deviation = |at_m: Vector3<f64>| {
        let row = DVector::from_vec(vec![1.0, at_m.y, -at_m.x]);
        (row.dot(&(&covariance * &row))).sqrt()
    };
    let here_m = deviation(place_m);
    assert!((here_m / 5e-5 - 1.0).abs() < 1e-6, "{here_m}");
    let apart_m = 2e-4 * place_m.x.hypot(place_m.y);
    let there_m = deviation(Vector3::zeros());
    assert_alike(there_m, apart_m.hypot(5e-5), 1e-6);
}

/// What is known of a cup counts from where the scenario has it, however often it is fitted anew; of a cup of which nothing is known the
/// parameters count from where it was found.
#[test]
fn what_is_known_counts_from_where_it_was_said_to_be() {
    let place = workplace(
        "ur10_ballbar",
        &source("position", "std_mm = 0.2\nstations = [\"table\"]"),
    );
    place.json("measure s.toml --plan plan.csv --measurements-out read.csv");
    let scenario = loaded(&place.read("s.toml"));
    let belief = &scenario.task.belief;
    let MeasuredFile::Absolute(readings) =
        read_measured(&place.path("read.csv"), belief).expect("read")
    else {
        panic!("distances are absolute readings");
    };
    let mut case = AbsoluteCase::new(belief, &readings).expect("a case");
    let fit = case.fit(&[], ReadingWeights::AsNeeded).expect("a fit");
    for (number, name) in case.stations.iter().enumerate() {
        let station = belief
            .stations
            .iter()
            .find(|each| Some(&each.name) == name.as_ref());
        let said_m = -station.expect("one").position_m;
        let [reference, found] = [&fit.reference, &fit.arm]
            .map(|arm| (arm.instrument_from_base[number].translation.vector - said_m).norm());
        assert!(found > 1e-5, "{name:?} {found}");
        assert_eq!(
            reference == 0.0,
            name.as_deref() == Some("table"),
            "{name:?} {reference}"
        );
    }
}

/// A zero that no distance shows follows from where cups are known to be, and else stays as it is.
#[test]
fn a_known_cup_tells_the_zero_of_joint_1() {
    let text = scenario_text("ur10_ballbar");
    let free = text.replacen(
        "[\"shoulder_lift\"]",
        "[\"shoulder_lift\", \"shoulder_pan.zero\"]",
        1,
    );
    let zero = |json: &Value| {
        let unknowns = list(&json["unknowns"]);
        let mut unknowns = unknowns.iter();
        let zero = unknowns.find(|each| each["name"] == "shoulder_pan.zero");
        zero.map(|zero| number(&zero["standard_error"]))
    };
    let place = workplace("ur10_ballbar", "");
    place.write("free.toml", &free);
    assert_eq!(
        zero(&place.json("evaluate free.toml --plan plan.csv")),
        None
    );
    place.write("known.toml", free + &source("position", "std_mm = 0.2"));
    let known = place.json("evaluate known.toml --plan plan.csv --trials 600");
    // Two cups at some 0.7 m, each to 0.2 mm.
    let error_rad = zero(&known).expect("an unknown");
    assert!((1e-4..4e-4).contains(&error_rad), "{error_rad}");
    holds(&known["trials"]);
    place.json("measure known.toml --plan plan.csv --measurements-out read.csv");
    let found =
        place.json("identify known.toml --measurements read.csv --identified-out robot.json");
    assert!(zero(&found).is_some_and(|error| (error / error_rad - 1.0).abs() < 0.2));
    place.json("compensate known.toml --identified robot.json");
}

/// Two distances from a known cup do beside others, and not from one of which nothing is known.
#[test]
fn few_readings_do_from_known_places() {
    let place = workplace(
        "ur10_ballbar",
        &source("position", "std_mm = 0.2\nstations = [\"table\"]"),
    );
    place.write("none.toml", scenario_text("ur10_ballbar"));
    let plan = place.read("plan.csv");
    let header = plan.lines().take(1);
    let (table, shelf): (Vec<&str>, Vec<&str>) =
        (plan.lines().skip(1)).partition(|line| line.ends_with("table"));
    let rows: Vec<&str> = header
        .chain(table.into_iter().take(2))
        .chain(shelf)
        .collect();
    place.write("two.csv", rows.join("\n") + "\n");
    place.json("evaluate s.toml --plan two.csv");
    place.json("measure s.toml --plan two.csv --measurements-out read.csv");
    let found = place.json("identify s.toml --measurements read.csv");
    let errors = numbers(&found["stations"][0]["position_std_mm"]);
    assert_eq!(found["stations"][0]["name"], "table");
    let is_known = |error_mm: &f64| *error_mm > 0.0 && *error_mm < 0.2 + 1e-9;
    assert!(
        errors.len() == 3 && errors.iter().all(is_known),
        "{errors:?}"
    );
    let told = place.run("evaluate none.toml --plan two.csv");
    told.says("station \"table\", which is read at 2 of at least 3 places");
    let told = place.run("identify none.toml --measurements read.csv");
    told.ends_with(1).says("E0504");
}

/// What a station is not, or no length shows, is refused with the key.
#[test]
fn what_no_place_is_known_by_is_refused() {
    let place = Workplace::new();
    let size = "std_mm = 0.2\n";
    let cups = |keys: &str| source("position", keys);
    let bar = |more: String| scenario_text("ur10_ballbar") + &more;
    let mut wrong = Vec::new();
    for (text, says) in [
        (
            bar(cups(&format!("{size}stations = [\"tabel\"]"))),
            &["stations", "\"tabel\"", "table, shelf"][..],
        ),
        (
            bar(cups(&format!("{size}stations = []"))),
            &["stations", "is empty"],
        ),
        (bar(cups("std_mm = -0.2")), &["std_mm", "-0.2"]),
        (bar(cups("")), &["needs its standard deviation", "std_mm"]),
        (bar(cups("std_mrad = 0.2")), &["std_mrad", "no such key"]),
        (
            bar(source("rotation", "std_mrad = 0.2")),
            &["kind", "no station reads"],
        ),
        (
            bar(source("rotation", "std_mrad = 0.2\nstations = [\"table\"]")),
            &["stations", "table reads no lengths"],
        ),
        (
            bar(cups(size) + &cups(&format!("{size}name = \"again\""))),
            &["uncertainty", "twice"],
        ),
        (
            scenario_text("ur10_tracker_ballbar")
                + &cups(&format!("{size}stations = [\"tracker\"]")),
            &["stations", "tracker reads no lengths"],
        ),
        (
            scenario_text("ur10_height_gauge")
                + "\n[[uncertainty]]\nkind = \"base_rotation\"\nstd_mrad = 1\n",
            &["kind", "station_rotation"],
        ),
        (
            scenario_text("klimchik2012") + &cups(size),
            &["kind", "lengths are read from"],
        ),
    ] {
        place.write("s.toml", text);
        let hints = [("\"tabel\"", "\"table\""), ("twice", "leave one out")];
        let hint = hints.iter().find(|(word, _)| says.contains(word));
        let hint = hint.map(|(_, hint)| *hint);
        wrong.extend(complaints(&place, "check s.toml", says, hint));
    }
    assert_none(&wrong);
}
