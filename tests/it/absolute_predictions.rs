//! What plans of absolute readings prediction, beside robots that are drawn, read, identified and judged at test poses; and what
//! disturbs a reading, beside readings that are disturbed.

use elastocal::experiment::Candidate;
use elastocal::identification::{AbsoluteCase, ParameterGroup, ReadingWeights};
use elastocal::measurement::AbsoluteReading;
use elastocal::numeric::random::generator;
use elastocal::observation::{BareArm, ObservationModel, ReadingErrors, ReadingKind, Setup};
use elastocal::parameter::ReadingSource::{Discrepancy, GaugeDirection};
use elastocal::parameter::{
    ElasticArm, ParameterKind, ParameterSet, RangeNoise, ReadingSource, SourceLevel,
    TransmissionError, UnexplainedError,
};
use elastocal::plan::absolute::AbsolutePlanning;
use elastocal::plan::search::random_plan;
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use nalgebra::{DVector, Matrix6, Matrix6xX, Rotation3, Vector3, Vector6};
use rand::Rng;
use rayon::prelude::*;

use crate::one_fit::{anywhere, normal};
use crate::support::{
    Workplace, assert_alike, assert_alike_in, blank_reading, scenario, scenario_text, setup,
};

const SPINDLE: &str = "spindle";
const REFLECTOR: &str = "reflector";
/// Robots that are drawn.
const ROBOTS: u64 = 160;

/// Random feasible rows: of the spindle without a load, and of the reflector under the scenario's.
pub fn rows(scenario: &Scenario, count: u32, station: Option<&str>) -> Vec<Candidate> {
    let plan = random_plan(&scenario.task, count, 8, 0).expect("a plan");
    (plan.experiments.iter().enumerate())
        .map(|(index, each)| Candidate {
            line: index + 2,
            configuration_rad: each.configuration_rad.clone(),
            load: Some(if index % 2 == 0 {
                Load::NONE
            } else {
                each.load
            }),
            most: Some(1),
            target: Some(if index % 2 == 0 { SPINDLE } else { REFLECTOR }.to_owned()),
            station: station.map(str::to_owned),
            approach: None,
        })
        .collect()
}

fn reading(row: &Candidate, position_m: Vector3<f64>) -> AbsoluteReading {
    AbsoluteReading {
        configuration_rad: row.configuration_rad.clone(),
        load: row.load.unwrap_or(Load::NONE),
        target: row.target.clone(),
        station: row.station.clone(),
        position_m,
        ..blank_reading()
    }
}

/// Where an arm has a target.
pub fn place(arm: &ElasticArm, setup: &Setup) -> Vector3<f64> {
    let nothing = ParameterSet::empty();
    let mut model = ObservationModel::new(&nothing, arm, &[]);
    let mut ignored = Matrix6xX::zeros(0);
    let seen = model.predict(setup, ReadingKind::Position, &mut ignored);
    seen.expect("stable").position_m
}

fn target_of(case: &AbsoluteCase<'_>, name: &str) -> usize {
    let mut targets = case.targets.iter();
    targets.position(|each| each == name).expect("it was read")
}

/// Draws a robot with its frames, reads what the plan says, identifies, and tells by how much the identified robot is off at each
/// test pose: the weighted mean square.
fn left_by_one(
    scenario: &Scenario,
    groups: &[ParameterGroup],
    plan: &[Candidate],
    robot: u64,
) -> f64 {
    let task = &scenario.task;
    let belief = &task.belief;
    let mut random = generator(11, robot);
    let dry: Vec<AbsoluteReading> = plan
        .iter()
        .map(|row| reading(row, Vector3::zeros()))
        .collect();
    let case = AbsoluteCase::placed(belief, &dry).expect("readings");
    let set = case.unknowns_beside(groups, &[]).expect("unknowns");
    let values: Vec<f64> = (set.parameters().iter())
        .map(|each| match (each.kind, each.prior_deviation) {
            (_, Some(deviation)) => each.nominal + deviation * normal(&mut random),
            (kind, None) if kind.is_mounted() => 0.0,
            (ParameterKind::JointCompliance { .. }, None) => {
                each.nominal * (1.0 + 0.05 * normal(&mut random))
            }
            (_, None) => each.nominal + 0.3 * each.scale * normal(&mut random),
        })
        .collect();
    let mut truth = set.apply(&case.arm, &values);
    for base in &mut truth.instrument_from_base {
        *base = anywhere(&mut random, 3.0);
    }
    for tool in &mut truth.tools {
        tool.link_from_tool.translation.vector +=
            Vector3::from_fn(|_, _| 1e-3 * normal(&mut random));
    }
    let sigma_m = belief.instrument.sigma_m / 2.0_f64.sqrt();
    let readings: Vec<AbsoluteReading> = (plan.iter().zip(&case.observations))
        .map(|(row, observation)| {
            let noise = Vector3::from_fn(|_, _| sigma_m * normal(&mut random));
            reading(row, place(&truth, &observation.setup) + noise)
        })
        .collect();
    let mut read = AbsoluteCase::new(belief, &readings).expect("readings");
    read.choices.keeps_all = true;
    let fit = read.fit(groups, ReadingWeights::Own).expect("a fit");
    (task.test_poses.iter())
        .map(|pose| {
            let setup = setup(
                pose.configuration_rad.clone(),
                pose.load,
                target_of(&read, SPINDLE),
            );
            let off = place(&fit.arm, &setup) - place(&truth, &setup);
            pose.weight * pose.counted(&off).norm_squared()
        })
        .sum()
}

