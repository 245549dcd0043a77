//! The planner's model of a robot: geometry, masses, compliances, transmission error, backlash.

use std::borrow::Cow;

use nalgebra::{Isometry3, Vector3};

use super::backlash::Backlash;
use super::gear::{GearWave, WaveError};
use crate::mujoco::TorqueLaw;
use crate::robot::{Approach, EquilibriumError, KinematicState, Load, SerialChain, Tool};

/// How often a command is corrected by what the gear is off by there.
const GEAR_STEPS: usize = 20;

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
    /// What each joint gives besides its spring.
    pub stiffening: Vec<TorqueLaw>,
    /// The waves in the joints' gears.
    pub gear_waves: Vec<WaveError>,
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
    /// The share of it that a gauge beside an instrument reads, whose loads are hung in place.
    pub drift_along: f64,
}

impl ElasticArm {
    /// An arm without payload whose zeros, base and loads are as they are said to be.
    pub fn new(chain: SerialChain, compliance_rad_per_nm: Vec<f64>, tools: Vec<Tool>) -> Self {
        Self {
            zero_rad: vec![0.0; chain.len()],
            backlash: vec![Backlash::NONE; chain.len()],
            stiffening: vec![TorqueLaw::SPRING; chain.len()],
            gear_waves: Vec::new(),
            chain,
            compliance_rad_per_nm,
            tools,
            payload: None,
            instrument_from_base: vec![Isometry3::identity()],
            load_scale: 1.0,
            load_offset_n: 0.0,
            drift_m: Vector3::zeros(),
            drift_along: 1.0,
        }
    }

    /// The load that acts where this one is said to.
    pub fn acting(&self, said: &Load) -> Load {
        let mut load = *said;
        if self.load_offset_n != 0.0 {
            load.force_n += along(said) * self.load_offset_n;
        }
        load.scaled(self.load_scale)
    }

    /// The chain with the payload.
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

/// How far a joint stands off where its spring has it, for one of each.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Leaning {
    /// On which side of its gap it stands, -1 to 1: for half a width of one.
    pub side: f64,
    /// The torque that it carries (N m; N where it slides), by which it gives besides its spring, see [`TorqueLaw`].
    pub torque_nm: f64,
}

impl ElasticArm {
    /// How each joint stands off its spring at commanded angles `q` (rad), with one of the tools, under a load that acts there and
    /// what the arm carries besides.
    pub fn leanings(
        &self,
        q: &[f64],
        tool: &Tool,
        load: &Load,
        approach: Option<&Approach>,
    ) -> Vec<Leaning> {
        let came = Approach::of_all(approach, &self.chain);
        let gaps = self.backlash.iter().zip(came);
        let is_weighed = (self.backlash.iter()).any(|gap| gap.turned_over_at_nm.is_some())
            || (self.stiffening.iter()).any(|law| law.at.is_some());
        let state = is_weighed.then(|| {
            let chain = match &self.payload {
                Some(_) => Cow::Owned(self.loaded_chain()),
                None => Cow::Borrowed(&self.chain),
            };
            chain.at(tool).state(q)
        });
        let leaning = |(joint, (gap, came)): (usize, (&Backlash, bool))| {
            let torque = (state.as_ref()).map_or(0.0, |state| self.torque(joint, load, state));
            Leaning {
                side: gap.side(came, torque),
                torque_nm: torque,
            }
        };
        gaps.enumerate().map(leaning).collect()
    }

    /// What a joint carries (N m; N where it slides): the load, the arm's weight, springs beside its own, constant forces.
    fn torque(&self, joint: usize, load: &Load, state: &KinematicState) -> f64 {
        let gravity = state.gravity_torque(joint, &self.chain.gravity_m_s2);
        let (of_springs, _) = state.torque_of_springs(joint, joint);
        let offsets = self.chain.elements.offsets.iter();
        let constant: f64 = (offsets.filter(|each| each.joint == joint))
            .map(|each| each.force)
            .sum();
        state.load_torque(joint, load) + gravity + of_springs + constant
    }

    /// How far a joint stands off its spring (rad; m where it slides).
    pub fn leans_by(&self, joint: usize, leaning: &Leaning) -> f64 {
        let compliance = self.compliance_rad_per_nm[joint];
        leaning.side * self.backlash[joint].half_width_rad
            + self.stiffening[joint].beside_spring(compliance, leaning.torque_nm)
    }

    /// How much more a joint gives besides its spring for more of a share (rad; m where it slides).
    pub fn gives_by(&self, joint: usize, leaning: &Leaning) -> f64 {
        self.stiffening[joint].gives(self.compliance_rad_per_nm[joint], leaning.torque_nm)
    }

    /// The same under loads that are as they are said: what scales those of readings is not the task's.
    #[must_use]
    pub fn under_loads_of_task(self) -> Self {
        Self {
            load_scale: 1.0,
            load_offset_n: 0.0,
            ..self
        }
    }

