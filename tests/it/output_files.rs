//! Where results go. What is no regular file is written into; links, modes and the umask are kept;
//! no output overwrites an input.

use std::os::unix::fs::MetadataExt;
use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
use std::process::Command;

use crate::recordings::rerun;
use crate::support::{Workplace, project, scenario_text};

/// A scenario, a plan and its measurements.
fn workplace() -> Workplace {
    let workplace = Workplace::with("s.toml", scenario_text("klimchik2012"));
    let plan = project("scenarios/plans/klimchik2012_m3.csv");
    std::fs::copy(plan, workplace.path("plan.csv")).expect("can be copied");
    workplace.done("measure s.toml --plan plan.csv --measurements-out m.csv");
    workplace
}

/// Writes what was identified, quickly.
const IDENTIFY: &str = "identify s.toml --quiet --measurements m.csv --identified-out";
/// A small part of a study.
const SHARD: &str = "study p.toml --quiet --trials 64 --shard 1/1 --tally-out";

/// A study of one plan that is in a file.
fn write_small_study(workplace: &Workplace) {
    let text = scenario_text("klimchik2012");
    let plans = text.find("[[study.plan]]").expect("is there");
    let plan = "[[study.plan]]\nname = \"paper\"\nkind = \"file\"\nfile = \"plan.csv\"\n";
    workplace.write("p.toml", format!("{}{plan}", &text[..plans]));
}

fn mode(workplace: &Workplace, name: &str) -> u32 {
    let found = workplace.path(name).metadata().expect("is there");
    found.permissions().mode() & 0o7777
}

/// Whether a tool made a special file; says so where it could not.
fn is_made(workplace: &Workplace, tool: &str, arguments: &[&str]) -> bool {
    let made = Command::new(tool)
        .args(arguments)
        .current_dir(workplace.path(""))
        .output()
        .is_ok_and(|output| output.status.success());
    if !made {
        eprintln!("skipped: {tool} {arguments:?} does not work here");
    }
    made
}

/// Every writer writes into a device, which stays one.
#[test]
fn a_device_stays_a_device() {
    let workplace = workplace();
    write_small_study(&workplace);
    if !is_made(&workplace, "mknod", &["null", "c", "1", "3"]) {
        return;
    }
    for arguments in [
        format!("{IDENTIFY} null"),
        "measure s.toml --quiet --plan plan.csv --measurements-out null".to_owned(),
        // One device may take several outputs.
        format!("{SHARD} null --rerun save=null"),
    ] {
        workplace.done(&arguments);
        let found = workplace.path("null").metadata().expect("is there");
        assert!(found.file_type().is_char_device(), "{arguments}");
    }
    if is_made(&workplace, "mknod", &["full", "c", "1", "7"]) {
        let outcome = workplace.refused(&format!("{IDENTIFY} full"));
        outcome.says("No space left");
    }
}

#[test]
fn stdout_is_written_into() {
    let workplace = workplace();
    workplace.done(&format!("{IDENTIFY} i.json"));
    let identified = workplace.read("i.json");
    let outcome = workplace.run(&format!("{IDENTIFY} /dev/stdout"));
    assert!(outcome.stdout.starts_with(&identified), "{outcome:#?}");
    // Where it is a regular file, results follow what was written.
    let script = format!("elastocal {IDENTIFY} /dev/stdout --json > both");
    workplace.shell(&script).ends_with(0);
    assert_eq!(workplace.read("both"), identified.repeat(2));
}

