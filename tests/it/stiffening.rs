//! Joints that stiffen or soften by a share that nobody knows: in truth by their law, in belief as a parameter.

use elastocal::mujoco::TorqueLaw;
use elastocal::robot::Load;
use elastocal::testbed::VirtualRobot;
use serde_json::Value;

use crate::absolute_trials::holds;
use crate::support::{Workplace, assert_alike, scenario_text, table4};
use crate::uncertainties::{assert_holds, assert_refused, entry, expected_mm, loaded, study, with};

const SHARES: &str = "std_relative = 0.01\nat_nm = 4000";

fn number(plan: &Value, key: &str) -> f64 {
    plan[key].as_f64().expect("a number")
}

/// What is seen on the virtual robot is what the account computes, within its errors and some percent.
fn assert_accounted_for(plan: &Value) {
    let expected = expected_mm(plan);
    let room = 3.0 * number(plan, "rms_std_mm") + 0.03 * expected;
    assert!((number(plan, "rms_mm") - expected).abs() < room, "{plan}");
}

/// Known, the prediction holds; hidden it is broken, by what the account says.
#[test]
fn predictions_hold_and_are_broken_by_what_is_hidden() {
    let known = study(&with(&entry(("stiffening", SHARES), ""), "robot", 800));
    assert_holds(&known, "stiffening");
    let noise = number(&study(&with("", "model", 4096)), "rms_mm");
    assert!(number(&known, "combined_rms_mm") > 1.1 * noise);
    let hidden = study(&with(
        &entry(("stiffening", SHARES), "hidden = true"),
        "robot",
        800,
    ));
    assert_accounted_for(&hidden);
    let verdict = hidden["verdict"].as_str().expect("a verdict");
    assert!(
        verdict.starts_with("exceeded") && verdict.contains("stiffening"),
        "{verdict}"
    );
    let exact = study(&with(&entry(("stiffening", SHARES), ""), "model", 20_000));
    let off = (number(&exact, "rms_mm") - number(&exact, "combined_rms_mm"))
        / number(&exact, "rms_std_mm");
    assert!(off.abs() < 4.5, "{off}");
}

/// So on a robot of another kind, of which a file says it and of which nothing holds the joints but their compliances.
#[test]
fn other_robots_stiffen_too() {
    let text = scenario_text("ur10");
    let head = text.split("[study]").next().expect("a head");
    let study_of = "\n[study]\nlevel = \"robot\"\ntrials = 800\nexperiments = 8\n[[study.plan]]\nname = \"best\"\n\
                    kind = \"optimal\"\nexperiments = 4\nnoise_only = true\n";
    let list = entry(("stiffening", "std_relative = 0.01\nat_nm = 200"), "");
    assert_holds(&study(&format!("{head}{study_of}{list}")), "UR10");
}

const ARM: &str = r#"<mujoco><compiler angle="degree"/><worldbody><body name="base"><site name="foot" pos="-0.3 0 0.1"/>
        <body name="link"><inertial pos="0.5 0 0" mass="80" diaginertia="1 1 1"/><joint name="hinge" axis="0 1 0" range="-90 90"/>
        <site name="eye" pos="0.2 0 0.3"/><site name="tip" pos="1 0 0"/></body></body></worldbody>
        <actuator><position joint="hinge" kp="2e5"/></actuator></mujoco>"#;
const SCENARIO: &str = r#"
        [robot]
        model = "arm.xml"
        calibration_site = "tip"
        machining_site = "tip"
        parameters = ["hinge"]
        [instrument]
        sigma_mm = 0.01
        sigma_of = "deflection"
        [[test_pose]]
        q_deg = [10]
        force_n = [0, 0, -500]
        [load]
        kind = "fixed"
        force_n = [0, 0, -800]
        [[uncertainty]]
        kind = "compliance"
        joints = ["hinge"]
        std_relative = 0.000001
        [[uncertainty]]
        kind = "stiffening"
        joints = ["hinge"]
        std_relative = 0.02
        at_nm = 1000
        [design]
        experiments = 4
        "#;
