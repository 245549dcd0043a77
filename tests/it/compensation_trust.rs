//! What `compensate` trusts: files of another robot are refused, and what speaks against a file is said.

use elastocal::calibration::compensate_poses;
use elastocal::compensation::test_pose_matrix;
use elastocal::numeric::estimable::Estimable;
use elastocal::numeric::posterior::Posterior;
use elastocal::scenario::Scenario;
use elastocal::testbed::TrueRobots;
use nalgebra::{DMatrix, DVector};
use serde_json::{Value, json};

use crate::support::{
    Outcome, Workplace, number, numbers, scenario, scenario_text, table4, with_numbers,
};

/// The paper's scenario, and what was identified under it.
fn identified() -> Workplace {
    let workplace = Workplace::with("s.toml", scenario_text("klimchik2012"));
    workplace.write_plan("p.csv", 6, &table4(4));
    workplace.done("measure s.toml --plan p.csv --measurements-out m.csv");
    workplace.done("identify s.toml --measurements m.csv --identified-out i.json");
    workplace
}

fn compensate(workplace: &Workplace, code: i32) -> Outcome {
    workplace
        .run("compensate s.toml --identified i.json --quiet --json")
        .ends_with(code)
}

/// Changes the identified file.
fn edit(workplace: &Workplace, change: impl FnOnce(&mut Value)) {
    let mut json = workplace.parsed("i.json");
    change(&mut json);
    workplace.write("i.json", json.to_string());
}

fn replace(workplace: &Workplace, from: &str, to: &str) {
    let text = workplace.read("s.toml");
    assert!(text.contains(from), "{from}");
    workplace.write("s.toml", text.replace(from, to));
}

#[test]
fn what_differs_harmlessly_does_not_matter() {
    let workplace = identified();
    let first = compensate(&workplace, 0);
    assert_eq!(first.stderr, "");
    // A new description, another seed, another plan; another job for the same robot.
    replace(&workplace, "seed = 1", "seed = 2");
    replace(
        &workplace,
        "description = \"The problem",
        "description = \"Problem",
    );
    replace(&workplace, "experiments = 3", "experiments = 5");
    assert_eq!(
        compensate(&workplace, 0).json()["q_commanded_deg"],
        first.json()["q_commanded_deg"]
    );
    replace(
        &workplace,
        "force_n = [0, 280, -180]",
        "force_n = [0, 100, -180]",
    );
    assert_ne!(
        compensate(&workplace, 0).json()["q_commanded_deg"],
        first.json()["q_commanded_deg"]
    );
}

#[test]
fn another_robots_file_is_refused() {
    let workplace = identified();
    let model =
        std::fs::read_to_string(crate::support::project("models/kr270.xml")).expect("is there");
    let longer = model.replace(
        "<body name=\"link_3\" pos=\"1.250 0 0\"",
        "<body name=\"link_3\" pos=\"1.300 0 0\"",
    );
    assert_ne!(model, longer, "the third link's place is written otherwise");
    workplace.write("kr270.xml", longer);
    replace(
        &workplace,
        &crate::support::project("models").to_string_lossy(),
        ".",
    );
    let outcome = compensate(&workplace, 1);
    outcome.says("i.json: identified_with.robot_sha256: was identified with another robot");
    outcome.says("hint: ");
    outcome.says("--identified-out i.json");
    assert_eq!(outcome.stdout, "");
}

#[test]
fn what_it_was_identified_under_must_still_be_believed() {
    for (from, to) in [
        ("sigma_mm = 0.03", "sigma_mm = 0.05"),
        (
            "calibration_site = \"calibration_tcp\"",
            "calibration_site = \"machining_tcp\"",
        ),
        (
            "[instrument]",
            "compliance_rad_per_nm = [1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6]\n[instrument]",
        ),
    ] {
        let workplace = identified();
        replace(&workplace, from, to);
        let outcome = compensate(&workplace, 3);
        outcome.says("condition C0307: i.json was identified under another scenario");
    }
}

#[test]
fn files_that_do_not_say_what_they_rest_on_are_read() {
    let workplace = identified();
    let new = compensate(&workplace, 0).json();
    edit(&workplace, |json| {
        let keys = json.as_object_mut().expect("an object");
        for key in ["identified_with", "conditions", "consistency_lower"] {
            keys.remove(key).expect(key);
        }
    });
    let outcome = compensate(&workplace, 3);
    outcome.says("condition C0308: i.json does not say with which robot");
    let old = outcome.json();
    assert_eq!(old["q_commanded_deg"], new["q_commanded_deg"]);
    assert_eq!(old["rho0_mm"], new["rho0_mm"]);
    // Without an estimate nothing can be predicted where that joint matters.
    edit(&workplace, |json| {
        json["compliance_rad_per_nm"][1] = Value::Null;
        json["undetermined_directions"] = json!([[0, 1, 0, 0, 0]]);
        json["rank"] = json!(4);
    });
    let outcome = compensate(&workplace, 3);
    assert!(
        outcome.stderr.contains("not determined: joint_3") && outcome.json()["rho0_mm"].is_null()
    );
}

