//! Choices of readings: what is best by a prediction is best by it, predictions are kept by a robot that is as the model says, and
//! threads change nothing.

use elastocal::measurement::AbsoluteReading;
use elastocal::numeric::markov::{Correlation, Kernel, SampledFunction};
use elastocal::numeric::random::generator;
use elastocal::parameter::JointFunction;

use crate::model_selection::read_of;
use crate::one_fit::{Campaign, plain, read, seen_arm, ur10, workplace};
use crate::support::{Workplace, list, scenario_text, shipped};

const SELECT: &str =
    "select s.toml --measurements m.csv --parameters zeros --sizes 10,16 --draws 12 --campaigns 40";

fn number(value: &serde_json::Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("no number: {value}"))
}

/// No choice predictions more than the planned one, whose bound holds; and on a robot without discrepancy all err as they predict.
#[test]
fn predictions_of_choices_are_kept() {
    let place = workplace(&plain(150, false));
    let found = place.json(&format!("{SELECT} --threads 1 --plot-out p.svg"));
    assert_eq!(found["readings"], 150);
    assert!(place.read("p.svg").contains("absolute accuracy"));
    crate::browser::plot_looks_well(&place.path("p.svg"));
    for of_size in list(&found["sizes"]) {
        let planned = list(&of_size["planned"]);
        assert_eq!(planned.len(), 6);
        let best = &planned[0];
        assert_eq!(best["criterion"], "test_pose");
        let rho0 = number(&best["rho0_mm"]);
        let bound = number(&best["lower_bound_rho0_mm"]);
        assert!(bound <= rho0 && bound > 0.7 * rho0, "{bound} and {rho0}");
        for other in planned {
            let predicted = number(&other["rho0_mm"]);
            assert!(predicted >= rho0 * (1.0 - 1e-9), "{other:#}");
            let kept = number(&other["without_discrepancy_from_true_mm"]) / predicted;
            assert!((0.65..1.4).contains(&kept), "{kept}: {other:#}");
            let chosen = list(&other["readings"]).len();
            assert_eq!(chosen.to_string(), of_size["size"].to_string());
        }
        let random = &of_size["random"];
        assert_eq!(random["draws"], 12);
        assert!(number(&random["rho0_mm"][0]) > rho0, "{random:#}");
        let kept =
            number(&random["without_discrepancy_from_true_mm"][1]) / number(&random["rho0_mm"][1]);
        assert!((0.8..1.25).contains(&kept), "{kept}");
    }
    let again = place.json(&format!("{SELECT} --threads 2"));
    assert_eq!(found["sizes"], again["sizes"]);
}

/// Errors that the readings' deviations do not tell of are predicted, too.
#[test]
fn predictions_count_discrepancy() {
    let predicted = |noise: f64| {
        let mut random = generator(11, 0);
        let arm = seen_arm(&mut random, &ur10(), 1, 1);
        let campaign = Campaign::positions(80, noise);
        let place = workplace(&read(&mut random, &arm, &campaign));
        let found = place.json("select s.toml --measurements m.csv --parameters zeros --sizes 8 --draws 1 --campaigns 20");
        let best = &found["sizes"][0]["planned"][0];
        ["rho0_mm", "without_discrepancy_from_true_mm"].map(|key| number(&best[key]))
    };
    let [own, with_discrepancy] = [1.0, 20.0].map(predicted);
    for (own, with_discrepancy) in own.into_iter().zip(with_discrepancy) {
        let ratio = with_discrepancy / own;
        assert!((16.0..24.0).contains(&ratio), "{ratio}");
    }
}

/// The standard deviation (rad) and the correlation length (rad) of each joint's error function.
const FUNCTION: (f64, f64) = (4e-4, 0.18);

/// Poses of an arm of which each joint is off by a random function of its own angle.
fn with_functions(correlation: Correlation, seed: u64, readings: usize) -> Vec<AbsoluteReading> {
    let mut random = generator(seed, 0);
    let arm = seen_arm(&mut random, &ur10(), 1, 1);
    let kernel = Kernel {
        correlation,
        length: FUNCTION.1,
        period: None,
    };
    let functions =
        [0, 1, 2, 3, 4, 5].map(|each| SampledFunction::new(kernel, generator(seed, 1), each));
    let gear = |joint: usize, angle: f64| FUNCTION.0 * functions[joint].at(angle);
    read_of(&mut random, &arm, readings, 0.0, &gear)
}

fn function_tables(correlation: &str) -> String {
    let [std_mrad, correlation_deg] = [FUNCTION.0 * 1e3, FUNCTION.1.to_degrees()];
    format!(
        "\n[[uncertainty]]\nkind = \"transmission_error\"\nstd_mrad = {std_mrad}\ncorrelation_deg = {correlation_deg}\n\
         correlation = \"{correlation}\"\n\
         \n[[uncertainty]]\nkind = \"discrepancy\"\nstd_mm = 0.01\n"
    )
}

