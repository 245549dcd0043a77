//! Two series, or the halves of one, that cannot both be right.

use std::cell::RefCell;

use elastocal::identification::{
    AbsoluteCase, AbsoluteFit, Inconsistencies, ParameterGroup, ReadingWeights,
};
use elastocal::measurement::{AbsoluteReading, absolute_table};
use elastocal::numeric::random::generator;
use elastocal::parameter::{ElasticArm, ParameterKind, ParameterSet};
use elastocal::scenario::Scenario;
use rayon::prelude::*;

use crate::model_selection::{read_of, read_where, read_within, waves};
use crate::one_fit::{between, normal, seen_arm, ur10, workplace};

const GROUPS: [ParameterGroup; 2] = [ParameterGroup::Zeros, ParameterGroup::Compliances];

fn softer(arm: &ElasticArm, joint: usize, factor: f64) -> ElasticArm {
    let mut arm = arm.clone();
    arm.compliance_rad_per_nm[joint] *= factor;
    arm
}

/// A series with its fit.
type Fitted<'a> = (AbsoluteCase<'a>, AbsoluteFit);

fn fitted<'a>(
    scenario: &'a Scenario,
    readings: &[AbsoluteReading],
    groups: &[ParameterGroup],
) -> Fitted<'a> {
    let mut case = AbsoluteCase::new(&scenario.task.belief, readings).expect("readings");
    let fit = case.fit(groups, ReadingWeights::AsNeeded).expect("a fit");
    (case, fit)
}

fn beside<'a>((one, fit): &mut Fitted<'a>, (other, other_fit): &mut Fitted<'a>) -> Inconsistencies {
    one.inconsistencies_with(fit, other, other_fit)
        .expect("fits, and blocks")
}

/// Series of one robot agree, discrepancy or not; with a compliance that is another one, a second joint that is twice as soft or an elbow that is six
/// times as soft, that one is named.
#[test]
fn series_contradict_each_other_where_the_robot_is_another() {
    const SERIES: u64 = 20;
    const OTHERS: u64 = 8;
    let others = [(1, 2.0), (2, 6.0)];
    let scenario = ur10();
    let found: Vec<(Inconsistencies, Vec<Inconsistencies>)> = (0..SERIES)
        .into_par_iter()
        .map(|seed| {
            let mut random = generator(41, seed);
            let arm = seen_arm(&mut random, &scenario, 1, 1);
            let gear = waves(&mut random);
            let one = read_of(&mut random, &arm, 120, 80.0, &gear);
            let same = read_of(&mut random, &arm, 120, 80.0, &gear);
            let mut one = fitted(&scenario, &one, &GROUPS);
            let others = others.iter().filter(|_| seed < OTHERS);
            let others = others.map(|&(joint, factor)| {
                let other = softer(&arm, joint, factor);
                let other = read_of(&mut random, &other, 120, 80.0, &gear);
                beside(&mut one, &mut fitted(&scenario, &other, &GROUPS))
            });
            let others = others.collect();
            (
                beside(&mut one, &mut fitted(&scenario, &same, &GROUPS)),
                others,
            )
        })
        .collect();
    let alarms = found
        .iter()
        .filter(|(same, _)| !same.found.is_empty())
        .count();
    // 0.2 are expected.
    assert!(alarms <= 1, "{alarms}");
    for (place, (joint, factor)) in others.into_iter().enumerate() {
        let kind = ParameterKind::JointCompliance { joint };
        let named = found.iter().filter(|(_, others)| {
            let first = others.get(place).and_then(|each| each.found.first());
            first.is_some_and(|first| first.kind == kind)
        });
        let named = named.count();
        println!("joint {} times {factor}: {named} of {OTHERS}", joint + 1);
        assert!(named >= 7, "joint {} times {factor}: {named}", joint + 1);
    }
}

