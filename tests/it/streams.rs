//! A study's recordings, live in a viewer and as files. Results do not depend on any viewer.

use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::recordings::{Message, read_mcap, rerun, rerun_program, rows};
use crate::support::{Outcome, Workplace, assert_has, scenario_text, shipped};

/// Two plans that need no search: the paper's plan of 12 measurements and a random one each run.
fn small() -> Workplace {
    let workplace = Workplace::new();
    let file = shipped("scenarios/plans/klimchik2012_m12.csv");
    let text = scenario_text("klimchik2012");
    let (text, _) = text.split_once("[study]").expect("it has a study");
    workplace.write(
        "s.toml",
        format!(
            "{text}[study]\ntrials = 5000\nexperiments = 12\n\
             [[study.plan]]\nname = \"the paper's\"\nkind = \"file\"\nfile = \"{file}\"\n\
             [[study.plan]]\nname = \"random\"\nkind = \"random_each\"\n"
        ),
    );
    workplace
}

/// What study.json says, but for the time that it took.
fn results(workplace: &Workplace, folder: &str) -> Value {
    let text = workplace.read(&format!("{folder}/s/study.json"));
    let mut json: Value = serde_json::from_str(&text).expect("JSON");
    let keys = json.as_object_mut().expect("an object");
    for timing in ["elapsed_s", "runs_per_s"] {
        keys.remove(timing).expect("it took some time");
    }
    json
}

fn messages(workplace: &Workplace, folder: &str) -> Vec<Message> {
    let path = workplace.path(&format!("{folder}/s/study.mcap"));
    read_mcap(&std::fs::read(path).expect("readable"))
}

/// The numbers of runs of the snapshots.
fn snapshots(messages: &[Message]) -> Vec<u64> {
    let of_progress = |message: &&Message| message.topic == "/study/progress";
    (messages.iter().filter(of_progress))
        .map(|message| message.json["runs"].as_u64().expect("a number"))
        .collect()
}

/// The program with other variables in its environment.
fn with(workplace: &Workplace, arguments: &str, variables: &[(&str, &str)]) -> Outcome {
    let output = Command::new(env!("CARGO_BIN_EXE_elastocal"))
        .args(arguments.split_whitespace())
        .current_dir(workplace.path(""))
        .env_remove("ELASTOCAL_RERUN")
        .envs(variables.iter().copied())
        .output()
        .expect("the program starts");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    Outcome {
        arguments: arguments.to_owned(),
        code: output.status.code(),
        stdout: text(output.stdout),
        stderr: text(output.stderr),
    }
}

#[test]
fn a_study_writes_recordings_that_others_can_read() {
    let workplace = small();
    workplace.done("study s.toml");
    let result = results(&workplace, "out");

    let messages = messages(&workplace, "out");
    let runs = snapshots(&messages);
    assert_eq!(
        runs,
        [10, 20, 50, 100, 200, 500, 1000, 2048, 4096, 5000],
        "within the first block, then by blocks"
    );
    let last = |topic: &str| {
        let mut found = messages.iter().filter(|each| each.topic == topic);
        found.next_back().unwrap_or_else(|| panic!("{topic}"))
    };
    // The final record has the bits of study.json.
    let study = &last("/study").json;
    assert_eq!(study["plans"], result["plans"]);
    for key in ["trials", "level", "experiments", "parameters", "reference"] {
        assert_eq!(study[key], result[key], "{key}");
    }
    assert_eq!(last("/provenance").json, result["provenance"]);
    let progress = last("/study/progress");
    assert_eq!(progress.time_ns, 600_000_000_000, "the tenth snapshot");
    for key in ["name", "mean_mm", "mean_ci95_mm", "rms_mm"] {
        assert_eq!(progress.json["plans"][1][key], result["plans"][1][key]);
    }
    // Two plans of 12 experiments, each with the test pose twice.
    let count = |topic: &str| messages.iter().filter(|each| each.topic == topic).count();
    assert_eq!((count("/plan"), count("/tf")), (2, 28));
    assert!(count("/scene") > 28);

    let path = workplace.path("out/s/study.rrd");
    rerun(&["rrd", "verify"], &path);
    let rows = rows(&rerun(&["rrd", "print"], &path));
    for plan in ["the\\ paper\\'s", "random"] {
        assert_eq!(
            rows[&format!("/means_um/{plan}")],
            1 + runs.len(),
            "a style, and snapshots"
        );
        assert_eq!(rows[&format!("/distance_um/{plan}")], runs.len());
    }
    assert_eq!(rows["/text/table"], runs.len());
    assert_eq!(
        rows["/world/force"],
        28 + runs.len(),
        "steps, and snapshots"
    );
    assert_eq!(rows["/text/about"], 1);
    let table = rerun(&["rrd", "print", "-vvv", "--entity", "/text/table"], &path);
    assert!(table.contains("5000 of 5000 runs"));
}

