//! What residuals go with: named where there is something, and not where there is nothing.

use elastocal::identification::patterns::{Against, Course, Drifting, LEVEL, Patterns};
use elastocal::identification::{AbsoluteCase, ParameterGroup, ReadingWeights};
use elastocal::measurement::{AbsoluteReading, absolute_table};
use elastocal::numeric::random::generator;
use elastocal::robot::Approach;
use elastocal::task::Belief;
use rand::RngExt;
use rayon::prelude::*;

use crate::model_selection::read_of;
use crate::one_fit::{between, plain, seen_arm, ur10, workplace};

use crate::support::assert_has;

const GROUPS: [ParameterGroup; 1] = [ParameterGroup::Geometry];

fn patterns(belief: &Belief, readings: &[AbsoluteReading]) -> Patterns {
    let mut case = AbsoluteCase::new(belief, readings).expect("readings");
    let fit = case.fit(&GROUPS, ReadingWeights::AsNeeded).expect("a fit");
    case.looked_at(&fit, readings)
        .expect("stable")
        .patterns(&[])
}

/// Readings with order, time, temperature and approach that mean nothing, and what a change makes of them.
fn told(
    seed: u64,
    count: usize,
    change: &dyn Fn(&mut AbsoluteReading, usize),
) -> Vec<AbsoluteReading> {
    let mut random = generator(31, seed);
    let scenario = ur10();
    let arm = seen_arm(&mut random, &scenario, 1, 1);
    let mut readings = read_of(&mut random, &arm, count, 0.0, &|_, _| 0.0);
    for (index, reading) in readings.iter_mut().enumerate() {
        reading.time_s = Some(60.0 * index as f64 + between(&mut random, 0.0, 30.0));
        reading.temperature_c = Some(20.0 + between(&mut random, 0.0, 5.0));
        let sides = (0..6).map(|_| random.random_range(0..2) == 1);
        reading.approach = Some(Approach(sides.collect()));
        change(reading, index);
    }
    readings
}

/// Robots without a pattern: the false alarms are as rare as they are said to be.
#[test]
fn nothing_is_named_where_there_is_nothing() {
    const ROBOTS: u64 = 100;
    let scenario = ur10();
    let belief = &scenario.task.belief;
    let alarms: Vec<usize> = (0..ROBOTS)
        .into_par_iter()
        .map(|seed| {
            let found = patterns(belief, &told(seed, 60, &|_, _| {}));
            assert!(found.looked_at > 500, "{}", found.looked_at);
            found.found.len()
        })
        .collect();
    let alarms = alarms.iter().filter(|&&count| count > 0).count();
    println!("{alarms} alarms in {ROBOTS} robots at {LEVEL}");
    // One is expected; five or more are seen by chance in one of 270.
    assert!(alarms <= 4, "{alarms}");
}

/// A gear that is not round is named with its joint and its waves, whichever it is.
#[test]
fn gears_that_are_not_round_are_named() {
    let scenario = ur10();
    let belief = &scenario.task.belief;
    let cases = [(1, 2, 2e-4), (2, 5, 1e-4), (4, 3, 3e-4), (0, 101, 2e-4)];
    cases.into_par_iter().for_each(|(joint, waves, size)| {
        let mut random = generator(32, waves as u64);
        let arm = seen_arm(&mut random, &scenario, 1, 1);
        let gear = |which: usize, angle: f64| {
            let wave = size * (waves as f64 * angle + 0.4).sin();
            if which == joint { wave } else { 0.0 }
        };
        let readings = read_of(&mut random, &arm, 150, 0.0, &gear);
        let found = patterns(belief, &readings);
        let first = &found.found[0];
        assert_eq!(
            first.against,
            Against::Angle { joint, waves },
            "{}",
            first.sentence
        );
        assert!((first.size / size - 1.0).abs() < 0.1, "{}", first.size);
        assert!(first.share > 0.5, "{}", first.share);
        assert_eq!(
            found.found.len(),
            1,
            "{:?}",
            found.found[1..]
                .iter()
                .map(|each| &each.sentence)
                .collect::<Vec<_>>()
        );
    });
}

type Change = fn(&mut AbsoluteReading, usize);

/// Drifts, backlash and an instrument's scale are told apart.
#[test]
fn other_patterns_are_told_apart() {
    let scenario = ur10();
    let belief = &scenario.task.belief;
    let cases: [(Change, Against); 3] = [
        (
            |reading, _| {
                let temperature = reading.temperature_c.expect("it is there");
                reading.position_m.x += 4e-5 * (temperature - 22.0);
            },
            Against::Course(Course::Temperature, Drifting::Base),
        ),
        (
            |reading, index| reading.position_m.z += if index < 60 { 0.0 } else { 1e-4 },
            Against::Course(Course::Order, Drifting::Base),
        ),
        (
            |reading, _| {
                let range = reading.position_m.norm();
                reading.position_m *= 1.0 + 1e-4 * (range - 2.0);
            },
            Against::Range,
        ),
    ];
    for (change, expected) in cases {
        let found = patterns(belief, &told(7, 120, &change));
        let first = &found.found[0];
        let is_it = first.against == expected
            || (expected, first.against)
                == (
                    Against::Course(Course::Order, Drifting::Base),
                    Against::Course(Course::Time, Drifting::Base),
                );
        assert!(is_it, "{expected:?}: {}", first.sentence);
    }
}

#[test]
fn the_command_names_and_draws_them() {
    let mut readings = plain(80, true);
    let place = workplace(&readings);
    let command = "identify s.toml --quiet --measurements m.csv --parameters frames";
    place.done(command).prints("No pattern in the residuals");
    let nothing = place.run(&format!("{command} --plot-out none.svg"));
    let said = "there are no patterns in the residuals to draw: none.svg is not written";
    assert!(nothing.ends_with(0).stdout.contains(said));
    assert!(!place.path("none.svg").exists());
    for (index, reading) in readings.iter_mut().enumerate() {
        reading.position_m.y += 1e-5 * index as f64;
    }
    place.write("m.csv", absolute_table(&6.into(), &readings));
    let found = place.run(&format!("{command} --plot-out p.svg")).stdout;
    assert_has(&found, "the order of the readings: the base shifts by 0.7");
    assert!(place.read("p.svg").contains("order"));
    crate::browser::plot_looks_well(&place.path("p.svg"));
    let json = place.run(&format!("{command} --json")).json();
    let first = &json["patterns"]["found"][0];
    assert_eq!(first["against"], "order");
    assert_eq!(first["drifting"], "base");
    let size = crate::support::number(&first["size"]);
    assert!((size / 7.9e-4 - 1.0).abs() < 0.1, "{size}");
}
