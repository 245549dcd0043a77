//! Readings that are wrong or not there: no belief carries them, and studies say what they cost.

use elastocal::plan::{Plan, posterior, quantile95_m};
use elastocal::study::account::Account;
use serde_json::Value;

use crate::support::{Workplace, table4};
use crate::uncertainties::{loaded, study, with};

const WRONG: &str =
    "[[uncertainty]]\nkind = \"wrong_reading\"\nshare = 0.1\nstd_mm = 0.15\nhidden = true\n";
const DROPPED: &str = "[[uncertainty]]\nkind = \"dropped_reading\"\nshare = 0.03\nhidden = true\n";

/// Table 4's plan of four, each measured as often as said.
fn repeated(text: &str, repeats: u32) -> String {
    text.replace(
        "experiments = 4\ntrials",
        &format!("experiments = {}\ntrials", 4 * repeats),
    )
}

fn number(plan: &Value, key: &str) -> f64 {
    plan[key].as_f64().expect("a number")
}

/// What the account of the errors expects (mm), which is seen at both levels.
fn assert_as_computed(text: &str, breaker: &str) {
    for (level, trials, nonlinear) in [("model", 20_000, 0.005), ("robot", 1500, 0.02)] {
        let text = text
            .replace("LEVEL", level)
            .replace("64", &trials.to_string());
        let plan = study(&text);
        let parts = plan["parts"].as_array().expect("parts").iter();
        let expected = parts
            .map(|part| number(part, "rms_mm").powi(2))
            .sum::<f64>()
            .sqrt();
        let room = 3.0 * number(&plan, "rms_std_mm") + nonlinear * expected;
        assert!(
            (number(&plan, "rms_mm") - expected).abs() < room,
            "{level}, {expected}: {plan}"
        );
        assert_eq!(plan["failed"], 0, "{plan}");
        assert!(expected > 1.01 * number(&plan, "promised_rms_mm"), "{plan}");
        let verdict = plan["verdict"].as_str().expect("words");
        assert!(verdict == "holds" || verdict.contains(breaker), "{verdict}");
    }
}

/// Wrong readings are seen at both levels as far as their covariance, share times square, says.
#[test]
fn wrong_readings_break_promises_as_computed() {
    let text = repeated(&with(WRONG, "LEVEL", 64), 2);
    assert_as_computed(&text, "wrong_reading");
    // The promise is that of the noise alone.
    let certain = number(&study(&with("", "model", 64)), "predicted_rms_mm");
    let plan = study(&with(WRONG, "model", 64));
    assert!((number(&plan, "promised_rms_mm") / certain - 1.0).abs() < 1e-6);
}

/// Dropped readings leave what the rest leaves: to first order in their share what every reading that is missing alone
/// leaves.
#[test]
fn dropped_readings_leave_what_the_rest_leaves() {
    let text = repeated(&with(DROPPED, "LEVEL", 64), 3);
    assert_as_computed(&text, "dropped_reading");
    let scenario = loaded(&repeated(&with(DROPPED, "model", 64), 1));
    let (task, plan) = (&scenario.task, table4(4));
    let account = Account::new(task, &scenario.truth, &plan).expect("determined");
    let square = |plan: &Plan| {
        let known = posterior(&task.belief, plan);
        assert!(quantile95_m(task, &known).is_some());
        let rows = elastocal::compensation::test_pose_rows(&task.belief, &task.test_poses[0]);
        known.variance_of(&rows).expect("determined")
    };
    let without = |index: usize| {
        let mut less = plan.clone();
        less.experiments.remove(index);
        square(&less) - square(&plan)
    };
    let expected = 0.03 * (0..4).map(without).sum::<f64>();
    let found = account.parts.last().expect("a part");
    assert!(
        (found.rms_m.powi(2) / expected - 1.0).abs() < 1e-9,
        "{found:?}"
    );
}

