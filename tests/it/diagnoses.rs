//! Likely input errors of measurements are named, on a large and on a small arm, and honest measurements are
//! left in peace; residuals are as chance has them.

use elastocal::codes::{Condition, ConditionCode};
use elastocal::identification::input_errors::{
    LikelyInputError, conditions_of_table, likely_input_errors, suspected_input_errors,
};
use elastocal::identification::{Case, Sigma, residuals};
use elastocal::measurement::{Measurement, deflection_table};
use elastocal::plan::Plan;
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use elastocal::task::Method;
use elastocal::testbed::{VirtualRobot, add_noise_of};
use nalgebra::{DVector, Matrix3, Rotation3, Unit, Vector3};

use crate::recovery::differing;
use crate::support::{
    Workplace, assert_near, experiment, leave_open, scenario_text, state_at, table4,
};

/// Angles and pulls of every kind, for an arm of n joints.
fn varied(scenario: &Scenario, experiments: usize, force_n: f64) -> Plan {
    // Multiples of irrational numbers are spread evenly.
    let share = |index: usize, salt: usize| {
        ((index + 1) as f64 * (2.0 + salt as f64).sqrt() * 1.618_034).fract()
    };
    let experiment = |index: usize| {
        let joints = scenario.task.belief.nominal.chain.joints.iter().enumerate();
        let angles = joints.map(|(joint, each)| {
            let [from, to] = each.range_rad;
            from + (to - from) * (0.1 + 0.8 * share(index, 3 * joint))
        });
        let direction = Vector3::from_fn(|axis, _| share(index, 20 + 7 * axis) - 0.5).normalize();
        let force = direction * force_n;
        experiment(
            DVector::from_iterator(scenario.task.belief.joints(), angles),
            Load::force(force.x, force.y, force.z),
        )
    };
    Plan {
        experiments: (0..experiments).map(experiment).collect(),
    }
}

/// The paper's robot with its plan of twelve, under weights; and a small arm pulled in all directions.
fn arms() -> [(Scenario, Plan); 2] {
    let mut weights = table4(12);
    for (index, experiment) in weights.experiments.iter_mut().enumerate() {
        experiment.configuration_rad[0] = 0.3 * index as f64 - 1.7;
    }
    let small = differing("spatial_3r");
    let pulls = varied(&small, 10, 400.0);
    [(differing("klimchik2012"), weights), (small, pulls)]
}

fn measured(scenario: &Scenario, plan: &Plan, run: u64) -> Vec<Measurement> {
    let belief = &scenario.task.belief;
    let mut measurements = VirtualRobot::new(&scenario.truth.robot, &belief.calibration_tool.name)
        .expect("the site exists")
        .measure_noise_free(plan, &belief.instrument)
        .expect("stable");
    add_noise_of(&mut measurements, &belief.instrument, 5, run);
    measurements
}

fn case<'a>(scenario: &'a Scenario, measurements: &'a [Measurement]) -> Case<'a> {
    let belief = &scenario.task.belief;
    let sigma = Sigma::Known(belief.instrument.sigma_m);
    Case::of_belief(belief, measurements, sigma, Method::Nonlinear)
}

fn diagnosed(scenario: &Scenario, measurements: &[Measurement]) -> Vec<LikelyInputError> {
    let case = case(scenario, measurements);
    suspected_input_errors(&case, case.identify().ok().as_ref())
}

fn shown(scenario: &Scenario, measurements: &[Measurement]) -> Vec<Condition> {
    conditions_of_table(&case(scenario, measurements))
}

fn assert_nothing(scenario: &Scenario, measurements: &[Measurement]) {
    assert_eq!(diagnosed(scenario, measurements), []);
    assert_eq!(shown(scenario, measurements), []);
}

/// How a mistake changes the measurements of a file.
type Spoil = fn(&Scenario, &mut Measurement);

fn turned_frame() -> Matrix3<f64> {
    let axis = Unit::new_normalize(Vector3::new(1.0, 2.0, -0.5));
    Rotation3::from_axis_angle(&axis, 0.6).into_inner()
}

