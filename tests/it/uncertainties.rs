//! What nobody knows exactly: the testbed draws it, the belief carries it, and predictions hold.
//!
//! A mean square seen in N runs is off by at most 3 of its standard errors and 2 % of the prediction, which is what
//! the model's non-linearity is allowed.

use elastocal::numeric::estimable::Estimable;
use elastocal::numeric::random::normal::LANES;
use elastocal::parameter::{ParameterKind, ParameterSet};
use elastocal::plan::posterior;
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use elastocal::testbed::TrueRobots;
use nalgebra::{DMatrix, DVector, Matrix6xX};
use serde_json::Value;

use crate::support::{
    Workplace, assert_alike, assert_near_in, scenario_text, setup, shipped, table4,
};

/// Sizes that a laboratory would recognise, or larger so that they show; each alone.
pub const SOURCES: [(&str, &str); 16] = [
    ("compliance", "joints = [\"joint_1\"]\nstd_relative = 0.1"),
    ("compliance", "joints = [\"joint_3\"]\nstd_relative = 0.05"),
    ("joint_zero", "std_mrad = 0.5"),
    ("link_position", "std_mm = 0.5"),
    ("link_rotation", "std_mrad = 0.5"),
    ("tool_position", "std_mm = 0.5"),
    ("base_rotation", "std_mrad = 0.5"),
    ("load_scale", "std_relative = 0.01"),
    ("load_offset", "std_n = 20"),
    ("load_direction", "std_mrad = 2"),
    ("load_point", "std_mm = 5"),
    ("joint_repeatability", "std_mrad = 0.03"),
    ("drift", "std_um_per_h = 20"),
    (
        "backlash",
        "joints = [\"joint_2\", \"joint_3\"]\nstd_arcsec = 60",
    ),
    (
        "backlash",
        "joints = [\"joint_1\", \"joint_4\", \"joint_5\", \"joint_6\"]\nstd_arcsec = 20\nturned_over_at_nm = 200",
    ),
    ("stiffening", "std_relative = 0.01\nat_nm = 8000"),
];

/// The paper's scenario with a study of Table 4's plan of four, and with uncertainties.
pub fn with(uncertainties: &str, level: &str, trials: u32) -> String {
    repeated_in_study(1, uncertainties, level, trials)
}

/// The same with each measurement so many times.
pub fn repeated_in_study(repeats: u32, uncertainties: &str, level: &str, trials: u32) -> String {
    let text = scenario_text("klimchik2012");
    let (head, _) = text.split_once("[study]").expect("there is a study");
    let plan = shipped("scenarios/plans/klimchik2012_m4.csv");
    format!(
        "{head}\n[study]\nexperiments = {}\ntrials = {trials}\nlevel = \"{level}\"\n[[study.plan]]\nkind = \"file\"\n\
         name = \"2c\"\nfile = \"{plan}\"\n{uncertainties}",
        4 * repeats
    )
}

pub fn entry((kind, size): (&str, &str), more: &str) -> String {
    format!("[[uncertainty]]\nkind = \"{kind}\"\n{size}\n{more}\n")
}

/// All at once, with names of their own.
pub fn everything() -> String {
    let named = SOURCES.iter().enumerate();
    named
        .map(|(index, &source)| entry(source, &format!("name = \"source {index}\"")))
        .collect()
}

pub fn loaded(text: &str) -> Scenario {
    let place = Workplace::with("laboratory.toml", text);
    place.scenario("laboratory.toml")
}

/// A wrong entry ends a command, which names it by its key and says what is the matter. A key is of the first table, or begins with the
/// table's number, or is that of all tables where it is empty.
pub fn assert_refused(entry: &str, key: &str, says: &str) {
    let place = Workplace::new();
    let text = with(&format!("[[uncertainty]]\n{entry}\n"), "model", 64);
    place.write("wrong.toml", text);
    let said = place.refused("check wrong.toml");
    if key.is_empty() || key.starts_with('[') {
        said.says(&format!("uncertainty{key}"));
    } else {
        said.says(&format!("uncertainty[0].{key}"));
    }
    said.says(says);
}

