//! What joints are off by over their own angles is corrected where absolute targets are asked for, and named where it cannot be.

use std::fmt::Write as _;

use elastocal::codes::{Condition, ConditionCode};
use elastocal::identification::patterns::{Against, Course, Drifting, Pattern};
use elastocal::identification::{FitChoices, ParameterGroup, ReadingWeights};
use elastocal::numeric::markov::{Correlation, Kernel, SampledFunction};
use elastocal::numeric::random::generator;
use elastocal::observation::{ObservationModel, ReadingKind};
use elastocal::parameter::{ElasticArm, ParameterSet};
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use elastocal::workflow::identify::identify_absolute;
use nalgebra::{DVector, Isometry3, Matrix6xX, Rotation3, UnitQuaternion};
use rand::Rng;
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::model_selection::{Gear, read_of, waves};
use crate::one_fit::{between, seen_arm, ur10, workplace};
use crate::support::{Workplace, list, numbers, scenario_text, setup, shipped};

/// Where the tool of a robot is that is told to stand so, as the instrument sees it.
fn stands(arm: &ElasticArm, gear: Gear<'_>, told: &DVector<f64>) -> Isometry3<f64> {
    let nothing = ParameterSet::empty();
    let mut model = ObservationModel::new(&nothing, arm, &[]);
    let setup = setup(
        DVector::from_fn(told.len(), |joint, _| {
            told[joint] + gear(joint, told[joint])
        }),
        Load::NONE,
        0,
    );
    let mut ignored = Matrix6xX::zeros(0);
    let seen = (model.predict(&setup, ReadingKind::Pose, &mut ignored)).expect("stable");
    let rotation = Rotation3::from_matrix_unchecked(seen.rotation);
    Isometry3::from_parts(
        seen.position_m.into(),
        UnitQuaternion::from_rotation_matrix(&rotation),
    )
}

/// A robot with such errors, identified from 250 readings; with the random numbers that go on.
fn identified() -> (Workplace, ElasticArm, Waves, impl Rng) {
    let mut random = generator(71, 0);
    let arm = seen_arm(&mut random, &ur10(), 1, 1);
    let waves = waves(&mut random);
    let place = workplace(&read_of(&mut random, &arm, 250, 0.0, waves.as_ref()));
    place.run(
        "identify s.toml --quiet --measurements m.csv --parameters zeros --identified-out i.json",
    );
    (place, arm, waves, random)
}

type Waves = Box<dyn Fn(usize, f64) -> f64>;

