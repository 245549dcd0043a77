//! A mapping's columns, as far as a table has them.

use super::mapping::{MappingFile, RotationMapping, VectorMapping};
use super::resolved::{ForeignNumber, Resolver, Word};
use super::rotation::Convention;
use super::units::{UnitFactor, UnitKind};
use crate::files::FileError;
use crate::quantities::limits::MOST_JOINTS;
use crate::robot::Commands;

/// What is read of every row.
pub(super) struct ReadingColumns {
    pub commands: Commands,
    pub joints: Vec<(ForeignNumber, bool)>,
    pub place: What,
    pub force: Option<Vec<ForeignNumber>>,
    pub torque: Option<Vec<ForeignNumber>>,
    pub weight: Option<ForeignNumber>,
    pub words: [Option<Word>; 4],
    pub time: Option<ForeignNumber>,
    pub temperature: Option<ForeignNumber>,
    pub understood: Vec<String>,
}

/// Deflections, or absolute readings.
pub(super) enum What {
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
    pub fn of(resolver: &Resolver<'_>, file: &MappingFile) -> Result<Self, FileError> {
        let mut understood = Vec::new();
        let joints = joints(resolver, file)?;
        let slides = joints.iter().map(|(_, slides)| *slides);
        let commands: Commands = slides.collect();
        let vector = |key: &str, kind, mapping: Option<&VectorMapping>| {
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
    pub fn columns(&self) -> Vec<usize> {
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
    mapping: &VectorMapping,
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
    mapping: &RotationMapping,
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
