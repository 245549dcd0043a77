//! Monte Carlo studies: exact tallies, runs that keep what was predicted, wrong inputs.

use elastocal::calibration::calibrate;
use elastocal::numeric::random::normal::{LANES, fill_normals};
use elastocal::numeric::random::streams::Stream;
use elastocal::scenario::Scenario;
use elastocal::study::model_level::LinearModel;
use elastocal::study::robot_level::{PreparedPlan, RobotRuns};
use elastocal::study::runner::Runner;
use elastocal::study::summary::QUANTILES;
use elastocal::study::tally::{Sum, Tally};
use elastocal::study::{Entry, Level, Setting, StudyError, TakenPlan, repeated};
use elastocal::task::Method;
use serde_json::{Value, json};

use crate::support::{
    Workplace, assert_alike_in, assert_has, number, numbers, scenario, scenario_text, shipped,
    table4,
};

/// The paper's plans, repeated to so many measurements.
fn paper_plans(sizes: &[u32], experiments: u32) -> Vec<Entry<'static>> {
    let entry = |&size: &u32| Entry {
        name: format!("m{size}"),
        setting: 0,
        plan: repeated(&table4(size), experiments).map(TakenPlan::Deflections),
        is_random: false,
    };
    sizes.iter().map(entry).collect()
}

/// The scenario with so many measurements in each run.
fn setting(scenario: &Scenario, experiments: u32) -> [Setting<'_>; 1] {
    let mut conditions = scenario.study.conditions[0];
    conditions.experiments = experiments;
    [Setting::new(&scenario.task, &scenario.truth, conditions)]
}

fn run(scenario: &Scenario, level: Level, entries: &[Entry<'_>], trials: u64) -> Vec<Tally> {
    let experiments = entries[0].plan.as_ref().expect("fixed").measurements();
    let settings = setting(scenario, experiments);
    let runner = Runner::new(&settings, scenario.seed, level, entries).expect("works");
    let blocks = runner.blocks(trials);
    runner.run(trials, 0..blocks, 1, &|_| ()).expect("works")
}

/// rho0 of eq. 20 within 3.3 standard deviations of what a million runs show, for every plan of
/// Fig. 7; and the estimation errors are as large as their covariance says.
#[test]
fn a_million_runs_keep_the_prediction_of_every_plan() {
    let scenario = scenario("klimchik2012");
    let entries = paper_plans(&[2, 3, 4, 6, 12], 12);
    let tallies = run(&scenario, Level::Model, &entries, 1_000_000);
    // The design page's values for m measurements, by the rule of repeated plans.
    let known = [(2, 8.17), (3, 6.59), (4, 5.45), (6, 4.53), (12, 3.20)];
    for ((tally, entry), (size, rho0)) in tallies.iter().zip(&entries).zip(known) {
        assert_eq!(tally.runs, 1_000_000);
        assert!(tally.z().abs() < 3.3, "{}: {}", entry.name, tally.z());
        assert!(
            tally.nees_z().abs() < 3.3,
            "{}: {}",
            entry.name,
            tally.nees_z()
        );
        let expected = rho0 * f64::from(size).sqrt() / 12.0_f64.sqrt();
        let predicted = tally.predicted_rms() * 30.0;
        assert!((predicted / expected - 1.0).abs() < 0.002, "{predicted}");
        assert!((tally.rms().value * 30.0 / expected - 1.0).abs() < 0.004);
        let quantiles = QUANTILES.map(|share| tally.quantile(share).expect("runs"));
        assert!(quantiles.is_sorted());
    }
}

/// Any split of the blocks, merged in any order, on any number of threads.
#[test]
fn neither_threads_nor_order_change_a_bit() {
    let scenario = scenario("klimchik2012");
    let mut entries = paper_plans(&[3, 12], 12);
    entries.push(Entry {
        name: "random".into(),
        setting: 0,
        plan: None,
        is_random: true,
    });
    let trials = 10_001;
    let settings = setting(&scenario, 12);
    let runner = Runner::new(&settings, scenario.seed, Level::Model, &entries).expect("works");
    let part = |start, step| {
        runner
            .run(trials, start..runner.blocks(trials), step, &|_| ())
            .expect("works")
    };
    let on = |threads| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads")
            .install(|| part(0, 1))
    };
    let one = on(1);
    assert_eq!(one, on(2));
    assert_eq!(one[0].runs, trials);
    let parts = [part(0, 3), part(1, 3), part(2, 3)];
    for order in [[0, 1, 2], [2, 0, 1], [1, 2, 0]] {
        let mut merged = vec![Tally::default(); entries.len()];
        for index in order {
            for (all, part) in merged.iter_mut().zip(&parts[index]) {
                all.merge(part);
            }
        }
        assert_eq!(merged, one);
    }
}

