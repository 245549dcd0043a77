//! Conditions and errors have stable codes: each is explained, made, shown by tests, printed, and can be accepted.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use elastocal::codes::{ConditionCode, ErrorCode, meanings};
use serde_json::json;

use crate::support::{Workplace, list, project, scenario_text};

/// Conditions that no test makes: what they need is named.
const NOT_MADE: [(ConditionCode, &str); 3] = [
    (
        ConditionCode::BelowBound,
        "searches for a bound that miss what a plan has",
    ),
    (ConditionCode::NoWay, "an obstacle in the only way back"),
    (
        ConditionCode::NotReproduced,
        "another paper: what it is made of is tested in `reproduction`",
    ),
];

#[test]
fn every_code_is_its_own_and_is_explained() {
    let all: Vec<_> = meanings().collect();
    let ids: Vec<&str> = all.iter().map(|each| each.id).collect();
    let conditions = ConditionCode::ALL.iter().map(|code| code.id());
    let errors = ErrorCode::ALL.iter().map(|code| code.id());
    let known: Vec<&str> = conditions.chain(errors).collect();
    assert_eq!(ids, known, "the pages explain all that is known");
    let unique: BTreeSet<&str> = ids.iter().copied().collect();
    assert_eq!(
        ids,
        unique.into_iter().collect::<Vec<_>>(),
        "in order, once each"
    );
    for each in all {
        let (kind, number) = each.id.split_at(1);
        assert!(["C", "E"].contains(&kind) && number.len() == 4, "{each:?}");
        assert!(number.parse::<u16>().is_ok(), "{each:?}");
        let is_title = (5..=60).contains(&each.title.len()) && !each.title.ends_with('.');
        assert!(is_title, "{each:?}");
        let sentences = each.explanation.matches(". ").count() + 1;
        assert!(
            each.explanation.ends_with('.') && sentences <= 5,
            "{each:?}"
        );
        assert!(each.explanation.len() >= 80, "{each:?}");
    }
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
        let path = entry.path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
}

/// All code in a folder of the project, but for the files that are left out.
fn code_in(folder: &str, left_out: &str) -> String {
    let mut files = Vec::new();
    sources(&project(folder), &mut files);
    files.retain(|file| !file.starts_with(project(left_out)));
    let texts = files
        .iter()
        .map(|file| std::fs::read_to_string(file).expect("it is there"));
    texts.collect()
}

/// Whether code names a variant, and not one whose name only begins so.
fn names(code: &str, variant: &str) -> bool {
    let mut places = code
        .match_indices(variant)
        .map(|(place, _)| place + variant.len());
    places.any(|end| !code[end..].starts_with(char::is_alphanumeric))
}

#[test]
fn every_code_is_used() {
    let code = code_in("src", "src/codes");
    let conditions = ConditionCode::ALL
        .iter()
        .map(|code| format!("ConditionCode::{code:?}"));
    let errors = ErrorCode::ALL
        .iter()
        .map(|code| format!("ErrorCode::{code:?}"));
    let unused: Vec<String> = conditions
        .chain(errors)
        .filter(|variant| !names(&code, variant))
        .collect();
    assert_eq!(unused, [] as [String; 0]);
    assert!(!names("ConditionCode::Outliers", "ConditionCode::Out"));
}

/// Tests name a condition by its code, as it is printed or as a variant.
#[test]
fn every_condition_is_made_by_a_test() {
    let tests = code_in("tests/it", "tests/it/codes.rs") + &own_tests();
    let is_shown = |code: &ConditionCode| {
        tests.contains(code.id()) || names(&tests, &format!("ConditionCode::{code:?}"))
    };
    let missing: Vec<_> = (ConditionCode::ALL.iter())
        .filter(|code| !is_shown(code) && !NOT_MADE.iter().any(|(known, _)| known == *code))
        .map(|code| code.id())
        .collect();
    assert!(missing.is_empty(), "{missing:#?}");
}

/// The tests of this file, without the list of what is not made.
fn own_tests() -> String {
    let own = std::fs::read_to_string(project("tests/it/codes.rs")).expect("it is there");
    let (before, after) = own.split_once("const NOT_MADE").expect("it is there");
    let (_, after) = after.split_once("];").expect("it ends");
    before.to_owned() + after
}