#[test]
fn doubts_of_the_identification_are_repeated() {
    let workplace = identified();
    // Ten times as exact as it is.
    replace(&workplace, "sigma_mm = 0.03", "sigma_mm = 0.003");
    // What the model leaves is not counted.
    let identify = "identify s.toml --measurements m.csv --identified-out i.json --noise-only";
    workplace.doubted(identify).says("residuals too large");
    let outcome = compensate(&workplace, 3);
    let condition = "condition C0205: the identification in i.json: residuals too large";
    outcome.says(condition);
}

/// A compliance that scatters below zero is none: the nominal one is compensated with and exported, and all else that is
/// correlated with it moves along.
#[test]
fn a_negative_compliance_is_not_compensated_with() {
    let workplace = identified();
    let nominal = compensate(&workplace, 0).json();
    let task = scenario("klimchik2012").task;
    let mut shift = DVector::zeros(5);
    edit(&workplace, |json| {
        let covariance = json["covariance_rad2_per_n2m2"].clone();
        let number = |value: &Value| value.as_f64().expect("a number");
        let off = number(&json["compliance_rad_per_nm"][1]) + 1e-7;
        let nominal = task.belief.nominal.compliance_rad_per_nm[2];
        for joint in 0..5 {
            let share = number(&covariance[1][joint]) / number(&covariance[1][1]);
            let value = number(&json["compliance_rad_per_nm"][joint]) - share * off;
            shift[joint] = share * (nominal + 1e-7);
            json["compliance_rad_per_nm"][joint] = json!(value);
            json["compliance_applied_rad_per_nm"][joint] = json!(value);
            json["compliance_ci95_rad_per_nm"][joint] = Value::Null;
        }
    });
    let outcome = compensate(&workplace, 3);
    let said = "the identified compliance of joint_3 is -1.000e-7 rad/(N m), which no joint has: replaced by the nominal value";
    outcome.says(said);
    let found = outcome.json();
    for (one, other) in numbers(&found["q_commanded_deg"])
        .iter()
        .zip(numbers(&nominal["q_commanded_deg"]))
    {
        assert!((one - other).abs() < 2e-3, "{found:#} {nominal:#}");
    }
    // What was identified says that this is wrong by the shift, beside its own uncertainty.
    let rows = test_pose_matrix(&task.belief, &task.test_poses[0], &task.belief.parameters);
    let [own, predicted] = [&nominal, &found].map(|each| number(&each["rho0_mm"]));
    let expected = own.hypot((rows * shift).norm() * 1e3);
    assert!(
        (predicted / expected - 1.0).abs() < 0.01 && predicted > 3.0 * own,
        "{predicted} {expected} {own}"
    );
    workplace.doubted("export s.toml --identified i.json --model-out o.xml --quiet");
}

/// By the logarithm of a compliance that is twice the nominal one, a test pose errs twice as much.
#[test]
fn accuracy_is_predicted_at_what_was_identified() {
    let place = Workplace::new();
    let source =
        "\n[[uncertainty]]\nkind = \"compliance\"\njoints = [\"joint_1\"]\nstd_relative = 0.3\n";
    place.write("s.toml", scenario_text("klimchik2012") + source);
    let Scenario { task, truth, .. } = place.scenario("s.toml");
    let mut robots = TrueRobots::new(&task.belief, &truth).expect("robots");
    let last = task.belief.unknowns() - 1;
    let [one, two] = [0.0, 2.0_f64.ln()].map(|value| {
        let mut mean = task.belief.values();
        mean[last] = value;
        let mut covariance = DMatrix::zeros(last + 1, last + 1);
        covariance[(last, last)] = 0.01;
        let posterior = Posterior {
            names: task.belief.unknown_names(),
            mean,
            covariance,
            estimable: Estimable::with_hidden(&task.belief.sizes(), DMatrix::zeros(last + 1, 0)),
        };
        let poses = compensate_poses(&task, &mut robots, &posterior, task.belief.method);
        poses.expect("compensated")[0]
            .predicted_m
            .clone()
            .expect("determined")
    });
    assert!(one > 0.0 && (two / one - 2.0).abs() < 1e-9, "{one} {two}");
}

/// Nor is it content with a value that stands in where only combinations are determined.
#[test]
fn a_negative_value_that_stands_in_is_said() {
    let workplace = identified();
    edit(&workplace, |json| {
        json["compliance_rad_per_nm"][4] = Value::Null;
        json["compliance_applied_rad_per_nm"][4] = json!(-1e-7);
        json["undetermined_directions"] = json!([[0, 0, 0, 0, 1]]);
        json["rank"] = json!(4);
    });
    let outcome = compensate(&workplace, 3);
    let condition = "condition C0202: the compliance of joint_6 is negative";
    outcome.says(condition);
}

