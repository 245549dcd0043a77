//! A mapping in which every column is found in the table.

use std::path::Path;

use crate::csv::{Delimiter, RawTable, Separator};
use crate::files::FileError;
use crate::text::nearest;

use super::mapping::{MappingFile, ScalarMapping, WordMapping};
use super::units::{UnitFactor, UnitKind};

/// Looks up what a mapping names.
pub(super) struct Resolver<'a> {
    pub mapping: &'a Path,
    pub table: &'a RawTable,
    pub table_path: &'a Path,
    pub comma: bool,
}

/// Where a number comes from, and how it becomes one of SI.
#[derive(Debug, Clone)]
pub(super) struct ForeignNumber {
    place: NumberSource,
    unit: UnitFactor,
    /// 1 or -1.
    sign: f64,
    offset: f64,
}

#[derive(Debug, Clone)]
enum NumberSource {
    Column(usize),
    Constant(f64),
}

/// Where a word comes from.
#[derive(Debug, Clone)]
pub(super) enum Word {
    Column(usize),
    Constant(String),
}

impl Resolver<'_> {
    pub fn wrong(&self, key: &str, problem: impl Into<String>) -> FileError {
        FileError::new(self.mapping, problem).at(key)
    }

    /// The place of a column.
    pub fn column(&self, key: &str, name: &str) -> Result<usize, FileError> {
        let all = &self.table.columns;
        let mut found = (0..all.len()).filter(|&index| all[index] == name.trim());
        match (found.next(), found.next()) {
            (Some(place), None) => Ok(place),
            (Some(_), Some(_)) => {
                let problem = format!(
                    "found {name:?}, which {} has twice",
                    self.table_path.display()
                );
                Err(self.wrong(key, problem).hint(
                    "rename one of the two; or say header_line = 0 and skip the header's line: columns are then named by their numbers",
                ))
            }
            (None, _) => {
                let problem = format!(
                    "found {name:?}; {} has no such column, it has: {}",
                    self.table_path.display(),
                    shown(all)
                );
                let wrong = self.wrong(key, problem);
                let known = all.iter().map(String::as_str);
                Err(match nearest(name, known) {
                    Some(near) => wrong.hint(format!("did you mean {near:?}?")),
                    None => wrong,
                })
            }
        }
    }

    /// The factor and the offset of a unit.
    pub fn unit(
        &self,
        key: &str,
        quantity: UnitKind,
        name: &str,
    ) -> Result<(UnitFactor, f64), FileError> {
        quantity.unit(name).map_err(|(problem, hint)| {
            let wrong = self.wrong(key, problem);
            match hint {
                Some(hint) => wrong.hint(hint),
                None => wrong,
            }
        })
    }

    /// A column or a constant.
    pub fn number(
        &self,
        key: &str,
        column: Option<&str>,
        value: Option<f64>,
        (unit, offset): (UnitFactor, f64),
    ) -> Result<ForeignNumber, FileError> {
        let place = match (column, value) {
            (Some(column), None) => {
                NumberSource::Column(self.column(&format!("{key}.column"), column)?)
            }
            (None, Some(value)) if value.is_finite() => NumberSource::Constant(value),
            (None, Some(value)) => {
                let problem = format!("found {value}; a finite number is allowed");
                return Err(self.wrong(&format!("{key}.value"), problem));
            }
            _ => {
                return Err(self.wrong(
                    key,
                    "needs a column, or a value that is the same in every row",
                ));
            }
        };
        Ok(ForeignNumber {
            place,
            unit,
            sign: 1.0,
            offset,
        })
    }

    pub fn scalar(
        &self,
        key: &str,
        quantity: UnitKind,
        mapping: Option<&ScalarMapping>,
    ) -> Result<Option<ForeignNumber>, FileError> {
        let Some(mapping) = mapping else {
            return Ok(None);
        };
        let unit = self.unit(&format!("{key}.unit"), quantity, &mapping.unit)?;
        self.number(key, mapping.column.as_deref(), mapping.value, unit)
            .map(Some)
    }

    /// So many columns, or as many constants; `keys` are theirs.
    pub fn numbers(
        &self,
        [columns_key, value_key]: [&str; 2],
        (columns, value): (&[String], &[f64]),
        count: usize,
        (unit, offset): (UnitFactor, f64),
    ) -> Result<Vec<ForeignNumber>, FileError> {
        let number = |place| ForeignNumber {
            place,
            unit,
            sign: 1.0,
            offset,
        };
        let miscounted =
            |key: &str, found: usize| self.wrong(key, format!("found {found}; {count} are needed"));
        match (columns.len(), value.len()) {
            (0, 0) => Err(self.wrong(columns_key, "is missing")),
            (_, 0) if columns.len() == count => (columns.iter())
                .map(|name| Ok(number(NumberSource::Column(self.column(columns_key, name)?))))
                .collect(),
            (0, _) if value.len() == count => {
                if let Some(found) = value.iter().find(|value| !value.is_finite()) {
                    let problem = format!("found {found}; a finite number is allowed");
                    return Err(self.wrong(value_key, problem));
                }
                Ok(value.iter().map(|&value| number(NumberSource::Constant(value))).collect())
            }
            (found, 0) => Err(miscounted(columns_key, found)),
            (0, found) => Err(miscounted(value_key, found)),
            _ => Err(self.wrong(columns_key, "found columns and values that are the same in every row; one of the two is allowed")),
        }
    }

    pub fn word(
        &self,
        key: &str,
        mapping: Option<&WordMapping>,
    ) -> Result<Option<Word>, FileError> {
        let Some(mapping) = mapping else {
            return Ok(None);
        };
        match (&mapping.column, &mapping.value) {
            (Some(column), None) => Ok(Some(Word::Column(
                self.column(&format!("{key}.column"), column)?,
            ))),
            (None, Some(value)) => Ok(Some(Word::Constant(value.clone()))),
            _ => Err(self.wrong(
                key,
                "needs a column, or a value that is the same in every row",
            )),
        }
    }
}

