//! Displacements along a direction, as a dial gauge reads them: plans and fits of them, on the virtual robot.

use elastocal::calibration::{calibrate, measure};
use elastocal::identification::Case;
use elastocal::measurement::read_measurements;
use elastocal::observation::DeflectionPrecision;
use elastocal::plan::search::{Problem, random_plan};
use elastocal::plan::{Criterion, Feasibility, Plan, UncertaintyBudget, read_plan};
use elastocal::record::run::RunMessage;
use elastocal::scenario::Scenario;
use elastocal::testbed::TrueRobots;
use elastocal::view::mcap_file::write_mcap;
use elastocal::view::recording::Recording;
use nalgebra::{DMatrix, Matrix3xX, Matrix6xX, Vector3};
use serde_json::Value;

use crate::recordings::read_mcap;
use crate::robust_deflections::robust;
use crate::search::cost_and_gradient;
use crate::support::{
    Workplace, assert_alike, assert_alike_in, assert_change_refused, assert_near, list, number,
    numbers, scenario, scenario_text, shipped, with_numbers,
};
use crate::uncertainties::{assert_holds, loaded};

const GAUGE: &str = "kr270_gauge";

fn gauge() -> Scenario {
    scenario(GAUGE)
}

/// Six measurements of random configurations and directions.
fn six(scenario: &Scenario) -> Plan {
    random_plan(&scenario.task, 6, 7, 0).expect("experiments are possible")
}

/// A row d . J over s, s^2 = sigma^2 + d . C d, of the rows J and the covariance C that all three coordinates would have.
#[test]
fn a_displacement_is_one_row_of_a_deflection() {
    let scenario = gauge();
    let belief = &scenario.task.belief;
    let extended = &belief.uncertain;
    let precision = belief.instrument.precision();
    let all_three = DeflectionPrecision {
        along_sigma_m: None,
        along_step_m: 0.0,
        reads_all: true,
        ..precision
    };
    let mut along = extended.readings_of_all(precision);
    let mut whole = extended.readings_of_all(all_three);
    let size = belief.unknowns();
    let plan = six(&scenario);
    for each in &plan.experiments {
        let direction = each.direction.expect("a gauge points somewhere");
        let q = each.configuration_rad.as_slice();
        along.read_along(Some(&direction));
        along.move_to(q);
        whole.read_along(Some(&direction));
        whole.move_to(q);
        let mut jacobian = Matrix6xX::zeros(size);
        whole.derivatives(&each.load, &mut jacobian);
        // What is shown on average of what moves along it.
        let shown = direction * extended.share_along();
        let row = jacobian.fixed_rows::<3>(0).tr_mul(&shown);
        let covariance = whole.covariance_of_all(&each.load);
        let spread = shown.dot(&(covariance.fixed_view::<3, 3>(0, 0) * shown));
        let expected = &row * row.transpose() / (precision.sigma_m.powi(2) + spread);
        let told = |readings: &elastocal::observation::PlannedReadings<'_>| {
            let mut matrix = Matrix3xX::zeros(size);
            readings.observe(&each.load, &mut matrix);
            DMatrix::from(matrix.tr_mul(&matrix))
        };
        assert!((told(&along) - &expected).amax() < 1e-9 * expected.amax());
        // One that points nowhere is no tracker.
        along.read_along(None);
        assert!(told(&along).amax() == 0.0);
    }
}

/// The gradient of a plan's cost by its joint angles, in each of the forms that rows of a gauge come in: of compliances alone, of an arm
/// whose sources have a gradient, and with the gauge's own direction among them.
#[test]
fn gradients_are_those_of_the_cost() {
    let text = scenario_text(GAUGE);
    let (head, tail) = text.split_once("# How well the gauge").expect("a comment");
    let (_, tail) = tail.split_once("# What is left").expect("a comment");
    let mut alone = gauge();
    alone.noise_only();
    for scenario in [
        alone,
        loaded(&format!("{head}# What is left{tail}")),
        gauge(),
    ] {
        let problem = Problem::new(&scenario.task, Criterion::TestPose);
        let plan = six(&scenario);
        let mut evaluator = problem.evaluator();
        for index in 0..plan.experiments.len() {
            let mut rest = plan.clone();
            let own = rest.experiments.remove(index);
            let rest = problem.information(&rest);
            evaluator.readings.read_along(own.direction.as_ref());
            let mut at_angles = |q: &[f64]| {
                cost_and_gradient(
                    &problem,
                    problem.criterion,
                    &mut evaluator,
                    &rest,
                    q,
                    &own.load,
                )
            };
            let q = own.configuration_rad.as_slice();
            let (cost, gradient) = at_angles(q);
            for (joint, slope) in gradient[..q.len()].iter().enumerate() {
                let mut at = |shift: f64| {
                    let mut q = q.to_vec();
                    q[joint] += shift;
                    at_angles(&q).0
                };
                let shift = 1e-4;
                let expected = (at(shift) - at(-shift)) / (2.0 * shift);
                assert!(
                    (slope - expected).abs() < 1e-4 * (expected.abs() + cost),
                    "{index} {joint}: {slope} {expected} {cost}"
                );
            }
        }
    }
}

