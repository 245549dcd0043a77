//! One fit of frames, geometry and elasticity to absolute readings.

use elastocal::identification::{AbsoluteCase, AbsoluteFit, ParameterGroup, ReadingWeights};
use elastocal::measurement::{AbsoluteReading, absolute_table};
use elastocal::numeric::random::generator;
use elastocal::observation::{Hook, ObservationModel, ReadingKind, Setup};
use elastocal::parameter::{Axis, ElasticArm, ParameterKind, ParameterSet};
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use nalgebra::{
    DVector, Isometry3, Matrix6, Matrix6xX, Rotation3, UnitQuaternion, Vector3, Vector6,
};
use rand::{Rng, RngExt};
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::support::{
    Outcome, Workplace, blank_reading, force, list, number, project, scenario, setup,
    ur10_under_any_load,
};

pub const SIGMA_M: f64 = 1.5e-5;
pub const SIGMA_RAD: f64 = 2e-5;

pub fn between(random: &mut impl Rng, low: f64, high: f64) -> f64 {
    random.random_range(low..=high)
}

pub fn vector(random: &mut impl Rng, size: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| between(random, -size, size))
}

pub fn normal(random: &mut impl Rng) -> f64 {
    let radius = (-2.0 * (1.0 - between(random, 0.0, 0.999_999_999)).ln()).sqrt();
    radius * between(random, 0.0, std::f64::consts::TAU).cos()
}

pub fn anywhere(random: &mut impl Rng, size_m: f64) -> Isometry3<f64> {
    Isometry3::new(vector(random, size_m), vector(random, 3.0))
}

/// What is read of an arm: which configurations, from which stations, of which of its tools.
pub struct Campaign {
    pub readings: usize,
    pub is_pose: bool,
    pub noise: f64,
    pub force_n: f64,
}

impl Campaign {
    /// Of so many readings without a load, with so many times the instrument's noise.
    pub const fn new(readings: usize, is_pose: bool, noise: f64) -> Self {
        Self {
            readings,
            is_pose,
            noise,
            force_n: 0.0,
        }
    }

    pub const fn poses(readings: usize, noise: f64) -> Self {
        Self::new(readings, true, noise)
    }

    pub const fn positions(readings: usize, noise: f64) -> Self {
        Self::new(readings, false, noise)
    }

    /// Under forces of up to that size.
    pub const fn under(self, force_n: f64) -> Self {
        Self { force_n, ..self }
    }
}

/// Readings of an arm by a random campaign.
pub fn read(random: &mut impl Rng, arm: &ElasticArm, campaign: &Campaign) -> Vec<AbsoluteReading> {
    let nothing = ParameterSet::empty();
    let mut model = ObservationModel::new(&nothing, arm, &[]);
    let mut ignored = Matrix6xX::zeros(0);
    let stations = arm.instrument_from_base.len();
    let variances = [SIGMA_M, SIGMA_RAD].map(|sigma| sigma * sigma);
    let covariance = Matrix6::from_diagonal(&Vector6::from_fn(|row, _| variances[row / 3]));
    (0..campaign.readings)
        .map(|index| {
            let target = (index / stations) % arm.tools.len();
            let setup = Setup {
                // Loads hang on the calibration tool.
                hangs_on: (target > 0).then_some(Hook::Tool(0)),
                commanded_rad: DVector::from_fn(arm.chain.len(), |_, _| between(random, -2.6, 2.6)),
                load: force(vector(random, campaign.force_n)),
                target,
                station: index % stations,
                approach: None,
            };
            let seen = model
                .predict(&setup, ReadingKind::Pose, &mut ignored)
                .expect("stable");
            let mut error =
                |size: f64| Vector3::from_fn(|_, _| normal(random) * size * campaign.noise);
            let position_m = seen.position_m + error(SIGMA_M);
            let turn = Rotation3::from_scaled_axis(error(SIGMA_RAD));
            let rotation = turn * Rotation3::from_matrix_unchecked(seen.rotation);
            AbsoluteReading {
                configuration_rad: setup.commanded_rad,
                load: setup.load,
                target: Some(arm.tools[setup.target].name.clone()),
                station: (stations > 1).then(|| format!("S{}", setup.station)),
                position_m,
                rotation: campaign
                    .is_pose
                    .then(|| UnitQuaternion::from_rotation_matrix(&rotation)),
                covariance: Some(covariance),
                ..blank_reading()
            }
        })
        .collect()
}

