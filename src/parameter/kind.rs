//! The kinds of parameters, with their units, names and typical sizes.

use std::fmt;

use super::{ElasticArm, FrameChange, GearWave, SourceLevel};

/// An axis of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Axis {
    /// The first.
    X,
    /// The second.
    Y,
    /// The third.
    Z,
}

impl Axis {
    /// All three.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    /// 0, 1 or 2.
    pub const fn index(self) -> usize {
        self as usize
    }
}

impl fmt::Display for Axis {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(["x", "y", "z"][self.index()])
    }
}

/// The logarithm of a quantity over its nominal value; of one that is zero, as a joint that the true robot does not have is, what that is to
/// first order.
pub fn log_ratio(quantity: f64, nominal: f64) -> f64 {
    if quantity > 0.0 {
        (quantity / nominal).ln()
    } else {
        -1.0
    }
}

/// What a parameter is of a [`ElasticArm`]. Joints, links and tools count from 0; link i is what joint i
/// moves.
///
/// Frames are unknown by a displacement d and a rotation vector r along the axes of the nominal frame:
/// T = `T_nominal` Translation(d) Rotation(r).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ParameterKind {
    /// The compliance of a joint (rad/(N m)); with a prior, the logarithm of its ratio to the nominal
    /// one.
    JointCompliance {
        /// The joint.
        joint: usize,
    },
    /// What is added to a joint's commanded angle (rad).
    JointZero {
        /// The joint.
        joint: usize,
    },
    /// Half the width of a joint's gap (rad), see [`super::Backlash`].
    JointBacklash {
        /// The joint.
        joint: usize,
    },
    /// By what share of what its spring gives at a torque a joint gives less there, see [`crate::mujoco::TorqueLaw`].
    JointStiffening {
        /// The joint.
        joint: usize,
    },
    /// A wave of a joint's gear error over the joint's own angle (rad), see [`GearWave`].
    JointWave {
        /// The joint, which turns.
        joint: usize,
        /// Which wave.
        wave: GearWave,
    },
    /// The stiffness of a spring between places of the arm (N/m); with a prior, the logarithm of its ratio to
    /// the nominal one.
    SpringStiffness {
        /// The spring.
        spring: usize,
    },
    /// The length at which a spring is relaxed, the shortest where it has a dead band (m).
    SpringRest {
        /// The spring.
        spring: usize,
    },
    /// The position of a link's frame along one of its axes (m).
    LinkPosition {
        /// The link.
        link: usize,
        /// Along which axis.
        axis: Axis,
    },
    /// The orientation of a link's frame: a coordinate of its rotation vector (rad).
    LinkRotation {
        /// The link.
        link: usize,
        /// About which axis.
        axis: Axis,
    },
    /// The logarithm of what a link weighs, with all that is fixed to it, over its nominal mass.
    LinkMass {
        /// The link.
        link: usize,
    },
    /// The centre of mass of a link, with all that is fixed to it, along an axis of the link (m).
    LinkCentre {
        /// The link.
        link: usize,
        /// Along which axis.
        axis: Axis,
    },
    /// The position of a tool along one of its axes (m).
    ToolPosition {
        /// Which of the belief's tools.
        tool: usize,
        /// Along which axis.
        axis: Axis,
    },
    /// The orientation of a tool: a coordinate of its rotation vector (rad).
    ToolRotation {
        /// Which of the belief's tools.
        tool: usize,
        /// About which axis.
        axis: Axis,
    },
    /// The position of the robot's base in the instrument's frame (m).
    BasePosition {
        /// Which of the instrument's stations.
        station: usize,
        /// Along which axis of the base.
        axis: Axis,
    },
    /// The orientation of the robot's base in the instrument's frame (rad).
    BaseRotation {
        /// Which of the instrument's stations.
        station: usize,
        /// About which axis of the base.
        axis: Axis,
    },
    /// The logarithm of the payload's mass over its nominal one.
    PayloadMass,
    /// The payload's centre of mass along an axis of the link that carries it (m).
    PayloadCentre {
        /// Along which axis.
        axis: Axis,
    },
    /// The logarithm of the factor by which all loads differ from what is said of them.
    LoadScale,
    /// The force that acts along a load's own besides what is said of it (N): a load cell that is not zero.
    LoadOffset,
    /// The logarithm of the factor by which the loads at the test poses differ from what is said of them. No reading
    /// shows it.
    TaskScale,
    /// A coordinate, in the world frame, of the force that acts at the test poses besides what is said of it (N).
    TaskForce {
        /// Along which axis.
        axis: Axis,
    },
    /// A coordinate, in the instrument's frame, of how far it drifts between the unloaded and the loaded reading (m).
    Drift {
        /// Along which axis.
        axis: Axis,
    },
}

