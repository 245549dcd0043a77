//! What the tests of the search need: searching, and judging by their own means.

use std::f64::consts::TAU;

use elastocal::experiment::Loads;
use elastocal::numeric::random::generator;
use elastocal::plan::search::{
    ApproximateDesign, ExactDesign, PlanSize, Problem, SearchError, approximate_design,
    exact_design,
};
use elastocal::plan::{Criterion, SmoothBound, bounds_of};
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use nalgebra::{DMatrix, Matrix3xX};
use rand::{Rng, RngExt};

use crate::support::unwatched;

/// Searches a plan as the program does: the approximate design for `rho_0`, then the exact one.
pub fn designed(
    problem: &Problem<'_>,
    experiments: u32,
    configurations: u32,
    seed: u64,
) -> Result<(ApproximateDesign, ExactDesign), SearchError> {
    let mut for_rho0 = Problem::new(problem.task, Criterion::TestPose);
    for_rho0.effort = problem.effort;
    let approximate = approximate_design(&for_rho0, seed)?;
    let exact = exact(problem, &approximate, experiments, configurations, seed)?;
    Ok((approximate, exact))
}

/// The second part of that search.
pub fn exact(
    problem: &Problem<'_>,
    approximate: &ApproximateDesign,
    experiments: u32,
    configurations: u32,
    seed: u64,
) -> Result<ExactDesign, SearchError> {
    let watch = unwatched();
    let size = PlanSize {
        measurements: experiments,
        configurations,
    };
    exact_design(problem, approximate, size, seed, watch, &[])
}

/// `rho_0` of the best plan of m measurements (m).
pub fn best_rho0(scenario: &Scenario, experiments: u32, seed: u64) -> f64 {
    let problem = Problem::new(&scenario.task, Criterion::TestPose);
    let found = designed(&problem, experiments, experiments, seed);
    found.expect("there is a plan").1.cost.sqrt()
}

/// The criteria that plans over a region are optimised by.
pub const OPTIMISED: [Criterion; 4] = [
    Criterion::TestPose,
    Criterion::A,
    Criterion::D,
    Criterion::O1,
];

/// Asserts that found / expected is 1 within a tolerance.
pub fn assert_close(what: &str, found: f64, expected: f64, tolerance: f64) {
    let apart = (found / expected - 1.0).abs();
    assert!(
        apart <= tolerance,
        "{what}: found {found}, expected {expected}: {apart:.2e} apart"
    );
}

/// The largest directional derivative trace(A G A^T) among so many feasible experiments, drawn
/// uniformly, on two threads; bounds only, neither collisions nor sight.
pub fn largest_derivative(problem: &Problem<'_>, directions: &DMatrix<f64>, samples: usize) -> f64 {
    let half = |thread: u64| largest_of(problem, directions, samples / 2, thread);
    std::thread::scope(|scope| {
        let other = scope.spawn(|| half(1));
        half(0).max(other.join().expect("the sampling ends"))
    })
}

fn largest_of(
    problem: &Problem<'_>,
    directions: &DMatrix<f64>,
    samples: usize,
    thread: u64,
) -> f64 {
    let task = problem.task;
    let ranges = &task.region.joint_range_rad;
    let bounds = bounds_of(&task.region);
    let mut random = generator(20_240_229, thread);
    let mut evaluator = problem.evaluator();
    let gravity = evaluator.readings.gravity_m_s2();
    let mut matrix = Matrix3xX::zeros(problem.parameters());
    let mut seen = Matrix3xX::zeros(problem.parameters());
    let mut q = vec![0.0; ranges.len()];
    let mut largest = f64::NEG_INFINITY;
    let mut count = 0;
    while count < samples {
        for (angle, [low, high]) in q.iter_mut().zip(ranges) {
            *angle = low + (high - low) * random.random::<f64>();
        }
        let load = random_load(&task.loads, &mut random);
        evaluator.readings.move_to(&q);
        let inside =
            |bound: &SmoothBound| bound.margin(evaluator.readings.state(), &load, &gravity) >= 0.0;
        if bounds.iter().all(inside) {
            evaluator.observe(&load, &mut matrix);
            seen.gemm(1.0, &matrix, directions, 0.0);
            largest = largest.max(seen.dot(&matrix));
            count += 1;
        }
    }
    largest
}

/// A load of those that a plan may use, as large as allowed.
pub fn random_load(loads: &Loads, random: &mut impl Rng) -> Load {
    let [x, y, z] = match loads {
        Loads::Fixed(load) => return *load,
        Loads::List(list) => return list[random.random_range(0..list.len())],
        Loads::Direction { direction, force_n } => (direction * force_n[1]).into(),
        Loads::Any { force_max_n } => {
            // Archimedes: height and longitude of a point on a sphere are uniform.
            let height = 2.0 * random.random::<f64>() - 1.0;
            let (sin, cos) = (TAU * random.random::<f64>()).sin_cos();
            let radius = (1.0 - height * height).sqrt();
            [radius * cos, radius * sin, height].map(|each| each * force_max_n)
        }
    };
    Load::force(x, y, z)
}
