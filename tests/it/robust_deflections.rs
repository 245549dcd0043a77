//! Measured deflections that are wrong, and robots that are not as their model: wrong rows are left out and named, errors count the
//! rest.

use elastocal::calibration::measure;
use elastocal::codes::{Condition, ConditionCode};
use elastocal::experiment::Plan;
use elastocal::identification::{Case, RobustIdentification, Robustness};
use elastocal::measurement::Measurement;
use elastocal::numeric::random::generator;
use elastocal::plan::search::random_plan;
use elastocal::scenario::Scenario;
use elastocal::testbed::TrueRobots;
use elastocal::workflow::identify::identify_measurements;
use nalgebra::{DVector, Vector3};
use serde_json::{Value, json};

use crate::one_fit::{between, normal};
use crate::support::{
    Workplace, assert_alike, assert_near_in, number, numbers, scenario_text, shipped,
};

const AS_COMMANDED: Robustness = Robustness {
    keeps_all: false,
    counts_discrepancy: true,
    holds_nominal: true,
};

fn scenario(more: &str) -> Scenario {
    let workplace = Workplace::with("s.toml", scenario_text("klimchik2012") + more);
    workplace.scenario("s.toml")
}

pub fn robust(scenario: &Scenario, measurements: &[Measurement]) -> RobustIdentification {
    let belief = &scenario.task.belief;
    Case::as_believed(belief, measurements)
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
        let right = measure(&mut robots, task, truth, &plan, 61, run, true)
            .expect("measured")
            .measurements;
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
        assert_eq!(found.identification.discrepancy, None);
        assert_eq!(found.identification.residuals_m.len(), 120);
        for (one, other) in
            (clean.identification.parameters.iter()).zip(&found.identification.parameters)
        {
            let [one, other] = [one, other].map(|each| each.estimate.expect("determined"));
            assert_near_in(&run, one.value, other.value, one.standard_error);
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
            let mut measurements = measure(&mut robots, task, truth, &plan, 62, run as u64, true)
                .expect("measured")
                .measurements;
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

/// With what is known before, four measurements are enough: a wrong one is left out however far it is off, and no right one.
#[test]
fn one_of_four_is_found_by_what_the_others_predict() {
    let scenario = crate::support::scenario("kr270");
    let (task, truth) = (&scenario.task, &scenario.truth);
    let mut robots = TrueRobots::new(&task.belief, truth).expect("robots");
    let plan = plan(&scenario, 4, 1);
    for off_m in [2e-3, 10e-3, 0.1, 1.0] {
        let mut found = 0;
        for run in 0..12_usize {
            let right = measure(&mut robots, task, truth, &plan, 66, run as u64, true)
                .expect("measured")
                .measurements;
            assert!(robust(&scenario, &right).rejected.is_empty(), "{run}");
            let mut measurements = right;
            let index = run % measurements.len();
            measurements[index].deflection_m.y += off_m;
            let rejected = robust(&scenario, &measurements).rejected;
            found += usize::from(rejected.len() == 1 && rejected[0].reading == index);
        }
        assert!(found >= 10, "{found} of 12 that are off by {off_m} m");
    }
}

/// Weak measurements, too few of them or too noisy: what is told of a compliance is positive and nearer than its nominal value, all others
/// stay nominal, in what is compensated with, too, and are notes.
#[test]
fn compliances_that_measurements_hardly_determine_stay_nominal() {
    let noisy = scenario_text("klimchik2012").replace("sigma_mm = 0.03", "sigma_mm = 0.6");
    let place = Workplace::with("s.toml", noisy);
    let scenario = place.scenario("s.toml");
    let (task, truth) = (&scenario.task, &scenario.truth);
    let mut robots = TrueRobots::new(&task.belief, truth).expect("robots");
    let nominal = &task.belief.nominal.compliance_rad_per_nm;
    let (mut told, mut negative, mut uncertain, mut weak) = (0, 0, 0, 0);
    for experiments in [2, 4, 8] {
        for run in 0..30 {
            let plan = random_plan(task, experiments, run, 0).expect("a plan");
            let measured = measure(&mut robots, task, truth, &plan, 68, run, true);
            let found = robust(&scenario, &measured.expect("measured").measurements).identification;
            let is_weak = |each: &Condition| each.code == ConditionCode::AllUncertain;
            if found.conditions().iter().any(is_weak) {
                assert!(found.is_all_weak);
                weak += 1;
                continue;
            }
            for each in &found.parameters {
                let own = nominal[each.joint];
                let stays = found
                    .stays_nominal
                    .iter()
                    .find(|other| other.name == each.name);
                match (each.estimate, stays) {
                    (Some(estimate), None) => {
                        assert!(estimate.value > 0.0, "{run} {estimate:?}");
                        // Intervals are wider than errors where these count what is unexplained.
                        assert!(estimate.standard_error <= own, "{run} {estimate:?}");
                        told += 1;
                    }
                    (None, Some(other)) => {
                        let would_be = other.estimate.expect("an estimate");
                        assert_alike(found.compliance_rad_per_nm[each.joint], own, 1e-12);
                        negative += usize::from(would_be.value < 0.0);
                        uncertain += usize::from(would_be.standard_error > own);
                        let note = found
                            .notes()
                            .into_iter()
                            .find(|note| note.contains(&each.name));
                        assert!(
                            note.is_some_and(|note| note.contains("stays nominal")),
                            "{run}"
                        );
                    }
                    other => panic!("{run}: {other:?}"),
                }
            }
            assert_eq!(found.conditions(), Vec::<Condition>::new(), "{run}");
        }
    }
    assert!(
        told > 100 && negative > 5 && uncertain > 10 && weak < 20,
        "{told} {negative} {uncertain} {weak}"
    );
}

/// Few wrong ones of many, and what joints that are springs leave of deflections, are notes; many, and more, are conditions.
#[test]
fn what_is_counted_is_a_note_and_what_needs_somebody_a_condition() {
    let scenario = scenario("");
    let (task, truth) = (&scenario.task, &scenario.truth);
    let mut robots = TrueRobots::new(&task.belief, truth).expect("robots");
    let plan = plan(&scenario, 40, 1);
    let right = measure(&mut robots, task, truth, &plan, 69, 0, true)
        .expect("measured")
        .measurements;
    let told = |wrong: &[usize], unexplained_m: f64| {
        let mut random = generator(69, 1);
        let mut measurements = right.clone();
        for each in &mut measurements {
            each.deflection_m += Vector3::from_fn(|_, _| unexplained_m * normal(&mut random));
        }
        for &index in wrong {
            measurements[index].deflection_m.y += 0.03;
        }
        let case = Case::as_believed(&task.belief, &measurements);
        let found = identify_measurements(case, AS_COMMANDED).expect("identified");
        (found.conditions().collect::<Vec<_>>(), found.notes())
    };
    let one = |texts: &[String], words: &str| texts.len() == 1 && texts[0].contains(words);
    let is_one = |found: &[Condition], code: ConditionCode, words: &str| {
        found.len() == 1 && found[0].code == code && found[0].text.contains(words)
    };
    assert_eq!(told(&[], 0.0), (Vec::new(), Vec::new()));
    let (conditions, notes) = told(&[5, 11], 0.0);
    assert!(
        conditions.is_empty() && one(&notes, "6 (") && one(&notes, "12 ("),
        "{notes:?}"
    );
    let (conditions, notes) = told(&[1, 5, 11, 20, 33], 0.0);
    assert!(
        is_one(&conditions, ConditionCode::Outliers, "5 outliers of 40") && notes.is_empty(),
        "{conditions:?}"
    );
    let (conditions, notes) = told(&[], 1e-4);
    assert!(
        conditions.is_empty() && one(&notes, "within the usual"),
        "{conditions:?}"
    );
    let (conditions, notes) = told(&[], 1e-3);
    assert!(
        is_one(
            &conditions,
            ConditionCode::ResidualsTooLarge,
            "more than the usual"
        ) && notes.is_empty(),
        "{conditions:?}"
    );
}

/// A joint that bends against the load, as no joint does: noise does not explain it, and its compliance stays nominal.
#[test]
fn a_compliance_that_is_negative_beyond_noise_is_a_condition() {
    let mut scenario = scenario("");
    let joint = scenario.task.belief.parameters[1];
    scenario.truth.robot.compliance_rad_per_nm[joint] *= -1.0;
    let (task, truth) = (&scenario.task, &scenario.truth);
    let mut robots = TrueRobots::new(&task.belief, truth).expect("robots");
    let plan = plan(&scenario, 40, 1);
    let measured = measure(&mut robots, task, truth, &plan, 70, 0, true).expect("measured");
    let conditions = robust(&scenario, &measured.measurements)
        .identification
        .conditions();
    let code = ConditionCode::NegativeCompliance;
    let named: Vec<_> = conditions.iter().filter(|each| each.code == code).collect();
    assert_eq!(named.len(), 1, "{conditions:?}");
    let name = &task.belief.parameter_names()[1];
    assert!(named[0].text.contains(name), "{conditions:?}");
}

/// Who repeats whom is found without comparing all with all, and as comparing all would.
#[test]
fn many_measurements_are_grouped_by_few_comparisons() {
    let mut random = generator(67, 0);
    let angle = |random: &mut _| (between(random, -3.0, 3.0) * 4.0).round() / 4.0;
    let grid: Vec<DVector<f64>> = (0..4000)
        .map(|_| DVector::from_fn(3, |_, _| angle(&mut random)))
        .collect();
    let crowded = |place: usize| {
        let middle = (place % 12) as f64 * 0.2;
        DVector::from_fn(6, |_, _| middle + between(&mut random, -0.017, 0.017))
    };
    let crowds: Vec<DVector<f64>> = (0..4000).map(crowded).collect();
    for all in [grid, crowds] {
        assert_few_comparisons(&all);
    }
}

fn assert_few_comparisons(all: &[DVector<f64>]) {
    let compared = std::cell::Cell::new(0_usize);
    let groups = elastocal::experiment::together(
        all.len(),
        |place| (&all[place], None),
        |one, other| {
            compared.set(compared.get() + 1);
            all[one] == all[other]
        },
    );
    assert!(compared.get() < 40 * all.len(), "{}", compared.get());
    let mut naive: Vec<Vec<usize>> = Vec::new();
    for (place, each) in all.iter().enumerate() {
        match naive.iter_mut().find(|group| all[group[0]] == *each) {
            Some(group) => group.push(place),
            None => naive.push(vec![place]),
        }
    }
    assert_eq!(groups, naive);
}

/// A robot whose deflections are off by more than noise, another one in each configuration: intervals hold the true compliances, with repeats,
/// too, which share that.
#[test]
fn intervals_hold_where_the_model_does_not() {
    const RUNS: u64 = 200;
    let hidden = "\n[[uncertainty]]\nkind = \"discrepancy\"\nstd_mm = 0.3\nhidden = true\n";
    let scenario = scenario(hidden);
    let (task, truth) = (&scenario.task, &scenario.truth);
    let belief = &task.belief;
    let mut robots = TrueRobots::new(belief, truth).expect("robots");
    for (experiments, repeats) in [(10, 1), (8, 3)] {
        let plan = plan(&scenario, experiments, repeats);
        let (mut held, mut all) = (0, 0);
        for run in 0..RUNS {
            let measured = measure(&mut robots, task, truth, &plan, 63, run, true)
                .expect("measured")
                .measurements;
            let found = robust(&scenario, &measured);
            assert!(found.rejected.len() <= 1, "{run} {:?}", found.rejected);
            let discrepancy = found
                .identification
                .discrepancy
                .expect("residuals are too large");
            assert!((1e-4..6e-4).contains(&discrepancy[0]), "{discrepancy:?}");
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
    let place = Workplace::with("s.toml", text);
    let scenario = place.scenario("s.toml");
    let (task, truth) = (&scenario.task, &scenario.truth);
    let belief = &task.belief;
    let mut robots = TrueRobots::new(belief, truth).expect("robots");
    for (off_m, off_rad, repeats) in [(0.0, 5e-4, 1), (3e-4, 5e-4, 1), (3e-4, 5e-4, 3)] {
        let plan = plan(&scenario, 10, repeats);
        let (mut held, mut all) = (0, 0);
        for run in 0..RUNS {
            let mut measured = measure(&mut robots, task, truth, &plan, 64, run, true)
                .expect("measured")
                .measurements;
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
            let discrepancy = found.discrepancy.expect("residuals are too large");
            assert!((1e-4..1e-3).contains(&discrepancy[1]), "{discrepancy:?}");
            // Noise of 0.03 mm in 26 degrees of freedom looks 0.03 mm larger in four standard deviations of its variance.
            assert!(discrepancy[0] < 2.0 * off_m + 4e-5, "{discrepancy:?}");
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
    let place = Workplace::with("s.toml", scenario_text("klimchik2012"));
    let plan = shipped("scenarios/plans/klimchik2012_m12.csv");
    let measure = |scenario: &str, more: &str| {
        place.done(&format!("measure {scenario} --quiet --plan {plan} {more}"));
    };
    measure("s.toml", "--measurements-out m.csv");
    let identify = |more: &str| place.run(&format!("identify s.toml --quiet {more}"));
    let clean = identify("--measurements m.csv --json").ends_with(0).json();
    assert_eq!(clean["rejected"], json!([]));
    assert_eq!(clean["discrepancy_mm"], Value::Null);
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
    outcome.prints("5 (left out)");
    let outcome = outcome.says("condition C0207: 1 outlier of");
    assert!(!outcome.stderr.contains("too large"), "{}", outcome.stderr);
    let json = place.parsed("i.json");
    assert_eq!(json["rejected"][0]["reading"], json!(5));
    assert_eq!(json["patterns"]["without"], json!([5]));
    let count =
        numbers(&json["residuals_mm"][4]).len() + json["residuals"].as_array().map_or(0, Vec::len);
    assert_eq!(count, 3 + clean["residuals"].as_array().map_or(0, Vec::len));
    let outcome = identify("--measurements w.csv --keep-all --json").ends_with(3);
    assert_eq!(outcome.json()["rejected"], json!([]));
    outcome.says("too large");

    // A robot that its model does not know: errors are larger, and later measurements are beside a prediction that counts it.
    let hidden = "\n[[uncertainty]]\nkind = \"discrepancy\"\nstd_mm = 0.3\nhidden = true\n";
    place.write("h.toml", scenario_text("klimchik2012") + hidden);
    measure("h.toml", "--measurements-out h.csv");
    let error = |json: &Value| json["compliance_std_rad_per_nm"][0].as_f64();
    let outcome = identify("--measurements h.csv --json --identified-out i.json").ends_with(3);
    let with = outcome.json();
    let discrepancy_mm = number(&with["discrepancy_mm"]);
    assert!((0.1..0.6).contains(&discrepancy_mm), "{discrepancy_mm}");
    outcome.says("model discrepancy of");
    let without = identify("--measurements h.csv --json --noise-only")
        .ends_with(3)
        .json();
    assert_eq!(without["discrepancy_mm"], Value::Null);
    assert!(error(&with) > error(&without).map(|error| 3.0 * error));
    let other = format!("measure h.toml --quiet --seed 9 --plan {plan} --measurements-out o.csv");
    place.done(&other);
    let validate = |file: &str, code: i32| {
        place
            .run(&format!(
                "validate s.toml --quiet --identified {file} --measurements o.csv --json"
            ))
            .ends_with(code)
    };
    let json = validate("i.json", 3).json();
    let probability = number(&json["probability"]);
    assert!((1e-3..0.999).contains(&probability), "{probability}");
    let text = place.read("i.json");
    place.write(
        "w.json",
        text.replace("\"discrepancy_mm\": ", "\"discrepancy_mm\": -"),
    );
    validate("w.json", 1).says("w.json: discrepancy_mm: found -");
}
