//! What may be planned: rows of a file of candidates, the readings of one plan, and what else is measured already.

use std::path::Path;

use super::joint_functions::RobotFunctions;
use super::readable::{check_station, from_stations, possible, reading_of, wrong_readings};
use super::{AbsolutePlanning, CandidateError, place_rows, setup_of};
use crate::experiment::{Candidate, numbered, read_candidates, together};
use crate::files::FileError;
use crate::identification::{AbsoluteCase, IdentificationError, ParameterGroup, visit_classes};
use crate::measurement::AbsoluteReading;
use crate::observation::{PlannedReading, ReadingErrors, ReadingKind};
use crate::parameter::{ReadingSource, relative_precision};
use crate::plan::search::CandidatePlan;
use crate::robot::Load;
use crate::task::Task;

impl<'a> AbsolutePlanning<'a> {
    /// For a task, the unknowns that groups name besides those of the belief, and candidates; rows that are alike are one.
    pub fn new(
        task: &'a Task,
        groups: &[ParameterGroup],
        rows: &[Candidate],
    ) -> Result<Self, CandidateError> {
        Self::of_rows(task, groups, &[], &merged(rows))
    }

    /// The same where rows that are alike stay apart, beside readings that are taken already: what they tell is known before, and new
    /// ones in their configurations share errors with them.
    pub(super) fn of_rows(
        task: &'a Task,
        groups: &[ParameterGroup],
        measured: &[AbsoluteReading],
        rows: &[Candidate],
    ) -> Result<Self, CandidateError> {
        if !task.design.mandatory.experiments.is_empty() {
            let problem =
                "design.mandatory: plans of absolute readings have no mandatory experiments";
            let hint = "leave it out, and name readings that there are to be among the candidates of `evaluate`";
            return Err(CandidateError::new(problem, Some(hint)));
        }
        let rows = from_stations(task, rows)?;
        let (possible, offer) = possible(task, &rows)?;
        let (taken, times) = taken_once(measured);
        let blank = possible.iter().map(|row| reading_of(row, &task.belief));
        let readings: Vec<AbsoluteReading> = blank.chain(taken.iter().cloned()).collect();
        let mut candidates = possible;
        let offered = candidates.len();
        candidates.extend(taken.iter().map(row_of));
        let lines: Vec<usize> = candidates.iter().map(|candidate| candidate.line).collect();
        let of_lines = |error: IdentificationError| wrong_readings(&error, &lines);
        let mut case = AbsoluteCase::placed(&task.belief, &readings).map_err(of_lines)?;
        let sources = task.belief.uncertain.sources();
        let sources: Vec<&ReadingSource> = sources.map(|(_, source)| source).collect();
        let (kept, new): (Vec<&ReadingSource>, Vec<&ReadingSource>) =
            (sources.into_iter()).partition(|source| source.is_function());
        let loads = candidates
            .iter()
            .map(|each| each.load.unwrap_or(Load::NONE));
        let read: Vec<(usize, Load)> = loads.enumerate().collect();
        let errors: Vec<ReadingErrors> = (read.iter())
            .map(|(place, load)| case.disturbed(*place, load, new.iter().copied()))
            .collect();
        let rounding = case.shared_rounding(&errors);
        let errors = errors.into_iter().zip(&rounding);
        let errors = errors.map(|(own, each)| own.rounded(each)).collect();
        let machining = &task.belief.machining_tool;
        let known = (case.targets.iter()).position(|target| *target == machining.name);
        let target = known.unwrap_or_else(|| {
            // It is where the model has it on its link.
            case.arm.tools.push(machining.clone());
            case.arm.tools.len() - 1
        });
        let first = &case.observations[0];
        let asked = (0..case.stations.len()).map(|station| PlannedReading {
            setup: setup_of(&first.setup.commanded_rad, Load::NONE, [target, station]),
            // Where only lengths are read, the tool's place counts along axes that they do not show: the robot's own.
            kind: (case.length_from(station)).map_or(ReadingKind::Position, ReadingKind::Length),
            whitener: first.whitener,
        });
        let asked: Vec<PlannedReading> = asked.collect();
        let set = case.unknowns_beside(groups, &asked).map_err(of_lines)?;
        let planning = Self {
            functions: RobotFunctions::new(task, (&case, target), &read, &kept),
            task,
            poses: place_rows(task, &case, &set, target),
            target,
            before: relative_precision(&set),
            unasked: case.unasked(groups),
            offer,
            configurations: numbered(readings.len(), |place| readings[place].pose(), |_, _| true),
            visits: visit_classes(&readings, &task.belief),
            candidates,
            case,
            set,
            errors,
            rounding,
            measured: CandidatePlan::new(),
        };
        Ok(planning.knowing((offered..).zip(times).collect()))
    }

