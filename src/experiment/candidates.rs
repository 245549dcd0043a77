//! Files of plans, and of candidates: what may be measured, of which a plan is chosen.

use std::path::Path;

use nalgebra::DVector;

use super::file::{
    APPROACH, LOAD, approach, configuration, configuration_and_load, experiment_columns,
};
use super::{Experiment, Plan};
use crate::codes::ErrorCode;
use crate::csv::{Columns, Row, Table, word_field};
use crate::files::FileError;
use crate::files::output::write_whole;
use crate::quantities::limits::{MOST_CANDIDATES, MOST_MEASUREMENTS};
use crate::quantities::plausible::faint_load;
use crate::robot::{Approach, Commands, Load};
use crate::text::wrong_name;

/// How often an experiment is measured, or a candidate may be.
const REPEATS: &str = "repeats";
/// What is read, and from where.
const PLACES: [&str; 2] = ["target", "station"];

/// One row of a file of candidates.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Its line.
    pub line: usize,
    /// The commanded joint angles q (rad; m where a joint slides).
    pub configuration_rad: DVector<f64>,
    /// The load W, in the world frame at the calibration tool; none where the file has no loads.
    pub load: Option<Load>,
    /// How often it may be measured; any number of times where the file does not say.
    pub most: Option<u32>,
    /// The site of the model that is read, where the file says.
    pub target: Option<String>,
    /// Where the instrument stands, where the file says.
    pub station: Option<String>,
    /// From which side the configuration is approached, where the file says.
    pub approach: Option<Approach>,
}

/// Reads candidates for an arm.
///
/// # Errors
/// See [`Table::read_with`]; the columns of a load come together, `repeats` must be a whole number from 1, and no load faint.
pub fn read_candidates(
    path: &Path,
    commands: impl Into<Commands>,
) -> Result<Vec<Candidate>, FileError> {
    candidates_of(path, &commands.into()).map_err(|wrong| wrong.or_code(ErrorCode::CandidateFile))
}

fn candidates_of(path: &Path, commands: &Commands) -> Result<Vec<Candidate>, FileError> {
    let optional = LOAD.iter().chain(&[REPEATS, APPROACH]).chain(&PLACES);
    let words = PLACES.iter().chain(&[APPROACH]);
    let table = table(path, commands.columns(), optional, words)?;
    let has_load = table.has(&LOAD);
    if let Some(column) = LOAD.iter().find(|column| !has_load && table.has(&[column])) {
        let problem = format!("found {column:?} alone; these columns come together: {LOAD:?}");
        return Err(table.wrong_header(problem));
    }
    let has_repeats = table.has(&[REPEATS]);
    let candidate = |row: Row<'_>| {
        let load = has_load.then(|| configuration_and_load(&row, commands).1);
        if let Some(problem) = load.and_then(|load| faint_load(&load.wrench())) {
            return Err(row.wrong(problem));
        }
        let often = ": how often the candidate may be measured";
        let most = has_repeats.then(|| repeats(&row, often)).transpose()?;
        let [target, station] = PLACES.map(|column| name(&row, column));
        Ok(Candidate {
            line: row.line(),
            configuration_rad: configuration(&row, commands),
            load,
            most,
            target: target?,
            station: station?,
            approach: approach(&row, commands)?,
        })
    };
    let candidates = table.rows().map(candidate).collect::<Result<Vec<_>, _>>()?;
    if candidates.len() > MOST_CANDIDATES {
        let found = candidates.len();
        let problem = format!("found {found} candidates; at most {MOST_CANDIDATES} are allowed");
        return Err(FileError::new(path, problem));
    }
    Ok(candidates)
}

fn table<'p, 'c>(
    path: &'p Path,
    required: Vec<String>,
    optional: impl Iterator<Item = &'c &'static str>,
    words: impl Iterator<Item = &'c &'static str>,
) -> Result<Table<'p>, FileError> {
    let columns = Columns {
        required,
        optional: optional.map(|&column| column.to_owned()).collect(),
        words: words.map(|&column| column.to_owned()).collect(),
        ..Columns::default()
    };
    Table::read_with(path, &columns)
}

/// Reads a plan for an arm, which may be given by its number of joints.
///
/// # Errors
/// See [`Table::read_with`]; `repeats` must be a whole number from 1, and no load zero.
pub fn read_plan(path: &Path, commands: impl Into<Commands>) -> Result<Plan, FileError> {
    plan_of(path, &commands.into()).map_err(|wrong| wrong.or_code(ErrorCode::PlanFile))
}

