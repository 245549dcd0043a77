//! The stream for the rerun viewer (.rrd).

mod blueprint;
mod scene;
mod store;
pub mod study;
mod study_text;
mod text;
pub mod viewer;

use std::collections::BTreeSet;
use std::path::Path;

use re_log_types::{EntityPath, LogMsg, StoreId, StoreKind, entity_path};
use re_sdk_types::archetypes::{RecordingInfo, Scalars, SeriesPoints, TextDocument};
use re_sdk_types::blueprint::components::PlayState;
use sha2::{Digest, Sha256};

use super::recording::{RecordedCalibration, Recording, ShownTool, Step, StepKind};
use crate::files::{FileError, output::write_whole};
use blueprint::{Clock, SPACE, TEXT, ViewArea};
use store::Store;

const APPLICATION: &str = "elastocal";
/// The timeline of steps: experiments and test poses, numbered from 1.
const STEP: &str = "step";
/// The timeline of measurements, repeats counted, numbered from 1.
const MEASUREMENT: &str = "measurement";

/// The coordinates, and what a gauge reads along its direction.
const AXES: [(&str, [u8; 3]); 4] = [
    ("x", [220, 60, 60]),
    ("y", [50, 160, 70]),
    ("z", [60, 110, 230]),
    ("along", [150, 90, 20]),
];

/// Writes a recording for the rerun viewer. The same recording gives the same bytes but for the
/// order of two parts of the footer.
pub fn write_rerun(path: &Path, recording: &Recording) -> Result<(), FileError> {
    write_messages(path, messages(recording))
}

/// The messages of a recording with its layout, for a file or a viewer.
pub fn messages(recording: &Recording) -> Result<Vec<LogMsg>, String> {
    let mut content = format!("{:?}", recording.provenance);
    for calibration in &recording.calibrations {
        content += &format!("{:?}", calibration.record);
    }
    let clock = Clock {
        timeline: STEP,
        // The legend has its place behind the last step.
        range: Some((
            0,
            i64::try_from(recording.steps().count() / 6 * 7 + 1).unwrap_or(i64::MAX),
        )),
        per_second: 0.5,
        play_state: PlayState::Playing,
    };
    let (mut messages, mut store) = open(&content, &layout(recording), recording, &clock)?;
    log_recording(&mut store, recording);
    messages.extend(store.take()?);
    Ok(messages)
}

fn write_messages(path: &Path, messages: Result<Vec<LogMsg>, String>) -> Result<(), FileError> {
    let bytes = messages
        .and_then(store::encode)
        .map_err(|error| FileError::new(path, format!("cannot be written: {error}")))?;
    write_whole(path, &bytes)
}

/// The messages that lay out the viewer, and the store of a recording whose numbers follow from the
/// content: the viewer takes two with the same number for parts of one recording.
fn open(
    content: &str,
    layout: &ViewArea,
    recording: &Recording,
    clock: &Clock,
) -> Result<(Vec<LogMsg>, Store), String> {
    let digest = Sha256::digest(content.as_bytes());
    let id = (digest.iter())
        .take(15)
        .fold(0, |number, byte| number << 8 | u128::from(*byte));
    let new = |kind, name, first| Store::new(StoreId::new(kind, APPLICATION, name), first);
    let blueprint = format!("blueprint-{id:032x}");
    let mut blueprint = new(StoreKind::Blueprint, blueprint, id ^ (1 << 120));
    let eye_m = recording.eye_m();
    let eye_m = eye_m.map(|places| places.map(|place| scene::single(&place)));
    blueprint::lay_out(&mut blueprint, layout, clock, eye_m);
    let mut store = new(StoreKind::Recording, format!("{id:032x}"), id);
    let info = RecordingInfo::new().with_name(recording.provenance.scenario.as_str());
    store.log_static(EntityPath::properties(), &info);
    Ok((store::show_by(blueprint)?, store))
}