/// Run 777 by itself is what it was among its neighbours, and B eps is the textbook's formula.
#[test]
fn a_run_can_be_replayed_by_itself() {
    let scenario = scenario("klimchik2012");
    let plan = table4(3);
    let model = LinearModel::new(&scenario.task, &scenario.truth)
        .plan(&plan)
        .expect("determined");
    let draw = |first| {
        let mut normals = [[0.0; LANES]; 9];
        fill_normals(Stream::Noise, scenario.seed, first, &mut normals);
        normals
    };
    let alone = draw(777);
    let among = draw(776);
    let (one, other) = (model.run(&alone, &[]), model.run(&among, &[]));
    assert_eq!(one.square[0].to_bits(), other.square[1].to_bits());
    assert_eq!(one.nees[0].to_bits(), other.nees[1].to_bits());

    let experiments = elastocal::plan::ExperimentModel::new(&scenario.task.belief);
    let mut observed = nalgebra::DMatrix::zeros(9, 5);
    for (index, experiment) in crate::support::repeated(&plan).enumerate() {
        let matrix = experiments.observation_matrix(experiment);
        observed.rows_mut(3 * index, 3).copy_from(&matrix);
    }
    let noise = nalgebra::DVector::from_fn(9, |row, _| alone[row][0]);
    let information = observed.tr_mul(&observed);
    let inverse = information.clone().try_inverse().expect("regular");
    let error = inverse * observed.tr_mul(&noise);
    let test_pose = elastocal::compensation::test_pose_matrix(
        &scenario.task.belief,
        &scenario.task.test_poses[0],
        &scenario.task.belief.parameters,
    );
    let square = (test_pose * &error).norm_squared();
    assert!((one.square[0] / square - 1.0).abs() < 1e-8, "{square}");
    let nees = error.dot(&(&information * &error));
    assert!((one.nees[0] / nees - 1.0).abs() < 1e-8, "{nees}");

    let mut robot = RobotRuns::new(&scenario.task, &scenario.truth).expect("works");
    let prepared = PreparedPlan::new(&scenario.task, &plan);
    let first = robot.run(&prepared, &alone, &[], 0).expect("works");
    robot.run(&prepared, &alone, &[], 1).expect("works");
    assert_eq!(robot.run(&prepared, &among, &[], 1), Ok(first.clone()));
    // And it is what a single calibration shows.
    let shown =
        calibrate(&scenario.task, &scenario.truth, &plan, scenario.seed, 777).expect("works");
    let square = shown.poses[0].seen.residual_m.norm_squared();
    assert!(
        (square / (first.square * scenario.task.belief.instrument.sigma_m.powi(2)) - 1.0).abs()
            < 1e-9
    );
}

