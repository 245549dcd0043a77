//! Arms for tests, and numbers at random for them.

use std::f64::consts::{FRAC_PI_2, PI};
use std::num::NonZeroU32;

use nalgebra::{DVector, Isometry3, Translation3, Unit, UnitQuaternion, Vector3};

use super::{Axis, ElasticArm, GearWave, ParameterKind, Payload};
use crate::robot::{Drive, Elements, Joint, JointSpring, Offset, Place, SerialChain, Spring, Tool};

/// A small generator (`SplitMix64`) of reproducible numbers.
pub(crate) struct Numbers(pub u64);

impl Numbers {
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (2.0 * PI * self.uniform()).cos()
    }

    pub fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.between(-size, size))
    }

    pub fn configuration(&mut self, chain: &SerialChain) -> DVector<f64> {
        DVector::from_iterator(
            chain.len(),
            (chain.joints.iter()).map(|joint| self.between(joint.range_rad[0], joint.range_rad[1])),
        )
    }
}

fn frame(position: [f64; 3], rotation: [f64; 3]) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(Vector3::from(position)),
        UnitQuaternion::from_scaled_axis(Vector3::from(rotation)),
    )
}

fn joint(
    index: usize,
    frame: Isometry3<f64>,
    axis: [f64; 3],
    mass_kg: f64,
    centre: [f64; 3],
) -> Joint {
    Joint {
        name: format!("joint_{}", index + 1),
        previous_from_link: frame,
        axis: Unit::new_normalize(axis.into()),
        range_rad: [-2.8, 2.8],
        mass_kg,
        centre_of_mass_m: centre.into(),
        model_compliance_rad_per_nm: None,
        drive: Drive::default(),
    }
}

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

/// A UR10 after its published Denavit-Hartenberg parameters and masses: joints 2, 3 and 4 are
/// parallel.
pub(crate) fn ur10() -> ElasticArm {
    let turn = [FRAC_PI_2, 0.0, 0.0];
    let frames = [
        frame([0.0; 3], [0.0; 3]),
        frame([0.0, 0.0, 0.1273], turn),
        frame([-0.612, 0.0, 0.0], [0.0; 3]),
        frame([-0.5723, 0.0, 0.0], [0.0; 3]),
        frame([0.0, 0.0, 0.163_941], turn),
        frame([0.0, 0.0, 0.1157], [-FRAC_PI_2, 0.0, 0.0]),
    ];
    let masses = [7.1, 12.7, 4.27, 2.0, 2.0, 0.365];
    let centres = [
        [0.021, 0.0, 0.027],
        [-0.232, 0.0, 0.158],
        [-0.3323, 0.0, 0.068],
        [0.0, -0.018, 0.007],
        [0.0, 0.018, 0.007],
        [0.0, 0.0, -0.026],
    ];
    let joints = (0..6)
        .map(|i| joint(i, frames[i], [0.0, 0.0, 1.0], masses[i], centres[i]))
        .collect();
    let chain = SerialChain {
        joints,
        gravity_m_s2: GRAVITY,
        elements: Elements::default(),
    };
    let tool = Tool {
        name: "reflector".to_owned(),
        joints: 6,
        link_from_tool: frame([0.05, 0.03, 0.19], [0.0, 0.3, 0.0]),
    };
    let compliance = vec![1.5e-5, 2.0e-5, 3.0e-5, 8.0e-5, 9.0e-5, 1.2e-4];
    ElasticArm::new(chain, compliance, vec![tool])
}

/// A heavy arm in the manner of a KR-270, axes along x, y and z of frames that are parallel at zero.
pub(crate) fn heavy() -> ElasticArm {
    let parts = [
        ([0.0, 0.0, 0.0], [0.0, 0.0, -1.0], 367.0, [0.1, 0.0, 0.5]),
        ([0.35, 0.0, 0.75], [0.0, 1.0, 0.0], 232.0, [0.6, 0.0, 0.0]),
        ([1.25, 0.0, 0.0], [0.0, 1.0, 0.0], 192.0, [0.3, 0.0, 0.0]),
        ([1.1, 0.0, -0.055], [-1.0, 0.0, 0.0], 48.0, [-0.2, 0.0, 0.0]),
        ([0.0; 3], [0.0, 1.0, 0.0], 24.0, [0.05, 0.0, 0.0]),
        ([0.0; 3], [-1.0, 0.0, 0.0], 12.0, [0.2, 0.0, 0.0]),
    ];
    let joints = (parts.iter().enumerate())
        .map(|(index, &(at, axis, mass, centre))| {
            joint(index, frame(at, [0.0; 3]), axis, mass, centre)
        })
        .collect();
    let chain = SerialChain {
        joints,
        gravity_m_s2: GRAVITY,
        elements: Elements::default(),
    };
    let tool = Tool {
        name: "reflector".to_owned(),
        joints: 6,
        link_from_tool: frame([0.6115, 0.0, -0.46], [0.0; 3]),
    };
    let compliance = vec![0.26e-6, 0.302e-6, 0.406e-6, 3.002e-6, 3.303e-6, 2.365e-6];
    ElasticArm::new(chain, compliance, vec![tool])
}

