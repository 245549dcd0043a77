//! Files of absolute readings.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, Matrix6, Quaternion, SymmetricEigen, UnitQuaternion};

use super::absolute::AbsoluteReading;
use super::columns::{
    DEFLECTION_SIGMA, POSITION, QUATERNION, ROTATION_SIGMA, TEMPERATURE, TIME, WORDS,
    covariance_columns, deviations, whole_group,
};
use crate::csv::{Columns, Row, Table};
use crate::experiment::{LOAD, approach, configuration, configuration_and_load};
use crate::files::FileError;
use crate::quantities::plausible::{DEVIATION, ROTATION_DEVIATION, faint_load, shown};
use crate::robot::{Commands, Load};
use crate::text::wrong_name;

/// A quaternion's length may be so far from 1: four decimals and a half.
const NEARLY_ONE: f64 = 1e-3;
/// Rounding in what wrote a covariance may leave it so far from positive definite, as a share of the variances.
const LEAST_EIGENVALUE: f64 = 1e-9;

/// The columns that a file of absolute readings may have.
pub(super) fn absolute_columns(commands: &Commands) -> Columns {
    let numbers = [
        &LOAD[..],
        &QUATERNION,
        &DEFLECTION_SIGMA,
        &ROTATION_SIGMA,
        &[TIME, TEMPERATURE],
    ];
    let owned = |columns: &[&str]| columns.iter().map(|&column| column.to_owned()).collect();
    let words: Vec<String> = owned(&WORDS);
    let mut optional: Vec<String> = owned(&numbers.concat());
    optional.extend(covariance_columns(6));
    optional.extend(words.iter().cloned());
    Columns {
        required: commands.columns(),
        one_of: vec![owned(&POSITION)],
        optional,
        words,
        may_be_empty: Vec::new(),
    }
}

/// The readings of a table with these columns.
pub(super) fn absolute_readings(
    table: &Table<'_>,
    commands: &Commands,
) -> Result<Vec<AbsoluteReading>, FileError> {
    let given = AbsoluteGroups::new(table)?;
    let mut readings = Vec::new();
    let mut visits: BTreeMap<String, (usize, Vec<u64>)> = BTreeMap::new();
    for row in table.rows() {
        let reading = given.reading(&row, commands)?;
        if let Some(visit) = &reading.visit {
            let bits: Vec<u64> = (reading.configuration_rad.iter())
                .map(|q| q.to_bits())
                .collect();
            let (line, known) = (visits.entry(visit.clone())).or_insert((row.line(), bits.clone()));
            if *known != bits {
                let problem = format!(
                    "visit: found {visit:?} at other joint angles than in line {line}; the readings of one visit are at the same commanded angles"
                );
                return Err(row.wrong(problem));
            }
        }
        readings.push(reading);
    }
    Ok(readings)
}

/// Which groups of columns a file has.
struct AbsoluteGroups {
    has_load: bool,
    is_pose: bool,
    precision: ReadingPrecision,
}

/// What a file says of how precise its readings are.
enum ReadingPrecision {
    None,
    Deviations,
    Covariance(Vec<String>),
}

impl AbsoluteGroups {
    fn new(table: &Table<'_>) -> Result<Self, FileError> {
        let is_pose = whole_group(table, &QUATERNION)?;
        let sigma = [DEFLECTION_SIGMA, ROTATION_SIGMA].concat();
        let covariance = covariance_columns(6);
        let names: Vec<&str> = covariance.iter().map(String::as_str).collect();
        let mut of_position = covariance_columns(3);
        if !is_pose {
            let of_rotation = |column: &&&str| {
                ROTATION_SIGMA.contains(column) || column.starts_with('c') && column.contains('r')
            };
            let lost = [&ROTATION_SIGMA[..], &names].concat();
            if let Some(found) = (lost.iter())
                .filter(of_rotation)
                .find(|column| table.has(&[column]))
            {
                let problem = format!("found {found:?} without {:?}", QUATERNION[0]);
                return Err(table.wrong_header(problem));
            }
        }
        let has_deviations = whole_group(table, if is_pose { &sigma } else { &DEFLECTION_SIGMA })?;
        let found = names.iter().find(|column| table.has(&[column]));
        let precision = match (has_deviations, found) {
            (false, None) => ReadingPrecision::None,
            (true, None) => ReadingPrecision::Deviations,
            (true, Some(found)) => {
                let problem = format!(
                    "found {:?} and {found:?}: standard deviations or a covariance are allowed",
                    DEFLECTION_SIGMA[0]
                );
                return Err(table.wrong_header(problem));
            }
            (false, Some(_)) => {
                if is_pose {
                    of_position.clone_from(&covariance);
                }
                let names: Vec<&str> = of_position.iter().map(String::as_str).collect();
                whole_group(table, &names)?;
                ReadingPrecision::Covariance(of_position)
            }
        };
        Ok(Self {
            has_load: whole_group(table, &LOAD)?,
            is_pose,
            precision,
        })
    }

