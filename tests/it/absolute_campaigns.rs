//! Plans of absolute readings in the laboratory: visits, stations, loads, run sheet, and the table to fill in.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::support::{
    Workplace, absolute_scenario_text, assert_has, number, numbers, with_numbers,
};

/// Two stations, two targets in one visit, repeats, and a load in some configurations.
const PLAN: &str = "\
q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats,target,station
-10,-65,110,-160,120,-20,0,0,-98,0,0,0,2,reflector,door
-10,-65,110,-160,120,-20,0,0,0,0,0,0,2,reflector,door
-10,-65,110,-160,120,-20,0,0,0,0,0,0,1,spindle,door
-140,-95,45,60,130,-20,0,0,0,0,0,0,2,spindle,door
90,-80,55,70,-70,-130,0,0,-98,0,0,0,1,reflector,door
-40,-90,55,-70,10,30,0,0,0,0,0,0,1,spindle,door
-50,-90,55,-70,30,30,0,0,0,0,0,0,1,spindle,door
70,-120,100,-150,-60,-50,0,0,-98,0,0,0,1,reflector,wall
-100,-85,100,50,150,50,0,0,0,0,0,0,1,spindle,wall
160,-80,100,-110,60,10,0,0,0,0,0,0,1,spindle,wall
-150,-55,40,-40,40,150,0,0,0,0,0,0,1,spindle,wall
";
/// The numbers of its rows' repeats, and of its visits: two of the load, two of the reflector, of which the spindle is in one.
const REPEATS: [usize; 11] = [2, 2, 1, 2, 1, 1, 1, 1, 1, 1, 1];
const VISITS: usize = 13;

const RETURNS: &str = "\n[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.02\n";

fn workplace(more: &str) -> Workplace {
    let place = Workplace::with("s.toml", absolute_scenario_text("ur10") + more);
    place.write("plan.csv", PLAN);
    place
}

fn stops(json: &Value) -> &Vec<Value> {
    json["stops"].as_array().expect("stops")
}

/// The header and the rows of a table.
fn rows(table: &str) -> (Vec<&str>, Vec<Vec<&str>>) {
    let lines = table.lines().filter(|line| !line.starts_with('#'));
    let mut rows = lines.map(|line| line.split(',').collect::<Vec<&str>>());
    (rows.next().expect("a header"), rows.collect())
}

/// A table to fill in with what another file of readings has of the same configurations, loads, targets and stations, the first first.
pub fn filled(empty: &str, read: &str) -> String {
    let ((columns, to_fill), (known, mut read)) = (rows(empty), rows(read));
    let place = |name: &str| known.iter().position(|column| *column == name);
    let head = empty.lines().filter(|line| line.starts_with('#'));
    let head: Vec<&str> = head.collect();
    let mut text = format!("{}\n{}\n", head.join("\n"), columns.join(","));
    for row in to_fill {
        let is_it = |other: &Vec<&str>| {
            let mut fields = columns.iter().zip(&row);
            fields.all(|(column, field)| {
                let is_free = field.is_empty() || *column == "visit";
                is_free || place(column).is_none_or(|place| other[place] == *field)
            })
        };
        let found = read.iter().position(is_it).expect("it was read");
        let found = read.remove(found);
        let fields = columns.iter().zip(&row).map(|(column, field)| {
            let value = place(column).map(|place| found[place]);
            value.filter(|_| field.is_empty()).unwrap_or(field)
        });
        text += &(fields.collect::<Vec<&str>>().join(",") + "\n");
    }
    assert!(read.is_empty(), "{read:?}");
    text
}

/// What is fitted to a filled-in table is what is fitted to the readings themselves.
pub fn fits_alike(place: &Workplace, scenario: &str, options: &str) {
    place.json(&format!(
        "measure {scenario}.toml --plan plan.csv --measurements-out read.csv"
    ));
    let empty = place.read(&format!("out/{scenario}/lab/measurements.csv"));
    place.write("filled.csv", filled(&empty, &place.read("read.csv")));
    let fit = |file: &str| {
        let identify = format!("identify {scenario}.toml --measurements {file} {options}");
        let outcome = place.run(&format!("{identify} --json --quiet"));
        outcome.json()
    };
    let [own, other] = ["filled.csv", "read.csv"].map(fit);
    assert_eq!(own["readings"], other["readings"]);
    // Stations and targets are in the order in which they come.
    for list in ["stations", "targets"] {
        let others = other[list].as_array().expect("a list");
        for one in own[list].as_array().expect("a list") {
            let found = others.iter().find(|each| each["name"] == one["name"]);
            let found = numbers(&found.expect("of both")["position_mm"]);
            for (one, other) in numbers(&one["position_mm"]).iter().zip(found) {
                assert!((one - other).abs() < 1e-5, "{list}: {one} {other}");
            }
        }
    }
    let [square, other] = [&own, &other].map(|json| number(&json["square"]));
    assert!((square / other - 1.0).abs() < 1e-6, "{square} {other}");
}