const QUARTER: Matrix3<f64> = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);

fn tool_axes(scenario: &Scenario, each: &Measurement) -> Matrix3<f64> {
    state_at(scenario, &each.configuration_rad).tool_rotation
}

/// Each mistake, what it is diagnosed as, and words of the message.
fn mistakes() -> Vec<(Spoil, &'static str, &'static str)> {
    vec![
        (
            |_, each| each.deflection_m *= -1.0,
            "signs_reversed",
            "are all signs reversed",
        ),
        (
            |_, each| each.load = each.load.scaled(-1.0),
            "signs_reversed",
            "or the loads' sign",
        ),
        (
            |_, each| each.load = each.load.scaled(1.0 / 9.81),
            "load_unit",
            "are the loads in kg instead of N? Multiply fx_n to tz_nm by 9.81",
        ),
        (
            |_, each| each.load = each.load.scaled(1e-3),
            "load_unit",
            "are the loads in kN instead of N? Multiply fx_n to tz_nm by 1000.",
        ),
        (
            |_, each| each.deflection_m *= 1e-3,
            "deflection_unit",
            "in m instead of mm? Multiply dx_mm, dy_mm, dz_mm by 1000.",
        ),
        (
            |_, each| each.deflection_m /= 25.4,
            "deflection_unit",
            "in inches instead of mm? Multiply dx_mm, dy_mm, dz_mm by 25.4.",
        ),
        (
            |_, each| each.deflection_m *= 1e3,
            "deflection_unit",
            "in um instead of mm? Multiply dx_mm, dy_mm, dz_mm by 0.001.",
        ),
        (
            |_, each| each.configuration_rad *= 1_f64.to_radians(),
            "angle_unit",
            "are the angles in radians instead of degrees? Multiply q1_deg",
        ),
        (
            |_, each| each.configuration_rad *= 1_f64.to_degrees(),
            "angle_unit",
            "were the angles converted to degrees twice",
        ),
        (
            |_, each| each.configuration_rad[2] *= -1.0,
            "joint_signs",
            "q3_deg (joint_3) turns the other way than in the model",
        ),
        (
            |_, each| each.configuration_rad.swap_rows(1, 2),
            "joints_swapped",
            "are the columns q2_deg (joint_2) and q3_deg (joint_3) swapped",
        ),
        (
            |_, each| each.deflection_m = QUARTER.transpose() * each.deflection_m,
            "frame",
            "turned by 90.0 deg about the z axis against the model's world frame? Write dx_mm = \
             -dy_mm, dy_mm = dx_mm, dz_mm = dz_mm",
        ),
        (
            |_, each| each.deflection_m.y *= -1.0,
            "frame",
            "mirrored and turned by 180.0 deg about the y axis against the model's world frame? Write dx_mm = \
             dx_mm, dy_mm = -dy_mm, dz_mm = dz_mm",
        ),
        (
            |scenario, each| {
                each.deflection_m = tool_axes(scenario, each).transpose() * each.deflection_m;
            },
            "deflections_in_tool_frame",
            "in the tool's frame instead of the world's",
        ),
        (
            |scenario, each| {
                let axes = tool_axes(scenario, each).transpose();
                each.load.force_n = axes * each.load.force_n;
            },
            "loads_in_tool_frame",
            "are the loads in the tool's frame",
        ),
    ]
}

