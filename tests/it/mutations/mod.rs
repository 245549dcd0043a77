//! Broken inputs by the hundred thousand: every reader either gives finite numbers or one error that names
//! the file and the place.
//!
//! Texts are read in this process. Models go to the program, which looks at them in a process of their own.
//! `ELASTOCAL_MUTATIONS` and `ELASTOCAL_MUTATION_SEED` ask for another number of inputs and for others; what
//! ever failed belongs in `tests/corpus`, in the folder of its reader.

mod mutate;
mod proofs;

use std::fmt::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use elastocal::comparison::results::ResultsFile;
use elastocal::compensation::read_targets;
use elastocal::experiment::read_candidates;
use elastocal::files::{FileError, read_text};
use elastocal::identification::{IdentifiedFile, IdentifiedRecord};
use elastocal::laboratory::{Dialect, DialectError, Program, ProgramStep};
use elastocal::measurement::foreign::import;
use elastocal::measurement::{
    AbsoluteReading, absolute_table, read_measured, read_measured_so_far, read_measurements,
};
use elastocal::numeric::random::generator;
use elastocal::plan::read_plan;
use elastocal::record::tally_file::TallyFile;
use elastocal::scenario::Scenario;
use elastocal::workflow::calibrated::CalibratedRobot;
use nalgebra::DVector;
use rayon::prelude::*;
use serde_json::Value;

use self::mutate::{mutated, mutated_json, mutated_xml};
use crate::foreign_tables::{MAPPING, TABLE};
use crate::support::{Workplace, error_message, project, scenario_text, shipped};

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

/// A workplace with a file for each reader.
fn prepared() -> Workplace {
    let place = Workplace::with("s.toml", scenario_text("klimchik2012"));
    let plan = shipped("scenarios/plans/klimchik2012_m3.csv");
    place.done(&format!(
        "measure s.toml --plan {plan} --measurements-out m.csv"
    ));
    let with_rotations =
        scenario_text("kr270").replace("tracker_site", "rotation_sigma_mrad = 0.1\ntracker_site");
    place.write("r.toml", with_rotations);
    place.done(&format!(
        "measure r.toml --plan {plan} --measurements-out r.csv"
    ));
    place.done("identify --quiet --measurements m.csv --identified-out i.json");
    place.write("u.toml", scenario_text("kr270_laboratory"));
    place.run("identify u.toml --quiet --measurements m.csv --identified-out u.json");
    place.done("study s.toml --level model --trials 500 --shard 1/2 --tally-out t.json --quiet");
    place
}

fn file(path: &str) -> String {
    std::fs::read_to_string(project(path)).expect("can be read")
}

fn readers() -> Vec<Reader> {
    let place = prepared();
    vec![
        scenario_reader(),
        plan_reader(),
        candidates_reader(),
        measurements_reader(&place),
        tally_reader(&place),
        results_reader(&place),
        identification_reader(&place),
        dialect_reader(),
        mapping_reader(),
        foreign_reader(),
        targets_reader(),
    ]
}

fn scenario_reader() -> Reader {
    Reader {
        name: "scenario",
        ending: "toml",
        share: 5,
        read: |path| {
            let scenario = Scenario::load(path)?;
            Ok(format!(
                "{:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?}",
                scenario.task.test_poses,
                scenario.task.loads,
                (scenario.task.region, scenario.task.belief.stations),
                scenario.task.belief.instrument,
                scenario.study,
                scenario.laboratory,
                scenario.task.belief.uncertain.set(),
                scenario.task.belief.nominal.compliance_rad_per_nm,
                scenario.truth.robot.torque_laws
            ))
        },
        is_well_formed: |text| text.parse::<toml::Table>().is_ok(),
        seeds: [
            "klimchik2012",
            "klimchik2012_joint1",
            "kr270",
            "kr270_all_joints",
            "kr270_compensator",
            "kr270_flexible",
            "kr270_laboratory",
            "kr270_unknown_compensator",
            "planar_3r",
            "spatial_3r",
        ]
        .map(scenario_text)
        .into_iter()
        .chain([
            scenario_text("kr270") + LABORATORY,
            scenario_text("planar_3r") + LABORATORY,
            scenario_text("klimchik2012"),
            scenario_text("klimchik2012") + TORQUE_LAWS,
            scenario_text("klimchik2012") + BACKLASH,
            scenario_text("ur10").replace("[design]", "[design]\naccuracy = \"absolute\"")
                + STATIONS,
        ])
        .collect(),
    }
}