fn plan_of(path: &Path, commands: &Commands) -> Result<Plan, FileError> {
    let mut required = experiment_columns(commands);
    required.push(REPEATS.to_owned());
    let table = table(path, required, [APPROACH].iter(), [APPROACH].iter())?;
    let experiment = |row: Row<'_>| {
        let repeats = repeats(&row, "")?;
        let (configuration_rad, load) = configuration_and_load(&row, commands);
        if load == Load::NONE {
            return Err(row.wrong("found a load of zero, which deflects nothing"));
        }
        if let Some(problem) = faint_load(&load.wrench()) {
            return Err(row.wrong(problem));
        }
        Ok(Experiment {
            configuration_rad,
            load,
            repeats,
            approach: approach(&row, commands)?,
        })
    };
    let experiments = table.rows().map(experiment).collect::<Result<_, _>>()?;
    let plan = Plan { experiments };
    let all = plan.experiments.iter().map(|each| u64::from(each.repeats));
    let all: u64 = all.sum();
    if all > u64::from(MOST_MEASUREMENTS) {
        let problem = format!(
            "found {all} measurements, repeats counted; at most {MOST_MEASUREMENTS} are allowed"
        );
        return Err(FileError::new(path, problem).at("repeats"));
    }
    Ok(plan)
}

/// Writes a plan for an arm, which may be given by its number of joints.
pub fn write_plan(
    path: &Path,
    commands: impl Into<Commands>,
    plan: &Plan,
) -> Result<(), FileError> {
    let row = |each: &Experiment| Candidate {
        line: 0,
        configuration_rad: each.configuration_rad.clone(),
        load: Some(each.load),
        most: Some(each.repeats),
        target: None,
        station: None,
        approach: each.approach.clone(),
    };
    let rows: Vec<Candidate> = plan.experiments.iter().map(row).collect();
    write(path, &commands.into(), &rows, true)
}

/// Writes candidates, or a plan of them, whose repeats are then the most that there may be; columns that nobody needs are left
/// out.
pub fn write_candidates(
    path: &Path,
    commands: impl Into<Commands>,
    candidates: &[Candidate],
) -> Result<(), FileError> {
    let has_load = candidates.iter().any(|each| each.load.is_some());
    write(path, &commands.into(), candidates, has_load)
}

fn write(
    path: &Path,
    commands: &Commands,
    candidates: &[Candidate],
    has_load: bool,
) -> Result<(), FileError> {
    let has = |of: &dyn Fn(&Candidate) -> bool| candidates.iter().any(of);
    let has_target = has(&|each| each.target.is_some());
    let has_station = has(&|each| each.station.is_some());
    let has_approach = has(&|each| each.approach.is_some());
    let mut columns = commands.columns();
    columns.extend(
        LOAD.iter()
            .filter(|_| has_load)
            .map(|&column| column.to_owned()),
    );
    columns.extend([REPEATS.to_owned()]);
    let [target, station] = PLACES.map(str::to_owned);
    columns.extend(has_target.then_some(target));
    columns.extend(has_station.then_some(station));
    columns.extend(has_approach.then(|| APPROACH.to_owned()));
    let mut text = columns.join(",") + "\n";
    for each in candidates {
        let mut fields: Vec<String> = (commands.numbers(each.configuration_rad.as_slice()).iter())
            .map(ToString::to_string)
            .collect();
        if has_load {
            let wrench = each.load.unwrap_or(Load::NONE).wrench();
            fields.extend(wrench.iter().map(ToString::to_string));
        }
        fields.push(each.most.unwrap_or(1).to_string());
        let word = |word: &Option<String>| word_field(word.as_deref().unwrap_or_default());
        fields.extend(has_target.then(|| word(&each.target)));
        fields.extend(has_station.then(|| word(&each.station)));
        let side = || (each.approach.as_ref()).map_or_else(String::new, Approach::field);
        fields.extend(has_approach.then(side));
        text += &(fields.join(",") + "\n");
    }
    write_whole(path, text.as_bytes())
}

fn repeats(row: &Row<'_>, of_what: &str) -> Result<u32, FileError> {
    let repeats = row.get(REPEATS);
    if repeats.fract() != 0.0 || !(1.0..=f64::from(MOST_MEASUREMENTS)).contains(&repeats) {
        return Err(row.wrong(format!(
            "{REPEATS}: found {repeats}; a whole number from 1 to {MOST_MEASUREMENTS} is allowed{of_what}"
        )));
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked to be a whole number from 1 to 1e6"
    )]
    let repeats = repeats as u32;
    Ok(repeats)
}

fn name(row: &Row<'_>, column: &str) -> Result<Option<String>, FileError> {
    match row.word(column) {
        None => Ok(None),
        Some(word) => match wrong_name(word) {
            Some(problem) => Err(row.wrong(format!("{column}: {problem}"))),
            None => Ok(Some(word.to_owned())),
        },
    }
}
