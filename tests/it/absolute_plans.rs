//! Plans of absolute readings: what they prediction is what the one fit then knows, the best of all plans is found, and targets and
//! stations are chosen.

use std::fmt::Write as _;

use elastocal::experiment::Candidate;
use elastocal::identification::{AbsoluteCase, ParameterGroup, ReadingWeights};
use elastocal::measurement::AbsoluteReading;
use elastocal::observation::{ObservationModel, ReadingKind, planned_positions};
use elastocal::parameter::{ElasticArm, ParameterSet};
use elastocal::plan::absolute::AbsolutePlanning;
use elastocal::plan::search::{PlanSize, random_plan};
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use nalgebra::{DVector, Isometry3, Matrix6xX, UnitQuaternion};

use crate::support::{
    Workplace, absolute_scenario_text, assert_alike_in, blank_reading, list, scenario,
    scenario_text, setup, unwatched,
};

const SPINDLE: &str = "spindle";

/// Random feasible rows without a load, of the machining tool and of the reflector in turn.
fn rows(scenario: &Scenario, count: u32) -> Vec<Candidate> {
    let plan = random_plan(&scenario.task, count, 5, 0).expect("a plan");
    (plan.experiments.iter().enumerate())
        .map(|(index, each)| Candidate {
            line: index + 2,
            configuration_rad: each.configuration_rad.clone(),
            load: None,
            most: Some(1),
            target: Some(if index % 2 == 0 { SPINDLE } else { "reflector" }.to_owned()),
            station: None,
            approach: None,
        })
        .collect()
}

/// What a robot as it is believed to be, seen from its own base, gives there.
fn readings(scenario: &Scenario, rows: &[Candidate]) -> Vec<AbsoluteReading> {
    let belief = &scenario.task.belief;
    let tools = vec![
        belief.machining_tool.clone(),
        belief.calibration_tool.clone(),
    ];
    let compliance = belief.nominal.compliance_rad_per_nm.clone();
    let mut arm = ElasticArm::new(belief.nominal.chain.clone(), compliance, tools);
    arm.instrument_from_base = vec![Isometry3::identity()];
    let nothing = ParameterSet::empty();
    let mut model = ObservationModel::new(&nothing, &arm, &[]);
    let mut ignored = Matrix6xX::zeros(0);
    rows.iter()
        .map(|row| {
            let setup = setup(
                row.configuration_rad.clone(),
                Load::NONE,
                usize::from(row.target.as_deref() != Some(SPINDLE)),
            );
            let seen = model
                .predict(&setup, ReadingKind::Position, &mut ignored)
                .expect("stable");
            AbsoluteReading {
                configuration_rad: row.configuration_rad.clone(),
                target: row.target.clone(),
                position_m: seen.position_m,
                ..blank_reading()
            }
        })
        .collect()
}

/// Whether positions are in another unit is seen in the distances among them, whichever way a station's frame is turned: also where half
/// of a target's are at one configuration.
#[test]
fn units_do_not_depend_on_the_frame() {
    let scenario = scenario("ur10");
    let rows = rows(&scenario, 6);
    let at = |(row, target): (usize, usize)| Candidate {
        target: rows[target].target.clone(),
        ..rows[row].clone()
    };
    let chosen = [(0, 0), (0, 0), (1, 1), (1, 1), (2, 1), (3, 1)].map(at);
    let read = readings(&scenario, &chosen);
    let refused = |times: f64, turn: &UnitQuaternion<f64>| {
        let mut turned = read.clone();
        for each in &mut turned {
            each.position_m = turn * each.position_m * times;
        }
        let case = AbsoluteCase::new(&scenario.task.belief, &turned);
        case.err()
            .is_some_and(|error| error.to_string().contains("mm apart"))
    };
    for turn in 0..40 {
        let turn = f64::from(turn);
        let turn = UnitQuaternion::from_euler_angles(turn, 0.7 * turn, -1.9 * turn);
        assert!(!refused(1.0, &turn), "{turn}");
        assert!(refused(1e-3, &turn) && refused(1e3, &turn), "{turn}");
    }
}