fn is_kept(scenario: &Scenario, groups: &[ParameterGroup], plan: &[Candidate], about: &str) {
    let planning = AbsolutePlanning::new(&scenario.task, groups, plan).expect("candidates");
    assert_eq!(planning.candidates.len(), plan.len(), "{about}");
    let all: Vec<(usize, u32)> = (0..plan.len()).map(|place| (place, 1)).collect();
    let predicted = planning
        .prediction(&all)
        .rho0_m()
        .expect("a prediction")
        .powi(2);
    let seen: f64 = (0..ROBOTS)
        .into_par_iter()
        .map(|robot| left_by_one(scenario, groups, plan, robot))
        .collect::<Vec<f64>>()
        .iter()
        .sum();
    let seen = seen / ROBOTS as f64;
    // |e|^2 of a normal e has the variance 2 trace(S^2) <= 2 trace(S)^2: four standard errors of the mean of all robots, and
    // 2 % for what linear propagation leaves out.
    let bound = 4.0 * (2.0 / ROBOTS as f64).sqrt() + 0.02;
    assert_alike_in(&about, seen, predicted, bound);
    // Not far off by chance of a wide bound: half or twice the noise's variance would be.
    assert!(bound < 0.5);
}

fn any_force() -> String {
    scenario_text("ur10").replace(
        "kind = \"fixed\"\nforce_n = [0, 0, -98]",
        "kind = \"any\"\nforce_max_n = 98",
    )
}

/// Zeros and compliances, with nothing known before; geometry that is known to a degree, with a path for its target.
#[test]
fn robots_keep_what_was_predicted() {
    let place = Workplace::new();
    // Forces in any direction: gravity alone does not bend the first joint.
    place.write("f.toml", any_force());
    let free = place.scenario("f.toml");
    let groups = [ParameterGroup::Zeros, ParameterGroup::Compliances];
    is_kept(&free, &groups, &rows(&free, 24, None), "nothing known");
    let known = "\n[[uncertainty]]\nkind = \"joint_zero\"\nstd_mrad = 1\n\n[[uncertainty]]\nkind = \"link_position\"\nstd_mm = 0.2\n\n\
        [[uncertainty]]\nkind = \"compliance\"\nstd_relative = 0.2\n\n[[uncertainty]]\nkind = \"load_scale\"\nstd_relative = 0.05\n\n\
        [[test_pose]]\nname = \"other\"\nq_deg = [-30, -80, 100, -60, 60, -90]\nforce_n = [0, 0, -80]\nweight = 2\n";
    place.write("k.toml", scenario_text("ur10") + known);
    let known = place.scenario("k.toml");
    is_kept(&known, &[], &rows(&known, 12, Some("door")), "known before");
}

