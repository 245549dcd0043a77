//! Instruments that show coarse steps: repeats share errors of rounding, which predictions, fits and bounds count.

use elastocal::codes::ConditionCode;
use elastocal::experiment::read_candidates;
use elastocal::identification::{AbsoluteCase, Case, ReadingWeights};
use elastocal::measurement::{MeasuredFile, read_measured};
use elastocal::plan::absolute::AbsolutePlanning;
use elastocal::plan::search::{Bound, BudgetPoint, Problem, random_plan};
use elastocal::plan::{Assessment, Criterion, ExperimentModel, Plan, posterior, read_plan, rho0_m};
use elastocal::scenario::Scenario;
use elastocal::testbed::measurements_of;
use nalgebra::DMatrix;

use crate::absolute_trials::holds;
use crate::support::{Workplace, number, project, scenario_text};
use crate::uncertainties::{assert_holds, loaded};

const GAUGE: &str = "kr270_gauge";

/// The gauge of the KR-270 with such a standard deviation and such steps (mm), where nothing but compliances is uncertain besides.
fn coarse(sigma_mm: f64, step_mm: f64) -> String {
    let text = scenario_text(GAUGE);
    let (head, tail) = text.split_once("# How well the gauge").expect("a comment");
    let (_, tail) = tail.split_once("# A gauge is set").expect("a comment");
    format!("{head}# A gauge is set{tail}")
        .replace("sigma_mm = 0.005", &format!("sigma_mm = {sigma_mm}"))
        .replace(
            "resolution_mm = 0.001",
            &format!("resolution_mm = {step_mm}"),
        )
        .replace("std_relative = 0.02", "std_relative = 0.0005")
}

/// The shipped plan of nine, each of its eight experiments so often.
fn nine(scenario: &Scenario, repeats: u32) -> Plan {
    let path = project("scenarios/plans/kr270_gauge_m9.csv");
    let commands = scenario.task.belief.commands();
    let mut plan = read_plan(&path, commands).expect("a plan");
    for each in &mut plan.experiments {
        each.repeats = repeats;
    }
    plan
}

/// What repeats leave on virtual robots, whose readings are rounded one by one, is what is predicted: far below the step nearly all is
/// shared, near it little.
#[test]
fn predictions_of_repeats_hold_on_virtual_robots() {
    for sigma_mm in [0.001, 0.008] {
        let text = coarse(sigma_mm, 0.05);
        let scenario = loaded(&text);
        let place = Workplace::new();
        let (head, _) = text.split_once("[[plan]]").expect("a plan");
        let study = "[study]\nlevel = \"robot\"\ntrials = 1200\n[[study.plan]]\nkind = \"file\"\nname = \"nine\"\nfile = \"plan.csv\"\n";
        let head = head.replace("experiments = 9", "experiments = 48");
        place.write("s.toml", format!("{head}{study}"));
        let commands = scenario.task.belief.commands();
        // Experiments that have nothing to do with each other are rounded independently.
        let mut plan = random_plan(&scenario.task, 8, 5, 0).expect("a plan");
        for each in &mut plan.experiments {
            each.repeats = 6;
        }
        place.write_plan("plan.csv", commands, &plan);
        let found = place.json("study s.toml")["plans"][0].clone();
        assert_holds(&found, &format!("sigma {sigma_mm}"));
        assert!(number(&found["coverage95"]) > 0.93, "{found}");
    }
}

/// Repeats that scatter by less than a step are mostly shown alike: their residuals are smaller than normal errors', and that is no condition.
#[test]
fn repeats_that_are_shown_alike_are_not_too_near() {
    let text = coarse(0.0005, 0.01);
    let scenario = loaded(&text);
    let place = Workplace::new();
    let (head, _) = text.split_once("[[plan]]").expect("a plan");
    place.write("s.toml", head);
    let plan = nine(&scenario, 4);
    let commands = scenario.task.belief.commands();
    place.write_plan("plan.csv", commands, &plan);
    for run in 0..20 {
        let measure =
            format!("measure s.toml --plan plan.csv --run {run} --measurements-out m.csv");
        place.done(&format!("{measure} --quiet"));
        place.done("identify s.toml --measurements m.csv --quiet");
    }
}

