//! Virtual robots that are more than a chain: they rest where MuJoCo's own simulation in time does.

use std::collections::BTreeMap;

use elastocal::mujoco::Model;
use elastocal::robot::{KnownJoint, Load, TrueRobot, rotation_vector};
use elastocal::testbed::VirtualRobot;
use nalgebra::{DVector, Vector3};

use crate::judge::{Question, judge};
use crate::random_models::{Features, random_model};
use crate::robots::{Additions, iiwa, kr270, ur5e, ur10};
use crate::support::{Workplace, assert_near, force, scenario, table4};

/// The two ways to the rest of a plain chain are one.
#[test]
fn a_chain_rests_where_any_model_would() {
    let scenario = scenario("klimchik2012");
    let robot = &scenario.truth.robot;
    let site = &scenario.task.belief.calibration_tool.name;
    let mut chain = VirtualRobot::new(robot, site).expect("the site exists");
    let mut any = VirtualRobot::of_any_model(robot, site).expect("the site exists");
    for experiment in &table4(12).experiments {
        for load in [&Load::NONE, &experiment.load] {
            let q = &experiment.configuration_rad;
            let (one, _, _) = chain.rest(q, load).expect("stable");
            let (other, _, found) = any.rest(q, load).expect("stable");
            let apart = (one - other).norm();
            assert!(apart < 1e-12, "{apart:.1e} m apart: {found:?}");
        }
    }
}

/// A robot that is asked where it rests.
struct Case<'a> {
    mjcf: &'a str,
    site: &'a str,
    joints: &'a [String],
    commanded: &'a [f64],
    force_n: Vector3<f64>,
}

/// How far (m) the virtual robot of a model rests from where the judge says, unloaded and loaded, or why
/// it is refused.
fn apart(workplace: &Workplace, case: &Case<'_>) -> Result<f64, String> {
    let Case {
        mjcf,
        site,
        joints,
        commanded,
        force_n,
    } = *case;
    workplace.write("robot.xml", mjcf);
    let path = workplace.path("robot.xml");
    let model = Model::load(&path).map_err(|error| format!("compile: {error}"))?;
    let known: Vec<_> = (joints.iter())
        .map(|name| KnownJoint {
            name: name.clone(),
            is_passive: false,
        })
        .collect();
    let robot = TrueRobot::of_model(model, &known, Err(String::new()));
    let robot = robot.map_err(|error| format!("refused: {error}"))?;
    let virtual_robot = VirtualRobot::new(&robot, site);
    let mut virtual_robot = virtual_robot.map_err(|error| format!("refused: {error}"))?;
    let q = DVector::from_column_slice(commanded);
    let mut most: f64 = 0.0;
    for force_n in [Vector3::zeros(), force_n] {
        let load = force(force_n);
        let found = virtual_robot.rest(&q, &load);
        let question = Question {
            site,
            joints,
            commanded,
            force_n,
        };
        let (position, judged) = match (found, judge(&path, &question)) {
            (Ok((position, _, _)), Some(judged)) => (position, judged),
            // MuJoCo does not bring it to rest either.
            (Err(error), None) => return Err(format!("refused: {error}")),
            (Err(error), Some(_)) => return Err(format!("no rest: {error}")),
            (Ok(_), None) => return Err("the judge does not rest".to_owned()),
        };
        most = most.max((position - judged).norm());
    }
    Ok(most)
}

