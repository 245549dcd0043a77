//! From a foreign table to a measurement file.

use std::path::Path;

use nalgebra::{DVector, Matrix6, SymmetricEigen, Vector3};

use super::mapping::MappingFile;
use super::resolved::{ForeignNumber, Resolver, Word, separator};
use super::rotation::Convention;
use super::units::{UnitFactor, UnitKind};
use crate::csv::{RawTable, Separator};
use crate::files::{FileError, read_text};
use crate::measurement::{
    AbsoluteReading, Approach, Measurement, absolute_table, deflection_table,
};
use crate::quantities::limits::MOST_JOINTS;
use crate::quantities::plausible::{self, Kind};
use crate::robot::{Commands, Load};
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
    /// How many rows of the table were left out, since a column was empty.
    pub left_out: usize,
    /// What the written columns hold.
    pub ranges: Vec<ColumnRange>,
    /// How the table was understood, in sentences; the last is about its first row.
    pub understood: Vec<String>,
    /// The table's columns that were not read.
    pub unread: Vec<String>,
}

/// What a column of the written file holds.
#[derive(Debug, Clone, PartialEq)]
pub struct ColumnRange {
    /// Its name.
    pub column: String,
    /// The smallest and the largest number; none where it holds words.
    pub range: Option<[f64; 2]>,
    /// How many different things are in it.
    pub different: usize,
}

/// Reads a table through a mapping.
///
/// # Errors
/// What is wrong with the mapping, by key, or with the table, by line.
pub fn import(table: &Path, mapping: &Path) -> Result<ImportedTable, FileError> {
    let file = read_mapping(mapping)?;
    let separator = separator(mapping, &file)?;
    let comma = match file.decimal.as_str() {
        "." => false,
        "," => true,
        other => {
            let problem = format!("found {other:?}; \".\" or \",\" is allowed");
            return Err(FileError::new(mapping, problem).at("decimal"));
        }
    };
    if comma && separator == Separator::Sign(crate::csv::Delimiter::Comma) {
        let problem = "is the decimal comma, too; fields need another delimiter";
        return Err(FileError::new(mapping, problem).at("delimiter"));
    }
    let raw = RawTable::read(table, separator, file.header_line, &file.skip_lines)?;
    let resolver = Resolver {
        mapping,
        table: &raw,
        table_path: table,
        comma,
    };
    let plan = ReadingColumns::of(&resolver, &file)?;
    let empty = (file.skip_empty.iter())
        .map(|name| resolver.column("skip_empty", name))
        .collect::<Result<Vec<usize>, _>>()?;
    let is_read =
        |row: &&(usize, Vec<String>)| empty.iter().all(|&column| !row.1[column].is_empty());
    let rows: Vec<&(usize, Vec<String>)> = raw.rows.iter().filter(is_read).collect();
    let Some(first) = rows.first() else {
        let problem = "has no row in which nothing of skip_empty is empty";
        return Err(FileError::new(table, problem));
    };
    let text = plan.text(&resolver, &rows)?;
    let mut understood = plan.understood.clone();
    understood.push(in_words(&text, first.0));
    let read = plan.columns();
    Ok(ImportedTable {
        rows: rows.len(),
        left_out: raw.rows.len() - rows.len(),
        ranges: ranges(&text),
        unread: (raw.columns.iter().enumerate())
            .filter(|(index, _)| !read.contains(index) && !empty.contains(index))
            .map(|(_, name)| name.clone())
            .collect(),
        understood,
        text,
    })
}

fn read_mapping(path: &Path) -> Result<MappingFile, FileError> {
    let text = read_text(path)?;
    let wrong = |error: &toml::de::Error| {
        let wrong = FileError::new(path, error.message().replace('\n', "; "));
        let line = error
            .span()
            .map(|span| 1 + text[..span.start].matches('\n').count());
        match line {
            Some(line) => wrong.at(format!("line {line}")),
            None => wrong,
        }
    };
    let deserializer = toml::Deserializer::parse(&text).map_err(|error| wrong(&error))?;
    serde_path_to_error::deserialize(deserializer).map_err(|error| {
        let key = error.path().to_string();
        let own = wrong(error.inner());
        match (own.place.clone(), key.as_str()) {
            (_, "." | "") => own,
            (Some(line), key) => own.at(format!("{key} ({line})")),
            (None, key) => own.at(key),
        }
    })
}