/// Nothing that the task's force does is learnt from readings, and it does not hide what they teach.
#[test]
fn what_the_tasks_force_does_is_added() {
    let place = Workplace::with("f.toml", any_force());
    let bare = place.scenario("f.toml");
    let text =
        any_force() + "\n[[uncertainty]]\nkind = \"task_force\"\nstd_n = 5\nstd_relative = 0.1\n";
    place.write("t.toml", text);
    let uncertain = place.scenario("t.toml");
    let rows = rows(&bare, 20, None);
    let all: Vec<(usize, u32)> = (0..rows.len()).map(|place| (place, 1)).collect();
    let groups = [ParameterGroup::Zeros, ParameterGroup::Compliances];
    let [without, with] = [&bare, &uncertain].map(|scenario| {
        let planning = AbsolutePlanning::new(&scenario.task, &groups, &rows).expect("candidates");
        let prediction = planning.prediction(&all);
        (
            prediction.rho0_m().expect("a prediction"),
            prediction.task_force_m,
        )
    });
    assert!(without.1 == 0.0 && with.1 > 0.0);
    // The force moves the tool by what the arm gives way: J k J^T dF, drawn.
    let task = &bare.task;
    let arm = task.belief.arm();
    let pose = &task.test_poses[0];
    let at = |load: Load| {
        let setup = setup(pose.configuration_rad.clone(), load, arm.tools.len() - 1);
        crate::absolute_predictions::place(&arm, &setup)
    };
    let mut random = generator(3, 0);
    let draws = 4000;
    let mean = (0..draws)
        .map(|_| {
            let scale = 1.0 + 0.1 * normal(&mut random);
            let mut load = pose.load.scaled(scale);
            load.force_n += Vector3::from_fn(|_, _| 5.0 * normal(&mut random));
            (at(load) - at(pose.load)).norm_squared()
        })
        .sum::<f64>()
        / f64::from(draws);
    let off = mean / with.1.powi(2) - 1.0;
    assert!(
        off.abs() < 4.0 * (2.0 / f64::from(draws)).sqrt() + 0.02,
        "{off}"
    );
    let expected = without.0.hypot(with.1);
    assert_alike(with.0, expected, 1e-9);
}

/// The sample covariance of readings that are disturbed.
fn sampled(
    random: &mut impl Rng,
    draws: u32,
    mut read: impl FnMut(&mut dyn FnMut() -> f64) -> Vector6<f64>,
) -> Matrix6<f64> {
    let mut sum = Matrix6::zeros();
    for _ in 0..draws {
        let off = read(&mut || normal(random));
        sum += off * off.transpose();
    }
    sum / f64::from(draws)
}

/// One of each kind that disturbs readings.
fn sources() -> [ReadingSource; 6] {
    let deviations = vec![2e-5, 3e-5, 1e-5, 5e-5, 4e-5, 6e-5];
    [
        ReadingSource::JointRepeatability(deviations.clone()),
        ReadingSource::TransmissionError(TransmissionError {
            deviations: deviations.clone(),
            kernel: None,
        }),
        ReadingSource::LoadDirection(0.01),
        ReadingSource::LoadPoint(0.005),
        ReadingSource::Range(RangeNoise {
            from_m: Vector3::zeros(),
            per_metre: 6e-6,
            along_per_metre: 2e-6,
        }),
        ReadingSource::Discrepancy(UnexplainedError {
            deviation_m: 4e-5,
            of: None,
        }),
    ]
}

/// A source's errors are those of its level alone.
fn check_level(source: &ReadingSource, errors: &ReadingErrors) {
    let moves = |columns: &Matrix6xX<f64>| columns.ncols() > 0 && columns.amax() > 0.0;
    let levels = [
        (SourceLevel::Reading, errors.reading.amax() > 0.0),
        (SourceLevel::Visit, moves(&errors.visit)),
        (SourceLevel::Configuration, moves(&errors.configuration)),
    ];
    for (level, is_moved) in levels {
        assert_eq!(is_moved, source.level() == level, "{source:?}");
    }
}

