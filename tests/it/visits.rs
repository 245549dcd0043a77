//! Several targets that one visit reads: they share what is new at the visit, in predictions, bounds and virtual robots.

use elastocal::experiment::Candidate;
use elastocal::identification::{AbsoluteCase, ParameterGroup, ReadingWeights};
use elastocal::measurement::AbsoluteReading;
use elastocal::numeric::random::generator;
use elastocal::plan::absolute::AbsolutePlanning;
use elastocal::plan::search::{PlanSize, random_plan};
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use nalgebra::Vector3;
use rand::RngExt;
use rayon::prelude::*;

use crate::absolute_predictions::place;
use crate::absolute_trials::holds;
use crate::one_fit::normal;
use crate::support::{
    Workplace, absolute_scenario_text, assert_near, assert_near_in, blank_reading, list, number,
    unwatched,
};

const GROUPS: [ParameterGroup; 1] = [ParameterGroup::Zeros];

/// A further reflector beside the spindle.
const TWIN: &str = "\n[[robot.tool]]\nname = \"twin\"\non = \"spindle\"\nposition_mm = [0, 0, 0]\n";

/// What moves all targets of a visit, and what moves all visits of a configuration.
const SHARED: &str = r#"
[[uncertainty]]
kind = "joint_repeatability"
std_mrad = 0.2

[[uncertainty]]
kind = "load_direction"
std_mrad = 20

[[uncertainty]]
kind = "transmission_error"
std_mrad = 0.1

[[uncertainty]]
kind = "discrepancy"
std_mm = 0.05
"#;

fn load(text: &str) -> Scenario {
    let place = Workplace::with("s.toml", text);
    place.scenario("s.toml")
}

/// Readings of some targets in random configurations, without and with the scenario's load.
fn rows(scenario: &Scenario, count: u32, targets: &[&str], loads: &[bool]) -> Vec<Candidate> {
    let plan = random_plan(&scenario.task, count, 8, 0).expect("a plan");
    let mut rows = Vec::new();
    for each in &plan.experiments {
        for &is_loaded in loads {
            for &target in targets {
                rows.push(Candidate {
                    line: rows.len() + 2,
                    configuration_rad: each.configuration_rad.clone(),
                    load: Some(if is_loaded { each.load } else { Load::NONE }),
                    most: None,
                    target: Some(target.to_owned()),
                    station: None,
                    approach: None,
                });
            }
        }
    }
    rows
}

/// The same as a plan's file.
fn table(rows: &[Candidate]) -> String {
    let mut plan = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats,target\n".to_owned();
    for row in rows {
        let angles = row.configuration_rad.iter().map(|q| q.to_degrees());
        let load = row.load.unwrap_or(Load::NONE).wrench();
        for value in angles.chain(load.iter().copied()) {
            plan += &format!("{value},");
        }
        let target = row.target.as_deref().unwrap_or_default();
        plan += &format!("{},{target}\n", row.most.unwrap_or(1));
    }
    plan
}

fn predicted(scenario: &Scenario, rows: &[Candidate]) -> f64 {
    let planning = AbsolutePlanning::new(&scenario.task, &GROUPS, rows).expect("candidates");
    let prediction = planning.prediction(&planning.whole());
    prediction.rho0_m().expect("a prediction")
}

/// What readings of a visit, or of a pose, have in common makes regions no smaller: of 8 robots each, more than 4 have fewer than 92 % of
/// others' positions in regions of 95 % with a probability below 1e-3, where one has with a tenth at most.
#[test]
fn regions_count_poses_and_not_readings() {
    let text = absolute_scenario_text("ur10")
        + "\n[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.1\n\n[laboratory]\nloading = \"in_place\"\n";
    let scenario = load(&text);
    let place = Workplace::with("s.toml", &*text);
    let targets = ["reflector", "spindle"];
    let mut all = rows(&scenario, 140, &targets, &[false, true]);
    let others = all.split_off(4 * 40);
    place.write("others.csv", table(&others));
    let again: Vec<Candidate> = (all.iter().step_by(4))
        .map(|row| Candidate {
            most: Some(5),
            ..row.clone()
        })
        .collect();
    for (name, rows) in [("visits.csv", all), ("again.csv", again)] {
        place.write(name, table(&rows));
        let mut low = 0;
        for seed in 1..=8 {
            let seed = format!("--seed {seed} --quiet");
            place.done(&format!(
                "measure s.toml --plan {name} --measurements-out m.csv {seed}"
            ));
            place.done(&format!(
                "measure s.toml --plan others.csv --measurements-out o.csv --series 1 {seed}"
            ));
            place.run("identify s.toml --measurements m.csv --parameters geometry --identified-out i.json --quiet");
            let judged = place.record("validate s.toml --identified i.json --measurements o.csv");
            let held = number(&judged["coverage95"]["positions"]);
            println!("{name} {held}");
            low += usize::from(held < 0.92);
        }
        assert!(low <= 4, "{name}: {low}");
    }
}

