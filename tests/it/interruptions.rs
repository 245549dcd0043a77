//! Long studies that are killed, and disks that fill up.

use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::support::{Workplace, scenario_text};

/// A study of one plan file under the conditions of the paper.
fn one_plan() -> String {
    let text = scenario_text("klimchik2012");
    let plans = text.find("[[study.plan]]").expect("is there");
    let plan = text[plans..]
        .split("[[study.plan]]")
        .last()
        .expect("a plan");
    assert!(plan.contains("optimal"));
    let file = crate::support::project("scenarios/plans/klimchik2012_m12.csv");
    format!(
        "{}[[study.plan]]\nname = \"paper\"\nkind = \"file\"\nfile = \"{}\"\n",
        &text[..plans],
        file.display()
    )
}

/// Killed by the system twice in the middle, with no chance to clean up, a study goes on from its
/// last tally and ends with the same bits as one that ran through.
#[test]
fn a_killed_study_goes_on_to_the_same_bits() {
    let workplace = Workplace::new();
    workplace.write("s.toml", one_plan());
    let study = "study s.toml --quiet --threads 1 --trials 8000000";
    workplace
        .run(&format!("{study} --out through"))
        .ends_with(0);

    let done = || {
        let text = std::fs::read_to_string(workplace.path("tally.json")).ok()?;
        // A tally is there as a whole or not at all.
        let tally: Value = serde_json::from_str(&text).expect("a whole tally");
        tally["blocks_done"].as_u64()
    };
    let resumed = format!("{study} --resume tally.json --out killed");
    let mut before = 0;
    for _ in 0..2 {
        let mut child = Command::new(env!("CARGO_BIN_EXE_elastocal"))
            .args(resumed.split_whitespace())
            .current_dir(workplace.path(""))
            .stdout(Stdio::null())
            .spawn()
            .expect("the program starts");
        let start = Instant::now();
        while done().unwrap_or(0) <= before {
            assert!(
                start.elapsed() < Duration::from_mins(2),
                "no tally is written"
            );
            std::thread::sleep(Duration::from_millis(5));
        }
        child.kill().expect("it runs");
        let status = child.wait().expect("it has ended");
        assert!(!status.success(), "it was done before it could be killed");
        before = done().expect("a tally");
    }
    assert!(
        before < 8_000_000_u64.div_ceil(2048),
        "nothing was left to do"
    );
    workplace.run(&resumed).ends_with(0);
    assert_eq!(
        workplace.read("killed/s/study.csv"),
        workplace.read("through/s/study.csv")
    );
}

/// On a disk that is full, the study's result is still printed, what could not be written is named,
/// and nothing is left as if it were whole.
#[test]
fn a_full_disk_costs_no_result() {
    let workplace = Workplace::new();
    workplace.write("s.toml", one_plan());
    std::fs::create_dir(workplace.path("full")).expect("can be made");
    // A file system of 16 kB of our own, in a name space that needs no rights.
    let script = "mount -t tmpfs -o size=16k none full && exec \"$@\"";
    let program = env!("CARGO_BIN_EXE_elastocal");
    let arguments = "study s.toml --json --trials 30000 --out full --resume full/tally.json";
    let output = Command::new("unshare")
        .args([
            "--user",
            "--map-root-user",
            "--mount",
            "sh",
            "-c",
            script,
            "sh",
            program,
        ])
        .args(arguments.split_whitespace())
        .current_dir(workplace.path(""))
        .output();
    let Ok(output) = output else {
        eprintln!("skipped: there is no unshare");
        return;
    };
    let stderr = String::from_utf8_lossy(&output.stderr);
    if stderr.contains("unshare:") || stderr.contains("mount:") {
        eprintln!("skipped: no file system may be mounted here: {stderr}");
        return;
    }
    let printed: Value = serde_json::from_slice(&output.stdout).expect("the whole result");
    assert_eq!(printed["plans"][0]["runs"], 30_000);
    assert_eq!(output.status.code(), Some(3), "{stderr}");
    assert!(
        stderr.contains("cannot be written: No space left"),
        "{stderr}"
    );
}
