//! Other measurements than those that were identified from check what the identification predicts.

use elastocal::calibration::{identify_as_planned, measure};
use elastocal::identification::{Case, Sigma};
use elastocal::plan::{Plan, read_plan};
use elastocal::scenario::Scenario;
use elastocal::testbed::TrueRobots;

use serde_json::Value;

use crate::support::{
    Workplace, assert_alike, assert_near_in, list, numbers, scenario_text, shipped, table4,
};

/// A robot that was identified from three measurements.
fn identified() -> Workplace {
    let workplace = Workplace::with("s.toml", scenario_text("klimchik2012"));
    let plan = shipped("scenarios/plans/klimchik2012_m3.csv");
    workplace.run(&format!(
        "measure s.toml --quiet --plan {plan} --measurements-out m.csv"
    ));
    workplace.done("identify --quiet --measurements m.csv --identified-out i.json");
    workplace
}

/// A robot that is what was identified keeps the prediction in about as many cases as it should, and one whose
/// compliances are others does not.
#[test]
fn a_prediction_is_kept_or_not() {
    let workplace = identified();
    workplace.done("validate --quiet --identified i.json --experiments 4 --plan-out v.csv");
    let judged = |scenario: &str, seed: u64| {
        workplace.run(&format!(
            "measure {scenario} --quiet --plan v.csv --seed {seed} --measurements-out vm.csv"
        ));
        workplace.run("validate s.toml --quiet --identified i.json --measurements vm.csv --json")
    };
    let probabilities: Vec<f64> = (0..12)
        .map(|seed| {
            let json = judged("s.toml", 100 + seed).ends_with(0).json();
            assert_eq!(json["measurements"].as_array().map(Vec::len), Some(4));
            json["probability"].as_f64().expect("a number")
        })
        .collect();
    // The identification is one and the same: what is wrong with it is wrong each time.
    assert!(
        probabilities.iter().all(|each| (1e-3..1.0).contains(each)),
        "{probabilities:?}"
    );
    let other = scenario_text("klimchik2012")
        + "\n[true_robot]\ncompliance_rad_per_nm = [0.26e-6, 0.33e-6, 0.406e-6, 3.002e-6, 3.303e-6, 2.365e-6]\n";
    workplace.write("other.toml", other);
    let outcome = judged("other.toml", 7).ends_with(3);
    outcome.says("condition C0301: the measurements differ from their prediction");
}

/// What was fitted says nothing of a prediction, in whatever order its rows are and beside whatever others.
#[test]
fn fitted_readings_are_known_again() {
    let workplace = identified();
    workplace.run("validate --quiet --identified i.json --experiments 4 --plan-out v.csv");
    workplace.run("measure s.toml --quiet --plan v.csv --seed 7 --measurements-out other.csv");
    let rows = |file: &str| -> Vec<String> {
        let text = workplace.read(file);
        let rows = text.lines().filter(|line| !line.starts_with('#'));
        rows.map(str::to_owned).collect()
    };
    let (own, other) = (rows("m.csv"), rows("other.csv"));
    let header = &own[..1];
    let reversed: Vec<String> = own[1..].iter().rev().cloned().collect();
    workplace.write("reversed.csv", [header, &reversed].concat().join("\n"));
    workplace.write("more.csv", [&other[..], &own[2..]].concat().join("\n"));
    workplace.write("half.csv", [&other[..3], &own[2..]].concat().join("\n"));
    let validate = |file: &str| {
        let command = format!("validate --quiet --identified i.json --measurements {file}");
        workplace.run(&command)
    };
    for file in ["m.csv", "reversed.csv"] {
        let problem = "holds the same readings as i.json was identified from";
        (validate(file).ends_with(1)).says(&format!("error E0302: {file}: {problem}"));
    }
    let problem = "2 of 4 readings are the same as i.json was identified from";
    (validate("half.csv").ends_with(1)).says(&format!("error E0302: half.csv: {problem}"));
    let few = "more.csv: 2 of 6 readings are the same as i.json was identified from";
    let told = validate("more.csv").stdout;
    assert!(told.contains(few), "{told}");
    let told = validate("other.csv").ends_with(0).stdout;
    assert!(!told.contains("the same"), "{told}");
    // What a prior rests on counts once.
    let key = "[robot]\nprior = \"i.json\"\n";
    let prior = scenario_text("klimchik2012").replace("[robot]\n", key);
    workplace.write("p.toml", prior);
    for command in ["identify", "next"] {
        let of =
            |file: &str| workplace.run(&format!("{command} p.toml --quiet --measurements {file}"));
        let problem = "holds the same readings as robot.prior was identified from";
        (of("reversed.csv").ends_with(1)).says(&format!("error E0302: reversed.csv: {problem}"));
        of("other.csv").ends_with(0);
    }
}