/// With joint error functions in the planner's model every fit has them: choices that are planned with them are better than those planned
/// for independent errors, and what is predicted is observed, on simulated robots and on the readings themselves. Of one robot and 14 poses
/// some 13 unknowns err by as many normal numbers, which is 0.7 of the square of what remains, and three joints that matter by 3 x 17.5: a root
/// mean square is 1 to 0.14 (3 standard deviations). Which of equally good choices is found hangs on rounding.
#[test]
fn joint_error_functions_are_planned_with() {
    are_planned_with(Correlation::Exponential, "exponential", 0.58..1.42);
}

/// The same of smooth ones, of which one robot has fewer that are independent: of three joints that matter 3 x 11.5, of which a root mean square
/// is 1 to 0.12 (3 standard deviations, and the shares that are seen).
#[test]
fn smooth_joint_error_functions_are_planned_with() {
    are_planned_with(Correlation::Matern32, "matern32", 0.6..1.4);
}

fn are_planned_with(correlation: Correlation, name: &str, of_one_robot: std::ops::Range<f64>) {
    let place = workplace(&with_functions(correlation, 5, 260));
    let tables = function_tables(name);
    place.write("f.toml", scenario_text("ur10") + &tables);
    let command = "--measurements m.csv --parameters zeros --sizes 14,30 --draws 10";
    let found = place.json(&format!(
        "select f.toml {command} --campaigns 20 --threads 1"
    ));
    let plain = place.json(&format!("select s.toml {command} --campaigns 0"));
    assert_eq!(list(&found["joint_errors"]).len(), 6);
    for (of_size, plain) in (list(&found["sizes"]).iter()).zip(list(&plain["sizes"])) {
        let planned = list(&of_size["planned"]);
        assert_eq!(planned.len(), 7);
        let best = &planned[0];
        assert_eq!(best["criterion"], "test_pose_with_joint_errors");
        let rho0 = number(&best["rho0_mm"]);
        assert!(rho0 < number(&planned[1]["rho0_mm"]), "{best:#}");
        assert!(rho0 < number(&of_size["random"]["rho0_mm"][0]), "{best:#}");
        // Twenty robots, whose errors of a function's length or so are independent.
        for choice in &planned[..2] {
            let kept = number(&choice["without_discrepancy_from_true_mm"]);
            let kept = kept / number(&choice["rho0_mm"]);
            assert!((0.85..1.15).contains(&kept), "{kept}: {choice:#}");
            let kept = number(&choice["distance_mm"]["rms"]) / number(&choice["predicted_rms_mm"]);
            assert!(of_one_robot.contains(&kept), "{kept}: {choice:#}");
        }
        // A fit without functions leaves far more.
        let without = number(&plain["planned"][0]["distance_mm"]["rms"]);
        assert!(
            number(&best["distance_mm"]["rms"]) < 0.85 * without,
            "{without} {best:#}"
        );
    }
    let again = place.json(&format!(
        "select f.toml {command} --campaigns 20 --threads 2"
    ));
    assert_eq!(found["sizes"], again["sizes"]);
}

/// What `identify` estimates of joint error functions is what readings were made with, and `select` takes it as it is written.
#[test]
fn estimated_components_are_those_of_the_robot() {
    let (place, functions) = identified_functions(Correlation::Exponential, 6, 700);
    for each in functions {
        assert!(each.kernel.correlation.is_exponential());
        // What decides over short ways is the variance over the length; both apart are known worse.
        let slope = each.deviation_rad.powi(2) / each.kernel.length;
        let ratio = slope / (FUNCTION.0.powi(2) / FUNCTION.1);
        assert!((0.5..1.6).contains(&ratio), "{each:?}");
    }
    place.done("select f.toml --measurements m.csv --parameters zeros --sizes 12 --draws 1 --campaigns 0 --quiet");
}

/// What `identify` finds of the functions of a robot that has such, read at so many poses.
fn identified_functions(
    correlation: Correlation,
    seed: u64,
    readings: usize,
) -> (Workplace, Vec<JointFunction>) {
    let place = workplace(&with_functions(correlation, seed, readings));
    let identify = "identify s.toml --measurements m.csv --parameters zeros --quiet";
    place.run(&format!("{identify} --uncertainties-out u.toml"));
    let tables = place.read("u.toml");
    place.write("f.toml", scenario_text("ur10") + &tables);
    let scenario = place.scenario("f.toml");
    let extended = &scenario.task.belief.uncertain;
    let functions = extended.joint_functions();
    assert_eq!(functions.len(), 6);
    (place, functions)
}