/// Each source moves readings by as much as the covariance says, at a target that is not where the load acts.
#[test]
fn readings_are_disturbed_as_much_as_planned() {
    let scenario = scenario("ur10");
    let belief = &scenario.task.belief;
    let arm = ElasticArm::new(
        belief.nominal.chain.clone(),
        belief.nominal.compliance_rad_per_nm.clone(),
        vec![
            belief.machining_tool.clone(),
            belief.calibration_tool.clone(),
        ],
    );
    let bare = BareArm {
        chain: &arm.chain,
        compliance_rad_per_nm: &arm.compliance_rad_per_nm,
        tool: &arm.tools[0],
    };
    let row = &rows(&scenario, 2, None)[1];
    let load = Load {
        force_n: Vector3::new(20.0, -10.0, -98.0),
        torque_nm: Vector3::new(3.0, 8.0, -4.0),
    };
    let q = row.configuration_rad.as_slice();
    let nothing = ParameterSet::empty();
    let mut model = ObservationModel::new(&nothing, &arm, &[]);
    let mut ignored = Matrix6xX::zeros(0);
    // The load acts at the calibration tool: where the spindle is, it has another torque.
    let mut seen = |moved: &DVector<f64>, load: &Load| {
        let mut at = |target: usize, load: Load| {
            let setup = setup(moved.clone(), load, target);
            let kind = ReadingKind::Pose;
            (model.predict(&setup, kind, &mut ignored)).expect("stable")
        };
        let lever = at(1, Load::NONE).position_m - at(0, Load::NONE).position_m;
        let torque_nm = load.torque_nm + lever.cross(&load.force_n);
        at(0, Load { torque_nm, ..*load })
    };
    let right = seen(&row.configuration_rad, &load);
    let station = Vector3::new(-3.0, 2.0, 1.0);
    let half = 0.5_f64.sqrt();
    let sources = sources();
    let draws = 3000;
    let mut random = generator(4, 0);
    for source in &sources {
        let calibration = &belief.calibration_tool;
        let errors = ReadingErrors::new(bare, q, (calibration, &load), Some(&station), [source]);
        let is_shared = source.is_of_configuration();
        check_level(source, &errors);
        let expected = errors.covariance();
        let found = sampled(&mut random, draws, |next| {
            let mut three = |size: f64| Vector3::from_fn(|_, _| size * next());
            let mut moved = row.configuration_rad.clone();
            let mut acting = load;
            let mut added = Vector3::zeros();
            match source {
                ReadingSource::JointRepeatability(deviations)
                | ReadingSource::TransmissionError(TransmissionError { deviations, .. }) => {
                    let share = if is_shared { 1.0 } else { half };
                    for (angle, deviation) in moved.iter_mut().zip(deviations) {
                        *angle += share * deviation * next();
                    }
                }
                ReadingSource::LoadDirection(deviation) => {
                    let turn = Rotation3::new(three(*deviation));
                    acting.force_n = turn * load.force_n;
                    acting.torque_nm = turn * load.torque_nm;
                }
                ReadingSource::LoadPoint(deviation) => {
                    acting.torque_nm += three(*deviation).cross(&load.force_n);
                }
                ReadingSource::Range(noise) => {
                    let apart = right.position_m - station;
                    let sight = apart.normalize();
                    let numbers = three(half * apart.norm());
                    let along = sight * sight.dot(&numbers);
                    added = along * noise.along_per_metre + (numbers - along) * noise.per_metre;
                }
                Discrepancy(error) => added = three(error.in_reading_m(&acting)),
                GaugeDirection(size) => added = three(*size),
            }
            let read = seen(&moved, &acting);
            let off = read.position_m + added - right.position_m;
            let turn = Rotation3::from_matrix_unchecked(read.rotation * right.rotation.transpose());
            let turn = turn.scaled_axis();
            Vector6::from_fn(|row, _| if row < 3 { off[row] } else { turn[row - 3] })
        });
        // Entries of a sample covariance of normal numbers: (s_ii s_jj + s_ij^2) / draws, four standard errors and 1 % for the
        // equilibrium.
        for (row, column) in (0..6).flat_map(|row| (0..6).map(move |column| (row, column))) {
            let size = (expected[(row, row)] * expected[(column, column)]).sqrt();
            let allowed = size * (4.0 * (2.0 / f64::from(draws)).sqrt() + 0.01) + 1e-30;
            let off = (found[(row, column)] - expected[(row, column)]).abs();
            assert!(
                off <= allowed,
                "{source:?} {row} {column}: {found} {expected}"
            );
        }
    }
}

/// Repeats average what is new in each reading, and not what the stand shares; no plan is below the bound.
#[test]
fn repeats_do_not_average_what_they_share() {
    let place = Workplace::new();
    let text = |kind: &str| {
        scenario_text("ur10").replace("sigma_mm = 0.02", "sigma_mm = 0.001")
            + &format!("\n[[uncertainty]]\nkind = \"{kind}\"\nstd_mrad = 0.1\n")
    };
    let rho0 = |kind: &str, repeats: u32| {
        place.write("r.toml", text(kind));
        let scenario = place.scenario("r.toml");
        let rows = rows(&scenario, 20, None);
        let groups = [ParameterGroup::Zeros];
        let planning = AbsolutePlanning::new(&scenario.task, &groups, &rows).expect("candidates");
        let plan: Vec<(usize, u32)> = (0..rows.len()).map(|place| (place, repeats)).collect();
        planning.prediction(&plan).rho0_m().expect("a prediction")
    };
    let new = rho0("joint_repeatability", 4) / rho0("joint_repeatability", 1);
    assert!((new - 0.5).abs() < 1e-6, "{new}");
    let shared = rho0("transmission_error", 4) / rho0("transmission_error", 1);
    assert!(shared > 0.99 && shared <= 1.0, "{shared}");
}
