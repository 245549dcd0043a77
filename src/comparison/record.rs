//! The records of a comparison: JSON for machines, rows and Markdown for people.

use serde_json::{Value, json};

use crate::comparison::results::{Key, ResultsFile};
use crate::comparison::{Change, Comparison, part_of};
use crate::gate::{Decision, Direction, Quantity};
use crate::record::messages::{SchemaMessage, merge};
use crate::text::markdown_text;

/// The columns of a [`row`].
pub const COLUMNS: [&str; 7] = [
    "plan", "quantity", "base", "new", "change", "allowed", "verdict",
];

/// The comparison of two files for machines. Numbers that do not exist are `null`.
pub fn comparison_json(
    base: &ResultsFile,
    new: &ResultsFile,
    comparison: &Comparison,
) -> serde_json::Result<Value> {
    let side = |file: &ResultsFile| {
        json!({
            "file": file.path.display().to_string(),
            "schema": file.schema,
            "provenance": file.provenance,
        })
    };
    let schema = SchemaMessage::new("compare");
    let mut json = json!({ "schema": schema, "base": side(base), "new": side(new) });
    merge(&mut json, serde_json::to_value(comparison)?);
    Ok(json)
}

/// A change, in the [`COLUMNS`].
pub fn row(change: &Change) -> Vec<String> {
    let quantity = change.key.quantity;
    let of = (change.key.of.as_ref()).map_or_else(String::new, |of| format!(" of {of}"));
    let unit = match quantity.unit() {
        "" => String::new(),
        "rad/(N m)" => " [1e-9 rad/(N m); slides 1e-9 m/N]".to_owned(),
        unit => format!(" [{unit}]"),
    };
    let verdict = match change.decision {
        Decision::Accept => "",
        Decision::Inconclusive => "INCONCLUSIVE",
        Decision::Reject => "BROKEN",
    };
    vec![
        change.key.plan.clone(),
        format!("{}{of}{unit}", quantity.name()),
        shown(quantity, change.base),
        shown(quantity, change.new),
        difference(change),
        allowed(change),
        verdict.to_owned(),
    ]
}

fn shown(quantity: Quantity, value: Option<f64>) -> String {
    value.map_or_else(
        || "-".to_owned(),
        |value| match quantity {
            Quantity::Violations | Quantity::FailedRuns => format!("{value}"),
            Quantity::StandardError => format!("{:.4}", value * 1e9),
            _ => format!("{value:.4}"),
        },
    )
}

fn is_count(quantity: Quantity) -> bool {
    matches!(quantity, Quantity::Violations | Quantity::FailedRuns)
}

fn difference(change: &Change) -> String {
    match (change.change, change.relative_change) {
        (Some(0.0), _) => "0".to_owned(),
        (Some(_), Some(relative)) if !is_count(change.key.quantity) => {
            let percent = relative * 100.0;
            if percent.abs() < 0.005 {
                format!("{percent:+.0e} %")
            } else {
                format!("{percent:+.2} %")
            }
        }
        (Some(absolute), _) => signed(absolute),
        (None, _) if change.base == change.new => "0".to_owned(),
        (None, _) => "-".to_owned(),
    }
}

fn allowed(change: &Change) -> String {
    let sign = match (change.direction, change.key.quantity.larger_is_worse()) {
        (Direction::None, _) => return "any".to_owned(),
        (Direction::Both, _) => "+-",
        (Direction::Worse, true) => "+",
        (Direction::Worse, false) => "-",
    };
    // As a part of the value before.
    match change.base.and_then(|base| part_of(base, change.tolerance)) {
        _ if change.tolerance == 0.0 => format!("{sign}0"),
        Some(tolerance) if !is_count(change.key.quantity) => {
            let percent = format!("{:.3}", tolerance * 100.0);
            let percent = percent.trim_end_matches('0').trim_end_matches('.');
            format!("{sign}{percent} %")
        }
        _ => format!("{sign}{}", change.tolerance),
    }
}

fn signed(value: f64) -> String {
    if value.fract() == 0.0 {
        format!("{value:+}")
    } else {
        format!("{value:+.3e}")
    }
}

/// Where both come from, and what else a reader must know: a sentence each.
pub fn notes(base: &ResultsFile, new: &ResultsFile, comparison: &Comparison) -> Vec<String> {
    let mut notes = Vec::new();
    for difference in &comparison.differences {
        notes.push(format!(
            "They differ in {}, as allowed: {} in the base, {} in the new.",
            difference.aspect.name(),
            difference.base,
            difference.new
        ));
    }
    let (before, now) = (&base.provenance.platform, &new.provenance.platform);
    if before != now {
        let digits = if comparison.identical {
            ""
        } else {
            ": the last digits may differ"
        };
        notes.push(format!(
            "The base is of another platform ({before}, now {now}){digits}."
        ));
    }
    if comparison.identical {
        notes.push("All are the same to the last bit.".to_owned());
    }
    if !comparison.not_compared.is_empty() {
        let names: Vec<String> = (comparison.not_compared.iter()).map(Key::text).collect();
        notes.push(format!("Only one file has: {}.", names.join("; ")));
    }
    notes
}

/// What it comes to, in a sentence.
pub fn verdict(comparison: &Comparison) -> String {
    let names: Vec<&str> = (comparison.quantities.iter())
        .map(|quantity| quantity.name())
        .collect();
    let all = comparison.changes.len();
    let compared = format!("{all} numbers compared ({})", names.join(", "));
    let of = |decision: Decision| {
        let same = (comparison.changes.iter()).filter(|change| change.decision == decision);
        same.count()
    };
    match (of(Decision::Reject), of(Decision::Inconclusive)) {
        (0, 0) => format!("{compared}: all within tolerance."),
        (broken, 0) => format!("{compared}: {broken} beyond tolerance."),
        (broken, unsure) => {
            format!("{compared}: {broken} beyond tolerance, {unsure} inconclusive.")
        }
    }
}

/// A summary that a job of continuous integration can post.
pub fn markdown(base: &ResultsFile, new: &ResultsFile, comparison: &Comparison) -> String {
    let outcome = if comparison.ok { "passed" } else { "failed" };
    let scenario = markdown_text(&new.provenance.scenario);
    let mut text = format!(
        "### Gate {outcome}: {scenario}\n\n{}\n\n",
        verdict(comparison)
    );
    if !comparison.ok {
        text += &markdown_table(&COLUMNS[..6], comparison.broken().map(row));
        text.push('\n');
    }
    let origin = |name: &str, file: &ResultsFile| {
        let provenance = &file.provenance;
        vec![
            name.to_owned(),
            file.path.display().to_string(),
            format!("{} ({})", provenance.version, provenance.commit),
            provenance.platform.clone(),
        ]
    };
    text += &markdown_table(
        &["", "file", "elastocal", "platform"],
        [origin("base", base), origin("new", new)],
    );
    for note in notes(base, new, comparison) {
        text += &format!("\n{}\n", markdown_text(&note));
    }
    let all = markdown_table(&COLUMNS, comparison.changes.iter().map(row));
    text + &format!("\n<details><summary>All numbers</summary>\n\n{all}\n</details>\n")
}

fn markdown_table(header: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let mut text = line(header.iter().map(|&cell| cell.to_owned()).collect());
    text += &line(vec!["---".to_owned(); header.len()]);
    for row in rows {
        let cells = row.iter().take(header.len());
        text += &line(cells.map(|cell| markdown_text(cell)).collect());
    }
    text
}
