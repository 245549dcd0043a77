//! What a person reads and writes at each stop: the content of the run sheet, which `view` prints.

use nalgebra::DVector;
use serde::Serialize;

use super::{Campaign, Stop, set_gauge, take_off};
use crate::observation::LengthKind;
use crate::robot::{Commands, ReadsAlong};
use crate::task::{AccuracyKind, Instrument, Task};
use crate::text::wording::{dash, joined, naming, number};

/// More readings than this at one stop are written into the file.
const LINES: u32 = 8;
/// The column of what a gauge shows.
const DISPLACEMENT: &str = "displacement [mm]";

/// What is done and written down at a stop.
#[derive(Debug, Clone, Serialize)]
pub struct SheetStop {
    /// Its number, from 1.
    pub number: usize,
    /// The number of its configuration, from 1.
    pub place: usize,
    /// What is done before it is read.
    pub before: Vec<String>,
    /// Whether the gauge is only set to zero here.
    pub sets_gauge: bool,
    /// A line for each reading, as far as there are lines.
    pub lines: Vec<SheetLine>,
    /// So many more readings are written into the file.
    pub rest: usize,
}

/// A line to write a reading on.
#[derive(Debug, Clone, Serialize)]
pub struct SheetLine {
    /// The numbers of the experiments, or of the row, that it is of.
    pub experiment: String,
    /// The number of the repeat, or the target.
    pub reading: String,
    /// What stands in each column already: what will be read there about, or that nothing is.
    pub near: Vec<Option<String>>,
}

/// Stops and columns of a run sheet.
#[derive(Debug, Clone, Copy)]
pub struct RunSheet<'a> {
    commands: &'a Commands,
    campaign: &'a Campaign,
}

impl<'a> RunSheet<'a> {
    /// Of a campaign.
    pub const fn new(commands: &'a Commands, campaign: &'a Campaign) -> Self {
        Self { commands, campaign }
    }

    /// The angles of a configuration in a line.
    pub fn angles(&self, q: &DVector<f64>) -> String {
        let shown = self.commands.shown(q.as_slice()).into_iter();
        let values = joined(shown.map(|value| number(Some(value), 3)), ", ");
        format!("{values} {}", self.commands.unit())
    }

    /// The stops, as indices, at each configuration, as it is printed, that is approached from one side, in the order of the first visits.
    pub fn places(&self) -> Vec<Vec<usize>> {
        let mut places: Vec<Vec<usize>> = Vec::new();
        for (index, stop) in self.campaign.stops.iter().enumerate() {
            let printed = |stop: &Stop| self.angles(&stop.configuration);
            let is_here = |place: &&mut Vec<usize>| {
                let first = &self.campaign.stops[place[0]];
                first.side == stop.side && printed(first) == printed(stop)
            };
            match places.iter_mut().find(is_here) {
                Some(place) => place.push(index),
                None => places.push(vec![index]),
            }
        }
        places
    }

    /// A stop, with lines of these columns.
    pub fn stop(&self, index: usize, places: &[Vec<usize>], columns: &[String]) -> SheetStop {
        let stop = &self.campaign.stops[index];
        let place = places.iter().position(|place| place.contains(&index));
        let is_repeat =
            |each: &&Stop| each.experiments == stop.experiments && each.load == stop.load;
        let earlier = self.campaign.stops[..index].iter().filter(is_repeat);
        let lines = lines(stop, earlier.map(|each| each.readings).sum(), columns);
        SheetStop {
            number: index + 1,
            place: place.unwrap_or(0) + 1,
            before: self.before(index),
            sets_gauge: stop.sets_gauge(),
            rest: (stop.readings as usize).saturating_sub(lines.len()),
            lines,
        }
    }

    /// What is done before a stop is read.
    fn before(&self, index: usize) -> Vec<String> {
        let stop = &self.campaign.stops[index];
        let mut before = Vec::new();
        if self.campaign.load_before(index).is_some() && stop.load.is_none() {
            let when =
                ["before the robot moves", "where the robot stands"][usize::from(stop.is_in_place)];
            before.push(format!("{} {when}.", take_off(stop)));
        }
        let via = stop.way.via.iter();
        before.extend(via.map(|via| format!("over {}", self.angles(via))));
        if let (Some(direction), None) = (&stop.direction, &stop.load) {
            let near = stop.at_gauge.map_or_else(String::new, |at_gauge| {
                format!(
                    " The target is near {} mm (world frame), and under the load the gauge should show about {} mm: one that moves in one \
                     sense alone needs that much room.",
                    at_gauge.near(),
                    at_gauge.shows()
                )
            });
            before.push(format!("At the stop, {}.{near}", set_gauge(direction)));
        }
        before
    }
}

/// The lines of a stop: of absolute readings each is its own, of deflections the readings of all experiments there, of which so many were
/// read at earlier stops.
fn lines(stop: &Stop, earlier: u32, columns: &[String]) -> Vec<SheetLine> {
    let experiments = stop.experiments.iter().map(|index| (index + 1).to_string());
    let names: Vec<[String; 2]> = if stop.targets.is_empty() {
        let mut all = Some(joined(experiments, ", "));
        let lines = 1..=stop.readings.clamp(1, LINES);
        lines
            .map(|line| [all.take().unwrap_or_default(), (earlier + line).to_string()])
            .collect()
    } else {
        experiments
            .zip(stop.targets.iter().cloned())
            .map(Into::into)
            .collect()
    };
    let numbered = names.into_iter().enumerate();
    let line = |(number, [experiment, reading]): (usize, [String; 2])| SheetLine {
        experiment,
        reading,
        near: near(stop, number, columns),
    };
    numbered.map(line).collect()
}

/// What stands in each column of a stop's line: what will be read there about, or a dash where nothing is.
fn near(stop: &Stop, line: usize, columns: &[String]) -> Vec<Option<String>> {
    let nominal = stop.lengths.get(line).copied().flatten();
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
    near.collect()
}

/// What is written down of a reading, with units.
pub fn columns(task: &Task) -> Vec<String> {
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

/// Whether the instrument reads positions that are written down.
pub fn reads_positions(instrument: &Instrument) -> bool {
    instrument.reads_along() != ReadsAlong::Always && instrument.reads_positions()
}

/// What is done with what the instrument shows of absolute readings.
pub fn shows(instrument: &Instrument) -> Vec<String> {
    let positions = "write down what the instrument shows in a frame of its own";
    let mut shows = Vec::new();
    shows.extend(instrument.reads_positions().then(|| positions.to_owned()));
    for (kind, _) in instrument.lengths() {
        let which = naming((!shows.is_empty()).then(|| kind.name()), "of a {} ");
        shows.push(which + kind.how());
    }
    shows
}