    /// That each joint can hold what it carries.
    ///
    /// # Errors
    /// One that softens carries more than it can hold.
    pub fn check_held(&self, leanings: &[Leaning]) -> Result<(), EquilibriumError> {
        self.overloaded(leanings)
            .map_or(Ok(()), |joint| Err(self.gives_way(joint)))
    }

    /// The first joint that carries more than it can hold.
    fn overloaded(&self, leanings: &[Leaning]) -> Option<usize> {
        let mut joints = self.stiffening.iter().zip(leanings);
        joints.position(|(law, leaning)| !law.can_hold(leaning.torque_nm))
    }

    /// That a joint does.
    pub fn gives_way(&self, joint: usize) -> EquilibriumError {
        let joint = self.chain.joints[joint].name.clone();
        EquilibriumError::GivesWay { joint }
    }

    /// Whether some joint has a gap, or gives besides its spring.
    pub fn leans(&self) -> bool {
        self.backlash.iter().any(|gap| gap.half_width_rad != 0.0)
            || self.stiffening.iter().any(|each| each.share != 0.0)
    }

    /// How large a wave in a joint's gear is (rad), to be changed.
    pub(super) fn amplitude_rad(&mut self, joint: usize, wave: GearWave) -> &mut f64 {
        let mut waves = self.gear_waves.iter();
        let known = waves.position(|each| (each.joint, each.wave) == (joint, wave));
        let place = known.unwrap_or_else(|| {
            self.gear_waves.push(WaveError {
                joint,
                wave,
                amplitude_rad: 0.0,
            });
            self.gear_waves.len() - 1
        });
        &mut self.gear_waves[place].amplitude_rad
    }

    /// How far a joint's gear is off where the joint is commanded an angle (rad).
    pub fn transmission_error_rad(&self, joint: usize, commanded_rad: f64) -> f64 {
        (self.gear_waves.iter().filter(|each| each.joint == joint))
            .map(|each| each.amplitude_rad * each.wave.at(commanded_rad))
            .sum()
    }

    /// Where a joint with its zero and its gear stands that is commanded an angle (rad; m where it slides), without what it carries.
    pub fn stands_at(&self, joint: usize, commanded: f64) -> f64 {
        let at_zero = commanded + self.zero_rad[joint];
        if self.gear_waves.is_empty() {
            return at_zero;
        }
        at_zero + self.transmission_error_rad(joint, commanded)
    }

    /// What to command a joint (rad) so that its gear has it where another command without gear error would.
    pub(crate) fn before_gear(&self, joint: usize, wanted_rad: f64) -> f64 {
        let mut commanded = wanted_rad;
        // Gears follow their commands nearly: each step leaves the share of itself by which the error has a slope.
        for _ in 0..GEAR_STEPS {
            commanded = wanted_rad - self.transmission_error_rad(joint, commanded);
        }
        commanded
    }

    /// What is added to each commanded angle `q` (rad): the joints' zeros, what their gears are off by there, and how far they
    /// stand off their springs, see [`Self::leanings`]: a joint that cannot hold what it carries, as far as where it holds most.
    pub fn offsets_rad(
        &self,
        q: &[f64],
        tool: usize,
        load: &Load,
        approach: Option<&Approach>,
    ) -> Vec<f64> {
        self.offsets_by(q, &self.leanings_of(q, tool, load, approach))
    }

    /// The same where each joint can hold what it carries.
    ///
    /// # Errors
    /// The place of one that softens and carries more.
    pub fn held_offsets_rad(&self, q: &[f64], tool: usize, load: &Load) -> Result<Vec<f64>, usize> {
        let leanings = self.leanings_of(q, tool, load, None);
        self.overloaded(&leanings)
            .map_or_else(|| Ok(self.offsets_by(q, &leanings)), Err)
    }

    /// How joints lean; nothing where none does.
    fn leanings_of(
        &self,
        q: &[f64],
        tool: usize,
        load: &Load,
        approach: Option<&Approach>,
    ) -> Vec<Leaning> {
        let lean = || self.leanings(q, &self.tools[tool], load, approach);
        self.leans().then(lean).unwrap_or_default()
    }

    fn offsets_by(&self, q: &[f64], leanings: &[Leaning]) -> Vec<f64> {
        let mut offsets = self.zero_rad.clone();
        for each in &self.gear_waves {
            offsets[each.joint] += each.amplitude_rad * each.wave.at(q[each.joint]);
        }
        for (joint, (offset, leaning)) in offsets.iter_mut().zip(leanings).enumerate() {
            *offset += self.leans_by(joint, leaning);
        }
        offsets
    }
}

/// The direction of a load's force; none without a force.
pub(crate) fn along(load: &Load) -> Vector3<f64> {
    load.force_n.try_normalize(0.0).unwrap_or_default()
}
