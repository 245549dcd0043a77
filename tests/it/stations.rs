//! Where the instrument stands: each station has its own distance, sight and bounds, and a plan chooses among them.

use elastocal::experiment::Candidate;
use elastocal::identification::ParameterGroup;
use elastocal::measurement::read_measured;
use elastocal::plan::absolute::AbsolutePlanning;
use elastocal::plan::search::{PlanSize, random_plan};
use elastocal::scenario::Scenario;
use serde_json::Value;

use crate::support::{
    Workplace, absolute_scenario_text, assert_has, list, number, scenario, scenario_text, unwatched,
};

/// What grows with the distance matters beside the rest.
const RANGE: &str = "\n[[uncertainty]]\nkind = \"tracker_range\"\nstd_um_per_m = 60\n";

fn station(name: &str, position_mm: [f64; 3], more: &str) -> String {
    format!("\n[[station]]\nname = {name:?}\nposition_mm = {position_mm:?}\n{more}\n")
}

/// The UR10's scenario for absolute accuracy, with more tables.
fn text(more: &str) -> String {
    absolute_scenario_text("ur10") + more
}

fn loaded(place: &Workplace, more: &str) -> Scenario {
    place.write("s.toml", text(more));
    place.scenario("s.toml")
}

/// Random rows without a load, from one station, or from nobody knows where.
fn rows(count: u32, from: Option<&str>) -> Vec<Candidate> {
    let plan = random_plan(&scenario("ur10").task, count, 3, 0).expect("a plan");
    (plan.experiments.iter().enumerate())
        .map(|(index, each)| Candidate {
            line: index + 2,
            configuration_rad: each.configuration_rad.clone(),
            load: None,
            most: Some(1),
            target: Some("spindle".to_owned()),
            station: from.map(str::to_owned),
            approach: None,
        })
        .collect()
}

fn planning<'a>(scenario: &'a Scenario, rows: &[Candidate]) -> AbsolutePlanning<'a> {
    AbsolutePlanning::new(&scenario.task, &[ParameterGroup::Frames], rows).expect("candidates")
}

fn of_all(scenario: &Scenario, rows: &[Candidate]) -> f64 {
    let planning = planning(scenario, rows);
    let all: Vec<(usize, u32)> = (0..planning.candidates.len())
        .map(|place| (place, 1))
        .collect();
    planning.prediction(&all).rho0_m().expect("a prediction")
}

/// A station where the model's tracker is says what the tracker says; one that is far away, less.
#[test]
fn each_station_has_its_own_distance() {
    let place = Workplace::new();
    let without = of_all(&loaded(&place, RANGE), &rows(10, Some("door")));
    let at = |position_mm: [f64; 3]| {
        let scenario = loaded(&place, &(station("door", position_mm, "") + RANGE));
        of_all(&scenario, &rows(10, Some("door")))
    };
    let there = at([-3500.0, -2500.0, 1200.0]);
    assert!((there / without - 1.0).abs() < 1e-12, "{there} {without}");
    let [near, far] = [[-1800.0, 0.0, 800.0], [-9000.0, -6000.0, 1200.0]].map(at);
    assert!(
        near < 0.7 * there && there < 0.7 * far,
        "{near} {there} {far}"
    );
}

/// Every plan of a few readings of few rows, each from each of three stations: the best is found, and none is below the bound.
#[test]
fn the_best_of_all_plans_from_all_stations_is_found() {
    const READINGS: u32 = 5;
    let place = Workplace::new();
    let more = station("a", [-1700.0, 900.0, 500.0], "range_max_mm = 2200")
        + &station("b", [2600.0, 300.0, 1200.0], "")
        + &station("c", [200.0, -2900.0, 900.0], "range_min_mm = 2000")
        + RANGE;
    let scenario = loaded(&place, &more);
    let planning = planning(&scenario, &rows(6, None));
    let all = planning.candidates.len();
    let stations: Vec<&str> = (planning.candidates.iter())
        .filter_map(|each| each.station.as_deref())
        .collect();
    for name in ["a", "b", "c"] {
        assert!(stations.contains(&name), "{stations:?}");
    }
    // Bounds leave some out, so that stations do not have the same rows.
    assert!(
        all < planning.offer.offered && planning.offer.offered == 18,
        "{all}"
    );
    let watch = unwatched();
    let found = planning
        .design_from(&[], PlanSize::all_different(READINGS), 1, watch)
        .expect("a plan");
    let value = planning
        .prediction(&found.plan)
        .rho0_m()
        .expect("a prediction");
    let mut best = (f64::INFINITY, Vec::new());
    let mut from_several = 0;
    for chosen in (0_u32..1 << all).filter(|chosen| chosen.count_ones() == READINGS) {
        let plan: Vec<(usize, u32)> = (0..all)
            .filter(|place| chosen >> place & 1 == 1)
            .map(|place| (place, 1))
            .collect();
        if let Some(rho0_m) = planning.prediction(&plan).rho0_m() {
            let first = &planning.candidates[plan[0].0].station;
            let is_mixed = plan
                .iter()
                .any(|&(each, _)| planning.candidates[each].station != *first);
            from_several += usize::from(is_mixed);
            if rho0_m < best.0 {
                best = (rho0_m, plan);
            }
        }
    }
    assert!(from_several > 100, "{from_several}");
    assert!((value / best.0 - 1.0).abs() < 1e-6, "{value} and {best:?}");
    let bound = found.bound.expect("a bound").best;
    assert!(
        bound <= best.0 && bound > 0.5 * best.0,
        "{bound} and {best:?}"
    );
}