#[test]
fn snapshots_stay_few_and_do_not_depend_on_threads() {
    let workplace = small();
    let few = "study s.toml --quiet --trials 30000 --threads 1 --out few";
    workplace.done(few);
    let more = "study s.toml --quiet --trials 300000 --out more";
    workplace.done(more);
    let few = snapshots(&messages(&workplace, "few"));
    let more = snapshots(&messages(&workplace, "more"));
    assert_eq!(few.last(), Some(&30_000));
    assert_eq!(more.last(), Some(&300_000));
    assert!(few.is_sorted() && more.is_sorted());
    // Ten times as many runs: 8 to 16 snapshots while the number doubles.
    let added = more.len() - few.len();
    assert!((20..=54).contains(&added), "{added}");

    let again = "study s.toml --quiet --trials 30000 --threads 2 --out again";
    workplace.done(again);
    let bytes = |folder: &str| {
        let path = workplace.path(&format!("{folder}/s/study.mcap"));
        std::fs::read(path).expect("readable")
    };
    assert!(bytes("few") == bytes("again"), "the same bits");
}

#[test]
fn the_stream_as_a_file_and_no_stream_give_the_same_results() {
    let workplace = small();
    workplace.done("study s.toml --out plain");
    workplace.done("study s.toml --out saved --rerun save=live.rrd");
    assert_eq!(results(&workplace, "plain"), results(&workplace, "saved"));
    let path = workplace.path("live.rrd");
    let saved = workplace.path("saved/s/study.rrd");
    let saved = saved.to_str().expect("UTF-8");
    rerun(&["rrd", "compare", "--unordered", saved], &path);

    // A part of a study has no folder for results, and can be shown all the same.
    workplace.done("study s.toml --shard 2/2 --tally-out part --rerun save=part.rrd");
    let part = workplace.path("part.rrd");
    rerun(&["rrd", "verify"], &part);
    let table = rerun(&["rrd", "print", "-vvv", "--entity", "/text/table"], &part);
    assert!(
        table.contains("2048 of 5000 runs"),
        "the second of three blocks"
    );
    assert!(!workplace.path("out/s/study.rrd").exists());
}

/// `RERUN=off` switches the SDK off elsewhere; here a recording that was asked for is written.
#[test]
fn the_environment_does_not_switch_recordings_off() {
    let workplace = small();
    with(&workplace, "study s.toml", &[("RERUN", "off")]).ends_with(0);
    let path = workplace.path("out/s/study.rrd");
    rerun(&["rrd", "verify"], &path);
    assert_eq!(rows(&rerun(&["rrd", "print"], &path))["/text/table"], 10);
}

#[test]
fn an_interrupted_study_is_recorded_from_where_it_goes_on() {
    let workplace = small();
    let study = "study s.toml --resume tally";
    workplace.done(study);
    let whole = results(&workplace, "out");
    // There is nothing left to do, and the recordings say what was found.
    workplace.done(study);
    assert_eq!(results(&workplace, "out"), whole);
    assert_eq!(snapshots(&messages(&workplace, "out")), [5000]);
}

/// Nobody listens, or somebody who closes every connection: said once, and the result is there.
#[test]
fn a_viewer_that_is_not_there_or_goes_away_costs_no_result() {
    let workplace = small();
    workplace.done("study s.toml --out plain");
    let expected = results(&workplace, "plain");
    let listener = TcpListener::bind("127.0.0.1:0").expect("there is a free port");
    let port = listener.local_addr().expect("it is bound").port();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            drop(stream);
        }
    });
    // Port 1 is that of a protocol which nobody uses.
    for (port, problem) in [(1, "there is no rerun viewer"), (port, "has gone away")] {
        let start = Instant::now();
        let connect = format!("--rerun connect=rerun+http://127.0.0.1:{port}/proxy");
        let study = format!("study s.toml --quiet --out live {connect}");
        let outcome = workplace.done(&study);
        assert_eq!(outcome.stderr.matches("warning:").count(), 1, "{outcome:?}");
        outcome.says(problem);
        assert!(start.elapsed() < Duration::from_secs(30));
        assert_eq!(results(&workplace, "live"), expected);
        std::fs::remove_dir_all(workplace.path("live")).expect("it was written");
    }
    let study = "study s.toml --quiet --out live --rerun spawn";
    let outcome = with(&workplace, study, &[("ELASTOCAL_RERUN", "nowhere/rerun")]).ends_with(0);
    outcome.says("hint: ELASTOCAL_RERUN must name");
    assert_eq!(results(&workplace, "live"), expected);
}

