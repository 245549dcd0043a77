//! Simulated files by the hundred: how often patterns and inconsistencies are told where there are none, how often those that are there
//! are found, and whether the model is chosen that was simulated. `SIMULATED` asks for so many files of the first kind (`make simulated`).

use elastocal::identification::patterns::{Against, Course, Drifting, LEVEL, Patterns};
use elastocal::identification::{AbsoluteCase, ParameterGroup, ReadingWeights};
use elastocal::measurement::AbsoluteReading;
use elastocal::numeric::random::generator;
use elastocal::robot::Approach;
use elastocal::scenario::Scenario;
use rand::RngExt;
use rayon::prelude::*;

use crate::model_selection::{Gear, other_arm, read_of};
use crate::one_fit::{between, seen_arm, ur10};

/// All of them: 200 files without anything, 24 with a pattern, 16 of which the model is chosen.
const ALL: u32 = 200;
const WITH_PATTERN: u32 = 24;
const OF_MODELS: u32 = 16;

/// How many of so many there are to be, in proportion to those that are asked for.
fn share(of: u32) -> u32 {
    let asked = std::env::var("SIMULATED").ok();
    let asked = asked
        .and_then(|asked| asked.parse().ok())
        .unwrap_or(ALL / 16);
    (of * asked).div_ceil(ALL)
}

/// A file of a robot whose joints' zeros are off, with order, time, temperature and sides of approach.
fn file(
    seed: u32,
    gear: Gear<'_>,
    change: &dyn Fn(&mut AbsoluteReading, f64),
) -> Vec<AbsoluteReading> {
    let mut random = generator(71, seed.into());
    let nominal = seen_arm(&mut random, &ur10(), 1, 1);
    let arm = other_arm(&mut random, &nominal, 1.0);
    let count = 60 + 10 * (seed as usize % 7);
    let force_n = if seed.is_multiple_of(2) { 0.0 } else { 80.0 };
    let mut readings = read_of(&mut random, &arm, count, force_n, gear);
    for (index, reading) in readings.iter_mut().enumerate() {
        reading.time_s = Some(60.0 * index as f64 + between(&mut random, 0.0, 30.0));
        reading.temperature_c = Some(20.0 + between(&mut random, 0.0, 5.0));
        let sides = (0..6).map(|_| random.random_range(0..2) == 1);
        reading.approach = Some(Approach(sides.collect()));
        if seed.is_multiple_of(5) {
            reading.rotation = None;
        }
        change(reading, index as f64 / count as f64);
    }
    readings
}

/// What is told of a file: patterns, and whether its halves are said to be inconsistent.
fn told(scenario: &Scenario, readings: &[AbsoluteReading]) -> (Patterns, bool) {
    let groups = [ParameterGroup::Geometry, ParameterGroup::Compliances];
    let is_loaded = readings.iter().any(|each| each.load.force_n.norm() > 0.0);
    let groups = &groups[..=usize::from(is_loaded)];
    let mut case = AbsoluteCase::new(&scenario.task.belief, readings).expect("readings");
    let fit = case.fit(groups, ReadingWeights::AsNeeded).expect("a fit");
    let patterns = case
        .looked_at(&fit, readings)
        .expect("stable")
        .patterns(&[]);
    let halves = case.kept(&fit).inconsistencies_of_halves(&fit);
    let is_inconsistent = halves.is_some_and(|(_, halves)| !halves.found.is_empty());
    (patterns, is_inconsistent)
}

/// What no parameter is, in a third of the files: as good as new in each reading.
fn discrepancy(seed: u32) -> impl Fn(usize, f64) -> f64 {
    let size = if seed.is_multiple_of(3) { 1e-4 } else { 0.0 };
    move |joint, angle| size * ((3e4 + joint as f64) * angle).sin()
}

