//! What deflections of one configuration share, under whatever loads: gears' errors, the model's discrepancy, and the one unloaded
//! reading that all of them may rest on.

use elastocal::experiment::SAME_CONFIGURATION;
use elastocal::identification::{Case, Sigma};
use elastocal::measurement::Measurement;
use elastocal::numeric::random::normal::{LANES, fill_normals};
use elastocal::numeric::random::streams::Stream;
use elastocal::observation::{NOTHING_READ, PlannedReadings};
use elastocal::parameter::{ParameterKind, ReadingSource, Unloaded};
use elastocal::plan::search::{Bound, NoBound};
use elastocal::plan::{Assessment, Experiment, Plan, posterior};
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use elastocal::study::account::Account;
use elastocal::task::Method;
use elastocal::testbed::{Circumstances, TrueRobots, add_noise_of};
use nalgebra::{DMatrix, Matrix3, Matrix6xX, Vector3};
use serde_json::Value;

use crate::repeats::{deflection, linear_equations};
use crate::support::{Workplace, list, scenario_text, table4};
use crate::uncertainties::assert_holds;

const MISFIT: &str = "[[uncertainty]]\nkind = \"discrepancy\"\nstd_mm = 0.04\n";
const GEARS: &str = "[[uncertainty]]\nkind = \"transmission_error\"\nstd_mrad = 3\n";
const RETURN: &str = "[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.03\n";
/// The loads of these tests (N), in every configuration.
const FORCES: [[f64; 3]; 2] = [[0.0, 0.0, -2500.0], [0.0, 1200.0, -1500.0]];

/// The paper's robot under two loads, with a study of `plan.csv`.
fn several(unloaded: &str, uncertainties: &str, level: &str, trials: u32) -> String {
    let text = scenario_text("klimchik2012");
    let (head, _) = text.split_once("[[plan]]").expect("there are plans");
    let one = "kind = \"fixed\"\nforce_n = [0, 0, -2500]";
    let wrenches = FORCES.map(|[x, y, z]| format!("{{ force_n = [{x}, {y}, {z}] }}"));
    let several = format!("kind = \"list\"\nwrenches = [{}]", wrenches.join(", "));
    let head = head
        .replace(one, &several)
        .replace("sigma_of", &format!("unloaded = \"{unloaded}\"\nsigma_of"));
    assert!(head.contains(&several) && head.contains("unloaded"));
    format!(
        "{head}\n[study]\nexperiments = 12\ntrials = {trials}\nlevel = \"{level}\"\n[[study.plan]]\nkind = \"file\"\n\
         name = \"two loads\"\nfile = \"plan.csv\"\n{uncertainties}"
    )
}

/// Table 4's configurations under both loads, one of them twice.
fn two_loads() -> Plan {
    let each = table4(4).experiments.into_iter().flat_map(|experiment| {
        [(FORCES[0], 1), (FORCES[1], 2)].map(|([x, y, z], repeats)| Experiment {
            load: Load::force(x, y, z),
            repeats,
            ..experiment.clone()
        })
    });
    Plan {
        experiments: each.collect(),
    }
}

fn place(unloaded: &str, uncertainties: &str, level: &str, trials: u32) -> Workplace {
    let place = Workplace::new();
    place.write_plan("plan.csv", 6, &two_loads());
    place.write("s.toml", several(unloaded, uncertainties, level, trials));
    place
}

fn loaded(unloaded: &str, uncertainties: &str) -> Scenario {
    let place = place(unloaded, uncertainties, "model", 64);
    place.scenario("s.toml")
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().expect("a number")
}

/// On the virtual robot, drawn in every run, and in the linear model: what is seen is what is predicted, and errors are as large as
/// their covariance says.
#[test]
fn predictions_hold_under_several_loads() {
    let all = format!("{MISFIT}{GEARS}{RETURN}");
    for (unloaded, uncertainties) in [
        ("own", MISFIT),
        ("own", GEARS),
        ("shared", ""),
        ("shared", RETURN),
        ("shared", &all),
    ] {
        for (level, trials) in [("robot", 600), ("model", 20_000)] {
            let what = format!("{unloaded} {uncertainties} {level}");
            let place = place(unloaded, uncertainties, level, trials);
            let json = place.json("study s.toml");
            let plan = &json["plans"][0];
            if !uncertainties.is_empty() {
                assert_holds(plan, &what);
            }
            assert!(number(plan, "nees_z").abs() < 5.0, "{what}: {plan}");
            let predicted = number(plan, "predicted_rms_mm");
            let off = (number(plan, "rms_mm") - predicted).abs();
            // On the virtual robot what the model's non-linearity is allowed comes with it.
            let room = match level {
                "robot" => 3.0 * number(plan, "rms_std_mm") + 0.02 * predicted,
                _ => 4.5 * number(plan, "rms_std_mm"),
            };
            assert!(off < room, "{what}: {plan}");
        }
    }
}

