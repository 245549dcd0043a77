//! Blocks of runs on all threads.

use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use super::absolute::ReadingRuns;
use super::model_level::{LinearModel, PlanModel};
use super::robot_level::{PreparedPlan, RobotRuns};
use super::tally::{Batch, BlockSums, FailedRun, Failure, Tally};
use super::{Entry, Level, Setting, StudyError, TakenPlan};
use crate::numeric::random::normal::{LANES, fill_normals};
use crate::numeric::random::streams::Stream;
use crate::plan::Criterion;
use crate::plan::absolute::PredictedAccuracy;
use crate::plan::search::{Problem, RandomPlans};
use crate::task::AccuracyKind;
use crate::testbed::{TrueCompliances, TrueRobots, numbers};

/// A study made ready to run.
#[derive(Debug)]
pub struct Runner<'a> {
    seed: u64,
    level: Level,
    settings: &'a [Setting<'a>],
    entries: &'a [Entry<'a>],
    /// What plans of deflections under the same conditions have in common, by setting; none where readings are absolute.
    parts: Vec<Part<'a>>,
    plans: Vec<ReadyPlan<'a>>,
    stop: Option<&'a AtomicBool>,
    /// The first run that failed, and why.
    first_failure: Mutex<Option<(u64, String)>>,
}

/// What the plans under the same conditions have in common.
#[derive(Debug)]
struct Part<'a> {
    setting: &'a Setting<'a>,
    problem: Problem<'a>,
    model: LinearModel<'a>,
}

/// A plan made ready.
#[derive(Debug)]
enum ReadyPlan<'a> {
    /// Of deflections: the linear model, where all runs have the same plan, and at the robot's level what else is the same in them.
    Deflections(Option<PlanModel>, Option<Box<PreparedPlan<'a>>>),
    /// Of absolute readings.
    Readings(Box<ReadingRuns<'a>>),
}

/// A plan with its conditions and, of absolute readings, what it predicts.
#[derive(Clone, Copy)]
pub struct PlanInStudy<'a> {
    /// The plan.
    pub entry: &'a Entry<'a>,
    /// Its conditions.
    pub setting: &'a Setting<'a>,
    /// What it predicts, of absolute readings.
    pub prediction: Option<&'a PredictedAccuracy>,
}

