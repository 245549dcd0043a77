//! Wrong inputs: each ends with exit code 1 and one error line that says what is wrong and where,
//! and leaves nothing behind.

use crate::support::{Workplace, error_message, project, scenario_text, shipped};

/// What is wrong with how a run failed: it should end with code 1, print one `error:` line with all
/// of `says` and, where `hint` is given, one `hint:` line with that, and leave no file behind.
pub fn complaints(
    workplace: &Workplace,
    arguments: &str,
    says: &[&str],
    hint: Option<&str>,
) -> Vec<String> {
    let before = workplace.listing();
    let outcome = workplace.run(&format!("{arguments} --quiet"));
    let mut lines = outcome.stderr.lines();
    let error = lines.next().unwrap_or_default();
    let hinted = lines.next();
    let mut wrong = Vec::new();
    let mut expect = |holds: bool, what: String| {
        if !holds {
            wrong.push(format!("{what}\n  {arguments}: {}", outcome.stderr));
        }
    };
    expect(outcome.code == Some(1), "the exit code is not 1".into());
    expect(outcome.stdout.is_empty(), "stdout is not empty".into());
    expect(error_message(error).is_some(), "no error line".into());
    for part in says {
        expect(error.contains(part), format!("{part:?} is missing"));
    }
    expect(!repeats_itself(error), "a cause is printed twice".into());
    let hint_is_right = match (hint, hinted) {
        (Some(hint), Some(line)) => line.starts_with("hint: ") && line.contains(hint),
        (expected, found) => expected == found,
    };
    let names_temporary = error.contains("/.tmp");
    expect(!names_temporary, "a temporary file is named".into());
    expect(hint_is_right, format!("the hint is not {hint:?}"));
    expect(lines.next().is_none(), "more lines on stderr".into());
    let after = workplace.listing();
    expect(after == before, format!("{after:?} is left behind"));
    wrong
}

/// Whether a cause is printed with its context and once more after it.
fn repeats_itself(error: &str) -> bool {
    let mut parts: Vec<_> = error.split(": ").filter(|part| part.len() > 12).collect();
    let all = parts.len();
    parts.sort_unstable();
    parts.dedup();
    parts.len() != all
}

pub fn assert_none(complaints: &[String]) {
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

/// One edit of the paper's scenario: what is replaced, by what, what the error says, the hint.
type Edit = (
    &'static str,
    &'static str,
    &'static [&'static str],
    Option<&'static str>,
);

const Q: &str = "q_deg = [0, -56.9, 89.3, 45.1, 76, 57.2]";
const LOAD: &str = "kind = \"fixed\"\nforce_n = [0, 0, -2500]";
const PARAMETERS: &str = r#"["joint_2", "joint_3", "joint_4", "joint_5", "joint_6"]"#;

