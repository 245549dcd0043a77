//! Absolute readings of a robot that stays where it is while a load is hung: the unloaded and the loaded reading share the joints' return.

use elastocal::experiment::{Candidate, read_candidates, write_candidates};
use elastocal::plan::absolute::AbsolutePlanning;
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use nalgebra::Isometry3;
use serde_json::Value;

use crate::absolute_campaigns::fits_alike;
use crate::absolute_trials::holds;
use crate::support::{Workplace, number, numbers, project, scenario_text};

const LOADINGS: [&str; 2] = ["in_place", "returns"];

const RETURNS: &str = "\n[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.05\n";
const DIRECTION: &str = "\n[[uncertainty]]\nkind = \"load_direction\"\nstd_mrad = 5\n";
const POINT: &str = "\n[[uncertainty]]\nkind = \"load_point\"\nstd_mm = 1\n";

/// A UR10 whose zeros are known and whose compliances are not, by a height gauge: joints return badly, and loads hang out of plumb.
fn text(loading: &str) -> String {
    let costs = "\n[laboratory]\nload_change_min = 3\nloading = ";
    let replaced = [
        (
            "\"shoulder_lift\"]\ncompliance",
            "\"shoulder_lift\", \"elbow\", \"wrist_1\", \"wrist_2\"]\ncompliance",
        ),
        (
            "\"shoulder_pan\", \"shoulder_lift\", \"elbow\", \"wrist_1\", \"wrist_2\", ",
            "\"shoulder_pan\", ",
        ),
        ("force_n = [10, -20, -50]", "force_n = [0, 0, -200]"),
        ("std_mrad = 2\n", "std_mrad = 0.02\n"),
        ("std_mrad = 0.02\n\n[design]", "std_mrad = 0.05\n\n[design]"),
    ];
    let own = scenario_text("ur10_height_gauge");
    let text = replaced.iter().fold(own, |text, (old, new)| {
        assert!(text.contains(old), "{old}");
        text.replacen(old, new, 1)
    });
    format!("{text}{DIRECTION}{POINT}{costs}\"{loading}\"\n")
}

/// Configurations of the height gauge's plan, each without and with a load: some with two loads, some loaded once more.
fn workplace() -> Workplace {
    let place = Workplace::new();
    for loading in LOADINGS {
        place.write(&format!("{loading}.toml"), text(loading));
    }
    let scenario = place.scenario("returns.toml");
    let commands = scenario.task.belief.commands();
    let plan = project("scenarios/plans/ur10_height_gauge.csv");
    let rows = read_candidates(&plan, commands.clone()).expect("a plan");
    let read = |(number, row): (usize, &Candidate)| {
        let times = 1 + u32::from(number % 4 == 0);
        [(0.0, 1), (-98.0, times)].map(|(force_n, times)| Candidate {
            load: Some(Load::force(0.0, 0.0, force_n)),
            most: Some(times),
            ..row.clone()
        })
    };
    let rows: Vec<Candidate> = rows.iter().step_by(2).enumerate().flat_map(read).collect();
    write_candidates(&place.path("plan.csv"), commands, &rows).expect("written");
    place
}

fn scenario(place: &Workplace, loading: &str) -> Scenario {
    place.scenario(&format!("{loading}.toml"))
}

/// Where the return of the joints is what counts, loads that are hung in place tell compliances better, as predicted either way.
#[test]
fn what_is_hung_in_place_tells_more_as_predicted() {
    let place = workplace();
    let [in_place, returns] = LOADINGS.map(|loading| {
        let json = place.json(&format!(
            "evaluate {loading}.toml --plan plan.csv --trials 1000"
        ));
        holds(&json["trials"]);
        number(&json["rho0_mm"])
    });
    assert!(in_place < 0.7 * returns, "{in_place} {returns}");
}

