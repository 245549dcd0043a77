//! An instrument that measures rotations: planning, study and identification use them alike.

use serde_json::Value;

use crate::support::{Workplace, assert_alike, list, number, numbers, scenario_text, shipped};

/// Rotations as good as the deflections are 0.15 m from the joints.
const SIGMA: &str = "rotation_sigma_mrad = 0.2\ntracker_site";

fn workplace(name: &str) -> Workplace {
    let place = Workplace::new();
    let text = scenario_text(name);
    assert!(text.contains("tracker_site"));
    place.write("without.toml", &text);
    place.write("with.toml", text.replace("tracker_site", SIGMA));
    let linear = "[identification]\nmethod = \"linear\"\n\n[instrument]";
    place.write(
        "linear.toml",
        text.replace("tracker_site", SIGMA)
            .replace("[instrument]", linear),
    );
    place
}

fn evaluated(place: &Workplace, scenario: &str, plan: &str) -> Value {
    let arguments = format!("evaluate {scenario} --plan {plan} --json");
    place.run(&arguments).json()
}

fn rho0_um(results: &Value) -> f64 {
    number(&results["rho0_mm"]) * 1e3
}

/// What `evaluate` predictions of a plan is what `identify` says after its measurements.
#[test]
fn standard_errors_are_those_of_identification() {
    let place = workplace("kr270_all_joints");
    let plan = shipped("scenarios/plans/kr270_all_joints.csv");
    place.done(&format!(
        "measure linear.toml --plan {plan} --measurements-out m.csv"
    ));
    let identified = place
        .run("identify linear.toml --measurements m.csv --json")
        .json();
    let predicted = evaluated(&place, "linear.toml", &plan);
    let key = "compliance_std_rad_per_nm";
    let (predicted, identified) = (numbers(&predicted[key]), numbers(&identified[key]));
    assert_eq!(predicted.len(), 6);
    for (predicted, identified) in predicted.iter().zip(&identified) {
        assert_alike(*predicted, *identified, 1e-9);
    }
}

/// A plan made for rotations is better with them than one that was made without, no plan beats the bound,
/// and runs of the study spread as predicted.
#[test]
fn plans_use_rotations() {
    let place = workplace("kr270_all_joints");
    for each in ["with", "without"] {
        let arguments = format!("plan {each}.toml --experiments 4 --plan-out {each}.csv --quiet");
        place.done(&arguments);
    }
    let with = evaluated(&place, "with.toml", "with.csv");
    let best = rho0_um(&with);
    let same_plan = rho0_um(&evaluated(&place, "without.toml", "with.csv"));
    let other_plan = rho0_um(&evaluated(&place, "with.toml", "without.csv"));
    assert!(best < same_plan, "{best} against {same_plan}");
    assert!(best < other_plan, "{best} against {other_plan}");
    let efficiency = number(&with["efficiency"]);
    assert!((0.5..=1.0).contains(&efficiency), "{efficiency}");
    let study = "study with.toml --level model --trials 20000 --json --quiet";
    let study = place.run(study).json();
    for plan in list(&study["plans"]) {
        let z = number(&plan["z"]);
        assert!(z.abs() < 5.0, "{}: {z}", plan["name"]);
    }
}