/// A rerun program that writes what it receives to a file; it ends with the test.
struct Receiver {
    program: Child,
    port: u16,
}

impl Receiver {
    fn start(file: &Path) -> Self {
        let free = TcpListener::bind("127.0.0.1:0").expect("there is a free port");
        let port = free.local_addr().expect("it is bound").port();
        drop(free);
        let program = Command::new(rerun_program())
            .arg("--save")
            .arg(file)
            .args(["--bind", "127.0.0.1", "--port", &port.to_string()])
            .env("RERUN_ANALYTICS", "0")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("rerun starts");
        let receiver = Self { program, port };
        eventually("rerun listens", || {
            TcpStream::connect(("127.0.0.1", receiver.port)).is_ok()
        });
        receiver
    }

    fn option(&self) -> String {
        format!("--rerun connect=rerun+http://127.0.0.1:{}/proxy", self.port)
    }
}

impl Drop for Receiver {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

fn eventually(what: &str, holds: impl Fn() -> bool) {
    let start = Instant::now();
    while !holds() {
        assert!(start.elapsed() < Duration::from_secs(30), "{what}");
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// How many rows an entity of a file has that may still be written.
fn rows_so_far(file: &Path, entity: &str) -> usize {
    let output = Command::new(rerun_program())
        .args(["rrd", "print"])
        .arg(file)
        .env("RERUN_ANALYTICS", "0")
        .output()
        .expect("rerun starts");
    let printed = String::from_utf8_lossy(&output.stdout);
    rows(&printed).get(entity).copied().unwrap_or(0)
}

#[test]
fn a_viewer_receives_all_while_the_study_runs() {
    let workplace = small();
    let file = workplace.path("received.rrd");
    let receiver = Receiver::start(&file);
    let study = format!("study s.toml --quiet {}", receiver.option());
    let outcome = workplace.done(&study);
    assert_eq!(outcome.stderr, "");
    eventually("all snapshots arrive", || {
        rows_so_far(&file, "/text/table") == 10 && rows_so_far(&file, "/world/force") == 38
    });
}

#[test]
fn a_viewer_receives_a_run() {
    let workplace = Workplace::new();
    let file = workplace.path("received.rrd");
    let receiver = Receiver::start(&file);
    let scenario = shipped("scenarios/planar_3r.toml");
    let run = format!("run {scenario} --quiet {}", receiver.option());
    let outcome = workplace.done(&run);
    assert_eq!(outcome.stderr, "");
    let written = rows_so_far(&workplace.path("out/planar_3r/run.rrd"), "/world/force");
    assert!(written > 0);
    eventually("all steps arrive", || {
        rows_so_far(&file, "/world/force") == written
    });
}

/// A program that lies in the folder where somebody stands is not run, by whatever name.
#[test]
fn the_folder_s_programs_are_not_run() {
    let place = small();
    place.write("viewer", "#!/bin/sh\necho \"$@\" >opened\n");
    let executable = std::os::unix::fs::PermissionsExt::from_mode(0o755);
    std::fs::set_permissions(place.path("viewer"), executable).expect("it is ours");
    std::fs::create_dir(place.path(".rerun")).expect("possible");
    for name in ["rerun", ".rerun/rerun", "elastocal"] {
        std::fs::copy(place.path("viewer"), place.path(name)).expect("possible");
    }
    // The program itself, where no viewer was installed beside it.
    let program = place.path("elastocal");
    std::fs::copy(env!("CARGO_BIN_EXE_elastocal"), &program).expect("possible");
    for path in ["/nowhere", "", ".", ".rerun"] {
        let output = Command::new(&program)
            .args(["study", "s.toml", "--trials", "10", "--rerun", "spawn"])
            .current_dir(place.path(""))
            .env_remove("ELASTOCAL_RERUN")
            .env("PATH", path)
            .output()
            .expect("the program starts");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_has(&said, "not installed");
        assert_has(&said, "pip install rerun-sdk");
        assert!(!place.path("opened").exists());
    }
}
