//! The sheet to take along into the laboratory: one stop after the other, with what to write down.

use std::fmt::Write;

use nalgebra::DVector;

use super::markup::{escaped, page, paragraph, section, table_of, with_unbroken_vectors};
use super::stills::{Pictures, Stills};
use crate::experiment::Plan;
use crate::laboratory::{Campaign, Stop, change_load, hung_kg, set_gauge, set_up, take_off};
use crate::observation::{LengthKind, ReadLength};
use crate::record::messages::ProvenanceMessage;
use crate::robot::{Commands, Load, ReadsAlong};
use crate::scenario::Scenario;
use crate::task::{AccuracyKind, Task, station_named};
use crate::text::wording::{counted, duration, number, significant};

const STYLE: &str = include_str!("run_sheet.css");
/// More readings than this at one stop are written into the file.
const LINES: u32 = 8;
/// The column of what a gauge shows.
const DISPLACEMENT: &str = "displacement [mm]";
/// What is written down once.
const FIELDS: [&str; 10] = [
    "date",
    "operator",
    "robot, serial number",
    "controller, software",
    "instrument, serial number",
    "its certificate, valid until",
    "reflector, serial number",
    "loads and their certificate",
    "air temperature, start [\u{b0}C]",
    "air temperature, end [\u{b0}C]",
];

/// The sheet as a page for print, which loads nothing; `axes` are the names of the commanded joints' axes. Without a program a person moves
/// the robot.
pub fn run_sheet(
    scenario: &Scenario,
    stills: Stills<'_>,
    campaign: &Campaign,
    axes: &[&str],
    has_program: bool,
) -> String {
    let overview = overview(scenario, &stills.plan, campaign, has_program);
    let pictures = stills.pictures();
    let places = places(&scenario.task.belief.commands(), campaign);
    let title = format!("{}: run sheet", scenario.name);
    let instrument = &scenario.task.belief.instrument;
    let has_reflector =
        instrument.reads_along() != ReadsAlong::Always && instrument.reads_positions();
    let fields = (FIELDS.into_iter())
        .filter(|field| has_reflector || !field.starts_with("reflector"))
        .map(|field| format!("<p class=\"blank\">{}</p>\n", escaped(field)));
    let body = format!(
        "<style>\n{STYLE}</style>\n<h1>{}</h1>\n{}<div class=\"fields\">\n{}</div>\n{}{}{}{}",
        escaped(&title),
        overview,
        fields.collect::<String>(),
        section(
            "before",
            "Before the first stop",
            &before(scenario, campaign)
        ),
        section(
            "configurations",
            "Configurations",
            &configurations(scenario, campaign, &places, &pictures, axes)
        ),
        section(
            "stops",
            "Stops",
            &stops(scenario, campaign, &places, &pictures)
        ),
        provenance(scenario)
    );
    page(&title, &body)
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
    let is_absolute = task.design.accuracy == AccuracyKind::Absolute;
    let mut columns = Vec::new();
    if instrument.reads_along() != ReadsAlong::Always && instrument.reads_positions() {
        columns.extend(["x [mm]", "y [mm]", "z [mm]"]);
    }
    if is_absolute && instrument.rotation_sigma_rad.is_some() {
        columns.extend(["qw", "qx", "qy", "qz"]);
    }
    columns.extend(instrument.gauge.map(|_| DISPLACEMENT));
    let mut columns: Vec<String> = columns.into_iter().map(str::to_owned).collect();
    columns.extend(instrument.lengths().map(|(kind, _)| length_column(kind)));
    columns
}

fn length_column(kind: LengthKind) -> String {
    format!("{} [mm]", kind.name())
}

