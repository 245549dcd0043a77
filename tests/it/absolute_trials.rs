//! Virtual robots in MuJoCo that are read as plans of absolute readings say: they keep what is predicted, and break it where the
//! planner does not know of what they are like; and plans at configurations that nobody listed.

use serde_json::Value;

use crate::support::{Workplace, absolute_scenario_text, number, scenario_text, shipped};

fn absolute(more: &str) -> String {
    absolute_scenario_text("ur10").replace("experiments = 4", "experiments = 14") + more
}

/// What a laboratory may know before, and what disturbs its readings.
const KNOWN: &str = r#"
[[uncertainty]]
kind = "joint_zero"
std_mrad = 1

[[uncertainty]]
kind = "link_position"
std_mm = 0.2

[[uncertainty]]
kind = "compliance"
std_relative = 0.2

[[uncertainty]]
kind = "joint_repeatability"
std_mrad = 0.05

[[uncertainty]]
kind = "transmission_error"
std_mrad = 0.03

[[uncertainty]]
kind = "tracker_range"
std_um_per_m = 6

[[uncertainty]]
kind = "task_force"
std_n = 5

[[station]]
name = "near"
position_mm = [-1800, 500, 900]

[[station]]
name = "far"
position_mm = [-6000, -3000, 1500]
"#;

/// Within three standard errors and 2 %, by the numbers themselves; and as many as predicted stay below the quantile.
pub fn holds(trials: &Value) {
    let [predicted, seen, error] =
        ["predicted_rms_mm", "rms_mm", "rms_std_mm"].map(|key| number(&trials[key]));
    assert!(error < 0.06 * seen, "{trials}");
    assert!(
        (seen - predicted).abs() <= 3.0 * error + 0.02 * predicted,
        "{trials}"
    );
    let robots = number(&trials["robots"]);
    let below = number(&trials["below_quantile95"]);
    assert!(
        (below - 0.95).abs() <= 3.0 * (0.95_f64 * 0.05 / robots).sqrt() + 0.01,
        "{trials}"
    );
    assert_eq!(trials["prediction"], "holds");
    assert_eq!(trials["failed"], 0);
}

/// The shipped plans of distances, of heights, and of positions beside distances.
#[test]
fn shipped_plans_keep_what_they_predict() {
    for (name, trials) in [
        ("ur10_ballbar", 1000),
        ("ur10_height_gauge", 600),
        ("ur10_tracker_ballbar", 1000),
    ] {
        let place = Workplace::with("s.toml", scenario_text(name));
        let plan = shipped(&format!("scenarios/plans/{name}.csv"));
        let json = place.json(&format!("evaluate s.toml --plan {plan} --trials {trials}"));
        holds(&json["trials"]);
    }
}

/// Plans at sampled configurations: robots of which nothing is known err as predicted, and, by a plan for them, those that are known to a
/// degree, with all that disturbs them.
#[test]
fn drawn_robots_keep_what_is_predicted() {
    let place = Workplace::with("s.toml", absolute(""));
    place.write("k.toml", absolute(KNOWN));
    let plan = "plan s.toml --parameters zeros --draw 40 --plan-out p.csv";
    let planned = place.json(plan);
    assert_eq!(planned["bound_kind"], "evidence");
    assert_eq!(planned["drawn"]["configurations"], 40);
    let efficiency = number(&planned["efficiency"]);
    assert!(efficiency > 0.3 && efficiency <= 1.0, "{efficiency}");
    let evaluate = "evaluate s.toml --parameters zeros --plan p.csv --trials 300";
    let [one, two] = [1, 2].map(|threads| place.json(&format!("{evaluate} --threads {threads}")));
    assert!((number(&one["rho0_mm"]) / number(&planned["rho0_mm"]) - 1.0).abs() < 1e-6);
    holds(&one["trials"]);
    assert_eq!(one["trials"], two["trials"]);
    let groups = "--parameters frames,zeros,links,compliances";
    place.json_with_conditions(&format!("plan k.toml {groups} --draw 40 --plan-out k.csv"));
    let known = format!("evaluate k.toml {groups} --plan k.csv --trials 200");
    let known = place.json_with_conditions(&known);
    assert!(number(&known["rho0_mm"]) > 2.0 * number(&one["rho0_mm"]));
    holds(&known["trials"]);
}