/// Six repeats of a gauge that hardly errs tell as much as one, of one that errs by more than a step six times as much; a fit weighs
/// measurements as the plan did.
#[test]
fn fits_weigh_repeats_as_plans_do() {
    for (sigma_mm, least, most) in [
        (0.0001, 1.0, 1.1),
        (0.008, 2.0, 4.0),
        (0.06, 5.99, 6.0 + 1e-9),
    ] {
        let scenario = loaded(&coarse(sigma_mm, 0.05));
        let belief = &scenario.task.belief;
        let model = ExperimentModel::new(belief);
        let sizes = DMatrix::from_diagonal(&belief.sizes().into());
        let told = |plan: &Plan| {
            let each = plan
                .experiments
                .iter()
                .zip(model.observation_matrices(plan));
            let each = each.map(|(of, rows)| rows.tr_mul(&rows) * f64::from(of.repeats));
            let sum: DMatrix<f64> = each.sum();
            &sizes * sum * &sizes / belief.instrument.sigma_m.powi(2)
        };
        let [once, often] = [1, 6].map(|repeats| nine(&scenario, repeats));
        let worth = told(&often).trace() / told(&once).trace();
        assert!((least..=most).contains(&worth), "{sigma_mm}: {worth}");
        // The same rows one by one are the same plan.
        let mut rows = nine(&scenario, 1);
        rows.experiments = [&*rows.experiments; 6].concat();
        let [one, other] = [&often, &rows]
            .map(|plan| rho0_m(&scenario.task, &posterior(belief, plan)).expect("determined"));
        assert!((one / other - 1.0).abs() < 1e-9, "{one} {other}");
        let measurements = measurements_of(&often, &belief.instrument);
        let fitted = Case::as_believed(belief, &measurements).information();
        let fitted = &sizes * fitted * &sizes;
        let planned = told(&often);
        assert!(
            (&fitted - &planned).amax() < 1e-6 * planned.amax(),
            "{fitted} {planned}"
        );
    }
}

/// No plan is better than the bound that is shown beside it, and a plan that is searched for is evaluated to what it was found for.
#[test]
fn bounds_hold_where_repeats_share_rounding() {
    let text = coarse(0.001, 0.05);
    let scenario = loaded(&text);
    let (task, seed) = (&scenario.task, scenario.seed);
    let bound = Bound::search(task, seed).with_sizes(seed, [6, 24]);
    for index in 0..3 {
        let plan = random_plan(task, 6, seed, index).expect("a plan");
        let once = BudgetPoint::repeated(task, &plan, 1, &bound).expect("determined");
        let often = BudgetPoint::repeated(task, &plan, 4, &bound).expect("determined");
        for point in [&once, &often] {
            assert!(point.rho0_m >= point.lower_bound_m().expect("a bound"));
        }
        assert!(often.rho0_m > 0.8 * once.rho0_m, "what repeats share stays");
    }
    let place = Workplace::new();
    let (head, _) = text.split_once("[[plan]]").expect("a plan");
    place.write("s.toml", head);
    let json = |command: &str| place.record(command);
    let planned =
        json("plan s.toml --experiments 12 --configurations 6 --no-proof --plan-out p.csv");
    let evaluated = json("evaluate s.toml --plan p.csv --no-proof");
    let [one, other] = [&planned, &evaluated].map(|json| number(&json["rho0_mm"]));
    assert!((one / other - 1.0).abs() < 1e-6, "{one} {other}");
    assert!(number(&planned["lower_bound_rho0_mm"]) <= one);
}