/// A gear's error turns joints before and under the load alike, in all readings of a configuration; what does not come back is there under
/// the load alone, and new in each.
#[test]
fn gears_turn_joints_before_and_under_the_load() {
    let visits = |source: &str| {
        let scenario = loaded("own", source);
        let laboratory = Circumstances::new(
            scenario.task.belief.arm(),
            &scenario.truth.uncertainties,
            scenario.truth.kept(),
        );
        let (laboratory, plan) = (laboratory.expect("valid"), two_loads());
        let mut normals = vec![[0.0; LANES]; laboratory.numbers(plan.measurements() as usize)];
        fill_normals(Stream::Circumstances, 5, 0, &mut normals);
        let all = laboratory.visits(&plan, &normals, 0);
        // One reading under the first load and two under the second in each configuration.
        let all = all.into_iter().map(|visit| visit.commanded_rad).zip(0..);
        let commanded = all.map(|(pair, number)| {
            let configuration = &plan.experiments[2 * (number / 3)].configuration_rad;
            pair.map(|commanded_rad| commanded_rad - configuration)
        });
        commanded.collect::<Vec<_>>()
    };
    let (gears, returns) = (visits(GEARS), visits(RETURN));
    assert_eq!((gears.len(), returns.len()), (12, 12));
    for (number, [before_rad, under_rad]) in gears.iter().enumerate() {
        assert!(before_rad.norm() > 1e-3 && (before_rad - under_rad).norm() < 1e-15);
        let first_rad = &gears[number - number % 3][0];
        assert!((before_rad - first_rad).norm() < 1e-15);
    }
    assert!((&gears[0][0] - &gears[3][0]).norm() > 1e-3);
    for [before_rad, under_rad] in &returns {
        assert!(before_rad.norm() < 1e-15 && under_rad.norm() > 1e-5);
    }
    assert!((&returns[0][1] - &returns[1][1]).norm() > 1e-5);
}

fn rms_mm(account: &Account) -> f64 {
    let squares = account
        .parts
        .iter()
        .filter_map(|each| Some(each.contribution_um?.powi(2)));
    squares.sum::<f64>().sqrt() * 1e-3
}

/// What the belief does not know of leaves what the account says, whatever loads share it.
#[test]
fn hidden_errors_of_configurations_leave_what_the_account_says() {
    for source in [MISFIT, GEARS] {
        let place = place("own", &format!("{source}hidden = true\n"), "model", 20_000);
        let scenario = place.scenario("s.toml");
        let account = Account::new(&scenario.task, &scenario.truth, &two_loads());
        let expected_mm = rms_mm(&account.expect("it is determined"));
        let plan = place.json("study s.toml")["plans"][0].clone();
        let off = number(&plan, "rms_mm") - expected_mm;
        assert!(
            off.abs() < 4.5 * number(&plan, "rms_std_mm"),
            "{source}: {expected_mm} {plan}"
        );
        // And it is not what it would leave if each load had errors of its own.
        let apart = Plan {
            experiments: (two_loads().experiments.into_iter().enumerate())
                .map(|(index, mut each)| {
                    each.configuration_rad[1] += 1.01 * SAME_CONFIGURATION * index as f64;
                    each
                })
                .collect(),
        };
        let account = Account::new(&scenario.task, &scenario.truth, &apart);
        let of_apart = rms_mm(&account.expect("it is determined"));
        assert!(
            (of_apart / expected_mm - 1.0).abs() > 0.02,
            "{of_apart} {expected_mm}"
        );
    }
}