/// A tracker whose angles err far more than its distances, from stations that look along different axes: each reading is off by half
/// the variance of a deflection, across its own beam, and weighed by that in the frame in which it is told.
#[test]
fn readings_are_off_across_their_beams() {
    let place = Workplace::new();
    let beams = r#"
[[uncertainty]]
kind = "tracker_range"
std_um_per_m = 100
along_um_per_m = 2

[[station]]
name = "side"
position_mm = [0, 4000, 900]

[[station]]
name = "front"
position_mm = [3000, 0, 400]
"#;
    place.write("s.toml", absolute(beams));
    let plan = "plan s.toml --parameters zeros --draw 30 --plan-out p.csv --quiet";
    place.done(plan);
    let judged = place.json("evaluate s.toml --parameters zeros --plan p.csv --trials 300");
    holds(&judged["trials"]);
}

/// What the planner does not know of breaks the prediction, which is a condition.
#[test]
fn what_is_hidden_breaks_the_prediction() {
    let place = Workplace::new();
    let hidden =
        "\n[[uncertainty]]\nkind = \"transmission_error\"\nstd_mrad = 0.3\nhidden = true\n";
    place.write("s.toml", absolute(hidden));
    let plan = "plan s.toml --parameters zeros --draw 30 --plan-out p.csv --quiet";
    place.done(plan);
    let evaluate = "evaluate s.toml --parameters zeros --plan p.csv --trials 60";
    let broken = place.doubted(&format!("{evaluate} --quiet"));
    let broken = broken.says("condition C0402: residual error of simulated robots");
    broken.prints("The prediction is exceeded");
    let text = place.done(&plan.replace("--quiet", ""));
    for words in [
        "which were sampled: evidence, no proof",
        "The candidates are 30 configurations at random (seed 1)",
    ] {
        text.prints(words);
    }
}

/// Plans of deflections are tried on virtual robots, too: the same as a study's at the robot's level, with the same error sources.
#[test]
fn deflections_keep_what_is_predicted() {
    let place = Workplace::new();
    let file = "[[study.plan]]\nkind = \"file\"\nname = \"mine\"\nfile = \"p.csv\"\n";
    let known = "\n[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.05\n\
        [[uncertainty]]\nkind = \"tracker_range\"\nstd_um_per_m = 6\n";
    let text = scenario_text("ur10") + known;
    place.write("r.toml", &text);
    place.write("noise.toml", scenario_text("ur10"));
    place.done("plan noise.toml --no-proof --plan-out p.csv --quiet");
    let evaluate = "evaluate r.toml --plan p.csv --no-proof --trials 300";
    let trials = place.json(evaluate)["trials"].clone();
    assert_eq!(trials["prediction"], "holds", "{trials}");
    assert_eq!(trials["robots"], 300);
    let measurements = place.read("p.csv").lines().count() - 1;
    let study = format!("\n[study]\nexperiments = {measurements}\ntrials = 300\n{file}");
    place.write("s.toml", text + &study);
    let study = place.json("study s.toml --level robot");
    for key in [
        "rms_mm",
        "rms_std_mm",
        "verdict",
        "histogram",
        "contributions",
    ] {
        assert_eq!(study["plans"][0][key], trials[key], "{key}");
    }
}

/// Options where they say nothing.
#[test]
fn options_that_do_not_fit_are_told() {
    let place = Workplace::with("s.toml", absolute(""));
    place.write("r.toml", scenario_text("ur10"));
    place.write(
        "c.csv",
        "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n20,-60,80,-110,-70,30\n",
    );
    for (arguments, words) in [
        (
            "plan r.toml --draw 20",
            "--draw is for plans of absolute readings",
        ),
        (
            "plan s.toml --candidates c.csv --draw 20",
            "cannot be used with",
        ),
        ("evaluate s.toml --plan c.csv --trials 1", "1 is not in 2.."),
    ] {
        let outcome = place.run(&format!("{arguments} --quiet"));
        assert!(
            outcome.code == Some(1) || outcome.code == Some(2),
            "{outcome:?}"
        );
        outcome.says(words);
    }
}