/// The errors of its joints, up to 3 mrad, are one robot's in both series: at the same poses they cancel in the difference, at others they
/// are counted once. Robots that did not change are seldom said to have, one whose elbow's zero moved by 5 mrad is named, and
/// differences are as large as their standard errors say.
#[test]
fn a_zero_that_moved_between_series_is_found() {
    const ROBOTS: u64 = 200;
    const MOVED: u64 = 40;
    const ELBOW: ParameterKind = ParameterKind::JointZero { joint: 2 };
    let scenario = ur10();
    let found: Vec<(Inconsistencies, Option<Inconsistencies>)> = (0..ROBOTS)
        .into_par_iter()
        .map(|seed| {
            let mut random = generator(46, seed);
            let arm = seen_arm(&mut random, &scenario, 1, 1);
            let turn = ParameterSet::new(&arm, [(ELBOW, None)]).expect("a zero");
            let moved = turn.apply(&arm, &[5e-3]);
            let waves = waves(&mut random);
            // Joints return to within 0.03 mrad.
            let returns = RefCell::new(generator(47, seed));
            let gear = |joint: usize, angle: f64| {
                10.0 * waves(joint, angle) + 3e-5 * normal(&mut *returns.borrow_mut())
            };
            let one = read_of(&mut random, &arm, 40, 0.0, &gear);
            let mut again = |arm: &ElasticArm| {
                let poses = if seed % 2 == 0 {
                    let poses = |place: usize, _: &mut _| one[place].configuration_rad.clone();
                    read_where(&mut random, arm, (40, 0.0), poses, &gear)
                } else {
                    read_of(&mut random, arm, 40, 0.0, &gear)
                };
                fitted(&scenario, &poses, &GROUPS[..1])
            };
            let (mut same, mut other) = (again(&arm), (seed < MOVED).then(|| again(&moved)));
            let mut one = fitted(&scenario, &one, &GROUPS[..1]);
            let other = other.as_mut().map(|other| beside(&mut one, other));
            (beside(&mut one, &mut same), other)
        })
        .collect();
    let alarms = found.iter().filter(|(same, _)| !same.found.is_empty());
    let alarms = alarms.count();
    // Of the robots that are read at the same poses again, and of the others.
    let named = [0, 1].map(|side| {
        let own = found.iter().skip(side).step_by(2);
        let first = own.filter_map(|(_, other)| Some(other.as_ref()?.found.first()));
        let elbow = first.map(|first| first.filter(|first| first.kind == ELBOW));
        let all: Vec<f64> = elbow
            .map(|first| first.map_or(1.0, |first| first.probability))
            .collect();
        all
    });
    let squares = [0, 1].map(|side| {
        let own = found.iter().skip(side).step_by(2);
        let all: Vec<f64> = own.flat_map(|(same, _)| same.deviations.clone()).collect();
        all.iter().map(|each| each * each).sum::<f64>() / all.len() as f64
    });
    println!("{alarms} of {ROBOTS} alarms; squares {squares:?}; p of a moved zero {named:?}");
    // Two are expected, more than seven with p = 0.001.
    assert!(alarms <= 7, "{alarms}");
    // At the same poses joint errors cancel; at others one in ten may hide behind them, more than six of twenty with p = 0.002.
    assert!(named[0].iter().all(|p| *p < 1e-6), "{:?}", named[0]);
    let hidden = named[1].iter().filter(|p| **p >= 1e-2).count();
    assert!(hidden <= 6, "{:?}", named[1]);
    // One with a standard deviation of sqrt(2 / 100), were all parameters of a robot one.
    for square in squares {
        assert!(
            (0.25..1.0 + 3.0 * 0.02_f64.sqrt()).contains(&square),
            "{squares:?}"
        );
    }
}

/// Without a load no reading tells how soft the first joint, which is vertical, is: two series and the halves of each have that from one
/// prior. A difference that is all rounding is named and not compared.
#[test]
fn what_series_owe_to_one_prior_is_not_compared() {
    let mut random = generator(48, 0);
    let arm = seen_arm(&mut random, &ur10(), 1, 1);
    let gear = waves(&mut random);
    let [one, other] = [0, 1].map(|_| read_of(&mut random, &arm, 60, 0.0, &gear));
    let place = workplace(&one);
    place.write("other.csv", absolute_table(&6.into(), &other));
    let known = "\n[[uncertainty]]\nkind = \"compliance\"\njoints = [\"shoulder_pan\"]\nstd_relative = 0.2\n";
    let all = "parameters = [\"shoulder_pan\", ";
    let text = place.read("s.toml").replace("parameters = [", all) + known;
    place.write("s.toml", text);
    let identify = "identify s.toml --measurements m.csv --against other.csv --parameters zeros";
    let found = place.record(identify);
    let comparisons = crate::support::list(&found["inconsistencies"]);
    assert_eq!(comparisons.len(), 2, "{comparisons:?}");
    for each in comparisons {
        let names = crate::support::list(&each["not_comparable"]);
        assert_eq!(names, &["shoulder_pan.compliance"], "{each}");
        assert_eq!(each["found"].as_array().map(Vec::len), Some(0), "{each}");
    }
}

