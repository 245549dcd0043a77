//! What MuJoCo's models can say: honoured as MuJoCo's own simulation in time has it, or refused by
//! name with the element. The judge steps the file as it is, by MuJoCo alone.

use std::path::Path;

use elastocal::robot::{EquilibriumSolver, Load};
use elastocal::scenario::Scenario;
use elastocal::testbed::VirtualRobot;
use mujoco_rs::prelude::{MjData, MjModel};
use mujoco_rs::wrappers::mj_model::{MjtDisableBit, MjtObjBase};
use nalgebra::{DVector, Vector3};

use crate::support::{Workplace, experiment};

/// The commanded angles (deg) and the load (N) at which features are tried.
const COMMANDED_DEG: [f64; 3] = [20.0, -35.0, 50.0];
const LOAD_N: [f64; 3] = [60.0, -40.0, -150.0];

/// An arm of three hinges, as an MJCF file with places to put features into.
#[derive(Clone)]
struct Arm {
    /// After the compiler's line: options, flags.
    head: String,
    /// Attributes of the joint in the middle.
    joint: String,
    /// Attributes of the forearm's body.
    body: String,
    /// Elements of the forearm's body.
    inside: String,
    /// Attributes of the middle joint's actuator; its tag ends with them.
    actuator: String,
    /// Elements before the end of the file.
    tail: String,
}

impl Arm {
    fn new() -> Self {
        Self {
            head: String::new(),
            joint: "range=\"-2 2\" limited=\"false\"".into(),
            body: String::new(),
            inside: String::new(),
            actuator: "<position name=\"servo_2\" joint=\"joint_2\" kp=\"40000\"/>".into(),
            tail: String::new(),
        }
    }

    fn mjcf(&self) -> String {
        let Self {
            head,
            joint,
            body,
            inside,
            actuator,
            tail,
        } = self;
        format!(
            r#"<mujoco model="arm">
  <compiler angle="radian"/>
  {head}
  <option timestep="0.001" integrator="implicitfast"/>
  <worldbody>
    <site name="anchor" pos="-0.3 0 1.2"/>
    <body name="column" pos="0 0 0.5">
      <inertial pos="0 0 0.1" mass="12" diaginertia="0.3 0.3 0.2"/>
      <joint name="joint_1" axis="0 0 1" range="-3 3" limited="false" damping="400" armature="2"/>
      <body name="upper_arm" pos="0.1 0 0.2">
        <inertial pos="0.3 0.02 0" mass="9" diaginertia="0.05 0.3 0.3"/>
        <joint name="joint_2" axis="0 1 0" damping="400" armature="2" {joint}/>
        <site name="elbow" pos="0.5 0 0.1"/>
        <body name="forearm" pos="0.6 0 0" {body}>
          <inertial pos="0.2 0 0.03" mass="5" diaginertia="0.02 0.1 0.1"/>
          <joint name="joint_3" axis="0 1 0" range="-2.5 2.5" limited="false" damping="150" armature="1"/>
          <site name="tool" pos="0.45 0.05 -0.02"/>
          {inside}
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="servo_1" joint="joint_1" kp="50000" kv="100"/>
    {actuator}
    <position name="servo_3" joint="joint_3" kp="15000" kv="100"/>
  </actuator>
  {tail}
</mujoco>
"#
        )
    }
}

/// A scenario with the arm's file.
fn load(workplace: &Workplace, mjcf: &str) -> Result<Scenario, String> {
    workplace.write("arm.xml", mjcf);
    let [x, y, z] = LOAD_N;
    workplace.write(
        "arm.toml",
        format!(
            "[robot]\nmodel = \"arm.xml\"\ncalibration_site = \"tool\"\nmachining_site = \"tool\"\n\
             parameters = [\"joint_2\", \"joint_3\"]\n[instrument]\nsigma_mm = 0.03\nsigma_of = \"deflection\"\n\
             [[test_pose]]\nq_deg = {COMMANDED_DEG:?}\nforce_n = [0, 20, -30]\n\
             [load]\nkind = \"fixed\"\nforce_n = [{x}, {y}, {z}]\n[design]\nexperiments = 3\n"
        ),
    );
    Scenario::load(&workplace.path("arm.toml")).map_err(|error| {
        let hinted = error.hint.is_some() || error.problem.contains("not a serial arm");
        assert!(hinted, "no hint: {error}");
        error.to_string()
    })
}