/// The prediction is the variance of the tool's place by the covariance of the fit, whichever unknowns either leaves out.
#[test]
fn the_fit_knows_what_was_predicted() {
    let scenario = scenario("ur10");
    let task = &scenario.task;
    for (groups, count) in [
        (&[ParameterGroup::Zeros][..], 14),
        (&[ParameterGroup::Geometry][..], 40),
    ] {
        let rows = rows(&scenario, count);
        let planning = AbsolutePlanning::new(task, groups, &rows).expect("candidates");
        let plan: Vec<(usize, u32)> = (0..rows.len()).map(|place| (place, 1)).collect();
        let predicted_m = planning.prediction(&plan).rho0_m().expect("a prediction");
        let mut case =
            AbsoluteCase::new(&task.belief, &readings(&scenario, &rows)).expect("readings");
        let fit = case.fit(groups, ReadingWeights::Own).expect("a fit");
        let target = case
            .targets
            .iter()
            .position(|target| target == SPINDLE)
            .expect("it was read");
        let setup = setup(
            task.test_poses[0].configuration_rad.clone(),
            task.test_poses[0].load,
            target,
        );
        let wanted = [(&setup, ReadingKind::Position)];
        let mut place = planned_positions(&fit.set, &fit.reference, &fit.values(), &wanted);
        for (mut column, scale) in place.column_iter_mut().zip(&fit.set.scales()) {
            column /= *scale;
        }
        let known_m = fit
            .posterior
            .variance_of(&place)
            .expect("determined")
            .sqrt();
        assert_alike_in(&groups, known_m, predicted_m, 0.01);
    }
}

/// All choices of eight of eleven.
#[test]
fn the_best_choice_is_found() {
    let scenario = scenario("ur10");
    let rows = rows(&scenario, 11);
    let planning =
        AbsolutePlanning::new(&scenario.task, &[ParameterGroup::Zeros], &rows).expect("candidates");
    let watch = unwatched();
    let found = planning
        .design_from(&[], PlanSize::all_different(8), 1, watch)
        .expect("a plan");
    let value = planning
        .prediction(&found.plan)
        .rho0_m()
        .expect("a prediction");
    let best = (0_u32..1 << rows.len())
        .filter(|chosen| chosen.count_ones() == 8)
        .filter_map(|chosen| {
            let plan: Vec<(usize, u32)> = (0..rows.len())
                .filter(|place| chosen >> place & 1 == 1)
                .map(|place| (place, 1))
                .collect();
            planning.prediction(&plan).rho0_m()
        })
        .fold(f64::INFINITY, f64::min);
    assert!((value / best - 1.0).abs() < 1e-6, "{value} and {best}");
    let bound = found.bound.expect("a bound").best;
    assert!(bound <= best && bound > 0.8 * best, "{bound} and {best}");
}

/// What only the reflector's readings do not tell of the spindle is named.
#[test]
fn what_targets_do_not_show_is_named() {
    let scenario = scenario("ur10");
    let mut rows = rows(&scenario, 40);
    for row in &mut rows {
        row.target = None;
    }
    let planning = AbsolutePlanning::new(&scenario.task, &[ParameterGroup::Geometry], &rows)
        .expect("candidates");
    let watch = unwatched();
    match planning.design_from(&[], PlanSize::all_different(30), 1, watch) {
        Err(error) if error.is_of_all => {
            let words = error.to_string();
            assert!(words.contains("none of them reads spindle"), "{words}");
            assert!(words.contains("more unknowns"), "{words}");
        }
        other => panic!("{other:?}"),
    }
}

