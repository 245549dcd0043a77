//! CSV files of numbers, and of some words, as laboratories and their spreadsheets write them: one reader for plans and
//! measurements.
//!
//! It reads UTF-8 and UTF-16; commas, semicolons or tabs between the fields; decimal points, and
//! decimal commas where semicolons or tabs separate; quoted fields; and the line ends of every
//! system. What can be read in two ways is an error that says so.

mod dialect;
mod encoding;
mod raw;

use std::path::Path;

use nalgebra::Vector3;

use crate::codes::ErrorCode;
use crate::files::FileError;
use crate::quantities::limits::MOST_MEASUREMENTS;
use crate::quantities::plausible::{self, Kind};
use dialect::Decimals;

pub use dialect::Delimiter;
pub use raw::{RawTable, Separator};

/// A spreadsheet takes a word that begins so for a formula, and this program for a comment.
const NO_WORD: [char; 5] = ['=', '+', '-', '@', '#'];

/// Whether a word begins as a formula or a comment, apostrophes before it left out.
fn is_like_formula(word: &str) -> bool {
    word.trim_start_matches('\'').starts_with(NO_WORD)
}

/// A problem with the table itself, and not with what it says.
fn wrong_table(path: &Path, problem: impl Into<String>) -> FileError {
    FileError::new(path, problem).code(ErrorCode::Table)
}

/// A word as a field (RFC 4180). What a spreadsheet would calculate gets an apostrophe, which it takes for the sign of a text, and
/// readers take away.
pub fn word_field(word: &str) -> String {
    let text = if is_like_formula(word) {
        format!("'{word}")
    } else {
        word.to_owned()
    };
    if text.contains([',', ';', '\t', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text
    }
}

/// The word that [`word_field`] wrote as a field, whose quotes are away.
fn word_of(field: &str) -> &str {
    match field.strip_prefix('\'') {
        Some(word) if is_like_formula(word) => word,
        _ => field,
    }
}

/// A CSV file of numbers, read whole: its rows with their line numbers, columns found by name.
#[derive(Debug)]
pub struct Table<'a> {
    path: &'a Path,
    header_line: usize,
    columns: Vec<String>,
    rows: Vec<TableRow>,
}

#[derive(Debug)]
struct TableRow {
    line: usize,
    /// The numbers; zero in columns of words.
    values: Vec<f64>,
    /// As many, empty in columns of numbers; none where the table has no words.
    words: Vec<String>,
}

/// Which columns a file may have.
#[derive(Debug, Clone, Default)]
pub struct Columns {
    /// Those that it has.
    pub required: Vec<String>,
    /// Groups of which it has one besides, whole; the first where it has no column of any.
    pub one_of: Vec<Vec<String>>,
    /// Those that it may have besides.
    pub optional: Vec<String>,
    /// Those of these whose fields are words.
    pub words: Vec<String>,
    /// Rows in which all of one of these groups of columns are empty are left out: they are not filled in yet.
    pub may_be_empty: Vec<Vec<String>>,
}

impl Columns {
    /// All that a header needs.
    fn needed(&self, header: &[String]) -> Vec<String> {
        [&self.required, self.group(header)].concat()
    }

    /// Whether a row has nothing in one of the groups that may be empty.
    fn is_left_out(&self, columns: &[String], fields: &[String]) -> bool {
        self.may_be_empty.iter().any(|group| {
            let of_it = |(column, _): &(&String, &String)| group.contains(column);
            let mut found = columns.iter().zip(fields).filter(of_it).peekable();
            found.peek().is_some() && found.all(|(_, field)| field.is_empty())
        })
    }

    /// The group that a header has.
    fn group(&self, header: &[String]) -> &[String] {
        let is_there = |group: &&Vec<String>| group.iter().any(|column| header.contains(column));
        let group = self.one_of.iter().find(is_there).or(self.one_of.first());
        group.map_or(&[], Vec::as_slice)
    }
}

impl<'a> Table<'a> {
    /// Reads a CSV file whose header has all `required` columns and, beside them, only `optional`
    /// ones. Lines that begin with # are comments, and those without any field are blank.
    ///
    /// # Errors
    /// The file cannot be read, a column is missing, unknown or given twice, a row has another
    /// number of fields, a field is not a finite number or can be read in two ways, or there is no
    /// row.
    pub fn read(
        path: &'a Path,
        required: &[String],
        optional: &[String],
    ) -> Result<Self, FileError> {
        let columns = Columns {
            required: required.to_vec(),
            optional: optional.to_vec(),
            ..Columns::default()
        };
        Self::read_with(path, &columns)
    }