pub fn study(text: &str) -> Value {
    let place = Workplace::with("laboratory.toml", text);
    let outcome = place.run("study laboratory.toml --json --quiet");
    let json = outcome.ends_with(0).json();
    json["plans"][0].clone()
}

pub fn assert_holds(plan: &Value, what: &str) {
    let number = |key: &str| plan[key].as_f64().expect("a number");
    let (rms, predicted) = (number("rms_mm"), number("combined_rms_mm"));
    let room = 3.0 * number("rms_std_mm") + 0.02 * predicted;
    assert_near_in(&what, rms, predicted, room);
    assert_eq!(plan["verdict"], "holds", "{what}");
}

/// The rms distance (mm) that the contributions to the errors of a study's plan come to.
pub fn expected_mm(plan: &Value) -> f64 {
    let contributions = plan["contributions"].as_array().expect("a list").iter();
    let square = |each: &Value| each["contribution_um"].as_f64().expect("a number").powi(2);
    contributions.map(square).sum::<f64>().sqrt() * 1e-3
}

/// Each source alone, on the virtual robot that is drawn in every run: what is seen is what is predicted.
#[test]
fn predictions_hold_on_a_robot_that_is_drawn_in_every_run() {
    for source in SOURCES {
        let plan = study(&with(&entry(source, ""), "robot", 600));
        assert_holds(&plan, &format!("{source:?}"));
    }
    let plan = study(&with(&everything(), "robot", 600));
    assert_holds(&plan, "everything");
}

/// A tracker reads along its beam better than across it, or worse: each is seen where it points.
#[test]
fn a_tracker_errs_along_its_beam_as_told() {
    let [mut along, mut across] = [0.0; 2];
    for (size, predicted) in [
        ("std_um_per_m = 0.001\nalong_um_per_m = 40", &mut along),
        ("std_um_per_m = 40\nalong_um_per_m = 0.001", &mut across),
    ] {
        let text = with(&entry(("tracker_range", size), ""), "robot", 600);
        let text = text.replace("sigma_of", "tracker_site = \"tracker\"\nsigma_of");
        let plan = study(&text);
        assert_holds(&plan, size);
        *predicted = plan["combined_rms_mm"].as_f64().expect("a number");
    }
    // As much in all directions is both, where the plan's noise is small beside them.
    let all = with(
        &entry(("tracker_range", "std_um_per_m = 40"), ""),
        "model",
        64,
    );
    let plan = study(&all.replace("sigma_of", "tracker_site = \"tracker\"\nsigma_of"));
    let all = plan["combined_rms_mm"].as_f64().expect("a number");
    assert!(all > 1.05 * along.max(across), "{along} {across} {all}");
}

/// By the linear model the prediction is exact, and the errors are as large as their covariance says.
#[test]
fn predictions_are_exact_in_the_linear_model() {
    for text in [
        with(&entry(SOURCES[1], ""), "model", 40_000),
        with(&entry(SOURCES[7], ""), "model", 40_000),
        with(&entry(SOURCES[11], ""), "model", 40_000),
        with(&everything(), "model", 40_000),
    ] {
        let plan = study(&text);
        let number = |key: &str| plan[key].as_f64().expect("a number");
        let off = (number("rms_mm") - number("combined_rms_mm")) / number("rms_std_mm");
        // Log-normal compliances are not quite linear: 0.5 % of their share.
        let nonlinear = 0.005 * number("combined_rms_mm") / number("rms_std_mm");
        assert!(off.abs() < 4.5 + nonlinear, "{off}");
        assert!(number("nees_z").abs() < 6.0, "{plan}");
    }
}