#[rustfmt::skip]
const SCENARIO_EDITS: &[Edit] = &[
    // Keys.
    ("seed = 1", "sed = 1", &["line 2", "unknown field `sed`"], Some("did you mean `seed`?")),
    ("sigma_mm", "sigma_um", &["instrument.sigma_um", "line 12", "`sigma_mm`"], Some("did you mean `sigma_mm`?")),
    ("sigma_mm = 0.03", "", &["instrument.sigma_mm", "is missing"], Some("mpe_um")),
    ("[design]\nexperiments = 3", "", &["missing field `design`"], None),
    ("kind = \"fixed\"", "kind = \"fixd\"", &["load", "`fixd`", "`fixed`, `direction`, `any`, `list`"], Some("did you mean `fixed`?")),
    ("kind = \"fixed\"", "", &["load", "missing field `kind`"], None),
    ("seed = 1", "seed = 1\nseed = 2", &["line 3", "duplicate key: `seed = 2`"], None),
    ("seed = 1", "seed = ", &["line 2"], None),
    // Obstacles.
    ("[design]", "[[obstacle]]\nname = \"a\"\nkind = \"cone\"\nposition_mm = [0, 0, 0]\n[design]", &["obstacle[0]", "`cone`", "`box`, `sphere`, `cylinder`, `capsule`"], None),
    ("[design]", "[[obstacle]]\nname = \"a\"\nkind = \"sphere\"\nposition_mm = [0, 0, 0]\n[design]", &["obstacle[0]", "missing field `radius_mm`"], None),
    ("[design]", "[[obstacle]]\nname = \"a\"\nkind = \"sphere\"\nradius_mm = -1\nposition_mm = [0, 0, 0]\n[design]", &["obstacle[0].radius_mm", "found -1", "a positive number is allowed"], None),
    ("[design]", "[[obstacle]]\nname = \"a\"\nkind = \"box\"\nradius_mm = 1\nposition_mm = [0, 0, 0]\n[design]", &["obstacle[0]", "unknown field `radius_mm`, expected `size_mm`"], None),
    ("[design]", "[[obstacle]]\nname = \"a\"\nkind = \"sphere\"\nradius_m = 1\nposition_mm = [0, 0, 0]\n[design]", &["obstacle[0]", "unknown field `radius_m`"], Some("did you mean `radius_mm`?")),
    ("[design]", "[[obstacle]]\nname = \"a\"\nkind = \"sphere\"\nradius_mm = 1\nposition_mm = [0, nan, 0]\n[design]", &["obstacle[0].position_mm", "found NaN"], None),
    ("[design]", "[[obstacle]]\nname = \"\"\nkind = \"sphere\"\nradius_mm = 1\nposition_mm = [0, 0, 0]\n[design]", &["obstacle[0].name", "a name of one line is allowed"], None),
    ("[design]", "[[obstacle]]\nname = \"a\"\nkind = \"sphere\"\nradius_mm = 1\nposition_mm = [0, 0, 0]\n[design]", &["obstacles are not checked", "region.collision_clearance_mm", "region.line_of_sight"], None),
    ("[design]", "collision_clearance_mm = 20\n[[obstacle]]\nname = \"floor\"\nkind = \"sphere\"\nradius_mm = 1\nposition_mm = [0, 0, 0]\n[design]", &["robot.model", "floor"], None),
    ("[design]", "[[uncertainty]]\nkind = \"joint_zero\"\nstd_mrad = 1\nstd_mm = 1\n[design]", &["uncertainty[0].std_mm", "none of the joints that are meant slides"], None),
    ("[region]", "[[test_pose]]\nname = \"milling\"\nq_deg = [0, -50, 80, 40, 70, 50]\nforce_n = [0, 0, -90]\n[region]", &["test_pose[1].name", "found \"milling\" twice"], None),
    // Types.
    ("seed = 1", "seed = \"one\"", &["seed", "line 2", "string \"one\"", "expected a whole number, at least 0"], None),
    ("seed = 1", "seed = -1", &["seed", "line 2", "`-1`"], None),
    ("0.03", "\"0.03\"", &["instrument.sigma_mm", "line 12", "expected a number"], None),
    ("\"deflection\"", "\"positions\"", &["instrument.sigma_of", "`positions`", "`deflection`, `position`, `distance`"], Some("did you mean `position`?")),
    ("force_n = [0, 280, -180]", "force_n = [0, 280]", &["test_pose[0].force_n"], None),
    // Numbers.
    ("0.03", "nan", &["instrument.sigma_mm", "found NaN", "positive number"], None),
    ("0.03", "inf", &["instrument.sigma_mm", "found inf", "positive number"], None),
    ("0.03", "-0.03", &["instrument.sigma_mm", "found -0.03", "positive number"], None),
    ("0.03", "0", &["instrument.sigma_mm", "found 0", "positive number"], None),
    ("0.03", "0.03\nrotation_sigma_mrad = 0", &["instrument.rotation_sigma_mrad", "found 0", "positive"], None),
    (LOAD, "kind = \"fixed\"\nforce_n = [0, 0, 0]", &["load", "a load of zero"], None),
    (LOAD, "kind = \"fixed\"\nforce_n = [0, 0, nan]", &["load.force_n", "found NaN", "finite"], None),
    (LOAD, "kind = \"direction\"\ndirection = [0, 0, 0]\nforce_max_n = 1", &["load.direction", "0, 0, 0"], None),
    (LOAD, "kind = \"direction\"\ndirection = [0, 0, 1]\nforce_min_n = 2\nforce_max_n = 1", &["load.force_min_n", "found 2", "load.force_max_n = 1"], None),
    (LOAD, "kind = \"any\"\nforce_max_n = 0", &["load.force_max_n", "found 0", "positive"], None),
    (LOAD, "kind = \"list\"\nwrenches = []", &["load.wrenches", "is empty"], None),
    (LOAD, "kind = \"list\"\nwrenches = [{ force_n = [0, 0, 0] }]", &["load.wrenches[0]", "a load of zero"], None),
    (LOAD, "kind = \"list\"\nwrenches = [{ force_n = [0, 0, -9] }, { force_n = [0, 0, -9] }]", &["load.wrenches[1]", "there twice"], None),
    ("force_n = [0, 280, -180]", "force_n = [0, 280, -180]\nweight = -1", &["test_pose[0].weight", "found -1", "positive"], None),
    ("force_n = [0, 280, -180]", "force_n = [0, inf, -180]", &["test_pose[0].force_n", "found inf", "finite"], None),
    // What does not fit the robot.
    (Q, "q_deg = [0, 12.5, 89.3, 45.1, 76, 57.2]", &["test_pose[0].q_deg", "found 12.5 for joint_2", "-146.0000 to 0.0000"], None),
    (Q, "q_deg = [0, -56.9, 89.3, 45.1, 76]", &["test_pose[0].q_deg", "found 5 numbers", "6 joints"], None),
    (Q, "q_deg = [nan, -56.9, 89.3, 45.1, 76, 57.2]", &["test_pose[0].q_deg", "found NaN", "finite"], None),
    ("machining_tcp", "milling_tcp", &["robot.machining_site", "\"milling_tcp\"", "calibration_tcp, machining_tcp"], None),
    ("sigma_of", "unloaded = \"shard\"\nsigma_of", &["instrument.unloaded", "`shard`", "`own` or `shared`"], Some("did you mean `shared`?")),
    ("sigma_of", "tracker_site = \"trakcer\"\nsigma_of", &["instrument.tracker_site", "\"trakcer\"", "tracker"], None),
    ("tool_elevation_max_deg = 30", "line_of_sight = true", &["instrument.tracker_site", "region.line_of_sight"], None),
    (PARAMETERS, "[]", &["robot.parameters", "is empty", "joint_1, joint_2"], None),
    (PARAMETERS, "[\"joint_7\"]", &["robot.parameters", "\"joint_7\"", "joint_1, joint_2"], None),
    (PARAMETERS, "[\"joint_2\", \"joint_2\"]", &["robot.parameters", "\"joint_2\" twice"], None),
    (PARAMETERS, "[\"joint_2\"]\ncompliance_rad_per_nm = [1e-6]", &["robot.compliance_rad_per_nm", "found 1 number", "6 joints"], None),
    (PARAMETERS, "[\"joint_2\"]\ncompliance_rad_per_nm = [0, 1, 1, 1, 1, -1e-6]", &["robot.compliance_rad_per_nm", "found -0.000001", "zero or a positive"], None),
    ("[instrument]", "[true_robot]\ncompliance_rad_per_nm = [nan, 0, 0, 0, 0, 0]\n[instrument]", &["true_robot.compliance_rad_per_nm", "found NaN"], None),
    // The region and the design.
    ("joint_1 = [0, 0]", "joint_9 = [0, 0]", &["region.joint_range_deg.joint_9", "found \"joint_9\"", "joint_1, joint_2"], None),
    ("joint_1 = [0, 0]", "joint_1 = [10, 0]", &["region.joint_range_deg.joint_1", "found 10 to 0", "-185.0000 to 185.0000"], None),
    ("joint_1 = [0, 0]", "joint_1 = [0, 200]", &["region.joint_range_deg.joint_1", "found 0 to 200", "-185.0000 to 185.0000"], None),
    ("tool_height_min_mm = 800", "tool_height_min_mm = nan", &["region.tool_height_min_mm", "found NaN"], None),
    ("tool_height_min_mm = 800", "tool_height_min_mm = 800\ntool_height_max_mm = 700", &["region.tool_height_min_mm", "found 800", "region.tool_height_max_mm = 700"], None),
    ("tool_elevation_max_deg = 30", "tool_elevation_max_deg = 91", &["region.tool_elevation_max_deg", "found 91"], None),
    ("tool_elevation_max_deg = 30", "collision_clearance_mm = -1", &["region.collision_clearance_mm", "found -1"], None),
    ("tool_elevation_max_deg = 30", "joint_torque_max_nm = [1, 2]", &["region.joint_torque_max_nm", "found 2 numbers", "6 joints"], None),
    ("experiments = 3", "experiments = 0", &["design.experiments", "found 0", "at least 2"], None),
    ("experiments = 3", "experiments = 3\nconfigurations = 4", &["design.configurations", "found 4", "2 to design.experiments = 3"], None),
    // Plans.
    ("name = \"klimchik2012_m3\"", "name = \"klimchik2012_m2\"", &["plan[1].name", "\"klimchik2012_m2\" twice"], None),
    ("klimchik2012_m3.csv", "missing.csv", &["plan[1].file", "missing.csv: cannot be read"], Some("relative to the scenario's folder")),
];

