//! Models with more and more parameters, compared by blocks of joint space.

use elastocal::identification::{AbsoluteCase, ModelSelection, ParameterGroup, ReadingWeights};
use elastocal::measurement::AbsoluteReading;
use elastocal::numeric::random::generator;
use elastocal::observation::{ObservationModel, ReadingKind};
use elastocal::parameter::{ElasticArm, ParameterKind, ParameterSet};
use elastocal::task::Belief;
use nalgebra::{DVector, Matrix6, Matrix6xX, Rotation3, UnitQuaternion, Vector3, Vector6};
use rand::Rng;
use rayon::prelude::*;

use crate::one_fit::{
    SIGMA_M, SIGMA_RAD, between, normal, plain, seen_arm, ur10, vector, workplace,
};

use crate::support::{blank_reading, force, setup};

/// A joint's angle error (rad) at an angle (rad): what no parameter of the model is.
pub type Gear<'a> = &'a dyn Fn(usize, f64) -> f64;

/// Poses of an arm whose joints turn by a little more than they are told.
pub fn read_of(
    random: &mut impl Rng,
    arm: &ElasticArm,
    readings: usize,
    force_n: f64,
    gear: Gear<'_>,
) -> Vec<AbsoluteReading> {
    read_within(random, arm, [-2.6, 2.6], (readings, force_n), gear)
}

/// The same where all joints stand between two angles.
pub fn read_within(
    random: &mut impl Rng,
    arm: &ElasticArm,
    [low, high]: [f64; 2],
    size: (usize, f64),
    gear: Gear<'_>,
) -> Vec<AbsoluteReading> {
    let joints = arm.chain.len();
    let told = |_, random: &mut _| DVector::from_fn(joints, |_, _| between(random, low, high));
    read_where(random, arm, size, told, gear)
}

/// The same where joints stand at these angles (rad).
pub fn read_where<R: Rng>(
    random: &mut R,
    arm: &ElasticArm,
    (readings, force_n): (usize, f64),
    mut told: impl FnMut(usize, &mut R) -> DVector<f64>,
    gear: Gear<'_>,
) -> Vec<AbsoluteReading> {
    let nothing = ParameterSet::empty();
    let mut model = ObservationModel::new(&nothing, arm, &[]);
    let mut ignored = Matrix6xX::zeros(0);
    let variances = [SIGMA_M, SIGMA_RAD].map(|sigma| sigma * sigma);
    let covariance = Matrix6::from_diagonal(&Vector6::from_fn(|row, _| variances[row / 3]));
    (0..readings)
        .map(|reading| {
            let told = told(reading, random);
            let setup = setup(
                DVector::from_fn(told.len(), |joint, _| {
                    told[joint] + gear(joint, told[joint])
                }),
                force(vector(random, force_n)),
                0,
            );
            let seen = model
                .predict(&setup, ReadingKind::Pose, &mut ignored)
                .expect("stable");
            let mut error = |size: f64| Vector3::from_fn(|_, _| normal(random) * size);
            let position_m = seen.position_m + error(SIGMA_M);
            let turn = Rotation3::from_scaled_axis(error(SIGMA_RAD));
            let rotation = turn * Rotation3::from_matrix_unchecked(seen.rotation);
            AbsoluteReading {
                configuration_rad: told,
                load: setup.load,
                position_m,
                rotation: Some(UnitQuaternion::from_rotation_matrix(&rotation)),
                covariance: Some(covariance),
                ..blank_reading()
            }
        })
        .collect()
}

fn model_selection(belief: &Belief, readings: &[AbsoluteReading]) -> ModelSelection {
    AbsoluteCase::new(belief, readings)
        .and_then(|mut case| case.model_selection(ReadingWeights::AsNeeded))
        .expect("a model_selection")
}

/// Angle errors of every joint that come round three to five times, of up to 0.3 mrad.
pub fn waves(random: &mut impl Rng) -> Box<dyn Fn(usize, f64) -> f64> {
    let all: Vec<[f64; 3]> = (0..6)
        .map(|joint| {
            let size = between(random, 1e-4, 3e-4);
            [size, 3.0 + f64::from(joint % 3), between(random, 0.0, 6.0)]
        })
        .collect();
    Box::new(move |joint, angle| all[joint][0] * (all[joint][1] * angle + all[joint][2]).sin())
}

