//! Positions by a tracker and distances by a ballbar beside it: one scenario, one plan, one file, one fit.

use std::fmt::Write as _;

use elastocal::experiment::{Candidate, read_candidates};
use elastocal::identification::{AbsoluteCase, FitChoices, ReadingWeights};
use elastocal::measurement::{AbsoluteReading, MeasuredFile, read_measured};
use elastocal::parameter::{Parameter, ParameterKind};
use elastocal::plan::absolute::AbsolutePlanning;
use elastocal::scenario::Scenario;
use elastocal::study::virtual_readings::ReadPlan;
use elastocal::testbed::TrueRobots;
use elastocal::workflow::identify::identify_absolute;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde_json::Value;

use crate::absolute_campaigns::fits_alike;
use crate::absolute_trials::holds;
use crate::support::{
    Workplace, assert_alike, assert_alike_in, assert_change_refused, assert_has, assert_near,
    assert_same_rho0, list, number, project, scenario_text, shipped, with_numbers,
};

const CHOICES: FitChoices = FitChoices::weighed(ReadingWeights::AsNeeded);
/// Of the tracker alone.
const RANGE: &str =
    "\n[[uncertainty]]\nkind = \"tracker_range\"\nstd_um_per_m = 8\nalong_um_per_m = 1\n";

/// The ballbar's plan: of its 24 poses the tracker reads seven beside the bar, and eight alone.
fn plan() -> String {
    let plan = std::fs::read_to_string(project("scenarios/plans/ur10_ballbar.csv")).expect("read");
    let mut rows = String::new();
    for (line, row) in plan.lines().enumerate() {
        let (pose, _) = row.rsplit_once(',').expect("a station");
        let by_bar = line == 0 || line % 3 > 0;
        let by_tracker = line > 0 && (line % 3 == 0 || line > 13);
        if by_bar {
            let _ = writeln!(rows, "{row}");
        }
        if by_tracker {
            let _ = writeln!(rows, "{pose},tracker");
        }
    }
    rows
}

fn workplace() -> Workplace {
    let place = Workplace::with("s.toml", scenario_text("ur10_tracker_ballbar"));
    place.write("plan.csv", plan());
    place
}

fn loaded(place: &Workplace) -> (Scenario, Vec<Candidate>) {
    let scenario = place.scenario("s.toml");
    let commands = scenario.task.belief.commands();
    let rows = read_candidates(&place.path("plan.csv"), commands).expect("a plan");
    (scenario, rows)
}

fn is_by_tracker(row: &Candidate) -> bool {
    row.station.as_deref() == Some("tracker")
}

/// The place of the tool is as far off as predicted, in the tracker's frame, and as many as predicted stay below the quantile.
#[test]
fn predictions_hold_on_virtual_robots() {
    let place = workplace();
    let json = place.json("evaluate s.toml --plan plan.csv --trials 1000");
    assert_eq!(json["frame"], "tracker");
    holds(&json["trials"]);
}

/// An arm on a rail.
const ON_A_RAIL: &str = r#"<mujoco><compiler angle="radian"/><worldbody><body name="car" pos="0 0 0.4">
<inertial pos="0 0 0.1" mass="30" diaginertia="1 1 1"/><joint name="rail" type="slide" axis="1 0 0" range="-0.5 0.5"/>
<body name="column" pos="0 0 0.2"><inertial pos="0 0 0.1" mass="12" diaginertia="1 1 1"/><joint name="turn" axis="0 0 1" range="-2.5 2.5"/>
<body name="upper" pos="0 0.02 0.2"><inertial pos="0.3 0 0" mass="9" diaginertia="1 1 1"/><joint name="lift" axis="0 1 0" range="-1.5 1.5"/>
<body name="fore" pos="0.6 0 0"><inertial pos="0.2 0 0" mass="4" diaginertia="1 1 1"/><joint name="bend" axis="0 1 0" range="-2.5 2.5"/>
<site name="tool" pos="0.5 0.03 0"/></body></body></body></body></worldbody>
<actuator><position joint="rail" kp="4e6"/><position joint="turn" kp="3e5"/><position joint="lift" kp="2e5"/>
<position joint="bend" kp="8e4"/></actuator></mujoco>"#;

