//! What to measure next, after some of a plan is measured.

use std::cell::RefCell;

use elastocal::calibration::{compensate_poses, identify_as_planned, measure};
use elastocal::laboratory::next::{Remaining, rest};
use elastocal::measurement::Measurement;
use elastocal::numeric::random::generator;
use elastocal::plan::Plan;
use elastocal::testbed::TrueRobots;
use rand::RngExt;
use serde_json::Value;

use crate::support::{Workplace, assert_alike, list, number, numbers, scenario_text, unwatched};

/// A scenario, a plan of six, and the measurements of its first experiments.
fn after(measured: usize) -> Workplace {
    let workplace = Workplace::with("s.toml", scenario_text("klimchik2012"));
    workplace.done("plan s.toml --quiet --no-proof --experiments 6 --plan-out plan.csv");
    let lines = workplace.read("plan.csv");
    let first: Vec<&str> = lines.lines().take(1 + measured).collect();
    workplace.write("first.csv", first.join("\n") + "\n");
    workplace.done("measure s.toml --quiet --plan first.csv --measurements-out m.csv");
    workplace
}

fn micro(json: &Value, key: &str) -> f64 {
    json[key]
        .as_f64()
        .unwrap_or_else(|| panic!("{key}: {json:#}"))
        * 1e3
}

/// What is measured counts among the configurations that a campaign may have; one more may be visited.
#[test]
fn the_rest_visits_as_few_configurations_as_the_campaign_may() {
    let workplace = after(3);
    let scenario = workplace.read("s.toml");
    for (most, more) in [(5, 2), (4, 1), (3, 1)] {
        let design = format!("[design]\nexperiments = 6\nconfigurations = {most}");
        let few = scenario.replace("[design]\nexperiments = 3", &design);
        workplace.write("few.toml", few);
        workplace.done("next few.toml --quiet --measurements m.csv --plan-out rest.csv");
        let rest = rows(&workplace, "rest.csv");
        let repeats: f64 = rest.iter().map(|row| row[12]).sum();
        let measured = rows(&workplace, "first.csv");
        let is_new = |row: &&Vec<f64>| !measured.iter().any(|known| is_one_place(known, row));
        let new: Vec<&Vec<f64>> = rest.iter().filter(is_new).collect();
        let are_few = new.iter().all(|row| is_one_place(new[0], row)) || new.len() <= more;
        assert!(are_few && (repeats - 3.0).abs() < 1e-9, "{most}: {rest:?}");
    }
}

/// The numbers of a plan's rows.
fn rows(workplace: &Workplace, file: &str) -> Vec<Vec<f64>> {
    let row = |row: &str| {
        row.split(',')
            .map(|each| each.parse().expect("a number"))
            .collect()
    };
    workplace.read(file).lines().skip(1).map(row).collect()
}

/// Whether rows of plans have one configuration, but for whole turns.
fn is_one_place(one: &[f64], other: &[f64]) -> bool {
    let apart = one[..6]
        .iter()
        .zip(&other[..6])
        .map(|(one, other)| (one - other).rem_euclid(360.0));
    apart.fold(0.0, |most, apart| apart.min(360.0 - apart).max(most)) < 1e-6
}

/// Of few configurations the rest is never worse than what is left of the plan, which is known: measured ones are measured again.
#[test]
fn the_rest_is_no_worse_than_that_of_the_plan() {
    let workplace = Workplace::new();
    let design = "[design]\nexperiments = 10\nconfigurations = 3";
    let few = scenario_text("klimchik2012").replace("[design]\nexperiments = 3", design);
    workplace.write("s.toml", few);
    (workplace.run("plan s.toml --quiet --no-proof --plan-out plan.csv")).ends_with(0);
    (workplace.run("measure s.toml --quiet --plan plan.csv --measurements-out all.csv"))
        .ends_with(0);
    let all = workplace.read("all.csv");
    let header = all.lines().take_while(|line| line.starts_with('#')).count() + 1;
    for measured in [1, 2, 4] {
        let some: Vec<&str> = all.lines().take(header + measured).collect();
        workplace.write("m.csv", some.join("\n") + "\n");
        let next = "next s.toml --measurements m.csv --plan plan.csv";
        let found = workplace.json_with_conditions(next);
        let (new, old) = (micro(&found, "rho0_mm"), micro(&found, "old_rest_rho0_mm"));
        assert!(new < old * 1.000_01, "{measured}: {new} {old}");
    }
}