/// A search over three directions is no worse than over any one of them, and than random plans.
#[test]
fn the_search_chooses_among_directions() {
    let text = scenario_text(GAUGE);
    let place = Workplace::new();
    let rho0 = |directions: &str| {
        let own = text.replace("[[1, 0, 0], [0, 1, 0], [0, 0, 1]]", directions);
        place.write("gauge.toml", own);
        let json = place
            .json("plan gauge.toml --noise-only --experiments 6 --plan-out plan.csv --no-proof");
        number(&json["rho0_mm"])
    };
    let one = ["[[1, 0, 0]]", "[[0, 0, 1]]"].map(rho0);
    let all = rho0("[[1, 0, 0], [0, 1, 0], [0, 0, 1]]");
    assert!(all < 1.001 * one[0].min(one[1]), "{all} {one:?}");
    let plan = read_plan(&place.path("plan.csv"), gauge().task.belief.commands());
    let plan = plan.expect("a plan that is written is read");
    let scenario = gauge();
    assert_eq!(Feasibility::new(&scenario.task).violations(&plan), []);
    let problem = Problem::new(&scenario.task, Criterion::TestPose);
    let cost = |plan: &Plan| {
        let information = problem.information(plan);
        problem.cost().value(&information).expect("it is regular")
    };
    assert!(cost(&plan) < cost(&six(&scenario)));
}

/// A study of the plan of nine that the project ships, on the virtual robot.
fn study(text: &str, trials: u32) -> Value {
    let (head, plan) = text.split_once("[[plan]]").expect("a plan");
    let place = Workplace::with(
        "gauge.toml",
        format!(
            "{head}[study]\nlevel = \"robot\"\ntrials = {trials}\n[[study.plan]]\nkind = \"file\"{plan}"
        ),
    );
    place.json("study gauge.toml")["plans"][0].clone()
}

/// What virtual robots leave is what is predicted, and 95 % intervals hold the truth in 95 % of the runs, within three standard errors.
#[test]
fn predictions_hold_on_virtual_robots() {
    let trials = 5000;
    let plan = study(&scenario_text(GAUGE), trials);
    let [rms, error, predicted] =
        ["rms_mm", "rms_std_mm", "combined_rms_mm"].map(|key| number(&plan[key]));
    assert_near(rms, predicted, 3.0 * error);
    let coverage = number(&plan["coverage95"]);
    let error = (0.95 * 0.05 / f64::from(trials)).sqrt();
    assert!((coverage - 0.95).abs() < 3.0 * error, "{coverage}");
}

/// A coarse step is counted as the noise that it is.
#[test]
fn a_coarse_gauge_is_predicted_to_be_one() {
    let text = scenario_text(GAUGE);
    let coarse = text.replace("resolution_mm = 0.001", "resolution_mm = 0.2");
    let [fine, coarse] = [&text, &coarse].map(|text| study(text, 600));
    let predicted = |plan: &Value| number(&plan["combined_rms_mm"]);
    assert!(predicted(&coarse) > 1.2 * predicted(&fine));
    assert_holds(&coarse, "coarse");
}

