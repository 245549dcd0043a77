//! What a command writes the next one reads, whatever is uncertain: of deflections, of positions and of poses.

use std::fmt::Write as _;

use elastocal::measurement::{AbsoluteReading, absolute_table};
use elastocal::numeric::random::generator;
use elastocal::observation::{ObservationModel, ReadingKind};
use elastocal::parameter::ParameterSet;
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use nalgebra::{DVector, Isometry3, Matrix6, Matrix6xX, Rotation3, UnitQuaternion, Vector3};
use rand::RngExt;

use crate::support::{Outcome, Workplace, blank_reading, force, setup};

const MODEL: &str = r#"<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <site name="anchor" pos="-0.3 0 0.5"/>
    <site name="tracker" pos="2.5 -1 1"/>
    <body name="link_1" pos="0 0 0.6">
      <inertial pos="0 0 -0.1" mass="20" diaginertia="0.3 0.3 0.2"/>
      <joint name="a1" axis="0 0 1" range="-2.9 2.9"/>
      <body name="link_2" pos="0.1 0 0.3">
        <inertial pos="0.3 0 0" mass="12" diaginertia="0.1 0.9 0.9"/>
        <joint name="a2" axis="0 1 0" range="-2.3 0.8"/>
        <site name="lever" pos="0.15 0 0.1"/>
        <body name="link_3" pos="0.8 0 0">
          <inertial pos="0.25 0 0" mass="6" diaginertia="0.1 0.3 0.3"/>
          <joint name="a3" axis="0 1 0" range="-2.6 2.6"/>
          <site name="tool" pos="0.7 0.05 0.1"/>
        </body>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="balancer" stiffness="900" springlength="0.3"><site site="anchor"/><site site="lever"/></spatial>
  </tendon>
  <actuator>
    <position joint="a1" kp="400000"/>
    <position joint="a2" kp="320000"/>
    <position joint="a3" kp="160000"/>
  </actuator>
</mujoco>"#;

const SCENARIO: &str = r#"
[robot]
model = "m.xml"
calibration_site = "tool"
machining_site = "tool"
parameters = ["a2", "a3"]

[instrument]
sigma_mm = 0.02
sigma_of = "deflection"
tracker_site = "tracker"

[[test_pose]]
name = "milling"
q_deg = [30, -60, 90]
force_n = [100, 200, -150]

[load]
kind = "any"
force_max_n = 300

[design]
experiments = 8
"#;

const PLAN: &str = "\
q1_deg,q2_deg,q3_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats
0,-30,60,200,150,-150,0,0,0,1
40,-60,20,-100,250,100,0,0,0,1
-50,-90,100,150,-200,-150,0,0,0,1
90,-45,-40,-250,-100,-120,0,0,0,2
-120,-20,-80,100,-180,200,0,0,0,1
20,-100,30,180,180,-150,0,0,0,1
-80,-70,70,-200,150,-100,0,0,0,1
";

/// What an uncertainty may be, and the sizes that it may have, by the schema that the program prints.
fn kinds_and_sizes(place: &Workplace) -> (Vec<String>, Vec<String>) {
    let schema = place.done("schema").json();
    let table = &schema["$defs"]["UncertaintyTable"]["properties"];
    // Words alone, or each with a description.
    let kinds = &schema["$defs"]["UncertaintyKind"];
    let described = kinds["oneOf"].as_array().into_iter().flatten();
    let words = described.flat_map(|each| {
        each["enum"]
            .as_array()
            .into_iter()
            .flatten()
            .chain(each.get("const"))
    });
    let kinds = words.chain(kinds["enum"].as_array().into_iter().flatten());
    let is_size = |key: &&String| {
        let kind = table[key.as_str()]["type"].to_string();
        kind.contains("number")
    };
    let sizes = table.as_object().expect("keys").keys();
    (
        kinds
            .map(|kind| kind.as_str().expect("a word").to_owned())
            .collect(),
        sizes.filter(is_size).cloned().collect(),
    )
}

/// The table of a kind with sizes that it takes.
fn table_of(place: &Workplace, kind: &str, sizes: &[String]) -> String {
    let one = |size: &String| {
        let is_torque = size.ends_with("_nm");
        format!("{size} = {}\n", if is_torque { 400.0 } else { 0.05 })
    };
    let pairs = (sizes.iter()).flat_map(|size| sizes.iter().map(move |other| (size, other)));
    let singles = sizes.iter().map(one);
    let tried = singles.chain(
        pairs
            .filter(|(size, other)| size < other)
            .map(|(size, other)| one(size) + &one(other)),
    );
    let tables = tried.flat_map(|sizes| {
        ["", "hidden = true\n"]
            .map(|hidden| format!("\n[[uncertainty]]\nkind = \"{kind}\"\n{sizes}{hidden}"))
    });
    let file = format!("try_{kind}.toml");
    let mut allowed = tables.filter(|table| {
        place.write(&file, SCENARIO.to_owned() + table);
        Scenario::load(&place.path(&file)).is_ok()
    });
    allowed
        .next()
        .unwrap_or_else(|| panic!("no size serves {kind}"))
}

/// A command that reads what others wrote: it may find conditions, but no fault.
fn reads(place: &Workplace, arguments: &str) -> Outcome {
    let outcome = place.run(&format!("{arguments} --quiet"));
    assert!(matches!(outcome.code, Some(0 | 3)), "{outcome:#?}");
    outcome
}