/// What the belief does not know of breaks its prediction, as far as the account says, and by its name.
#[test]
fn what_is_hidden_breaks_the_prediction() {
    for source in [SOURCES[0], SOURCES[7], SOURCES[11]] {
        let text = with(&entry(source, "hidden = true"), "robot", 600);
        let plan = study(&text);
        let number = |key: &str| plan[key].as_f64().expect("a number");
        let expected = expected_mm(&plan);
        let room = 3.0 * number("rms_std_mm") + 0.03 * expected;
        assert_near_in(&(source, &plan), number("rms_mm"), expected, room);
        let verdict = plan["verdict"].as_str().expect("words");
        assert!(
            verdict.starts_with("exceeded") && verdict.contains(source.0),
            "{verdict}"
        );
        // The prediction is that of the noise alone.
        let certain = study(&with("", "robot", 64));
        let predicted = certain["predicted_rms_mm"].as_f64().expect("a number");
        assert!((number("combined_rms_mm") / predicted - 1.0).abs() < 1e-6);
    }
}

/// The covariance of the compliances is that of generalised least squares with all that is uncertain in one
/// covariance of all readings, V = R + Z P Z^T: another formula.
#[test]
fn the_posterior_is_that_of_generalised_least_squares() {
    let scenario = loaded(&with(&everything(), "model", 64));
    let (belief, plan) = (&scenario.task.belief, table4(4));
    let found = posterior(belief, &plan);
    let extended = &belief.uncertain;
    let (set, arm) = (extended.set(), extended.arm());
    let size = set.len();
    let count = plan.experiments.len();
    let mut rows = DMatrix::zeros(3 * count, size);
    let mut covariance = DMatrix::zeros(3 * count, 3 * count);
    let values = set.prior().mean.clone();
    let mut model = elastocal::observation::ObservationModel::new(set, arm, values.as_slice());
    let precision = belief.instrument.precision();
    let mut first = extended.readings_of_all(precision);
    for (index, experiment) in plan.experiments.iter().enumerate() {
        assert_eq!(experiment.repeats, 1);
        let setup = setup(experiment.configuration_rad.clone(), experiment.load, 0);
        let mut derivatives = Matrix6xX::zeros(size);
        let kind = elastocal::observation::ReadingKind::Deflection;
        model.predict_first_order(None, &setup, kind, &mut derivatives);
        rows.rows_mut(3 * index, 3)
            .copy_from(&derivatives.rows(0, 3));
        first.move_to(experiment.configuration_rad.as_slice());
        let own = first.covariance_of_all(&experiment.load) + precision.covariance();
        covariance
            .view_mut((3 * index, 3 * index), (3, 3))
            .copy_from(&own.view((0, 0), (3, 3)));
    }
    let own = belief.parameters.len();
    // Parameters of the plan with their priors, all but the compliances that are to be found.
    for index in own..size {
        let deviation = set.parameters()[index].prior_deviation.expect("a prior");
        let column = rows.column(index) * deviation;
        covariance += &column * column.transpose();
    }
    let inverse = covariance.try_inverse().expect("regular");
    let own_rows = rows.columns(0, own).into_owned();
    let mut information = own_rows.transpose() * inverse * own_rows;
    for index in 0..own {
        information[(index, index)] += set.prior().precision[(index, index)];
    }
    let expected = information.try_inverse().expect("regular");
    for row in 0..own {
        for column in 0..own {
            let scale = (expected[(row, row)] * expected[(column, column)]).sqrt();
            let error = found.covariance[(row, column)] - expected[(row, column)];
            assert!(error.abs() < 1e-6 * scale, "{row} {column}: {error}");
        }
    }
    assert!(matches!(found.estimable, Estimable { .. }) && found.estimable.is_complete());
}

