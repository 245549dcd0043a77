//! A study for the rerun viewer: the robot, the running means, the distribution of the distance.
//!
//! On the timeline `run`, each snapshot shows the next experiment or test pose of the plans; all of
//! them are on the timeline `step`.

use std::path::Path;

use re_log_types::{EntityPath, LogMsg, entity_path};
use re_sdk_types::archetypes::{
    BarChart, LineStrips2D, Points2D, Scalars, SeriesLines, TextDocument,
};
use re_sdk_types::blueprint::components::PlayState;

use super::blueprint::{BARS, Clock, PLANE, SPACE, TEXT, ViewArea};
use super::store::Store;
use super::{STEP, log_step, open, scene, study_text, write_messages};
use crate::files::FileError;
use crate::record::study::HistogramMessage;
use crate::study::account::Contribution;
use crate::view::recording::ShownTool;
use crate::view::study_recording::{Snapshot, StudyRecording};

/// The timeline of the number of runs so far.
const RUN: &str = "run";
/// The plans' colours, which the colour-blind can tell apart (Okabe and Ito).
const COLOURS: [[u8; 3]; 8] = [
    [213, 94, 0],
    [86, 180, 233],
    [230, 159, 0],
    [0, 158, 115],
    [240, 228, 66],
    [204, 121, 167],
    [0, 114, 178],
    [170, 170, 170],
];
/// The opacity of bars, which lie over one another.
const BAR_ALPHA: u8 = 150;

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
    let messages = StudyStream::new(study).and_then(|(mut stream, mut messages)| {
        for snapshot in snapshots {
            stream.log(study, snapshot);
        }
        messages.extend(stream.take()?);
        Ok(messages)
    });
    write_messages(path, messages)
}

/// A study on its way to a file or a viewer.
pub struct StudyStream {
    store: Store,
    snapshots: usize,
    mounted: Option<ShownTool>,
}

impl StudyStream {
    /// Begins with the layout and what is there before the first run.
    pub fn new(study: &StudyRecording) -> Result<(Self, Vec<LogMsg>), String> {
        let content = format!("{:?}", study.header);
        // The legend has its place behind the last run.
        let end = i64::try_from(study.header.trials / 7 * 8).unwrap_or(i64::MAX);
        let clock = Clock {
            timeline: RUN,
            range: Some((0, end)),
            per_second: study.header.trials as f64 / REPLAY_S,
            play_state: PlayState::Following,
        };
        let (mut messages, store) = open(&content, &layout(study), &study.arms, &clock)?;
        let mut stream = Self {
            store,
            snapshots: 0,
            mounted: None,
        };
        stream.log_beginning(study);
        messages.extend(stream.take()?);
        Ok((stream, messages))
    }

    /// Adds a snapshot.
    pub fn log(&mut self, study: &StudyRecording, snapshot: &Snapshot) {
        let store = &mut self.store;
        let now = [(RUN, i64::try_from(snapshot.runs).unwrap_or(i64::MAX))];
        let table = TextDocument::from_markdown(study_text::table(study, snapshot));
        store.log("text/table", &now, &table);
        for (index, plan) in snapshot.plans.iter().enumerate() {
            if let (Some(mean), Some([low, high])) = (plan.mean_mm, plan.mean_ci95_mm)
                && snapshot.runs >= study.header.trials / UNSETTLED
            {
                let values = [mean, low, high].map(|value| value * 1e3);
                store.log(mean_path(&plan.name), &now, &Scalars::new(values));
            }
            log_sources(store, &plan.name, &plan.contributions, &now);
            if let Some(bars) = bars(&plan.histogram) {
                let bars = bars.with_color(translucent(colour(index)));
                store.log(distance_path(&plan.name), &now, &bars);
            }
        }
        let steps = study.arms.steps().count().max(1);
        if let Some((_, calibration, step)) = study.arms.steps().nth(self.snapshots % steps) {
            log_step(
                store,
                &study.arms,
                (calibration, step),
                &mut self.mounted,
                &now,
            );
        }
        self.snapshots += 1;
    }

    /// The messages of what was added since the last call.
    pub fn take(&mut self) -> Result<Vec<LogMsg>, String> {
        self.store.take()
    }

    fn log_beginning(&mut self, study: &StudyRecording) {
        let store = &mut self.store;
        if study.arms.shows_robot() {
            scene::log_bodies(store, &study.arms);
        }
        let about = TextDocument::from_markdown(study_text::about(study));
        store.log_static("text/about", &about);
        for (index, name) in study.header.labels().iter().enumerate() {
            let colour = colour(index);
            // One name for the mean and its band makes one entry in the legend.
            let lines = SeriesLines::new()
                .with_colors([colour; 3])
                .with_widths([2.5, 0.7, 0.7])
                .with_names([name.as_str(); 3]);
            store.log_static(mean_path(name), &lines);
        }
        let mut mounted = None;
        for (number, calibration, step) in study.arms.steps() {
            let now = [(STEP, i64::from(number))];
            log_step(store, &study.arms, (calibration, step), &mut mounted, &now);
        }
    }
}

fn layout(study: &StudyRecording) -> ViewArea {
    let view =
        |class, name: &str, content: &str| ViewArea::View(class, name.into(), content.into());
    let about = view(TEXT, "about this study", "text/about");
    let left = if study.arms.shows_robot() {
        let texts = ViewArea::Tabs(vec![about, view(TEXT, "step", "text/step")]);
        ViewArea::Column(vec![(2.2, view(SPACE, "robot", "world/**")), (1.0, texts)])
    } else {
        about
    };
    let means = "mean distance over the number of runs, with 95 % bands [µm]";
    let mut tabs = sources(study);
    tabs.extend(distributions(study));
    let right = ViewArea::Column(vec![
        (
            1.1,
            ViewArea::Curves(means.into(), "means_um/**".into(), None),
        ),
        (1.1, ViewArea::Tabs(tabs)),
        (1.0, view(TEXT, "results so far", "text/table")),
    ]);
    ViewArea::Row(vec![(1.25, left), (1.0, right)])
}