/// Of eight robots of each kind the smoothness is found, and of smooth ones how large and how long the functions are: over 5.2 rad squares of
/// such a function are as 5.2 / (2.5 x 0.18) = 11.5 independent ones, and its size is known to 1 / sqrt(2 x 11.5), a factor of exp(0.21)
/// (3 standard deviations); the length, which goes with the square of that, to no more than twice.
#[test]
fn smoothness_is_found() {
    for correlation in Correlation::ALL {
        for seed in 1..=8 {
            let (_, functions) = identified_functions(correlation, seed, 90);
            for each in functions {
                assert_eq!(each.kernel.correlation, correlation, "{seed} {each:?}");
                if correlation == Correlation::Matern32 {
                    let [size, length] = [
                        each.deviation_rad / FUNCTION.0,
                        each.kernel.length / FUNCTION.1,
                    ];
                    assert!((0.53..1.88).contains(&size), "{seed} {each:?}");
                    assert!((0.5..2.0).contains(&length), "{seed} {each:?}");
                }
            }
        }
    }
}

/// Correlation lengths are of transmission errors of joints that turn, without harmonics.
#[test]
fn wrong_correlations_are_refused() {
    let place = workplace(&plain(12, false));
    for (table, wanted) in [
        (
            "kind = \"joint_zero\"\nstd_mrad = 1\ncorrelation_deg = 5",
            "a joint_zero has no such key",
        ),
        (
            "kind = \"transmission_error\"\nstd_mrad = 1\nharmonics = [3]\ncorrelation_deg = 5",
            "only a transmission_error without harmonics",
        ),
        (
            "kind = \"transmission_error\"\nstd_mrad = 1\ncorrelation_deg = 0",
            "correlation_deg",
        ),
        (
            "kind = \"transmission_error\"\nstd_mrad = 1\ncorrelation_mm = 5",
            "is of joints that turn",
        ),
        (
            "kind = \"transmission_error\"\nstd_mm = 1\ncorrelation_deg = 5",
            "a joint that slides has no turn",
        ),
        (
            "kind = \"transmission_error\"\nstd_mrad = 1\ncorrelation = \"matern32\"",
            "only a transmission_error with correlation_deg",
        ),
        (
            "kind = \"transmission_error\"\nstd_mrad = 1\ncorrelation_deg = 9\ncorrelation = \"rough\"",
            "matern32",
        ),
        (
            "kind = \"transmission_error\"\nstd_mrad = 1\ncorrelation_deg = nan",
            "correlation_deg",
        ),
    ] {
        place.write(
            "w.toml",
            format!("{}\n[[uncertainty]]\n{table}\n", scenario_text("ur10")),
        );
        place.refused("check w.toml --quiet").says(wanted);
    }
}

/// What is known before takes the place of readings.
#[test]
fn a_prior_makes_few_readings_enough() {
    let place = workplace(&plain(60, false));
    let prior = "\n[[uncertainty]]\nkind = \"joint_zero\"\nstd_mrad = 1\n\n[[uncertainty]]\nkind = \"link_position\"\nstd_mm = 0.2\n\n[[uncertainty]]\nkind = \"link_rotation\"\nstd_mrad = 0.5\n";
    place.write("k.toml", scenario_text("ur10") + prior);
    let found = place.json("select k.toml --measurements m.csv --parameters geometry --sizes 6 --draws 5 --campaigns 0");
    assert!(number(&found["known_before"]) > 10.0, "{found:#}");
    let best = &found["sizes"][0]["planned"][0];
    assert!(number(&best["rho0_mm"]) > 0.0, "{best:#}");
    assert!(best["without_discrepancy_from_true_mm"].is_null());
    // Without it, six positions do not tell so much.
    let bare = place.json("select s.toml --measurements m.csv --parameters geometry --sizes 6 --draws 5 --campaigns 0");
    let problem = bare["sizes"][0]["planned"][0]["problem"]
        .as_str()
        .expect("a problem");
    assert!(problem.contains("cannot determine"), "{problem}");
}

/// Wrong inputs are told.
#[test]
fn what_cannot_be_chosen_from_is_refused() {
    let readings = plain(12, false);
    let place = workplace(&readings);
    let run = |place: &Workplace, arguments: &str, wanted: &str| {
        let outcome = place.refused(&format!("{arguments} --quiet"));
        outcome.says(wanted);
    };
    run(
        &place,
        "select s.toml --measurements m.csv --sizes 12",
        "holds 12 readings, of which 12 leave none to validate on",
    );
    place.misused("select s.toml --measurements m.csv --sizes 0");
    let plan = shipped("scenarios/plans/klimchik2012_m3.csv");
    place.write("kr.toml", scenario_text("klimchik2012"));
    place.done(&format!(
        "measure kr.toml --plan {plan} --measurements-out d.csv --quiet"
    ));
    run(
        &place,
        "select kr.toml --measurements d.csv --sizes 2",
        "holds deflections",
    );
}
