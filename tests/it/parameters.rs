//! Derivatives of the observation model beside MuJoCo's own Jacobians.
//!
//! MuJoCo has no parameters of geometry, but joints: an arm whose every frame can slide and turn along
//! and about three axes, held at zero, has a Jacobian whose columns are what a frame's parameters do.

use elastocal::mujoco::{Model, State};
use elastocal::numeric::random::generator;
use elastocal::observation::{ObservationModel, ReadingKind};
use elastocal::parameter::{Axis, ElasticArm, ParameterKind, ParameterSet};
use elastocal::robot::{Load, SerialChain};
use nalgebra::{DVector, Matrix3xX, Matrix6xX};
use rand::RngExt;

use crate::support::{Workplace, list, setup, shipped};

/// Numbers of an arm at random: for each body position, quaternion and axis.
struct Arm {
    bodies: Vec<[f64; 10]>,
    tool: [f64; 7],
}

impl Arm {
    fn random(seed: u64, joints: usize) -> Self {
        let mut random = generator(seed, 0);
        Self {
            bodies: (0..joints)
                .map(|_| std::array::from_fn(|_| random.random_range(-1.0..1.0)))
                .collect(),
            tool: std::array::from_fn(|_| random.random_range(-0.5..0.5)),
        }
    }

    /// The arm, with its frames' displacements as joints where that is wanted.
    fn mjcf(&self, is_loose: bool) -> String {
        let loose = |name: &str| {
            let mut text = String::new();
            for kind in ["slide", "hinge"] {
                for axis in ["1 0 0", "0 1 0", "0 0 1"] {
                    let label = axis.replace(' ', "");
                    text += &format!(
                        "<joint name='{name}_{kind}_{label}' type='{kind}' axis='{axis}'/>"
                    );
                }
            }
            if is_loose { text } else { String::new() }
        };
        let words = |numbers: &[f64]| {
            let words: Vec<String> = numbers.iter().map(ToString::to_string).collect();
            words.join(" ")
        };
        let inertial = "<inertial pos='0.1 0 0.2' mass='3' diaginertia='1 1 1'/>";
        // A body has six degrees of freedom at most: the joint itself is in one of its own.
        let mut text = format!(
            "<mujoco><compiler angle='radian'/><worldbody><body name='base'>{inertial}{}",
            loose("base")
        );
        for (index, numbers) in self.bodies.iter().enumerate() {
            text += &format!(
                "<body name='frame_{index}' pos='{}' quat='{}'>{inertial}{}<body name='link_{index}'>{inertial}<joint name='joint_{}' axis='{}'/>",
                words(&numbers[..3]),
                words(&numbers[3..7]),
                loose(&format!("link_{index}")),
                index + 1,
                words(&numbers[7..]),
            );
        }
        let [position, rotation] = [words(&self.tool[..3]), words(&self.tool[3..])];
        text += &format!(
            "<body name='tool' pos='{position}' quat='{rotation}'>{inertial}{}<site name='tool'/></body>",
            loose("tool")
        );
        text += &"</body>".repeat(2 * self.bodies.len() + 1);
        text + "</worldbody></mujoco>"
    }
}