fn overview(scenario: &Scenario, plan: &Plan, campaign: &Campaign, has_program: bool) -> String {
    let is_absolute = scenario.task.design.accuracy == AccuracyKind::Absolute;
    let counts = [
        counted(campaign.stops.len() as u64, "stop"),
        counted(u64::from(campaign.readings()), "reading"),
        counted(campaign.load_changes() as u64, "change"),
    ];
    let [stops, readings, changes] = counts;
    let takes = format!("It takes about {}.", duration(campaign.minutes));
    let what = if is_absolute {
        let set_ups = counted(campaign.set_ups() as u64, "set-up");
        format!(
            "{readings} in {stops}, with {set_ups} of the instrument and {changes} of load. {takes}"
        )
    } else {
        format!(
            "{} of {} in {stops}: {readings} with {changes} of load and {}. {takes}",
            counted(plan.measurements().into(), "measurement"),
            counted(plan.experiments.len() as u64, "experiment"),
            counted(campaign.moves() as u64, "move"),
        )
    };
    let of_gauge = "For each measurement in turn, without moving the robot in between: set the gauge against the tool along the \
         direction that is given (world frame) and to zero, hang the load, and write down what the gauge shows, positive \
         along its direction (mm). Then take the load off and the gauge away before the robot moves.";
    let comes = if has_program {
        "The robot halts at each stop"
    } else {
        "Move the robot to each stop over the points and from the side that are given"
    };
    let is_sided = (campaign.stops.iter()).all(|stop| stop.side.as_approach().is_some());
    let sides = if is_sided {
        "Every configuration is approached from the same side both times: + and - say in which sense each joint, in their order, turns last."
    } else {
        "A configuration is approached from the same side both times where a side is given."
    };
    let of_positions = format!(
        "Without a load first, then under each load in turn: what is identified from is the difference of the \
         two positions at the same commanded angles. {sides} {comes}: wait until it has come to rest, read the instrument, write \
         the position of the reflector down (world frame, mm), and tick the stop."
    );
    let how = if is_absolute {
        let instrument = &scenario.task.belief.instrument;
        let positions = "write down what the instrument shows in a frame of its own";
        let mut shows = Vec::new();
        shows.extend(instrument.reads_positions().then(|| positions.to_owned()));
        for (kind, _) in instrument.lengths() {
            let which = if shows.is_empty() {
                String::new()
            } else {
                format!("of a {} ", kind.name())
            };
            shows.push(which + kind.how());
        }
        let stays = if campaign.stops.iter().any(|stop| stop.is_in_place) {
            " Where the load changes between two stops of one configuration the robot stays where it stands."
        } else {
            ""
        };
        format!(
            "{comes}: wait until it has come to rest, read each target of the stop, {}, and tick the stop.{stays} A configuration that comes again is \
             another visit of the robot, from the same side where one is given. The instrument stays where it is until the sheet asks \
             for another station.",
            shows.join("; ")
        )
    } else {
        match scenario.task.belief.instrument.reads_along() {
            ReadsAlong::Always => of_gauge.to_owned(),
            ReadsAlong::Sometimes => {
                format!("{of_positions} At the end, with the gauge: {of_gauge}")
            }
            ReadsAlong::Never => of_positions,
        }
    };
    let mut text = paragraph(&what) + &paragraph(&how);
    if !scenario.description.is_empty() {
        text = format!("<p class=\"lead\">{}</p>\n", escaped(&scenario.description)) + &text;
    }
    for condition in campaign.conditions(&scenario.laboratory) {
        text += &format!(
            "<p class=\"alarm\">{}</p>\n",
            escaped(&condition.to_string())
        );
    }
    if !campaign.is_checked {
        text += "<p class=\"alarm\">Moves were not looked at for collisions: the scenario names no \
                 region.collision_clearance_mm. Move slowly and with care.</p>\n";
    }
    if !has_program {
        text += "<p class=\"alarm\">There is no program of this campaign: no dialect suits the robot's joints.</p>\n";
    }
    text
}

