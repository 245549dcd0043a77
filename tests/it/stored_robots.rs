//! A robot that was identified from absolute readings, read from its file: wrong entries are told with their keys, and stations
//! that were moved with how far.

use elastocal::measurement::{AbsoluteReading, absolute_table};
use elastocal::numeric::random::generator;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde_json::{Value, json};

use crate::model_selection::{read_of, waves};
use crate::one_fit::{Campaign, normal, read, seen_arm, ur10, workplace};
use crate::support::{Workplace, list, number, numbers};

/// Readings of a robot whose gears are not round, before and after its base was moved along and about its own axes.
fn not_round(moved: &Isometry3<f64>) -> [Vec<AbsoluteReading>; 2] {
    let mut random = generator(41, 0);
    let mut arm = seen_arm(&mut random, &ur10(), 1, 1);
    let gear = waves(&mut random);
    let before = read_of(&mut random, &arm, 100, 0.0, &gear);
    arm.instrument_from_base[0] *= moved;
    [before, read_of(&mut random, &arm, 100, 0.0, &gear)]
}

fn identified(readings: &[AbsoluteReading]) -> Workplace {
    let place = workplace(readings);
    place.run(
        "identify s.toml --quiet --measurements m.csv --parameters zeros --identified-out i.json",
    );
    place
}

fn moves() -> Isometry3<f64> {
    Isometry3::new(
        Vector3::new(2e-3, -3e-3, 1e-3),
        Vector3::new(1e-3, 5e-4, -2e-3),
    )
}

/// Holds the stations that moved beside what was done to them (mm, mrad), each within so much.
fn assert_moved(found: &Value, moved: &Isometry3<f64>, within: f64) {
    let done = [moved.translation.vector, moved.rotation.scaled_axis()];
    for (key, done) in ["position_mm", "rotation_mrad"].into_iter().zip(done) {
        for (found, done) in numbers(&found[key]).into_iter().zip(done.iter()) {
            assert!((found - done * 1e3).abs() < within, "{found} {done}");
        }
    }
}

#[test]
fn a_moved_station_is_told_with_how_far() {
    for moved in [moves(), Isometry3::identity()] {
        let [before, after] = not_round(&moved);
        let place = identified(&before);
        assert!(place.read("i.json").contains("\"discrepancy_model\": {"));
        place.write("other.csv", absolute_table(&6.into(), &after));
        let validate = "validate --quiet --identified i.json --measurements other.csv --json";
        let outcome = place.run(validate);
        let json = outcome.json();
        let found = &json["stations_moved"][0];
        // A tenth of what gears leave of a single reading.
        assert_moved(found, &moved, 0.1);
        let was_moved = moved != Isometry3::identity();
        let probability = number(&found["probability"]);
        assert_eq!(probability < 1e-6, was_moved, "{probability}");
        assert_eq!(outcome.stderr.contains("condition C0303: "), was_moved);
    }
}

/// A robot that is other than it was identified, by 3 mm, to any side: few readings lie in their regions.
#[test]
fn regions_that_do_not_cover_are_named() {
    let [before, mut after] = not_round(&Isometry3::identity());
    let place = identified(&before);
    let mut random = generator(43, 0);
    for each in &mut after {
        each.position_m += 3e-3 * Vector3::from_fn(|_, _| normal(&mut random));
    }
    place.write("other.csv", absolute_table(&6.into(), &after));
    let outcome = place.run("validate --quiet --identified i.json --measurements other.csv");
    outcome
        .ends_with(3)
        .says("condition C0302: coverage of the 95 % regions of positions is ");
}

/// Of two stations the one that was moved is named, by robots that are as their model, too.
#[test]
fn of_two_stations_the_moved_one_is_named() {
    let mut random = generator(42, 0);
    let mut arm = seen_arm(&mut random, &ur10(), 2, 1);
    let campaign = Campaign::poses(60, 1.0);
    let place = identified(&read(&mut random, &arm, &campaign));
    arm.instrument_from_base[1] *= moves();
    let after = read(&mut random, &arm, &campaign);
    place.write("other.csv", absolute_table(&6.into(), &after));
    let outcome = place.run("validate --quiet --identified i.json --measurements other.csv --json");
    let json = outcome.json();
    for (station, moved) in [Isometry3::identity(), moves()].iter().enumerate() {
        let found = &json["stations_moved"][station];
        assert_eq!(found["station"], json!(format!("S{station}")));
        assert_moved(found, moved, 0.02);
        let named = format!("condition C0303: station S{station} moved by ");
        assert_eq!(outcome.stderr.contains(&named), station == 1);
    }
}