const RAIL: &str = r#"seed = 3
[robot]
model = "arm.xml"
calibration_site = "tool"
machining_site = "tool"
parameters = ["lift"]
[instrument]
sigma_mm = 0.05
sigma_of = "position"
[instrument.distance]
mpe_um = 6
coverage_factor = 2
[[station]]
name = "tracker"
position_mm = [-2000, 1800, 700]
[[station]]
name = "cup"
reads = "distance"
position_mm = [700, 300, 500]
range_min_mm = 240
range_max_mm = 260
[[test_pose]]
q_deg = [100, 20, -30, 60]
force_n = [60, 20, -140]
[load]
kind = "fixed"
force_n = [0, 0, -120]
[region]
tool_height_min_mm = -2000
[design]
accuracy = "absolute"
experiments = 12
[[uncertainty]]
kind = "joint_zero"
joints = ["turn", "lift", "bend"]
std_mrad = 2
[[uncertainty]]
kind = "compliance"
joints = ["rail", "turn", "lift", "bend"]
std_relative = 0.2
[[uncertainty]]
kind = "joint_repeatability"
joints = ["turn", "lift", "bend"]
std_mrad = 0.01
[[uncertainty]]
kind = "link_position"
joints = ["lift", "bend"]
std_mm = 0.3
[[uncertainty]]
kind = "link_rotation"
joints = ["turn", "lift", "bend"]
std_mrad = 1
"#;

/// The same of an arm on a rail: ten readings by the tracker, twelve by the bar.
#[test]
fn predictions_hold_of_an_arm_on_a_rail() {
    let place = Workplace::with("arm.xml", ON_A_RAIL);
    let at = |table: &str| RAIL.find(table).expect("a table");
    let [bar, tracker] = ["[instrument.distance]", "[[station]]\nname = \"tracker\""].map(at);
    let [cup, poses] = ["[[station]]\nname = \"cup\"", "[[test_pose]]"].map(at);
    let of_bar = [&RAIL[..tracker], &RAIL[cup..]].concat();
    let of_tracker = [&RAIL[..bar], &RAIL[tracker..cup], &RAIL[poses..]].concat();
    let mut both = String::new();
    for (text, readings) in [(of_bar, 12), (of_tracker, 10)] {
        place.write("one.toml", text);
        place.json(&format!(
            "plan one.toml --draw 40 --experiments {readings} --plan-out one.csv"
        ));
        let plan = place.read("one.csv");
        let rows = plan
            .split_inclusive('\n')
            .skip(usize::from(!both.is_empty()));
        both.extend(rows);
    }
    place.write("both.csv", both);
    place.write("s.toml", RAIL);
    let json = place.json("evaluate s.toml --plan both.csv --trials 1000");
    assert_eq!(
        (&json["frame"], &json["experiments"]),
        (&"tracker".into(), &22.into())
    );
    holds(&json["trials"]);
}

/// Plans choose among both, and each distance that is sampled is within its range.
#[test]
fn plans_choose_among_both() {
    let place = workplace();
    let lengths = |planned: &Value| -> Vec<f64> {
        let rows = list(&planned["plan"]).iter();
        rows.filter_map(|row| row["distance_mm"].as_f64()).collect()
    };
    place.write("bar.toml", scenario_text("ur10_ballbar"));
    let sampled = lengths(&place.json("plan bar.toml --draw 12 --experiments 24"));
    assert!(sampled.len() > 2 && sampled.iter().all(|mm| (290.0..=310.0).contains(mm)));
    let planned =
        place.json("plan s.toml --candidates plan.csv --experiments 16 --plan-out drawn.csv");
    let rows = list(&planned["plan"]);
    let by_bar = lengths(&planned).len();
    assert!(by_bar > 2 && by_bar < rows.len(), "{planned}");
    for row in rows {
        assert_eq!(row["distance_mm"].is_null(), row["station"] == "tracker");
    }
    let evaluated = place.json("evaluate s.toml --plan drawn.csv");
    assert_same_rho0(&planned, &evaluated, 1e-6);
}

