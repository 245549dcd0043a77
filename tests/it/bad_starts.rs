//! Absolute fits that begin far from the truth, or with little: those that converge go on to. One that ends better than is said may be
//! raised to that.

use elastocal::identification::{AbsoluteCase, AbsoluteFit, ParameterGroup, ReadingWeights};
use elastocal::measurement::AbsoluteReading;
use elastocal::numeric::random::generator;
use elastocal::parameter::{Axis, ElasticArm, ParameterKind, ParameterSet};
use elastocal::scenario::Scenario;
use nalgebra::{Unit, UnitQuaternion, Vector3};
use rayon::prelude::*;

use crate::model_selection::read_within;
use crate::one_fit::{Campaign, SIGMA_M, read, seen_arm, ur10};
use crate::support::{Workplace, project, scenario_text};

use ParameterGroup::{Compliances, Geometry, Zeros};

/// How a fit ends, from bad to good.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Outcome {
    /// It says that there is none.
    Fails,
    /// Readings are further off than their noise.
    Ends,
    /// Most readings are where the fit has them.
    Fits,
}

/// A robot with its readings, unlike what is believed of it.
#[derive(Clone, Copy)]
struct Start {
    name: &'static str,
    groups: &'static [ParameterGroup],
    stations: usize,
    targets: usize,
    readings: usize,
    is_pose: bool,
    force_n: f64,
    /// Between which angles all joints stand (rad); anywhere where there is none.
    within: Option<[f64; 2]>,
    /// What the scenario says besides.
    known: &'static str,
    change: fn(&mut ElasticArm),
    spoil: fn(usize, &mut AbsoluteReading),
    /// At least that.
    outcome: Outcome,
}

const PLAIN: Start = Start {
    name: "",
    groups: &[Geometry],
    stations: 1,
    targets: 1,
    readings: 40,
    is_pose: true,
    force_n: 0.0,
    within: None,
    known: "",
    change: |_| {},
    spoil: |_, _| {},
    outcome: Outcome::Fits,
};

/// A robot that is changed so.
fn changed(name: &'static str, change: fn(&mut ElasticArm)) -> Start {
    Start {
        name,
        change,
        ..PLAIN
    }
}

fn of_positions(start: Start) -> Start {
    Start {
        is_pose: false,
        ..start
    }
}

fn fails(start: Start) -> Start {
    Start {
        outcome: Outcome::Fails,
        ..start
    }
}

fn half_turn(axis: Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Unit::new_normalize(axis), std::f64::consts::PI)
}

fn turn_base(arm: &mut ElasticArm, axis: Vector3<f64>) {
    arm.instrument_from_base[0].rotation = half_turn(axis);
}

fn turn_target(arm: &mut ElasticArm, axis: Vector3<f64>) {
    arm.tools[0].link_from_tool.rotation = half_turn(axis);
}

/// Moves parameters of an arm by as much as is said.
fn change(arm: &mut ElasticArm, kinds: impl IntoIterator<Item = ParameterKind>, by: f64) {
    let set = ParameterSet::new(arm, kinds.into_iter().map(|kind| (kind, None)));
    let set = set.expect("parameters");
    let nominal = set.parameters().iter().map(|each| each.nominal + by);
    *arm = set.apply(arm, &nominal.collect::<Vec<f64>>());
}

fn zeros(arm: &mut ElasticArm, joints: &[usize], degrees: f64) {
    let kinds = joints
        .iter()
        .map(|&joint| ParameterKind::JointZero { joint });
    change(arm, kinds, degrees.to_radians());
}

fn soften(arm: &mut ElasticArm, factor: f64) {
    for compliance in &mut arm.compliance_rad_per_nm {
        *compliance *= factor;
    }
}

const GOOD_PRIORS: &str = r#"
[[uncertainty]]
kind = "joint_zero"
std_mrad = 0.0001

[[uncertainty]]
kind = "link_position"
std_mm = 0.0001

[[uncertainty]]
kind = "compliance"
std_relative = 0.0001
"#;

