//! Compensated angles for absolute targets: MuJoCo's robot, commanded with them, stands where it should.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::num::NonZeroU32;

use elastocal::compensation::{AbsoluteTarget, InverseKinematics, Unreachable};
use elastocal::identification::JointError;
use elastocal::mujoco::Model;
use elastocal::numeric::markov::{Correlation, Kernel, MarkovProcess};
use elastocal::parameter::{ElasticArm, GearWave, WaveError};
use elastocal::robot::{EquilibriumSolver, Load, SerialChain};
use elastocal::testbed::VirtualRobot;
use nalgebra::{DVector, Isometry3, Quaternion, UnitQuaternion, Vector3};
use serde_json::Value;

use crate::support::{
    Workplace, absolute_scenario_text, assert_near, list, number, numbers, project, scenario,
    scenario_text,
};

/// A place in which a KR-270 with unknown zeros and links was identified, and written as a model.
fn identified() -> Workplace {
    let place = Workplace::new();
    let text = scenario_text("kr270_all_joints").replace(
        "parameters = [\"joint_1\", \"joint_2\", \"joint_3\", \"joint_4\", \"joint_5\", \"joint_6\"]",
        "parameters = [\"joint_1\", \"joint_2\", \"joint_3\", \"joint_4\", \"joint_5\", \"joint_6\", \"joint_3.zero\", \"link_4.x\"]",
    );
    place.write("k.toml", text);
    let mut plan = String::from(
        "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats\n",
    );
    for row in 0..24 {
        let angle = |joint: i32, from: i32, to: i32| {
            from + (row * (37 + 10 * joint) + 29 * joint) % (to - from)
        };
        let force = [[0, 0, -2500], [0, 2500, 0], [0, -2500, 0]][(row % 3).unsigned_abs() as usize];
        let _ = writeln!(
            plan,
            "{},{},{},{},{},{},{},{},{},0,0,0,1",
            angle(1, -60, 60),
            angle(2, -110, -30),
            angle(3, 30, 120),
            angle(4, -150, 150),
            angle(5, -100, 100),
            angle(6, -150, 150),
            force[0],
            force[1],
            force[2]
        );
    }
    place.write("plan.csv", plan);
    place.run("measure k.toml --plan plan.csv --measurements-out m.csv --quiet");
    place.run("identify k.toml --measurements m.csv --identified-out i.json --quiet");
    place.run("export k.toml --identified i.json --model-out true.xml --quiet");
    place
}

/// Poses along a path, from what the true robot does at configurations, with a load.
fn path(
    place: &Workplace,
    base_from_frame: &Isometry3<f64>,
) -> (String, Vec<(Isometry3<f64>, Load)>) {
    let model = Model::load(&place.path("true.xml")).expect("a model");
    let chain = SerialChain::from_model(&model).expect("an arm");
    let tool = SerialChain::tool(&model, "machining_tcp").expect("a site");
    let compliance: Vec<f64> = (chain.joints.iter())
        .map(|joint| joint.model_compliance_rad_per_nm.expect("elastic"))
        .collect();
    let mut solver = EquilibriumSolver::new(6);
    let mut text = "x_mm,y_mm,z_mm,qw,qx,qy,qz,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm\n".to_owned();
    let mut wanted = Vec::new();
    for step in 0..6 {
        let turn = f64::from(step) * 6.0;
        let q = [
            turn,
            -56.9 - turn / 3.0,
            89.3,
            45.1 + turn,
            50.0 + turn,
            57.2 - turn,
        ]
        .map(f64::to_radians);
        let load = Load {
            force_n: Vector3::new(300.0, -200.0 * f64::from(step), -500.0),
            torque_nm: Vector3::new(0.0, 20.0, 0.0),
        };
        solver
            .solve(&mut chain.at(&tool), &compliance, &q, &load)
            .expect("it rests");
        let state = solver.state();
        let turned = UnitQuaternion::from_matrix(&state.tool_rotation);
        let pose = Isometry3::from_parts(state.tool_position.into(), turned);
        let given = base_from_frame.inverse() * pose;
        let at = given.translation.vector * 1e3;
        let Quaternion { coords } = *given.rotation.quaternion();
        let force = load.force_n;
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{},{},{},0,20,0",
            at.x, at.y, at.z, coords.w, coords.x, coords.y, coords.z, force.x, force.y, force.z
        );
        wanted.push((pose, load));
    }
    (text, wanted)
}

