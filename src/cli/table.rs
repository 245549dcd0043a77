//! Plain text tables.

use crate::identification::DistanceStatistics;
use crate::observation::LengthKind;
use crate::task::Instrument;
pub use crate::text::table::aligned;
use crate::text::wording::{self, joined};

/// A table whose header has the names of its columns between bars.
pub fn table(header: &str, rows: impl IntoIterator<Item = Vec<String>>) -> String {
    aligned(&header.split(" | ").collect::<Vec<_>>(), rows)
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

/// What holds, and is worth knowing, a line each.
pub fn noted(notes: &[String]) -> String {
    joined(notes.iter().map(|note| format!("note: {note}\n")), "")
}