/// Stands far from the test pose (deg), of which positions of one target hardly show the last link apart from it.
const FAR_STANDS_DEG: [[i16; 6]; 30] = [
    [-278, -174, 21, -158, 31, 138],
    [-182, -100, 78, -186, 87, 4],
    [-208, -181, 40, -140, 91, 50],
    [-183, -93, 130, -155, 79, 63],
    [-221, -151, 9, -243, 56, 69],
    [-245, -137, 108, -116, 31, 93],
    [-263, -155, 59, -244, 32, 33],
    [-263, -168, 130, -120, 56, 81],
    [-199, -114, 46, -136, 63, 138],
    [-218, -139, 90, -158, 67, -9],
    [-189, -134, 118, -83, 77, 13],
    [-223, -150, 127, -122, 75, 40],
    [-201, -127, 118, -161, 82, 135],
    [-214, -93, 116, -126, 94, 6],
    [-244, -96, 42, -93, 44, 72],
    [-246, -147, 129, -107, 76, 79],
    [-202, -107, 104, -171, 103, 3],
    [-223, -120, 93, -75, 89, -31],
    [-185, -142, 2, -42, 34, 140],
    [-272, -178, 12, -181, 85, 8],
    [-198, -172, 34, -32, 44, 12],
    [-180, -159, 15, -142, 101, -42],
    [-278, -139, 92, -206, 41, 122],
    [-282, -175, 29, -233, 13, -40],
    [-192, -183, 95, -185, 26, -10],
    [-191, -162, 0, -152, 85, -39],
    [-184, -154, 38, -241, 10, 38],
    [-207, -105, 28, -177, 53, 75],
    [-282, -146, 114, -109, 108, 104],
    [-191, -180, 67, -57, 61, 109],
];

/// What the candidates do not tell apart and what moves the tool by thousandths of what a plan leaves does not stand in its way,
/// and carries no number.
#[test]
fn what_hardly_moves_the_tool_may_stay_hidden() {
    let scenario = scenario("ur10");
    let rows: Vec<Candidate> = (FAR_STANDS_DEG.iter().enumerate())
        .map(|(index, stand)| Candidate {
            line: index + 2,
            configuration_rad: DVector::from_iterator(
                6,
                stand.iter().map(|&q| f64::from(q).to_radians()),
            ),
            load: None,
            most: None,
            target: Some(SPINDLE.to_owned()),
            station: None,
            approach: None,
        })
        .collect();
    let planning = AbsolutePlanning::new(&scenario.task, &[ParameterGroup::Geometry], &rows)
        .expect("candidates");
    let watch = unwatched();
    let design = planning
        .design_from(&[], PlanSize::all_different(28), 1, watch)
        .expect("a plan");
    let prediction = planning.prediction(&design.plan);
    let rho0_m = prediction.rho0_m().expect("a prediction");
    let bound_m = design.bound.expect("a bound").best;
    assert!(
        bound_m <= rho0_m && bound_m > 0.9 * rho0_m,
        "{bound_m} and {rho0_m}"
    );
    let names = planning.set().parameters();
    let without: Vec<&str> = (names.iter().enumerate())
        .filter(|(index, _)| prediction.posterior.standard_error(*index).is_none())
        .map(|(_, each)| each.name.as_str())
        .collect();
    assert!(without.contains(&"link_6.rx"), "{without:?}");
}

fn table(rows: &[Candidate], station: &str) -> String {
    let mut text = String::from("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,target,station\n");
    for row in rows {
        let angles = row
            .configuration_rad
            .iter()
            .map(|q| q.to_degrees().to_string());
        let angles: Vec<String> = angles.collect();
        let _ = writeln!(
            text,
            "{},{},{station}",
            angles.join(","),
            row.target.as_deref().expect("a target")
        );
    }
    text
}

