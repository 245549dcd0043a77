//! What absolute readings found of a robot is what the next campaign knows, of absolute readings or of deflections.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::support::{
    UR10_JOINTS, Workplace, absolute_scenario_text, assert_alike_in, list, number,
};

/// The robot differs in geometry and compliances, of which the planner's model knows nothing before.
const HIDDEN: &str = r#"
[[uncertainty]]
kind = "joint_zero"
std_mrad = 0.5
hidden = true

[[uncertainty]]
kind = "link_position"
std_mm = 0.2
hidden = true

[[uncertainty]]
kind = "link_rotation"
std_mrad = 0.3
hidden = true

[[uncertainty]]
name = "springs"
kind = "compliance"
std_relative = 0.15
joints = ["shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"]
hidden = true

[[station]]
name = "door"
position_mm = [-1800, 500, 900]

[[station]]
name = "wall"
position_mm = [-2500, -2000, 1500]
"#;

/// Poses of the robot, of the reflector each read under the load, every third without.
const POSES: [[f64; 6]; 30] = [
    [-29.0, -74.0, 114.0, 169.0, -105.0, 3.0],
    [-76.0, -43.0, 50.0, -16.0, -32.0, -11.0],
    [16.0, -31.0, 69.0, -158.0, 30.0, -129.0],
    [34.0, -49.0, 42.0, -108.0, -61.0, 3.0],
    [-155.0, -169.0, 112.0, -156.0, 166.0, -100.0],
    [31.0, 30.0, -148.0, 26.0, 155.0, -95.0],
    [-6.0, -31.0, 60.0, 97.0, -37.0, 28.0],
    [164.0, -83.0, 113.0, -124.0, -122.0, -116.0],
    [-37.0, -55.0, 83.0, 155.0, 8.0, 54.0],
    [141.0, -36.0, 0.0, 78.0, -93.0, 140.0],
    [17.0, -109.0, -119.0, 41.0, -3.0, -162.0],
    [-6.0, -62.0, 96.0, 138.0, -105.0, 11.0],
    [58.0, -55.0, 55.0, -112.0, -116.0, 0.0],
    [-164.0, -160.0, 0.0, 109.0, -54.0, 123.0],
    [-73.0, -100.0, 79.0, -105.0, -103.0, 152.0],
    [-153.0, -66.0, 117.0, -25.0, -132.0, 119.0],
    [36.0, -75.0, 98.0, -98.0, -71.0, 52.0],
    [-16.0, -103.0, 131.0, -173.0, -104.0, 62.0],
    [61.0, -6.0, -36.0, -26.0, -59.0, -117.0],
    [-143.0, -82.0, -51.0, 134.0, -146.0, 129.0],
    [26.0, -70.0, 99.0, -30.0, -27.0, -6.0],
    [-101.0, -83.0, -118.0, 159.0, -67.0, -13.0],
    [1.0, 134.0, 122.0, -50.0, -157.0, -17.0],
    [7.0, -29.0, 51.0, -92.0, 131.0, -36.0],
    [-23.0, 0.0, -27.0, -48.0, -149.0, 38.0],
    [-163.0, -178.0, 25.0, -122.0, 50.0, -9.0],
    [-133.0, -51.0, 29.0, 88.0, 142.0, 32.0],
    [2.0, 123.0, 129.0, 166.0, -42.0, 0.0],
    [-55.0, 156.0, 100.0, 69.0, 102.0, -118.0],
    [83.0, 0.0, -29.0, -133.0, -44.0, -155.0],
];

/// The parameters of a link.
const OF_LINK: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

/// A scenario of all zeros and links beside compliances.
fn scenario(prior: Option<&str>) -> String {
    let zeros = UR10_JOINTS.map(|joint| format!("\"{joint}.zero\""));
    let links = (1..=UR10_JOINTS.len())
        .flat_map(|link| OF_LINK.map(|key| format!("\"link_{link}.{key}\"")));
    let geometry: Vec<String> = zeros.into_iter().chain(links).collect();
    let wanted = format!("\"wrist_3\", {}]", geometry.join(", "));
    with_prior(&plain().replacen("\"wrist_3\"]", &wanted, 1), prior)
}

/// A scenario of compliances alone.
fn plain() -> String {
    let text = absolute_scenario_text("ur10") + HIDDEN;
    let text = text.replacen("tool_height_min_mm = 300", "tool_height_min_mm = 200", 1);
    text.replacen("tool_radius_min_mm = 400", "tool_radius_min_mm = 300", 1)
}

/// The same of deflections.
fn of_deflections(prior: Option<&str>) -> String {
    let text = plain().replace("accuracy = \"absolute\"\n", "");
    let (text, _) = text.split_once("[[station]]").expect("stations");
    with_prior(text, prior)
}