/// What is read of every row.
struct ReadingColumns {
    commands: Commands,
    joints: Vec<(ForeignNumber, bool)>,
    place: What,
    force: Option<Vec<ForeignNumber>>,
    torque: Option<Vec<ForeignNumber>>,
    weight: Option<ForeignNumber>,
    words: [Option<Word>; 4],
    time: Option<ForeignNumber>,
    temperature: Option<ForeignNumber>,
    understood: Vec<String>,
}

/// Deflections, or absolute readings.
enum What {
    Deflection {
        values: Vec<ForeignNumber>,
        deviations: Option<Vec<ForeignNumber>>,
    },
    Absolute {
        position: Vec<ForeignNumber>,
        rotation: Option<(Convention, Vec<ForeignNumber>)>,
        deviations: Option<Vec<ForeignNumber>>,
        rotation_deviations: Option<Vec<ForeignNumber>>,
    },
}

impl ReadingColumns {
    fn of(resolver: &Resolver<'_>, file: &MappingFile) -> Result<Self, FileError> {
        let mut understood = Vec::new();
        let joints = joints(resolver, file)?;
        let slides = joints.iter().map(|(_, slides)| *slides);
        let commands: Commands = slides.collect();
        let vector = |key: &str, kind, mapping: Option<&super::mapping::VectorMapping>| {
            mapping
                .map(|mapping| three(resolver, key, kind, mapping))
                .transpose()
        };
        let place = match (&file.position, &file.deflection) {
            (Some(position), None) => {
                let (values, deviations) = three(resolver, "position", UnitKind::Length, position)?;
                understood.push("Absolute readings, in the instrument's frame.".to_owned());
                let mut turned = None;
                let mut rotation_deviations = None;
                if let Some(rotation) = &file.rotation {
                    let (convention, numbers, own) = rotation_of(resolver, rotation)?;
                    understood.push(format!("Rotations are {}.", convention.words()));
                    rotation_deviations = own;
                    turned = Some((convention, numbers));
                }
                if turned.is_some() && deviations.is_some() != rotation_deviations.is_some() {
                    let (has, lacks) = if deviations.is_some() {
                        ("position", "rotation")
                    } else {
                        ("rotation", "position")
                    };
                    let problem = format!(
                        "has no standard deviations, and {has} has some; poses have those of both or of none"
                    );
                    return Err(resolver.wrong(lacks, problem).hint(
                        "give std_columns, or std = [...] where they are the same in every row",
                    ));
                }
                What::Absolute {
                    position: values,
                    rotation: turned,
                    deviations,
                    rotation_deviations,
                }
            }
            (None, Some(deflection)) => {
                if file.rotation.is_some() {
                    return Err(resolver.wrong("rotation", "belongs to a position"));
                }
                let (values, deviations) =
                    three(resolver, "deflection", UnitKind::Length, deflection)?;
                understood.push("Deflections, in the world frame.".to_owned());
                What::Deflection { values, deviations }
            }
            _ => {
                return Err(resolver.wrong("position", "is missing").hint(
                    "give [position] for what the instrument shows, or [deflection] for loaded minus unloaded",
                ));
            }
        };
        if file.weight.is_some() && file.force.is_some() {
            return Err(
                resolver.wrong("weight", "is a force downwards; give it or force, not both")
            );
        }
        let words = [
            resolver.word("target", file.target.as_ref())?,
            resolver.word("state", file.state.as_ref())?,
            resolver.word("station", file.station.as_ref())?,
            resolver.word("approach", file.approach.as_ref())?,
        ];
        let plan = Self {
            force: vector("force", UnitKind::Force, file.force.as_ref())?.map(|found| found.0),
            torque: vector("torque", UnitKind::Torque, file.torque.as_ref())?.map(|found| found.0),
            weight: resolver.scalar("weight", UnitKind::Force, file.weight.as_ref())?,
            time: resolver.scalar("time", UnitKind::Time, file.time.as_ref())?,
            temperature: resolver.scalar(
                "temperature",
                UnitKind::Temperature,
                file.temperature.as_ref(),
            )?,
            commands,
            joints,
            place,
            words,
            understood,
        };
        if matches!(plan.place, What::Deflection { .. }) {
            let given = [
                (plan.words[0].is_some(), "target"),
                (plan.words[1].is_some(), "state"),
                (plan.words[2].is_some(), "station"),
                (plan.words[3].is_some(), "approach"),
                (plan.time.is_some(), "time"),
                (plan.temperature.is_some(), "temperature"),
            ];
            if let Some((_, key)) = given.iter().find(|(is_there, _)| *is_there) {
                let problem = "files of deflections have no column for it: leave it out";
                return Err(resolver.wrong(key, problem));
            }
        }
        Ok(plan)
    }