/// Positions alone, at the same poses again.
#[test]
fn positions_are_compared() {
    let mut random = generator(49, 0);
    let scenario = ur10();
    let arm = seen_arm(&mut random, &scenario, 1, 1);
    let gear = waves(&mut random);
    let mut one = read_of(&mut random, &arm, 60, 0.0, &gear);
    let poses = |place: usize, _: &mut _| one[place].configuration_rad.clone();
    let mut other = read_where(&mut random, &arm, (60, 0.0), poses, &gear);
    for reading in one.iter_mut().chain(&mut other) {
        reading.rotation = None;
    }
    let [mut one, mut other] = [one, other].map(|all| fitted(&scenario, &all, &GROUPS[..1]));
    let found = beside(&mut one, &mut other);
    assert!(found.compared > 3 && found.found.is_empty(), "{found:?}");
}

/// Gears that are not round once or twice a turn look like joints that give way to gravity, another way in each half of a series: no half
/// contradicts the other for it, and intervals hold the true compliances.
#[test]
fn slow_waves_of_gears_are_no_inconsistency() {
    const SERIES: u64 = 16;
    let scenario = ur10();
    let belief = &scenario.task.belief;
    let found: Vec<(bool, usize, usize)> = (0..SERIES)
        .into_par_iter()
        .map(|seed| {
            let mut random = generator(44, seed);
            let arm = seen_arm(&mut random, &scenario, 1, 1);
            let waves: Vec<[f64; 3]> = (0..6)
                .map(|joint| {
                    let turns = 1.0 + ((joint + seed) % 2) as f64;
                    let size = between(&mut random, 1e-4, 3e-4);
                    [
                        size,
                        turns,
                        between(&mut random, 0.0, std::f64::consts::TAU),
                    ]
                })
                .collect();
            let gear = |joint: usize, angle: f64| {
                let [size, turns, phase] = waves[joint];
                size * (turns * angle + phase).sin()
            };
            let all = read_of(&mut random, &arm, 120, 80.0, &gear);
            let mut case = AbsoluteCase::new(belief, &all).expect("readings");
            let fit = case.fit(&GROUPS, ReadingWeights::AsNeeded).expect("a fit");
            let compliances: Vec<bool> = fit
                .of_the_robot()
                .filter(|(_, each)| matches!(each.kind, ParameterKind::JointCompliance { .. }))
                .map(|(index, each)| {
                    let error = fit.posterior.standard_error(index).expect("determined");
                    let off = fit.posterior.mean[index] - each.nominal;
                    off.abs() < fit.reach95(index) * error
                })
                .collect();
            let held = compliances.iter().filter(|held| **held).count();
            let halves = case.kept(&fit).inconsistencies_of_halves(&fit);
            let alarm = !halves.expect("halves").1.found.is_empty();
            (alarm, held, compliances.len())
        })
        .collect();
    let alarms = found.iter().filter(|each| each.0).count();
    let held: usize = found.iter().map(|each| each.1).sum();
    let all: usize = found.iter().map(|each| each.2).sum();
    println!("{alarms} of {SERIES} contradict themselves; {held} of {all} compliances held");
    // 0.16 are expected; without regard for slow waves a third were.
    assert!(alarms <= 1, "{alarms}");
    // A robot's compliances hang together: with 95 % of each, fewer than 90 % of all by chance with a probability of a few per cent.
    assert!(all >= 90 && 10 * held >= 9 * all, "{held} of {all}");
}

