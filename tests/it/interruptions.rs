//! Long studies that are killed, commands that are interrupted, and disks that fill up.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::support::{Workplace, assert_has, scenario_text, shipped};

/// A study of one plan file under the conditions of the paper.
fn one_plan() -> String {
    let text = scenario_text("klimchik2012");
    let plans = text.find("[[study.plan]]").expect("is there");
    let plan = text[plans..]
        .split("[[study.plan]]")
        .last()
        .expect("a plan");
    assert!(plan.contains("optimal"));
    let file = shipped("scenarios/plans/klimchik2012_m12.csv");
    format!(
        "{}[[study.plan]]\nname = \"paper\"\nkind = \"file\"\nfile = \"{file}\"\n",
        &text[..plans]
    )
}

/// Killed by the system twice in the middle, with no chance to clean up, a study goes on from its
/// last tally and ends with the same bits as one that ran through.
#[test]
fn a_killed_study_goes_on_to_the_same_bits() {
    let workplace = Workplace::with("s.toml", one_plan());
    let study = "study s.toml --quiet --threads 1 --trials 8000000";
    workplace.done(&format!("{study} --out through"));

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
    workplace.done(&resumed);
    assert_eq!(
        workplace.read("killed/s/study.csv"),
        workplace.read("through/s/study.csv")
    );
}

/// A command that was started, and what it has said on stderr so far.
struct Started {
    child: Child,
    stderr: BufReader<std::process::ChildStderr>,
    said: String,
}

impl Started {
    fn new(workplace: &Workplace, arguments: &str) -> Self {
        let mut child = workplace
            .command(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let stderr = BufReader::new(child.stderr.take().expect("is piped"));
        let said = String::new();
        Self {
            child,
            stderr,
            said,
        }
    }

    /// Waits until it says this.
    fn says(mut self, what: &str) -> Self {
        while !self.said.contains(what) {
            let read = self.stderr.read_line(&mut self.said).expect("is text");
            assert!(read > 0, "{what:?} is not said: {}", self.said);
        }
        self
    }

    /// Sends it a signal and waits for its end; it ends within a second, more or less: other tests
    /// run at the same time.
    fn ends_soon_after(self, signal: &str) -> (Option<i32>, String, String) {
        let start = Instant::now();
        let ended = self.ends_after(signal);
        let took = start.elapsed();
        assert!(took < Duration::from_secs(5), "it took {took:?}");
        ended
    }

    /// The exit code, stdout and what was said since.
    fn ends_after(mut self, signal: &str) -> (Option<i32>, String, String) {
        let sent = Command::new("kill")
            .args([signal, &self.child.id().to_string()])
            .status()
            .expect("there is kill");
        assert!(sent.success());
        let mut since = String::new();
        while self.stderr.read_line(&mut since).expect("is text") > 0 {}
        let Output { status, stdout, .. } = self.child.wait_with_output().expect("ends");
        let stdout = String::from_utf8(stdout).expect("is text");
        (status.code(), stdout, since)
    }
}

/// An interrupted study keeps what is done, says so, writes no results, and goes on to the same bits.
#[test]
fn an_interrupted_study_goes_on_to_the_same_bits() {
    let workplace = Workplace::with("s.toml", one_plan());
    let study = "study s.toml --threads 1 --trials 2000000";
    workplace.done(&format!("{study} --quiet --out through"));
    let resumed = format!("{study} --resume tally.json");
    for signal in ["-INT", "-TERM"] {
        let before =
            std::fs::metadata(workplace.path("tally.json")).and_then(|file| file.modified());
        let started = Started::new(&workplace, &resumed).says("runs of 1 plan");
        let start = Instant::now();
        while std::fs::metadata(workplace.path("tally.json"))
            .and_then(|file| file.modified())
            .ok()
            == before.as_ref().ok().copied()
        {
            assert!(
                start.elapsed() < Duration::from_mins(2),
                "no tally is written"
            );
            std::thread::sleep(Duration::from_millis(5));
        }
        let (code, stdout, stderr) = started.ends_soon_after(signal);
        assert_eq!((code, &*stdout), (Some(130), ""), "{stderr}");
        assert!(
            stderr.starts_with("interrupted: tally.json keeps "),
            "{stderr}"
        );
        assert_has(&stderr, "the same command goes on from there");
        assert_eq!(stderr.lines().count(), 1, "{stderr}");
        let tally = workplace.parsed("tally.json");
        assert_ne!(tally["blocks_done"], 0);
        assert_eq!(workplace.listing(), expected_files(&["tally.json"]));
    }
    workplace.done(&format!("{resumed} --quiet"));
    assert_eq!(
        workplace.read("out/s/study.csv"),
        workplace.read("through/s/study.csv")
    );
}

/// The files of a workplace where a study ran through, and another one was interrupted.
fn expected_files(more: &[&str]) -> Vec<String> {
    let through = [
        "",
        "/s",
        "/s/study.csv",
        "/s/study.html",
        "/s/study.json",
        "/s/study.mcap",
        "/s/study.rrd",
    ];
    let mut files: Vec<String> = through.map(|name| format!("through{name}")).to_vec();
    files.extend(["out", "out/s", "s.toml"].map(str::to_owned));
    files.extend(more.iter().map(|&name| name.to_owned()));
    files.sort();
    files
}

/// Whether these tests were started so that they outlive their terminal, as `nohup` does: the programs that they start do so, too.
fn ignores_hangups() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = (status.lines()).find_map(|line| line.strip_prefix("SigIgn:"));
    ignored.is_some_and(|mask| u64::from_str_radix(mask.trim(), 16).is_ok_and(|mask| mask & 1 == 1))
}

