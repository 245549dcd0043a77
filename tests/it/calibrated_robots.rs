//! A robot from absolute readings, further on: as a model, and compensated with, at test poses and for absolute targets.

use std::fmt::Write as _;

use elastocal::identification::{AbsoluteCase, ParameterGroup, ReadingWeights};
use elastocal::measurement::{AbsoluteReading, absolute_table};
use elastocal::mujoco::Model;
use elastocal::numeric::random::generator;
use elastocal::observation::{ObservationModel, ReadingKind, Setup};
use elastocal::parameter::{ElasticArm, ParameterKind, ParameterSet};
use elastocal::robot::{EquilibriumSolver, Load, SerialChain};
use nalgebra::{
    DVector, Isometry3, Matrix6, Matrix6xX, Rotation3, UnitQuaternion, Vector3, Vector6,
};
use rand::{Rng, RngExt};

use crate::support::{
    Workplace, blank_reading, force, list, numbers, scenario, ur10_under_any_load,
};

/// What the instrument sees of an arm's only tool.
fn seen(arm: &ElasticArm, q: &DVector<f64>, load: &Load, station: usize) -> Isometry3<f64> {
    let nothing = ParameterSet::empty();
    let mut model = ObservationModel::new(&nothing, arm, &[]);
    let setup = Setup {
        hangs_on: None,
        commanded_rad: q.clone(),
        load: *load,
        target: 0,
        station,
        approach: None,
    };
    let mut ignored = Matrix6xX::zeros(0);
    let seen = model
        .predict(&setup, ReadingKind::Pose, &mut ignored)
        .expect("stable");
    let turned =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(seen.rotation));
    Isometry3::from_parts(seen.position_m.into(), turned)
}

fn configuration(random: &mut impl Rng, joints: usize) -> DVector<f64> {
    DVector::from_fn(joints, |_, _| random.random_range(-2.0..=2.0))
}

fn load(random: &mut impl Rng) -> Load {
    force(Vector3::from_fn(|_, _| random.random_range(-90.0..=90.0)))
}

/// Exact readings, said to be precise, of an arm from its stations.
fn readings(random: &mut impl Rng, arm: &ElasticArm, count: usize) -> Vec<AbsoluteReading> {
    let variances = [1e-6_f64, 1e-6].map(|sigma| sigma * sigma);
    let stations = arm.instrument_from_base.len();
    (0..count)
        .map(|index| {
            let configuration_rad = configuration(random, arm.chain.len());
            let load = if index % 3 == 0 {
                Load::NONE
            } else {
                load(random)
            };
            let seen = seen(arm, &configuration_rad, &load, index % stations);
            AbsoluteReading {
                configuration_rad,
                load,
                target: Some(arm.tools[0].name.clone()),
                station: (stations > 1).then(|| format!("S{}", index % stations)),
                position_m: seen.translation.vector,
                rotation: Some(seen.rotation),
                covariance: Some(Matrix6::from_diagonal(&Vector6::from_fn(|row, _| {
                    variances[row / 3]
                }))),
                ..blank_reading()
            }
        })
        .collect()
}

/// A UR10 that is not as its model has it, with its reflector and the instrument somewhere; it is seen, and identified to
/// `i.json`.
fn laboratory(stations: usize) -> (Workplace, ElasticArm) {
    let mut random = generator(31, stations as u64);
    let scenario = scenario("ur10");
    let belief = &scenario.task.belief;
    let mut nominal = belief.arm();
    nominal.tools.truncate(1);
    nominal.tools[0].link_from_tool = Isometry3::new(
        Vector3::new(0.05, -0.03, 0.12),
        Vector3::new(0.4, -0.3, 0.8),
    );
    nominal.instrument_from_base = (0..stations)
        .map(|station| {
            let off = station as f64;
            Isometry3::new(
                Vector3::new(2.0, off - 1.0, 0.3),
                Vector3::new(0.2, -0.1, 2.0 + off),
            )
        })
        .collect();
    // What the fit itself leaves out stays as it is.
    let groups = [ParameterGroup::Geometry, ParameterGroup::Compliances];
    let dry = readings(&mut random, &nominal, 60);
    let fit = AbsoluteCase::new(belief, &dry)
        .and_then(|mut case| case.fit(&groups, ReadingWeights::Own))
        .expect("a fit");
    let values: Vec<f64> = (fit.set.parameters().iter())
        .map(|each| {
            let draw = random.random_range(-1.0..=1.0);
            match each.kind {
                kind if kind.is_mounted() => 0.0,
                ParameterKind::JointCompliance { .. } => each.nominal * (1.0 + 0.3 * draw),
                _ => each.nominal + 2e-3 * draw,
            }
        })
        .collect();
    let truth = fit.set.apply(&nominal, &values);
    let place = Workplace::with("s.toml", ur10_under_any_load());
    let all = readings(&mut random, &truth, 90);
    place.write("m.csv", absolute_table(&6.into(), &all));
    place
        .done("identify s.toml --quiet --measurements m.csv --parameters geometry,compliances --noise-only --identified-out i.json");
    (place, truth)
}