#[test]
fn wrong_scenarios() {
    let workplace = Workplace::new();
    let mut wrong = Vec::new();
    for (from, to, says, hint) in SCENARIO_EDITS {
        let text = scenario_text("klimchik2012");
        assert!(text.contains(from), "{from:?}");
        workplace.write("bad.toml", text.replacen(from, to, 1));
        let says = [&["bad.toml: "], *says].concat();
        wrong.extend(complaints(&workplace, "check bad.toml", &says, *hint));
    }
    assert_none(&wrong);
}

/// A model that works, and edits that break it: what is replaced, by what, what the error says.
pub const MODEL: &str = r#"<mujoco model="arm"><worldbody>
  <body name="a" pos="0 0 1"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
    <joint name="one" axis="0 0 1"/>
    <body name="b" pos="1 0 0"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
      <joint name="two" axis="0 1 0"/>
      <site name="tcp" pos="1 0 0"/>
    </body>
  </body>
  <site name="wall" pos="0 0 0"/>
</worldbody></mujoco>"#;

pub const MODEL_SCENARIO: &str = r#"
[robot]
model = "arm.xml"
calibration_site = "tcp"
machining_site = "tcp"
parameters = ["one", "two"]
compliance_rad_per_nm = [1e-6, 1e-6]
[instrument]
sigma_mm = 0.03
sigma_of = "deflection"
[[test_pose]]
q_deg = [0, 0]
force_n = [0, 0, 1]
[load]
kind = "fixed"
force_n = [0, 100, -100]
[design]
experiments = 2
"#;