/// A study of one run shows what the replay of this run shows, true compliances and random plans
/// included.
#[test]
fn a_replay_is_the_run_of_the_study() {
    let workplace = Workplace::new();
    let spread = "[study]\ncompliance_spread = 0.1";
    workplace.write("s.toml", with_study(&SMALL.replacen("[study]", spread, 1)));
    let study = workplace.run("study s.toml --level robot --trials 1 --json --quiet");
    let study = study.ends_with(0).json();
    let replay = workplace.json("replay s.toml --run 0");
    for (one, other) in (study["plans"].as_array().expect("an array").iter())
        .zip(replay["plans"].as_array().expect("an array"))
    {
        assert_eq!(one["name"], other["name"]);
        let mean = number(&one["mean_mm"]);
        let seen = number(&other["test_poses"][0]["residual_mm"]);
        assert!((mean / seen - 1.0).abs() < 1e-9, "{mean}, {seen}");
    }
    for ending in ["json", "rrd", "mcap"] {
        assert!(workplace.path(&format!("out/s/replay_0.{ending}")).exists());
    }
    let other = workplace.json("replay s.toml --run 1");
    assert_ne!(other["plans"], replay["plans"]);
    workplace.misused("replay s.toml");
    // Of a sweep it says which conditions are shown, and which are not.
    let swept = "[study]\nsweep = { sigma_mm = [0.05, 0.03] }";
    workplace.write("s.toml", with_study(&SMALL.replacen("[study]", swept, 1)));
    let replay = workplace.json("replay s.toml --run 0");
    assert_eq!(replay["sigma_mm"], 0.05);
    let says = "the run is shown under the first conditions of study.sweep: 6 measurements, sigma 0.0500 mm, load 1. \
                The others: 6 measurements, sigma 0.0300 mm, load 1";
    assert_eq!(replay["notes"], serde_json::json!([says]));
}

/// What must be looked at of a fit is said of the replay, with the plan.
#[test]
fn a_replay_has_the_conditions_of_its_fits() {
    let workplace = Workplace::new();
    let study = "[study]\nexperiments = 2\n\n\
                 [[study.plan]]\nname = \"two\"\nkind = \"file\"\nfile = \"plans/klimchik2012_m2.csv\"\n";
    let noisy = with_study(study).replace("sigma_mm = 0.03", "sigma_mm = 10");
    workplace.write("s.toml", noisy);
    let replay = workplace.run("replay s.toml --run 0 --json --quiet");
    let replay = replay
        .ends_with(3)
        .says("condition C0202: plan \"two\": the compliance of")
        .json();
    let fitted = replay["plans"][0]["identification"]["conditions"].as_array();
    let said = replay["conditions"].as_array();
    assert_eq!(said.map(Vec::len), fitted.map(Vec::len));
    let written = workplace.parsed("out/s/replay_0.json");
    assert_eq!(written["conditions"], replay["conditions"]);
}

/// Any run can be measured by itself: as its replay measures, true compliances included.
#[test]
fn a_run_is_measured_as_its_replay_measures() {
    let workplace = Workplace::new();
    let study = "[study]\ntrials = 3\nexperiments = 3\ncompliance_spread = 0.1\n\n\
                 [[study.plan]]\nname = \"one\"\nkind = \"file\"\nfile = \"plans/klimchik2012_m3.csv\"\n";
    workplace.write("s.toml", with_study(study));
    let plan = shipped("scenarios/plans/klimchik2012_m3.csv");
    let measured = |options: &str| {
        let command = format!("measure s.toml --plan {plan} --json --quiet {options}");
        workplace.done(&command).json()
    };
    for run in [0, 5] {
        let replay = workplace.run(&format!("replay s.toml --run {run} --json --quiet"));
        let replay = replay.ends_with(0).json();
        let found = measured(&format!("--run {run}"));
        assert_eq!(found["run"], run);
        assert_eq!(found["measurements"], replay["plans"][0]["measurements"]);
    }
    // Run 0 where none is named, and another robot in every run.
    assert_eq!(
        measured("--run 0")["measurements"],
        measured("")["measurements"]
    );
    assert_ne!(
        measured("--run 1")["measurements"],
        measured("")["measurements"]
    );
}

