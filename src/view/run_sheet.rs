//! The sheet to take along into the laboratory: one stop after the other, with what to write down.

use nalgebra::{DVector, Vector3};
use serde_json::{Value, json};

use super::markup::{PageError, page};
use super::stills::Stills;
use crate::laboratory::sheet::{RunSheet, columns, reads_positions, shows};
use crate::laboratory::{Campaign, Stop, change_load, hung_kg, set_up, take_off};
use crate::record::campaign::campaign_json;
use crate::record::messages::ProvenanceMessage;
use crate::robot::Load;
use crate::scenario::Scenario;
use crate::task::{AccuracyKind, Task, station_named};
use crate::text::wording::{joined, number, significant};

const STYLE: &str = include_str!("pages/run_sheet.css");

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
    let pictures = stills.pictures()?;
    let sheet = RunSheet::new(&commands, campaign);
    let places = sheet.places();
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
    let (mut first, mut hung) = (0, Vec::new());
    let is_on = |_: &Stop, next: &Stop| !next.changes_load && !next.changes_station;
    let groups = campaign.stops.chunk_by(is_on).map(|group| {
        let (stop, indices) = (&group[0], first..first + group.len());
        let station = stop.station.as_ref().filter(|_| stop.changes_station);
        let hang = hang(scenario, campaign.load_before(first), stop).map(|mut hang| {
            // Where a load hangs is shown once.
            let is_new = !hung.contains(&stop.load.as_ref());
            let picture = is_new.then(|| &*pictures[stop.experiments[0]].load);
            hang["picture"] = picture.into();
            hung.push(stop.load.as_ref());
            hang
        });
        first = indices.end;
        json!({
            "first": indices.start + 1,
            "station": station.map(|name| set_up_at(task, name)),
            "hang": hang,
            "stops": indices.map(|index| sheet.stop(index, &places, &columns)).collect::<Vec<_>>(),
        })
    });
    let groups: Vec<Value> = groups.collect();
    let stops = &campaign.stops;
    let title = format!("{}: run sheet", scenario.name);
    let shown = json!({
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
        "home": campaign.home.as_ref().map(|home| sheet.angles(home)),
        "unit": commands.unit(),
        "columns": columns,
        "places": places.iter().map(place).collect::<Vec<_>>(),
        "groups": groups,
        "take_off": stops.last().filter(|stop| stop.load.is_some()).map(|stop| take_off(stop).to_lowercase()),
    });
    page(&title, "run_sheet.html", &shown)
}

/// A place (mm) with the given decimals.
fn place_mm(place_m: &Vector3<f64>, decimals: usize) -> String {
    let values = place_m.iter();
    let values = values.map(|value| number(Some(value * 1e3), decimals));
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
        "change": change_load(before, load, gravity),
        "size": size,
        "hangs": mass.is_some(),
        "tool": tool.name,
        "at": place_mm(&tool.link_from_tool.translation.vector, 1),
        "behind": link.map(|joint| &joint.name),
    }))
}
