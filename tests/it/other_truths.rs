//! Virtual robots that differ from the planner's model: accounts say by what, and targets on inner links bend as the whole arm does.

use elastocal::robot::{Load, SerialChain};
use elastocal::testbed::{ReadingNumbers, SeenFrom, TrueRobots};
use nalgebra::{DVector, Vector3};
use serde_json::Value;

use crate::small_arms::{KNOWN, arm, place, text};
use crate::support::{assert_alike, experiment, number};

const STUDY: &str = "[study]\nlevel = \"robot\"\ntrials = 600\n[[study.plan]]\nkind = \"optimal\"\nname = \"optimal\"\n";

/// A source among contributions, or in a budget.
fn of_source<'a>(list: &'a Value, source: &str) -> &'a Value {
    let mut list = list.as_array().expect("a list").iter();
    list.find(|each| each["source"] == source)
        .expect("it is there")
}

/// What the task's force leaves is the same whether the planner knows of it or not.
#[test]
fn hidden_task_forces_count_in_absolute_accounts() {
    let source = "kind = \"task_force\"\nstd_n = 8\nstd_relative = 0.05";
    let known = place(true, text(true, "absolute", 16, source));
    known.json("plan arm.toml --plan-out plan.csv");
    known.json("check arm.toml --plan plan.csv");
    let known_um = {
        let json = known.json("evaluate arm.toml --plan plan.csv");
        let sources = &json["uncertainty_budget"]["sources"];
        number(&of_source(sources, "task_force")["contribution_um"])
    };
    let hidden = place(
        true,
        text(true, "absolute", 16, &format!("{source}\nhidden = true")),
    );
    hidden.write("plan.csv", known.read("plan.csv"));
    let json = hidden.record("evaluate arm.toml --plan plan.csv --trials 300");
    let found = of_source(&json["trials"]["contributions"], "task_force");
    assert_eq!(found["hidden"], true);
    let hidden_um = number(&found["contribution_um"]);
    assert!(
        known_um > 1.0 && (hidden_um / known_um - 1.0).abs() < 1e-9,
        "{hidden_um} {known_um}"
    );
}

/// Compliances with a prior that are others in truth explain what is seen, and the verdict names them.
#[test]
fn other_compliances_are_named_where_something_is_known_before() {
    let known = format!("{KNOWN}std_relative = 0.02");
    let other = "[true_robot]\ncompliance_rad_per_nm = [4.5e-6, 5.5e-6, 9e-5, 1.4e-5]\n";
    let place = place(true, text(true, "relative", 6, &known) + other + STUDY);
    let plan = &place.record("study arm.toml")["plans"][0];
    let part = of_source(&plan["contributions"], "true robot");
    assert!(part["hidden"] == true && number(&part["contribution_um"]) > 0.0);
    let verdict = plan["verdict"].as_str().expect("words");
    assert!(verdict.contains("\"true robot\""), "{verdict}");
    let [observed, expected] = [
        number(&plan["rms_mm"]),
        crate::uncertainties::expected_mm(plan),
    ];
    assert_alike(observed, expected, 0.1);
}

/// A virtual robot may lack a passive joint of whose compliance something is known.
#[test]
fn a_passive_joint_may_not_be_there() {
    let known = format!("{KNOWN}std_relative = 0.3");
    let other = "[true_robot]\nmodel = \"stiff.xml\"\n";
    let place = place(false, text(false, "relative", 6, &known) + other + STUDY);
    let soft = "<joint name=\"soft\" axis=\"0 1 0\" stiffness=\"15000\"/>";
    assert!(arm(false).contains(soft));
    place.write("stiff.xml", arm(false).replacen(soft, "", 1));
    let json = place.record("study arm.toml");
    let plan = &json["plans"][0];
    assert_eq!(plan["failed"], 0);
    let [observed, expected] = [
        number(&plan["rms_mm"]),
        crate::uncertainties::expected_mm(plan),
    ];
    assert!(expected < 20.0 * observed, "{observed} {expected}");
}

/// Joints of a true model are those of their names; one that slides is none that turns.
#[test]
fn true_joints_are_found_by_their_names() {
    let source = "kind = \"joint_repeatability\"\nstd_mrad = 0.01";
    let own = text(true, "relative", 6, source);
    let place = place(true, own.clone() + "[true_robot]\nmodel = \"other.xml\"\n");
    place.write("own.toml", own);
    place.json("plan own.toml --no-proof --plan-out plan.csv");
    let deflections = |name: &str| {
        let json = place.json(&format!("measure {name} --plan plan.csv --noise-free"));
        json["measurements"].clone()
    };
    let swapped = arm(true)
        .replace("\"lift\"", "\"LIFT\"")
        .replace("\"bend\"", "\"lift\"");
    place.write("other.xml", swapped.replace("\"LIFT\"", "\"bend\""));
    assert_ne!(deflections("own.toml"), deflections("arm.toml"));
    let slide = "<joint name=\"lift\" type=\"slide\" axis=\"0 1 0\"";
    place.write(
        "other.xml",
        arm(true).replacen("<joint name=\"lift\" axis=\"0 1 0\"", slide, 1),
    );
    let said = place.refused("check arm.toml");
    said.says("true_robot.model");
    said.says("joint \"lift\" slides");
}

