//! The columns that a mapping names, and their numbers in SI units, row by row.

use std::collections::BTreeSet;
use std::path::Path;

use ::csv::StringRecord;
use nalgebra::Vector3;

use super::mapping::{NumbersMapping, Word};
use super::quantity::ForeignQuantity;
use crate::csv::{Decimals, Fields};
use crate::files::FileError;
use crate::text::{nearest, wrong_name};

/// A row with the number of its line.
pub(super) type ForeignRow = (usize, StringRecord);

/// A table under its mapping.
pub(super) struct Reader<'a> {
    mapping: &'a Path,
    path: &'a Path,
    columns: &'a [String],
    pub decimals: Decimals<'a>,
    /// The columns that are read.
    read: BTreeSet<usize>,
}

impl<'a> Reader<'a> {
    pub fn new(mapping: &'a Path, path: &'a Path, fields: &'a Fields) -> Self {
        Self {
            mapping,
            path,
            columns: &fields.columns,
            decimals: Decimals::new(path, fields.delimiter),
            read: BTreeSet::new(),
        }
    }

    /// What is wrong with the mapping.
    fn wrong(&self, key: &str, problem: impl Into<String>) -> FileError {
        FileError::new(self.mapping, problem).at(key)
    }

    /// What is wrong in a row.
    pub fn wrong_row(&self, row: &ForeignRow, problem: impl Into<String>) -> FileError {
        FileError::new(self.path, problem).at(format!("line {}", row.0))
    }

    /// The columns that nothing asked for.
    pub fn unread(&self) -> Vec<String> {
        let all = self.columns.iter().enumerate();
        let unread = all.filter(|(place, _)| !self.read.contains(place));
        unread.map(|(_, name)| name.clone()).collect()
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
                let near = nearest(name, self.columns.iter().map(String::as_str));
                let hint = near.map(|near| format!("did you mean {near:?}?"));
                Err(self.wrong(key, problem).hinted(hint))
            }
        }
    }

    /// A number of a quantity in SI units: so many times what the table says, plus an offset in the table's unit.
    pub fn number(
        &mut self,
        key: &str,
        (column, unit): (&str, &str),
        quantity: ForeignQuantity,
        [times, offset]: [f64; 2],
        row: &ForeignRow,
    ) -> Result<f64, FileError> {
        let column = self.column(key, column)?;
        let Some(&(_, factor, over)) = quantity.units.iter().find(|each| each.0 == unit.trim())
        else {
            let names: Vec<&str> = quantity.units.iter().map(|unit| unit.0).collect();
            let problem = format!("found {unit:?}; one of {} is allowed", names.join(", "));
            return Err(self.wrong(&format!("{key}.unit"), problem));
        };
        let (name, field) = (&self.columns[column], &row.1[column]);
        let value = self.decimals.any_number(row.0, name, field)?;
        let in_si = |value: f64| value * factor / over * quantity.si;
        let value = in_si(value) * times + in_si(offset);
        let checked = quantity.kind.check(value * quantity.shown);
        checked.map(|_| value).map_err(|problem| {
            self.wrong_row(row, format!("{key}: {problem}"))
                .hint("is the unit in the mapping the right one?")
        })
    }

    fn numbers(
        &mut self,
        key: &str,
        (names, unit): (&[String], &str),
        quantity: ForeignQuantity,
        row: &ForeignRow,
    ) -> Result<Vec<f64>, FileError> {
        (names.iter())
            .map(|name| self.number(key, (name, unit), quantity, [1.0, 0.0], row))
            .collect()
    }

    /// So many numbers of a quantity, and their three standard deviations where they have some.
    pub fn measured(
        &mut self,
        key: &str,
        numbers: &NumbersMapping,
        count: usize,
        [quantity, deviation]: [ForeignQuantity; 2],
        row: &ForeignRow,
    ) -> Result<(Vec<f64>, Option<Vector3<f64>>), FileError> {
        for (names, what, count) in [
            (Some(&numbers.columns), "columns", count),
            (numbers.std_columns.as_ref(), "std_columns", count.min(3)),
        ] {
            if let Some(found) = names.map(|names| names.all().len()).filter(|&n| n != count) {
                let problem = format!("found {found}; {count} are needed");
                return Err(self.wrong(&format!("{key}.{what}"), problem));
            }
        }
        let unit = &*numbers.unit;
        let values = self.numbers(key, (numbers.columns.all(), unit), quantity, row)?;
        let std_unit = numbers.std_unit.as_deref().unwrap_or(unit);
        let key = format!("{key}.std");
        let sigma = numbers.std_columns.as_ref().map(|names| {
            let sigma = self.numbers(&key, (names.all(), std_unit), deviation, row)?;
            Ok(Vector3::from_row_slice(&sigma))
        });
        Ok((values, sigma.transpose()?))
    }

    /// A number that need not be there.
    pub fn scalar(
        &mut self,
        key: &str,
        numbers: Option<&NumbersMapping>,
        quantity: ForeignQuantity,
        row: &ForeignRow,
    ) -> Result<Option<f64>, FileError> {
        let one = numbers.map(|numbers| self.measured(key, numbers, 1, [quantity; 2], row));
        Ok(one.transpose()?.map(|(values, _)| values[0]))
    }

    /// A word of a column, or the same in every row.
    pub fn word(
        &mut self,
        key: &str,
        word: Option<&Word>,
        row: &ForeignRow,
    ) -> Result<Option<String>, FileError> {
        Ok(match word {
            Some(Word::Column(name)) => Some(row.1[self.column(key, name)?].to_owned()),
            Some(Word::Value(word)) => Some(word.clone()),
            None => None,
        })
    }

    /// A word that names something.
    pub fn name(
        &mut self,
        key: &str,
        word: Option<&Word>,
        row: &ForeignRow,
    ) -> Result<Option<String>, FileError> {
        let name = self.word(key, word, row)?;
        match name.as_deref().and_then(wrong_name) {
            Some(problem) => Err(self.wrong_row(row, problem)),
            None => Ok(name),
        }
    }
}
