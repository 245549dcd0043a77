//! Blocks of runs on all threads.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use super::model_level::{LinearModel, PlanModel};
use super::robot_level::RobotRuns;
use super::tally::{Batch, BlockSums, Failure, Tally};
use super::{Entry, EntryKind, Level, Setting, StudyError};
use crate::numeric::random::normal::{LANES, fill_normals};
use crate::numeric::random::streams::Stream;
use crate::plan::search::{Problem, RandomPlans};
use crate::plan::{Criterion, Plan};
use crate::testbed::{TrueCompliances, numbers};

/// What makes the runs of a study in blocks, all plans of each.
pub trait RunsInBlocks {
    /// The number of runs of a block.
    fn block_runs(&self) -> u64;

    /// Makes the runs of every `step`-th block of a range and tallies each plan; after every block,
    /// `progress` is told how many runs it had.
    ///
    /// # Errors
    /// The virtual robot's model lacks something, or it was asked to stop.
    fn run(
        &self,
        trials: u64,
        blocks: Range<u64>,
        step: u64,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Vec<Tally>, StudyError>;

    /// The number of blocks of so many runs.
    fn blocks(&self, trials: u64) -> u64 {
        trials.div_ceil(self.block_runs())
    }
}

/// Which blocks are run, of so many runs each.
pub(super) struct RunBlocks {
    pub block_runs: u64,
    pub trials: u64,
    pub numbers: Range<u64>,
    pub step: u64,
}

impl RunBlocks {
    /// Runs them side by side, each in a workspace of its thread, from its first run on, and merges the tallies of so many plans.
    pub(super) fn run<Workspace>(
        self,
        plans: usize,
        workspace: impl Fn() -> Result<Workspace, StudyError> + Send + Sync,
        block: impl Fn(&mut Workspace, u64, u64) -> Result<Vec<Tally>, StudyError> + Send + Sync,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Vec<Tally>, StudyError> {
        let step = self.step.max(1);
        let count = (self.numbers.end.saturating_sub(self.numbers.start)).div_ceil(step);
        (0..count)
            .into_par_iter()
            .map(|index| self.numbers.start + index * step)
            .map_init(workspace, |workspace, number| {
                let workspace = workspace.as_mut().map_err(|error| error.clone())?;
                let first = number * self.block_runs;
                let runs = self.block_runs.min(self.trials.saturating_sub(first));
                let tallies = block(workspace, first, runs)?;
                progress(runs);
                Ok(tallies)
            })
            .try_reduce(|| vec![Tally::default(); plans], merge)
    }
}

/// A study made ready to run.
#[derive(Debug)]
pub struct Runner<'a> {
    seed: u64,
    level: Level,
    entries: &'a [Entry],
    parts: Vec<Part<'a>>,
    /// The model of each plan that is the same in all runs.
    plans: Vec<Option<PlanModel>>,
    /// For each plan, the one that it is compared with.
    references: Vec<Option<usize>>,
    stop: Option<&'a AtomicBool>,
}

/// What the plans under the same conditions have in common.
#[derive(Debug)]
struct Part<'a> {
    setting: &'a Setting<'a>,
    problem: Problem<'a>,
    model: LinearModel<'a>,
}

/// What one thread needs.
struct ThreadWorkspace<'a> {
    normals: Vec<[f64; LANES]>,
    /// What the laboratory takes besides.
    laboratory: Vec<[f64; LANES]>,
    truth: TrueCompliances<'a>,
    /// One for each setting.
    parts: Vec<PartWorkspace<'a>>,
    batches: Vec<Batch>,
    sums: Vec<BlockSums>,
}

/// What one thread needs for one setting.
struct PartWorkspace<'a> {
    random: RandomPlans<'a>,
    robot: Option<RobotRuns<'a>>,
    /// See [`Deviations::values`](super::deviations::Deviations::values).
    unknown: Vec<[f64; LANES]>,
}