#[rustfmt::skip]
const MODEL_EDITS: &[(&str, &str, &[&str])] = &[
    ("</mujoco>", "", &["robot.model", "MuJoCo refuses"]),
    (MODEL, "<mujoco/>", &["robot.model", "it has no joint"]),
    ("mass=\"1\"", "mass=\"-1\"", &["robot.model", "MuJoCo refuses"]),
    (MODEL, "this is not XML", &["robot.model", "MuJoCo refuses"]),
    (MODEL, "", &["robot.model", "empty file"]),
    (
        "axis=\"0 1 0\"",
        "axis=\"nan 1 0\"",
        &["robot.model", "<joint> \"two\"", "not a number"],
    ),
    (
        "name=\"two\"",
        "name=\"two\" type=\"ball\"",
        &["robot.model", "\"two\" is neither a hinge nor a slide"],
    ),
    (
        "<joint name=\"one\" axis=\"0 0 1\"/>",
        "<freejoint name=\"one\"/>",
        &["robot.model", "\"one\" is neither a hinge nor a slide"],
    ),
    (
        "<site name=\"wall\" pos=\"0 0 0\"/>",
        "<body><joint name=\"three\"/><geom size=\"1\"/></body>",
        &["robot.model", "\"three\" branches off"],
    ),
    (
        "name=\"tcp\"",
        "name=\"tool\"",
        &["robot.calibration_site", "\"tcp\"", "wall, tool"],
    ),
];

