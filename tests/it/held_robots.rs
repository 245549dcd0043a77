//! Plans of experiments that the robot must hold, torque limits of arms with passive joints, and signals and predictions that are far
//! from what is usual.

use elastocal::experiment::Loads;
use elastocal::plan::Criterion;
use elastocal::plan::search::{Problem, SearchError, approximate_design};
use elastocal::text::wording::in_um;

use crate::support::{Workplace, number, scenario};

/// An arm of four joints of which the last is commanded, or only gives, with something at its base and between its links.
fn arm(is_driven: bool, [site, tendon]: [&str; 2]) -> String {
    let (spring, drive) = if is_driven {
        ("", "<position joint=\"j4\" kp=\"3e4\"/>")
    } else {
        ("stiffness=\"3e4\"", "")
    };
    format!(
        r#"<mujoco><compiler angle="degree"/><worldbody>{site}<body pos="0 0 0.5"><joint name="j1" axis="0 0 1" range="-150 150"/>
<geom type="capsule" size="0.05" fromto="0 0 0 0.1 0 0.3" mass="8"/>
<body pos="0.1 0 0.3"><joint name="j2" axis="0 1 0" range="-120 40"/>
<geom type="capsule" size="0.05" fromto="0 0 0 0.6 0 0" mass="6"/>
<body pos="0.6 0.05 0"><joint name="j3" axis="0 1 0" range="-140 140"/>
<geom type="capsule" size="0.04" fromto="0 0 0 0.5 0 0" mass="4"/>
<body pos="0.5 0 0.05"><joint name="j4" axis="1 0 0" range="-170 170" {spring}/>
<geom type="box" size="0.05 0.05 0.05" mass="1"/><site name="end" pos="0 0 0.05"/><site name="tip" pos="0.15 0.12 0.05" euler="0 90 0"/>
</body></body></body></body></worldbody>{tendon}
<actuator><position joint="j1" kp="2e5"/><position joint="j2" kp="1.5e5"/><position joint="j3" kp="9e4"/>{drive}</actuator></mujoco>"#
    )
}

fn place(is_driven: bool, force_max_n: f64, more: &str) -> Workplace {
    let scenario = text(is_driven, force_max_n) + more;
    Workplace::of_arm(arm(is_driven, ["", ""]), scenario)
}

/// A scenario of the arm.
fn text(is_driven: bool, force_max_n: f64) -> String {
    let last = if is_driven { ", 30" } else { "" };
    format!(
        r#"seed = 5
[robot]
model = "arm.xml"
calibration_site = "tip"
machining_site = "tip"
parameters = ["j1", "j2", "j3", "j4"]
[instrument]
sigma_mm = 0.03
sigma_of = "deflection"
[[test_pose]]
name = "one"
q_deg = [20, -60, 80{last}]
force_n = [40, 50, -60]
[load]
kind = "any"
force_max_n = {force_max_n}
[design]
experiments = 4
"#
    )
}

/// What nothing commands has no torque limit: limits that are never reached change no plan's feasibility.
#[test]
fn torque_limits_leave_passive_joints_alone() {
    let limits = "[region]\njoint_torque_max_nm = [1000, 1000, 1000]\n";
    let place = place(false, 60.0, limits);
    let json = place.json("plan arm.toml --no-proof --plan-out plan.csv");
    assert!(number(&json["rho0_mm"]) > 0.0);
    assert!(json["lower_bound_rho0_mm"].is_number(), "{json}");
    place.json("check arm.toml --plan plan.csv");
    // A limit that is exceeded is named still.
    place.write(
        "low.toml",
        text(false, 60.0) + &limits.replace("1000, 1000, 1000", "1, 1, 1"),
    );
    let refused = place.doubted("check low.toml --plan plan.csv");
    refused.says("condition C0102: ");
    refused.does_not_print("torque about joint 4");
}

const HEAVY: &str = "q1_deg,q2_deg,q3_deg,q4_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats\n\
    20,-10,5,30,0,0,-100000,0,0,0,1\n";
const LIGHT: &str = "20,-60,80,30,0,0,-60,0,0,0,1\n-40,-20,50,60,0,50,0,0,0,0,1\n70,-80,20,-30,40,0,-30,0,0,0,1\n\
    10,-40,-90,100,30,-30,30,0,0,0,1\n-90,0,40,-120,0,-50,-30,0,0,0,1\n";