/// A tolerance is kept, broken, or neither can be said: the guard band is the expanded uncertainty of a measurement, 2.7955 sigma for
/// three equal coordinates.
#[test]
fn a_tolerance_with_a_guard_band_is_kept_or_not() {
    let workplace = identified();
    // What was fitted stands for other measurements.
    workplace.forget_readings("i.json");
    let judged = |options: &str, code: i32| {
        let arguments =
            "validate --quiet --identified i.json --measurements m.csv --json --tolerance-um";
        let outcome = workplace
            .run(&format!("{arguments} {options}"))
            .ends_with(code);
        let json = outcome.json();
        let condition = match json["tolerance"]["decision"].as_str() {
            Some("inconclusive") => "C0310",
            Some("reject") => "C0309",
            _ => return json["tolerance"].clone(),
        };
        assert_eq!(json["conditions"][0]["code"], condition);
        json["tolerance"].clone()
    };
    let wide = judged("10000", 0);
    assert_eq!(wide["decision"], "accept");
    let measurements = list(&wide["measurements"]);
    let number = |each: &Value, key: &str| each[key].as_f64().expect("a number");
    let mut largest_um: f64 = 0.0;
    for each in measurements {
        let expanded_um = number(each, "expanded_uncertainty_um");
        assert_alike(expanded_um, 2.795_483_5 * 30.0, 1e-6);
        largest_um = largest_um.max(number(each, "distance_um"));
    }
    let edge_um = |times: f64| largest_um + times * 2.795_483_5 * 30.0;
    assert_eq!(
        judged(&format!("{}", edge_um(1.001)), 0)["decision"],
        "accept"
    );
    assert_eq!(
        judged(&format!("{}", edge_um(0.999)), 3)["decision"],
        "inconclusive"
    );
    let half = format!("{} --guard-band 0.5", edge_um(0.501));
    assert_eq!(judged(&half, 0)["decision"], "accept");
    // Without a guard band a value decides by itself.
    let none = format!("{} --guard-band 0", 0.999 * largest_um);
    assert_eq!(judged(&none, 3)["decision"], "reject");
    let refused = workplace.run("validate --quiet --identified i.json --tolerance-um 5");
    refused.ends_with(2).says("--measurements");
}

/// Validation asks where the identified robot is known least: there the prediction is weaker than at random.
#[test]
fn validation_is_planned_where_the_prediction_is_weakest() {
    let workplace = identified();
    let weakest = |plan: &str| {
        workplace.run(&format!(
            "measure s.toml --quiet --seed 2 --plan {plan} --measurements-out vm.csv"
        ));
        let json = workplace.json("validate s.toml --identified i.json --measurements vm.csv");
        let left: Vec<f64> = (list(&json["measurements"]).iter())
            .map(|each| each["residual_rms_mm"].as_f64().expect("a number"))
            .collect();
        left[0]
    };
    let json = workplace.json("validate --identified i.json --plan-out v.csv");
    let plan = list(&json["plan"]);
    assert_eq!(plan.len(), 3);
    assert_ne!(numbers(&plan[0]["q_deg"]), numbers(&plan[1]["q_deg"]));
    let own = crate::support::project("scenarios/plans/klimchik2012_m3.csv");
    assert!(weakest("v.csv") > 1.5 * weakest(&own.display().to_string()));
}

