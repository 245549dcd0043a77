//! What was identified, read from its file, and what speaks against trusting it.

use std::path::Path;

use elastocal::estimable::Estimable;
use elastocal::files::FileError;
use elastocal::identification::covariance_of;
use elastocal::plausible::ELASTIC_COMPLIANCE;
use elastocal::posterior::Posterior;
use elastocal::record::messages::{FingerprintMessage, IdentificationMessage};
use elastocal::scenario::Scenario;
use nalgebra::DMatrix;
use serde::Deserialize;
use serde::de::DeserializeOwned;

/// Which file is wanted.
pub const WANTED: &str = "the file must be one that `elastocal identify --identified-out` wrote";

/// What an identification gives to compensate with.
pub struct Identified {
    /// The compliance of every joint (rad/(N m)).
    pub compliance_rad_per_nm: Vec<f64>,
    /// What is known of the parameters.
    pub posterior: Posterior,
    /// What speaks against trusting it.
    pub conditions: Vec<String>,
}

/// What else the file says.
#[derive(Deserialize)]
struct IdentifiedWith {
    identified_with: Option<FingerprintMessage>,
}

/// Reads what `identify --identified-out` wrote, for the same robot.
pub fn read_identified(
    path: &Path,
    text: &str,
    scenario: &Scenario,
) -> Result<Identified, FileError> {
    let message: IdentificationMessage = parse(path, text)?;
    let with: IdentifiedWith = parse(path, text)?;
    let expected = scenario.task.belief.parameter_names();
    if message.parameters != expected {
        let problem = format!(
            "found {}; the scenario's parameters are {}",
            message.parameters.join(", "),
            expected.join(", ")
        );
        return Err(FileError::new(path, problem).at("parameters"));
    }
    let mut conditions = trust(path, scenario, with.identified_with.as_ref())?;
    let posterior = posterior(path, scenario, &message)?;
    let doubts = (message.conditions.iter())
        .map(|condition| format!("the identification in {}: {condition}", path.display()));
    conditions.extend(doubts);
    let mut compliance_rad_per_nm = scenario.task.belief.nominal.compliance_rad_per_nm.clone();
    for (&joint, value) in scenario.task.belief.parameters.iter().zip(&posterior.mean) {
        compliance_rad_per_nm[joint] = *value;
    }
    for (name, value) in expected.iter().zip(&posterior.mean) {
        let negative = format!("the compliance of {name} is negative");
        let is_said = |condition: &String| condition.contains(&negative[4..]);
        if *value < 0.0 && !conditions.iter().any(is_said) {
            conditions.push(negative);
        }
    }
    Ok(Identified {
        compliance_rad_per_nm,
        posterior,
        conditions,
    })
}

fn parse<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T, FileError> {
    let reader = &mut serde_json::Deserializer::from_str(text);
    serde_path_to_error::deserialize(reader).map_err(|error| {
        let wrong = FileError::new(path, error.inner().to_string()).hint(WANTED);
        match error.path().to_string().as_str() {
            "." => wrong,
            key => wrong.at(key),
        }
    })
}

/// Whether it was identified with the robot of the scenario: another one's is refused.
fn trust(
    path: &Path,
    scenario: &Scenario,
    found: Option<&FingerprintMessage>,
) -> Result<Vec<String>, FileError> {
    let renew = format!(
        "renew it with `elastocal identify {} --measurements FILE --identified-out {}`",
        scenario.path.display(),
        path.display()
    );
    let Some(found) = found else {
        return Ok(vec![format!(
            "{} does not say what it was identified with, as files of earlier versions do not: {renew}",
            path.display()
        )]);
    };
    let expected = FingerprintMessage::from(scenario.task.belief.fingerprint());
    if found.robot_sha256 != expected.robot_sha256 {
        let problem = "was identified with another robot: its joints' names, axes or places are not those \
                       of the scenario's model";
        return Err(FileError::new(path, problem)
            .at("identified_with.robot_sha256")
            .hint(format!(
                "give the scenario that it was identified under, or {renew}"
            )));
    }
    if found.belief_sha256 != expected.belief_sha256 {
        return Ok(vec![format!(
            "{} was identified under another scenario: masses, gravity, nominal compliances, the calibration \
             tool or the instrument's sigma are not those of this one; {renew}",
            path.display()
        )]);
    }
    Ok(Vec::new())
}

