//! The size of a force is a variable of the design, like the angles: arms whose joints bear only so much
//! torque, with optima derived by hand.

use elastocal::experiment::Loads;
use elastocal::numeric::random::generator;
use elastocal::plan::search::{Bound, Problem};
use elastocal::plan::{Assessment, Criterion, Plan, bounds_of};
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use nalgebra::{DMatrix, Matrix3xX, Vector3};
use rand::RngExt;

use crate::planning::{assert_close, designed};
use crate::support::{
    Workplace, assert_has, assert_near_in, leave_open, list, number, scenario, scenario_text,
    state_at,
};

const SIGMA_M: f64 = 0.03e-3;
/// The planar arm stretched: its length (m), and the torque of its weight about joint 1 when it is
/// horizontal (N m): three masses at their distances.
const LENGTH_M: f64 = 1.7;
const WEIGHT_NM: f64 = 9.81 * (14.0 * 0.30 + 6.0 * 0.92 + 3.0 * 1.42);
/// What joint 1 bears (N m), and the largest force (N).
const TORQUE_NM: f64 = 300.0;
const FORCE_N: f64 = 1000.0;

/// The stretched planar arm, which joint 1 turns by up to 20 deg; only the compliance of that is unknown.
fn arm(loads: Loads) -> Scenario {
    let mut scenario = scenario("planar_3r");
    let turn = 20.0_f64.to_radians();
    leave_open(&mut scenario, &[0]);
    scenario.task.region.joint_range_rad = vec![[-turn, turn], [0.0; 2], [0.0; 2]];
    scenario.task.region.joint_torque_max_nm = Some(vec![TORQUE_NM, 1e4, 1e4]);
    scenario.task.loads = loads;
    scenario
}

fn down(low: f64) -> Loads {
    Loads::Direction {
        direction: -Vector3::z(),
        force_n: [low, FORCE_N],
    }
}

fn prediction(scenario: &Scenario, experiments: u32) -> (Plan, f64, f64) {
    let problem = Problem::new(&scenario.task, Criterion::TestPose);
    let (approximate, exact) =
        designed(&problem, experiments, experiments, 1).expect("there is a plan");
    let bound = Bound::new(&scenario.task, &approximate);
    let assessment = Assessment::new(&scenario.task, &exact.plan, Some(&bound));
    assert_eq!(assessment.violations, []);
    let efficiency = assessment.efficiency().expect("a bound");
    assert!(efficiency <= 1.0, "{efficiency}");
    (
        exact.plan,
        assessment.rho0_m.expect("determined"),
        efficiency,
    )
}

/// `rho_0` for a torque of the load about joint 1: sigma |a| / (sqrt(m) L tau).
fn expected(scenario: &Scenario, torque_nm: f64, experiments: u32) -> f64 {
    let column = elastocal::compensation::test_pose_matrix(
        &scenario.task.belief,
        &scenario.task.test_poses[0],
        &[0],
    )
    .norm();
    SIGMA_M * column / (f64::from(experiments).sqrt() * LENGTH_M * torque_nm)
}

// Stretched at the angle t, joint 1 bears the weight G cos t and the load s L cos t. What the load may add
// is T - G cos t: most at t = 20 deg, with the force s = (T - G cos t) / (L cos t) = 107 N of 1000 N.
#[test]
fn a_torque_bound_asks_for_a_smaller_force() {
    let scenario = arm(down(0.0));
    let cosine = 20.0_f64.to_radians().cos();
    let torque = TORQUE_NM - WEIGHT_NM * cosine;
    for experiments in [1, 3] {
        let (plan, rho0, efficiency) = prediction(&scenario, experiments);
        assert_close("rho0", rho0, expected(&scenario, torque, experiments), 1e-5);
        assert!(efficiency > 0.98, "{efficiency}");
        for each in &plan.experiments {
            assert_close(
                "force",
                each.load.force_n.norm(),
                torque / (LENGTH_M * cosine),
                1e-4,
            );
            assert_close(
                "turned",
                each.configuration_rad[0].abs(),
                20.0_f64.to_radians(),
                1e-4,
            );
        }
    }
}

// Pulled upwards, the weight helps: the load may bear G cos t + T, most where the arm is horizontal. A
// force of any direction does that, at right angles to the arm, with 257 N of 1000 N.
#[test]
fn any_force_works_against_the_weight() {
    let scenario = arm(Loads::Any {
        force_max_n: FORCE_N,
    });
    let torque = TORQUE_NM + WEIGHT_NM;
    for experiments in [1, 2] {
        let (plan, rho0, efficiency) = prediction(&scenario, experiments);
        assert_close("rho0", rho0, expected(&scenario, torque, experiments), 1e-5);
        assert!(efficiency > 0.98, "{efficiency}");
        for each in &plan.experiments {
            let state = state_at(&scenario, &each.configuration_rad);
            let found = state.load_torque(0, &each.load);
            assert_close("torque", found, -torque, 1e-5);
            assert!(each.load.force_n.norm() <= FORCE_N * (1.0 + 1e-9));
        }
    }
}

#[test]
fn the_smallest_force_is_honoured() {
    // At 20 deg, 107 N are possible, horizontally 96 N.
    let scenario = arm(down(100.0));
    let (plan, _, _) = prediction(&scenario, 2);
    assert!(
        plan.experiments
            .iter()
            .all(|each| each.load.force_n.norm() >= 100.0)
    );
    let problem = arm(down(110.0));
    let problem = Problem::new(&problem.task, Criterion::TestPose);
    let error = designed(&problem, 2, 2, 1)
        .expect_err("the joint does not bear it")
        .to_string();
    assert!(error.contains("no experiment is feasible"), "{error}");
    assert_has(&error, "torque about joint 1 rejects 100.0 %");
}