/// A stop is a visit; the instrument is set up at each station once, the load hung once, and no configuration comes twice in a row.
#[test]
fn stops_are_visits() {
    let place = workplace("");
    let json = place.json("lab s.toml --plan plan.csv");
    let stops = stops(&json);
    assert_eq!(stops.len(), VISITS);
    assert_eq!(json["set_ups"], 2);
    assert_eq!(json["load_changes"], 1);
    let mut read = [0; REPEATS.len()];
    for stop in stops {
        let targets = stop["targets"].as_array().expect("targets");
        let experiments = numbers(&stop["experiments"]);
        assert_eq!(targets.len(), experiments.len());
        for (row, target) in (PLAN.lines().skip(1).enumerate())
            .filter(|(row, _)| experiments.contains(&(*row as f64 + 1.0)))
            .zip(targets)
        {
            let (row, line) = row;
            read[row] += 1;
            let wanted = format!(
                ",{},{}",
                target.as_str().expect("a name"),
                stop["station"].as_str().expect("a name")
            );
            assert!(line.ends_with(&wanted), "{line} {stop}");
            assert_eq!(
                line.contains("-98"),
                !stop["wrench"].is_null(),
                "{line} {stop}"
            );
            let q: Vec<String> = (numbers(&stop["q_deg"]).iter())
                .map(f64::to_string)
                .collect();
            assert!(line.starts_with(&(q.join(",") + ",")), "{line} {stop}");
        }
    }
    assert_eq!(read, REPEATS);
    for pair in stops.windows(2) {
        assert!(pair[0]["q_deg"] != pair[1]["q_deg"] || pair[0]["wrench"] != pair[1]["wrench"]);
    }
    let stations: Vec<&str> = stops
        .iter()
        .filter_map(|stop| stop["station"].as_str())
        .collect();
    assert_eq!(stations.iter().filter(|name| **name == "wall").count(), 4);
    assert!(
        stations[9..].iter().all(|name| *name == "wall"),
        "{stations:?}"
    );
    // 2 set-ups of 20 min, 13 moves of 1, a load of 10, 14 readings of 0.5, and the time that joints turn.
    let turning_min = number(&json["travel_deg"]) / 10.0 / 60.0;
    assert!((number(&json["minutes"]) - 70.0 - turning_min).abs() < 1e-9);
    // In the plan's own order the load is hung for each row that has it.
    let kept = place.json("lab s.toml --plan plan.csv --keep-order");
    assert_eq!(kept["set_ups"], 2);
    assert_eq!(kept["load_changes"], 4);
}

/// The program halts for stations and loads, and keeps the angles of each stop.
#[test]
fn the_program_halts_for_stations() {
    let place = workplace("");
    place.json("lab s.toml --plan plan.csv --dialect urscript");
    let program = place.read("out/s/lab/s.script");
    for (said, times) in [
        ("Set up the instrument at station door", 1),
        ("Set up the instrument at station wall", 1),
        ("Hang the load", 1),
        ("Take the load off", 1),
        ("read reflector, spindle", 1),
        ("measured joint angles", VISITS),
    ] {
        assert_eq!(program.matches(said).count(), times, "{said}");
    }
}

/// A filled-in table is read as it is, from plan to compensation; readings of one visit are of one.
#[test]
fn filled_in_tables_are_read_as_they_are() {
    for more in ["", RETURNS] {
        let place = workplace(more);
        place.json("lab s.toml --plan plan.csv");
        fits_alike(&place, "s", "--parameters frames");
        let filled = place.read("filled.csv");
        let (columns, rows) = rows(&filled);
        let visit = columns
            .iter()
            .position(|column| *column == "visit")
            .expect("a column");
        let mut visits: Vec<&str> = rows.iter().map(|row| row[visit]).collect();
        assert_eq!(visits.len(), REPEATS.iter().sum::<usize>());
        visits.dedup();
        assert_eq!(visits.len(), VISITS);
        let identify = "identify s.toml --parameters frames --quiet --identified-out robot.json --measurements";
        place.run(&format!("{identify} filled.csv"));
        let compensated = place.json("compensate s.toml --identified robot.json");
        assert_eq!(compensated["test_poses"][0]["name"], "drilling");
    }
    // Poses have their quaternions.
    let place = workplace("");
    let text = place
        .read("s.toml")
        .replace("[instrument]", "[instrument]\nrotation_sigma_mrad = 0.1");
    place.write("s.toml", text);
    place.json("lab s.toml --plan plan.csv");
    assert!(
        place
            .read("out/s/lab/measurements.csv")
            .contains("z_mm,qw,qx,qy,qz\n")
    );
    fits_alike(&place, "s", "--parameters frames");
}