/// The whole way through files: plan, virtual readings in whole steps, and what is identified of them.
#[test]
fn files_of_a_gauge_are_read_as_they_are_written() {
    let place = Workplace::with("gauge.toml", scenario_text(GAUGE));
    let scenario = gauge();
    let commands = scenario.task.belief.commands();
    let plan = six(&scenario);
    place.write_plan("plan.csv", commands.clone(), &plan);
    assert_eq!(
        read_plan(&place.path("plan.csv"), commands).expect("read"),
        plan
    );
    place.json("measure gauge.toml --plan plan.csv --measurements-out measured.csv");
    let header = place.read("measured.csv");
    assert!(header.contains("direction_x,direction_y,direction_z,displacement_mm"));
    let read = read_measurements(&place.path("measured.csv"), &scenario.task.belief);
    for (each, planned) in read.expect("read").iter().zip(&plan.experiments) {
        assert_eq!(each.direction, planned.direction);
        let steps = each
            .direction
            .map(|d: Vector3<f64>| d.dot(&each.deflection_m) * 1e6);
        let steps = steps.expect("a direction");
        assert!((steps - steps.round()).abs() < 1e-6, "{steps}");
    }
    let step = |row: &str| {
        row.rsplit(',')
            .next()
            .is_some_and(|mm| mm.len() <= "-10.001".len())
    };
    let mut rows = header.lines().filter(|row| !row.starts_with(['#', 'q']));
    assert!(rows.all(step), "{header}");
    let json = place.json("identify gauge.toml --measurements measured.csv");
    // Six numbers, of which the priors of five compliances take up what they do not know.
    let residuals = list(&json["residuals"]);
    assert_eq!(residuals.len(), 6);
    for each in residuals {
        assert_eq!(list(&each["standardised"]).len(), 1);
        assert!(number(&each["degrees_of_freedom"]) < 1.5);
    }
    place.json("evaluate gauge.toml --plan plan.csv --no-proof");
    // A gauge at its stop, and one that a file calls exact.
    place.write(
        "narrow.toml",
        scenario_text(GAUGE).replace("range_mm = 10", "range_mm = 0.001"),
    );
    let notes = &place.json("identify narrow.toml --measurements measured.csv")["notes"];
    let said = "the gauge shows at most 0.001 mm to either side, and more in measurement 1, 2";
    assert!(notes.to_string().contains(said), "{notes}");
    let exact = header.replace("displacement_mm", "displacement_mm,s_mm");
    let exact: Vec<String> = (exact.lines())
        .map(|row| {
            if row.starts_with(['#', 'q']) {
                row.to_owned()
            } else {
                format!("{row},0")
            }
        })
        .collect();
    place.write("exact.csv", exact.join("\n"));
    let said = place.refused("identify gauge.toml --measurements exact.csv");
    said.says("s_mm: found 0; ");
}

/// For each measurement a gauge is set and the weight hung: minutes count both, the table says the direction.
#[test]
fn the_laboratory_sets_a_gauge_for_each_measurement() {
    let place = Workplace::new();
    let scenario = gauge();
    place.write("gauge.toml", scenario_text(GAUGE));
    let plan = six(&scenario);
    let commands = scenario.task.belief.commands();
    place.write_plan("plan.csv", commands, &plan);
    let json = place.record("lab gauge.toml --plan plan.csv");
    assert_eq!(json["load_changes"], 6);
    let stops = list(&json["stops"]);
    assert_eq!(stops.len(), 12);
    let costs = &scenario.laboratory.costs;
    let work = 6.0
        * (costs.station_min + costs.move_min + costs.load_change_min + 2.0 * costs.reading_min);
    let turning =
        number(&json["travel_deg"]) / scenario.laboratory.axis_speed_per_s.to_degrees() / 60.0;
    assert!((number(&json["minutes"]) - work - turning).abs() < 1e-6);
    for pair in stops.chunks(2) {
        assert_eq!(pair[0]["q_deg"], pair[1]["q_deg"]);
        assert!(pair[0]["wrench"].is_null() && pair[1]["wrench"].is_array());
        assert_eq!(numbers(&pair[0]["direction"]).len(), 3);
    }
    // What the gauge meets is what the virtual robot has there without noise.
    place.run("measure gauge.toml --plan plan.csv --noise-free --measurements-out free.csv");
    let free = read_measurements(&place.path("free.csv"), &scenario.task.belief).expect("read");
    for stop in stops {
        let first = stop["experiments"][0].as_u64().expect("a number");
        let experiment = usize::try_from(first).expect("a number") - 1;
        let expected_mm = plan.experiments[experiment]
            .direction
            .expect("one")
            .dot(&free[experiment].deflection_m)
            * 1e3;
        let found_mm = number(&stop["displacement_mm"]);
        assert_near(found_mm, expected_mm, 2e-3);
        assert!(
            numbers(&stop["target_mm"])
                .iter()
                .any(|mm| mm.abs() > 500.0)
        );
    }
    let text = place.run("lab gauge.toml --plan plan.csv");
    text.prints("gauge near [mm]");
    text.prints("should show [mm]");
    let table = place.read("out/gauge/lab/measurements.csv");
    assert!(table.contains("direction_z,displacement_mm"));
    let sheet = place.read("out/gauge/lab/run_sheet.html");
    assert_eq!(sheet.matches("The target is near ").count(), 6);
    assert_eq!(sheet.matches("<small>near ").count(), 6);
    assert_eq!(sheet.matches("set the gauge along").count(), 6);
    assert!(
        sheet.contains(" and 6 moves."),
        "the robot stands where the weight is hung"
    );
}

