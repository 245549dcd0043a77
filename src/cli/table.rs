//! Plain text tables.

use crate::identification::DistanceStatistics;
use crate::observation::LengthKind;
use crate::task::Instrument;
use crate::text::wording::{self, joined, shortened};

/// Names of rows have at most so many characters.
const LONGEST_NAME: usize = 40;

/// A table whose header has the names of its columns between bars.
pub fn table(header: &str, rows: impl IntoIterator<Item = Vec<String>>) -> String {
    table_of(&header.split(" | ").collect::<Vec<_>>(), rows)
}

/// A table with aligned columns; the first, of names, is left-aligned, the others right-aligned.
pub fn table_of(header: &[impl AsRef<str>], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut rows: Vec<Vec<String>> = rows.into_iter().collect();
    for name in rows.iter_mut().filter_map(|row| row.first_mut()) {
        *name = shortened(name, LONGEST_NAME);
    }
    let width = |column: usize| {
        rows.iter()
            .map(|row| row[column].chars().count())
            .chain([header[column].as_ref().chars().count()])
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..header.len()).map(width).collect();
    let line = |cells: &mut dyn Iterator<Item = &str>| {
        let cells: Vec<String> = cells
            .zip(&widths)
            .enumerate()
            .map(|(index, (cell, &width))| {
                if index == 0 {
                    format!("{cell:<width$}")
                } else {
                    format!("{cell:>width$}")
                }
            })
            .collect();
        format!("  {}\n", cells.join("  ").trim_end())
    };
    let mut text = line(&mut header.iter().map(AsRef::as_ref));
    for row in &rows {
        text += &line(&mut row.iter().map(String::as_str));
    }
    text
}

/// The columns of [`distances`].
pub const DISTANCES: &str = "read less predicted | mean | rms | 95 % below | largest";

/// A row of the statistics of some distances or angles.
pub fn distances(name: &str, each: &DistanceStatistics) -> Vec<String> {
    let numbers = [each.mean, each.rms, each.quantile95, each.largest];
    let cells = numbers.map(|value| format!("{value:.4}"));
    [vec![name.to_owned()], cells.to_vec()].concat()
}

/// What is shown of something, or a dash where there is nothing.
pub fn or_dash<T>(of: Option<T>, shown: impl FnOnce(T) -> String) -> String {
    of.map_or_else(|| "-".to_owned(), shown)
}

/// What readings are off by, with its unit: of lengths of one kind in their word.
pub fn residual_name(instrument: &Instrument) -> String {
    let length = instrument.length_alone();
    format!("{} [mm]", length.map_or("distance", LengthKind::name))
}

/// A length (m) in micrometres with the given decimals, or a dash where there is none.
pub fn in_um(value_m: Option<f64>, decimals: usize) -> String {
    or_dash(value_m, |value_m| wording::in_um(value_m, decimals))
}

/// Numbers with the given decimals, one after the other.
pub fn numbers(values: impl IntoIterator<Item = f64>, decimals: usize) -> String {
    let values = values.into_iter();
    joined(values.map(|value| format!("{value:.decimals$}")), " ")
}

/// A number with the given decimals, or a dash where there is none.
pub fn number(value: Option<f64>, decimals: usize) -> String {
    or_dash(value, |value| format!("{value:.decimals$}"))
}
