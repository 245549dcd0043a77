//! Arms of three joints: plans whose optimality can be derived by hand, each in its test's comment,
//! and the equivalence theorem on fresh samples where it cannot.
//!
//! Notation: L is the distance from a joint to the tool of the stretched arm, F the force's size,
//! sigma the standard deviation, `a_j` column j of the test pose's matrix, `J_j` column j of the Jacobian.
//! An experiment shows `k_j` through column j of its observation matrix, `J_j` (`J_j` . F).

use elastocal::compensation::test_pose_matrix;
use elastocal::experiment::Loads;
use elastocal::plan::search::{ExactDesign, Problem, SearchError, approximate_design};
use elastocal::plan::{Criterion, Experiment};
use elastocal::robot::Load;
use elastocal::scenario::Scenario;

use crate::planning::{OPTIMISED, assert_close, best_rho0, designed, largest_derivative};
use crate::support::{leave_open, scenario, state_at};

// Link lengths of models/planar_3r.xml and of models/spatial_3r.xml (m).
const PLANAR_M: [f64; 3] = [0.7, 0.5, 0.5];
const SPATIAL_M: f64 = 0.8 + 0.7;
/// The forces of their scenarios (N).
const PLANAR_N: f64 = 200.0;
const SPATIAL_N: f64 = 400.0;
const SIGMA_M: f64 = 0.03e-3;

/// A shipped scenario with fewer unknown compliances.
fn scenario_of(name: &str, parameters: &[usize]) -> Scenario {
    let mut scenario = scenario(name);
    leave_open(&mut scenario, parameters);
    scenario
}

/// The lengths of the columns of the test pose's matrix (N m^2).
fn test_pose_columns(scenario: &Scenario) -> Vec<f64> {
    let matrix = test_pose_matrix(
        &scenario.task.belief,
        &scenario.task.test_poses[0],
        &scenario.task.belief.parameters,
    );
    matrix.column_iter().map(|column| column.norm()).collect()
}

fn best(scenario: &Scenario, criterion: Criterion, experiments: u32) -> ExactDesign {
    let problem = Problem::new(&scenario.task, criterion);
    let found = designed(&problem, experiments, experiments, 1);
    found.expect("there is a plan").1
}

/// No experiment of a fresh sample may prediction more than the cost of an optimal approximate design:
/// the general equivalence theorem. The bound that the search certifies holds for the same reason.
fn assert_optimal(problem: &Problem<'_>) {
    let design = approximate_design(problem, 1).expect("there is a design");
    let certificate = &design.certificate;
    assert!(certificate.largest_inside <= certificate.cost * 1.0002);
    let sampled = largest_derivative(problem, &design.directions, 200_000);
    let largest = certificate.largest_derivative;
    assert!(
        sampled <= largest * (1.0 + 1e-9),
        "{sampled} above {largest}"
    );
    // And the sample is not blind: it comes near.
    assert!(sampled > 0.95 * largest, "{sampled} far below {largest}");
}

/// With one unknown, `rho_0`^2 = sigma^2 |a|^2 / sum |J|^2 (J . F)^2. |J| is the distance r from the
/// joint to the tool, and J . F at most r F, so each term is at most L^4 F^2: the stretched arm, with
/// the force at right angles. Hence `rho_0` = sigma |a| / (sqrt(m) L^2 F), and the bound is met for every m.
#[test]
fn one_compliance_is_seen_best_by_the_stretched_arm() {
    for joint in 0..3 {
        let scenario = scenario_of("planar_3r", &[joint]);
        let length: f64 = PLANAR_M[joint..].iter().sum();
        let column = test_pose_columns(&scenario)[0];
        for experiments in [1_u32, 4] {
            let expected =
                SIGMA_M * column / (f64::from(experiments).sqrt() * length.powi(2) * PLANAR_N);
            let found = best_rho0(&scenario, experiments, 1);
            assert_close(&format!("joint {}", joint + 1), found, expected, 1e-6);
        }
        let plan = best(&scenario, Criterion::TestPose, 1).plan;
        let state = state_at(&scenario, &plan.experiments[0].configuration_rad);
        let moved = state.position_column(joint);
        assert_close("the stretched arm", moved.norm(), length, 1e-6);
        assert_close("at right angles", moved.z.abs(), length, 1e-6);
        assert_optimal(&Problem::new(&scenario.task, Criterion::TestPose));
    }
    // In space, under a force that may have any direction, about the vertical axis and the shoulder.
    for joint in 0..2 {
        let scenario = scenario_of("spatial_3r", &[joint]);
        let column = test_pose_columns(&scenario)[0];
        let expected = SIGMA_M * column / (SPATIAL_M.powi(2) * SPATIAL_N);
        let found = best_rho0(&scenario, 1, 1);
        assert_close(&format!("joint {}", joint + 1), found, expected, 1e-6);
    }
}

