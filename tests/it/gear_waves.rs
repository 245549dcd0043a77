//! Gear error as waves over the joint's own angle: in truth and belief, in predictions, and found in absolute readings.

use elastocal::measurement::absolute_table;
use elastocal::numeric::random::generator;
use elastocal::plan::Assessment;
use serde_json::Value;

use crate::backlash::pose_of;
use crate::one_fit::{SIGMA_M, between, normal, seen_arm, workplace};
use crate::support::{assert_near, scenario_text, table4};
use crate::uncertainties::{assert_holds, assert_refused, entry, expected_mm, loaded, study, with};

const WAVES: &str = "std_mrad = 1\nharmonics = [1, 2, 40]";

fn number(plan: &Value, key: &str) -> f64 {
    plan[key].as_f64().expect("a number")
}

fn rho0(list: &str) -> f64 {
    let scenario = loaded(&with(list, "model", 64));
    Assessment::new(&scenario.task, &table4(4), None)
        .rho0_m
        .expect("determined")
}

/// Known, the prediction holds, at rest and in the linear model; hidden it is broken, by what the account says.
#[test]
fn predictions_hold_and_are_broken_by_what_is_hidden() {
    let known = study(&with(
        &entry(("transmission_error", WAVES), ""),
        "robot",
        800,
    ));
    assert_holds(&known, "waves");
    let noise = number(&study(&with("", "model", 4096)), "rms_mm");
    assert!(number(&known, "combined_rms_mm") > 1.02 * noise, "{known}");
    let exact = study(&with(
        &entry(("transmission_error", WAVES), ""),
        "model",
        20_000,
    ));
    let off = (number(&exact, "rms_mm") - number(&exact, "combined_rms_mm"))
        / number(&exact, "rms_std_mm");
    assert!(off.abs() < 4.5, "{off}");
    let large = entry(
        ("transmission_error", "std_mrad = 3\nharmonics = [40]"),
        "hidden = true",
    );
    let hidden = study(&with(&large, "robot", 800));
    let expected = expected_mm(&hidden);
    let room = 3.0 * number(&hidden, "rms_std_mm") + 0.03 * expected;
    assert_near(number(&hidden, "rms_mm"), expected, room);
    let verdict = hidden["verdict"].as_str().expect("a verdict");
    assert!(
        verdict.starts_with("exceeded") && verdict.contains("transmission_error"),
        "{verdict}"
    );
}

/// So on a robot of another kind.
#[test]
fn other_robots_have_waves_too() {
    let text = scenario_text("ur10");
    let head = text.split("[study]").next().expect("a head");
    let study_of = "\n[study]\nlevel = \"robot\"\ntrials = 800\nexperiments = 8\n[[study.plan]]\nname = \"best\"\n\
                    kind = \"optimal\"\nexperiments = 4\nnoise_only = true\n";
    let list = entry(("transmission_error", WAVES), "");
    assert_holds(&study(&format!("{head}{study_of}{list}")), "UR10");
}

/// A wave that comes once in a turn is nearly the joint's zero to a plan. Fast ones cost more, as the joint is commanded back over
/// some of the wave where a deflection is compensated.
#[test]
fn what_waves_cost() {
    let sized = |harmonics: &str| {
        let size = format!("std_mrad = 1\nharmonics = {harmonics}");
        rho0(&entry(("transmission_error", &size), ""))
    };
    let zero = rho0(&entry(("joint_zero", "std_mrad = 1"), ""));
    let (slow, fast) = (sized("[1]"), sized("[40]"));
    assert!((slow / zero - 1.0).abs() < 0.1, "{slow} {zero}");
    assert!(fast > 5.0 * slow, "{fast} {slow}");
    // Several together are off by as much as one, and cost what lies between.
    let several = sized("[1, 2, 3, 4]");
    assert!(several > slow && several < 1.2 * slow, "{several} {slow}");
}

