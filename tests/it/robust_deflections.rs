//! Measured deflections that are wrong, and robots that are not as their model: wrong rows are left out and named, errors count the
//! rest.

use elastocal::calibration::measure;
use elastocal::experiment::Plan;
use elastocal::identification::{Case, RobustIdentification, Robustness, Sigma};
use elastocal::measurement::Measurement;
use elastocal::numeric::random::generator;
use elastocal::plan::search::random_plan;
use elastocal::scenario::Scenario;
use elastocal::testbed::TrueRobots;
use nalgebra::Vector3;
use serde_json::{Value, json};

use crate::one_fit::{between, normal};
use crate::support::{Workplace, numbers, project, scenario_text};

const AS_COMMANDED: Robustness = Robustness {
    keeps_all: false,
    counts_misfit: true,
};

fn scenario(more: &str) -> Scenario {
    let workplace = Workplace::new();
    workplace.write("s.toml", scenario_text("klimchik2012") + more);
    Scenario::load(&workplace.path("s.toml")).expect("a scenario")
}

fn robust(scenario: &Scenario, measurements: &[Measurement]) -> RobustIdentification {
    let belief = &scenario.task.belief;
    let sigma = Sigma::Known(belief.instrument.sigma_m);
    Case::of_belief(belief, measurements, sigma, belief.method)
        .identify_robustly(AS_COMMANDED)
        .expect("identified")
}

/// So many random experiments, each so often.
fn plan(scenario: &Scenario, experiments: u32, repeats: u32) -> Plan {
    let mut plan = random_plan(&scenario.task, experiments, 5, 0).expect("a plan");
    for experiment in &mut plan.experiments {
        experiment.repeats = repeats;
    }
    plan
}

/// One in twenty, wrong by 1 to 50 mm to one side: exactly those are left out, and no compliance moves by a standard error. Right
/// measurements stay, all of them.
#[test]
fn wrong_deflections_are_left_out_and_named() {
    let scenario = scenario("");
    let (task, truth) = (&scenario.task, &scenario.truth);
    let mut robots = TrueRobots::new(&task.belief, truth).expect("robots");
    for run in 0..40 {
        let mut random = generator(61, run);
        let plan = plan(&scenario, 40, 1);
        let right = measure(&mut robots, task, truth, &plan, 61, run).expect("measured");
        let mut measurements = right.clone();
        let wrong = [3, 27];
        let side = Vector3::new(0.6, -0.5, 0.6).normalize();
        for index in wrong {
            let off_m = 1e-3 * 50.0_f64.powf(between(&mut random, 0.0, 1.0));
            measurements[index].deflection_m += side * off_m;
        }
        let (clean, found) = (robust(&scenario, &right), robust(&scenario, &measurements));
        assert!(clean.rejected.is_empty(), "{:?}", clean.rejected);
        let named: Vec<usize> = found.rejected.iter().map(|each| each.reading).collect();
        assert_eq!(named, wrong, "{run}");
        assert_eq!(found.identification.misfit, None);
        assert_eq!(found.identification.residuals_m.len(), 120);
        for (one, other) in
            (clean.identification.parameters.iter()).zip(&found.identification.parameters)
        {
            let [one, other] = [one, other].map(|each| each.estimate.expect("determined"));
            assert!(
                (one.value - other.value).abs() < one.standard_error,
                "{run}"
            );
        }
    }
}

/// Of a few measurements a wrong one that the fit nearly goes through is found by what it is off from the others' prediction; where so few
/// are left that one could be any, none is.
#[test]
fn of_few_measurements_the_wrong_one_is_found_or_none() {
    let scenario = scenario("");
    let (task, truth) = (&scenario.task, &scenario.truth);
    let mut robots = TrueRobots::new(&task.belief, truth).expect("robots");
    for (experiments, at_least) in [(3, 0), (4, 0), (6, 28), (8, 30)] {
        let mut found = 0;
        for run in 0..30_usize {
            let plan = plan(&scenario, experiments, 1);
            let mut measurements =
                measure(&mut robots, task, truth, &plan, 62, run as u64).expect("measured");
            let index = run % measurements.len();
            measurements[index].deflection_m.z += 5e-3;
            let rejected = robust(&scenario, &measurements).rejected;
            match rejected.as_slice() {
                [] => {}
                [one] if one.reading == index => found += 1,
                others => panic!("{experiments} {run}: {index}, and not {others:?}"),
            }
        }
        assert!(found >= at_least, "{found} of 30 with {experiments}");
    }
}