/// What a table cannot be is said: loads that are not those of the scenario, targets whose names are exchanged. One reading is no evidence
/// of anything.
#[test]
fn wrong_tables_are_noticed() {
    let place = workplace("");
    place.json("measure s.toml --plan plan.csv --measurements-out m.csv");
    let right = place.read("m.csv");
    let said = |text: &str| {
        place.write("w.csv", text);
        let identify = "identify s.toml --measurements w.csv --parameters frames --quiet";
        place.run(identify).stderr
    };
    let of_right = said(&right);
    assert!(
        !of_right.contains("C0105") && !of_right.contains("C0210"),
        "{of_right}"
    );
    let in_kg = right.replace(",-98,", ",-9.9898,");
    assert!(said(&in_kg).contains("condition C0105"));
    let exchanged = right
        .replace("spindle", "other")
        .replace("reflector", "spindle");
    let exchanged = said(&exchanged.replace("other", "reflector"));
    assert_has(&exchanged, "are targets exchanged? \"spindle\" is");
    let first = right.lines().filter(|line| !line.starts_with('#')).take(2);
    let one = said(&first.collect::<Vec<_>>().join("\n"));
    assert!(
        one.contains("E0504") && !one.contains("likely input error"),
        "{one}"
    );
}

/// A station that is read at fewer places than its frame takes is named, whether it is planned or measured.
#[test]
fn stations_of_few_readings_are_named() {
    let place = workplace("");
    let mut few: Vec<&str> = PLAN.lines().collect();
    few.truncate(few.len() - 3);
    place.write("few.csv", few.join("\n"));
    let evaluate = "evaluate s.toml --parameters frames --plan few.csv --quiet";
    place
        .doubted(evaluate)
        .says("the frame of station \"wall\", which is read at 1 of");
    place.done("evaluate s.toml --parameters frames --plan plan.csv --quiet");
}

/// A limit of configurations counts these, and not their targets and loads.
#[test]
fn configurations_are_limited() {
    let place = workplace("");
    let plan = "plan s.toml --parameters frames --candidates plan.csv --experiments 9";
    let json = place.json(&format!("{plan} --configurations 4"));
    let read = json["plan"].as_array().expect("a list");
    let configurations: BTreeSet<String> =
        read.iter().map(|each| each["q_deg"].to_string()).collect();
    assert!(configurations.len() <= 4 && read.len() > 4, "{json}");
}

/// The sheet as a browser shows it, on paper too: each reading has its line, each station its box.
#[test]
fn the_run_sheet_looks_well() {
    let place = workplace(
        "\n[[station]]\nname = \"door\"\nposition_mm = [2600, 300, 1200]\n\n[[station]]\nname = \"wall\"\nposition_mm = [-500, -4000, 1500]\n",
    );
    place.json("lab s.toml --plan plan.csv");
    let sheet = place.read("out/s/lab/run_sheet.html");
    assert_eq!(sheet.matches("class=\"stop\"").count(), VISITS);
    assert_eq!(
        sheet.matches("class=\"line\"").count(),
        REPEATS.iter().sum::<usize>()
    );
    for said in [
        "at station door",
        "near (\u{2212}500,\u{a0}\u{2212}4000,\u{a0}1500) mm",
        "hang the load",
        "Take the load off",
    ] {
        assert_eq!(sheet.matches(said).count(), 1, "{said}");
    }
    // Nine configurations, and where the load hangs.
    crate::browser::looks_well(&place.path("out/s/lab/run_sheet.html"), 10);
}

/// Standard deviations of readings that are in another unit are a condition.
#[test]
fn standard_deviations_in_another_unit_are_a_condition() {
    let place = workplace("");
    place.write("plan.csv", PLAN.replace(",1,", ",3,"));
    place.json("measure s.toml --plan plan.csv --measurements-out m.csv");
    let text = place.read("m.csv");
    let deviations = ["sx_mm", "sy_mm", "sz_mm"];
    place.write(
        "slip.csv",
        with_numbers(&text, &deviations, |sigma| sigma * 1e3),
    );
    let identify = "identify s.toml --allow C0201 --quiet --measurements";
    place.done(&format!("{identify} m.csv"));
    let slipped = place.doubted(&format!("{identify} slip.csv"));
    slipped.says("condition C0206: residuals too small for the readings' standard deviations");
}
