//! The KR-270 with a gravity compensator, a base that tilts and a link that bends: what a belief without
//! them costs, and what identifying the compensator gives.

use elastocal::identification::fit_parameters;
use elastocal::mujoco::Model;
use elastocal::numeric::random::generator;
use elastocal::observation::{Observation, Reading, Whitener};
use elastocal::parameter::{ElasticArm, ParameterKind, ParameterSet};
use elastocal::robot::{EquilibriumSolver, KnownJoint, Load, TrueRobot};
use elastocal::scenario::Scenario;
use elastocal::testbed::VirtualRobot;
use nalgebra::{DVector, Vector3};
use rand::RngExt;

use crate::judge::{Question, judge};
use crate::support::{Workplace, project, scenario, scenario_text, setup, table4};

const SITE: &str = "calibration_tcp";
const WEIGHT: Load = Load::force(0.0, 0.0, -2500.0);

/// The models with more on them are the plain one's but for what their headers tell.
#[test]
fn the_models_differ_from_the_plain_one_by_what_they_add() {
    let read = |name: &str| {
        let text = std::fs::read_to_string(project(&format!("models/{name}.xml"))).expect("there");
        let body = text.find("<mujoco ").expect("a model");
        text[body..].to_owned()
    };
    let plain = read("kr270");
    for (name, added) in [("kr270_compensator", 13), ("kr270_flexible", 18)] {
        let text = read(name);
        let lines: Vec<&str> = text.lines().skip(1).collect();
        let mut next = 0;
        let mut missing = Vec::new();
        for line in plain.lines().skip(1) {
            match lines[next..].iter().position(|each| *each == line) {
                Some(further) => next += further + 1,
                None => missing.push(line),
            }
        }
        // The comment on the counterbalance, and poses for all joints.
        let told = [
            "real one swings",
            "In radians: q",
            "<keyframe>",
            "<key name",
            "</keyframe>",
        ];
        for line in missing.iter().filter(|line| !line.is_empty()) {
            assert!(
                told.iter().any(|part| line.contains(part)),
                "{name}: {line}"
            );
        }
        let unchanged = plain.lines().skip(1).count() - missing.len();
        assert_eq!(lines.len() - unchanged, added, "{name}");
    }
}

/// All ways to the rest of the richest model.
#[test]
fn the_flexible_robot_rests_where_mujoco_does() {
    let scenario = scenario("kr270_flexible");
    let robot = &scenario.truth.robot;
    assert!(robot.chain.is_ok());
    let mut by_chain = VirtualRobot::new(robot, SITE).expect("there is");
    let mut by_any = VirtualRobot::of_any_model(robot, SITE).expect("there is");
    let names: Vec<String> = (1..=6).map(|joint| format!("joint_{joint}")).collect();
    for experiment in &table4(3).experiments {
        let q = &experiment.configuration_rad;
        for load in [Load::NONE, WEIGHT] {
            let (one, _, _) = by_chain.rest(q, &load).expect("stable");
            let (other, _, _) = by_any.rest(q, &load).expect("stable");
            assert!((one - other).norm() < 1e-12);
            let question = Question {
                site: SITE,
                joints: &names,
                commanded: q.as_slice(),
                force_n: load.force_n,
            };
            let judged = judge(&project("models/kr270_flexible.xml"), &question);
            assert!((one - judged.expect("it rests")).norm() < 1e-9);
        }
    }
}

/// The virtual robot of a model, as seen by a belief of six joints.
fn robot(model: &str) -> VirtualRobot {
    let path = project(&format!("models/{model}.xml"));
    let model = Model::load(&path).expect("the model is valid");
    let chain = elastocal::robot::SerialChain::from_model(&model).expect("a chain");
    let known: Vec<_> = (1..=6)
        .map(|joint| KnownJoint {
            name: format!("joint_{joint}"),
            is_passive: false,
        })
        .collect();
    let robot = TrueRobot::of_model(model, &known, Ok(chain)).expect("it has the joints");
    VirtualRobot::new(&robot, SITE).expect("there is")
}