/// Patterns and inconsistencies are told of no more of the files in which there is none than the level of the tests says.
#[test]
fn no_file_raises_a_false_alarm() {
    let scenario = ur10();
    let alarms: Vec<(u32, Vec<String>, bool)> = (0..share(ALL))
        .into_par_iter()
        .map(|seed| {
            let (patterns, is_inconsistent) =
                told(&scenario, &file(seed, &discrepancy(seed), &|_, _| {}));
            let sentences = patterns.found.into_iter().map(|each| each.sentence);
            (seed, sentences.collect::<Vec<_>>(), is_inconsistent)
        })
        .filter(|(_, patterns, is_inconsistent)| !patterns.is_empty() || *is_inconsistent)
        .collect();
    println!(
        "{} alarms in {} files: {alarms:?}",
        alarms.len(),
        share(ALL)
    );
    let most = (LEVEL * f64::from(share(ALL))).floor();
    assert!(alarms.len() as f64 <= most, "{alarms:?}");
}

/// The pattern that is there is told first.
#[test]
fn every_pattern_is_found() {
    let scenario = ur10();
    let missed: Vec<String> = (0..share(WITH_PATTERN))
        .into_par_iter()
        .filter_map(|number| {
            let (joint, waves) = ((1 + number as usize / 4) % 5, 2 + number as usize % 3);
            let gear = |which: usize, angle: f64| {
                let is_it = number.is_multiple_of(4) && which == joint;
                if is_it {
                    2e-4 * (waves as f64 * angle + 0.4).sin()
                } else {
                    0.0
                }
            };
            let change = |reading: &mut AbsoluteReading, place: f64| match number % 4 {
                1 => {
                    let temperature = reading.temperature_c.expect("it is there");
                    reading.position_m.x += 4e-5 * (temperature - 22.0);
                }
                2 => reading.position_m.z += if place < 0.5 { 0.0 } else { 1e-4 },
                3 => reading.position_m *= 1.0 + 1e-4 * (reading.position_m.norm() - 2.0),
                _ => {}
            };
            let is_it = |against: Against| match number % 4 {
                0 => against == Against::Angle { joint, waves },
                1 => against == Against::Course(Course::Temperature, Drifting::Base),
                2 => matches!(
                    against,
                    Against::Course(Course::Order | Course::Time, Drifting::Base)
                ),
                _ => against == Against::Range,
            };
            // Poses without loads.
            let (patterns, _) = told(&scenario, &file(1000 + 70 * number + 2, &gear, &change));
            let first = patterns.found.first();
            let is_found = first.is_some_and(|first| is_it(first.against));
            (!is_found).then(|| format!("{number}: {:?}", first.map(|first| &first.sentence)))
        })
        .collect();
    println!("{} of {} missed", missed.len(), share(WITH_PATTERN));
    assert!(missed.is_empty(), "{missed:?}");
}

/// Zeros, and compliances where they are others, are what is recommended.
#[test]
fn the_simulated_model_is_recommended() {
    let scenario = ur10();
    let others: Vec<(u32, Vec<ParameterGroup>)> = (0..share(OF_MODELS))
        .into_par_iter()
        .filter_map(|number| {
            let is_soft = number % 2 == 1;
            let mut random = generator(72, number.into());
            let nominal = seen_arm(&mut random, &scenario, 1, 1);
            let arm = other_arm(&mut random, &nominal, if is_soft { 4.0 } else { 1.0 });
            let force_n = if is_soft { 60.0 } else { 0.0 };
            let readings = read_of(&mut random, &arm, 120, force_n, &|_, _| 0.0);
            let case = AbsoluteCase::new(&scenario.task.belief, &readings);
            let model_selection =
                case.and_then(|mut case| case.model_selection(ReadingWeights::AsNeeded));
            let groups = model_selection
                .expect("a model_selection")
                .groups()
                .to_vec();
            let is_right = if is_soft {
                groups.contains(&ParameterGroup::Compliances)
            } else {
                groups == [ParameterGroup::Zeros]
            };
            (!is_right).then_some((number, groups))
        })
        .collect();
    println!("{} of {} others", others.len(), share(OF_MODELS));
    assert!(others.is_empty(), "{others:?}");
}