/// Readings of one visit share the joints' return whatever hangs, and the direction of the load with those under the same alone.
#[test]
fn readings_of_one_visit_share_returns_and_no_other_load() {
    let place = workplace();
    let correlations = |loading: &str, kept: &str| {
        let sources = [RETURNS, DIRECTION, POINT];
        let others = sources.into_iter().filter(|source| *source != kept);
        let text = others.fold(text(loading), |text, other| text.replacen(other, "", 1));
        let any = "kind = \"any\"\nforce_max_n = 98";
        place.write(
            "one.toml",
            text.replacen("kind = \"fixed\"\nforce_n = [0, 0, -98]", any, 1),
        );
        let scenario = scenario(&place, "one");
        let commands = scenario.task.belief.commands();
        let rows = read_candidates(&place.path("plan.csv"), commands).expect("a plan");
        let [unloaded, loaded] = [&rows[0], &rows[1]];
        let other = Candidate {
            load: Some(Load::force(0.0, 0.0, -49.0)),
            ..loaded.clone()
        };
        let rows = [unloaded.clone(), loaded.clone(), other];
        let planning = AbsolutePlanning::new(&scenario.task, &[], &rows).expect("a plan");
        let groups = planning.by_configuration(&planning.whole());
        let frames = vec![Isometry3::identity(); planning.stations().len()];
        let shared = planning.shared_errors(&groups, &frames).groups.remove(0);
        // Visits are in the order of the rows that they begin with.
        let places = groups[0].iter().map(|each| each.place);
        let places: Vec<usize> = places.collect();
        let row = |place: usize| {
            let index = places.iter().position(|each| *each == place);
            shared.effects[index.expect("read")].row(0).into_owned()
        };
        let product = |one: usize, other: usize| row(one).dot(&row(other));
        let size = |one: usize, other: usize| (product(one, one) * product(other, other)).sqrt();
        [(0, 1), (1, 2)]
            .map(|(one, other)| product(one, other) / size(one, other).max(f64::MIN_POSITIVE))
    };
    for correlation in correlations("in_place", RETURNS) {
        assert!(correlation > 0.999, "{correlation}");
    }
    for (loading, source) in [
        ("returns", RETURNS),
        ("in_place", DIRECTION),
        ("in_place", POINT),
    ] {
        let found = correlations(loading, source);
        assert!(
            found.iter().all(|each| each.abs() < 1e-12),
            "{loading} {source}: {found:?}"
        );
    }
}

/// What `measure` writes says which readings are of one visit: fits, choices and plans of what is next know of it, whatever the scenario.
#[test]
fn files_say_what_was_read_in_place() {
    let place = workplace();
    place.json("measure in_place.toml --plan plan.csv --measurements-out read.csv");
    let planned = place.json("evaluate in_place.toml --plan plan.csv");
    let errors = |json: &Value, list: &str| -> Vec<f64> {
        let all = json[list].as_array().expect("a list").iter();
        all.take(4)
            .map(|each| number(&each["standard_error"]))
            .collect()
    };
    let identified = |loading: &str, file: &str| {
        let options = format!("{loading}.toml --measurements {file}");
        place.json(&format!(
            "identify {options} --identified-out {loading}.json"
        ))
    };
    let [own, named] = LOADINGS.map(|loading| identified(loading, "read.csv"));
    let covariance = |json: &Value| -> Vec<f64> {
        let rows = json["covariance"].as_array().expect("rows").iter();
        rows.flat_map(numbers).collect()
    };
    assert_eq!(covariance(&own), covariance(&named));
    let [expected, found] = [errors(&planned, "unknowns"), errors(&own, "unknowns")];
    for (found, expected) in found.iter().zip(&expected) {
        assert!((found / expected - 1.0).abs() < 0.05, "{found} {expected}");
    }
    // Without the column the scenario says it.
    let table = place.read("read.csv");
    let header = table
        .lines()
        .find(|line| line.starts_with("q1_deg"))
        .expect("a header");
    let column = header
        .split(',')
        .position(|name| name == "visit")
        .expect("a column");
    let without = table.lines().map(|line| {
        let fields = line.split(',').enumerate();
        let kept = fields.filter(|(place, _)| line.starts_with('#') || *place != column);
        kept.map(|(_, field)| field).collect::<Vec<_>>().join(",") + "\n"
    });
    place.write("unsaid.csv", without.collect::<String>());
    assert_eq!(
        covariance(&own),
        covariance(&identified("in_place", "unsaid.csv"))
    );
    let returned = errors(&identified("returns", "unsaid.csv"), "unknowns");
    assert!(returned[1] > 2.0 * found[1], "{returned:?} {found:?}");

    let next = "--measurements read.csv --candidates plan.csv --experiments 26";
    for loading in LOADINGS {
        let json = place.json(&format!("next {loading}.toml {next}"));
        let [so_far, all] = [&json["measured_rho0_mm"], &planned["rho0_mm"]].map(number);
        assert!((so_far / all - 1.0).abs() < 1e-6, "{so_far} {all}");
    }
    let select = "select in_place.toml --measurements read.csv --sizes 8 --draws 4 --campaigns 2";
    assert_eq!(place.json(select)["chosen"], "visits");
    place.json("measure in_place.toml --plan plan.csv --series 1 --measurements-out other.csv");
    place.json("validate in_place.toml --identified in_place.json --measurements other.csv");
}