/// What of an arm a parameter is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Owner {
    Joint(usize),
    Spring(usize),
    Link(usize),
    Tool(usize),
    Station(usize),
    /// There is one alone, or none.
    Only,
}

/// What there is to say of a kind, whatever of the arm it is of.
struct KindRow {
    /// Its name and its words, with @ for what it is of and % for the axis.
    name: &'static str,
    words: &'static str,
    /// The unit of a value that is no logarithm.
    unit: &'static str,
    /// See [`ParameterKind::typical_size`].
    size: f64,
}

const fn row(name: &'static str, words: &'static str, unit: &'static str, size: f64) -> KindRow {
    KindRow {
        name,
        words,
        unit,
        size,
    }
}

impl ParameterKind {
    const fn row(self) -> KindRow {
        match self {
            Self::JointCompliance { .. } => {
                row("@.compliance", "the compliance of @", "rad/(N m)", 1.0)
            }
            Self::JointZero { .. } => row("@.zero", "the zero of @", "rad", 1e-3),
            Self::JointBacklash { .. } => row("@.backlash", "the backlash of @", "rad", 1e-4),
            Self::JointStiffening { .. } => row("@.stiffening", "the stiffening of @", "1", 1e-2),
            Self::JointWave { .. } => row("@.", "in @'s gear that comes", "rad", 1e-4),
            Self::SpringStiffness { .. } => row("@.stiffness", "the stiffness of @", "N/m", 1.0),
            Self::SpringRest { .. } => row("@.rest", "the rest length of @", "m", 1e-2),
            Self::LinkPosition { .. } => row("@.%", "@'s position along %", "m", 3e-4),
            Self::LinkRotation { .. } => row("@.r%", "@'s rotation about %", "rad", 3e-4),
            Self::LinkMass { .. } => row("@.mass", "@'s mass", "1", 5e-2),
            Self::LinkCentre { .. } => row("@.c%", "@'s centre of mass along %", "m", 1e-2),
            Self::ToolPosition { .. } => row("@.%", "@'s position along %", "m", 1e-3),
            Self::BasePosition { .. } => row("@.%", "@'s position along %", "m", 1e-2),
            Self::ToolRotation { .. } | Self::BaseRotation { .. } => {
                row("@.r%", "@'s rotation about %", "rad", 1e-2)
            }
            Self::PayloadMass => row("payload.mass", "the payload's mass", "1", 5e-2),
            Self::PayloadCentre { .. } => {
                row("payload.%", "the payload's centre along %", "m", 1e-2)
            }
            Self::LoadScale => row("load.scale", "the scale of the load", "1", 1e-2),
            Self::LoadOffset => row("load.offset", "the offset of the load", "N", 10.0),
            Self::TaskScale => row("task.scale", "the scale of the task's load", "1", 1e-2),
            Self::TaskForce { .. } => row("task.f%", "the task's force along %", "N", 10.0),
            Self::Drift { .. } => row("drift.%", "the instrument's drift along %", "m", 1e-5),
        }
    }

    /// What it is of.
    pub(super) const fn owner(self) -> Owner {
        match self {
            Self::JointCompliance { joint }
            | Self::JointZero { joint }
            | Self::JointBacklash { joint }
            | Self::JointStiffening { joint }
            | Self::JointWave { joint, .. } => Owner::Joint(joint),
            Self::SpringStiffness { spring } | Self::SpringRest { spring } => Owner::Spring(spring),
            Self::LinkPosition { link, .. }
            | Self::LinkRotation { link, .. }
            | Self::LinkMass { link }
            | Self::LinkCentre { link, .. } => Owner::Link(link),
            Self::ToolPosition { tool, .. } | Self::ToolRotation { tool, .. } => Owner::Tool(tool),
            Self::BasePosition { station, .. } | Self::BaseRotation { station, .. } => {
                Owner::Station(station)
            }
            _ => Owner::Only,
        }
    }