#[test]
fn wrong_models() {
    let workplace = Workplace::with("bad.toml", MODEL_SCENARIO);
    workplace.write("arm.xml", MODEL);
    workplace.done("check bad.toml");
    let mut wrong = Vec::new();
    for (from, to, says) in MODEL_EDITS {
        assert!(MODEL.contains(from), "{from:?}");
        workplace.write("arm.xml", MODEL.replace(from, to));
        let says = [&["bad.toml: ", "arm.xml: "], *says].concat();
        wrong.extend(complaints(&workplace, "check bad.toml", &says, None));
    }
    workplace.write("arm.xml", MODEL);
    let on_the_wall = MODEL_SCENARIO.replacen("\"tcp\"", "\"wall\"", 1);
    workplace.write("bad.toml", on_the_wall);
    let says = [
        "bad.toml: robot.calibration_site",
        "no joint moves the site \"wall\"",
    ];
    wrong.extend(complaints(&workplace, "check bad.toml", &says, None));
    workplace.write("bad.toml", MODEL_SCENARIO.replace("compliance_rad", "#"));
    let says = [
        "bad.toml: robot.compliance_rad_per_nm",
        "is missing",
        "joint \"one\"",
    ];
    wrong.extend(complaints(&workplace, "check bad.toml", &says, None));
    assert_none(&wrong);
}

pub const PLAN: &str =
    "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats
0,-90,90,10,20,30,0,0,-2500,0,0,0,1
# a comment
0,-80,80,10,20,30,0,0,-2500,0,0,0,2
";
const HEADER: &str = "the header must be: q1_deg,q2_deg";

#[rustfmt::skip]
const PLAN_EDITS: &[(&str, &str, &[&str], Option<&str>)] = &[
    (",repeats", "", &["line 1", "\"repeats\" is missing"], Some(HEADER)),
    (",repeats", ",repeat", &["line 1", "unknown column \"repeat\""], Some(HEADER)),
    (",repeats", ",repeats,repeats", &["line 1", "\"repeats\" twice"], Some(HEADER)),
    ("q1_deg", "q1_rad", &["line 1", "unknown column \"q1_rad\""], Some(HEADER)),
    (",0,2\n", ",0\n", &["line 4", "found 12 fields", "13"], None),
    (",0,2\n", ",0,2,2\n", &["line 4", "found 14 fields", "13"], Some("decimal commas?")),
    ("-80", "fourty", &["line 4", "q2_deg", "found \"fourty\"", "finite number"], None),
    ("-80", "nan", &["line 4", "q2_deg", "found \"nan\"", "finite number"], None),
    ("-80", "-inf", &["line 4", "q2_deg", "found \"-inf\"", "finite number"], None),
    ("-80", "", &["line 4", "q2_deg", "found \"\"", "finite number"], None),
    (",2\n", ",0\n", &["line 4", "repeats: found 0", "whole number from 1"], None),
    (",2\n", ",1.5\n", &["line 4", "repeats: found 1.5", "whole number from 1"], None),
    (",2\n", ",-1\n", &["line 4", "repeats: found -1", "whole number from 1"], None),
    (",2\n", ",1e9\n", &["line 4", "repeats: found 1000000000", "to 1000000"], None),
    ("0,-80,80,10,20,30,0,0,-2500", "0,-80,80,10,20,30,0,0,0", &["line 4", "load of zero"], None),
    (PLAN, "", &["is empty"], Some(HEADER)),
];