/// With the non-linear method nothing is lost to linearisation: run by run the virtual robot ends
/// where the linear model says, but for the second order of the errors.
#[test]
fn the_virtual_robot_errs_as_the_model_predicts() {
    let scenario = scenario("klimchik2012");
    assert_eq!(scenario.task.belief.method, Method::Nonlinear);
    let entries = paper_plans(&[3], 3);
    let trials = 1500;
    let robot = &run(&scenario, Level::Robot, &entries, trials)[0];
    let model = &run(&scenario, Level::Model, &entries, trials)[0];
    assert_eq!((robot.runs, robot.failures()), (trials, 0));
    assert!(robot.z().abs() < 3.3, "{}", robot.z());
    assert!(robot.nees_z().abs() < 3.3, "{}", robot.nees_z());
    // The same noise: much closer than statistics ask for.
    let ratio = robot.sum(Sum::Square) / model.sum(Sum::Square);
    assert!((ratio - 1.0).abs() < 0.03, "{ratio}");
}

/// True compliances that vary: where all are identified, the linear model's errors stay the same and
/// the virtual robot's nearly so; a joint that is taken as known leaves a bias that can be told
/// beforehand from the log-normal's moments.
#[test]
fn true_compliances_may_vary() {
    let mut scenario = scenario("klimchik2012");
    let entries = paper_plans(&[3], 3);
    let fixed = run(&scenario, Level::Model, &entries, 2000);
    let identified = scenario.task.belief.parameters.clone();
    for &joint in &identified {
        scenario.truth.compliance_spread[joint] = 0.2;
    }
    assert_eq!(run(&scenario, Level::Model, &entries, 2000), fixed);
    let robot = &run(&scenario, Level::Robot, &entries, 2000)[0];
    assert_eq!(robot.failures(), 0);
    assert!(robot.z().abs() < 3.3, "{}", robot.z());
    assert!(robot.nees_z().abs() < 3.3, "{}", robot.nees_z());
    assert_ne!(robot.sums, run_fixed_robot(&entries).sums);

    // Joint 1 is not identified: a vertical load does not bend it, but the task load does.
    let spread: f64 = 0.1;
    scenario.truth.compliance_spread[0] = spread;
    let nominal = scenario.task.belief.nominal.compliance_rad_per_nm[0];
    scenario.truth.robot.compliance_rad_per_nm[0] = 1.1 * nominal;
    let (mean, mean_square) = ((spread * spread / 2.0).exp(), (2.0 * spread * spread).exp());
    let square = nominal.powi(2) * (1.21 * mean_square - 2.2 * mean + 1.0);
    let column = elastocal::compensation::test_pose_matrix(
        &scenario.task.belief,
        &scenario.task.test_poses[0],
        &[0],
    );
    let bias_square = column.norm_squared() * square / (3e-5_f64).powi(2);
    for (level, trials, tolerance) in [(Level::Model, 400_000, 0.01), (Level::Robot, 4000, 0.1)] {
        let tally = &run(&scenario, level, &entries, trials)[0];
        let noise = fixed[0].sum(Sum::Expected) / 2000.0;
        let seen = tally.sum(Sum::Square) / trials as f64;
        let predicted = tally.sum(Sum::Expected) / trials as f64;
        assert_alike_in(&level, seen, noise + bias_square, tolerance);
        assert!((predicted / (noise + bias_square) - 1.0).abs() < tolerance);
        // At the robot's level eq. 15's second order counts too.
        assert!(
            level == Level::Robot || tally.z().abs() < 3.3,
            "{}",
            tally.z()
        );
    }
}