/// Differences from predictions are as large as they are predicted to be: over many robots, r^T S^-1 r has the mean of
/// a chi-square, whatever is uncertain and whether rotations are measured; on the same day, or in a later campaign.
fn mean_square(scenario: &Scenario, plan: &Plan, runs: u64, is_later: bool) -> f64 {
    let (task, truth) = (&scenario.task, &scenario.truth);
    let mut robots = [0, u64::from(is_later)].map(|campaign| {
        let robots = TrueRobots::new(&task.belief, truth).expect("robots");
        robots.in_series(campaign, 0)
    });
    let mut sum = 0.0;
    for run in 0..runs {
        let [measured, later] = robots.each_mut().map(|robots| {
            let measured = measure(robots, task, truth, plan, scenario.seed, run, true);
            measured.expect("measured").measurements
        });
        // Noise is of its own for each measurement.
        let fitted = measured.len() - 1;
        let (first, others) = (&measured[..fitted], &later[fitted..]);
        let identification = identify_as_planned(&task.belief, first).expect("identified");
        let sigma = Sigma::Known(task.belief.instrument.sigma_m);
        let case = Case::of_belief(&task.belief, others, sigma, task.belief.method);
        let known = identification.posterior;
        let known = if is_later {
            task.belief.uncertain.in_another_campaign(&known)
        } else {
            known
        };
        let predictions = case.predictions(&known).expect("a prediction");
        sum += predictions.square / predictions.freedom as f64;
    }
    sum / runs as f64
}

/// A scenario and a plan of nine displacements that a gauge reads.
fn gauge_of_nine() -> (String, Plan) {
    let plan = crate::support::project("scenarios/plans/kr270_gauge_m9.csv");
    let text = scenario_text("kr270_gauge");
    let commands = crate::support::scenario("kr270_gauge")
        .task
        .belief
        .commands();
    (text, read_plan(&plan, commands).expect("the plan is valid"))
}

#[test]
fn differences_are_as_large_as_predicted() {
    let runs = 400;
    let workplace = Workplace::new();
    let uncertain = "\n[[uncertainty]]\nkind = \"compliance\"\njoints = [\"joint_1\"]\nstd_relative = 0.15\n\
                     [[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.02\n\
                     [[uncertainty]]\nkind = \"tool_position\"\nstd_mm = 1\n\
                     [[uncertainty]]\nkind = \"base_rotation\"\nstd_mrad = 5\n\
                     [[uncertainty]]\nkind = \"load_scale\"\nstd_relative = 0.02\n";
    let plain = scenario_text("klimchik2012");
    let (gauge, of_gauge) = gauge_of_nine();
    for (text, plan, freedom) in [
        (plain.clone() + uncertain, table4(4), 3.0),
        (
            plain.replace("sigma_mm", "rotation_sigma_mrad = 0.02\nsigma_mm"),
            table4(4),
            6.0,
        ),
        (gauge, of_gauge, 1.0),
    ] {
        workplace.write("s.toml", text);
        let scenario = workplace.scenario("s.toml");
        for is_later in [false, true] {
            let mean = mean_square(&scenario, &plan, runs, is_later);
            let standard_error = (2.0_f64 / freedom / runs as f64).sqrt();
            assert_near_in(&(freedom, is_later), mean, 1.0, 4.0 * standard_error);
        }
    }
}