/// Readings that agree with what the scenario lists are weighed by that, as they were planned, and leave no discrepancy; of 8 files one
/// disagrees with a probability below 1e-3. Beyond that they do.
#[test]
fn listed_sources_weigh_what_agrees_with_them() {
    let source = |std_mrad: f64| {
        format!("\n[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = {std_mrad}\n")
    };
    let text = absolute_scenario_text("ur10") + "\n[laboratory]\nloading = \"in_place\"\n";
    let place = Workplace::with("true.toml", text.clone() + &source(0.1));
    place.write("listed.toml", text.clone() + &source(0.1));
    place.write("less.toml", text.clone() + &source(0.02));
    let plan = rows(&load(&text), 16, &["reflector", "spindle"], &[false, true]);
    place.write("p.csv", table(&plan));
    for seed in 1..=8 {
        let measure = "measure true.toml --plan p.csv --measurements-out m.csv --quiet --seed";
        place.done(&format!("{measure} {seed}"));
        for (scenario, agrees) in [("listed", true), ("less", false)] {
            let found = place.run(&format!(
                "identify {scenario}.toml --measurements m.csv --parameters zeros --json --quiet"
            ));
            let discrepancy = &found.json()["discrepancy_mm"];
            assert_eq!(
                discrepancy.is_null(),
                agrees,
                "{scenario} {seed}: {discrepancy}"
            );
        }
    }
}

/// A tolerance is judged with all that is new in a reading: 30 um in each metre is far more than the noise, 20 um of a difference of two
/// readings, of which 95 % stay within 2.7955 (chi-square of three coordinates).
#[test]
fn tolerances_count_the_tracker_s_range() {
    let place = Workplace::new();
    let text = absolute_scenario_text("ur10");
    place.write("noise.toml", &*text);
    let range = "\n[[uncertainty]]\nkind = \"tracker_range\"\nstd_um_per_m = 30\n";
    place.write("range.toml", text.clone() + range);
    place.write(
        "p.csv",
        table(&rows(&load(&text), 16, &["spindle"], &[false])),
    );
    let most_um = ["noise", "range"].map(|scenario| {
        let measure = format!("measure {scenario}.toml --plan p.csv --quiet --measurements-out");
        place.done(&format!("{measure} m.csv"));
        place.done(&format!("{measure} o.csv --series 1"));
        let identify = "--measurements m.csv --parameters frames --identified-out i.json --quiet";
        place.run(&format!("identify {scenario}.toml {identify}"));
        let validate = "--identified i.json --measurements o.csv --tolerance-um 500 --json --quiet";
        let judged = place
            .run(&format!("validate {scenario}.toml {validate}"))
            .json();
        let each = judged["tolerance"]["measurements"].as_array();
        let each = each.expect("a list").iter();
        let each = each.map(|each| number(&each["expanded_uncertainty_um"]));
        each.fold(0.0, f64::max)
    });
    let [noise_um, range_um] = most_um;
    assert_near_in(&most_um, noise_um, 2.7955 * 20.0 / 2.0_f64.sqrt(), 0.01);
    assert!(range_um > 2.0 * noise_um, "{most_um:?}");
}

/// Four readings of one visit tell once how the robot drifts: where it does not, of 20 files more than 5 have a p below 0.05 with a
/// probability below 1e-3.
#[test]
fn drift_is_told_by_visits_and_not_by_readings() {
    let text = absolute_scenario_text("ur10")
        + "\n[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.1\n\n[laboratory]\nloading = \"in_place\"\n";
    let place = Workplace::with("s.toml", &*text);
    let mut plan = rows(&load(&text), 12, &["reflector", "spindle"], &[false, true]);
    for row in &mut plan {
        row.most = Some(5);
    }
    place.write("p.csv", table(&plan));
    let mut low = 0;
    for seed in 1..=20 {
        let measure = "measure s.toml --plan p.csv --measurements-out m.csv --quiet --seed";
        place.done(&format!("{measure} {seed}"));
        let identify = "identify s.toml --measurements m.csv --parameters frames --json --quiet";
        let repeats = &place.run(identify).json()["repeats"];
        assert_eq!(repeats["degrees_of_freedom"], 48, "{repeats}");
        low += usize::from(number(&repeats["drift"]["probability"]) < 0.05);
    }
    assert!(low <= 5, "{low}");
}