fn plan_reader() -> Reader {
    Reader {
        name: "plan",
        ending: "csv",
        share: 28,
        read: |path| read_plan(path, 6).map(|plan| format!("{plan:?}")),
        is_well_formed: is_table,
        seeds: vec![
            file("scenarios/plans/klimchik2012_m3.csv"),
            file("scenarios/plans/klimchik2012_m12.csv"),
            file("scenarios/plans/kr270_all_joints.csv"),
            "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats,approach\n\
             0,-60,90,10,-40,20,0,0,-2500,0,0,0,1,+-++-+\n1,-60,90,10,-40,20,0,0,-2500,0,0,0,2,-\n"
                .to_owned(),
        ],
    }
}

fn candidates_reader() -> Reader {
    let with = |columns: &str, values: &str| {
        format!(
            "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg{columns}\n0,-60,90,10,-40,20{values}\n10,-50,80,0,-30,0{values}\n"
        )
    };
    Reader {
        name: "candidates",
        ending: "csv",
        share: 4,
        read: |path| read_candidates(path, 6).map(|all| format!("{all:?}")),
        is_well_formed: is_table,
        seeds: vec![
            with("", ""),
            with(
                ",fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats",
                ",0,0,-2500,0,0,0,2",
            ),
            with(",target,station,approach", ",reflector,door,-"),
        ],
    }
}

fn measurements_reader(place: &Workplace) -> Reader {
    Reader {
        name: "measurements",
        ending: "csv",
        share: 38,
        read: |path| {
            // What is not filled in yet is another way to read it.
            let _ = read_measured_so_far(path, 6);
            let _ = read_measurements(path, 6);
            read_measured(path, 6).map(|all| format!("{all:?}"))
        },
        is_well_formed: is_table,
        seeds: vec![
            place.read("m.csv"),
            place.read("r.csv"),
            of_positions(&place.read("m.csv")),
            of_positions(&place.read("r.csv")),
            absolute(false),
            absolute(true),
            "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,dx_mm,dy_mm,dz_mm,approach\n\
             0,-60,90,10,-40,20,0,0,-2500,0,0,0,1,2,-3,+-++-+\n1,-60,90,10,-40,20,0,0,-2500,0,0,0,1,0,-4,\n"
                .to_owned(),
        ],
    }
}

fn tally_reader(place: &Workplace) -> Reader {
    Reader {
        name: "tally",
        ending: "json",
        share: 4,
        read: |path| TallyFile::read(path).map(|tally| format!("{:?}", tally.header)),
        is_well_formed: is_json,
        seeds: vec![place.read("t.json")],
    }
}

fn results_reader(place: &Workplace) -> Reader {
    let plan = shipped("scenarios/plans/klimchik2012_m3.csv");
    let evaluated = place
        .run(&format!("evaluate s.toml --plan {plan} --json --quiet"))
        .stdout;
    let planned = place
        .run("plan s.toml --json --quiet --experiments 3")
        .stdout;
    let studied = place
        .run("study s.toml --level model --trials 500 --json --quiet")
        .stdout;
    Reader {
        name: "results",
        ending: "json",
        share: 4,
        read: |path| ResultsFile::read(path).map(|_| String::new()),
        is_well_formed: is_json,
        seeds: vec![evaluated, planned, studied],
    }
}

fn identification_reader(place: &Workplace) -> Reader {
    Reader {
        name: "identification",
        ending: "json",
        share: 3,
        read: |path| {
            let file = IdentifiedFile::read(path)?;
            if let IdentifiedRecord::Readings(robot) = &file.record {
                let robot = CalibratedRobot::of_absolute(&UR10.task.belief, robot)?;
                return Ok(format!(
                    "{:?} {:?} {:?}",
                    robot.arm, robot.stations, robot.covariance
                ));
            }
            let stored = file.known(&KR270.task.belief.nominal)?;
            Ok(format!("{stored:?}"))
        },
        is_well_formed: is_json,
        seeds: vec![
            place.read("i.json"),
            place.read("u.json"),
            robot_of_readings(),
        ],
    }
}

