//! Models of robots at random, with all that MuJoCo can say of statics.

use std::fmt::Write as _;

use elastocal::numeric::random::generator;
use nalgebra::Vector3;
use rand::{Rng, RngExt};

/// Random numbers by their ranges.
struct Dice<R>(R);

/// What a model may have.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Features {
    /// All that MuJoCo knows of statics.
    All,
    /// What a belief knows: hinges and slides, passive joints, linear springs in joints and along straight
    /// tendons, constant forces of actuators.
    Belief,
}

impl<R: Rng> Dice<R> {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0.random_range(low..=high)
    }

    fn one_in(&mut self, times: u32) -> bool {
        self.0.random_range(0..times) == 0
    }

    fn axis(&mut self) -> String {
        let axes = ["1 0 0", "0 1 0", "0 0 1"];
        if self.one_in(2) {
            axes[self.0.random_range(0..3)].to_owned()
        } else {
            let [x, y, z] = self.vector(1.0);
            format!("{x} {y} {z}")
        }
    }

    fn vector(&mut self, size: f64) -> [f64; 3] {
        [0.0; 3].map(|_| self.between(-size, size))
    }

    fn triple(&mut self, size: f64) -> String {
        let [x, y, z] = self.vector(size);
        format!("{x} {y} {z}")
    }
}

/// An elastic element that oscillates at 40 rad/s, nearly critically damped: stiffness, armature and
/// damping.
fn element(stiffness: f64) -> [f64; 3] {
    [stiffness, stiffness / 1600.0, 1.6 * stiffness / 40.0]
}