// Two unknowns at the ends of two equal links of length l, one measurement. With u = J_2, v = J_3 and
// the elbow angle q (u and v are as long as 2 l cos(q/2) and l, with q/2 between them),
// det(A^T A) = F^4 (u.f)^2 (v.f)^2 |u x v|^2 and |u x v| = l^2 sin q. Joint 1 turns the whole against
// the force: (u.f)(v.f) = |u||v| cos(x) cos(x - q/2) is largest at x = q/4, where the force bisects u
// and v, with the value (|u||v| + u.v) / 2 = l^2 c (1 + c), c = cos(q/2). So the root of the
// determinant is F^2 2 l^4 s c^2 (1 + c), s = sin(q/2). Its logarithm's derivative vanishes where
// c/s - 2 s/c - s/(1 + c) = 0, that is 4 c^2 - c - 2 = 0: c = (1 + sqrt(33)) / 8, q = 65.07 deg.
#[test]
fn the_d_optimal_elbow_of_two_equal_links_is_65_degrees() {
    let scenario = scenario_of("planar_3r", &[1, 2]);
    let found = best(&scenario, Criterion::D, 1);
    let [_, length, _] = PLANAR_M;
    let c = (1.0 + 33.0_f64.sqrt()) / 8.0;
    let s = (1.0 - c * c).sqrt();
    let root = PLANAR_N.powi(2) * 2.0 * length.powi(4) * s * c * c * (1.0 + c);
    let compliance = &scenario.task.belief.nominal.compliance_rad_per_nm;
    let expected = root * compliance[1] * compliance[2] / SIGMA_M.powi(2);
    assert_close("determinant", found.cost.recip(), expected, 1e-6);

    let experiment = &found.plan.experiments[0];
    let elbow = experiment.configuration_rad[2].abs();
    assert!((elbow - 2.0 * c.acos()).abs() < 1e-3, "{elbow} rad");
    let state = state_at(&scenario, &experiment.configuration_rad);
    let cosine = |joint: usize| state.position_column(joint).normalize().z.abs();
    assert!((cosine(1) - cosine(2)).abs() < 1e-3);

    // Two different measurements beat this one taken twice: the cost per measurement falls by 29 %.
    let problem = Problem::new(&scenario.task, Criterion::D);
    assert_optimal(&problem);
    assert!(2.0 * best(&scenario, Criterion::D, 2).cost < 0.71 * found.cost);
}

// The spatial arm with a known elbow: about the vertical axis and the shoulder, both on axis 1, J_1 is at
// right angles to the arm's plane and J_2 lies in it. With R the tool's distance from axis 1, h its
// height over the shoulder, r^2 = R^2 + h^2, the information of every experiment is diagonal,
// (x, y) = (R^2 (J_1.F)^2, r^2 (J_2.F)^2):
//   a vertical force:      (0, r^2 R^2 F^2),
//   a force along y at q1: (R^4 F^2 cos^2 q1, r^2 h^2 F^2 sin^2 q1).
// In both x + y <= r^4 F^2 <= L^4 F^2 = I, with equality for the stretched arm, at (0, I) and (I, 0). So
// `rho_0`^2 = sigma^2 (|a_1|^2 / x + |a_2|^2 / y) is minimised over x + y = I: the weights are as the
// roots of the cost shares, |a_1| : |a_2|, and m `rho_0`^2 >= sigma^2 (|a_1| + |a_2|)^2 / I.
// A plan of m measurements takes the best whole numbers, m_1 + m_2 = m.
#[test]
fn separate_compliances_share_the_measurements_as_roots_of_their_cost() {
    let mut scenario = scenario_of("spatial_3r", &[0, 1]);
    scenario.task.loads = Loads::List(vec![
        Load::force(0.0, 0.0, -SPATIAL_N),
        Load::force(0.0, SPATIAL_N, 0.0),
    ]);
    let columns = test_pose_columns(&scenario);
    let information = SPATIAL_M.powi(4) * SPATIAL_N.powi(2);
    let of_shares = |one: f64, other: f64| {
        SIGMA_M * ((columns[0].powi(2) / one + columns[1].powi(2) / other) / information).sqrt()
    };

    let problem = Problem::new(&scenario.task, Criterion::TestPose);
    assert_optimal(&problem);
    let design = approximate_design(&problem, 1).expect("there is a design");
    let total: f64 = columns.iter().sum();
    let bound = of_shares(columns[0] / total, columns[1] / total);
    assert_close("bound", design.certificate.cost.sqrt(), bound, 1e-4);
    // The bound leaves room for plans as they are printed.
    let printed = design.certificate.lower_bound(1).expect("a bound").sqrt();
    assert!(printed < bound && printed > 0.999 * bound, "{printed}");
    // The share of the measurements that show joint 1.
    let share: f64 = (design.support.iter().zip(&design.weights))
        .filter(|(point, _)| point.matrix.column(0).norm() > point.matrix.column(1).norm())
        .map(|(_, weight)| weight)
        .sum();
    assert_close("share", share, columns[0] / total, 0.01);

    for experiments in 2..=7 {
        let splits = (1..experiments)
            .map(|one| of_shares(f64::from(one), f64::from(experiments - one)))
            .fold(f64::INFINITY, f64::min);
        let found = best_rho0(&scenario, experiments, 1);
        assert_close(&format!("m = {experiments}"), found, splits, 1e-6);
    }
}