/// The covariance of all deflections (m^2) written out: of each two of one configuration, what they share. Gears' errors by
/// differences of the deflection.
fn written_out(scenario: &Scenario, measurements: &[Measurement]) -> DMatrix<f64> {
    let belief = &scenario.task.belief;
    let extended = &belief.uncertain;
    let arm = extended.arm();
    let along = |each: &Measurement, joint: usize| {
        let at = |shift: f64| {
            let mut q = each.configuration_rad.clone();
            q[joint] += shift;
            deflection(arm, &q, &each.load)
        };
        (at(1e-5) - at(-1e-5)) / 2e-5
    };
    let state = |each: &Measurement| {
        arm.chain
            .at(&arm.tools[0])
            .state(each.configuration_rad.as_slice())
    };
    let is_shared = belief.instrument.unloaded == Unloaded::Shared;
    let count = measurements.len();
    let mut covariance = DMatrix::zeros(3 * count, 3 * count);
    for (index, one) in measurements.iter().enumerate() {
        for (column, other) in measurements.iter().enumerate() {
            if one.configuration_rad != other.configuration_rad {
                continue;
            }
            // What two readings have in common of what both of a deflection's make.
            let part = match (index == column, is_shared) {
                (true, _) => 1.0,
                (false, true) => 0.5,
                (false, false) => 0.0,
            };
            let sigma = |each: &Measurement| {
                each.sigma_m
                    .unwrap_or(Vector3::repeat(belief.instrument.sigma_m))
            };
            let mut block = Matrix3::from_diagonal(&sigma(one).component_mul(&sigma(other))) * part;
            for (_, source) in extended.sources() {
                match source {
                    ReadingSource::Discrepancy(error) => {
                        block += Matrix3::identity() * error.in_deflection_m().powi(2);
                    }
                    ReadingSource::TransmissionError(gears) => {
                        for (joint, deviation) in gears.deviations.iter().enumerate() {
                            let [one, other] = [one, other].map(|each| along(each, joint));
                            block += one * other.transpose() * deviation.powi(2);
                        }
                    }
                    ReadingSource::JointRepeatability(deviations) => {
                        for (joint, deviation) in deviations.iter().enumerate() {
                            let moved = state(one).position_column(joint) * *deviation;
                            block += moved * moved.transpose() * part;
                        }
                    }
                    other => panic!("{other:?}"),
                }
            }
            (covariance.view_mut((3 * index, 3 * column), (3, 3))).copy_from(&block);
        }
    }
    covariance
}

/// Generalised least squares with the whole covariance of all readings, written out, gives the same estimate and covariance, also
/// where readings bring deviations of their own; and the predicted accuracy of a plan is what identification then has.
#[test]
fn identification_and_predictions_are_those_of_the_whole_covariance() {
    let all = format!("{MISFIT}{GEARS}{RETURN}");
    for unloaded in ["own", "shared"] {
        let scenario = loaded(unloaded, &all);
        let (belief, plan) = (&scenario.task.belief, two_loads());
        let mut robots = TrueRobots::new(belief, &scenario.truth).expect("a robot");
        let normals = (robots.become_run_of(&scenario.truth, 12, 1, 0)).expect("a run");
        let measured = robots.measure_noise_free(&plan, &belief.instrument, &normals, 0);
        let mut measurements = measured.expect("measurements");
        add_noise_of(&mut measurements, &belief.instrument, 1, 0);
        let predicted = posterior(belief, &plan);
        for has_own in [false, true] {
            if has_own {
                for (index, each) in measurements.iter_mut().enumerate() {
                    each.sigma_m = Some(Vector3::repeat(1e-5 * (1.0 + index as f64)));
                }
            }
            let sigma = Sigma::Known(belief.instrument.sigma_m);
            let case = Case::of_belief(belief, &measurements, sigma, Method::Linear);
            let found = case.identify().expect("an identification");

            let size = belief.unknowns();
            let (rows, right) = linear_equations(belief, &measurements);
            let inverse = written_out(&scenario, &measurements).try_inverse();
            let weighted = rows.transpose() * inverse.expect("regular");
            let covariance = (&weighted * &rows).try_inverse().expect("determined");
            let change = &covariance * &weighted * &right;
            let values = belief.values();
            for index in 0..size {
                let expected = values[index] + change[index];
                let error = (found.posterior.mean[index] / expected - 1.0).abs();
                assert!(error < 1e-6, "{unloaded} {index}: {error}");
            }
            let apart = |other: &DMatrix<f64>| (other - &covariance).norm() / covariance.norm();
            let error = apart(&found.posterior.covariance);
            assert!(error < 1e-6, "{unloaded}: {error}");
            if !has_own {
                let error = apart(&predicted.covariance);
                assert!(error < 1e-6, "{unloaded}, predicted: {error}");
            }
        }
    }
}