#[test]
fn wrong_plans() {
    let workplace = Workplace::with("good.toml", scenario_text("klimchik2012"));
    workplace.write("plan.csv", PLAN);
    let measure = "measure good.toml --plan plan.csv --measurements-out m.csv";
    let mut wrong = Vec::new();
    for (from, to, says, hint) in PLAN_EDITS {
        assert!(PLAN.contains(from), "{from:?}");
        workplace.write("plan.csv", PLAN.replace(from, to));
        let says = [&["plan.csv: "], *says].concat();
        for command in [
            measure,
            "evaluate good.toml --plan plan.csv",
            "check good.toml --plan plan.csv",
        ] {
            wrong.extend(complaints(&workplace, command, &says, *hint));
        }
    }
    let header = PLAN.lines().next().unwrap();
    workplace.write("plan.csv", header);
    wrong.extend(complaints(
        &workplace,
        measure,
        &["plan.csv: has no row"],
        None,
    ));
    workplace.write("plan.csv", [PLAN.as_bytes(), b"0,\xff"].concat());
    let says = ["plan.csv: line 5: is not UTF-8"];
    wrong.extend(complaints(&workplace, measure, &says, Some("UTF-8")));
    workplace.write("plan.csv", b"PK\x03\x04\x14\0\x06\0");
    let says = ["plan.csv: is a spreadsheet and no text"];
    wrong.extend(complaints(
        &workplace,
        measure,
        &says,
        Some("export it as CSV"),
    ));
    assert_none(&wrong);
}

pub const MEASUREMENTS: &str = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,dx_mm,dy_mm,dz_mm,sx_mm,sy_mm,sz_mm
0,-93.5,125,-118.7,-62.4,-168.9,0,0,-2500,0,0,0,-0.29,1.2,-5.54,0.03,0.03,0.04
0,-103.4,93.4,-147.9,105.8,93.2,0,0,-2500,0,0,0,0.17,1.15,-5.37,0.03,0.03,0.05
";

#[rustfmt::skip]
const MEASUREMENT_EDITS: &[(&str, &str, &[&str], Option<&str>)] = &[
    (",sz_mm", "", &["line 1", "\"sx_mm\", \"sy_mm\"", "come together", "\"sz_mm\""], None),
    (",sz_mm", ",sz_um", &["line 1", "unknown column \"sz_um\""], Some("dz_mm")),
    ("dx_mm,", "", &["line 1", "\"dx_mm\" is missing"], Some("dx_mm")),
    ("sx_mm,sy_mm,sz_mm", "rx_mrad,ry_mrad,rz_mrad", &["line 1", "come together", "\"srx_mrad\""], None),
    ("0.05", "0", &["line 3", "sx_mm,sy_mm,sz_mm", "found 0.03, 0.03, 0;", "positive"], None),
    ("0.05", "-1", &["line 3", "found 0.03, 0.03, -1;", "positive"], None),
    ("-5.37", "five", &["line 3", "dz_mm", "found \"five\"", "finite number"], None),
    ("-2500", "0", &["m.csv: the measurements determine none of the parameters"], None),
    // Metres instead of millimetres the wrong way round.
    (",-5.37", ",5370", &["m.csv: measurement", "with the parameters that fit so far"], Some("signs, units and frames")),
];

#[test]
fn wrong_measurements() {
    let workplace = Workplace::with("good.toml", scenario_text("klimchik2012"));
    workplace.write("m.csv", MEASUREMENTS);
    workplace.done("identify good.toml --measurements m.csv");
    let identify = "identify good.toml --measurements m.csv --identified-out i.json";
    let mut wrong = Vec::new();
    for (from, to, says, hint) in MEASUREMENT_EDITS {
        assert!(MEASUREMENTS.contains(from), "{from:?}");
        let text = MEASUREMENTS.replace(from, to);
        let short = from.ends_with("sz_mm") && to.is_empty() || *from == "dx_mm,";
        // A shorter header needs shorter rows.
        let text = if short {
            text.replace(",0.03,0.04", ",0.03")
                .replace(",0.03,0.05", ",0.03")
        } else {
            text
        };
        workplace.write("m.csv", text);
        wrong.extend(complaints(&workplace, identify, says, *hint));
    }
    assert_none(&wrong);
}

