//! Broken inputs by the hundred thousand: every reader either gives finite numbers or one error that names
//! the file and the place.
//!
//! Texts are read in this process. Models go to the program, which looks at them in a process of their own.
//! `ELASTOCAL_MUTATIONS` and `ELASTOCAL_MUTATION_SEED` ask for another number of inputs and for others; what
//! ever failed belongs in `tests/corpus`, in the folder of its reader.

mod mutate;

use std::fmt::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use elastocal::comparison::results::ResultsFile;
use elastocal::files::FileError;
use elastocal::measurement::read_measurements;
use elastocal::plan::read_plan;
use elastocal::random::generator;
use elastocal::record::tally_file::TallyFile;
use elastocal::scenario::Scenario;
use rayon::prelude::*;
use serde_json::Value;

use self::mutate::{mutated, mutated_json, mutated_xml};
use crate::support::{Workplace, project, scenario_text};

/// No input takes longer to read, on a machine with other work to do.
const LONGEST: Duration = Duration::from_secs(5);

/// A reader of texts, and what it is given.
struct Reader {
    /// The folder of its corpus.
    name: &'static str,
    /// The ending of its files.
    ending: &'static str,
    /// Of a hundred inputs, so many are its own.
    share: usize,
    /// Reads a file; what it holds in words, to look for numbers that are none.
    read: fn(&Path) -> Result<String, FileError>,
    /// Whether a text is well formed, by another parser.
    is_well_formed: fn(&str) -> bool,
    /// Whole files.
    seeds: Vec<String>,
}

fn readers() -> Vec<Reader> {
    let place = Workplace::new();
    place.write("s.toml", scenario_text("klimchik2012"));
    let plan = project("scenarios/plans/klimchik2012_m3.csv");
    let plan = plan.display();
    place
        .run(&format!(
            "measure s.toml --plan {plan} --measurements-out m.csv"
        ))
        .ends_with(0);
    let with_rotations =
        scenario_text("kr270").replace("tracker_site", "rotation_sigma_mrad = 0.1\ntracker_site");
    place.write("r.toml", with_rotations);
    place
        .run(&format!(
            "measure r.toml --plan {plan} --measurements-out r.csv"
        ))
        .ends_with(0);
    place
        .run("study s.toml --level model --trials 500 --shard 1/2 --tally-out t.json --quiet")
        .ends_with(0);
    let evaluated = place
        .run(&format!("evaluate s.toml --plan {plan} --json --quiet"))
        .stdout;
    let planned = place
        .run("plan s.toml --json --quiet --experiments 3")
        .stdout;
    let studied = place
        .run("study s.toml --level model --trials 500 --json --quiet")
        .stdout;
    let file = |path: &str| std::fs::read_to_string(project(path)).expect("can be read");
    vec![
        Reader {
            name: "scenario",
            ending: "toml",
            share: 10,
            read: |path| {
                let scenario = Scenario::load(path)?;
                Ok(format!(
                    "{:?} {:?} {:?} {:?} {:?} {:?}",
                    scenario.task.test_poses,
                    scenario.task.loads,
                    scenario.task.region,
                    scenario.task.belief.instrument,
                    scenario.study,
                    scenario.task.belief.nominal.compliance_rad_per_nm
                ))
            },
            is_well_formed: |text| text.parse::<toml::Table>().is_ok(),
            seeds: [
                "klimchik2012",
                "klimchik2012_joint1",
                "kr270",
                "kr270_all_joints",
                "planar_3r",
                "spatial_3r",
            ]
            .map(scenario_text)
            .into(),
        },
        Reader {
            name: "plan",
            ending: "csv",
            share: 40,
            read: |path| read_plan(path, 6).map(|plan| format!("{plan:?}")),
            is_well_formed: is_table,
            seeds: vec![
                file("scenarios/plans/klimchik2012_m3.csv"),
                file("scenarios/plans/klimchik2012_m12.csv"),
                file("scenarios/plans/kr270_all_joints.csv"),
            ],
        },
        Reader {
            name: "measurements",
            ending: "csv",
            share: 40,
            read: |path| read_measurements(path, 6).map(|all| format!("{all:?}")),
            is_well_formed: is_table,
            seeds: vec![place.read("m.csv"), place.read("r.csv")],
        },
        Reader {
            name: "tally",
            ending: "json",
            share: 5,
            read: |path| TallyFile::read(path).map(|tally| format!("{:?}", tally.header)),
            is_well_formed: is_json,
            seeds: vec![place.read("t.json")],
        },
        Reader {
            name: "results",
            ending: "json",
            share: 5,
            read: |path| ResultsFile::read(path).map(|_| String::new()),
            is_well_formed: is_json,
            seeds: vec![evaluated, planned, studied],
        },
    ]
}