#[test]
fn the_virtual_robot_stands_where_it_should_under_its_load() {
    let place = identified();
    // The virtual robot is the identified one.
    place.write(
        "t.toml",
        scenario_text("kr270_all_joints").replace(
            &project("models/kr270.xml").to_string_lossy().into_owned(),
            "true.xml",
        ),
    );
    let scenario = place.scenario("t.toml");
    let mut robot = VirtualRobot::new(&scenario.truth.robot, "machining_tcp").expect("a robot");
    let workpiece = elastocal::mujoco::frame(
        Vector3::new(0.5, -0.2, 0.1),
        [0.1, 0.2, 0.3].map(f64::to_radians),
    );
    for (options, frame) in [
        ("", Isometry3::identity()),
        ("--workpiece table=500,-200,100,0.1,0.2,0.3", workpiece),
    ] {
        let (text, wanted) = path(&place, &frame);
        place.write("targets.csv", text);
        let outcome = place.run(&format!("compensate k.toml --identified i.json --targets targets.csv --angles-out angles.csv --json --quiet {options}"));
        let json = outcome.json();
        assert_eq!(place.read("angles.csv").lines().count(), 2 + wanted.len());
        let said = json["frame"].as_str().expect("a text");
        assert_eq!(
            said.contains("the workpiece \"table\""),
            !options.is_empty(),
            "{said}"
        );
        assert!(
            place
                .read("angles.csv")
                .starts_with("# targets of the tool \"machining_tcp\" in the frame of")
        );
        for ((pose, load), target) in wanted.iter().zip(list(&json["targets"])) {
            let commanded: Vec<f64> = numbers(&target["q_commanded_deg"])
                .iter()
                .map(|deg| deg.to_radians())
                .collect();
            let commanded = DVector::from_vec(commanded);
            let (position, axes, _) = robot.rest(&commanded, load).expect("it rests");
            let off_m = (position - pose.translation.vector).norm();
            let turned = UnitQuaternion::from_matrix(&axes).angle_to(&pose.rotation);
            assert!(off_m < 1e-8 && turned < 1e-8, "{off_m:e} m, {turned:e} rad");
        }
    }
}

#[test]
fn what_is_out_of_reach_is_named() {
    let place = identified();
    place.write("targets.csv", "x_mm,y_mm,z_mm\n1500,100,1200\n9000,0,0\n");
    place
        .doubted("compensate k.toml --identified i.json --targets targets.csv --angles-out angles.csv --quiet")
        .says("condition C0306: target 2 (line 3) cannot be reached: the tool stays");
    assert_eq!(place.read("angles.csv").lines().count(), 3);
    place
        .refused("compensate k.toml --identified i.json --targets targets.csv --quiet --frame instrument")
        .says("was identified from deflections");
    for (text, said) in [
        ("x_mm,y_mm\n1,2\n", "z_mm"),
        (
            "x_mm,y_mm,z_mm,qw\n1,2,3,1\n",
            "these columns come together",
        ),
        (
            "x_mm,y_mm,z_mm,qw,qx,qy,qz\n1,2,3,1,1,0,0\n",
            "line 2: qw,qx,qy,qz: found a quaternion of length 1.414214",
        ),
    ] {
        place.write("targets.csv", text);
        place
            .refused("compensate k.toml --identified i.json --targets targets.csv --quiet")
            .says(said);
    }
}

/// The numbers of some columns of a table that a command wrote.
fn columns(place: &Workplace, file: &str, named: &[&str]) -> Vec<Vec<f64>> {
    let text = place.read(file);
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let heads: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let of_line = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        let field = |name: &&str| {
            let place = heads
                .iter()
                .position(|head| head == name)
                .expect("a column");
            fields[place].parse().expect("a number")
        };
        named.iter().map(field).collect()
    };
    lines.map(of_line).collect()
}