/// A plan for the whole is better by the whole than the plan for the noise, and not below its bound; the plan for the
/// noise is the one that it was without any list.
#[test]
fn plans_minimise_the_whole() {
    let place = Workplace::new();
    let list = entry(SOURCES[11], "") + &entry(SOURCES[9], "") + &entry(SOURCES[7], "");
    place.write("laboratory.toml", with(&list, "model", 64));
    place.write("noise.toml", with("", "model", 64));
    let plan = |arguments: &str| {
        let outcome = place.run(&format!("plan {arguments} --no-proof --json --quiet"));
        outcome.ends_with(0).json()
    };
    let whole = plan("laboratory.toml --experiments 4 --plan-out whole.csv");
    let noise = plan("laboratory.toml --experiments 4 --noise-only --plan-out noise.csv");
    let before = plan("noise.toml --experiments 4 --plan-out before.csv");
    assert_eq!(noise["rho0_mm"], before["rho0_mm"]);
    assert_eq!(noise["provenance"]["noise_only"], true);
    assert_eq!(place.read("noise.csv"), place.read("before.csv"));
    let judged = place.run("evaluate laboratory.toml --plan noise.csv --no-proof --json --quiet");
    let judged = judged.ends_with(0).json();
    let number = |value: &Value| value.as_f64().expect("a number");
    let (best, other) = (number(&whole["rho0_mm"]), number(&judged["rho0_mm"]));
    assert!(best < 0.95 * other, "{best} against {other}");
    assert!(number(&whole["lower_bound_rho0_mm"]) <= best);
    assert!(number(&whole["efficiency"]) > 0.95, "{whole}");
}

/// A belief in noise alone sees its prediction broken by what the scenario lists, and takes no sigma from residuals where
/// it knows better.
#[test]
fn noise_alone_is_a_prediction_that_breaks() {
    let workplace = Workplace::with(
        "laboratory.toml",
        with(&entry(SOURCES[7], ""), "robot", 256),
    );
    let study = workplace.done("study laboratory.toml --noise-only --json --quiet");
    let plan = study.json()["plans"][0].clone();
    let verdict = plan["verdict"].as_str().expect("words");
    assert!(
        verdict.starts_with("exceeded") && verdict.contains("load_scale"),
        "{verdict}"
    );
    let file = shipped("scenarios/plans/klimchik2012_m4.csv");
    let measure = format!("measure laboratory.toml --plan {file} --measurements-out m.csv");
    workplace.done(&measure);
    let identify = "identify laboratory.toml --measurements m.csv --sigma-from-residuals";
    let refused = workplace.refused(identify);
    refused.says("uncertainty");
    refused.says("--noise-only");
    workplace.run(&format!("{identify} --noise-only --quiet"));
}

/// Where more measurements stop helping: what the whole plan shares stays.
#[test]
fn budgets_say_where_measurements_stop_helping() {
    let workplace = Workplace::with("laboratory.toml", with(&entry(SOURCES[7], ""), "model", 64));
    let budget = "budget laboratory.toml --accuracy-um 12 --up-to 4 --no-proof";
    let text = workplace.done(budget);
    text.prints("More measurements hardly help");
    text.prints("10.3 um");
    let json = workplace.run(&format!("{budget} --json")).json();
    for point in json["budget"].as_array().expect("points") {
        let shared = point["shared_rho0_mm"].as_f64().expect("a number");
        assert!(shared > 0.0 && shared <= point["rho0_mm"].as_f64().expect("a number"));
    }
}

/// Frames that stand elsewhere in MuJoCo's model are those of the arm with the same parameters.
#[test]
fn displaced_frames_are_those_of_the_parameters() {
    let list = [SOURCES[2], SOURCES[3], SOURCES[4], SOURCES[5]].map(|source| entry(source, ""));
    let scenario = loaded(&with(&list.concat(), "model", 64));
    let belief = &scenario.task.belief;
    let mut robots = TrueRobots::new(belief, &scenario.truth).expect("the sites exist");
    let extended = &belief.uncertain;
    for (run, experiment) in (0..).zip(&table4(4).experiments) {
        let normals =
            (robots.become_run_of(&scenario.truth, 1, 7, run)).expect("frames of their own");
        let values = robots.unknowns(belief);
        let arm = extended.set().apply(extended.arm(), &values);
        assert_ne!(arm.chain.joints[2], extended.arm().chain.joints[2]);
        let one = elastocal::plan::Plan {
            experiments: vec![experiment.clone()],
        };
        let seen =
            (robots.measure_noise_free(&one, &belief.instrument, &normals, 0)).expect("at rest");
        let commanded: Vec<f64> = (experiment.configuration_rad.iter().zip(&arm.zero_rad))
            .map(|(q, zero)| q + zero)
            .collect();
        let mut solver = elastocal::robot::EquilibriumSolver::new(6);
        let mut rest = |load: &Load| {
            let mut chain = arm.chain.at(&arm.tools[0]);
            let compliance = &arm.compliance_rad_per_nm;
            solver
                .solve(&mut chain, compliance, &commanded, load)
                .expect("at rest");
            solver.state().tool_position
        };
        let expected = -rest(&Load::NONE) + rest(&experiment.load);
        let error = (seen[0].deflection_m - expected).norm();
        assert!(error < 1e-12, "run {run}: {error}");
    }
}