fn is_json(text: &str) -> bool {
    serde_json::from_str::<Value>(text).is_ok()
}

/// As many cells in each line as in the header.
fn is_table(text: &str) -> bool {
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let cells = |line: &str| line.split(',').count();
    let Some(header) = lines.next() else {
        return false;
    };
    header.starts_with("q1_deg")
        && lines.all(|line| line.is_empty() || cells(line) == cells(header))
}

/// What is wrong with the reading of a file; none if it is as it must be. Whether the file was accepted.
fn judged(reader: &Reader, path: &Path) -> Result<bool, String> {
    let start = Instant::now();
    let result = catch_unwind(AssertUnwindSafe(|| (reader.read)(path)));
    let took = start.elapsed();
    if took > LONGEST {
        return Err(format!("takes {took:?}"));
    }
    match result {
        Err(_) => Err("panics".to_owned()),
        Ok(Ok(words)) => {
            let is_none = |word: &str| matches!(word, "NaN" | "inf" | "-inf");
            let mut words = words.split(|character: char| {
                !"+-._".contains(character) && !character.is_alphanumeric()
            });
            match words.find(|word| is_none(word)) {
                Some(word) => Err(format!("is accepted with {word}")),
                None => Ok(true),
            }
        }
        Ok(Err(error)) => {
            let text = error.to_string();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if text.len() > 4000 {
                Err(format!("has an error that nobody reads: {text:?}"))
            } else if text.contains(&*name) || text.contains(".xml") || text.contains(".csv") {
                Ok(false)
            } else {
                Err(format!("has an error that names no file: {text}"))
            }
        }
    }
}

fn number(variable: &str, otherwise: usize) -> usize {
    let asked = std::env::var(variable).ok();
    asked
        .and_then(|text| text.parse().ok())
        .unwrap_or(otherwise)
}

#[test]
fn a_hundred_thousand_broken_texts_are_told_in_words() {
    let total = number("ELASTOCAL_MUTATIONS", 100_000);
    let seed = number("ELASTOCAL_MUTATION_SEED", 1) as u64;
    let readers = readers();
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let mut report = String::new();
    for reader in &readers {
        let count = total * reader.share / 100;
        let (formed, accepted) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let start = Instant::now();
        let failures: Vec<(PathBuf, String)> = (0..count)
            .into_par_iter()
            .filter_map(|index| {
                let mut random = generator(seed, index as u64);
                let seed = &reader.seeds[index % reader.seeds.len()];
                let text = if reader.ending == "json" && index % 3 > 0 {
                    mutated_json(seed, &mut random)
                } else {
                    mutated(seed, &mut random)
                };
                if std::str::from_utf8(&text).is_ok_and(reader.is_well_formed) {
                    formed.fetch_add(1, Ordering::Relaxed);
                }
                let path = folder
                    .path()
                    .join(format!("{}-{index}.{}", reader.name, reader.ending));
                std::fs::write(&path, text).expect("the file can be written");
                match judged(reader, &path) {
                    Ok(was_accepted) => {
                        accepted.fetch_add(usize::from(was_accepted), Ordering::Relaxed);
                        std::fs::remove_file(path).expect("the file can be removed");
                        None
                    }
                    Err(problem) => Some((path, problem)),
                }
            })
            .collect();
        let (formed, accepted) = (formed.into_inner(), accepted.into_inner());
        let _ = writeln!(
            report,
            "{}: {count} texts in {:.1} s, {formed} well formed, {accepted} accepted, {} failures",
            reader.name,
            start.elapsed().as_secs_f64(),
            failures.len()
        );
        let kept = project("target/mutations");
        for (path, problem) in failures.iter().take(20) {
            let copy = kept.join(path.file_name().expect("a name"));
            std::fs::create_dir_all(&kept).expect("a folder can be made");
            std::fs::copy(path, &copy).expect("the file can be copied");
            let _ = writeln!(report, "  {}: {problem}", copy.display());
        }
        assert!(failures.is_empty(), "{report}");
        // Otherwise the parser is tried, and not what comes after it.
        assert!(10 * formed >= 3 * count, "{report}");
    }
    println!("{report}");
}