pub fn ur10() -> Scenario {
    scenario("ur10")
}

/// The scenario's arm with one reflector, seen from so many stations somewhere.
pub fn seen_arm(
    random: &mut impl Rng,
    scenario: &Scenario,
    stations: usize,
    targets: usize,
) -> ElasticArm {
    let belief = &scenario.task.belief;
    let mut arm = belief.arm();
    arm.tools.truncate(targets);
    for tool in &mut arm.tools {
        tool.link_from_tool = anywhere(random, 0.2);
    }
    arm.instrument_from_base = (0..stations).map(|_| anywhere(random, 4.0)).collect();
    arm
}

/// What a fit leaves out cannot be told: with everything else of its set somewhere, an arm to read.
pub fn changed(
    random: &mut impl Rng,
    fit: &AbsoluteFit,
    nominal: &ElasticArm,
) -> (Vec<f64>, ElasticArm) {
    let values: Vec<f64> = (fit.set.parameters().iter())
        .map(|each| match each.kind {
            kind if kind.is_mounted() => 0.0,
            ParameterKind::JointCompliance { .. } => each.nominal * between(random, 0.7, 1.3),
            _ => each.nominal + each.scale * between(random, -2.0, 2.0),
        })
        .collect();
    let arm = fit.set.apply(nominal, &values);
    (values, arm)
}

/// The largest of errors, whatever its sign.
fn worst_of(errors: &[f64]) -> f64 {
    errors.iter().fold(0.0, |most, each| each.abs().max(most))
}

/// How far off each value of a fit is, in standard errors.
pub fn errors(fit: &AbsoluteFit, values: &[f64], truth: &ElasticArm) -> Vec<f64> {
    let off = |reference: &Isometry3<f64>, truth: &Isometry3<f64>, axis: Axis, is_turn: bool| {
        let off = reference.inverse() * truth;
        let vector = if is_turn {
            off.rotation.scaled_axis()
        } else {
            off.translation.vector
        };
        vector[axis as usize]
    };
    let base = |station: usize| {
        (
            &fit.reference.instrument_from_base[station],
            &truth.instrument_from_base[station],
        )
    };
    let tool = |tool: usize| {
        (
            &fit.reference.tools[tool].link_from_tool,
            &truth.tools[tool].link_from_tool,
        )
    };
    (fit.set.parameters().iter().enumerate())
        .map(|(index, parameter)| {
            let expected = match parameter.kind {
                ParameterKind::BasePosition { station, axis } => {
                    off(base(station).0, base(station).1, axis, false)
                }
                ParameterKind::BaseRotation { station, axis } => {
                    off(base(station).0, base(station).1, axis, true)
                }
                ParameterKind::ToolPosition { tool: which, axis } => {
                    off(tool(which).0, tool(which).1, axis, false)
                }
                ParameterKind::ToolRotation { tool: which, axis } => {
                    off(tool(which).0, tool(which).1, axis, true)
                }
                _ => values[index],
            };
            let error = fit.posterior.standard_error(index).expect("determined");
            (fit.posterior.mean[index] - expected) / error
        })
        .collect()
}

const GEOMETRY: [ParameterGroup; 1] = [ParameterGroup::Geometry];

/// Exact readings give back stations and targets that are anywhere, and the geometry; without a guess.
#[test]
fn frames_and_geometry_come_back_without_a_guess() {
    let scenario = ur10();
    let belief = &scenario.task.belief;
    for (case, (stations, targets, is_pose)) in
        [(1, 1, true), (2, 2, true), (3, 1, false), (1, 2, false)]
            .into_iter()
            .enumerate()
    {
        let mut random = generator(5, case as u64);
        let nominal = seen_arm(&mut random, &scenario, stations, targets);
        let campaign = Campaign::new(120, is_pose, 0.0);
        let dry = read(&mut random, &nominal, &campaign);
        let fit = AbsoluteCase::new(belief, &dry)
            .and_then(|mut case| case.fit(&GEOMETRY, ReadingWeights::AsNeeded));
        let fit = fit.expect("a fit");
        let (values, truth) = changed(&mut random, &fit, &nominal);
        let readings = read(&mut random, &truth, &campaign);
        let fit = AbsoluteCase::new(belief, &readings)
            .and_then(|mut case| case.fit(&GEOMETRY, ReadingWeights::AsNeeded));
        let fit = fit.expect("a fit");
        assert!(fit.undetermined.is_empty(), "{:#?}", fit.undetermined);
        // 4 for each joint, 6 of each further station and target; how a target is turned shows in poses alone.
        let of_frames = if is_pose {
            6 * (stations + targets)
        } else {
            6 * stations + 3 * targets
        };
        let expected = if is_pose { 18 } else { 17 } + of_frames;
        assert!(
            fit.set.len() >= expected - 1 && fit.set.len() <= expected + 1,
            "{}",
            fit.set.len()
        );
        let worst = worst_of(&errors(&fit, &values, &truth));
        assert!(worst < 1e-3, "case {case}: {worst} standard errors");
    }
}