/// At the test pose: the compensator moves the unloaded tool by millimetres, and deflections by micrometres.
#[test]
fn the_compensator_shows_in_positions_and_hardly_in_deflections() {
    let q = &scenario("kr270").task.test_poses[0].configuration_rad;
    let [plain, compensated, flexible] =
        ["kr270", "kr270_compensator", "kr270_flexible"].map(|model| {
            let mut robot = robot(model);
            let (unloaded, _, _) = robot.rest(q, &Load::NONE).expect("stable");
            let (loaded, _, _) = robot.rest(q, &WEIGHT).expect("stable");
            (unloaded, loaded - unloaded)
        });
    let moved_mm = (compensated.0 - plain.0).norm() * 1e3;
    let changed_mm = (compensated.1 - plain.1).norm() * 1e3;
    let share = (flexible.1 - compensated.1).norm() / compensated.1.norm();
    println!(
        "the compensator moves the tool by {moved_mm:.3} mm and its deflection by {changed_mm:.4} mm of {:.3} mm; flexible parts add {:.1} %",
        plain.1.norm() * 1e3,
        share * 100.0
    );
    assert!((0.2..10.0).contains(&moved_mm), "{moved_mm} mm");
    assert!((0.001..0.1).contains(&changed_mm), "{changed_mm} mm");
    assert!((0.03..0.2).contains(&share), "{share}");
}

/// From 60 positions, loaded and not: the compliances with the compensator's stiffness and rest length,
/// or without a compensator at all.
#[test]
fn a_compensator_is_identified_with_the_compliances() {
    let scenario = scenario("kr270_compensator");
    let belief = &scenario.task.belief;
    let mut truth = belief.nominal.as_believed();
    let wrong = [1.2, 0.85, 1.1, 0.9, 1.15, 1.0];
    for (value, factor) in truth.compliance_rad_per_nm.iter_mut().zip(wrong) {
        *value *= factor;
    }
    let chain = truth.chain.as_mut().expect("a chain");
    chain.elements.springs[0].stiffness_n_per_m *= 0.9;
    chain.elements.springs[0].rest_m = [0.47; 2];
    let mut robot = VirtualRobot::new(&truth, SITE).expect("there is");
    let mut random = generator(5, 0);
    let sigma_m = 1e-5;
    let observations: Vec<Observation> = (0..60)
        .map(|index| {
            let ranges = scenario.task.region.joint_range_rad.iter();
            let q = ranges.map(|[low, high]| random.random_range(0.4 * low..=0.4 * high));
            let q = DVector::from_iterator(6, q);
            let load = if index % 2 == 0 { WEIGHT } else { Load::NONE };
            let (position_m, _, _) = robot.rest(&q, &load).expect("stable");
            Observation {
                setup: setup(q, load, 0),
                reading: Reading::Position { position_m },
                whitener: Whitener::independent(Vector3::repeat(sigma_m), Vector3::repeat(1.0)),
            }
        })
        .collect();
    let arm = |scenario: &Scenario| {
        let belief = &scenario.task.belief;
        ElasticArm::new(
            belief.nominal.chain.clone(),
            belief.nominal.compliance_rad_per_nm.clone(),
            vec![belief.calibration_tool.clone()],
        )
    };
    let compliances = (0..6).map(|joint| (ParameterKind::JointCompliance { joint }, None));
    let spring = [
        (ParameterKind::SpringStiffness { spring: 0 }, None),
        (ParameterKind::SpringRest { spring: 0 }, None),
    ];
    let nominal = arm(&scenario);
    let set = ParameterSet::new(&nominal, compliances.clone().chain(spring)).expect("a set");
    let fit = fit_parameters(&nominal, &set, &observations).expect("it converges");
    let found = &fit.belief.chain.elements.springs[0];
    let rms_um = (fit.square / fit.rows as f64).sqrt() * sigma_m * 1e6;
    println!("with the compensator: {rms_um:.2e} um left, {found:?}");
    assert!(rms_um < 1e-3, "{rms_um} um");
    assert!((found.stiffness_n_per_m / (0.9 * 144_270.0) - 1.0).abs() < 1e-6);
    assert!((found.rest_m[0] - 0.47).abs() < 1e-7);
    // A weight tells nothing of the joint that stands upright.
    for (joint, factor) in wrong.iter().enumerate().skip(1) {
        let true_value = belief.nominal.compliance_rad_per_nm[joint] * factor;
        let ratio = fit.belief.compliance_rad_per_nm[joint] / true_value;
        assert!((ratio - 1.0).abs() < 1e-6, "joint {}: {ratio}", joint + 1);
    }
    // The plain belief cannot explain the positions.
    let plain = arm(&crate::support::scenario("kr270"));
    let set = ParameterSet::new(&plain, compliances).expect("a set");
    let fit = fit_parameters(&plain, &set, &observations).expect("it converges");
    let rms_um = (fit.square / fit.rows as f64).sqrt() * sigma_m * 1e6;
    println!("without: {rms_um:.1} um left");
    assert!(rms_um > 100.0, "{rms_um} um");
}