/// The rest goes with what is measured: together they prediction what `next` says, and as much as a plan of all
/// that was made at once, since planning does not depend on the compliances.
#[test]
fn the_rest_goes_with_what_is_measured() {
    let workplace = after(3);
    let json = workplace.json("next --measurements m.csv --plan plan.csv --plan-out rest.csv");
    assert_eq!(json["measured"], 3);
    assert_eq!(json["reached"], true);
    let rest = workplace.read("rest.csv");
    let measured = workplace.read("first.csv");
    let rows: Vec<&str> = rest.lines().skip(1).collect();
    let count: u32 = rows
        .iter()
        .map(|row| {
            row.rsplit(',')
                .next()
                .and_then(|each| each.parse::<u32>().ok())
                .expect("repeats")
        })
        .sum();
    assert_eq!(count, 3);
    workplace.write("all.csv", measured + &rows.join("\n") + "\n");
    let all = workplace.record("evaluate s.toml --no-proof --plan all.csv");
    let (predicted, evaluated) = (micro(&json, "rho0_mm"), micro(&all, "rho0_mm"));
    assert_alike(predicted, evaluated, 1e-9);
    let old = micro(&json, "old_rest_rho0_mm");
    assert!(predicted < old * 1.001, "{predicted} {old}");
    assert!(predicted >= micro(&json, "lower_bound_rho0_mm"));
    // What is measured alone is worse.
    assert!(micro(&json, "measured_rho0_mm") > 1.2 * predicted);
}

/// As few measurements as give an accuracy; none where it is reached.
#[test]
fn an_accuracy_takes_as_few_as_needed() {
    let workplace = after(4);
    let next = |accuracy: f64, code: i32, options: &str| {
        workplace
            .run(&format!(
                "next --quiet --measurements m.csv --json --accuracy-um {accuracy} {options}"
            ))
            .ends_with(code)
            .json()
    };
    let reached = next(100.0, 0, "");
    assert_eq!(
        (&reached["reached"], &reached["plan"]),
        (&Value::from(true), &serde_json::json!([]))
    );
    let now = micro(&reached, "measured_rho0_mm");
    let wanted = 0.93 * now;
    let more = next(wanted, 0, "");
    assert_eq!(more["reached"], true);
    assert!(micro(&more, "rho0_mm") <= wanted);
    let count = |json: &Value| -> f64 {
        let plan = list(&json["plan"]);
        plan.iter().map(|each| number(&each["repeats"])).sum()
    };
    let needed = count(&more);
    assert!(needed >= 1.0);
    let far = next(0.1 * now, 3, "--experiments 6");
    assert_eq!(far["reached"], false);
    assert!((count(&far) - 2.0).abs() < 0.1);
}

/// A configuration that turned out impossible, and those near it, are not planned again.
#[test]
fn what_is_impossible_is_replaced() {
    let workplace = after(3);
    let plan = workplace.read("plan.csv");
    let impossible: Vec<f64> = plan
        .lines()
        .nth(5)
        .map(|row| {
            row.split(',')
                .take(6)
                .map(|each| each.parse().expect("a number"))
                .collect()
        })
        .expect("a row");
    let json =
        workplace.json("next --measurements m.csv --plan plan.csv --skip 5 --skip-within-deg 12");
    let next = list(&json["plan"]);
    assert!(!next.is_empty());
    for experiment in next {
        let q = numbers(&experiment["q_deg"]);
        let apart = (q.iter().zip(&impossible))
            .map(|(one, other)| {
                // A whole turn is no other configuration.
                let way = (one - other).abs() % 360.0;
                way.min(360.0 - way)
            })
            .fold(0.0, f64::max);
        assert!(apart > 12.0, "{apart} deg");
    }
    let outcome = workplace.refused("next --quiet --measurements m.csv --plan plan.csv --skip 7");
    outcome.says("plan.csv: --skip: found 7; 1 to 6 are allowed");
    let outcome = workplace.refused("next --quiet --measurements m.csv --plan plan.csv --skip 2");
    assert!(
        (outcome.stderr).contains("plan.csv: --skip: found 2, which is measured"),
        "{outcome:#?}"
    );
    let outcome = workplace.misused("next --quiet --measurements m.csv --skip 2");
    outcome.says("--plan");
}