/// Over a quarter of a turn slow waves of any size add up to next to nothing: intervals are as wide as errors are, and not as those
/// could be.
#[test]
fn intervals_over_a_part_of_a_turn_are_no_wider_than_errors() {
    const SERIES: u64 = 8;
    let scenario = ur10();
    let groups = [ParameterGroup::Geometry, ParameterGroup::Compliances];
    let found: Vec<(f64, usize)> = (0..SERIES)
        .into_par_iter()
        .map(|seed| {
            let mut random = generator(45, seed);
            let arm = seen_arm(&mut random, &scenario, 1, 1);
            let phases: Vec<f64> = (0..18)
                .map(|_| between(&mut random, 0.0, std::f64::consts::TAU))
                .collect();
            let gear = |joint: usize, angle: f64| {
                let waves = [6.0, 11.0, 20.0].into_iter().zip(&phases[3 * joint..]);
                waves
                    .map(|(turns, phase): (f64, &f64)| 1.5e-4 * (turns * angle + phase).sin())
                    .sum()
            };
            let all = read_within(&mut random, &arm, [0.3, 1.9], (300, 0.0), &gear);
            let mut case = AbsoluteCase::new(&scenario.task.belief, &all).expect("readings");
            let fit = case.fit(&groups, ReadingWeights::AsNeeded).expect("a fit");
            let of: Vec<f64> = fit
                .of_the_robot()
                .filter_map(|(index, each)| {
                    let error = fit.posterior.standard_error(index)?;
                    Some((fit.posterior.mean[index] - each.nominal) / error)
                })
                .collect();
            let squares: f64 = of.iter().map(|each| each * each).sum();
            (squares, of.len())
        })
        .collect();
    let squares: f64 = found.iter().map(|each| each.0).sum();
    let count: usize = found.iter().map(|each| each.1).sum();
    let deviations = (squares / count as f64).sqrt();
    println!("{deviations} standard errors, rms of {count}");
    assert!((0.5..1.5).contains(&deviations), "{deviations}");
}

/// The halves of one series: the elbow is softer where the shoulder is turned one way.
#[test]
fn halves_of_one_series_are_held_beside_each_other() {
    let scenario = ur10();
    let mut random = generator(42, 0);
    let arm = seen_arm(&mut random, &scenario, 1, 1);
    let all = read_of(&mut random, &arm, 160, 80.0, &|_, _| 0.0);
    let place = workplace(&all);
    let command = "identify s.toml --quiet --measurements m.csv --parameters zeros,compliances";
    let outcome = place.done(command);
    outcome.prints("none are inconsistent with each other");
    let json = place.run(&format!("{command} --json")).json();
    let halves = json["inconsistencies"][0].clone();
    assert!(
        halves["compared"].as_u64().expect("a number") >= 8,
        "{halves}"
    );

    // The readings of the one half come from another robot.
    let soft = softer(&arm, 2, 8.0);
    let mut random = generator(42, 0);
    seen_arm(&mut random, &scenario, 1, 1);
    let others = read_of(&mut random, &soft, 160, 80.0, &|_, _| 0.0);
    let words = halves["between"][0].as_str().expect("words");
    let joint = scenario.task.belief.nominal.chain.joints.iter();
    let joint = joint
        .map(|joint| joint.name.clone())
        .position(|name| words.contains(&format!("where {name} is")));
    let joint = joint.expect("a joint");
    let mut angles: Vec<f64> = all
        .iter()
        .map(|each| each.configuration_rad[joint])
        .collect();
    angles.sort_by(f64::total_cmp);
    let middle = angles[80];
    let mixed: Vec<AbsoluteReading> = (all.iter().zip(&others))
        .map(|(one, other)| {
            let is_low = one.configuration_rad[joint] < middle;
            (if is_low { one } else { other }).clone()
        })
        .collect();
    place.write("m.csv", absolute_table(&6.into(), &mixed));
    let outcome = place.doubted(command);
    outcome.says("condition C0213: inconsistency between series: elbow.compliance is");

    // The same as two files.
    place.write("m.csv", absolute_table(&6.into(), &all));
    place.write("n.csv", absolute_table(&6.into(), &others));
    let outcome = place.doubted(&format!("{command} --against n.csv"));
    let sentence = "condition C0213: inconsistency between series: elbow.compliance is";
    outcome.says(sentence);
    outcome.says("in n.csv");
    place
        .refused(&format!("{command} --against m.csv"))
        .says("holds the same readings as m.csv");
}

#[test]
fn what_cannot_be_held_against_is_refused() {
    let scenario = ur10();
    let mut random = generator(43, 0);
    let arm = seen_arm(&mut random, &scenario, 1, 1);
    let all = read_of(&mut random, &arm, 20, 0.0, &|_, _| 0.0);
    let place = workplace(&all);
    let command = "identify s.toml --quiet --measurements m.csv --parameters zeros --against n.csv";
    place.refused(command);
    place.write("n.csv", "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,dx_mm,dy_mm,dz_mm\n1,2,3,4,5,6,0,0,-98,0,0,0,0,0,-1\n");
    place.refused(command).says("a file of absolute readings");
    let few = read_of(&mut random, &arm, 6, 0.0, &|_, _| 0.0);
    place.write("n.csv", absolute_table(&6.into(), &few));
    let outcome = place.refused(command);
    outcome.says("8 different configurations are needed: 6");
}
