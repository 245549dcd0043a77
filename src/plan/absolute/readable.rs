//! What may be read: candidates from each station, and those that are possible.

use std::collections::BTreeMap;

use nalgebra::{UnitQuaternion, Vector3};

use crate::experiment::Candidate;
use crate::identification::IdentificationError;
use crate::measurement::AbsoluteReading;
use crate::observation::ReadLength;
use crate::plan::search::{CandidateError, OfferedCandidates, possible_of};
use crate::plan::{Feasibility, LookingAt};
use crate::quantities::limits::{MOST_CANDIDATES, MOST_EXPERIMENTS};
use crate::robot::{Load, SerialChain, Tool};
use crate::task::{Belief, Task, station_named, wrong_station};

/// Rows as readings from stations: where a task says what stations there are, a row that names none is one from each.
pub(super) fn from_stations(
    task: &Task,
    rows: &[Candidate],
) -> Result<Vec<Candidate>, CandidateError> {
    if task.belief.stations.is_empty() {
        return Ok(rows.to_vec());
    }
    let mut all = Vec::new();
    for row in rows {
        if row.station.is_none() {
            all.extend(task.belief.stations.iter().map(|station| Candidate {
                station: Some(station.name.clone()),
                ..row.clone()
            }));
        } else {
            check_station(task, row)?;
            all.push(row.clone());
        }
    }
    if all.len() > MOST_CANDIDATES {
        return Err(CandidateError::too_many(all.len(), "from", "station"));
    }
    Ok(all)
}

/// Refuses a row of a station that the task has not, or of none where it has several.
pub(super) fn check_station(task: &Task, row: &Candidate) -> Result<(), CandidateError> {
    match wrong_station(&task.belief.stations, row.station.as_deref()) {
        Some([problem, hint]) => {
            let problem = format!("line {}: {problem}", row.line);
            Err(CandidateError::new(problem, Some(&hint)))
        }
        None => Ok(()),
    }
}

/// The rows that a task allows, and why not the others.
pub(super) fn possible(
    task: &Task,
    rows: &[Candidate],
) -> Result<(Vec<Candidate>, OfferedCandidates), CandidateError> {
    let lines: Vec<usize> = rows.iter().map(|row| row.line).collect();
    let targets = targets(&task.belief, rows)?;
    let first_violation = |feasibility: &mut Feasibility<'_>, place: usize| {
        let row = &rows[place];
        let known = row.target.as_deref().and_then(|name| targets.get(name));
        let looking = LookingAt {
            target: known.unwrap_or(&task.belief.calibration_tool),
            station: station_named(&task.belief.stations, row.station.as_deref()),
            is_seen: true,
        };
        let experiment = row.experiment(row.most.unwrap_or(MOST_EXPERIMENTS));
        let violations = feasibility.violations_of_reading(1, &experiment, looking);
        // Without a load there is none that is not allowed.
        let is_fine = |what: &str| what == "load" && experiment.load == Load::NONE;
        (violations.into_iter()).find(|violation| !is_fine(&violation.what))
    };
    let (places, offer) = possible_of(task, &lines, first_violation)?;
    let candidates = places.into_iter().map(|place| rows[place].clone());
    Ok((candidates.collect(), offer))
}

/// The sites of the model that rows name.
fn targets<'a>(
    belief: &Belief,
    rows: &'a [Candidate],
) -> Result<BTreeMap<&'a str, Tool>, CandidateError> {
    let mut known = BTreeMap::new();
    for row in rows {
        let Some(name) = row.target.as_deref() else {
            continue;
        };
        if !known.contains_key(name) {
            let tool = SerialChain::tool(&belief.nominal.model, name);
            let tool = tool.map_err(|error| wrong_target(row.line, &error.to_string()))?;
            known.insert(name, tool);
        }
    }
    Ok(known)
}

/// A target that the model does not have, in the line of the first candidate of it.
fn wrong_target(line: usize, problem: &str) -> CandidateError {
    let hint = "add the target to the scenario as a [[robot.tool]], or to the model as a site";
    CandidateError::new(format!("line {line}: target: {problem}"), Some(hint))
}

/// What is wrong with candidates in these lines.
pub(super) fn wrong_readings(error: &IdentificationError, lines: &[usize]) -> CandidateError {
    let line = |reading: usize| lines.get(reading.wrapping_sub(1)).copied().unwrap_or(0);
    match error {
        IdentificationError::Target { reading, source } => {
            wrong_target(line(*reading), &source.to_string())
        }
        IdentificationError::BeyondLoad { reading, target } => CandidateError::new(
            format!(
                "line {}: the target {target:?} is carried by a joint beyond the calibration tool's, at which loads act",
                line(*reading)
            ),
            None,
        ),
        other => CandidateError::new(other.to_string(), other.hint()),
    }
}

/// A reading that a candidate would be by what reads from its station.
pub(super) fn reading_of(candidate: &Candidate, belief: &Belief) -> AbsoluteReading {
    let length = belief.length_from(candidate.station.as_deref());
    let rotation_rad = (belief.instrument.rotation_sigma_rad).filter(|_| length.is_none());
    AbsoluteReading {
        configuration_rad: candidate.configuration_rad.clone(),
        load: candidate.load.unwrap_or(Load::NONE),
        target: candidate.target.clone(),
        station: candidate.station.clone(),
        visit: None,
        position_m: Vector3::zeros(),
        rotation: rotation_rad.map(|_| UnitQuaternion::identity()),
        length: length.map(|(kind, _)| ReadLength {
            kind,
            length_m: 0.0,
        }),
        covariance: None,
        approach: candidate.approach.clone(),
        time_s: None,
        temperature_c: None,
    }
}
