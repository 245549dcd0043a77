//! Tables of text, for pages, terminals and Markdown alike.

use serde::Serialize;

use super::for_terminal;
use super::wording::{joined, shortened};

/// Names of rows have at most so many characters.
const LONGEST_NAME: usize = 40;

/// A table with aligned columns; the first, of names, is left-aligned, the others right-aligned.
pub fn aligned(header: &[impl AsRef<str>], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut rows: Vec<Vec<String>> = rows.into_iter().collect();
    for name in rows.iter_mut().filter_map(|row| row.first_mut()) {
        *name = shortened(name, LONGEST_NAME);
    }
    let header: Vec<String> = header.iter().map(|name| name.as_ref().to_owned()).collect();
    rows.insert(0, header);
    let longest = |column: usize| {
        rows.iter()
            .map(move |row| row[column].chars().count())
            .max()
    };
    let widths = (0..rows[0].len()).map(|column| longest(column).unwrap_or(0));
    let widths: Vec<usize> = widths.collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).enumerate();
        let cells = cells.map(|(index, (cell, &width))| match index {
            0 => format!("{cell:<width$}"),
            _ => format!("{cell:>width$}"),
        });
        format!("  {}\n", joined(cells, "  ").trim_end())
    };
    rows.iter().map(line).collect()
}

/// A table; the first column is text, the others are numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecordTable {
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl RecordTable {
    /// With the names of its columns between bars.
    pub fn new(header: &str, rows: impl IntoIterator<Item = Vec<String>>) -> Self {
        Self {
            header: header
                .split('|')
                .map(|name| name.trim().to_owned())
                .collect(),
            rows: rows.into_iter().collect(),
        }
    }

    /// Of a terminal.
    pub fn plain(&self) -> String {
        let row = |row: &Vec<String>| {
            let (name, cells) = row.split_first().unzip();
            let cells = cells.unwrap_or(&[]).iter().map(|cell| for_terminal(cell));
            name.cloned().into_iter().chain(cells).collect()
        };
        let header: Vec<String> = self.header.iter().map(|name| for_terminal(name)).collect();
        aligned(&header, self.rows.iter().map(row))
    }

    /// Its first so many columns.
    pub fn first(mut self, columns: usize) -> Self {
        let all = self.rows.iter_mut().chain([&mut self.header]);
        all.for_each(|row| row.truncate(columns));
        self
    }
}