/// What a gauge does not have, or a plan that none can follow, is an error or a violation that says why.
#[test]
fn what_no_gauge_can_do_is_refused() {
    assert_change_refused(
        GAUGE,
        ["reads = \"displacement\"", ""],
        ["instrument.directions", "\"deflection\""],
    );
    assert_change_refused(
        GAUGE,
        ["range_mm = 10", "unloaded = \"shared\""],
        ["instrument.unloaded", "\"displacement\""],
    );
    assert_change_refused(
        GAUGE,
        ["range_mm = 10", "tracker_site = \"tracker\""],
        ["instrument.tracker_site", "\"displacement\""],
    );
    assert_change_refused(
        GAUGE,
        ["[0, 0, 1]]", "[0, 0, 0]]"],
        ["instrument.directions[2]", "direction"],
    );
    assert_change_refused(
        GAUGE,
        [
            "clearance_mm = 20",
            "clearance_mm = 20\nline_of_sight = true",
        ],
        ["region.line_of_sight", "positions"],
    );
    assert_change_refused(
        GAUGE,
        ["[design]", "[design]\naccuracy = \"absolute\""],
        ["design.accuracy", "positions"],
    );
    assert_change_refused(
        GAUGE,
        ["resolution_mm = 0.001", "resolution_mm = 20"],
        ["instrument.resolution_mm", "instrument.range_mm is 10"],
    );

    let place = Workplace::new();
    let text = scenario_text(GAUGE);
    place.write("gauge.toml", &text);
    place.write("short.toml", text.replace("range_mm = 10", "range_mm = 1"));
    let scenario = gauge();
    let mut plan = six(&scenario);
    let commands = scenario.task.belief.commands();
    let write = |plan: &Plan| {
        place.write_plan("plan.csv", commands.clone(), plan);
    };
    plan.experiments[1].direction = Some(Vector3::new(0.6, 0.8, 0.0));
    write(&plan);
    let said = place.doubted("evaluate gauge.toml --plan plan.csv --no-proof");
    said.prints("direction is (0.6000, 0.8000, 0.0000)");
    plan.experiments[1].direction = Some(Vector3::z());
    write(&plan);
    let said = place.doubted("evaluate short.toml --plan plan.csv --no-proof");
    said.prints("displacement along the gauge");
    // A tracker's plan says no direction.
    place.write(
        "tracker.csv",
        std::fs::read(crate::support::project(
            "scenarios/plans/klimchik2012_m4.csv",
        ))
        .expect("read"),
    );
    place
        .refused("evaluate gauge.toml --plan tracker.csv")
        .says("direction_x");
    let proved = place.done("plan gauge.toml --experiments 6 --prove 10% --noise-only");
    let refusal = "Nothing is proved: there is no proof where a gauge";
    proved.prints(refusal);
}

/// The tracker of the laboratory reads some experiments, a gauge beside it others.
pub fn beside(text: &str) -> String {
    let (head, tail) = text.split_once("[instrument]").expect("an instrument");
    let (_, tail) = tail.split_once("[[test_pose]]").expect("a test pose");
    let range = "[[uncertainty]]\nkind = \"tracker_range\"\nstd_um_per_m = 6\n";
    let (tail, plans) = tail.split_once("[[plan]]").expect("a plan");
    format!(
        "{head}[instrument]\nsigma_mm = 0.03\nsigma_of = \"deflection\"\ntracker_site = \"tracker\"\n[instrument.gauge]\n\
         sigma_mm = 0.005\ndirections = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nrange_mm = 10\nresolution_mm = 0.001\n\
         [[test_pose]]{tail}{range}[[plan]]{plans}"
    )
}

/// Six random experiments, of which both instruments read some.
pub fn of_both(scenario: &Scenario) -> Plan {
    let mut plan = six(scenario);
    for (index, each) in plan.experiments.iter_mut().enumerate() {
        each.direction = (index % 2 == 0).then_some(Vector3::z());
    }
    plan
}

/// Without any other error source both tell as much together as the gauge alone and the tracker alone of their own.
#[test]
fn a_gauge_and_a_tracker_tell_as_much_as_each() {
    let text = beside(&scenario_text(GAUGE));
    let (head, tail) = text.split_once("[instrument.gauge]").expect("a gauge");
    let (_, rest) = tail.split_once("[[test_pose]]").expect("a test pose");
    let (rest, _) = rest.split_once("[[plan]]").expect("a plan");
    let named = "kind = \"load_direction\"\nname = \"more\"";
    let of_tracker =
        format!("{head}[[test_pose]]{rest}").replacen("kind = \"gauge_direction\"", named, 1);
    let [mut both, mut gauge, mut tracker] = [loaded(&text), gauge(), loaded(&of_tracker)];
    let plan = of_both(&both);
    let information = |scenario: &mut Scenario, is_told: &dyn Fn(bool) -> bool| {
        scenario.noise_only();
        let mut plan = plan.clone();
        plan.experiments
            .retain(|each| is_told(each.direction.is_some()));
        Problem::new(&scenario.task, Criterion::TestPose).information(&plan)
    };
    let all = information(&mut both, &|_| true);
    let prior = information(&mut both, &|_| false);
    let of_gauge = information(&mut gauge, &|along| along) - information(&mut gauge, &|_| false);
    let of_tracker =
        information(&mut tracker, &|along| !along) - information(&mut tracker, &|_| false);
    let expected = prior + of_gauge + of_tracker;
    assert!(
        (&all - &expected).amax() < 1e-9 * expected.amax(),
        "{all} {expected}"
    );
}

