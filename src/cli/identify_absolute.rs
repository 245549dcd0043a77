//! `identify` on absolute readings.

use std::path::Path;

use elastocal::files::FileError;
use elastocal::identification::{AbsoluteError, ParameterGroup, ReadingWeights};
use elastocal::measurement::AbsoluteReading;
use elastocal::record::absolute::{AbsoluteMessage, LengthsMessage, MountedFrameMessage};
use elastocal::record::messages::ProvenanceMessage;
use elastocal::scenario::Scenario;
use elastocal::text::wording::counted;
use elastocal::workflow::identify_absolute::identify_absolute;

use super::Report;
use super::table::table;

/// Fits a robot to absolute readings.
pub fn execute(
    scenario: &Scenario,
    file: &Path,
    readings: &[AbsoluteReading],
    groups: &[ParameterGroup],
    weights: ReadingWeights,
) -> anyhow::Result<Report> {
    let identified = identify_absolute(&scenario.task.belief, readings, groups, weights)
        .map_err(|error| explained(file, &error))?;
    let provenance = ProvenanceMessage::new(scenario).with_input("measurements", file)?;
    let json = identified.json(scenario, &provenance, groups)?;
    let message = AbsoluteMessage::new(&identified.case, &identified.fit);
    Ok(Report {
        json,
        text: describe(&message),
        conditions: message.conditions,
    })
}

/// Why there is no fit, with what to do about it.
pub fn explained(file: &Path, error: &AbsoluteError) -> FileError {
    let wrong = FileError::new(file, error.to_string());
    match error.hint() {
        Some(hint) => wrong.hint(hint),
        None => wrong,
    }
}

fn describe(message: &AbsoluteMessage) -> String {
    let mut text = format!(
        "{} unknowns from {} ({} numbers)\n\n",
        message.unknowns.len(),
        counted(message.readings as u64, "reading"),
        message.numbers
    );
    let frames: Vec<_> = message.stations.iter().chain(&message.targets).collect();
    let is_frame = |name: &str| {
        let owner = name.rsplit_once('.').map_or(name, |(owner, _)| owner);
        frames.iter().any(|frame| frame.unknowns == owner)
    };
    text += &frames_table(&message.stations, &message.targets);
    let rows: Vec<Vec<String>> = (message.unknowns.iter())
        .filter(|each| !is_frame(&each.name))
        .map(|each| {
            let (factor, unit) = shown_unit(&each.unit);
            let number = |value: f64| format!("{:.4}", value * factor);
            let error = each.standard_error.map_or_else(|| "-".to_owned(), number);
            let interval = each.interval95.map_or_else(
                || "-".to_owned(),
                |[low, high]| format!("{} to {}", number(low), number(high)),
            );
            let value = match each.standard_error {
                Some(_) => number(each.value),
                None => "not determined".to_owned(),
            };
            vec![
                each.name.clone(),
                number(each.nominal),
                value,
                error,
                interval,
                unit.to_owned(),
            ]
        })
        .collect();
    if !rows.is_empty() {
        let header = [
            "unknown",
            "nominal",
            "value",
            "standard error",
            "95 % interval",
            "unit",
        ];
        text += &format!("\n{}", table(&header, &rows));
    }
    if !message.left_out.is_empty() {
        let names: Vec<&str> = message
            .left_out
            .iter()
            .map(|each| each.name.as_str())
            .collect();
        text += &format!(
            "\n  Left out, since no reading can tell them from others: {}\n",
            names.join(", ")
        );
    }
    text += &format!(
        "\n{}",
        distances_table(&message.distance_mm, message.angle_mrad.as_ref())
    );
    if let Some(misfit_mm) = message.misfit_mm {
        let turned = message
            .misfit_mrad
            .map(|value| format!(", {value:.4} mrad"));
        text += &format!(
            "  The model leaves {misfit_mm:.4} mm{} in each coordinate unexplained, which the standard errors count.\n",
            turned.unwrap_or_default()
        );
    }
    text
}

/// A quantity as a person reads it: the factor and the unit.
fn shown_unit(unit: &str) -> (f64, &str) {
    match unit {
        "m" => (1e3, "mm"),
        "rad" => (1e3, "mrad"),
        "rad/(N m)" => (1e6, "1e-6 rad/(N m)"),
        unit => (1.0, unit),
    }
}

fn frames_table(stations: &[MountedFrameMessage], targets: &[MountedFrameMessage]) -> String {
    let joined = |values: &[f64], decimals: usize| {
        let texts: Vec<String> = values
            .iter()
            .map(|value| format!("{value:.decimals$}"))
            .collect();
        texts.join(" ")
    };
    let row = |what: &str, frame: &MountedFrameMessage| {
        let name = frame
            .name
            .as_deref()
            .map_or_else(String::new, |name| format!(" {name}"));
        let std = |errors: &Option<[f64; 3]>| {
            errors.map_or_else(|| "-".to_owned(), |errors| joined(&errors, 4))
        };
        vec![
            format!("{what}{name}"),
            joined(&frame.position_mm, 4),
            std(&frame.position_std_mm),
            frame
                .quaternion
                .map_or_else(|| "-".to_owned(), |q| joined(&q, 7)),
            std(&frame.rotation_std_mrad),
        ]
    };
    let rows: Vec<Vec<String>> = (stations.iter().map(|frame| row("base at station", frame)))
        .chain(targets.iter().map(|frame| row("target", frame)))
        .collect();
    let header = [
        "frame",
        "position [mm]",
        "standard error",
        "quaternion w x y z",
        "standard error [mrad]",
    ];
    table(&header, &rows)
}

/// Distances, and angles where there are any.
pub fn distances_table(
    distance_mm: &LengthsMessage,
    angle_mrad: Option<&LengthsMessage>,
) -> String {
    let row = |name: &str, lengths: &LengthsMessage| {
        let numbers = [
            lengths.mean,
            lengths.rms,
            lengths.quantile95,
            lengths.largest,
        ];
        let cells = numbers.map(|value| format!("{value:.4}"));
        [vec![name.to_owned()], cells.to_vec()].concat()
    };
    let mut rows = vec![row("distance [mm]", distance_mm)];
    rows.extend(angle_mrad.map(|angles| row("angle [mrad]", angles)));
    table(
        &[
            "read less predicted",
            "mean",
            "rms",
            "95 % below",
            "largest",
        ],
        &rows,
    )
}
