//! What separates fields, and what separates the decimals of a number.

use std::path::Path;

use super::{kind_of, wrong_table};
use crate::files::FileError;

/// What may separate fields, and what several are called.
const DELIMITERS: [(u8, &str); 3] = [(b',', "commas"), (b';', "semicolons"), (b'\t', "tabs")];

/// Spreadsheets may say it in a first line of their own: `sep=;`.
pub(super) fn delimiter_of_separator_line(line: &str) -> Option<u8> {
    let said = line.trim_matches(['"', ' ']).strip_prefix("sep=")?;
    let mut known = DELIMITERS.iter().map(|(delimiter, _)| *delimiter);
    known.find(|&delimiter| said.as_bytes().first() == Some(&delimiter))
}

/// The one in the header, since no column's name contains any.
pub(super) fn delimiter_of_header(path: &Path, header: &str) -> Result<u8, FileError> {
    let is_there = |(delimiter, _): &(u8, &str)| header.as_bytes().contains(delimiter);
    let mut found = DELIMITERS.into_iter().filter(is_there);
    match (found.next(), found.next()) {
        (one, None) => Ok(one.map_or(b',', |(delimiter, _)| delimiter)),
        (Some((_, one)), Some((_, other))) => {
            let found = format!("found {one} and {other} between the columns' names");
            Err(wrong_table(path, found + "; one of them is allowed"))
        }
        (None, Some(_)) => Ok(b','),
    }
}

/// A number with its line, as it is written.
type WrittenNumber = (usize, String);

/// Reads the numbers of a file, all with one decimal sign.
#[derive(Debug)]
pub struct Decimals<'a> {
    path: &'a Path,
    delimiter: u8,
    point: Option<WrittenNumber>,
    /// The first number with a comma.
    comma: Option<WrittenNumber>,
    /// Whether some comma cannot be a thousands separator.
    is_decimal: bool,
}

impl<'a> Decimals<'a> {
    /// Those of a file with this between its fields.
    pub const fn new(path: &'a Path, delimiter: u8) -> Self {
        Self {
            path,
            delimiter,
            point: None,
            comma: None,
            is_decimal: false,
        }
    }

    /// The value of a field, which is plausible for the unit in the column's name.
    pub fn number(&mut self, line: usize, column: &str, field: &str) -> Result<f64, FileError> {
        let value = self.any_number(line, column, field)?;
        kind_of(column).check(value).map_err(|problem| {
            wrong_table(self.path, format!("{column}: {problem}")).at(format!("line {line}"))
        })
    }

    /// The value of a field of whatever unit.
    pub fn any_number(&mut self, line: usize, column: &str, field: &str) -> Result<f64, FileError> {
        let wrong = |problem: String| {
            wrong_table(self.path, format!("{column}: found {field:?}{problem}"))
                .at(format!("line {line}"))
        };
        let plain = match (field.matches(',').count(), field.contains('.')) {
            (0, _) => field.to_owned(),
            (_, true) | (2.., _) => {
                return Err(wrong(
                    "; a number without thousands separators is allowed".to_owned(),
                ));
            }
            (_, false) if self.delimiter == b',' => {
                return Err(wrong(
                    ", where the comma can be a decimal one or separate thousands".to_owned(),
                )
                .hint("write a decimal point, or put semicolons between the fields"));
            }
            (_, false) => field.replace(',', "."),
        };
        let value = match plain.parse::<f64>() {
            Ok(value) if value.is_finite() => value,
            _ => {
                let error = wrong("; a finite number is allowed".to_owned());
                return Err(if field.contains('\u{2212}') {
                    error.hint("the minus sign is a typesetter's (U+2212): write -")
                } else {
                    error
                });
            }
        };
        let written = || Some((line, field.to_owned()));
        if field.contains(',') {
            self.comma = self.comma.take().or_else(written);
            self.is_decimal |= !may_separate_thousands(field);
        } else if field.contains('.') {
            self.point = self.point.take().or_else(written);
        }
        if let (Some((of_point, point)), Some((of_comma, comma))) = (&self.point, &self.comma) {
            let problem = format!(
                "found {point:?} in line {of_point} and {comma:?} in line {of_comma}; one decimal sign \
                 is allowed in a file, and no thousands separators"
            );
            return Err(wrong_table(self.path, problem).at(format!("line {line}")));
        }
        Ok(value)
    }

    /// Whether the file's commas were decimal ones for sure.
    pub fn check(&self) -> Result<(), FileError> {
        match &self.comma {
            Some((line, field)) if !self.is_decimal => Err(wrong_table(
                self.path,
                format!(
                    "found {field:?}, where the comma can be a decimal one or separate thousands, as \
                     every other comma of the file"
                ),
            )
            .at(format!("line {line}"))
            .hint("write decimal points, or another number of decimals than three")),
            _ => Ok(()),
        }
    }
}

/// Whether a comma can stand before thousands: one to three digits before it, of which the first is
/// not zero, and three after it.
fn may_separate_thousands(field: &str) -> bool {
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let (before, after) = field.split_once(',').unwrap_or((field, ""));
    let before = before.trim_start_matches(['+', '-']);
    let counts = (1..=3).contains(&before.len()) && after.len() == 3;
    counts && !before.starts_with('0') && digits(before) && digits(after)
}