    fn reading(&self, row: &Row<'_>, commands: &Commands) -> Result<AbsoluteReading, FileError> {
        let (configuration_rad, load) = if self.has_load {
            configuration_and_load(row, commands)
        } else {
            (configuration(row, commands), Load::NONE)
        };
        if let Some(problem) = faint_load(&load.wrench()) {
            return Err(row.wrong(problem));
        }
        let [target, visit, station, _] = WORDS;
        let number = |column: &str| Some(row.get(column)).filter(|value| !value.is_nan());
        Ok(AbsoluteReading {
            configuration_rad,
            load,
            target: name(row, target)?,
            station: name(row, station)?,
            visit: name(row, visit)?,
            position_m: row.vector(POSITION) * 1e-3,
            rotation: if self.is_pose {
                Some(rotation(row)?)
            } else {
                None
            },
            covariance: self.covariance(row)?,
            approach: approach(row, commands)?,
            time_s: number(TIME),
            temperature_c: number(TEMPERATURE),
        })
    }

    fn covariance(&self, row: &Row<'_>) -> Result<Option<Matrix6<f64>>, FileError> {
        let mut covariance = Matrix6::identity();
        match &self.precision {
            ReadingPrecision::None => return Ok(None),
            ReadingPrecision::Deviations => {
                let position = deviations(row, DEFLECTION_SIGMA, &DEVIATION)?;
                let rotation = if self.is_pose {
                    Some(deviations(row, ROTATION_SIGMA, &ROTATION_DEVIATION)?)
                } else {
                    None
                };
                let rotation = rotation.iter().flat_map(|vector| vector.iter());
                for (index, sigma) in position.iter().chain(rotation).enumerate() {
                    covariance[(index, index)] = sigma * sigma;
                }
            }
            ReadingPrecision::Covariance(columns) => {
                let mut values = columns.iter().map(|column| row.get(column) * 1e-6);
                let size = if self.is_pose { 6 } else { 3 };
                for one in 0..size {
                    for other in one..size {
                        let value = values.next().unwrap_or_default();
                        covariance[(one, other)] = value;
                        covariance[(other, one)] = value;
                    }
                }
                definite(&covariance).map_err(|problem| row.wrong(problem))?;
            }
        }
        Ok(Some(covariance))
    }
}

/// Whether a matrix with units of m and rad is the covariance of a reading, whose deviations are plausible.
fn definite(covariance: &Matrix6<f64>) -> Result<(), String> {
    let deviation = covariance.diagonal().map(f64::sqrt);
    for (index, column) in covariance_columns(6).iter().enumerate() {
        // Of the diagonal: rows are of 6, 5, 4 and so on columns.
        let Some(row) = [0, 6, 11, 15, 18, 20]
            .iter()
            .position(|&place| place == index)
        else {
            continue;
        };
        if !DEVIATION.allows(deviation[row] * 1e3) {
            let found = shown(covariance[(row, row)] * 1e6);
            return Err(format!(
                "{column}: found {found}; a variance is allowed, a positive number from 1e-18 to 1e8"
            ));
        }
    }
    let relative = DMatrix::from_fn(6, 6, |row, column| {
        covariance[(row, column)] / (deviation[row] * deviation[column])
    });
    let least = SymmetricEigen::new(relative).eigenvalues.min();
    if least < LEAST_EIGENVALUE {
        return Err(format!(
            "the covariance is not positive definite: the smallest eigenvalue of its correlations is {least:.1e}"
        ));
    }
    Ok(())
}

fn name(row: &Row<'_>, column: &str) -> Result<Option<String>, FileError> {
    let Some(word) = row.word(column) else {
        return Ok(None);
    };
    match wrong_name(word) {
        Some(problem) => Err(row.wrong(format!("{column}: {problem}"))),
        None => Ok(Some(word.to_owned())),
    }
}

fn rotation(row: &Row<'_>) -> Result<UnitQuaternion<f64>, FileError> {
    let [w, x, y, z] = QUATERNION.map(|column| row.get(column));
    let quaternion = Quaternion::new(w, x, y, z);
    let norm = quaternion.norm();
    if (norm - 1.0).abs() <= NEARLY_ONE {
        return Ok(UnitQuaternion::from_quaternion(quaternion));
    }
    let problem = format!(
        "{}: found a quaternion of length {}; 1 is allowed, to {NEARLY_ONE}",
        QUATERNION.join(","),
        shown((norm * 1e6).round() / 1e6)
    );
    Err(row
        .wrong(problem)
        .hint("give more decimals; the first of the four is the real part"))
}
