//! Plans that are chosen from a list of candidates.

use nalgebra::DMatrix;
use rayon::prelude::*;
use thiserror::Error;

use super::bound::{Bound, Enumerated};
use super::candidate_information::CandidateInformation;
use super::exact::{ExactDesign, Watch};
use super::finite::{FiniteBound, FiniteProblem, SharingCandidates};
use super::finite_search::{ExchangesTry, FiniteEffort};
use super::point::LoadChoice;
use super::problem::{Problem, SearchError};
use crate::experiment::{Candidate, Experiment, Loads, numbered};
use crate::plan::{Criterion, Feasibility, Plan, Violation};
use crate::quantities::limits::{MOST_CANDIDATES, MOST_EXPERIMENTS};
use crate::task::Task;

/// Searches for one plan.
const SEARCHES: usize = 12;

/// What may be measured of a list of candidates.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidates {
    /// Those that are possible, each row under each load; their repeats are the most that there may be.
    pub experiments: Vec<Experiment>,
    /// How many there were, each row under each load.
    pub offered: usize,
    /// Those that are not possible, by the reason.
    pub left_out: Vec<LeftOutCandidates>,
}

/// Candidates that are not possible for one reason.
#[derive(Debug, Clone, PartialEq, serde::Serialize, schemars::JsonSchema)]
pub struct LeftOutCandidates {
    /// What is violated.
    pub what: String,
    /// How many.
    pub count: usize,
    /// The line of the first in its file.
    pub line: usize,
    /// What is wrong with that.
    pub first: String,
}

/// Why no plan can be chosen from candidates.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum CandidateError {
    /// Rows without a load, where there may be forces of any direction.
    #[error("the candidates have no loads, and load.kind = \"any\" does not say which")]
    NoLoad,
    /// A target or a station, where deflections are read.
    #[error(
        "line {line}: {column}: found {found:?}, and deflections are read of the calibration tool, whatever the station"
    )]
    Place {
        /// The line.
        line: usize,
        /// The column.
        column: &'static str,
        /// What it says.
        found: String,
    },
    /// Too many, each row under each load.
    #[error(
        "there are {found} candidates, each row under each load of the scenario; at most {MOST_CANDIDATES} are allowed"
    )]
    TooMany {
        /// How many.
        found: usize,
    },
    /// None is possible.
    #[error("none of {offered} candidates is possible: {}", reasons.join("; "))]
    AllLeftOut {
        /// How many there were.
        offered: usize,
        /// The reasons, with how many each leaves out.
        reasons: Vec<String>,
    },
}

impl CandidateError {
    /// What to do about it.
    pub const fn hint(&self) -> &'static str {
        match self {
            Self::NoLoad => "give the columns fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm",
            Self::Place { .. } => "leave the column out",
            Self::TooMany { .. } => "give fewer rows, or the load of each",
            Self::AllLeftOut { .. } => {
                "check the units of the angles, and the scenario's [region] and [load]"
            }
        }
    }
}

impl std::fmt::Display for LeftOutCandidates {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            what,
            count,
            line,
            first,
        } = self;
        write!(
            formatter,
            "{count} for {what} (the first in line {line}: {first})"
        )
    }
}