#[test]
fn absolute_targets_are_reached_by_joints_that_are_off() {
    let (place, arm, waves, mut random) = identified();
    let gear = waves.as_ref();
    let identified = place.parsed("i.json");
    let tool = identified["targets"][0]["name"].as_str().expect("a name");
    // The next campaign knows of them, but not what they are.
    let next = place.read("s.toml");
    let next = next.replacen("[robot]\n", "[robot]\nprior = \"i.json\"\n", 1);
    place.write("next.toml", next);
    let next = place.scenario("next.toml");
    let is_said = |each: &Condition| each.code == ConditionCode::SameJointErrors;
    assert!(next.doubts.iter().any(is_said), "{:?}", next.doubts);
    let mut plain = identified.clone();
    plain["discrepancy_model"] = Value::Null;
    place.write("plain.json", plain.to_string());
    let mut table = "x_mm,y_mm,z_mm,qw,qx,qy,qz\n".to_owned();
    let mut wanted = Vec::new();
    for _ in 0..40 {
        let told = DVector::from_fn(6, |_, _| between(&mut random, -2.2, 2.2));
        let pose = stands(&arm, gear, &told);
        let ([x, y, z], q) = ((pose.translation.vector * 1e3).into(), pose.rotation);
        let _: [f64; 3] = [x, y, z];
        let _ = writeln!(table, "{x},{y},{z},{},{},{},{}", q.w, q.i, q.j, q.k);
        wanted.push(pose);
    }
    place.write("t.csv", table);
    let mean_mm = |file: &str, is_corrected: bool| {
        let outcome = place.run(&format!(
            "compensate s.toml --quiet --identified {file} --targets t.csv --tool {tool} --json"
        ));
        let json = outcome.json();
        assert_eq!(json["corrects_joint_errors"], json!(is_corrected));
        let found = list(&json["targets"]);
        let off = found.iter().zip(&wanted).map(|(found, wanted)| {
            let told = numbers(&found["q_commanded_deg"]);
            let told = told.into_iter().map(f64::to_radians);
            let pose = stands(&arm, gear, &DVector::from_iterator(6, told));
            (pose.translation.vector - wanted.translation.vector).norm()
        });
        off.sum::<f64>() / wanted.len() as f64 * 1e3
    };
    let (corrected, plain) = (mean_mm("i.json", true), mean_mm("plain.json", false));
    println!("{corrected:.4} mm, {plain:.4} mm without");
    assert!(
        plain > 0.1 && corrected < 0.4 * plain,
        "{corrected} {plain}"
    );
    let outcome = place.run(&format!(
        "compensate s.toml --quiet --identified i.json --targets t.csv --tool {tool}"
    ));
    outcome.prints("what joints are off by");
    // A model has no such errors, which is said.
    let json = place.record("export s.toml --identified i.json --model-out c.xml");
    let said = list(&json["not_expressed"]).iter();
    let said: Vec<&str> = said.filter_map(Value::as_str).collect();
    assert!(
        said.iter()
            .any(|each| each.contains("off by as functions of their own angles")),
        "{said:?}"
    );
}

/// The table has the errors, and the model what goes with them: commands by both bring the tool where it is wanted.
#[test]
fn a_table_has_what_joints_are_off_by() {
    let (place, arm, waves, _) = identified();
    place.run("export s.toml --quiet --identified i.json --model-out c.xml");
    let json = place
        .record("export s.toml --identified i.json --model-out d.xml --joint-errors-out e.csv");
    let said = json["not_expressed"].to_string();
    assert!(!said.contains("off by as functions"), "{said}");
    let off = |model: &str, table: &[TableRow]| {
        let text = place.read("s.toml");
        let own = text
            .lines()
            .find(|line| line.starts_with("model ="))
            .expect("a model");
        let text = text.replace(own, &format!("model = \"{model}\""));
        place.write("calibrated.toml", text);
        let scenario = place.scenario("calibrated.toml");
        let mut said = scenario.task.belief.arm();
        said.instrument_from_base = vec![Isometry3::identity()];
        let gear = |joint: usize, angle: f64| error_at(table, &scenario, joint, angle);
        let mut random = generator(71, 1);
        let told: Vec<_> = (0..40)
            .map(|_| DVector::from_fn(6, |_, _| between(&mut random, -2.2, 2.2)))
            .collect();
        // Distances between places do not hang on where the base stands.
        let pairs = told.windows(2).map(|pair| {
            let [one, other] =
                [(&arm, waves.as_ref()), (&said, &gear as Gear<'_>)].map(|(arm, gear)| {
                    let [one, other] = [0, 1].map(|each| stands(arm, gear, &pair[each]));
                    (one.translation.vector - other.translation.vector).norm()
                });
            (one - other).abs()
        });
        pairs.sum::<f64>() / 39.0 * 1e3
    };
    let table = read_table(&place.read("e.csv"));
    let (with, without) = (off("d.xml", &table), off("c.xml", &[]));
    println!("{with:.4} mm, {without:.4} mm without");
    assert!(without > 0.1 && with < 0.4 * without, "{with} {without}");
    let mut plain = place.parsed("i.json");
    plain["discrepancy_model"] = Value::Null;
    place.write("plain.json", plain.to_string());
    let plain =
        "export s.toml --quiet --identified plain.json --model-out f.xml --joint-errors-out g.csv";
    place.refused(plain).says("--joint-errors off");
    assert!(!place.path("f.xml").exists());
}