/// Each plan's distribution with that of the plan that it is compared with, the last plan's first.
fn distributions(study: &StudyRecording) -> Vec<ViewArea> {
    let header = &study.header;
    let labels = header.labels();
    let view = |(index, plan): (usize, &String)| {
        let compared = (header.plans[index]
            .reference
            .filter(|&reference| reference != index))
        .map(|reference| &labels[reference]);
        let shown: Vec<String> = (compared.into_iter().chain([plan]))
            .map(|name| distance_path(name).to_string())
            .collect();
        let name = match compared {
            Some(reference) => format!("{plan}, {reference}: % of runs per µm, up to 95 % of them"),
            None => format!("{plan}: % of runs per µm, up to 95 % of them"),
        };
        ViewArea::View(BARS, name, shown.join("\n"))
    };
    let others = |(index, _): &(usize, &String)| {
        labels.len() == 1 || header.plans[*index].reference != Some(*index)
    };
    (labels.iter().enumerate().rev().filter(others))
        .take(MOST_TABS)
        .map(view)
        .collect()
}

/// Where each plan's errors come from, where the scenario lists what is uncertain.
fn sources(study: &StudyRecording) -> Vec<ViewArea> {
    let header = &study.header;
    (header.labels().iter().zip(&header.plans))
        .filter(|(_, plan)| plan.account.is_some())
        .take(MOST_TABS)
        .map(|(name, _)| {
            let title = format!("{name}: where the error comes from, rms [µm]");
            ViewArea::View(PLANE, title, format!("{}/**", sources_path(name)))
        })
        .collect()
}

fn sources_path(plan: &str) -> EntityPath {
    entity_path!["sources_um", plan.to_owned()]
}

/// A bar for each source, as long as its contribution (the longest is 24 rows wide), the largest above.
fn log_sources(store: &mut Store, plan: &str, parts: &[Contribution], now: &[(&'static str, i64)]) {
    let mut parts: Vec<&Contribution> = parts.iter().collect();
    parts.sort_by(|one, other| other.contribution_um.total_cmp(&one.contribution_um));
    let total: f64 = parts.iter().map(|part| part.contribution_um.powi(2)).sum();
    let Some(longest) = parts
        .first()
        .map(|part| part.contribution_um)
        .filter(|_| total > 0.0)
    else {
        return;
    };
    let (mut strips, mut colours) = (Vec::new(), Vec::new());
    let (mut places, mut labels) = (Vec::new(), Vec::new());
    for (row, part) in (0_u16..).zip(&parts) {
        let y = f32::from(row);
        strips.push([
            [0.0, y],
            [scene::narrow(24.0 * part.contribution_um / longest), y],
        ]);
        colours.push(COLOURS[if part.hidden { 0 } else { 6 }]);
        // The viewer writes a label below its place.
        places.push([-8.0, y - 0.7]);
        let hidden = if part.hidden { " (hidden)" } else { "" };
        labels.push(format!(
            "{}{hidden}: {:.2} µm, {:.1} %",
            part.source,
            part.contribution_um,
            part.contribution_um.powi(2) / total * 100.0
        ));
    }
    // The viewer shows what lies between places, and labels are wider.
    places.push([-15.0, 0.0]);
    labels.push(String::new());
    let bars = LineStrips2D::new(strips)
        .with_radii(vec![0.2; parts.len()])
        .with_colors(colours);
    let names = Points2D::new(places)
        .with_radii([0.02])
        .with_labels(labels)
        .with_show_labels(true);
    store.log(sources_path(plan).join(&entity_path!["bars"]), now, &bars);
    store.log(sources_path(plan).join(&entity_path!["names"]), now, &names);
}

fn mean_path(plan: &str) -> EntityPath {
    entity_path!["means_um", plan.to_owned()]
}

fn distance_path(plan: &str) -> EntityPath {
    entity_path!["distance_um", plan.to_owned()]
}

fn colour(plan: usize) -> [u8; 3] {
    COLOURS[plan % COLOURS.len()]
}

const fn translucent([red, green, blue]: [u8; 3]) -> [u8; 4] {
    [red, green, blue, BAR_ALPHA]
}

/// The share of runs (%) per micrometre in each bin, up to the bin that [`DRAWN`] of them end in: few that are far off would
/// make the rest a line.
fn bars(histogram: &HistogramMessage) -> Option<BarChart> {
    let runs: u64 = histogram.counts.iter().sum();
    if runs == 0 {
        return None;
    }
    let (mut shares, mut starts, mut widths) = (Vec::new(), Vec::new(), Vec::new());
    let mut drawn = 0;
    for (edges, count) in histogram.edges_mm.windows(2).zip(&histogram.counts) {
        if drawn as f64 >= DRAWN * runs as f64 {
            break;
        }
        drawn += count;
        let width = (edges[1] - edges[0]) * 1e3;
        shares.push(100.0 * *count as f64 / runs as f64 / width);
        starts.push(edges[0] * 1e3);
        widths.push(scene::narrow(width));
    }
    Some(
        BarChart::new(shares)
            .with_abscissa(starts)
            .with_widths(widths),
    )
}