    /// The same for a file that may have one group of columns or another.
    ///
    /// # Errors
    /// As [`read`](Self::read); and no row is filled in.
    pub fn read_with(path: &'a Path, wanted: &Columns) -> Result<Self, FileError> {
        Self::read_as(path, |_| wanted.clone())
    }

    /// The same for a file whose header says which columns it may have.
    pub fn read_as(
        path: &'a Path,
        wanted: impl Fn(&[String]) -> Columns,
    ) -> Result<Self, FileError> {
        let text = encoding::read_text(path)?;
        let mut lines = content_lines(&text).peekable();
        let separator_line =
            (lines.peek()).and_then(|(_, line)| Delimiter::of_separator_line(line));
        if separator_line.is_some() {
            lines.next();
        }
        let (header_line, header) = lines.next().ok_or_else(|| {
            wrong_table(path, "is empty").hint(header_hint(&wanted(&[]).needed(&[])))
        })?;
        let at = |line: usize| move |error: FileError| error.at(format!("line {line}"));
        let delimiter = match separator_line {
            Some(delimiter) => delimiter,
            None => Delimiter::of_header(path, header).map_err(at(header_line))?,
        };
        let split = |line, content| delimiter.split(path, content).map_err(at(line));
        let mut columns = split(header_line, header)?;
        // Spreadsheets fill up lines to the width of the widest.
        while columns.last().is_some_and(String::is_empty) {
            columns.pop();
        }
        let wanted = wanted(&columns);
        let needed = wanted.needed(&columns);
        check_columns(path, header_line, &columns, &needed, &wanted.optional)?;
        let mut is_unfinished = false;
        let mut decimals = Decimals::new(path, delimiter);
        let mut rows = Vec::new();
        for (line, content) in lines {
            let mut fields = split(line, content)?;
            if fields.iter().all(String::is_empty) {
                continue;
            }
            while fields.len() > columns.len() && fields.last().is_some_and(String::is_empty) {
                fields.pop();
            }
            if fields.len() != columns.len() {
                return Err(at(line)(delimiter.miscounted(
                    path,
                    fields.len(),
                    columns.len(),
                )));
            }
            if wanted.is_left_out(&columns, &fields) {
                is_unfinished = true;
                continue;
            }
            let mut words = Vec::new();
            let values = (fields.iter().zip(&columns))
                .map(|(field, column)| {
                    let is_word = wanted.words.contains(column);
                    if !wanted.words.is_empty() {
                        words.push(if is_word {
                            word_of(field).to_owned()
                        } else {
                            String::new()
                        });
                    }
                    if is_word {
                        return Ok(0.0);
                    }
                    let value = decimals.number(line, column, field)?;
                    kind_of(column).check(value).map_err(|problem| {
                        wrong_table(path, format!("{column}: {problem}")).at(format!("line {line}"))
                    })
                })
                .collect::<Result<Vec<f64>, FileError>>()?;
            rows.push(TableRow {
                line,
                values,
                words,
            });
        }
        decimals.check()?;
        if rows.len() > MOST_MEASUREMENTS as usize {
            let problem = format!(
                "has {} rows; at most {MOST_MEASUREMENTS} are allowed",
                rows.len()
            );
            return Err(wrong_table(path, problem));
        }
        if rows.is_empty() && is_unfinished {
            return Err(wrong_table(path, "has no row that is filled in"));
        }
        if rows.is_empty() {
            return Err(wrong_table(path, "has no row below its header"));
        }
        Ok(Self {
            path,
            header_line,
            columns,
            rows,
        })
    }

    /// Whether the file has all of these columns.
    pub fn has(&self, columns: &[&str]) -> bool {
        (columns.iter()).all(|column| self.columns.iter().any(|known| known == column))
    }

    /// An error about the header.
    pub fn wrong_header(&self, problem: impl Into<String>) -> FileError {
        FileError::new(self.path, problem).at(format!("line {}", self.header_line))
    }

    /// The rows in order.
    pub fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        self.rows.iter().map(|row| Row { table: self, row })
    }
}

/// One row of a [`Table`].
#[derive(Debug, Clone, Copy)]
pub struct Row<'a> {
    table: &'a Table<'a>,
    row: &'a TableRow,
}

impl<'a> Row<'a> {
    /// The value in a column that the table has; NaN where it has none.
    pub fn get(&self, column: &str) -> f64 {
        self.place(column)
            .map_or(f64::NAN, |index| self.row.values[index])
    }