/// Where a compliance that no joint has is held at its nominal value, stations and targets go with that, as all else does.
#[test]
fn frames_go_with_a_compliance_that_is_held() {
    let mut random = generator(44, 0);
    let arm = seen_arm(&mut random, &ur10(), 1, 1);
    let campaign = Campaign::poses(60, 1.0).under(100.0);
    let place = workplace(&read(&mut random, &arm, &campaign));
    place.run("identify s.toml --quiet --measurements m.csv --parameters compliances --identified-out i.json");
    let others = read(&mut random, &arm, &campaign);
    place.write("other.csv", absolute_table(&6.into(), &others));
    let found = place.parsed("i.json");
    let unknowns = list(&found["unknowns"]);
    let place_of = |name: &str| unknowns.iter().position(|each| each["name"] == name);
    let elbow = place_of("elbow.compliance").expect("identified");
    let covariance = |row: usize| number(&found["covariance"][row][elbow]);
    // What is left where it was found so, and all else as it goes with that.
    let left = |value: f64| {
        let share = (value - number(&unknowns[elbow]["value"])) / covariance(elbow);
        let mut file = found.clone();
        for (row, unknown) in file["unknowns"]
            .as_array_mut()
            .into_iter()
            .flatten()
            .enumerate()
        {
            for key in ["/value", "/interval95/0", "/interval95/1"] {
                let entry = unknown.pointer_mut(key).expect("a number");
                *entry = json!(number(entry) + covariance(row) * share);
            }
        }
        for (key, word) in [("stations", "base"), ("targets", "tool")] {
            let by = |name: String| place_of(&name).map_or(0.0, |row| covariance(row) * share);
            let [moved, turned] = ["", "r"].map(|turn| {
                Vector3::from(["x", "y", "z"].map(|axis| by(format!("{word}.{turn}{axis}"))))
            });
            let frame = &mut file[key][0];
            let [x, y, z] = [0, 1, 2].map(|axis| number(&frame["position_mm"][axis]) * 1e-3);
            let [w, i, j, k] = [0, 1, 2, 3].map(|part| number(&frame["quaternion"][part]));
            let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
            let other = Isometry3::from_parts(Translation3::new(x, y, z), turn)
                * Isometry3::new(moved, turned);
            frame["position_mm"] = json!(<[f64; 3]>::from(other.translation.vector * 1e3));
            let [i, j, k, w] = other.rotation.coords.into();
            frame["quaternion"] = json!([w, i, j, k]);
        }
        place.write("w.json", file.to_string());
        let outcome =
            place.run("validate --quiet --identified w.json --measurements other.csv --json");
        let json = outcome.json();
        let all: Vec<Value> = list(&json["residuals_mm"]).clone();
        all.iter().flat_map(numbers).collect::<Vec<f64>>()
    };
    let nominal = left(number(&unknowns[elbow]["nominal"]));
    for (held, nominal) in left(-1e-7).into_iter().zip(nominal) {
        assert!((held - nominal).abs() < 1e-4, "{held} {nominal}");
    }
}

/// What is wrong in what a file says of joints' errors and of the rest is told with its key.
#[test]
fn wrong_entries_of_what_is_unexplained_are_told() {
    let [before, after] = not_round(&Isometry3::identity());
    let place = identified(&before);
    place.write("other.csv", absolute_table(&6.into(), &after));
    let right = place.parsed("i.json");
    let joint = "/discrepancy_model/joints/0";
    let first = &right["discrepancy_model"]["joints"][0];
    let mut knots = first["knots"].clone();
    knots[1] = knots[0].clone();
    let mut values = list(&first["values"]).clone();
    values.pop();
    let second = right["discrepancy_model"]["joints"][1]["joint"].clone();
    let mut triangle = right["discrepancy_model"]["covariance"].clone();
    let last = triangle.as_array().expect("rows").len() - 1;
    triangle[last][last] = json!(-1.0);
    let shorter = &right["discrepancy_model"]["covariance"]
        .as_array()
        .expect("rows")[..last];
    let mut too_alike = right["discrepancy_model"]["covariance"].clone();
    too_alike[1][0] = json!(1.0);
    for (key, entry, expected) in [
        (
            format!("{joint}/joint"),
            json!("knee"),
            "discrepancy_model.joints[0].joint: the robot has no joint \"knee\"",
        ),
        (
            format!("{joint}/joint"),
            second,
            "discrepancy_model.joints[1].joint: found",
        ),
        (
            format!("{joint}/knots"),
            knots,
            "discrepancy_model.joints[0].knots: wants finite numbers in ascending order",
        ),
        (
            format!("{joint}/knots"),
            json!([]),
            "discrepancy_model.joints[0].knots: wants",
        ),
        (
            format!("{joint}/values"),
            json!(values),
            "discrepancy_model.joints[0].values: found",
        ),
        (
            format!("{joint}/length"),
            json!(0.0),
            "discrepancy_model.joints[0].length: found 0; a size is needed",
        ),
        (
            format!("{joint}/deviation"),
            json!(-1e-4),
            "discrepancy_model.joints[0].deviation: found -0.0001",
        ),
        (
            "/discrepancy_model/shift".to_owned(),
            json!([0.0]),
            "discrepancy_model.shift: found 1 numbers; there are",
        ),
        (
            "/discrepancy_model/remainder_mm".to_owned(),
            json!(-0.1),
            "discrepancy_model.remainder_mm: found -0.1",
        ),
        (
            "/discrepancy_model/remainder_mrad".to_owned(),
            json!(-0.1),
            "discrepancy_model.remainder_mrad: found -0.1",
        ),
        (
            "/discrepancy_model/scale/1".to_owned(),
            json!(0.0),
            "discrepancy_model.scale[1]: found 0; a positive number",
        ),
        (
            "/discrepancy_model/covariance".to_owned(),
            json!(shorter),
            "discrepancy_model.covariance: wants the lower triangle",
        ),
        (
            "/discrepancy_model/covariance".to_owned(),
            triangle,
            &format!("discrepancy_model.covariance[{last}][{last}]: found"),
        ),
        (
            "/discrepancy_model/covariance".to_owned(),
            too_alike,
            "discrepancy_model.covariance[0][1]: found",
        ),
    ] {
        let mut wrong = right.clone();
        *wrong.pointer_mut(&key).expect("a key") = entry;
        place.write("w.json", wrong.to_string());
        let outcome = place.run("validate --quiet --identified w.json --measurements other.csv");
        outcome.ends_with(1).says(&format!("w.json: {expected}"));
    }
    place.done("validate --quiet --identified i.json --measurements other.csv");
}

