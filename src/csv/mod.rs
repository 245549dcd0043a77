//! CSV files of numbers, and of some words, as laboratories and their spreadsheets write them: one reader for plans and
//! measurements.
//!
//! It reads UTF-8, and UTF-16 with a byte order mark; commas, semicolons or tabs between the fields; decimal points, and
//! decimal commas where semicolons or tabs separate; quoted fields; and the line ends of every
//! system. What can be read in two ways is an error that says so.

mod dialect;
mod encoding;
mod fields;
mod sheet;

use std::path::Path;

use ::csv::StringRecord;
use nalgebra::Vector3;

use crate::codes::ErrorCode;
use crate::files::FileError;
use crate::quantities::plausible::{self, Kind};
use crate::text::wrong_name;

pub use dialect::Decimals;
pub use fields::Fields;
pub use sheet::Sheet;

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
    /// Those whose fields may be empty where the row needs none: NaN there.
    pub blank: Vec<String>,
}

/// Names as their own.
pub fn owned(names: &[&str]) -> Vec<String> {
    names.iter().map(|&name| name.to_owned()).collect()
}

impl Columns {
    /// Those that a file has, and those of numbers and of words that it may have besides.
    pub fn of(required: Vec<String>, numbers: &[&str], words: &[&str]) -> Self {
        Self {
            required,
            optional: owned(&[numbers, words].concat()),
            words: owned(words),
            ..Self::default()
        }
    }

    /// All that a header needs.
    fn needed(&self, header: &[String]) -> Vec<String> {
        [&self.required, self.group(header)].concat()
    }

    /// Whether a row has nothing in one of the groups that may be empty.
    fn is_left_out(&self, columns: &[String], fields: &StringRecord) -> bool {
        self.may_be_empty.iter().any(|group| {
            let of_it = |(column, _): &(&String, &str)| group.contains(column);
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
    /// Reads a CSV file whose header has all required columns and, beside them, only optional ones.
    ///
    /// # Errors
    /// As [`Fields::read`]; and a column is missing, unknown or given twice, a field is not a finite number or can be read in
    /// two ways, or no row is filled in.
    pub fn read_with(path: &'a Path, wanted: &Columns) -> Result<Self, FileError> {
        Self::read_as(path, |_| wanted.clone())
    }

    /// The same for a file whose header says which columns it may have.
    pub fn read_as(
        path: &'a Path,
        wanted: impl Fn(&[String]) -> Columns,
    ) -> Result<Self, FileError> {
        let (fields, wanted) = Fields::read(path, |line, columns| {
            let wanted = wanted(columns);
            check_columns(path, line, columns, &wanted)?;
            Ok(wanted)
        })?;
        let Fields { columns, rows, .. } = &fields;
        let is_word: Vec<bool> = (columns.iter())
            .map(|column| wanted.words.contains(column))
            .collect();
        let mut decimals = Decimals::new(path, fields.delimiter);
        let mut filled = Vec::new();
        for (line, fields) in rows {
            if wanted.is_left_out(columns, fields) {
                continue;
            }
            let words = match wanted.words.as_slice() {
                [] => Vec::new(),
                _ => (fields.iter().zip(&is_word))
                    .map(|(field, &is_word)| if is_word { word_of(field) } else { "" }.to_owned())
                    .collect(),
            };
            let value = |(place, field): (usize, &str)| {
                if is_word[place] {
                    return Ok(0.0);
                }
                if field.is_empty() && wanted.blank.contains(&columns[place]) {
                    return Ok(f64::NAN);
                }
                decimals.number(*line, &columns[place], field)
            };
            filled.push(TableRow {
                line: *line,
                values: fields
                    .iter()
                    .enumerate()
                    .map(value)
                    .collect::<Result<_, _>>()?,
                words,
            });
        }
        decimals.check()?;
        if filled.is_empty() {
            return Err(wrong_table(path, "has no row that is filled in"));
        }
        Ok(Self {
            path,
            header_line: fields.header_line,
            columns: fields.columns,
            rows: filled,
        })
    }

    /// Whether the file has all of these columns.
    pub fn has(&self, columns: &[&str]) -> bool {
        (columns.iter()).all(|column| self.columns.iter().any(|known| known == column))
    }

    /// Whether the file has the columns of a group, which come together.
    ///
    /// # Errors
    /// It has some of them.
    pub fn has_group(&self, group: &[&str]) -> Result<bool, FileError> {
        let there: Vec<_> = group.iter().filter(|column| self.has(&[column])).collect();
        if there.is_empty() || there.len() == group.len() {
            return Ok(!there.is_empty());
        }
        let problem = format!("found {there:?}; these columns come together: {group:?}");
        Err(self.wrong_header(problem))
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

    /// The name in a column of words, where the table has it.
    ///
    /// # Errors
    /// It is no name.
    pub fn name(&self, column: &str) -> Result<Option<String>, FileError> {
        let word = self.word(column);
        match word.and_then(wrong_name) {
            Some(problem) => Err(self.wrong(format!("{column}: {problem}"))),
            None => Ok(word.map(str::to_owned)),
        }
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

fn check_columns(
    path: &Path,
    line: usize,
    found: &[String],
    wanted: &Columns,
) -> Result<(), FileError> {
    let needed = wanted.needed(found);
    let wrong = |problem: String| {
        let hint = format!("the header must be: {}", needed.join(","));
        let wrong = wrong_table(path, problem).hint(hint);
        if found.is_empty() {
            wrong
        } else {
            wrong.at(format!("line {line}"))
        }
    };
    if found.is_empty() {
        return Err(wrong("is empty".to_owned()));
    }
    for (index, column) in found.iter().enumerate() {
        if !needed.contains(column) && !wanted.optional.contains(column) {
            return Err(wrong(format!("found the unknown column {column:?}")));
        }
        if found[..index].contains(column) {
            return Err(wrong(format!("found the column {column:?} twice")));
        }
    }
    match needed.iter().find(|column| !found.contains(column)) {
        None => Ok(()),
        Some(missing) => Err(wrong(format!(
            "the column {missing:?} is missing; found {} columns, {} are needed",
            found.len(),
            needed.len()
        ))),
    }
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