/// Squares of contributions add up, those of the budget and, where nothing is hidden, those of the account alike.
#[test]
fn contributions_add_up_under_several_loads() {
    let all = format!("{MISFIT}{GEARS}{RETURN}");
    for unloaded in ["own", "shared"] {
        let scenario = loaded(unloaded, &all);
        let assessment = Assessment::new(&scenario.task, &two_loads(), None);
        let rho0_m = assessment.rho0_m.expect("it is determined");
        let budget = assessment.uncertainty_budget.expect("it is determined");
        let combined_m = budget.combined_standard_uncertainty_um * 1e-6;
        assert!((combined_m / rho0_m - 1.0).abs() < 1e-9);
        let account = Account::new(&scenario.task, &scenario.truth, &two_loads());
        let account = account.expect("it is determined");
        assert!((account.predicted_m / rho0_m - 1.0).abs() < 1e-9);
        for (each, part) in budget.sources.iter().zip(&account.parts) {
            assert_eq!(each.source, part.source);
            let error =
                (each.contribution_um / part.contribution_um.expect("computed") - 1.0).abs();
            assert!(error < 1e-9, "{}: {error}", each.source);
        }
    }
}

/// A discrepancy that two loads share does not show in what they differ by: together they tell more than apart. No bound speaks about
/// such a plan, and the reason is told.
#[test]
fn no_bound_speaks_about_several_loads_that_share_errors() {
    let scenario = loaded("own", MISFIT);
    let task = &scenario.task;
    let plan = two_loads();
    let mut apart = plan.clone();
    for (index, each) in apart.experiments.iter_mut().enumerate() {
        each.configuration_rad[1] += 1.01 * SAME_CONFIGURATION * index as f64;
    }
    let deviation = |plan: &Plan| posterior(&task.belief, plan).standard_error(0);
    let [together, apart_too] = [&plan, &apart].map(|plan| deviation(plan).expect("determined"));
    assert!(
        (together / apart_too - 1.0).abs() > 0.01,
        "{together} {apart_too}"
    );

    let bound = Bound::search(task, 1);
    assert_eq!(
        bound.of_plan(&plan),
        Err(NoBound::SeveralLoads { one: 1, other: 2 })
    );
    assert!(bound.of_plan(&apart).is_ok());
    // Where each deflection has errors of its own, the bound speaks about it.
    let certain = loaded("own", RETURN);
    assert!(Bound::search(&certain.task, 1).of_plan(&plan).is_ok());
    let mut mandatory = task.clone();
    mandatory.design.mandatory = plan.clone();
    assert!(Bound::search(&mandatory, 1).of_size(20).is_err());
    let place = place("shared", "", "model", 64);
    let told = place.done("evaluate s.toml --plan plan.csv --no-proof");
    told.prints("one load in each configuration");
}

/// Of a list of candidates the best plan is found where loads of one configuration share errors, and it predicts what it is
/// judged by.
#[test]
fn candidates_of_one_configuration_are_weighed_together() {
    let place = place("shared", MISFIT, "model", 64);
    let rows = two_loads().experiments;
    place.write_plan(
        "candidates.csv",
        6,
        &Plan {
            experiments: rows
                .iter()
                .map(|each| Experiment {
                    repeats: 1,
                    ..each.clone()
                })
                .collect(),
        },
    );
    let planned =
        place.json("plan s.toml --candidates candidates.csv --experiments 4 --plan-out found.csv");
    let judged = place.json("evaluate s.toml --plan found.csv --no-proof");
    let found = number(&planned, "rho0_mm");
    assert!((found / number(&judged, "rho0_mm") - 1.0).abs() < 1e-9);
    // All plans of four of the eight.
    let scenario = place.scenario("s.toml");
    let mut best = f64::INFINITY;
    for choice in 0_u32..256 {
        if choice.count_ones() != 4 {
            continue;
        }
        let chosen = rows
            .iter()
            .enumerate()
            .filter(|(index, _)| choice >> index & 1 == 1);
        let plan = Plan {
            experiments: chosen
                .map(|(_, each)| Experiment {
                    repeats: 1,
                    ..each.clone()
                })
                .collect(),
        };
        if let Some(rho0_m) = Assessment::new(&scenario.task, &plan, None).rho0_m {
            best = best.min(rho0_m * 1e3);
        }
    }
    assert!((found / best - 1.0).abs() < 1e-9, "{found} against {best}");
}