fn dialect_reader() -> Reader {
    Reader {
        name: "dialect",
        ending: "toml",
        share: 4,
        read: |path| {
            let wrong = |error: DialectError| FileError::new(path, error.to_string());
            let dialect = Dialect::read(&read_text(path)?).map_err(wrong)?;
            let commands = KR270.task.belief.commands();
            let move_to = DVector::from_element(6, 0.1);
            let program = Program {
                title: "a title".to_owned(),
                steps: vec![ProgramStep::Move(move_to), ProgramStep::Log],
            };
            // What the texts say is nobody's business here: a word like NaN may stand in them.
            (program.files(&dialect, &KR270.laboratory, &commands, "name"))
                .map(|_| String::new())
                .map_err(wrong)
        },
        is_well_formed: |text| text.parse::<toml::Table>().is_ok(),
        seeds: ["krl", "urscript"]
            .map(|name| file(&format!("src/laboratory/dialects/{name}.toml")))
            .into(),
    }
}

/// What absolute readings tell of a robot.
fn robot_of_readings() -> String {
    let place = crate::one_fit::workplace(&crate::one_fit::plain(30, true));
    place
        .run("identify s.toml --quiet --measurements m.csv --parameters zeros --json")
        .stdout
}

/// The robot that absolute readings are of.
static UR10: LazyLock<Scenario> = LazyLock::new(|| crate::support::scenario("ur10"));

/// A foreign table and its mapping.
static FOREIGN: LazyLock<Workplace> = LazyLock::new(|| {
    let place = Workplace::with("table.csv", TABLE);
    place.write("mapping.toml", MAPPING);
    place
});

fn mapping_reader() -> Reader {
    Reader {
        name: "mapping",
        ending: "toml",
        share: 4,
        read: |path| import(&FOREIGN.path("table.csv"), path).map(|imported| imported.text),
        is_well_formed: |text| text.parse::<toml::Table>().is_ok(),
        seeds: vec![MAPPING.to_owned()],
    }
}

fn foreign_reader() -> Reader {
    Reader {
        name: "foreign",
        ending: "csv",
        share: 4,
        read: |path| import(path, &FOREIGN.path("mapping.toml")).map(|imported| imported.text),
        is_well_formed: |text| is_even(text, ';'),
        seeds: vec![TABLE.to_owned()],
    }
}

/// Whether all lines have as many fields.
fn is_even(text: &str, sign: char) -> bool {
    let signs = |line: &str| line.matches(sign).count();
    let mut lines = text.lines().filter(|line| !line.trim().is_empty());
    let first = lines.next().map_or(0, signs);
    first > 0 && lines.all(|line| signs(line) == first)
}

fn targets_reader() -> Reader {
    Reader {
        name: "targets",
        ending: "csv",
        share: 2,
        read: |path| read_targets(path).map(|rows| format!("{rows:?}")),
        is_well_formed: |text| is_even(text, ','),
        seeds: vec![
            "x_mm,y_mm,z_mm\n1500,100,1200\n1500,-150.5,1200\n".to_owned(),
            "x_mm,y_mm,z_mm,qw,qx,qy,qz,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm\n1,2,3,1,0,0,0,0,0,-98,0,0,1\n5,6,7,0.6,0,0.8,0,1,2,3,4,5,6\n"
                .to_owned(),
        ],
    }
}

/// The robot that identifications and programs are for.
static KR270: LazyLock<Scenario> = LazyLock::new(|| crate::support::scenario("kr270"));

const STATIONS: &str = r#"
[[station]]
name = "door"
position_mm = [2600, 300, 1200]
range_min_mm = 1000
range_max_mm = 15000
incidence_max_deg = 30

[[station]]
name = "wall"
position_mm = [-500, -4000, 1500.5]

[[uncertainty]]
kind = "tracker_range"
std_um_per_m = 3
along_um_per_m = 0.15
"#;

const BACKLASH: &str = r#"
[[uncertainty]]
kind = "backlash"
joints = ["joint_1", "joint_2"]
std_arcsec = 15
turned_over_at_nm = 100

[[uncertainty]]
kind = "transmission_error"
name = "gear_waves"
joints = ["joint_2", "joint_3"]
std_mrad = 0.05
harmonics = [1, 2, 40]

[[uncertainty]]
kind = "transmission_error"
name = "error_functions"
joints = ["joint_2"]
std_mrad = 0.05
correlation_deg = 8