/// A load acts where the calibration tool is found, on all targets: exact readings of two give back where both are, far from where
/// the model has them, and the compliances.
#[test]
fn loads_act_where_the_calibration_tool_is_found() {
    let scenario = ur10();
    let belief = &scenario.task.belief;
    let mut random = generator(9, 0);
    let nominal = seen_arm(&mut random, &scenario, 1, 2);
    let campaign = Campaign::positions(80, 0.0).under(60.0);
    let fitted = |readings: &[AbsoluteReading]| {
        let fit = AbsoluteCase::new(belief, readings)
            .and_then(|mut case| case.fit(&[ParameterGroup::Compliances], ReadingWeights::Own));
        fit.expect("a fit")
    };
    let dry = fitted(&read(&mut random, &nominal, &campaign));
    let (values, truth) = changed(&mut random, &dry, &nominal);
    let fit = fitted(&read(&mut random, &truth, &campaign));
    assert!(fit.undetermined.is_empty(), "{:#?}", fit.undetermined);
    let worst = worst_of(&errors(&fit, &values, &truth));
    assert!(worst < 1e-3, "{worst} standard errors");
}

/// 500 laboratories read 40 poses each: every parameter's interval of 95 % holds the truth in 91.5 to 98.5 % of them
/// (a binomial deviation is 0.97 %), on average in 94 to 96 %.
#[test]
fn intervals_hold_the_truth_as_often_as_they_say() {
    const RUNS: u64 = 500;
    let scenario = ur10();
    let belief = &scenario.task.belief;
    let groups = [ParameterGroup::Geometry, ParameterGroup::Compliances];
    let mut random = generator(7, 0);
    let nominal = seen_arm(&mut random, &scenario, 1, 1);
    let campaign = Campaign::poses(40, 1.0).under(60.0);
    let fitted = |readings: &[AbsoluteReading]| {
        let mut case = AbsoluteCase::new(belief, readings)?;
        case.fit(&groups, ReadingWeights::Own)
    };
    let dry = fitted(&read(&mut random, &nominal, &campaign)).expect("a fit");
    let (values, truth) = changed(&mut random, &dry, &nominal);
    let names: Vec<&str> = (dry.set.parameters().iter())
        .map(|each| each.name.as_str())
        .collect();
    let runs: Vec<Vec<bool>> = (0..RUNS)
        .into_par_iter()
        .map(|run| {
            let readings = read(&mut generator(8, run), &truth, &campaign);
            let fit = fitted(&readings).expect("a fit");
            assert_eq!(fit.set.len(), names.len());
            (errors(&fit, &values, &truth).iter())
                .map(|error| error.abs() < 1.959_964)
                .collect()
        })
        .collect();
    let shares: Vec<f64> = (0..names.len())
        .map(|index| runs.iter().filter(|held| held[index]).count() as f64 / RUNS as f64)
        .collect();
    for (share, name) in shares.iter().zip(&names) {
        assert!((0.915..=0.985).contains(share), "{name}: {share}");
    }
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    println!(
        "{} parameters, on average {:.2} %",
        names.len(),
        100.0 * mean
    );
    assert!((0.94..=0.96).contains(&mean), "{mean}");
}

pub fn workplace(readings: &[AbsoluteReading]) -> Workplace {
    let place = Workplace::new();
    let model = project("models/ur10.xml");
    let text = ur10_under_any_load().replace("../models/ur10.xml", &model.display().to_string());
    place.write("s.toml", text);
    place.write("m.csv", absolute_table(&6.into(), readings));
    place
}

fn identify(place: &Workplace, more: &str) -> Outcome {
    place.run(&format!(
        "identify s.toml --quiet --measurements m.csv {more}"
    ))
}