/// With all error sources, each of its own instrument, and one that readings of a configuration share, whichever instrument makes them and
/// along whichever direction: what virtual robots leave is what is predicted, and intervals cover.
#[test]
fn mixed_campaigns_are_predicted() {
    let shared = "[[uncertainty]]\nkind = \"discrepancy\"\nstd_mm = 0.03\n[[test_pose]]";
    let text = beside(&scenario_text(GAUGE)).replacen("[[test_pose]]", shared, 1);
    let scenario = loaded(&text);
    let mut plan = six(&scenario);
    let directions = [Some(Vector3::z()), None, Some(Vector3::x())];
    for place in 0..plan.experiments.len() {
        plan.experiments[place].configuration_rad =
            plan.experiments[place / 3].configuration_rad.clone();
        plan.experiments[place].direction = directions[place % 3];
    }
    let place = Workplace::new();
    let (head, _) = text.split_once("[[plan]]").expect("a plan");
    let head = head.replace("experiments = 9", "experiments = 6");
    place.write(
        "both.toml",
        format!("{head}[study]\nlevel = \"robot\"\ntrials = 4000\n[[study.plan]]\nkind = \"file\"\nname = \"both\"\nfile = \"plan.csv\"\n"),
    );
    let commands = scenario.task.belief.commands();
    place.write_plan("plan.csv", commands.clone(), &plan);
    assert_eq!(
        read_plan(&place.path("plan.csv"), commands).expect("read"),
        plan
    );
    let found = place.json("study both.toml")["plans"][0].clone();
    let [rms, error, predicted, coverage] =
        ["rms_mm", "rms_std_mm", "combined_rms_mm", "coverage95"].map(|key| number(&found[key]));
    assert_near(rms, predicted, 3.0 * error + 0.005 * predicted);
    assert_near(coverage, 0.95, 3.0 * (0.95 * 0.05 / 4000.0_f64).sqrt());
}

/// A tracker's readings cost no set-up of a gauge: where they are worth more, a plan by minutes has as many of them as there is time for, and
/// is no worse than that of the tracker alone.
#[test]
fn plans_by_minutes_count_what_each_instrument_costs() {
    let place = Workplace::new();
    let text = beside(&scenario_text(GAUGE));
    let (head, _) = text.split_once("[[plan]]").expect("a plan");
    place.write("both.toml", head);
    let timed = place.json("plan both.toml --no-proof --minutes 90 --plan-out plan.csv");
    let minutes = number(&timed["minutes"]);
    assert!(minutes > 85.0 && minutes <= 90.0, "{minutes}");
    let plan = read_plan(
        &place.path("plan.csv"),
        loaded(&text).task.belief.commands(),
    );
    let plan = plan.expect("a plan");
    let mut along = plan.experiments.iter().map(|each| each.direction.is_some());
    assert!(!along.all(|along| along), "{plan:?}");
    let (before, gauge) = head.split_once("[instrument.gauge]").expect("a gauge");
    let (_, after) = gauge.split_once("[[test_pose]]").expect("a test pose");
    let direction = "[[uncertainty]]\nkind = \"gauge_direction\"\nstd_mrad = 10\n";
    assert!(after.contains(direction));
    let after = after.replace(direction, "");
    place.write("tracker.toml", format!("{before}[[test_pose]]{after}"));
    let by_tracker = place.json("plan tracker.toml --no-proof --minutes 90");
    let [both_mm, tracker_mm] = [timed, by_tracker].map(|plan| number(&plan["rho0_mm"]));
    assert!(both_mm < 1.002 * tracker_mm, "{both_mm} {tracker_mm}");
}