const ANGLES: [&str; 6] = ["q1_deg", "q2_deg", "q3_deg", "q4_deg", "q5_deg", "q6_deg"];

/// A UR10's angles (deg), others for each number.
fn spread_angles(number: i32) -> String {
    let middles = [0, -90, 55, 0, 0, 0];
    let ranges = [340, 60, 90, 340, 340, 340];
    let angle = |joint: usize| {
        let step = number * (37 + 22 * i32::try_from(joint).expect("few")) + 29;
        middles[joint] - ranges[joint] / 2 + step % ranges[joint]
    };
    let angles: Vec<String> = (0..6).map(|joint| angle(joint).to_string()).collect();
    angles.join(",")
}

/// The UR10, whose spindle is read so precisely.
fn spindle_scenario(sigma_mm: &str) -> String {
    absolute_scenario_text("ur10")
        .replace("\"reflector\"", "\"spindle\"")
        .replace("sigma_mm = 0.02", &format!("sigma_mm = {sigma_mm}"))
        .replace("tool_height_min_mm = 300", "tool_height_min_mm = 20")
        .replace("tool_radius_min_mm = 400", "tool_radius_min_mm = 10")
}

/// What is predicted of commands for targets is observed on MuJoCo's robots, whose zeros and links are sampled: the mean square over 40 robots
/// within three of its standard errors.
#[test]
fn the_predicted_accuracy_is_observed() {
    let place = Workplace::new();
    let sources = "\n[[uncertainty]]\nkind = \"joint_zero\"\nstd_mrad = 0.5\n\n[[uncertainty]]\nkind = \"link_position\"\nstd_mm = 0.3\n";
    place.write("s.toml", spindle_scenario("0.02") + sources);
    place.write("exact.toml", spindle_scenario("1e-6") + sources);
    let head = ANGLES.join(",") + ",fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats,target\n";
    let row = |number: i32| {
        let force_n = -98 * (number % 2);
        let angles = spread_angles(number);
        format!("{angles},0,0,{force_n},0,0,0,1,spindle\n")
    };
    let rows = |numbers: std::ops::Range<i32>| numbers.map(row).collect::<String>();
    place.write("plan.csv", head.clone() + &rows(0..20));
    place.write("other.csv", head.clone() + &rows(70..76));
    let axes = ["x_mm", "y_mm", "z_mm"];
    let square = |numbers: &[f64]| numbers.iter().map(|each| each * each).sum::<f64>();
    let (mut observed, mut predicted) = (Vec::new(), Vec::new());
    for seed in 1..=40 {
        let measure = |scenario: &str, plan: &str, file: &str| {
            let files = format!("--plan {plan} --measurements-out {file}");
            place.run(&format!("measure {scenario} {files} --seed {seed} --quiet"));
            columns(&place, file, &axes)
        };
        measure("s.toml", "plan.csv", "m.csv");
        place.run("identify s.toml --measurements m.csv --identified-out i.json --quiet");
        let wanted = measure("s.toml", "other.csv", "o.csv");
        let lines = wanted
            .iter()
            .map(|row| format!("{},{},{}\n", row[0], row[1], row[2]));
        place.write("t.csv", axes.join(",") + "\n" + &lines.collect::<String>());
        let command =
            "compensate s.toml --identified i.json --targets t.csv --angles-out a.csv --quiet";
        place.run(command);
        let mut again = head.clone();
        for angles in columns(&place, "a.csv", &ANGLES) {
            let angles: Vec<String> = angles.iter().map(ToString::to_string).collect();
            let _ = writeln!(again, "{},0,0,0,0,0,0,1,spindle", angles.join(","));
        }
        place.write("again.csv", again);
        let stands = measure("exact.toml", "again.csv", "again_m.csv");
        assert_eq!(stands.len(), 6);
        let off = |(one, other): (&Vec<f64>, &Vec<f64>)| {
            square(&[one[0] - other[0], one[1] - other[1], one[2] - other[2]])
        };
        observed.push(wanted.iter().zip(&stands).map(off).sum::<f64>() / 6.0);
        let told = columns(&place, "a.csv", &["predicted_mm"]).concat();
        predicted.push(square(&told) / 6.0);
    }
    let mean = |all: &[f64]| all.iter().sum::<f64>() / 40.0;
    let (seen, told) = (mean(&observed), mean(&predicted));
    let spread: Vec<f64> = observed.iter().map(|each| (each - seen).powi(2)).collect();
    let error = (mean(&spread) / 39.0).sqrt();
    assert_near(seen, told, 3.0 * error);
    assert!(told > 1e-4, "{told}");
}