/// Measurements tell as much as their own standard deviations say: half of the scenario's is as much as four times as
/// many measurements, ten times as much is next to nothing.
#[test]
fn measurements_count_as_their_own_deviations_say() {
    let workplace = after(3);
    let measured = workplace.read("m.csv");
    let rows = |more: &dyn Fn(&str) -> String| -> String {
        let lines = measured.lines();
        lines
            .map(|line| match line.chars().next() {
                Some('#') => format!("{line}\n"),
                Some('q') => format!("{line}{}\n", more("sx_mm,sy_mm,sz_mm")),
                _ => more(line),
            })
            .collect()
    };
    let with = |sigma: &str| {
        rows(&|line| match line {
            "sx_mm,sy_mm,sz_mm" => format!(",{line}"),
            _ => format!("{line},{sigma},{sigma},{sigma}\n"),
        })
    };
    let four_times = rows(&|line| match line {
        "sx_mm,sy_mm,sz_mm" => String::new(),
        _ => format!("{line}\n").repeat(4),
    });
    let next = |text: String, total: u32| {
        workplace.write("n.csv", text);
        let options = format!("next --quiet --measurements n.csv --experiments {total} --json");
        // Whether residuals are as large as the deviations is not asked here.
        micro(&workplace.run(&options).json(), "rho0_mm")
    };
    let plain = next(measured.clone(), 6);
    let same = next(with("0.03"), 6);
    assert!((same / plain - 1.0).abs() < 1e-9, "{same} {plain}");
    let [half, four] = [next(with("0.015"), 6), next(four_times, 15)];
    assert!((half / four - 1.0).abs() < 1e-4, "{half} {four}");
    assert!(half < 0.9 * plain, "{half} {plain}");
    let useless = next(with("0.3"), 6);
    assert!(useless > 1.3 * plain, "{useless} {plain}");
}

/// What else is uncertain is in the prediction of the rest, and mandatory experiments that are not measured stay mandatory.
#[test]
fn uncertainties_and_mandatory_experiments_go_with_the_rest() {
    let workplace = Workplace::new();
    let rows: Vec<String> = {
        let file = crate::support::project("scenarios/plans/klimchik2012_m4.csv");
        let text = std::fs::read_to_string(file).expect("can be read");
        let lines = text.lines().filter(|line| !line.starts_with('#'));
        lines.map(|line| format!("{line}\n")).collect()
    };
    let plan = |name: &str, wanted: &[usize]| {
        let wanted = wanted.iter().map(|&row| rows[row].clone());
        workplace.write(name, rows[0].clone() + &wanted.collect::<String>());
    };
    plan("mandatory.csv", &[1, 4]);
    plan("first.csv", &[1, 2, 3]);
    workplace.write(
        "s.toml",
        scenario_text("kr270_laboratory").replace(
            "experiments = 12\n\n#",
            "experiments = 6\nmandatory = \"mandatory.csv\"\n\n#",
        ),
    );
    // Without noise the robot is identified as what it is believed to be.
    workplace.done("measure s.toml --quiet --noise-free --plan first.csv --measurements-out m.csv");
    let json = workplace.record("next --measurements m.csv --plan-out rest.csv");
    let rest = workplace.read("rest.csv");
    let angles = |row: &str| -> Vec<f64> {
        let cells = row.split(',').take(6);
        cells.map(|cell| cell.parse().expect("a number")).collect()
    };
    let found: Vec<&str> = rest
        .lines()
        .filter(|line| !line.starts_with(['#', 'q']))
        .collect();
    assert_eq!(found.len(), 3, "{rest}");
    let is = |row: &str, wanted: &str| {
        (angles(row).iter().zip(angles(wanted))).all(|(one, other)| (one - other).abs() < 1e-9)
    };
    assert!(found.iter().any(|row| is(row, &rows[4])), "{rest}");
    assert!(!found.iter().any(|row| is(row, &rows[1])), "{rest}");
    let all = rows[..4].concat() + &found.join("\n") + "\n";
    workplace.write("all.csv", all);
    let evaluated = workplace.record("evaluate s.toml --no-proof --plan all.csv");
    let [predicted, evaluated] = [&json, &evaluated].map(|json| micro(json, "rho0_mm"));
    assert_alike(predicted, evaluated, 1e-4);
}

