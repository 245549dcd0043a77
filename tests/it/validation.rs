//! Other measurements than those that were identified from check what the identification promises.

use crate::support::{Workplace, numbers, scenario_text};

/// A robot that was identified from three measurements.
fn identified() -> Workplace {
    let workplace = Workplace::new();
    workplace.write("s.toml", scenario_text("klimchik2012"));
    let plan = crate::support::project("scenarios/plans/klimchik2012_m3.csv");
    workplace.run(&format!(
        "measure s.toml --quiet --plan {} --measurements-out m.csv",
        plan.display()
    ));
    workplace
        .run("identify --quiet --measurements m.csv --identified-out i.json")
        .ends_with(0);
    workplace
}

/// A robot that is what was identified keeps the promise in about as many cases as it should, and one whose
/// compliances are others does not.
#[test]
fn a_promise_is_kept_or_not() {
    let workplace = identified();
    workplace
        .run("validate --quiet --identified i.json --experiments 4 --plan-out v.csv")
        .ends_with(0);
    let judged = |scenario: &str, seed: u64| {
        workplace.run(&format!(
            "measure {scenario} --quiet --plan v.csv --seed {seed} --measurements-out vm.csv"
        ));
        workplace.run("validate s.toml --quiet --identified i.json --measurements vm.csv --json")
    };
    let probabilities: Vec<f64> = (0..12)
        .map(|seed| {
            let json = judged("s.toml", 100 + seed).ends_with(0).json();
            assert_eq!(json["measurements"].as_array().map(Vec::len), Some(4));
            json["probability"].as_f64().expect("a number")
        })
        .collect();
    // The identification is one and the same: what is wrong with it is wrong each time.
    assert!(
        probabilities.iter().all(|each| (1e-3..1.0).contains(each)),
        "{probabilities:?}"
    );
    let other = scenario_text("klimchik2012")
        + "\n[true_robot]\ncompliance_rad_per_nm = [0.26e-6, 0.33e-6, 0.406e-6, 3.002e-6, 3.303e-6, 2.365e-6]\n";
    workplace.write("other.toml", other);
    let outcome = judged("other.toml", 7).ends_with(3);
    assert!(
        outcome.stderr.contains("does not keep what was promised"),
        "{outcome:#?}"
    );
}

/// Validation asks where the identified robot is known least: there the promise is weaker than at random.
#[test]
fn validation_is_planned_where_the_promise_is_weakest() {
    let workplace = identified();
    let weakest = |plan: &str| {
        workplace.run(&format!(
            "measure s.toml --quiet --plan {plan} --measurements-out vm.csv"
        ));
        let json = workplace
            .run("validate --quiet s.toml --identified i.json --measurements vm.csv --json")
            .ends_with(0)
            .json();
        let left: Vec<f64> = (json["measurements"]
            .as_array()
            .expect("measurements")
            .iter())
        .map(|each| each["left_rms_mm"].as_f64().expect("a number"))
        .collect();
        left[0]
    };
    let json = workplace
        .run("validate --quiet --identified i.json --plan-out v.csv --json")
        .ends_with(0)
        .json();
    let plan = json["plan"].as_array().expect("a plan");
    assert_eq!(plan.len(), 3);
    assert_ne!(numbers(&plan[0]["q_deg"]), numbers(&plan[1]["q_deg"]));
    let own = crate::support::project("scenarios/plans/klimchik2012_m3.csv");
    assert!(weakest("v.csv") > 1.5 * weakest(&own.display().to_string()));
}