/// Where MuJoCo's simulation of the file rests (m): the tool unloaded and loaded, contacts and joint
/// limits off. `gears` are those of the actuators.
fn judge(path: &Path, gears: [f64; 3]) -> [Vector3<f64>; 2] {
    let mut model = MjModel::from_xml(path).expect("MuJoCo reads it");
    model.opt_mut().disableflags |=
        MjtDisableBit::mjDSBL_CONTACT as i32 | MjtDisableBit::mjDSBL_LIMIT as i32;
    let site = model
        .name_to_id(MjtObjBase::mjOBJ_SITE, "tool")
        .expect("there is");
    let body = model.site_bodyid()[site].unsigned_abs() as usize;
    [0.0, 1.0].map(|share| {
        let mut data = MjData::new(&model);
        let q = COMMANDED_DEG.map(f64::to_radians);
        data.qpos_mut().copy_from_slice(&q);
        for (joint, angle) in q.iter().enumerate() {
            data.ctrl_mut()[joint] = gears[joint] * angle;
        }
        for step in 0..60_000 {
            data.step1();
            let point = data.site_xpos()[site];
            let mut applied = [0.0; 3];
            data.apply_ft(
                &LOAD_N.map(|force| share * force),
                &[0.0; 3],
                &point,
                body,
                &mut applied,
            )
            .expect("the body exists");
            data.qfrc_applied_mut().copy_from_slice(&applied);
            data.step2();
            if step > 10 && data.qvel().iter().all(|speed| speed.abs() < 1e-12) {
                break;
            }
        }
        data.kinematics();
        Vector3::from(data.site_xpos()[site])
    })
}

/// The same by the virtual robot and by the analytic chain.
fn found(scenario: &Scenario) -> [[Vector3<f64>; 2]; 2] {
    let robot = &scenario.task.belief.nominal;
    let q = DVector::from_iterator(3, COMMANDED_DEG.map(f64::to_radians));
    let [x, y, z] = LOAD_N;
    let loads = [Load::NONE, Load::force(x, y, z)];
    let mut virtual_robot =
        VirtualRobot::new(&robot.as_believed(), "tool").expect("the site exists");
    let mut solver = EquilibriumSolver::new(3);
    let virtually = loads.map(|load| virtual_robot.rest(&q, &load).expect("stable").0);
    let analytically = loads.map(|load| {
        let mut arm = robot.chain.at(&scenario.task.belief.calibration_tool);
        solver
            .solve(&mut arm, &robot.compliance_rad_per_nm, q.as_slice(), &load)
            .expect("stable");
        solver.state().tool_position
    });
    [virtually, analytically]
}

/// The largest distance (m) between the judge and both of the program's models.
fn apart(workplace: &Workplace, arm: &Arm, gear: f64) -> f64 {
    let scenario = load(workplace, &arm.mjcf()).unwrap_or_else(|error| panic!("{error}"));
    let judged = judge(&workplace.path("arm.xml"), [1.0, gear, 1.0]);
    found(&scenario)
        .iter()
        .flat_map(|by| {
            by.iter()
                .zip(&judged)
                .map(|(one, other)| (one - other).norm())
        })
        .fold(0.0, f64::max)
}

fn arm(change: impl FnOnce(&mut Arm)) -> Arm {
    let mut arm = Arm::new();
    change(&mut arm);
    arm
}

fn flag(text: &str) -> Arm {
    arm(|arm| arm.head = format!("<option><flag {text}/></option>"))
}

fn option(text: &str) -> Arm {
    arm(|arm| arm.head = format!("<option {text}/>"))
}

fn servo(text: &str) -> Arm {
    arm(|arm| {
        arm.actuator =
            format!("<position name=\"servo_2\" joint=\"joint_2\" kp=\"40000\" {text}/>");
    })
}