/// Which experiments, with the lines that they are in, a task allows, by their places; and why not the others: what a judge
/// finds first.
///
/// # Errors
/// None is possible.
pub(in crate::plan) fn possible_of(
    task: &Task,
    all: &[(usize, Experiment)],
    first_violation: impl Fn(&mut Feasibility<'_>, usize) -> Option<Violation> + Sync,
) -> Result<(Vec<usize>, Vec<LeftOutCandidates>), CandidateError> {
    let wrong: Vec<Option<(String, String)>> = (0..all.len())
        .into_par_iter()
        .map_init(
            || Feasibility::new(task),
            |feasibility, place| {
                let violation = first_violation(feasibility, place)?;
                let words = Violation {
                    experiment: None,
                    ..violation.clone()
                };
                Some((violation.kind(), words.to_string()))
            },
        )
        .collect();
    let mut left_out: Vec<LeftOutCandidates> = Vec::new();
    let mut places = Vec::new();
    for (place, ((line, _), wrong)) in all.iter().zip(wrong).enumerate() {
        let Some((what, first)) = wrong else {
            places.push(place);
            continue;
        };
        match left_out.iter_mut().find(|known| known.what == what) {
            Some(known) => known.count += 1,
            None => left_out.push(LeftOutCandidates {
                what,
                count: 1,
                line: *line,
                first,
            }),
        }
    }
    if places.is_empty() {
        let reasons = left_out.iter().map(ToString::to_string).collect();
        return Err(CandidateError::AllLeftOut {
            offered: all.len(),
            reasons,
        });
    }
    Ok((places, left_out))
}

impl Candidates {
    /// What a task allows of a list of candidates: rows without a load are under each of the scenario's.
    pub fn new(task: &Task, rows: &[Candidate]) -> Result<Self, CandidateError> {
        let loads = match &task.loads {
            Loads::Any { .. } if rows.iter().any(|row| row.load.is_none()) => {
                return Err(CandidateError::NoLoad);
            }
            loads => LoadChoice::new(loads).samples(),
        };
        let mut all: Vec<(usize, Experiment)> = Vec::new();
        for row in rows {
            let line = row.line;
            for (column, found) in [("target", &row.target), ("station", &row.station)] {
                if let Some(found) = found.clone() {
                    return Err(CandidateError::Place {
                        line,
                        column,
                        found,
                    });
                }
            }
            let own = row.load.map(|load| vec![load]);
            let under = own
                .as_ref()
                .unwrap_or(&loads)
                .iter()
                .map(|&load| Experiment {
                    configuration_rad: row.configuration_rad.clone(),
                    load,
                    repeats: row.most.unwrap_or(MOST_EXPERIMENTS),
                    approach: row.approach.clone(),
                });
            all.extend(under.map(|experiment| (line, experiment)));
        }
        let offered = all.len();
        if offered > MOST_CANDIDATES {
            return Err(CandidateError::TooMany { found: offered });
        }
        let (places, left_out) = possible_of(task, &all, |feasibility, place| {
            let violations = feasibility.violations_of(1, &all[place].1);
            violations.into_iter().next()
        })?;
        let experiments = places
            .into_iter()
            .map(|place| all[place].1.clone())
            .collect();
        Ok(Self {
            experiments,
            offered,
            left_out,
        })
    }

    /// The best plan of so many measurements in so many configurations, the mandatory ones among them, with what no plan of
    /// these candidates is better than.
    ///
    /// # Errors
    /// The candidates do not determine what is asked for, or allow fewer measurements.
    pub fn design(
        &self,
        task: &Task,
        criterion: Criterion,
        [measurements, configurations]: [u32; 2],
        seed: u64,
        watch: Watch<'_>,
    ) -> Result<(ExactDesign, Bound), SearchError> {
        let mandatory = &task.design.mandatory;
        let count = u32::try_from(mandatory.experiments.len()).unwrap_or(u32::MAX);
        let effort = FiniteEffort {
            measurements: measurements.saturating_sub(mandatory.measurements()),
            configurations: configurations.saturating_sub(count),
            searches: SEARCHES,
            seed,
            exchanges: ExchangesTry::AllThatMayHelp,
        };
        let problem = Problem::among(task, criterion, &self.experiments);
        problem.check_excited()?;
        let found = self.with_finite(&problem, |finite| finite.search(effort, watch));
        let found = found.map_err(SearchError::Candidates)?;
        let chosen = found.plan.iter().map(|&(candidate, repeats)| Experiment {
            repeats,
            ..self.experiments[candidate].clone()
        });
        let plan = Plan {
            experiments: mandatory
                .experiments
                .iter()
                .cloned()
                .chain(chosen)
                .collect(),
        };
        if !problem.is_determined_by(&plan) {
            return Err(SearchError::Singular {
                experiments: measurements,
                parameters: problem.parameters(),
            });
        }
        let exact = ExactDesign {
            plan,
            cost: found.cost,
            searches: found.searches,
            agreeing: found.agreeing,
        };
        Ok((exact, self.bound_of(&problem, found.bound)))
    }

    /// What no plan of so many measurements of these candidates is better than, as near as the best weights tell it, and as
    /// a plan tells it besides.
    pub fn bound(&self, task: &Task, criterion: Criterion, plan: &Plan) -> Bound {
        let problem = Problem::among(task, criterion, &self.experiments);
        let mandatory = task.design.mandatory.measurements();
        let free = plan.measurements().saturating_sub(mandatory);
        let found = problem.check_excited().and_then(|()| {
            let weighed = self.with_finite(&problem, |finite| finite.weigh(free));
            Ok(weighed.map_err(SearchError::Candidates)?.1)
        });
        match found {
            Ok(bound) => self.bound_of(&problem, bound),
            Err(error) => Bound::none(task, criterion, error),
        }
    }

    fn bound_of(&self, problem: &Problem<'_>, bound: FiniteBound) -> Bound {
        let left_out = problem.left_out().into_iter().map(str::to_owned);
        let enumerated = Enumerated {
            candidates: self.experiments.clone(),
            bound,
            left_out: left_out.collect(),
        };
        Bound::among(problem.task, problem.criterion, enumerated)
    }

    /// Does something with the candidates by what they tell.
    fn with_finite<T>(
        &self,
        problem: &Problem<'_>,
        work: impl FnOnce(&FiniteProblem<'_>) -> T,
    ) -> T {
        let size = problem.parameters();
        let each: Vec<DMatrix<f64>> = self
            .experiments
            .par_iter()
            .map(|experiment| problem.told(experiment, 1))
            .collect();
        let mut told = CandidateInformation::new(size);
        for information in &each {
            told.push(information);
        }
        let is_shared = problem.is_shared_by_configuration();
        let q = |place: usize| &self.experiments[place].configuration_rad;
        let stands_as =
            |one: usize, other: usize| self.experiments[one].stands_as(&self.experiments[other]);
        let shared = if is_shared { self.experiments.len() } else { 0 };
        let mut configurations = numbered(shared, q, stands_as);
        configurations.resize(self.experiments.len(), 0);
        let told_by = |measured: &[(usize, u32)]| {
            if let [(only, times)] = *measured {
                return problem.told(&self.experiments[only], times);
            }
            let each = measured.iter().map(|&(candidate, repeats)| Experiment {
                repeats,
                ..self.experiments[candidate].clone()
            });
            problem.told_by(each.collect())
        };
        let sharing = SharingCandidates {
            configurations: &configurations,
            told: &told_by,
            // Bounds speak about plans that hang one load in each configuration.
            bounds: None,
        };
        work(&FiniteProblem {
            criterion: problem.criterion,
            test_poses: problem.test_poses().clone(),
            beside: problem.information(&problem.task.design.mandatory),
            told,
            most: self.experiments.iter().map(|each| each.repeats).collect(),
            sharing: is_shared.then_some(sharing),
        })
    }
}
