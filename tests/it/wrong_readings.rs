//! Wrong readings are left out of everything that is told of a file, and named there.

use std::cell::RefCell;
use std::fmt::Write;

use elastocal::identification::{AbsoluteCase, ParameterGroup, ReadingWeights};
use elastocal::measurement::{AbsoluteReading, absolute_table};
use elastocal::numeric::random::generator;
use nalgebra::{UnitQuaternion, Vector3};
use serde_json::{Value, json};

use crate::model_selection::{read_of, waves};
use crate::one_fit::{between, normal, seen_arm, ur10, workplace};
use crate::support::{
    Workplace, absolute_scenario_text, assert_alike_in, list, number, project, scenario_text,
    shipped,
};

/// Readings of a robot whose gears are not round, and the same with one in twenty wrong by 1 to 50 mm, all to one side; which
/// (from 1).
fn some_wrong() -> ([Vec<AbsoluteReading>; 2], Vec<usize>) {
    let mut random = generator(51, 0);
    let arm = seen_arm(&mut random, &ur10(), 1, 1);
    let gear = waves(&mut random);
    let right = read_of(&mut random, &arm, 120, 0.0, &gear);
    let mut readings = right.clone();
    let side = Vector3::new(0.6, -0.5, 0.6).normalize();
    let wrong: Vec<usize> = (0..6).map(|each| 20 * each + 7).collect();
    for &index in &wrong {
        let off_m = 3e-3 * 16.0_f64.powf(between(&mut random, 0.0, 1.0));
        readings[index].position_m += side * off_m;
    }
    let wrong = wrong.into_iter().map(|index| index + 1).collect();
    ([right, readings], wrong)
}

/// With wrong readings, models are compared and patterns looked for as among the right ones alone.
#[test]
fn model_selection_and_patterns_are_of_the_right_readings() {
    let ([right, readings], wrong) = some_wrong();
    let place = workplace(&readings);
    let alone: Vec<AbsoluteReading> = (right.into_iter().enumerate())
        .filter(|(index, _)| !wrong.contains(&(index + 1)))
        .map(|(_, each)| each)
        .collect();
    place.write("right.csv", absolute_table(&6.into(), &alone));
    let command = "identify s.toml --quiet --model-selection --measurements";
    let with = place.run(&format!("{command} m.csv --json")).json();
    let without = place.run(&format!("{command} right.csv --json")).json();
    let rejected = list(&with["model_selection"]["rejected"]);
    let numbers: Vec<&Value> = rejected.iter().map(|each| &each["reading"]).collect();
    assert_eq!(json!(numbers), json!(wrong));
    assert_eq!(with["patterns"]["without"], json!(wrong));
    assert_eq!(without["model_selection"]["rejected"], json!([]));
    assert_eq!(without["patterns"]["without"], json!([]));
    assert_eq!(with["groups"], without["groups"]);
    let alike = |one: &Value, other: &Value| {
        let [one, other] = [one, other].map(|value| value.as_f64().expect("a number"));
        assert!((one / other - 1.0).abs() < 1e-3, "{one} {other}");
    };
    let nested_models = |json: &Value| list(&json["model_selection"]["nested_models"]).clone();
    let both = [nested_models(&with), nested_models(&without)];
    assert_eq!(both[0].len(), both[1].len());
    for (one, other) in both[0].iter().zip(&both[1]) {
        alike(&one["distance_mm"]["rms"], &other["distance_mm"]["rms"]);
        let judged =
            |nested_model: &Value| nested_model["cross_validation"]["distance_mm"]["rms"].clone();
        alike(&judged(one), &judged(other));
    }
    let found = |json: &Value| -> Vec<Value> {
        let all = list(&json["patterns"]["found"]).iter();
        all.map(|each| json!([each["against"], each["joint"], each["waves"]]))
            .collect()
    };
    assert!(!found(&with).is_empty());
    assert_eq!(found(&with), found(&without));
    let outcome = place.run(&format!("{command} m.csv"));
    for words in [
        "outliers of the largest model, left out of all: readings 8, 28, 48, 68, 88, 108",
        "without 6 rejected readings",
    ] {
        outcome.prints(words);
    }
    // All are in the model selection that is asked to keep them.
    let all = place
        .run(&format!("{command} m.csv --keep-all --json"))
        .json();
    assert_eq!(all["model_selection"]["rejected"], json!([]));
    let rms =
        |json: &Value| json["model_selection"]["nested_models"][1]["distance_mm"]["rms"].as_f64();
    assert!(rms(&all) > rms(&with).map(|rms| 2.0 * rms));
}