fn general(text: &str) -> Arm {
    arm(|arm| arm.actuator = format!("<general name=\"servo_2\" joint=\"joint_2\" {text}/>"))
}

fn joint(text: &str) -> Arm {
    arm(|arm| arm.joint += &format!(" {text}"))
}

fn forearm(text: &str) -> Arm {
    arm(|arm| arm.body = text.into())
}

fn tail(text: &str) -> Arm {
    arm(|arm| arm.tail = text.into())
}

#[test]
fn what_is_honoured_rests_where_mujoco_comes_to_rest() {
    let workplace = Workplace::new();
    let plain = Arm::new();
    let upside_down = "gravity=\"3 0 4\"";
    #[rustfmt::skip]
    let features: &[(&str, Arm, f64)] = &[
        ("nothing", plain.clone(), 1.0),
        ("gravity", option(upside_down), 1.0),
        ("flag gravity", flag("gravity=\"disable\""), 1.0),
        ("gravcomp of a part", forearm("gravcomp=\"0.6\""), 1.0),
        ("gravcomp of all", forearm("gravcomp=\"1\""), 1.0),
        ("actuatorgravcomp", arm(|arm| { arm.body = "gravcomp=\"0.6\"".into(); arm.joint += " actuatorgravcomp=\"true\""; }), 1.0),
        ("gravcomp without gravity", arm(|arm| { arm.body = "gravcomp=\"0.6\"".into(); arm.head = "<option><flag gravity=\"disable\"/></option>".into(); }), 1.0),
        ("gravcomp with springs and dampers switched off", arm(|arm| { arm.body = "gravcomp=\"0.6\"".into(); arm.head = "<option><flag spring=\"disable\" damper=\"disable\"/></option>".into(); arm.actuator = "<position name=\"servo_2\" joint=\"joint_2\" kp=\"40000\" kv=\"300\"/>".into(); }), 1.0),
        ("gear", servo("gear=\"3\""), 3.0),
        ("gear backwards", servo("gear=\"-0.5\""), -0.5),
        ("ref", joint("ref=\"0.4\""), 1.0),
        ("a spring beside the actuator", joint("stiffness=\"5000\" springref=\"0.5\""), 1.0),
        ("a spring between sites", arm(|arm| arm.tail = "<tendon><spatial stiffness=\"20000\" springlength=\"0.1\"><site site=\"anchor\"/><site site=\"elbow\"/></spatial></tendon>".into()), 1.0),
        ("a slack one", arm(|arm| arm.tail = "<tendon><spatial stiffness=\"20000\" springlength=\"0.1 5\"><site site=\"anchor\"/><site site=\"elbow\"/></spatial></tendon>".into()), 1.0),
        ("a pushing one", arm(|arm| arm.tail = "<tendon><spatial stiffness=\"2000\" springlength=\"2 5\"><site site=\"anchor\"/><site site=\"elbow\"/></spatial></tendon>".into()), 1.0),
        ("a constant force", general("gainprm=\"40000\" biastype=\"affine\" biasprm=\"120 -40000 0\""), 1.0),
        ("joint in parent", arm(|arm| arm.actuator = "<position name=\"servo_2\" jointinparent=\"joint_2\" kp=\"40000\"/>".into()), 1.0),
        ("general", general("gainprm=\"40000\" biastype=\"affine\" biasprm=\"0 -40000 -20\""), 1.0),
        ("wide ctrlrange", servo("ctrlrange=\"-2 2\" ctrllimited=\"true\""), 1.0),
        ("ctrlrange that does not clamp", arm(|arm| { arm.head = "<option><flag clampctrl=\"disable\"/></option>".into(); arm.actuator = "<position name=\"servo_2\" joint=\"joint_2\" kp=\"40000\" ctrlrange=\"-0.1 0.1\" ctrllimited=\"true\"/>".into(); }), 1.0),
        ("a second actuator, disabled", arm(|arm| { arm.head = "<option actuatorgroupdisable=\"3\"/>".into(); arm.tail = "<actuator><position joint=\"joint_2\" kp=\"10000\" group=\"3\"/></actuator>".into(); }), 1.0),
    ];
    for (name, arm, gear) in features {
        let distance = apart(&workplace, arm, *gear);
        println!("honoured: {name}: {distance:.1e} m");
        assert!(distance < 1e-9, "{name}: {distance:.2e} m apart");
    }
}