/// The budget's points are the plans of as many readings, with their bounds; its minutes are the laboratory's.
#[test]
fn budgets_are_of_the_plans() {
    let place = Workplace::with("s.toml", absolute_scenario_text("ur10"));
    place.write("c.csv", table(&rows(&scenario("ur10"), 30), "door"));
    let budget = |accuracy_um: f64, options: &str| {
        place.json(&format!(
            "budget s.toml --parameters zeros --candidates c.csv --up-to 10 --accuracy-um {accuracy_um} {options}"
        ))
    };
    let json = budget(1000.0, "");
    let points = list(&json["budget"]);
    let number = |json: &serde_json::Value, key: &str| json[key].as_f64().expect("a number");
    assert_eq!(json["needed"], points[0]);
    assert!(points.len() > 3, "{points:?}");
    for (one, other) in points.iter().zip(&points[1..]) {
        assert!(number(one, "rho0_mm") > number(other, "rho0_mm"));
        assert!(number(one, "rho0_mm") >= number(one, "lower_bound_rho0_mm"));
        assert!(number(one, "lower_bound_rho0_mm") >= number(other, "lower_bound_rho0_mm"));
    }
    let last = &points[points.len() - 1];
    let plan = "plan s.toml --parameters zeros --candidates c.csv --plan-out p.csv --experiments";
    let planned = place.json(&format!("{plan} 10"));
    // It goes on from the plan of one reading less, too.
    assert!(number(last, "rho0_mm") <= number(&planned, "rho0_mm") * (1.0 + 1e-9));
    assert!(number(last, "rho0_mm") >= number(&planned, "lower_bound_rho0_mm"));
    assert_eq!(last["bound_kind"], "proved");
    let needed = budget(1e3 * number(last, "rho0_mm") * (1.0 + 1e-9), "--by-minutes");
    assert_eq!(needed["needed"], *last);
    // A set-up, ten visits at most, ten readings, and the time that joints turn.
    let minutes = number(&needed, "needed_minutes");
    assert!(
        (20.0 + 5.0..20.0 + 10.0 + 5.0 + 10.0).contains(&minutes),
        "{minutes}"
    );
    // Sampled configurations are no proof.
    let sampled =
        place.json("budget s.toml --draw 6 --parameters frames --up-to 6 --accuracy-um 1000");
    for point in list(&sampled["budget"]) {
        assert_eq!(point["bound_kind"], "evidence");
        assert!(point["proved_lower_bound_rho0_mm"].is_null());
    }
}

/// The commands: targets and stations are chosen, paths are judged pose by pose, and the plan's file says the same.
#[test]
fn commands_plan_absolute_readings() {
    let place = Workplace::new();
    let text = absolute_scenario_text("ur10");
    place.write("s.toml", &text);
    let rows = rows(&scenario("ur10"), 40);
    place.write(
        "c.csv",
        table(&rows, "door") + table(&rows[..16], "wall").split_once('\n').expect("rows").1,
    );
    place.write(
        "path.csv",
        "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n20,-60,80,-110,-70,30\n25,-62,82,-110,-70,30\n30,-64,84,-110,-70,30\n",
    );
    let plan = "plan s.toml --parameters zeros --experiments 12 --candidates c.csv --test-poses path.csv --plan-out p.csv";
    let one = place.json(&format!("{plan} --threads 1"));
    let two = place.json(&format!("{plan} --threads 2"));
    assert_eq!(one["plan"], two["plan"]);
    assert_eq!(one["accuracy"], "absolute");
    assert_eq!(one["bound_kind"], "proved");
    assert_eq!(list(&one["test_poses"]).len(), 3);
    // One station is enough: a second has a frame of its own to be found.
    let frame = &one["frame"];
    let stations: Vec<&serde_json::Value> = list(&one["plan"])
        .iter()
        .map(|each| &each["station"])
        .collect();
    assert!(
        stations.iter().all(|station| *station == frame),
        "{stations:?}"
    );
    let again = place.json(
        "evaluate s.toml --parameters zeros --plan p.csv --candidates c.csv --test-poses path.csv",
    );
    let [first, second] =
        [&one, &again].map(|json| json["rho0_mm"].as_f64().expect("a prediction"));
    assert!((first / second - 1.0).abs() < 1e-6, "{first} and {second}");
    let efficiency = again["efficiency"].as_f64().expect("a bound");
    assert!(efficiency > 0.7 && efficiency <= 1.0, "{efficiency}");
    // Other stations to choose from make nothing worse.
    place.write("door.csv", table(&rows, "door"));
    let door = place.json(&plan.replace("c.csv", "door.csv").replace("p.csv", "q.csv"));
    let among = place.json(
        "evaluate s.toml --parameters zeros --plan q.csv --candidates c.csv --test-poses path.csv",
    );
    let efficiency = among["efficiency"].as_f64().expect("a bound");
    assert!(efficiency > 0.7 && efficiency <= 1.0, "{efficiency}");
    let [of_both, of_one] =
        [&one, &door].map(|json| json["rho0_mm"].as_f64().expect("a prediction"));
    assert!(of_both <= of_one * (1.0 + 1e-6), "{of_both} and {of_one}");
    let exact = one["assumed_exact"].to_string();
    assert!(exact.contains("elbow.compliance"), "{exact}");
    assert!(exact.contains("--parameters does not"), "{exact}");
    let source = "\n[[uncertainty]]\nkind = \"tool_position\"\nstd_mm = 1\n";
    place.write("t.toml", place.read("s.toml") + source);
    let prior = place.json_with_conditions("evaluate t.toml --parameters compliances --plan p.csv");
    assert_eq!(prior["assumed_exact"], serde_json::json!([]));
    // What a bound takes for exact is named where there is one.
    let function = "\n[[uncertainty]]\nkind = \"transmission_error\"\njoints = [\"elbow\"]\nstd_mrad = 0.3\ncorrelation_deg = 20\n";
    place.write("f.toml", place.read("s.toml") + function);
    let evaluate = "evaluate f.toml --parameters zeros --plan p.csv";
    for (options, is_there) in [("", false), (" --candidates c.csv", true)] {
        let json = place.json(&format!("{evaluate}{options}"));
        let exact = json["assumed_exact"].to_string();
        assert_eq!(exact.contains("by the bound alone"), is_there, "{exact}");
    }
    let words = prior["not_counted"][0].as_str().expect("a sentence");
    assert!(words.starts_with("tool_position, of frames"), "{words}");
    let text = place.done(plan);
    text.prints("An absolute accuracy: where the loaded tool is");
    for (arguments, wanted) in [
        (
            "plan s.toml --experiments 12 --candidates c.csv --criterion d",
            "--criterion is for plans of deflections",
        ),
        (
            "budget s.toml --candidates c.csv --no-proof",
            "--no-proof is for plans of deflections",
        ),
        (
            "plan s.toml --experiments 1000 --candidates p.csv",
            "are wanted",
        ),
        (
            "plan s.toml --experiments 4 --candidates c.csv --test-poses c.csv",
            "which test poses do not have",
        ),
    ] {
        let outcome = place.refused(&format!("{arguments} --quiet"));
        outcome.says(wanted);
    }
}

