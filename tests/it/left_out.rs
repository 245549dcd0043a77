//! What a proof of a bound knows of uncertainties, and what it takes for certain by name.

use serde_json::Value;

use crate::proofs::{checked, python};
use crate::support::{Workplace, number, scenario_text, shipped};

const RETURN: &str = "[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.05\n";
const DIRECTION: &str = "[[uncertainty]]\nkind = \"load_direction\"\nstd_mrad = 2\n";
const POINT: &str = "[[uncertainty]]\nkind = \"load_point\"\nstd_mm = 2\n";
const MISFIT: &str = "[[uncertainty]]\nkind = \"discrepancy\"\nstd_mm = 0.02\n";
const GEAR: &str = "[[uncertainty]]\nkind = \"transmission_error\"\nstd_mrad = 0.1\n";
const PLACES: &str = "[[uncertainty]]\nkind = \"link_position\"\nstd_mm = 0.3\n";
const WAVES: &str = "[[uncertainty]]\nkind = \"transmission_error\"\nname = \"waves\"\nstd_mrad = 0.3\nharmonics = [1, 40]\n";

/// What `plan` says of a scenario with these uncertainties.
fn planned(workplace: &Workplace, name: &str, list: &[&str], options: &str) -> Value {
    let text = scenario_text(name) + "\n" + &list.join("\n");
    workplace.write("uncertain.toml", text);
    let arguments =
        format!("plan uncertain.toml --experiments 3 --json --quiet --seed 1 {options}");
    let outcome = workplace.done(&arguments);
    serde_json::from_str(&outcome.stdout).expect("JSON")
}

fn names(value: &Value) -> Vec<&str> {
    let names = value.as_array().expect("a list").iter();
    names.map(|name| name.as_str().expect("a name")).collect()
}

/// Joints that return as they like and loads that hang as they like are proved with all that they do: the bound is near
/// that of searches, and far above that of the noise alone; another program checks it.
#[test]
fn the_covariance_of_readings_is_in_the_proof() {
    let workplace = Workplace::new();
    let list = [RETURN, DIRECTION, POINT, MISFIT];
    let whole = planned(
        &workplace,
        "planar_3r",
        &list,
        "--prove 1% --proof-out proof.json",
    );
    assert_eq!(whole["proof"]["left_out"], serde_json::json!([]));
    let proved = number(&whole["proved_lower_bound_rho0_mm"]);
    let evidence = number(&whole["lower_bound_rho0_mm"]);
    assert!(proved <= evidence * (1.0 + 1e-9) && proved > 0.98 * evidence);
    let alone = planned(&workplace, "planar_3r", &list, "--noise-only");
    assert!(proved > 1.5 * number(&alone["proved_lower_bound_rho0_mm"]));
    let Some(python) = python() else { return };
    let (code, text) = checked(&python, &workplace.path("proof.json"));
    assert_eq!(code, Some(0), "{text}");
    // With less noise an experiment would tell more.
    let mut file = workplace.parsed("proof.json");
    let mut less = file.clone();
    let everywhere = &mut less["proof"]["question"]["spread"]["everywhere"];
    *everywhere = serde_json::json!(number(everywhere) * 0.5);
    workplace.write("less.json", less.to_string());
    let (code, text) = checked(&python, &workplace.path("less.json"));
    assert_eq!(code, Some(1), "{text}");
    let returns = &mut file["proof"]["question"]["spread"]["joint_repeatability"];
    for deviation in returns.as_array_mut().expect("one for each joint") {
        *deviation = serde_json::json!(number(deviation) * 0.9);
    }
    workplace.write("less.json", file.to_string());
    let (code, text) = checked(&python, &workplace.path("less.json"));
    assert_eq!(code, Some(1), "{text}");
}

/// Joints that return as they like take a fifth of the boxes that they took while their columns were not told apart from the
/// torques.
#[test]
fn joint_repeatabilitys_take_few_boxes() {
    let workplace = Workplace::new();
    let text = scenario_text("klimchik2012");
    let (text, _) = text.split_once("\n[[plan]]").expect("it lists plans");
    workplace.write("uncertain.toml", format!("{text}\n{RETURN}"));
    let plan = shipped("scenarios/plans/klimchik2012_m3.csv");
    let arguments = format!("evaluate uncertain.toml --plan {plan} --json --quiet --prove 300%");
    let json = workplace.run(&arguments).json();
    let boxes = json["proof"]["boxes"].as_u64().expect("a number");
    assert!(boxes < 30_000, "{boxes}");
    assert_eq!(json["proof"]["left_out"], serde_json::json!([]));
}

