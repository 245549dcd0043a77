//! Plan files: CSV with the units in the column names.

use std::path::Path;

use nalgebra::DVector;

use super::{Experiment, Plan};
use crate::files::{FileError, read_text, write_whole};
use crate::robot::Load;
use crate::units::degrees;

/// The columns that name a configuration and a load, for an arm of n joints.
#[must_use]
pub fn experiment_columns(joints: usize) -> Vec<String> {
    (1..=joints)
        .map(|joint| format!("q{joint}_deg"))
        .chain(["fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm"].map(str::to_owned))
        .collect()
}

/// A CSV file of numbers, read whole: its rows with their line numbers, columns found by name.
#[derive(Debug)]
pub struct Table<'a> {
    path: &'a Path,
    columns: Vec<String>,
    rows: Vec<(usize, Vec<f64>)>,
}

impl<'a> Table<'a> {
    /// Reads a CSV file whose header has all `required` columns and, beside them, only `optional`
    /// ones. Lines that begin with # are comments.
    ///
    /// # Errors
    /// The file cannot be read, a column is missing, unknown or given twice, a row has another
    /// number of fields, a field is not a finite number, or there is no row.
    pub fn read(
        path: &'a Path,
        required: &[String],
        optional: &[String],
    ) -> Result<Self, FileError> {
        let text = read_text(path)?;
        let mut lines = content_lines(text.strip_prefix('\u{feff}').unwrap_or(&text));
        let (header_line, header) = lines
            .next()
            .ok_or_else(|| FileError::new(path, "is empty").hint(header_hint(required)))?;
        let columns: Vec<String> = fields(header).map(str::to_owned).collect();
        check_columns(path, header_line, &columns, required, optional)?;
        let mut rows = Vec::new();
        for (line, content) in lines {
            let wrong = |problem| Err(FileError::new(path, problem).at(format!("line {line}")));
            let found = fields(content).count();
            if found != columns.len() {
                let problem = format!("found {found} fields; the header has {}", columns.len());
                return wrong(problem);
            }
            let mut values = Vec::new();
            for (field, column) in fields(content).zip(&columns) {
                match field.parse::<f64>() {
                    Ok(value) if value.is_finite() => values.push(value),
                    _ => {
                        let problem =
                            format!("{column}: found {field:?}; a finite number is allowed");
                        return wrong(problem);
                    }
                }
            }
            rows.push((line, values));
        }
        if rows.is_empty() {
            return Err(FileError::new(path, "has no row below its header"));
        }
        Ok(Self {
            path,
            columns,
            rows,
        })
    }

    /// Whether the file has all of these columns.
    #[must_use]
    pub fn has(&self, columns: &[&str]) -> bool {
        columns
            .iter()
            .all(|column| self.columns.iter().any(|known| known == column))
    }

    /// The rows in order.
    pub fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        self.rows.iter().map(|(line, values)| Row {
            table: self,
            line: *line,
            values,
        })
    }
}

/// One row of a [`Table`].
#[derive(Debug, Clone, Copy)]
pub struct Row<'a> {
    table: &'a Table<'a>,
    line: usize,
    values: &'a [f64],
}

impl Row<'_> {
    /// The value in a column that the table has; NaN where it has none.
    #[must_use]
    pub fn get(&self, column: &str) -> f64 {
        self.table
            .columns
            .iter()
            .position(|known| known == column)
            .map_or(f64::NAN, |index| self.values[index])
    }

    /// The values of three columns.
    #[must_use]
    pub fn vector(&self, columns: [&str; 3]) -> nalgebra::Vector3<f64> {
        columns.map(|column| self.get(column)).into()
    }

    /// The configuration (rad) and load of the row.
    #[must_use]
    pub fn configuration_and_load(&self, joints: usize) -> (DVector<f64>, Load) {
        let configuration = DVector::from_iterator(
            joints,
            (1..=joints).map(|joint| self.get(&format!("q{joint}_deg")).to_radians()),
        );
        let load = Load {
            force_n: self.vector(["fx_n", "fy_n", "fz_n"]),
            torque_nm: self.vector(["tx_nm", "ty_nm", "tz_nm"]),
        };
        (configuration, load)
    }

    /// An error about this row.
    #[must_use]
    pub fn wrong(&self, problem: impl Into<String>) -> FileError {
        FileError::new(self.table.path, problem).at(format!("line {}", self.line))
    }
}

/// The lines that are neither blank nor comments, with their numbers from 1.
fn content_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    (1..).zip(text.lines()).filter(|(_, line)| {
        let line = line.trim();
        !line.is_empty() && !line.starts_with('#')
    })
}

/// The fields of a line of names or numbers, which contain no comma, without space or quotes.
fn fields(line: &str) -> impl Iterator<Item = &str> {
    line.split(',')
        .map(|field| field.trim().trim_matches('"').trim())
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
        FileError::new(path, problem)
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
    required
        .iter()
        .find(|column| !found.contains(column))
        .map_or(Ok(()), |missing| {
            Err(wrong(format!(
                "the column {missing:?} is missing; found {} columns, {} are needed",
                found.len(),
                required.len()
            )))
        })
}

/// Reads a plan for an arm of n joints.
///
/// # Errors
/// See [`Table::read`]; `repeats` must be a whole number from 1, and no load zero.
pub fn read_plan(path: &Path, joints: usize) -> Result<Plan, FileError> {
    let mut columns = experiment_columns(joints);
    columns.push("repeats".to_owned());
    let table = Table::read(path, &columns, &[])?;
    let experiments = table
        .rows()
        .map(|row| {
            let repeats = row.get("repeats");
            if repeats.fract() != 0.0 || !(1.0..=1e6).contains(&repeats) {
                return Err(row.wrong(format!(
                    "repeats: found {repeats}; a whole number from 1 to 1000000 is allowed"
                )));
            }
            let (configuration_rad, load) = row.configuration_and_load(joints);
            if load == Load::NONE {
                return Err(row.wrong("found a load of zero, which deflects nothing"));
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "checked to be a whole number from 1 to 1e6"
            )]
            let repeats = repeats as u32;
            Ok(Experiment {
                configuration_rad,
                load,
                repeats,
            })
        })
        .collect::<Result<_, _>>()?;
    Ok(Plan { experiments })
}

/// The fields of a configuration and a load, in the order of [`experiment_columns`].
#[must_use]
pub fn experiment_fields(configuration_rad: &DVector<f64>, load: &Load) -> Vec<String> {
    configuration_rad
        .iter()
        .map(|&angle| degrees(angle))
        .chain(load.wrench().iter().copied())
        .map(|value| value.to_string())
        .collect()
}

/// Writes a plan for an arm of n joints.
///
/// # Errors
/// The file cannot be written.
pub fn write_plan(path: &Path, joints: usize, plan: &Plan) -> Result<(), FileError> {
    let mut text = experiment_columns(joints).join(",") + ",repeats\n";
    for each in &plan.experiments {
        text += &experiment_fields(&each.configuration_rad, &each.load).join(",");
        text += &format!(",{}\n", each.repeats);
    }
    write_whole(path, text.as_bytes())
}
