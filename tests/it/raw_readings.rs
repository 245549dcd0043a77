//! Positions that an instrument shows without and with a load, in place of deflections.

use serde_json::Value;

use crate::support::{Workplace, list, scenario_text, shipped};

const START: &str = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm";

/// Deflections that the virtual robot shows in `m.csv`; their rows without the header, cut before the deflection.
fn measured(plan: &str) -> (Workplace, Vec<(String, [f64; 3])>) {
    let workplace = Workplace::with("s.toml", scenario_text("klimchik2012"));
    let plan = shipped(&format!("scenarios/plans/{plan}.csv"));
    workplace.done(&format!(
        "measure s.toml --quiet --plan {plan} --measurements-out m.csv"
    ));
    let text = workplace.read("m.csv");
    let lines = text.lines().filter(|line| !line.starts_with(['#', 'q']));
    let rows = lines.map(|line| {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |index: usize| fields[index].parse().expect("a number");
        (fields[..12].join(","), [12, 13, 14].map(number))
    });
    let rows = rows.collect();
    (workplace, rows)
}

fn joined(numbers: &[f64]) -> String {
    let texts: Vec<String> = numbers.iter().map(ToString::to_string).collect();
    texts.join(",")
}

fn identified(workplace: &Workplace, file: &str) -> Value {
    let command = format!("identify s.toml --quiet --measurements {file} --json");
    workplace.run(&command).json()
}

fn same(one: &Value, other: &Value, key: &str, within: f64) {
    let [one, other] = [one, other].map(|json| crate::support::numbers(&json[key]));
    assert_eq!(one.len(), other.len());
    for (one, other) in one.iter().zip(&other) {
        assert!((one / other - 1.0).abs() < within, "{key}: {one} {other}");
    }
}

/// The sheet's table, filled in, identifies what its differences do; half of it is enough for `next`.
#[test]
fn the_table_of_the_laboratory_takes_positions() {
    let (workplace, rows) = measured("klimchik2012_m4");
    let plan = shipped("scenarios/plans/klimchik2012_m4.csv");
    workplace.run(&format!("lab s.toml --quiet --plan {plan}"));
    let empty = workplace.read("out/s/lab/measurements.csv");
    let header = "unloaded_stop,unloaded_reading,loaded_stop,loaded_reading,";
    assert!(empty.contains(&format!("{header}{START},unloaded_x_mm,")));
    let mut count = 0_u32;
    let filled: Vec<String> = (empty.lines())
        .map(|line| {
            let Some(start) = line.strip_suffix(",,,,,,") else {
                return line.to_owned();
            };
            count += 1;
            let known = rows.iter().find(|(known, _)| start.ends_with(known));
            let (_, [x, y, z]) = known.expect("the same row");
            let at = [1500.25 + f64::from(count), -300.5, 1200.125];
            let loaded = [at[0] + x, at[1] + y, at[2] + z];
            format!("{start},{},{}", joined(&at), joined(&loaded))
        })
        .collect();
    assert_eq!(count, 4);
    workplace.write("filled.csv", filled.join("\n"));
    let [raw, deflections] = ["filled.csv", "m.csv"].map(|file| identified(&workplace, file));
    same(&raw, &deflections, "compliance_rad_per_nm", 1e-8);
    same(&raw, &deflections, "compliance_std_rad_per_nm", 1e-8);

    let is_row = |line: &&String| line.starts_with(|first: char| first.is_ascii_digit());
    let half = filled.iter().filter(is_row).take(3);
    let unfinished: Vec<&str> = empty.lines().filter(|line| line.ends_with(",,,")).collect();
    let head = empty
        .lines()
        .take_while(|line| !line.starts_with(|first: char| first.is_ascii_digit()));
    let lines: Vec<&str> = head
        .chain(half.map(String::as_str))
        .chain(unfinished[3..].iter().copied())
        .collect();
    workplace.write("half.csv", lines.join("\n"));
    let json = workplace.record("next --measurements half.csv --experiments 4");
    assert_eq!(json["measured"], 3);
    // The sheet goes from stop to stop: readings without a load stand before the first with one.
    let mut rows = 0;
    let so_far: Vec<String> = (filled.iter())
        .map(|line| {
            rows += u32::from(is_row(&line));
            let fields: Vec<&str> = line.split(',').collect();
            match (is_row(&line), rows) {
                (true, 4..) => format!("{},,,", fields[..fields.len() - 3].join(",")),
                _ => line.clone(),
            }
        })
        .collect();
    workplace.write("so_far.csv", so_far.join("\n"));
    let json = workplace.record("next --measurements so_far.csv --experiments 4");
    assert_eq!(json["measured"], 3);
    let outcome = workplace.refused("identify --quiet --measurements half.csv");
    outcome.says("unloaded_x_mm: found \"\"");
    let outcome = workplace.refused("next --quiet --measurements out/s/lab/measurements.csv");
    outcome.says("has no row that is filled in");
}

