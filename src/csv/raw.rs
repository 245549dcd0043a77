//! A table as somebody else's program writes it: fields as texts, columns by any names.

use std::path::Path;

use super::dialect::Delimiter;
use super::encoding::read_text;
use super::wrong_table;
use crate::files::FileError;
use crate::quantities::limits::MOST_MEASUREMENTS;

/// What separates the fields of a table.
#[derive(Debug, Clone, Copy, Default, serde::Deserialize)]
pub enum Separator {
    /// One of those that the header has.
    #[default]
    #[serde(skip)]
    InHeader,
    /// `,`
    #[serde(rename = ",")]
    Comma,
    /// `;`
    #[serde(rename = ";")]
    Semicolon,
    /// A tab.
    #[serde(rename = "tab")]
    Tab,
    /// Any space.
    #[serde(rename = "space")]
    Space,
}

/// A table of texts, read whole.
#[derive(Debug)]
pub struct RawTable {
    /// The names of its columns; their numbers from 1 where it has no header.
    pub columns: Vec<String>,
    /// The rows with the numbers of their lines.
    pub rows: Vec<(usize, Vec<String>)>,
}

impl RawTable {
    /// Reads a table whose header is in this line (from 1; 0 for none), without the lines of these numbers, those that
    /// begin with #, and blank ones.
    ///
    /// # Errors
    /// The file cannot be read, has two delimiters or rows of different lengths, or has no row.
    pub fn read(
        path: &Path,
        separator: Separator,
        header_line: Option<usize>,
        skipped: &[usize],
    ) -> Result<Self, FileError> {
        let text = read_text(path)?;
        let first = header_line.unwrap_or(1).max(1);
        let mut lines = (1..).zip(text.lines()).filter(|(number, line)| {
            let is_comment = line.trim_start_matches([' ', '\t', '"']).starts_with('#');
            *number >= first && !skipped.contains(number) && !line.trim().is_empty() && !is_comment
        });
        let mut lines = lines.by_ref().peekable();
        let Some(&(number, header)) = lines.peek() else {
            return Err(wrong_table(path, "has no line to read"));
        };
        let at = |line: usize| move |error: FileError| error.at(format!("line {line}"));
        let hint = "say in the mapping which separates the fields: delimiter = \";\"";
        let delimiter = match separator {
            Separator::Space => None,
            Separator::Comma => Some(Delimiter::Comma),
            Separator::Semicolon => Some(Delimiter::Semicolon),
            Separator::Tab => Some(Delimiter::Tab),
            Separator::InHeader => {
                let found = Delimiter::of_header(path, header);
                Some(found.map_err(|error| at(number)(error.hint(hint)))?)
            }
        };
        let split = |line: usize, text: &str| match delimiter {
            None => Ok(text.split_whitespace().map(str::to_owned).collect()),
            Some(delimiter) => delimiter.split(path, text).map_err(at(line)),
        };
        let mut columns: Vec<String> = split(number, header)?;
        if header_line == Some(0) {
            columns = (1..=columns.len())
                .map(|column| column.to_string())
                .collect();
        } else {
            while columns.last().is_some_and(String::is_empty) {
                columns.pop();
            }
            lines.next();
        }
        let mut rows = Vec::new();
        for (line, text) in lines {
            let mut fields: Vec<String> = split(line, text)?;
            if fields.iter().all(String::is_empty) {
                continue;
            }
            while fields.len() > columns.len() && fields.last().is_some_and(String::is_empty) {
                fields.pop();
            }
            if fields.len() != columns.len() {
                let problem = format!(
                    "found {} fields; the first line has {}",
                    fields.len(),
                    columns.len()
                );
                return Err(at(line)(wrong_table(path, problem).hint(
                    "say in the mapping what separates the fields (delimiter), which line is the header (header_line) and \
                     which lines are none of the table's (skip_lines)",
                )));
            }
            rows.push((line, fields));
            if rows.len() > MOST_MEASUREMENTS as usize {
                let problem = format!("has more than {MOST_MEASUREMENTS} rows");
                return Err(wrong_table(path, problem));
            }
        }
        if rows.is_empty() {
            return Err(wrong_table(path, "has no row below its header"));
        }
        Ok(Self { columns, rows })
    }
}