/// A gauge's load is hung in place, so that the instrument drifts no longer than that takes, also where a tracker reads before and after
/// the robot's return: predictions of a plan of the gauge alone are those of a laboratory that hangs all in place, and virtual robots
/// agree on plans of both.
#[test]
fn drifts_are_as_long_as_each_instrument_takes() {
    let place = Workplace::new();
    let text = beside(&scenario_text(GAUGE));
    let (head, _) = text.split_once("[[plan]]").expect("a plan");
    let head = head.replace("experiments = 9", "experiments = 6")
        + "[[uncertainty]]\nkind = \"drift\"\nstd_um_per_h = 600\n";
    let study = "[study]\nlevel = \"robot\"\ntrials = 4000\n[[study.plan]]\nkind = \"file\"\nname = \"both\"\nfile = \"both.csv\"\n";
    place.write("returns.toml", format!("{head}{study}"));
    let in_place = "[laboratory]\nloading = \"in_place\"\n";
    place.write(
        "in_place.toml",
        head.replacen("[laboratory]\n", in_place, 1),
    );
    let scenario = loaded(&text);
    let both = of_both(&scenario);
    for (name, is_of) in [
        ("gauge.csv", Some(true)),
        ("tracker.csv", Some(false)),
        ("both.csv", None),
    ] {
        let mut plan = both.clone();
        (plan.experiments).retain(|each| is_of.is_none_or(|is| each.direction.is_some() == is));
        let commands = scenario.task.belief.commands();
        place.write_plan(name, commands, &plan);
    }
    let rho0 = |plan: &str| {
        ["returns", "in_place"].map(|name| {
            let json = place.json(&format!(
                "evaluate {name}.toml --plan {plan}.csv --no-proof"
            ));
            number(&json["rho0_mm"])
        })
    };
    let [returns, in_place] = rho0("gauge");
    assert_alike(returns, in_place, 1e-9);
    let [returns, in_place] = rho0("tracker");
    assert!(returns > 1.01 * in_place, "{returns} {in_place}");
    let found = place.json("study returns.toml")["plans"][0].clone();
    let [rms, error, predicted, coverage] =
        ["rms_mm", "rms_std_mm", "combined_rms_mm", "coverage95"].map(|key| number(&found[key]));
    println!("{rms} {error} {predicted} {coverage}");
    assert_near(rms, predicted, 3.0 * error + 0.005 * predicted);
    let error = (0.95 * 0.05 / 4000.0_f64).sqrt();
    assert!((coverage - 0.95).abs() < 3.0 * error, "{coverage}");
}

/// Recordings have no coordinates of what a gauge reads, and no one number stands for the noise of both.
#[test]
fn recordings_show_what_each_instrument_reads() {
    let scenario = loaded(&beside(&scenario_text(GAUGE)));
    let (plan, seed) = (of_both(&scenario), scenario.seed);
    let found = calibrate(&scenario.task, &scenario.truth, &plan, seed, 0).expect("it works");
    let posterior = &found.identification.posterior;
    let budget = UncertaintyBudget::of_deflections(&scenario.task, &plan, posterior);
    let noise = budget.expect("it is determined").sources[0].clone();
    assert_eq!(noise.standard_uncertainty, None);
    let both = "is 0.03 mm of a coordinate and 0.00501 mm of the gauge";
    assert_eq!(noise.remark.as_deref(), Some(both));
    let (task, truth) = (&scenario.task, &scenario.truth);
    let shown = RunMessage::of_deflections(task, truth, seed, "plan", &found);
    let shown = shown.expect("it works");
    let recording = Recording::new(&scenario, &[shown]).expect("it works");
    let place = Workplace::new();
    write_mcap(&place.path("run.mcap"), &recording).expect("written");
    let bytes = std::fs::read(place.path("run.mcap")).expect("it is there");
    let messages = read_mcap(&bytes).into_iter();
    let messages = messages.filter(|each| each.topic == "/measurements");
    let mut along = 0;
    for (message, measured) in messages.zip(&found.measurements) {
        let json = &message.json;
        for key in ["deflection_mm", "residual_mm"] {
            assert_eq!(json[key].is_null(), measured.direction.is_some(), "{key}");
        }
        let keys = [
            "displacement_mm",
            "true_displacement_mm",
            "displacement_residual_mm",
        ];
        for key in keys {
            assert_eq!(json[key].is_f64(), measured.direction.is_some(), "{key}");
        }
        if let Some(direction) = measured.direction {
            along += 1;
            let shown_mm = direction.dot(&measured.deflection_m) * 1e3;
            assert!((number(&json["displacement_mm"]) - shown_mm).abs() < 1e-12);
            // All are read along z.
            let [exact, z] = [
                &json["true_displacement_mm"],
                &json["true_deflection_mm"][2],
            ];
            assert!((number(exact) - number(z)).abs() < 1e-12, "{exact} {z}");
        }
    }
    assert_eq!(along, 3);
}

