//! The columns that a mapping names, found in a table, and their numbers in SI units.

use std::collections::BTreeSet;
use std::path::Path;

use super::mapping::{ForeignQuantity, NumberSource, ScalarMapping, VectorMapping, Word};
use crate::csv::RawTable;
use crate::files::FileError;
use crate::text::nearest;

/// A row with the number of its line.
pub(super) type ForeignRow = (usize, Vec<String>);

/// A table under its mapping.
pub(super) struct Reader<'a> {
    pub mapping: &'a Path,
    pub path: &'a Path,
    pub table: &'a RawTable,
    /// Whether the decimal sign is a comma.
    pub comma: bool,
    /// The columns that are read.
    pub read: BTreeSet<usize>,
}

/// Where a number comes from, and how it becomes one of SI.
#[derive(Debug)]
pub(super) struct ForeignNumber {
    place: Result<usize, f64>,
    quantity: ForeignQuantity,
    /// Of the unit: factor, divisor, what is added.
    unit: [f64; 3],
    sign: f64,
    offset: f64,
    key: String,
}

/// Three numbers, and their standard deviations.
pub(super) type MeasuredNumbers = (Vec<ForeignNumber>, Option<Vec<ForeignNumber>>);

impl Reader<'_> {
    /// What is wrong with the mapping.
    pub fn wrong(&self, key: &str, problem: impl Into<String>) -> FileError {
        FileError::new(self.mapping, problem).at(key)
    }

    fn column(&mut self, key: &str, name: &str) -> Result<usize, FileError> {
        let all = &self.table.columns;
        let table = self.path.display();
        let mut found = (0..all.len()).filter(|&index| all[index] == name.trim());
        match (found.next(), found.next()) {
            (Some(place), None) => {
                self.read.insert(place);
                Ok(place)
            }
            (Some(_), Some(_)) => Err(self
                .wrong(key, format!("found {name:?}, which {table} has twice"))
                .hint("say header_line = 0 and skip the header's line: columns are then named by their numbers")),
            (None, _) => {
                let problem = format!("found {name:?}; {table} has no such column, it has: {}", all.join(", "));
                let near = nearest(name, all.iter().map(String::as_str));
                let wrong = self.wrong(key, problem);
                Err(match near {
                    Some(near) => wrong.hint(format!("did you mean {near:?}?")),
                    None => wrong,
                })
            }
        }
    }

    /// A number of a quantity.
    pub fn number(
        &mut self,
        key: &str,
        (source, unit): (&NumberSource, &str),
        quantity: ForeignQuantity,
    ) -> Result<ForeignNumber, FileError> {
        let place = match source {
            NumberSource::Column(name) => Ok(self.column(key, name)?),
            NumberSource::Value(value) => Err(*value),
        };
        let found = quantity.units.iter().find(|each| each.0 == unit.trim());
        let Some(&(_, times, over, added)) = found else {
            let names: Vec<&str> = quantity.units.iter().map(|unit| unit.0).collect();
            let problem = format!("found {unit:?}; one of {} is allowed", names.join(", "));
            return Err(self.wrong(&format!("{key}.unit"), problem));
        };
        Ok(ForeignNumber {
            place,
            quantity,
            unit: [times, over, added],
            sign: 1.0,
            offset: 0.0,
            key: key.to_owned(),
        })
    }

    /// Numbers of a quantity, and their standard deviations.
    pub fn vector(
        &mut self,
        key: &str,
        mapping: &VectorMapping,
        [quantity, deviation]: [ForeignQuantity; 2],
    ) -> Result<MeasuredNumbers, FileError> {
        let VectorMapping { columns, unit, .. } = mapping;
        let values = self.numbers(key, (columns, unit), quantity)?;
        let deviations = (mapping.std_columns.as_ref()).map(|columns| {
            let unit = mapping.std_unit.as_ref().unwrap_or(unit);
            self.numbers(&format!("{key}.std"), (columns, unit), deviation)
        });
        Ok((values, deviations.transpose()?))
    }

    /// Numbers of one unit.
    pub fn numbers(
        &mut self,
        key: &str,
        (columns, unit): (&[NumberSource], &str),
        quantity: ForeignQuantity,
    ) -> Result<Vec<ForeignNumber>, FileError> {
        let each = |source| self.number(key, (source, unit), quantity);
        columns.iter().map(each).collect()
    }

    /// A number that need not be there.
    pub fn scalar(
        &mut self,
        key: &str,
        mapping: Option<&ScalarMapping>,
        quantity: ForeignQuantity,
    ) -> Result<Option<ForeignNumber>, FileError> {
        mapping
            .map(|mapping| self.number(key, (&mapping.column, &mapping.unit), quantity))
            .transpose()
    }

    /// The place of a column of words, or the word.
    pub fn word(
        &mut self,
        key: &str,
        word: Option<&Word>,
    ) -> Result<Option<Result<usize, String>>, FileError> {
        Ok(match word {
            Some(Word::Column(name)) => Some(Ok(self.column(key, name)?)),
            Some(Word::Value(word)) => Some(Err(word.clone())),
            None => None,
        })
    }

    /// What is wrong in a row.
    pub fn wrong_row(&self, row: &ForeignRow, problem: impl Into<String>) -> FileError {
        FileError::new(self.path, problem).at(format!("line {}", row.0))
    }

    /// A number in a row, in SI units.
    pub fn value(&self, number: &ForeignNumber, row: &ForeignRow) -> Result<f64, FileError> {
        let ForeignNumber { quantity, key, .. } = number;
        let value = match number.place {
            Err(value) => value,
            Ok(column) => {
                let (name, field) = (&self.table.columns[column], &row.1[column]);
                let is_plain = !field.contains(if self.comma { '.' } else { ',' });
                let value = field.replace(',', ".").parse().ok();
                value.filter(|_| is_plain).ok_or_else(|| {
                    let problem = format!("{name}: found {field:?}; a number is allowed");
                    self.wrong_row(row, problem).hint(
                        "the decimal sign is the mapping's decimal, thousands are not separated, and skip_lines leaves lines out",
                    )
                })?
            }
        };
        let [times, over, added] = number.unit;
        let in_si = |value: f64| value * times / over * quantity.si;
        let value = in_si(value) * number.sign + in_si(number.offset) + added;
        let checked = quantity.kind.check(value * quantity.shown);
        checked.map(|_| value).map_err(|problem| {
            self.wrong_row(row, format!("{key}: {problem}"))
                .hint("is the unit in the mapping the right one?")
        })
    }

    /// Numbers in a row, in SI units.
    pub fn values(
        &self,
        numbers: &[ForeignNumber],
        row: &ForeignRow,
    ) -> Result<Vec<f64>, FileError> {
        (numbers.iter())
            .map(|number| self.value(number, row))
            .collect()
    }
}

impl ForeignNumber {
    /// Times a sign, and with an offset in its own unit.
    pub fn then(self, sign: f64, offset: f64) -> Self {
        Self {
            sign,
            offset,
            ..self
        }
    }
}