/// How each reading follows the unknowns (by their units), by differences, with its standard deviations by hand.
fn rows_by_hand(planning: &AbsolutePlanning<'_>, scenario: &Scenario) -> (DMatrix<f64>, Vec<f64>) {
    let (belief, set) = (&scenario.task.belief, planning.set());
    let blank = (0..planning.candidates.len()).map(|place| planning.blank_reading(place));
    let blank: Vec<AbsoluteReading> = blank.collect();
    let case = AbsoluteCase::placed(belief, &blank).expect("readings");
    let values: Vec<f64> = set.prior().mean.iter().copied().collect();
    let shown = |values: &[f64]| -> Vec<f64> {
        let left = case
            .left(&set.apply(&case.arm, values))
            .expect("an equilibrium");
        let of_one = |(left, blank): (_, &AbsoluteReading)| {
            let left: &elastocal::identification::ReadingResidual = left;
            let rows = if blank.length.is_some() { 1 } else { 3 };
            left.position_m
                .iter()
                .take(rows)
                .map(|each| -each)
                .collect::<Vec<f64>>()
        };
        left.iter().zip(&blank).flat_map(of_one).collect()
    };
    let columns = set.parameters().iter().enumerate().map(|(index, each)| {
        let step = 1e-2 * each.scale;
        let [above, below] = [step, -step].map(|step| {
            let mut values = values.clone();
            values[index] += step;
            DVector::from_vec(shown(&values))
        });
        (above - below) / (2.0 * step)
    });
    let columns = DMatrix::from_columns(&columns.collect::<Vec<DVector<f64>>>());
    let sigmas = blank.iter().flat_map(|each| match each.length {
        Some(_) => vec![2e-6_f64.hypot(1e-6 / 12.0_f64.sqrt())],
        None => vec![2e-5; 3],
    });
    (columns, sigmas.collect())
}

/// What both tell adds up: the covariance of the unknowns by hand; and with the tracker's readings alone the prediction is that of a
/// scenario without a bar.
#[test]
fn information_of_both_adds_up() {
    let place = workplace();
    // Without what is new in readings, each counts by its instrument alone.
    let text = place.read("s.toml").replace(RANGE, "");
    let repeatability = text
        .find("[[uncertainty]]\nkind = \"joint_repeatability\"")
        .expect("there");
    let design = text.find("[design]").expect("a table");
    place.write(
        "s.toml",
        format!("{}{}", &text[..repeatability], &text[design..]),
    );
    let (scenario, rows) = loaded(&place);
    let by_tracker: Vec<Candidate> = (rows.iter())
        .filter(|row| is_by_tracker(row))
        .cloned()
        .collect();
    for rows in [&rows, &by_tracker] {
        let planning = AbsolutePlanning::of_plan(&scenario.task, &[], rows).expect("a plan");
        let set = planning.set();
        let (by_unknowns, sigmas) = rows_by_hand(&planning, &scenario);
        let mut information = set.prior().precision.clone();
        for (row, sigma) in by_unknowns.row_iter().zip(&sigmas) {
            information += row.transpose() * row / sigma.powi(2);
        }
        let found = planning.prediction(&planning.whole()).posterior;
        // In typical sizes, so that an inverse has all its digits.
        let sizes = DMatrix::from_diagonal(&set.scales());
        let covariance = (&sizes * information * &sizes).try_inverse();
        let covariance = &sizes * covariance.expect("determined") * &sizes;
        for (place, name) in found.names.iter().enumerate() {
            let by_hand = covariance[(place, place)].sqrt();
            let error = found.standard_error(place).expect("determined");
            // Derivatives are those at the commanded angles: gravity bends the robot by 2 mrad.
            assert_alike_in(&name, error, by_hand, 1e-2);
        }
    }

    let rho0_m = |scenario: &Scenario| {
        let planning = AbsolutePlanning::of_plan(&scenario.task, &[], &by_tracker).expect("a plan");
        planning
            .prediction(&planning.whole())
            .rho0_m()
            .expect("a prediction")
    };
    let text = place.read("s.toml");
    let bar = text.find("[instrument.distance]").expect("a table");
    let tracker = text.find("[[station]]").expect("a table");
    let cups = text.find("[[station]]\nname = \"table\"").expect("a table");
    let poses = text.find("[[test_pose]]").expect("a table");
    place.write(
        "s.toml",
        [&text[..bar], &text[tracker..cups], &text[poses..]].concat(),
    );
    let (alone, _) = loaded(&place);
    assert_eq!(rho0_m(&scenario).to_bits(), rho0_m(&alone).to_bits());
}

