//! What else is uncertain or to be found where rotations are measured, too, and on arms with springs beside the joints'
//! own: predictions, studies, identification, and names that are wrong.

use std::fmt::Write as _;

use crate::support::{Workplace, number, scenario_text, shipped};
use crate::uncertainties::{
    SOURCES, assert_holds, assert_refused, entry, expected_mm, repeated_in_study, study,
};

/// The paper's scenario where rotations are measured, too.
fn with_rotations(text: &str) -> String {
    let with = text.replace(
        "sigma_mm = 0.03",
        "sigma_mm = 0.03\nrotation_sigma_mrad = 0.02",
    );
    assert_ne!(with, text);
    with
}

const SHARED: [(&str, &str); 2] = [
    ("transmission_error", "std_mrad = 3"),
    ("discrepancy", "std_mm = 0.04"),
];

/// A hydraulic arm's springs: an arm of three joints, soft enough that a compensator shows, in three measurements each
/// three times.
fn with_springs(parameters: &str, more: &str, level: &str, trials: u32) -> String {
    let text = scenario_text("kr270_compensator");
    let (head, _) = text.split_once("[study]").unwrap_or((&text, ""));
    let head = head.replace(
        "parameters = [\"joint_2\", \"joint_3\", \"joint_4\", \"joint_5\", \"joint_6\"]",
        &format!("parameters = [\"joint_2\", \"joint_3\", \"joint_4\", \"joint_5\", \"joint_6\"{parameters}]"),
    );
    let plan = shipped("scenarios/plans/klimchik2012_m4.csv");
    format!(
        "{head}\n[study]\nexperiments = 4\ntrials = {trials}\nlevel = \"{level}\"\n[[study.plan]]\nkind = \"file\"\n\
         name = \"2c\"\nfile = \"{plan}\"\n{more}"
    )
}

/// Each source with rotations measured, on the virtual robot: what is seen is what is predicted.
#[test]
fn predictions_hold_where_rotations_are_measured() {
    for source in SOURCES {
        let text = with_rotations(&repeated_in_study(1, &entry(source, ""), "robot", 600));
        assert_holds(&study(&text), &format!("{source:?}"));
    }
    let shared: String = SHARED.iter().map(|&source| entry(source, "")).collect();
    for (level, trials) in [("robot", 600), ("model", 20_000)] {
        let plan = study(&with_rotations(&repeated_in_study(
            3, &shared, level, trials,
        )));
        assert_holds(&plan, level);
        let z = number(&plan["nees_z"]);
        assert!(z.abs() < 5.0, "{level}: {z}");
    }
}

/// All at once, as the linear model has it.
#[test]
fn predictions_about_everything_are_exact_with_rotations() {
    let all: String = (SOURCES.iter().chain(&SHARED).enumerate())
        .map(|(index, &source)| entry(source, &format!("name = \"source {index}\"")))
        .collect();
    let text = with_rotations(&repeated_in_study(1, &all, "model", 20_000));
    let plan = study(&text);
    assert_holds(&plan, "everything");
    let expected = expected_mm(&plan);
    let predicted = number(&plan["combined_rms_mm"]);
    let error = expected / predicted - 1.0;
    assert!(error.abs() < 1e-9, "{expected} {predicted}");
}

/// A compensator of which little is known, in each run another one in MuJoCo's model.
#[test]
fn predictions_hold_on_arms_with_springs() {
    let mut all = String::new();
    for source in [
        ("spring_stiffness", "std_relative = 0.3"),
        ("spring_rest", "std_mm = 20"),
        ("joint_zero", "std_mrad = 1"),
        ("link_position", "std_mm = 0.5"),
        ("load_scale", "std_relative = 0.01"),
        ("load_point", "std_mm = 5"),
        ("joint_repeatability", "std_mrad = 0.03"),
        ("transmission_error", "std_mrad = 1"),
    ] {
        let alone = with_springs("", &entry(source, ""), "robot", 400);
        assert_holds(&study(&alone), source.0);
        write!(all, "{}", entry(source, "")).expect("text takes it");
    }
    for (level, trials) in [("robot", 600), ("model", 20_000)] {
        let plan = study(&with_springs("", &all, level, trials));
        assert_holds(&plan, level);
        let z = number(&plan["nees_z"]);
        assert!(z.abs() < 5.0, "{level}: {z}");
    }
}

/// A compensator's stiffness that is to be found, beside what a list knows of it.
#[test]
fn springs_are_found() {
    let known = entry(("spring_stiffness", "std_relative = 0.3"), "");
    let parameters = ", \"compensator.stiffness\"";
    let plan = study(&with_springs(parameters, &known, "robot", 600));
    assert_holds(&plan, "known to a third");
    let z = number(&plan["nees_z"]);
    assert!(z.abs() < 5.0, "{z}");
    let place = Workplace::with("s.toml", with_springs(parameters, &known, "robot", 64));
    let plan = shipped("scenarios/plans/klimchik2012_m4.csv");
    place.json(&format!(
        "measure s.toml --plan {plan} --measurements-out m.csv"
    ));
    let found = place.json("identify s.toml --measurements m.csv");
    let spring = &found["uncertain"][0];
    assert_eq!(spring["name"], "compensator.stiffness");
    let [known, now] = ["prior_std", "std"].map(|key| number(&spring[key]));
    assert!((known / (0.3 * 144_270.0) - 1.0).abs() < 1e-9, "{known}");
    assert!(now < known, "{now}");
}

/// Wrong names and kinds are named.
#[test]
fn wrong_entries() {
    for name in ["compensator.stifness", "spring_1.stiffness", "compensator"] {
        let place = Workplace::new();
        let parameters = format!(", \"{name}\"");
        place.write("wrong.toml", with_springs(&parameters, "", "model", 64));
        let said = place.refused("check wrong.toml");
        said.says("robot.parameters");
        said.says(name);
        said.says("--parameters");
    }
    for (entry, key, says) in [
        (
            "kind = \"spring_stiffness\"\nstd_relative = 0.1",
            "kind",
            "no springs",
        ),
        (
            "kind = \"spring_rest\"\nstd_relative = 0.1",
            "std_relative",
            "std_mm",
        ),
        (
            "kind = \"spring_stiffness\"\nstd_relative = 0.1\njoints = [\"joint_2\"]",
            "joints",
            "spring_stiffness",
        ),
    ] {
        assert_refused(entry, key, says);
    }
}
