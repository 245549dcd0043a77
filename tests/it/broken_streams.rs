//! stdout and stderr that nobody reads or that are full.

use std::path::Path;
use std::process::Stdio;

use crate::support::{Workplace, scenario_text, shipped};

/// A quick command that says something on both, with a condition.
fn command() -> (Workplace, String) {
    let workplace = Workplace::with("s.toml", scenario_text("klimchik2012"));
    let plan = shipped("scenarios/plans/klimchik2012_m3.csv");
    let arguments = format!("measure s.toml --plan {plan}");
    (workplace, arguments)
}

fn is_there(device: &str) -> bool {
    let found = Path::new(device).exists();
    if !found {
        eprintln!("skipped: there is no {device}");
    }
    found
}

/// What is said on stderr is no part of the result.
#[test]
fn a_broken_stderr_changes_nothing() {
    let (workplace, measure) = command();
    let expected = workplace.done(&measure).stdout;
    let (reader, writer) = std::io::pipe().expect("there are pipes");
    drop(reader);
    let output = workplace.command(&measure).stderr(writer).output();
    let output = output.expect("the program starts");
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(String::from_utf8_lossy(&output.stdout), expected);
    for end in ["2>&-", "2>/dev/full"] {
        if end.contains("full") && !is_there("/dev/full") {
            continue;
        }
        let outcome = workplace.shell(&format!("elastocal {measure} {end}"));
        assert_eq!(outcome.code, Some(0), "{outcome:#?}");
        assert_eq!(outcome.stdout, expected);
        // Neither what went wrong nor a wrong usage needs somebody who listens.
        for (wrong, code) in [("check missing.toml", 1), ("check --what", 2)] {
            let outcome = workplace.shell(&format!("elastocal {wrong} {end}"));
            assert_eq!(outcome.code, Some(code), "{outcome:#?}");
        }
    }
}

#[test]
fn a_reader_of_stdout_that_has_seen_enough_is_no_error() {
    let (workplace, measure) = command();
    let [words, json] = ["", " --json"].map(|form| format!("{measure} --quiet{form}"));
    for arguments in [&*words, &*json, "--help"] {
        let (reader, writer) = std::io::pipe().expect("there are pipes");
        drop(reader);
        let output = workplace
            .command(arguments)
            .stdout(writer)
            .stderr(Stdio::piped())
            .output()
            .expect("the program starts");
        assert_eq!(String::from_utf8_lossy(&output.stderr), "");
        assert_eq!(output.status.code(), Some(0));
    }
}

#[test]
fn a_full_stdout_is_an_error() {
    if !is_there("/dev/full") {
        return;
    }
    let (workplace, measure) = command();
    for arguments in [&*measure, "--help", "--version"] {
        let outcome = workplace.shell(&format!("elastocal {arguments} >/dev/full"));
        assert_eq!(outcome.code, Some(1), "{outcome:#?}");
        let says = "error E0901: stdout cannot be written: No space left";
        outcome.says(says);
    }
}