/// The errors of the zeros that are identified from a virtual robot's file over their standard errors, and the probability of the
/// residuals. Where no column says it, the bar's reading and the tracker's at one pose are of one visit.
fn identified(scenario: &Scenario, rows: &[Candidate], run: u64) -> (Vec<f64>, f64) {
    let (task, truth) = (&scenario.task, &scenario.truth);
    let planning = AbsolutePlanning::of_plan(task, &[], rows).expect("a plan");
    let whole = planning.whole();
    let plan = ReadPlan::new(&planning, &whole);
    let robots = TrueRobots::of_readings(&task.belief, truth, plan.targets());
    let mut robots = robots.expect("a robot");
    (robots.become_run_of(truth, plan.count(), 5, run)).expect("a run");
    let readings = plan.readings(task, &mut robots, 5, run).expect("at rest");
    let fit = identify_absolute(&task.belief, &readings, &[], CHOICES)
        .expect("a fit")
        .fit;
    let error = |(index, parameter): (usize, &Parameter)| {
        let is_zero = matches!(parameter.kind, ParameterKind::JointZero { .. });
        let off = fit.posterior.mean[index] - robots.value(&task.belief, parameter);
        is_zero.then(|| off / fit.posterior.standard_error(index).expect("determined"))
    };
    let errors = fit.set.parameters().iter().enumerate().filter_map(error);
    (errors.collect(), fit.consistency.expect("residuals"))
}

/// Files of both are weighed as their errors are: identified zeros are as far off as they are said to be, intervals of 95 % hold 95 %, and
/// residuals are as large as predicted.
#[test]
fn one_fit_weighs_both() {
    const RUNS: u64 = 600;
    let place = workplace();
    // Joints return fifty times worse than the bar reads, and hardly anything else is unknown.
    let text = place
        .read("s.toml")
        .replace("std_mrad = 0.02", "std_mrad = 0.2");
    place.write("s.toml", text);
    let (scenario, rows) = loaded(&place);
    let all: Vec<(Vec<f64>, f64)> = (0..RUNS)
        .into_par_iter()
        .map(|run| identified(&scenario, &rows, run))
        .collect();
    let errors: Vec<f64> = all.iter().flat_map(|(errors, _)| errors.clone()).collect();
    let count = errors.len() as f64;
    let square = errors.iter().map(|each| each * each).sum::<f64>() / count;
    let held = errors.iter().filter(|each| each.abs() < 1.959_964).count() as f64 / count;
    let probability = all.iter().map(|each| each.1).sum::<f64>() / RUNS as f64;
    println!("{square} {held} {probability}");
    assert_near(square, 1.0, 3.0 * (2.0 / RUNS as f64).sqrt());
    assert_near(held, 0.95, 3.0 * (0.95 * 0.05 / RUNS as f64).sqrt());
    assert_near(probability, 0.5, 3.0 / (12.0 * RUNS as f64).sqrt());
}

