//! Absolute readings of a UR10: the one fit with and without joint error functions, and one virtual robot after another.

use std::path::Path;

use elastocal::identification::{AbsoluteCase, ParameterGroup, ReadingWeights};
use elastocal::measurement::AbsoluteReading;
use elastocal::numeric::random::generator;
use elastocal::observation::{ObservationModel, ReadingKind, Setup};
use elastocal::parameter::ParameterSet;
use elastocal::plan::absolute::ReadingsWanted;
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use elastocal::study::runner::Runner;
use elastocal::study::{Conditions, Entry, Level, Setting, TakenPlan};
use elastocal::task::AccuracyKind;
use nalgebra::{DVector, Isometry3, Matrix6, Matrix6xX, Rotation3, UnitQuaternion, Vector3};
use rand::RngExt;

const SIGMA: f64 = 2e-5;
const POSES: usize = 60;
const READINGS: u32 = 14;

/// Poses of the arm as it is believed to be, whose joints turn by `transmission_error_rad` more than they are commanded, in one wave a
/// joint.
fn poses(scenario: &Scenario, transmission_error_rad: f64) -> Vec<AbsoluteReading> {
    let mut random = generator(1, 2);
    let mut arm = scenario.task.belief.arm();
    arm.tools.truncate(1);
    arm.instrument_from_base = vec![Isometry3::new(
        Vector3::new(2.0, -1.0, 0.5),
        Vector3::new(0.3, 0.1, 2.0),
    )];
    let nothing = ParameterSet::empty();
    let mut model = ObservationModel::new(&nothing, &arm, &[]);
    let mut ignored = Matrix6xX::zeros(0);
    (0..POSES)
        .map(|_| {
            let commanded_rad =
                DVector::from_fn(arm.chain.len(), |_, _| random.random_range(-2.6..2.6));
            let mut turns = 1.0;
            let setup = Setup {
                hangs_on: None,
                commanded_rad: commanded_rad.map(|angle: f64| {
                    turns += 1.0;
                    angle + transmission_error_rad * (turns * angle).sin()
                }),
                load: Load::NONE,
                target: 0,
                station: 0,
                approach: None,
            };
            let seen = model
                .predict(&setup, ReadingKind::Pose, &mut ignored)
                .expect("stable");
            let mut error =
                || Vector3::from_fn(|_, _| 3.0_f64.sqrt() * SIGMA * random.random_range(-1.0..1.0));
            let turn = Rotation3::from_scaled_axis(error());
            let rotation = turn * Rotation3::from_matrix_unchecked(seen.rotation);
            AbsoluteReading {
                configuration_rad: commanded_rad,
                load: Load::NONE,
                target: None,
                station: None,
                visit: None,
                position_m: seen.position_m + error(),
                rotation: Some(UnitQuaternion::from_rotation_matrix(&rotation)),
                covariance: Some(Matrix6::identity() * (SIGMA * SIGMA)),
                approach: None,
                length: None,
                time_s: None,
                temperature_c: None,
            }
        })
        .collect()
}

/// The fit of frames and geometry; with joint error functions where joints have transmission errors.
pub fn fit(scenario: &'static Scenario, transmission_error_rad: f64) -> impl FnMut() -> usize {
    let readings = poses(scenario, transmission_error_rad);
    move || {
        let mut case = AbsoluteCase::new(&scenario.task.belief, &readings).expect("readings");
        let fit = case.fit(&[ParameterGroup::Geometry], ReadingWeights::AsNeeded);
        let fit = fit.expect("a fit");
        assert_eq!(
            fit.discrepancy_model.is_some(),
            transmission_error_rad > 0.0
        );
        fit.iterations
    }
}

/// Virtual robots that are read by a random plan, a block at a time.
pub fn trials(scenario: &'static Scenario) -> impl FnMut(u64) {
    let groups: &[ParameterGroup] = &[ParameterGroup::Zeros];
    let wanted = ReadingsWanted {
        groups,
        measured: &[],
        candidates: None,
        path: Path::new("scenarios"),
        configurations: 20,
    };
    let mut task = scenario.task.clone();
    task.design.accuracy = AccuracyKind::Absolute;
    let conditions = Conditions::plain(&task, READINGS);
    let task = Box::leak(Box::new(task));
    let setting = Setting::new(task, &scenario.truth, conditions);
    let settings = Box::leak(Box::new([setting]));
    let planning = wanted.planning(&settings[0].task, 1).expect("a region");
    let plan = planning.random(READINGS, 1, 0).expect("a plan");
    let entries = Box::leak(Box::new([Entry {
        name: "plan".to_owned(),
        setting: 0,
        plan: Some(TakenPlan::of_readings(plan, planning, groups)),
        is_random: true,
    }]));
    let runner = Runner::new(settings, 1, Level::Robot, entries).expect("a prediction");
    move |blocks| {
        let made = runner.run(blocks * runner.block_runs(), 0..blocks, 1, &|_| {});
        made.expect("a valid study");
    }
}