/// What is measured: how loads move the tool, or where it is, loaded and not.
#[derive(Clone, Copy, PartialEq)]
enum Campaign {
    Deflections,
    Positions,
}

/// The noise of a coordinate (m).
const SIGMA_M: f64 = 3e-5;

fn campaign(truth: &TrueRobot, scenario: &Scenario, kind: Campaign, run: u64) -> Vec<Observation> {
    let mut robot = VirtualRobot::new(truth, SITE).expect("there is");
    let mut random = generator(6, run);
    let whitener = Whitener::independent(Vector3::repeat(SIGMA_M), Vector3::repeat(1.0));
    (0..60)
        .map(|index| {
            let ranges = scenario.task.region.joint_range_rad.iter();
            let q = ranges.map(|[low, high]| random.random_range(0.4 * low..=0.4 * high));
            let q = DVector::from_iterator(6, q);
            let load = [WEIGHT, Load::force(0.0, 2000.0, 0.0), Load::NONE][index % 3];
            let load = if kind == Campaign::Deflections && load == Load::NONE {
                WEIGHT
            } else {
                load
            };
            let mut rest = |load: &Load| robot.rest(&q, load).expect("stable").0;
            let noise = Vector3::from_fn(|_, _| {
                // Of twelve uniform numbers, a nearly normal one.
                let sum: f64 = (0..12).map(|_| random.random_range(-0.5..0.5)).sum();
                sum * SIGMA_M
            });
            let reading = match kind {
                Campaign::Deflections => Reading::Deflection {
                    position_m: rest(&load) - rest(&Load::NONE) + noise,
                    rotation_rad: None,
                },
                Campaign::Positions => Reading::Position {
                    position_m: rest(&load) + noise,
                },
            };
            Observation {
                setup: setup(q, load, 0),
                reading,
                whitener,
            }
        })
        .collect()
}