/// A robot too soft for its own weight, or for the load.
#[test]
fn robots_that_give_way() {
    let workplace = Workplace::with("plan.csv", PLAN);
    let with_compliance = |table: &str, value: &str| {
        let table = format!(
            "{table}\ncompliance_rad_per_nm = [{}]\n",
            [value; 6].join(", ")
        );
        workplace.write("soft.toml", scenario_text("klimchik2012") + &table);
    };
    let mut wrong = Vec::new();
    let measure = "measure soft.toml --plan plan.csv --measurements-out m.csv";
    with_compliance("[true_robot]", "1e-3");
    let says = ["plan.csv: experiment 1, unloaded: no static equilibrium: joint "];
    wrong.extend(complaints(&workplace, measure, &says, None));
    with_compliance("[true_robot]", "1e-4");
    let says = ["plan.csv: experiment 1, loaded: no static equilibrium: joint "];
    wrong.extend(complaints(&workplace, measure, &says, None));
    assert_none(&wrong);
}

#[test]
fn sigma_from_no_residuals() {
    let workplace = Workplace::new();
    let only_one = r#"["joint_2", "joint_3", "joint_4"]"#;
    let text = scenario_text("klimchik2012").replace(PARAMETERS, only_one);
    workplace.write("good.toml", text);
    let one: Vec<_> = MEASUREMENTS.lines().take(2).collect();
    workplace.write("m.csv", one.join("\n"));
    let identify = "identify good.toml --measurements m.csv --sigma-from-residuals";
    let says = [
        "m.csv: sigma cannot be estimated",
        "3 equations determine 3 unknowns",
    ];
    assert_none(&complaints(
        &workplace,
        identify,
        &says,
        Some("measure more"),
    ));
}

#[test]
fn more_configurations_than_measurements() {
    let workplace = Workplace::with("good.toml", scenario_text("klimchik2012"));
    let plan = "plan good.toml --experiments 2 --configurations 3";
    let says = ["good.toml: --configurations: found 3; at most 2"];
    assert_none(&complaints(&workplace, plan, &says, None));
}

#[test]
fn wrong_identifications() {
    let workplace = Workplace::with("good.toml", scenario_text("klimchik2012"));
    workplace.write("m.csv", MEASUREMENTS);
    workplace.done("identify good.toml --measurements m.csv --identified-out good.json");
    let good = workplace.read("good.json");
    let first_row = good.find("\"covariance").expect("is there");
    let first_row = &good[first_row..first_row + good[first_row..].find("],").expect("ends") + 2];
    #[rustfmt::skip]
    let edits: &[(&str, &str, &[&str], Option<&str>)] = &[
        (&good, "", &["i.json: ", "line 1"], Some("--identified-out")),
        (&good, "[1, 2]", &["i.json: "], Some("--identified-out")),
        (&good, "{\"parameters\": [\"joint_2\"]}", &["i.json: schema.name: is not a results file of elastocal"], Some("--identified-out")),
        (&good, "{\"schema\": {\"name\": \"elastocal.identify\", \"version\": 2}, \"parameters\": [\"joint_2\"]}", &["i.json: ", "missing field `method`"], Some("--identified-out")),
        (&good[good.len() / 2..], "", &["i.json: ", "line"], Some("--identified-out")),
        ("\"rank\": 5", "\"rank\": \"five\"", &["i.json: ", "rank", "line", "string \"five\""], Some("--identified-out")),
        ("joint_6", "joint_1", &["i.json: parameters: found joint_2", "joint_5, joint_1;", "joint_5, joint_6"], None),
        (first_row, "\"covariance_rad2_per_n2m2\": [", &["i.json: covariance_rad2_per_n2m2: found 4", "5 parameters"], None),
    ];
    let mut wrong = Vec::new();
    for (from, to, says, hint) in edits {
        assert!(good.contains(from), "{from:?}");
        workplace.write("i.json", good.replacen(from, to, 1));
        let compensate = "compensate good.toml --identified i.json";
        wrong.extend(complaints(&workplace, compensate, says, *hint));
    }
    assert_none(&wrong);
}