fn layout(recording: &Recording) -> ViewArea {
    let view =
        |class, name: &str, content: &str| ViewArea::View(class, name.into(), content.into());
    let [readings, of_readings] = curves_of_readings(recording);
    let curves = |name: &str, group: &str| {
        let values = (recording.steps()).flat_map(|(_, calibration, step)| {
            (measured(calibration, step).into_iter())
                .flatten()
                .filter(|(of, _)| *of == group)
                .flat_map(|(_, values)| values.into_iter().flatten())
        });
        let largest = values.map(f64::abs).fold(0.0, f64::max);
        let content = format!("measurements/{group}/**");
        ViewArea::Curves(name.into(), content, blueprint::about_nought(largest))
    };
    ViewArea::Row(vec![
        (2.2, view(SPACE, "robot", "world/**")),
        (
            1.0,
            ViewArea::Column(vec![
                (1.0, view(TEXT, "step", "text/step")),
                (
                    1.3,
                    ViewArea::Tabs(vec![
                        view(TEXT, "results", "text/results"),
                        view(TEXT, "all plans", "text/overview"),
                    ]),
                ),
                (
                    0.87,
                    ViewArea::Tabs(vec![
                        curves("residuals [mm]", "residual_mm"),
                        curves(of_readings, readings),
                    ]),
                ),
            ]),
        ),
    ])
}

fn log_recording(store: &mut Store, recording: &Recording) {
    scene::log_bodies(store, recording);
    let plans = recording.calibrations.iter();
    let shown = plans.flat_map(|each| {
        let all = 0..each.record.measured();
        all.flat_map(|index| each.record.shown(index))
    });
    let is_along: BTreeSet<bool> = (shown.filter(|each| each.group.is_some()))
        .map(|each| each.along_mm.is_some())
        .collect();
    for group in ["residual_mm", curves_of_readings(recording)[0]] {
        let read = |(axis, _): &(&str, _)| is_along.contains(&(*axis == "along"));
        for (axis, colour) in AXES.into_iter().filter(read) {
            let series = SeriesPoints::new()
                .with_colors([colour])
                .with_names([axis])
                .with_marker_sizes([4.0]);
            store.log_static(entity_path!["measurements", group, axis], &series);
        }
    }
    let overview = TextDocument::from_markdown(text::overview(recording));
    store.log_static("text/overview", &overview);
    log_steps(store, recording);
}

fn log_steps(store: &mut Store, recording: &Recording) {
    let mut mounted = None;
    let mut named = None;
    let mut measurement = 0;
    for (number, calibration, step) in recording.steps() {
        let now = [(STEP, i64::from(number))];
        if named != Some(calibration.record.name()) {
            let results = TextDocument::from_markdown(text::results(calibration));
            store.log("text/results", &now, &results);
            named = Some(calibration.record.name());
        }
        log_step(store, recording, (calibration, step), &mut mounted, &now);
        for groups in measured(calibration, step) {
            measurement += 1;
            let now = [(STEP, i64::from(number)), (MEASUREMENT, measurement)];
            for (group, values) in groups {
                for ((axis, _), value) in AXES.iter().zip(values) {
                    if let Some(value) = value {
                        let path = entity_path!["measurements", group, axis];
                        store.log(path, &now, &Scalars::single(value));
                    }
                }
            }
        }
    }
}

/// The arms in a step, in pictures and in words; `mounted` is the tool of the step before.
fn log_step(
    store: &mut Store,
    recording: &Recording,
    (calibration, step): (&RecordedCalibration, &Step),
    mounted: &mut Option<ShownTool>,
    now: store::Now<'_>,
) {
    scene::log_step(store, recording, step, mounted, now);
    let described = TextDocument::from_markdown(text::step(calibration, step));
    store.log("text/step", now, &described);
}

/// What was measured in a step and what identification left of it (mm) along [`AXES`], measurement by measurement; none in a test
/// pose.
type Groups = Vec<(&'static str, [Option<f64>; 4])>;

fn measured(calibration: &RecordedCalibration, step: &Step) -> Vec<Groups> {
    let StepKind::Experiment { measurements, .. } = &step.kind else {
        return Vec::new();
    };
    let groups = |index: usize| {
        let shown = calibration.record.shown(index).into_iter();
        shown.filter_map(|each| {
            let [x, y, z] = each.vector_mm.map_or([None; 3], |vector| vector.map(Some));
            Some((each.group?, [x, y, z, each.along_mm]))
        })
    };
    let measured = measurements.clone();
    measured.map(|index| groups(index).collect()).collect()
}

/// The group of curves of what was read, and its name.
fn curves_of_readings(recording: &Recording) -> [&'static str; 2] {
    let first = recording.calibrations.first();
    first.map_or(["deflection_mm", "deflections [mm]"], |first| {
        first.record.curves()
    })
}