fn with_prior(text: &str, prior: Option<&str>) -> String {
    let Some(file) = prior else {
        return text.to_owned();
    };
    text.replacen(
        "\nparameters = ",
        &format!("\nprior = \"{file}\"\nparameters = "),
        1,
    )
}

/// A plan of deflections, or one that reads a target from a station.
fn plan(poses: &[[f64; 6]], read: Option<[&str; 2]>) -> String {
    let columns = read.map_or("", |_| ",target,station");
    let mut text = format!(
        "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats{columns}\n"
    );
    for (index, pose) in poses.iter().enumerate() {
        // Where loads hang, the reflector's readings say; the spindle's are of the bare robot.
        let is_loaded = read.is_none_or(|[target, _]| target == "reflector" && index % 3 != 2);
        let force = if is_loaded { -98 } else { 0 };
        let angles = pose.map(|angle| angle.to_string()).join(",");
        let read = read.map_or_else(String::new, |read| format!(",{}", read.join(",")));
        text += &format!("{angles},0,0,{force},0,0,0,1{read}\n");
    }
    text
}

/// A folder with the readings and plans of two campaigns of one virtual robot: the reflector from the door, then the spindle from the wall.
fn measured(run: u64) -> Workplace {
    let place = Workplace::with("first.toml", scenario(None));
    let (first, second) = POSES.split_at(20);
    let of = |poses, at| plan(poses, Some(at));
    place.write("p0.csv", of(first, ["reflector", "door"]));
    place.write("p1.csv", of(second, ["spindle", "wall"]));
    for campaign in 0..2 {
        let arguments = format!(
            "measure first.toml --plan p{campaign}.csv --run {run} --campaign {campaign} --measurements-out m{campaign}.csv"
        );
        place.done(&arguments);
    }
    place
}

fn both(place: &Workplace, files: [&str; 2]) -> String {
    let [one, other] = files.map(|file| place.read(file));
    let rows = |text: &str| -> Vec<String> {
        let rows = text.lines().filter(|line| !line.starts_with('#'));
        let is_loaded = text.contains("fx_n");
        // Loads stand behind the six angles; a table without any has no columns for them.
        let with_loads = |row: &str| {
            let (angles, others) = row.split_at(row.match_indices(',').nth(5).expect("six").0);
            let header = "fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm";
            let loads = [header, "0,0,0,0,0,0"][usize::from(!row.starts_with('q'))];
            format!("{angles},{loads}{others}")
        };
        let row = |row: &str| [with_loads(row), row.to_owned()][usize::from(is_loaded)].clone();
        rows.map(row).collect()
    };
    let all: Vec<String> = (rows(&one).into_iter())
        .chain(rows(&other).into_iter().skip(1))
        .collect();
    all.join("\n") + "\n"
}

/// Values and standard errors of the robot's own unknowns, by name.
fn of_robot(json: &Value) -> BTreeMap<String, (f64, f64)> {
    let all = list(&json["unknowns"]).iter();
    let named = all.filter_map(|each| {
        let name = each["name"].as_str().expect("a name").to_owned();
        let error = each["standard_error"].as_f64()?;
        Some((name, (number(&each["value"]), error)))
    });
    named
        .filter(|(name, _)| !name.starts_with("base") && !name.starts_with("tool"))
        .collect()
}

/// What one campaign after the other finds is that of all readings together: what is redundant, and what
/// it is redundant with, is the same; whether the scenario or the command names what is unknown.
#[test]
fn two_campaigns_are_one_fit() {
    let place = measured(0);
    place.write("both.csv", both(&place, ["m0.csv", "m1.csv"]));
    let groups = "--parameters geometry,compliances";
    for (first, options) in [(scenario(None), ""), (plain(), groups)] {
        place.write("first.toml", &first);
        place.write("second.toml", with_prior(&first, Some("first.json")));
        let identified = |arguments: &str| {
            let allow = "--allow C0201 --json --quiet";
            let outcome = place.run(&format!("identify {arguments} {allow} {options}"));
            outcome.ends_with(0).json()
        };
        identified("first.toml --measurements m0.csv --identified-out first.json");
        let second = identified("second.toml --measurements m1.csv");
        let together = identified("first.toml --measurements both.csv");
        let names = |json: &Value| -> Vec<String> {
            let all = list(&json["left_out"]).iter();
            all.map(|each| each["name"].to_string()).collect()
        };
        assert!(names(&second).len() > 20, "{second}");
        let [mut one, mut other] = [&second, &together].map(names);
        one.sort();
        other.sort();
        assert_eq!(one, other);
        let [one, other] = [&second, &together].map(of_robot);
        assert!(one.len() > 20 && one.keys().eq(other.keys()), "{one:?}");
        for (name, (value, error)) in &one {
            let (expected, known) = other[name];
            // To first order.
            assert_alike_in(&name, *error, known, 0.02);
            let off = (value - expected) / known;
            assert!(off.abs() < 0.01, "{name}: {off} standard errors");
        }
    }
}

