//! Files of plans, and of candidates: what may be measured, of which a plan is chosen.

use std::path::Path;

use nalgebra::DVector;

use super::file::{
    APPROACH, DIRECTION, LOAD, add_approach, blank_directions, configuration, direction, load,
    planned_approach, reading_columns, reading_fields,
};
use super::{Experiment, Plan};
use crate::codes::ErrorCode;
use crate::csv::{Columns, Row, Sheet, Table, word_field};
use crate::files::FileError;
use crate::files::output::write_whole;
use crate::quantities::limits::{MOST_CANDIDATES, MOST_MEASUREMENTS};
use crate::robot::{Approach, CommandPose, Commands, Load};

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

impl Candidate {
    /// A command pose alone.
    pub fn at((configuration_rad, approach): CommandPose<'_>) -> Self {
        Self {
            line: 0,
            configuration_rad: configuration_rad.clone(),
            load: None,
            most: None,
            target: None,
            station: None,
            approach: approach.cloned(),
        }
    }

    /// Its command pose.
    pub const fn pose(&self) -> CommandPose<'_> {
        (&self.configuration_rad, self.approach.as_ref())
    }

    /// Its configuration and load as an experiment that is made so often.
    pub fn experiment(&self, repeats: u32) -> Experiment {
        Experiment {
            configuration_rad: self.configuration_rad.clone(),
            load: self.load.unwrap_or(Load::NONE),
            repeats,
            approach: self.approach.clone(),
            direction: None,
        }
    }
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
    let numbers = [&LOAD[..], &[REPEATS], &DIRECTION].concat();
    let words = [&PLACES[..], &[APPROACH]].concat();
    let mut columns = Columns::of(commands.columns(), &numbers, &words);
    columns.blank = DIRECTION.map(str::to_owned).into();
    let table = Table::read_with(path, &columns)?;
    if DIRECTION.iter().any(|column| table.has(&[column])) {
        let columns = DIRECTION.join(",");
        let problem = format!(
            "found {columns}; candidates have no directions, a gauge reads each along any of instrument.directions"
        );
        return Err(FileError::new(path, problem).hint("leave these columns out"));
    }
    let has_load = table.has_group(&LOAD)?;
    let has_repeats = table.has(&[REPEATS]);
    let candidate = |row: Row<'_>| {
        let often = ": how often the candidate may be measured";
        let most = has_repeats.then(|| repeats(&row, often)).transpose()?;
        let [target, station] = PLACES.map(|column| row.name(column));
        Ok(Candidate {
            line: row.line(),
            configuration_rad: configuration(&row, commands),
            load: has_load.then(|| load(&row)).transpose()?,
            most,
            target: target?,
            station: station?,
            approach: planned_approach(&row, commands)?,
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

/// Reads a plan for an arm, which may be given by its number of joints.
///
/// # Errors
/// See [`Table::read_with`]; `repeats` must be a whole number from 1, and no load zero.
pub fn read_plan(path: &Path, commands: impl Into<Commands>) -> Result<Plan, FileError> {
    plan_of(path, &commands.into()).map_err(|wrong| wrong.or_code(ErrorCode::PlanFile))
}

fn plan_of(path: &Path, commands: &Commands) -> Result<Plan, FileError> {
    let mut required = reading_columns(commands);
    required.push(REPEATS.to_owned());
    let mut columns = Columns::of(required, &[], &[APPROACH]);
    columns.blank = blank_directions(commands);
    let table = Table::read_with(path, &columns)?;
    let experiment = |row: Row<'_>| {
        let repeats = repeats(&row, "")?;
        let load = load(&row)?;
        if load == Load::NONE {
            return Err(row.wrong("found a load of zero, which deflects nothing"));
        }
        Ok(Experiment {
            configuration_rad: configuration(&row, commands),
            load,
            repeats,
            approach: planned_approach(&row, commands)?,
            direction: direction(&row, commands)?,
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
    let commands = commands.into();
    let mut sheet = Sheet::new(&plan.experiments);
    sheet.add(&reading_columns(&commands), |each| {
        let (q, direction) = (&each.configuration_rad, each.direction.as_ref());
        reading_fields(&commands, q, &each.load, direction)
    });
    sheet.add(&[REPEATS], |each| vec![each.repeats.to_string()]);
    add_approach(&mut sheet, |each| each.approach.as_ref());
    write_whole(path, sheet.text().as_bytes())
}

/// Writes candidates, or a plan of them, whose repeats are then the most that there may be; columns that nobody needs are left
/// out.
pub fn write_candidates(
    path: &Path,
    commands: impl Into<Commands>,
    candidates: &[Candidate],
) -> Result<(), FileError> {
    let has_load = candidates.iter().any(|each| each.load.is_some());
    let commands = commands.into();
    let shown = |values: &[f64]| values.iter().map(ToString::to_string).collect();
    let mut sheet = Sheet::new(candidates);
    sheet.add(&commands.columns(), |each| {
        shown(&commands.numbers(each.configuration_rad.as_slice()))
    });
    if has_load {
        sheet.add(&LOAD, |each| {
            shown(each.load.unwrap_or(Load::NONE).wrench().as_slice())
        });
    }
    sheet.add(&[REPEATS], |each| vec![each.most.unwrap_or(1).to_string()]);
    let words: [fn(&Candidate) -> Option<&str>; 2] = [
        |each| each.target.as_deref(),
        |each| each.station.as_deref(),
    ];
    for (column, word) in PLACES.into_iter().zip(words) {
        if candidates.iter().any(|each| word(each).is_some()) {
            sheet.add(&[column], |each| {
                vec![word_field(word(each).unwrap_or_default())]
            });
        }
    }
    add_approach(&mut sheet, |each| each.approach.as_ref());
    write_whole(path, sheet.text().as_bytes())
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
