//! Writes measurement files, and such to fill in.

use std::path::Path;

use nalgebra::{DVector, Matrix6, Vector3};

use super::columns::{
    DEFLECTION, DEFLECTION_SIGMA, DISPLACEMENT, DISPLACEMENT_SIGMA, LOADED, PLACES, POSITION,
    QUATERNION, ROTATION, ROTATION_SIGMA, TEMPERATURE, TIME, UNLOADED, WORDS, covariance_columns,
    triangle,
};
use super::{AbsoluteReading, Measurement};
use crate::csv::{Sheet, owned, word_field};
use crate::experiment::{LOAD, add_approach, fields_of, reading_columns, reading_fields};
use crate::files::FileError;
use crate::observation::LengthKind;
use crate::quantities::units::thousandths;
use crate::robot::{Approach, Commands, Load, ReadsAlong};

/// The coordinates of a vector in thousandths of its unit.
fn in_thousandths(vector: &Vector3<f64>) -> Vec<String> {
    (vector.iter())
        .map(|&value| thousandths(value).to_string())
        .collect()
}

fn shown(values: &[f64]) -> Vec<String> {
    values.iter().map(ToString::to_string).collect()
}

/// A measurement that is to be made.
#[derive(Debug, Clone)]
pub struct RowToFillIn<'a> {
    /// The number of the stop without a load, from 1, and that of the reading there.
    pub unloaded: [usize; 2],
    /// The same with the load.
    pub loaded: [usize; 2],
    /// The commanded configuration (rad, m).
    pub configuration_rad: &'a DVector<f64>,
    /// The load.
    pub load: &'a Load,
    /// The side from which the configuration is approached, where the table is to say.
    pub approach: Option<Approach>,
    /// The direction that a gauge reads along.
    pub direction: Option<Vector3<f64>>,
}

/// A table in which the positions without and with the load are to be filled in, or for a gauge the displacement; where rotations are measured, with
/// that standard deviation (rad), they are, too.
pub fn table_to_fill_in<'a>(
    commands: &Commands,
    rotation_sigma_rad: Option<f64>,
    rows: impl Iterator<Item = RowToFillIn<'a>>,
) -> String {
    let rows: Vec<RowToFillIn<'_>> = rows.collect();
    let mut sheet = Sheet::new(&rows);
    let reads_along = commands.reads_along;
    if reads_along != ReadsAlong::Always {
        sheet.add(&PLACES, |row| {
            let places = [row.unloaded, row.loaded].concat();
            match row.direction {
                Some(_) => vec![String::new(); places.len()],
                None => places.iter().map(ToString::to_string).collect(),
            }
        });
    }
    sheet.add(&reading_columns(commands), |row| {
        reading_fields(
            commands,
            row.configuration_rad,
            row.load,
            row.direction.as_ref(),
        )
    });
    let empty = |_: &RowToFillIn<'_>| vec![String::new(); 3];
    if reads_along != ReadsAlong::Never {
        sheet.add(&[DISPLACEMENT], |_| vec![String::new()]);
    }
    if reads_along != ReadsAlong::Always {
        sheet.add(&UNLOADED, empty);
        sheet.add(&LOADED, empty);
    }
    if let Some(sigma_rad) = rotation_sigma_rad {
        sheet.add(&ROTATION, empty);
        sheet.add(&ROTATION_SIGMA, |_| {
            in_thousandths(&Vector3::repeat(sigma_rad))
        });
    }
    add_approach(&mut sheet, |row| row.approach.as_ref());
    sheet.text()
}

/// The text of a file of deflections.
///
/// # Errors
/// Some of them have standard deviations or rotations and some have none.
pub fn deflection_table(
    path: &Path,
    commands: &Commands,
    measurements: &[Measurement],
) -> Result<String, FileError> {
    type Of<'a> = &'a dyn Fn(&Measurement) -> bool;
    let has = |what, of: Of<'_>, is_there: Of<'_>| {
        let measurements = measurements.iter().filter(|each| of(each));
        let all = measurements.clone().count();
        let count = measurements.filter(|each| is_there(each)).count();
        if count == 0 || count == all {
            return Ok(count > 0);
        }
        let problem = format!("{count} of {all} measurements have {what}; all or none may");
        Err(FileError::new(path, problem))
    };
    let of_gauge = |each: &Measurement| each.direction.is_some();
    let of_all = |each: &Measurement| each.direction.is_none();
    let mut sheet = Sheet::new(measurements);
    sheet.add(&reading_columns(commands), |each| {
        let (q, direction) = (&each.configuration_rad, each.direction.as_ref());
        reading_fields(commands, q, &each.load, direction)
    });
    let reads_along = commands.reads_along;
    if reads_along != ReadsAlong::Never {
        let sigma_m = |each: &Measurement| each.direction.and(each.sigma_m);
        sheet.add(&[DISPLACEMENT], |each| {
            let along = (each.direction).map(|d| [thousandths(d.dot(&each.deflection_m))]);
            fields_of(along)
        });
        if has("standard deviations", &of_gauge, &|each| {
            each.sigma_m.is_some()
        })? {
            sheet.add(&[DISPLACEMENT_SIGMA], |each| {
                fields_of(sigma_m(each).map(|sigma| [thousandths(sigma.x)]))
            });
        }
    }
    if reads_along != ReadsAlong::Always {
        let all = |of: &dyn Fn(&Measurement) -> Option<Vector3<f64>>, each: &Measurement| {
            let values = of(each).filter(|_| each.direction.is_none());
            fields_of(values.map(|values| <[f64; 3]>::from(values.map(thousandths))))
        };
        sheet.add(&DEFLECTION, |each| {
            all(&|each| Some(each.deflection_m), each)
        });
        if has("standard deviations", &of_all, &|each| {
            each.sigma_m.is_some()
        })? {
            sheet.add(&DEFLECTION_SIGMA, |each| all(&|each| each.sigma_m, each));
        }
    }
    if has("rotations", &|_| true, &|each| each.rotation.is_some())? {
        sheet.add(&[ROTATION, ROTATION_SIGMA].concat(), |each| {
            let both = each.rotation.map(|each| [each.vector_rad, each.sigma_rad]);
            both.iter().flatten().flat_map(in_thousandths).collect()
        });
    }
    add_approach(&mut sheet, |each| each.approach.as_ref());
    Ok(sheet.text())
}

