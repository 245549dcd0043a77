//! The sheet to take along into the laboratory: one stop after the other, with what to write down.

use nalgebra::{DVector, Vector3};
use serde_json::{Value, json};

use super::markup::{PageError, Templates, with_unbroken_vectors};
use super::stills::Stills;
use crate::laboratory::{Campaign, Stop, change_load, hung_kg, set_gauge, set_up, take_off};
use crate::observation::LengthKind;
use crate::record::campaign::campaign_json;
use crate::record::messages::ProvenanceMessage;
use crate::robot::{Commands, Load, ReadsAlong};
use crate::scenario::Scenario;
use crate::task::{AccuracyKind, Instrument, Task, station_named};
use crate::text::wording::{dash, joined, naming, number, significant};

const STYLE: &str = include_str!("pages/run_sheet.css");
/// More readings than this at one stop are written into the file.
const LINES: u32 = 8;
/// The column of what a gauge shows.
const DISPLACEMENT: &str = "displacement [mm]";

/// The sheet as a page for print, which loads nothing; `axes` are the names of the commanded joints' axes. Without a program a person moves
/// the robot.
pub fn run_sheet(
    scenario: &Scenario,
    stills: &Stills<'_>,
    campaign: &Campaign,
    axes: &[&str],
    has_program: bool,
) -> Result<String, PageError> {
    let (task, laboratory) = (&scenario.task, &scenario.laboratory);
    let (instrument, commands) = (&task.belief.instrument, task.belief.commands());
    let plan = &stills.plan;
    let templates = Templates::new()?;
    let pictures = stills.pictures(&templates)?;
    let places = places(&commands, campaign);
    let columns = columns(task);
    let place = |place: &Vec<usize>| {
        let stop = &campaign.stops[place[0]];
        let experiments = place
            .iter()
            .flat_map(|&each| &campaign.stops[each].experiments);
        let shown = |q: &DVector<f64>| commands.shown(q.as_slice());
        let from = stop.approach.as_ref().map(shown);
        let joints = shown(&stop.configuration).into_iter().zip(axes).enumerate();
        let joints = joints.map(|(joint, (at, axis))| {
            let from = from.as_ref().map(|from| from[joint]);
            [(*axis).to_owned(), number(from, 3), number(Some(at), 3)]
        });
        json!({
            "stops": place.iter().map(|each| each + 1).collect::<Vec<_>>(),
            "picture": experiments.min().map(|&first| &pictures[first].unloaded),
            "side": stop.side.words(),
            "joints": joints.collect::<Vec<_>>(),
        })
    };
    let mut index = 0;
    let is_on = |_: &Stop, next: &Stop| !next.changes_load && !next.changes_station;
    let groups = campaign.stops.chunk_by(is_on).map(|group| {
        let (first, stop) = (index, &group[0]);
        let station = stop.station.as_ref().filter(|_| stop.changes_station);
        let hang = hang(scenario, campaign.load_before(first), stop);
        let hang = hang.map(|mut hang| {
            hang["picture"] = pictures[stop.experiments[0]].load.as_str().into();
            hang
        });
        let stops = group.iter().map(|stop| {
            let at = places.iter().position(|place| place.contains(&index));
            let mut shown = shown(&commands, campaign, index, &columns);
            index += 1;
            shown["number"] = index.into();
            shown["place"] = (at.unwrap_or(0) + 1).into();
            shown["sets_gauge"] = stop.sets_gauge().into();
            shown
        });
        json!({
            "first": first + 1,
            "station": station.map(|name| set_up_at(task, name)),
            "hang": hang,
            "stops": stops.collect::<Vec<_>>(),
        })
    });
    let groups: Vec<Value> = groups.collect();
    let stops = &campaign.stops;
    let title = format!("{}: run sheet", scenario.name);
    let sheet = json!({
        "title": title,
        "style": STYLE,
        "description": scenario.description,
        "path": scenario.path,
        "provenance": ProvenanceMessage::new(scenario),
        "laboratory": {
            "tool_number": laboratory.tool_number,
            "base_number": laboratory.base_number,
            "speed_percent": laboratory.speed_percent,
        },
        "campaign": campaign_json(&commands, &laboratory.costs, campaign),
        "conditions": campaign.conditions(laboratory).iter().map(ToString::to_string).collect::<Vec<_>>(),
        "measurements": plan.measurements(),
        "experiments": plan.experiments.len(),
        "moves": campaign.moves(),
        "has_program": has_program,
        "is_absolute": task.design.accuracy == AccuracyKind::Absolute,
        "is_sided": stops.iter().all(|stop| stop.side.as_approach().is_some()),
        "has_stop_in_place": stops.iter().any(|stop| stop.is_in_place),
        "reads_along": instrument.reads_along(),
        "reads_positions": reads_positions(instrument),
        "shows": shows(instrument),
        "home": campaign.home.as_ref().map(|home| angles(&commands, home)),
        "unit": commands.unit(),
        "columns": columns,
        "places": places.iter().map(place).collect::<Vec<_>>(),
        "groups": groups,
        "take_off": stops.last().filter(|stop| stop.load.is_some()).map(|stop| take_off(stop).to_lowercase()),
    });
    templates.page(&title, "run_sheet.html", &sheet)
}