impl ForeignNumber {
    /// The column that is read.
    pub const fn column(&self) -> Option<usize> {
        match self.place {
            NumberSource::Column(column) => Some(column),
            NumberSource::Constant(_) => None,
        }
    }

    /// Times a sign, and with an offset in its own unit.
    pub fn then(mut self, sign: f64, offset: f64) -> Self {
        self.sign = sign;
        self.offset = self.unit.of(offset);
        self
    }

    /// In a row, in SI units.
    pub fn of(
        &self,
        resolver: &Resolver<'_>,
        (line, fields): &(usize, Vec<String>),
    ) -> Result<f64, FileError> {
        let value = match self.place {
            NumberSource::Constant(value) => value,
            NumberSource::Column(column) => {
                let (name, field) = (&resolver.table.columns[column], &fields[column]);
                decimal(field, resolver.comma).map_err(|hint| {
                    let problem = format!("{name}: found {field:?}; a number is allowed");
                    let wrong =
                        FileError::new(resolver.table_path, problem).at(format!("line {line}"));
                    match hint {
                        Some(hint) => wrong.hint(hint),
                        None => wrong,
                    }
                })?
            }
        };
        Ok(self.unit.of(value) * self.sign + self.offset)
    }
}

impl Word {
    pub const fn column(&self) -> Option<usize> {
        match self {
            Self::Column(column) => Some(*column),
            Self::Constant(_) => None,
        }
    }

    pub fn of<'w>(&'w self, fields: &'w [String]) -> &'w str {
        match self {
            Self::Column(column) => &fields[*column],
            Self::Constant(word) => word,
        }
    }
}

/// A number with a decimal comma or point; what to do about it where it is none.
fn decimal(field: &str, comma: bool) -> Result<f64, Option<&'static str>> {
    let (own, other) = if comma { (',', '.') } else { ('.', ',') };
    if field.contains(other) || field.matches(own).count() > 1 {
        return Err(Some(if comma {
            "the mapping says decimal = \",\": a number has one comma then, and no point"
        } else {
            "a decimal comma? say decimal = \",\" in the mapping; thousands are not separated"
        }));
    }
    let value: f64 = field.replace(',', ".").parse().map_err(|_| {
        field
            .is_empty()
            .then_some("name the column in skip_empty to leave such rows out")
    })?;
    if value.is_finite() {
        Ok(value)
    } else {
        Err(Some("leave the row out with skip_lines"))
    }
}

/// What separates fields, as a mapping says.
pub(super) fn separator(path: &Path, mapping: &MappingFile) -> Result<Separator, FileError> {
    Ok(match mapping.delimiter.as_deref() {
        None => Separator::InHeader,
        Some("," | "comma") => Separator::Sign(Delimiter::Comma),
        Some(";" | "semicolon") => Separator::Sign(Delimiter::Semicolon),
        Some("\t" | "tab") => Separator::Sign(Delimiter::Tab),
        Some(" " | "space") => Separator::Space,
        Some(other) => {
            let problem = format!("found {other:?}; \",\", \";\", \"tab\" or \"space\" is allowed");
            return Err(FileError::new(path, problem).at("delimiter"));
        }
    })
}

fn shown(columns: &[String]) -> String {
    const MOST: usize = 40;
    let mut text = columns
        .iter()
        .take(MOST)
        .map(|name| format!("{name:?}"))
        .collect::<Vec<_>>()
        .join(", ");
    if columns.len() > MOST {
        text += &format!(" and {} more", columns.len() - MOST);
    }
    text
}