    /// The word in a column of words; `None` where the table has no such column.
    pub fn word(&self, column: &str) -> Option<&'a str> {
        let words = &self.row.words;
        (self.place(column)).and_then(|index| words.get(index).map(String::as_str))
    }

    fn place(&self, column: &str) -> Option<usize> {
        (self.table.columns.iter()).position(|known| known == column)
    }

    /// The values of three columns.
    pub fn vector(&self, columns: [&str; 3]) -> Vector3<f64> {
        columns.map(|column| self.get(column)).into()
    }

    /// The number of its line.
    pub const fn line(&self) -> usize {
        self.row.line
    }

    /// An error about this row.
    pub fn wrong(&self, problem: impl Into<String>) -> FileError {
        FileError::new(self.table.path, problem).at(format!("line {}", self.row.line))
    }
}

/// The comments of a CSV file, without # and what a spreadsheet puts around them.
pub fn comments(path: &Path) -> Result<Vec<String>, FileError> {
    let text = encoding::read_text(path)?;
    let around = |sign: char| sign.is_whitespace() || ['#', '"', ',', ';'].contains(&sign);
    Ok(numbered(&text)
        .filter(|(_, line)| is_comment(line))
        .map(|(_, line)| line.trim_matches(around).to_owned())
        .collect())
}

/// What a column holds, by the unit in its name.
fn kind_of(column: &str) -> &'static Kind {
    match column.rsplit_once('_').map(|(_, unit)| unit) {
        Some("deg") => &plausible::ANGLE,
        Some("n") => &plausible::FORCE,
        Some("nm") => &plausible::TORQUE,
        Some("mm") => &plausible::POSITION,
        Some("mrad") => &plausible::ROTATION,
        Some("c") => &plausible::TEMPERATURE,
        _ => &plausible::COUNT,
    }
}

/// The lines with their numbers from 1.
fn numbered(text: &str) -> impl Iterator<Item = (usize, &str)> {
    (1..).zip(text.lines())
}

fn is_comment(line: &str) -> bool {
    line.trim().trim_start_matches('"').starts_with('#')
}

/// The lines that are neither blank nor comments, with their numbers from 1.
fn content_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    numbered(text).filter(|(_, line)| !line.trim().is_empty() && !is_comment(line))
}

fn header_hint(required: &[String]) -> String {
    format!("the header must be: {}", required.join(","))
}

fn check_columns(
    path: &Path,
    line: usize,
    found: &[String],
    required: &[String],
    optional: &[String],
) -> Result<(), FileError> {
    let wrong = |problem: String| {
        wrong_table(path, problem)
            .at(format!("line {line}"))
            .hint(header_hint(required))
    };
    for (index, column) in found.iter().enumerate() {
        if !required.contains(column) && !optional.contains(column) {
            return Err(wrong(format!("found the unknown column {column:?}")));
        }
        if found[..index].contains(column) {
            return Err(wrong(format!("found the column {column:?} twice")));
        }
    }
    (required.iter())
        .find(|column| !found.contains(column))
        .map_or(Ok(()), |missing| {
            Err(wrong(format!(
                "the column {missing:?} is missing; found {} columns, {} are needed",
                found.len(),
                required.len()
            )))
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Words of all kinds of signs come back, and none begins as a formula.
    #[test]
    fn words_come_back() {
        let signs = ["'", "\"", "=", "+", "-", "@", "#", ",", ";", "a", "\u{fc}"];
        let two = (signs.iter()).flat_map(|one| signs.map(|other| format!("{one}{other}")));
        let words: Vec<String> = two
            .flat_map(|two| signs.map(|end| format!("{two}{end}")))
            .collect();
        let mut text = "number,word\n".to_owned();
        for word in &words {
            let field = word_field(word);
            let inside = field.strip_prefix('"').unwrap_or(&field);
            assert!(!inside.starts_with(NO_WORD), "{field}");
            text += &format!("1,{field}\n");
        }
        let file = tempfile::NamedTempFile::new().expect("a file");
        std::fs::write(file.path(), text).expect("written");
        let columns = Columns {
            required: ["number", "word"].map(str::to_owned).to_vec(),
            words: vec!["word".to_owned()],
            ..Columns::default()
        };
        let table = Table::read_with(file.path(), &columns).expect("a table");
        let found: Vec<&str> = table.rows().filter_map(|row| row.word("word")).collect();
        assert_eq!(found, words);
    }
}
