//! Sizes, and files without an end: each is named in an error, and nothing hangs.

use std::time::{Duration, Instant};

use crate::bad_input::{MEASUREMENTS, PLAN, assert_none, complaints};
use crate::support::{Workplace, project, scenario_text};

/// Devices, sockets and named pipes, at each place where a file is read.
#[test]
fn files_without_an_end() {
    let workplace = Workplace::with("good.toml", scenario_text("klimchik2012"));
    let model = project("models/kr270.xml");
    for (name, file) in [("m_zero", "/dev/zero"), ("m_fifo", "fifo")] {
        let text = scenario_text("klimchik2012").replace(&*model.to_string_lossy(), file);
        workplace.write(&format!("{name}.toml"), text);
    }
    let made = std::process::Command::new("mkfifo")
        .arg(workplace.path("fifo"))
        .status();
    assert!(made.expect("mkfifo starts").success());
    let _socket =
        std::os::unix::net::UnixListener::bind(workplace.path("socket")).expect("can be made");
    let mut wrong = Vec::new();
    for (file, says) in [
        ("/dev/zero", "is a device"),
        ("/dev/random", "is a device"),
        ("socket", "is a socket"),
    ] {
        for command in [
            format!("check {file}"),
            format!("evaluate good.toml --plan {file}"),
            format!("identify good.toml --measurements {file}"),
            format!("compensate good.toml --identified {file}"),
            format!("merge {file}"),
        ] {
            wrong.extend(complaints(&workplace, &command, &[file, says], None));
        }
    }
    let start = Instant::now();
    let says = ["robot.model", "/dev/zero", "is a device"];
    wrong.extend(complaints(&workplace, "check m_zero.toml", &says, None));
    for command in [
        "check fifo",
        "check m_fifo.toml",
        "check good.toml --plan fifo",
    ] {
        let says = ["fifo: is a pipe"];
        wrong.extend(complaints(&workplace, command, &says, None));
    }
    assert!(start.elapsed() < Duration::from_secs(30));
    assert_none(&wrong);
}

/// A pipe with something in it is a file like another.
#[test]
fn pipes_are_read() {
    let workplace = Workplace::with("good.toml", scenario_text("klimchik2012"));
    workplace.write("plan.csv", PLAN);
    let program = env!("CARGO_BIN_EXE_elastocal");
    let script = format!("(sleep 0.1; cat plan.csv) | {program} check good.toml --plan /dev/stdin");
    let output = std::process::Command::new("sh")
        .args(["-c", &script])
        .current_dir(workplace.path(""))
        .output()
        .expect("the shell starts");
    // It has violations.
    assert_eq!(output.status.code(), Some(3), "{output:?}");
}

#[rustfmt::skip]
const SCENARIO_EDITS: &[(&str, &str, &[&str])] = &[
    ("experiments = 3", "experiments = 1000000", &["design.experiments", "found 1000000; at most 10000"]),
    ("[study]", "[study]\ntrials = 10000000000000", &["study.trials", "found 10000000000000", "1000000000000"]),
    ("[study]", "[study]\nexperiments = 1000000", &["study.experiments", "found 1000000", "to 10000"]),
];

/// The paper's scenario with an empty study at its end.
fn without_study() -> String {
    let text = scenario_text("klimchik2012");
    let study = text.find("[study]").expect("is there");
    format!("{}[study]\n", &text[..study])
}

#[test]
fn sizes() {
    let workplace = Workplace::with("good.toml", scenario_text("klimchik2012"));
    let mut wrong = Vec::new();
    let check = |text: String, says: &[&str]| {
        workplace.write("bad.toml", text);
        complaints(&workplace, "check bad.toml", says, None)
    };
    for (from, to, says) in SCENARIO_EDITS {
        let text = without_study();
        assert!(text.contains(from), "{from:?}");
        wrong.extend(check(text.replacen(from, to, 1), says));
    }
    let good = scenario_text("klimchik2012");
    let obstacle = |index: usize| {
        format!(
            "[[obstacle]]\nname = \"{index}\"\nkind = \"sphere\"\nradius_mm = 1\nposition_mm = [{index}, 0, 9000]\n"
        )
    };
    let obstacles: String = (0..2000).map(obstacle).collect();
    let cluttered = good.replace(
        "[design]",
        &format!("collision_clearance_mm = 1\n{obstacles}[design]"),
    );
    wrong.extend(check(cluttered, &["obstacle", "found 2000; at most 500"]));
    let pose =
        "[[test_pose]]\nq_deg = [0, -56.9, 89.3, 45.1, 76, 57.2]\nforce_n = [0, 280, -180]\n";
    let posed = good.replace("[load]", &format!("{}[load]", pose.repeat(1001)));
    wrong.extend(check(posed, &["test_pose", "found 1002; at most 1000"]));
    let values: Vec<String> = (1..=2000).map(|value| value.to_string()).collect();
    let values = values.join(",");
    let swept = without_study()
        + &format!("[study.sweep]\nsigma_mm = [{values}]\nload_scale = [{values}]\n");
    wrong.extend(check(
        swept,
        &["study.sweep", "found 4000000; at most 1000"],
    ));

    workplace.write("plan.csv", PLAN.replace(",0,2\n", ",0,1000000\n"));
    let says = [
        "plan.csv: repeats",
        "found 1000001 measurements",
        "at most 1000000",
    ];
    let command = "evaluate good.toml --plan plan.csv";
    wrong.extend(complaints(&workplace, command, &says, None));
    let file = std::fs::File::create(workplace.path("large.csv")).expect("can be made");
    file.set_len(1 << 30).expect("can be long");
    let says = ["large.csv: is too large: at most 256 MiB are allowed"];
    let command = "evaluate good.toml --plan large.csv";
    wrong.extend(complaints(&workplace, command, &says, None));
    assert_none(&wrong);
}

