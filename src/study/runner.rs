//! Blocks of runs on all threads.

use std::ops::Range;

use rayon::prelude::*;

use super::model_level::{Model, PlanModel};
use super::normal::{LANES, fill_normals};
use super::robot_level::RobotRuns;
use super::tally::{Batch, BlockSums, Failure, Tally};
use super::{Entry, EntryKind, StudyError};
use crate::plan::Criterion;
use crate::plan::search::{Problem, RandomPlans};
use crate::scenario::{Level, Scenario};

/// A study made ready to run.
#[derive(Debug)]
pub struct Runner<'a> {
    scenario: &'a Scenario,
    level: Level,
    experiments: u32,
    entries: &'a [Entry],
    problem: Problem<'a>,
    model: Model<'a>,
    /// The model of each plan that is the same in all runs.
    plans: Vec<Option<PlanModel>>,
    /// The plan that others are compared with.
    reference: Option<usize>,
}

/// What one thread needs.
struct Workspace<'a> {
    random: RandomPlans<'a>,
    robot: Option<RobotRuns<'a>>,
    normals: Vec<[f64; LANES]>,
    batches: Vec<Batch>,
    sums: Vec<BlockSums>,
}

impl<'a> Runner<'a> {
    /// Prepares the plans of a study, which all have so many measurements.
    ///
    /// # Errors
    /// A plan cannot work in any run, or there is none.
    pub fn new(
        scenario: &'a Scenario,
        level: Level,
        experiments: u32,
        entries: &'a [Entry],
    ) -> Result<Self, StudyError> {
        if entries.is_empty() {
            return Err(StudyError::NoPlan);
        }
        let model = Model::new(scenario);
        let prepare = |entry: &Entry| {
            let Some(plan) = entry.kind.plan() else {
                return Ok(None);
            };
            let found = plan.measurements();
            if found != experiments {
                return Err(StudyError::Experiments {
                    plan: entry.name.clone(),
                    found,
                    expected: experiments,
                });
            }
            let prepared = model.plan(plan).map_err(|failure| StudyError::Plan {
                plan: entry.name.clone(),
                failure,
            })?;
            Ok(Some(prepared))
        };
        let plans = entries.iter().map(prepare).collect::<Result<_, _>>()?;
        if level == Level::Robot {
            // What is wrong with the model shows before the work.
            RobotRuns::new(scenario)?;
        }
        Ok(Self {
            scenario,
            level,
            experiments,
            entries,
            problem: Problem::new(scenario, Criterion::TestPose),
            model,
            plans,
            reference: reference(entries),
        })
    }

    /// The number of runs of a block.
    #[must_use]
    pub const fn block_runs(&self) -> u64 {
        block_runs(self.level)
    }

    /// The number of blocks of so many runs.
    #[must_use]
    pub const fn blocks(&self, trials: u64) -> u64 {
        trials.div_ceil(self.block_runs())
    }

    /// Makes the runs of every `step`-th block of a range and tallies each plan; after every block,
    /// `progress` is told how many runs it had.
    ///
    /// # Errors
    /// The virtual robot's model lacks something.
    pub fn run(
        &self,
        trials: u64,
        blocks: Range<u64>,
        step: u64,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Vec<Tally>, StudyError> {
        let step = step.max(1);
        let count = blocks.end.saturating_sub(blocks.start).div_ceil(step);
        (0..count)
            .into_par_iter()
            .map(|index| blocks.start + index * step)
            .map_init(
                || self.workspace(),
                |workspace, block| {
                    let workspace = workspace.as_mut().map_err(|error| error.clone())?;
                    let first = block * self.block_runs();
                    let runs = self.block_runs().min(trials.saturating_sub(first));
                    let tallies = self.block(workspace, first, runs);
                    progress(runs);
                    Ok(tallies)
                },
            )
            .try_reduce(|| vec![Tally::default(); self.entries.len()], merge)
    }

    fn workspace(&self) -> Result<Workspace<'_>, StudyError> {
        let rotations = self.scenario.instrument.rotation_sigma_rad.is_some();
        let numbers = if rotations { 6 } else { 3 } * self.experiments as usize;
        let plans = self.entries.len();
        Ok(Workspace {
            random: RandomPlans::new(&self.problem),
            robot: match self.level {
                Level::Model => None,
                Level::Robot => Some(RobotRuns::new(self.scenario)?),
            },
            normals: vec![[0.0; LANES]; numbers],
            batches: vec![Batch::default(); plans],
            sums: vec![BlockSums::default(); plans],
        })
    }