/// What is known after a campaign of absolute readings goes on through one of deflections to a third of absolute readings: what stayed
/// nominal is redundant there, too, and each knows no less than the one before.
#[test]
fn deflections_come_between() {
    let place = measured(1);
    place.write("deflections.toml", of_deflections(Some("first.json")));
    place.write("third.toml", scenario(Some("second.json")));
    place.write("other.toml", of_deflections(None));
    place.write("p.csv", plan(&POSES[20..26], None));
    place.json("measure other.toml --plan p.csv --run 1 --campaign 1 --measurements-out d.csv");
    let first = place.json("identify first.toml --measurements m0.csv --identified-out first.json");
    let second =
        place.json("identify deflections.toml --measurements d.csv --identified-out second.json");
    let third = place.json("identify third.toml --measurements m1.csv");
    let found = |name: &str| {
        let all = list(&second["uncertain"]).iter();
        let mut own = all.filter(|each| each["name"] == name);
        number(&own.next().expect("is there")["std"])
    };
    let [one, other] = [&first, &third].map(of_robot);
    assert!(one.keys().eq(other.keys()), "{other:?}");
    for (name, (_, error)) in &one {
        let between = match name.split_once(".compliance") {
            None => found(name),
            Some((joint, _)) => {
                let names = list(&second["parameters"]).iter();
                let place = names.enumerate().find(|each| each.1 == joint);
                number(&second["compliance_std_rad_per_nm"][place.expect("is there").0])
            }
        };
        let room = 1.0 + 1e-6;
        assert!(between < error * room, "{name}: {between} {error}");
        assert!(other[name].1 < between * room, "{name}");
        if name == "shoulder_lift.compliance" {
            assert!(between < 0.9 * error, "{between} {error}");
        }
    }
    let text = place.run("evaluate deflections.toml --plan p.csv --no-proof");
    let remark =
        "earlier identification includes the robot's other unknowns: one value in both campaigns";
    text.prints(remark);
}

/// Robots that are sampled from what is known err by as much as is predicted.
#[test]
fn errors_are_predicted() {
    let place = measured(2);
    place.json("identify first.toml --measurements m0.csv --identified-out first.json");
    let study = "\n[study]\nexperiments = 10\ntrials = 200\nlevel = \"robot\"\n[[study.plan]]\nname = \"ten\"\nkind = \"file\"\nfile = \"p1.csv\"\n";
    let shown = scenario(Some("first.json"));
    let (robot, _) = shown.split_once("\n[[uncertainty]]").expect("sources");
    let (_, stations) = HIDDEN.split_once("\n[[station]]").expect("stations");
    place.write(
        "second.toml",
        format!("{robot}\n[[station]]{stations}{study}"),
    );
    let predicted = place.json("evaluate second.toml --plan p1.csv");
    // Without it one compliance is not determined.
    let alone = place.json_with_conditions("evaluate first.toml --plan p1.csv");
    let [predicted, alone] = [predicted, alone].map(|json| number(&json["rho0_mm"]));
    assert!(predicted < 0.3 * alone, "{predicted} {alone}");
    let study = place.json("study second.toml");
    let of = |key: &str| number(&study["plans"][0][key]);
    let off = of("rms_mm") - of("predicted_rms_mm");
    assert!(off.abs() < 4.0 * of("rms_std_mm"), "{study}");
    assert!((of("coverage95") - 0.95).abs() < 0.05, "{study}");
}

#[test]
fn a_file_that_cannot_be_a_prior_is_refused() {
    let place = measured(0);
    place.json("identify first.toml --measurements m0.csv --identified-out first.json");
    place.write("second.toml", scenario(Some("first.json")));
    place.done("check second.toml");
    let good = place.read("first.json");
    let shift = "\"shift\": [";
    for (from, to, expected) in [
        (
            "\"robot_sha256\": \"",
            "\"robot_sha256\": \"0",
            "another robot",
        ),
        ("\"elbow.zero\"", "\"ellbow.zero\"", "unknowns["),
        ("elastocal.identify", "elastocal.plan", "schema.name"),
        (shift, "\"shift\": [1,", "left_out[0].shift"),
        ("\"covariance\": [", "\"covariance\": [[1],", "covariance"),
        ("{", "", "is not JSON"),
    ] {
        assert!(good.contains(from), "{from}");
        place.write("first.json", good.replacen(from, to, 1));
        let outcome = place.refused("check second.toml");
        let begins = "second.toml: robot.prior: first.json: ";
        outcome.says(begins);
        outcome.says(expected);
    }
}