fn workplace() -> Workplace {
    let place = Workplace::with("s.toml", scenario_text("klimchik2012"));
    let plan = std::fs::read(project("scenarios/plans/klimchik2012_m3.csv"));
    place.write("p.csv", plan.expect("it is there"));
    place
}

#[test]
fn accepted_conditions_are_named_and_end_with_0() {
    let place = workplace();
    let check = "check scenarios/kr270.toml --plan p.csv --quiet";
    let kr270 = project("scenarios/kr270.toml");
    let check = check.replace("scenarios/kr270.toml", &kr270.display().to_string());
    let found = place.doubted(&check);
    assert_eq!(found.stderr, "condition C0102: the plan has 1 violation\n");
    let json = place.doubted(&format!("{check} --json")).json();
    let text = "the plan has 1 violation";
    assert_eq!(
        json["conditions"],
        json!([{ "code": "C0102", "text": text }])
    );
    for allow in ["c0102", "C0105,C0102", "C0105 --allow C0102"] {
        let found = place.done(&format!("{check} --allow {allow}"));
        assert_eq!(found.stderr, format!("condition C0102 (allowed): {text}\n"));
    }
    let accepted = format!("{check} --json --allow C0102");
    let json = place.done(&accepted).json();
    let accepted = json!([{ "code": "C0102", "text": text, "allowed": true }]);
    assert_eq!(json["conditions"], accepted);
    place.doubted(&format!("{check} --allow C0105"));
    for unknown in ["C0199", "E0101", ""] {
        let found = place.misused(&format!("{check} --allow={unknown}"));
        found.says("there is no such code; the nearest are C0");
    }
}

/// One of several is accepted: the other one still counts.
#[test]
fn what_is_not_accepted_ends_with_3() {
    let place = workplace();
    let text = place.read("p.csv").replace("-2500", "2500");
    assert_ne!(text, place.read("p.csv"));
    place.write("p.csv", text);
    let scenario = place.read("s.toml").replace("-2500", "2500");
    place.write("s.toml", scenario);
    let evaluate = "evaluate s.toml --plan p.csv --quiet --no-proof";
    let found = place.doubted(evaluate);
    let codes: Vec<&str> = (found.stderr.lines())
        .filter_map(|line| {
            line.strip_prefix("condition ")?
                .split_once(':')
                .map(|(code, _)| code)
        })
        .collect();
    assert!(codes.contains(&"C0502"), "{found:#?}");
    let all = codes.join(",");
    place.done(&format!("{evaluate} --allow {all}"));
    if let [first, _, ..] = codes[..] {
        place.doubted(&format!("{evaluate} --allow {first}"));
    }
}

/// A joint at its limit cannot be approached from beyond it.
#[test]
fn a_side_without_room_is_named() {
    let place = workplace();
    let rows = place.read("p.csv");
    let rows: Vec<String> = (rows.lines().filter(|line| !line.starts_with('#')))
        .map(|line| {
            if line.starts_with("q1") {
                return format!("{line},approach");
            }
            let mut fields: Vec<&str> = line.split(',').collect();
            fields[4] = "-124";
            fields.join(",") + ",++++++"
        })
        .collect();
    place.write("p.csv", rows.join("\n"));
    let lab = place.doubted("lab s.toml --quiet --plan p.csv");
    let named = "C0109: there is no room to approach experiment 1, 2, 3 from one side";
    lab.says(&format!("condition {named}"));
    let sheet = place.read("out/s/lab/run_sheet.html");
    assert!(sheet.contains(named) && sheet.contains("Approached as it comes."));
    assert!(!sheet.contains("Every configuration is approached from the same side"));
}