/// A search that is cut short leaves nothing: no worse plan, and no tally of it.
#[test]
fn an_interrupted_search_of_a_study_or_run_keeps_nothing() {
    let workplace = Workplace::new();
    // Searches that take seconds, so that a busy machine does not make them end before the signal.
    let text = scenario_text("kr270_all_joints");
    let line = (text.lines()).find(|line| line.starts_with("experiments = "));
    let text = text.replace(
        line.expect("a number"),
        "experiments = 30\nconfigurations = 3",
    );
    let study = "\n[[study.plan]]\nname = \"long\"\nkind = \"optimal\"\ncriterion = \"d\"\n";
    workplace.write("s.toml", text + study);
    for (arguments, says) in [
        (
            "study s.toml --resume tally.json",
            "the same command begins anew",
        ),
        ("study s.toml", "with --resume FILE"),
        ("run s.toml", "nothing was kept"),
    ] {
        for signal in ["-INT", "-TERM", "-HUP"] {
            if signal == "-HUP" && ignores_hangups() {
                continue;
            }
            let started = Started::new(&workplace, arguments).says("designing");
            // Within the search.
            std::thread::sleep(Duration::from_millis(20));
            let (code, stdout, stderr) = started.ends_soon_after(signal);
            assert_eq!((code, &*stdout), (Some(130), ""), "{arguments}: {stderr}");
            assert!(stderr.starts_with("interrupted: "), "{stderr}");
            assert!(stderr.contains(says), "{stderr}");
            assert_eq!(stderr.lines().count(), 1, "{stderr}");
            assert_eq!(
                workplace.listing(),
                ["out", "out/s", "s.toml"],
                "{arguments}"
            );
        }
    }
}

#[test]
fn other_commands_end_at_once() {
    let workplace = Workplace::with("s.toml", scenario_text("klimchik2012"));
    let plan = shipped("scenarios/plans/klimchik2012_m12.csv");
    for (arguments, says) in [
        (
            format!("evaluate s.toml --plan {plan}"),
            "searching the bound",
        ),
        ("reproduce s.toml --out out".to_owned(), "designing"),
    ] {
        let started = Started::new(&workplace, &arguments).says(says);
        let (code, stdout, stderr) = started.ends_soon_after("-INT");
        assert_eq!((code, &*stdout), (Some(130), ""), "{stderr}");
        assert!(
            stderr.starts_with("interrupted: nothing was kept"),
            "{stderr}"
        );
    }
    assert!(!workplace.path("out/s/reproduction.json").exists());
}

/// `plan` and `budget` make something of what they have.
#[test]
fn an_interrupted_search_keeps_its_best_plan() {
    let workplace = Workplace::with("s.toml", scenario_text("klimchik2012"));
    for (arguments, says, file) in [
        (
            "plan s.toml --experiments 6 --plan-out p.csv",
            "designing",
            "p.csv",
        ),
        ("budget s.toml --plot-out b.svg", "searching", "b.svg"),
    ] {
        let started = Started::new(&workplace, arguments).says(says);
        let (code, _, stderr) = started.ends_after("-INT");
        assert_eq!(code, Some(3), "{stderr}");
        assert_has(&stderr, "stopping: keeping the best plan");
        assert_has(&stderr, "condition C0106: the search was stopped");
        assert!(workplace.path(file).is_file());
    }
    let evaluate = "evaluate s.toml --plan p.csv --quiet";
    workplace.done(evaluate);
}