/// Absolute readings tell a wave: with what is known before, or named among what is to be found.
#[test]
fn absolute_readings_find_waves() {
    let scenario = crate::one_fit::ur10();
    let random = &mut generator(37, 0);
    let arm = seen_arm(random, &scenario, 1, 1);
    let (sine, cosine) = (3e-4_f64, -1.5e-4);
    let mut readings = Vec::new();
    for _ in 0..120 {
        let told = nalgebra::DVector::from_fn(6, |_, _| between(random, -2.6, 2.6));
        // The arm stands where another zero would have it.
        let mut standing = arm.clone();
        let phase: f64 = 20.0 * told[1];
        standing.zero_rad[1] += sine * phase.sin() + cosine * phase.cos();
        let mut reading = pose_of(&standing, &told);
        reading.position_m += nalgebra::Vector3::from_fn(|_, _| normal(random) * SIGMA_M);
        readings.push(reading);
    }
    let place = workplace(&readings);
    let bare = place.read("s.toml");
    place.write("m.csv", absolute_table(&6.into(), &readings));
    let joint = &scenario.task.belief.nominal.chain.joints[1].name;
    let listed = format!("joints = [\"{joint}\"]\nstd_mrad = 0.3\nharmonics = [20]");
    place.write(
        "s.toml",
        format!("{bare}{}", entry(("transmission_error", &listed), "")),
    );
    let told = "identify s.toml --parameters zeros --measurements m.csv --json --quiet";
    assert_found(&place.run(told).json(), joint, [sine, cosine]);
    let names = format!("\"{joint}.gear_20_cosine\", \"{joint}.gear_20_sine\"");
    let named = bare.replace("parameters = [", &format!("parameters = [{names}, "));
    place.write("s.toml", &named);
    let found = (place.run("identify s.toml --measurements m.csv --json --quiet --out r")).json();
    assert_found(&found, joint, [sine, cosine]);
    // Wrong names are told.
    for wrong in ["gear_0_sine", "gear_20", "gear_x_cosine"] {
        place.write("s.toml", named.replace("gear_20_sine", wrong));
        let said = place.refused("check s.toml");
        said.says(wrong);
        said.says("gear_40_sine");
    }
}

fn assert_found(found: &Value, joint: &str, expected: [f64; 2]) {
    let unknowns = found["unknowns"].as_array().expect("unknowns");
    for (phase, expected) in ["sine", "cosine"].into_iter().zip(expected) {
        let name = format!("{joint}.gear_20_{phase}");
        let unknown = unknowns.iter().find(|each| each["name"] == name.as_str());
        let unknown = unknown.expect("it is found");
        assert_eq!(unknown["unit"], "rad");
        let error = number(unknown, "standard_error");
        assert!(error < 1e-5, "{unknown}");
        assert_near(number(unknown, "value"), expected, 5.0 * error);
    }
}

/// Wrong entries are named with their key and what is allowed.
#[test]
fn wrong_entries() {
    for (text, key, says) in [
        (
            "std_mrad = 1\nharmonics = [0]",
            "harmonics[0]",
            "joint_zero",
        ),
        ("std_mrad = 1\nharmonics = [2, -1]", "harmonics[1]", "-1"),
        (
            "std_mrad = 1\nharmonics = [1001]",
            "harmonics[0]",
            "from 1 to 1000",
        ),
        (
            "std_mrad = 1\nharmonics = [3, 3]",
            "harmonics[1]",
            "3 twice",
        ),
        ("std_mrad = 1\nharmonics = []", "harmonics", "is empty"),
        ("std_mm = 1\nharmonics = [3]", "std_mm", "slides"),
        ("harmonics = [3]", "[0]", "needs its standard deviation"),
        (
            "std_mrad = 1\nharmonics = [3]\n[[uncertainty]]\nkind = \"transmission_error\"\nname = \"more\"\nstd_mrad = 1\n\
             harmonics = [3]",
            "",
            "twice",
        ),
    ] {
        assert_refused(&format!("kind = \"transmission_error\"\n{text}"), key, says);
    }
    assert_refused(
        "kind = \"joint_zero\"\nstd_mrad = 1\nharmonics = [3]",
        "harmonics",
        "a joint_zero has no such key",
    );
}
