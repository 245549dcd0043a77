//! What happens to commands from outside, at random moments: killed, interrupted, out of space, without
//! streams, two at once; and files with the oddest names.
//!
//! The moments are seeded. `ELASTOCAL_FAULTS` makes so many with each signal instead of two, and
//! `ELASTOCAL_FAULTS_SEED` others.

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde_json::Value;

use crate::support::{Workplace, error_message, scenario_text};

/// A plan for the arm of three joints.
const PLAN: &str = "q1_deg,q2_deg,q3_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats\n\
                    0,-40,60,0,0,-200,0,0,0,1\n\
                    30,-60,90,0,0,-200,0,0,0,1\n\
                    0,-20,-40,0,0,-200,0,0,0,1\n";

/// How many moments are tried with each signal.
fn moments() -> usize {
    let asked = std::env::var("ELASTOCAL_FAULTS").ok();
    asked.map_or(2, |count| count.parse().expect("a number of moments"))
}

fn generator(of: &str) -> ChaCha8Rng {
    let asked = std::env::var("ELASTOCAL_FAULTS_SEED").ok();
    let seed: u64 = asked.map_or(0, |seed| seed.parse().expect("a seed"));
    let name = of.bytes().fold(seed, |hash, byte| {
        hash.wrapping_mul(0x0100_0000_01b3) ^ u64::from(byte)
    });
    ChaCha8Rng::seed_from_u64(name)
}

/// A command that takes a while, with what it needs.
struct Trial {
    workplace: Workplace,
    arguments: String,
    /// The same with other results in the same files: what is there before.
    before: String,
}

impl Trial {
    fn all() -> Vec<Self> {
        let shards = [
            "study s.toml --quiet --trials 20000 --shard 1/2 --tally-out a",
            "study s.toml --quiet --trials 20000 --shard 2/2 --tally-out b",
            "study s.toml --quiet --trials 10000 --shard 1/1 --tally-out c",
        ];
        let study = "study s.toml --quiet --trials 300000";
        let resumed = "study s.toml --quiet --trials 300000 --resume tally";
        let other = "study s.toml --quiet --trials 1000 --seed 7";
        let plan = "plan s.toml --quiet --experiments 6 --plan-out plan.csv --proof-out proof.json";
        let other_plan = "plan s.toml --quiet --seed 7 --plan-out plan.csv --proof-out proof.json";
        let [run, other_run] =
            ["--seed 1", "--seed 7"].map(|seed| format!("run s.toml --quiet --no-proof {seed}"));
        vec![
            Self::new(&[], &run, &other_run),
            Self::new(&[], study, other),
            Self::new(&[], resumed, other),
            Self::new(&[], plan, other_plan),
            Self::new(&shards, "merge --quiet a b", "merge --quiet c"),
        ]
    }

    /// All but `run`, which takes longest.
    fn quick() -> impl Iterator<Item = Self> {
        Self::all().into_iter().skip(1)
    }

    /// An arm of three joints, and a study of one plan that is in a file.
    fn new(prepare: &[&str], arguments: &str, before: &str) -> Self {
        let workplace = Workplace::new();
        let text = scenario_text("planar_3r");
        let file = "[[study.plan]]\nname = \"file\"\nkind = \"file\"\nfile = \"file.csv\"\n";
        workplace.write("s.toml", text + file);
        workplace.write("file.csv", PLAN);
        for each in prepare {
            workplace.done(each);
        }
        Self {
            workplace,
            arguments: arguments.to_owned(),
            before: before.to_owned(),
        }
    }