/// Joints whose gears are not round and that have gaps: MuJoCo's robot is where it should be, to some micrometres, where commands for
/// springs and zeros alone leave a millimetre.
#[test]
fn gears_and_gaps_are_corrected() {
    let place = Workplace::new();
    let sources = "\n[[uncertainty]]\nkind = \"transmission_error\"\nstd_mrad = 1\nharmonics = [2]\n\n\
                   [[uncertainty]]\nkind = \"backlash\"\nstd_arcsec = 60\n";
    place.write("s.toml", spindle_scenario("0.001") + sources);
    let angles = ANGLES;
    let head = angles.join(",") + ",approach,target\n";
    let row = |number: i32| {
        let side = if number % 2 == 0 { "+" } else { "-" };
        format!("{},{side},spindle\n", spread_angles(number))
    };
    let rows = |numbers: std::ops::Range<i32>| numbers.map(row).collect::<String>();
    place.write("plan.csv", head.clone() + &rows(0..60));
    place.write("other.csv", head + &rows(70..76));
    place.run("measure s.toml --plan plan.csv --measurements-out m.csv --quiet");
    place.run("identify s.toml --measurements m.csv --parameters compliances --identified-out i.json --quiet");
    place.run("measure s.toml --plan other.csv --measurements-out o.csv --quiet");
    let axes = ["x_mm", "y_mm", "z_mm"];
    let lines = |rows: &[Vec<f64>], more: &str| -> String {
        let line = |row: &Vec<f64>| {
            let fields: Vec<String> = row.iter().map(ToString::to_string).collect();
            fields.join(",") + more + "\n"
        };
        rows.iter().map(line).collect()
    };
    let mut wanted = columns(&place, "o.csv", &axes);
    for each in wanted.iter_mut().flatten() {
        *each += 1.0;
    }
    place.write("t.csv", axes.join(",") + "\n" + &lines(&wanted, ""));
    place.run("compensate s.toml --identified i.json --targets t.csv --angles-out a.csv --quiet");
    let commanded = columns(&place, "a.csv", &angles);
    let head = angles.join(",") + ",target\n";
    place.write("again.csv", head + &lines(&commanded, ",spindle"));
    place.run("measure s.toml --plan again.csv --measurements-out again_m.csv --quiet");
    let seen = columns(&place, "again_m.csv", &axes);
    assert_eq!(seen.len(), 6);
    for (wanted, seen) in wanted.iter().zip(&seen) {
        let off = Vector3::from_column_slice(wanted) - Vector3::from_column_slice(seen);
        assert!(off.norm() < 0.01, "{off}");
    }
}

