//! A study for the rerun viewer: the robot, the running means, the distribution of the distance.
//!
//! On the timeline `run`, each snapshot shows the next experiment or test pose of the plans; all of
//! them are on the timeline `step`.

use std::path::Path;

use re_sdk::blueprint::components::PlayState;
use re_sdk::blueprint::{ContainerLike, Horizontal, Tabs, Vertical};
use re_sdk::{EntityPath, RecordingStream, entity_path};
use re_sdk_types::archetypes::{BarChart, Scalars, SeriesLines};

use super::blueprint::{self, Clock, Layout};
use super::{Logged, STEP, begin, scene, text, write_stream};
use crate::files::FileError;
use crate::record::study::HistogramMessage;
use crate::view::charts::plan_colours;
use crate::view::study_recording::{Snapshot, StudyRecording};

/// The timeline of the number of runs so far.
const RUN: &str = "run";
/// The opacity of lines, and that of bars, which lie over one another.
const OPAQUE: u32 = 255;
const BAR_ALPHA: u32 = 150;

/// No more plans than these have a tab for their distribution.
const MOST_TABS: usize = 30;
/// Means of fewer runs than this fraction of all are not drawn: they would dwarf the bands.
const UNSETTLED: u64 = 500;
/// So much of a distribution is drawn.
const DRAWN: f64 = 0.95;
/// Played again, a study takes so long (s).
const REPLAY_S: f64 = 30.0;

/// Writes a study with its snapshots for the rerun viewer.
pub fn write_study_rerun(
    path: &Path,
    study: &StudyRecording,
    snapshots: &[Snapshot],
) -> Result<(), FileError> {
    write_stream(path, |stream| {
        let mut logged = StudyStream::begin(stream, study)?;
        for snapshot in snapshots {
            logged.log(stream, study, snapshot)?;
        }
        Ok(())
    })
}

/// How far a study has come on its way to a file or a viewer.
pub struct StudyStream {
    snapshots: usize,
}

impl StudyStream {
    /// Begins with the layout and what is there before the first run.
    pub fn begin(stream: &RecordingStream, study: &StudyRecording) -> Logged<Self> {
        let runs = usize::try_from(study.header.trials).unwrap_or(usize::MAX);
        let clock = Clock {
            timeline: RUN,
            // The legend has its place behind the last run.
            range: [0, runs.saturating_add(runs / 7 + 1)],
            per_second: study.header.trials as f64 / REPLAY_S,
            play_state: PlayState::Following,
        };
        begin(stream, &study.arms, &clock, |layout| root(study, layout))?;
        log_beginning(stream, study)?;
        Ok(Self { snapshots: 0 })
    }

    /// Adds a snapshot.
    pub fn log(
        &mut self,
        stream: &RecordingStream,
        study: &StudyRecording,
        snapshot: &Snapshot,
    ) -> Logged {
        stream.set_time_sequence(RUN, i64::try_from(snapshot.runs).unwrap_or(i64::MAX));
        stream.log("text/table", &text::study_table(study, snapshot)?)?;
        if let Some(sources) = text::study_sources(snapshot)? {
            stream.log("text/sources", &sources)?;
        }
        for (plan, colour) in snapshot.plans.iter().zip(colours(study)) {
            if let (Some(mean), Some([low, high])) = (plan.mean_mm, plan.mean_ci95_mm)
                && snapshot.runs >= study.header.trials / UNSETTLED
            {
                let values = [mean, low, high].map(|value| value * 1e3);
                stream.log(mean_path(&plan.name), &Scalars::new(values))?;
            }
            if let Some(bars) = bars(&plan.histogram) {
                let bars = bars.with_color(colour - OPAQUE + BAR_ALPHA);
                stream.log(distance_path(&plan.name), &bars)?;
            }
        }
        let steps = study.arms.steps().count().max(1);
        if let Some((_, calibration, step)) = study.arms.steps().nth(self.snapshots % steps) {
            scene::log_step(stream, &study.arms, calibration, step)?;
        }
        self.snapshots += 1;
        Ok(())
    }
}