#[expect(clippy::too_many_lines, reason = "a list of what there is")]
/// A model at random: the file, the commanded joints, the commands and a force.
pub fn random_model(
    seed: u64,
    features: Features,
) -> (String, Vec<String>, Vec<f64>, Vector3<f64>) {
    let mut dice = Dice(generator(1300, seed));
    let joints = dice.0.random_range(2..=7_usize);
    let all = features == Features::All;
    let mut names = Vec::new();
    let mut commanded = Vec::new();
    let mut actuators = String::new();
    let mut bodies = String::new();
    let mut tail = String::new();
    let mut ends = String::new();
    for index in 1..=joints {
        let slides = dice.one_in(5);
        let stiffness = 10_f64.powf(dice.between(4.8, 6.2));
        let [kp, armature, damping] = element(stiffness);
        let gravcomp = if dice.one_in(5) {
            dice.between(0.2, if all { 1.2 } else { 1.0 })
        } else {
            0.0
        };
        // A passive joint before the commanded one, in a body of its own, since MuJoCo wants that of balls.
        if dice.one_in(3) {
            let [stiffness, armature, damping] = element(10_f64.powf(dice.between(4.8, 6.2)));
            let kind = ["hinge", "slide", if all { "ball" } else { "hinge" }];
            let kind = kind[dice.0.random_range(0..3)];
            let spring = if kind == "ball" {
                String::new()
            } else {
                let (axis, rest) = (dice.axis(), dice.between(-0.02, 0.02));
                format!("axis=\"{axis}\" springref=\"{rest}\"")
            };
            let poly = if dice.one_in(4) && all {
                format!("{stiffness} {}", dice.between(-1e5, 1e5))
            } else {
                stiffness.to_string()
            };
            let _ = write!(
                bodies,
                "<body name=\"bend_{index}\"><inertial pos=\"{}\" mass=\"3\" diaginertia=\"0.1 0.1 0.1\"/>\
                 <joint name=\"passive_{index}\" type=\"{kind}\" {spring} stiffness=\"{poly}\" \
                 armature=\"{armature}\" damping=\"{damping}\"/>",
                dice.triple(0.2)
            );
            ends += "</body>";
        }
        let _ = write!(
            bodies,
            "<body name=\"link_{index}\" pos=\"{}\" euler=\"{}\" gravcomp=\"{gravcomp}\">\
             <inertial pos=\"{}\" mass=\"{}\" diaginertia=\"0.3 0.4 0.5\"/>\
             <site name=\"eye_{index}\" pos=\"{}\"/>",
            dice.triple(0.5),
            dice.triple(1.0),
            dice.triple(0.2),
            dice.between(2.0, 20.0),
            dice.triple(0.3)
        );
        let mut extra = String::new();
        if dice.one_in(4) {
            let _ = write!(
                extra,
                " stiffness=\"{}\" springref=\"{}\"",
                dice.between(0.0, 0.3) * stiffness,
                dice.between(-0.5, 0.5)
            );
        }
        if dice.one_in(4) {
            let _ = write!(extra, " ref=\"{}\"", dice.between(-0.5, 0.5));
        }
        let kind = if slides { "slide" } else { "hinge" };
        let name = format!("joint_{index}");
        let _ = write!(
            bodies,
            "<joint name=\"{name}\" type=\"{kind}\" axis=\"{}\" armature=\"{armature}\" damping=\"{damping}\"{extra}/>",
            dice.axis()
        );
        let gear = if dice.one_in(3) {
            dice.between(-3.0, 3.0)
        } else {
            1.0
        };
        let kp = kp / (gear * gear);
        let offset = if dice.one_in(4) {
            dice.between(-200.0, 200.0)
        } else {
            0.0
        };
        let _ = write!(
            actuators,
            "<general name=\"servo_{name}\" joint=\"{name}\" gear=\"{gear}\" gainprm=\"{kp}\" biastype=\"affine\" biasprm=\"{offset} {} 0\"/>",
            -kp
        );
        // A side branch that nothing commands: a finger with a spring, or one that hangs.
        if dice.one_in(4) && all {
            let [stiffness, armature, damping] = element(10_f64.powf(dice.between(3.5, 5.0)));
            let _ = write!(
                bodies,
                "<body name=\"finger_{index}\" pos=\"{}\"><joint name=\"finger_{index}\" axis=\"{}\" stiffness=\"{stiffness}\" armature=\"{armature}\" damping=\"{damping}\"/><geom size=\"0.05\" mass=\"2\" pos=\"0.1 0 0\"/></body>",
                dice.triple(0.2),
                dice.axis()
            );
            if dice.one_in(3) {
                let _ = write!(
                    tail,
                    "<equality><joint joint1=\"finger_{index}\" joint2=\"{name}\" polycoef=\"0 {} 0.1 0 0\" solref=\"0.005 1\"/></equality>",
                    dice.between(-0.5, 0.5)
                );
            }
        }
        commanded.push(if slides {
            dice.between(-0.3, 0.3)
        } else {
            dice.between(-1.5, 1.5)
        });
        names.push(name);
        ends += "</body>";
    }
    if dice.one_in(2) {
        let [low, high] = [dice.between(0.1, 0.5), dice.between(0.0, 0.4)];
        let _ = write!(
            tail,
            "<tendon><spatial stiffness=\"{}\" springlength=\"{low} {}\" damping=\"100\"><site site=\"anchor\"/><site site=\"eye_{}\"/></spatial></tendon>",
            dice.between(1e3, 4e4),
            low + high,
            joints
        );
    }
    if dice.one_in(4) && all {
        let _ = write!(
            tail,
            "<tendon><spatial name=\"wound\" stiffness=\"{}\" springlength=\"0.2\" damping=\"50\"><site site=\"anchor\"/><geom geom=\"drum\"/><site site=\"eye_1\"/></spatial></tendon>",
            dice.between(1e3, 2e4)
        );
    }
    if dice.one_in(4) && all {
        let _ = write!(
            tail,
            "<tendon><fixed name=\"sum\" stiffness=\"{}\" springlength=\"0.1\" damping=\"20\"><joint joint=\"joint_1\" coef=\"1\"/><joint joint=\"joint_2\" coef=\"-0.7\"/></fixed></tendon>",
            dice.between(1e3, 2e4)
        );
        if dice.one_in(2) {
            let _ = write!(
                tail,
                "<actuator><position tendon=\"sum\" kp=\"{}\"/></actuator>",
                dice.between(1e3, 1e4)
            );
        }
    }
    if dice.one_in(6) && all {
        let _ = write!(
            tail,
            "<equality><connect body1=\"link_{joints}\" body2=\"rod\" anchor=\"0.1 0 0\" solref=\"0.004 1\"/></equality>"
        );
    }
    if dice.one_in(6) && all {
        let _ = write!(
            tail,
            "<equality><joint joint1=\"joint_1\" joint2=\"joint_2\" polycoef=\"0 {} 0 0 0\" solref=\"0.01 1\"/></equality>",
            dice.between(-0.5, 0.5)
        );
    }
    // What no static equilibrium tells.
    if dice.one_in(12) && all {
        tail += "<actuator><position joint=\"joint_1\" kp=\"100\" timeconst=\"0.1\"/></actuator>";
    }
    let friction = if dice.one_in(12) {
        "frictionloss=\"3\""
    } else {
        ""
    };
    let integrator = if dice.one_in(2) {
        "implicitfast"
    } else {
        "Euler"
    };
    let [stiffness, armature, damping] = element(1e4);
    let rod = if all {
        format!(
            "<body name=\"rod\" pos=\"0.2 0 0\"><joint name=\"rod\" type=\"ball\" stiffness=\"{stiffness}\" armature=\"{armature}\" damping=\"{damping}\" {friction}/><geom size=\"0.05\" mass=\"1\" pos=\"0.2 0 0\"/></body>"
        )
    } else {
        String::new()
    };
    let payload = dice.between(0.0, 30.0);
    let mjcf = format!(
        r#"<mujoco model="seed {seed}">
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="{integrator}"/>
  <worldbody>
    <site name="anchor" pos="-0.3 0.2 0.7"/>
    <geom name="drum" type="cylinder" size="0.1" fromto="0 -1 0.4 0 1 0.4" contype="0" conaffinity="0"/>
    {bodies}
    <body name="payload" pos="{}"><inertial pos="0 0 0" mass="{payload}" diaginertia="0.1 0.1 0.1"/></body>
    <site name="tool" pos="{}"/>
    {rod}
    {ends}
  </worldbody>
  <actuator>{actuators}</actuator>
  {tail}
</mujoco>
"#,
        dice.triple(0.3),
        dice.triple(0.4)
    );
    let force_n = Vector3::from(dice.vector(300.0));
    (mjcf, names, commanded, force_n)
}
