//! Inputs that are well formed and cannot be: surplus numbers, forces of 1e308 N, negative variances,
//! names that command a terminal. Each is one error that names the place, before any work.

use elastocal::scenario::Scenario;

use crate::bad_input::{MEASUREMENTS, PLAN, assert_none, complaints};
use crate::support::{Workplace, number, scenario_text};

const LOAD: &str = "kind = \"fixed\"\nforce_n = [0, 0, -2500]";
const FORCE: &str = "force_n = [0, 280, -180]";
const BOX: &str = "[design]\nexperiments = 3\n\n[[obstacle]]\nname = \"box\"\nkind = \"box\"\nsize_mm = [10, 10, 10]\nposition_mm = [0, 0, 0]\nrpy_deg = [0, 0, 0]";

/// The paper's scenario with an obstacle, so that it has an array of every kind.
fn scenario() -> String {
    let text = scenario_text("klimchik2012");
    text.replace("[design]\nexperiments = 3", BOX).replace(
        "tool_elevation_max_deg = 30",
        "tool_elevation_max_deg = 30\ncollision_clearance_mm = 0",
    )
}

#[rustfmt::skip]
const SCENARIO_EDITS: &[(&str, &str, &[&str])] = &[
    // Surplus and missing numbers.
    (FORCE, "force_n = [0, 0, 0, -180]", &["test_pose[0].force_n", "found 4 numbers; 3 are allowed"]),
    (FORCE, "force_n = [0, 280]", &["test_pose[0].force_n", "found 2 numbers; 3 are allowed"]),
    (FORCE, "force_n = [0, 280, -180]\ntorque_nm = [0, 0, 0, 1]", &["test_pose[0].torque_nm", "found 4 numbers; 3 are allowed"]),
    (LOAD, "kind = \"fixed\"\nforce_n = [0, 0, 0, -2500]", &["load.force_n", "found 4 numbers; 3 are allowed"]),
    (LOAD, "kind = \"fixed\"\nforce_n = [0, 0, 1]\ntorque_nm = []", &["load.torque_nm", "found 0 numbers; 3 are allowed"]),
    (LOAD, "kind = \"direction\"\ndirection = [0, 0, 1, 0]\nforce_max_n = 1", &["load.direction", "found 4 numbers; 3 are allowed"]),
    (LOAD, "kind = \"list\"\nwrenches = [{ force_n = [0, 0, 1, 0] }]", &["load.wrenches[0].force_n", "found 4 numbers; 3 are allowed"]),
    ("size_mm = [10, 10, 10]", "size_mm = [10, 10, 10, 10]", &["obstacle[0].size_mm", "found 4 numbers; 3 are allowed"]),
    ("position_mm = [0, 0, 0]", "position_mm = [0, 0, 0, 0]", &["obstacle[0].position_mm", "found 4 numbers; 3 are allowed"]),
    ("rpy_deg = [0, 0, 0]", "rpy_deg = [0, 0, 0, 0]", &["obstacle[0].rpy_deg", "found 4 numbers; 3 are allowed"]),
    ("joint_1 = [0, 0]", "joint_1 = [0, 0, 0]", &["region.joint_range_deg.joint_1", "found 3 numbers; 2 are allowed"]),
    // Numbers beyond any robot.
    (FORCE, "force_n = [0, 1e308, 0]", &["test_pose[0].force_n", "found 1e308", "up to 1e8 N"]),
    (FORCE, "force_n = [0, 1e-308, 0]", &["test_pose[0]", "found a load of at most 1e-308 N", "at least 1e-6"]),
    (FORCE, "force_n = [0, 280, -180]\ntorque_nm = [0, -1e9, 0]", &["test_pose[0].torque_nm", "found -1e9", "up to 1e8 N m"]),
    (FORCE, "force_n = [0, 280, -180]\nweight = 1e308", &["test_pose[0].weight", "found 1e308", "from 1e-9 to 1e9"]),
    (LOAD, "kind = \"fixed\"\nforce_n = [0, 0, -1e308]", &["load.force_n", "found -1e308", "up to 1e8 N"]),
    (LOAD, "kind = \"fixed\"\nforce_n = [0, 0, -1e-308]", &["load", "found a load of at most 1e-308 N"]),
    (LOAD, "kind = \"any\"\nforce_max_n = 1e308", &["load.force_max_n", "found 1e308", "from 0.000001 to 1e8 N"]),
    (LOAD, "kind = \"any\"\nforce_max_n = 1e-308", &["load.force_max_n", "found 1e-308", "from 0.000001 to 1e8 N"]),
    (LOAD, "kind = \"direction\"\ndirection = [0, 0, 1e308]\nforce_max_n = 1", &["load.direction", "found 1e308"]),
    ("sigma_mm = 0.03", "sigma_mm = 1e308", &["instrument.sigma_mm", "found 1e308", "from 1e-9 to 10000 mm"]),
    ("sigma_mm = 0.03", "sigma_mm = 1e-308", &["instrument.sigma_mm", "found 1e-308", "from 1e-9 to 10000 mm"]),
    ("sigma_mm = 0.03", "sigma_mm = 0.03\nrotation_sigma_mrad = 1e-308", &["instrument.rotation_sigma_mrad", "found 1e-308"]),
    ("size_mm = [10, 10, 10]", "size_mm = [10, 10, 1e-300]", &["obstacle[0].size_mm", "found 1e-300", "from 0.001 to 1000000 mm"]),
    ("position_mm = [0, 0, 0]", "position_mm = [0, 1e300, 0]", &["obstacle[0].position_mm", "found 1e300", "mm in size"]),
    ("rpy_deg = [0, 0, 0]", "rpy_deg = [0, 1e300, 0]", &["obstacle[0].rpy_deg", "found 1e300", "deg in size"]),
    ("tool_height_min_mm = 800", "tool_height_min_mm = 1e300", &["region.tool_height_min_mm", "found 1e300"]),
    ("collision_clearance_mm = 0", "collision_clearance_mm = 1e300", &["region.collision_clearance_mm", "found 1e300"]),
    ("[instrument]", "compliance_rad_per_nm = [0, 1e-6, 1e-6, 1e-6, 1e-6, 1e300]\n[instrument]", &["robot.compliance_rad_per_nm", "found 1e300", "rad/(N m)"]),
    ("[instrument]", "[true_robot]\ncompliance_rad_per_nm = [0, 1e-6, 1e-6, 1e-6, 1e-6, 1e-300]\n[instrument]", &["true_robot.compliance_rad_per_nm", "found 1e-300"]),
    ("[instrument]", "[study.sweep]\nsigma_mm = [0.01, 1e300]\n[instrument]", &["study.sweep.sigma_mm", "found 1e300"]),
    ("[instrument]", "[study.sweep]\nload_scale = [1, 1e300]\n[instrument]", &["study.sweep.load_scale", "found 1e300"]),
    ("[study]", "[study]\ncompliance_spread = 1e300", &["study.compliance_spread", "found 1e300"]),
    ("rho0 = { relative = 0.001", "rho0 = { relative = 1e308", &["gate.rho0.relative", "found 1e308"]),
    // A test pose without a load, which has nothing to compensate.
    (FORCE, "force_n = [0, 0, 0]", &["test_pose[0]", "found a load of zero"]),
    // Names.
    ("calibration_site = \"calibration_tcp\"", r#"calibration_site = "\u0000""#, &["robot.calibration_site", "found \"\\0\""]),
    ("calibration_site = \"calibration_tcp\"", r#"calibration_site = "tcp\u0000""#, &["robot.calibration_site", "found \"tcp\\0\""]),
    ("parameters = [\"joint_2\"", r#"parameters = ["\u001b[31mjoint_2""#, &["robot.parameters[0]", r#"found "\u{1b}[31mjoint_2""#]),
    ("name = \"klimchik2012_m2\"", r#"name = "\u001b]0;title\u0007""#, &["plan[0].name", r"\u{1b}]0;title\u{7}"]),
    ("name = \"klimchik2012_m2\"", "name = \"two\\nlines\"", &["plan[0].name", "a name of one line"]),
    ("name = \"milling\"", "name = \"\\u009b2J\"", &["test_pose[0].name", r"\u{9b}2J"]),
    ("joint_1 = [0, 0]", r#""joint\u001b" = [0, 0]"#, &["region.joint_range_deg.joint\\u{1b}", "a name of one line"]),
    ("name = \"box\"", "name = \"\\u202ebox\"", &["obstacle[0].name", r"\u{202e}"]),
    ("description = \"", "description = \"\\u001b[2J", &["description", "without control characters"]),
];

#[test]
fn scenarios() {
    let workplace = Workplace::with("bad.toml", scenario());
    workplace.done("check bad.toml");
    let mut wrong = Vec::new();
    for (from, to, says) in SCENARIO_EDITS {
        let text = scenario();
        assert!(text.contains(from), "{from:?}");
        workplace.write("bad.toml", text.replacen(from, to, 1));
        let says = [&["bad.toml: "], *says].concat();
        let is_faint = says.iter().any(|part| part.contains("a load of"));
        let hint = if is_faint && from == &FORCE {
            Some("the forces of the process")
        } else {
            to.contains("_spread").then_some("by about 10 %")
        };
        wrong.extend(complaints(&workplace, "check bad.toml", &says, hint));
    }
    assert_none(&wrong);
}

/// Small components that rounding leaves are no implausible loads.
#[test]
fn rounding_is_plausible() {
    let workplace = Workplace::new();
    let rounded = "kind = \"fixed\"\nforce_n = [1.5e-13, 0, -2500]";
    workplace.write(
        "s.toml",
        scenario_text("klimchik2012").replace(LOAD, rounded),
    );
    workplace.write("plan.csv", PLAN.replace("0,0,-2500", "-3e-14,0,-2500"));
    // The plan points the tool too high.
    workplace.doubted("check s.toml --plan plan.csv");
}

#[rustfmt::skip]
const PLAN_EDITS: &[(&str, &str, &[&str])] = &[
    ("-80", "1e308", &["line 4", "q2_deg: found 1e308", "up to 100000 deg"]),
    ("0,-80,80,10,20,30,0,0,-2500", "0,-80,80,10,20,30,0,0,-1e308", &["line 4", "fz_n: found -1e308", "up to 1e8 N"]),
    ("0,-80,80,10,20,30,0,0,-2500", "0,-80,80,10,20,30,0,0,-1e-308", &["line 4", "found a load of at most 1e-308 N"]),
];

#[rustfmt::skip]
const MEASUREMENT_EDITS: &[(&str, &str, &[&str])] = &[
    ("-5.37", "1e308", &["line 3", "dz_mm: found 1e308", "mm in size"]),
    ("0.05", "1e-308", &["line 3", "sx_mm,sy_mm,sz_mm", "found 0.03, 0.03, 1e-308", "from 1e-9"]),
    ("0.05", "1e5", &["line 3", "found 0.03, 0.03, 100000", "to 10000 mm"]),
    ("93.2,0,0,-2500", "93.2,0,0,1e308", &["line 3", "fz_n: found 1e308"]),
    ("93.2,0,0,-2500", "93.2,0,0,1e-308", &["line 3", "found a load of at most 1e-308 N"]),
];

#[test]
fn tables() {
    let workplace = Workplace::with("good.toml", scenario_text("klimchik2012"));
    let mut wrong = Vec::new();
    for (from, to, says) in PLAN_EDITS {
        assert!(PLAN.contains(from), "{from:?}");
        workplace.write("plan.csv", PLAN.replacen(from, to, 1));
        let command = "evaluate good.toml --plan plan.csv";
        wrong.extend(complaints(&workplace, command, says, None));
    }
    for (from, to, says) in MEASUREMENT_EDITS {
        assert!(MEASUREMENTS.contains(from), "{from:?}");
        workplace.write("m.csv", MEASUREMENTS.replacen(from, to, 1));
        let command = "identify good.toml --measurements m.csv";
        wrong.extend(complaints(&workplace, command, says, None));
    }
    assert_none(&wrong);
}

/// Numbers that no identification gives.
#[test]
fn identifications() {
    let workplace = Workplace::with("good.toml", scenario_text("klimchik2012"));
    workplace.write("m.csv", MEASUREMENTS);
    workplace.done("identify good.toml --measurements m.csv --identified-out good.json");
    let good = workplace.parsed("good.json");
    let covariance = "covariance_rad2_per_n2m2";
    let variance = number(&good[covariance][1][1]);
    let mut wrong = Vec::new();
    for (key, index, value, says) in [
        ("compliance_rad_per_nm", None, 1e300, "joint_3: found 1e300"),
        (covariance, Some(1), -variance, "[1][1]: found -"),
        (covariance, Some(1), 1e300, "[1][1]: found 1e300"),
        (covariance, Some(2), 1.0, "with these variances at most"),
        (
            covariance,
            Some(2),
            variance / 10.0,
            "a covariance is symmetric",
        ),
    ] {
        let mut bad = good.clone();
        match index {
            None => bad[key][1] = value.into(),
            Some(column) => bad[key][1][column] = value.into(),
        }
        workplace.write("i.json", bad.to_string());
        let command = "compensate good.toml --identified i.json";
        let place = format!("i.json: {key}");
        let hint = index.is_none().then_some("robot.parameters");
        wrong.extend(complaints(&workplace, command, &[&place, says], hint));
    }
    assert_none(&wrong);
}

/// Where the robot has no equilibrium, that is what is said, and no number.
#[test]
fn no_equilibrium_has_no_number() {
    let workplace = Workplace::new();
    let soft = "compliance_rad_per_nm = [1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3]\n[instrument]";
    workplace.write("s.toml", scenario().replace("[instrument]", soft));
    workplace.write("plan.csv", PLAN);
    let outcome = workplace.doubted("check s.toml --plan plan.csv");
    outcome.prints("experiment 1: no static equilibrium");
    assert!(!outcome.stdout.contains("NaN"), "{outcome:#?}");
    let outcome = workplace.doubted("check s.toml --plan plan.csv --json");
    assert!(!outcome.stdout.contains("NaN"), "{outcome:#?}");
}

/// Every number of a scenario made absurd, one at a time: an error, or a scenario of plausible numbers.
#[test]
fn mutated_scenarios() {
    let workplace = Workplace::new();
    let text = scenario();
    let text = text.lines().filter(|line| !line.starts_with('#'));
    let text = text.collect::<Vec<_>>().join("\n");
    let is_number = |each: char| each.is_ascii_digit() || ".-".contains(each);
    let mut accepted = 0;
    let mut tried = 0;
    for (start, _) in text.char_indices() {
        let before = text[..start].chars().next_back().unwrap_or('\n');
        let end = text[start..]
            .find(|each| !is_number(each))
            .map_or(text.len(), |length| start + length);
        if end == start || !" [".contains(before) || text[start..end].parse::<f64>().is_err() {
            continue;
        }
        for value in [
            "1e308",
            "-1e308",
            "1e-308",
            "nan",
            "-inf",
            "0",
            "1000000000000",
        ] {
            tried += 1;
            let bad = format!("{}{value}{}", &text[..start], &text[end..]);
            workplace.write("bad.toml", bad);
            let Ok(scenario) = Scenario::load(&workplace.path("bad.toml")) else {
                continue;
            };
            accepted += 1;
            let sizes = scenario
                .task
                .test_poses
                .iter()
                .map(|pose| pose.load.wrench().amax());
            assert!(sizes.into_iter().all(|size| (1e-6..=1e8).contains(&size)));
            assert!((1e-12..=20.0).contains(&scenario.task.belief.instrument.sigma_m));
            let ranges = scenario.task.region.joint_range_rad.iter().flatten();
            assert!(ranges.into_iter().all(|angle| angle.abs() < 1e4));
        }
    }
    assert!(tried > 200 && accepted < tried / 2, "{accepted} of {tried}");
}