/// `measure`, `identify` and `compensate` by files are what a run of the study is, and results say what is known of
/// what is uncertain.
#[test]
fn identification_knows_of_uncertainties() {
    let place = Workplace::new();
    let list =
        entry(SOURCES[0], "name = \"axis 1\"") + &entry(SOURCES[7], "") + &entry(SOURCES[11], "");
    place.write("laboratory.toml", with(&list, "robot", 64));
    let plan = shipped("scenarios/plans/klimchik2012_m4.csv");
    let run = |arguments: &str| place.json(arguments);
    run(&format!(
        "measure laboratory.toml --plan {plan} --measurements-out m.csv"
    ));
    let identified = run("identify laboratory.toml --measurements m.csv --identified-out i.json");
    let uncertain = identified["uncertain"].as_array().expect("a list");
    let names: Vec<&str> = uncertain
        .iter()
        .filter_map(|each| each["name"].as_str())
        .collect();
    assert_eq!(names, ["joint_1.compliance", "load.scale"]);
    for each in uncertain {
        let (prior, now) = (each["prior_std"].as_f64(), each["std"].as_f64());
        assert!(
            now.expect("known") <= prior.expect("known") * (1.0 + 1e-9),
            "{each}"
        );
    }
    // What the plan predicted is what is known now.
    let predicted = run(&format!(
        "evaluate laboratory.toml --plan {plan} --no-proof"
    ));
    let compensated = run("compensate laboratory.toml --identified i.json");
    let found = compensated["rho0_mm"].as_f64().expect("a number");
    let expected = predicted["rho0_mm"].as_f64().expect("a number");
    assert_alike(found, expected, 0.02);
    // Without the list, the same file serves a belief in noise alone, which says that it is another one.
    let other =
        place.run("compensate laboratory.toml --identified i.json --noise-only --json --quiet");
    assert!(
        other
            .ends_with(3)
            .stderr
            .contains("identified under another scenario")
    );
}