const PLAN: &str = "q1_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats\n-40,0,0,-800,0,0,0,1\n0,0,0,-800,0,0,0,1\n\
                    20,0,0,-800,0,0,0,1\n50,0,0,-800,0,0,0,1\n";

/// A joint stiffens by all that it carries: a spring of its own, one between places, an actuator's constant force.
#[test]
fn what_a_joint_carries_besides_weight_and_load_stiffens_it() {
    let tendon = r#"</worldbody><tendon><spatial stiffness="8000" springlength="0.1"><site site="foot"/><site site="eye"/></spatial></tendon>"#;
    let constant =
        r#"<general gainprm="2e5" biastype="affine" joint="hinge" biasprm="-300 -2e5 0"/>"#;
    for (from, to) in [
        ("</worldbody>", tendon),
        (r#"<position joint="hinge" kp="2e5"/>"#, constant),
        (
            r#"axis="0 1 0""#,
            r#"axis="0 1 0" stiffness="500" springref="-40""#,
        ),
    ] {
        assert!(ARM.contains(from));
        let place = Workplace::of_arm(ARM.replace(from, to), SCENARIO);
        place.write("plan.csv", PLAN);
        let evaluated = place.json("evaluate arm.toml --plan plan.csv --no-proof --trials 1500");
        holds(&evaluated["trials"]);
    }
}

/// A joint that nearly gives way is identified: first steps lead where none would hold.
#[test]
fn a_joint_that_holds_hardly_more_is_identified() {
    let wide = [("0.02", "0.15"), ("at_nm = 1000", "at_nm = 800")];
    let scenario = wide.iter().fold(SCENARIO.to_owned(), |text, (from, to)| {
        assert!(text.contains(from));
        text.replace(from, to)
    });
    let place = Workplace::of_arm(ARM, &scenario);
    place.write("plan.csv", PLAN);
    let command = "measure arm.toml --plan plan.csv --run 58 --measurements-out m.csv";
    let stiffening = |all: &Value| {
        let mut all = all.as_array().expect("a list").iter();
        let found = all.find(|each| each["name"] == "hinge.stiffening");
        found.expect("a stiffening").clone()
    };
    let sampled = stiffening(&place.json(command)["truth"]["sampled"]);
    let fitted = &place.json("identify arm.toml --measurements m.csv")["uncertain"];
    let fitted = stiffening(fitted);
    let off = number(&fitted, "value") - number(&sampled, "value");
    assert!(
        off.abs() < 4.0 * number(&fitted, "std"),
        "{sampled} {fitted}"
    );
    // Under a force that it cannot hold there is no command.
    let identified = "--measurements m.csv --identified-out i.json --quiet";
    place.run(&format!("identify arm.toml {identified}"));
    place.write(
        "arm.toml",
        scenario.replace("force_n = [0, 0, -500]", "force_n = [0, 0, -4000]"),
    );
    let refused = place.refused("compensate arm.toml --identified i.json --quiet");
    let told = "joint \"hinge\" softens and cannot hold what it carries";
    refused.says(told);
}

/// One law: the chain's solver and MuJoCo's forces leave the robot in the same place, and its beginning is what the belief has.
#[test]
fn one_law() {
    let shares = "std_relative = 0.01\nat_nm = 8000";
    let scenario = loaded(&with(&entry(("stiffening", shares), ""), "robot", 64));
    let belief = &scenario.task.belief;
    let (plain, tool) = (&scenario.truth.robot, &belief.calibration_tool.name);
    let experiment = &table4(3).experiments[1];
    let (q, load) = (&experiment.configuration_rad, &experiment.load);
    let compliance = &plain.compliance_rad_per_nm;
    let law = |joint: usize, share: f64| {
        let at = compliance[joint] * 8000.0;
        (
            joint,
            TorqueLaw {
                share,
                at: Some(at),
            },
        )
    };
    let laws = [law(1, 0.06), law(2, -0.04), law(4, 0.02)];
    let mut chain = VirtualRobot::new(plain, tool).expect("the site exists");
    let springs = chain.rest(q, load).expect("stable").0;
    chain.set_torque_laws(&laws);
    let position = chain.rest(q, load).expect("stable").0;
    assert!((position - springs).norm() > 1e-6);
    let mut robot = plain.clone();
    robot.torque_laws = laws.to_vec();
    let mut any = VirtualRobot::of_any_model(&robot, tool).expect("the site exists");
    assert!((any.rest(q, load).expect("stable").0 - position).norm() < 1e-9);
    // Laws that are drawn take the place of those before.
    any.set_torque_laws(&laws[..1]);
    assert!((any.rest(q, load).expect("stable").0 - position).norm() > 1e-8);
    // What the planner's model has is the same law, and its derivative by the share.
    let torque = 6000.0;
    let spring = compliance[1] * torque;
    for share in [0.06, 1e-4, 0.0, -1e-4, -0.06] {
        let believed = |share: f64| {
            let law = TorqueLaw {
                share,
                at: Some(8000.0),
            };
            (
                law.beside_spring(compliance[1], torque),
                law.gives(compliance[1], torque),
            )
        };
        let given = law(1, share).1.deflection(spring) - spring;
        let (beside, slope) = believed(share);
        assert!((given - beside).abs() < 1e-15, "{given} {beside}");
        let step = 1e-6;
        let difference = (believed(share + step).0 - believed(share - step).0) / (2.0 * step);
        assert_alike(difference, slope, 1e-5);
    }
    assert!(TorqueLaw::SPRING.gives(1e-6, 1e4) == 0.0);
    // A load that a softening joint cannot hold.
    chain.set_torque_laws(&[law(1, -0.9)]);
    assert!(chain.rest(q, &Load::force(0.0, 0.0, -9000.0)).is_err());
}

/// A law that is told needs no actuators.
#[test]
fn robots_without_actuators_have_laws() {
    let text = scenario_text("ur10");
    let head = text.split("[study]").next().expect("a head");
    let plan = "\n[study]\nlevel = \"robot\"\ntrials = 64\n[[study.plan]]\nname = \"best\"\nkind = \"optimal\"\n";
    let law = |text: &str| {
        format!("{head}{plan}[[true_robot.torque_law]]\njoints = [\"elbow\"]\n{text}\n")
    };
    assert_accounted_for(&study(&law("stiffens_at_mrad = 60")));
}

/// Wrong entries are named with their key and what is allowed.
#[test]
fn wrong_entries() {
    for (text, key, says) in [
        ("std_relative = 0.01", "at_nm", "is missing"),
        ("at_nm = 100", "[0]", "needs its standard deviation"),
        ("std_relative = -0.1\nat_nm = 100", "std_relative", "-0.1"),
        (
            "std_relative = 0.1\nat_nm = 0",
            "at_nm",
            "a positive number",
        ),
        (
            "std_mrad = 0.1\nat_nm = 10",
            "std_mrad",
            "it has std_relative",
        ),
        (
            "joints = [\"joint_9\"]\nstd_relative = 0.1\nat_nm = 10",
            "joints",
            "the robot's joints are",
        ),
        (
            "std_relative = 0.1\nat_nm = 10\nturned_over_at_nm = 5",
            "turned_over_at_nm",
            "a stiffening has no such key",
        ),
        (
            "std_relative = 0.1\nat_nm = 10\n[[uncertainty]]\nkind = \"load_scale\"\nstd_relative = 0.1\nat_nm = 5",
            "[1].at_nm",
            "a load_scale has no such key",
        ),
        (
            "std_relative = 0.1\nat_nm = 10\n[[uncertainty]]\nkind = \"stiffening\"\nname = \"more\"\nstd_relative = 0.1\n\
             at_nm = 20\nhidden = true",
            "[1].at_nm",
            "something else of joint_1",
        ),
        (
            "std_relative = 0.1\nat_nm = 10\n[[true_robot.torque_law]]\njoints = [\"joint_2\"]\nstiffens_at_mrad = 5",
            "joints",
            "joint_2 has a law of its own",
        ),
    ] {
        assert_refused(&format!("kind = \"stiffening\"\n{text}"), key, says);
    }
}
