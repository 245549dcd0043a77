//! Springs beside the joints' own, such as a gravity compensator, in planning: to first order in compliance
//! the deflection's derivatives are those of the equilibrium, the search's gradient is that of what it
//! searches, and torque bounds hold what the drives must hold.

use elastocal::identification::{Case, Sigma};
use elastocal::measurement::Measurement;
use elastocal::numeric::random::generator;
use elastocal::plan::search::Problem;
use elastocal::plan::{Bounded, Criterion, SmoothBound};
use elastocal::robot::{
    EquilibriumSolver, JointSpring, Load, ObservationMatrix, SerialChain, rotation_vector,
};
use elastocal::scenario::Scenario;
use elastocal::task::Method;
use nalgebra::{DMatrix, DVector, Matrix3xX, Vector3};
use rand::RngExt;

use crate::recovery::of_compliances;
use crate::support::{Workplace, assert_near, number, scenario, scenario_text, shipped, six_rows};

/// A KR-270 whose compensator is stiff enough to share joint 2's load, and with a spring in joint 3.
fn stiffly_braced() -> Scenario {
    let mut scenario = scenario("kr270_compensator");
    let elements = &mut scenario.task.belief.nominal.chain.elements;
    elements.springs[0].stiffness_n_per_m *= 300.0;
    elements.joint_springs.push(JointSpring {
        joint: 2,
        stiffness: 1e6,
        rest: 0.3,
    });
    scenario
}

/// The same without weight, with springs that are relaxed at `q`: its first order is exact for small loads.
fn relaxed_at(scenario: &Scenario, q: &DVector<f64>) -> SerialChain {
    let belief = &scenario.task.belief;
    let mut chain = belief.nominal.chain.clone();
    chain.gravity_m_s2 = Vector3::zeros();
    let state = chain.at(&belief.calibration_tool).state(q.as_slice());
    let length_m = chain.elements.length_m(0, &state);
    chain.elements.springs[0].rest_m = [length_m; 2];
    chain.elements.joint_springs[0].rest = q[2];
    chain
}

fn configurations(scenario: &Scenario, count: usize) -> Vec<DVector<f64>> {
    let mut random = generator(11, 0);
    let ranges = &scenario.task.region.joint_range_rad;
    (0..count)
        .map(|_| {
            let q = ranges.iter();
            let q = q.map(|[low, high]| random.random_range(*low..=*high));
            DVector::from_iterator(ranges.len(), q)
        })
        .collect()
}

const LOAD: Load = Load {
    force_n: Vector3::new(30.0, -20.0, -60.0),
    torque_nm: Vector3::new(5.0, 10.0, -15.0),
};

/// Loaded minus unloaded, position above rotation.
fn deflection(chain: &SerialChain, scenario: &Scenario, k: &[f64], q: &DVector<f64>) -> [f64; 6] {
    let tool = &scenario.task.belief.calibration_tool;
    let mut solver = EquilibriumSolver::new(chain.len());
    let [unloaded, loaded] = [Load::NONE, LOAD].map(|load| {
        let found = solver.solve(&mut chain.at(tool), k, q.as_slice(), &load);
        found.expect("stable");
        solver.state().clone()
    });
    let moved = loaded.tool_position - unloaded.tool_position;
    let turned = rotation_vector(&(loaded.tool_rotation * unloaded.tool_rotation.transpose()));
    [moved.x, moved.y, moved.z, turned.x, turned.y, turned.z]
}