/// Each place where a file is read: missing, a folder, not UTF-8.
#[test]
fn files_that_cannot_be_read() {
    let workplace = Workplace::with("good.toml", scenario_text("klimchik2012"));
    std::fs::create_dir(workplace.path("folder")).expect("can be made");
    workplace.write("latin1", b"# sch\xf6n\n");
    let model = project("models/kr270.xml");
    for (file, wrong) in [
        ("m_missing", "missing.xml"),
        ("m_folder", "folder"),
        ("m_latin1", "latin1"),
    ] {
        let text = scenario_text("klimchik2012").replace(&*model.to_string_lossy(), wrong);
        workplace.write(&format!("{file}.toml"), text);
    }
    let mut wrong = Vec::new();
    for (file, says, hint) in [
        ("missing", "missing: cannot be read: No such file", None),
        ("folder", "folder: is a folder", None),
        ("latin1", "latin1: line 1: is not UTF-8", Some("UTF-8")),
    ] {
        for command in [
            format!("check {file}"),
            format!("run {file}"),
            format!("evaluate good.toml --plan {file}"),
            format!("measure good.toml --plan {file}"),
            format!("identify good.toml --measurements {file}"),
            format!("compensate good.toml --identified {file}"),
        ] {
            let scenario_is_missing = file == "missing" && !command.contains("--");
            let hint = hint.or(scenario_is_missing.then_some("path of a scenario file"));
            wrong.extend(complaints(&workplace, &command, &[says], hint));
        }
    }
    for (command, says, hint) in [
        (
            "check m_missing.toml",
            ["m_missing.toml: robot.model", "missing.xml: cannot be read"],
            Some("relative to the scenario"),
        ),
        (
            "check m_folder.toml",
            ["m_folder.toml: robot.model", "folder: is a folder"],
            None,
        ),
        (
            "check m_latin1.toml",
            ["m_latin1.toml: robot.model", "latin1: line 1: is not UTF-8"],
            Some("UTF-8"),
        ),
    ] {
        wrong.extend(complaints(&workplace, command, &says, hint));
    }
    assert_none(&wrong);
}

/// Each place where a file is written: the folder is missing, is a file, or allows no writing even
/// to the superuser; the file is a folder.
#[test]
fn places_that_cannot_be_written() {
    let workplace = Workplace::with("good.toml", scenario_text("klimchik2012"));
    workplace.write("m.csv", MEASUREMENTS);
    workplace.write("file", "");
    std::fs::create_dir_all(workplace.path("folder/good")).expect("can be made");
    let plan = shipped("scenarios/plans/klimchik2012_m2.csv");
    let mut wrong = Vec::new();
    for place in ["missing/x", "file/x", "/proc/x", "folder"] {
        for command in [
            format!("plan good.toml --experiments 2 --plan-out {place}"),
            format!("measure good.toml --plan {plan} --measurements-out {place}"),
            format!("identify good.toml --measurements m.csv --identified-out {place}"),
        ] {
            let says = [place, "cannot be written"];
            wrong.extend(complaints(
                &workplace,
                &command,
                &says,
                Some("where you may write"),
            ));
        }
    }
    let outcome = workplace.run("plan good.toml --plan-out missing/x");
    outcome.does_not_say("designing");
    for place in ["file", "file/x", "/proc/x"] {
        let command = format!("run good.toml --out {place}");
        let says = [place, "cannot be made a folder"];
        wrong.extend(complaints(&workplace, &command, &says, Some("--out")));
    }
    assert_none(&wrong);
}

/// Wrong usage is for clap: exit code 2, and nothing on stdout.
#[test]
fn wrong_usage() {
    let workplace = Workplace::with("good.toml", scenario_text("klimchik2012"));
    for arguments in [
        "",
        "calibrate good.toml",
        "check good.toml --sed 1",
        "check good.toml --seed one",
        "check good.toml --seed -1",
        "check good.toml --threads 0",
        "plan good.toml --experiments 0",
        "plan good.toml --criterion best",
        "evaluate good.toml",
        "identify good.toml --measurements m.csv --method best",
    ] {
        let outcome = workplace.misused(arguments);
        assert_eq!(outcome.stdout, "", "{outcome:#?}");
        // Without arguments it is the help.
        let says = if arguments.is_empty() {
            "Usage: "
        } else {
            "error E0902: "
        };
        outcome.says(says);
    }
    assert_eq!(workplace.listing(), ["good.toml"]);
}
