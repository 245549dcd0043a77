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
    let pictures = stills.pictures();
    let sheet = RunSheet::new(&commands, campaign);
    let places = sheet.places();
    let columns = columns(task);
    let place = |place: &Vec<usize>| {
        let stop = &campaign.stops[place[0]];
        let experiments = place
            .iter()
            .flat_map(|&each| &campaign.stops[each].experiments);
        let shown = |q: &DVector<f64>| commands.shown(q.as_slice());
        json!({
            "stops": place.iter().map(|each| each + 1).collect::<Vec<_>>(),
            "picture": experiments.min().map(|&first| &pictures[first][0]),
            "side": stop.side.words(),
            "from": stop.approach.as_ref().map(shown),
            "at": shown(&stop.configuration),
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
            let picture = is_new.then(|| &pictures[stop.experiments[0]][1]);
            hang["picture"] = json!(picture);
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
        "camera": stills.camera.shown(),
        "description": scenario.description,
        "path": scenario.path,
        "provenance": ProvenanceMessage::new(scenario),
        "tool_number": laboratory.tool_number,
        "base_number": laboratory.base_number,
        "speed_percent": laboratory.speed_percent,
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
        "axes": axes,
        "columns": columns,
        "places": places.iter().map(place).collect::<Vec<_>>(),
        "groups": groups,
        "take_off": stops.last().filter(|stop| stop.load.is_some()).map(|stop| take_off(stop).to_lowercase()),
    });
    page(&title, "run_sheet.html", &shown)
}

/// Where the instrument is set up, near a place (mm).
fn set_up_at(task: &Task, name: &str) -> Value {
    let station = station_named(&task.belief.stations, Some(name));
    json!({ "set_up": set_up(name), "near": station.map(|station| millimetres(&station.position_m)) })
}

/// Which load is hung where (mm), and what the controller is told; none where it does not change.
fn hang(scenario: &Scenario, before: Option<&Load>, stop: &Stop) -> Option<Value> {
    let load = stop.load.as_ref().filter(|_| stop.changes_load)?;
    let belief = &scenario.task.belief;
    let (tool, chain) = (&belief.calibration_tool, &belief.nominal.chain);
    let link = tool.joints.checked_sub(1);
    let link = link.and_then(|last| chain.joints.get(last));
    Some(json!({
        "change": change_load(before, load, &chain.gravity_m_s2),
        "mass_kg": hung_kg(load, &chain.gravity_m_s2),
        "force_n": load.force_n.norm(),
        "tool": tool.name,
        "at": millimetres(&tool.link_from_tool.translation.vector),
        "behind": link.map(|joint| &joint.name),
    }))
}

fn millimetres(place_m: &Vector3<f64>) -> [f64; 3] {
    (place_m * 1e3).into()
}