/// What is to be done before, with a box to tick.
fn before(scenario: &Scenario, campaign: &Campaign) -> String {
    let laboratory = &scenario.laboratory;
    let home = match &campaign.home {
        Some(home) => format!(
            "Home, where the campaign starts and ends: {}.",
            angles(&scenario.task.belief.commands(), home)
        ),
        None => {
            "Bring the robot by hand to where the first stop's approach begins: all joints move \
                 together from there on."
                .to_owned()
        }
    };
    let instruments: &[&str] = if scenario.task.design.accuracy == AccuracyKind::Absolute {
        &[
            "What is read from stands firm: its place is found with the rest, as long as it does not move.",
        ]
    } else {
        let both = &[
            "The gauge's stand does not stand on what the load bends; its tip meets a flat face across its direction.",
            "The instrument is aligned to the robot's base (world frame). Residual of the alignment [mm]:",
        ];
        match scenario.task.belief.instrument.reads_along() {
            ReadsAlong::Always => &both[..1],
            ReadsAlong::Sometimes => both,
            ReadsAlong::Never => &both[1..],
        }
    };
    let warm = "The robot and the instrument are warm: all axes were moved until readings no longer drift. From, to:";
    let first = [warm].into_iter().chain(instruments.iter().copied());
    let further = [
        format!(
            "Tool {} and base {} of the controller are right, with the load data of the tool alone; speed {} %.",
            laboratory.tool_number, laboratory.base_number, laboratory.speed_percent
        ),
        "The controller's own compensation of deflections, such as KUKA's $ABS_ACCUR, is off."
            .to_owned(),
        home,
    ];
    let lines = first.map(str::to_owned).chain(further);
    let lines: Vec<String> = lines
        .map(|each| format!("<li>{}</li>\n", escaped(&each)))
        .collect();
    format!("<ul class=\"todo\">\n{}</ul>\n", lines.concat())
}

/// The angles of a configuration in a line.
fn angles(commands: &Commands, q: &DVector<f64>) -> String {
    let shown = commands.shown(q.as_slice()).into_iter();
    let values: Vec<String> = shown.map(|value| number(Some(value), 3)).collect();
    format!("{} {}", values.join(", "), commands.unit())
}

/// Each configuration once: picture, angles, side of approach, and where it comes.
fn configurations(
    scenario: &Scenario,
    campaign: &Campaign,
    places: &[Vec<usize>],
    pictures: &[Pictures],
    axes: &[&str],
) -> String {
    let commands = scenario.task.belief.commands();
    let of_place = |(index, place): (usize, &Vec<usize>)| {
        let stop = &campaign.stops[place[0]];
        let experiments = place
            .iter()
            .flat_map(|&each| &campaign.stops[each].experiments);
        let picture = experiments
            .min()
            .map_or("", |&first| &pictures[first].unloaded);
        let numbers: Vec<String> = place.iter().map(|each| (each + 1).to_string()).collect();
        let shown = |q: &DVector<f64>| commands.shown(q.as_slice());
        let (from, at) = (
            stop.approach.as_ref().map(shown),
            shown(&stop.configuration),
        );
        let rows = (at.iter().zip(axes).enumerate()).map(|(joint, (value, axis))| {
            let from = from.as_ref().map(|from| from[joint]);
            vec![(*axis).to_owned(), number(from, 3), number(Some(*value), 3)]
        });
        let unit = commands.unit();
        let header = [
            "joint",
            &format!("from [{unit}]"),
            &format!("stop [{unit}]"),
        ];
        format!(
            "<article class=\"place\"><h3>Configuration {}: {} {}</h3>\n{}\
             <p title=\"the sense in which each joint turns last, in their order\">Approached {}.</p>\n{}</article>\n",
            index + 1,
            if numbers.len() == 1 { "stop" } else { "stops" },
            numbers.join(", "),
            picture,
            escaped(&stop.side.words()),
            table_of(&header, rows)
        )
    };
    let all: String = places.iter().enumerate().map(of_place).collect();
    format!("<div class=\"places\">\n{all}</div>\n")
}