fn reasons(planning: &AbsolutePlanning<'_>) -> String {
    let all: Vec<String> = planning
        .offer
        .left_out
        .iter()
        .map(ToString::to_string)
        .collect();
    all.join("\n")
}

/// What stands before one station hides nothing from another; a reflector that turns away, or is too far, is not read.
#[test]
fn each_station_has_its_own_sight() {
    let place = Workplace::new();
    let wall = "\n[[obstacle]]\nname = \"wall\"\nkind = \"box\"\nsize_mm = [100, 6000, 6000]\nposition_mm = [2000, 0, 3000]\n";
    let more = station("behind", [3000.0, 0.0, 1500.0], "")
        + &station("before", [-3000.0, 0.0, 1500.0], "")
        + wall;
    let seen = text(&more).replace("[region]", "[region]\nline_of_sight = true");
    // Stations are enough: the model's tracker site is not needed.
    place.write("s.toml", seen.replace("tracker_site = \"tracker\"\n", ""));
    let scenario = place.scenario("s.toml");
    let planning = planning(&scenario, &rows(30, None));
    let from = |name: &str| {
        let is_from = |each: &&Candidate| each.station.as_deref() == Some(name);
        planning.candidates.iter().filter(is_from).count()
    };
    assert_eq!(from("behind"), 0);
    assert!(from("before") > 10, "{}", from("before"));
    let words = reasons(&planning);
    assert_has(&words, "for line of sight");
    assert_has(&words, "blocked by wall");

    let limits = "range_min_mm = 2500\nrange_max_mm = 3500\nincidence_max_deg = 40";
    let scenario = loaded(&place, &station("door", [-3000.0, 0.0, 1500.0], limits));
    let rows = rows(60, None);
    let planning = crate::stations::planning(&scenario, &rows);
    let words = reasons(&planning);
    assert!(words.contains("range from station \"door\""), "{words}");
    assert!(words.contains("incidence to station \"door\""), "{words}");
    // What is left keeps the bounds, and what is left out does not, up to what gravity bends.
    let belief = &scenario.task.belief;
    for row in &rows {
        let state = (belief.nominal.chain.at(&belief.machining_tool))
            .state(row.configuration_rad.as_slice());
        let ray = nalgebra::Vector3::new(-3.0, 0.0, 1.5) - state.tool_position;
        let turned_deg = state.tool_rotation.column(2).angle(&ray).to_degrees();
        let is_near = [ray.norm() - 2.5, ray.norm() - 3.5]
            .iter()
            .any(|off| off.abs() < 0.005)
            || (turned_deg - 40.0).abs() < 0.5;
        let is_kept = planning.candidates.iter().any(|each| each.line == row.line);
        let keeps = (2.5..3.5).contains(&ray.norm()) && turned_deg < 40.0;
        assert!(is_near || is_kept == keeps, "{} {turned_deg}", ray.norm());
    }
}

/// The sight is of the target that is read, not of the calibration tool.
#[test]
fn what_is_read_must_be_seen() {
    let place = Workplace::new();
    let far =
        "\n[[robot.tool]]\nname = \"arm_end\"\non = \"reflector\"\nposition_mm = [0, 0, 3000]\n";
    let text = text(&station(
        "door",
        [-3000.0, 0.0, 1500.0],
        "range_max_mm = 2000",
    ));
    place.write("s.toml", text + far);
    let scenario = place.scenario("s.toml");
    let of = |target: &str| {
        let mut rows = rows(60, None);
        for row in &mut rows {
            row.target = Some(target.to_owned());
        }
        let planning = planning(&scenario, &rows);
        planning
            .candidates
            .iter()
            .map(|each| each.line)
            .collect::<Vec<_>>()
    };
    assert_ne!(of("spindle"), of("arm_end"));
}