impl<'a> Runner<'a> {
    /// Prepares the plans of a study under a seed, which have as many measurements as the conditions of their
    /// settings say.
    ///
    /// # Errors
    /// A plan cannot work in any run, or there is none.
    pub fn new(
        settings: &'a [Setting<'a>],
        seed: u64,
        level: Level,
        entries: &'a [Entry],
    ) -> Result<Self, StudyError> {
        let (Some(first), false) = (settings.first(), entries.is_empty()) else {
            return Err(StudyError::NoPlan);
        };
        let parts: Vec<Part<'_>> = (settings.iter())
            .map(|setting| Part {
                setting,
                problem: Problem::new(&setting.task, Criterion::TestPose),
                model: LinearModel::new(&setting.task, setting.truth),
            })
            .collect();
        let plans = (entries.iter())
            .map(|entry| prepare(&parts[entry.setting], entry))
            .collect::<Result<_, _>>()?;
        if level == Level::Robot {
            // What is wrong with the model shows before the work.
            RobotRuns::new(&first.task, first.truth)?;
        }
        Ok(Self {
            seed,
            level,
            entries,
            parts,
            plans,
            references: references(entries),
            stop: None,
        })
    }

    /// The same, which gives up when the flag is set.
    pub fn stopped_by(self, stop: &'a AtomicBool) -> Self {
        Self {
            stop: Some(stop),
            ..self
        }
    }

    fn workspace(&self) -> Result<ThreadWorkspace<'_>, StudyError> {
        let parts: Vec<PartWorkspace<'_>> = (self.parts.iter())
            .map(|part| {
                Ok(PartWorkspace {
                    random: RandomPlans::new(&part.problem),
                    robot: match self.level {
                        Level::Model => None,
                        Level::Robot => {
                            Some(RobotRuns::new(&part.setting.task, part.setting.truth)?)
                        }
                    },
                    unknown: Vec::new(),
                })
            })
            .collect::<Result<_, StudyError>>()?;
        let numbers = (self.parts.iter())
            .map(|part| {
                let measurements = part.setting.conditions.experiments as usize;
                numbers(&part.setting.task.belief.instrument, measurements)
            })
            .max();
        let of_laboratory =
            (self.parts.iter().zip(&parts)).map(|(part, mine): (&Part<'_>, &PartWorkspace<'_>)| {
                let measurements = part.setting.conditions.experiments as usize;
                mine.robot.as_ref().map_or_else(
                    || part.model.deviations().numbers(),
                    |robot| robot.numbers(measurements),
                )
            });
        let mut workspace = ThreadWorkspace {
            laboratory: vec![[0.0; LANES]; of_laboratory.max().unwrap_or(0)],
            normals: vec![[0.0; LANES]; numbers.unwrap_or(0)],
            truth: TrueCompliances::new(self.parts[0].setting.truth, self.seed),
            parts,
            batches: vec![Batch::default(); self.entries.len()],
            sums: vec![BlockSums::default(); self.entries.len()],
        };
        self.draw_truth(&mut workspace, 0);
        Ok(workspace)
    }

    /// Consecutive runs in a fixed order, a batch at a time.
    fn block(
        &self,
        workspace: &mut ThreadWorkspace<'_>,
        first: u64,
        runs: u64,
    ) -> Result<Vec<Tally>, StudyError> {
        let mut tallies = vec![Tally::default(); self.entries.len()];
        let end = first + runs;
        for first in (first..end).step_by(LANES) {
            let count = usize::try_from(end - first).map_or(LANES, |left| left.min(LANES));
            fill_normals(Stream::Noise, self.seed, first, &mut workspace.normals);
            fill_normals(
                Stream::Circumstances,
                self.seed,
                first,
                &mut workspace.laboratory,
            );
            if workspace.truth.varies() || !workspace.laboratory.is_empty() {
                self.draw_truth(workspace, first);
            }
            for index in 0..self.entries.len() {
                if self.stop.is_some_and(|stop| stop.load(Ordering::Relaxed)) {
                    return Err(StudyError::Stopped);
                }
                self.batch(workspace, index, first, count);
                workspace.batches[index].clean(count);
            }
            for (index, (tally, sums)) in tallies.iter_mut().zip(&mut workspace.sums).enumerate() {
                let reference = self.references[index].map(|other| &workspace.batches[other]);
                tally.add(sums, &workspace.batches[index], reference, count);
            }
        }
        for (tally, sums) in tallies.iter_mut().zip(&mut workspace.sums) {
            tally.close(sums);
        }
        Ok(tallies)
    }

    /// Draws the true compliances of some runs.
    fn draw_truth(&self, workspace: &mut ThreadWorkspace<'_>, first: u64) {
        let truth = workspace.truth.draw(first);
        for (part, mine) in self.parts.iter().zip(&mut workspace.parts) {
            mine.unknown = part.model.deviations().values(truth, &workspace.laboratory);
        }
    }

    /// Makes an entry's next runs.
    fn batch(&self, workspace: &mut ThreadWorkspace<'_>, index: usize, first: u64, count: usize) {
        let entry = &self.entries[index];
        let (Some(model), Some(plan)) = (&self.plans[index], entry.kind.plan()) else {
            let mut batch = Batch::default();
            for (lane, run) in (first..).take(count).enumerate() {
                let made = self.random_run(workspace, entry.setting, &mut batch, lane, run);
                if let Err(failure) = made {
                    batch.failed[lane] = Some(failure);
                }
            }
            workspace.batches[index] = batch;
            return;
        };
        let mine = &workspace.parts[entry.setting];
        let batch = &mut workspace.batches[index];
        model.run_into(batch, &workspace.normals, &mine.unknown);
        if mine.robot.is_none() {
            return;
        }
        let mut batch = std::mem::take(batch);
        for lane in 0..count {
            robot_run(workspace, entry.setting, plan, &mut batch, lane);
        }
        workspace.batches[index] = batch;
    }

    /// A run with a random plan of its own.
    fn random_run(
        &self,
        workspace: &mut ThreadWorkspace<'_>,
        setting: usize,
        batch: &mut Batch,
        lane: usize,
        run: u64,
    ) -> Result<(), Failure> {
        let part = &self.parts[setting];
        let experiments = part.setting.conditions.experiments;
        let drawn = workspace.parts[setting]
            .random
            .draw(experiments, self.seed, run);
        let plan = drawn.map_err(|_| Failure::NoPlan)?;
        let unknown = &workspace.parts[setting].unknown;
        let all = (part.model.plan(&plan)?).run(&workspace.normals, unknown);
        take_lane(batch, &all, lane);
        robot_run(workspace, setting, &plan, batch, lane);
        Ok(())
    }
}