/// Wrong readings of one half, or of one of two series, do not make them contradict each other.
#[test]
fn wrong_readings_are_no_inconsistency() {
    let ([right, mut readings], wrong) = some_wrong();
    readings.truncate(60);
    let place = workplace(&right[60..]);
    place.write("other.csv", absolute_table(&6.into(), &readings));
    let command = "identify s.toml --quiet --parameters zeros --measurements m.csv --against other.csv --json";
    let json = place.run(command).json();
    let series = list(&json["inconsistencies"]).last();
    let series = series.expect("both are compared");
    assert!(series["compared"].as_u64() > Some(0), "{series}");
    assert_eq!(series["found"], json!([]), "{wrong:?}");
    place.write("m.csv", place.read("other.csv"));
    place.write("other.csv", absolute_table(&6.into(), &right[60..]));
    let json = place.run(command).json();
    for each in list(&json["inconsistencies"]) {
        assert_eq!(each["found"], json!([]), "{each}");
    }
}

/// Frames alone, without what the load bends, explain a crowd of readings best and few others: geometry and elasticity explain all, and
/// none is left out.
#[test]
fn readings_apart_from_a_crowd_are_fitted() {
    let place = Workplace::with("s.toml", absolute_scenario_text("planar_3r"));
    let mut plan = String::from(
        "q1_deg,q2_deg,q3_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats,target\n\
         2,6,17,0,0,-200,0,0,0,2,tool\n4,8,18,0,0,-200,0,0,0,1,tool\n\
         98,43,37,0,0,0,0,0,0,1,tool\n-20,-38,123,0,0,-200,0,0,0,1,tool\n",
    );
    for each in 0..6 {
        let (one, other) = (-87.0 + 0.4 * f64::from(each), 106.0 - 0.3 * f64::from(each));
        let _ = writeln!(plan, "{one},{other},42,0,0,0,0,0,0,2,tool");
    }
    place.write("plan.csv", plan);
    for seed in 1..=5 {
        place.done(&format!(
            "measure s.toml --plan plan.csv --seed {seed} --measurements-out m.csv --quiet"
        ));
        let json = place.json("identify s.toml --measurements m.csv --parameters zeros");
        assert_eq!(json["rejected"], json!([]), "seed {seed}");
        assert!(number(&json["consistency"]) > 1e-3, "seed {seed}");
    }
}

/// One of fourteen readings is 10 mm off: the compliances that the others determine do not stay nominal beside it.
#[test]
fn what_stays_nominal_is_decided_without_a_gross_error() {
    let place = Workplace::new();
    let [scenario, plan] = ["ur10_readings.toml", "plans/ur10_readings.csv"]
        .map(|file| project(&format!("tests/golden/{file}")));
    let (scenario, plan) = (scenario.display(), plan.display());
    let measure = format!("measure {scenario} --plan {plan} --measurements-out m.csv");
    place.done(&measure);
    let table = place.read("m.csv");
    let mut lines: Vec<String> = table.lines().map(str::to_owned).collect();
    let header = lines.iter().position(|line| line.starts_with("q1"));
    let header = header.expect("a header");
    let column = lines[header].split(',').position(|name| name == "x_mm");
    let row = header + 8;
    let mut cells: Vec<String> = lines[row].split(',').map(str::to_owned).collect();
    let cell = &mut cells[column.expect("a position")];
    *cell = (cell.parse::<f64>().expect("a number") + 10.0).to_string();
    lines[row] = cells.join(",");
    let identified = |lines: &[String]| {
        place.write("w.csv", lines.join("\n") + "\n");
        let command =
            format!("identify {scenario} --measurements w.csv --parameters zeros,compliances");
        place.run(&format!("{command} --json")).json()
    };
    let found = identified(&lines);
    assert_eq!(found["rejected"][0]["reading"], 8);
    lines.remove(row);
    let without = identified(&lines);
    assert_eq!(
        found["unknowns"].as_array().map(Vec::len),
        without["unknowns"].as_array().map(Vec::len)
    );
    let unknowns = [&found, &without].map(|json| list(&json["unknowns"]));
    for (one, other) in unknowns[0].iter().zip(unknowns[1]) {
        let [one, other] = [one, other].map(|each| &each["standard_error"]);
        assert_eq!(one.is_null(), other.is_null(), "{found:#}");
    }
}

