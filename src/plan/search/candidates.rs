//! Plans that are chosen from a list of candidates.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::bound::{Basis, Bound, Enumerated};
use super::candidate_error::{CandidateError, LeftOutCandidates, OfferedCandidates};
use super::candidate_information::CandidateInformation;
use super::error::SearchError;
use super::exact_plan::ExactDesign;
use super::finite::{FiniteBound, FiniteProblem, ToldTogether};
use super::finite_search::FiniteEffort;
use super::problem::Problem;
use super::size::PlanSize;
use super::watch::Watch;
use crate::experiment::{Candidate, Experiment, Loads, numbered};
use crate::plan::{Criterion, Feasibility, Plan, Violation};
use crate::quantities::limits::{MOST_CANDIDATES, MOST_EXPERIMENTS};
use crate::task::Task;

/// Searches for one plan.
const SEARCHES: usize = 12;

/// What may be measured of a list of candidates.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidates {
    /// Those that are possible, each row under each load and along each direction; their repeats are the most that there may be.
    pub experiments: Vec<Experiment>,
    /// How many there were, and why others are not possible.
    pub offer: OfferedCandidates,
}

/// Which candidates of some lines a task allows, by their places; and why not the others: what a judge finds first.
///
/// # Errors
/// None is possible.
pub(in crate::plan) fn possible_of(
    task: &Task,
    lines: &[usize],
    first_violation: impl Fn(&mut Feasibility<'_>, usize) -> Option<Violation> + Sync,
) -> Result<(Vec<usize>, OfferedCandidates), CandidateError> {
    let wrong: Vec<Option<Violation>> = (0..lines.len())
        .into_par_iter()
        .map_init(|| Feasibility::new(task), &first_violation)
        .collect();
    let mut left_out: Vec<LeftOutCandidates> = Vec::new();
    let mut places = Vec::new();
    for (place, wrong) in wrong.into_iter().enumerate() {
        let Some(mut violation) = wrong else {
            places.push(place);
            continue;
        };
        let what = violation.kind();
        if let Some(known) = left_out.iter_mut().find(|known| known.what == what) {
            known.count += 1;
            continue;
        }
        violation.experiment = None;
        left_out.push(LeftOutCandidates {
            what,
            count: 1,
            line: lines[place],
            first: violation.to_string(),
        });
    }
    if places.is_empty() {
        let reasons: Vec<String> = left_out.iter().map(ToString::to_string).collect();
        let (offered, reasons) = (lines.len(), reasons.join("; "));
        let problem = format!("none of {offered} candidates is possible: {reasons}");
        let hint = "check the units of the angles, and the scenario's [region] and [load]";
        return Err(CandidateError::new(problem, Some(hint)));
    }
    let offer = OfferedCandidates {
        offered: lines.len(),
        possible: places.len(),
        left_out,
    };
    Ok((places, offer))
}

impl Candidates {
    /// What a task allows of a list of candidates: rows without a load are under each of the scenario's.
    pub fn new(task: &Task, rows: &[Candidate]) -> Result<Self, CandidateError> {
        let loads = match &task.loads {
            Loads::Any { .. } if rows.iter().any(|row| row.load.is_none()) => {
                let problem =
                    "the candidates have no loads, and load.kind = \"any\" does not say which";
                let hint = "give the columns fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm";
                return Err(CandidateError::new(problem, Some(hint)));
            }
            loads => loads.samples(),
        };
        let (mut lines, mut all) = (Vec::new(), Vec::new());
        for row in rows {
            let line = row.line;
            for (column, found) in [("target", &row.target), ("station", &row.station)] {
                if let Some(found) = found {
                    let problem = format!(
                        "line {line}: {column}: found {found:?}, and deflections are read of the calibration tool, whatever the station"
                    );
                    return Err(CandidateError::new(problem, Some("leave the column out")));
                }
            }
            for &load in row.load.as_ref().map_or(&loads[..], std::slice::from_ref) {
                for &direction in &task.directions {
                    lines.push(line);
                    all.push(Experiment {
                        configuration_rad: row.configuration_rad.clone(),
                        load,
                        repeats: row.most.unwrap_or(MOST_EXPERIMENTS),
                        approach: row.approach.clone(),
                        direction,
                    });
                }
            }
        }
        if all.len() > MOST_CANDIDATES {
            return Err(CandidateError::too_many(all.len(), "under", "load"));
        }
        let (places, offer) = possible_of(task, &lines, |feasibility, place| {
            let violations = feasibility.violations_of(1, &all[place]);
            violations.into_iter().next()
        })?;
        Ok(Self {
            experiments: places.into_iter().map(|place| all[place].clone()).collect(),
            offer,
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
        size: PlanSize,
        seed: u64,
        watch: Watch<'_>,
    ) -> Result<(ExactDesign, Bound), SearchError> {
        let problem = Problem::among(task, criterion, &self.experiments);
        let (mut exact, bound) = self.search(&problem, size, seed, watch)?;
        if let Some(whole) = problem.with_left_out(&exact.plan) {
            let (other, _) = self.search(&whole, size, seed, watch)?;
            exact = exact.or_better(other, &whole);
        }
        Ok((exact, self.bound_of(&problem, bound)))
    }

    /// The same by one problem.
    pub(super) fn search(
        &self,
        problem: &Problem<'_>,
        size: PlanSize,
        seed: u64,
        watch: Watch<'_>,
    ) -> Result<(ExactDesign, FiniteBound), SearchError> {
        problem.check_excited()?;
        let free = size.beside(&problem.task.design.mandatory);
        let effort = FiniteEffort {
            measurements: free.measurements,
            configurations: free.configurations,
            searches: SEARCHES,
            seed,
            is_thorough: true,
        };
        let found = self.finite(problem).search(effort, watch);
        let found = found.map_err(SearchError::Candidates)?;
        let chosen = measured_of(&self.experiments, &found.plan);
        let exact = ExactDesign::beside_mandatory(problem, chosen, found.cost, found.searches);
        if !problem.is_determined_by(&exact.plan) {
            return Err(SearchError::Singular {
                experiments: size.measurements,
                parameters: problem.parameters(),
            });
        }
        Ok((exact, found.bound))
    }

    /// What no plan of so many measurements of these candidates is better than, as near as the best weights tell it, and as
    /// a plan tells it besides.
    pub fn bound(&self, task: &Task, criterion: Criterion, plan: &Plan) -> Bound {
        let problem = Problem::among(task, criterion, &self.experiments);
        let mandatory = task.design.mandatory.measurements();
        let free = plan.measurements().saturating_sub(mandatory);
        let found = problem.check_excited().and_then(|()| {
            let weighed = self.finite(&problem).weigh(free);
            Ok(weighed.map_err(SearchError::Candidates)?.1)
        });
        match found {
            Ok(bound) => self.bound_of(&problem, bound),
            Err(error) => Bound::not_found(task, criterion, error),
        }
    }

    fn bound_of(&self, problem: &Problem<'_>, bound: FiniteBound) -> Bound {
        let left_out = problem.left_out().into_iter().map(str::to_owned);
        let enumerated = Enumerated {
            candidates: self.experiments.clone(),
            bound,
            left_out: left_out.collect(),
        };
        Bound::resting_on(
            problem.task,
            problem.criterion,
            Basis::Candidates(enumerated),
        )
    }

    /// The candidates by what they tell. Bounds speak about plans that hang one load in each configuration.
    fn finite<'p>(&'p self, problem: &'p Problem<'_>) -> FiniteProblem<'p> {
        let all = &self.experiments;
        let each: Vec<DMatrix<f64>> = (all.par_iter())
            .map(|experiment| problem.told(experiment, 1))
            .collect();
        let mandatory = &problem.task.design.mandatory;
        let configurations = numbered(all.len(), |place| all[place].pose(), |_, _| true);
        let is_mandatory =
            |place: &usize| (mandatory.experiments.iter()).any(|each| each.stands_as(&all[*place]));
        let told = |measured: &[(usize, u32)]| {
            let here = mandatory.experiments.iter();
            let here = here
                .filter(|each| each.stands_as(&all[measured[0].0]))
                .cloned();
            let here: Vec<Experiment> = here.collect();
            match *measured {
                [(only, times)] if here.is_empty() => problem.told(&all[only], times),
                _ => {
                    let before = problem.told_by(here.clone());
                    problem.told_by([here, measured_of(all, measured)].concat()) - before
                }
            }
        };
        FiniteProblem {
            criterion: problem.criterion,
            test_poses: problem.test_poses.clone(),
            beside: problem.information(mandatory),
            told: CandidateInformation::of_all(problem.parameters(), &each),
            most: all.iter().map(|each| each.repeats).collect(),
            mandatory: (0..all.len())
                .filter(is_mandatory)
                .map(|place| configurations[place])
                .collect(),
            configurations,
            told_together: (problem.is_shared_by_repeats())
                .then(|| -> Box<ToldTogether<'p>> { Box::new(told) }),
            bounds: None,
        }
    }
}

/// Experiments of a list by their places, each measured so often.
fn measured_of(all: &[Experiment], plan: &[(usize, u32)]) -> Vec<Experiment> {
    let measured = plan.iter().map(|&(place, repeats)| Experiment {
        repeats,
        ..all[place].clone()
    });
    measured.collect()
}