fn csv(rows: &[Candidate], has_station: bool) -> String {
    let mut text = String::from("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,target");
    text += if has_station { ",station\n" } else { "\n" };
    for row in rows {
        let angles: Vec<String> = (row.configuration_rad.iter())
            .map(|q| q.to_degrees().to_string())
            .collect();
        text += &format!(
            "{},{}",
            angles.join(","),
            row.target.as_deref().expect("a target")
        );
        if has_station {
            text += &format!(",{}", row.station.as_deref().unwrap_or_default());
        }
        text.push('\n');
    }
    text
}

/// The commands: rows without a station are from each, the plan says which were chosen, and its file says the same.
#[test]
fn commands_choose_the_station() {
    let place = Workplace::new();
    let more = station("near", [-1800.0, 0.0, 800.0], "")
        + &station("far", [-9000.0, -6000.0, 1200.0], "")
        + RANGE;
    place.write("s.toml", text(&more));
    place.write("c.csv", csv(&rows(20, None), false));
    let plan =
        "plan s.toml --parameters frames --experiments 8 --candidates c.csv --plan-out p.csv";
    let planned = place.json(plan);
    assert_eq!(planned["candidates"]["offered"], 40);
    assert_eq!(planned["frame"], "near");
    let readings = list(&planned["plan"]);
    let is_near = |each: &Value| each["station"] == "near";
    assert!(readings.iter().all(is_near), "{readings:?}");
    let again = place.json("evaluate s.toml --parameters frames --plan p.csv --candidates c.csv");
    let [one, other] = [&planned, &again].map(|json| number(&json["rho0_mm"]));
    assert!((one / other - 1.0).abs() < 1e-6, "{one} {other}");

    let evaluate = "evaluate s.toml --parameters frames --plan c.csv --quiet";
    place
        .refused(evaluate)
        .says("line 2: station: is missing; the scenario has near, far");
    place.write("w.csv", csv(&rows(20, Some("fare")), true));
    let wrong = place.refused("plan s.toml --candidates w.csv --quiet");
    let wrong = wrong.says("line 2: station: found \"fare\"; the scenario has near, far");
    wrong.says("did you mean \"far\"?");
    // The one station that there is needs no word.
    let one = text(&(station("near", [-1800.0, 0.0, 800.0], "") + RANGE));
    place.write("s.toml", one);
    let alone = place.json("evaluate s.toml --parameters frames --plan c.csv");
    assert_eq!(alone["frame"], "near");
}

/// Wrong tables, each with its key.
#[test]
fn wrong_stations_are_told() {
    let place = Workplace::new();
    let at = |name: &str, more: &str| station(name, [-1800.0, 0.0, 800.0], more);
    let ball = "\n[[obstacle]]\nname = \"ball\"\nkind = \"sphere\"\nradius_mm = 500\nposition_mm = [-1700, 0, 800]\n";
    let sighted = |more: &str| text(more).replace("[region]", "[region]\nline_of_sight = true");
    for (text, words) in [
        (
            text(&(at("a", "") + &at("a", ""))),
            "station[1].name: found \"a\" twice",
        ),
        (text(&at("", "")), "station[0].name"),
        (text(&at("a", "position_um = 1")), "station[0].position_um"),
        (
            text(&station("a", [0.0, 1e9, 0.0], "")),
            "station[0].position_mm: found 1e9",
        ),
        (
            text("\n[[station]]\nname = \"a\"\nposition_mm = [1, 2]\n"),
            "station[0].position_mm: found 2 numbers",
        ),
        (
            text("\n[[station]]\nname = \"a\"\n"),
            "missing field `position_mm`",
        ),
        (
            text(&at("a", "range_min_mm = -1")),
            "station[0].range_min_mm: found -1",
        ),
        (
            text(&at("a", "range_min_mm = 6\nrange_max_mm = 5")),
            "station[0].range_min_mm: found 6",
        ),
        (
            text(&at("a", "incidence_max_deg = 0")),
            "station[0].incidence_max_deg: found 0",
        ),
        (
            text(&at("a", "incidence_max_deg = 181")),
            "station[0].incidence_max_deg: found 181",
        ),
        (
            sighted(&(at("a", "") + ball)),
            "station[0].position_mm: the place is inside ball",
        ),
        (
            text(&station("a", [500.0, 500.0, -20.0], "")),
            "the place is inside floor",
        ),
        (
            scenario_text("ur10") + &at("a", ""),
            "station: stations are of absolute readings",
        ),
        (
            text("")
                .replace("[region]", "[region]\nline_of_sight = true")
                .replace("tracker_site = \"tracker\"\n", ""),
            "instrument.tracker_site",
        ),
    ] {
        place.write("s.toml", text);
        place.refused("check s.toml --quiet").says(words);
    }
}