/// Where no error source is listed and noise explains what was identified, others' probability is that of noise; of another robot it
/// breaks the prediction.
#[test]
fn noise_alone_has_a_probability() {
    let text = absolute_scenario_text("ur10");
    let hidden = "\n[[uncertainty]]\nkind = \"joint_zero\"\nstd_mrad = 0.5\nhidden = true\n";
    let place = Workplace::with("s.toml", &*text);
    place.write("other.toml", text.clone() + hidden);
    let plan = table(&rows(&load(&text), 30, &["spindle"], &[false]));
    place.write("p.csv", plan);
    for (scenario, series) in [("s", 0), ("s", 1), ("other", 2)] {
        let to = format!("--series {series} --measurements-out m{series}.csv --quiet");
        place.done(&format!("measure {scenario}.toml --plan p.csv {to}"));
    }
    let identify = "--measurements m0.csv --parameters frames --identified-out i.json --quiet";
    place.run(&format!("identify s.toml {identify}"));
    let probability = |series: u32| {
        let validate = "validate s.toml --identified i.json --json --quiet --measurements";
        let json = place.run(&format!("{validate} m{series}.csv")).json();
        let conditions = list(&json["conditions"]);
        let is_broken = conditions.iter().any(|each| each["code"] == "C0301");
        (number(&json["probability"]), is_broken)
    };
    let (same, is_broken) = probability(1);
    assert!(same > 1e-3 && !is_broken, "{same}");
    let (other, is_broken) = probability(2);
    assert!(other < 1e-10 && is_broken, "{other}");
}

/// Three targets of one visit tell once where the station is: where nobody moves it, of 30 files more than 6 have a p below 0.05 with a
/// probability below 1e-3.
#[test]
fn stations_are_moved_by_visits_and_not_by_readings() {
    let text = absolute_scenario_text("ur10")
        + TWIN
        + "\n[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.2\n";
    let place = Workplace::with("s.toml", &*text);
    let targets = ["reflector", "spindle", "twin"];
    place.write("p.csv", table(&rows(&load(&text), 16, &targets, &[false])));
    let mut low = 0;
    for seed in 1..=30 {
        for series in 0..2 {
            let measure = "measure s.toml --plan p.csv --quiet --seed";
            let to = format!("--series {series} --measurements-out m{series}.csv");
            place.done(&format!("{measure} {seed} {to}"));
        }
        let identify = "--measurements m0.csv --parameters frames --identified-out i.json --quiet";
        place.run(&format!("identify s.toml {identify}"));
        let validate = "validate s.toml --identified i.json --measurements m1.csv --json --quiet";
        let stations = &place.run(validate).json()["stations_moved"];
        low += usize::from(number(&stations[0]["probability"]) < 0.05);
    }
    assert!(low <= 6, "{low}");
}

/// Where the robot comes back badly and the instrument reads well, a second target at the same place adds nothing; a second visit does.
#[test]
fn a_second_target_at_one_place_adds_nothing() {
    let text = absolute_scenario_text("ur10").replace("sigma_mm = 0.02", "sigma_mm = 0.0005")
        + TWIN
        + "\n[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.1\n";
    let scenario = load(&text);
    let one = rows(&scenario, 12, &["spindle"], &[false]);
    let alone = predicted(&scenario, &one);
    let both = predicted(
        &scenario,
        &rows(&scenario, 12, &["spindle", "twin"], &[false]),
    );
    assert!((both / alone - 1.0).abs() < 2e-3, "{both} {alone}");
    let twice: Vec<Candidate> = (one.into_iter())
        .map(|row| Candidate {
            most: Some(2),
            ..row
        })
        .collect();
    let twice = predicted(&scenario, &twice);
    assert_near(twice / alone, 0.5_f64.sqrt(), 2e-3);
}