/// One file of both, one fit; a row is of one instrument.
#[test]
fn mixed_files_are_read_as_they_are_written() {
    let text = beside(&scenario_text(GAUGE));
    let scenario = loaded(&text);
    let place = Workplace::new();
    let (head, _) = text.split_once("[[plan]]").expect("a plan");
    place.write("both.toml", head);
    let commands = scenario.task.belief.commands();
    place.write_plan("plan.csv", commands, &of_both(&scenario));
    place.json("measure both.toml --plan plan.csv --measurements-out m.csv");
    let read = read_measurements(&place.path("m.csv"), &scenario.task.belief).expect("read");
    let sigmas: Vec<Option<f64>> = read
        .iter()
        .map(|each| each.sigma_m.map(|sigma| sigma.x))
        .collect();
    let gauge = Some(0.005e-3_f64.hypot(1e-6 / 12.0_f64.sqrt()));
    for (place, sigma) in sigmas.iter().enumerate() {
        let expected = gauge.filter(|_| place % 2 == 0);
        assert!(
            sigma.is_some() == expected.is_some()
                && (sigma.unwrap_or(0.0) - expected.unwrap_or(0.0)).abs() < 1e-12
        );
    }
    let json = place.json("identify both.toml --measurements m.csv");
    let printed = place.run("identify both.toml --measurements m.csv --quiet");
    let sigmas = "given are 0.0300 mm of a coordinate and 0.0050 mm of the gauge";
    printed.prints(sigmas);
    let residuals = list(&json["residuals"]);
    let rows = |each: &Value| each["standardised"].as_array().map_or(0, Vec::len);
    let mut rows: Vec<usize> = residuals.iter().map(rows).collect();
    rows.sort_unstable();
    assert_eq!(rows, [1, 1, 1, 3, 3, 3]);
    let lab = place.json("lab both.toml --plan plan.csv");
    assert_eq!(lab["stops"].as_array().map(Vec::len), Some(12));
    let wrong = place.read("m.csv").replacen(",,,\n", ",1,2,3\n", 1);
    place.write("wrong.csv", wrong);
    let said = place.refused("identify both.toml --measurements wrong.csv");
    said.says("wrong.csv: line");
    said.says("is a gauge's");
    let turned = format!("{head}[[uncertainty]]\nkind = \"base_rotation\"\nstd_mrad = 1\n");
    place.write("turned.toml", turned);
    place.refused("check turned.toml").says("with a frame");
}

/// A gauge, or the tracker beside it, that slipped at one reading: that one is named, and the fit is the one without it; where another one
/// might as well be wrong, none is. Of 200 tables of right readings none is left out, since one of 1.7 million readings is by chance.
#[test]
fn a_gross_error_is_named_whichever_instrument_reads() {
    let text = scenario_text(GAUGE);
    let cases = [(beside(&text), 2, 24), (text.clone(), 1, 24), (text, 1, 12)];
    for (text, of_gauge, count) in cases {
        let scenario = loaded(&text);
        let (task, truth) = (&scenario.task, &scenario.truth);
        let mut plan = random_plan(task, count, 7, 0).expect("experiments are possible");
        for (index, each) in plan.experiments.iter_mut().enumerate() {
            let axis = each.direction.unwrap_or_else(Vector3::z);
            each.direction = (index % of_gauge == 0).then_some(axis);
        }
        let mut robots = TrueRobots::new(&task.belief, truth).expect("robots");
        let mut unnamed = 0;
        for run in 0..200 {
            let measured = measure(&mut robots, task, truth, &plan, 71, run as u64, true);
            let mut measured = measured.expect("measured").measurements;
            let right = robust(&scenario, &measured);
            assert!(right.rejected.is_empty(), "{run}: {:?}", right.rejected);
            if run >= count as usize {
                continue;
            }
            let axis = measured[run].direction.unwrap_or_else(Vector3::y);
            measured[run].deflection_m += 3e-3 * axis;
            let found = robust(&scenario, &measured);
            let named: Vec<usize> = found.rejected.iter().map(|each| each.reading).collect();
            if named.is_empty() {
                unnamed += 1;
                continue;
            }
            assert_eq!(named, [run]);
            assert_eq!(found.identification.residuals_m.len(), 3 * count as usize);
            measured.remove(run);
            let without = robust(&scenario, &measured).identification;
            for (one, other) in (found.identification.parameters.iter()).zip(&without.parameters) {
                let [one, other] = [one, other].map(|each| each.estimate.expect("determined"));
                let off = (one.value - other.value).abs() / one.standard_error;
                assert!(off < 1e-3, "{run}: {off}");
            }
        }
        println!("{unnamed} of {count} unnamed");
        assert!(unnamed <= count / 2, "{unnamed} of {count}");
    }
}

