//! Predictions outside of the angles that were read.

use elastocal::measurement::absolute_table;
use elastocal::numeric::random::generator;
use serde_json::Value;

use crate::model_selection::read_within;
use crate::one_fit::{between, seen_arm, ur10, workplace};
use crate::support::{Workplace, assert_near, list, number, numbers, with_numbers};

/// A robot whose joints err once to five times a turn, read in one part of joint space and in another.
fn halves(seed: u64, readings: usize) -> Workplace {
    let mut random = generator(53, seed);
    let arm = seen_arm(&mut random, &ur10(), 1, 1);
    let waves: Vec<[f64; 2]> = (0..30)
        .map(|_| {
            [
                between(&mut random, 0.0, 3e-4),
                between(&mut random, 0.0, 6.3),
            ]
        })
        .collect();
    let gear = |joint: usize, angle: f64| {
        let own = waves[5 * joint..].iter().take(5).enumerate();
        let wave = |(order, [size, phase]): (usize, &[f64; 2])| {
            size * ((order + 1) as f64 * angle + phase).sin()
        };
        own.map(wave).sum()
    };
    let mut read = |range| read_within(&mut random, &arm, range, (readings, 0.0), &gear);
    let (one, other) = (read([-2.6, 0.0]), read([0.0, 2.6]));
    let place = workplace(&one);
    place.write("other.csv", absolute_table(&6.into(), &other));
    place
}

fn validated(place: &Workplace) -> Value {
    let identify = "identify s.toml --measurements m.csv --parameters geometry --identified-out i.json --quiet";
    place.run(identify);
    let validate = "validate --identified i.json --measurements other.csv --json --quiet";
    place.run(validate).json()
}

/// A condition names the joints, before a validation and before a compensation.
#[test]
fn beyond_what_was_read_is_said() {
    let place = halves(20, 15);
    let codes = |found: &Value| -> Vec<String> {
        let conditions = list(&found["conditions"]).iter();
        let beyond = conditions.filter(|each| each["code"] == "C0311");
        beyond.map(|each| each["text"].to_string()).collect()
    };
    let found = codes(&validated(&place));
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(
        found[0].contains("15 of 15 readings") && found[0].contains("elbow by "),
        "{found:?}"
    );
    let compensate = "compensate --identified i.json --json --quiet";
    let found = codes(&place.run(compensate).json());
    assert!(found[0].contains("1 of 1 test pose outside"), "{found:?}");
    // What was fitted stands for other readings.
    place.forget_readings("i.json");
    let own = "validate --identified i.json --measurements m.csv --json --quiet";
    assert!(codes(&place.run(own).json()).is_empty());
    // More readings, to which joint error functions are fitted.
    assert_eq!(codes(&validated(&halves(21, 60))).len(), 1);
}

/// A joint that is commanded a turn further stands alike, and errs alike: readings are predicted as well there, to the last digit that an
/// angle has, and nothing is outside of what was read. Joint error functions that went by the angle itself left 1.8 times as much.
#[test]
fn joint_errors_come_again_in_each_turn() {
    let place = halves(22, 120);
    let identify =
        "identify s.toml --measurements m.csv --parameters zeros --identified-out i.json --quiet";
    place.run(identify);
    let text = place.read("m.csv");
    let angles = ["q1_deg", "q2_deg", "q3_deg", "q4_deg", "q5_deg", "q6_deg"];
    let further = with_numbers(&text, &angles, |angle| angle + 360.0);
    place.write("further.csv", further);
    let validated = |file: &str| {
        let validate = format!("validate --identified i.json --measurements {file} --json --quiet");
        place.run(&validate).json()
    };
    // What was fitted stands for other readings.
    place.forget_readings("i.json");
    let [own, further] = ["m.csv", "further.csv"].map(validated);
    let rms = |found: &Value| number(&found["with_joint_errors"]["distance_mm"]["rms"]);
    assert_near(rms(&own), rms(&further), 1e-6 * rms(&own));
    assert_eq!(own["coverage95"], further["coverage95"]);
    let conditions = list(&further["conditions"]).iter();
    let codes: Vec<&Value> = conditions.map(|each| &each["code"]).collect();
    assert!(!codes.iter().any(|code| *code == "C0311"), "{codes:?}");
    // A tolerance is judged beside these functions, too.
    let judged =
        place.record("validate --identified i.json --measurements m.csv --tolerance-um 500");
    let each = list(&judged["tolerance"]["measurements"]);
    let left = &judged["residuals_with_joint_errors_mm"];
    assert_eq!(each.len(), 120);
    for (each, left) in each.iter().zip(left.as_array().expect("all")) {
        let distance_um = numbers(left)
            .iter()
            .map(|each| each * each)
            .sum::<f64>()
            .sqrt()
            * 1e3;
        let judged_um = number(&each["distance_um"]);
        assert_near(distance_um, judged_um, 1e-6 * distance_um);
    }
}