/// Robots that come to each configuration once and are read at three targets, and some of these more often: sampled at each level in
/// MuJoCo, identified, and as accurate as predicted.
#[test]
fn robots_read_at_several_targets_keep_what_is_predicted() {
    let place = Workplace::new();
    let known = "\n[[uncertainty]]\nkind = \"joint_zero\"\nstd_mrad = 2\n\n[[uncertainty]]\nkind = \"compliance\"\nstd_relative = 0.2\n";
    let text = absolute_scenario_text("ur10") + TWIN + SHARED + known;
    place.write("s.toml", &text);
    let scenario = load(&text);
    let targets = ["spindle", "reflector", "twin"];
    let mut rows = rows(&scenario, 8, &targets, &[false, true]);
    for (row, place) in rows.iter_mut().zip(0_u32..) {
        row.most = Some(1 + place % 5 % 2);
    }
    rows.retain(|row| row.load == Some(Load::NONE) || row.target.as_deref() != Some("twin"));
    place.write("p.csv", table(&rows));
    let judged =
        place.json("evaluate s.toml --parameters zeros,compliances --plan p.csv --trials 300");
    holds(&judged["trials"]);
    let sources = list(&judged["uncertainty_budget"]["sources"]).clone();
    let shares: f64 = sources
        .iter()
        .map(|each| number(&each["variance_share_percent"]))
        .sum();
    assert!((shares - 100.0).abs() < 1e-6, "{shares}");
    let source = |name: &str| {
        sources
            .iter()
            .find(|each| each["source"] == name)
            .expect(name)
    };
    assert_eq!(source("joint_repeatability")["level"], "visit");
}

/// What is read in one visit is chosen together, and counts for what it determines: on robots without discrepancy, whose visits' errors
/// are shared as residuals show, choices are as good as predicted. Twelve choices of 60 robots each, 5 % of a deviation of 30 unknowns.
#[test]
fn visits_are_chosen_together() {
    let place = Workplace::new();
    let text = absolute_scenario_text("ur10")
        + TWIN
        + "\n[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.2\n";
    place.write("s.toml", &text);
    let scenario = load(&text);
    let targets = ["spindle", "reflector", "twin"];
    place.write("p.csv", table(&rows(&scenario, 60, &targets, &[false])));
    place.json("measure s.toml --plan p.csv --measurements-out m.csv");
    let found = place.json(
        "select s.toml --measurements m.csv --parameters zeros --sizes 10,20 --draws 12 --campaigns 60",
    );
    assert_eq!(
        (&found["readings"], &found["chosen"]),
        (&180.into(), &"visits".into())
    );
    for of_size in list(&found["sizes"]) {
        let size = of_size["size"].as_u64().expect("a size");
        for choice in list(&of_size["planned"]) {
            let readings = list(&choice["readings"]);
            assert_eq!(readings.len() as u64, 3 * size);
            let kept = number(&choice["without_discrepancy_from_true_mm"]);
            let kept = kept / number(&choice["rho0_mm"]);
            assert!((0.8..1.2).contains(&kept), "{kept}: {choice:#}");
        }
    }
}

/// Two targets, two loads and repeats share errors in every way: no plan is below the bound, and the search finds one near it.
#[test]
fn no_plan_of_several_targets_is_below_the_bound() {
    for (more, nearest) in [(SHARED, 0.5), ("", 0.8)] {
        let scenario = load(&(absolute_scenario_text("ur10") + more));
        let rows = rows(&scenario, 8, &["spindle", "reflector"], &[false, true]);
        let planning = AbsolutePlanning::new(&scenario.task, &GROUPS, &rows).expect("candidates");
        let watch = unwatched();
        let found = planning
            .design_from(&[], PlanSize::all_different(10), 1, watch)
            .expect("a plan");
        let rho0 = |plan: &[(usize, u32)]| planning.prediction(plan).rho0_m();
        let best = rho0(&found.plan).expect("a prediction");
        let bound = found.bound.expect("a bound").best;
        assert!(bound < best && bound > nearest * best, "{bound} {best}");
        let mut random = generator(5, 0);
        let mut near = 0;
        for _ in 0..2000 {
            // Few configurations, so that readings share them.
            let first = random.random_range(0..rows.len() / 4 - 3) * 4;
            let mut plan: Vec<(usize, u32)> = Vec::new();
            for _ in 0..10 {
                let place = first + random.random_range(0..16);
                match plan.iter_mut().find(|(each, _)| *each == place) {
                    Some((_, times)) => *times += 1,
                    None => plan.push((place, 1)),
                }
            }
            let Some(value) = rho0(&plan) else { continue };
            assert!(value >= bound, "{plan:?}: {value} {bound}");
            if near % 20 == 0 {
                let own = planning.bound(&plan).expect("a bound").expect("one").best;
                assert!(value >= own, "{plan:?}: {value} {own}");
            }
            near += 1;
        }
        assert!(near > 500, "{near}");
    }
}

fn reading(row: &Candidate, visit: Option<&str>) -> AbsoluteReading {
    AbsoluteReading {
        configuration_rad: row.configuration_rad.clone(),
        load: row.load.unwrap_or(Load::NONE),
        target: row.target.clone(),
        station: row.station.clone(),
        visit: visit.map(str::to_owned),
        position_m: Vector3::zeros(),
        ..blank_reading()
    }
}