/// A joint's name, an angle (rad), and by how much further the joint stands there (rad).
type TableRow = (String, f64, f64);

fn read_table(text: &str) -> Vec<TableRow> {
    let lines = text.lines().filter(|line| !line.starts_with('#')).skip(1);
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        assert_eq!((cells[1], cells[3]), ("deg", "mrad"));
        let [at, error] = [2, 4].map(|cell| cells[cell].parse::<f64>().expect("a number"));
        (cells[0].to_owned(), at.to_radians(), error * 1e-3)
    };
    lines.map(row).collect()
}

/// The error between the rows of a table.
fn error_at(table: &[TableRow], scenario: &Scenario, joint: usize, angle: f64) -> f64 {
    let name = &scenario.task.belief.nominal.chain.joints[joint].name;
    let own: Vec<&TableRow> = table.iter().filter(|row| row.0 == *name).collect();
    let after = own.partition_point(|row| row.1 < angle);
    match (after.checked_sub(1).map(|place| own[place]), own.get(after)) {
        (Some(one), Some(other)) => {
            let share = (angle - one.1) / (other.1 - one.1);
            one.2 + share * (other.2 - one.2)
        }
        _ => 0.0,
    }
}

/// Robots whose joints err by functions of their own angles, read while the base shifts by so much (m); whether a drift is found beside these.
fn drifts(seed: u64, shift_m: f64) -> Vec<Pattern> {
    let scenario = ur10();
    let mut random = generator(72, seed);
    let arm = seen_arm(&mut random, &scenario, 1, 1);
    let kernel = Kernel {
        correlation: Correlation::Matern32,
        length: 0.5,
        period: None,
    };
    let functions: Vec<_> = (0..6)
        .map(|joint| SampledFunction::new(kernel, generator(73, seed), joint))
        .collect();
    let gear = |joint: usize, angle: f64| 4e-4 * functions[joint].at(angle);
    let mut readings = read_of(&mut random, &arm, 150, 0.0, &gear);
    for (index, each) in readings.iter_mut().enumerate() {
        let along = index as f64 / 149.0 - 0.5;
        each.position_m.y += shift_m * along;
        each.temperature_c = Some(between(&mut random, 20.0, 25.0));
    }
    let choices = FitChoices::weighed(ReadingWeights::AsNeeded);
    let groups = [ParameterGroup::Zeros];
    let found = identify_absolute(&scenario.task.belief, &readings, &groups, choices);
    let found = found.expect("a fit").drifts.expect("joint error functions");
    assert_eq!((found.looked_at, found.kinds.len()), (16, 2));
    found.found
}

/// Drifts that joint error functions hide are named beside them, and none where there is none: of 40 files 0.4 alarms are expected at a level
/// of 1 %, and four or more in one of 1200.
#[test]
fn drifts_show_beside_joint_errors() {
    let alarms: Vec<u64> = (0..40_u64)
        .into_par_iter()
        .filter(|seed| !drifts(*seed, 0.0).is_empty())
        .collect();
    assert!(alarms.len() < 4, "{alarms:?}");
    (0..8).into_par_iter().for_each(|seed| {
        let found = drifts(seed, 3e-4);
        let first = &found[0];
        let is_it = Against::Course(Course::Order, Drifting::Base);
        assert_eq!(first.against, is_it, "{}", first.sentence);
        assert!((1e-4..4e-4).contains(&first.size), "{}", first.size);
    });
}

/// Deflections have no joint error functions: the option is refused by its name.
#[test]
fn deflections_have_no_joint_error_functions() {
    let place = Workplace::with("s.toml", scenario_text("klimchik2012"));
    let plan = shipped("scenarios/plans/klimchik2012_m3.csv");
    let measure = format!("measure s.toml --plan {plan} --measurements-out m.csv --quiet");
    place.done(&measure);
    place
        .refused("identify s.toml --measurements m.csv --joint-errors on --quiet")
        .says("holds deflections, and --joint-errors is for absolute readings");
}