/// A robot whose deflections are off by more than noise, another one in each configuration: intervals hold the true compliances, with repeats,
/// too, which share that.
#[test]
fn intervals_hold_where_the_model_does_not() {
    const RUNS: u64 = 200;
    let hidden = "\n[[uncertainty]]\nkind = \"misfit\"\nstd_mm = 0.3\nhidden = true\n";
    let scenario = scenario(hidden);
    let (task, truth) = (&scenario.task, &scenario.truth);
    let belief = &task.belief;
    let mut robots = TrueRobots::new(belief, truth).expect("robots");
    for (experiments, repeats) in [(10, 1), (8, 3)] {
        let plan = plan(&scenario, experiments, repeats);
        let (mut held, mut all) = (0, 0);
        for run in 0..RUNS {
            let measured = measure(&mut robots, task, truth, &plan, 63, run).expect("measured");
            let found = robust(&scenario, &measured);
            assert!(found.rejected.len() <= 1, "{run} {:?}", found.rejected);
            let misfit = found
                .identification
                .misfit
                .expect("residuals are too large");
            assert!((1e-4..6e-4).contains(&misfit.position_m), "{misfit:?}");
            for each in &found.identification.parameters {
                let [low, high] = each.estimate.expect("determined").interval95;
                let truth = belief.nominal.compliance_rad_per_nm[each.joint];
                held += i32::from((low..=high).contains(&truth));
                all += 1;
            }
        }
        let share = f64::from(held) / f64::from(all);
        println!("{experiments} times {repeats}: {share:.4} of {all}");
        assert!(
            (0.93..=0.97).contains(&share),
            "{experiments} times {repeats}: {share}"
        );
    }
}

/// The same with rotations that are read beside the deflections, and are off by more than noise, too: by how much is told, and intervals hold;
/// where rotations alone are off, only they count less.
#[test]
fn intervals_hold_where_rotations_are_off() {
    const RUNS: u64 = 150;
    let text = scenario_text("klimchik2012");
    let text = text.replace("[instrument]", "[instrument]\nrotation_sigma_mrad = 0.05");
    let place = Workplace::new();
    place.write("s.toml", text);
    let scenario = Scenario::load(&place.path("s.toml")).expect("a scenario");
    let (task, truth) = (&scenario.task, &scenario.truth);
    let belief = &task.belief;
    let mut robots = TrueRobots::new(belief, truth).expect("robots");
    for (off_m, off_rad, repeats) in [(0.0, 5e-4, 1), (3e-4, 5e-4, 1), (3e-4, 5e-4, 3)] {
        let plan = plan(&scenario, 10, repeats);
        let (mut held, mut all) = (0, 0);
        for run in 0..RUNS {
            let mut measured = measure(&mut robots, task, truth, &plan, 64, run).expect("measured");
            let mut random = generator(65, run);
            // Repeats of a configuration share what the model lacks there.
            for same in measured.chunks_mut(repeats as usize) {
                let mut off = |size: f64| Vector3::from_fn(|_, _| size * normal(&mut random));
                let (moved_m, turned_rad) = (off(off_m), off(off_rad));
                for each in same {
                    each.deflection_m += moved_m;
                    each.rotation.as_mut().expect("rotations").vector_rad += turned_rad;
                }
            }
            let found = robust(&scenario, &measured).identification;
            let misfit = found.misfit.expect("residuals are too large");
            assert!((1e-4..1e-3).contains(&misfit.rotation_rad), "{misfit:?}");
            // Noise of 0.03 mm in 26 degrees of freedom looks 0.03 mm larger in four standard deviations of its variance.
            assert!(misfit.position_m < 2.0 * off_m + 4e-5, "{misfit:?}");
            for each in &found.parameters {
                let [low, high] = each.estimate.expect("determined").interval95;
                let truth = belief.nominal.compliance_rad_per_nm[each.joint];
                held += i32::from((low..=high).contains(&truth));
                all += 1;
            }
        }
        let share = f64::from(held) / f64::from(all);
        println!("{off_m} m, {off_rad} rad, {repeats} times: {share:.4} of {all}");
        assert!((0.93..=0.98).contains(&share), "{share}");
    }
}