/// One of nine readings is 10 mm off: which compliances stay nominal is what the other eight say.
#[test]
fn compliances_of_a_gauge_are_those_of_the_right_readings() {
    let place = Workplace::new();
    let text = scenario_text("kr270_gauge");
    let (before, own) = text
        .split_once("[[uncertainty]]\nkind = \"compliance\"\nname = \"data_sheet\"")
        .expect("a data sheet");
    let (_, after) = own.split_once("[[uncertainty]]").expect("more");
    place.write("s.toml", format!("{before}[[uncertainty]]{after}"));
    let plan = shipped("scenarios/plans/kr270_gauge_m9.csv");
    place.done(&format!(
        "measure s.toml --plan {plan} --measurements-out m.csv"
    ));
    let table = place.read("m.csv");
    let lines: Vec<&str> = table.lines().collect();
    let first = lines
        .iter()
        .position(|line| line.starts_with("q1"))
        .expect("a header")
        + 1;
    let identified = |lines: &[String]| {
        place.write("w.csv", lines.join("\n") + "\n");
        place
            .run("identify s.toml --measurements w.csv --json")
            .json()
    };
    let mut named = 0;
    for row in 0..9 {
        let mut wrong: Vec<String> = lines.iter().map(|&line| line.to_owned()).collect();
        let (setup, read) = lines[first + row].rsplit_once(',').expect("a displacement");
        wrong[first + row] = format!("{setup},{}", read.parse::<f64>().expect("a number") + 10.0);
        let found = identified(&wrong);
        let rejected = list(&found["rejected"]);
        assert_eq!(rejected.len(), 1, "{row}");
        named += usize::from(rejected[0]["reading"] == row + 1);
        wrong.remove(first + row);
        let without = identified(&wrong);
        let of = |json: &Value| list(&json["compliance_rad_per_nm"]).clone();
        for (one, other) in of(&found).iter().zip(of(&without)) {
            assert_eq!(one.is_null(), other.is_null(), "{row}: {found:#}");
            if !one.is_null() {
                assert_alike_in(&row, number(one), number(&other), 1e-4);
            }
        }
    }
    assert_eq!(named, 9);
}

/// One wrong pose takes no other with it where the planner's model lists how joints return: how far out each lies given the others is by the
/// weights of the fit.
#[test]
fn one_wrong_pose_takes_no_other_with_it() {
    const STD_RAD: f64 = 1e-5;
    let mut random = generator(53, 0);
    let arm = seen_arm(&mut random, &ur10(), 1, 1);
    let returns = RefCell::new(generator(53, 1));
    let gear = |_: usize, _: f64| STD_RAD / 2.0_f64.sqrt() * normal(&mut *returns.borrow_mut());
    let right = read_of(&mut random, &arm, 40, 200.0, &gear);
    let place = workplace(&right);
    let listed = format!(
        "{}\n[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = {}\n",
        place.read("s.toml"),
        STD_RAD * 1e3
    );
    place.write("l.toml", listed);
    let scenario = place.scenario("l.toml");
    let rejected = |readings: &[AbsoluteReading]| -> (bool, Vec<usize>) {
        let mut case = AbsoluteCase::new(&scenario.task.belief, readings).expect("readings");
        let groups = [ParameterGroup::Geometry, ParameterGroup::Compliances];
        let fit = case.fit(&groups, ReadingWeights::AsNeeded).expect("a fit");
        let rejected = fit.rejected.iter().map(|each| each.reading).collect();
        (fit.counts_sources, rejected)
    };
    assert_eq!(rejected(&right), (true, Vec::new()));
    for wrong in [4, 8, 22, 30] {
        let mut readings = right.clone();
        let turn = UnitQuaternion::from_scaled_axis(Vector3::x() * 0.02);
        readings[wrong].rotation = readings[wrong].rotation.map(|rotation| turn * rotation);
        assert_eq!(rejected(&readings), (true, vec![wrong]));
    }
}