/// Forces that bend the arm beyond any equilibrium: a plan with them is named by all commands, and none is chosen.
#[test]
fn experiments_that_the_robot_does_not_hold_are_violations() {
    let place = place(true, 1e5, "");
    place.write("heavy.csv", HEAVY.to_owned() + LIGHT);
    for command in ["check", "evaluate --no-proof"] {
        let found = place.doubted(&format!("{command} arm.toml --plan heavy.csv"));
        found
            .says("condition C0102: the plan has 1 violation")
            .prints("experiment 1: no static equilibrium");
        assert!(!found.stdout.contains("NaN"), "{found:#?}");
    }
    let chosen = place.done("plan arm.toml --candidates heavy.csv --plan-out chosen.csv");
    assert!(
        (chosen.stdout.clone() + &chosen.stderr).contains("static equilibrium"),
        "{chosen:#?}"
    );
    place.json("check arm.toml --plan chosen.csv");
}

/// A search goes on without what the arm does not hold.
#[test]
fn searches_find_experiments_that_the_robot_holds() {
    let held = place(true, 6e4, "");
    held.json("plan arm.toml --no-proof --allow C0112 --plan-out plan.csv");
    held.json("check arm.toml --plan plan.csv");
    let measured = held.run("measure arm.toml --plan plan.csv --measurements-out m.csv");
    assert!(held.path("m.csv").exists(), "{measured:#?}");
}

#[test]
fn loads_that_move_next_to_nothing_are_told_from_none() {
    let mut scenario = scenario("klimchik2012");
    scenario.task.loads = Loads::Any { force_max_n: 1e-6 };
    let problem = Problem::new(&scenario.task, Criterion::TestPose);
    let error = approximate_design(&problem, scenario.seed).expect_err("nothing shows");
    assert!(matches!(error, SearchError::Faint(_)), "{error}");
}

#[test]
fn short_lengths_keep_their_digits() {
    let shown = [0.0, 1.619e-11, -3e-13, 2.7e-8, 0.025_110].map(|value_m| in_um(value_m, 3));
    assert_eq!(
        shown,
        ["0.000", "1.62e-5", "-3.00e-7", "0.027", "25110.000"]
    );
}

/// Near buckling deflections are not linear in compliances: a prediction of noise alone holds for little noise, and is judged, as others
/// are, where that makes them more than linear.
#[test]
fn a_prediction_of_noise_alone_is_judged() {
    let base = "<site name=\"base\" pos=\"0.2 0.1 1.2\"/>";
    let tendon = "<tendon><spatial stiffness=\"1800\" springlength=\"0.1\"><site site=\"base\"/><site site=\"end\"/></spatial></tendon>";
    let study = "[study]\nlevel = \"robot\"\ntrials = 200\n[[study.plan]]\nname = \"f\"\nkind = \"file\"\nfile = \"f.csv\"\n";
    let scenario = text(true, 60.0) + study;
    let noise = |sigma: &str| scenario.replace("sigma_mm = 0.03", sigma);
    let place = Workplace::of_arm(arm(true, [base, tendon]), noise("sigma_mm = 0.003"));
    let header = HEAVY.lines().next().expect("a header");
    let rows = "-130.762,-73.558,-117.035,-45.816,-3.443,-3.031,-59.824,0,0,0,1\n\
        -130.738,-73.568,-117.066,-46.500,-15.906,-9.414,-57.082,0,0,0,1\n\
        26.525,-17.025,-129.996,82.158,-24.900,-1.815,-54.559,0,0,0,1\n\
        -131.187,-73.633,-116.891,-43.862,17.631,24.886,-51.670,0,0,0,1\n";
    place.write("f.csv", format!("{header}\n{rows}"));
    let held = &place.json("study arm.toml")["plans"][0];
    let [rms, predicted, error] =
        ["rms_mm", "predicted_rms_mm", "rms_std_mm"].map(|key| number(&held[key]));
    assert!((rms - predicted).abs() < 3.0 * error, "{rms} {predicted}");
    place.write("arm.toml", noise("sigma_mm = 0.06"));
    place.done("study arm.toml --quiet").prints("not validated");
}
