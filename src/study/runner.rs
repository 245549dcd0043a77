//! Blocks of runs on all threads.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use super::model_level::{LinearModel, PlanModel};
use super::robot_level::{PreparedPlan, RobotRuns};
use super::tally::{Batch, BlockSums, Failure, Tally};
use super::{Entry, EntryKind, Level, Setting, StudyError};
use crate::numeric::random::normal::{LANES, fill_normals};
use crate::numeric::random::streams::Stream;
use crate::plan::Criterion;
use crate::plan::search::{Problem, RandomPlans};
use crate::testbed::{TrueCompliances, numbers};

/// What makes the runs of a study, all plans of each, in blocks.
pub trait RunsInBlocks: Sync {
    /// What one thread needs.
    type Workspace<'a>
    where
        Self: 'a;

    /// The number of runs of a block, the unit of work.
    fn block_runs(&self) -> u64;

    /// For each plan, the one that it is compared with.
    fn references(&self) -> Vec<Option<usize>>;

    /// The flag that stops it.
    fn stop(&self) -> Option<&AtomicBool>;

    /// What a thread begins with.
    ///
    /// # Errors
    /// The virtual robot's model lacks something.
    fn workspace(&self) -> Result<Self::Workspace<'_>, StudyError>;

    /// Draws what all plans share in up to [`LANES`] runs from `first` on.
    fn draw<'a>(&'a self, workspace: &mut Self::Workspace<'a>, first: u64);

