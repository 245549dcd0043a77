//! From a foreign table to a measurement file.

use std::path::Path;

use super::columns::ReadingColumns;
use super::mapping::MappingFile;
use super::resolved::{Resolver, separator};
use super::told::{ColumnRange, in_words, ranges};
use crate::csv::{RawTable, Separator};
use crate::files::typed::from_toml;
use crate::files::{FileError, read_text};

/// What became of a table.
#[derive(Debug, Clone)]
pub struct ImportedTable {
    /// The text of the measurement file.
    pub text: String,
    /// How many rows it has.
    pub rows: usize,
    /// How many rows of the table were left out, since a column was empty.
    pub left_out: usize,
    /// What the written columns hold.
    pub ranges: Vec<ColumnRange>,
    /// How the table was understood, in sentences; the last is about its first row.
    pub understood: Vec<String>,
    /// The table's columns that were not read.
    pub unread: Vec<String>,
}

/// Reads a table through a mapping.
///
/// # Errors
/// What is wrong with the mapping, by key, or with the table, by line.
pub fn import(table: &Path, mapping: &Path) -> Result<ImportedTable, FileError> {
    let file: MappingFile = from_toml(mapping, &read_text(mapping)?)?;
    let separator = separator(mapping, &file)?;
    let comma = match file.decimal.as_str() {
        "." => false,
        "," => true,
        other => {
            let problem = format!("found {other:?}; \".\" or \",\" is allowed");
            return Err(FileError::new(mapping, problem).at("decimal"));
        }
    };
    if comma && separator == Separator::Sign(crate::csv::Delimiter::Comma) {
        let problem = "is the decimal comma, too; fields need another delimiter";
        return Err(FileError::new(mapping, problem).at("delimiter"));
    }
    let raw = RawTable::read(table, separator, file.header_line, &file.skip_lines)?;
    let resolver = Resolver {
        mapping,
        table: &raw,
        table_path: table,
        comma,
    };
    let plan = ReadingColumns::of(&resolver, &file)?;
    let empty = (file.skip_empty.iter())
        .map(|name| resolver.column("skip_empty", name))
        .collect::<Result<Vec<usize>, _>>()?;
    let is_read =
        |row: &&(usize, Vec<String>)| empty.iter().all(|&column| !row.1[column].is_empty());
    let rows: Vec<&(usize, Vec<String>)> = raw.rows.iter().filter(is_read).collect();
    let Some(first) = rows.first() else {
        let problem = "has no row in which nothing of skip_empty is empty";
        return Err(FileError::new(table, problem));
    };
    let text = plan.text(&resolver, &rows)?;
    let mut understood = plan.understood.clone();
    understood.push(in_words(&text, first.0));
    let read = plan.columns();
    Ok(ImportedTable {
        rows: rows.len(),
        left_out: raw.rows.len() - rows.len(),
        ranges: ranges(&text),
        unread: (raw.columns.iter().enumerate())
            .filter(|(index, _)| !read.contains(index) && !empty.contains(index))
            .map(|(_, name)| name.clone())
            .collect(),
        understood,
        text,
    })
}