/// A file has the columns of both, and the whole way through the commands is open to it.
#[test]
fn files_of_both_are_read_as_they_are_written() {
    let place = workplace();
    place.json("measure s.toml --plan plan.csv --measurements-out read.csv");
    let columns = "target,station,x_mm,y_mm,z_mm,distance_mm,sx_mm,sy_mm,sz_mm,s_mm\n";
    assert!(place.read("read.csv").contains(columns));
    let (scenario, rows) = loaded(&place);
    let found = read_measured(&place.path("read.csv"), &scenario.task.belief).expect("read");
    let MeasuredFile::Absolute(readings) = found else {
        panic!("they are absolute readings");
    };
    for (reading, row) in readings.iter().zip(&rows) {
        assert_eq!(reading.length.is_none(), is_by_tracker(row));
        assert_eq!(reading.position_m.norm() > 0.0, is_by_tracker(row));
    }
    let json = place.json("identify s.toml --measurements read.csv --identified-out robot.json");
    assert_eq!(json["numbers"], 16 + 3 * 15);
    let stations = list(&json["stations"]);
    for station in stations {
        let is_turned = station["name"] == "tracker";
        assert_eq!(station["quaternion"].is_null(), !is_turned);
    }
    let notes = list(&json["notes"]);
    let said = |words: &str| {
        notes
            .iter()
            .any(|note| note.as_str().is_some_and(|note| note.contains(words)))
    };
    assert!(
        said("positions are weighed by the scenario's error sources"),
        "{notes:?}"
    );
    assert_eq!(json["not_counted"], Value::Array(Vec::new()));
    place.json("compensate s.toml --identified robot.json");
    // Of one robot, each half by the other.
    let (head, rows) = place
        .read("plan.csv")
        .split_once('\n')
        .map(|(head, rows)| (head.to_owned(), rows.to_owned()))
        .expect("rows");
    for half in [0, 1] {
        let rows: Vec<&str> = rows.lines().skip(half).step_by(2).collect();
        place.write("half.csv", format!("{head}\n{}\n", rows.join("\n")));
        place.json(&format!(
            "measure s.toml --plan half.csv --measurements-out half_{half}.csv"
        ));
    }
    place.json("identify s.toml --measurements half_0.csv --identified-out half.json");
    let validate =
        "validate s.toml --identified half.json --measurements half_1.csv --quiet --json";
    let other = place.run(validate).json();
    assert!(number(&other["probability"]) > 1e-3, "{other:#}");
    assert!(number(&other["coverage95"]["readings"]) > 0.7, "{other:#}");
    place.json_with_conditions("budget s.toml --candidates plan.csv");
}

/// Visits are chosen, with all that is read in each; what the best choice predicts of all readings is observed at the others, on robots
/// without discrepancy: 60 of them, which show a deviation of some four unknowns that matter to 5 %.
#[test]
fn visits_are_chosen() {
    let place = workplace();
    let shipped = project("scenarios/plans/ur10_tracker_ballbar.csv");
    let mut both = std::fs::read_to_string(shipped).expect("read");
    for row in place.read("plan.csv").lines().skip(1) {
        let fields: Vec<&str> = row.split(',').collect();
        let (q, rest) = fields.split_at(6);
        let _ = writeln!(both, "{},0,0,0,0,0,0,{}", q.join(","), rest.join(","));
    }
    place.write("both.csv", both);
    place.json("measure s.toml --plan both.csv --measurements-out read.csv");
    let chosen = "select s.toml --measurements read.csv --parameters frames --sizes 20 --draws 2 --campaigns 60";
    let found = place.json(chosen);
    assert_eq!(
        (&found["readings"], &found["chosen"]),
        (&62.into(), &"visits".into())
    );
    let best = &found["sizes"][0]["planned"][0];
    let readings = list(&best["readings"]).len();
    assert!(readings > 20, "{best:#}");
    let kept = number(&best["without_discrepancy_from_true_mm"]) / number(&best["rho0_mm"]);
    assert!((0.85..1.15).contains(&kept), "{kept}: {best:#}");
    place
        .refused("select s.toml --measurements read.csv --sizes 62")
        .says("visits, of which 62 leave none to validate on");
}

