//! The robot's program of a campaign, and one that leads to given configurations, one after the other.

use nalgebra::{DVector, Vector3};

use super::dialect::{Angles, Dialect, DialectError};
use super::side::{Side, wanted_side};
use super::ways::Ways;
use super::{Campaign, CampaignError, Laboratory, Stop};
use crate::experiment::in_words;
use crate::robot::{Commands, Load};
use crate::task::Task;
use crate::text::wording::counted;

/// Texts of programs are shorter than this.
const LONGEST_TEXT: usize = 100;
/// The cosine of the largest angle between a hung load and gravity.
const PLUMB: f64 = 0.999;

/// What is done before a stop without a load where one hangs, or after the last stop.
pub const fn take_off(stop: &Stop) -> &'static str {
    if stop.direction.is_some() {
        "Take the load off and the gauge away"
    } else {
        "Take the load off"
    }
}

/// What is done before the readings from a station.
pub fn set_up(station: &str) -> String {
    format!("set up the instrument at station {station}")
}

/// How a gauge is set along a direction (unit vector, world frame).
pub fn set_gauge(direction: &Vector3<f64>) -> String {
    let [x, y, z] = (*direction).into();
    format!("set the gauge along ({x:.3}, {y:.3}, {z:.3}) and to zero")
}

/// One step of a program.
#[derive(Debug, Clone, PartialEq)]
pub enum ProgramStep {
    /// A remark.
    Remark(String),
    /// A move of all joints together to a configuration (rad, m), at whose end the robot rests.
    Move(DVector<f64>),
    /// Waits for a person, who is told what to do.
    Halt(String),
    /// Tells the controller what hangs at the tool's point beside the tool (kg); nothing any more.
    Payload(Option<f64>),
    /// Keeps the measured joint angles.
    Log,
}

/// A program in any dialect.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Program {
    /// What it is, in a line.
    pub title: String,
    /// Its steps.
    pub steps: Vec<ProgramStep>,
}

/// A file of a program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ProgramFile {
    /// The file's name.
    pub name: String,
    /// What is in it.
    pub text: String,
}

/// The mass (kg) whose weight a load is, under gravity (m/s^2); none where it does not hang.
pub fn hung_kg(load: &Load, gravity_m_s2: &Vector3<f64>) -> Option<f64> {
    let (pull, gravity) = (load.force_n.norm(), gravity_m_s2.norm());
    let hangs = load.force_n.dot(gravity_m_s2) > PLUMB * pull * gravity;
    (hangs && load.torque_nm.norm() == 0.0).then(|| pull / gravity)
}

/// How a load takes the place of that of the stop before, if one is there, under gravity (m/s^2).
pub fn change_load(before: Option<&Load>, load: &Load, gravity_m_s2: &Vector3<f64>) -> String {
    let rounded = |load: &Load| in_words(&load.as_set());
    let hangs = hang_or_apply(load, gravity_m_s2);
    let first = before.map_or_else(String::new, |before| {
        format!("take the load {} off, then ", rounded(before))
    });
    format!("{first}{hangs} the load {}", rounded(load))
}

/// A sentence with its first letter as sentences have it.
fn capitalised(sentence: &str) -> String {
    let mut letters = sentence.chars();
    let first = letters.next().map(|letter| letter.to_ascii_uppercase());
    first.into_iter().chain(letters).collect()
}

/// What is done with a load under gravity (m/s^2): a weight is hung.
pub fn hang_or_apply(load: &Load, gravity_m_s2: &Vector3<f64>) -> &'static str {
    match hung_kg(load, gravity_m_s2) {
        Some(_) => "hang",
        None => "apply",
    }
}