/// One move for each visit, at which the load is changed as often as need be; the table to fill in says which stops are one visit.
#[test]
fn the_laboratory_changes_loads_where_the_robot_stands() {
    let place = workplace();
    let work = LOADINGS.map(|loading| {
        let json = place.json(&format!("lab {loading}.toml --plan plan.csv"));
        let stops = json["stops"].as_array().expect("stops").clone();
        let number = |key: &str| number(&json[key]);
        let minutes = number("minutes") - number("travel_deg") / 10.0 / 60.0;
        let costs =
            20.0 * number("set_ups") + 3.0 * number("load_changes") + 0.5 * number("readings");
        (stops, minutes - costs, number("load_changes"))
    });
    let [(stops, moves, changes), (_, returned, once)] = &work;
    // Eleven configurations, three of which are visited again; what hangs stays on to the next.
    assert!(
        (moves - 14.0).abs() < 1e-6 && (returned - 25.0).abs() < 1e-6,
        "{moves} {returned}"
    );
    assert!(
        *changes <= 7.0 && (*once - 1.0).abs() < 1e-9,
        "{changes} {once}"
    );
    let table = place.read("out/in_place/lab/measurements.csv");
    let lines = table.lines().filter(|line| !line.starts_with('#')).skip(1);
    let visits: Vec<String> = lines
        .map(|line| line.split(',').nth(13).expect("a visit").to_owned())
        .collect();
    let mut came = 0;
    for (place, (stop, visit)) in stops.iter().zip(&visits).enumerate() {
        if place == 0 || stops[place - 1]["q_deg"] != stop["q_deg"] {
            came = place + 1;
        }
        assert_eq!(*visit, came.to_string());
    }
    let sheet = place.read("out/in_place/lab/run_sheet.html");
    assert!(
        sheet.contains("Take the load off where the robot stands.")
            && sheet.contains("stays where it stands")
    );
    fits_alike(&place, "in_place", "");
}

/// What cannot be is refused with the key or the column.
#[test]
fn what_cannot_hang_in_place_is_refused() {
    let place = workplace();
    let shared =
        text("in_place").replacen("[instrument]", "[instrument]\nunloaded = \"shared\"", 1);
    place.write("shared.toml", shared);
    place.refused("check shared.toml").says("unloaded");
    place.write("word.toml", text("inplace"));
    place.refused("check word.toml").says("inplace");
    place.json("measure in_place.toml --plan plan.csv --measurements-out read.csv");
    let read = place.read("read.csv");
    let first = read
        .lines()
        .find(|line| line.starts_with("21.14"))
        .expect("a row");
    let angle = first.split(',').next().expect("an angle");
    place.write("moved.csv", read.replacen(angle, "21", 1));
    let identify = "identify in_place.toml --measurements moved.csv";
    place
        .refused(identify)
        .says("visit: found \"1\" at other joint angles");
}