#[expect(clippy::too_many_lines, reason = "a list")]
fn starts() -> Vec<Start> {
    use Outcome::{Ends, Fails};
    let x = |arm: &mut ElasticArm| turn_base(arm, Vector3::x());
    let loaded = Start {
        groups: &[Zeros, Compliances],
        force_n: 80.0,
        ..PLAIN
    };
    vec![
        changed("base half a turn about x", x),
        changed("base half a turn about y", |arm| {
            turn_base(arm, Vector3::y());
        }),
        changed("base half a turn about z", |arm| {
            turn_base(arm, Vector3::z());
        }),
        changed("target half a turn about x", |arm| {
            turn_target(arm, Vector3::x());
        }),
        changed("target half a turn about y", |arm| {
            turn_target(arm, Vector3::y());
        }),
        changed("target half a turn askew", |arm| {
            turn_target(arm, Vector3::new(1.0, 1.0, 1.0));
        }),
        Start {
            name: "base and target half a turn",
            change: |arm| {
                turn_base(arm, Vector3::new(1.0, -1.0, 0.0));
                turn_target(arm, Vector3::z());
            },
            ..PLAIN
        },
        of_positions(changed("positions, base half a turn about x", x)),
        of_positions(changed("positions, base half a turn askew", |arm| {
            turn_base(arm, Vector3::new(1.0, 1.0, 1.0));
        })),
        fails(changed("second joint 90 deg off", |arm| {
            zeros(arm, &[1], 90.0);
        })),
        fails(changed("elbow 90 deg off", |arm| zeros(arm, &[2], 90.0))),
        changed("fourth joint 90 deg off", |arm| zeros(arm, &[3], 90.0)),
        changed("fifth joint 90 deg off", |arm| zeros(arm, &[4], 90.0)),
        fails(changed("elbow 180 deg off", |arm| zeros(arm, &[2], 180.0))),
        fails(changed("all joints 30 deg off", |arm| {
            zeros(arm, &[0, 1, 2, 3, 4, 5], 30.0);
        })),
        fails(changed("all joints 90 deg off", |arm| {
            zeros(arm, &[0, 1, 2, 3, 4, 5], 90.0);
        })),
        of_positions(changed("positions, elbow 30 deg off", |arm| {
            zeros(arm, &[2], 30.0);
        })),
        fails(of_positions(changed(
            "positions, elbow 90 deg off",
            |arm| zeros(arm, &[2], 90.0),
        ))),
        Start {
            name: "12 poses",
            readings: 12,
            ..PLAIN
        },
        Start {
            name: "12 poses, elbow 90 deg off",
            readings: 12,
            change: |arm| zeros(arm, &[2], 90.0),
            outcome: Fails,
            ..PLAIN
        },
        Start {
            name: "12 poses with loads",
            readings: 12,
            ..loaded
        },
        Start {
            name: "12 positions",
            groups: &[Zeros],
            readings: 12,
            is_pose: false,
            ..PLAIN
        },
        Start {
            name: "12 positions, wrist 20 deg off",
            groups: &[Zeros],
            readings: 12,
            is_pose: false,
            change: |arm| zeros(arm, &[3], 20.0),
            ..PLAIN
        },
        Start {
            name: "very good priors",
            groups: &[Geometry, Compliances],
            force_n: 80.0,
            known: GOOD_PRIORS,
            ..PLAIN
        },
        Start {
            name: "very good priors that are wrong",
            known: GOOD_PRIORS,
            change: |arm| zeros(arm, &[1, 2], 0.1),
            ..PLAIN
        },
        Start {
            name: "upper arm 0.3 m longer",
            change: |arm| {
                let axis = Axis::X;
                change(arm, [ParameterKind::LinkPosition { link: 2, axis }], 0.3);
            },
            ..PLAIN
        },
        Start {
            name: "ten times as soft",
            change: |arm| soften(arm, 10.0),
            ..loaded
        },
        Start {
            name: "a tenth as soft",
            change: |arm| soften(arm, 0.1),
            ..loaded
        },
        Start {
            name: "a hundred times as soft",
            change: |arm| soften(arm, 100.0),
            ..loaded
        },
        Start {
            name: "joints within 0.3 rad",
            within: Some([0.4, 0.7]),
            ..PLAIN
        },
        Start {
            name: "positions of two targets from three stations",
            stations: 3,
            targets: 2,
            is_pose: false,
            change: x,
            ..PLAIN
        },
        Start {
            name: "every fifth reading a metre off",
            spoil: |index, reading| {
                if index % 5 == 0 {
                    reading.position_m.y += 1.0;
                }
            },
            outcome: Ends,
            ..PLAIN
        },
        Start {
            name: "every fifth reading at the origin",
            readings: 60,
            spoil: |index, reading| {
                if index % 5 == 0 {
                    reading.position_m = Vector3::zeros();
                }
            },
            outcome: Fails,
            ..PLAIN
        },
    ]
}

fn fitted(scenario: &Scenario, start: &Start, seed: u64) -> Option<AbsoluteFit> {
    let mut random = generator(61, seed);
    let mut arm = seen_arm(&mut random, &ur10(), start.stations, start.targets);
    (start.change)(&mut arm);
    let mut readings = if let Some(range) = start.within {
        let size = (start.readings, start.force_n);
        read_within(&mut random, &arm, range, size, &|_, _| 0.0)
    } else {
        let campaign = Campaign::new(start.readings, start.is_pose, 1.0).under(start.force_n);
        read(&mut random, &arm, &campaign)
    };
    for (index, reading) in readings.iter_mut().enumerate() {
        (start.spoil)(index, reading);
    }
    let mut case = AbsoluteCase::new(&scenario.task.belief, &readings).ok()?;
    case.fit(start.groups, ReadingWeights::AsNeeded).ok()
}

fn outcome(start: &Start, seed: u64) -> Outcome {
    let place = Workplace::new();
    let model = project("models/ur10.xml").display().to_string();
    let text = scenario_text("ur10").replace("../models/ur10.xml", &model);
    place.write("s.toml", text + start.known);
    let scenario = place.scenario("s.toml");
    let Some(fit) = fitted(&scenario, start, seed) else {
        return Outcome::Fails;
    };
    let mut off: Vec<f64> = fit.left.iter().map(|each| each.position_m.norm()).collect();
    off.sort_by(f64::total_cmp);
    // The median distance of three normal errors is 1.5 of their standard deviation.
    if off[off.len() / 2] < 3.0 * SIGMA_M {
        Outcome::Fits
    } else {
        Outcome::Ends
    }
}

/// Fits from far away end as well as they ever did.
#[test]
fn fits_from_bad_starts_converge() {
    let starts = starts();
    let found: Vec<Outcome> = (starts.par_iter().enumerate())
        .map(|(seed, start)| outcome(start, seed as u64))
        .collect();
    for (start, found) in starts.iter().zip(&found) {
        println!("{}: {found:?}", start.name);
    }
    let worse: Vec<_> = (starts.iter().zip(&found))
        .filter(|(start, found)| **found < start.outcome)
        .map(|(start, found)| (start.name, start.outcome, found))
        .collect();
    assert!(worse.is_empty(), "{worse:?}");
}