/// Where too few are left, runs fail by name and count for nothing, and both levels lose the same readings.
#[test]
fn runs_with_too_few_readings_fail_by_name() {
    let many = DROPPED.replace("0.03", "0.5");
    let place = Workplace::new();
    let mut failed = Vec::new();
    for level in ["model", "robot"] {
        place.write("s.toml", with(&many, level, 256));
        let outcome = place
            .run("study s.toml --json --quiet --threads 1")
            .ends_with(3);
        let plan = outcome.json()["plans"][0].clone();
        let reasons = plan["failures"].as_array().expect("reasons").clone();
        assert_eq!(reasons.len(), 1, "{plan}");
        let reason = reasons[0][0].as_str().expect("words");
        assert!(reason.contains("so many readings were dropped"), "{reason}");
        failed.push(plan["failed"].clone());
        // The same bits on any threads.
        let again = place
            .run("study s.toml --json --quiet --threads 3")
            .ends_with(3);
        assert_eq!(again.json()["plans"][0], plan);
    }
    assert_eq!(failed[0], failed[1]);
    // Fewer than two readings of four do not determine five compliances: five patterns of sixteen.
    let expected: f64 = 256.0 * 5.0 / 16.0;
    let seen = failed[0].as_f64().expect("a number");
    let room = 4.0 * (expected * 11.0 / 16.0).sqrt();
    assert!((seen - expected).abs() < room, "{seen}");
}

/// Every command that measures leaves them out and says so; what is seen without a source is told by --shares.
#[test]
fn what_measures_says_what_was_dropped() {
    let place = Workplace::new();
    let many = DROPPED.replace("0.03", "0.3") + WRONG;
    place.write("s.toml", with(&many, "robot", 64));
    let file = crate::support::project("scenarios/plans/klimchik2012_m4.csv");
    let measure = |seed: u32, plan: &str, more: &str| {
        place.run(&format!(
            "measure s.toml --plan {plan} --seed {seed} {more}"
        ))
    };
    let file = file.display().to_string();
    let mut fewest = 4;
    for seed in 0..12 {
        let outcome = measure(seed, &file, "--json --quiet");
        let found = outcome.ends_with(0).json()["measurements"]
            .as_array()
            .expect("a list")
            .len();
        let text = measure(seed, &file, "--quiet").ends_with(0).stdout;
        let says = format!("{} of 4 readings w", 4 - found);
        assert_eq!(text.contains(&says), found < 4, "{text}");
        fewest = fewest.min(found);
    }
    assert!(fewest < 4);
    // All of them, some time.
    let one = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats\n\
               0,-56.9,89.3,45.1,76,57.2,0,0,-2500,0,0,0,1\n";
    place.write("one.csv", one);
    let all = (0..12).find(|seed| measure(*seed, "one.csv", "--quiet").code == Some(1));
    let outcome = measure(all.expect("a seed"), "one.csv", "--quiet").ends_with(1);
    assert!(
        outcome.stderr.contains("readings were dropped"),
        "{}",
        outcome.stderr
    );
    let plan = place
        .run("study s.toml --trials 512 --shares --json --quiet")
        .json()["plans"][0]
        .clone();
    let parts = plan["parts"].as_array().expect("parts");
    assert_eq!(parts.len(), 3, "{plan}");
    assert!(
        parts.iter().all(|part| part["seen_rms_mm"].is_number()),
        "{plan}"
    );
}

/// They are refused where they could not be meant.
#[test]
fn wrong_entries() {
    for (text, key, says) in [
        (
            "kind = \"wrong_reading\"\nshare = 0.1\nstd_mm = 1",
            "uncertainty[0].hidden",
            "hidden = true",
        ),
        (
            "kind = \"dropped_reading\"\nshare = 0.1",
            "uncertainty[0].hidden",
            "no part of any promise",
        ),
        (
            "kind = \"dropped_reading\"\nshare = 0.6\nhidden = true",
            "uncertainty[0].share",
            "0.6",
        ),
        (
            "kind = \"dropped_reading\"\nshare = -0.1\nhidden = true",
            "uncertainty[0].share",
            "-0.1",
        ),
        (
            "kind = \"dropped_reading\"\nstd_mm = 1\nhidden = true",
            "uncertainty[0].std_mm",
            "it has share",
        ),
        (
            "kind = \"wrong_reading\"\nshare = 0.1\nhidden = true",
            "uncertainty[0].std_mm",
            "is missing",
        ),
        (
            "kind = \"wrong_reading\"\nstd_mm = 1\nhidden = true",
            "uncertainty[0].share",
            "is missing",
        ),
        (
            "kind = \"misfit\"\nstd_mm = 1\nshare = 0.1",
            "uncertainty[0].share",
            "no such size",
        ),
    ] {
        let place = Workplace::new();
        place.write(
            "wrong.toml",
            with(&format!("[[uncertainty]]\n{text}\n"), "model", 64),
        );
        let outcome = place.run("check wrong.toml").ends_with(1);
        let stderr = outcome.stderr;
        assert!(
            stderr.contains(key) && stderr.contains(says),
            "{text}: {stderr}"
        );
    }
}
