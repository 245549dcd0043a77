//! The hot paths by name, each ready to be repeated.

use std::hint::black_box;
use std::sync::atomic::AtomicBool;

use elastocal::calibration::calibrate;
use elastocal::identification::{Case, Sigma};
use elastocal::measurement::Measurement;
use elastocal::numeric::random::normal::{LANES, fill_normals};
use elastocal::numeric::random::streams::Stream;
use elastocal::plan::search::{
    PlanSize, Problem, Watch, approximate_design, exact_design, random_plan,
};
use elastocal::plan::{Criterion, Plan, read_plan};
use elastocal::record::run::RunMessage;
use elastocal::scenario::Scenario;
use elastocal::study::runner::{Runner, block_runs};
use elastocal::study::{Conditions, Entry, Level, Setting, TakenPlan, repeated};
use elastocal::task::{AccuracyKind, Method};
use elastocal::testbed::{VirtualRobot, add_noise_of};
use elastocal::view::mcap_file::write_mcap;
use elastocal::view::recording::Recording;
use elastocal::view::rerun_file::write_rerun;
use nalgebra::{DMatrix, Matrix3xX};

use super::fit::Fit;
use super::{absolute, arms};

/// Does its work so many times.
pub type HotPath = Box<dyn FnMut(u64)>;

/// Prepares a path. A number behind its name is that of measurements, or of joints or threads where the name says so.
pub fn hot_path(name: &str) -> HotPath {
    let (kind, size) = match name.rsplit_once('_') {
        Some((kind, digits)) if digits.parse::<u32>().is_ok() => {
            (kind, digits.parse().expect("a number"))
        }
        _ => (name, 0),
    };
    match kind {
        "objective" => objective(paper(), &plan_of(size)),
        "objective_default" => objective(lasting("scenarios/kr270.toml"), &plan_of(size)),
        "objective_laboratory" => objective(laboratory(), &plan_of(size)),
        "objective_joints" => objective(arms::serial_arm(size), &arms::plan(size)),
        "search" => search(),
        "equilibrium" => equilibrium(paper(), &plan_of(3)),
        "equilibrium_joints" => equilibrium(arms::serial_arm(size), &arms::plan(size)),
        "measurement" => measurement(paper()),
        "measurement_flexible" => measurement(flexible()),
        "identify_linear" => identification(Method::Linear, size),
        "identify_nonlinear" => identification(Method::Nonlinear, size),
        "fit" => fit(),
        "fit_absolute" => absolute_fit(0.0),
        "fit_joint_errors" => absolute_fit(2e-4),
        "study_model" => study(paper(), Level::Model, 12, 1),
        "study_model_threads" => study(paper(), Level::Model, 12, size),
        "study_robot" => study(paper(), Level::Robot, 3, 1),
        "study_laboratory" => study(laboratory(), Level::Robot, 3, 1),
        "trial_absolute" => absolute_trials(),
        "normals" => normals(),
        "mcap" => recording_file("run.mcap"),
        "rrd" => recording_file("run.rrd"),
        _ => panic!("there is no path {name:?}"),
    }
}

/// The paper's problem; lives as long as the program.
pub fn paper() -> &'static Scenario {
    lasting("scenarios/klimchik2012.toml")
}

/// A robot with a gravity compensator and three passive joints.
pub fn flexible() -> &'static Scenario {
    lasting("scenarios/kr270_flexible.toml")
}

/// The paper's problem with all that a laboratory does not know exactly.
fn laboratory() -> &'static Scenario {
    lasting("scenarios/kr270_laboratory.toml")
}

fn lasting(path: &str) -> &'static Scenario {
    let scenario = Scenario::load(path.as_ref()).expect("a valid scenario");
    Box::leak(Box::new(scenario))
}

/// The size of the largest plan of the paper's Table 4 that makes up so many experiments.
fn size_of_part(experiments: u32) -> u32 {
    [2, 3, 4, 6, 12]
        .into_iter()
        .rfind(|size| experiments.is_multiple_of(*size))
        .expect("a multiple of a plan of Table 4")
}