    /// The table's columns that are read.
    fn columns(&self) -> Vec<usize> {
        let mut all: Vec<&ForeignNumber> = self.joints.iter().map(|(number, _)| number).collect();
        let groups: [&Option<Vec<ForeignNumber>>; 2] = [&self.force, &self.torque];
        all.extend(groups.into_iter().flatten().flatten());
        all.extend(
            [&self.weight, &self.time, &self.temperature]
                .into_iter()
                .flatten(),
        );
        match &self.place {
            What::Deflection { values, deviations } => {
                all.extend(values);
                all.extend(deviations.iter().flatten());
            }
            What::Absolute {
                position,
                rotation,
                deviations,
                rotation_deviations,
            } => {
                all.extend(position);
                all.extend(rotation.iter().flat_map(|(_, numbers)| numbers));
                all.extend(deviations.iter().flatten());
                all.extend(rotation_deviations.iter().flatten());
            }
        }
        let numbers = all.into_iter().filter_map(ForeignNumber::column);
        numbers
            .chain(self.words.iter().flatten().filter_map(Word::column))
            .collect()
    }

    fn text(
        &self,
        resolver: &Resolver<'_>,
        rows: &[&(usize, Vec<String>)],
    ) -> Result<String, FileError> {
        match &self.place {
            What::Deflection { values, deviations } => {
                let measurement = |row: &&(usize, Vec<String>)| {
                    let (configuration_rad, load) = self.setup(resolver, row)?;
                    Ok(Measurement {
                        configuration_rad,
                        load,
                        deflection_m: position(resolver, row, "deflection", values)?,
                        sigma_m: deviations_in(
                            resolver,
                            row,
                            deviations.as_deref(),
                            (1e3, &plausible::DEVIATION),
                        )?,
                        rotation: None,
                    })
                };
                let all = rows
                    .iter()
                    .map(measurement)
                    .collect::<Result<Vec<_>, FileError>>()?;
                deflection_table(resolver.table_path, &self.commands, &all)
            }
            What::Absolute { .. } => {
                let all = (rows.iter())
                    .map(|row| self.reading(resolver, row))
                    .collect::<Result<Vec<_>, _>>()?;
                Ok(absolute_table(&self.commands, &all))
            }
        }
    }

    /// The joint angles and the load of a row.
    fn setup(
        &self,
        resolver: &Resolver<'_>,
        row: &(usize, Vec<String>),
    ) -> Result<(DVector<f64>, Load), FileError> {
        let mut angles = Vec::new();
        for (index, (number, slides)) in self.joints.iter().enumerate() {
            let value = number.of(resolver, row)?;
            let shown = if *slides {
                value * 1e3
            } else {
                value.to_degrees()
            };
            let kind = if *slides {
                &plausible::POSITION
            } else {
                &plausible::ANGLE
            };
            check(resolver, row, &format!("joint[{index}]"), kind, shown)?;
            angles.push(value);
        }
        let mut wrench = [0.0; 6];
        for (numbers, start) in [(&self.force, 0), (&self.torque, 3)] {
            for (index, number) in numbers.iter().flatten().enumerate() {
                let kind = if start == 0 {
                    &plausible::FORCE
                } else {
                    &plausible::TORQUE
                };
                let value = number.of(resolver, row)?;
                wrench[start + index] = check(resolver, row, "load", kind, value)?;
            }
        }
        if let Some(weight) = &self.weight {
            wrench[2] = -check(
                resolver,
                row,
                "weight",
                &plausible::FORCE,
                weight.of(resolver, row)?,
            )?;
            // No weight is no minus zero.
            wrench[2] += 0.0;
        }
        Ok((DVector::from_vec(angles), Load::from_wrench(wrench)))
    }

