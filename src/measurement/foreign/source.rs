//! The columns that a mapping names, found in a table, and their numbers in SI units.

use std::collections::BTreeSet;
use std::path::Path;

use ::csv::StringRecord;

use super::mapping::{Numbers, Word};
use super::quantity::{ForeignQuantity, Unit};
use crate::csv::Decimals;
use crate::files::FileError;
use crate::text::nearest;

/// A row with the number of its line.
pub(super) type ForeignRow = (usize, StringRecord);

/// A table under its mapping.
pub(super) struct Reader<'a> {
    pub mapping: &'a Path,
    pub path: &'a Path,
    pub columns: &'a [String],
    pub decimals: Decimals<'a>,
    /// The columns that are read.
    pub read: BTreeSet<usize>,
}

/// Where a number comes from, and how it becomes one of SI.
#[derive(Debug)]
pub(super) struct Source {
    column: usize,
    quantity: ForeignQuantity,
    unit: Unit,
    pub sign: f64,
    /// In its own unit.
    pub offset: f64,
    key: String,
}

/// Numbers, and their standard deviations.
pub(super) type Measured = (Vec<Source>, Option<Vec<Source>>);

impl Reader<'_> {
    /// What is wrong with the mapping.
    pub fn wrong(&self, key: &str, problem: impl Into<String>) -> FileError {
        FileError::new(self.mapping, problem).at(key)
    }

    /// What is wrong in a row.
    pub fn wrong_row(&self, row: &ForeignRow, problem: impl Into<String>) -> FileError {
        FileError::new(self.path, problem).at(format!("line {}", row.0))
    }

    fn column(&mut self, key: &str, name: &str) -> Result<usize, FileError> {
        let table = self.path.display();
        let is_it = |index: &usize| self.columns[*index] == name.trim();
        let mut found = (0..self.columns.len()).filter(is_it);
        match (found.next(), found.next()) {
            (Some(place), None) => {
                self.read.insert(place);
                Ok(place)
            }
            (Some(_), Some(_)) => {
                Err(self.wrong(key, format!("found {name:?}, which {table} has twice")))
            }
            (None, _) => {
                let all = self.columns.join(", ");
                let problem = format!("found {name:?}; {table} has no such column, it has: {all}");
                let wrong = self.wrong(key, problem);
                Err(
                    match nearest(name, self.columns.iter().map(String::as_str)) {
                        Some(near) => wrong.hint(format!("did you mean {near:?}?")),
                        None => wrong,
                    },
                )
            }
        }
    }

    /// A number of a quantity.
    pub fn number(
        &mut self,
        key: &str,
        (column, unit): (&str, &str),
        quantity: ForeignQuantity,
    ) -> Result<Source, FileError> {
        let column = self.column(key, column)?;
        let Some(&unit) = quantity.units.iter().find(|each| each.0 == unit.trim()) else {
            let names: Vec<&str> = quantity.units.iter().map(|unit| unit.0).collect();
            let problem = format!("found {unit:?}; one of {} is allowed", names.join(", "));
            return Err(self.wrong(&format!("{key}.unit"), problem));
        };
        Ok(Source {
            column,
            quantity,
            unit,
            sign: 1.0,
            offset: 0.0,
            key: key.to_owned(),
        })
    }

    fn numbers(
        &mut self,
        key: &str,
        (names, unit): (&[String], &str),
        count: usize,
        quantity: ForeignQuantity,
    ) -> Result<Vec<Source>, FileError> {
        if names.len() != count {
            let problem = format!("found {}; {count} are needed", names.len());
            return Err(self.wrong(&format!("{key}.columns"), problem));
        }
        (names.iter())
            .map(|name| self.number(key, (name, unit), quantity))
            .collect()
    }

    /// So many numbers of a quantity, and their standard deviations.
    pub fn measured(
        &mut self,
        (key, numbers): (&str, &Numbers),
        count: usize,
        [quantity, deviation]: [ForeignQuantity; 2],
    ) -> Result<Measured, FileError> {
        let unit = &numbers.unit;
        let values = self.numbers(key, (numbers.columns.all(), unit), count, quantity)?;
        let std_unit = numbers.std_unit.as_ref().unwrap_or(unit);
        let deviations = numbers.std_columns.as_ref().map(|names| {
            let key = format!("{key}.std");
            self.numbers(&key, (names.all(), std_unit), count.min(3), deviation)
        });
        Ok((values, deviations.transpose()?))
    }

    /// A number that need not be there.
    pub fn scalar(
        &mut self,
        key: &str,
        numbers: Option<&Numbers>,
        quantity: ForeignQuantity,
    ) -> Result<Option<Source>, FileError> {
        let Some(numbers) = numbers else {
            return Ok(None);
        };
        let (mut one, _) = self.measured((key, numbers), 1, [quantity; 2])?;
        Ok(one.pop())
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

    /// A number in a row, in SI units.
    pub fn value(&mut self, source: &Source, row: &ForeignRow) -> Result<f64, FileError> {
        let Source { quantity, key, .. } = source;
        let (name, field) = (&self.columns[source.column], &row.1[source.column]);
        let value = self.decimals.any_number(row.0, name, field)?;
        let (_, times, over) = source.unit;
        let in_si = |value: f64| value * times / over * quantity.si;
        let value = in_si(value) * source.sign + in_si(source.offset);
        let checked = quantity.kind.check(value * quantity.shown);
        checked.map(|_| value).map_err(|problem| {
            self.wrong_row(row, format!("{key}: {problem}"))
                .hint("is the unit in the mapping the right one?")
        })
    }

    /// Numbers in a row, in SI units.
    pub fn values(&mut self, sources: &[Source], row: &ForeignRow) -> Result<Vec<f64>, FileError> {
        (sources.iter())
            .map(|source| self.value(source, row))
            .collect()
    }
}
