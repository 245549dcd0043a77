//! The paths' data and results as JSON, so that other programs do the same work and show that they
//! come to the same numbers.

use elastocal::identification::{Case, Sigma};
use elastocal::numeric::random::normal::{LANES, fill_normals};
use elastocal::numeric::random::streams::Stream;
use elastocal::plan::search::{Problem, random_plan};
use elastocal::plan::{Criterion, Plan};
use elastocal::robot::{Load, Tool};
use elastocal::scenario::Scenario;
use elastocal::study::model_level::LinearModel;
use elastocal::study::robot_level::{PreparedPlan, RobotRuns};
use elastocal::task::Method;
use elastocal::testbed::VirtualRobot;
use elastocal::view::mcap_file::write_mcap;
use elastocal::view::rerun_file::write_rerun;
use nalgebra::{DMatrix, Isometry3, Matrix3xX};
use serde_json::{Value, json};

use super::fit::Fit;
use super::paths::{flexible, measurements, paper, plan_of, recording, value_and_gradient};

/// Experiments that selections choose from.
const POOL: u32 = 200;

/// All that the peers need.
pub fn problem() -> Value {
    let scenario = paper();
    let pose = &scenario.task.test_poses[0];
    json!({
        "sigma_m": scenario.task.belief.instrument.sigma_m,
        "parameters": scenario.task.belief.parameters,
        "compliance_rad_per_nm": scenario.task.belief.nominal.compliance_rad_per_nm,
        "model": "models/kr270.xml",
        "gravity_m_s2": scenario.task.belief.nominal.chain.gravity_m_s2.as_slice(),
        "joints": scenario.task.belief.nominal.chain.joints.iter().map(|joint| json!({
            "name": joint.name,
            "previous_from_link": isometry(&joint.previous_from_link),
            "axis": joint.axis.as_slice(),
            "mass_kg": joint.mass_kg,
            "centre_of_mass_m": joint.centre_of_mass_m.as_slice(),
        })).collect::<Vec<_>>(),
        "calibration_tool": tool(&scenario.task.belief.calibration_tool),
        "machining_tool": tool(&scenario.task.belief.machining_tool),
        "test_pose": {
            "q_rad": pose.configuration_rad.as_slice(),
            "wrench": pose.load.wrench().as_slice(),
        },
        "plans": { "3": plan(scenario, 3), "12": plan(scenario, 12) },
        "study": study(scenario),
        "equilibrium": { "tool_m": at_rest(scenario) },
        "flexible": { "model": "models/kr270_flexible.xml", "tool_m": at_rest(flexible()) },
        "pool": pool(scenario),
        "recordings": recordings(),
        "fit": Fit::new(scenario).record(),
    })
}

fn isometry(isometry: &Isometry3<f64>) -> Vec<Vec<f64>> {
    rows(&DMatrix::from_column_slice(
        4,
        4,
        isometry.to_homogeneous().as_slice(),
    ))
}

fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    let row = |row: nalgebra::DVectorView<'_, f64>| row.iter().copied().collect();
    matrix.transpose().column_iter().map(row).collect()
}

fn tool(tool: &Tool) -> Value {
    json!({
        "site": tool.name,
        "joints": tool.joints,
        "link_from_tool": isometry(&tool.link_from_tool),
    })
}