/// A campaign of the UR10 as its scenario has it, poses from one station.
pub fn plain(readings: usize, is_pose: bool) -> Vec<AbsoluteReading> {
    let mut random = generator(11, 0);
    let arm = seen_arm(&mut random, &ur10(), 1, 1);
    read(&mut random, &arm, &Campaign::new(readings, is_pose, 1.0))
}

#[test]
fn the_command_tells_frames_parameters_and_what_is_left() {
    let place = workplace(&plain(60, true));
    let outcome = identify(&place, "--parameters geometry --identified-out i.json").ends_with(0);
    for words in [
        "base at station",
        "target reflector",
        "elbow.zero",
        "Redundant, not fitted",
        "distance [mm]",
        "wrote i.json",
    ] {
        outcome.prints(words);
    }
    let json = identify(&place, "--parameters geometry --json").json();
    assert_eq!(json["kind"], "absolute");
    assert_eq!(list(&json["unknowns"]).len(), 30);
    assert_eq!(list(&json["covariance"]).len(), 30);
    assert!(number(&json["distance_mm"]["mean"]) < 0.04);
    // The same on any threads, to the bit.
    for threads in [1, 2, 3] {
        let other = identify(
            &place,
            &format!("--parameters geometry --json --threads {threads}"),
        )
        .json();
        assert_eq!(json, other);
    }
    // What the scenario names, when no group is given.
    let json = identify(&place, "--json").json();
    let names: Vec<&str> = (list(&json["unknowns"]).iter())
        .filter_map(|each| each["name"].as_str())
        .collect();
    assert!(
        names.contains(&"elbow.compliance") && !names.contains(&"elbow.zero"),
        "{names:?}"
    );
    // What was fitted stands for other readings.
    place.forget_readings("i.json");
    let checked = place.record("validate --identified i.json --measurements m.csv");
    let one = number(&checked["distance_mm"]["mean"]);
    let json = identify(&place, "--parameters geometry --json").json();
    let other = number(&json["distance_mm"]["mean"]);
    assert!((one - other).abs() < 1e-9, "{one} {other}");
}

/// What a scenario lists as new at each visit counts in standard errors while residuals are plausible without it; a discrepancy that they show
/// consists of it.
#[test]
fn what_is_new_at_each_visit_counts_unless_the_residuals_show_it() {
    let place = workplace(&plain(30, true));
    let alone = identify(&place, "--json").json();
    assert_eq!(alone["not_counted"], json!([]));
    let listed =
        "[[uncertainty]]\nkind = \"joint_repeatability\"\nname = \"gears\"\nstd_mrad = 0.05\n";
    place.write("s.toml", place.read("s.toml") + "\n" + listed);
    let counted = identify(&place, "--json").json();
    assert_eq!(counted["not_counted"], json!([]));
    let error = |json: &Value| number(&json["unknowns"][0]["standard_error"]);
    assert!(error(&counted) > 1.5 * error(&alone), "{counted}");
    let mut random = generator(12, 0);
    let arm = seen_arm(&mut random, &ur10(), 1, 1);
    let campaign = Campaign::poses(30, 6.0);
    let large = read(&mut random, &arm, &campaign);
    place.write("m.csv", absolute_table(&6.into(), &large));
    let shown = identify(&place, "--json").json();
    assert_eq!(shown["not_counted"], json!(["gears"]), "{shown}");
    let outcome = identify(&place, "");
    let words = "Not counted but as part of what the residuals show: gears";
    outcome.prints(words);
}

/// Where the tracker was moved, its frame is found anew; the robot is the same.
#[test]
fn other_readings_from_another_station_are_validated() {
    let mut random = generator(12, 0);
    let scenario = ur10();
    let mut arm = seen_arm(&mut random, &scenario, 1, 1);
    let campaign = Campaign::poses(60, 1.0);
    let place = workplace(&read(&mut random, &arm, &campaign));
    identify(&place, "--parameters geometry --identified-out i.json").ends_with(0);
    arm.instrument_from_base[0] = anywhere(&mut random, 5.0);
    let mut moved = read(&mut random, &arm, &campaign);
    place.write("other.csv", absolute_table(&6.into(), &moved));
    let validate = |place: &Workplace| {
        place.run("validate --quiet --identified i.json --measurements other.csv --json")
    };
    // Nothing says that it was moved.
    let wrong = validate(&place).json();
    assert!(number(&wrong["distance_mm"]["mean"]) > 100.0);
    for reading in &mut moved {
        reading.station = Some("after lunch".to_owned());
    }
    place.write("other.csv", absolute_table(&6.into(), &moved));
    let json = validate(&place).json();
    assert_eq!(json["frames_anew"][0], "after lunch");
    let mean = number(&json["distance_mm"]["mean"]);
    assert!((0.01..0.05).contains(&mean), "{mean}");
}