/// What the command says, and what others make of its file.
#[test]
fn the_command_names_what_it_leaves_out_and_what_it_counts() {
    let place = Workplace::new();
    place.write("s.toml", scenario_text("klimchik2012"));
    let plan = project("scenarios/plans/klimchik2012_m12.csv");
    let measure = |scenario: &str, more: &str| {
        place
            .run(&format!(
                "measure {scenario} --quiet --plan {} {more}",
                plan.display()
            ))
            .ends_with(0);
    };
    measure("s.toml", "--measurements-out m.csv");
    let identify = |more: &str| place.run(&format!("identify s.toml --quiet {more}"));
    let clean = identify("--measurements m.csv --json").ends_with(0).json();
    assert_eq!(clean["rejected"], json!([]));
    assert_eq!(clean["misfit_mm"], Value::Null);
    let text = place.read("m.csv");
    let rows: Vec<String> = text.lines().map(str::to_owned).collect();
    let header = rows
        .iter()
        .position(|row| row.starts_with("q1_deg"))
        .expect("a header");
    let column = rows[header]
        .split(',')
        .position(|name| name == "dz_mm")
        .expect("a column");
    let wrong: Vec<String> = (rows.iter().enumerate())
        .map(|(index, row)| {
            let mut fields: Vec<String> = row.split(',').map(str::to_owned).collect();
            if index == header + 5 {
                fields[column] = "20".to_owned();
            }
            fields.join(",")
        })
        .collect();
    place.write("w.csv", wrong.join("\n") + "\n");
    let outcome = identify("--measurements w.csv --identified-out i.json").ends_with(3);
    assert!(
        outcome.stdout.contains("5 (left out)"),
        "{}",
        outcome.stdout
    );
    let outcome = outcome.says("1 measurement lies beyond 5 standard deviations");
    assert!(!outcome.stderr.contains("too large"), "{}", outcome.stderr);
    let json: Value = serde_json::from_str(&place.read("i.json")).expect("JSON");
    assert_eq!(json["rejected"][0]["reading"], json!(5));
    assert_eq!(json["patterns"]["without"], json!([5]));
    let count =
        numbers(&json["residuals_mm"][4]).len() + json["residuals"].as_array().map_or(0, Vec::len);
    assert_eq!(count, 3 + clean["residuals"].as_array().map_or(0, Vec::len));
    let outcome = identify("--measurements w.csv --keep-all --json").ends_with(3);
    assert_eq!(outcome.json()["rejected"], json!([]));
    outcome.says("too large");

    // A robot that its model does not know: errors are larger, and later measurements are beside a promise that counts it.
    let hidden = "\n[[uncertainty]]\nkind = \"misfit\"\nstd_mm = 0.3\nhidden = true\n";
    place.write("h.toml", scenario_text("klimchik2012") + hidden);
    measure("h.toml", "--measurements-out h.csv");
    let error = |json: &Value| json["compliance_std_rad_per_nm"][0].as_f64();
    let outcome = identify("--measurements h.csv --json --identified-out i.json").ends_with(3);
    let with = outcome.json();
    let misfit_mm = with["misfit_mm"].as_f64().expect("a number");
    assert!((0.1..0.6).contains(&misfit_mm), "{misfit_mm}");
    outcome.says("are unexplained of each coordinate");
    let without = identify("--measurements h.csv --json --noise-only")
        .ends_with(3)
        .json();
    assert_eq!(without["misfit_mm"], Value::Null);
    assert!(error(&with) > error(&without).map(|error| 3.0 * error));
    let other = format!(
        "measure h.toml --quiet --seed 9 --plan {} --measurements-out o.csv",
        plan.display()
    );
    place.run(&other).ends_with(0);
    let validate = |file: &str, code: i32| {
        place
            .run(&format!(
                "validate s.toml --quiet --identified {file} --measurements o.csv --json"
            ))
            .ends_with(code)
    };
    let json = validate("i.json", 3).json();
    let probability = json["probability"].as_f64().expect("a number");
    assert!((1e-3..0.999).contains(&probability), "{probability}");
    let text = place.read("i.json");
    place.write(
        "w.json",
        text.replace("\"misfit_mm\": ", "\"misfit_mm\": -"),
    );
    validate("w.json", 1).says("w.json: misfit_mm: found -");
}