    /// Starts it, and ends it with the signal after a while.
    fn is_ended(&self, signal: &str, after: Duration) -> Output {
        let child = self
            .workplace
            .command(&self.arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        std::thread::sleep(after);
        // It may have ended by itself; nobody has waited for it, so the number is still its own.
        Command::new("kill")
            .args([signal, &child.id().to_string()])
            .status()
            .expect("there is kill");
        child.wait_with_output().expect("it ends")
    }

    /// What is in the files that it writes, without elapsed times.
    fn results(&self) -> BTreeMap<String, Vec<u8>> {
        let mut found = BTreeMap::new();
        for name in self.workplace.listing() {
            let path = self.workplace.path(&name);
            let is_result = name.starts_with("out/") || name.starts_with('p');
            // Snapshots of a study that was resumed begin where it goes on.
            let is_shown = ["mcap", "rrd"].contains(&ending(&name));
            let is_same = !is_shown || !self.arguments.contains("--resume");
            if is_result && is_same && path.is_file() && !is_unfinished(&name) {
                found.insert(name.clone(), timeless(&name, path));
            }
        }
        found
    }

    fn unfinished(&self) -> Vec<String> {
        let mut names = self.workplace.listing();
        names.retain(|name| is_unfinished(name));
        names
    }
}

fn is_unfinished(name: &str) -> bool {
    name.contains(".tmp")
}

fn ending(name: &str) -> &str {
    name.rsplit('.').next().unwrap_or_default()
}

/// A file's content, as far as it does not depend on the time.
fn timeless(name: &str, path: PathBuf) -> Vec<u8> {
    let content = std::fs::read(path).expect("can be read");
    match ending(name) {
        "json" => {
            let mut value: Value = serde_json::from_slice(&content)
                .unwrap_or_else(|error| panic!("{name} is not whole: {error}"));
            strip(&mut value);
            value.to_string().into_bytes()
        }
        // Recordings and pages hold the time; they are whole if they end as they should.
        "html" => content[content.len().saturating_sub(8)..].to_vec(),
        "rrd" => content[content.len().saturating_sub(4)..].to_vec(),
        _ => content,
    }
}

fn strip(value: &mut Value) {
    match value {
        Value::Object(map) => {
            map.retain(|key, _| !["elapsed_s", "runs_per_s"].contains(&key.as_str()));
            map.values_mut().for_each(strip);
        }
        Value::Array(list) => list.iter_mut().for_each(strip),
        _ => {}
    }
}

/// Whenever a command is ended, each of its files is the old one or the new one, or not there;
/// the command says how it ended; and called again it comes to the same bits.
#[test]
fn ended_at_any_moment() {
    for trial in Trial::all() {
        let (workplace, arguments) = (&trial.workplace, &trial.arguments);
        let start = Instant::now();
        workplace.done(arguments);
        let takes = start.elapsed();
        let new = trial.results();
        assert!(!new.is_empty(), "{arguments}");
        let _ = std::fs::remove_file(workplace.path("tally"));
        workplace.done(&trial.before);
        let mut old = trial.results();

        let mut random = generator(arguments);
        for signal in ["-KILL", "-INT", "-TERM"] {
            for _ in 0..moments() {
                let after = takes.mul_f64(random.random_range(0.0..1.1));
                let told = format!("{arguments} {signal} after {after:?}");
                let output = trial.is_ended(signal, after);
                let stderr = String::from_utf8_lossy(&output.stderr);
                if signal != "-KILL" {
                    judge_end(&told, &output, &stderr);
                    assert_eq!(trial.unfinished(), [""; 0], "{told}");
                }
                for name in trial.unfinished() {
                    std::fs::remove_file(workplace.path(&name)).expect("can be removed");
                }
                let found = trial.results();
                judge_files(&told, &found, &old, &new, output.status.code());
                // What a search that was asked to stop leaves is there before the next.
                old.clone_from(&found);
                // Results are printed when they are in their files.
                let is_search = output.status.code() == Some(3);
                assert!(
                    output.stdout.is_empty() || is_search || found == new,
                    "{told}"
                );
            }
        }
        workplace.done(arguments);
        assert_eq!(trial.results(), new, "{arguments}");
    }
}

/// What an interrupted command says, and its exit code.
fn judge_end(told: &str, output: &Output, stderr: &str) {
    match output.status.code() {
        // A signal may meet the end of the last search: nothing was left to stop.
        Some(0) => assert!(
            stderr.is_empty()
                || (stderr.trim().starts_with("stopping: ") && stderr.trim().lines().count() == 1),
            "{told}: {stderr}"
        ),
        Some(3) => assert!(
            stderr.contains("the search was stopped"),
            "{told}: {stderr}"
        ),
        Some(130) => {
            assert!(stderr.starts_with("interrupted: "), "{told}: {stderr}");
            assert_eq!(stderr.lines().count(), 1, "{told}: {stderr}");
        }
        // Before it listens, the system ends it.
        None => assert!(
            output.stdout.is_empty() && stderr.is_empty(),
            "{told}: {stderr}"
        ),
        other => panic!("{told}: {other:?}: {stderr}"),
    }
}

fn judge_files(
    told: &str,
    found: &BTreeMap<String, Vec<u8>>,
    old: &BTreeMap<String, Vec<u8>>,
    new: &BTreeMap<String, Vec<u8>>,
    code: Option<i32>,
) {
    assert!(old.keys().all(|name| found.contains_key(name)), "{told}");
    for (name, content) in found {
        // A search that is asked to stop makes a plan of what it has.
        let is_best_so_far = code == Some(3);
        let is_whole = [old, new]
            .iter()
            .any(|files| files.get(name) == Some(content));
        assert!(
            is_whole || is_best_so_far,
            "{told}: {name} is neither, code {code:?}"
        );
    }
}

/// Two that write the same files at once: each file is that of one of them.
#[test]
fn two_writers() {
    // A tally has one writer: the second would go on from where the first is.
    for trial in Trial::quick().filter(|trial| !trial.arguments.contains("--resume")) {
        let each = [&trial.arguments, &trial.before].map(|arguments| {
            trial.workplace.done(arguments);
            trial.results()
        });
        let both = [&trial.arguments, &trial.before].map(|arguments| {
            let mut command = trial.workplace.command(arguments);
            let command = command.stdout(Stdio::null()).stderr(Stdio::piped());
            command.spawn().expect("the program starts")
        });
        for child in both {
            let output = child.wait_with_output().expect("it ends");
            assert_eq!(String::from_utf8_lossy(&output.stderr), "");
            assert_eq!(output.status.code(), Some(0));
        }
        assert_eq!(trial.unfinished(), [""; 0]);
        judge_files(
            &trial.arguments,
            &trial.results(),
            &each[0],
            &each[1],
            Some(0),
        );
    }
}

/// A limit on the size of files at any place: nothing unfinished stays, and nothing is said to be there
/// that is not.
#[test]
fn files_that_may_not_grow() {
    for trial in Trial::all() {
        let mut random = generator(&trial.arguments);
        for _ in 0..moments() {
            // In blocks of 512 bytes.
            let blocks = 1_u32 << random.random_range(0..9);
            let arguments = &trial.arguments;
            let outcome = trial
                .workplace
                .shell(&format!("ulimit -f {blocks}; elastocal {arguments}"));
            let told = format!("{blocks} blocks: {outcome:#?}");
            assert_eq!(trial.unfinished(), [""; 0], "{told}");
            match outcome.code {
                Some(0) => assert_eq!(outcome.stderr, "", "{told}"),
                Some(1 | 3) => assert!(outcome.stderr.contains("File too large"), "{told}"),
                _ => panic!("{told}"),
            }
            for (name, content) in trial.results() {
                assert!(!content.is_empty(), "{name}: {told}");
                let is_told = outcome
                    .stderr
                    .contains(&format!("{name}: cannot be written"));
                assert!(!is_told, "{told}");
                let file = trial.workplace.path(&name);
                std::fs::remove_file(file).expect("can be removed");
            }
        }
    }
}

/// Without stdin, stdout or stderr at all, results are in their files all the same, and no file takes
/// the place of a stream.
#[test]
fn closed_streams() {
    for trial in Trial::quick() {
        let arguments = &trial.arguments;
        trial.workplace.done(arguments);
        let expected = trial.results();
        for closed in ["2>&-", "<&- >&- 2>&-"] {
            let _ = std::fs::remove_file(trial.workplace.path("tally"));
            let script = format!("elastocal {arguments} {closed}");
            let outcome = trial.workplace.shell(&script);
            assert!(matches!(outcome.code, Some(0 | 1)), "{outcome:#?}");
            assert!(
                outcome.code == Some(0) || closed.contains(" >&-"),
                "{outcome:#?}"
            );
            assert_eq!(trial.results(), expected, "{arguments} {closed}");
        }
    }
}

/// Names that scripts trip over.
fn odd_names() -> Vec<OsString> {
    let mut names: Vec<OsString> = [
        "with spaces and 'quotes\"",
        "two\nlines",
        "-leading-dash",
        "--plan-out",
        "M\u{fc}ller \u{4e2d}\u{6587} \u{1f916}",
        "combining e\u{301}",
        "*?[a]$HOME`;|&",
        "\u{1b}[31mred",
        "~",
        "%s%n",
        ".hidden",
    ]
    .map(OsString::from)
    .to_vec();
    names.push(OsString::from("long".repeat(49)));
    names.push(OsString::from_vec(b"latin-\xfc-1".to_vec()));
    names
}

/// Every kind of file under odd names, in folders with odd names.
#[test]
fn odd_paths() {
    for name in odd_names() {
        let workplace = Workplace::new();
        let folder = workplace.path("").join(&name);
        std::fs::create_dir(&folder).expect("can be made");
        let file = |ending: &str| {
            let mut file = OsString::from("./");
            file.push(&name);
            file.push(ending);
            file
        };
        std::fs::write(folder.join(file(".toml")), scenario_text("planar_3r")).expect("written");
        let run = |arguments: &[&OsStr]| {
            let output = Command::new(env!("CARGO_BIN_EXE_elastocal"))
                .args(arguments)
                .current_dir(&folder)
                .output()
                .expect("the program starts");
            let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
            // Control characters of names are not for terminals.
            let is_plain = |byte: u8| byte == b'\n' || !byte.is_ascii_control();
            assert!(stderr.bytes().all(is_plain), "{stderr:?}");
            (output, stderr)
        };
        let plain = |text: &'static str| OsStr::new(text);
        let (quiet, plan_option) = (plain("--quiet"), plain("--plan"));
        let (scenario, plan, measured) = (file(".toml"), file(".csv"), file(".measured"));
        let identified = file(".json");
        std::fs::write(folder.join(&plan), PLAN).expect("written");
        let commands: [Vec<&OsStr>; 3] = [
            vec![
                plain("measure"),
                &scenario,
                quiet,
                plan_option,
                &plan,
                plain("--measurements-out"),
                &measured,
            ],
            // The measurements name their scenario.
            vec![
                plain("identify"),
                quiet,
                plain("--measurements"),
                &measured,
                plain("--identified-out"),
                &identified,
            ],
            vec![
                plain("compensate"),
                quiet,
                plain("--identified"),
                &identified,
            ],
        ];
        // Text files cannot name what is no text.
        let is_text = name.to_str().is_some();
        for mut arguments in commands {
            if !is_text && !arguments.contains(&&*scenario) {
                arguments.push(&scenario);
            }
            let (output, stderr) = run(&arguments);
            let code = output.status.code();
            assert!(!stderr.contains("panicked"), "{stderr}");
            // Results and their folder are named after the scenario's file.
            if name.as_bytes().iter().any(u8::is_ascii_control) {
                assert_eq!(code, Some(1), "{name:?}: {stderr}");
                assert!(error_message(&stderr).is_some(), "{stderr}");
                assert!(stderr.contains("a name of one line is allowed"), "{stderr}");
                break;
            }
            assert!(
                matches!(code, Some(0 | 3)),
                "{name:?} {arguments:?}: {stderr}"
            );
        }
    }
}