    const fn axis(self) -> Option<Axis> {
        match self {
            Self::LinkPosition { axis, .. }
            | Self::LinkRotation { axis, .. }
            | Self::LinkCentre { axis, .. }
            | Self::ToolPosition { axis, .. }
            | Self::ToolRotation { axis, .. }
            | Self::BasePosition { axis, .. }
            | Self::BaseRotation { axis, .. }
            | Self::PayloadCentre { axis }
            | Self::TaskForce { axis }
            | Self::Drift { axis } => Some(axis),
            _ => None,
        }
    }

    /// Where its quantity is in an arm; none of the places of frames, and of the task's force.
    pub(super) fn place(self, arm: &mut ElasticArm) -> Option<&mut f64> {
        Some(match self {
            Self::JointCompliance { joint } => &mut arm.compliance_rad_per_nm[joint],
            Self::JointZero { joint } => &mut arm.zero_rad[joint],
            Self::JointBacklash { joint } => &mut arm.backlash[joint].half_width_rad,
            Self::JointStiffening { joint } => &mut arm.stiffening[joint].share,
            Self::JointWave { joint, wave } => arm.amplitude_rad(joint, wave),
            Self::SpringStiffness { spring } => {
                &mut arm.chain.elements.springs[spring].stiffness_n_per_m
            }
            Self::SpringRest { spring } => &mut arm.chain.elements.springs[spring].rest_m[0],
            Self::LinkMass { link } => &mut arm.chain.joints[link].mass_kg,
            Self::LinkCentre { link, axis } => {
                &mut arm.chain.joints[link].centre_of_mass_m[axis.index()]
            }
            Self::PayloadMass => &mut arm.payload.as_mut()?.mass_kg,
            Self::PayloadCentre { axis } => {
                &mut arm.payload.as_mut()?.centre_of_mass_m[axis.index()]
            }
            Self::LoadScale => &mut arm.load_scale,
            Self::LoadOffset => &mut arm.load_offset_n,
            Self::Drift { axis } => &mut arm.drift_m[axis.index()],
            _ => return None,
        })
    }

    /// The quantity that an arm has, in SI units; none of what has no place in it.
    pub fn quantity(self, arm: &ElasticArm) -> Option<f64> {
        self.place(&mut arm.clone()).map(|place| *place)
    }

    /// Where its value is in how its owner's frame differs from the nominal one; none of what is no coordinate of a frame.
    pub(super) fn place_of_frame(self, frame: &mut FrameChange) -> Option<&mut f64> {
        match self {
            Self::LinkPosition { axis, .. }
            | Self::ToolPosition { axis, .. }
            | Self::BasePosition { axis, .. } => Some(&mut frame.position_m[axis.index()]),
            Self::LinkRotation { axis, .. }
            | Self::ToolRotation { axis, .. }
            | Self::BaseRotation { axis, .. } => Some(&mut frame.rotation_rad[axis.index()]),
            _ => None,
        }
    }