#[test]
fn a_fifo_is_written_into() {
    let workplace = workplace();
    write_small_study(&workplace);
    if !is_made(&workplace, "mkfifo", &["fifo"]) {
        return;
    }
    workplace.done(&format!("{IDENTIFY} i.json"));
    workplace.done(&format!("{SHARD} t --rerun save=s.rrd"));
    for (arguments, name) in [
        (format!("{IDENTIFY} fifo"), "i.json"),
        (format!("{SHARD} t --rerun save=fifo"), "s.rrd"),
    ] {
        let fifo = workplace.path("fifo");
        let reader = std::thread::spawn(move || std::fs::read(fifo).expect("can be read"));
        workplace.done(&arguments);
        // Nobody would ever write to a FIFO that was replaced.
        let found = workplace.path("fifo").metadata().expect("is there");
        assert!(found.file_type().is_fifo(), "{arguments}");
        let read = reader.join().expect("the reader ends");
        if name == "i.json" {
            assert_eq!(read.len(), workplace.read(name).len(), "{arguments}");
        } else {
            // Each recording has its own number, and numbers of rows.
            workplace.write("read.rrd", read);
            let whole = workplace.path(name).display().to_string();
            let read = workplace.path("read.rrd");
            rerun(&["rrd", "compare", "--unordered", &whole], &read);
        }
    }
}

#[test]
fn the_umask_and_a_mode_are_kept() {
    let workplace = workplace();
    for (umask, expected) in [("077", 0o600), ("027", 0o640), ("002", 0o664)] {
        let script = format!("umask {umask}; elastocal {IDENTIFY} {umask}.json");
        workplace.shell(&script).ends_with(0);
        assert_eq!(mode(&workplace, &format!("{umask}.json")), expected);
    }
    workplace.write("i.json", "before");
    let private = std::fs::Permissions::from_mode(0o640);
    std::fs::set_permissions(workplace.path("i.json"), private).expect("can be set");
    workplace.done(&format!("{IDENTIFY} i.json"));
    assert_eq!(mode(&workplace, "i.json"), 0o640);
    assert!(workplace.read("i.json").contains("elastocal.identify"));
}

#[test]
fn links_are_followed() {
    let workplace = workplace();
    std::fs::create_dir(workplace.path("folder")).expect("can be made");
    workplace.write("folder/there", "before");
    for (link, target) in [
        ("one", "folder/there"),
        ("two", "folder/made"),
        ("three", "two"),
    ] {
        symlink(target, workplace.path(link)).expect("can be made");
        workplace.done(&format!("{IDENTIFY} {link}"));
        assert!(workplace.path(link).is_symlink(), "{link} is replaced");
    }
    for name in ["folder/there", "folder/made"] {
        assert!(workplace.read(name).contains("elastocal.identify"));
    }
    let listing = workplace.listing();
    assert!(!listing.iter().any(|name| name.contains(".tmp")));
    symlink("round", workplace.path("round")).expect("can be made");
    workplace.refused(&format!("{IDENTIFY} round"));
}

/// Also to the superuser, who might write it.
#[test]
fn a_read_only_file_is_not_overwritten() {
    let workplace = workplace();
    workplace.write("i.json", "before");
    let read_only = std::fs::Permissions::from_mode(0o444);
    std::fs::set_permissions(workplace.path("i.json"), read_only).expect("can be set");
    let outcome = workplace.refused(&format!("{IDENTIFY} i.json"));
    outcome.says("is read-only");
    outcome.says("hint: give another file");
    assert_eq!(workplace.read("i.json"), "before");
}

/// A limit on the size of files is an error of writing, and leaves nothing unfinished.
#[test]
fn a_limit_on_the_size_of_files_leaves_nothing() {
    let workplace = workplace();
    let before = workplace.listing();
    let outcome = workplace.shell(&format!("ulimit -f 1; elastocal {IDENTIFY} i.json"));
    let outcome = outcome.ends_with(1);
    outcome.says("File too large");
    assert_eq!(workplace.listing(), before);
}