/// One number that somebody altered contradicts another, and is refused by key.
#[test]
fn an_altered_number_is_an_error() {
    for (pointer, factor, place) in [
        (
            "/compliance_rad_per_nm/0",
            10.0,
            "compliance_applied_rad_per_nm[0]",
        ),
        (
            "/compliance_rad_per_nm/3",
            -1.0,
            "compliance_applied_rad_per_nm[3]",
        ),
        (
            "/compliance_applied_rad_per_nm/1",
            1.01,
            "compliance_applied_rad_per_nm[1]",
        ),
        (
            "/compliance_std_rad_per_nm/2",
            1.01,
            "compliance_std_rad_per_nm[2]",
        ),
        (
            "/compliance_ci95_rad_per_nm/0/1",
            1.01,
            "compliance_ci95_rad_per_nm[0]",
        ),
        (
            "/covariance_rad2_per_n2m2/4/4",
            1.01,
            "compliance_std_rad_per_nm[4]",
        ),
        ("/rank", 1.0, "rank"),
    ] {
        let workplace = identified();
        edit(&workplace, |json| {
            let number = json.pointer_mut(pointer).expect("a key");
            *number = match number.as_u64() {
                Some(_) => json!(4),
                None => json!(number.as_f64().expect("a number") * factor),
            };
        });
        let outcome = compensate(&workplace, 1);
        outcome.says(&format!("i.json: {place}: found "));
        outcome.says("the file was altered");
    }
}

#[test]
fn a_damaged_subspace_is_an_error() {
    for (directions, problem) in [
        (json!([[1, 0]]), "found 2 values"),
        (json!([[1, 1, 0, 0, 0]]), "not orthonormal"),
        (json!([[1, 0, 0, 0, 0], [1, 0, 0, 0, 0]]), "not orthonormal"),
    ] {
        let workplace = identified();
        edit(&workplace, |json| {
            json["undetermined_directions"] = directions;
        });
        let outcome = compensate(&workplace, 1);
        let place = "i.json: undetermined_directions: ";
        outcome.says(place);
        outcome.says(problem);
    }
}

/// The deflection there is 0.05 deg in joint 5, and the pose 0.01 deg from its limit.
#[test]
fn angles_beyond_the_limits_are_named() {
    let workplace = identified();
    let at_limit = "q_deg = [0, -56.9, 89.3, 45.1, 124.999, 57.2]";
    replace(
        &workplace,
        "q_deg = [0, -56.9, 89.3, 45.1, 76, 57.2]",
        at_limit,
    );
    for force in ["force_n = [2000, 0, 0]", "force_n = [-2000, 0, 0]"] {
        let text = workplace.read("s.toml");
        let start = text.find("force_n = [").expect("is there");
        let end = start + text[start..].find('\n').expect("a line");
        workplace.write("s.toml", text[..start].to_owned() + force + &text[end..]);
        let outcome = workplace.run("compensate s.toml --identified i.json --quiet --json");
        let angle = outcome.json()["q_commanded_deg"][4]
            .as_f64()
            .expect("a number");
        let condition =
            "condition C0304: test pose \"milling\": joint_5 would be commanded to 125.";
        assert_eq!(
            outcome.code,
            Some(if angle > 125.0 { 3 } else { 0 }),
            "{outcome:#?}"
        );
        assert_eq!(outcome.stderr.contains(condition), angle > 125.0);
        assert_eq!(
            outcome
                .stderr
                .contains("its limits are -125.0000 to 125.0000 deg"),
            angle > 125.0
        );
    }
}

/// Metres in the columns of millimetres: everything fits, too well.
#[test]
fn residuals_can_be_too_small() {
    let workplace = identified();
    let columns = ["dx_mm", "dy_mm", "dz_mm"];
    let in_metres = with_numbers(&workplace.read("m.csv"), &columns, |number| number * 1e-3);
    workplace.write("m.csv", in_metres);
    for method in ["linear", "nonlinear"] {
        let identify = format!(
            "identify s.toml --measurements m.csv --method {method} --identified-out i.json --json --quiet"
        );
        let outcome = workplace.doubted(&identify);
        outcome.says("condition C0206: residuals too small for sigma = 0.0300 mm");
        let json = outcome.json();
        let probability = |key: &str| json[key].as_f64().expect("a number");
        assert!(probability("consistency_lower") < 1e-4);
        let sum = probability("consistency") + probability("consistency_lower");
        assert!((sum - 1.0).abs() < 1e-12, "{sum}");
        assert!(
            compensate(&workplace, 3)
                .stderr
                .contains("residuals too small")
        );
    }
}
