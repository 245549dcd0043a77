//! Random numbers of virtual robots in a file: readings are a function of them, whatever the seed is.

use serde_json::Value;

use crate::support::{Workplace, absolute_scenario_text, project, scenario_text};

/// What else may be drawn of deflections.
const MORE: &str = r#"
[[uncertainty]]
kind = "transmission_error"
std_mrad = 0.02

"#;

const ABSOLUTE: &str = r#"
[[uncertainty]]
kind = "joint_zero"
std_mrad = 1

[[uncertainty]]
kind = "joint_repeatability"
std_mrad = 0.05

[[uncertainty]]
kind = "task_force"
std_n = 5

[[station]]
name = "near"
position_mm = [-1800, 500, 900]

[study]
experiments = 14
trials = 9

[[study.plan]]
kind = "file"
name = "mine"
file = "p.csv"
"#;

fn laboratory() -> String {
    let text = scenario_text("kr270_laboratory");
    let (text, _) = text.split_once("[study]").expect("a study");
    let plan = project("scenarios/plans/klimchik2012_m12.csv");
    text.to_owned()
        + MORE
        + "\n[study]\nlevel = \"robot\"\ntrials = 20\nexperiments = 12\ncompliance_spread = 0.1\n\
           [[study.plan]]\nname = \"2e\"\nkind = \"file\"\n"
        + &format!("file = \"{}\"\n", plan.display())
}

/// The numbers of seed 1 as those of seed 2.
fn reseeded(place: &Workplace) {
    let text = place.read("d.csv");
    let lines = text.lines().map(|line| {
        let mut cells: Vec<&str> = line.split(',').collect();
        if cells[1] == "1" {
            cells[1] = "2";
        }
        cells.join(",") + "\n"
    });
    place.write("e.csv", lines.collect::<String>());
}

/// What a command says under seed 1; the same comes of seed 2 with the numbers of seed 1, but not without.
fn is_a_function_of_them(place: &Workplace, command: &str, key: &str) -> Value {
    let plain = place.json(&format!("{command} --seed 1"))[key].clone();
    let noted = place.json(&format!("{command} --seed 1 --draws-out d.csv"));
    assert_eq!(noted[key], plain, "{command}");
    assert_ne!(place.json(&format!("{command} --seed 2"))[key], plain);
    reseeded(place);
    for (seed, file, threads) in [(1, "d.csv", 2), (2, "e.csv", 1)] {
        let asked = format!("{command} --seed {seed} --draws-in {file} --threads {threads}");
        assert_eq!(place.json(&asked)[key], plain, "{asked}");
    }
    plain
}

#[test]
fn deflections_are_a_function_of_what_is_drawn() {
    let place = Workplace::new();
    place.write("s.toml", laboratory());
    let plan = project("scenarios/plans/klimchik2012_m12.csv");
    let measure = format!("measure s.toml --plan {}", plan.display());
    is_a_function_of_them(&place, &measure, "measurements");
    is_a_function_of_them(&place, &format!("{measure} --run 3"), "measurements");
    is_a_function_of_them(&place, "study s.toml", "plans");
    is_a_function_of_them(&place, "study s.toml --level model", "plans");
}

#[test]
fn absolute_readings_are_a_function_of_what_is_drawn() {
    let place = Workplace::new();
    let text = absolute_scenario_text("ur10").replace("experiments = 4", "experiments = 14");
    place.write(
        "s.toml",
        text.clone() + ABSOLUTE.split("[study]").next().unwrap_or_default(),
    );
    place
        .run("plan s.toml --draw 20 --plan-out p.csv --quiet")
        .ends_with(3);
    place.write("s.toml", text + ABSOLUTE);
    is_a_function_of_them(&place, "study s.toml --parameters zeros", "plans");
    let trials = "evaluate s.toml --parameters zeros --plan p.csv --trials 9";
    is_a_function_of_them(&place, trials, "trials");
}

/// A file that does not have all numbers, or is another, is refused; so is asking where nothing is drawn.
#[test]
fn what_is_missing_is_told() {
    let place = Workplace::new();
    place.write("s.toml", laboratory());
    let study = "study s.toml --level robot --quiet";
    place
        .run(&format!("{study} --trials 8 --draws-out d.csv"))
        .ends_with(0);
    place
        .run(&format!("{study} --trials 9 --draws-in d.csv"))
        .ends_with(1)
        .says("d.csv: has no number 0 of stream ");
    let text = place.read("d.csv");
    let (whole, _) = text.trim_end().rsplit_once(',').expect("numbers");
    place.write("d.csv", whole);
    place
        .run(&format!("{study} --trials 8 --draws-in d.csv"))
        .ends_with(1)
        .says(", run 7");
    for (wrong, place_of) in [
        (text.replacen("noise,1", "noise,one", 1), "line "),
        (text.replacen("noise,1,0,", "noise,1,0,nan,", 1), "line "),
        ("q1_deg\n1\n".to_owned(), "does not begin with"),
    ] {
        place.write("d.csv", wrong);
        place
            .run(&format!("{study} --trials 8 --draws-in d.csv"))
            .ends_with(1)
            .says(place_of);
    }
    place
        .run("check s.toml --quiet --draws-out n.csv")
        .ends_with(1)
        .says("no virtual robot was sampled");
    assert!(!place.listing().contains(&"n.csv".to_owned()));
}