/// The gradient of a plan's cost where an experiment is repeated: the more its readings scatter, the less rounding they share.
#[test]
fn gradients_know_of_shared_rounding() {
    let text = scenario_text(GAUGE)
        .replace("resolution_mm = 0.001", "resolution_mm = 1")
        .replace("std_mrad = 10", "std_mrad = 3");
    let scenario = loaded(&text);
    let problem = Problem::new(&scenario.task, Criterion::TestPose);
    let mut plan = random_plan(&scenario.task, 6, 7, 0).expect("a plan");
    plan.experiments[2].repeats = 5;
    let (cost, gradient) = problem.cost_and_gradient(&plan);
    for (joint, slope) in gradient[2].iter().enumerate() {
        let shift = 1e-4;
        let at = |by: f64| {
            let mut moved = plan.clone();
            moved.experiments[2].configuration_rad[joint] += by;
            problem.cost_and_gradient(&moved).0
        };
        let expected = (at(shift) - at(-shift)) / (2.0 * shift);
        let error = (slope - expected).abs();
        assert!(
            error < 1e-4 * (expected.abs() + cost),
            "{joint}: {slope} {expected}"
        );
    }
}

/// Configurations that hardly differ, and show nearly the same, are named: they may be rounded alike.
#[test]
fn neighbours_that_are_rounded_alike_are_named() {
    let scenario = loaded(&coarse(0.001, 0.05));
    let conditions = |by_rad: f64| {
        let mut plan = nine(&scenario, 1);
        let mut other = plan.experiments[0].clone();
        other.configuration_rad[1] += by_rad;
        plan.experiments.push(other);
        let mut all = Assessment::new(&scenario.task, &plan, None).conditions;
        all.retain(|each| each.code == ConditionCode::NearConfigurations);
        all
    };
    let near = conditions(0.001);
    assert!(
        near.len() == 1 && near[0].text.contains("rounding error"),
        "{near:?}"
    );
    assert!(conditions(0.2).is_empty());
}

/// Heights that are read again and again in steps of 0.05 mm: on virtual robots, and in a fit, whose standard errors are those of the plan.
#[test]
fn predictions_of_repeated_heights_hold_on_virtual_robots() {
    let text = scenario_text("ur10_height_gauge")
        .replace("sigma_mm = 0.004", "sigma_mm = 0.002")
        .replace("resolution_mm = 0.001", "resolution_mm = 0.05")
        .replace("std_mrad = 0.02", "std_mrad = 0.002")
        .replace("joints = [\"shoulder_pan\", ", "joints = [");
    let place = Workplace::with("s.toml", text);
    let plan = project("scenarios/plans/ur10_height_gauge.csv");
    let plan = std::fs::read_to_string(plan).expect("read");
    place.write("once.csv", &plan);
    place.write("often.csv", plan.replace(",1,spindle", ",8,spindle"));
    let [once, often] = ["once", "often"].map(|name| {
        let evaluated = place.json(&format!("evaluate s.toml --plan {name}.csv"));
        number(&evaluated["rho0_mm"])
    });
    assert!(often > 0.5 * once, "{often} {once}");
    let json = place.json("evaluate s.toml --plan often.csv --trials 600");
    holds(&json["trials"]);
    place.json("measure s.toml --plan often.csv --measurements-out read.csv");
    let scenario = place.scenario("s.toml");
    let belief = &scenario.task.belief;
    let rows = read_candidates(&place.path("often.csv"), belief.commands()).expect("a plan");
    let planning = AbsolutePlanning::new(&scenario.task, &[], &rows).expect("a plan");
    let planned = planning.prediction(&planning.whole()).posterior;
    let read = read_measured(&place.path("read.csv"), belief).expect("read");
    let MeasuredFile::Absolute(readings) = read else {
        panic!("heights are absolute readings");
    };
    let case = AbsoluteCase::new(belief, &readings).expect("a case");
    let mut case = case.counting_sources_of_lengths();
    case.choices.keeps_all = true;
    let fit = case.fit(&[], ReadingWeights::Own).expect("a fit");
    // 18 heights eight times, and three twice.
    assert_eq!(readings.len(), 150);
    for (place, parameter) in planning.set().parameters().iter().enumerate() {
        let own = fit.set.index_of(parameter.kind).expect("the same unknowns");
        let one = planned.standard_error(place).expect("determined");
        let other = fit.posterior.standard_error(own).expect("determined");
        let name = &parameter.name;
        // The robot that was read is softer or stiffer than the nominal one by some 10 %.
        assert!((one / other - 1.0).abs() < 0.15, "{name}: {one} {other}");
    }
}
