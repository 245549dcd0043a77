//! The program's own files of other versions are refused with what to do, and names in them that
//! would lead elsewhere too.

use serde_json::{Value, json};

use crate::support::{Workplace, scenario_text, shipped};

fn workplace() -> Workplace {
    let workplace = Workplace::new();
    let text = scenario_text("klimchik2012");
    let plans = text.find("[[study.plan]]").expect("is there");
    let plan = shipped("scenarios/plans/klimchik2012_m3.csv");
    let entry = format!("[[study.plan]]\nname = \"paper\"\nkind = \"file\"\nfile = \"{plan}\"\n");
    workplace.write("s.toml", format!("{}{entry}", &text[..plans]));
    for arguments in [
        format!("measure s.toml --plan {plan} --measurements-out m.csv"),
        "identify s.toml --measurements m.csv --identified-out good.json".to_owned(),
        "study s.toml --trials 64 --resume tally.json".to_owned(),
    ] {
        workplace.done(&arguments);
    }
    let study = workplace.read("out/s/study.json");
    workplace.write("study.json", study);
    workplace
}

/// Writes a file with one value replaced.
fn edit(workplace: &Workplace, from: &str, pointer: &str, value: Value) {
    let mut json = workplace.parsed(from);
    *json.pointer_mut(pointer).expect("is there") = value;
    workplace.write("edited.json", json.to_string());
}

#[test]
fn other_versions_are_refused_with_what_to_do() {
    let workplace = workplace();
    let compensate = "compensate s.toml --identified edited.json --quiet";
    let merge = "merge edited.json --quiet";
    let resume = "study s.toml --trials 64 --resume edited.json --quiet";
    let compare = "compare edited.json study.json --quiet";
    let newer = "hint: read it with the elastocal that wrote it";
    for (file, pointer, value, command, says, hint) in [
        (
            "good.json",
            "/schema/version",
            json!(99),
            compensate,
            "schema.version: found 99; this elastocal (0.1.0) reads up to",
            newer,
        ),
        (
            "good.json",
            "/schema/version",
            json!(0),
            compensate,
            "reads no version before",
            "make the file anew with `elastocal identify`",
        ),
        (
            "good.json",
            "/schema/name",
            json!("elastocal.study"),
            compensate,
            "results of identify and run are needed",
            "elastocal identify --identified-out",
        ),
        (
            "good.json",
            "/schema",
            json!(null),
            compensate,
            "is not a results file of elastocal",
            "elastocal identify --identified-out",
        ),
        (
            "tally.json",
            "/elastocal_tally",
            json!(99),
            merge,
            "elastocal_tally: found 99; this elastocal",
            newer,
        ),
        (
            "tally.json",
            "/elastocal_tally",
            json!(1),
            merge,
            "reads no version before",
            "make the file anew with `elastocal study`",
        ),
        (
            "tally.json",
            "/elastocal_tally",
            json!(1),
            resume,
            "reads no version before",
            "make the file anew with `elastocal study`",
        ),
        (
            "study.json",
            "/schema/version",
            json!(99),
            compare,
            "schema.version: found 99",
            newer,
        ),
        (
            "study.json",
            "/schema/version",
            json!(0),
            compare,
            "schema.version: found 0",
            "make the file anew with `elastocal study`",
        ),
        (
            "study.json",
            "/schema/version",
            json!("1"),
            compare,
            "schema.version: found \"1\"",
            "make the file anew with `elastocal study`",
        ),
    ] {
        edit(&workplace, file, pointer, value);
        let outcome = workplace.refused(command);
        outcome.says(says);
        outcome.says(hint);
    }
    for (file, command) in [("good.json", compensate), ("tally.json", merge)] {
        workplace.write("edited.json", workplace.read(file));
        workplace.done(command);
    }
}

/// The folder for merged results is named by the tally.
#[test]
fn a_tally_names_no_place_elsewhere() {
    let workplace = workplace();
    let outside = tempfile::tempdir().expect("a folder");
    let absolute = outside.path().join("x");
    let absolute = absolute.to_string_lossy();
    let before = workplace.listing();
    for name in [
        "../../../x",
        &*absolute,
        "",
        ".",
        "..",
        "a/b",
        "a/",
        "./a",
        "a\\b",
        "a\nb",
        "a\u{0}b",
        "\u{1b}[31m",
    ] {
        edit(&workplace, "tally.json", "/study/scenario", json!(name));
        let outcome = workplace.refused("merge edited.json --out deep/er");
        let says = "edited.json: study.scenario: found ";
        assert!(outcome.stderr.contains(says), "{name:?}: {outcome:#?}");
        let is_ours = |line: &str| line.starts_with("error E0701: ") || line.starts_with("hint: ");
        assert!(outcome.stderr.lines().all(is_ours), "{outcome:#?}");
    }
    std::fs::remove_file(workplace.path("edited.json")).expect("is there");
    assert_eq!(workplace.listing(), before);
    assert_eq!(outside.path().read_dir().expect("a folder").count(), 0);
    for name in ["s", "ä.b", "..."] {
        let scenario = format!("{name}.toml");
        let text = workplace.read("s.toml");
        workplace.write(&scenario, text);
        workplace.done(&format!(
            "study {scenario} --trials 64 --shard 1/1 --tally-out named.json"
        ));
        workplace.done("merge named.json --out deep/er");
        assert!(
            workplace
                .path(&format!("deep/er/{name}/study.csv"))
                .is_file()
        );
    }
}