/// A zero of the first joint is a turn of all frames, of which no prior says anything: it takes nothing from the accuracy that frames
/// alone leave.
#[test]
fn a_zero_that_frames_take_up_costs_nothing() {
    let place = workplace();
    let (head, tail) = (place.read("s.toml").split_once("[[uncertainty]]"))
        .map(|(head, tail)| (head.to_owned(), tail.to_owned()))
        .expect("uncertainties");
    let (_, design) = tail.split_once("[design]").expect("a design");
    let zeros = "joints = [\"shoulder_lift\", \"elbow\", \"wrist_1\", \"wrist_2\"]";
    place.write(
        "s.toml",
        format!(
            "{head}[[uncertainty]]\nkind = \"joint_zero\"\n{zeros}\nstd_mrad = 1\n[design]{design}"
        ),
    );
    let plan = shipped("scenarios/plans/ur10_tracker_ballbar.csv");
    let [frames, zeros] = ["frames", "zeros"].map(|unknown| {
        let command = format!("evaluate s.toml --plan {plan} --parameters {unknown}");
        number(&place.json(&command)["rho0_mm"])
    });
    assert!((zeros / frames - 1.0).abs() < 1e-6, "{zeros} {frames}");
}

/// The run sheet says what is read from where; the table to fill in has both, and is read as it is.
#[test]
fn both_go_to_the_laboratory() {
    let place = workplace();
    let json = place.json("lab s.toml --plan plan.csv");
    assert_eq!(json["set_ups"], 3);
    assert_eq!(json["readings"], 31);
    let stops = list(&json["stops"]);
    assert_eq!(stops.len(), 24);
    let beside = stops
        .iter()
        .filter(|stop| stop["targets"].as_array().is_some_and(|all| all.len() == 2));
    let beside: Vec<&Value> = beside.collect();
    assert_eq!(beside.len(), 7);
    for stop in beside {
        assert_eq!(stop["station"], "tracker");
        let targets = stop["targets"].to_string();
        assert!(targets.contains("spindle from "), "{targets}");
    }
    let empty = place.read("out/s/lab/measurements.csv");
    assert_has(&empty, "target,visit,station,x_mm,y_mm,z_mm,distance_mm\n");
    fits_alike(&place, "s", "");
}

/// A tracker's readings that were turned are named, whatever distances are beside them.
#[test]
fn input_errors_of_positions_are_named() {
    let place = workplace();
    place.json("measure s.toml --plan plan.csv --measurements-out read.csv");
    let table = place.read("read.csv");
    let mirrored = with_numbers(&table, &["y_mm"], |y_mm| -y_mm);
    place.write("mirrored.csv", mirrored);
    let said = place.run("identify s.toml --measurements mirrored.csv");
    said.says("left-handed");
}

