//! From a foreign table to a measurement file.

use std::collections::BTreeSet;
use std::path::Path;

use nalgebra::{DVector, Matrix3, Matrix6, UnitQuaternion, Vector3};

use super::mapping::{Convention, Mapping};
use super::number::{ForeignNumber, ForeignRow, MeasuredNumbers, Reader};
use super::quantity::{
    ANGLE, DEVIATION, FORCE, LENGTH, ROTATION_DEVIATION, TEMPERATURE, TIME, TORQUE,
};
use crate::codes::ErrorCode;
use crate::csv::{Decimals, Fields};
use crate::files::{FileError, read_text, typed::from_toml};
use crate::measurement::{AbsoluteReading, Measurement, absolute_table, deflection_table};
use crate::quantities::limits::MOST_JOINTS;
use crate::robot::{Approach, Commands, Load};
use crate::text::wrong_name;

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

/// What is read of every row.
struct ImportedColumns {
    joints: Vec<ForeignNumber>,
    /// The coordinates of the load that are there, from 0 to 5.
    load: Vec<(usize, ForeignNumber)>,
    place: MeasuredNumbers,
    rotation: Option<(Convention, MeasuredNumbers)>,
    /// Target, visit, station and approach.
    words: [Option<Result<usize, String>>; 4],
    time: Option<ForeignNumber>,
    temperature: Option<ForeignNumber>,
}

/// Reads a table through a mapping.
///
/// # Errors
/// What is wrong with the mapping, by key, or with the table, by line.
pub fn import(table: &Path, mapping: &Path) -> Result<ImportedTable, FileError> {
    imported(table, mapping).map_err(|wrong| wrong.or_code(ErrorCode::Mapping))
}