/// The k-th reading of each target in one configuration, under one load and from one station is of visit k; a word says it otherwise.
#[test]
fn files_say_which_readings_are_of_one_visit() {
    let scenario = load(&(absolute_scenario_text("ur10") + TWIN));
    let rows = rows(&scenario, 1, &["spindle", "reflector"], &[false, true]);
    let [spindle, reflector, hung, _] = [0, 1, 2, 3].map(|place| &rows[place]);
    let moved = Candidate {
        configuration_rad: spindle.configuration_rad.add_scalar(1e-3),
        ..spindle.clone()
    };
    let away = Candidate {
        station: Some("wall".to_owned()),
        ..reflector.clone()
    };
    let visits = |readings: &[AbsoluteReading]| {
        let case = AbsoluteCase::placed(&scenario.task.belief, readings);
        case.expect("readings").visits
    };
    let plain = [spindle, reflector, spindle, hung, &moved, reflector, &away];
    let plain: Vec<AbsoluteReading> = plain.map(|row| reading(row, None)).to_vec();
    let expected = vec![vec![0, 1], vec![2, 5], vec![3], vec![4], vec![6]];
    assert_eq!(visits(&plain), expected);
    let named = [
        (spindle, "a"),
        (reflector, "b"),
        (hung, "a"),
        (reflector, "a"),
    ];
    let named = named.map(|(row, name)| reading(row, Some(name)));
    assert_eq!(visits(&named), vec![vec![0, 2, 3], vec![1]]);
}

/// Readings of three targets in each of 40 configurations, whose joints are off by another error at each visit, and the robot's zeros.
fn read_with_errors(scenario: &Scenario, seed: u64) -> Vec<f64> {
    let belief = &scenario.task.belief;
    let targets = ["spindle", "reflector", "twin"];
    let rows = rows(scenario, 40, &targets, &[false]);
    let mut random = generator(21, seed);
    let mut readings: Vec<AbsoluteReading> = rows.iter().map(|row| reading(row, None)).collect();
    let case = AbsoluteCase::placed(belief, &readings).expect("readings");
    let set = case.unknowns_beside(&GROUPS, &[]).expect("unknowns");
    let values: Vec<f64> = (set.parameters().iter())
        .map(|each| {
            if each.kind.is_mounted() {
                0.0
            } else {
                1e-3 * normal(&mut random)
            }
        })
        .collect();
    let truth = set.apply(&case.arm, &values);
    let sigma_m = belief.instrument.sigma_m / 2.0_f64.sqrt();
    let mut off_rad = Vec::new();
    for (index, (reading, observation)) in readings.iter_mut().zip(&case.observations).enumerate() {
        if index % targets.len() == 0 {
            off_rad = (0..6).map(|_| 2e-4 * normal(&mut random)).collect();
        }
        let mut setup = observation.setup.clone();
        for (angle, off) in setup.commanded_rad.iter_mut().zip(&off_rad) {
            *angle += off;
        }
        reading.position_m =
            place(&truth, &setup) + Vector3::from_fn(|_, _| sigma_m * normal(&mut random));
    }
    let mut read = AbsoluteCase::new(belief, &readings).expect("readings");
    let fit = read.fit(&GROUPS, ReadingWeights::AsNeeded).expect("a fit");
    (set.parameters().iter().zip(&values))
        .filter(|(each, _)| !each.kind.is_mounted())
        .map(|(each, value)| {
            let index = fit.set.index_of(each.kind).expect("fitted");
            let error = fit.standard_error(index).expect("determined");
            (fit.quantity(index) - value) / error
        })
        .collect()
}

/// Standard errors of identified zeros count that one visit moves three targets together.
#[test]
fn identified_zeros_know_of_visits() {
    const RUNS: u64 = 24;
    let scenario = load(&(absolute_scenario_text("ur10") + TWIN));
    let each: Vec<Vec<f64>> = (0..RUNS)
        .into_par_iter()
        .map(|run| read_with_errors(&scenario, run))
        .collect();
    let all: Vec<f64> = each.into_iter().flatten().collect();
    let mean_square = all.iter().map(|each| each * each).sum::<f64>() / all.len() as f64;
    // Of normal errors the mean of n squares has the standard deviation (2/n)^1/2; zeros of one run are correlated, so that runs
    // count, three zeros each. Standard errors are no smaller than errors are, and allow for harmonics that are not there.
    let allowed = 4.0 * (2.0 / RUNS as f64 / 3.0).sqrt();
    assert!(
        mean_square < 1.0 + allowed && mean_square > 0.3,
        "{mean_square}"
    );
}