/// Whoever reads a file says the same of what is wrong with it: as the robot that is validated, and as what was known before.
#[test]
fn every_reader_tells_the_same() {
    let [before, _] = not_round(&Isometry3::identity());
    let place = identified(&before);
    let text = place.read("s.toml");
    place.write(
        "p.toml",
        text.replacen("[robot]", "[robot]\nprior = \"w.json\"", 1),
    );
    let right = place.parsed("i.json");
    for (key, entry, expected) in [
        (
            "/unknowns/0/value",
            json!("far"),
            "unknowns[0].value: invalid type: string \"far\"",
        ),
        (
            "/unknowns/0/value",
            json!(0.5),
            "unknowns[0].interval95: found",
        ),
        (
            "/stations/0/quaternion",
            json!([2, 0, 0, 0]),
            "stations[0]: is no place",
        ),
        (
            "/discrepancy_mm",
            json!(-1),
            "discrepancy_mm: found -1; zero or a size",
        ),
        (
            "/discrepancy_model/shift",
            json!([]),
            "discrepancy_model.shift: found 0 numbers",
        ),
    ] {
        let mut wrong = right.clone();
        *wrong.pointer_mut(key).expect("a key") = entry;
        place.write("w.json", wrong.to_string());
        let says = format!("w.json: {expected}");
        for command in [
            "validate --quiet --identified w.json --measurements m.csv",
            "compensate s.toml --quiet --identified w.json",
            "check p.toml --quiet",
        ] {
            place.refused(command).says(&says);
        }
    }
}

/// The same of how errors are spread over a joint's angles; an older file says nothing of that.
#[test]
fn wrong_entries_of_spreads_are_told() {
    let [before, after] = not_round(&Isometry3::identity());
    let place = identified(&before);
    place.write("other.csv", absolute_table(&6.into(), &after));
    let right = place.parsed("i.json");
    let validate = |stored: &Value| {
        place.write("w.json", stored.to_string());
        place.run("validate --quiet --identified w.json --measurements other.csv")
    };
    for (key, entry, expected) in [
        (
            "spread_of_positions",
            json!([0.1, 1e3]),
            "found 1000; numbers from -30 to 30",
        ),
        (
            "spread_of_rotations",
            json!([0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1]),
            "found 7 numbers; 6 are the most",
        ),
    ] {
        let mut wrong = right.clone();
        wrong["discrepancy_model"]["joints"][0][key] = entry;
        let outcome = validate(&wrong).ends_with(1);
        outcome.says(&format!(
            "w.json: discrepancy_model.joints[0].{key}: {expected}"
        ));
    }
    let mut older = right.clone();
    for joint in older["discrepancy_model"]["joints"]
        .as_array_mut()
        .expect("a list")
    {
        let joint = joint.as_object_mut().expect("a joint");
        joint.remove("spread_of_positions").expect("it is there");
        joint.remove("spread_of_rotations").expect("it is there");
    }
    validate(&older).ends_with(0);
}