/// Wrong entries are named with their key and what is allowed.
#[test]
fn wrong_entries() {
    for (text, key, says) in [
        (
            "kind = \"load_scale\"\nstd_relative = -0.01",
            "std_relative",
            "-0.01",
        ),
        (
            "kind = \"load_scale\"\nstd_mm = 1",
            "std_mm",
            "std_relative",
        ),
        ("kind = \"load_scale\"", "[0]", "std_relative"),
        ("kind = \"drift\"\nstd_um_per_h = -1", "std_um_per_h", "-1"),
        (
            "kind = \"drift\"\nstd_mm = 1",
            "std_mm",
            "it has std_um_per_h",
        ),
        (
            "kind = \"drift\"\njoints = [\"joint_1\"]\nstd_um_per_h = 1",
            "joints",
            "a drift has no such key",
        ),
        (
            "kind = \"load_scal\"\nstd_relative = 1",
            "kind",
            "load_scale",
        ),
        (
            "kind = \"joint_zero\"\nstd_mm = 1",
            "joints",
            "no joint is left for a joint_zero",
        ),
        (
            "kind = \"joint_zero\"\njoints = [\"joint_9\"]\nstd_mrad = 1",
            "joints",
            "joint_1",
        ),
        (
            "kind = \"load_point\"\njoints = [\"joint_1\"]\nstd_mm = 1",
            "joints",
            "load_point",
        ),
        (
            "kind = \"tracker_range\"\nstd_um_per_m = 6",
            "kind",
            "tracker_site",
        ),
        (
            "kind = \"tracker_range\"\nalong_um_per_m = 0.3",
            "std_um_per_m",
            "is missing",
        ),
        (
            "kind = \"tracker_range\"\nstd_um_per_m = 3\nalong_um_per_m = -1",
            "along_um_per_m",
            "-1",
        ),
        (
            "kind = \"load_scale\"\nstd_relative = 0.01\n[[uncertainty]]\nkind = \"load_scale\"\nstd_relative = 0.02",
            "[1].name",
            "twice",
        ),
        (
            "kind = \"load_scale\"\nstd_relative = 0.01\n[[uncertainty]]\nkind = \"load_scale\"\nname = \"b\"\n\
             std_relative = 0.02",
            "",
            "load.scale is listed twice",
        ),
    ] {
        assert_refused(text, key, says);
    }
}

/// The runs of a laboratory are functions of seed and run alone.
#[test]
fn threads_change_no_bit() {
    let text = with(&everything(), "robot", 256);
    let place = Workplace::with("laboratory.toml", &text);
    let run = |threads: u32| {
        let arguments = format!("study laboratory.toml --json --quiet --threads {threads}");
        place.done(&arguments).json()["plans"].clone()
    };
    let whole = run(1);
    assert_eq!(whole, run(3));
    // Shards, one of which is gone on with, come to the same.
    let study = |arguments: &str| place.done(&format!("study laboratory.toml --quiet {arguments}"));
    study("--shard 1/2 --tally-out one.json");
    study("--shard 2/2 --tally-out two.json --resume going.json");
    study("--shard 2/2 --tally-out two.json --resume going.json");
    let merged = place.json("merge one.json two.json");
    assert_eq!(merged["plans"], whole);
}

/// With everything drawn and nothing hidden, 95 % intervals hold the true compliances in 95 %: of N runs with five
/// intervals each, which may agree, within 4 standard deviations of N.
#[test]
fn intervals_hold_the_true_compliances() {
    let plan = study(&with(&everything(), "robot", 2000));
    let coverage = plan["coverage95"].as_f64().expect("a share");
    let room = 4.0 * (0.95 * 0.05 / 2000.0_f64).sqrt();
    assert!((coverage - 0.95).abs() < room, "{coverage}");
    // Ones that know of noise alone do not.
    let hidden = entry(SOURCES[7], "hidden = true");
    let plan = study(&with(&hidden, "robot", 512));
    assert!(
        plan["coverage95"].as_f64().expect("a share") < 0.9,
        "{plan}"
    );
    assert_eq!(
        study(&with(&everything(), "model", 64))["coverage95"],
        Value::Null
    );
}

/// A parameter that nothing in the testbed draws has no deviation.
#[test]
fn what_is_certain_is_nominal() {
    let scenario = loaded(&with(&entry(SOURCES[7], ""), "model", 64));
    let mut robots = TrueRobots::new(&scenario.task.belief, &scenario.truth).expect("works");
    let compliance = scenario.truth.robot.compliance_rad_per_nm.clone();
    let normals = vec![[1.5; LANES]; robots.numbers(2)];
    robots.become_run(&compliance, &normals, 0).expect("works");
    assert_eq!(robots.compliance_rad_per_nm(), &compliance[..]);
    let values = DVector::from_vec(robots.unknowns(&scenario.task.belief));
    assert!((values[values.len() - 1] - 0.015).abs() < 1e-12, "{values}");
    let arm = scenario.task.belief.arm();
    assert!(ParameterSet::new(&arm, [(ParameterKind::LoadScale, Some(0.01))]).is_ok());
}