/// Scenarios of both that lack something, or have what does not fit, are refused with the key.
#[test]
fn scenarios_that_do_not_fit_are_refused() {
    let cup = "[instrument.distance]\nsigma_mm = 0.002\nresolution_mm = 0.001\n";
    assert_change_refused(
        "ur10_tracker_ballbar",
        [cup, ""],
        ["station[1].reads", "nothing says how precise distances are"],
    );
    assert_change_refused(
        "ur10_tracker_ballbar",
        ["sigma_mm = 0.002\nres", "res"],
        ["instrument.distance.sigma_mm", "is missing"],
    );
    assert_change_refused(
        "ur10_tracker_ballbar",
        ["sigma_mm = 0.002\nres", "mpe_um = 4\nres"],
        ["instrument.distance.distribution", "is missing"],
    );
    assert_change_refused(
        "ur10_tracker_ballbar",
        ["accuracy = \"absolute\"\n", ""],
        ["design.accuracy", "instrument.distance"],
    );
    assert_change_refused(
        "ur10_tracker_ballbar",
        ["position_mm = [700, -300, 100]\n", ""],
        ["position_mm", "missing"],
    );
    assert_change_refused(
        "ur10_tracker_ballbar",
        ["range_max_mm = 310\n", ""],
        ["range_max_mm", "is missing"],
    );
    let position = "reads = \"distance\"\nrange_min_mm";
    let text = scenario_text("ur10_tracker_ballbar").replace(position, "range_min_mm");
    let place = Workplace::with("s.toml", &text);
    let said = place.refused("check s.toml");
    said.says("instrument.distance: is given, and distances are read from no [[station]]");
    let alone = scenario_text("ur10_ballbar");
    place.write(
        "s.toml",
        alone.replacen("range_min_mm", "reads = \"position\"\nrange_min_mm", 1),
    );
    place
        .refused("check s.toml")
        .says("reads: is \"position\", and instrument.reads is \"distance\"");
    place.write(
        "s.toml",
        alone.replace(
            "resolution_mm = 0.001",
            "resolution_mm = 0.001\ndistance = { sigma_mm = 1 }",
        ),
    );
    place
        .refused("check s.toml")
        .says("instrument.distance: is given");
}

/// Rows that are of the other kind than their station, of both, or of none, are refused by their number.
#[test]
fn rows_that_do_not_fit_are_refused() {
    let place = workplace();
    place.json("measure s.toml --plan plan.csv --measurements-out read.csv");
    let table = place.read("read.csv");
    let refused = |from: &str, to: &str, says: &[&str]| {
        assert!(table.contains(from), "{from}");
        place.write("wrong.csv", table.replacen(from, to, 1));
        let said = place
            .refused("identify s.toml --measurements wrong.csv")
            .stderr;
        assert!(says.iter().all(|words| said.contains(words)), "{said}");
    };
    refused(
        ",tracker,",
        ",shelf,",
        &["is a position from station \"shelf\"", "[[station]] says"],
    );
    refused(
        ",shelf,",
        ",tracker,",
        &["reading 1 is a distance from station \"tracker\""],
    );
    refused(",shelf,", ",door,", &["station: found \"door\""]);
    refused(
        ",shelf,,",
        ",shelf,1,",
        &["x_mm: found 1 beside distance_mm"],
    );
    let row = table
        .lines()
        .find(|line| line.contains("tracker"))
        .expect("a position");
    let (before, after) = row.split_once("tracker,").expect("a station");
    let (_, after) = after.split_once(',').expect("a coordinate");
    refused(
        row,
        &format!("{before}tracker,,{after}"),
        &["x_mm: is empty"],
    );
}

/// A level table may tell what a tracker cannot, how the robot is tilted, and that is unknown then: a plan that does without is predicted as an
/// identification of its readings is, and one is found that is no worse than without the table.
#[test]
fn plans_without_a_level_table_know_as_much_as_if_there_were_none() {
    let place = Workplace::with("arm.xml", ON_A_RAIL);
    let without = RAIL
        .split("[[uncertainty]]\nkind = \"link_rotation\"")
        .next();
    let without = without.expect("the table of rotations");
    // The more the robot bends, the more it matters which way is down.
    let without = without.replace("[60, 20, -140]", "[600, 200, -1400]");
    let without = without.replace("[0, 0, -120]", "[0, 0, -1200]");
    let table = "[instrument.height]\nsigma_mm = 0.02\n[[station]]\nname = \"table\"\nreads = \"height\"\nposition_mm = [0, 0, 0]\nrange_max_mm = 3000\n";
    let level =
        "[[uncertainty]]\nkind = \"station_rotation\"\nstations = [\"table\"]\nstd_mrad = 0.1\n";
    let with = without.replace("[[test_pose]]", &format!("{table}[[test_pose]]")) + level;
    place.write("without.toml", &without);
    place.write("with.toml", with);
    let groups = "--parameters zeros,links,compliances";
    let planned = |name: &str| {
        let json = place.json(&format!(
            "plan {name}.toml {groups} --draw 8 --experiments 24 --plan-out {name}.csv"
        ));
        number(&json["rho0_mm"])
    };
    let [alone, beside] = ["without", "with"].map(planned);
    let evaluate = format!("evaluate with.toml {groups} --plan with.csv");
    let evaluated = number(&place.json(&evaluate)["rho0_mm"]);
    assert_alike(evaluated, beside, 1e-6);
    assert!(beside <= alone * 1.05, "{beside} {alone}");
}