    /// Makes runs of one plan, from a first one on, so many of them.
    ///
    /// # Errors
    /// It was asked to stop.
    fn make<'a>(
        &'a self,
        workspace: &mut Self::Workspace<'a>,
        plan: usize,
        runs: (u64, usize),
        batch: &mut Batch,
    ) -> Result<(), StudyError>;

    /// The number of blocks of so many runs.
    fn blocks(&self, trials: u64) -> u64 {
        trials.div_ceil(self.block_runs())
    }

    /// Whether to go on.
    ///
    /// # Errors
    /// It was asked to stop.
    fn proceed(&self) -> Result<(), StudyError> {
        match self.stop() {
            Some(stop) if stop.load(Ordering::Relaxed) => Err(StudyError::Stopped),
            _ => Ok(()),
        }
    }

    /// Consecutive runs in a fixed order, a batch at a time.
    ///
    /// # Errors
    /// It was asked to stop.
    fn block<'a>(
        &'a self,
        workspace: &mut Self::Workspace<'a>,
        first: u64,
        runs: u64,
    ) -> Result<Vec<Tally>, StudyError> {
        let references = self.references();
        let mut tallies = vec![Tally::default(); references.len()];
        let mut sums = vec![BlockSums::default(); references.len()];
        let mut batches = vec![Batch::default(); references.len()];
        let end = first + runs;
        for first in (first..end).step_by(LANES) {
            let count = usize::try_from(end - first).map_or(LANES, |left| left.min(LANES));
            self.draw(workspace, first);
            for (plan, batch) in batches.iter_mut().enumerate() {
                self.proceed()?;
                self.make(workspace, plan, (first, count), batch)?;
                batch.clean(count);
            }
            for (plan, (tally, sums)) in tallies.iter_mut().zip(&mut sums).enumerate() {
                let reference = references[plan].map(|other| &batches[other]);
                tally.add(sums, &batches[plan], reference, count);
            }
        }
        for (tally, sums) in tallies.iter_mut().zip(&mut sums) {
            tally.close(sums);
        }
        Ok(tallies)
    }

    /// Makes the runs of every `step`-th block of a range side by side, each from its first run on, and tallies each plan; after
    /// every block, `progress` is told how many runs it had.
    ///
    /// # Errors
    /// The virtual robot's model lacks something, or it was asked to stop.
    fn run(
        &self,
        trials: u64,
        blocks: Range<u64>,
        step: u64,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Vec<Tally>, StudyError> {
        let step = step.max(1);
        let count = (blocks.end.saturating_sub(blocks.start)).div_ceil(step);
        let nothing = || vec![Tally::default(); self.references().len()];
        (0..count)
            .into_par_iter()
            .map(|index| blocks.start + index * step)
            .map_init(
                || self.workspace(),
                |workspace, number| {
                    let workspace = workspace.as_mut().map_err(|error| error.clone())?;
                    let first = number * self.block_runs();
                    let runs = self.block_runs().min(trials.saturating_sub(first));
                    let tallies = self.block(workspace, first, runs)?;
                    progress(runs);
                    Ok(tallies)
                },
            )
            .try_reduce(nothing, merge)
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
    /// At the robot's level, what else is.
    prepared: Vec<Option<PreparedPlan<'a>>>,
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
pub struct ThreadWorkspace<'a> {
    normals: Vec<[f64; LANES]>,
    /// What the laboratory takes besides.
    laboratory: Vec<[f64; LANES]>,
    truth: TrueCompliances<'a>,
    /// One for each setting.
    parts: Vec<PartWorkspace<'a>>,
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
        let of_robot = |entry: &'a Entry| {
            let plan = entry.kind.plan().filter(|_| level == Level::Robot)?;
            Some(PreparedPlan::new(&settings[entry.setting].task, plan))
        };
        Ok(Self {
            prepared: entries.iter().map(of_robot).collect(),
            seed,
            level,
            entries,
            parts,
            plans,
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

    /// Draws the true compliances of some runs.
    fn draw_truth(&self, workspace: &mut ThreadWorkspace<'_>, first: u64) {
        let truth = workspace.truth.draw(first);
        for (part, mine) in self.parts.iter().zip(&mut workspace.parts) {
            mine.unknown = part.model.deviations().values(truth, &workspace.laboratory);
        }
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
        if workspace.parts[setting].robot.is_some() {
            let prepared = PreparedPlan::new(&part.setting.task, &plan);
            robot_run(workspace, setting, &prepared, batch, lane);
        }
        Ok(())
    }
}

impl RunsInBlocks for Runner<'_> {
    type Workspace<'a>
        = ThreadWorkspace<'a>
    where
        Self: 'a;

    fn block_runs(&self) -> u64 {
        block_runs(self.level)
    }

    fn references(&self) -> Vec<Option<usize>> {
        references(self.entries)
    }

    fn stop(&self) -> Option<&AtomicBool> {
        self.stop
    }

    fn workspace(&self) -> Result<Self::Workspace<'_>, StudyError> {
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
        };
        self.draw_truth(&mut workspace, 0);
        Ok(workspace)
    }

    fn draw<'a>(&'a self, workspace: &mut Self::Workspace<'a>, first: u64) {
        let (noise, laboratory) = (&mut workspace.normals, &mut workspace.laboratory);
        fill_normals(Stream::Noise, self.seed, first, noise);
        fill_normals(Stream::Circumstances, self.seed, first, laboratory);
        if workspace.truth.varies() || !workspace.laboratory.is_empty() {
            self.draw_truth(workspace, first);
        }
    }

    fn make<'a>(
        &'a self,
        workspace: &mut Self::Workspace<'a>,
        plan: usize,
        (first, count): (u64, usize),
        batch: &mut Batch,
    ) -> Result<(), StudyError> {
        let entry = &self.entries[plan];
        let mine = &workspace.parts[entry.setting];
        match &self.plans[plan] {
            Some(model) => model.run_into(batch, &workspace.normals, &mine.unknown),
            None => *batch = Batch::default(),
        }
        if self.plans[plan].is_some() && mine.robot.is_none() {
            return Ok(());
        }
        for (lane, run) in (first..).take(count).enumerate() {
            if let Some(prepared) = &self.prepared[plan] {
                robot_run(workspace, entry.setting, prepared, batch, lane);
            } else {
                let made = self.random_run(workspace, entry.setting, batch, lane, run);
                batch.failed[lane] = made.err().or(batch.failed[lane]);
            }
        }
        Ok(())
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
    plan: &PreparedPlan<'_>,
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
    match robot.run_prepared(plan, normals, lane) {
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