/// What is for plans of absolute readings is refused elsewhere.
#[test]
fn other_accuracies_are_refused() {
    let place = Workplace::with("relative.toml", scenario_text("ur10"));
    let outcome = place.refused("plan relative.toml --parameters zeros --quiet");
    outcome.says("is \"relative\", and --parameters is for plans of absolute readings");
    place.write(
        "wrong.toml",
        scenario_text("ur10").replace("[design]", "[design]\naccuracy = \"exact\""),
    );
    place.refused("check wrong.toml").says("accuracy");
}

/// Rows that are alike are visits of their own, as repeats are: the k-th reading of each target belongs to visit k.
#[test]
fn rows_that_are_alike_are_repeats() {
    let scenario = scenario("ur10");
    let known = "\n[[uncertainty]]\nkind = \"joint_zero\"\nstd_mrad = 1\n\n\
                 [[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.1\n";
    let place = Workplace::with("s.toml", absolute_scenario_text("ur10") + known);
    let once = table(&rows(&scenario, 8), "east");
    let (head, lines) = once.split_once('\n').expect("a header");
    place.write("alike.csv", format!("{head}\n{lines}{lines}{lines}"));
    let thrice = lines.lines().map(|line| format!("{line},3\n"));
    let thrice: String = thrice.collect();
    place.write("repeats.csv", format!("{head},repeats\n{thrice}"));
    let rho0_mm = ["alike", "repeats"].map(|plan| {
        let evaluate =
            format!("evaluate s.toml --plan {plan}.csv --parameters zeros --quiet --json");
        place.run(&evaluate).json()["rho0_mm"]
            .as_f64()
            .expect("rho0")
    });
    assert!((rho0_mm[0] / rho0_mm[1] - 1.0).abs() < 1e-9, "{rho0_mm:?}");
}