/// The variance of a deflection is the sum of those of its positions.
#[test]
fn both_positions_are_uncertain() {
    let (workplace, rows) = measured("klimchik2012_m3");
    let mut raw = format!(
        "{START},loaded_x_mm,loaded_y_mm,loaded_z_mm,unloaded_x_mm,unloaded_y_mm,unloaded_z_mm,\
         unloaded_sx_mm,unloaded_sy_mm,unloaded_sz_mm,loaded_sx_mm,loaded_sy_mm,loaded_sz_mm\n"
    );
    let mut deflections = format!("{START},dx_mm,dy_mm,dz_mm,sx_mm,sy_mm,sz_mm\n");
    for (start, deflection) in &rows {
        let dp = joined(deflection);
        raw += &format!("{start},{dp},0,0,0,0.03,0.05,0.012,0.04,0.12,0.016\n");
        deflections += &format!("{start},{dp},0.05,0.13,0.02\n");
    }
    // At different configurations the same numbers are different readings.
    workplace.write("raw.csv", raw);
    workplace.write("deflections.csv", deflections);
    let [raw, deflections] =
        ["raw.csv", "deflections.csv"].map(|file| identified(&workplace, file));
    same(&raw, &deflections, "compliance_rad_per_nm", 1e-9);
    same(&raw, &deflections, "compliance_std_rad_per_nm", 1e-9);
}

/// A reading that stands in two rows makes their errors one, which nothing here knows of.
#[test]
fn a_reading_belongs_to_one_row() {
    let (workplace, rows) = measured("klimchik2012_m3");
    let columns = "unloaded_x_mm,unloaded_y_mm,unloaded_z_mm,loaded_x_mm,loaded_y_mm,loaded_z_mm";
    let table = |more: &str, wanted: &[(usize, &str)]| {
        let mut text = format!("{START},{columns}{more}\n");
        for (row, more) in wanted {
            let (start, dp) = &rows[*row];
            text += &format!("{start},0,0,0,{}{more}\n", joined(dp));
        }
        text
    };
    let fails = |text: String, says: &str| {
        workplace.write("w.csv", text);
        let outcome = workplace.refused("identify s.toml --quiet --measurements w.csv");
        outcome.says(says);
    };
    let plain = [(0, ""), (1, ""), (2, "")];
    fails(
        table("", &[plain[0], plain[1], plain[2], plain[0]]),
        "line 5: the reading without a load (0, 0, 0) is that of line 2, too",
    );
    let places = ",unloaded_stop,unloaded_reading,loaded_stop,loaded_reading";
    fails(
        table(places, &[(0, ",1,1,4,1"), (1, ",2,1,5,1"), (2, ",2,1,6,1")]),
        "line 4: the reading without a load (reading 1 at stop 2) is that of line 3, too",
    );
    let numbered = [
        (0, ",1,1,4,1"),
        (0, ",1,2,4,2"),
        (1, ",2,1,5,1"),
        (2, ",3,1,6,1"),
    ];
    workplace.write("n.csv", table(places, &numbered));
    assert_eq!(
        identified(&workplace, "n.csv")["residuals"]
            .as_array()
            .map(Vec::len),
        Some(4)
    );
    fails(table(",dx_mm", &[(0, ",1")]), "found the unknown column");
    fails(
        table(",unloaded_stop", &[(0, ",1")]),
        "these columns come together",
    );
    let deviations = ",unloaded_sx_mm,unloaded_sy_mm,unloaded_sz_mm";
    fails(
        table(deviations, &[(0, ",1,1,1")]),
        "these columns come together",
    );
    let both = format!("{deviations},loaded_sx_mm,loaded_sy_mm,loaded_sz_mm,sx_mm,sy_mm,sz_mm");
    fails(
        table(&both, &[(0, ",1,1,1,1,1,1,1,1,1")]),
        "the deviations of the deflection or of the positions are allowed",
    );
    let alone = format!("{START},dx_mm,dy_mm,dz_mm{places}\n");
    fails(alone + "0,0,0,0,0,0,0,0,1,0,0,0,1,1,1,1,1,1,1\n", "without");
}

/// Under two loads a configuration has two readings without a load, and the table says which are whose.
#[test]
fn every_row_has_a_reading_without_a_load() {
    let workplace = Workplace::new();
    let text = scenario_text("klimchik2012").replace(
        "kind = \"fixed\"\nforce_n = [0, 0, -2500]",
        "kind = \"any\"\nforce_max_n = 2500",
    );
    workplace.write("s.toml", text);
    workplace.write(
        "plan.csv",
        format!(
            "{START},repeats\n0,-90,90,0,30,0,0,0,-2500,0,0,0,2\n10,-80,90,0,30,0,0,0,-2500,0,0,0,1\n\
             0,-90,90,0,30,0,0,0,-1000,0,0,0,3\n"
        ),
    );
    let json = workplace.record("lab s.toml --plan plan.csv --keep-order");
    let stops = list(&json["stops"]);
    assert_eq!(stops[0]["experiments"], serde_json::json!([1, 3]));
    assert_eq!(stops[0]["readings"], 5);
    assert_eq!(json["readings"], 12);
    let table = workplace.read("out/s/lab/measurements.csv");
    let places: Vec<String> = (table.lines())
        .filter(|line| line.starts_with(|first: char| first.is_ascii_digit()))
        .map(|line| line.split(',').take(4).collect::<Vec<_>>().join(" "))
        .collect();
    assert_eq!(
        places,
        [
            "1 1 3 1", "1 2 3 2", "2 1 4 1", "1 3 5 1", "1 4 5 2", "1 5 5 3"
        ]
    );
}