    fn reading(
        &self,
        resolver: &Resolver<'_>,
        row: &(usize, Vec<String>),
    ) -> Result<AbsoluteReading, FileError> {
        let What::Absolute {
            position: places,
            rotation,
            deviations,
            rotation_deviations,
        } = &self.place
        else {
            return Err(wrong_row(resolver, row, "is a deflection"));
        };
        let (configuration_rad, load) = self.setup(resolver, row)?;
        let sigma = deviations_in(
            resolver,
            row,
            deviations.as_deref(),
            (1e3, &plausible::DEVIATION),
        )?;
        let turned = deviations_in(
            resolver,
            row,
            rotation_deviations.as_deref(),
            (1e3, &plausible::ROTATION_DEVIATION),
        )?;
        let mut covariance = sigma.map(|sigma| {
            let mut all = Matrix6::identity();
            for (index, sigma) in sigma.iter().enumerate() {
                all[(index, index)] = sigma * sigma;
            }
            all
        });
        let mut orientation = None;
        if let Some((convention, numbers)) = rotation {
            let values = (numbers.iter())
                .map(|number| number.of(resolver, row))
                .collect::<Result<Vec<f64>, _>>()?;
            let wrong = |problem: String| wrong_row(resolver, row, format!("rotation: {problem}"));
            orientation = Some(convention.rotation(&values).map_err(wrong)?);
            if let (Some(all), Some(sigma)) = (&mut covariance, turned) {
                let own = convention.covariance(&values, &sigma).map_err(wrong)?;
                let size = own.diagonal().map(f64::sqrt);
                let relative = own.component_div(&(size * size.transpose()));
                if SymmetricEigen::new(relative).eigenvalues.min().is_nan()
                    || SymmetricEigen::new(relative).eigenvalues.min() < LEAST_EIGENVALUE
                {
                    let problem = "the Euler angles are at their lock, where their standard deviations leave a rotation out";
                    return Err(
                        wrong(problem.to_owned()).hint("leave the line out with skip_lines")
                    );
                }
                all.fixed_view_mut::<3, 3>(3, 3).copy_from(&own);
            }
        }
        let [target, state, station, approach] = &self.words;
        let name = |key: &str, word: &Option<Word>| {
            let Some(word) = word.as_ref().map(|word| word.of(&row.1)) else {
                return Ok(None);
            };
            match wrong_name(word) {
                Some(problem) => Err(wrong_row(resolver, row, format!("{key}: {problem}"))),
                None => Ok(Some(word.to_owned())),
            }
        };
        let number = |number: &Option<ForeignNumber>| {
            number
                .as_ref()
                .map(|number| number.of(resolver, row))
                .transpose()
        };
        let temperature_c = number(&self.temperature)?;
        if let Some(value) = temperature_c {
            check(resolver, row, "temperature", &plausible::TEMPERATURE, value)?;
        }
        Ok(AbsoluteReading {
            configuration_rad,
            load,
            target: name("target", target)?,
            station: name("station", station)?,
            state: name("state", state)?,
            position_m: position(resolver, row, "position", places)?,
            rotation: orientation,
            covariance,
            approach: self.side(resolver, row, approach.as_ref())?,
            time_s: number(&self.time)?,
            temperature_c,
        })
    }

    fn side(
        &self,
        resolver: &Resolver<'_>,
        row: &(usize, Vec<String>),
        word: Option<&Word>,
    ) -> Result<Option<Approach>, FileError> {
        let Some(word) = word
            .map(|word| word.of(&row.1))
            .filter(|word| !word.is_empty())
        else {
            return Ok(None);
        };
        Approach::of_word(word, self.joints.len())
            .map(Some)
            .ok_or_else(|| {
                let problem = format!(
                    "approach: found {word:?}; + or -, or a sign for each joint, is allowed"
                );
                wrong_row(resolver, row, problem)
            })
    }
}