/// The text of a measurement file that holds these readings, positions or poses, lengths, or both. A column that some of a kind do not
/// have is left out, but for the approach, which may be known of some.
pub fn absolute_table(commands: &Commands, readings: &[AbsoluteReading]) -> String {
    table_of_readings(commands, readings, true)
}

/// The same with nothing filled in of what is read.
pub fn readings_to_fill_in(commands: &Commands, readings: &[AbsoluteReading]) -> String {
    table_of_readings(commands, readings, false)
}

fn table_of_readings(commands: &Commands, readings: &[AbsoluteReading], is_filled: bool) -> String {
    let all = |has: &dyn Fn(&AbsoluteReading) -> bool| readings.iter().all(has);
    let is_length = |each: &AbsoluteReading| each.length.is_some();
    let [has_positions, has_lengths] =
        [false, true].map(|kind| readings.iter().any(|each| is_length(each) == kind));
    let is_pose = has_positions && all(&|each| is_length(each) || each.rotation.is_some());
    let rows = if is_pose { 6 } else { 3 };
    let mut sheet = Sheet::new(readings);
    sheet.add(&commands.columns(), |each| {
        shown(&commands.numbers(each.configuration_rad.as_slice()))
    });
    if readings.iter().any(|each| each.load != Load::NONE) {
        sheet.add(&LOAD, |each| shown(each.load.wrench().as_slice()));
    }
    let words: [fn(&AbsoluteReading) -> Option<&String>; 3] = [
        |each| each.target.as_ref(),
        |each| each.visit.as_ref(),
        |each| each.station.as_ref(),
    ];
    for (name, word) in WORDS.into_iter().zip(words) {
        if all(&|each| word(each).is_some()) {
            sheet.add(&[name], |each| {
                word(each)
                    .map(|word| word_field(word))
                    .into_iter()
                    .collect()
            });
        }
    }
    add_approach(&mut sheet, |each| each.approach.as_ref());
    // What is of another kind of readings, or not filled in, is empty.
    let mut add = |names: &[String], of_lengths: bool, is_filled: bool, fields: NumbersOf<'_>| {
        sheet.add(names, |each| {
            let mut numbers = Vec::new();
            if is_filled && is_length(each) == of_lengths {
                numbers = shown(&fields(each));
            }
            numbers.resize(names.len(), String::new());
            numbers
        });
    };
    if has_positions {
        let position = |each: &AbsoluteReading| -> Vec<f64> {
            each.position_m
                .iter()
                .map(|&value| thousandths(value))
                .collect()
        };
        add(&owned(&POSITION), false, is_filled, &position);
    }
    if is_pose {
        add(&owned(&QUATERNION), false, is_filled, &|each| {
            let parts = each.rotation.iter();
            parts
                .flat_map(|turned| [turned.w, turned.i, turned.j, turned.k])
                .collect()
        });
    }
    for kind in LengthKind::ALL {
        let read = |each: &AbsoluteReading| each.length.filter(|length| length.kind == kind);
        if readings.iter().any(|each| read(each).is_some()) {
            add(&owned(&[kind.column()]), true, is_filled, &|each| {
                let length = read(each).map(|length| thousandths(length.length_m));
                length.into_iter().collect()
            });
        }
    }
    if all(&|each| each.covariance.is_some()) {
        let covariance = |each: &AbsoluteReading| each.covariance.unwrap_or_default();
        if has_positions {
            let is_diagonal = all(&|each| is_length(each) || is_diagonal(&covariance(each), rows));
            let columns = if is_diagonal {
                owned(&[DEFLECTION_SIGMA, ROTATION_SIGMA].concat()[..rows])
            } else {
                covariance_columns(rows)
            };
            add(&columns, false, true, &|each| {
                precision(&covariance(each), rows, is_diagonal)
            });
        }
        if has_lengths {
            add(&owned(&[DISPLACEMENT_SIGMA]), true, true, &|each| {
                precision(&covariance(each), 1, true)
            });
        }
    }
    let mut number = |name: &str, of: fn(&AbsoluteReading) -> Option<f64>| {
        if all(&|each| of(each).is_some()) {
            sheet.add(&[name], |each| shown(of(each).as_slice()));
        }
    };
    number(TIME, |each| each.time_s);
    number(TEMPERATURE, |each| each.temperature_c);
    sheet.text()
}

/// Numbers of a reading, in the units of the file.
type NumbersOf<'f> = &'f dyn Fn(&AbsoluteReading) -> Vec<f64>;

fn is_diagonal(covariance: &Matrix6<f64>, rows: usize) -> bool {
    triangle(rows).all(|(row, column)| row == column || covariance[(row, column)] == 0.0)
}

/// The numbers of a covariance in the units of the file.
fn precision(covariance: &Matrix6<f64>, rows: usize, is_diagonal: bool) -> Vec<f64> {
    if is_diagonal {
        return (0..rows)
            .map(|row| thousandths(covariance[(row, row)].sqrt()))
            .collect();
    }
    triangle(rows)
        .map(|place| covariance[place] * 1e6)
        .collect()
}