#[test]
fn the_observation_matrix_is_the_equilibriums_derivative() {
    let scenario = stiffly_braced();
    let belief = &scenario.task.belief;
    let compliance = &belief.nominal.compliance_rad_per_nm;
    let joints: Vec<usize> = (0..6).collect();
    let mut most_shared: f64 = 0.0;
    for q in configurations(&scenario, 20) {
        let chain = relaxed_at(&scenario, &q);
        let state = chain.at(&belief.calibration_tool).state(q.as_slice());
        let plain = six_rows(&ObservationMatrix::new(&state, &LOAD, &joints));
        let braced = state.braced(compliance);
        let braced = six_rows(&ObservationMatrix::new(&braced, &LOAD, &joints));
        let sizes = [braced.fixed_rows::<3>(0), braced.fixed_rows::<3>(3)].map(|rows| rows.amax());
        for joint in 0..6 {
            let step = 1e-2 * compliance[joint];
            let at = |by: f64| {
                let mut k = compliance.clone();
                k[joint] += by;
                deflection(&chain, &scenario, &k, &q)
            };
            let (after, before) = (at(step), at(-step));
            for row in 0..6 {
                let slope = (after[row] - before[row]) / (2.0 * step);
                let apart = (slope - braced[(row, joint)]).abs() / sizes[row / 3];
                assert!(apart < 1e-3, "joint {joint}, row {row}: {apart:.1e}");
                let unbraced = (slope - plain[(row, joint)]).abs() / sizes[row / 3];
                most_shared = most_shared.max(unbraced);
            }
        }
    }
    // Without the springs it would be another matrix.
    assert!(most_shared > 0.3, "{most_shared}");
}

/// The search's derivative of sum(B * A) by the joint angles, for springs under tension, where rotations
/// are measured, too.
#[test]
fn the_searchs_gradient_is_that_of_its_matrix() {
    let mut scenario = stiffly_braced();
    for rotation_sigma_rad in [None, Some(2e-5)] {
        scenario.task.belief.instrument.rotation_sigma_rad = rotation_sigma_rad;
        let problem = Problem::new(&scenario.task, Criterion::TestPose);
        let mut evaluator = problem.evaluator();
        let mut random = generator(12, 0);
        for q in configurations(&scenario, 20) {
            let factor = Matrix3xX::from_fn(evaluator.matrix().ncols(), |_, _| {
                random.random_range(-1.0..1.0)
            });
            let mut matrix = evaluator.matrix();
            let mut value = |q: &DVector<f64>| {
                evaluator.readings.move_to(q.as_slice());
                evaluator.observe(&LOAD, &mut matrix);
                matrix.dot(&factor)
            };
            let slopes = DVector::from_fn(6, |joint, _| {
                let mut at = |by: f64| {
                    let mut moved = q.clone();
                    moved[joint] += by;
                    value(&moved)
                };
                (at(1e-5) - at(-1e-5)) / 2e-5
            });
            evaluator.readings.move_to(q.as_slice());
            let mut gradient = vec![0.0; 6];
            evaluator.pull_back(&LOAD, &factor, &mut gradient);
            let apart = (DVector::from_vec(gradient) - &slopes).amax() / slopes.amax();
            assert!(apart < 1e-7, "{rotation_sigma_rad:?}: {apart:.1e}");
            // And by the force.
            let force_gradient = evaluator.force_gradient(&LOAD, &factor);
            let mut beside = |by: Vector3<f64>| {
                let load = Load {
                    force_n: LOAD.force_n + by,
                    ..LOAD
                };
                evaluator.observe(&load, &mut matrix);
                matrix.dot(&factor)
            };
            for axis in 0..3 {
                let mut by = Vector3::zeros();
                by[axis] = 1.0;
                let slope = (beside(by) - beside(-by)) / 2.0;
                let apart = (slope - force_gradient[axis]).abs() / force_gradient.amax();
                assert!(apart < 1e-7, "{rotation_sigma_rad:?}: {apart:.1e}");
            }
        }
    }
}

