//! Arms on rails: joints that slide are told in mm, and what they are off by stays within their ends.

use std::fmt::Write as _;

use elastocal::compensation::{AbsoluteTarget, InverseKinematics, Unreachable};
use elastocal::numeric::random::generator;
use elastocal::parameter::{GearWave, WaveError};
use elastocal::robot::{EquilibriumSolver, Load};
use rand::RngExt;

use crate::support::Workplace;

/// A scenario of an arm on a rail with a tool that a tracker reads.
fn scenario(q: &str, more: &str) -> String {
    format!(
        "seed = 2\n[robot]\nmodel = \"arm.xml\"\ncalibration_site = \"tool\"\nmachining_site = \"tool\"\n{more}\
         [instrument]\nsigma_mm = 0.005\nsigma_of = \"position\"\n[[test_pose]]\nname = \"task\"\nq_deg = [{q}]\n\
         force_n = [10, 20, -30]\n[load]\nkind = \"fixed\"\nforce_n = [0, 0, -50]\n[region]\ntool_height_min_mm = -5000\n\
         [design]\naccuracy = \"absolute\"\nexperiments = 4\n"
    )
}

/// Two slides along x that carry slides along y and z.
const SLIDES: &str = r#"<mujoco><worldbody><body><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
<joint name="long" type="slide" axis="1 0 0" range="0 1"/><body><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
<joint name="short" type="slide" axis="1 0 0" range="0 0.1"/><body><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
<joint name="y" type="slide" axis="0 1 0" range="0 1"/><body><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
<joint name="z" type="slide" axis="0 0 1" range="0 1"/><site name="tool" pos="0.1 0 0"/></body></body></body></body></worldbody>
<actuator><position joint="long" kp="1e7"/><position joint="short" kp="1e7"/><position joint="y" kp="1e7"/><position joint="z" kp="1e7"/>
</actuator></mujoco>"#;

/// Where two slides must go nearly to their ends, the one that stands off its command leaves room for that.
#[test]
fn corrected_commands_keep_the_ends_of_the_ranges() {
    let place = Workplace::of_arm(
        SLIDES,
        scenario("500, 50, 500, 500", "parameters = [\"z\"]\n"),
    );
    let scenario = place.scenario("arm.toml");
    let mut arm = scenario.task.belief.arm();
    let wave = GearWave::both(std::num::NonZeroU32::MIN)[0];
    let off_m = -2e-5;
    arm.gear_waves = vec![WaveError {
        joint: 1,
        wave,
        amplitude_rad: off_m / wave.at(0.1),
    }];
    let chain = arm.loaded_chain();
    let mut solver = EquilibriumSolver::new(chain.len());
    let mut target = |short_m: f64| {
        let mut loaded = chain.at(&arm.tools[0]);
        let standing = [1.0, short_m, 0.4, 0.6];
        (solver.solve(
            &mut loaded,
            &arm.compliance_rad_per_nm,
            &standing,
            &Load::NONE,
        ))
        .expect("it rests");
        AbsoluteTarget {
            position_m: solver.state().tool_position,
            rotation: None,
            load: Load::NONE,
        }
    };
    // The short slide stands at 0.1 m - 20 um at most.
    let [near, beyond] = [0.0999, 0.09999].map(&mut target);
    let start = [scenario.task.test_poses[0].configuration_rad.clone()];
    let mut inverse = InverseKinematics::new(&arm, 0, &[]);
    let commands = inverse.commands(&near, &start).expect("within the ranges");
    let sum_m = commands[0] + commands[1] + arm.gear_waves[0].amplitude_rad * wave.at(commands[1]);
    assert!(commands[0] <= 1.0 && commands[1] <= 0.1, "{commands}");
    assert!((sum_m - 1.0999).abs() < 1e-9, "{sum_m}");
    let found = inverse.commands(&beyond, &start);
    assert!(
        matches!(
            found,
            Err(Unreachable::TooFar { .. } | Unreachable::BeyondRange { .. })
        ),
        "{found:?}"
    );
}