/// A target on an inner link rests where the arm rests under the load on the outer one, by the joints' angles there.
#[test]
fn inner_targets_rest_with_the_whole_arm() {
    let source = "kind = \"joint_repeatability\"\nstd_mrad = 0";
    let own = text(
        true,
        "absolute",
        16,
        &source.replace("std_mrad = 0", "std_mrad = 1e-9"),
    );
    let place = place(true, own);
    let inner = "<site name=\"elbow\" pos=\"0.3 0.05 0.02\"/><body name=\"fore\"";
    place.write(
        "arm.xml",
        arm(true).replacen("<body name=\"fore\"", inner, 1),
    );
    let scenario = place.scenario("arm.toml");
    let (belief, truth) = (&scenario.task.belief, &scenario.truth);
    let mut robots = TrueRobots::of_readings(belief, truth, ["elbow"]).expect("robots");
    robots.become_run_of(truth, 1, 0, 0).expect("a run");
    let chain: &SerialChain = &belief.nominal.chain;
    let elbow = SerialChain::tool(&belief.nominal.model, "elbow").expect("a site");
    for q in [[0.2, -0.5, 0.02, 1.3], [-0.4, 0.3, -0.03, -0.9]] {
        let experiment = experiment(
            DVector::from_column_slice(&q),
            Load {
                force_n: Vector3::new(40.0, -60.0, -900.0),
                torque_nm: Vector3::new(5.0, 20.0, -10.0),
            },
        );
        let seen = SeenFrom {
            target: "elbow",
            station_m: None,
            by_tracker: true,
        };
        let numbers = ReadingNumbers {
            reading: 0,
            load: 0,
            visit: 0,
            configuration: 0,
        };
        let (at_m, _) = robots.read(&experiment, seen, numbers).expect("it rests");
        let standing = robots.reading().joint_angles();
        let bent = standing
            .iter()
            .zip(q)
            .map(|(one, other)| (one - other).abs());
        assert!(bent.fold(0.0, f64::max) > 1e-3);
        // The outer joint bends, too.
        assert!((standing[3] - q[3]).abs() > 1e-4, "{standing:?}");
        let expected_m = chain.at(&elbow).state(&standing).tool_position;
        assert!(
            (at_m - expected_m).norm() < 1e-9,
            "{}",
            (at_m - expected_m).norm()
        );
    }
}

/// Poses that are visited again err alike again: regions of others hold as those of poses that are visited once do. Of 180 positions of six
/// robots, whose errors a robot's share: 0.95 less four times 0.22 / sqrt(6 * 5) for five independent ones of each at least.
#[test]
fn regions_hold_where_poses_are_visited_again() {
    let source = "kind = \"discrepancy\"\nstd_mm = 0.3";
    let place = place(true, text(true, "absolute", 16, source));
    place.json("plan arm.toml --plan-out once.csv");
    place.json("plan arm.toml --experiments 30 --seed 9 --plan-out others.csv");
    let once = place.read("once.csv");
    let rows = once.lines().filter(|line| !line.starts_with('#'));
    let mut repeats = None;
    let again = rows.map(|row| {
        let mut cells: Vec<&str> = row.split(',').collect();
        match repeats {
            None => repeats = cells.iter().position(|cell| *cell == "repeats"),
            Some(column) => cells[column] = "5",
        }
        cells.join(",") + "\n"
    });
    let again: String = again.collect();
    place.write("again.csv", again);
    let coverage = |run: u64| {
        let read = |plan: &str, more: &str| {
            place.json(&format!(
                "measure arm.toml --plan {plan} --run {run} --measurements-out {plan}.read {more}"
            ));
        };
        read("again.csv", "");
        read("others.csv", "--series 1");
        place
            .run("identify arm.toml --measurements again.csv.read --identified-out i.json --quiet");
        let json =
            place.record("validate arm.toml --identified i.json --measurements others.csv.read");
        number(&json["coverage95"]["positions"])
    };
    let mean = (0..6).map(coverage).sum::<f64>() / 6.0;
    assert!(mean > 0.79, "{mean}");
}