#[test]
fn every_frame_moves_the_tool_as_mujoco_says() {
    let place = Workplace::new();
    for joints in 1..=7 {
        let arm = Arm::random(joints as u64, joints);
        place.write("arm.xml", arm.mjcf(false));
        place.write("loose.xml", arm.mjcf(true));
        let model = Model::load(&place.path("arm.xml")).expect("a model");
        let loose = Model::load(&place.path("loose.xml")).expect("a model");
        let chain = SerialChain::from_model(&model).expect("serial");
        let tool = SerialChain::tool(&model, "tool").expect("a tool");
        let belief = ElasticArm::new(chain, vec![0.0; joints], vec![tool]);

        // In the order of the loose arm's joints.
        let frame = |position: &dyn Fn(Axis) -> ParameterKind,
                     rotation: &dyn Fn(Axis) -> ParameterKind| {
            [Axis::ALL.map(position), Axis::ALL.map(rotation)].concat()
        };
        let mut kinds = frame(
            &|axis| ParameterKind::BasePosition { station: 0, axis },
            &|axis| ParameterKind::BaseRotation { station: 0, axis },
        );
        for link in 0..joints {
            kinds.extend(frame(
                &|axis| ParameterKind::LinkPosition { link, axis },
                &|axis| ParameterKind::LinkRotation { link, axis },
            ));
            kinds.push(ParameterKind::JointZero { joint: link });
        }
        kinds.extend(frame(
            &|axis| ParameterKind::ToolPosition { tool: 0, axis },
            &|axis| ParameterKind::ToolRotation { tool: 0, axis },
        ));
        let set =
            ParameterSet::new(&belief, kinds.iter().map(|&kind| (kind, None))).expect("a set");
        let mut ours = ObservationModel::new(&set, &belief, &vec![0.0; set.len()]);
        let mut state = State::new(&loose);
        let site = loose.site("tool").expect("there is");
        let mut random = generator(100, joints as u64);
        for _ in 0..20 {
            let q = DVector::from_fn(joints, |_, _| random.random_range(-3.0..3.0));
            let mut all = vec![0.0; set.len()];
            for (angle, place) in q.iter().zip((12..).step_by(7)) {
                all[place] = *angle;
            }
            state.move_to(&all);
            let (position, axes) = state.site(site);
            let (rows_position, rows_rotation) = state.site_jacobian(site);
            let setup = setup(q, Load::force(10.0, 20.0, 30.0), 0);
            for at_rest in [false, true] {
                let mut derivatives = Matrix6xX::zeros(set.len());
                let seen = if at_rest {
                    let seen = ours.predict(&setup, ReadingKind::Pose, &mut derivatives);
                    seen.expect("rigid")
                } else {
                    ours.predict_first_order(None, &setup, ReadingKind::Pose, &mut derivatives)
                };
                assert!((seen.position_m - position).amax() < 1e-12);
                assert!((seen.rotation - axes).amax() < 1e-12);
                let theirs = |rows: &[f64]| Matrix3xX::from_row_slice(rows);
                let apart = [
                    derivatives.fixed_rows::<3>(0) - theirs(&rows_position),
                    derivatives.fixed_rows::<3>(3) - theirs(&rows_rotation),
                ];
                assert!(apart[0].amax() < 1e-11 && apart[1].amax() < 1e-11);
            }
        }
    }
}

/// `check --parameters`: every parameter is in the minimal set or redundant with a reason, and the better
/// the readings, the more is told apart.
#[test]
fn check_names_a_minimal_set() {
    let place = Workplace::new();
    let scenario = shipped("scenarios/klimchik2012.toml");
    let arguments = format!("check {scenario} --parameters --json --quiet");
    let results = place.done(&arguments).json();
    let mut counts = Vec::new();
    for (reading, each) in ["deflection", "position", "pose"]
        .iter()
        .zip(list(&results["identifiable"]))
    {
        assert_eq!(each["reading"], *reading);
        let minimal = list(&each["minimal_set"]);
        let redundant = list(&each["redundant"]);
        assert_eq!(each["parameters"], 62);
        assert_eq!(minimal.len() + redundant.len(), 62);
        let reason = |parameter: &str| {
            let found = redundant.iter().find(|each| each["parameter"] == parameter);
            found.map_or("", |each| each["reason"].as_str().expect("a text"))
        };
        assert_eq!(
            reason("joint_1.zero"),
            "the zero of joint_1 and the base's rotation about z cannot be separated: their difference is determined"
        );
        // A weight turns with nothing: axis 1 stands upright.
        if *reading == "pose" {
            assert_eq!(
                reason("joint_1.compliance"),
                "the compliance of joint_1 does not show in these readings"
            );
        }
        // Joint 1 stands still in this scenario.
        if *reading != "deflection" {
            assert_eq!(
                reason("link_2.x"),
                "link_2's position along x is nearly redundant with the base's position along x in these readings"
            );
        }
        if *reading == "position" {
            assert!(reason("tool.rx").ends_with("does not show in these readings"));
        }
        counts.push(minimal.len());
    }
    assert!(counts.is_sorted(), "{counts:?}");
    let text = place.done(&arguments.replace(" --json", ""));
    text.prints(&format!(
        "{} of 62 parameters can be identified together",
        counts[2]
    ));
}