fn reads_positions(instrument: &Instrument) -> bool {
    instrument.reads_along() != ReadsAlong::Always && instrument.reads_positions()
}

/// What is done with what the instrument shows of absolute readings.
fn shows(instrument: &Instrument) -> Vec<String> {
    let positions = "write down what the instrument shows in a frame of its own";
    let mut shows = Vec::new();
    shows.extend(instrument.reads_positions().then(|| positions.to_owned()));
    for (kind, _) in instrument.lengths() {
        let which = naming((!shows.is_empty()).then(|| kind.name()), "of a {} ");
        shows.push(which + kind.how());
    }
    shows
}

/// The stops at each configuration, as it is printed, that is approached from one side, in the order of the first visits.
fn places(commands: &Commands, campaign: &Campaign) -> Vec<Vec<usize>> {
    let mut places: Vec<Vec<usize>> = Vec::new();
    for (index, stop) in campaign.stops.iter().enumerate() {
        let printed = |stop: &Stop| angles(commands, &stop.configuration);
        let is_here = |place: &&mut Vec<usize>| {
            let first = &campaign.stops[place[0]];
            first.side == stop.side && printed(first) == printed(stop)
        };
        match places.iter_mut().find(is_here) {
            Some(place) => place.push(index),
            None => places.push(vec![index]),
        }
    }
    places
}

/// What is written down of a reading, with units.
fn columns(task: &Task) -> Vec<String> {
    let instrument = &task.belief.instrument;
    let has_rotations =
        task.design.accuracy == AccuracyKind::Absolute && instrument.rotation_sigma_rad.is_some();
    let columns = [
        (
            reads_positions(instrument),
            &["x [mm]", "y [mm]", "z [mm]"][..],
        ),
        (has_rotations, &["qw", "qx", "qy", "qz"]),
        (instrument.gauge.is_some(), &[DISPLACEMENT]),
    ];
    let columns = columns.into_iter().filter(|(is_there, _)| *is_there);
    let columns = columns.flat_map(|(_, names)| names.iter().map(|name| (*name).to_owned()));
    let lengths = instrument.lengths().map(|(kind, _)| length_column(kind));
    columns.chain(lengths).collect()
}

fn length_column(kind: LengthKind) -> String {
    format!("{} [mm]", kind.name())
}

/// The angles of a configuration in a line.
fn angles(commands: &Commands, q: &DVector<f64>) -> String {
    let shown = commands.shown(q.as_slice()).into_iter();
    let values = joined(shown.map(|value| number(Some(value), 3)), ", ");
    format!("{values} {}", commands.unit())
}

/// A place (mm) with the given decimals.
fn place_mm(place_m: &Vector3<f64>, decimals: usize) -> String {
    let values = place_m
        .iter()
        .map(|value| format!("{:.decimals$}", value * 1e3));
    format!("({})", joined(values, ", "))
}

/// Where the instrument is set up.
fn set_up_at(task: &Task, name: &str) -> Value {
    let station = station_named(&task.belief.stations, Some(name));
    json!({ "set_up": set_up(name), "near": station.map(|station| place_mm(&station.position_m, 0)) })
}