/// Readings in which the first joint alone moves: the target goes round in a circle.
fn one_joint_moves() -> Vec<AbsoluteReading> {
    let mut random = generator(13, 0);
    let arm = seen_arm(&mut random, &ur10(), 1, 1);
    let campaign = Campaign::positions(30, 0.0);
    let mut readings = read(&mut random, &arm, &campaign);
    let nothing = ParameterSet::empty();
    let mut model = ObservationModel::new(&nothing, &arm, &[]);
    for (index, reading) in readings.iter_mut().enumerate() {
        let commanded_rad =
            DVector::from_vec(vec![0.2 * index as f64 - 2.0, -1.0, 1.0, 0.3, 0.4, 0.5]);
        let setup = setup(commanded_rad, Load::NONE, 0);
        let mut ignored = Matrix6xX::zeros(0);
        let seen = model
            .predict(&setup, ReadingKind::Position, &mut ignored)
            .expect("stable");
        reading.configuration_rad = setup.commanded_rad;
        reading.position_m = seen.position_m;
    }
    readings
}

/// Readings that cannot tell frames, or cannot be: one error that says what is missing.
#[test]
fn what_frames_need_is_told() {
    let all = plain(30, false);
    let changed = |change: &dyn Fn(usize, &mut AbsoluteReading)| {
        let mut readings = all.clone();
        for (index, reading) in readings.iter_mut().enumerate() {
            change(index, reading);
        }
        readings
    };
    let first = all[0].clone();
    for (readings, expected) in [
        (
            all[..2].to_vec(),
            "6 numbers were read, and the frames of stations and targets alone have 9 unknowns",
        ),
        (
            changed(&|_, each| *each = first.clone()),
            "the readings do not determine base and targets (reflector)",
        ),
        (
            one_joint_moves(),
            "the readings do not determine base and targets (reflector)",
        ),
        (
            changed(&|_, each| each.position_m *= 1e-3),
            "metres or inches in a column of millimetres",
        ),
        (
            changed(&|_, each| each.position_m *= 25.4),
            "metres or inches in a column of millimetres",
        ),
        (
            changed(&|_, each| each.configuration_rad *= 0.017),
            "are the angles in radians instead of degrees?",
        ),
        (
            changed(&|_, each| each.configuration_rad.swap_rows(1, 3)),
            "Swap q2_deg and q4_deg",
        ),
        (
            changed(&|_, each| each.target = Some("cat".to_owned())),
            "reading 1: target: ",
        ),
    ] {
        let place = workplace(&readings);
        identify(&place, "--parameters frames")
            .ends_with(1)
            .says(expected);
    }
}

/// Readings that are just enough leave nothing by which they could be wrong, and that is said.
#[test]
fn that_nothing_is_left_over_is_said() {
    let of = |readings: usize| {
        let place = workplace(&plain(readings, false));
        identify(&place, "--parameters frames").ends_with(0).stdout
    };
    let words = "there are no residuals that could show an error";
    assert!(of(3).contains(words), "{}", of(3));
    assert!(!of(4).contains(words), "{}", of(4));
}

/// What is asked for and cannot be done with such a file.
#[test]
fn options_that_do_not_fit_are_refused() {
    let mut poses = plain(20, true);
    for pose in &mut poses {
        pose.covariance = None;
    }
    identify(&workplace(&poses), "--parameters frames")
        .ends_with(1)
        .says("nothing says how precise the orientations are");
    let place = workplace(&plain(10, false));
    identify(&place, "--method linear")
        .ends_with(1)
        .says("--method linear is for deflections");
    place.write("m.csv", "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,dx_mm,dy_mm,dz_mm\n1,2,3,4,5,6,0,0,-98,0,0,0,0,0,-1\n");
    identify(&place, "--parameters frames")
        .ends_with(1)
        .says("leave out --parameters");
}

