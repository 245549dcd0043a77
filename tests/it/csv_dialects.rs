//! CSV files as spreadsheets of every country write them: read to the same numbers, or an error that
//! says what is wrong.

use elastocal::measurement::{Measurement, read_measurements};
use elastocal::plan::{Plan, read_plan};

use crate::support::Workplace;

const PLAN: &str = "# A plan for three joints
q1_deg,q2_deg,q3_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats
0.5,-20,30.25,0,0,-700,0,0,0,1
10,20.125,-30,0,10.5,-700,0,0,0,2
";

const MEASUREMENTS: &str = "# Measured on Monday
q1_deg,q2_deg,q3_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,dx_mm,dy_mm,dz_mm
0.5,-20,30.25,0,0,-700,0,0,0,0.031,-1.2,-5.54
10,20.125,-30,0,10.5,-700,0,0,0,1.5e-2,0.25,-4
";

fn german(text: &str) -> String {
    text.replace(',', ";").replace('.', ",")
}

fn utf16(text: &str, unit: fn(u16) -> [u8; 2]) -> Vec<u8> {
    text.encode_utf16().flat_map(unit).collect()
}

/// Every dialect in which a text of commas and points can be written.
fn dialects(text: &str) -> Vec<(&'static str, Vec<u8>)> {
    let bytes = |text: String| text.into_bytes();
    let marked = |text: &str| format!("\u{feff}{text}");
    let quoted = |text: &str| -> String {
        let line = |line: &str| {
            if line.starts_with('#') {
                format!("\"{line}\"\n")
            } else {
                format!("\"{}\"\n", line.replace(',', "\",\""))
            }
        };
        text.lines().map(line).collect()
    };
    let filled = |text: &str| -> String { text.replace('\n', ";;\n") + ";;;;;;;;;;;;;;\n" };
    let excel = german(text).replace('\n', "\r\n");
    vec![
        ("as it is", bytes(text.into())),
        ("UTF-8 with a mark", bytes(marked(text))),
        ("semicolons", bytes(text.replace(',', ";"))),
        ("tabs", bytes(text.replace(',', "\t"))),
        ("decimal commas", bytes(german(text))),
        (
            "tabs, decimal commas",
            bytes(german(text).replace(';', "\t")),
        ),
        ("carriage returns", bytes(text.replace('\n', "\r\n"))),
        ("old Macintosh", bytes(text.replace('\n', "\r"))),
        ("quotes", bytes(quoted(text))),
        (
            "quotes, semicolons",
            bytes(quoted(text).replace("\",\"", "\";\"")),
        ),
        ("spaces", bytes(text.replace(',', " , "))),
        ("filled up", bytes(filled(&german(text)))),
        ("separator line", bytes(format!("sep=;\n{}", german(text)))),
        ("German Excel", bytes(marked(&excel))),
        (
            "German Excel, Unicode text",
            utf16(&marked(&excel.replace(';', "\t")), u16::to_le_bytes),
        ),
        (
            "UTF-16, large end first",
            utf16(&marked(text), u16::to_be_bytes),
        ),
    ]
}

#[test]
fn every_dialect_gives_the_same_numbers() {
    let workplace = Workplace::new();
    let path = workplace.path("file.csv");
    let mut plans: Vec<Plan> = Vec::new();
    let mut measurements: Vec<Vec<Measurement>> = Vec::new();
    for (name, bytes) in dialects(PLAN) {
        workplace.write("file.csv", bytes);
        plans.push(read_plan(&path, 3).unwrap_or_else(|error| panic!("{name}: {error}")));
    }
    for (name, bytes) in dialects(MEASUREMENTS) {
        workplace.write("file.csv", bytes);
        let read = read_measurements(&path, 3);
        measurements.push(read.unwrap_or_else(|error| panic!("{name}: {error}")));
    }
    assert!(plans.iter().all(|plan| plan == &plans[0]), "{plans:#?}");
    assert!(measurements.iter().all(|each| each == &measurements[0]));
    let first = &measurements[0][0];
    let expected = [0.031, -1.2, -5.54].map(|value: f64| value * 1e-3);
    assert_eq!(first.deflection_m, nalgebra::Vector3::from(expected));
    assert_eq!(plans[0].experiments[1].repeats, 2);
}