/// The zero of the last axis cannot be told from where the reflector is on the flange: a tool on that axis stands where it does all the same,
/// and of one beside it nothing is known.
#[test]
fn a_tool_that_was_not_read_may_depend_on_what_is_redundant() {
    for (machining, is_predicted) in [("spindle", true), ("side", false)] {
        let place = Workplace::new();
        let side =
            "\n[[robot.tool]]\nname = \"side\"\non = \"spindle\"\nposition_mm = [100, 0, 0]\n";
        let own = "machining_site = \"spindle\"";
        let text = absolute_scenario_text("ur10")
            .replace(own, &format!("machining_site = \"{machining}\""))
            .replace("tool_height_min_mm = 300", "tool_height_min_mm = -2000")
            .replace("tool_radius_min_mm = 400", "tool_radius_min_mm = 1");
        place.write("s.toml", text + side);
        let rows = (0..40).map(|number| spread_angles(number) + ",reflector\n");
        place.write(
            "plan.csv",
            ANGLES.join(",") + ",target\n" + &rows.collect::<String>(),
        );
        place.run("measure s.toml --plan plan.csv --measurements-out m.csv --quiet");
        let found = place.record(
            "identify s.toml --measurements m.csv --parameters zeros --identified-out i.json",
        );
        assert!(found["left_out"].to_string().contains("wrist_3.zero"));
        place.write("t.csv", "x_mm,y_mm,z_mm\n600,300,500\n-500,400,700\n");
        for (tool, is_predicted) in [("reflector", true), (machining, is_predicted)] {
            let json = place.record(&format!(
                "compensate s.toml --identified i.json --targets t.csv --frame base --tool {tool}"
            ));
            for target in list(&json["targets"]) {
                assert!(target["q_commanded_deg"].is_array(), "{target}");
                let predicted_mm = &target["predicted_mm"];
                assert_eq!(predicted_mm.is_number(), is_predicted, "{tool}: {target}");
            }
        }
    }
}

/// Where the first tool of an arm is whose joints are told to stand so (m).
fn rests_m(arm: &ElasticArm, standing: &[f64]) -> Vector3<f64> {
    let chain = arm.loaded_chain();
    let mut solver = EquilibriumSolver::new(chain.len());
    let (mut loaded, compliance) = (chain.at(&arm.tools[0]), &arm.compliance_rad_per_nm);
    (solver.solve(&mut loaded, compliance, standing, &Load::NONE)).expect("it rests");
    solver.state().tool_position
}

/// A search that ends a whole turn away commands a joint within its range, by what the joint is off by there.
#[test]
fn errors_of_joints_are_those_within_their_ranges() {
    let scenario = scenario("kr270");
    let arm = scenario.task.belief.arm();
    let stands = scenario.task.test_poses[0].configuration_rad.clone();
    let joint = 1;
    let kernel = Kernel {
        correlation: Correlation::Exponential,
        length: 0.5,
        period: None,
    };
    let process = MarkovProcess {
        knots: vec![stands[joint] - 0.4, stands[joint] + 0.5],
        kernel,
    };
    let errors = [JointError {
        joint,
        turn_about: None,
        process,
        deviation: 1e-3,
        repeatability: 0.0,
        values: vec![1e-3, 2e-3],
        spread_of_positions: Vec::new(),
        spread_of_rotations: Vec::new(),
    }];
    let target = AbsoluteTarget {
        position_m: rests_m(&arm, stands.as_slice()),
        rotation: None,
        load: Load::NONE,
    };
    for turns in [0.0, 1.0, -1.0] {
        let mut start = stands.clone();
        start[joint] += turns * TAU;
        let found = InverseKinematics::new(&arm, 0, &errors).commands(&target, &[start]);
        let mut standing = found.expect("commands");
        let off = errors[0].at(standing.as_slice());
        assert!(off > 5e-4, "{off}");
        standing[joint] += off;
        let off_m = (rests_m(&arm, standing.as_slice()) - target.position_m).norm();
        assert!(off_m < 1e-9, "{turns}: {off_m}");
    }
}

