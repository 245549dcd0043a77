//! The sheet to take along into the laboratory: one stop after the other, with what to write down.

use std::fmt::Write;

use nalgebra::DVector;

use super::markup::{escaped, page, paragraph, section, table};
use super::stills;
use crate::experiment::{Plan, in_words};
use crate::laboratory::{Campaign, Stop};
use crate::record::messages::ProvenanceMessage;
use crate::robot::Commands;
use crate::scenario::Scenario;
use crate::text::wording::{counted, number};

const STYLE: &str = include_str!("run_sheet.css");
/// More readings than this at one stop are written into the file.
const LINES: u32 = 8;

/// The sheet as a page for print, which loads nothing.
pub fn run_sheet(scenario: &Scenario, plan: &Plan, campaign: &Campaign) -> String {
    let commands = scenario.task.belief.commands();
    let pictures = stills::pictures(scenario, plan);
    let mut stops = String::new();
    for (index, stop) in campaign.stops.iter().enumerate() {
        if let (Some(load), true) = (&stop.load, stop.changes_load) {
            let _ = writeln!(
                stops,
                "<div class=\"hang\">The robot halts before stop {}: hang the load {}.</div>",
                index + 1,
                escaped(&in_words(load))
            );
        }
        let picture = &pictures[stop.experiments[0]][usize::from(stop.load.is_some())];
        stops += &of_stop(&commands, index + 1, stop, picture);
    }
    let title = format!("{}: run sheet", scenario.name);
    let body = format!(
        "<style>\n{STYLE}</style>\n<h1>{}</h1>\n{}{}{}",
        escaped(&title),
        overview(scenario, plan, campaign),
        section("stops", "Stops", &stops),
        provenance(scenario)
    );
    page(&title, &body)
}

fn overview(scenario: &Scenario, plan: &Plan, campaign: &Campaign) -> String {
    let what = format!(
        "{} of {} in {}: {} with {} of load and {}. It takes about {}.",
        counted(plan.measurements().into(), "measurement"),
        counted(plan.experiments.len() as u64, "experiment"),
        counted(campaign.stops.len() as u64, "stop"),
        counted(u64::from(campaign.readings()), "reading"),
        counted(campaign.load_changes() as u64, "change"),
        counted(campaign.stops.len() as u64, "move"),
        duration(campaign.minutes)
    );
    let how = "Without a load first, then under each load in turn: what is identified from is the difference of the \
               two positions at the same commanded angles. Every configuration is approached from the same side both \
               times. The robot halts at each stop: wait until it has come to rest, read the instrument, write \
               the position of the reflector down (world frame, mm), tick the stop, and let the program go on.";
    let mut text = paragraph(&what) + &paragraph(how);
    if !scenario.description.is_empty() {
        text = paragraph(&scenario.description) + &text;
    }
    if !campaign.is_checked {
        text += "<p><strong>Moves were not looked at for collisions: the scenario names no \
                 region.collision_clearance_mm. Run the program slowly and with care.</strong></p>\n";
    }
    if campaign.home.is_none() {
        text += &paragraph(
            "Bring the robot by hand to where the first stop's approach begins: the program starts with a straight \
             joint move there.",
        );
    }
    text + "<p class=\"blank\">Date, people, temperature:</p>\n\
            <p class=\"blank\">The controller's own compensation of deflections (KUKA: $ABS_ACCUR) is off:</p>\n"
}

fn of_stop(commands: &Commands, index: usize, stop: &Stop, picture: &str) -> String {
    let experiments: Vec<String> = (stop.experiments.iter())
        .map(|index| (index + 1).to_string())
        .collect();
    let load = stop.load.as_ref();
    let load = load.map_or_else(|| "without load".to_owned(), in_words);
    let names: Vec<String> = (1..=commands.len())
        .map(|joint| format!("A{joint}"))
        .collect();
    let mut header = vec!["joint"];
    header.extend(names.iter().map(String::as_str));
    let row = |name: &str, q: &DVector<f64>| {
        let shown = commands.shown(q.as_slice());
        let values = shown.into_iter().map(|value| number(Some(value), 3));
        [name.to_owned()].into_iter().chain(values).collect()
    };
    let mut rows: Vec<Vec<String>> = Vec::new();
    for via in &stop.way.via {
        rows.push(row("over", via));
    }
    if let Some(approach) = &stop.approach {
        rows.push(row("from", approach));
    }
    rows.push(row("stop", &stop.configuration));
    let lines = stop.readings.min(LINES);
    let lines_to_fill: Vec<String> = (1..=lines)
        .map(|line| format!("<tr><td>{line}</td><td></td><td></td><td></td></tr>\n"))
        .collect();
    let readings = lines_to_fill.concat();
    let more = match stop.readings - lines {
        0 => String::new(),
        more => paragraph(&format!(
            "and {}, into the file",
            counted(more.into(), "more reading")
        )),
    };
    format!(
        "<article class=\"stop\"><header><strong>{index}</strong><span>experiment {}</span>\
         <span>{}</span><span class=\"tick\" title=\"done\"></span></header>\n\
         <div class=\"parts\">{picture}<div class=\"words\"><p>Angles in {}; approached with {}.</p>\n{}\
         <table class=\"readings\"><thead><tr><th></th><th>x [mm]</th><th>y [mm]</th><th>z [mm]</th></tr></thead>\
         <tbody>\n{readings}</tbody></table>{more}</div></div></article>\n",
        experiments.join(", "),
        escaped(&load),
        commands.unit(),
        escaped(&stop.side.to_string()),
        table(&header, &rows),
    )
}

fn provenance(scenario: &Scenario) -> String {
    let ProvenanceMessage {
        version,
        commit,
        scenario_sha256,
        ..
    } = ProvenanceMessage::new(scenario);
    paragraph(&format!(
        "elastocal {version} ({commit}), scenario {} ({scenario_sha256})",
        scenario.path.display()
    ))
}

/// Minutes as hours and minutes.
fn duration(minutes: f64) -> String {
    let (hours, rest) = ((minutes / 60.0).floor(), minutes % 60.0);
    if hours > 0.0 {
        format!("{hours:.0} h {rest:.0} min")
    } else {
        format!("{rest:.0} min")
    }
}