/// What one thread needs.
pub struct ThreadWorkspace<'a> {
    normals: Vec<[f64; LANES]>,
    /// What the laboratory takes besides.
    laboratory: Vec<[f64; LANES]>,
    truth: TrueCompliances<'a>,
    /// One for each setting, of deflections.
    parts: Vec<PartWorkspace<'a>>,
    /// The virtual robot of each plan of absolute readings.
    robots: Vec<Option<TrueRobots>>,
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
        entries: &'a [Entry<'a>],
    ) -> Result<Self, StudyError> {
        let (Some(first), false) = (settings.first(), entries.is_empty()) else {
            return Err(StudyError::NoPlan);
        };
        let of_deflections =
            |setting: &&Setting<'_>| setting.task.design.accuracy == AccuracyKind::Relative;
        let parts: Vec<Part<'_>> = (settings.iter().filter(of_deflections))
            .map(|setting| Part {
                setting,
                problem: Problem::new(&setting.task, Criterion::TestPose),
                model: LinearModel::new(&setting.task, setting.truth),
            })
            .collect();
        let ready = |entry: &'a Entry<'a>| {
            let (setting, name) = (&settings[entry.setting], || entry.name.clone());
            let plan = match &entry.plan {
                None => return Ok(ReadyPlan::Deflections(None, None)),
                Some(TakenPlan::Deflections(plan)) => plan,
                Some(TakenPlan::Readings(readings)) => {
                    let runs = ReadingRuns::new(setting, readings)?;
                    // What the model lacks is told before the work.
                    runs.robots()?;
                    return Ok(ReadyPlan::Readings(Box::new(runs)));
                }
            };
            let (found, expected) = (plan.measurements(), setting.conditions.experiments);
            if found != expected {
                let plan = name();
                return Err(StudyError::Experiments {
                    plan,
                    found,
                    expected,
                });
            }
            let failed = |failure| StudyError::Plan {
                plan: name(),
                failure,
            };
            let model = parts[entry.setting].model.plan(plan).map_err(failed)?;
            let prepared =
                (level == Level::Robot).then(|| Box::new(PreparedPlan::new(&setting.task, plan)));
            Ok(ReadyPlan::Deflections(Some(model), prepared))
        };
        let plans = (entries.iter().map(ready)).collect::<Result<_, StudyError>>()?;
        if level == Level::Robot && !parts.is_empty() {
            RobotRuns::new(&first.task, first.truth)?;
        }
        Ok(Self {
            seed,
            level,
            settings,
            entries,
            parts,
            plans,
            stop: None,
            first_failure: Mutex::new(None),
        })
    }

    /// The same, which gives up when the flag is set.
    pub fn stopped_by(self, stop: &'a AtomicBool) -> Self {
        Self {
            stop: Some(stop),
            ..self
        }
    }

    /// The number of runs of a block, the unit of work.
    pub fn block_runs(&self) -> u64 {
        block_runs(self.settings[0].task.design.accuracy, self.level)
    }

    /// The number of blocks of so many runs.
    pub fn blocks(&self, trials: u64) -> u64 {
        trials.div_ceil(self.block_runs())
    }

    /// For each plan, the one that it is compared with: the first random one under the same conditions.
    pub fn references(&self) -> Vec<Option<usize>> {
        let reference = |each: &Entry<'_>| {
            let is_it = |other: &Entry<'_>| other.setting == each.setting && other.is_random;
            self.entries.iter().position(is_it)
        };
        self.entries.iter().map(reference).collect()
    }

    /// The plans.
    pub fn plans(&self) -> impl Iterator<Item = PlanInStudy<'_>> {
        self.entries.iter().zip(&self.plans).map(|(entry, plan)| {
            let prediction = match plan {
                ReadyPlan::Deflections(..) => None,
                ReadyPlan::Readings(runs) => Some(&runs.prediction),
            };
            PlanInStudy {
                entry,
                setting: &self.settings[entry.setting],
                prediction,
            }
        })
    }

    /// Why the first of the runs that were made and failed did so.
    pub fn first_failure(&self) -> Option<String> {
        let first = self.first_failure.lock().ok()?;
        first.as_ref().map(|(_, reason)| reason.clone())
    }

    fn note(&self, run: u64, reason: String) {
        if let Ok(mut first) = self.first_failure.lock()
            && first.as_ref().is_none_or(|(known, _)| run < *known)
        {
            *first = Some((run, reason));
        }
    }

    /// Whether to go on.
    fn proceed(&self) -> Result<(), StudyError> {
        match self.stop {
            Some(stop) if stop.load(Ordering::Relaxed) => Err(StudyError::Stopped),
            _ => Ok(()),
        }
    }

    /// Makes the runs of every `step`-th block of a range side by side, each from its first run on, and tallies each plan; after
    /// every block, `progress` is told how many runs it had.
    ///
    /// # Errors
    /// The virtual robot's model lacks something, or it was asked to stop.
    pub fn run(
        &self,
        trials: u64,
        blocks: Range<u64>,
        step: u64,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Vec<Tally>, StudyError> {
        let step = step.max(1);
        let count = (blocks.end.saturating_sub(blocks.start)).div_ceil(step);
        let nothing = || vec![Tally::default(); self.entries.len()];
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

    /// Consecutive runs in a fixed order, a batch at a time.
    fn block<'w>(
        &'w self,
        workspace: &mut ThreadWorkspace<'w>,
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
                self.make(workspace, plan, first, count, batch)?;
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

    /// What a thread begins with.
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
        let (mut of_noise, mut of_laboratory) = (0, 0);
        for (part, mine) in self.parts.iter().zip(&parts) {
            let measurements = part.setting.conditions.experiments as usize;
            let instrument = &part.setting.task.belief.instrument;
            of_noise = of_noise.max(numbers(instrument, measurements));
            of_laboratory = of_laboratory.max(mine.robot.as_ref().map_or_else(
                || part.model.deviations().numbers(),
                |robot| robot.numbers(measurements),
            ));
        }
        let robots = self.plans.iter().map(|plan| match plan {
            ReadyPlan::Deflections(..) => Ok(None),
            ReadyPlan::Readings(runs) => runs.robots().map(Some),
        });
        let mut workspace = ThreadWorkspace {
            laboratory: vec![[0.0; LANES]; of_laboratory],
            normals: vec![[0.0; LANES]; of_noise],
            truth: TrueCompliances::new(self.settings[0].truth, self.seed),
            robots: robots.collect::<Result<_, _>>()?,
            parts,
        };
        self.draw_truth(&mut workspace, 0);
        Ok(workspace)
    }

    /// Draws what all plans of deflections share in up to [`LANES`] runs from `first` on.
    fn draw(&self, workspace: &mut ThreadWorkspace<'_>, first: u64) {
        let (noise, laboratory) = (&mut workspace.normals, &mut workspace.laboratory);
        fill_normals(Stream::Noise, self.seed, first, noise);
        fill_normals(Stream::Circumstances, self.seed, first, laboratory);
        if workspace.truth.varies() || !workspace.laboratory.is_empty() {
            self.draw_truth(workspace, first);
        }
    }

    /// Draws the true compliances of some runs.
    fn draw_truth(&self, workspace: &mut ThreadWorkspace<'_>, first: u64) {
        if self.parts.is_empty() {
            return;
        }
        let truth = workspace.truth.draw(first);
        for (part, mine) in self.parts.iter().zip(&mut workspace.parts) {
            mine.unknown = part.model.deviations().values(truth, &workspace.laboratory);
        }
    }

    /// Makes runs of one plan, from a first one on, so many of them.
    fn make<'w>(
        &'w self,
        workspace: &mut ThreadWorkspace<'w>,
        plan: usize,
        first: u64,
        count: usize,
        batch: &mut Batch,
    ) -> Result<(), StudyError> {
        self.proceed()?;
        match &self.plans[plan] {
            ReadyPlan::Deflections(Some(model), _) => {
                let mine = &workspace.parts[self.entries[plan].setting];
                model.run_into(batch, &workspace.normals, &mine.unknown);
                if self.level == Level::Model {
                    return Ok(());
                }
            }
            ReadyPlan::Deflections(None, _) => *batch = Batch::default(),
            ReadyPlan::Readings(runs) => {
                let [expected, variance] = runs.expected();
                *batch = Batch {
                    expected: [expected; LANES],
                    variance: [variance; LANES],
                    freedom: [runs.freedom(); LANES],
                    ..Batch::default()
                };
            }
        }
        for (lane, run) in (first..).take(count).enumerate() {
            self.proceed()?;
            if let Err(failed) = self.one(workspace, plan, run, batch, lane) {
                batch.failed[lane] = Some(failed.failure);
                self.note(run, failed.reason);
            }
        }
        Ok(())
    }

    /// One run of one plan, in a lane.
    fn one<'w>(
        &'w self,
        workspace: &mut ThreadWorkspace<'w>,
        plan: usize,
        run: u64,
        batch: &mut Batch,
        lane: usize,
    ) -> Result<(), FailedRun> {
        let setting = self.entries[plan].setting;
        match (&self.plans[plan], &mut workspace.robots[plan]) {
            (ReadyPlan::Readings(runs), Some(robots)) => {
                let made = runs.run(robots, self.seed, run)?;
                batch.put(lane, &runs.outcome(&made));
                Ok(())
            }
            (ReadyPlan::Deflections(_, Some(prepared)), _) => {
                robot_run(workspace, setting, prepared, batch, lane)
            }
            _ => self.random_run(workspace, setting, run, batch, lane),
        }
    }

    /// A run with a random plan of its own.
    fn random_run(
        &self,
        workspace: &mut ThreadWorkspace<'_>,
        setting: usize,
        run: u64,
        batch: &mut Batch,
        lane: usize,
    ) -> Result<(), FailedRun> {
        let part = &self.parts[setting];
        let experiments = part.setting.conditions.experiments;
        let mine = &mut workspace.parts[setting];
        let drawn = mine.random.draw(experiments, self.seed, run);
        let plan = drawn.map_err(|error| Failure::NoPlan.because(&error))?;
        let all = (part.model.plan(&plan)?).run(&workspace.normals, &mine.unknown);
        batch.square[lane] = all.square[lane];
        batch.nees[lane] = all.nees[lane];
        batch.expected[lane] = all.expected[lane];
        batch.variance[lane] = all.variance[lane];
        batch.freedom[lane] = all.freedom[lane];
        if self.level == Level::Model {
            return Ok(());
        }
        let prepared = PreparedPlan::new(&part.setting.task, &plan);
        robot_run(workspace, setting, &prepared, batch, lane)
    }
}

/// At the robot's level, puts what is seen on the virtual robot in the place of the model's outcome.
fn robot_run(
    workspace: &mut ThreadWorkspace<'_>,
    setting: usize,
    plan: &PreparedPlan<'_>,
    batch: &mut Batch,
    lane: usize,
) -> Result<(), FailedRun> {
    let Some(robot) = &mut workspace.parts[setting].robot else {
        return Ok(());
    };
    let laboratory = &workspace.laboratory;
    robot
        .become_run(workspace.truth.current(), laboratory, lane)
        .map_err(|error| Failure::Measurement.because(&error))?;
    batch.put(
        lane,
        &robot.run(plan, &workspace.normals, laboratory, lane)?,
    );
    Ok(())
}

/// The number of runs of a block, the unit of work. Sums depend on it, so it is fixed.
pub const fn block_runs(accuracy: AccuracyKind, level: Level) -> u64 {
    match (accuracy, level) {
        // Such a run takes longer.
        (AccuracyKind::Absolute, _) => LANES as u64,
        (AccuracyKind::Relative, Level::Model) => 2048,
        (AccuracyKind::Relative, Level::Robot) => 64,
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