/// As many obstacles as are allowed do not overflow anything.
#[test]
fn many_obstacles() {
    let workplace = Workplace::with("plan.csv", PLAN);
    let obstacles: Vec<String> = (0..500)
        .map(|index| {
            let (x, y) = (4000 + 100 * (index % 25), 100 * (index / 25));
            format!("[[obstacle]]\nname = \"{index}\"\nkind = \"box\"\nsize_mm = [200, 200, 200]\nposition_mm = [{x}, {y}, 1000]\n")
        })
        .collect();
    let text = scenario_text("klimchik2012").replace(
        "[design]",
        &format!(
            "collision_clearance_mm = 200\n{}[design]",
            obstacles.concat()
        ),
    );
    workplace.write("s.toml", text);
    let outcome = workplace.run("check s.toml --plan plan.csv");
    assert!(matches!(outcome.code, Some(0 | 3)), "{outcome:#?}");
}

/// More threads than help cost nothing.
#[test]
fn threads() {
    let workplace = Workplace::with("good.toml", scenario_text("klimchik2012"));
    workplace.write("m.csv", MEASUREMENTS);
    let start = Instant::now();
    let plan = |threads: u32| {
        let arguments = format!(
            "plan good.toml --experiments 2 --quiet --plan-out {threads}.csv --threads {threads}"
        );
        workplace.done(&arguments);
        workplace.read(&format!("{threads}.csv"))
    };
    assert_eq!(plan(1), plan(65535));
    assert!(start.elapsed() < Duration::from_mins(1));
}

/// Options out of range are wrong usage.
#[test]
fn options() {
    let workplace = Workplace::with("good.toml", scenario_text("klimchik2012"));
    for (arguments, says) in [
        (
            "budget good.toml --accuracy-um nan",
            "found NaN; a positive number",
        ),
        ("budget good.toml --accuracy-um -5", "unexpected argument"),
        (
            "budget good.toml --accuracy-um=-5",
            "found -5; a positive number",
        ),
        (
            "budget good.toml --accuracy-um 1e308",
            "found 1e308; a positive number",
        ),
        (
            "plan good.toml --experiments 1000000",
            "1000000 is not in 1..=10000",
        ),
        (
            "study good.toml --trials 0",
            "0 is not in 1..=1000000000000",
        ),
        (
            "study good.toml --shard 1/10000000 --tally-out t",
            "is the first part of four",
        ),
    ] {
        workplace.misused(arguments).says(says);
    }
}

/// A model that works, with something put into its world.
fn model(inside: &str) -> String {
    crate::bad_input::MODEL.replace("<worldbody>", &format!("{inside}<worldbody>"))
}

/// Models that end MuJoCo's process, or take all memory and time.
#[test]
fn models_that_break_mujoco() {
    let workplace = Workplace::with("s.toml", crate::bad_input::MODEL_SCENARIO);
    let start = Instant::now();
    let mut wrong = Vec::new();
    for (inside, says) in [
        (
            "<asset><texture name=\"t\" type=\"2d\" builtin=\"flat\" width=\"60000\" height=\"60000\"/></asset>",
            "MuJoCo refuses the model: Error: Could not allocate memory",
        ),
        (
            "<worldbody><body name=\"&#27;[2J\"/></worldbody>",
            "\\u{1b}[2J",
        ),
    ] {
        workplace.write("arm.xml", model(inside));
        let says = ["robot.model", "arm.xml", says];
        wrong.extend(complaints(&workplace, "check s.toml", &says, None));
    }
    assert_none(&wrong);
    assert!(start.elapsed() < Duration::from_mins(1));
}

/// Such a model ends a process that only loads it.
#[test]
fn a_model_whose_process_ends() {
    let workplace = Workplace::with("s.toml", crate::bad_input::MODEL_SCENARIO);
    let field =
        "<asset><hfield name=\"h\" nrow=\"100000\" ncol=\"100000\" size=\"1 1 1 1\"/></asset>";
    workplace.write("arm.xml", model(field));
    let says = ["robot.model: arm.xml: MuJoCo breaks down on the model (signal: 6 (SIGABRT))"];
    assert_none(&complaints(&workplace, "check s.toml", &says, None));
}