/// What a random model may have, and how its file shows it: the start of an element's tag, an attribute and
/// whether its value counts.
type Shown = (&'static str, &'static str, &'static str, fn(&str) -> bool);

const FEATURES: [Shown; 15] = [
    ("commanded slides", "joint name=\"joint_", "type", |kind| {
        kind == "slide"
    }),
    (
        "springs beside position actuators",
        "joint name=\"joint_",
        "stiffness",
        |_| true,
    ),
    ("`ref`", "joint name=\"joint_", "ref", |_| true),
    ("`gear`", "general", "gear", |gear| gear != "1"),
    (
        "constant forces of actuators",
        "general",
        "biasprm",
        |bias| !bias.starts_with("0 "),
    ),
    ("`gravcomp`", "body", "gravcomp", |share| share != "0"),
    (
        "passive hinges and slides",
        "joint name=\"passive_",
        "type",
        |kind| kind != "ball",
    ),
    ("passive balls", "joint name=\"passive_", "type", |kind| {
        kind == "ball"
    }),
    (
        "springs that are not linear",
        "joint name=\"passive_",
        "stiffness",
        |law| law.contains(' '),
    ),
    (
        "springs of straight tendons",
        "spatial stiffness",
        "springlength",
        |_| true,
    ),
    (
        "springs of wound tendons",
        "spatial name=\"wound",
        "stiffness",
        |_| true,
    ),
    (
        "springs of tendons that add joints up",
        "fixed",
        "stiffness",
        |_| true,
    ),
    ("side branches", "joint name=\"finger_", "name", |_| true),
    ("coupled joints", "joint joint1", "polycoef", |_| true),
    ("closed loops", "connect", "body1", |_| true),
];

/// Whether a file has a feature.
fn has(mjcf: &str, (_, tag, attribute, counts): &Shown) -> bool {
    let attribute = format!(" {attribute}=\"");
    mjcf.split('<').skip(1).any(|element| {
        let value = element.split(&attribute).nth(1);
        element.starts_with(tag)
            && value.is_some_and(|value| counts(value.split('"').next().unwrap_or_default()))
    })
}

#[test]
fn two_hundred_random_models_rest_where_mujoco_does() {
    let workplace = Workplace::new();
    let mut accepted = 0;
    let mut wrong = Vec::new();
    let mut worst: f64 = 0.0;
    let mut of_features = [(0, 0.0_f64); FEATURES.len()];
    let mut refused = BTreeMap::<String, u32>::new();
    for seed in 0..200 {
        let (mjcf, joints, commanded, force_n) = random_model(seed, Features::All);
        let case = Case {
            mjcf: &mjcf,
            site: "tool",
            joints: &joints,
            commanded: &commanded,
            force_n,
        };
        match apart(&workplace, &case) {
            Ok(distance_m) => {
                accepted += 1;
                worst = worst.max(distance_m);
                for (feature, (count, worst)) in FEATURES.iter().zip(&mut of_features) {
                    if has(&mjcf, feature) {
                        *count += 1;
                        *worst = worst.max(distance_m);
                    }
                }
                if distance_m >= 1e-9 {
                    wrong.push(format!("{seed}: {distance_m:.1e} m apart"));
                }
            }
            Err(refusal) => {
                let reason = refusal.split(": ").last().unwrap_or_default();
                *refused.entry(reason.to_owned()).or_default() += 1;
                if !refusal.starts_with("refused") {
                    wrong.push(format!("{seed}: {refusal}"));
                }
            }
        }
    }
    println!("| feature of random models | models | worst distance [m] |\n|---|---:|---:|");
    for ((feature, ..), (count, worst)) in FEATURES.iter().zip(of_features) {
        println!("| {feature} | {count} | {worst:.0e} |");
    }
    println!("| all of the {accepted} accepted | {accepted} | {worst:.0e} |");
    for (reason, count) in refused {
        println!("{count} refused: {reason}");
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(accepted >= 150);
    assert!(
        of_features.iter().all(|&(count, _)| count >= 10),
        "{of_features:?}"
    );
}

/// The judge's table: robots with the features that a truth may have.
#[test]
#[expect(clippy::too_many_lines, reason = "a list of robots")]
fn robots_with_all_features_rest_where_mujoco_does() {
    let workplace = Workplace::new();
    let with = |change: fn(&mut Additions)| {
        let mut additions = Additions::default();
        change(&mut additions);
        additions
    };
    let none = Additions::default();
    let flexible = with(|all| {
        let bent = "<joint name=\"bend\" axis=\"0 1 0\" stiffness=\"90000\" springref=\"0.01\" armature=\"25\" damping=\"2400\"/>";
        all.before = vec![(3, bent)];
    });
    let coupled = with(|all| {
        all.inside = vec![(
            3,
            "<body pos=\"0 0.1 0\"><joint name=\"finger\" axis=\"1 0 0\" stiffness=\"500\" armature=\"0.2\" damping=\"12\"/><geom size=\"0.03\" mass=\"1\" pos=\"0 0.1 0\"/></body>",
        )];
        all.tail = "<equality><joint joint1=\"finger\" joint2=\"joint_2\" polycoef=\"0 0.5 0 0 0\" solref=\"0.004 1\"/></equality>";
    });
    let loaded = with(|all| {
        all.inside = vec![(
            6,
            "<body name=\"payload\" pos=\"0 0 0.1\"><inertial pos=\"0.02 0 0.03\" mass=\"7\" diaginertia=\"0.02 0.02 0.02\"/></body>",
        )];
    });
    let balanced = with(|all| {
        all.world = "<site name=\"anchor\" pos=\"-0.2 0 0.4\"/>";
        all.inside = vec![(2, "<site name=\"lever\" pos=\"0 0.1 0\"/>")];
        all.tail = "<tendon><spatial stiffness=\"3000\" springlength=\"0.1\" damping=\"30\"><site site=\"anchor\"/><site site=\"lever\"/></spatial></tendon>";
    });
    // Forearm and rod of a parallelogram, closed by a loop: the rod holds the forearm's angle to the column.
    let parallelogram = with(|all| {
        all.inside = vec![(
            1,
            "<body name=\"crank\" pos=\"0 0 0.1273\" euler=\"1.5707963267948966 0 0\"><joint name=\"crank\" axis=\"0 0 1\" armature=\"5\" damping=\"300\"/><inertial pos=\"0 0.1 0\" mass=\"1\" diaginertia=\"0.01 0.01 0.01\"/><body name=\"rod\" pos=\"0 0.2 0\"><joint name=\"rod\" axis=\"0 0 1\" armature=\"1\" damping=\"60\"/><inertial pos=\"-0.3 0 0\" mass=\"2\" diaginertia=\"0.01 0.1 0.1\"/></body></body>",
        )];
        all.tail = "<equality><connect name=\"loop\" body1=\"rod\" body2=\"link_3\" anchor=\"-0.612 0 0\" solref=\"0.002 1\" solimp=\"0.999 0.9999 0.001\"/></equality>";
    });
    let six = [0.3, -1.1, 1.4, -0.6, 0.8, 0.5];
    let seven = [0.3, 0.6, -0.4, 1.1, 0.5, -0.7, 0.2];
    let press = Vector3::new(60.0, -40.0, -120.0);
    let mut cases = vec![
        ("UR10", ur10(&none), "tool", six.to_vec(), press),
        ("UR5e", ur5e(&none), "tool", six.to_vec(), press),
        (
            "iiwa: seven joints",
            iiwa(&none),
            "tool",
            seven.to_vec(),
            press,
        ),
        (
            "UR10, flexible link",
            ur10(&flexible),
            "tool",
            six.to_vec(),
            press,
        ),
        (
            "UR5e, coupled joint",
            ur5e(&coupled),
            "tool",
            six.to_vec(),
            press,
        ),
        ("UR5e, payload", ur5e(&loaded), "tool", six.to_vec(), press),
        (
            "UR10, balancing spring",
            ur10(&balanced),
            "tool",
            six.to_vec(),
            press,
        ),
        (
            "UR10, parallelogram",
            ur10(&parallelogram),
            "tool",
            six.to_vec(),
            press,
        ),
        (
            "iiwa, flexible link",
            iiwa(&flexible),
            "tool",
            seven.to_vec(),
            press,
        ),
    ];
    let pose = [0.0, -56.9, 89.3, 45.1, 76.0, 57.2].map(f64::to_radians);
    let weight = Vector3::new(0.0, 0.0, -2500.0);
    let compensator: &[(&str, &str)] = &[
        (
            "<body name=\"link_1\">",
            "<site name=\"spring_anchor\" pos=\"-0.33593 -0.24 0.8703\"/>",
        ),
        (
            "<body name=\"link_2\" pos=\"0.350 0 0.750\">",
            "<site name=\"spring_lever\" pos=\"0 -0.24 0.18472\"/>",
        ),
        (
            "</actuator>",
            "<tendon><spatial name=\"compensator\" stiffness=\"144270\" springlength=\"0.458\"><site site=\"spring_anchor\"/><site site=\"spring_lever\"/></spatial></tendon>",
        ),
    ];
    let soft: &[(&str, &str)] = &[
        (
            "<body name=\"link_1\">",
            "<joint name=\"base_x\" axis=\"1 0 0\" stiffness=\"3e7\" damping=\"1e6\" armature=\"300\"/><joint name=\"base_y\" axis=\"0 1 0\" stiffness=\"3e7\" damping=\"1e6\" armature=\"300\"/>",
        ),
        (
            "<body name=\"link_2\" pos=\"0.350 0 0.750\">",
            "<joint name=\"bend_2\" axis=\"0 0 1\" stiffness=\"2e7\" damping=\"6e5\" armature=\"100\"/>",
        ),
    ];
    let both: Vec<_> = soft.iter().chain(compensator).copied().collect();
    for (name, additions) in [
        ("KR-270", &[][..]),
        ("KR-270, compensator", compensator),
        ("KR-270, flexible base and link", soft),
        ("KR-270, compensator, flexible base and link", &both),
    ] {
        cases.push((
            name,
            kr270(additions),
            "calibration_tcp",
            pose.to_vec(),
            weight,
        ));
    }
    let mut wrong = Vec::new();
    println!("| robot | worst distance [m] |\n|---|---:|");
    for (name, (mjcf, joints), site, commanded, force_n) in &cases {
        let case = Case {
            mjcf,
            site,
            joints,
            commanded,
            force_n: *force_n,
        };
        let found = apart(&workplace, &case);
        match found {
            Ok(distance_m) => println!("| {name} | {distance_m:.0e} |"),
            Err(ref problem) => println!("| {name} | {problem} |"),
        }
        if !found.is_ok_and(|distance_m| distance_m < 1e-9) {
            wrong.push(*name);
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}

/// A plate that hangs on the forearm by a weld alone: how far the weld lets it turn is what
/// their sites show.
#[test]
fn welds_give_way_by_angles_too() {
    let workplace = Workplace::new();
    for tail in [
        "<equality><weld name=\"seam\" body1=\"plate\" body2=\"link_3\" solref=\"0.05 1\"/></equality>",
        "<equality><weld body1=\"plate\" body2=\"link_3\" torquescale=\"0.3\" solref=\"0.05 1\"/></equality>",
    ] {
        let additions = Additions {
            inside: vec![(
                3,
                "<site name=\"on_arm\" pos=\"-0.3 0 0\"/><body name=\"plate\" pos=\"-0.3 0 0\"><joint name=\"hang\" type=\"ball\" armature=\"0.1\" damping=\"8\"/><inertial pos=\"0.1 0.2 0\" mass=\"9\" diaginertia=\"0.1 0.1 0.1\"/><site name=\"on_plate\"/></body>",
            )],
            tail,
            ..Additions::default()
        };
        let (mjcf, joints) = ur10(&additions);
        workplace.write("robot.xml", mjcf);
        let model = Model::load(&workplace.path("robot.xml")).expect("MuJoCo reads it");
        let known: Vec<_> = (joints.iter())
            .map(|name| KnownJoint {
                name: name.clone(),
                is_passive: false,
            })
            .collect();
        let robot = TrueRobot::of_model(model, &known, Err(String::new())).expect("it rests");
        let mut robot = VirtualRobot::new(&robot, "tool").expect("the site exists");
        let q = DVector::from_column_slice(&[0.3, -1.1, 1.4, -0.6, 0.8, 0.5]);
        robot.rest(&q, &Load::NONE).expect("stable");
        let state = robot.simulation();
        let site = |name: &str| state.site(state.model().site(name).expect("there is"));
        let ((_, arm_axes), (_, plate_axes)) = (site("on_arm"), site("on_plate"));
        let turned = rotation_vector(&(plate_axes * arm_axes.transpose())).norm();
        let gives_way = robot.giving_way(&Load::NONE);
        assert_eq!(gives_way.len(), 1);
        let found = gives_way[0].weld_rad.expect("an angle");
        assert!(
            turned > 1e-4 && (found - turned).abs() < 1e-9,
            "{found}, {turned}"
        );
        assert!(gives_way[0].words().ends_with(" deg"));
    }
}

/// A scenario whose truth has a spring, flexible parts and a loop that the belief knows nothing of.
#[test]
fn check_says_what_the_truth_honours_and_how_far_loops_give_way() {
    let workplace = Workplace::new();
    let additions = Additions {
        inside: vec![(
            2,
            "<body name=\"rod\" pos=\"0 0 0.1\"><joint name=\"rod\" axis=\"0 0 1\" armature=\"1\" damping=\"60\"/>\
             <inertial pos=\"-0.3 0 0\" mass=\"2\" diaginertia=\"0.01 0.1 0.1\"/></body>",
        )],
        before: vec![(
            3,
            "<joint name=\"bend\" axis=\"0 1 0\" stiffness=\"90000\" armature=\"25\" damping=\"2400\"/>",
        )],
        tail: "<equality><connect name=\"loop\" body1=\"rod\" body2=\"link_3\" anchor=\"-0.5 0 0\"/></equality>",
        ..Additions::default()
    };
    workplace.write("truth.xml", ur10(&additions).0);
    workplace.write("belief.xml", ur10(&Additions::default()).0);
    let scenario = |truth: &str| {
        format!(
            "[robot]\nmodel = \"belief.xml\"\ncalibration_site = \"tool\"\nmachining_site = \"tool\"\n\
             parameters = [\"joint_2\", \"joint_3\"]\n[true_robot]\nmodel = \"{truth}\"\n\
             [instrument]\nsigma_mm = 0.03\nsigma_of = \"deflection\"\n\
             [[test_pose]]\nq_deg = [10, -60, 80, -30, 40, 20]\nforce_n = [0, 20, -300]\n\
             [load]\nkind = \"fixed\"\nforce_n = [0, 0, -200]\n[design]\nexperiments = 3\n"
        )
    };
    workplace.write("loop.toml", scenario("truth.xml"));
    let checked = workplace.done("check loop.toml");
    for part in [
        "equality/connect \"loop\": ties joints",
        "joint \"rod\"",
        "no actuator holds it",
        "equality/connect \"loop\" gives way by",
    ] {
        checked.prints(part);
    }
    checked.says("constraints are soft");
    let json = workplace.done("check loop.toml --json").json();
    let distance = &json["true_robot"]["gives_way"][0]["distance_mm"];
    assert!(distance.as_f64().expect("a number") > 0.1);
    // The whole loop works with it, and says that the belief is too simple.
    workplace.doubted("run loop.toml --out out --quiet");

    // A truth with a joint less, and one that remembers.
    let (five, _) = ur10(&Additions::default());
    workplace.write("five.xml", five.replace("joint_6", "wrist"));
    workplace.write("five.toml", scenario("five.xml"));
    // As many joints in a plain chain: they are the belief's by their order.
    workplace.done("check five.toml");
    let odd = ur10(&additions).0.replace("joint_6", "wrist");
    workplace.write("odd.xml", odd);
    workplace.write("odd.toml", scenario("odd.xml"));
    let refused = workplace.refused("check odd.toml");
    refused.says("no joint named \"joint_6\"");
    let filtered = ur10(&additions)
        .0
        .replace("kp=\"60000\"", "kp=\"60000\" timeconst=\"0.1\"");
    workplace.write("filtered.xml", filtered);
    workplace.write("filtered.toml", scenario("filtered.xml"));
    let refused = workplace.refused("check filtered.toml");
    refused.says("a state of its own");
}

/// Actuators and dry friction that do not count do not in a virtual robot's own model, whatever it has of them: it is as compliant as the
/// scenario says.
#[test]
fn ignored_actuators_hold_no_virtual_robot() {
    let arm = |joint: &str, more: &str, actuators: &str| {
        format!(
            "<mujoco><worldbody><body pos=\"0 0 1\"><inertial pos=\"0.25 0 0\" mass=\"10\" diaginertia=\"1 1 1\"/>\
             <joint name=\"j1\" axis=\"0 1 0\" range=\"-90 90\" limited=\"true\" {joint}/>\
             <body pos=\"0.5 0 0\"><inertial pos=\"0.2 0 0\" mass=\"5\" diaginertia=\"1 1 1\"/>\
             <joint name=\"j2\" axis=\"0 1 0\" range=\"-90 90\" limited=\"true\" {joint}/><site name=\"tip\" pos=\"0.5 0 0\"/>\
             </body>{more}</body></worldbody>{actuators}</mujoco>"
        )
    };
    let held = "<actuator><position joint=\"j1\" kp=\"2000\" forcerange=\"-9 9\"/><position joint=\"j2\" kp=\"500\"/></actuator>";
    let flap = "<body><inertial pos=\"0 0 0\" mass=\"1e-9\" diaginertia=\"1e-9 1e-9 1e-9\"/><joint name=\"flap\" stiffness=\"1\"/></body>";
    let workplace = Workplace::with("own.xml", arm("", "", ""));
    let moved = |truth: &str| {
        let text = format!(
            "[robot]\nmodel = \"own.xml\"\nactuators = \"ignored\"\ncompliance_rad_per_nm = [1e-5, 2e-5]\n\
             calibration_site = \"tip\"\nmachining_site = \"tip\"\nparameters = [\"j1\", \"j2\"]\n{truth}\
             [instrument]\nsigma_mm = 0.01\nsigma_of = \"deflection\"\n[[test_pose]]\nq_deg = [10, 20]\nforce_n = [0, 0, -100]\n\
             [load]\nkind = \"fixed\"\nforce_n = [0, 0, -100]\n[design]\nexperiments = 2\n"
        );
        workplace.write("s.toml", text);
        let scenario = workplace.scenario("s.toml");
        let robot = VirtualRobot::new(&scenario.truth.robot, "tip");
        let pose = &scenario.task.test_poses[0];
        let moved = robot.map(|mut robot| {
            let [loaded, unloaded] = [&pose.load, &Load::NONE]
                .map(|load| robot.rest(&pose.configuration_rad, load).expect("stable").0);
            loaded - unloaded
        });
        moved.expect("a virtual robot")
    };
    let nominal = moved("");
    assert!((nominal.z * 1e3 + 1.229).abs() < 0.01, "{nominal}");
    let friction = "frictionloss=\"1\"";
    for (joint, more, actuators) in [
        ("", "", held),
        (friction, "", held),
        ("", "", ""),
        (friction, flap, held),
    ] {
        workplace.write("true.xml", arm(joint, more, actuators));
        let model = "[true_robot]\nmodel = \"true.xml\"\n";
        let apart = (moved(model) - nominal).norm();
        assert!(apart < 1e-9, "{joint} {more}: {apart:.1e} m");
        let twice = moved(&format!("{model}compliance_rad_per_nm = [2e-5, 4e-5]\n"));
        assert_near(twice.norm() / nominal.norm(), 2.0, 0.01);
    }
}