/// Which load is hung where, and what the controller is told; none where it does not change.
fn hang(scenario: &Scenario, before: Option<&Load>, stop: &Stop) -> Option<Value> {
    let load = stop.load.as_ref().filter(|_| stop.changes_load)?;
    let belief = &scenario.task.belief;
    let tool = &belief.calibration_tool;
    let gravity = &belief.nominal.chain.gravity_m_s2;
    let mass = hung_kg(load, gravity);
    let size = mass.map_or_else(
        || format!("{} N together", significant(load.force_n.norm(), 5)),
        |mass| format!("{} kg", significant(mass, 5)),
    );
    let link = tool.joints.checked_sub(1);
    let link = link.and_then(|last| belief.nominal.chain.joints.get(last));
    Some(json!({
        "change": with_unbroken_vectors(&change_load(before, load, gravity)),
        "size": size,
        "hangs": mass.is_some(),
        "tool": tool.name,
        "at": place_mm(&tool.link_from_tool.translation.vector, 1),
        "behind": link.map(|joint| &joint.name),
    }))
}

/// A stop: what is done before it is read, and the lines for its readings, with what is near what will be read.
fn shown(commands: &Commands, campaign: &Campaign, index: usize, columns: &[String]) -> Value {
    let stop = &campaign.stops[index];
    let mut before = Vec::new();
    if campaign.load_before(index).is_some() && stop.load.is_none() {
        let when =
            ["before the robot moves", "where the robot stands"][usize::from(stop.is_in_place)];
        before.push(format!("{} {when}.", take_off(stop)));
    }
    let via = stop.way.via.iter();
    before.extend(via.map(|via| format!("over {}", angles(commands, via))));
    if let (Some(direction), None) = (&stop.direction, &stop.load) {
        let near = stop.at_gauge.map_or_else(String::new, |at_gauge| {
            format!(
                " The target is near {} mm (world frame), and under the load the gauge should show about {} mm: one that moves in one \
                 sense alone needs that much room.",
                at_gauge.near(),
                at_gauge.shows()
            )
        });
        before.push(with_unbroken_vectors(&format!(
            "At the stop, {}.{near}",
            set_gauge(direction)
        )));
    }
    // Of absolute readings each line is its own, of deflections the readings of all experiments here.
    let experiments = stop.experiments.iter().map(|index| (index + 1).to_string());
    let lines: Vec<[String; 2]> = if stop.targets.is_empty() {
        let mut all = Some(joined(experiments, ", "));
        let lines = 1..=stop.readings.clamp(1, LINES);
        lines
            .map(|line| [all.take().unwrap_or_default(), line.to_string()])
            .collect()
    } else {
        experiments
            .zip(stop.targets.iter().cloned())
            .map(Into::into)
            .collect()
    };
    let rest = (stop.readings as usize).saturating_sub(lines.len());
    let line = |(number, [experiment, reading]): (usize, &[String; 2])| {
        let nominal = stop.lengths.get(number).copied().flatten();
        // A length or what a gauge shows alone, or all but these.
        let alone = nominal.map(|length| length_column(length.kind));
        let alone = alone.or(stop.direction.map(|_| DISPLACEMENT.to_owned()));
        let is_alone = |column: &String| {
            let mut lengths = LengthKind::ALL.into_iter().map(length_column);
            column == DISPLACEMENT || lengths.any(|length| length == *column)
        };
        let is_read = |column: &String| match &alone {
            Some(alone) => column == alone,
            None => !is_alone(column),
        };
        let is_one_read = columns.iter().any(is_read);
        let near = columns.iter().map(|column| {
            if is_one_read && !is_read(column) {
                return Some(dash());
            }
            let own = nominal.filter(|length| length_column(length.kind) == *column);
            let own = own.map(|length| format!("{:.2}", length.length_m * 1e3));
            let at_gauge = stop.at_gauge.filter(|_| column == DISPLACEMENT);
            let near = own.or(at_gauge.map(|at_gauge| at_gauge.shows()));
            near.map(|near| format!("near {near}"))
        });
        let near: Vec<Option<String>> = near.collect();
        json!({ "experiment": experiment, "reading": reading, "near": near })
    };
    let lines: Vec<Value> = lines.iter().enumerate().map(line).collect();
    json!({ "before": before, "lines": lines, "rest": rest })
}