/// Too many candidates once each row is from each station.
#[test]
fn rows_times_stations_have_a_limit() {
    let place = Workplace::new();
    let stations: String = (0..100)
        .map(|index| {
            station(
                &format!("s{index}"),
                [-3000.0, f64::from(index), 1500.0],
                "",
            )
        })
        .collect();
    let scenario = loaded(&place, &stations);
    let mut many = vec![rows(1, None).remove(0); 501];
    for (row, by_rad) in many.iter_mut().zip(0..) {
        row.configuration_rad[0] += 1e-3 * f64::from(by_rad);
    }
    match AbsolutePlanning::new(&scenario.task, &[ParameterGroup::Frames], &many) {
        Err(error) if error.to_string().contains("50100 candidates") => {}
        other => panic!("{:?}", other.map(|planning| planning.offer.offered)),
    }
}

/// A virtual robot's station stands where it stands, whatever else is read: what is identified by one plan is validated by another.
#[test]
fn a_station_stands_where_it_stands_whatever_else_is_read() {
    let place = Workplace::new();
    let exact = absolute_scenario_text("ur10").replace("sigma_mm = 0.02", "sigma_mm = 1e-5");
    let known = station("door", [-3500.0, -2500.0, 1200.0], "")
        + &station("wall", [-1800.0, 2500.0, 800.0], "");
    let row = |station: &str| format!("-10,-65,110,-160,120,-20,spindle,{station}\n");
    let header = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,target,station\n";
    for (name, stations) in [("known", ["door", "wall"]), ("other", ["floor", "roof"])] {
        let more = if name == "known" { &*known } else { "" };
        place.write("s.toml", exact.clone() + more);
        let read = |rows: &[&str]| -> Vec<String> {
            let rows: String = rows.iter().map(|each| row(each)).collect();
            place.write("plan.csv", header.to_owned() + &rows);
            place.done("measure s.toml --plan plan.csv --measurements-out m.csv --quiet");
            place.read("m.csv").lines().map(str::to_owned).collect()
        };
        let of = |lines: &[String], station: &str| -> Vec<f64> {
            let line = lines
                .iter()
                .find(|line| line.contains(&format!(",{station},")));
            let fields = line.expect("a row").split(',');
            fields
                .filter_map(|field| field.parse().ok())
                .skip(6)
                .take(3)
                .collect()
        };
        let [one, other] = stations;
        let (both, turned, alone) = (read(&[one, other]), read(&[other, one]), read(&[other]));
        for lines in [&turned, &alone] {
            for (there, here) in of(&both, other).iter().zip(of(lines, other)) {
                assert!((there - here).abs() < 1e-3, "{name}: {there} {here}");
            }
        }
        assert_ne!(of(&both, one), of(&both, other));
    }
}

/// A file of readings has the stations of the scenario, where it has some.
#[test]
fn readings_are_from_the_scenarios_stations() {
    let place = Workplace::new();
    let near = station("near", [-1800.0, 0.0, 800.0], "");
    let far = station("far", [-9000.0, -6000.0, 1200.0], "");
    let header = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,station,x_mm,y_mm,z_mm";
    let read = |stations: &str, name: &str| {
        let scenario = loaded(&place, stations);
        let row = |name| format!("0,-60,80,0,0,0,{name},1,2,3\n");
        place.write("m.csv", format!("{header}\n{}{}", row("near"), row(name)));
        let read = read_measured(&place.path("m.csv"), &scenario.task);
        read.map(drop).map_err(|error| error.to_string())
    };
    for (stations, name, problem) in [
        (
            near.clone() + &far,
            "fare",
            "line 3: station: found \"fare\"; the scenario has near, far",
        ),
        (near.clone() + &far, "", "line 3: station: found \"\""),
    ] {
        let found = read(&stations, name).expect_err(name);
        assert!(found.contains(problem), "{found}");
    }
    assert_eq!(read(&(near.clone() + &far), "far"), Ok(()));
    assert_eq!(read("", "fare"), Ok(()));
}
