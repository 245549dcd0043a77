//! A table as texts: the fields of its header and of its rows.

use std::path::Path;

use ::csv::{ReaderBuilder, StringRecord, Trim};

use super::dialect::{delimiter_of_header, delimiter_of_separator_line};
use super::{content_lines, encoding, is_comment, numbered, wrong_table};
use crate::files::FileError;
use crate::quantities::limits::MOST_MEASUREMENTS;

/// The fields of a table, without space and quotes around them, with the numbers of their lines from 1.
#[derive(Debug)]
pub struct Fields {
    /// The names of its columns; none where the file is empty.
    pub columns: Vec<String>,
    /// Its rows, all as wide as the header.
    pub rows: Vec<(usize, StringRecord)>,
    pub(super) header_line: usize,
    /// What separates its fields.
    pub delimiter: u8,
}

impl Fields {
    /// Reads a table whose header is as it should be: `check` looks at its line and columns before the rows are read. Lines that
    /// begin with # are comments, and those without any field are blank.
    ///
    /// # Errors
    /// The file cannot be read, has two delimiters or an open quote, a row has another number of fields than the header, or
    /// there is no row.
    pub fn read<T>(
        path: &Path,
        check: impl FnOnce(usize, &[String]) -> Result<T, FileError>,
    ) -> Result<(Self, T), FileError> {
        let text = encoding::read_text(path)?;
        let mut lines = content_lines(&text).peekable();
        let said = (lines.peek()).and_then(|(_, line)| delimiter_of_separator_line(line));
        if said.is_some() {
            lines.next();
        }
        let at = |line: usize| move |error: FileError| error.at(format!("line {line}"));
        let (header_line, header) = lines.next().unwrap_or((1, ""));
        let delimiter = match said {
            Some(delimiter) => delimiter,
            None => delimiter_of_header(path, header).map_err(at(header_line))?,
        };
        let split = |line, text| split(path, delimiter, text).map_err(at(line));
        let mut columns = split(header_line, header)?;
        // Spreadsheets fill up lines to the width of the widest.
        while columns.iter().next_back().is_some_and(str::is_empty) {
            columns.truncate(columns.len() - 1);
        }
        let columns: Vec<String> = columns.iter().map(str::to_owned).collect();
        let checked = check(header_line, &columns)?;
        refuse_hidden_row(path, delimiter, &text, (header_line, columns.len()))?;
        let mut rows = Vec::new();
        for (line, text) in lines {
            let mut fields = split(line, text)?;
            if fields.iter().all(str::is_empty) {
                continue;
            }
            if fields.iter().skip(columns.len()).all(str::is_empty) {
                fields.truncate(columns.len());
            }
            if fields.len() != columns.len() {
                let (found, columns) = (fields.len(), columns.len());
                let problem = format!("found {found} fields; the header has {columns}");
                let wrong = wrong_table(path, problem).at(format!("line {line}"));
                return Err(if delimiter == b',' && found > columns {
                    wrong.hint(
                        "decimal commas? Where commas separate the fields, write decimal points, or put semicolons between \
                         the fields",
                    )
                } else {
                    wrong
                });
            }
            rows.push((line, fields));
        }
        if rows.is_empty() {
            return Err(wrong_table(path, "has no row below its header"));
        }
        if rows.len() > MOST_MEASUREMENTS as usize {
            let found = rows.len();
            let problem = format!("has {found} rows; at most {MOST_MEASUREMENTS} are allowed");
            return Err(wrong_table(path, problem));
        }
        let fields = Self {
            columns,
            rows,
            header_line,
            delimiter,
        };
        Ok((fields, checked))
    }
}

/// Refuses a row that is a comment only since its first field is what a spreadsheet writes for an error, such as #N/A or #VALUE!.
fn refuse_hidden_row(
    path: &Path,
    delimiter: u8,
    text: &str,
    (header_line, columns): (usize, usize),
) -> Result<(), FileError> {
    let below = numbered(text).filter(|(line, text)| *line > header_line && is_comment(text));
    for (line, text) in below {
        let Ok(fields) = split(path, delimiter, text) else {
            continue;
        };
        let first = fields.get(0).unwrap_or_default();
        let is_word = first.starts_with('#') && first[1..].starts_with(char::is_uppercase);
        let begins =
            |field: &str| field.starts_with(|sign: char| sign.is_ascii_digit() || sign == '-');
        if is_word && fields.len() == columns && fields.iter().skip(1).any(begins) {
            let problem = format!("found {first:?}, as spreadsheets write errors; a number");
            let hint = "a comment begins with # and a space; a row without a number must go";
            return Err(wrong_table(path, problem)
                .at(format!("line {line}"))
                .hint(hint));
        }
    }
    Ok(())
}

fn split(path: &Path, delimiter: u8, line: &str) -> Result<StringRecord, FileError> {
    if !line.matches('"').count().is_multiple_of(2) {
        return Err(wrong_table(path, "a quote is not closed"));
    }
    let mut fields = StringRecord::new();
    ReaderBuilder::new()
        .has_headers(false)
        .delimiter(delimiter)
        .trim(Trim::All)
        .buffer_capacity(line.len().max(1))
        .from_reader(line.as_bytes())
        .read_record(&mut fields)
        .map_err(|error| wrong_table(path, error.to_string()))?;
    Ok(fields)
}
