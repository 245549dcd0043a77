//! An earlier identification as what is known before: planning, identification and studies use it.

use serde_json::Value;

use crate::support::{Workplace, numbers, project, scenario_text};

/// klimchik2012 by the linear method, so that two steps are exactly one.
fn linear() -> String {
    let method = "[identification]\nmethod = \"linear\"\n\n[instrument]";
    scenario_text("klimchik2012").replace("[instrument]", method)
}

fn with_prior(text: &str, file: &str) -> String {
    text.replace(
        "\nparameters = ",
        &format!("\nprior = \"{file}\"\nparameters = "),
    )
}

fn table4(experiments: u32) -> String {
    let path = project(&format!("scenarios/plans/klimchik2012_m{experiments}.csv"));
    path.display().to_string()
}

fn identified(place: &Workplace, scenario: &str, measurements: &str, out: &str) -> Value {
    let arguments = format!(
        "identify {scenario} --measurements {measurements} --identified-out {out} --json --quiet"
    );
    place.run(&arguments).json()
}

fn assert_near(one: &Value, other: &Value, key: &str, share: f64) {
    let (one, other) = (numbers(&one[key]), numbers(&other[key]));
    assert_eq!(one.len(), 5);
    for (one, other) in one.iter().zip(&other) {
        assert!(
            (one / other - 1.0).abs() < share,
            "{key}: {one} against {other}"
        );
    }
}

/// Two campaigns one after the other tell what both tell together.
#[test]
fn two_steps_are_one() {
    let place = Workplace::new();
    place.write("first.toml", linear());
    place.write("second.toml", with_prior(&linear(), "first.json"));
    let mut both = String::new();
    for (m, name) in [(3, "a.csv"), (4, "b.csv")] {
        let plan = table4(m);
        let arguments =
            format!("measure first.toml --plan {plan} --measurements-out {name} --seed {m}");
        place.run(&arguments).ends_with(0);
        let text = place.read(name);
        let rows = text.lines().filter(|line| !line.starts_with('#'));
        for line in rows.skip(usize::from(!both.is_empty())) {
            both += &format!("{line}\n");
        }
    }
    place.write("both.csv", both);
    identified(&place, "first.toml", "a.csv", "first.json");
    let second = identified(&place, "second.toml", "b.csv", "second.json");
    let together = identified(&place, "first.toml", "both.csv", "together.json");
    assert_near(&second, &together, "compliance_rad_per_nm", 1e-9);
    assert_near(&second, &together, "compliance_std_rad_per_nm", 1e-9);
    // And planning promises what identification then says.
    let arguments = format!("evaluate second.toml --plan {} --json --quiet", table4(4));
    let promised = place.run(&arguments).json();
    assert_near(&promised, &second, "compliance_std_rad_per_nm", 1e-9);
    assert!(
        promised["efficiency"]
            .as_f64()
            .is_some_and(|share| share > 0.8 && share <= 1.0)
    );
}

/// The paper's second step: a joint that a vertical load does not show is known from elsewhere. Plans take
/// it along, no plan beats the bound, and runs of a study spread as promised.
#[test]
fn a_joint_that_no_load_shows_is_known_before() {
    let place = Workplace::new();
    let plan = project("scenarios/plans/kr270_joint1.csv");
    let method = "[identification]\nmethod = \"linear\"\n\n[instrument]";
    let text = scenario_text("klimchik2012_joint1").replace("[instrument]", method);
    place.write("joint1.toml", text);
    let arguments = format!(
        "measure joint1.toml --plan {} --measurements-out m.csv",
        plan.display()
    );
    place.run(&arguments).ends_with(0);
    place
        .run("identify joint1.toml --measurements m.csv --identified-out joint1.json")
        .ends_with(0);
    place.write(
        "all.toml",
        with_prior(&scenario_text("klimchik2012"), "joint1.json"),
    );
    place.write("alone.toml", scenario_text("klimchik2012"));
    let planned = place
        .run("plan all.toml --json --quiet --plan-out p.csv")
        .ends_with(0)
        .json();
    assert_eq!(planned["parameters"][0], "joint_1");
    let efficiency = planned["efficiency"].as_f64().expect("a bound");
    assert!((0.85..=1.0).contains(&efficiency), "{efficiency}");
    // The errors of what is known before and of what is measured are independent.
    let rho0 = |scenario: &str, plan: &str| {
        let results = place
            .run(&format!("evaluate {scenario} --plan {plan} --json --quiet"))
            .json();
        results["rho0_mm"].as_f64().expect("determined")
    };
    let (one, five) = (
        rho0("joint1.toml", &plan.display().to_string()),
        rho0("alone.toml", "p.csv"),
    );
    let all = rho0("all.toml", "p.csv");
    // The compliance that was found is not quite the nominal one; to first order that changes nothing.
    assert!(
        (all / one.hypot(five) - 1.0).abs() < 1e-9,
        "{all}: {one}, {five}"
    );
    for (level, trials) in [("model", 20_000), ("robot", 300)] {
        let arguments = format!("study all.toml --level {level} --trials {trials} --json --quiet");
        let study = place.run(&arguments).json();
        for plan in study["plans"].as_array().expect("plans") {
            let number = |key: &str| plan[key].as_f64().expect("a number");
            assert!(
                number("z").abs() < 5.0,
                "{level}, {}: {}",
                plan["name"],
                number("z")
            );
            // Chi-square with six degrees of freedom.
            let standard_error = (12.0 / f64::from(trials)).sqrt();
            let off = (number("nees") - 6.0) / standard_error;
            assert!(
                off.abs() < 5.0,
                "{level}, {}: NEES is off by {off}",
                plan["name"]
            );
        }
    }
}

#[test]
fn a_prior_that_cannot_be_one_is_refused() {
    let place = Workplace::new();
    place.write("s.toml", linear());
    place
        .run(&format!(
            "measure s.toml --plan {} --measurements-out m.csv",
            table4(3)
        ))
        .ends_with(0);
    identified(&place, "s.toml", "m.csv", "i.json");
    let good = place.read("i.json");
    place.write("p.toml", with_prior(&linear(), "i.json"));
    place.run("check p.toml").ends_with(0);
    let hash = "\"robot_sha256\": \"";
    for (from, to, expected) in [
        (hash, "\"robot_sha256\": \"0", "another robot"),
        ("\"joint_2\"", "\"joint_9\"", "the robot's joints are"),
        ("elastocal.identify", "elastocal.plan", "schema.name"),
        ("{", "", "is not JSON"),
    ] {
        place.write("i.json", good.replacen(from, to, 1));
        let outcome = place.run("check p.toml").ends_with(1);
        assert!(
            outcome.stderr.contains("i.json: ") && outcome.stderr.contains(expected),
            "{expected}: {outcome:?}"
        );
    }
    place.write("i.json", &good);
    let outcome = place
        .run("identify p.toml --measurements m.csv --sigma-from-residuals")
        .ends_with(1);
    assert!(outcome.stderr.contains("robot.prior"), "{outcome:?}");
    place.write("p.toml", with_prior(&linear(), "nothing.json"));
    let outcome = place.run("check p.toml").ends_with(1);
    assert!(outcome.stderr.contains("nothing.json"), "{outcome:?}");
}