/// What joints stand off changes nearly as fast as they turn: the tool is where it should be all the same. Where it changes faster, a
/// command is right, or there is none.
#[test]
fn steep_gear_errors_are_corrected_or_refused() {
    let scenario = scenario("ur10");
    let stands = scenario.task.test_poses[0].configuration_rad.clone();
    for (slope, joint) in [(0.5, 1), (0.95, 2), (3.0, 3)] {
        let mut arm = scenario.task.belief.arm();
        let per_turn = NonZeroU32::new(360).expect("not zero");
        arm.gear_waves = vec![WaveError {
            joint,
            wave: GearWave::both(per_turn)[0],
            amplitude_rad: slope / 360.0,
        }];
        let place = |standing: &[f64]| rests_m(&arm, standing);
        let mut refused = 0;
        for number in 0..12 {
            let stands = stands.add_scalar(0.003 * f64::from(number));
            let target = AbsoluteTarget {
                position_m: place(stands.as_slice()),
                rotation: None,
                load: Load::NONE,
            };
            let found = InverseKinematics::new(&arm, 0, &[]).commands(&target, &[stands]);
            let Ok(commands) = found else {
                assert_eq!(found, Err(Unreachable::Unsettled { joint }));
                refused += 1;
                continue;
            };
            let offsets = arm.offsets_rad(commands.as_slice(), 0, &Load::NONE, None);
            let standing = commands.iter().zip(&offsets);
            let standing: Vec<f64> = standing.map(|(q, off)| q + off).collect();
            let off_m = (place(&standing) - target.position_m).norm();
            assert!(off_m < 1e-9, "{slope}: {off_m}");
        }
        assert!(slope > 1.0 || refused == 0, "{slope}: {refused}");
    }
}

/// The load hangs on the calibration tool: where another target that is read is believed to be says nothing of what it bends.
#[test]
fn loads_hang_on_the_calibration_tool() {
    let place = Workplace::new();
    let text = absolute_scenario_text("ur10")
        .replace("sigma_mm = 0.02", "sigma_mm = 0.001")
        .replace("tool_height_min_mm = 300", "tool_height_min_mm = -2000")
        .replace("tool_radius_min_mm = 400", "tool_radius_min_mm = 1")
        .replace(
            "kind = \"fixed\"\nforce_n = [0, 0, -98]",
            "kind = \"list\"\nwrenches = [{ force_n = [0, 0, -98] }, { force_n = [0, 98, 0] }]",
        );
    for (name, x_mm) in [("true.toml", 80), ("believed.toml", 89)] {
        let corner = format!(
            "\n[[robot.tool]]\nname = \"corner\"\non = \"spindle\"\nposition_mm = [{x_mm}, 30, 20]\n"
        );
        place.write(name, text.clone() + &corner);
    }
    let mut plan =
        "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,target\n"
            .to_owned();
    let ranges = [
        (-170, 340),
        (-120, 80),
        (20, 100),
        (-150, 120),
        (-170, 340),
        (-170, 340),
    ];
    for row in 0..24 {
        let steps = [61, 37, 29, 43, 71, 53].iter().zip(ranges);
        let angles = steps.map(|(step, (from, width))| (from + row * step % width).to_string());
        let angles = angles.collect::<Vec<_>>().join(",");
        for force in ["0,0,0", "0,0,-98", "0,98,0"] {
            for target in ["reflector", "corner"] {
                let _ = writeln!(plan, "{angles},{force},0,0,0,{target}");
            }
        }
    }
    place.write("plan.csv", plan);
    place.run("measure true.toml --plan plan.csv --measurements-out m.csv --quiet");
    let found = ["true.toml", "believed.toml"].map(|name| {
        let json = place.json(&format!(
            "identify {name} --measurements m.csv --parameters compliances"
        ));
        let unknowns = list(&json["unknowns"]).clone();
        let of = |each: &Value| (number(&each["value"]), number(&each["standard_error"]));
        let compliances = unknowns.iter().filter(|each| {
            let name = each["name"].as_str().expect("a name");
            name.ends_with(".compliance")
        });
        compliances.map(of).collect::<Vec<_>>()
    });
    assert_eq!(found[0].len(), 6);
    for (one, other) in found[0].iter().zip(&found[1]) {
        assert!((one.0 - other.0).abs() < 0.05 * one.1, "{one:?} {other:?}");
        assert!((one.1 / other.1 - 1.0).abs() < 0.01, "{one:?} {other:?}");
    }
}