/// A plan of Table 4 with the results of objective and identification.
fn plan(scenario: &'static Scenario, experiments: u32) -> Value {
    let plan = plan_of(experiments);
    let (square_m2, gradient) = value_and_gradient(scenario, &plan)();
    let measured = measurements(scenario, experiments);
    let identified = |method| {
        let belief = &scenario.task.belief;
        let sigma = Sigma::Known(belief.instrument.sigma_m);
        let case = Case::of_belief(belief, &measured, sigma, method);
        case.identify().expect("identifiable")
    };
    let linear = identified(Method::Linear);
    let nonlinear = identified(Method::Nonlinear);
    json!({
        "q_rad": plan.experiments.iter().map(|each| each.configuration_rad.as_slice()).collect::<Vec<_>>(),
        "wrench": plan.experiments.iter().map(|each| each.load.wrench().as_slice().to_vec()).collect::<Vec<_>>(),
        "deflection_m": measured.iter().map(|each| each.deflection_m.as_slice()).collect::<Vec<_>>(),
        "rho0_square_m2": square_m2,
        "gradient": gradient,
        "linear": {
            "compliance_rad_per_nm": linear.compliance_rad_per_nm,
            "covariance": rows(&linear.posterior.covariance),
        },
        "nonlinear": {
            "compliance_rad_per_nm": nonlinear.compliance_rad_per_nm,
            "covariance": rows(&nonlinear.posterior.covariance),
        },
    })
}

/// The first runs of both levels with their normals.
fn study(scenario: &Scenario) -> Value {
    let mut normals = vec![[0.0; LANES]; 36];
    fill_normals(Stream::Noise, scenario.seed, 0, &mut normals);
    let model = LinearModel::new(&scenario.task, &scenario.truth);
    let batch = model
        .plan(&plan_of(12))
        .expect("determined")
        .run(&normals, &[]);
    let plan = plan_of(3);
    let plan = PreparedPlan::new(&scenario.task, &plan);
    let mut robot = RobotRuns::new(&scenario.task, &scenario.truth).expect("the tools exist");
    let runs: Vec<(f64, f64)> = (0..LANES)
        .map(|lane| robot.run(&plan, &normals, &[], lane).expect("a run"))
        .map(|outcome| (outcome.square, outcome.nees))
        .collect();
    json!({
        "normals": normals,
        "model": { "square": batch.square, "nees": batch.nees },
        "robot": {
            "square": runs.iter().map(|run| run.0).collect::<Vec<_>>(),
            "nees": runs.iter().map(|run| run.1).collect::<Vec<_>>(),
        },
    })
}

/// Where a robot's tool rests in the first experiment of the plan of three, without and with load.
fn at_rest(scenario: &Scenario) -> [Vec<f64>; 2] {
    let site = &scenario.task.belief.calibration_tool.name;
    let mut robot = VirtualRobot::new(&scenario.truth.robot, site).expect("the site exists");
    let experiment = &plan_of(3).experiments[0];
    [Load::NONE, experiment.load].map(|load| {
        let found = robot.rest(&experiment.configuration_rad, &load);
        found.expect("stable").0.as_slice().to_vec()
    })
}

/// Random feasible experiments with their observation matrices, and the test pose's, in units of
/// typical compliances and of sigma: `rho_0` is in metres.
fn pool(scenario: &Scenario) -> Value {
    let drawn: Plan = random_plan(&scenario.task, POOL, scenario.seed, 0).expect("feasible");
    let problem = Problem::new(&scenario.task, Criterion::TestPose);
    let mut evaluator = problem.evaluator();
    let mut matrix = Matrix3xX::zeros(problem.parameters());
    let matrices: Vec<Vec<Vec<f64>>> = drawn
        .experiments
        .iter()
        .map(|each| {
            evaluator
                .readings
                .move_to(each.configuration_rad.as_slice());
            evaluator.observe(&each.load, &mut matrix);
            rows(&DMatrix::from_column_slice(
                3,
                matrix.ncols(),
                matrix.as_slice(),
            ))
        })
        .collect();
    json!({ "observation_matrices": matrices })
}

/// The recordings as files for the peers to read.
fn recordings() -> Value {
    let recording = recording();
    let folder = std::path::Path::new("out/bench");
    std::fs::create_dir_all(folder).expect("a folder for recordings");
    write_mcap(&folder.join("run.mcap"), &recording).expect("written");
    write_rerun(&folder.join("run.rrd"), &recording).expect("written");
    json!({ "mcap": "out/bench/run.mcap", "rrd": "out/bench/run.rrd" })
}