/// A station that has a name, and of which nothing is known, reads what one without a name does.
#[test]
fn plans_do_not_depend_on_a_stations_name() {
    let place = Workplace::with("arm.xml", ON_A_RAIL);
    let (instrument, rest) = RAIL.split_once("[instrument.distance]").expect("a table");
    let (_, rest) = rest.split_once("[[test_pose]]").expect("a table");
    let station = "[[station]]\nname = \"tracker\"\nposition_mm = [-2000, 1800, 700]\n";
    let rho0_mm = [station, ""].map(|station| {
        place.write(
            "s.toml",
            format!("{instrument}{station}[[test_pose]]{rest}"),
        );
        let plan = "plan s.toml --parameters zeros,compliances --draw 8 --experiments 12";
        number(&place.json(plan)["rho0_mm"])
    });
    assert!((rho0_mm[0] / rho0_mm[1] - 1.0).abs() < 1e-9, "{rho0_mm:?}");
}

/// What an earlier campaign of one tracker found is known beside a cup whose place and a table whose inclination are uncertain.
#[test]
fn plans_beside_a_cup_and_a_table_go_on_from_a_prior() {
    let place = Workplace::with("arm.xml", ON_A_RAIL);
    let all = RAIL
        .split("[[uncertainty]]\nkind = \"link_position\"")
        .next();
    let all = all.expect("the tables before links");
    let at = |table: &str| all.find(table).expect("a table");
    let [bar, tracker] = ["[instrument.distance]", "[[station]]\nname = \"tracker\""].map(at);
    let [cup, poses] = ["[[station]]\nname = \"cup\"", "[[test_pose]]"].map(at);
    let first = [&all[..bar], &all[tracker..cup], &all[poses..]].concat();
    let table = "[instrument.height]\nsigma_mm = 0.02\n[[station]]\nname = \"table\"\nreads = \"height\"\nposition_mm = [0, 0, 0]\n\
                 range_max_mm = 3000\n";
    let mounted = "[[uncertainty]]\nkind = \"station_rotation\"\nstations = [\"table\"]\nstd_mrad = 0.1\n[[uncertainty]]\n\
                   kind = \"station_position\"\nstations = [\"cup\"]\nstd_mm = 0.1\n";
    let second = all.replacen("[[test_pose]]", &format!("{table}[[test_pose]]"), 1) + mounted;
    let second = second.replacen("\nparameters", "\nprior = \"i.json\"\nparameters", 1);
    place.write("first.toml", first);
    place.write("second.toml", second);
    for arguments in [
        "plan first.toml --draw 8 --plan-out p.csv",
        "measure first.toml --plan p.csv --run 1 --measurements-out m.csv",
        "identify first.toml --measurements m.csv --identified-out i.json",
    ] {
        place.done(arguments);
    }
    let planned = place.json("plan second.toml --draw 8 --plan-out q.csv");
    let evaluated = place.json("evaluate second.toml --plan q.csv");
    assert_same_rho0(&planned, &evaluated, 1e-6);
}