fn imported(table: &Path, mapping: &Path) -> Result<ImportedTable, FileError> {
    let file: Mapping = from_toml(mapping, &read_text(mapping)?)?;
    let (fields, ()) = Fields::read(table, |_, _| Ok(()))?;
    let mut reader = Reader {
        mapping,
        path: table,
        columns: &fields.columns,
        decimals: Decimals::new(table, fields.delimiter),
        read: BTreeSet::new(),
    };
    if file.joint.is_empty() || file.joint.len() > MOST_JOINTS {
        let problem = format!("found {}; 1 to {MOST_JOINTS} are allowed", file.joint.len());
        return Err(reader.wrong("joint", problem));
    }
    let (joints, commands) = joints(&mut reader, &file)?;
    let columns = ImportedColumns::of(&mut reader, &file, joints)?;
    let mut readings = Vec::new();
    for row in &fields.rows {
        readings.push(columns.reading(&mut reader, row)?);
    }
    reader.decimals.check()?;
    let text = if file.deflection.is_some() {
        let all: Vec<Measurement> = readings.into_iter().map(deflection).collect();
        deflection_table(table, &commands, &all)?
    } else {
        let all: Vec<AbsoluteReading> = readings.into_iter().map(|(each, _)| each).collect();
        absolute_table(&commands, &all)
    };
    let unread = fields.columns.iter().enumerate();
    Ok(ImportedTable {
        rows: fields.rows.len(),
        ranges: ranges(&text),
        unread: unread
            .filter(|(index, _)| !reader.read.contains(index))
            .map(|(_, name)| name.clone())
            .collect(),
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

fn joints(
    reader: &mut Reader<'_>,
    file: &Mapping,
) -> Result<(Vec<ForeignNumber>, Commands), FileError> {
    let mut joints = Vec::new();
    let mut slides = Vec::new();
    for (index, joint) in file.joint.iter().enumerate() {
        let key = format!("joint[{index}]");
        let is_slide = LENGTH.units.iter().any(|unit| unit.0 == joint.unit);
        let quantity = if is_slide { LENGTH } else { ANGLE };
        if joint.sign.abs().to_bits() != 1.0_f64.to_bits() {
            let problem = format!("found {}; 1 or -1 is allowed", joint.sign);
            return Err(reader.wrong(&format!("{key}.sign"), problem));
        }
        let mut source = reader.number(&key, (&joint.column, &joint.unit), quantity)?;
        (source.sign, source.offset) = (joint.sign, joint.offset);
        joints.push(source);
        slides.push(is_slide);
    }
    Ok((joints, slides.into_iter().collect()))
}

impl ImportedColumns {
    fn of(
        reader: &mut Reader<'_>,
        file: &Mapping,
        joints: Vec<ForeignNumber>,
    ) -> Result<Self, FileError> {
        let (key, place) = match (&file.position, &file.deflection) {
            (Some(position), None) => ("position", position),
            (None, Some(deflection)) => ("deflection", deflection),
            _ => {
                return Err(reader.wrong("position", "is missing").hint(
                    "give [position] for what the instrument shows, or [deflection] for loaded minus unloaded",
                ));
            }
        };
        let place = reader.measured((key, place), 3, [LENGTH, DEVIATION])?;
        let rotation = match &file.rotation {
            None => None,
            Some(numbers) => {
                let Some(convention) = numbers.convention else {
                    return Err(reader.wrong("rotation.convention", "is missing"));
                };
                let (count, quantity) = convention.numbers();
                let kinds = [quantity, ROTATION_DEVIATION];
                let measured = reader.measured(("rotation", numbers), count, kinds)?;
                if measured.1.is_some() != place.1.is_some() {
                    let problem = "poses have standard deviations of both or of none: std_columns of position and rotation";
                    return Err(reader.wrong("rotation", problem));
                }
                Some((convention, measured))
            }
        };
        let mut load = Vec::new();
        for (key, mapping, quantity, first) in [
            ("force", &file.force, FORCE, 0),
            ("torque", &file.torque, TORQUE, 3),
        ] {
            if let Some(mapping) = mapping {
                let (numbers, _) = reader.measured((key, mapping), 3, [quantity; 2])?;
                load.extend((first..).zip(numbers));
            }
        }
        if let Some(mut weight) = reader.scalar("weight", file.weight.as_ref(), FORCE)? {
            if file.force.is_some() {
                let problem = "is a force downwards; give it or force, not both";
                return Err(reader.wrong("weight", problem));
            }
            weight.sign = -1.0;
            load.push((2, weight));
        }
        let columns = Self {
            joints,
            load,
            place,
            rotation,
            words: [
                reader.word("target", file.target.as_ref())?,
                reader.word("visit", file.visit.as_ref())?,
                reader.word("station", file.station.as_ref())?,
                reader.word("approach", file.approach.as_ref())?,
            ],
            time: reader.scalar("time", file.time.as_ref(), TIME)?,
            temperature: reader.scalar("temperature", file.temperature.as_ref(), TEMPERATURE)?,
        };
        let is_more = columns.rotation.is_some()
            || columns.time.is_some()
            || columns.temperature.is_some()
            || columns.words.iter().any(Option::is_some);
        if file.deflection.is_some() && is_more {
            let problem = "files of deflections have loads and standard deviations besides, no rotations, words, times or temperatures";
            return Err(reader.wrong("deflection", problem));
        }
        Ok(columns)
    }

    /// What a row says, with the standard deviations of its place.
    fn reading(
        &self,
        reader: &mut Reader<'_>,
        row: &ForeignRow,
    ) -> Result<(AbsoluteReading, Option<Vector3<f64>>), FileError> {
        let configuration_rad = DVector::from_vec(reader.values(&self.joints, row)?);
        let mut wrench = [0.0; 6];
        for (place, source) in &self.load {
            // No weight is no minus zero.
            wrench[*place] = 0.0 + reader.value(source, row)?;
        }
        let mut three = |sources: &Vec<ForeignNumber>| {
            (reader.values(sources, row)).map(|values| Vector3::from_row_slice(&values))
        };
        let (place, deviations) = &self.place;
        let (position_m, sigma_m) = (three(place)?, deviations.as_ref().map(three).transpose()?);
        let mut covariance = sigma_m.map(|sigma| {
            let mut all = Matrix6::identity();
            set_block(
                &mut all,
                0,
                &Matrix3::from_diagonal(&sigma.component_mul(&sigma)),
            );
            all
        });
        let rotation = self.rotation(reader, row, &mut covariance)?;
        let word = |place: usize| {
            (self.words[place].as_ref()).map(|word| match word {
                Ok(column) => row.1[*column].to_owned(),
                Err(word) => word.clone(),
            })
        };
        let name = |place: usize| match word(place).map(|name| (wrong_name(&name), name)) {
            Some((Some(problem), _)) => Err(reader.wrong_row(row, problem)),
            other => Ok(other.map(|(_, name)| name)),
        };
        let approach = word(3).filter(|side| !side.is_empty()).map(|side| {
            Approach::of_word(&side, self.joints.len()).ok_or_else(|| {
                let allowed = "+ or -, or a sign for each joint, is allowed";
                reader.wrong_row(row, format!("approach: found {side:?}; {allowed}"))
            })
        });
        let (target, visit, station) = (name(0)?, name(1)?, name(2)?);
        let approach = approach.transpose()?;
        let mut number = |source: &Option<ForeignNumber>| {
            (source.as_ref())
                .map(|source| reader.value(source, row))
                .transpose()
        };
        let reading = AbsoluteReading {
            configuration_rad,
            load: Load::from_wrench(wrench),
            target,
            visit,
            station,
            position_m,
            rotation,
            covariance,
            approach,
            time_s: number(&self.time)?,
            temperature_c: number(&self.temperature)?,
        };
        Ok((reading, sigma_m))
    }

    /// How the target is turned; the covariance gets that of its rotation vector.
    fn rotation(
        &self,
        reader: &mut Reader<'_>,
        row: &ForeignRow,
        covariance: &mut Option<Matrix6<f64>>,
    ) -> Result<Option<UnitQuaternion<f64>>, FileError> {
        let Some((convention, (numbers, deviations))) = &self.rotation else {
            return Ok(None);
        };
        let found = convention.rotation(&reader.values(numbers, row)?);
        let (rotation, about) =
            found.map_err(|problem| reader.wrong_row(row, format!("rotation: {problem}")))?;
        if let (Some(all), Some(deviations)) = (covariance, deviations) {
            let sigma = Vector3::from_row_slice(&reader.values(deviations, row)?);
            let own = Matrix3::from_diagonal(&sigma.component_mul(&sigma));
            let own = about * own * about.transpose();
            // The same to the bit on both sides of the diagonal.
            set_block(all, 3, &((own + own.transpose()) / 2.0));
        }
        Ok(Some(rotation))
    }
}

fn deflection((reading, sigma_m): (AbsoluteReading, Option<Vector3<f64>>)) -> Measurement {
    Measurement {
        configuration_rad: reading.configuration_rad,
        load: reading.load,
        deflection_m: reading.position_m,
        sigma_m,
        rotation: None,
        approach: None,
    }
}

fn set_block(covariance: &mut Matrix6<f64>, first: usize, block: &Matrix3<f64>) {
    (covariance.fixed_view_mut::<3, 3>(first, first)).copy_from(block);
}