/// The run sheet visits each configuration once without a load, and its table, filled in, identifies what deflections do.
#[test]
fn the_laboratory_reads_each_configuration_once_without_a_load() {
    let place = place("shared", "", "model", 64);
    place.run("lab s.toml --plan plan.csv --quiet");
    let table = place.read("out/s/lab/measurements.csv");
    let header = table
        .lines()
        .find(|line| line.starts_with("unloaded_stop"))
        .expect("a header");
    let rows: Vec<&str> = (table.lines())
        .filter(|line| line.starts_with(|first: char| first.is_ascii_digit()))
        .collect();
    assert_eq!(rows.len(), 12);
    let mut unloaded: Vec<String> = rows
        .iter()
        .map(|row| row.split(',').take(2).collect::<Vec<_>>().join(","))
        .collect();
    unloaded.sort();
    unloaded.dedup();
    assert_eq!(unloaded, ["1,1", "2,1", "3,1", "4,1"]);
    let readings = |text: &str| -> u64 {
        let sheet: Value = serde_json::from_str(text).expect("a record");
        let stops = list(&sheet["stops"]).iter();
        stops
            .map(|stop| stop["readings"].as_u64().expect("a number"))
            .sum()
    };
    assert_eq!(readings(&place.read("out/s/lab/campaign.json")), 4 + 12);

    place.done("measure s.toml --plan plan.csv --measurements-out m.csv --quiet");
    let measured: Vec<(String, [f64; 3])> = (place.read("m.csv").lines())
        .filter(|line| line.starts_with(|first: char| first.is_ascii_digit() || first == '-'))
        .map(|line| {
            let fields: Vec<&str> = line.split(',').collect();
            (
                fields[..12].join(","),
                [12, 13, 14].map(|at| fields[at].parse().expect("a number")),
            )
        })
        .collect();
    let mut left = measured.clone();
    let filled: Vec<String> = rows
        .iter()
        .map(|row| {
            let start = row.strip_suffix(",,,,,,").expect("nothing is filled in");
            let known = left
                .iter()
                .position(|(known, _)| start.ends_with(known))
                .expect("it was measured");
            let (_, [x, y, z]) = left.remove(known);
            let stop: f64 = start
                .split(',')
                .next()
                .expect("a stop")
                .parse()
                .expect("a number");
            format!("{start},{stop},0,0,{},{y},{z}", stop + x)
        })
        .collect();
    let write = |name: &str, rows: &[String]| {
        place.write(name, format!("{header}\n{}\n", rows.join("\n")));
    };
    write("filled.csv", &filled);
    let identify = |file: &str| {
        place.run(&format!(
            "identify s.toml --quiet --measurements {file} --json"
        ))
    };
    let [raw, deflections] = ["filled.csv", "m.csv"].map(|file| identify(file).ends_with(0).json());
    let key = "compliance_std_rad_per_nm";
    let [raw, deflections] = [raw, deflections].map(|json| crate::support::numbers(&json[key]));
    for (one, other) in raw.iter().zip(&deflections) {
        assert!((one / other - 1.0).abs() < 1e-8);
    }
    // Each row with a reading of its own is not what the scenario says, and neither is the same without it.
    let own: Vec<String> = (filled.iter().enumerate())
        .map(|(index, row)| {
            let (stop, rest) = row.split_once(',').expect("fields");
            let (_, rest) = rest.split_once(',').expect("fields");
            format!("{stop},{},{rest}", index + 1)
        })
        .collect();
    write("own.csv", &own);
    let said = identify("own.csv").ends_with(1).stderr;
    assert!(said.contains("instrument.unloaded = \"own\""), "{said}");
    place.write("s.toml", several("own", "", "model", 64));
    let said = identify("filled.csv").ends_with(1).stderr;
    assert!(said.contains("instrument.unloaded = \"shared\""), "{said}");
    identify("own.csv").ends_with(0);
}

/// A joint's zero moves the deflections of one configuration as its gear's error does: what all loads share of it.
#[test]
fn gears_err_alike_under_all_loads() {
    let scenario = loaded("own", GEARS);
    let belief = &scenario.task.belief;
    let extended = &belief.uncertain;
    let arm = extended.arm();
    let kinds = (0..6).map(|joint| (ParameterKind::JointZero { joint }, None));
    let set = elastocal::parameter::ParameterSet::new(arm, kinds).expect("zeros");
    let sources: Vec<ReadingSource> = extended.sources().map(|(_, each)| each.clone()).collect();
    let mut model = PlannedReadings::new(arm, 0, &set, &[1.0; 6], NOTHING_READ, &sources);
    let q = table4(4).experiments[1].configuration_rad.clone();
    model.move_to(q.as_slice());
    let loads = FORCES.map(|[x, y, z]| Load::force(x, y, z));
    let [one, other] = loads.map(|load| {
        let mut columns = Matrix6xX::zeros(6);
        model.derivatives(&load, &mut columns);
        columns.fixed_rows::<3>(0).into_owned()
    });
    let expected = &one * other.transpose() * 3e-3_f64.powi(2);
    let found = model.covariance_shared([(&loads[0], None), (&loads[1], None)]);
    let found = found.fixed_view::<3, 3>(0, 0).into_owned();
    assert!((found - expected).norm() < 1e-12 * expected.norm());
    assert!((found - found.transpose()).norm() > 1e-3 * found.norm());
}