/// Every case that ever failed.
#[test]
fn the_corpus_is_told_in_words() {
    for reader in readers() {
        let folder = project("tests/corpus").join(reader.name);
        let Ok(files) = std::fs::read_dir(&folder) else {
            continue;
        };
        for file in files {
            let path = file.expect("the entry can be read").path();
            let judged = judged(&reader, &path);
            assert!(judged.is_ok(), "{}: {judged:?}", path.display());
        }
    }
}

/// Models go to MuJoCo, which may end the process that looks at them.
#[test]
fn five_hundred_broken_models_are_told_in_words() {
    let count = number("ELASTOCAL_MUTATIONS", 100_000).div_ceil(200);
    let seed = number("ELASTOCAL_MUTATION_SEED", 1) as u64;
    let seeds: Vec<(String, String)> = ["planar_3r", "spatial_3r", "kr270"]
        .into_iter()
        .map(|name| {
            let model = std::fs::read_to_string(project(&format!("models/{name}.xml")));
            let scenario = scenario_text(name);
            let folder = project("models");
            let scenario =
                scenario.replace(&format!("{}/{name}.xml", folder.display()), "model.xml");
            assert!(scenario.contains("\"model.xml\""));
            (model.expect("can be read"), scenario)
        })
        .collect();
    let accepted = AtomicUsize::new(0);
    let parsed = AtomicUsize::new(0);
    let failures: Vec<String> = (0..count)
        .into_par_iter()
        .filter_map(|index| {
            let (model, scenario) = &seeds[index % seeds.len()];
            let place = Workplace::new();
            let mut random = generator(seed, 1 << 40 | index as u64);
            let model = if index % 4 == 0 {
                mutated(model, &mut random)
            } else {
                mutated_xml(model, &mut random)
            };
            place.write("model.xml", &model);
            place.write("s.toml", scenario);
            let outcome = place.run("check s.toml --quiet");
            let is_told = match outcome.code {
                Some(0 | 3) => !outcome.stdout.is_empty() && !outcome.stdout.contains("NaN"),
                Some(1) => outcome.stdout.is_empty() && outcome.stderr.starts_with("error: "),
                _ => false,
            };
            accepted.fetch_add(usize::from(outcome.code == Some(0)), Ordering::Relaxed);
            let is_parsed = !outcome.stderr.contains("XML");
            parsed.fetch_add(usize::from(is_parsed), Ordering::Relaxed);
            (!is_told || outcome.stderr.contains("panicked")).then(|| {
                let kept = project("target/mutations");
                std::fs::create_dir_all(&kept).expect("a folder can be made");
                let copy = kept.join(format!("model-{index}.xml"));
                std::fs::write(&copy, model).expect("the file can be written");
                format!(
                    "{}: {:?} {:.300}",
                    copy.display(),
                    outcome.code,
                    outcome.stderr
                )
            })
        })
        .collect();
    assert!(failures.is_empty(), "{failures:#?}");
    let (parsed, accepted) = (parsed.into_inner(), accepted.into_inner());
    println!("models: {count}, {parsed} beyond MuJoCo's parser, {accepted} accepted");
    // Otherwise only MuJoCo's parser is tried.
    assert!(10 * parsed > 3 * count, "{parsed} of {count}");
}
