//! Somebody's file is not taken for the default robot's: measurements and identified compliances say
//! under which scenario they were made.

use crate::support::{Workplace, project, scenario_text};

/// A folder like the project's, with a default scenario and another one.
fn workplace() -> Workplace {
    let workplace = Workplace::new();
    std::fs::create_dir(workplace.path("scenarios")).expect("can be made");
    workplace.write("scenarios/kr270.toml", scenario_text("klimchik2012"));
    workplace.write(
        "mine.toml",
        scenario_text("klimchik2012").replace("0.03", "0.05"),
    );
    let plan = project("scenarios/plans/klimchik2012_m3.csv");
    for (scenario, file) in [("", "default.csv"), ("mine.toml", "mine.csv")] {
        let plan = plan.display();
        let measure = format!("measure {scenario} --plan {plan} --measurements-out {file}");
        workplace.done(&measure);
    }
    workplace
}

#[test]
fn files_name_their_scenario() {
    let workplace = workplace();
    for (file, scenario, sigma_mm) in [
        ("default.csv", "scenarios/kr270.toml", 0.03),
        ("mine.csv", "mine.toml", 0.05),
    ] {
        let text = workplace.read(file);
        assert!(text.starts_with(&format!("# scenario: {scenario}\n# scenario_sha256: ")));
        let identify = format!("identify --measurements {file} --identified-out i.json --json");
        let outcome = workplace.done(&identify);
        assert_eq!(outcome.json()["sigma_mm"], sigma_mm);
        assert_eq!(outcome.json()["scenario_file"], scenario);
        outcome.says(&format!("scenario {scenario}: "));
        let outcome = workplace.done("compensate --identified i.json");
        outcome.says(&format!("scenario {scenario}: "));
    }
    // A spreadsheet leaves its traces in comments.
    let text = workplace
        .read("mine.csv")
        .replace(',', ";")
        .replace(".toml\n", ".toml;;;;;\n");
    workplace.write("mine.csv", text);
    workplace.done("identify --measurements mine.csv");
}

#[test]
fn no_scenario_is_guessed() {
    let workplace = workplace();
    let text = workplace.read("mine.csv");
    let uncommented = &text[text.find("q1_deg").expect("a header")..];
    workplace.write("theirs.csv", uncommented);
    let outcome = workplace.refused("identify --measurements theirs.csv");
    let says = "error E0103: theirs.csv: no scenario was given, and the file does not say to which one it belongs\n\
                hint: name the robot's scenario: elastocal identify SCENARIO --measurements theirs.csv\n";
    assert_eq!(outcome.stderr, says);
    workplace.done("identify mine.toml --measurements theirs.csv --identified-out i.json");

    let mut identified = workplace.parsed("i.json");
    identified
        .as_object_mut()
        .expect("an object")
        .remove("scenario_file");
    workplace.write("i.json", identified.to_string());
    let outcome = workplace.refused("compensate --identified i.json");
    let says =
        "hint: name the robot's scenario: elastocal compensate SCENARIO --identified i.json\n";
    assert!(outcome.stderr.ends_with(says), "{outcome:#?}");
}

#[test]
fn a_scenario_that_changed_is_not_taken_silently() {
    let workplace = workplace();
    workplace.write(
        "mine.toml",
        workplace.read("mine.toml").replace("0.05", "0.06"),
    );
    let outcome = workplace.refused("identify --measurements mine.csv");
    let says = "mine.csv: it belongs to mine.toml, which has changed since\nhint: ";
    outcome.says(says);
    let outcome = workplace.done("identify mine.toml --measurements mine.csv");
    let says = "mine.csv was made under another scenario, or another state of it: mine.toml";
    outcome.says(says);
}

/// Help speaks of what does something.
#[test]
fn help_leaves_out_what_has_no_effect() {
    let workplace = Workplace::new();
    for (command, absent, present) in [
        ("check", "--seed --threads --out ", "--json --quiet"),
        ("plan", "--out ", "--seed --threads"),
        ("budget", "--out ", "--seed --threads"),
        ("evaluate", "--out ", "--seed --threads"),
        ("measure", "--out --threads", "--seed"),
        (
            "identify",
            "--seed --threads --out ",
            "--measurements --json",
        ),
        (
            "compensate",
            "--seed --threads --out ",
            "--identified --json",
        ),
        ("run", "", "--seed --threads --out"),
        ("study", "", "--seed --threads --out"),
    ] {
        let help = workplace.done(&format!("{command} --help")).stdout;
        let options: Vec<&str> = help.split_whitespace().collect();
        for option in absent.split_whitespace() {
            assert!(!options.contains(&option), "{command} {option}: {help}");
        }
        for option in present.split_whitespace() {
            assert!(options.contains(&option), "{command} {option}: {help}");
        }
        let default = help.contains("[default: scenarios/kr270.toml]");
        assert_eq!(
            default,
            !["identify", "compensate"].contains(&command),
            "{help}"
        );
    }
}

/// A scenario without a description is announced without a colon.
#[test]
fn no_description_no_colon() {
    let workplace = Workplace::new();
    let text = scenario_text("klimchik2012");
    let rest = text.split_once('\n').expect("a first line").1;
    assert!(text.starts_with("description"));
    workplace.write("s.toml", rest);
    let outcome = workplace.done("check s.toml");
    assert_eq!(outcome.stderr.lines().next(), Some("scenario s.toml"));
}
