//! A prediction as a tolerance: the distance that 95 % of all draws of what is uncertain stay below.

use elastocal::plan::Assessment;

use crate::directions::{FORCE, pose};
use crate::support::{Workplace, assert_alike, number, numbers, project, shipped, table4};
use crate::uncertainties::{entry, loaded, study, with};

/// Along a direction the error is a normal number; in space it lies between one that is and three alike.
#[test]
fn quantiles_follow_from_the_covariance() {
    let judged = |text: &str| Assessment::new(&loaded(text).task, &table4(4), None);
    let along = judged(&pose(FORCE, "direction = [1, 2, 3]", "", "model", 64));
    let ratio = along.quantile95_m.expect("determined") / along.rho0_m.expect("determined");
    assert!((ratio - 1.959_963_985).abs() < 1e-8, "{ratio}");
    let all = judged(&with("", "model", 64));
    let ratio = all.quantile95_m.expect("determined") / all.rho0_m.expect("determined");
    assert!(
        ratio > (7.814_727_903_f64 / 3.0).sqrt() && ratio < 1.959_963_985,
        "{ratio}"
    );
}

/// Where nothing is predicted, no tolerance is.
#[test]
fn no_prediction_no_tolerance() {
    let place = Workplace::with("paper.toml", with("", "model", 64));
    let file = std::fs::read_to_string(project("scenarios/plans/klimchik2012_m4.csv"));
    let rows: Vec<String> = (file.expect("there"))
        .lines()
        .filter(|line| !line.starts_with('#'))
        .take(2)
        .map(str::to_owned)
        .collect();
    place.write("one.csv", rows.join("\n") + "\n");
    let found = place.run("evaluate paper.toml --plan one.csv --no-proof --json --quiet");
    let json = found.ends_with(3).json();
    assert!(
        json["rho0_mm"].is_null() && json["quantile95_mm"].is_null(),
        "{json}"
    );
}

/// What is predicted is seen: by the linear model, on the virtual robot with more that is uncertain, along a direction.
#[test]
fn runs_keep_the_tolerance() {
    let list = entry(("load_scale", "std_relative = 0.01"), "")
        + &entry(("joint_repeatability", "std_mrad = 0.03"), "")
        + &entry(("task_force", "std_relative = 0.02"), "");
    for (text, room) in [
        (with("", "model", 40_000), 0.015),
        (with(&list, "model", 40_000), 0.015),
        (
            pose(FORCE, "direction = [0, 1, 1]", &list, "model", 40_000),
            0.015,
        ),
        (with(&list, "robot", 1000), 0.08),
    ] {
        let plan = study(&text);
        let predicted = number(&plan["predicted_quantile95_mm"]);
        let seen = numbers(&plan["quantiles_mm"])[2];
        assert_alike(seen, predicted, room);
        let judged = Assessment::new(&loaded(&text).task, &table4(4), None);
        let judged = judged.quantile95_m.expect("determined") * 1e3;
        assert!((predicted / judged - 1.0).abs() < 1e-8);
    }
}

/// It is printed beside the prediction, and shards that are joined have the same bits as one study.
#[test]
fn tolerances_are_printed_and_joined() {
    let place = Workplace::new();
    let list = entry(("load_scale", "std_relative = 0.01"), "");
    place.write("laboratory.toml", with(&list, "model", 9000));
    let text = place.done("study laboratory.toml --quiet");
    text.prints("U = ");
    text.prints("by Monte Carlo");
    for shard in ["1", "2"] {
        let shard = format!("--shard {shard}/2 --tally-out {shard}.json");
        place.done(&format!("study laboratory.toml --quiet {shard}"));
    }
    let once = place.json("study laboratory.toml");
    let joined = place.done("merge 2.json 1.json --json").json();
    assert!(once["plans"][0]["predicted_quantile95_mm"].is_number());
    assert_eq!(once["plans"], joined["plans"]);
    let plan = shipped("scenarios/plans/klimchik2012_m4.csv");
    let evaluate = format!("evaluate laboratory.toml --plan {plan} --no-proof --quiet");
    place.done(&evaluate).prints("\n95 % stay below ");
}