/// Drives that hardly give way hold load, gravity and springs.
#[test]
fn torque_bounds_hold_what_the_drives_hold() {
    let mut scenario = stiffly_braced();
    scenario.task.belief.nominal.chain.elements.springs[0].stiffness_n_per_m /= 300.0;
    let belief = &scenario.task.belief;
    let (chain, gravity) = (&belief.nominal.chain, belief.nominal.chain.gravity_m_s2);
    let stiff = [1e-11; 6];
    let tool = &belief.calibration_tool;
    let mut solver = EquilibriumSolver::new(6);
    for q in configurations(&scenario, 20) {
        let state = chain.at(tool).state(q.as_slice());
        let found = solver.solve(&mut chain.at(tool), &stiff, q.as_slice(), &LOAD);
        found.expect("stable");
        for joint in 0..6 {
            let bound = SmoothBound {
                of: Bounded::Torque(joint),
                is_upper: true,
                bound: 1.0,
            };
            let (_, torque, _, _) = bound.describe(&state, &LOAD, &gravity);
            let held = (solver.q()[joint] - q[joint]) / stiff[joint];
            assert_near(torque, held, 0.05 + 1e-4 * held.abs());
            let margin = |by: usize, shift: f64| {
                let mut moved = q.clone();
                moved[by] += shift;
                let state = chain.at(tool).state(moved.as_slice());
                bound.margin(&state, &LOAD, &gravity)
            };
            for by in 0..6 {
                let slope = (margin(by, 1e-5) - margin(by, -1e-5)) / 2e-5;
                let derivative = bound.derivative(&state, &LOAD, &gravity, by);
                let allowed = 1e-6 * (1e4 + slope.abs());
                assert_near(slope, derivative, allowed);
            }
        }
    }
}

/// The paper's least squares with springs at work: small deflections give back the compliances that made
/// them.
#[test]
fn linear_identification_knows_the_springs() {
    let mut scenario = stiffly_braced();
    let q = configurations(&scenario, 1).remove(0);
    scenario.task.belief.nominal.chain = relaxed_at(&scenario, &q);
    let belief = &scenario.task.belief;
    let compliance = &belief.nominal.compliance_rad_per_nm;
    let mut measurements = Vec::new();
    // The springs are relaxed at one configuration: loads of several directions tell the joints apart.
    for axis in 0..3 {
        for torque in 0..3 {
            let mut load = Load::NONE;
            load.force_n[axis] = 100.0;
            load.torque_nm[torque] = 100.0;
            let chain = &belief.nominal.chain;
            let mut solver = EquilibriumSolver::new(6);
            let mut rest = |load: &Load| {
                let mut arm = chain.at(&belief.calibration_tool);
                let found = solver.solve(&mut arm, compliance, q.as_slice(), load);
                found.expect("stable");
                solver.state().tool_position
            };
            let deflection_m = rest(&load) - rest(&Load::NONE);
            measurements.push(Measurement {
                configuration_rad: q.clone(),
                load,
                deflection_m,
                sigma_m: None,
                rotation: None,
                approach: None,
                direction: None,
            });
        }
    }
    let parameters = [1, 2];
    let belief = of_compliances(belief, &parameters);
    let case = Case::of_belief(&belief, &measurements, Sigma::Known(1e-8), Method::Linear);
    let found = case.identify().expect("identifiable");
    for joint in parameters {
        let ratio = found.compliance_rad_per_nm[joint] / compliance[joint];
        assert!((ratio - 1.0).abs() < 2e-3, "joint {}: {ratio}", joint + 1);
    }
    let whole = DMatrix::from_diagonal_element(2, 2, 1.0);
    assert_eq!(found.posterior.estimable.basis(), &whole);
}

/// The unloaded arm rests elsewhere with other compliances where springs pull at it. Plans count that under the instrument's noise
/// alone as they do beside a source that makes nothing.
#[test]
fn noise_alone_is_predicted_as_beside_a_source_of_nothing() {
    const NOTHING: &str = "\n[[uncertainty]]\nkind = \"load_scale\"\nstd_relative = 1e-9\n";
    let place = Workplace::new();
    let text = scenario_text("kr270_compensator");
    let list = text.find("[[uncertainty]]").unwrap_or(text.len());
    let noise = text[..list].to_owned();
    place.write("noise.toml", &noise);
    place.write("nothing.toml", noise + NOTHING);
    let plan = shipped("scenarios/plans/klimchik2012_m12.csv");
    let found = ["noise", "nothing"].map(|name| {
        let command = format!("evaluate {name}.toml --plan {plan} --no-proof --json --quiet");
        place.run(&command).json()
    });
    let [noise, nothing] = found.each_ref().map(|each| number(&each["rho0_mm"]));
    assert!((noise / nothing - 1.0).abs() < 1e-6, "{noise} {nothing}");
}
