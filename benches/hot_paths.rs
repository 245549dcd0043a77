//! The cost of the hot paths: `cargo bench`.

#![expect(clippy::expect_used, reason = "a bench that cannot go on fails")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use elastocal::identification::{Sigma, identify};
use elastocal::plan::search::Problem;
use elastocal::plan::{Plan, read_plan};
use elastocal::random::normal::{LANES, Stream, fill_normals};
use elastocal::robot::Load;
use elastocal::scenario::{Method, Scenario};
use elastocal::testbed::{VirtualRobot, settle};
use nalgebra::{DMatrix, Matrix3xX};

fn scenario() -> Scenario {
    Scenario::load("scenarios/klimchik2012.toml".as_ref()).expect("the scenario is valid")
}

fn table4(experiments: u32) -> Plan {
    let path = format!("scenarios/plans/klimchik2012_m{experiments}.csv");
    read_plan(path.as_ref(), 6).expect("the plan is valid")
}

/// The objective of a plan, and its gradient by all joint angles.
fn objective(bench: &mut Criterion) {
    let scenario = scenario();
    let problem = Problem::new(&scenario, elastocal::plan::Criterion::TestPose);
    for experiments in [3, 12] {
        let plan = table4(experiments);
        let mut observer = problem.observer();
        let mut cost = problem.cost();
        let size = problem.parameters();
        let mut information = DMatrix::zeros(size, size);
        let mut directions = DMatrix::zeros(size, size);
        let mut matrix = Matrix3xX::zeros(size);
        let mut factor = Matrix3xX::zeros(size);
        let mut gradient = vec![0.0; scenario.joints()];
        bench.bench_function(
            &format!("objective and gradient, m = {experiments}"),
            |bench| {
                bench.iter(|| {
                    information.fill(0.0);
                    for experiment in &plan.experiments {
                        observer.move_to(experiment.configuration_rad.as_slice());
                        observer.observe(&experiment.load, &mut matrix);
                        information.gemm_tr(1.0, &matrix, &matrix, 1.0);
                    }
                    let value = cost.cost(&information, &mut directions);
                    for experiment in &plan.experiments {
                        observer.move_to(experiment.configuration_rad.as_slice());
                        observer.observe(&experiment.load, &mut matrix);
                        factor.gemm(-2.0, &matrix, &directions, 0.0);
                        gradient.fill(0.0);
                        observer.pull_back(&experiment.load, &factor, &mut gradient);
                        black_box(&gradient);
                    }
                    black_box(value)
                });
            },
        );
    }
}

/// A virtual measurement, by static equilibria and by simulating in time until the robot rests.
fn measurement(bench: &mut Criterion) {
    let scenario = scenario();
    let plan = table4(3);
    let experiment = &plan.experiments[0];
    let site = &scenario.calibration_tool.name;
    let mut robot = VirtualRobot::new(&scenario.true_robot, site).expect("the site exists");
    bench.bench_function("static equilibrium in MuJoCo", |bench| {
        bench.iter(|| {
            let (position, _, _) = robot
                .rest(&experiment.configuration_rad, &experiment.load)
                .expect("stable");
            black_box(position)
        });
    });
    bench.bench_function("virtual measurement", |bench| {
        bench.iter(|| black_box(robot.displacement(1, experiment).expect("stable")));
    });
    let mut group = bench.benchmark_group("dynamics");
    group.sample_size(10);
    group.bench_function("the same, stepping until rest", |bench| {
        bench.iter(|| {
            for load in [Load::NONE, experiment.load] {
                let q = &experiment.configuration_rad;
                black_box(settle(&scenario.true_robot, site, q, &load).expect("settles"));
            }
        });
    });
    group.finish();
}

/// Identification from 3 and 12 measurements.
fn identification(bench: &mut Criterion) {
    let scenario = scenario();
    let site = &scenario.calibration_tool.name;
    let mut robot = VirtualRobot::new(&scenario.true_robot, site).expect("the site exists");
    for experiments in [3, 12] {
        let measurements = robot
            .measure(&table4(experiments), &scenario.instrument, 1, 0)
            .expect("stable");
        for method in [Method::Linear, Method::Nonlinear] {
            let name = format!("identification, {method:?}, m = {experiments}");
            bench.bench_function(&name, |bench| {
                bench.iter(|| {
                    identify(
                        &scenario.nominal,
                        &scenario.calibration_tool,
                        &scenario.parameters,
                        black_box(&measurements),
                        Sigma::Known(scenario.instrument.sigma_m),
                        method,
                    )
                });
            });
        }
    }
}

/// The normal numbers of a Monte Carlo run: eight runs of 36.
fn normals(bench: &mut Criterion) {
    let mut normals = vec![[0.0; LANES]; 36];
    let mut run = 0;
    bench.bench_function("8 x 36 normal numbers", |bench| {
        bench.iter(|| {
            fill_normals(Stream::Noise, 1, run, &mut normals);
            run += LANES as u64;
            black_box(&normals);
        });
    });
}

criterion_group!(benches, objective, measurement, identification, normals);
criterion_main!(benches);