/// The base in the instrument's frame, as a file of `identify` has it.
fn station_of(place: &Workplace, index: usize) -> Isometry3<f64> {
    let json = place.parsed("i.json");
    let frame = &json["stations"][index];
    let at = Vector3::from_vec(numbers(&frame["position_mm"])) * 1e-3;
    let turned = numbers(&frame["quaternion"]);
    let turned = nalgebra::Quaternion::new(turned[0], turned[1], turned[2], turned[3]);
    Isometry3::from_parts(at.into(), UnitQuaternion::from_quaternion(turned))
}

/// The model that is written stands and bends as the robot that was read, wherever it is commanded.
#[test]
fn the_robot_of_absolute_readings_becomes_a_model() {
    let (place, truth) = laboratory(1);
    let json = place.json("export --identified i.json --model-out c.xml");
    for key in ["place_difference_mm", "deflection_difference_mm"] {
        assert!(json[key].as_f64().expect("a number") < 1e-6, "{json}");
    }
    let apart = json["not_expressed"].to_string();
    assert!(apart.contains("the base = ("), "{apart}");
    let model = Model::load(&place.path("c.xml")).expect("a model");
    let chain = SerialChain::from_model(&model).expect("an arm");
    let tool = SerialChain::tool(&model, "reflector").expect("a site");
    let compliance: Vec<f64> = (chain.joints.iter())
        .map(|joint| joint.model_compliance_rad_per_nm.expect("elastic"))
        .collect();
    let station = station_of(&place, 0);
    let mut solver = EquilibriumSolver::new(6);
    let mut random = generator(32, 0);
    for _ in 0..20 {
        let (q, load) = (configuration(&mut random, 6), load(&mut random));
        let mut arm = chain.at(&tool);
        solver
            .solve(&mut arm, &compliance, q.as_slice(), &load)
            .expect("it rests");
        let found = station * nalgebra::Point3::from(solver.state().tool_position);
        // The scenario's load acts where the calibration tool is believed to be, as it did for the readings.
        let expected = seen(&truth, &q, &load, 0).translation.vector;
        let off_m = (found.coords - expected).norm();
        assert!(off_m < 1e-6, "{off_m:e} m");
    }
    let text = place.read("c.xml");
    for kept in [
        "elastocal_covariance",
        "elastocal_parameters",
        "elastocal_provenance",
    ] {
        assert_eq!(text.matches(kept).count(), 1, "{kept}");
    }
    // It is the model of a scenario again.
    let again = place
        .read("s.toml")
        .lines()
        .filter(|line| !line.starts_with("compliance_rad_per_nm"))
        .map(|line| {
            if line.starts_with("model") {
                "model = \"c.xml\""
            } else {
                line
            }
        })
        .fold(String::new(), |text, line| text + line + "\n");
    place.write("again.toml", again);
    place.done("check again.toml --quiet");
}

/// At the compensated test pose the loaded tool of the identified robot rests where the unloaded one does.
#[test]
fn test_poses_are_compensated_with_the_robot_of_absolute_readings() {
    let (place, _) = laboratory(1);
    let json = place.json("compensate --identified i.json --angles-out a.csv");
    let rho0_mm = json["rho0_mm"].as_f64().expect("a number");
    assert!((1e-6..1.0).contains(&rho0_mm), "{rho0_mm}");
    place.json("export --identified i.json --model-out c.xml");
    let model = Model::load(&place.path("c.xml")).expect("a model");
    let chain = SerialChain::from_model(&model).expect("an arm");
    let tool = SerialChain::tool(&model, "spindle").expect("a site");
    let compliance: Vec<f64> = (chain.joints.iter())
        .map(|joint| joint.model_compliance_rad_per_nm.expect("elastic"))
        .collect();
    let mut solver = EquilibriumSolver::new(6);
    let mut rest = |q_deg: &[f64], load: &Load| {
        let q: Vec<f64> = q_deg.iter().map(|deg| deg.to_radians()).collect();
        solver
            .solve(&mut chain.at(&tool), &compliance, &q, load)
            .expect("it rests");
        solver.state().tool_position
    };
    let task = Load::force(10.0, -20.0, -50.0);
    let wanted = rest(&[20.0, -60.0, 80.0, -110.0, -70.0, 30.0], &Load::NONE);
    let found = rest(&numbers(&json["q_commanded_deg"]), &task);
    assert!(
        (found - wanted).norm() < 1e-8,
        "{}",
        (found - wanted).norm()
    );
}

