//! The columns that a mapping names, and their numbers in SI units, row by row.

use std::collections::BTreeSet;
use std::path::Path;

use ::csv::StringRecord;
use nalgebra::Vector3;

use super::mapping::{Names, NumbersMapping, Word};
use super::quantity::ForeignQuantity;
use crate::csv::{Decimals, Fields};
use crate::files::FileError;
use crate::text::{nearest, wrong_name};

/// A table under its mapping.
pub(super) struct Reader<'a> {
    mapping: &'a Path,
    path: &'a Path,
    columns: &'a [String],
    pub decimals: Decimals<'a>,
    /// The columns that are read.
    read: BTreeSet<usize>,
    /// The row that is read, with the number of its line.
    pub row: &'a (usize, StringRecord),
}

impl<'a> Reader<'a> {
    pub fn new(mapping: &'a Path, path: &'a Path, fields: &'a Fields) -> Self {
        Self {
            mapping,
            path,
            columns: &fields.columns,
            decimals: Decimals::new(path, fields.delimiter),
            read: BTreeSet::new(),
            row: &fields.rows[0],
        }
    }

    /// What is wrong with the mapping.
    fn wrong(&self, key: &str, problem: impl Into<String>) -> FileError {
        FileError::new(self.mapping, problem).at(key)
    }

    /// What is wrong in the row.
    pub fn wrong_row(&self, problem: impl Into<String>) -> FileError {
        FileError::new(self.path, problem).at(format!("line {}", self.row.0))
    }

    /// The columns that nothing asked for.
    pub fn unread(&self) -> Vec<String> {
        let unread = (0..self.columns.len()).filter(|place| !self.read.contains(place));
        unread.map(|place| self.columns[place].clone()).collect()
    }

    fn column(&mut self, key: &str, name: &str) -> Result<usize, FileError> {
        let table = self.path.display();
        let is_it = |index: &usize| self.columns[*index] == name.trim();
        let places: Vec<usize> = (0..self.columns.len()).filter(is_it).collect();
        Err(match places[..] {
            [place] => {
                self.read.insert(place);
                return Ok(place);
            }
            [] => {
                let all = self.columns.join(", ");
                let problem = format!("found {name:?}; {table} has no such column, it has: {all}");
                let near = nearest(name, self.columns.iter().map(String::as_str));
                let hint = near.map(|near| format!("did you mean {near:?}?"));
                self.wrong(key, problem).hinted(hint)
            }
            _ => self.wrong(key, format!("found {name:?}, which {table} has twice")),
        })
    }

    /// A number of a quantity in SI units: so many times what the table says, plus an offset in the table's unit.
    pub fn number(
        &mut self,
        key: &str,
        column: &str,
        (quantity, unit): (ForeignQuantity, &str),
        [times, offset]: [f64; 2],
    ) -> Result<f64, FileError> {
        let column = self.column(key, column)?;
        let in_si = quantity.in_si(unit).ok_or_else(|| {
            let problem = format!("found {unit:?}; one of {} is allowed", quantity.units());
            self.wrong(&format!("{key}.unit"), problem)
        })?;
        let (line, fields) = self.row;
        let value = (self.decimals).any_number(*line, &self.columns[column], &fields[column])?;
        let value = in_si(value) * times + in_si(offset);
        let checked = quantity.2.check(value * quantity.3);
        checked.map(|_| value).map_err(|problem| {
            self.wrong_row(format!("{key}: {problem}"))
                .hint("is the unit in the mapping the right one?")
        })
    }

    fn numbers(
        &mut self,
        [key, names_key]: [&str; 2],
        names: &Names,
        count: usize,
        of: (ForeignQuantity, &str),
    ) -> Result<Vec<f64>, FileError> {
        let found = names.all().len();
        if found != count {
            return Err(self.wrong(names_key, format!("found {found}; {count} are needed")));
        }
        let numbers = names.all().iter();
        numbers
            .map(|name| self.number(key, name, of, [1.0, 0.0]))
            .collect()
    }

    /// So many numbers of a quantity, and their three standard deviations where they have some.
    pub fn measured(
        &mut self,
        key: &str,
        numbers: &NumbersMapping,
        count: usize,
        [quantity, deviation]: [ForeignQuantity; 2],
    ) -> Result<(Vec<f64>, Option<Vector3<f64>>), FileError> {
        let keys = [key, &format!("{key}.columns")];
        let values = self.numbers(keys, &numbers.columns, count, (quantity, &numbers.unit))?;
        let Some(names) = &numbers.std_columns else {
            return Ok((values, None));
        };
        let unit = numbers.std_unit.as_ref().unwrap_or(&numbers.unit);
        let keys = [&*format!("{key}.std"), &*format!("{key}.std_columns")];
        let sigma = self.numbers(keys, names, 3, (deviation, unit))?;
        Ok((values, Some(Vector3::from_row_slice(&sigma))))
    }

    /// A number that need not be there.
    pub fn scalar(
        &mut self,
        key: &str,
        numbers: Option<&NumbersMapping>,
        quantity: ForeignQuantity,
    ) -> Result<Option<f64>, FileError> {
        let one = numbers.map(|numbers| self.measured(key, numbers, 1, [quantity; 2]));
        Ok(one.transpose()?.map(|(values, _)| values[0]))
    }

    /// A word of a column, or the same in every row.
    pub fn word(&mut self, key: &str, word: Option<&Word>) -> Result<Option<String>, FileError> {
        Ok(match word {
            Some(Word::Column(name)) => Some(self.row.1[self.column(key, name)?].to_owned()),
            Some(Word::Value(word)) => Some(word.clone()),
            None => None,
        })
    }

    /// A word that names something.
    pub fn name(&mut self, key: &str, word: Option<&Word>) -> Result<Option<String>, FileError> {
        let name = self.word(key, word)?;
        match name.as_deref().and_then(wrong_name) {
            Some(problem) => Err(self.wrong_row(problem)),
            None => Ok(name),
        }
    }
}