[[uncertainty]]
kind = "stiffening"
joints = ["joint_2", "joint_3"]
std_relative = 0.01
at_nm = 8000

[[uncertainty]]
kind = "joint_repeatability"
rp_mm = 0.06
q_deg = [30, -90, 100, 0, 30, 0]
site = "machining_tcp"

[[uncertainty]]
kind = "load_scale"
mpe_relative = 0.002
distribution = "uniform"
level = "instrument"

[[uncertainty]]
kind = "load_offset"
mpe_n = 6
coverage_factor = 2
level = "instrument"
"#;

const TORQUE_LAWS: &str = r#"
[[true_robot.torque_law]]
joints = ["joint_2"]
stiffens_at_mrad = 20

[[true_robot.torque_law]]
joints = ["joint_4", "joint_5"]
softens_at_mrad = 30
"#;

/// A table that no scenario of the project has.
const LABORATORY: &str = "\n[laboratory]\nstation_min = 20\nmove_min = 5\nload_change_min = 15\nreading_min = 0.5\n\
                          axis_speed_deg_s = 12\napproach_deg = 3\nspeed_percent = 20\ntool_number = 3\nbase_number = 2\n\
                          dialect = \"urscript\"\nsafe_deg = []\n";

/// The same measurements with positions in place of deflections, and which readings these are.
fn of_positions(measurements: &str) -> String {
    let mut row = 0;
    let lines = measurements.lines().map(|line| {
        let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
        if fields.len() < 15 {
            return line.to_owned();
        }
        let words = |names: &str| -> Vec<String> { names.split(',').map(str::to_owned).collect() };
        let (positions, places) = if line.starts_with('q') {
            let columns =
                "unloaded_x_mm,unloaded_y_mm,unloaded_z_mm,loaded_x_mm,loaded_y_mm,loaded_z_mm";
            let places = "unloaded_stop,unloaded_reading,loaded_stop,loaded_reading";
            (words(columns), words(places))
        } else {
            row += 1;
            let loaded = fields[12..15].join(",");
            (
                words(&format!("0,0,0,{loaded}")),
                words(&format!("{row},1,{},1", row + 3)),
            )
        };
        fields.splice(12..15, positions);
        fields.extend(places);
        fields.join(",")
    });
    lines.map(|line| line + "\n").collect::<Vec<_>>().concat()
}

/// Absolute readings with everything that a file of them may have: positions with deviations, or poses with a covariance.
fn absolute(is_pose: bool) -> String {
    let mut random = generator(3, 0);
    let readings: Vec<AbsoluteReading> = (0..6)
        .map(|row| crate::absolute_readings::reading(&mut random, row, is_pose))
        .collect();
    absolute_table(&6.into(), &readings)
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

/// A text without what stands in it between quotation marks: names may be any words.
fn outside_quotes(text: &str) -> String {
    let (mut is_quoted, mut is_escaped) = (false, false);
    let mut outside = String::with_capacity(text.len());
    for character in text.chars() {
        if character == '"' && !is_escaped {
            is_quoted = !is_quoted;
        } else if !is_quoted {
            outside.push(character);
        }
        is_escaped = is_quoted && character == '\\' && !is_escaped;
    }
    outside
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
            let words = outside_quotes(&words);
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
    let mut report = String::from(
        "| reader | texts | well formed | accepted | refused in words | failures | s |\n|---|---|---|---|---|---|---|\n",
    );
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
        let refused = count - accepted - failures.len();
        let _ = writeln!(
            report,
            "| {} | {count} | {formed} ({:.0} %) | {accepted} | {refused} | {} | {:.1} |",
            reader.name,
            100.0 * formed as f64 / count.max(1) as f64,
            failures.len(),
            start.elapsed().as_secs_f64()
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
            let folder = shipped("models");
            let scenario = scenario.replace(&format!("{folder}/{name}.xml"), "model.xml");
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
                Some(1) => outcome.stdout.is_empty() && error_message(&outcome.stderr).is_some(),
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
    println!(
        "| reader | models | beyond MuJoCo's parser | accepted | failures |\n|---|---|---|---|---|\n\
         | model | {count} | {parsed} ({:.0} %) | {accepted} | 0 |",
        100.0 * parsed as f64 / count as f64
    );
    // Otherwise only MuJoCo's parser is tried.
    assert!(10 * parsed > 3 * count, "{parsed} of {count}");
}