/// A plan of the paper's Table 4, or the largest one over and over.
pub fn plan_of(experiments: u32) -> Plan {
    let size = size_of_part(experiments);
    let path = format!("scenarios/plans/klimchik2012_m{size}.csv");
    let mut plan = read_plan(path.as_ref(), 6).expect("a valid plan");
    let once = plan.experiments.clone();
    for _ in 1..experiments / size {
        plan.experiments.extend_from_slice(&once);
    }
    plan
}

/// Measurements with noise of a plan of the paper's Table 4, or those of the largest one over and over:
/// the identification then needs as many iterations however many there are.
pub fn measurements(scenario: &Scenario, experiments: u32) -> Vec<Measurement> {
    let size = size_of_part(experiments);
    let site = &scenario.task.belief.calibration_tool.name;
    let instrument = &scenario.task.belief.instrument;
    let mut once = VirtualRobot::new(&scenario.truth.robot, site)
        .expect("the site exists")
        .measure_noise_free(&plan_of(size), instrument)
        .expect("stable");
    add_noise_of(&mut once, instrument, 1, 0);
    vec![once; (experiments / size) as usize].concat()
}

/// `rho_0`^2 of a plan (m^2), and its gradient by all joint angles.
pub fn value_and_gradient(
    scenario: &'static Scenario,
    plan: &Plan,
) -> impl FnMut() -> (f64, Vec<f64>) + use<> {
    let problem = Problem::new(&scenario.task, Criterion::TestPose);
    let experiments = plan.experiments.clone();
    let mut evaluator = problem.evaluator();
    let mut cost = problem.cost();
    let size = problem.parameters();
    let nothing = Plan {
        experiments: Vec::new(),
    };
    let before = problem.information(&nothing);
    let mut information = before.clone();
    let mut directions = DMatrix::zeros(size, size);
    let mut matrix = Matrix3xX::zeros(size);
    let mut factor = Matrix3xX::zeros(size);
    let joints = scenario.task.belief.joints();
    move || {
        let mut gradient = vec![0.0; joints * experiments.len()];
        information.copy_from(&before);
        for experiment in &experiments {
            evaluator
                .readings
                .move_to(experiment.configuration_rad.as_slice());
            evaluator.observe(&experiment.load, &mut matrix);
            information.gemm_tr(1.0, &matrix, &matrix, 1.0);
        }
        let value = cost.cost(&information, &mut directions);
        for (experiment, gradient) in experiments.iter().zip(gradient.chunks_exact_mut(joints)) {
            evaluator
                .readings
                .move_to(experiment.configuration_rad.as_slice());
            evaluator.observe(&experiment.load, &mut matrix);
            factor.gemm(-2.0, &matrix, &directions, 0.0);
            evaluator.pull_back(&experiment.load, &factor, gradient);
        }
        (value, gradient)
    }
}

fn objective(scenario: &'static Scenario, plan: &Plan) -> HotPath {
    over_and_over(value_and_gradient(scenario, plan))
}

/// A search to a certified plan with less effort than the program's, on one thread.
fn search() -> HotPath {
    let mut problem = Problem::new(&paper().task, Criterion::TestPose);
    problem.effort.probes = 4;
    problem.effort.certificate_probes = 20;
    problem.effort.searches = 4;
    let pool = threads(1);
    over_and_over(move || {
        pool.install(|| {
            let bound = approximate_design(&problem, 1).expect("a feasible region");
            let stop = AtomicBool::new(false);
            let watch = Watch {
                stop: &stop,
                progress: &|_, _, _| {},
            };
            exact_design(&problem, &bound, PlanSize::all_different(3), 1, watch, &[])
                .expect("a plan")
        })
    })
}

/// The static equilibrium of the first experiment in MuJoCo.
fn equilibrium(scenario: &'static Scenario, plan: &Plan) -> HotPath {
    let experiment = plan.experiments[0].clone();
    let site = &scenario.task.belief.calibration_tool.name;
    let mut robot = VirtualRobot::new(&scenario.truth.robot, site).expect("the site exists");
    over_and_over(move || {
        robot
            .rest(&experiment.configuration_rad, &experiment.load)
            .expect("stable")
    })
}

/// A virtual measurement: an unloaded and a loaded equilibrium.
fn measurement(scenario: &'static Scenario) -> HotPath {
    let experiment = plan_of(3).experiments[0].clone();
    let site = &scenario.task.belief.calibration_tool.name;
    let mut robot = VirtualRobot::new(&scenario.truth.robot, site).expect("the site exists");
    over_and_over(move || robot.displacement(1, &experiment).expect("stable"))
}