/// The commands with a laboratory's list of uncertainties, and with rotations.
#[test]
fn uncertainties_and_rotations_are_in_the_prediction() {
    let workplace = Workplace::with("u.toml", scenario_text("kr270_laboratory"));
    workplace.write(
        "r.toml",
        scenario_text("klimchik2012").replace("sigma_mm", "rotation_sigma_mrad = 0.02\nsigma_mm"),
    );
    let plan = shipped("scenarios/plans/klimchik2012_m4.csv");
    for (name, has_rotation) in [("u", false), ("r", true)] {
        let run = |arguments: &str| workplace.done(&arguments.replace("NAME", name));
        run(&format!(
            "measure NAME.toml --quiet --plan {plan} --measurements-out m.csv"
        ));
        run("identify --quiet --measurements m.csv --identified-out i.json");
        run("validate --quiet --identified i.json --plan-out v.csv");
        run("measure NAME.toml --quiet --seed 1 --plan v.csv --measurements-out vm.csv");
        let json = run("validate --quiet --identified i.json --measurements vm.csv --json").json();
        for each in list(&json["measurements"]) {
            let number = |key: &str| each[key].as_f64().expect("a number");
            assert!(number("residual_rms_mm") < number("predicted_rms_mm"));
            let turned = &each["rotation_difference_mrad"];
            assert_eq!(!turned.is_null(), has_rotation);
        }
        let probability = json["probability"].as_f64().expect("a number");
        assert!((1e-3..1.0).contains(&probability), "{probability}");
        // A rotation that is wrong alone breaks the prediction.
        if has_rotation {
            let broken: String = (workplace.read("vm.csv").lines())
                .map(|line| match line.split(',').collect::<Vec<_>>() {
                    fields if fields.len() == 21 && !line.starts_with('q') => {
                        let mut fields: Vec<String> =
                            fields.into_iter().map(str::to_owned).collect();
                        fields[15] = "9".to_owned();
                        fields.join(",") + "\n"
                    }
                    _ => format!("{line}\n"),
                })
                .collect();
            workplace.write("vm.csv", broken);
            workplace.doubted("validate --quiet --identified i.json --measurements vm.csv");
        }
    }
}

/// Nothing is predicted where compliances were not determined: such experiments are not planned, and refused by name.
#[test]
fn what_was_not_determined_is_not_validated() {
    let workplace = Workplace::with("s.toml", scenario_text("klimchik2012"));
    let plan = crate::support::project("scenarios/plans/klimchik2012_m2.csv");
    let row = |count: usize| -> String {
        let text = std::fs::read_to_string(&plan).expect("can be read");
        let lines = text.lines().filter(|line| !line.starts_with('#'));
        let lines: Vec<&str> = lines.take(1 + count).collect();
        lines.join("\n") + "\n"
    };
    workplace.write("one.csv", row(1));
    workplace.write("two.csv", row(2));
    workplace.run("measure s.toml --quiet --plan one.csv --measurements-out m.csv");
    workplace.doubted("identify --quiet --measurements m.csv --identified-out i.json");
    workplace.run("measure s.toml --quiet --plan two.csv --measurements-out vm.csv");
    let outcome = workplace.refused("validate --quiet --identified i.json --measurements vm.csv");
    outcome.says(": what is predicted depends on compliances: ");
    let outcome = workplace.refused("validate --quiet --identified i.json");
    outcome.says("nothing is predicted");
}

/// A station that moved readings by less than the model leaves of each was not moved, however small the probability.
#[test]
fn less_than_the_discrepancy_is_no_move() {
    let moved = |readings_m, probability| elastocal::identification::MovedStation {
        position_m: nalgebra::Vector3::new(readings_m, 0.0, 0.0),
        rotation_rad: nalgebra::Vector3::zeros(),
        probability,
        readings_m,
        discrepancy_m: 1e-4,
    };
    assert!(!moved(2e-5, 1e-12).is_moved());
    assert!(!moved(2e-4, 1e-3).is_moved());
    assert!(moved(2e-4, 1e-12).is_moved());
}
