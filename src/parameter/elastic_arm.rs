//! What planner and identification believe of a robot.

use std::borrow::Cow;

use nalgebra::{Isometry3, Vector3};

use super::backlash::Backlash;
use crate::robot::{Approach, Load, SerialChain, Tool};

/// A mass that is fixed to a link, besides what the model gives the link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Payload {
    /// The link that carries it, from 0.
    pub link: usize,
    /// Its mass (kg).
    pub mass_kg: f64,
    /// Its centre of mass in the link's frame (m).
    pub centre_of_mass_m: Vector3<f64>,
}

/// An elastic arm with its tools, its payload and the instrument that looks at it.
#[derive(Debug, Clone, PartialEq)]
pub struct ElasticArm {
    /// The chain, without the payload; its world is the robot's base.
    pub chain: SerialChain,
    /// The compliance of every joint (rad/(N m)).
    pub compliance_rad_per_nm: Vec<f64>,
    /// What is added to each joint's commanded angle (rad).
    pub zero_rad: Vec<f64>,
    /// The gap of each joint.
    pub backlash: Vec<Backlash>,
    /// The tools that are measured or loaded.
    pub tools: Vec<Tool>,
    /// The payload, if there is one.
    pub payload: Option<Payload>,
    /// The robot's base in the frame in which the instrument gives its readings, for each station where it stands.
    pub instrument_from_base: Vec<Isometry3<f64>>,
    /// By how much loads are larger than what is said of them, offset included.
    pub load_scale: f64,
    /// The force along each load's own besides what is said of it (N).
    pub load_offset_n: f64,
    /// How far the instrument drifts between the unloaded and the loaded reading of a deflection, in its frame (m).
    pub drift_m: Vector3<f64>,
}

impl ElasticArm {
    /// An arm without payload whose zeros, base and loads are as they are said to be.
    #[must_use]
    pub fn new(chain: SerialChain, compliance_rad_per_nm: Vec<f64>, tools: Vec<Tool>) -> Self {
        Self {
            zero_rad: vec![0.0; chain.len()],
            backlash: vec![Backlash::NONE; chain.len()],
            chain,
            compliance_rad_per_nm,
            tools,
            payload: None,
            instrument_from_base: vec![Isometry3::identity()],
            load_scale: 1.0,
            load_offset_n: 0.0,
            drift_m: Vector3::zeros(),
        }
    }

    /// The load that acts where this one is said to.
    #[must_use]
    pub fn acting(&self, said: &Load) -> Load {
        let mut load = *said;
        if self.load_offset_n != 0.0 {
            load.force_n += along(said) * self.load_offset_n;
        }
        load.scaled(self.load_scale)
    }

    /// The chain with the payload.
    #[must_use]
    pub fn loaded_chain(&self) -> SerialChain {
        let mut chain = self.chain.clone();
        if let Some(payload) = &self.payload
            && payload.mass_kg > 0.0
        {
            let link = &mut chain.joints[payload.link];
            let total = link.mass_kg + payload.mass_kg;
            link.centre_of_mass_m = (link.centre_of_mass_m * link.mass_kg
                + payload.centre_of_mass_m * payload.mass_kg)
                / total;
            link.mass_kg = total;
        }
        chain
    }
}

impl ElasticArm {
    /// On which side of its gap each joint stands at commanded angles `q` (rad), with one of the tools, under a load that acts
    /// there and the arm's own weight.
    #[must_use]
    pub fn sides(
        &self,
        q: &[f64],
        tool: usize,
        load: &Load,
        approach: Option<&Approach>,
    ) -> Vec<f64> {
        let came = Approach::of_all(approach, &self.chain);
        let gaps = self.backlash.iter().zip(came);
        if (self.backlash.iter()).all(|gap| gap.turned_over_at_nm.is_none()) {
            return gaps.map(|(gap, came)| gap.side(came, 0.0)).collect();
        }
        let chain = if self.payload.is_some() {
            Cow::Owned(self.loaded_chain())
        } else {
            Cow::Borrowed(&self.chain)
        };
        let state = chain.at(&self.tools[tool]).state(q);
        let torque = |joint: usize| {
            state.load_torque(joint, load) + state.gravity_torque(joint, &chain.gravity_m_s2)
        };
        gaps.enumerate()
            .map(|(joint, (gap, came))| gap.side(came, torque(joint)))
            .collect()
    }

    /// Whether some joint has a gap.
    #[must_use]
    pub fn has_backlash(&self) -> bool {
        self.backlash.iter().any(|gap| gap.half_width_rad != 0.0)
    }

    /// What is added to each commanded angle `q` (rad): the joints' zeros, and how far they stand in their gaps, see
    /// [`Self::sides`].
    #[must_use]
    pub fn offsets_rad(
        &self,
        q: &[f64],
        tool: usize,
        load: &Load,
        approach: Option<&Approach>,
    ) -> Vec<f64> {
        let mut offsets = self.zero_rad.clone();
        if self.has_backlash() {
            let sides = self.sides(q, tool, load, approach);
            for ((offset, gap), side) in offsets.iter_mut().zip(&self.backlash).zip(sides) {
                *offset += side * gap.half_width_rad;
            }
        }
        offsets
    }
}

/// The direction of a load's force; none without a force.
pub(crate) fn along(load: &Load) -> Vector3<f64> {
    load.force_n.try_normalize(0.0).unwrap_or_default()
}