impl RunsInBlocks for Runner<'_> {
    fn block_runs(&self) -> u64 {
        block_runs(self.level)
    }

    fn run(
        &self,
        trials: u64,
        blocks: Range<u64>,
        step: u64,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Vec<Tally>, StudyError> {
        let blocks = RunBlocks {
            block_runs: self.block_runs(),
            trials,
            numbers: blocks,
            step,
        };
        blocks.run(
            self.entries.len(),
            || self.workspace(),
            |workspace, first, runs| self.block(workspace, first, runs),
            progress,
        )
    }
}

/// Puts another batch's outcome of a run in the place of its own.
fn take_lane(batch: &mut Batch, other: &Batch, lane: usize) {
    batch.square[lane] = other.square[lane];
    batch.nees[lane] = other.nees[lane];
    batch.expected[lane] = other.expected[lane];
    batch.variance[lane] = other.variance[lane];
    batch.freedom[lane] = other.freedom[lane];
}

/// The model of a plan that is the same in all runs.
fn prepare(part: &Part<'_>, entry: &Entry) -> Result<Option<PlanModel>, StudyError> {
    let Some(plan) = entry.kind.plan() else {
        return Ok(None);
    };
    let (found, expected) = (plan.measurements(), part.setting.conditions.experiments);
    if found != expected {
        return Err(StudyError::Experiments {
            plan: entry.name.clone(),
            found,
            expected,
        });
    }
    let model = part.model.plan(plan).map_err(|failure| StudyError::Plan {
        plan: entry.name.clone(),
        failure,
    })?;
    Ok(Some(model))
}

/// At the robot's level, puts what is seen on the virtual robot in the place of the model's outcome.
fn robot_run(
    workspace: &mut ThreadWorkspace<'_>,
    setting: usize,
    plan: &Plan,
    batch: &mut Batch,
    lane: usize,
) {
    let Some(robot) = &mut workspace.parts[setting].robot else {
        return;
    };
    let normals = (&*workspace.normals, &*workspace.laboratory);
    if robot
        .become_run(workspace.truth.current(), normals.1, lane)
        .is_err()
    {
        batch.failed[lane] = Some(Failure::Measurement);
        return;
    }
    match robot.run(plan, normals, lane) {
        Ok(outcome) => {
            batch.square[lane] = outcome.square;
            batch.nees[lane] = outcome.nees;
            batch.intervals[lane] = outcome.intervals;
        }
        Err(failure) => batch.failed[lane] = Some(failure),
    }
}

/// The number of runs of a block, the unit of work. Sums depend on it, so it is fixed.
pub const fn block_runs(level: Level) -> u64 {
    match level {
        Level::Model => 2048,
        Level::Robot => 64,
    }
}

/// For each plan, the one that it is compared with: the first random one under the same conditions.
pub fn references(entries: &[Entry]) -> Vec<Option<usize>> {
    let is_random = |entry: &Entry| !matches!(entry.kind, EntryKind::Fixed(_));
    let reference = |each: &Entry| {
        (entries.iter()).position(|other| other.setting == each.setting && is_random(other))
    };
    entries.iter().map(reference).collect()
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