#[test]
fn what_has_no_influence_changes_nothing() {
    let workplace = Workplace::new();
    let plain = load(&workplace, &Arm::new().mjcf()).expect("valid");
    let plain = found(&plain);
    #[rustfmt::skip]
    let features: &[(&str, Arm)] = &[
        ("damping", servo("kv=\"300\"")),
        ("joint damping and armature", joint("margin=\"0.1\"")),
        ("springref without a spring", joint("springref=\"1\"")),
        ("a spring that is switched off", arm(|arm| { arm.head = "<option><flag spring=\"disable\"/></option>".into(); arm.joint += " stiffness=\"5000\""; })),
        ("a still medium", option("density=\"1.2\" viscosity=\"1e-5\"")),
        ("wind without a medium", option("wind=\"10 0 0\"")),
        ("magnetic", option("magnetic=\"1 2 3\"")),
        ("integrator", option("integrator=\"RK4\"")),
        ("keyframe", tail("<keyframe><key qpos=\"1 1 1\" ctrl=\"1 1 1\"/></keyframe>")),
        ("sensors", tail("<sensor><jointpos joint=\"joint_2\"/></sensor>")),
        ("an equality that is not active", tail("<equality><joint joint1=\"joint_2\" joint2=\"joint_3\" active=\"false\"/></equality>")),
        ("equalities that are switched off", arm(|arm| { arm.head = "<option><flag equality=\"disable\"/></option>".into(); arm.tail = "<equality><joint joint1=\"joint_2\" joint2=\"joint_3\"/></equality>".into(); })),
        ("a tendon without a spring", tail("<tendon><spatial damping=\"5\"><site site=\"anchor\"/><site site=\"elbow\"/></spatial></tendon>")),
        ("a contact", arm(|arm| { arm.inside = "<geom type=\"sphere\" size=\"0.3\" mass=\"0\"/>".into(); arm.tail = "<worldbody><geom type=\"sphere\" size=\"0.5\" pos=\"0.6 0 1\"/></worldbody>".into(); })),
        ("friction that is switched off", arm(|arm| { arm.head = "<option><flag frictionloss=\"disable\"/></option>".into(); arm.joint += " frictionloss=\"50\""; })),
    ];
    for (name, arm) in features {
        let distance = apart(&workplace, arm, 1.0);
        assert!(distance < 1e-9, "{name}: {distance:.2e} m apart");
        let scenario = load(&workplace, &arm.mjcf()).expect("valid");
        assert_eq!(found(&scenario), plain, "{name}");
    }
}