/// Three standard deviations of a row, where there are some.
fn deviations_in(
    resolver: &Resolver<'_>,
    row: &(usize, Vec<String>),
    numbers: Option<&[ForeignNumber]>,
    (scale, kind): (f64, &Kind),
) -> Result<Option<Vector3<f64>>, FileError> {
    let Some(numbers) = numbers else {
        return Ok(None);
    };
    let mut all = Vector3::zeros();
    for (own, number) in all.iter_mut().zip(numbers) {
        *own = number.of(resolver, row)?;
        check(resolver, row, "a standard deviation", kind, *own * scale)?;
    }
    Ok(Some(all))
}

fn wrong_row(
    resolver: &Resolver<'_>,
    row: &(usize, Vec<String>),
    problem: impl Into<String>,
) -> FileError {
    FileError::new(resolver.table_path, problem).at(format!("line {}", row.0))
}

fn check(
    resolver: &Resolver<'_>,
    row: &(usize, Vec<String>),
    what: &str,
    kind: &Kind,
    value: f64,
) -> Result<f64, FileError> {
    kind.check(value).map_err(|problem| {
        wrong_row(resolver, row, format!("{what}: {problem}"))
            .hint("is the unit in the mapping the right one?")
    })
}

fn position(
    resolver: &Resolver<'_>,
    row: &(usize, Vec<String>),
    what: &str,
    numbers: &[ForeignNumber],
) -> Result<Vector3<f64>, FileError> {
    let mut all = Vector3::zeros();
    for (own, number) in all.iter_mut().zip(numbers) {
        *own = number.of(resolver, row)?;
        check(resolver, row, what, &plausible::POSITION, *own * 1e3)?;
    }
    Ok(all)
}

/// The joints, each with whether it slides.
fn joints(
    resolver: &Resolver<'_>,
    file: &MappingFile,
) -> Result<Vec<(ForeignNumber, bool)>, FileError> {
    if file.joint.is_empty() || file.joint.len() > MOST_JOINTS {
        let problem = format!(
            "found {} joints; 1 to {MOST_JOINTS} are allowed",
            file.joint.len()
        );
        return Err(resolver.wrong("joint", problem));
    }
    let mut joints = Vec::new();
    for (index, joint) in file.joint.iter().enumerate() {
        let key = format!("joint[{index}]");
        let of_length = UnitKind::Length.unit(&joint.unit);
        let slides = of_length.is_ok();
        let unit = match of_length {
            Ok(unit) => unit,
            Err(_) => resolver.unit(&format!("{key}.unit"), UnitKind::Angle, &joint.unit)?,
        };
        if joint.sign.abs().to_bits() != 1.0_f64.to_bits() {
            let problem = format!("found {}; 1 or -1 is allowed", joint.sign);
            return Err(resolver.wrong(&format!("{key}.sign"), problem));
        }
        if !joint.offset.is_finite() {
            let problem = format!("found {}; a finite number is allowed", joint.offset);
            return Err(resolver.wrong(&format!("{key}.offset"), problem));
        }
        let number = resolver.number(&key, joint.column.as_deref(), joint.value, unit)?;
        joints.push((number.then(joint.sign, joint.offset), slides));
    }
    Ok(joints)
}

type ValuesAndDeviations = (Vec<ForeignNumber>, Option<Vec<ForeignNumber>>);

/// Three numbers, and their standard deviations where there are some.
fn three(
    resolver: &Resolver<'_>,
    key: &str,
    kind: UnitKind,
    mapping: &super::mapping::VectorMapping,
) -> Result<ValuesAndDeviations, FileError> {
    let unit = resolver.unit(&format!("{key}.unit"), kind, &mapping.unit)?;
    let keys = [format!("{key}.columns"), format!("{key}.value")];
    let values = resolver.numbers(
        [&keys[0], &keys[1]],
        (&mapping.columns, &mapping.value),
        3,
        unit,
    )?;
    let of = (
        &mapping.std_columns[..],
        &mapping.std[..],
        mapping.std_unit.as_deref(),
    );
    Ok((
        values,
        deviations_of(resolver, key, kind, of, Some(&mapping.unit))?,
    ))
}

