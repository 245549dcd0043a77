//! Plans of few configurations, in which several loads hang: chosen from configurations that searches met, then turned with all that hangs
//! there.

use std::cell::RefCell;

use nalgebra::{DMatrix, Vector3};

use super::candidates::Candidates;
use super::exact_plan::ExactDesign;
use super::local::Precision;
use super::point::{Point, force};
use super::problem::Problem;
use super::sampling::RandomPlans;
use super::size::PlanSize;
use super::watch::Watch;
use crate::experiment::{Candidate, Experiment, Loads, together};
use crate::plan::Plan;
use crate::robot::CommandPose;

/// So many candidates are chosen from: of all configurations that a search met where they bear few loads.
const OFFERED: usize = 1000;
/// The most sweeps over a plan's configurations.
const SWEEPS: usize = 50;

/// The best plan of a size that is found from configurations that a search met, and mandatory ones, under several loads, read along each
/// direction: where configurations are fewer than measurements several may be in one. None where nothing is to be chosen, or no plan
/// determines the compliances.
pub(super) fn with_several_loads(
    problem: &Problem<'_>,
    size: PlanSize,
    met: &[Point],
    seed: u64,
    watch: Watch<'_>,
) -> Option<ExactDesign> {
    let task = problem.task;
    let mandatory = &task.design.mandatory;
    // A row has all loads of a list, and one where any is allowed.
    let is_any = matches!(task.loads, Loads::Any { .. });
    let loads = if is_any {
        1
    } else {
        task.loads.listed()?.len()
    };
    let is_one =
        loads == 1 && !is_any && task.directions.len() == 1 && mandatory.experiments.is_empty();
    let free = size.beside(mandatory);
    if is_one || free.configurations >= free.measurements {
        return None;
    }
    let met = met.iter().map(|point| point.experiment(1));
    let places: Vec<Experiment> = mandatory.experiments.iter().cloned().chain(met).collect();
    let firsts = together(places.len(), |place| places[place].pose(), |_, _| true);
    let mut sampler = RandomPlans::new(problem);
    let mut rows = Vec::new();
    for group in firsts {
        if rows.len() * task.directions.len() * loads < OFFERED {
            rows.extend(rows_at(problem, &sampler, places[group[0]].pose()));
        }
    }
    let candidates = Candidates::new(task, &rows).ok()?;
    let found = candidates.search(problem, size, seed, Watch::quiet(watch.stop));
    Some(turned(problem, &mut sampler, found.ok()?.0))
}

/// A command pose under each of the loads that are listed; under forces in all directions where any is allowed.
fn rows_at(
    problem: &Problem<'_>,
    sampler: &RandomPlans<'_>,
    pose: CommandPose<'_>,
) -> Vec<Candidate> {
    let row = Candidate::at(pose);
    let Loads::Any { force_max_n } = problem.task.loads else {
        return vec![row];
    };
    let directions = (0..27).map(|index| {
        let along = [index % 3, index / 3 % 3, index / 9].map(|step| f64::from(step) - 1.0);
        Vector3::from(along)
    });
    // Of opposite forces, which tell the same, gravity may allow one.
    let is_taken = |direction: &Vector3<f64>| {
        let first = direction.iter().rev().find(|part| **part != 0.0);
        first.is_some_and(|part| *part < 0.0 || problem.is_force_bounded())
    };
    let loads = directions.filter(is_taken).filter_map(|direction| {
        let (q, direction) = (pose.0.as_slice(), direction.normalize());
        let size = sampler
            .local
            .largest_size(q, &direction, [0.0, force_max_n])?;
        Some(force(&direction, size))
    });
    loads
        .map(|load| Candidate {
            load: Some(load),
            ..row.clone()
        })
        .collect()
}

/// The plan whose configurations beside mandatory ones are turned, one after the other and each with what is free of its loads, until
/// nothing more is gained.
fn turned(
    problem: &Problem<'_>,
    sampler: &mut RandomPlans<'_>,
    mut found: ExactDesign,
) -> ExactDesign {
    let mandatory = problem.task.design.mandatory.experiments.len();
    let function = RefCell::new(problem.cost());
    let cost = |information: &DMatrix<f64>, directions: Option<&mut DMatrix<f64>>| {
        let function = &mut *function.borrow_mut();
        match directions {
            Some(directions) => function.cost(information, directions),
            None => function.cost(information, &mut information.clone()),
        }
    };
    for _ in 0..SWEEPS {
        let before = found.cost;
        for group in found.plan.by_configuration() {
            if group[0] < mandatory || problem.is_stopped() {
                continue;
            }
            let all = found.plan.experiments.iter().cloned().enumerate();
            let (own, others): (Vec<_>, Vec<_>) = all.partition(|(place, _)| group.contains(place));
            let [own, experiments] =
                [own, others].map(|part| part.into_iter().map(|(_, each)| each).collect());
            let rest = problem.information(&Plan { experiments });
            let beside = |told: &DMatrix<f64>, directions: Option<&mut DMatrix<f64>>| {
                cost(&(&rest + told), directions)
            };
            let own: Vec<Experiment> = own;
            let turned = (sampler.local).improve_together(&own, &beside, Precision::FINE);
            let Some(turned) = turned.filter(|turned| sampler.are_clear(turned)) else {
                continue;
            };
            let mut plan = found.plan.clone();
            for (&place, turned) in group.iter().zip(turned) {
                plan.experiments[place] = turned;
            }
            let cost = cost(&problem.information(&plan), None);
            if cost < found.cost {
                found = ExactDesign {
                    plan,
                    cost,
                    ..found
                };
            }
        }
        if found.cost > before * (1.0 - Precision::FINE.converged) {
            break;
        }
    }
    found
}