/// The program of a campaign under gravity (m/s^2).
pub fn program(campaign: &Campaign, gravity_m_s2: &Vector3<f64>, title: &str) -> Program {
    let mut steps = Vec::new();
    let mut payload = None;
    if let Some(home) = &campaign.home {
        let start = "Start at the first safe pose";
        steps.push(ProgramStep::Remark(start.to_owned()));
        steps.push(ProgramStep::Move(home.clone()));
    }
    for (index, stop) in campaign.stops.iter().enumerate() {
        let before = campaign.load_before(index);
        if before.is_some() && stop.load.is_none() {
            steps.push(ProgramStep::Halt(take_off(stop).to_owned()));
            steps.extend(payload.take().map(|_: f64| ProgramStep::Payload(None)));
        }
        let station = stop.station.as_ref().filter(|_| stop.changes_station);
        steps.extend(station.map(|station| ProgramStep::Halt(capitalised(&set_up(station)))));
        steps.push(ProgramStep::Remark(remark(index + 1, stop)));
        steps.extend(stop.way.via.iter().cloned().map(ProgramStep::Move));
        steps.extend(stop.approach.iter().cloned().map(ProgramStep::Move));
        if let (Some(load), true) = (&stop.load, stop.changes_load) {
            if stop.approach.is_none() {
                steps.push(ProgramStep::Move(stop.configuration.clone()));
            }
            let change = change_load(before, load, gravity_m_s2);
            steps.push(ProgramStep::Halt(capitalised(&change)));
        }
        let hung = (stop.load.as_ref()).and_then(|load| hung_kg(load, gravity_m_s2));
        if hung != payload {
            steps.push(ProgramStep::Payload(hung));
            payload = hung;
        }
        steps.push(ProgramStep::Move(stop.configuration.clone()));
        let what = match (&stop.direction, &stop.load) {
            (Some(direction), None) => set_gauge(direction),
            _ if !stop.targets.is_empty() => format!("read {}", stop.targets.join(", ")),
            _ => counted(stop.readings.into(), "reading"),
        };
        steps.push(ProgramStep::Halt(format!("Stop {}: {what}", index + 1)));
        steps.push(ProgramStep::Log);
    }
    if let Some(last) = campaign.stops.last().filter(|last| last.load.is_some()) {
        steps.push(ProgramStep::Halt(take_off(last).to_owned()));
        steps.extend(payload.map(|_| ProgramStep::Payload(None)));
    }
    if let (Some(home), Some(way)) = (&campaign.home, &campaign.return_way) {
        steps.extend(back(way.via.clone(), home));
    }
    Program {
        title: title.to_owned(),
        steps,
    }
}

/// The steps over safe poses back to the first.
fn back(via: Vec<DVector<f64>>, home: &DVector<f64>) -> impl Iterator<Item = ProgramStep> {
    let remark = ProgramStep::Remark("Back to the first safe pose".to_owned());
    let moves = via.into_iter().chain([home.clone()]).map(ProgramStep::Move);
    [remark].into_iter().chain(moves)
}

fn remark(number: usize, stop: &Stop) -> String {
    let experiments: Vec<String> = (stop.experiments.iter())
        .map(|index| (index + 1).to_string())
        .collect();
    let load = stop.load.as_ref();
    let load = load.map_or_else(|| "without load".to_owned(), in_words);
    format!(
        "Stop {number}: experiment {}, {load}",
        experiments.join(", ")
    )
}

/// A configuration to go to.
#[derive(Debug, Clone, PartialEq)]
pub struct ProgramTarget {
    /// What it is, in words: `test pose "milling"`.
    pub name: String,
    /// The configuration to command (rad, m).
    pub configuration: DVector<f64>,
}

/// A program that leads the unloaded robot to targets in their order, from the laboratory's first safe pose and back
/// to it where there is one: straight moves where these keep clear, else over safe poses; each target from one side, as
/// in the calibration; a halt at each, and the measured joint angles.
///
/// # Errors
/// No way is found to a target, or a joint would be commanded beyond its range.
pub fn program_to(
    task: &Task,
    laboratory: &Laboratory,
    targets: &[ProgramTarget],
    title: &str,
) -> Result<Program, CampaignError> {
    let configurations: Vec<DVector<f64>> = (targets.iter())
        .map(|each| each.configuration.clone())
        .collect();
    let mut ways = Ways::new(task, &laboratory.safe_poses, &configurations);
    let home = laboratory.safe_poses.first();
    let mut steps: Vec<ProgramStep> = home.cloned().map(ProgramStep::Move).into_iter().collect();
    let mut last = home.map(|home| ("from the first safe pose".to_owned(), home.clone()));
    for ProgramTarget {
        name,
        configuration: q,
    } in targets
    {
        let joints = q.iter().zip(&task.belief.nominal.chain.joints);
        for (value, joint) in joints {
            let [low, high] = joint.range_rad;
            if !(low..=high).contains(value) {
                return Err(CampaignError::BeyondRange {
                    joint: joint.name.clone(),
                    to: name.clone(),
                });
            }
        }
        let judge = ways.judge();
        let (wanted, by) = (wanted_side(task, None), laboratory.approach);
        let (side, approach) = Side::free(task, by, judge, q, &[Load::NONE], wanted.as_deref());
        let remark = format!("{name}, approached {}", side.words());
        steps.push(ProgramStep::Remark(remark));
        if let Some(last) = &last {
            let via = via(&mut ways, last, name, approach.as_ref().unwrap_or(q))?;
            steps.extend(via.into_iter().map(ProgramStep::Move));
        }
        steps.extend(approach.map(ProgramStep::Move));
        steps.push(ProgramStep::Move(q.clone()));
        steps.push(ProgramStep::Halt(format!("At {name}")));
        steps.push(ProgramStep::Log);
        last = Some((format!("from {name}"), q.clone()));
    }
    if let (Some(home), Some((_, last))) = (home, last) {
        let last = ("from the last target".to_owned(), last);
        let via = via(&mut ways, &last, "the first safe pose", home)?;
        steps.extend(back(via, home));
    }
    Ok(Program {
        title: title.to_owned(),
        steps,
    })
}