/// A gauge that is set to some degrees shows less than what moves along it: on average as much less as is predicted, and as widely spread,
/// along what moves and aslant. Virtual robots turn it.
#[test]
fn a_gauge_that_points_aslant_shows_less() {
    const REPEATS: u32 = 1000;
    let text = scenario_text(GAUGE);
    let (head, _) = text
        .split_once("# What this laboratory")
        .expect("a comment");
    let more =
        "[[uncertainty]]\nkind = \"gauge_direction\"\nstd_mrad = 80\n[design]\nexperiments = 9\n";
    let scenario = loaded(&format!("{head}{more}"));
    let belief = &scenario.task.belief;
    let mut robots = TrueRobots::new(belief, &scenario.truth).expect("the sites exist");
    let mut read = |direction: Option<Vector3<f64>>, repeats: u32| {
        let mut plan = six(&scenario);
        plan.experiments.truncate(1);
        (plan.experiments[0].direction, plan.experiments[0].repeats) = (direction, repeats);
        let normals = robots
            .become_run_of(&scenario.truth, repeats as usize, 7, 0)
            .expect("a run");
        robots
            .measure_noise_free(&plan, &belief.instrument, &normals, 0)
            .expect("at rest")
    };
    let moved = read(None, 1)[0].deflection_m;
    let along = moved.normalize();
    let across = along.cross(&Vector3::new(0.3, -0.5, 0.8)).normalize();
    // The nominal robot, which these are.
    let known = elastocal::plan::posterior(belief, &six(&scenario));
    for aslant in [0.0, 0.6] {
        let direction = (along + across * aslant).normalize();
        let measurements = read(Some(direction), REPEATS);
        let predictions = Case::as_believed(belief, &measurements).predictions(&known);
        let each = predictions.expect("predictions").each;
        let along = |each: &elastocal::identification::Predicted| {
            let variance_m2 = direction.dot(&(each.reading_m2 * direction));
            [direction.dot(&each.difference_m), variance_m2]
        };
        let predicted: Vec<[f64; 2]> = each.iter().map(along).collect();
        let count = f64::from(REPEATS);
        let mean = predicted.iter().map(|each| each[0]).sum::<f64>() / count;
        let squares = predicted.iter().map(|each| (each[0] - mean).powi(2));
        let spread = squares.sum::<f64>() / count;
        let noise_m2 = belief.instrument.along_sigma_m().powi(2);
        let expected = predicted[0][1] - noise_m2;
        assert!(
            mean.abs() < 4.0 * (spread / count).sqrt(),
            "{aslant}: {mean} {spread}"
        );
        // The square of two normal numbers has a kurtosis of 9.
        assert_alike_in(&aslant, spread, expected, 4.0 * (8.0 / count).sqrt());
    }
}

/// What is wrong with a gauge's table is named as with a tracker's: signs, units of displacements and of loads.
#[test]
fn input_errors_of_displacements_are_named() {
    let place = Workplace::with("gauge.toml", scenario_text(GAUGE));
    let plan = shipped("scenarios/plans/kr270_gauge_m9.csv");
    place.json(&format!(
        "measure gauge.toml --plan {plan} --run 3 --measurements-out right.csv"
    ));
    let right = place.read("right.csv");
    let identified = |column: &str, factor: f64| {
        let wrong = with_numbers(&right, &[column], |number| number * factor);
        place.write("wrong.csv", wrong);
        let outcome = place.run("identify gauge.toml --measurements wrong.csv");
        outcome.stdout + &outcome.stderr
    };
    let honest = identified("displacement_mm", 1.0);
    assert!(!honest.contains("likely input error"), "{honest}");
    for (column, factor, words) in [
        ("displacement_mm", -1.0, "are all signs reversed"),
        (
            "displacement_mm",
            1e3,
            "are the displacements in um instead of mm? Multiply displacement_mm by 0.001",
        ),
        (
            "displacement_mm",
            1e-3,
            "are the displacements in m instead of mm? Multiply displacement_mm by 1000",
        ),
        ("fz_n", 9.81_f64.recip(), "are the loads in kg instead of N"),
    ] {
        let said = identified(column, factor);
        assert!(said.contains(words), "{column} {factor}: {said}");
    }
}

/// A gauge beside a tracker has its error as a certificate has it, too.
#[test]
fn a_gauge_beside_a_tracker_may_have_a_certificate() {
    let place = Workplace::new();
    let text = beside(&scenario_text(GAUGE));
    let certificate = "mpe_um = 10\ncoverage_factor = 2\ndirections";
    place.write("gauge.toml", &text);
    place.write(
        "certificate.toml",
        text.replacen("sigma_mm = 0.005\ndirections", certificate, 1),
    );
    place.write(
        "none.toml",
        text.replacen("sigma_mm = 0.005\ndirections", "directions", 1),
    );
    let scenario = loaded(&text);
    let commands = scenario.task.belief.commands();
    place.write_plan("plan.csv", commands, &of_both(&scenario));
    let [plain, certified] = ["gauge", "certificate"].map(|name| {
        let evaluate = format!("evaluate {name}.toml --plan plan.csv --no-proof --json --quiet");
        number(&place.run(&evaluate).json()["rho0_mm"])
    });
    assert_alike(plain, certified, 1e-12);
    (place.refused("check none.toml")).says("instrument.gauge.sigma_mm");
}