/// Held-out poses that the instrument saw are targets: commanded with the angles for them, the true robot is there again.
#[test]
fn absolute_targets_are_reached_in_the_instrument_s_frame() {
    let (place, truth) = laboratory(2);
    let mut random = generator(34, 0);
    let workpiece = Isometry3::from_parts(
        Vector3::new(0.5, -0.2, 0.1).into(),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 30_f64.to_radians()),
    );
    for (options, station, frame, said) in [
        (
            "--station S0",
            0,
            Isometry3::identity(),
            "the instrument's frame at station \"S0\"",
        ),
        (
            "--station S1",
            1,
            Isometry3::identity(),
            "the instrument's frame at station \"S1\"",
        ),
        (
            "--station S1 --workpiece table=500,-200,100,0,0,30",
            1,
            workpiece,
            "the workpiece \"table\", which stands at (500, -200, 100) mm and (0, 0, 30) deg in the instrument's frame at station \"S1\"",
        ),
    ] {
        let mut table = "x_mm,y_mm,z_mm,qw,qx,qy,qz,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm\n".to_owned();
        let mut wanted = Vec::new();
        for _ in 0..6 {
            let (q, load) = (configuration(&mut random, 6), load(&mut random));
            let pose = seen(&truth, &q, &load, station);
            let given = frame.inverse() * pose;
            let (at, turned) = (given.translation.vector * 1e3, given.rotation.coords);
            let force = load.force_n;
            let _ = writeln!(
                table,
                "{},{},{},{},{},{},{},{},{},{},0,0,0",
                at.x, at.y, at.z, turned.w, turned.x, turned.y, turned.z, force.x, force.y, force.z
            );
            wanted.push((pose, load));
        }
        place.write("t.csv", table);
        let json = place.json(&format!(
            "compensate --identified i.json --targets t.csv --tool reflector --angles-out a.csv {options}"
        ));
        assert!(
            json["frame"].as_str().expect("a text").ends_with(said),
            "{}",
            json["frame"]
        );
        assert_eq!(json["tool_is_identified"], true);
        let csv = place.read("a.csv");
        assert!(csv.lines().next().expect("a line").ends_with(said), "{csv}");
        assert_eq!(csv.lines().count(), 2 + wanted.len());
        let targets = list(&json["targets"]);
        for (target, (pose, load)) in targets.iter().zip(&wanted) {
            let q: Vec<f64> = (numbers(&target["q_commanded_deg"]).iter())
                .map(|deg| deg.to_radians())
                .collect();
            let found = seen(&truth, &DVector::from_vec(q), load, station);
            let off_m = (found.translation.vector - pose.translation.vector).norm();
            let turned = found.rotation.angle_to(&pose.rotation);
            assert!(off_m < 1e-6 && turned < 1e-6, "{off_m:e} m, {turned:e} rad");
        }
    }
}

#[test]
fn what_absolute_targets_need_is_said() {
    let (place, _) = laboratory(2);
    place.write("t.csv", "x_mm,y_mm,z_mm\n2400,-1000,900\n1,2,99999\n");
    let command = "compensate --identified i.json --targets t.csv --quiet";
    place
        .doubted(&format!("{command} --station S0"))
        .says("condition C0306: target 2 (line 3) cannot be reached: the tool stays ");
    for (more, words) in [
        ("", "i.json: the instrument had several stations"),
        ("", "--station: S0, S1"),
        ("--station S7", "--station: found \"S7\""),
        (
            "--station S0 --frame base",
            "--station is for targets in the instrument's frame",
        ),
        (
            "--station S0 --tool cat",
            "--tool: found \"cat\"; allowed are: reflector, spindle",
        ),
    ] {
        place.refused(&format!("{command} {more}")).says(words);
    }
    place
        .misused(&format!("{command} --workpiece table=1,2"))
        .says("table=500,0,200,0,0,90");
    for (text, words) in [
        ("x_mm,y_mm\n1,2\n", "z_mm"),
        ("x_mm,y_mm,z_mm\n1,2,cat\n", "line 2"),
        ("x_mm,y_mm,z_mm\n1,2,NaN\n", "line 2"),
        ("x_mm,y_mm,z_mm\n", "t.csv"),
    ] {
        place.write("t.csv", text);
        place
            .refused(&format!("{command} --station S0"))
            .says(words);
    }
    // What somebody wrote into the file of the identification.
    let text = place.read("i.json");
    for (key, to, words) in [
        ("position_mm", "position_mn", "position_mm"),
        (
            "\"elbow.compliance\"",
            "\"knee.compliance\"",
            "w.json: unknowns[",
        ),
        (
            "\"name\": \"reflector\"",
            "\"name\": \"mirror\"",
            "w.json: targets[0].name",
        ),
    ] {
        assert!(text.contains(key), "{key}");
        place.write("w.json", text.replacen(key, to, 1));
        for command in ["export --model-out c.xml", "compensate"] {
            place
                .refused(&format!("{command} --identified w.json --quiet"))
                .says(words);
        }
    }
    let mut json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    for key in ["value", "standard_error", "interval95"] {
        let mut altered = json.clone();
        let number = &mut altered["unknowns"][0][key];
        *number = match number.as_f64() {
            Some(value) => serde_json::json!(value * 1.01),
            None => serde_json::json!([0.0, number[1]]),
        };
        place.write("w.json", altered.to_string());
        let outcome = place.run("export --identified w.json --model-out c.xml --quiet");
        outcome.ends_with(1).says("the file was altered");
    }
    json["covariance"].as_array_mut().expect("a list").pop();
    place.write("w.json", json.to_string());
    place
        .refused("export --identified w.json --model-out c.xml --quiet")
        .says("w.json: covariance");
    assert!(!place.path("c.xml").exists());
}