    /// Consecutive runs in a fixed order, a batch at a time.
    fn block(&self, workspace: &mut Workspace<'_>, first: u64, runs: u64) -> Vec<Tally> {
        let mut tallies = vec![Tally::default(); self.entries.len()];
        let end = first + runs;
        for first in (first..end).step_by(LANES) {
            let count = usize::try_from(end - first).map_or(LANES, |left| left.min(LANES));
            fill_normals(self.scenario.seed, first, &mut workspace.normals);
            for index in 0..self.entries.len() {
                let mut batch = self.batch(workspace, index, first, count);
                batch.clean(count);
                workspace.batches[index] = batch;
            }
            let reference = self.reference.map(|index| &workspace.batches[index]);
            for ((tally, sums), batch) in (tallies.iter_mut())
                .zip(&mut workspace.sums)
                .zip(&workspace.batches)
            {
                tally.add(sums, batch, reference, count);
            }
        }
        for (tally, sums) in tallies.iter_mut().zip(&mut workspace.sums) {
            tally.close(sums);
        }
        tallies
    }

    fn batch(
        &self,
        workspace: &mut Workspace<'_>,
        index: usize,
        first: u64,
        count: usize,
    ) -> Batch {
        let kind = &self.entries[index].kind;
        if let (Some(model), Some(plan)) = (&self.plans[index], kind.plan()) {
            let mut batch = model.run(&workspace.normals);
            if let Some(robot) = &mut workspace.robot {
                for lane in 0..count {
                    replace(&mut batch, lane, robot.run(plan, &workspace.normals, lane));
                }
            }
            return batch;
        }
        let mut batch = Batch::default();
        for (lane, run) in (first..).take(count).enumerate() {
            if let Err(failure) = self.random_run(workspace, &mut batch, lane, run) {
                batch.failed[lane] = Some(failure);
            }
        }
        batch
    }

    /// A run with a random plan of its own.
    fn random_run(
        &self,
        workspace: &mut Workspace<'_>,
        batch: &mut Batch,
        lane: usize,
        run: u64,
    ) -> Result<(), Failure> {
        let plan = workspace
            .random
            .draw(self.experiments, run)
            .map_err(|_| Failure::NoPlan)?;
        let all = self.model.plan(&plan)?.run(&workspace.normals);
        batch.square[lane] = all.square[lane];
        batch.nees[lane] = all.nees[lane];
        batch.expected[lane] = all.expected[lane];
        batch.variance[lane] = all.variance[lane];
        if let Some(robot) = &mut workspace.robot {
            replace(batch, lane, robot.run(&plan, &workspace.normals, lane));
        }
        Ok(())
    }
}

/// The number of runs of a block, the unit of work. Sums depend on it, so it is fixed.
#[must_use]
pub const fn block_runs(level: Level) -> u64 {
    match level {
        Level::Model => 2048,
        Level::Robot => 64,
    }
}

/// The plan that others are compared with: the first random one.
#[must_use]
pub fn reference(entries: &[Entry]) -> Option<usize> {
    (entries.iter()).position(|entry| !matches!(entry.kind, EntryKind::Fixed(_)))
}

/// Puts what was seen on the virtual robot in the place of the model's outcome.
fn replace(batch: &mut Batch, lane: usize, outcome: Result<(f64, f64), Failure>) {
    match outcome {
        Ok((square, nees)) => {
            batch.square[lane] = square;
            batch.nees[lane] = nees;
        }
        Err(failure) => batch.failed[lane] = Some(failure),
    }
}

#[expect(
    clippy::unnecessary_wraps,
    clippy::needless_pass_by_value,
    reason = "rayon's shape"
)]
fn merge(mut one: Vec<Tally>, other: Vec<Tally>) -> Result<Vec<Tally>, StudyError> {
    for (one, other) in one.iter_mut().zip(&other) {
        one.merge(other);
    }
    Ok(one)
}
