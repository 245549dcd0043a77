//! From a foreign table to a measurement file.

use std::path::Path;

use nalgebra::{DVector, Matrix3, Matrix6, Vector3};

use super::mapping::{JointMapping, Mapping, NumbersMapping};
use super::quantity::{
    ANGLE, DEVIATION, FORCE, LENGTH, ROTATION_DEVIATION, TEMPERATURE, TIME, TORQUE,
};
use super::reader::Reader;
use crate::codes::ErrorCode;
use crate::csv::Fields;
use crate::files::{FileError, read_text, typed::from_toml};
use crate::measurement::read_absolute::definite;
use crate::measurement::{AbsoluteReading, Measurement, absolute_table, deflection_table};
use crate::robot::{Approach, Commands, Load};

/// What became of a table.
#[derive(Debug, Clone)]
pub struct ImportedTable {
    /// The text of the measurement file.
    pub text: String,
    /// How many rows it has.
    pub rows: usize,
    /// The columns of the file that hold numbers, with the smallest and the largest.
    pub ranges: Vec<(String, [f64; 2])>,
    /// The table's columns that were not read.
    pub unread: Vec<String>,
}

/// Reads a table through a mapping.
///
/// # Errors
/// What is wrong with the mapping, by key, or with the table, by line.
pub fn import(table: &Path, mapping: &Path) -> Result<ImportedTable, FileError> {
    imported(table, mapping).map_err(|wrong| wrong.or_code(ErrorCode::Mapping))
}

fn imported(table: &Path, path: &Path) -> Result<ImportedTable, FileError> {
    let mapping: Mapping = from_toml(path, &read_text(path)?)?;
    let place = mapping.check(path)?;
    let (fields, ()) = Fields::read(table, |_, _| Ok(()))?;
    let mut reader = Reader::new(path, table, &fields);
    let mut readings = Vec::new();
    for row in &fields.rows {
        reader.row = row;
        readings.push(reading(&mut reader, &mapping, place)?);
    }
    reader.decimals.check()?;
    let commands: Commands = mapping.joint.iter().map(JointMapping::slides).collect();
    let text = if mapping.deflection.is_some() {
        let all: Vec<Measurement> = readings.into_iter().map(deflection).collect();
        deflection_table(table, &commands, &all)?
    } else {
        absolute_table(&commands, &readings)
    };
    Ok(ImportedTable {
        rows: fields.rows.len(),
        ranges: ranges(&text),
        unread: reader.unread(),
        text,
    })
}

/// The smallest and the largest number of each column of a text that this program wrote.
fn ranges(text: &str) -> Vec<(String, [f64; 2])> {
    let mut rows = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = rows.next().unwrap_or_default();
    let mut ranges = vec![[f64::INFINITY, f64::NEG_INFINITY]; header.len()];
    for row in rows {
        for ([low, high], field) in ranges.iter_mut().zip(row) {
            let value: f64 = field.parse().unwrap_or(f64::NAN);
            (*low, *high) = (low.min(value), high.max(value));
        }
    }
    let named = header.into_iter().map(str::to_owned).zip(ranges);
    named.filter(|(_, [low, high])| low <= high).collect()
}

/// What the row says; a deflection has its place.
fn reading(
    reader: &mut Reader<'_>,
    mapping: &Mapping,
    (key, place): (&str, &NumbersMapping),
) -> Result<AbsoluteReading, FileError> {
    let mut configuration_rad = DVector::zeros(mapping.joint.len());
    for (index, joint) in mapping.joint.iter().enumerate() {
        let of = (if joint.slides() { LENGTH } else { ANGLE }, &*joint.unit);
        let (key, turned) = (
            format!("joint[{index}]"),
            [joint.sign.unwrap_or(1.0), joint.offset],
        );
        configuration_rad[index] = reader.number(&key, &joint.column, of, turned)?;
    }
    let squared = |sigma: Vector3<f64>| Matrix3::from_diagonal(&sigma.component_mul(&sigma));
    let (position, sigma) = reader.measured(key, place, 3, [LENGTH, DEVIATION])?;
    let mut covariance = sigma.map(|sigma| squared(sigma).fixed_resize::<6, 6>(0.0));
    let mut rotation = None;
    if let Some(numbers) = &mapping.rotation
        && let Some(convention) = numbers.convention
    {
        let (count, quantity) = convention.numbers();
        let kinds = [quantity, ROTATION_DEVIATION];
        let (found, sigma) = reader.measured("rotation", numbers, count, kinds)?;
        let (turn, about) = (convention.rotation(&found))
            .map_err(|problem| reader.wrong_row(format!("rotation: {problem}")))?;
        if let (Some(all), Some(sigma)) = (&mut covariance, sigma) {
            let own = about * squared(sigma) * about.transpose();
            // The same to the bit on both sides of the diagonal.
            (all.fixed_view_mut::<3, 3>(3, 3)).copy_from(&((own + own.transpose()) / 2.0));
            definite(all).map_err(|problem| {
                let wrong = reader.wrong_row(format!("rotation: {problem}"));
                wrong.hint("where two axes of the angles coincide, their standard deviations are none of a rotation: leave std_columns out")
            })?;
        }
        rotation = Some(turn);
    } else if let Some(all) = &mut covariance {
        all.fixed_view_mut::<3, 3>(3, 3).fill_with_identity();
    }
    let approach = reader.word("approach", mapping.approach.as_ref())?;
    let approach = approach.filter(|side| !side.is_empty()).map(|side| {
        Approach::of_word(&side, mapping.joint.len()).ok_or_else(|| {
            let allowed = "+ or -, or a sign for each joint, is allowed";
            reader.wrong_row(format!("approach: found {side:?}; {allowed}"))
        })
    });
    Ok(AbsoluteReading {
        configuration_rad,
        position_m: Vector3::from_row_slice(&position),
        rotation,
        covariance,
        approach: approach.transpose()?,
        load: load(reader, mapping)?,
        target: reader.name("target", mapping.target.as_ref())?,
        visit: reader.name("visit", mapping.visit.as_ref())?,
        station: reader.name("station", mapping.station.as_ref())?,
        length: None,
        time_s: reader.scalar("time", mapping.time.as_ref(), TIME)?,
        temperature_c: reader.scalar("temperature", mapping.temperature.as_ref(), TEMPERATURE)?,
    })
}

fn load(reader: &mut Reader<'_>, mapping: &Mapping) -> Result<Load, FileError> {
    // No load is no minus zero.
    let mut wrench = [0.0; 6];
    for (key, numbers, quantity, first) in [
        ("force", &mapping.force, FORCE, 0),
        ("torque", &mapping.torque, TORQUE, 3),
    ] {
        if let Some(numbers) = numbers {
            let (values, _) = reader.measured(key, numbers, 3, [quantity; 2])?;
            (wrench[first..].iter_mut().zip(values)).for_each(|(to, value)| *to += value);
        }
    }
    wrench[2] -= (reader.scalar("weight", mapping.weight.as_ref(), FORCE)?).unwrap_or(0.0);
    Ok(Load::from_wrench(wrench))
}

fn deflection(reading: AbsoluteReading) -> Measurement {
    let deviations = |all: Matrix6<f64>| Vector3::from_fn(|row, _| all[(row, row)].sqrt());
    Measurement {
        configuration_rad: reading.configuration_rad,
        load: reading.load,
        deflection_m: reading.position_m,
        sigma_m: reading.covariance.map(deviations),
        rotation: None,
        approach: None,
        direction: None,
    }
}