/// Loads under which soft robots do not stand, among robots of which some are soft.
#[test]
fn failed_runs_are_named() {
    let place = workplace();
    for name in ["s.toml", "p.csv"] {
        let text = place.read(name).replace("-2500", "-250000");
        place.write(name, text);
    }
    let text = place.read("s.toml");
    let (text, _) = text.split_once("[study]").expect("a study");
    let study =
        "[study]\ntrials = 64\nexperiments = 3\nlevel = \"robot\"\ncompliance_spread = 1.0\n";
    let plan = "[[study.plan]]\nname = \"paper\"\nkind = \"file\"\nfile = \"p.csv\"\n";
    place.write("s.toml", format!("{text}{study}{plan}"));
    let found = place.doubted("study s.toml --quiet");
    assert!(found.stderr.starts_with("condition C0401: "), "{found:#?}");
    let said = "of 64 runs failed with the plan \"paper\" (";
    found.says(said);
}

/// A kind of error has one code, wherever it comes from.
#[test]
fn errors_have_the_code_of_their_kind() {
    let place = workplace();
    place.write("broken.toml", "seed =");
    place.write(
        "key.toml",
        scenario_text("klimchik2012").replace("sigma_mm", "sigma"),
    );
    place.write("columns.csv", "q1_deg,fx_n\n1,2\n");
    let text = place.read("p.csv");
    let zero = text.replace("-2500", "0");
    place.write("zero.csv", zero);
    place.write("latin.csv", b"q1_deg\n\xe9\n".as_slice());
    place.write(
        "other.json",
        r#"{"schema": {"name": "elastocal.identify", "version": 99}}"#,
    );
    place.write("no.json", "{}");
    let model = scenario_text("klimchik2012").replace("kr270.xml", "nothing.xml");
    place.write("model.toml", model);
    for (arguments, code) in [
        ("check nothing.toml", "E0601"),
        ("check broken.toml", "E0101"),
        ("check key.toml", "E0101"),
        ("check model.toml", "E0601"),
        ("run s.toml --draw 10", "E0102"),
        ("evaluate s.toml --plan nothing.csv", "E0601"),
        ("evaluate s.toml --plan columns.csv", "E0301"),
        ("evaluate s.toml --plan latin.csv", "E0602"),
        ("evaluate s.toml --plan zero.csv", "E0304"),
        ("identify --measurements p.csv", "E0103"),
        ("identify s.toml --measurements p.csv", "E0301"),
        ("compensate s.toml --identified other.json", "E0605"),
        ("compensate s.toml --identified no.json", "E0505"),
        ("compare no.json no.json", "E0703"),
        ("merge no.json", "E0701"),
        ("plan s.toml --plan-out p/q.csv", "E0603"),
        (
            "measure s.toml --plan p.csv --measurements-out p.csv",
            "E0604",
        ),
        ("lab s.toml --plan p.csv --dialect none", "E0404"),
    ] {
        let found = place.run(&format!("{arguments} --quiet"));
        let found = found.ends_with(1);
        assert!(
            found.stderr.starts_with(&format!("error {code}: ")),
            "{found:#?}"
        );
    }
}

#[test]
fn explain_says_what_a_code_means() {
    let place = Workplace::new();
    let all = place.done("explain").stdout;
    assert_eq!(all.lines().count(), meanings().count());
    for word in ["C0205", "c0205"] {
        let one = place.done(&format!("explain {word}")).stdout;
        let meaning = meanings()
            .find(|each| each.id == "C0205")
            .expect("it is told");
        assert!(
            one.starts_with(&format!("C0205: {}\n", meaning.title)),
            "{one}"
        );
        let words: Vec<&str> = one.split_whitespace().collect();
        let expected = meaning.explanation.split_whitespace().collect::<Vec<_>>();
        assert!(words.ends_with(&expected), "{one}");
    }
    let json = place.done("explain C06 E0301 --json").json();
    let codes = list(&json["codes"]);
    let ids: Vec<_> = codes.iter().map(|each| each["id"].as_str()).collect();
    assert_eq!(ids, [Some("C0601"), Some("E0301")]);
    let listed = place.done("explain --json").json();
    assert_eq!(
        listed["codes"].as_array().map(Vec::len),
        Some(meanings().count())
    );
    let unknown = place.misused("explain C0209x");
    unknown.says("there is no such code; the nearest are C0209 (copied readings), C020");
}