/// Any arm: frames, axes, masses, a payload, a second tool on some link, a base somewhere.
pub(crate) fn random(numbers: &mut Numbers, joints: usize) -> ElasticArm {
    let links = (0..joints)
        .map(|index| {
            let axis = numbers.vector(1.0).normalize();
            let mass = numbers.between(0.0, 30.0);
            let at = Isometry3::new(numbers.vector(0.6), numbers.vector(1.5));
            joint(index, at, axis.into(), mass, numbers.vector(0.3).into())
        })
        .collect();
    let chain = SerialChain {
        joints: links,
        gravity_m_s2: numbers.vector(9.81),
        elements: Elements::default(),
    };
    let tools = [joints, 1 + joints / 2]
        .map(|carried| Tool {
            name: format!("tool on link {carried}"),
            joints: carried,
            link_from_tool: Isometry3::new(numbers.vector(0.4), numbers.vector(1.5)),
        })
        .to_vec();
    let compliance = (0..joints).map(|_| numbers.between(0.0, 5e-6)).collect();
    let mut belief = ElasticArm::new(chain, compliance, tools);
    belief.instrument_from_base = vec![Isometry3::new(numbers.vector(2.0), numbers.vector(1.5))];
    belief.zero_rad = (0..joints).map(|_| numbers.between(-0.05, 0.05)).collect();
    for gap in belief.backlash.iter_mut().step_by(2) {
        gap.turned_over_at_nm = Some(100.0);
    }
    for each in belief.stiffening.iter_mut().skip(1).step_by(2) {
        each.at = Some(1000.0);
    }
    belief.load_scale = numbers.between(0.8, 1.2);
    belief.payload = Some(Payload {
        link: joints - 1,
        mass_kg: numbers.between(1.0, 40.0),
        centre_of_mass_m: numbers.vector(0.3),
    });
    belief
}

/// The same with joints that slide, passive joints, springs in joints and between places, and constant
/// forces of actuators.
pub(crate) fn random_elastic(numbers: &mut Numbers, joints: usize) -> ElasticArm {
    let mut belief = random(numbers, joints);
    for (index, joint) in belief.chain.joints.iter_mut().enumerate() {
        joint.drive.slides = numbers.uniform() < 0.3;
        joint.drive.passive_at = (numbers.uniform() < 0.3).then(|| numbers.between(-0.1, 0.1));
        if numbers.uniform() < 0.3 {
            belief.chain.elements.offsets.push(Offset {
                joint: index,
                force: numbers.between(-300.0, 300.0),
            });
        }
        if numbers.uniform() < 0.3 {
            belief.chain.elements.joint_springs.push(JointSpring {
                joint: index,
                stiffness: numbers.between(0.0, 5e3),
                rest: numbers.between(-0.5, 0.5),
            });
        }
    }
    // Springs hold far more than links weigh.
    for law in &mut belief.stiffening {
        law.at = law.at.map(|at_nm| 30.0 * at_nm);
    }
    for index in 0..2 {
        let mut place = |joints: usize| Place {
            joints,
            position_m: numbers.vector(0.5),
        };
        let path = vec![place(0), place(joints / 2), place(joints)];
        let low = numbers.between(0.0, 0.3);
        belief.chain.elements.springs.push(Spring {
            name: format!("spring_{index}"),
            stiffness_n_per_m: numbers.between(500.0, 5e3),
            rest_m: [low, low + 0.05 * f64::from(index)],
            path,
        });
    }
    // A second station of the instrument.
    let second = Isometry3::new(numbers.vector(2.0), numbers.vector(1.5));
    belief.instrument_from_base.push(second);
    belief
}

/// Everything that readings could tell of an arm, and what each link weighs.
pub(crate) fn everything(belief: &ElasticArm) -> Vec<ParameterKind> {
    let links = (belief.chain.joints.iter().enumerate()).filter(|(_, joint)| joint.mass_kg > 0.0);
    let masses = links.flat_map(|(link, _)| {
        let centre = Axis::ALL.map(|axis| ParameterKind::LinkCentre { link, axis });
        [ParameterKind::LinkMass { link }].into_iter().chain(centre)
    });
    let mut kinds = ParameterKind::all_of(belief);
    kinds.extend(masses);
    kinds.extend((0..belief.chain.len()).map(|joint| ParameterKind::JointBacklash { joint }));
    kinds.extend((0..belief.chain.len()).map(|joint| ParameterKind::JointStiffening { joint }));
    let turning = (0..belief.chain.len()).filter(|&joint| !belief.chain.joints[joint].drive.slides);
    kinds.extend(turning.flat_map(|joint| {
        let waves = [NonZeroU32::MIN, NonZeroU32::MIN.saturating_add(2)];
        waves
            .into_iter()
            .flat_map(GearWave::both)
            .map(move |wave| ParameterKind::JointWave { joint, wave })
    }));
    kinds
}

/// The frames of all links, of the tools and of the base.
pub(crate) fn geometry(belief: &ElasticArm) -> Vec<ParameterKind> {
    let is_frame = |kind: &ParameterKind| {
        kind.is_mounted()
            || matches!(
                kind,
                ParameterKind::LinkPosition { .. } | ParameterKind::LinkRotation { .. }
            )
    };
    ParameterKind::all_of(belief)
        .into_iter()
        .filter(is_frame)
        .collect()
}