/// What a belief without the compensator costs at the test pose, and what identifying the compensator
/// gives, for a robot whose compliances and compensator are not as they are believed to be.
#[test]
fn what_a_compensator_costs_at_the_test_pose() {
    const RUNS: u64 = 20;
    let pose = &scenario("kr270").task.test_poses[0];
    println!(
        "| truth | belief | identified from | readings off by [um] | deflection off by [um] | position off by [um] |\n|---|---|---|---:|---:|---:|"
    );
    let mut found = Vec::new();
    for truth_name in ["kr270_compensator", "kr270_flexible"] {
        let mut truth = scenario(truth_name).truth.robot;
        for (value, factor) in
            (truth.compliance_rad_per_nm.iter_mut()).zip([1.2, 0.85, 1.1, 0.9, 1.15, 1.0])
        {
            *value *= factor;
        }
        let chain = truth.chain.as_mut().expect("a chain");
        chain.elements.springs[0].stiffness_n_per_m *= 0.95;
        chain.elements.springs[0].rest_m = [0.462; 2];
        let mut robot = VirtualRobot::new(&truth, "machining_tcp").expect("there is");
        let mut seen = |load: &Load| robot.rest(&pose.configuration_rad, load).expect("stable").0;
        let (unloaded_m, loaded_m) = (seen(&Load::NONE), seen(&pose.load));
        for (belief_name, model, with_spring) in [
            ("without compensator", "kr270", false),
            ("compensator as in the file", "kr270_compensator", false),
            ("compensator identified", "kr270_compensator", true),
        ] {
            let scenario = scenario(model);
            let belief = &scenario.task.belief;
            let nominal = ElasticArm::new(
                belief.nominal.chain.clone(),
                belief.nominal.compliance_rad_per_nm.clone(),
                vec![
                    belief.calibration_tool.clone(),
                    belief.machining_tool.clone(),
                ],
            );
            let mut kinds: Vec<ParameterKind> = (0..6)
                .map(|joint| ParameterKind::JointCompliance { joint })
                .collect();
            if with_spring {
                kinds.push(ParameterKind::SpringStiffness { spring: 0 });
                kinds.push(ParameterKind::SpringRest { spring: 0 });
            }
            let set = ParameterSet::new(&nominal, kinds.iter().map(|&kind| (kind, None)));
            let set = set.expect("a set");
            for (campaign_name, kind) in [
                ("60 deflections", Campaign::Deflections),
                ("60 positions", Campaign::Positions),
            ] {
                let mut squares = [0.0; 3];
                for run in 0..RUNS {
                    let observations = campaign(&truth, &scenario, kind, run);
                    let fit = fit_parameters(&nominal, &set, &observations).expect("it converges");
                    let arm = &fit.belief;
                    let mut solver = EquilibriumSolver::new(6);
                    let mut rest = |load: &Load| {
                        let mut arm_at_tool = arm.chain.at(&arm.tools[1]);
                        let q = pose.configuration_rad.as_slice();
                        solver
                            .solve(&mut arm_at_tool, &arm.compliance_rad_per_nm, q, load)
                            .expect("stable");
                        solver.state().tool_position
                    };
                    let (from, to) = (rest(&Load::NONE), rest(&pose.load));
                    squares[0] += fit.square / fit.rows as f64 * SIGMA_M * SIGMA_M;
                    squares[1] += ((to - from) - (loaded_m - unloaded_m)).norm_squared();
                    squares[2] += (to - loaded_m).norm_squared();
                }
                let rms_um = squares.map(|square| (square / RUNS as f64).sqrt() * 1e6);
                let [readings, deflection, position] = rms_um;
                println!(
                    "| {truth_name} | {belief_name} | {campaign_name} | {readings:.1} | {deflection:.1} | {position:.1} |"
                );
                found.push(rms_um);
            }
        }
    }
    let deflection = |row: usize| found[row][1];
    let position = |row: usize| found[row][2];
    // Deflections hardly tell of the compensator, positions do, and without it in the belief they spoil the
    // compliances.
    assert!(deflection(0) < 10.0 && position(0) > 200.0);
    assert!(deflection(1) > 50.0 && position(1) > 200.0);
    // Identified from positions it is known; from deflections it is not.
    assert!(deflection(5) < 10.0 && position(5) < 15.0);
    assert!(position(4) > 100.0);
    // What bends beside the joints is left.
    assert!(position(11) < 0.5 * position(9) && position(11) > 3.0 * position(5));
}

/// A belief without the compensator: deflections hardly tell, and compensation works.
#[test]
fn check_names_what_the_belief_does_not_know() {
    let workplace = Workplace::new();
    let text = scenario_text("kr270").replacen(
        "[instrument]",
        &format!(
            "[true_robot]\nmodel = \"{}\"\n[instrument]",
            project("models/kr270_flexible.xml").display()
        ),
        1,
    );
    workplace.write("plain.toml", text);
    let checked = workplace.done("check plain.toml");
    for part in ["base_x, base_y, link_2_bend", "compensator"] {
        checked.prints(part);
    }
}