/// The stops in their order, with lines for the readings, and the changes of load between them.
fn stops(
    scenario: &Scenario,
    campaign: &Campaign,
    places: &[Vec<usize>],
    pictures: &[Pictures],
) -> String {
    let columns = columns(&scenario.task);
    let width = 60 / columns.len();
    let filled = columns
        .iter()
        .map(|column| format!("<th style=\"width: {width}%\">{column}</th>"));
    let experiment = match scenario.task.design.accuracy {
        AccuracyKind::Absolute => "<th>plan row</th><th>target</th>",
        AccuracyKind::Relative => "<th>experiment</th><th>repeat</th>",
    };
    let head = format!(
        "<thead><tr><th></th><th>stop</th><th>configuration</th>{experiment}{}</tr></thead>",
        filled.collect::<String>()
    );
    let commands = scenario.task.belief.commands();
    let (mut text, mut index) = (String::new(), 0);
    let is_on = |_: &Stop, next: &Stop| !next.changes_load && !next.changes_station;
    for group in campaign.stops.chunk_by(is_on) {
        let first = &group[0];
        if let (Some(station), true) = (&first.station, first.changes_station) {
            text += &station_words(&scenario.task, index + 1, station);
        }
        if let (Some(load), true) = (&first.load, first.changes_load) {
            let picture = &pictures[first.experiments[0]].load;
            let before = campaign.load_before(index);
            text += &hang(scenario, index + 1, before, load, picture);
        }
        let _ = writeln!(text, "<div class=\"wide\"><table class=\"stops\">\n{head}");
        for stop in group {
            let place = places.iter().position(|place| place.contains(&index));
            let before = campaign.load_before(index);
            index += 1;
            let numbers = (index, place.unwrap_or(0) + 1);
            text += &of_stop(&commands, numbers, (before, stop), &columns);
        }
        text += "</table></div>\n";
    }
    text
}

/// Where the instrument is set up.
fn station_words(task: &Task, stop: usize, name: &str) -> String {
    let known = station_named(&task.belief.stations, Some(name));
    let near = known.map_or_else(String::new, |station| {
        let [x, y, z] = [0, 1, 2].map(|axis| station.position_m[axis] * 1e3);
        format!(" It is near ({x:.0}, {y:.0}, {z:.0}) mm in the world frame.")
    });
    format!(
        "<p class=\"station\"><strong>Before stop {stop}: {}.</strong>{near}</p>\n",
        escaped(&set_up(name))
    )
}

/// Which load is hung where, and what the controller is told.
fn hang(
    scenario: &Scenario,
    stop: usize,
    before: Option<&Load>,
    load: &Load,
    picture: &str,
) -> String {
    let belief = &scenario.task.belief;
    let tool = &belief.calibration_tool;
    let gravity = &belief.nominal.chain.gravity_m_s2;
    let mass = hung_kg(load, gravity);
    let [x, y, z] = [0, 1, 2].map(|axis| tool.link_from_tool.translation.vector[axis] * 1e3);
    let link = (tool.joints.checked_sub(1))
        .and_then(|last| belief.nominal.chain.joints.get(last))
        .map_or_else(String::new, |joint| format!(" behind {}", joint.name));
    let mut text = format!(
        "<p><strong>Before stop {stop}: {}, {}.</strong></p>\n\
         <p>It acts at {}: ({x:.1}, {y:.1}, {z:.1}) mm in the frame of the link{}. Its direction is that in the world frame.</p>\n",
        with_unbroken_vectors(&escaped(&change_load(before, load, gravity))),
        mass.map_or_else(
            || format!("{} N together", significant(load.force_n.norm(), 5)),
            |mass| format!("{} kg", significant(mass, 5))
        ),
        escaped(&tool.name),
        escaped(&link)
    );
    if let Some(mass) = mass {
        let _ = writeln!(
            text,
            "<p class=\"todo\">Payload data, if the program does not set them: {} kg more, at the TCP of tool {}.</p>",
            significant(mass, 5),
            scenario.laboratory.tool_number
        );
    }
    format!("<div class=\"hang\">{picture}<div>{text}</div></div>\n")
}