/// However large an arm is, a search ends when it is told to: with a plan, or without.
#[test]
fn searches_of_large_arms_end_soon() {
    let workplace = Workplace::new();
    let (mut bodies, mut servos) = (String::new(), String::new());
    for joint in 0..30 {
        let axis = ["0 0 1", "0 1 0", "1 0 0"][joint % 3];
        bodies += &format!(
            "<body pos=\"0.03 0 0.05\"><joint name=\"j{joint}\" axis=\"{axis}\" range=\"-100 100\"/><geom size=\"0.02\" mass=\"0.2\"/>"
        );
        servos += &format!("<position joint=\"j{joint}\" kp=\"50000\"/>");
    }
    let ends = "</body>".repeat(30);
    let model = format!(
        "<mujoco><worldbody>{bodies}<site name=\"tool\" pos=\"0.1 0 0.1\"/>{ends}</worldbody><actuator>{servos}</actuator></mujoco>"
    );
    workplace.write("m.xml", model);
    workplace.done("init m.xml --scenario-out s.toml");
    for signal in ["-INT", "-TERM"] {
        let started = Started::new(&workplace, "plan s.toml --experiments 40 --plan-out p.csv");
        let (code, _, stderr) = started.says("designing").ends_soon_after(signal);
        assert!(matches!(code, Some(3 | 130)), "{stderr}");
        assert_eq!(workplace.path("p.csv").is_file(), code == Some(3));
    }
}

/// `nohup` has a study outlive its terminal.
#[test]
fn nohup_is_heeded() {
    let workplace = Workplace::with("s.toml", one_plan());
    let study = "study s.toml --quiet --threads 1 --trials 1000000";
    let script = format!("trap '' HUP; \"$ELASTOCAL\" {study} & sleep 0.5; kill -HUP $!; wait $!");
    workplace.shell(&script).ends_with(0);
}

/// Runs the program where the folder `full` is a file system of so many kB of our own, in a name space
/// that needs no rights. `None`, with a message, where that is not possible.
fn run_on_a_full_disk(workplace: &Workplace, size_kb: u32, arguments: &str) -> Option<Output> {
    std::fs::create_dir_all(workplace.path("full")).expect("can be made");
    let script = format!("mount -t tmpfs -o size={size_kb}k none full && exec \"$@\"");
    let output = Command::new("unshare")
        .args([
            "--user",
            "--map-root-user",
            "--mount",
            "sh",
            "-c",
            &script,
            "sh",
        ])
        .arg(env!("CARGO_BIN_EXE_elastocal"))
        .args(arguments.split_whitespace())
        .current_dir(workplace.path(""))
        .output();
    let Ok(output) = output else {
        eprintln!("skipped: there is no unshare");
        return None;
    };
    let stderr = String::from_utf8_lossy(&output.stderr);
    if stderr.contains("unshare:") || stderr.contains("mount:") {
        eprintln!("skipped: no file system may be mounted here: {stderr}");
        return None;
    }
    Some(output)
}

/// On a disk that is full, the study's result is still printed, what could not be written is named,
/// and nothing is left as if it were whole.
#[test]
fn a_full_disk_costs_no_result() {
    let workplace = Workplace::with("s.toml", one_plan());
    let arguments = "study s.toml --json --trials 30000 --out full --resume full/tally.json";
    let Some(output) = run_on_a_full_disk(&workplace, 16, arguments) else {
        return;
    };
    let stderr = String::from_utf8_lossy(&output.stderr);
    let printed: Value = serde_json::from_slice(&output.stdout).expect("the whole result");
    assert_eq!(printed["plans"][0]["runs"], 30_000);
    assert_eq!(output.status.code(), Some(3), "{stderr}");
    assert_has(&stderr, "cannot be written: No space left");
}

/// `run` says which files of its results are there and which are not, and prints its result.
#[test]
fn a_run_on_a_full_disk_says_what_is_there() {
    let workplace = Workplace::with("s.toml", scenario_text("planar_3r"));
    let arguments = "run s.toml --json --out full";
    let Some(output) = run_on_a_full_disk(&workplace, 64, arguments) else {
        return;
    };
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{stderr}");
    let printed: Value = serde_json::from_slice(&output.stdout).expect("the whole result");
    assert_eq!(printed["schema"]["name"], "elastocal.run");
    assert_has(&stderr, "full/s/run.rrd: cannot be written: No space left");
    assert!(
        stderr.contains("condition C0601: written: full/s/plan.csv, full/s/measurements.csv"),
        "{stderr}"
    );
    let missing = stderr
        .lines()
        .find_map(|line| line.split_once("not written: "));
    let (_, missing) = missing.expect("what is missing is said");
    assert!(missing.contains("full/s/run.rrd"), "{stderr}");
    assert!(!missing.contains("full/s/plan.csv"), "{stderr}");
}