    /// With the last candidates, read so often, as known before.
    fn knowing(mut self, measured: CandidatePlan) -> Self {
        for told in self.told_of(&self.groups(&measured)) {
            self.before += told;
        }
        if let Some(&(first, _)) = measured.first() {
            // They were read in visits of their own.
            let known = self.visits.len();
            for visit in &mut self.visits[first..] {
                *visit += known;
            }
        }
        self.measured = measured;
        self
    }

    /// The same of the plan of a file.
    ///
    /// # Errors
    /// It is none of the task, or cannot be read.
    pub fn of_file(
        task: &'a Task,
        groups: &[ParameterGroup],
        path: &Path,
    ) -> Result<Self, FileError> {
        let rows = read_candidates(path, task.belief.commands())?;
        Self::of_plan(task, groups, &rows).map_err(|error| error.in_file(path))
    }

    /// The same of the readings of one plan, each of which says from which of several stations it is, and is possible.
    pub fn of_plan(
        task: &'a Task,
        groups: &[ParameterGroup],
        rows: &[Candidate],
    ) -> Result<Self, CandidateError> {
        (rows.iter()).try_for_each(|row| check_station(task, row))?;
        let once = rows.iter().map(|row| Candidate {
            most: row.most.or(Some(1)),
            ..row.clone()
        });
        let planning = Self::new(task, groups, &once.collect::<Vec<_>>())?;
        if planning.offer.left_out.is_empty() {
            return Ok(planning);
        }
        let reasons = planning.offer.left_out.iter().map(ToString::to_string);
        let reasons = reasons.collect::<Vec<String>>().join("; ");
        let problem = format!("readings that are not possible: {reasons}");
        Err(CandidateError::new(problem, None))
    }

    /// All candidates as one plan, each as often as its file says, or once.
    pub fn whole(&self) -> CandidatePlan {
        let places = self.places().into_iter();
        places
            .map(|place| (place, self.candidates[place].most.unwrap_or(1)))
            .collect()
    }
}

/// Rows of one target, under one load, from one station and in one configuration together.
fn alike(rows: &[Candidate]) -> Vec<Vec<usize>> {
    let is_alike = |one: usize, other: usize| {
        let [one, other] = [&rows[one], &rows[other]];
        (one.load, &one.target, &one.station) == (other.load, &other.target, &other.station)
    };
    together(rows.len(), |place| rows[place].pose(), is_alike)
}

/// Rows that are alike as one that is read as often as all.
pub(super) fn merged(rows: &[Candidate]) -> Vec<Candidate> {
    let times = |group: &[usize]| -> Option<u32> {
        let each: Option<Vec<u32>> = group.iter().map(|&place| rows[place].most).collect();
        each.map(|each| each.into_iter().fold(0, u32::saturating_add))
    };
    let row = |group: Vec<usize>| Candidate {
        most: times(&group),
        ..rows[group[0]].clone()
    };
    alike(rows).into_iter().map(row).collect()
}

/// Readings that are alike as one, with how often it is taken; those of which a column says the visit stay apart.
fn taken_once(measured: &[AbsoluteReading]) -> (Vec<AbsoluteReading>, Vec<u32>) {
    let rows: Vec<Candidate> = measured.iter().map(row_of).collect();
    let times = |group: &[usize]| u32::try_from(group.len()).unwrap_or(u32::MAX);
    let apart = |group: Vec<usize>| match measured[group[0]].visit {
        Some(_) => group.into_iter().map(|place| vec![place]).collect(),
        None => vec![group],
    };
    (alike(&rows).into_iter().flat_map(apart))
        .map(|group| (measured[group[0]].clone(), times(&group)))
        .unzip()
}

/// What a reading read, as a row of a file.
fn row_of(reading: &AbsoluteReading) -> Candidate {
    Candidate {
        line: 0,
        configuration_rad: reading.configuration_rad.clone(),
        load: Some(reading.load),
        most: None,
        target: reading.target.clone(),
        station: reading.station.clone(),
        approach: reading.approach.clone(),
    }
}