/// What the proof does not know is named, in words and in JSON, and only makes it less near.
#[test]
fn what_is_left_out_is_named() {
    let workplace = Workplace::new();
    let list = [RETURN, GEAR, PLACES];
    let whole = planned(&workplace, "planar_3r", &list, "");
    assert_eq!(
        names(&whole["proof"]["left_out"]),
        ["link_position", "transmission_error"]
    );
    assert_eq!(whole["bound_kind"], "evidence");
    let proved = number(&whole["proved_lower_bound_rho0_mm"]);
    assert!(proved < number(&whole["rho0_mm"]));
    let words = workplace.run("plan uncertain.toml --experiments 3 --quiet --seed 1");
    let told = ", with link_position, transmission_error assumed exact";
    words.prints(told);
    // Under a force of any direction the covariance of readings is left out, too.
    let any = planned(&workplace, "spatial_3r", &[RETURN, PLACES, WAVES], "");
    assert_eq!(
        names(&any["proof"]["left_out"]),
        ["link_position", "waves", "joint_repeatability"]
    );
    assert!(number(&any["proved_lower_bound_rho0_mm"]) < number(&any["rho0_mm"]));
}

/// Compliances of which something is known before, identified or not, are in the proof with what is known: without that
/// an identified one would make the bound too high.
#[test]
fn what_is_known_of_compliances_is_in_the_proof() {
    let workplace = Workplace::new();
    let compliance = |joints: &str, share: f64| {
        format!(
            "[[uncertainty]]\nkind = \"compliance\"\nname = \"{joints}\"\njoints = [\"{joints}\"]\n\
             std_relative = {share}\n"
        )
    };
    let (known, unknown) = (compliance("joint_2", 0.001), compliance("joint_1", 0.05));
    let whole = planned(&workplace, "klimchik2012", &[&known, &unknown], "");
    assert_eq!(whole["proof"]["left_out"], serde_json::json!([]));
    let proved = number(&whole["proved_lower_bound_rho0_mm"]);
    let rho0 = number(&whole["rho0_mm"]);
    assert!(proved < rho0 && proved > 0.85 * rho0, "{proved} {rho0}");
    let searched = planned(
        &workplace,
        "klimchik2012",
        &[&known, &unknown],
        "--no-proof",
    );
    let evidence = number(&searched["lower_bound_rho0_mm"]);
    assert!(proved <= evidence * (1.0 + 1e-6) && proved > 0.99 * evidence);
}

const GANTRY: &str = r#"<mujoco>
  <compiler angle="radian" autolimits="true"/>
  <worldbody>
    <body pos="0 0 2"><inertial pos="0 0 0" mass="100" diaginertia="1 1 1"/>
      <joint name="x" type="slide" axis="1 0 0" range="0 2"/>
      <body><inertial pos="0 0 0" mass="60" diaginertia="1 1 1"/>
        <joint name="roll" axis="1 0 0" stiffness="2e6"/>
        <joint name="pitch" axis="0 1 0" stiffness="3e6"/>
        <body pos="0 0.2 -0.2"><inertial pos="0 0 -0.4" mass="40" diaginertia="1 1 1"/>
          <joint name="z" type="slide" axis="0 0 -1" range="0 0.9"/>
          <body pos="0 0 -0.9"><inertial pos="0 0 -0.05" mass="10" diaginertia="1 1 1"/>
            <joint name="c" axis="0 0 1" range="-3 3"/>
            <body pos="0 0 -0.1"><inertial pos="0 0.03 -0.08" mass="8" diaginertia="1 1 1"/>
              <joint name="a" axis="1 0 0" range="-1.7 1.7"/>
              <site name="reflector" pos="0.15 0.02 -0.21"/>
              <site name="spindle" pos="0.02 0 -0.4"/>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position joint="x" kp="3e6"/><position joint="z" kp="2e6"/><position joint="c" kp="90000"/><position joint="a" kp="60000"/>
  </actuator>
</mujoco>"#;
const GANTRY_SCENARIO: &str = r#"seed = 11
[robot]
model = "arm.xml"
calibration_site = "reflector"
machining_site = "spindle"
parameters = ["x", "roll", "pitch", "z", "c", "a"]
[instrument]
sigma_mm = 0.01
sigma_of = "deflection"
[[test_pose]]
q_deg = [500, 500, 40, 50]
force_n = [200, -160, 180]
[load]
kind = "list"
wrenches = [{ force_n = [0, 0, -600] }, { force_n = [400, 0, 0] }, { force_n = [0, 400, 0], torque_nm = [0, 0, 10] }]
[region]
[design]
experiments = 3
[[uncertainty]]
kind = "backlash"
joints = ["c", "a"]
std_arcsec = 20
turned_over_at_nm = 20
[[uncertainty]]
kind = "backlash"
name = "gaps of slides"
joints = ["x", "z"]
std_mm = 0.01
turned_over_at_nm = 100
"#;

/// Gaps make next to nothing of random plans, and 5 % of those that a search finds without them: a budget counts them as a plan does.
#[test]
fn a_budget_searches_again_with_what_it_left_out() {
    let place = Workplace::of_arm(GANTRY, GANTRY_SCENARIO);
    let plan = place.done("plan arm.toml --no-proof --json --quiet");
    let budget = place.record("budget arm.toml --up-to 3 --no-proof");
    let points = budget["budget"].as_array().expect("points").iter();
    let best = points
        .filter(|point| point["experiments"] == 3)
        .map(|point| number(&point["rho0_mm"]));
    let (best, planned) = (
        best.fold(f64::INFINITY, f64::min),
        number(&plan.json()["rho0_mm"]),
    );
    assert!(best < 1.01 * planned, "{best} {planned}");
}