fn deviations_of(
    resolver: &Resolver<'_>,
    key: &str,
    kind: UnitKind,
    (columns, constant, unit): (&[String], &[f64], Option<&str>),
    otherwise: Option<&str>,
) -> Result<Option<Vec<ForeignNumber>>, FileError> {
    if columns.is_empty() && constant.is_empty() {
        return Ok(None);
    }
    let unit_key = format!("{key}.std_unit");
    let unit = unit
        .or(otherwise)
        .ok_or_else(|| resolver.wrong(&unit_key, "is missing"))?;
    let unit = resolver.unit(&unit_key, kind, unit)?;
    let keys = [format!("{key}.std_columns"), format!("{key}.std")];
    resolver
        .numbers([&keys[0], &keys[1]], (columns, constant), 3, unit)
        .map(Some)
}

type RotationNumbers = (Convention, Vec<ForeignNumber>, Option<Vec<ForeignNumber>>);

fn rotation_of(
    resolver: &Resolver<'_>,
    mapping: &super::mapping::RotationMapping,
) -> Result<RotationNumbers, FileError> {
    let convention = Convention::of(mapping).map_err(|(key, problem, hint)| {
        let wrong = resolver.wrong(&format!("rotation.{key}"), problem);
        match hint {
            Some(hint) => wrong.hint(hint),
            None => wrong,
        }
    })?;
    let unit = match (&mapping.unit, convention.has_unit()) {
        (Some(unit), true) => resolver.unit("rotation.unit", UnitKind::Angle, unit)?,
        (None, true) => {
            return Err(resolver.wrong("rotation.unit", "is missing: \"deg\" or \"rad\""));
        }
        (None, false) => (UnitFactor::ONE, 0.0),
        (Some(_), false) => {
            return Err(resolver.wrong("rotation.unit", "is for angles and rotation vectors alone"));
        }
    };
    let keys = ["rotation.columns", "rotation.value"];
    let numbers = resolver.numbers(keys, (&mapping.columns, &[]), convention.numbers(), unit)?;
    let of = (
        &mapping.std_columns[..],
        &mapping.std[..],
        mapping.std_unit.as_deref(),
    );
    let deviations = deviations_of(
        resolver,
        "rotation",
        UnitKind::Angle,
        of,
        mapping.unit.as_deref(),
    )?;
    Ok((convention, numbers, deviations))
}

/// The header and the fields of a text that this program wrote.
fn fields(text: &str) -> (Vec<&str>, Vec<Vec<&str>>) {
    let mut lines = text.lines().map(|line| {
        line.split(',')
            .map(|field| field.trim_matches('"'))
            .collect()
    });
    let header = lines.next().unwrap_or_default();
    (header, lines.collect())
}

fn ranges(text: &str) -> Vec<ColumnRange> {
    let (header, rows) = fields(text);
    let column = |(index, name): (usize, &&str)| {
        let words = ["target", "state", "station", "approach"];
        let all = rows.iter().filter_map(|row| row.get(index).copied());
        let different: std::collections::BTreeSet<&str> = all.clone().collect();
        let range = (!words.contains(name)).then(|| {
            let values = all.filter_map(|field| field.parse::<f64>().ok());
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
                [low.min(value), high.max(value)]
            })
        });
        ColumnRange {
            column: (*name).to_owned(),
            range,
            different: different.len(),
        }
    };
    header.iter().enumerate().map(column).collect()
}

/// The first row as it was understood.
fn in_words(text: &str, line: usize) -> String {
    let (header, rows) = fields(text);
    let first = rows.first().cloned().unwrap_or_default();
    let told = header.iter().zip(first).map(|(column, field)| {
        let (name, unit) = column.rsplit_once('_').unwrap_or((*column, ""));
        let shown = field
            .parse::<f64>()
            .map_or_else(|_| field.to_owned(), |value| format!("{value:.5}"));
        let trimmed = if shown.contains('.') {
            shown.trim_end_matches('0').trim_end_matches('.')
        } else {
            &shown
        };
        format!("{name} = {trimmed} {unit}").trim_end().to_owned()
    });
    format!("Line {line}: {}.", told.collect::<Vec<_>>().join(", "))
}