/// In the linear model a run has the noise and the compliances that it has on the virtual robot, so that what is left is as far from the
/// target but for what linearisation misses; large noise and a first joint twice as soft make that little.
#[test]
fn a_run_is_the_same_in_the_linear_model() {
    let mut scenario = scenario("klimchik2012");
    scenario.task.belief.instrument.sigma_m = 3e-4;
    scenario.truth.robot.compliance_rad_per_nm[0] *= 2.0;
    let entries = paper_plans(&[3], 3);
    let mut distances_m = Vec::new();
    for seed in 0..16 {
        scenario.seed = seed;
        distances_m.push([Level::Model, Level::Robot].map(|level| {
            let tally = &run(&scenario, level, &entries, 1)[0];
            tally.sum(Sum::Distance) * scenario.task.belief.instrument.sigma_m
        }));
    }
    for [model_m, robot_m] in &distances_m {
        assert!((model_m - robot_m).abs() < 1e-5, "{distances_m:?}");
    }
}

fn run_fixed_robot(entries: &[Entry<'_>]) -> Tally {
    run(&scenario("klimchik2012"), Level::Robot, entries, 2000).remove(0)
}

#[test]
fn what_cannot_be_studied_is_named() {
    let scenario = scenario("klimchik2012");
    let settings = setting(&scenario, 12);
    let new = |entries: &[Entry<'_>]| {
        Runner::new(&settings, scenario.seed, Level::Model, entries).map(drop)
    };
    assert!(matches!(new(&[]), Err(StudyError::NoPlan)));
    let wrong = new(&paper_plans(&[3], 6)).expect_err("six measurements");
    assert!(
        wrong.to_string().contains("found 6 measurements"),
        "{wrong}"
    );
    let mut plan = table4(12);
    plan.experiments.truncate(1);
    plan.experiments[0].repeats = 12;
    let singular = Entry {
        name: "one".into(),
        setting: 0,
        plan: Some(TakenPlan::Deflections(plan)),
        is_random: false,
    };
    let wrong = new(&[singular]).expect_err("one configuration");
    assert!(
        wrong
            .to_string()
            .contains("\"one\": the measurements do not determine")
    );
    assert!(repeated(&table4(4), 6).is_none());
}

const SMALL: &str = r#"
[study]
trials = 3000
experiments = 6

[[study.plan]]
name = "=paper, of \"three\""
kind = "file"
file = "plans/klimchik2012_m3.csv"

[[study.plan]]
name = "random"
kind = "random"

[[study.plan]]
name = "best"
kind = "optimal"
experiments = 2
"#;

/// The paper's scenario with another study.
fn with_study(study: &str) -> String {
    let text = scenario_text("klimchik2012");
    let start = text.find("[study]").expect("is there");
    let plans = crate::support::project("scenarios/plans/");
    text[..start].to_owned() + &study.replace("plans/", &plans.to_string_lossy())
}

#[test]
fn the_command_prints_and_writes_its_results() {
    let workplace = Workplace::with("s.toml", with_study(SMALL));
    let study = |options: &str| {
        let outcome = workplace.run(&format!("study s.toml --json --quiet {options}"));
        outcome.ends_with(0).json()
    };
    let json = study("--threads 1");
    assert_eq!(json["conditions"], json!([]));
    let written = workplace.parsed("out/s/study.json");
    assert_eq!(json, written);
    assert_eq!(json["trials"], 3000);
    assert_eq!(json["level"], "model");
    assert_eq!(json["reference"], "random");
    assert_eq!(json["provenance"]["seed"], 1);
    assert!(json["elapsed_s"].as_f64() > Some(0.0) && json["runs_per_s"].as_f64() > Some(0.0));
    let plans = json["plans"].as_array().expect("an array");
    assert_eq!(plans.len(), 3);
    for plan in plans {
        let [low, high] = numbers(&plan["mean_ci95_mm"])[..] else {
            panic!("{plan}");
        };
        let mean = number(&plan["mean_mm"]);
        assert!(low < mean && mean < high && plan["failed"] == 0);
        assert!(number(&plan["z"]).abs() < 4.0);
        assert!(plan["rms_mm"].as_f64() > plan["mean_mm"].as_f64());
        assert!(plan["predicted_rms_mm"].is_number() && plan["nees"].is_number());
    }
    assert!(plans[2]["mean_ratio_to_random"].as_f64() < Some(1.0));
    let csv = workplace.read("out/s/study.csv");
    assert_eq!(csv.lines().count(), 4);
    assert_has(&csv, "\n\"'=paper, of \"\"three\"\"\",6,0.03,1,3000,0,");
    assert_eq!(study("--threads 2")["plans"], json["plans"]);
    assert_ne!(study("--seed 2")["plans"], json["plans"]);
    let robot = study("--level robot --trials 20");
    assert_eq!(
        (&robot["level"], &robot["trials"]),
        (&"robot".into(), &20.into())
    );
    let text = workplace.done("study s.toml");
    let words = "Against a random plan: ";
    text.prints(words);
    text.prints(" times as accurate. 95 % interval: ");
}

/// All conditions of a sweep with all; a plan takes part where it fits, and the part under given
/// conditions is the study that is made under these alone.
#[test]
fn a_sweep_is_many_studies() {
    let workplace = Workplace::new();
    let sweep =
        "\n[study.sweep]\nsigma_mm = [0.03, 0.06]\nexperiments = [2, 6]\nload_scale = [0.5, 1]\n";
    workplace.write("sweep.toml", with_study(SMALL) + sweep);
    workplace.write("one.toml", with_study(SMALL));
    let study = |name: &str| {
        let outcome = workplace.run(&format!("study {name}.toml --json --quiet"));
        outcome.ends_with(0).json()["plans"]
            .as_array()
            .expect("an array")
            .clone()
    };
    let (all, one) = (study("sweep"), study("one"));
    // Of 3 plans under 8 conditions, the one of three measurements does not make up two.
    assert_eq!(all.len(), 3 * 8 - 4);
    let find = |name: &str, experiments: u32, load: f64, sigma: f64| {
        let is_wanted = |plan: &&Value| {
            plan["name"] == name
                && plan["experiments"] == experiments
                && plan["load_scale"] == load
                && plan["sigma_mm"] == sigma
        };
        all.iter().find(is_wanted).expect("is there")
    };
    for plan in &one {
        let name = plan["name"].as_str().expect("text");
        let same = find(name, 6, 1.0, 0.03);
        assert_eq!(same, plan);
        // The linear model: the error grows with sigma and with the inverse of the load.
        for (load, sigma, factor) in [(1.0, 0.06, 2.0), (0.5, 0.03, 2.0), (0.5, 0.06, 4.0)] {
            let other = find(name, 6, load, sigma);
            let ratio = |key: &str| number(&other[key]) / number(&plan[key]);
            assert!((ratio("mean_mm") / factor - 1.0).abs() < 1e-9, "{name}");
            assert_alike_in(&name, ratio("predicted_rms_mm"), factor, 1e-9);
        }
    }
    let csv = workplace.read("out/sweep/study.csv");
    assert_eq!(csv.lines().count(), 21);
    assert!(csv.contains("\nbest,2,0.06,0.5,3000,0,"), "{csv}");
    let text = workplace.done("study sweep.toml");
    text.says("20 plans under 8 conditions");
    text.prints("load scale");
}

/// Where errors besides the noise count, a plan is designed for each sigma, in whatever order these are listed.
#[test]
fn plans_of_a_sweep_are_designed_for_each_sigma() {
    let workplace = Workplace::new();
    let best = "[study]\ntrials = 100\nexperiments = 4\n[[study.plan]]\nname = \"best\"\nkind = \"optimal\"\n";
    let returns = "[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.05\n";
    let predicted = |list: &str| {
        let sweep = format!("[study.sweep]\nsigma_mm = [{list}]\n");
        workplace.write("s.toml", with_study(best) + &sweep + returns);
        let json = workplace.json("study s.toml");
        let plans = json["plans"].as_array().expect("an array").iter();
        let mut all: Vec<[f64; 2]> = plans
            .map(|each| ["sigma_mm", "combined_rms_mm"].map(|key| number(&each[key])))
            .collect();
        all.sort_by(|one, other| one[0].total_cmp(&other[0]));
        all
    };
    let both = predicted("0.01, 0.2");
    let alone = ["0.01", "0.2"].map(|sigma| predicted(sigma)[0]);
    assert_eq!([both[0], both[1]], alone);
    assert_eq!(predicted("0.2, 0.01"), both);
}

/// What is replaced, by what, what the error says.
const WRONG: &[(&str, &str, &[&str])] = &[
    ("trials = 3000", "trials = 0", &["study.trials", "found 0"]),
    (
        "experiments = 6",
        "experiments = 7",
        &["study.plan[0].file", "found 3", "study.experiments = 7"],
    ),
    (
        "experiments = 6",
        "experiments = 1",
        &["study.experiments", "found 1", "2 to 10000"],
    ),
    (
        "experiments = 2",
        "experiments = 4",
        &["study.plan[2].experiments", "found 4"],
    ),
    (
        "experiments = 2",
        "experiments = 2\nconfigurations = 3",
        &["study.plan[2].configurations", "found 3"],
    ),
    (
        "kind = \"optimal\"",
        "kind = \"optimal\"\ncriterion = \"o6\"",
        &["study.plan", "`o6`", "`test_pose`"],
    ),
    (
        "kind = \"random\"",
        "kind = \"randon\"",
        &["study.plan", "`randon`"],
    ),
    (
        "name = \"best\"",
        "name = \"random\"",
        &["study.plan[2].name", "\"random\" twice"],
    ),
    (
        "experiments = 6",
        "experiments = 6\nsweep = { experiments = [4, 5] }",
        &["study.plan[0].file", "found 3", "= 4 or 5"],
    ),
    (
        "experiments = 6",
        "experiments = 6\nsweep = { sigma_mm = [] }",
        &["study.sweep.sigma_mm", "is empty"],
    ),
    (
        "experiments = 6",
        "experiments = 6\nsweep = { load_scale = [1, 0] }",
        &["study.sweep.load_scale", "found 0", "positive"],
    ),
    (
        "experiments = 6",
        "experiments = 6\nsweep = { load_scale = [1, 2, 1] }",
        &["study.sweep.load_scale", "found 1 twice"],
    ),
    (
        "experiments = 6",
        "experiments = 6\nsweep = { sigma_um = [1] }",
        &["study.sweep", "`sigma_um`", "`sigma_mm`"],
    ),
    (
        "experiments = 6",
        "experiments = 6\ncompliance_spread = 1.5",
        &["study.compliance_spread", "found 1.5", "0 to 1"],
    ),
    (
        "experiments = 6",
        "experiments = 6\ncompliance_spread = [0.1, 0.1]",
        &["study.compliance_spread", "found 2 numbers", "6 joints"],
    ),
    (
        "m3.csv",
        "m5.csv",
        &["study.plan[0].file", "cannot be read"],
    ),
];

#[test]
fn wrong_studies_give_one_clear_error() {
    let workplace = Workplace::new();
    let fails = |text: String, says: &[&str]| {
        workplace.write("bad.toml", text);
        let outcome = workplace.refused("study bad.toml --quiet");
        let error = outcome.stderr.lines().next().unwrap_or_default();
        for part in says {
            assert!(error.contains(part), "{part:?} is missing: {error}");
        }
        assert_eq!(outcome.stderr.matches("error E").count(), 1);
        assert!(!workplace.path("out").exists());
    };
    for (from, to, says) in WRONG {
        assert!(SMALL.contains(from), "{from:?}");
        fails(with_study(&SMALL.replacen(from, to, 1)), says);
    }
    fails(
        with_study("[study]\nplan = []\n"),
        &["study.plan", "is empty"],
    );
    workplace.write("s.toml", with_study(SMALL));
    workplace.misused("study s.toml --trials 0");
}

/// Three shards joined in any order, and a study resumed, are the study made at once; files of
/// other studies are refused with what differs.
#[test]
fn shards_and_resumption_change_no_bit() {
    let workplace = Workplace::with("s.toml", with_study(SMALL));
    let study = "study s.toml --quiet --trials 9001";
    workplace.done(study);
    let csv = workplace.read("out/s/study.csv");
    for shard in 1..=3 {
        let arguments = format!("{study} --shard {shard}/3 --tally-out {shard}.json");
        workplace.done(&arguments);
    }
    let merged = workplace.run("merge 3.json 1.json 2.json --json --out joined");
    assert_eq!(merged.ends_with(0).json()["trials"], 9001);
    assert_eq!(workplace.read("joined/s/study.csv"), csv);

    workplace.done(&format!("{study} --resume r.json --out one"));
    let finished = workplace.read("r.json");
    workplace.done(&format!("{study} --resume r.json --out two"));
    assert_eq!(workplace.read("r.json"), finished);
    for folder in ["one", "two"] {
        assert_eq!(workplace.read(&format!("{folder}/s/study.csv")), csv);
    }

    let fails = |arguments: &str, says: &str| {
        workplace.refused(arguments).says(says);
    };
    fails("merge 1.json 3.json", "number 2 is missing");
    fails("merge 1.json 1.json", "which another file is too");
    fails("merge 1.json s.toml", "is not a tally");
    fails(
        &format!("{study} --seed 7 --resume r.json"),
        "seed is 1 there, 7 here",
    );
    // Before a plan is designed, which would take long.
    let optimal = with_study(SMALL) + "\n[[study.plan]]\nname = \"o\"\nkind = \"optimal\"\n";
    workplace.write("o.toml", optimal);
    let outcome = workplace.refused("study o.toml --resume r.json");
    assert!(!outcome.stderr.contains("designing"), "{outcome:#?}");
    let few = "study s.toml --quiet --trials 10 --shard 3/3 --tally-out few.json";
    let few = workplace.done(few);
    few.prints("no runs: 10 runs are fewer blocks");
    let other = "study s.toml --quiet --trials 9002 --shard 2/3 --tally-out other.json";
    workplace.done(other);
    fails(
        "merge 1.json other.json 3.json",
        "trials is 9002 there, 9001 here",
    );
    workplace.misused(&format!("{study} --shard 4/3 --tally-out t.json"));
}

/// What was done before an interruption counts, and the rest is done.
#[test]
fn an_interrupted_study_goes_on() {
    use elastocal::record::tally_file::{Header, PlanHeader, TallyFile};
    let scenario = scenario("klimchik2012");
    let entries = paper_plans(&[3], 12);
    let settings = setting(&scenario, 12);
    let runner = Runner::new(&settings, scenario.seed, Level::Model, &entries).expect("works");
    let trials = 10_000;
    let plans = PlanHeader::of(&runner);
    let header = Header::new(&scenario, Level::Model, [trials, 1], plans);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("t.json");
    let mut part = TallyFile::resume(&path, header.clone(), 1).expect("nothing is done");
    part.tallies = runner.run(trials, 0..2, 1, &|_| ()).expect("works");
    part.blocks_done = 2;
    part.write(&path).expect("can be written");
    let mut again = TallyFile::resume(&path, header.clone(), 1).expect("is there");
    assert_eq!(again, part);
    assert!(!again.is_complete());
    let rest = runner.run(trials, 2..header.blocks_of(1), 1, &|_| ());
    again.tallies[0].merge(&rest.expect("works")[0]);
    assert_eq!(
        again.tallies,
        run(&scenario, Level::Model, &entries, trials)
    );
}