/// Of an arm whose axes are all vertical neither the tool's height nor the base's can be told, and their sum is: a tool that is read itself is
/// commanded with an accuracy.
#[test]
fn a_tool_that_was_read_has_an_accuracy_where_its_height_is_redundant() {
    const MODEL: &str = r#"<mujoco><compiler angle="degree"/><worldbody><body name="l1" pos="0 0 0.5"><inertial pos="0.2 0 0" mass="12" diaginertia="0.1 0.3 0.3"/>
<joint name="A1" axis="0 0 1" range="-140 140"/><body name="l2" pos="0.4 0 0"><inertial pos="0.15 0 0" mass="7" diaginertia="0.1 0.2 0.2"/>
<joint name="A2" axis="0 0 1" range="-145 145"/><body name="l3" pos="0.35 0 0"><inertial pos="0 0 -0.1" mass="3" diaginertia="0.02 0.02 0.01"/>
<joint name="Z" type="slide" axis="0 0 1" range="-0.3 0.05"/><site name="tool" pos="0.08 0.03 -0.25"/><site name="mill" pos="0.02 0 -0.3"/>
</body></body></body></worldbody><actuator><position joint="A1" kp="60000"/><position joint="A2" kp="40000"/><position joint="Z" kp="300000"/></actuator></mujoco>"#;
    const SCENARIO: &str = r#"[robot]
model = "arm.xml"
calibration_site = "tool"
machining_site = "mill"
parameters = ["A1", "A2", "Z"]
[instrument]
sigma_mm = 0.03
sigma_of = "position"
[[uncertainty]]
kind = "joint_zero"
joints = ["A1", "A2"]
std_mrad = 0.2
[[test_pose]]
q_deg = [30, 50, 0]
force_n = [0, 20, -20]
[load]
kind = "fixed"
force_n = [400, 0, -400]
[region]
[design]
accuracy = "absolute"
experiments = 8
[[station]]
name = "A"
position_mm = [2500, -2000, 1200]
"#;
    let place = Workplace::of_arm(MODEL, SCENARIO);
    let mut plan = String::from(
        "q1_deg,q2_deg,q3_mm,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats,target,station\n",
    );
    for row in 0..12 {
        let q = [
            row * 53 % 200 - 100,
            row * 71 % 220 - 110,
            -(row * 37 % 300),
        ];
        let force = ["0,0,0", "400,0,-400"][usize::from(row % 2 == 1)];
        let _ = writeln!(plan, "{},{},{},{force},0,0,0,2,mill,A", q[0], q[1], q[2]);
    }
    place.write("plan.csv", plan);
    place.write(
        "t.csv",
        "x_mm,y_mm,z_mm,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm\n450,300,100,0,20,-20,0,0,0\n",
    );
    let all = "--parameters zeros,compliances --identified-out i.json --quiet";
    place.done("measure arm.toml --plan plan.csv --measurements-out m.csv --quiet");
    place.run(&format!("identify arm.toml --measurements m.csv {all}"));
    let left_out = place.read("i.json");
    assert!(left_out.contains("\"tool.z\""), "{left_out}");
    let predicted_mm = |targets: &str| {
        let command =
            format!("compensate arm.toml --identified i.json --targets {targets} --frame base");
        let told = place.json(&command);
        told["targets"][0]["predicted_mm"]
            .as_f64()
            .expect("a number")
    };
    let read_itself_mm = predicted_mm("t.csv");
    assert!((0.01..0.2).contains(&read_itself_mm), "{read_itself_mm}");
    // Compliances are known no better than the load cell, and a target's load bends the arm by them: 6 mm.
    let heavy = place.read("t.csv").replace("0,20,-20", "0,1000,0");
    place.write("heavy.csv", heavy);
    let known_mm = predicted_mm("heavy.csv");
    let cell = "[[uncertainty]]\nkind = \"load_scale\"\nstd_relative = 0.1\n";
    place.write("arm.toml", format!("{SCENARIO}{cell}"));
    place.done("measure arm.toml --plan plan.csv --measurements-out m.csv --quiet");
    place.run(&format!("identify arm.toml --measurements m.csv {all}"));
    let by_cell_mm = predicted_mm("heavy.csv");
    assert!(by_cell_mm > 3.0 * known_mm, "{by_cell_mm} {known_mm}");
}