/// The safe poses between two places.
fn via(
    ways: &mut Ways<'_>,
    (from, start): &(String, DVector<f64>),
    to: &str,
    end: &DVector<f64>,
) -> Result<Vec<DVector<f64>>, CampaignError> {
    let way = ways.find(start, end, &[Load::NONE], 0);
    way.map(|way| way.via).ok_or_else(|| CampaignError::NoWay {
        from: from.clone(),
        to: to.to_owned(),
        load: None,
    })
}

impl Program {
    /// The files of the program in a dialect.
    ///
    /// # Errors
    /// The dialect is for other joints.
    pub fn files(
        &self,
        dialect: &Dialect,
        laboratory: &Laboratory,
        commands: &Commands,
        name: &str,
    ) -> Result<Vec<ProgramFile>, DialectError> {
        let axes = dialect.axes_of(commands)?;
        let name = identifier(name, dialect.longest_name);
        let speed = laboratory.speed_percent.to_string();
        let mut logs = 0_usize;
        let lines: Vec<String> = (self.steps.iter())
            .map(|step| match step {
                ProgramStep::Remark(text) => dialect.comment.replace("<text>", &plain(text)),
                ProgramStep::Move(q) => (dialect.movement)
                    .replace("<target>", &target(dialect, &axes, commands, q))
                    .replace("<speed>", &speed),
                ProgramStep::Payload(Some(mass_kg)) => (dialect.payload)
                    .replace("<mass>", &format!("{mass_kg:.3}"))
                    .replace("<tool>", &laboratory.tool_number.to_string()),
                ProgramStep::Payload(None) => {
                    (dialect.no_payload).replace("<tool>", &laboratory.tool_number.to_string())
                }
                ProgramStep::Halt(text) => dialect.halt.replace("<text>", &plain(text)),
                ProgramStep::Log => {
                    logs += 1;
                    dialect.log.replace("<index>", &logs.to_string())
                }
            })
            .map(|line| line.trim_start_matches('\n').to_owned())
            .filter(|line| !line.is_empty())
            .collect();
        let fill = |text: &str| {
            text.trim_start_matches('\n')
                .replace("<name>", &name)
                .replace("<title>", &plain(&self.title))
                .replace("<speed>", &speed)
                .replace("<tool>", &laboratory.tool_number.to_string())
                .replace("<base>", &laboratory.base_number.to_string())
                .replace("<logs>", &logs.max(1).to_string())
                .replace("<steps>", &lines.join("\n"))
        };
        let files = dialect.files.iter().map(|file| ProgramFile {
            name: format!("{name}.{}", file.ending),
            text: fill(&file.text),
        });
        Ok(files.collect())
    }
}

fn target(dialect: &Dialect, axes: &[&str], commands: &Commands, q: &DVector<f64>) -> String {
    let written = commands.numbers(q.as_slice());
    let values = (commands.slides().zip(written)).map(|(slides, value)| match dialect.angles {
        Angles::Degrees => value,
        Angles::Radians if slides => value * 1e-3,
        Angles::Radians => value.to_radians(),
    });
    let axes: Vec<String> = (axes.iter().zip(values))
        .map(|(axis, value)| {
            let number = format!("{value:.*}", dialect.decimals);
            let number = number.trim_end_matches('0').trim_end_matches('.');
            let number = if number == "-0" { "0" } else { number };
            dialect
                .target
                .replace("<axis>", axis)
                .replace("<value>", number)
        })
        .collect();
    axes.join(&dialect.between)
}

/// A name of letters, digits and underscores that begins with a letter.
fn identifier(name: &str, longest: usize) -> String {
    let mut name = name.replace(|letter: char| !letter.is_ascii_alphanumeric(), "_");
    if !name.starts_with(|letter: char| letter.is_ascii_alphabetic()) {
        name.insert_str(0, "p_");
    }
    name.truncate(longest);
    name
}

/// Text that no controller takes for anything else: one line of ASCII without quotes or brackets.
fn plain(text: &str) -> String {
    let letters = text.chars().map(|letter| match letter {
        '"' | '\'' | '\\' | '<' | '>' | '{' | '}' => ' ',
        letter if letter.is_ascii() && !letter.is_ascii_control() => letter,
        _ => '?',
    });
    letters.take(LONGEST_TEXT).collect()
}