/// A stop after another, with these fields for each reading.
fn of_stop(
    commands: &Commands,
    (index, place): (usize, usize),
    (before, stop): (Option<&Load>, &Stop),
    read: &[String],
) -> String {
    let fields = read.len();
    let experiments: Vec<String> = (stop.experiments.iter())
        .map(|index| (index + 1).to_string())
        .collect();
    let columns = fields + 4;
    let line = |text: &str| format!("<tr><td></td><td colspan=\"{columns}\">{text}</td></tr>\n");
    let mut over = String::new();
    if before.is_some() && stop.load.is_none() {
        let when = if stop.is_in_place {
            "where the robot stands"
        } else {
            "before the robot moves"
        };
        over += &line(&format!("{} {when}.", take_off(stop)));
    }
    for via in &stop.way.via {
        over += &line(&format!("over {}", angles(commands, via)));
    }
    if let (Some(direction), None) = (&stop.direction, &stop.load) {
        let near = stop.at_gauge.map_or_else(String::new, |at_gauge| {
            format!(
                " The target is near {} mm (world frame), and under the load the gauge should show about {} mm: one that moves in one \
                 sense alone needs that much room.",
                at_gauge.near(),
                at_gauge.shows()
            )
        });
        let words = format!("At the stop, {}.{near}", set_gauge(direction));
        over += &line(&with_unbroken_vectors(&words));
    }
    // What each line is: of absolute readings each its own, of deflections the readings of all experiments here.
    let lines: Vec<[String; 2]> = if stop.targets.is_empty() {
        let lines = 1..=stop.readings.clamp(1, LINES);
        let all = |line: u32| (line == 1).then(|| experiments.join(", "));
        lines
            .map(|line| [all(line).unwrap_or_default(), line.to_string()])
            .collect()
    } else {
        let targets = stop.targets.iter().map(|target| escaped(target));
        experiments
            .into_iter()
            .zip(targets)
            .map(Into::into)
            .collect()
    };
    // Where a gauge is set to zero nothing is written down.
    let blanks = |nominal: Option<ReadLength>| {
        if stop.sets_gauge() {
            return format!("<td colspan=\"{fields}\">to zero</td>");
        }
        let blank = |column: &String| {
            let own = nominal.filter(|length| length_column(length.kind) == *column);
            let near = own.map(|length| format!("{:.2}", length.length_m * 1e3));
            let at_gauge = stop.at_gauge.filter(|_| column == DISPLACEMENT);
            let near = near.or(at_gauge.map(|at_gauge| at_gauge.shows()));
            let near = near.map(|near| format!("<small>near {near}</small>"));
            format!("<td class=\"fill\">{}</td>", near.unwrap_or_default())
        };
        read.iter().map(blank).collect::<String>()
    };
    let tick = format!(
        "<td><span class=\"tick\" title=\"done\"></span></td><td><strong>{index}</strong></td><td>{place}</td>"
    );
    let mut rows = String::new();
    for (number, [experiment, reading]) in lines.iter().enumerate() {
        let first = if number == 0 {
            &tick
        } else {
            "<td colspan=\"3\"></td>"
        };
        let _ = writeln!(
            rows,
            "<tr class=\"line\">{first}<td>{experiment}</td><td>{reading}</td>{}</tr>",
            blanks(stop.lengths.get(number).copied().flatten())
        );
    }
    let rest = (stop.readings as usize).saturating_sub(lines.len());
    if rest > 0 {
        let more = counted(rest as u64, "more reading");
        let _ = writeln!(
            rows,
            "<tr><td colspan=\"5\"></td><td colspan=\"{fields}\">and {more}, into the file</td></tr>"
        );
    }
    format!("<tbody class=\"stop\">\n{over}{rows}</tbody>\n")
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