/// What no configuration of a planar arm shows is named, and no error.
#[test]
fn a_planar_arm_has_freedoms_of_its_own() {
    let scenario = scenario("planar_3r");
    let mut random = generator(14, 0);
    let arm = seen_arm(&mut random, &scenario, 1, 1);
    let readings = read(&mut random, &arm, &Campaign::positions(40, 1.0));
    let mut case = AbsoluteCase::new(&scenario.task.belief, &readings).expect("readings");
    let fit = case
        .fit(&[ParameterGroup::Zeros], ReadingWeights::AsNeeded)
        .expect("a fit");
    let left_out: Vec<&str> = fit.left_out.iter().map(|each| each.name.as_str()).collect();
    assert!(left_out.contains(&"tool.y"), "{left_out:?}");
    let largest = fit
        .left
        .iter()
        .map(|each| each.position_m.norm())
        .fold(0.0, f64::max);
    assert!(largest < 10.0 * SIGMA_M, "{largest}");
}

/// A file that somebody wrote into, or of another robot, is told with the place.
#[test]
fn wrong_robots_are_told_in_words() {
    let place = workplace(&plain(30, true));
    identify(&place, "--parameters zeros --identified-out i.json").ends_with(0);
    let text = place.read("i.json");
    let validate = |more: &str| {
        place.refused(&format!(
            "validate s.toml --quiet --identified w.json {more}"
        ))
    };
    for (from, to, expected) in [
        ("\"elbow.zero\"", "\"knee.zero\"", "w.json: unknowns["),
        (
            "\"robot_sha256\": \"",
            "\"robot_sha256\": \"0",
            "identified_with.robot_sha256: was identified with another robot",
        ),
        (
            "\"covariance\"",
            "\"covarience\"",
            "missing field `covariance`",
        ),
    ] {
        assert!(text.contains(from), "{from}");
        place.write("w.json", text.replacen(from, to, 1));
        validate("--measurements m.csv").says(expected);
    }
    place.write("w.json", &text);
    validate("").says("for which no plan is made");
}

/// Each stand of the robot is off by 0.3 mm, unloaded and loaded the same: readings of one visit tell compliances as their
/// differences do, and the standard errors are right.
#[test]
fn readings_of_one_visit_share_what_the_model_does_not_know() {
    const RUNS: u64 = 60;
    let scenario = ur10();
    let mut random = generator(15, 0);
    let arm = seen_arm(&mut random, &scenario, 1, 1);
    let campaign = Campaign::positions(60, 1.0);
    let forces = [0.0, -100.0, 100.0];
    let run = |seed: u64, has_visits: bool| {
        let mut random = generator(16, seed);
        let stands = read(&mut random, &arm, &campaign);
        let nothing = ParameterSet::empty();
        let mut model = ObservationModel::new(&nothing, &arm, &[]);
        let mut readings = Vec::new();
        for (stand, reading) in stands.iter().enumerate() {
            let off = Vector3::from_fn(|_, _| 3e-4 * normal(&mut random));
            let direction = vector(&mut random, 1.0).normalize();
            for size in forces {
                let load = force(direction * size);
                let commanded_rad = reading.configuration_rad.clone();
                let setup = setup(commanded_rad, load, 0);
                let mut ignored = Matrix6xX::zeros(0);
                let seen = model
                    .predict(&setup, ReadingKind::Position, &mut ignored)
                    .expect("stable");
                let error = Vector3::from_fn(|_, _| SIGMA_M * normal(&mut random));
                readings.push(AbsoluteReading {
                    load,
                    visit: has_visits.then(|| format!("stand {stand}")),
                    position_m: seen.position_m + off + error,
                    ..reading.clone()
                });
            }
        }
        let mut case = AbsoluteCase::new(&scenario.task.belief, &readings).expect("readings");
        let fit = case
            .fit(&[ParameterGroup::Compliances], ReadingWeights::AsNeeded)
            .expect("a fit");
        assert!((fit.discrepancy.expect("residuals are too large")[0] / 3e-4 - 1.0).abs() < 0.3);
        let elbow = ParameterKind::JointCompliance { joint: 2 };
        let index = fit.set.index_of(elbow).expect("fitted");
        let error = fit.standard_error(index).expect("determined");
        (
            (fit.quantity(index) - arm.compliance_rad_per_nm[2]) / error,
            error,
        )
    };
    let (_, without) = run(0, false);
    let all: Vec<(f64, f64)> = (0..RUNS)
        .into_par_iter()
        .map(|seed| run(seed, true))
        .collect();
    let with = all[0].1;
    assert!(with < 0.15 * without, "{with} {without}");
    let square = all.iter().map(|(off, _)| off * off).sum::<f64>() / RUNS as f64;
    // A deviation of 0.18.
    assert!((square - 1.0).abs() < 0.6, "{square}");
}