fn identification(method: Method, experiments: u32) -> HotPath {
    let scenario = paper();
    let measurements = measurements(scenario, experiments);
    over_and_over(move || {
        let belief = &scenario.task.belief;
        let sigma = Sigma::Known(belief.instrument.sigma_m);
        let case = Case::of_belief(belief, &measurements, sigma, method);
        case.identify().expect("identifiable")
    })
}

/// 45 parameters from 1000 poses, on one thread.
fn fit() -> HotPath {
    let fit = Fit::new(paper());
    let pool = threads(1);
    over_and_over(move || pool.install(|| fit.solve()))
}

/// Frames and geometry of a UR10 whose joints have such transmission errors, on one thread.
fn absolute_fit(transmission_error_rad: f64) -> HotPath {
    let mut fit = absolute::fit(lasting("scenarios/ur10.toml"), transmission_error_rad);
    let pool = threads(1);
    over_and_over(move || pool.install(&mut fit))
}

/// Virtual robots that are read, identified and looked at, eight at a time, on one thread.
fn absolute_trials() -> HotPath {
    let mut trials = absolute::trials(lasting("scenarios/ur10.toml"));
    let pool = threads(1);
    Box::new(move |blocks| pool.install(|| trials(blocks)))
}

/// Monte Carlo runs of one plan, a block at a time: 2048 runs of the model, or 64 of the robot.
fn study(scenario: &'static Scenario, level: Level, experiments: u32, on_threads: u32) -> HotPath {
    let plan = repeated(&plan_of(experiments), experiments).expect("as many");
    let entries = Box::leak(Box::new([Entry {
        name: "plan".to_owned(),
        setting: 0,
        plan: Some(TakenPlan::Deflections(plan)),
        is_random: false,
    }]));
    let conditions = Conditions::plain(&scenario.task, experiments);
    let setting = Setting::new(&scenario.task, &scenario.truth, conditions);
    let settings = Box::leak(Box::new([setting]));
    let runner = Runner::new(settings, scenario.seed, level, entries).expect("a valid study");
    let pool = threads(on_threads);
    Box::new(move |blocks| {
        let trials = blocks * runner.block_runs();
        let tallies = pool.install(|| runner.run(trials, 0..blocks, 1, &|_| {}));
        black_box(tallies.expect("a valid study"));
    })
}

/// The normal numbers of a block of runs of 12 measurements.
fn normals() -> HotPath {
    let mut normals = vec![[0.0; LANES]; 36];
    Box::new(move |blocks| {
        for first in (0..blocks * block_runs(AccuracyKind::Relative, Level::Model)).step_by(LANES) {
            fill_normals(Stream::Noise, 1, first, &mut normals);
            black_box(&normals);
        }
    })
}

/// The recording of the paper's plan of three and of a random one.
pub fn recording() -> Recording {
    let scenario = paper();
    let plans = [
        ("klimchik2012_m3", plan_of(3)),
        (
            "random",
            random_plan(&scenario.task, 3, scenario.seed, 0).expect("feasible"),
        ),
    ];
    let calibrations = plans.map(|(name, plan)| {
        let (task, truth, seed) = (&scenario.task, &scenario.truth, scenario.seed);
        let made = calibrate(task, truth, &plan, seed, 0).expect("a calibration");
        RunMessage::of_deflections(task, truth, seed, name, &made).expect("it works")
    });
    Recording::new(scenario, &calibrations).expect("a recording")
}

fn recording_file(name: &str) -> HotPath {
    let recording = recording();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join(name);
    let write = if name == "run.mcap" {
        write_mcap
    } else {
        write_rerun
    };
    over_and_over(move || {
        // The folder lives as long as the work.
        let _ = &folder;
        write(&path, &recording).expect("written");
    })
}

fn over_and_over<T>(mut work: impl FnMut() -> T + 'static) -> HotPath {
    Box::new(move |times| {
        for _ in 0..times {
            black_box(work());
        }
    })
}

fn threads(count: u32) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new()
        .num_threads(count as usize)
        .build()
        .expect("threads")
}