    /// The unit of its value; "1" for a logarithm.
    pub const fn unit(self, is_logarithmic: bool) -> &'static str {
        match self {
            Self::JointCompliance { .. } | Self::SpringStiffness { .. } if is_logarithmic => "1",
            _ => self.row().unit,
        }
    }

    /// The unit of the quantity itself, logarithms undone.
    pub const fn quantity_unit(self) -> &'static str {
        match self {
            Self::LinkMass { .. } | Self::PayloadMass => "kg",
            kind => kind.unit(false),
        }
    }

    /// Where it takes a new value.
    pub const fn level(self) -> SourceLevel {
        match self {
            Self::TaskScale | Self::TaskForce { .. } => SourceLevel::Task,
            Self::PayloadMass | Self::PayloadCentre { .. } | Self::Drift { .. } => {
                SourceLevel::Campaign
            }
            _ if self.is_mounted() => SourceLevel::Campaign,
            Self::LoadScale | Self::LoadOffset => SourceLevel::Instrument,
            _ => SourceLevel::Robot,
        }
    }

    /// Whether its value is the same in a later campaign: the robot's and the load cell's are.
    pub const fn is_kept_between_campaigns(self) -> bool {
        matches!(self.level(), SourceLevel::Instrument | SourceLevel::Robot)
    }

    /// Whether it is the robot's, whatever a scenario says of its joints' laws.
    pub fn is_of_any_robot(self) -> bool {
        let is_law = matches!(
            self,
            Self::JointBacklash { .. } | Self::JointStiffening { .. }
        );
        self.level() == SourceLevel::Robot && !is_law
    }

    /// What it does not move, where its name might be read otherwise.
    pub const fn remark(self) -> Option<&'static str> {
        match self {
            Self::ToolPosition { .. } | Self::ToolRotation { .. } => {
                Some("moves the calibration tool only, not the machining tool")
            }
            Self::BasePosition { .. } | Self::BaseRotation { .. } => {
                Some("moves the instrument's frame only; the robot does not tilt under gravity")
            }
            Self::LoadOffset => Some("acts along the load"),
            _ => None,
        }
    }

    /// Whether it is unknown in its logarithm.
    pub const fn is_logarithmic(self, has_prior: bool) -> bool {
        match self {
            Self::JointCompliance { .. } | Self::SpringStiffness { .. } => has_prior,
            Self::LinkMass { .. } | Self::PayloadMass | Self::LoadScale | Self::TaskScale => true,
            _ => false,
        }
    }

    /// The position and the rotation of the base in a station's frame.
    pub fn of_base(station: usize) -> [[Self; 3]; 2] {
        [
            Axis::ALL.map(|axis| Self::BasePosition { station, axis }),
            Axis::ALL.map(|axis| Self::BaseRotation { station, axis }),
        ]
    }

    /// The position and the rotation of a tool on its link.
    pub fn of_tool(tool: usize) -> [[Self; 3]; 2] {
        [
            Axis::ALL.map(|axis| Self::ToolPosition { tool, axis }),
            Axis::ALL.map(|axis| Self::ToolRotation { tool, axis }),
        ]
    }

    /// Everything that readings could tell of a belief, base first.
    pub fn all_of(belief: &ElasticArm) -> Vec<Self> {
        let joints = belief.chain.len();
        let mut kinds = Vec::new();
        let stations = 0..belief.instrument_from_base.len();
        kinds.extend(stations.flat_map(Self::of_base).flatten());
        for link in 0..joints {
            kinds.extend(Axis::ALL.map(|axis| Self::LinkPosition { link, axis }));
            kinds.extend(Axis::ALL.map(|axis| Self::LinkRotation { link, axis }));
        }
        let tools = 0..belief.tools.len();
        kinds.extend(tools.flat_map(Self::of_tool).flatten());
        kinds.extend((0..joints).map(|joint| Self::JointZero { joint }));
        kinds.extend((0..joints).map(|joint| Self::JointCompliance { joint }));
        for spring in 0..belief.chain.elements.springs.len() {
            kinds.extend([
                Self::SpringStiffness { spring },
                Self::SpringRest { spring },
            ]);
        }
        if belief.payload.is_some_and(|payload| payload.mass_kg > 0.0) {
            kinds.push(Self::PayloadMass);
            kinds.extend(Axis::ALL.map(|axis| Self::PayloadCentre { axis }));
        }
        kinds.extend([Self::LoadScale, Self::LoadOffset]);
        kinds
    }

    /// All that may be unknown about a robot, masses of links among it.
    pub fn of_robot(arm: &ElasticArm) -> Vec<Self> {
        let mut kinds = Self::all_of(arm);
        for link in 0..arm.chain.len() {
            kinds.push(Self::JointBacklash { joint: link });
            kinds.push(Self::JointStiffening { joint: link });
            kinds.push(Self::LinkMass { link });
            kinds.extend(Axis::ALL.map(|axis| Self::LinkCentre { link, axis }));
        }
        kinds
    }

    /// The parameter of this name, of those in a list and of waves in the gears of joints that turn.
    pub fn named(name: &str, listed: &[Self], belief: &ElasticArm) -> Option<Self> {
        let wave = || {
            let (owner, word) = name.rsplit_once('.')?;
            let is_owner = |joint: &crate::robot::Joint| joint.name == owner && !joint.drive.slides;
            let joint = belief.chain.joints.iter().position(is_owner)?;
            let wave = GearWave::named(word)?;
            Some(Self::JointWave { joint, wave })
        };
        let known = listed.iter().find(|kind| kind.name(belief) == name);
        known.copied().or_else(wave)
    }

    /// Its unique name, such as `joint_3.compliance`, `link_3.x`, `tool.ry`, `base.z`.
    pub fn name(self, belief: &ElasticArm) -> String {
        // The first of several bears the plain name.
        let numbered = |name: &str, index: usize| match index {
            0 => name.to_owned(),
            index => format!("{name}_{}", index + 1),
        };
        let name = self.filled(self.row().name, belief, &numbered);
        match self {
            Self::JointWave { wave, .. } => name + &wave.name(),
            _ => name,
        }
    }

    /// A text of its row about an arm, whose tools and stations are named so.
    fn filled(
        self,
        text: &str,
        belief: &ElasticArm,
        numbered: &dyn Fn(&str, usize) -> String,
    ) -> String {
        let owner = match self.owner() {
            Owner::Joint(joint) => belief.chain.joints[joint].name.clone(),
            Owner::Spring(spring) => belief.chain.elements.springs[spring].name.clone(),
            Owner::Link(link) => format!("link_{}", link + 1),
            Owner::Tool(tool) => numbered("tool", tool),
            Owner::Station(station) => numbered("base", station),
            Owner::Only => String::new(),
        };
        let axis = self
            .axis()
            .map_or_else(String::new, |axis| axis.to_string());
        text.replace('%', &axis).replace('@', &owner)
    }

    /// The typical size of its deviation from the nominal value, in its own unit: 0.3 mm and 0.3 mrad for
    /// a robot's geometry, which is manufactured, 1 mrad for its zeros, more for what users mount and set
    /// up. The largest nominal compliance stands in for a joint held to be rigid.
    pub fn typical_size(self, belief: &ElasticArm, has_prior: bool) -> f64 {
        match self {
            Self::JointCompliance { joint } if !has_prior => {
                let nominal = &belief.compliance_rad_per_nm;
                let largest = nominal.iter().copied().fold(0.0, f64::max);
                match (nominal[joint] > 0.0, largest > 0.0) {
                    (true, _) => nominal[joint],
                    (false, true) => largest,
                    (false, false) => 1e-6,
                }
            }
            Self::SpringStiffness { spring } if !has_prior => belief.chain.elements.springs[spring]
                .stiffness_n_per_m
                .abs(),
            _ => self.row().size,
        }
    }

    /// What a share of it is a share of where it is not unknown in its logarithm: its nominal value, in its unit; one
    /// for what has no share.
    pub fn whole(self, belief: &ElasticArm) -> f64 {
        match self {
            Self::JointCompliance { joint } => belief.compliance_rad_per_nm[joint],
            Self::SpringStiffness { spring } => {
                belief.chain.elements.springs[spring].stiffness_n_per_m
            }
            _ => 1.0,
        }
    }

    /// Whether it changes the loads that readings are taken under: those of the task are not the load cell's.
    pub const fn is_of_readings_loads(self) -> bool {
        matches!(self, Self::LoadScale | Self::LoadOffset)
    }

    /// Whether it is the place of what users mount and set up: of a tool or of the base.
    pub const fn is_mounted(self) -> bool {
        matches!(self.owner(), Owner::Tool(_) | Owner::Station(_))
    }

    /// Whether it is of what a joint stands off its spring by: its gap, or what it gives besides.
    pub const fn leans(self) -> bool {
        matches!(
            self,
            Self::JointBacklash { .. } | Self::JointStiffening { .. }
        )
    }

    /// Whether it is a gap of an arm that turns over at a torque.
    pub fn is_turned_over(self, arm: &ElasticArm) -> bool {
        match self {
            Self::JointBacklash { joint } => arm.backlash[joint].turned_over_at_nm.is_some(),
            _ => false,
        }
    }

    /// Whether it changes the torque at which a gap of the unloaded arm leans to one side: it is of a spring, or of what weighs.
    pub const fn turns_over_others(self) -> bool {
        matches!(self.owner(), Owner::Spring(_)) || self.is_of_mass()
    }

    /// Whether it is of what weighs: of a link with all that is fixed to it, or of a payload.
    pub const fn is_of_mass(self) -> bool {
        matches!(
            self,
            Self::LinkMass { .. }
                | Self::LinkCentre { .. }
                | Self::PayloadMass
                | Self::PayloadCentre { .. }
        )
    }

    /// What it is, in words.
    pub fn words(self, belief: &ElasticArm) -> String {
        let numbered = |name: &str, index: usize| match (name, index) {
            (name, 0) => format!("the {name}"),
            ("base", station) => format!("the base at station {}", station + 1),
            (name, index) => format!("{name} {}", index + 1),
        };
        let words = self.filled(self.row().words, belief, &numbered);
        match self {
            Self::JointWave { wave, .. } => {
                let often = match wave.per_turn.get() {
                    1 => "once".to_owned(),
                    count => format!("{count} times"),
                };
                format!("the {} {words} {often} a turn", wave.phase.word())
            }
            _ => words,
        }
    }
}
