//! What separates fields, and what separates the decimals of a number.

use std::path::Path;

use super::wrong_table;
use crate::files::FileError;

/// What separates fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Delimiter {
    /// `,`
    Comma,
    /// `;`
    Semicolon,
    /// A tab.
    Tab,
}

impl Delimiter {
    const ALL: [Self; 3] = [Self::Comma, Self::Semicolon, Self::Tab];

    /// Its sign, and what several are called.
    const fn spelled(self) -> (char, &'static str) {
        match self {
            Self::Comma => (',', "commas"),
            Self::Semicolon => (';', "semicolons"),
            Self::Tab => ('\t', "tabs"),
        }
    }

    /// Spreadsheets may say it in a first line of their own: `sep=;`.
    pub(super) fn of_separator_line(line: &str) -> Option<Self> {
        let line = line.trim_matches(['"', ' ']);
        let said = line.strip_prefix("sep=")?;
        Self::ALL
            .into_iter()
            .find(|delimiter| said.starts_with(delimiter.spelled().0))
    }

    /// The one in the header, since no column's name contains any.
    pub(super) fn of_header(path: &Path, header: &str) -> Result<Self, FileError> {
        let found: Vec<Self> = Self::ALL
            .into_iter()
            .filter(|delimiter| header.contains(delimiter.spelled().0))
            .collect();
        match found.as_slice() {
            [] => Ok(Self::Comma),
            [one] => Ok(*one),
            [one, other, ..] => {
                let [one, other] = [one, other].map(|each| each.spelled().1);
                let found = format!("found {one} and {other} between the columns' names");
                Err(wrong_table(path, found + "; one of them is allowed"))
            }
        }
    }

    /// The fields of a line without space and quotes around them; a delimiter in quotes is none, and a doubled quote there is
    /// one.
    pub(super) fn split(self, path: &Path, line: &str) -> Result<Vec<String>, FileError> {
        let mut fields = vec![String::new()];
        let mut quoted = false;
        let mut signs = line.chars().peekable();
        while let Some(sign) = signs.next() {
            if sign == '"' && quoted && signs.next_if_eq(&'"').is_some() {
                fields
                    .last_mut()
                    .into_iter()
                    .for_each(|field| field.push(sign));
            } else if sign == '"' {
                quoted = !quoted;
            } else if sign == self.spelled().0 && !quoted {
                fields.push(String::new());
            } else if let Some(field) = fields.last_mut() {
                field.push(sign);
            }
        }
        if quoted {
            return Err(wrong_table(path, "a quote is not closed"));
        }
        for field in &mut fields {
            *field = field.trim().to_owned();
        }
        Ok(fields)
    }

    /// The error of a row that has not as many fields as the header.
    pub(super) fn miscounted(self, path: &Path, found: usize, columns: usize) -> FileError {
        let wrong = wrong_table(
            path,
            format!("found {found} fields; the header has {columns}"),
        );
        if self == Self::Comma && found > columns {
            wrong.hint(
                "decimal commas? Where commas separate the fields, write decimal points, or put \
                 semicolons between the fields",
            )
        } else {
            wrong
        }
    }
}

/// A number with its line, as it is written.
type WrittenNumber = (usize, String);

/// Reads the numbers of a file, all with one decimal sign.
#[derive(Debug)]
pub struct Decimals<'a> {
    path: &'a Path,
    delimiter: Delimiter,
    point: Option<WrittenNumber>,
    /// The first number with a comma.
    comma: Option<WrittenNumber>,
    /// Whether some comma cannot be a thousands separator.
    is_decimal: bool,
}

impl<'a> Decimals<'a> {
    pub const fn new(path: &'a Path, delimiter: Delimiter) -> Self {
        Self {
            path,
            delimiter,
            point: None,
            comma: None,
            is_decimal: false,
        }
    }

    /// The value of a field.
    pub fn number(&mut self, line: usize, column: &str, field: &str) -> Result<f64, FileError> {
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
            (_, false) if self.delimiter == Delimiter::Comma => {
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