#[test]
fn every_mistake_is_named_on_both_arms() {
    let mut wrong = Vec::new();
    for (scenario, plan) in arms() {
        let honest = measured(&scenario, &plan, 0);
        assert_nothing(&scenario, &honest);
        for (spoil, expected, words) in mistakes() {
            let mut spoiled = honest.clone();
            for each in &mut spoiled {
                spoil(&scenario, each);
            }
            let found = diagnosed(&scenario, &spoiled);
            let is_right =
                found.len() == 1 && found[0].kind == expected && found[0].text.contains(words);
            if !is_right {
                wrong.push(format!("{}: {expected:?}: {found:#?}", scenario.name));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// A frame turned by any angle: the rotation is found within what the noise allows.
#[test]
fn a_turned_frame_is_found_with_its_angle() {
    for (scenario, plan) in arms() {
        let mut measurements = measured(&scenario, &plan, 1);
        for each in &mut measurements {
            each.deflection_m = turned_frame().transpose() * each.deflection_m;
        }
        let found = diagnosed(&scenario, &measurements);
        assert_eq!(found[0].kind, "frame", "{found:#?}");
        // Its rows, as the words have them: dx_mm = a dx_mm + b dy_mm + c dz_mm.
        let (_, written) = found[0]
            .text
            .split_once("Write ")
            .expect("a frame is written");
        let words = written
            .split([' ', ','])
            .filter_map(|word| word.parse::<f64>().ok());
        let matrix = Matrix3::from_row_iterator(words.take(9));
        let off = Rotation3::from_matrix(&(matrix * turned_frame().transpose())).angle();
        // Noise of 0.03 mm in ten deflections of some millimetres; the model is linear.
        assert!(off < 0.03, "{off} rad: {found:#?}");
        assert!(found[0].text.contains("deg about (0.4"), "{found:#?}");
    }
}

/// With axis 1 at zero throughout, its sign does not show and is not spoken of.
#[test]
fn what_does_not_show_is_no_other_explanation() {
    let (scenario, _) = &arms()[0];
    let mut measurements = measured(scenario, &table4(12), 13);
    for each in &mut measurements {
        each.configuration_rad[3] *= -1.0;
    }
    let found = diagnosed(scenario, &measurements);
    assert_eq!(found[0].kind, "joint_signs");
    assert!(
        found[0].text.starts_with("q4_deg (joint_4) turns"),
        "{found:#?}"
    );
    assert!(!found[0].text.contains("joint_1"), "{found:#?}");
}

/// Two mistakes at once are found one after the other.
#[test]
fn weights_in_kilograms_without_sign() {
    for (scenario, plan) in arms() {
        let mut measurements = measured(&scenario, &plan, 2);
        for each in &mut measurements {
            each.load = each.load.scaled(-1.0 / 9.81);
        }
        let found: Vec<String> = (diagnosed(&scenario, &measurements).into_iter())
            .map(|each| each.text)
            .collect();
        assert_eq!(found.len(), 2, "{found:?}");
        for words in ["all signs reversed", "in kg instead of N"] {
            let is_named = found.iter().any(|text| text.contains(words));
            assert!(is_named, "{found:?}");
        }
    }
}

#[test]
fn copies_are_named_and_chance_is_not() {
    for (scenario, mut plan) in arms() {
        plan.experiments[0].repeats = 20;
        let honest = measured(&scenario, &plan, 3);
        let mut rows = honest.clone();
        rows.push(honest[21].clone());
        let copy = |code, words: String| {
            move |found: &[Condition]| {
                let [found] = found else {
                    panic!("{found:#?}");
                };
                assert_eq!(found.code, code);
                assert!(found.text.ends_with(&words), "{found:#?}");
            }
        };
        let words = format!(": {} (22)", rows.len());
        copy(ConditionCode::CopiedRows, words)(&shown(&scenario, &rows));

        let mut readings = honest.clone();
        readings[22].deflection_m = honest[21].deflection_m;
        let words = ": 23 (22)".to_owned();
        copy(ConditionCode::CopiedReadings, words)(&shown(&scenario, &readings));

        // An instrument that shows hundredths of a millimetre may well show the same twice.
        let mut rounded = honest.clone();
        for each in &mut rounded {
            each.deflection_m = each.deflection_m.map(|value| (value * 1e5).round() / 1e5);
        }
        rounded[1].deflection_m = rounded[0].deflection_m;
        assert_nothing(&scenario, &rounded);
    }
}

/// Outside of its range is the angle, not the measurement that lies on the bound.
#[test]
fn angles_outside_the_ranges_are_named() {
    let (scenario, plan) = &arms()[0];
    let mut measurements = measured(scenario, plan, 4);
    measurements[3].configuration_rad[1] = 5_f64.to_radians();
    let found = shown(scenario, &measurements);
    let text = "1 of 12 measurements have commanded angles outside the joint limits: q2_deg (joint_2) \
                of measurement 4 is 5.0 deg, allowed are -146.0 to 0.0 deg";
    assert_eq!(found[0].text, text);
    assert_eq!(found[0].code, ConditionCode::AnglesOutsideLimits);
}

/// Whether they are suspicious or not: by Markov's inequality, each kind of mistake is said of honest
/// measurements once in a million times, a dozen kinds of 200 once in four hundred tests. The seeds are
/// fixed, so that the test cannot fail by chance later.
#[test]
fn honest_measurements_are_left_in_peace() {
    for (scenario, plan) in arms() {
        for run in 0..100 {
            let measurements = measured(&scenario, &plan, run);
            let case = case(&scenario, &measurements);
            assert_nothing(&scenario, &measurements);
            assert_eq!(likely_input_errors(&case), [], "run {run}");
        }
    }
}

/// What is wrong in another way is not explained away: one wrong reading, another sigma, compliances
/// that are twice the nominal ones, and a robot that discrepancies in every row.
#[test]
fn other_troubles_are_no_such_mistakes() {
    for (scenario, plan) in arms() {
        let honest = measured(&scenario, &plan, 6);
        let mut outlier = honest.clone();
        outlier[4].deflection_m.y += 0.6e-3;
        let mut coarse = honest.clone();
        let mut discrepancy = honest.clone();
        for (index, each) in discrepancy.iter_mut().enumerate() {
            let swing = Vector3::from_fn(|axis, _| (index as f64 * (2.3 + axis as f64)).sin());
            each.deflection_m += swing * 0.5e-3;
        }
        for (before, each) in measured(&scenario, &plan, 7).iter().zip(&mut coarse) {
            each.deflection_m += (each.deflection_m - before.deflection_m) * 4.0;
        }
        let mut soft = scenario.clone();
        for value in &mut soft.truth.robot.compliance_rad_per_nm {
            *value *= 2.0;
        }
        let soft = measured(&soft, &plan, 8);
        for measurements in [outlier, coarse, discrepancy, soft] {
            assert_nothing(&scenario, &measurements);
        }
    }
}

/// The square of the distance is what the sum of squares loses without the measurement.
#[test]
fn the_distance_is_what_leaving_out_gains() {
    for (scenario, plan) in arms() {
        for sigma in [
            Sigma::Known(scenario.task.belief.instrument.sigma_m),
            ESTIMATED,
        ] {
            let measurements = measured(&scenario, &plan, 9);
            let mut case = case(&scenario, &measurements);
            (case.sigma, case.method) = (sigma, Method::Linear);
            let found = case.identify().expect("identified");
            let squares = |residuals_m: &[f64]| residuals_m.iter().map(|r| r * r).sum::<f64>();
            let of_all = squares(&found.residuals_m);
            let residuals = residuals(&case, &found, &[]).expect("there are");
            let spare = 3 * measurements.len() - scenario.task.belief.parameters.len();
            for (index, each) in residuals.iter().enumerate() {
                let mut others = measurements.clone();
                others.remove(index);
                let without = case.with(&others).identify().expect("identified");
                let variance = match sigma {
                    Sigma::Known(sigma) => sigma * sigma,
                    Sigma::FromResiduals(_) => of_all / spare as f64,
                };
                let gain = (of_all - squares(&without.residuals_m)) / variance;
                let square = each.distance.powi(2);
                assert_near(square, gain, 1e-6 * gain.max(1.0));
                assert_eq!(each.freedom, 3);
            }
        }
    }
}

const ESTIMATED: Sigma = Sigma::FromResiduals(3e-5);

/// Over many runs, distances are those of the chi-squared distribution with their own degrees of freedom.
#[test]
fn distances_are_as_chance_has_them() {
    let (scenario, plan) = &arms()[1];
    let runs = 300_u32;
    let (mut sum, mut below, mut count) = (0.0, 0, 0);
    for run in 0..runs {
        let measurements = measured(scenario, plan, u64::from(run));
        let case = case(scenario, &measurements);
        let found = case.identify().expect("identified");
        for each in residuals(&case, &found, &[]).expect("there are") {
            sum += each.distance.powi(2) / 3.0;
            below += u32::from(each.probability.expect("there is") < 0.1);
            count += 1;
        }
    }
    let count = f64::from(count);
    // The mean square of three normal numbers has the variance 2/3; four deviations.
    assert!((sum / count - 1.0).abs() < 4.0 * (2.0 / 3.0 / count).sqrt());
    let share = f64::from(below) / count;
    assert!((share - 0.1).abs() < 4.0 * (0.09 / count).sqrt(), "{share}");
}

/// A fit through every measurement leaves nothing to judge by, and says nothing.
#[test]
fn without_spare_measurements_nothing_is_judged() {
    let (mut scenario, plan) = arms()[0].clone();
    leave_open(&mut scenario, &[1, 2, 3]);
    let measurements = &measured(&scenario, &plan, 11)[..1];
    let case = case(&scenario, measurements);
    let residuals =
        residuals(&case, &case.identify().expect("identified"), &[]).expect("there are");
    let only = &residuals[0];
    assert_eq!((only.freedom, only.probability), (0, None));
    assert_eq!(only.standardised, [None, None, None]);
}

/// From outside: conditions, exit code, JSON, and words on the wrong reading.
#[test]
fn identify_says_what_is_wrong() {
    let workplace = Workplace::with("s.toml", scenario_text("klimchik2012"));
    let (scenario, plan) = &arms()[0];
    let honest = measured(scenario, plan, 12);
    let write = |measurements: &[Measurement]| {
        let path = workplace.path("m.csv");
        let table = deflection_table(&path, &6.into(), measurements);
        std::fs::write(path, table.expect("can be written")).expect("can be written");
    };
    let identify = "identify s.toml --measurements m.csv --identified-out i.json";

    write(&honest);
    workplace.done(identify).prints("(6 more fit better)");

    let mut kilograms = honest.clone();
    for each in &mut kilograms {
        each.load = each.load.scaled(1.0 / 9.81);
    }
    write(&kilograms);
    let outcome = workplace.doubted(&format!("{identify} --json"));
    let says = "condition C0210: likely input error: are the loads in kg instead of N? Multiply fx_n to tz_nm by 9.81";
    outcome.says(says);
    let diagnosis = &outcome.json()["diagnoses"][0];
    assert_eq!(diagnosis["kind"], "load_unit");
    assert!(diagnosis["log_evidence_ratio"].as_f64() > Some(13.8));

    let mut wrong = honest;
    wrong[7].deflection_m.y += 0.6e-3;
    write(&wrong);
    let outcome = workplace.doubted(identify);
    outcome.prints("8 (left out)");
    outcome.does_not_say("likely input error");
    let identify = &format!("{identify} --keep-all");
    let outcome = workplace.done(identify);
    let note = "note: residuals too large";
    outcome.prints(note);
    outcome.does_not_say("likely input error");
    let json = workplace.run(&format!("{identify} --json")).json();
    assert_eq!(json["residuals"].as_array().map(Vec::len), Some(12));
    assert_eq!(json["residuals"][7]["degrees_of_freedom"], 3);
    assert!(json["diagnoses"].as_array().is_some_and(Vec::is_empty));

    // Where nothing can be identified, the likely input error is the hint.
    let mut micrometres = wrong;
    for each in &mut micrometres {
        each.deflection_m *= 1e3;
    }
    write(&micrometres);
    let outcome = workplace.refused(identify);
    let says = "hint: likely input error: are the deflections in um instead of mm?";
    outcome.says(says);
}
