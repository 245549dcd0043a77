//! From a foreign table to a measurement file.

use std::collections::BTreeSet;
use std::path::Path;

use nalgebra::{DVector, Matrix6, SymmetricEigen, Vector3};

use super::mapping::{
    ANGLE, DEVIATION, Decimal, FORCE, LENGTH, Mapping, PURE, ROTATION_DEVIATION, TEMPERATURE, TIME,
    TORQUE,
};
use super::number::{ForeignNumber, ForeignRow, MeasuredNumbers, Reader};
use super::rotation::Convention;
use crate::codes::ErrorCode;
use crate::csv::RawTable;
use crate::files::{FileError, read_text, typed::from_toml};
use crate::measurement::{AbsoluteReading, Measurement, absolute_table, deflection_table};
use crate::quantities::limits::MOST_JOINTS;
use crate::robot::{Approach, Commands, Load};
use crate::text::wrong_name;

/// Correlations whose smallest eigenvalue is less than this leave some rotation without any error.
const LEAST_EIGENVALUE: f64 = 1e-9;

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
    /// The coordinates of the load that are there, from 0 to 5, and the weight.
    load: Vec<(usize, ForeignNumber)>,
    weight: Option<ForeignNumber>,
    place: MeasuredNumbers,
    is_deflection: bool,
    rotation: Option<(Convention, MeasuredNumbers)>,
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
    let raw = RawTable::read(table, file.delimiter, file.header_line, &file.skip_lines)?;
    let mut reader = Reader {
        mapping,
        path: table,
        table: &raw,
        comma: file.decimal == Decimal::Comma,
        read: BTreeSet::new(),
    };
    if file.joint.is_empty() || file.joint.len() > MOST_JOINTS {
        let problem = format!("found {}; 1 to {MOST_JOINTS} are allowed", file.joint.len());
        return Err(reader.wrong("joint", problem));
    }
    let (plan, commands) = ImportedColumns::of(&mut reader, &file)?;
    let text = if plan.is_deflection {
        let all: Result<Vec<_>, _> = (raw.rows.iter())
            .map(|row| plan.deflection(&reader, row))
            .collect();
        deflection_table(table, &commands, &all?)?
    } else {
        let all: Result<Vec<_>, _> = (raw.rows.iter())
            .map(|row| plan.reading(&reader, row))
            .collect();
        absolute_table(&commands, &all?)
    };
    let unread = raw.columns.iter().enumerate();
    Ok(ImportedTable {
        rows: raw.rows.len(),
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

impl ImportedColumns {
    fn of(reader: &mut Reader<'_>, file: &Mapping) -> Result<(Self, Commands), FileError> {
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
            let number = reader.number(&key, (&joint.column, &joint.unit), quantity)?;
            joints.push(number.then(joint.sign, joint.offset));
            slides.push(is_slide);
        }
        let (is_deflection, key, place) = match (&file.position, &file.deflection) {
            (Some(position), None) => (false, "position", position),
            (None, Some(deflection)) => (true, "deflection", deflection),
            _ => {
                return Err(reader.wrong("position", "is missing").hint(
                    "give [position] for what the instrument shows, or [deflection] for loaded minus unloaded",
                ));
            }
        };
        let place = reader.vector(key, place, [LENGTH, DEVIATION])?;
        let rotation = Self::rotation(reader, file)?;
        let has_deviations = rotation.as_ref().map(|(_, (_, own))| own.is_some());
        if has_deviations.is_some_and(|has| has != place.1.is_some()) {
            let problem = "poses have standard deviations of both or of none: std_columns of position and rotation";
            return Err(reader.wrong("rotation", problem));
        }
        let mut load = Vec::new();
        for (key, mapping, quantity, first) in [
            ("force", &file.force, FORCE, 0),
            ("torque", &file.torque, TORQUE, 3),
        ] {
            if let Some(mapping) = mapping {
                let (numbers, _) = reader.vector(key, mapping, [quantity; 2])?;
                load.extend((first..).zip(numbers));
            }
        }
        if file.weight.is_some() && file.force.is_some() {
            return Err(reader.wrong("weight", "is a force downwards; give it or force, not both"));
        }
        let plan = Self {
            joints,
            load,
            weight: reader.scalar("weight", file.weight.as_ref(), FORCE)?,
            place,
            is_deflection,
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
        let others = [
            plan.time.is_some(),
            plan.temperature.is_some(),
            plan.rotation.is_some(),
        ];
        if is_deflection && (others.contains(&true) || plan.words.iter().any(Option::is_some)) {
            let problem = "files of deflections have loads and standard deviations besides, no rotations, words, times or temperatures";
            return Err(reader.wrong("deflection", problem));
        }
        Ok((plan, slides.into_iter().collect()))
    }

    fn rotation(
        reader: &mut Reader<'_>,
        file: &Mapping,
    ) -> Result<Option<(Convention, MeasuredNumbers)>, FileError> {
        let Some(mapping) = &file.rotation else {
            return Ok(None);
        };
        let (count, found) = (mapping.convention.numbers(), mapping.columns.len());
        if found != count {
            let problem = format!("found {found}; {count} are needed");
            return Err(reader.wrong("rotation.columns", problem));
        }
        let quantity = if count == 3 { ANGLE } else { PURE };
        let unit = mapping.unit.as_deref().unwrap_or_default();
        let numbers = reader.numbers("rotation", (&mapping.columns, unit), quantity)?;
        let deviations = (mapping.std_columns.as_ref()).map(|columns| {
            let unit = mapping.std_unit.as_deref().unwrap_or(unit);
            reader.numbers("rotation.std", (columns, unit), ROTATION_DEVIATION)
        });
        let measured = (numbers, deviations.transpose()?);
        Ok(Some((mapping.convention.clone(), measured)))
    }

    /// The joint angles and the load of a row.
    fn setup(
        &self,
        reader: &Reader<'_>,
        row: &ForeignRow,
    ) -> Result<(DVector<f64>, Load), FileError> {
        let mut wrench = [0.0; 6];
        for (place, number) in &self.load {
            wrench[*place] = reader.value(number, row)?;
        }
        if let Some(weight) = &self.weight {
            // No weight is no minus zero.
            wrench[2] = 0.0 - reader.value(weight, row)?;
        }
        let angles = reader.values(&self.joints, row)?;
        Ok((DVector::from_vec(angles), Load::from_wrench(wrench)))
    }

    /// The place of a row, and its standard deviations.
    fn place(
        &self,
        reader: &Reader<'_>,
        row: &ForeignRow,
    ) -> Result<(Vector3<f64>, Option<Vector3<f64>>), FileError> {
        let three = |numbers: &Vec<ForeignNumber>| {
            (reader.values(numbers, row)).map(|values| Vector3::from_row_slice(&values))
        };
        let (values, deviations) = &self.place;
        Ok((three(values)?, deviations.as_ref().map(three).transpose()?))
    }

    fn deflection(&self, reader: &Reader<'_>, row: &ForeignRow) -> Result<Measurement, FileError> {
        let (configuration_rad, load) = self.setup(reader, row)?;
        let (deflection_m, sigma_m) = self.place(reader, row)?;
        Ok(Measurement {
            configuration_rad,
            load,
            deflection_m,
            sigma_m,
            rotation: None,
            approach: None,
        })
    }

    fn reading(&self, reader: &Reader<'_>, row: &ForeignRow) -> Result<AbsoluteReading, FileError> {
        let (configuration_rad, load) = self.setup(reader, row)?;
        let (position_m, sigma_m) = self.place(reader, row)?;
        let mut covariance = sigma_m.map(|sigma| {
            let variances = sigma.map(|sigma| sigma * sigma);
            let mut all = Matrix6::identity();
            all.fixed_view_mut::<3, 3>(0, 0)
                .copy_from(&nalgebra::Matrix3::from_diagonal(&variances));
            all
        });
        let mut rotation = None;
        if let Some((convention, (numbers, deviations))) = &self.rotation {
            let values = reader.values(numbers, row)?;
            let wrong = |problem: String| reader.wrong_row(row, format!("rotation: {problem}"));
            rotation = Some(convention.rotation(&values).map_err(wrong)?);
            if let (Some(all), Some(deviations)) = (&mut covariance, deviations) {
                let sigma = Vector3::from_row_slice(&reader.values(deviations, row)?);
                let own = convention.covariance(&values, &sigma).map_err(wrong)?;
                let size = own.diagonal().map(f64::sqrt);
                let relative = own.component_div(&(size * size.transpose()));
                let least = SymmetricEigen::new(relative).eigenvalues.min();
                if least.is_nan() || least < LEAST_EIGENVALUE {
                    let problem = "the Euler angles are at their lock, where their standard deviations leave a rotation out";
                    return Err(
                        wrong(problem.to_owned()).hint("leave the line out with skip_lines")
                    );
                }
                all.fixed_view_mut::<3, 3>(3, 3).copy_from(&own);
            }
        }
        let word = |place: usize| {
            (self.words[place].as_ref()).map(|word| match word {
                Ok(column) => row.1[*column].clone(),
                Err(word) => word.clone(),
            })
        };
        let name = |place: usize| match word(place).map(|name| (wrong_name(&name), name)) {
            Some((Some(problem), _)) => Err(reader.wrong_row(row, problem)),
            Some((None, name)) => Ok(Some(name)),
            None => Ok(None),
        };
        let side = word(3).filter(|side| !side.is_empty()).map(|side| {
            Approach::of_word(&side, self.joints.len()).ok_or_else(|| {
                let allowed = "+ or -, or a sign for each joint, is allowed";
                reader.wrong_row(row, format!("approach: found {side:?}; {allowed}"))
            })
        });
        let number = |number: &Option<ForeignNumber>| {
            (number.as_ref())
                .map(|number| reader.value(number, row))
                .transpose()
        };
        Ok(AbsoluteReading {
            configuration_rad,
            load,
            target: name(0)?,
            visit: name(1)?,
            station: name(2)?,
            position_m,
            rotation,
            covariance,
            approach: side.transpose()?,
            time_s: number(&self.time)?,
            temperature_c: number(&self.temperature)?,
        })
    }
}
