//! Robots by hand: arms after public data, and the KR-270 with what a calibration's truth may have.

use std::fmt::Write as _;

use crate::support::project;

/// A joint of an arm with its link: position and orientation in the link before, axis, mass and its
/// centre, stiffness.
type Link = ([f64; 3], [f64; 3], [f64; 3], f64, [f64; 3], f64);

/// What is put into an arm's file.
#[derive(Default, Clone)]
pub struct Additions {
    /// Before each joint, in its body.
    pub before: Vec<(usize, &'static str)>,
    /// Behind each joint, in its body.
    pub inside: Vec<(usize, &'static str)>,
    /// In the world.
    pub world: &'static str,
    /// After the actuators.
    pub tail: &'static str,
}

/// An arm as MJCF; joints and bodies count from 1. The damping brings it to rest in a second or so.
fn arm(links: &[Link], tool: [f64; 3], additions: &Additions) -> (String, Vec<String>) {
    let text = |[x, y, z]: [f64; 3]| format!("{x} {y} {z}");
    let (mut bodies, mut actuators, mut ends) = (String::new(), String::new(), String::new());
    let mut names = Vec::new();
    let added = |to: &[(usize, &'static str)], index: usize| -> String {
        (to.iter().filter(|each| each.0 == index))
            .map(|each| each.1)
            .collect()
    };
    for (index, &(position, turn, axis, mass, centre, kp)) in (1..).zip(links) {
        let _ = write!(
            bodies,
            "<body name=\"link_{index}\" pos=\"{}\" euler=\"{}\"><inertial pos=\"{}\" mass=\"{mass}\" diaginertia=\"0.1 0.1 0.1\"/>{}\
             <joint name=\"joint_{index}\" axis=\"{}\" armature=\"{}\" damping=\"{}\"/>{}",
            text(position),
            text(turn),
            text(centre),
            added(&additions.before, index),
            text(axis),
            kp / 3600.0,
            1.6 * kp / 60.0,
            added(&additions.inside, index),
        );
        let _ = write!(actuators, "<position joint=\"joint_{index}\" kp=\"{kp}\"/>");
        names.push(format!("joint_{index}"));
        ends += "</body>";
    }
    let mjcf = format!(
        "<mujoco><compiler angle=\"radian\" eulerseq=\"XYZ\"/><option timestep=\"0.001\" integrator=\"implicitfast\"/>\
         <worldbody>{}{bodies}<site name=\"tool\" pos=\"{}\"/>{ends}</worldbody><actuator>{actuators}</actuator>{}</mujoco>",
        additions.world,
        text(tool),
        additions.tail
    );
    (mjcf, names)
}

const QUARTER: f64 = std::f64::consts::FRAC_PI_2;
const Z: [f64; 3] = [0.0, 0.0, 1.0];

/// An arm of six joints after published Denavit-Hartenberg parameters: `a_2`, `a_3`, `d_1`,
/// `d_4`, `d_5`, `d_6`.
fn universal(lengths: [f64; 6], masses: [f64; 6], additions: &Additions) -> (String, Vec<String>) {
    let [a2, a3, d1, d4, d5, d6] = lengths;
    let turn = [QUARTER, 0.0, 0.0];
    let back = [-QUARTER, 0.0, 0.0];
    let none = [0.0; 3];
    let at = |x, z| [x, 0.0, z];
    let links = [
        (none, none, Z, masses[0], [0.0, 0.0, d1 / 2.0], 6.0e4),
        (at(0.0, d1), turn, Z, masses[1], [a2 / 2.0, 0.0, 0.1], 5.0e4),
        (
            at(a2, 0.0),
            none,
            Z,
            masses[2],
            [a3 / 2.0, 0.0, 0.05],
            4.0e4,
        ),
        (at(a3, d4), turn, Z, masses[3], none, 1.5e4),
        (at(0.0, d5), back, Z, masses[4], none, 1.2e4),
        (at(0.0, 0.0), none, Z, masses[5], at(0.0, d6 / 2.0), 1.0e4),
    ];
    arm(&links, [0.05, 0.03, d6 + 0.1], additions)
}

/// After the UR10.
pub fn ur10(additions: &Additions) -> (String, Vec<String>) {
    let lengths = [-0.612, -0.5723, 0.1273, 0.163_941, 0.1157, 0.0922];
    universal(lengths, [7.1, 12.7, 4.27, 2.0, 2.0, 0.365], additions)
}

/// After the `UR5e`.
pub fn ur5e(additions: &Additions) -> (String, Vec<String>) {
    let lengths = [-0.425, -0.3922, 0.1625, 0.1333, 0.0997, 0.0996];
    universal(lengths, [3.761, 8.058, 2.846, 1.37, 1.3, 0.365], additions)
}

/// After the LBR iiwa 14: seven joints.
pub fn iiwa(additions: &Additions) -> (String, Vec<String>) {
    let y = [0.0, 1.0, 0.0];
    let none = [0.0; 3];
    let up = |z| [0.0, 0.0, z];
    let links = [
        (up(0.1575), none, Z, 5.76, up(0.1), 3e4),
        (up(0.2025), none, y, 6.35, up(0.1), 3e4),
        (up(0.2045), none, Z, 3.5, up(0.1), 2e4),
        (up(0.2155), none, [0.0, -1.0, 0.0], 3.5, up(0.1), 2e4),
        (up(0.1845), none, Z, 3.5, up(0.1), 1.5e4),
        (up(0.2155), none, y, 1.8, up(0.0), 1e4),
        (up(0.081), none, Z, 1.2, up(0.02), 1e4),
    ];
    arm(&links, [0.02, 0.0, 0.145], additions)
}

/// The KR-270's file with additions: pairs of what to find and what to put behind it.
pub fn kr270(additions: &[(&str, &str)]) -> (String, Vec<String>) {
    let mut mjcf =
        std::fs::read_to_string(project("models/kr270.xml")).expect("the model can be read");
    for (place, addition) in additions {
        let start = mjcf.find(place).expect("it is there") + place.len();
        mjcf.insert_str(start, addition);
    }
    let names = (1..=6).map(|joint| format!("joint_{joint}"));
    (mjcf, names.collect())
}