// Without torque bounds the largest force is best, as with a fixed load.
#[test]
fn without_torque_bounds_the_largest_force_is_best() {
    let mut scenario = scenario("planar_3r");
    let best = |scenario: &Scenario| {
        let problem = Problem::new(&scenario.task, Criterion::TestPose);
        designed(&problem, 3, 3, 1).expect("there is a plan").1
    };
    let with_fixed = best(&scenario);
    scenario.task.loads = Loads::Direction {
        direction: -Vector3::z(),
        force_n: [10.0, 200.0],
    };
    let with_direction = best(&scenario);
    assert_close("cost", with_direction.cost, with_fixed.cost, 1e-6);
    for each in &with_direction.plan.experiments {
        assert_eq!(each.load, Load::force(0.0, 0.0, -200.0));
    }
}

/// The derivatives with respect to the force, and so to its size, against differences.
#[test]
fn derivatives_by_the_size_are_those_of_differences() {
    let mut scenario = scenario("spatial_3r");
    scenario.task.region.joint_torque_max_nm = Some(vec![300.0, 400.0, 200.0]);
    scenario.task.region.tool_elevation_max_rad = Some(0.5);
    let problem = Problem::new(&scenario.task, Criterion::TestPose);
    let mut evaluator = problem.evaluator();
    let gravity = evaluator.readings.gravity_m_s2();
    let directions = DMatrix::from_fn(3, 3, |row, column| if row == column { 2.0 } else { 0.5 });
    let mut random = generator(4, 0);
    for _ in 0..20 {
        let q: Vec<f64> = (0..3).map(|_| random.random_range(-1.0..1.0)).collect();
        let direction = Vector3::from_fn(|_, _| random.random_range(-1.0..1.0)).normalize();
        let load = |size: f64| {
            let [x, y, z] = (direction * size).into();
            Load::force(x, y, z)
        };
        let (size, step) = (250.0, 1e-2);
        evaluator.readings.move_to(&q);
        let information = |size: f64| {
            let mut matrix = Matrix3xX::zeros(3);
            evaluator.observe(&load(size), &mut matrix);
            ((&matrix * &directions).dot(&matrix), matrix)
        };
        let factor = (&information(size).1 * &directions) * 2.0;
        let slope = (evaluator.clone())
            .force_gradient(&load(size), &factor)
            .dot(&direction);
        let difference = (information(size + step).0 - information(size - step).0) / (2.0 * step);
        assert_close("information", slope, difference, 1e-7);
        for bound in bounds_of(&scenario.task.region) {
            let margin =
                |size: f64| bound.margin(evaluator.readings.state(), &load(size), &gravity);
            let difference = (margin(size + step) - margin(size - step)) / (2.0 * step);
            let slope = (bound.force_derivative(evaluator.readings.state()))
                .map_or(0.0, |slope| slope.dot(&direction));
            assert_near_in(&bound, slope, difference, 1e-9);
        }
    }
}

/// Seen from outside the process, on a KR-270 whose drives do not bear the whole weight.
#[test]
fn a_weak_robot_gets_a_lighter_weight() {
    let workplace = Workplace::new();
    let text = scenario_text("klimchik2012")
        .replace(
            "kind = \"fixed\"\nforce_n = [0, 0, -2500]",
            "kind = \"direction\"\ndirection = [0, 0, -1]\nforce_min_n = 100\nforce_max_n = 20000",
        )
        .replace(
            "[region]\n",
            "[region]\njoint_torque_max_nm = [9000, 9000, 5000, 1500, 1500, 1000]\n",
        );
    workplace.write("cell.toml", text);
    let json = workplace.json("plan cell.toml --plan-out p.csv");
    let efficiency = number(&json["efficiency"]);
    assert!(efficiency > 0.7 && efficiency <= 1.0, "{efficiency}");
    for experiment in list(&json["plan"]) {
        let force = number(&experiment["wrench"][2]);
        assert!(
            (-20000.0..=-100.0).contains(&force) && force > -19_000.0,
            "{force}"
        );
    }
    workplace.done("check cell.toml --plan p.csv");
}

/// Parameters may be given in any order: the derivatives by the angles are those of differences.
#[test]
fn the_order_of_parameters_does_not_matter() {
    let mut scenario = scenario("spatial_3r");
    leave_open(&mut scenario, &[2, 0, 1]);
    let problem = Problem::new(&scenario.task, Criterion::TestPose);
    let mut evaluator = problem.evaluator();
    let load = Load::force(100.0, -200.0, 300.0);
    let weights = Matrix3xX::from_fn(3, |row, column| 1.0 + row as f64 - 0.7 * column as f64);
    let q = [0.3, -0.5, 0.8];
    let mut gradient = [0.0; 3];
    evaluator.readings.move_to(&q);
    evaluator.pull_back(&load, &weights, &mut gradient);
    for joint in 0..3 {
        let mut told = |step: f64| {
            let mut q = q;
            q[joint] += step;
            let mut matrix = Matrix3xX::zeros(3);
            evaluator.readings.move_to(&q);
            evaluator.observe(&load, &mut matrix);
            matrix.dot(&weights)
        };
        let difference = (told(1e-5) - told(-1e-5)) / 2e-5;
        assert_close("slope", gradient[joint], difference, 1e-6);
    }
}