/// An arm with zeros, and where it is asked for compliances, that are not the nominal ones.
pub fn other_arm(random: &mut impl Rng, nominal: &ElasticArm, softer: f64) -> ElasticArm {
    let zeros = (1..5).map(|joint| (ParameterKind::JointZero { joint }, None));
    let set = ParameterSet::new(nominal, zeros).expect("parameters");
    let values: Vec<f64> = (0..set.len())
        .map(|_| 1e-3 * between(random, 1.5, 3.0))
        .collect();
    let mut arm = set.apply(nominal, &values);
    for compliance in &mut arm.compliance_rad_per_nm {
        *compliance *= softer;
    }
    arm
}

/// The model selection finds what was put in, and no more, over robots whose gears are not round.
#[test]
fn what_was_put_in_is_recommended() {
    let scenario = ur10();
    let belief = &scenario.task.belief;
    let chosen = |seed: u64, softer: f64, force_n: f64| {
        let mut random = generator(22, seed);
        let nominal = seen_arm(&mut random, &scenario, 1, 1);
        let arm = other_arm(&mut random, &nominal, softer);
        let gear = waves(&mut random);
        let model_selection =
            model_selection(belief, &read_of(&mut random, &arm, 150, force_n, &gear));
        // Gears that are not round come again in other blocks.
        let with = model_selection.with_joint_errors.as_ref();
        let judged = with.and_then(|with| with.cross_validation.as_ref().ok());
        let apart = judged.map(|judged| judged.beyond_best + judged.standard_error);
        assert!(
            model_selection.recommends_joint_errors() && apart < Some(0.0),
            "{apart:?}"
        );
        model_selection.groups().to_vec()
    };
    let zeros: Vec<_> = (0..6u64)
        .into_par_iter()
        .map(|seed| chosen(seed, 1.0, 0.0))
        .collect();
    let right = zeros
        .iter()
        .filter(|groups| **groups == [ParameterGroup::Zeros]);
    let right = right.count();
    assert!(right >= 4, "{zeros:?}");
    let soft: Vec<_> = (0..3u64)
        .into_par_iter()
        .map(|seed| chosen(seed, 4.0, 60.0))
        .collect();
    for groups in &soft {
        assert!(groups.contains(&ParameterGroup::Compliances), "{soft:?}");
    }
}

/// Where the readings' own errors explain the residuals nothing recommends joint error functions.
#[test]
fn robots_without_joint_errors_get_no_functions() {
    let scenario = ur10();
    let rows = (0..8u64).into_par_iter().map(|seed| {
        let mut random = generator(23, seed);
        let nominal = seen_arm(&mut random, &scenario, 1, 1);
        let arm = other_arm(&mut random, &nominal, 1.0);
        let readings = read_of(&mut random, &arm, 100, 0.0, &|_, _| 0.0);
        let found = model_selection(&scenario.task.belief, &readings);
        assert!(found.recommendation.is_some());
        found.with_joint_errors.is_some()
    });
    let rows: Vec<bool> = rows.collect();
    // Residuals are implausible by chance (p < 1e-4) in one file of ten thousand.
    assert_eq!(rows, [false; 8]);
}

#[test]
fn the_command_recommends_fits_and_draws() {
    let place = workplace(&plain(60, true));
    let command = "identify s.toml --quiet --measurements m.csv --model-selection";
    let outcome = place.run(&format!(
        "{command} --plot-out l.svg --identified-out i.json"
    ));
    for words in [
        "+ zeros",
        "<- use",
        "Use --parameters frames",
        "wrote i.json",
    ] {
        outcome.prints(words);
    }
    assert!(place.read("l.svg").contains("recommended"));
    crate::browser::plot_looks_well(&place.path("l.svg"));
    let json = place.run(&format!("{command} --json")).json();
    assert_eq!(json["groups"][0], "frames");
    let nested_models = crate::support::list(&json["model_selection"]["nested_models"]);
    assert!(nested_models.len() >= 4);
    assert_eq!(nested_models[2]["groups"][0], "geometry");
    for threads in [1, 3] {
        let other = place
            .run(&format!("{command} --json --threads {threads}"))
            .json();
        assert_eq!(json, other);
    }
    let twice = place.misused(&format!("{command} --parameters frames"));
    twice.says("cannot be used with");
}

#[test]
fn what_no_model_selection_can_be_made_of_is_refused() {
    let place = workplace(&plain(5, true));
    let command = "identify s.toml --quiet --measurements m.csv --model-selection";
    let outcome = place.refused(command);
    outcome.says("8 different configurations are needed: 5");
    place.write("m.csv", "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,dx_mm,dy_mm,dz_mm\n1,2,3,4,5,6,0,0,-98,0,0,0,0,0,-1\n");
    place.refused(command).says("leave out --model-selection");
}