// The same arm under a force of any direction: J_1.F and J_2.F are components of F at right angles, so
// horizontally stretched x + y = L^2 ((J_1.F)^2 + (J_2.F)^2) = I can be split at will within one
// measurement, and even m = 1 reaches the bound. In relative units, with s_j = k_j^2 m I / sigma^2, the
// eigenvalues are w s_1 and (1 - w) s_2, and every criterion has its best w in closed form:
//   A: 1/(w s_1) + 1/((1 - w) s_2)         >= (1/sqrt(s_1) + 1/sqrt(s_2))^2
//   D: sqrt(w (1 - w) s_1 s_2)             <= sqrt(s_1 s_2) / 2;    O1 is its root
#[test]
fn a_free_force_splits_one_measurement_by_every_criterion() {
    let scenario = scenario_of("spatial_3r", &[0, 1]);
    let information = SPATIAL_M.powi(4) * SPATIAL_N.powi(2);
    let total: f64 = test_pose_columns(&scenario).iter().sum();
    for experiments in [1_u32, 2] {
        let measurements = f64::from(experiments);
        let s: Vec<f64> = scenario.task.belief.nominal.compliance_rad_per_nm[..2]
            .iter()
            .map(|k| k.powi(2) * measurements * information / SIGMA_M.powi(2))
            .collect();
        let sum = |power: f64| s[0].powf(power) + s[1].powf(power);
        for criterion in OPTIMISED {
            let expected = match criterion {
                Criterion::TestPose => SIGMA_M * total / (measurements * information).sqrt(),
                Criterion::A => sum(-0.5).powi(2),
                Criterion::D => (s[0] * s[1]).sqrt() / 2.0,
                _ => ((s[0] * s[1]).sqrt() / 2.0).sqrt(),
            };
            let found = best(&scenario, criterion, experiments);
            let problem = Problem::new(&scenario.task, criterion);
            let value = problem
                .cost_of(criterion)
                .value(&problem.information(&found.plan))
                .expect("regular");
            let what = format!("{criterion:?}, m = {experiments}");
            assert_close(&what, value, expected, 1e-9);
            let force = |each: &Experiment| each.load.force_n.norm();
            let largest = found.plan.experiments.iter().map(force).fold(0.0, f64::max);
            assert_close(&what, largest, SPATIAL_N, 1e-12);
        }
    }
}

#[test]
fn no_experiment_beats_the_designs_for_all_three_joints() {
    for name in ["planar_3r", "spatial_3r"] {
        let scenario = scenario(name);
        for criterion in [Criterion::TestPose, Criterion::A, Criterion::D] {
            assert_optimal(&Problem::new(&scenario.task, criterion));
        }
    }
}

/// The arm moves in its plane: one measurement gives two numbers, and three compliances are unknown.
#[test]
fn one_measurement_in_a_plane_cannot_determine_three_compliances() {
    let scenario = scenario("planar_3r");
    for criterion in OPTIMISED {
        let found = designed(&Problem::new(&scenario.task, criterion), 1, 1, 1);
        let expected = SearchError::Singular {
            experiments: 1,
            parameters: 3,
        };
        assert_eq!(found.err(), Some(expected), "{criterion:?}");
    }
}