fn log_beginning(stream: &RecordingStream, study: &StudyRecording) -> Logged {
    if study.arms.shows_robot() {
        scene::log_bodies(stream, &study.arms)?;
    }
    stream.log_static("text/about", &text::study(study)?)?;
    for (name, colour) in study.header.labels().iter().zip(colours(study)) {
        // One name for the mean and its band makes one entry in the legend.
        let lines = SeriesLines::new()
            .with_colors([colour; 3])
            .with_widths([2.5, 0.7, 0.7])
            .with_names([name.as_str(); 3]);
        stream.log_static(mean_path(name), &lines)?;
    }
    for (number, calibration, step) in study.arms.steps() {
        stream.set_time_sequence(STEP, number);
        scene::log_step(stream, &study.arms, calibration, step)?;
    }
    stream.disable_timeline(STEP);
    Ok(())
}

fn root(study: &StudyRecording, layout: &mut Layout) -> ContainerLike {
    let about = blueprint::text("about this study", "text/about");
    let left = if study.arms.shows_robot() {
        let texts = Tabs::new([about, blueprint::text("step", "text/step")]);
        Vertical::new([layout.space(), texts.into()])
            .with_row_shares([2.2, 1.0])
            .into()
    } else {
        about
    };
    let means = "mean distance over the number of runs, with 95 % bands [µm]";
    let has_sources = study.header.plans.iter().any(|plan| plan.account.is_some());
    let sources =
        has_sources.then(|| blueprint::text("where the error comes from", "text/sources"));
    let distributions = distributions(study, layout);
    let right = Vertical::new([
        layout.curves(means, "means_um"),
        Tabs::new(sources.into_iter().chain(distributions)).into(),
        blueprint::text("results so far", "text/table"),
    ]);
    Horizontal::new([left, right.with_row_shares([1.0, 1.0, 1.15]).into()])
        .with_column_shares([1.25, 1.0])
        .into()
}

/// Each plan's distribution with that of the plan that it is compared with, the last plan's first.
fn distributions(study: &StudyRecording, layout: &mut Layout) -> Vec<ContainerLike> {
    let header = &study.header;
    let labels = header.labels();
    let view = |index: usize| {
        let plan = &labels[index];
        let compared = (header.plans[index]
            .reference
            .filter(|&reference| reference != index))
        .map(|reference| &labels[reference]);
        let shown: Vec<String> = (compared.into_iter().chain([plan]))
            .map(|name| distance_path(name).to_string())
            .collect();
        layout.bars(plan, shown)
    };
    let plans = header.plans.len();
    let others = |index: &usize| plans == 1 || header.plans[*index].reference != Some(*index);
    let shown = (0..plans).rev().filter(others).take(MOST_TABS);
    shown.map(view).collect()
}

fn mean_path(plan: &str) -> EntityPath {
    entity_path!["means_um", plan.to_owned()]
}

fn distance_path(plan: &str) -> EntityPath {
    entity_path!["distance_um", plan.to_owned()]
}

/// The plans' colours, as on the study's page: bytes of red, green, blue and opacity.
fn colours(study: &StudyRecording) -> impl Iterator<Item = u32> {
    let plans = study.header.plans.iter().enumerate();
    let colours = plan_colours(plans.map(|(place, plan)| plan.reference == Some(place)));
    let rgb = |colour: &str| u32::from_str_radix(&colour[1..], 16).unwrap_or(0);
    (colours.into_iter()).map(move |colour| (rgb(colour) << 8) + OPAQUE)
}

/// The share of runs (%) per micrometre in each bin, up to the bin that [`DRAWN`] of them end in: few that are far off would
/// make the rest a line.
fn bars(histogram: &HistogramMessage) -> Option<BarChart> {
    let mut bins = histogram.bins();
    let mut drawn = 0.0;
    bins.retain(|[.., share]| {
        let is_drawn = drawn < DRAWN;
        drawn += share;
        is_drawn
    });
    let (mut starts, mut widths, mut shares) = (Vec::new(), Vec::new(), Vec::new());
    for [low_mm, high_mm, share] in bins {
        let width = (high_mm - low_mm) * 1e3;
        starts.push(low_mm * 1e3);
        widths.push(scene::narrow(width));
        shares.push(100.0 * share / width);
    }
    let is_there = !shares.is_empty();
    is_there.then(|| {
        BarChart::new(shares)
            .with_abscissa(starts)
            .with_widths(widths)
    })
}