/// What a campaign leaves at the test pose, rms over runs (m): planned at once, and replanned after half of it,
/// by a planner whose compliances are each off by 30 % (the standard deviation of their logarithms).
fn compared(name: &str, total: u32, runs: u64) -> [f64; 3] {
    let mut scenario = crate::support::scenario(name);
    let mut squares = [0.0; 3];
    let seed = scenario.seed;
    let watch = unwatched();
    let believed = scenario.task.belief.nominal.compliance_rad_per_nm.clone();
    // Planning sees the belief alone, which is the same in all runs.
    let plan_of = |count: u32| {
        let all = Remaining {
            task: scenario.task.clone(),
            measured: 0,
            carried_out: Plan::default(),
            untold: None,
            planned: None,
        };
        let found = rest(&all, count..=count, None, seed, watch);
        found.expect("a plan").plan
    };
    let (all_plan, half_plan) = (plan_of(total), plan_of(total / 2));
    for run in 0..runs {
        let mut normals = [0.0; 16];
        let mut random = generator(seed, 77 + run);
        for each in &mut normals {
            // A sum of twelve is normal enough here.
            *each = (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
        }
        // What is not identified stays as it is believed: no plan mends that.
        let identified = &scenario.task.belief.parameters;
        let truth = believed.iter().enumerate().map(|(joint, each)| {
            let is_off = identified.contains(&joint);
            each * if is_off {
                (0.3 * normals[joint]).exp()
            } else {
                1.0
            }
        });
        let truth: Vec<f64> = truth.collect();
        scenario.truth.robot.compliance_rad_per_nm = truth;
        let (task, truth) = (&scenario.task, &scenario.truth);
        let robots = TrueRobots::new(&task.belief, truth).expect("robots");
        let robots = RefCell::new(robots);
        let left_by = |measurements: &[Measurement]| {
            let identification =
                identify_as_planned(&task.belief, measurements).expect("identified");
            let poses = compensate_poses(
                task,
                &mut robots.borrow_mut(),
                &identification.posterior,
                task.belief.method,
            );
            let poses = poses.expect("compensated");
            (poses[0].seen.residual_m.norm_squared(), identification)
        };
        let measure = |plan: &Plan, part: u64| {
            let robots = &mut robots.borrow_mut();
            measure(robots, task, truth, plan, seed, 2 * run + part, true)
                .expect("measured")
                .measurements
        };
        let at_once = measure(&all_plan, 0);
        let first = measure(&half_plan, 0);
        let (square, identification) = left_by(&first);
        squares[0] += square;
        let left = Remaining::new(task, &identification, &first, &[], 0.0);
        let more = total - left.measured;
        let second = rest(&left, more..=more, None, seed, watch)
            .expect("a rest")
            .plan;
        let both = [first, measure(&second, 1)].concat();
        squares[1] += left_by(&at_once).0;
        squares[2] += left_by(&both).0;
    }
    squares.map(|sum| (sum / runs as f64).sqrt())
}

/// Replanning keeps what planning at once gives: in the linear model the best plan does not depend on the
/// compliances, so that wrong beliefs cost no accuracy. `REPLANNING` asks for so many runs, and prints.
#[test]
fn replanned_from_wrong_beliefs_is_as_good_as_planned_at_once() {
    let asked = std::env::var("REPLANNING").ok();
    let asked = asked.map(|runs| runs.parse().expect("a number of runs"));
    // A small arm is enough to see that all fits together.
    let (name, total, runs) = match asked {
        Some(runs) => ("klimchik2012", 6, runs),
        None => ("planar_3r", 4, 2),
    };
    let [half, at_once, replanned] = compared(name, total, runs);
    println!(
        "{name}, {runs} runs: after half of {total} measurements {:.2} um, all at once {:.2} um, the second half \
         replanned {:.2} um (rms)",
        half * 1e6,
        at_once * 1e6,
        replanned * 1e6
    );
    assert!(at_once < 5e-5 && replanned < 5e-5);
    if runs >= 100 {
        assert!((replanned / at_once - 1.0).abs() < 0.2 && half > 1.2 * replanned);
    }
}

/// What deflections of one configuration share is one error of those that are measured and those that are to be: what the rest would give
/// is what the whole plan predicts, whether half of it is measured or none.
#[test]
fn what_a_configuration_shares_is_counted_once() {
    let place = Workplace::new();
    let source = "\n[[uncertainty]]\nkind = \"discrepancy\"\nstd_mm = 0.1\n";
    place.write("s.toml", scenario_text("klimchik2012") + source);
    place.done("plan s.toml --quiet --no-proof --experiments 2 --plan-out two.csv");
    let two = place.read("two.csv");
    for (name, repeats) in [("half.csv", "3"), ("whole.csv", "6")] {
        let rows = two.lines().map(|line| match line.strip_suffix(",1") {
            Some(row) => format!("{row},{repeats}\n"),
            None => format!("{line}\n"),
        });
        place.write(name, rows.collect::<String>());
    }
    place.done("measure s.toml --quiet --plan half.csv --measurements-out m.csv");
    let whole = place.record("evaluate s.toml --plan whole.csv --no-proof");
    let next = place.record("next s.toml --measurements m.csv --plan whole.csv --experiments 12");
    let [whole_um, rest_um] = [micro(&whole, "rho0_mm"), micro(&next, "old_rest_rho0_mm")];
    // Planned about what was identified.
    assert_alike(rest_um, whole_um, 0.05);
    // Where nothing is left there is no rest.
    let done = place.record("next s.toml --measurements m.csv --plan half.csv --experiments 6");
    assert!(done["measured_rho0_mm"].is_number());
    assert!(done["old_rest_rho0_mm"].is_null(), "{done}");
}