/// Each output that would overwrite an input or another output is refused before any work.
#[test]
fn no_output_overwrites_an_input() {
    let workplace = workplace();
    write_small_study(&workplace);
    let included = "<mujoco><include file=\"arm.xml\"/></mujoco>";
    let model = project("models/kr270.xml");
    std::fs::copy(&model, workplace.path("arm.xml")).expect("can be copied");
    workplace.write("model.xml", included);
    let text = scenario_text("klimchik2012").replace(&*model.to_string_lossy(), "model.xml");
    workplace.write("own.toml", text);
    std::fs::create_dir_all(workplace.path("out/p")).expect("can be made");
    std::fs::copy(workplace.path("plan.csv"), workplace.path("out/p/plan.csv")).expect("copied");
    workplace.write("out/p/p.toml", workplace.read("p.toml"));
    symlink("m.csv", workplace.path("link")).expect("can be made");
    std::fs::hard_link(workplace.path("m.csv"), workplace.path("hard")).expect("can be made");
    workplace.done(&format!("{SHARD} tally"));
    std::fs::create_dir_all(workplace.path("merged/p")).expect("can be made");
    std::fs::rename(
        workplace.path("tally"),
        workplace.path("merged/p/study.csv"),
    )
    .expect("moved");
    let results = workplace.run("evaluate s.toml --plan plan.csv --json --quiet");
    workplace.write("base.json", &results.stdout);
    workplace.write("new.json", &results.stdout);

    let measure = "measure s.toml --plan plan.csv --measurements-out";
    let cases = [
        ("plan s.toml --plan-out s.toml", "is the scenario"),
        ("plan s.toml --plan-out ./../WORK/s.toml", "is the scenario"),
        (
            "plan own.toml --plan-out model.xml",
            "is a file of the scenario",
        ),
        (
            "plan own.toml --stills-out arm.xml",
            "is a file of the scenario",
        ),
        (
            "budget own.toml --plot-out arm.xml",
            "is a file of the scenario",
        ),
        (
            "plan s.toml --plan-out a --stills-out ./a",
            "is the file for --plan-out (a) and for --stills-out",
        ),
        (&format!("{measure} plan.csv"), "is the plan"),
        (&format!("{IDENTIFY} m.csv"), "is the measurements"),
        (&format!("{IDENTIFY} link"), "is the measurements (m.csv)"),
        (&format!("{IDENTIFY} hard"), "is the measurements (m.csv)"),
        (
            "compare base.json new.json --markdown base.json",
            "is the base",
        ),
        (
            "compare base.json new.json --markdown new.json",
            "is the results to judge",
        ),
        (
            "study p.toml --resume t --tally-out t",
            "is the file for --resume and for --tally-out",
        ),
        ("study p.toml --resume p.toml", "is the scenario"),
        (
            "study p.toml --rerun save=plan.csv",
            "is a file of the scenario",
        ),
        (
            "study p.toml --rerun save=out/p/study.rrd",
            "is the file for the results and for --rerun",
        ),
        (
            "study p.toml --resume new/p --out new",
            "and the folder for the results",
        ),
        (
            "run out/p/p.toml --out out",
            "is a file of the scenario, which the results",
        ),
        ("merge merged/p/study.csv --out merged", "is a tally"),
    ];
    let before = contents(&workplace);
    let own = workplace.path("");
    let own = own
        .file_name()
        .expect("a name")
        .to_string_lossy()
        .into_owned();
    for (arguments, says) in cases {
        let outcome = workplace.run(&arguments.replace("WORK", &own));
        assert_eq!(outcome.code, Some(1), "{outcome:#?}");
        outcome.says(says);
        assert!(!outcome.stderr.contains("designing"), "{outcome:#?}");
        assert_eq!(contents(&workplace), before, "{arguments}");
    }
}

/// The names of all files with number, size and time of change.
fn contents(workplace: &Workplace) -> Vec<(String, u64, u64, i64)> {
    let about = |name: String| {
        let found = workplace.path(&name).symlink_metadata().expect("is there");
        let is_folder = found.is_dir();
        let changed = if is_folder { 0 } else { found.mtime_nsec() };
        (
            name,
            found.ino(),
            if is_folder { 0 } else { found.len() },
            changed,
        )
    };
    workplace.listing().into_iter().map(about).collect()
}