/// A station is not said to be moved since joints that turn about it err by what nobody read, alike in all readings there.
#[test]
fn what_was_not_read_moves_no_station() {
    for seed in 21..25 {
        let found = validated(&halves(seed, 60));
        assert!(
            found["residuals_with_joint_errors_mm"].is_array(),
            "{found}"
        );
        let conditions = list(&found["conditions"]).iter();
        let codes: Vec<&Value> = conditions.map(|each| &each["code"]).collect();
        assert!(
            !codes.iter().any(|code| *code == "C0303"),
            "{}",
            found["conditions"]
        );
    }
}

/// Of six readings whose discrepancy nobody knows, regions of 95 % hold as many of further ones: by the degrees of freedom of what the
/// residuals say of it. 60 robots; the shares of 40 readings each scatter by 0.13, so that their mean does by 0.017. Where six readings
/// were taken for as good as many, 82 % were within.
#[test]
fn regions_of_few_readings_hold() {
    let known = crate::support::absolute_scenario_text("ur10")
        .replace("\"reflector\"", "\"spindle\"")
        .replace("tool_height_min_mm = 300", "tool_height_min_mm = 20")
        .replace("tool_radius_min_mm = 400", "tool_radius_min_mm = 10")
        + "\n[[uncertainty]]\nkind = \"joint_zero\"\nstd_mrad = 1\n";
    let place = Workplace::with("s.toml", &known);
    let hidden = "\n[[uncertainty]]\nkind = \"discrepancy\"\nstd_mm = 0.2\nhidden = true\n";
    place.write("true.toml", known + hidden);
    let mut held = 0.0;
    for seed in 1..=60 {
        let mut random = generator(67, seed);
        let mut row = || {
            let ranges = [170.0, 30.0, 45.0, 170.0, 170.0, 170.0];
            let middles = [0.0, -90.0, 55.0, 0.0, 0.0, 0.0];
            let angles = ranges.iter().zip(middles);
            let angles = angles.map(|(range, middle)| {
                format!("{:.3}", middle + between(&mut random, -range, *range))
            });
            angles.collect::<Vec<_>>().join(",") + ",spindle"
        };
        let head = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,target".to_owned();
        let rows: Vec<String> = std::iter::once(head)
            .chain((0..46).map(|_| row()))
            .collect();
        place.write("p.csv", rows.join("\n") + "\n");
        let measure =
            format!("measure true.toml --plan p.csv --seed {seed} --measurements-out m.csv");
        place.run(&(measure + " --quiet"));
        let text = place.read("m.csv");
        let lines: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
        place.write("a.csv", lines[..7].join("\n") + "\n");
        place.write(
            "b.csv",
            [&lines[..1], &lines[7..]].concat().join("\n") + "\n",
        );
        place.run("identify s.toml --measurements a.csv --parameters zeros --identified-out i.json --quiet");
        let validate = "validate s.toml --identified i.json --measurements b.csv --json --quiet";
        let found = place.run(validate).json();
        held += number(&found["coverage95"]["positions"]) / 60.0;
    }
    assert!((held - 0.95).abs() < 0.05, "{held}");
}