const ON_RAIL: &str = r#"<mujoco><compiler angle="radian"/><worldbody><body><inertial pos="0 0 0" mass="9" diaginertia="1 1 1"/>
<joint name="rail" type="slide" axis="1 0 0" range="-1 1"/><body pos="0 0 0.4"><inertial pos="0 0 0" mass="9" diaginertia="1 1 1"/>
<joint name="turn" axis="0 0 1" range="-2 2"/><body pos="0 0 0.3"><inertial pos="0.3 0 0" mass="4" diaginertia="1 1 1"/>
<joint name="lift" axis="0 1 0" range="-1.5 1.5"/><body pos="0.7 0 0"><inertial pos="0.2 0 0" mass="3" diaginertia="1 1 1"/>
<joint name="bend" axis="0 1 0" range="-2 2"/><site name="tool" pos="0.5 0.1 0"/></body></body></body></body></worldbody>
<actuator><position joint="rail" kp="1e7"/><position joint="turn" kp="3e5"/><position joint="lift" kp="3e5"/>
<position joint="bend" kp="1e5"/></actuator></mujoco>"#;

/// The error of a rail over its way is told in mm; a command beyond a joint's limits is named.
#[test]
fn what_a_rail_is_off_by_is_told_in_mm() {
    let more = "parameters = [\"lift\"]\n";
    let place = Workplace::of_arm(ON_RAIL, scenario("100, 10, 20, 40", more));
    let mut random = generator(5, 0);
    let mut plan = "q1_mm,q2_deg,q3_deg,q4_deg\n".to_owned();
    for _ in 0..120 {
        let [rail, turn, lift, bend] =
            [900.0, 100.0, 70.0, 100.0].map(|most: f64| random.random_range(-most..most));
        let _ = writeln!(plan, "{rail:.1},{turn:.1},{lift:.1},{bend:.1}");
    }
    place.write("plan.csv", plan);
    place.done("measure arm.toml --plan plan.csv --measurements-out m.csv --quiet");
    // The rail stands where it was measured, by another command.
    let text = place.read("m.csv");
    let rows: Vec<String> = (text.lines())
        .map(|line| {
            match line
                .split_once(',')
                .map(|(q, rest)| (q.parse::<f64>(), rest))
            {
                Some((Ok(rail), rest)) => format!("{},{rest}", rail - 0.5 * (rail / 150.0).sin()),
                _ => line.to_owned(),
            }
        })
        .collect();
    place.write("off.csv", rows.join("\n") + "\n");
    let identify = "identify arm.toml --parameters zeros --identified-out i.json --measurements";
    let told = place.run(&format!("{identify} off.csv")).stdout;
    let rail: Vec<&str> = told
        .lines()
        .filter(|line| line.trim_start().starts_with("rail ") && line.contains(" mm "))
        .collect();
    println!("{told}");
    assert!(
        matches!(rail[..], [row] if row.trim_end().ends_with(" mm") && !row.contains("mrad")),
        "{told}"
    );
    place.write("t.csv", "x_mm,y_mm,z_mm\n800,100,500\n");
    let told = place
        .run("compensate arm.toml --identified i.json --targets t.csv --frame base")
        .stdout;
    let said = told
        .lines()
        .find(|line| line.contains("off by over their own angles"));
    assert!(
        said.is_some_and(|said| said.contains(" mm at most") || said.contains(" mm and ")),
        "{told}"
    );

    let mut rows: Vec<&str> = text.lines().collect();
    let last = rows.pop().expect("a reading");
    let changed = last
        .splitn(3, ',')
        .enumerate()
        .map(|(place, field)| if place == 1 { "140" } else { field });
    let changed = changed.collect::<Vec<_>>().join(",");
    place.write("beyond.csv", rows.join("\n") + "\n" + &changed + "\n");
    place.doubted(&format!("{identify} beyond.csv")).says(
        "C0211: 1 of 120 readings have commanded angles outside the joint limits: q2_deg (turn) of reading 120 is 140.0 deg, allowed are \
         -114.6 to 114.6 deg",
    );
}