#[test]
fn the_rest_is_refused_by_name() {
    let workplace = Workplace::new();
    let spatial = |attributes: &str| {
        tail(&format!(
            "<tendon><spatial name=\"cable\" {attributes}><site site=\"anchor\"/><site site=\"elbow\"/></spatial></tendon>"
        ))
    };
    let another = |text: &str| tail(&format!("<actuator>{text}</actuator>"));
    let equality = |text: &str| tail(&format!("<equality>{text}</equality>"));
    #[rustfmt::skip]
    let features: &[(Arm, &[&str])] = &[
        (joint("stiffness=\"0 300\""), &["joint \"joint_2\"", "stiffness=\"0 300"]),
        (joint("frictionloss=\"20\""), &["joint \"joint_2\"", "frictionloss=\"20\""]),
        (joint("actuatorfrcrange=\"-50 50\""), &["joint \"joint_2\"", "actuatorfrcrange=\"-50 50\""]),
        (spatial("stiffness=\"20000 5\" springlength=\"0.1\""), &["tendon \"cable\"", "stiffness=\"20000 5", "not linear"]),
        (arm(|arm| { arm.inside = "<geom name=\"drum\" size=\"0.02\" mass=\"0\"/>".into(); arm.tail = "<tendon><spatial name=\"cable\" stiffness=\"20000\"><site site=\"anchor\"/><geom geom=\"drum\"/><site site=\"elbow\"/></spatial></tendon>".into(); }), &["tendon \"cable\"", "straight from site to site"]),
        (spatial("range=\"0 0.2\" limited=\"true\""), &["tendon \"cable\"", "range=\"0 0.2\""]),
        (spatial("frictionloss=\"9\""), &["tendon \"cable\"", "frictionloss=\"9\""]),
        (tail("<tendon><fixed name=\"coupling\" stiffness=\"700\"><joint joint=\"joint_2\" coef=\"1\"/><joint joint=\"joint_3\" coef=\"-1\"/></fixed></tendon>"), &["tendon \"coupling\"", "stiffness=\"700\""]),
        (equality("<joint name=\"coupled\" joint1=\"joint_2\" joint2=\"joint_3\"/>"), &["equality/joint \"coupled\""]),
        (equality("<connect name=\"loop\" body1=\"forearm\" body2=\"column\" anchor=\"0.1 0 0\"/>"), &["equality/connect \"loop\""]),
        (equality("<weld body1=\"forearm\"/>"), &["equality/weld 0"]),
        (another("<position name=\"extra\" joint=\"joint_2\" kp=\"9000\"/>"), &["actuator \"extra\"", "joint \"joint_2\"", "actuator \"servo_2\""]),
        (another("<motor name=\"extra\" joint=\"joint_2\"/>"), &["actuator \"extra\"", "\"servo_2\""]),
        (another("<position name=\"push\" site=\"tool\" kp=\"1000\" gear=\"0 0 1 0 0 0\"/>"), &["actuator \"push\"", "a site"]),
        (another("<adhesion name=\"glue\" body=\"forearm\" ctrlrange=\"0 1\"/>"), &["actuator \"glue\"", "contacts"]),
        (tail("<tendon><fixed name=\"t\"><joint joint=\"joint_3\" coef=\"1\"/></fixed></tendon><actuator><position name=\"pull\" tendon=\"t\" kp=\"3000\"/></actuator>"), &["actuator \"pull\"", "a tendon"]),
        // MuJoCo numbers tendons as it does joints: this is not the actuator of joint 2.
        (arm(|arm| { arm.actuator = String::new(); arm.tail = "<tendon><fixed name=\"t\"><joint joint=\"joint_2\" coef=\"1\"/></fixed></tendon><actuator><position name=\"pull\" tendon=\"t\" kp=\"3000\"/></actuator>".into(); }), &["actuator \"pull\"", "a tendon"]),
        (servo("forcerange=\"-30 30\""), &["actuator \"servo_2\"", "forcerange=\"-30 30\""]),
        (servo("timeconst=\"0.1\""), &["actuator \"servo_2\"", "a state of its own"]),
        (servo("ctrlrange=\"-0.2 0.2\""), &["actuator \"servo_2\"", "ctrlrange", "-0.2 to 0.2 rad", "joint \"joint_2\" is -2 to 2 rad"]),
        (servo("gear=\"4\" ctrlrange=\"-2 2\""), &["actuator \"servo_2\"", "ctrlrange", "-0.5 to 0.5 rad"]),
        (general("gainprm=\"40000\" biastype=\"affine\" biasprm=\"0 -30000 0\""), &["actuator \"servo_2\"", "-30000"]),
        (general("gainprm=\"40000\" gaintype=\"affine\" biastype=\"affine\" biasprm=\"0 -40000 0\""), &["actuator \"servo_2\"", "no position actuator"]),
        (arm(|arm| arm.actuator = "<motor name=\"servo_2\" joint=\"joint_2\"/>".into()), &["actuator \"servo_2\"", "no position actuator"]),
        (arm(|arm| arm.actuator = "<velocity name=\"servo_2\" joint=\"joint_2\" kv=\"5\"/>".into()), &["actuator \"servo_2\"", "no position actuator"]),
        (arm(|arm| arm.actuator = "<intvelocity name=\"servo_2\" joint=\"joint_2\" kp=\"5\" actrange=\"-1 1\"/>".into()), &["actuator \"servo_2\"", "a state of its own"]),
        (arm(|arm| arm.actuator = String::new()), &["joint \"joint_2\"", "no actuator"]),
        (arm(|arm| { arm.head = "<option actuatorgroupdisable=\"2\"/>".into(); arm.actuator = "<position name=\"servo_2\" joint=\"joint_2\" kp=\"40000\" group=\"2\"/>".into(); }), &["joint \"joint_2\"", "actuator \"servo_2\"", "actuatorgroupdisable"]),
        (flag("actuation=\"disable\""), &["option/flag", "actuation=\"disable\""]),
        (flag("sleep=\"enable\""), &["option/flag", "sleep=\"enable\""]),
        (option("wind=\"10 0 0\" density=\"1.2\""), &["option", "wind=\"10 0 0\""]),
        (forearm("gravcomp=\"1.5\""), &["body \"forearm\"", "gravcomp=\"1.5\""]),
        (arm(|arm| arm.inside = "<body name=\"finger\"><joint name=\"slide\" type=\"slide\"/><geom size=\"0.1\"/></body>".into()), &["\"slide\"", "no actuator"]),
        (arm(|arm| arm.inside = "<body name=\"ball\"><joint name=\"ball\" type=\"ball\"/><geom size=\"0.1\"/></body>".into()), &["\"ball\"", "neither a hinge nor a slide"]),
        (arm(|arm| arm.inside = "<flexcomp name=\"rope\" type=\"grid\" count=\"3 1 1\" dim=\"1\" spacing=\"0.1 0.1 0.1\" radius=\"0.01\" mass=\"0.1\"/>".into()), &["joint 6", "branches off", "robot.locked_deg"]),
        (arm(|arm| arm.inside = "<flexcomp name=\"rope\" type=\"grid\" count=\"3 1 1\" rigid=\"true\" dim=\"1\" spacing=\"0.1 0.1 0.1\" radius=\"0.01\" mass=\"0.1\"/>".into()), &["flex \"rope\"", "deformable"]),
    ];
    let mut wrong = Vec::new();
    for (arm, says) in features {
        match load(&workplace, &arm.mjcf()) {
            Ok(_) => wrong.push(format!("{says:?}: accepted")),
            Err(error) => {
                if !error.contains("arm.xml") || says.iter().any(|part| !error.contains(part)) {
                    wrong.push(format!("{says:?}: {error}"));
                }
                println!("refused: {error}");
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Without a range of the joint, that of its commands holds.
#[test]
fn a_joint_without_a_range_has_that_of_its_commands() {
    let workplace = Workplace::new();
    let mut limited = servo("gear=\"-2\" ctrlrange=\"-1 3\"");
    limited.joint = String::new();
    let scenario = load(&workplace, &limited.mjcf()).expect("valid");
    let range = scenario.task.belief.nominal.chain.joints[1].range_rad;
    assert_eq!(range.map(f64::to_bits), [-1.5, 0.5].map(f64::to_bits));
}

/// The reader's command, with a plan measured by the virtual robot, sees what MuJoCo does.
#[test]
fn a_measurement_of_a_geared_arm_is_mujocos() {
    let workplace = Workplace::new();
    let geared = servo("gear=\"3\"");
    let scenario = load(&workplace, &geared.mjcf()).expect("valid");
    let compliance = scenario.truth.robot.compliance_rad_per_nm[1];
    assert!((compliance * 360_000.0 - 1.0).abs() < 1e-12);
    let [x, y, z] = LOAD_N;
    let experiment = experiment(
        DVector::from_iterator(3, COMMANDED_DEG.map(f64::to_radians)),
        Load::force(x, y, z),
    );
    let mut robot = VirtualRobot::new(&scenario.truth.robot, "tool").expect("the site exists");
    let seen = robot
        .displacement(1, &experiment)
        .expect("stable")
        .position_m;
    let [unloaded, loaded] = judge(&workplace.path("arm.xml"), [1.0, 3.0, 1.0]);
    assert!((seen - (loaded - unloaded)).norm() < 1e-9);
}
