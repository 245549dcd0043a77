//! Joints that stand off their springs as weight and load have it: the columns of their gaps, and of what they give besides, in
//! deflections to first order.
//!
//! With the lever J of joint n and its shape f, on which side of its gap it stands or what it gives besides its spring, a deflection
//! follows a half width, or a share, by
//!
//! ```text
//! f(tau_w + tau_l) dp_n + (f(tau_w + tau_l) - f(tau_w)) J,     tau_l = J . F + z . T
//! ```
//!
//! where `tau_w` is the torque of the arm's own weight and `dp_n` what turning the joint changes of the deflection.

use nalgebra::Vector3;

use crate::parameter::{Backlash, ElasticArm, ParameterKind, Stiffening};
use crate::robot::KinematicState;

/// How a joint leans by a torque.
#[derive(Debug, Clone, Copy, PartialEq)]
enum LeaningLaw {
    /// The side of a gap, and whether the joint came turning positively.
    Side(Backlash, bool),
    /// What a joint of this compliance (rad/(N m)) gives besides its spring.
    Gives(Stiffening, f64),
}

impl LeaningLaw {
    /// Its value, and its slope (1/(N m)).
    fn at(&self, torque_nm: f64) -> (f64, f64) {
        match self {
            Self::Side(gap, came_positively) => gap.side_and_slope(*came_positively, torque_nm),
            Self::Gives(stiffening, compliance) => stiffening.gives(*compliance, torque_nm),
        }
    }
}

/// A joint that stands off its spring by what it carries.
#[derive(Debug, Clone, PartialEq)]
pub struct OffSpring {
    /// The joint.
    pub joint: usize,
    law: LeaningLaw,
    /// The torque of the arm's weight about the joint (N m).
    weight_nm: f64,
    /// What the torque of the weight is worth in a cost.
    of_weight: f64,
}

/// The shape with a load and without it, and how these follow the torques.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeUnderLoad {
    /// With the load.
    pub loaded: f64,
    /// Without it.
    pub unloaded: f64,
    loaded_slope: f64,
    unloaded_slope: f64,
}

impl ShapeUnderLoad {
    /// By how much the two differ.
    pub fn crossed(&self) -> f64 {
        self.loaded - self.unloaded
    }
}

impl OffSpring {
    /// What of an arm a parameter is of, where what the joint carries counts; `None` of any other.
    pub fn of(arm: &ElasticArm, kind: ParameterKind) -> Option<Self> {
        let (joint, law) = match kind {
            ParameterKind::JointBacklash { joint } => {
                let gap = arm.backlash[joint];
                gap.turned_over_at_nm?;
                (joint, LeaningLaw::Side(gap, true))
            }
            ParameterKind::JointStiffening { joint } => {
                let compliance = arm.compliance_rad_per_nm[joint];
                (joint, LeaningLaw::Gives(arm.stiffening[joint], compliance))
            }
            _ => return None,
        };
        Some(Self {
            joint,
            law,
            weight_nm: 0.0,
            of_weight: 0.0,
        })
    }

    /// Each joint comes from now on turning positively, or not.
    pub fn come_from(&mut self, came_positively: &[bool]) {
        if let LeaningLaw::Side(_, came) = &mut self.law {
            *came = came_positively[self.joint];
        }
    }

    /// Takes the arm's weight where it has this geometry.
    pub fn stand(&mut self, state: &KinematicState, gravity_m_s2: &Vector3<f64>) {
        self.weight_nm = state.gravity_torque(self.joint, gravity_m_s2);
    }

    /// The shape where a load turns the joint with a torque (N m).
    pub fn under(&self, load_nm: f64) -> ShapeUnderLoad {
        let (loaded, loaded_slope) = self.law.at(self.weight_nm + load_nm);
        let (unloaded, unloaded_slope) = self.law.at(self.weight_nm);
        ShapeUnderLoad {
            loaded,
            unloaded,
            loaded_slope,
            unloaded_slope,
        }
    }

    /// Nothing is worth anything.
    pub fn forget(&mut self) {
        self.of_weight = 0.0;
    }

    /// Adds what the torques are worth in a cost in which the two shapes are worth so much, that of the weight here, and returns
    /// that of the load.
    pub fn weigh(&mut self, shape: &ShapeUnderLoad, of_loaded: f64, of_unloaded: f64) -> f64 {
        let of_load = of_loaded * shape.loaded_slope;
        self.of_weight += of_load + of_unloaded * shape.unloaded_slope;
        of_load
    }

    /// Adds what turning each joint is worth by the weight to a gradient, where the joints turn what is beyond them so and the
    /// weight turns about them, see [`KinematicState::torque_derivative`].
    pub fn add_to(
        &self,
        gradient: &mut [f64],
        turning: &[Vector3<f64>],
        weight_turning: &[Vector3<f64>],
    ) {
        for (by, slope) in gradient.iter_mut().enumerate() {
            let (inner, outer) = (self.joint.min(by), self.joint.max(by));
            *slope += self.of_weight * turning[inner].dot(&weight_turning[outer]);
        }
    }
}
