//! A study as it is recorded and streamed while it runs.

use std::path::Path;

use crate::calibration::calibrate;
use crate::plan::search::random_plan;
use crate::record::{run::RunMessage, tally_file::Header};
use crate::scenario::Scenario;
use crate::study::runner::Runner;
use crate::study::{Entry, Setting, TakenPlan, tally::Tally};
use crate::view::mcap_file::study::write_study_mcap;
use crate::view::recording::Recording;
use crate::view::rerun_file::study::{StudyStream, write_study_rerun};
use crate::view::rerun_file::viewer::Viewer;
use crate::view::study_recording::{Snapshot, StudyRecording};
use crate::workflow::run::replay_readings;
use crate::workflow::study::plan_messages;

use super::target::ViewerTarget;
use crate::cli::written::{Written, warn};

/// What is recorded of a study, and the viewer that it is streamed to.
pub struct StudyObserver {
    study: StudyRecording,
    snapshots: Vec<Snapshot>,
    live: Option<(Viewer, StudyStream)>,
}

impl StudyObserver {
    /// Calibrates once with each plan, to be shown, and opens the viewer.
    pub fn new(
        scenario: &Scenario,
        settings: &[Setting<'_>],
        header: &Header,
        entries: &[Entry<'_>],
        target: Option<&ViewerTarget>,
    ) -> anyhow::Result<Self> {
        let mut shown = Vec::new();
        for (entry, label) in entries.iter().zip(header.labels()) {
            let setting = &settings[entry.setting];
            // A plan that fails on the virtual robot is not shown, and may do by the linear model; that of run 0 stands for all where
            // every run has its own.
            shown.extend(carried_out(
                scenario,
                setting,
                &label,
                entry.plan.as_ref(),
                0,
            ));
        }
        let study = StudyRecording {
            header: header.clone(),
            arms: Recording::new(scenario, &shown)?,
        };
        let live = match target.and_then(ViewerTarget::open) {
            Some(viewer) => {
                let stream = StudyStream::begin(viewer.stream(), &study)?;
                Some((viewer, stream))
            }
            None => None,
        };
        Ok(Self {
            study,
            snapshots: Vec::new(),
            live,
        })
    }

    /// Makes the first runs, to be shown before the first block is done; the block makes them again.
    pub fn first_runs(&mut self, runner: &Runner<'_>, block: u64) -> anyhow::Result<()> {
        for runs in self.study.first_runs() {
            let end = block * runner.block_runs() + runs;
            let tallies = runner.run(end, block..block + 1, 1, &|_| ())?;
            self.observe(&tallies)?;
        }
        Ok(())
    }

    /// Takes a snapshot, and shows it.
    pub fn observe(&mut self, tallies: &[Tally]) -> anyhow::Result<()> {
        let header = &self.study.header;
        let mut plans = plan_messages(header, tallies);
        for (plan, label) in plans.iter_mut().zip(header.labels()) {
            plan.name = label;
        }
        let snapshot = Snapshot {
            runs: tallies
                .first()
                .map_or(0, |tally| tally.runs + tally.failures()),
            plans,
        };
        if let Some((viewer, stream)) = &mut self.live {
            stream.log(viewer.stream(), &self.study, &snapshot)?;
            // That it is gone is said once.
            if let Some(problem) = viewer.lost() {
                warn(&problem, None);
                self.live = None;
            }
        }
        self.snapshots.push(snapshot);
        Ok(())
    }

    /// Writes study.mcap and study.rrd to the folder, if one is given, and the file of the target.
    pub fn finish(
        self,
        folder: Option<&Path>,
        target: Option<&ViewerTarget>,
        written: &mut Written,
    ) {
        let (study, snapshots) = (&self.study, &self.snapshots);
        if let Some(folder) = folder {
            let [mcap, rerun] = ["study.mcap", "study.rrd"].map(|name| folder.join(name));
            written.note(&mcap, write_study_mcap(&mcap, study, snapshots));
            written.note(&rerun, write_study_rerun(&rerun, study, snapshots));
        }
        if let Some(path) = target.and_then(ViewerTarget::file) {
            written.note(path, write_study_rerun(path, study, snapshots));
        }
        if let Some((viewer, _)) = self.live
            && let Some(problem) = viewer.finish()
        {
            warn(&problem, None);
        }
    }
}

/// A plan of a study as it is carried out in a run, whatever is measured; a random one where every run has its own.
pub fn carried_out(
    scenario: &Scenario,
    setting: &Setting<'_>,
    name: &str,
    plan: Option<&TakenPlan<'_>>,
    run: u64,
) -> anyhow::Result<RunMessage> {
    let (task, seed) = (&setting.task, scenario.seed);
    let plan = match plan {
        Some(TakenPlan::Deflections(plan)) => plan.clone(),
        None => random_plan(task, setting.conditions.experiments, seed, run)?,
        Some(TakenPlan::Readings(readings)) => {
            return replay_readings(scenario, setting, name, readings, seed, run);
        }
    };
    let truth = setting.truth;
    let made = calibrate(task, truth, &plan, seed, run)?;
    Ok(RunMessage::of_deflections(task, truth, seed, name, &made)?)
}