#[test]
fn what_can_be_read_in_two_ways_is_an_error() {
    let workplace = Workplace::new();
    let path = workplace.path("file.csv");
    let thousands = german(MEASUREMENTS).replace("-700", "-2,500");
    let only_thousands = "q1_deg;fx_n;fy_n;fz_n;tx_nm;ty_nm;tz_nm;repeats\n30;0;0;-2,500;0;0;0;1\n";
    let cases: Vec<(&str, String, usize, &[&str], &str)> = vec![
        (
            "decimal commas between commas",
            MEASUREMENTS.replace('.', ","),
            3,
            &["line 3", "found 17 fields; the header has 12"],
            "decimal commas?",
        ),
        (
            "a quoted comma between commas",
            MEASUREMENTS.replace("0.031", "\"1,234\""),
            3,
            &[
                "line 3",
                "dx_mm: found \"1,234\"",
                "decimal one or separate thousands",
            ],
            "decimal point",
        ),
        (
            "points and commas",
            thousands.replace("10;", "10.5;"),
            3,
            &[
                "line 4",
                "\"10.5\" in line 4",
                "\"0,5\" in line 3",
                "one decimal sign",
            ],
            "",
        ),
        (
            "thousands and decimals in one number",
            german(MEASUREMENTS).replace("-700", "-2.500,5"),
            3,
            &[
                "line 3",
                "fz_n: found \"-2.500,5\"",
                "without thousands separators",
            ],
            "",
        ),
        (
            "nothing but what may be thousands",
            only_thousands.to_owned(),
            1,
            &["line 2", "\"-2,500\"", "decimal one or separate thousands"],
            "decimal points",
        ),
        (
            "two delimiters",
            MEASUREMENTS.replacen(',', ";", 1),
            3,
            &["line 2", "commas and semicolons between the columns' names"],
            "",
        ),
        (
            "an open quote",
            MEASUREMENTS.replace("0.031", "\"0.031"),
            3,
            &["line 3", "a quote is not closed"],
            "",
        ),
        (
            "a typesetter's minus",
            MEASUREMENTS.replace("-20", "\u{2212}20"),
            3,
            &["line 3", "q2_deg", "finite number"],
            "U+2212",
        ),
    ];
    for (name, text, joints, says, hint) in cases {
        workplace.write("file.csv", text);
        let error = if joints == 1 {
            read_plan(&path, joints).expect_err(name)
        } else {
            read_measurements(&path, joints).expect_err(name)
        };
        for part in says {
            assert!(error.to_string().contains(part), "{name}: {error}");
        }
        let hinted = error.hint.unwrap_or_default();
        assert!(hinted.contains(hint), "{name}: {hinted}");
    }
}

#[test]
fn other_encodings_are_named() {
    let workplace = Workplace::new();
    let path = workplace.path("file.csv");
    let half: Vec<u8> = {
        let mut bytes = utf16(&format!("\u{feff}{PLAN}"), u16::to_le_bytes);
        bytes.pop();
        bytes
    };
    for (bytes, says) in [
        (half, "is not whole UTF-16 text"),
        (
            utf16(PLAN, u16::to_le_bytes),
            "nor UTF-16 with a byte order mark",
        ),
        (b"# sch\xf6n\n".to_vec(), "line 1: is not UTF-8 text"),
    ] {
        workplace.write("file.csv", bytes);
        let error = read_plan(&path, 3).expect_err(says);
        assert!(error.to_string().contains(says), "{error}");
        assert_eq!(error.hint.as_deref(), Some("save the file as UTF-8"));
    }
}

/// Line numbers in errors are those of an editor, whatever the dialect and the comments are.
#[test]
fn errors_name_the_line_of_the_file() {
    let workplace = Workplace::new();
    let path = workplace.path("file.csv");
    for (name, bytes) in dialects(&MEASUREMENTS.replace("-4\n", "four\n")) {
        workplace.write("file.csv", bytes);
        let error = read_measurements(&path, 3).expect_err(name).to_string();
        let line = if name == "separator line" { 5 } else { 4 };
        let expected = format!("line {line}: dz_mm: found \"four\"");
        assert!(error.contains(&expected), "{name}: {error}");
    }
    // A group of columns that is not whole: the header's line.
    let text = MEASUREMENTS
        .replace("dz_mm", "dz_mm,sx_mm")
        .replace("-5.54", "-5.54,1");
    workplace.write("file.csv", text.replace(",-4\n", ",-4,1\n"));
    let error = read_measurements(&path, 3)
        .expect_err("not whole")
        .to_string();
    assert!(error.contains("line 2: found [\"sx_mm\"]"), "{error}");
}

/// A row is no comment since its first field is what a spreadsheet writes for an error; one with a # before its numbers is.
#[test]
fn rows_that_begin_with_a_spreadsheets_error_are_refused() {
    let workplace = Workplace::new();
    let path = workplace.path("file.csv");
    let begun = |word: &str| MEASUREMENTS.replace("\n10,", &format!("\n{word},"));
    for word in ["#N/A", "\"#N/A\"", "#VALUE!", "#BEZUG!"] {
        workplace.write("file.csv", begun(word));
        let error = read_measurements(&path, 3).expect_err(word).to_string();
        assert!(error.contains("line 4: found \"#"), "{word}: {error}");
    }
    workplace.write("file.csv", begun("#10"));
    assert_eq!(read_measurements(&path, 3).expect("a comment").len(), 1);
}