/// What is known of the parameters.
fn posterior(
    path: &Path,
    scenario: &Scenario,
    message: &IdentificationMessage,
) -> Result<Posterior, FileError> {
    let names = scenario.task.belief.parameter_names();
    let size = names.len();
    let check = |key: &str, found: usize, is_right: bool| {
        let problem = format!("found {found} values; the scenario has {size} parameters");
        let wrong = || FileError::new(path, problem).at(key);
        is_right.then_some(()).ok_or_else(wrong)
    };
    let estimates = &message.compliance_rad_per_nm;
    check(
        "compliance_rad_per_nm",
        estimates.len(),
        estimates.len() == size,
    )?;
    for (index, value) in estimates.iter().enumerate() {
        let Some(value) = *value else { continue };
        ELASTIC_COMPLIANCE.check(value).map_err(|problem| {
            FileError::new(path, format!("{}: {problem}", names[index]))
                .at(format!("compliance_rad_per_nm[{index}]"))
                .hint("measure again with loads that bend this joint, or take it out of robot.parameters")
        })?;
    }
    let rows = &message.covariance_rad2_per_n2m2;
    check("covariance_rad2_per_n2m2", rows.len(), rows.len() == size)?;
    let covariance = covariance_of(rows).map_err(|(place, problem)| {
        FileError::new(path, problem).at(format!("covariance_rad2_per_n2m2{place}"))
    })?;
    // Files of earlier versions have none of these: there, what has no estimate is nominal.
    let applied = &message.compliance_applied_rad_per_nm;
    let is_right = applied.is_empty() || applied.len() == size;
    check("compliance_applied_rad_per_nm", applied.len(), is_right)?;
    let given = &message.compliance_typical_rad_per_nm;
    let is_right = given.is_empty() || given.len() == size;
    check("compliance_typical_rad_per_nm", given.len(), is_right)?;
    let typical = if given.is_empty() {
        scenario
            .task
            .belief
            .nominal
            .typical_rad_per_nm(&scenario.task.belief.parameters)
    } else {
        given.clone()
    };
    if let Some(found) = typical
        .iter()
        .find(|value| value.is_nan() || **value <= 0.0)
    {
        let problem = format!("found {found}; positive numbers are allowed");
        return Err(FileError::new(path, problem).at("compliance_typical_rad_per_nm"));
    }
    let directions = &message.undetermined_directions;
    let wrong = directions.iter().find(|direction| direction.len() != size);
    let found = wrong.map_or(size, Vec::len);
    check("undetermined_directions", found, wrong.is_none())?;
    let hidden = if applied.is_empty() {
        let missing: Vec<usize> = (0..size)
            .filter(|&each| estimates[each].is_none())
            .collect();
        DMatrix::identity(size, size).select_columns(&missing)
    } else {
        DMatrix::from_fn(size, directions.len(), |row, column| {
            directions[column][row]
        })
    };
    let gram = hidden.tr_mul(&hidden);
    let off = (&gram - DMatrix::identity(gram.nrows(), gram.ncols())).amax();
    if off.is_nan() || off > 1e-9 {
        let problem = "these are not orthonormal: the file is damaged";
        return Err(FileError::new(path, problem).at("undetermined_directions"));
    }
    let value = |(index, &joint): (usize, &usize)| {
        let nominal = scenario.task.belief.nominal.compliance_rad_per_nm[joint];
        let applied = applied.get(index).copied().unwrap_or(nominal);
        estimates[index].unwrap_or(applied)
    };
    let posterior = Posterior {
        names,
        mean: scenario
            .task
            .belief
            .parameters
            .iter()
            .enumerate()
            .map(value)
            .collect(),
        covariance,
        estimable: Estimable::with_hidden(&typical, hidden),
    };
    let is_known = |index: usize| posterior.standard_error(index).is_some();
    if let Some(index) = (0..size).find(|&index| estimates[index].is_some() != is_known(index)) {
        let problem = "is a number where undetermined_directions say that there is none, or the other \
                       way round: the file is damaged";
        let place = format!("compliance_rad_per_nm[{index}]");
        return Err(FileError::new(path, problem).at(place));
    }
    Ok(posterior)
}