/// All commands after one another for a scenario that is there.
fn deflections(place: &Workplace, name: &str) {
    let [scenario, measured, identified, plan] =
        [".toml", "_m.csv", "_i.json", "_v.csv"].map(|ending| name.to_owned() + ending);
    for command in [
        format!("measure {scenario} --plan p.csv --measurements-out {measured}"),
        format!("identify --measurements {measured} --identified-out {identified}"),
        format!("compensate --identified {identified}"),
        format!("export --identified {identified} --model-out {name}_o.xml"),
        format!("validate --identified {identified} --experiments 2 --plan-out {plan}"),
        format!("measure {scenario} --plan {plan} --seed 5 --measurements-out {measured}"),
        format!("validate --identified {identified} --measurements {measured}"),
    ] {
        reads(place, &command);
    }
}

/// Readings of the robot as the scenario believes it to be, with a little noise.
fn readings(scenario: &Scenario, kind: ReadingKind, count: u32, seed: u64) -> Vec<AbsoluteReading> {
    let mut random = generator(seed, 0);
    let mut arm = scenario.task.belief.arm();
    arm.tools.truncate(1);
    arm.instrument_from_base = vec![Isometry3::new(
        Vector3::new(2.0, -1.0, 0.3),
        Vector3::new(0.1, -0.2, 2.0),
    )];
    let nothing = ParameterSet::empty();
    let mut model = ObservationModel::new(&nothing, &arm, &[]);
    let mut ignored = Matrix6xX::zeros(0);
    (0..count)
        .map(|index| {
            let [turn, shoulder, elbow] =
                [-2.5..2.5, -2.0..0.5, -2.0..2.0].map(|range| random.random_range(range));
            let force_n = Vector3::from_fn(|_, _| random.random_range(-200.0..200.0));
            let load = if index % 2 == 0 {
                Load::NONE
            } else {
                force(force_n)
            };
            let setup = setup(DVector::from_vec(vec![turn, shoulder, elbow]), load, 0);
            let seen = model.predict(&setup, kind, &mut ignored).expect("stable");
            let mut noise = || Vector3::from_fn(|_, _| random.random_range(-3e-5..3e-5));
            let turned = Rotation3::from_matrix_unchecked(seen.rotation);
            AbsoluteReading {
                configuration_rad: setup.commanded_rad,
                load,
                position_m: seen.position_m + noise(),
                rotation: (kind == ReadingKind::Pose).then(|| {
                    UnitQuaternion::from_rotation_matrix(&turned)
                        * UnitQuaternion::from_scaled_axis(noise())
                }),
                covariance: (kind == ReadingKind::Pose)
                    .then(|| Matrix6::identity() * 2e-5_f64.powi(2)),
                ..blank_reading()
            }
        })
        .collect()
}

fn absolute(place: &Workplace, name: &str, kind: ReadingKind) {
    let scenario = place.scenario(&format!("{name}.toml"));
    let [from, later] = [("from", 40, 1), ("later", 12, 2)].map(|(which, count, seed)| {
        let file = format!("{name}_{kind:?}_{which}.csv");
        let all = readings(&scenario, kind, count, seed);
        place.write(&file, absolute_table(&3.into(), &all));
        file
    });
    let identified = format!("{name}_{kind:?}.json");
    for command in [
        format!(
            "identify {name}.toml --measurements {from} --parameters zeros,compliances --identified-out {identified}"
        ),
        format!("compensate {name}.toml --identified {identified}"),
        format!("export {name}.toml --identified {identified} --model-out {identified}.xml"),
        format!("validate {name}.toml --identified {identified} --measurements {later}"),
    ] {
        reads(place, &command);
    }
}

/// Each uncertainty alone, of whatever kind there is, and all at once.
#[test]
fn what_a_command_writes_the_next_one_reads() {
    let place = Workplace::with("m.xml", MODEL);
    place.write("p.csv", PLAN);
    let (mut kinds, sizes) = kinds_and_sizes(&place);
    // These are errors where nothing is read by a gauge, or from a place.
    let elsewhere = ["gauge_direction", "station_position", "station_rotation"];
    kinds.retain(|kind| !elsewhere.contains(&kind.as_str()));
    assert!(kinds.len() > 20 && sizes.len() > 5, "{kinds:?} {sizes:?}");
    let mut all = SCENARIO.to_owned();
    for kind in &kinds {
        let table = table_of(&place, kind, &sizes);
        let _ = write!(all, "{table}");
        place.write(&format!("{kind}.toml"), SCENARIO.to_owned() + &table);
    }
    place.write("none.toml", SCENARIO);
    let before =
        "\n[[uncertainty]]\nkind = \"compliance\"\njoints = [\"a2\"]\nstd_relative = 0.1\n";
    place.write("before.toml", SCENARIO.to_owned() + before);
    place.write("all.toml", all);
    let mut names: Vec<&str> = kinds.iter().map(String::as_str).collect();
    names.extend(["none", "before", "all"]);
    let halves = names.chunks(names.len().div_ceil(2));
    std::thread::scope(|scope| {
        for half in halves {
            let place = &place;
            scope.spawn(move || half.iter().for_each(|name| deflections(place, name)));
        }
    });
    for name in ["none", "all"] {
        reads(
            &place,
            &format!("next --measurements {name}_m.csv --experiments 3"),
        );
        absolute(&place, name, ReadingKind::Position);
        absolute(&place, name, ReadingKind::Pose);
    }
    let after = SCENARIO.replace("a3\"]", "a3\"]\nprior = \"none_i.json\"");
    place.write("after.toml", after);
    reads(&place, "study after.toml --trials 3");
}
