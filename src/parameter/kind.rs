//! The kinds of parameters, with their units, names and typical sizes.

use std::fmt;

use super::{ElasticArm, GearWave, SourceLevel};

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
    /// By what share of what its spring gives at a torque a joint gives less there, see [`super::Stiffening`].
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

impl ParameterKind {
    /// The unit of its value; "1" for a logarithm.
    pub const fn unit(self, is_logarithmic: bool) -> &'static str {
        match self {
            Self::JointCompliance { .. } | Self::SpringStiffness { .. } if is_logarithmic => "1",
            Self::JointCompliance { .. } => "rad/(N m)",
            Self::SpringStiffness { .. } => "N/m",
            Self::JointZero { .. }
            | Self::JointBacklash { .. }
            | Self::JointWave { .. }
            | Self::LinkRotation { .. }
            | Self::ToolRotation { .. }
            | Self::BaseRotation { .. } => "rad",
            Self::LinkPosition { .. }
            | Self::SpringRest { .. }
            | Self::ToolPosition { .. }
            | Self::BasePosition { .. }
            | Self::LinkCentre { .. }
            | Self::PayloadCentre { .. }
            | Self::Drift { .. } => "m",
            Self::JointStiffening { .. }
            | Self::LinkMass { .. }
            | Self::PayloadMass
            | Self::LoadScale
            | Self::TaskScale => "1",
            Self::LoadOffset | Self::TaskForce { .. } => "N",
        }
    }

    /// Where it takes a new value.
    pub const fn level(self) -> SourceLevel {
        match self {
            Self::TaskScale | Self::TaskForce { .. } => SourceLevel::Task,
            Self::ToolPosition { .. }
            | Self::ToolRotation { .. }
            | Self::BasePosition { .. }
            | Self::BaseRotation { .. }
            | Self::PayloadMass
            | Self::PayloadCentre { .. }
            | Self::Drift { .. } => SourceLevel::Campaign,
            Self::LoadScale | Self::LoadOffset => SourceLevel::Instrument,
            _ => SourceLevel::Robot,
        }
    }

    /// Whether its value is the same in a later campaign: the robot's and the load cell's are.
    pub const fn is_kept_between_campaigns(self) -> bool {
        matches!(self.level(), SourceLevel::Instrument | SourceLevel::Robot)
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

    /// Everything that readings could tell of a belief, base first.
    pub fn all_of(belief: &ElasticArm) -> Vec<Self> {
        let joints = belief.chain.len();
        let mut kinds = Vec::new();
        let mut frame = |position: &dyn Fn(Axis) -> Self, rotation: &dyn Fn(Axis) -> Self| {
            kinds.extend(Axis::ALL.map(position));
            kinds.extend(Axis::ALL.map(rotation));
        };
        for station in 0..belief.instrument_from_base.len() {
            frame(&|axis| Self::BasePosition { station, axis }, &|axis| {
                Self::BaseRotation { station, axis }
            });
        }
        for link in 0..joints {
            frame(&|axis| Self::LinkPosition { link, axis }, &|axis| {
                Self::LinkRotation { link, axis }
            });
        }
        for tool in 0..belief.tools.len() {
            frame(&|axis| Self::ToolPosition { tool, axis }, &|axis| {
                Self::ToolRotation { tool, axis }
            });
        }
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
        let tool = |index: usize| numbered("tool", index);
        let joint = |index: usize| &belief.chain.joints[index].name;
        let named = |spring: usize| &belief.chain.elements.springs[spring].name;
        match self {
            Self::JointCompliance { joint: index } => format!("{}.compliance", joint(index)),
            Self::JointZero { joint: index } => format!("{}.zero", joint(index)),
            Self::JointBacklash { joint: index } => format!("{}.backlash", joint(index)),
            Self::JointStiffening { joint: index } => format!("{}.stiffening", joint(index)),
            Self::JointWave { joint: index, wave } => format!("{}.{}", joint(index), wave.name()),
            Self::SpringStiffness { spring } => format!("{}.stiffness", named(spring)),
            Self::SpringRest { spring } => format!("{}.rest", named(spring)),
            Self::LinkPosition { link, axis } => format!("link_{}.{axis}", link + 1),
            Self::LinkRotation { link, axis } => format!("link_{}.r{axis}", link + 1),
            Self::LinkMass { link } => format!("link_{}.mass", link + 1),
            Self::LinkCentre { link, axis } => format!("link_{}.c{axis}", link + 1),
            Self::ToolPosition { tool: index, axis } => format!("{}.{axis}", tool(index)),
            Self::ToolRotation { tool: index, axis } => format!("{}.r{axis}", tool(index)),
            Self::BasePosition { station, axis } => format!("{}.{axis}", numbered("base", station)),
            Self::BaseRotation { station, axis } => {
                format!("{}.r{axis}", numbered("base", station))
            }
            Self::PayloadMass => "payload.mass".to_owned(),
            Self::PayloadCentre { axis } => format!("payload.{axis}"),
            Self::LoadScale => "load.scale".to_owned(),
            Self::LoadOffset => "load.offset".to_owned(),
            Self::TaskScale => "task.scale".to_owned(),
            Self::TaskForce { axis } => format!("task.f{axis}"),
            Self::Drift { axis } => format!("drift.{axis}"),
        }
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
            Self::JointCompliance { .. } | Self::SpringStiffness { .. } => 1.0,
            Self::LinkPosition { .. } | Self::LinkRotation { .. } => 3e-4,
            Self::JointBacklash { .. } | Self::JointWave { .. } => 1e-4,
            Self::JointZero { .. } | Self::ToolPosition { .. } => 1e-3,
            Self::ToolRotation { .. }
            | Self::SpringRest { .. }
            | Self::BasePosition { .. }
            | Self::BaseRotation { .. }
            | Self::LinkCentre { .. }
            | Self::PayloadCentre { .. }
            | Self::JointStiffening { .. }
            | Self::LoadScale
            | Self::TaskScale => 1e-2,
            Self::LoadOffset | Self::TaskForce { .. } => 10.0,
            Self::Drift { .. } => 1e-5,
            Self::PayloadMass | Self::LinkMass { .. } => 5e-2,
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

    /// Whether it is the place of what users mount and set up: of a tool or of the base.
    pub const fn is_mounted(self) -> bool {
        matches!(
            self,
            Self::ToolPosition { .. }
                | Self::ToolRotation { .. }
                | Self::BasePosition { .. }
                | Self::BaseRotation { .. }
        )
    }

    /// Whether it is of what a joint stands off its spring by: its gap, or what it gives besides.
    pub const fn leans(self) -> bool {
        matches!(
            self,
            Self::JointBacklash { .. } | Self::JointStiffening { .. }
        )
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
        let joint = |index: usize| &belief.chain.joints[index].name;
        let named = |spring: usize| &belief.chain.elements.springs[spring].name;
        let tool = |index: usize| match index {
            0 => "the tool".to_owned(),
            index => format!("tool {}", index + 1),
        };
        let base = |station: usize| match station {
            0 => "the base".to_owned(),
            station => format!("the base at station {}", station + 1),
        };
        match self {
            Self::JointCompliance { joint: index } => format!("the compliance of {}", joint(index)),
            Self::JointZero { joint: index } => format!("the zero of {}", joint(index)),
            Self::JointBacklash { joint: index } => format!("the backlash of {}", joint(index)),
            Self::JointStiffening { joint: index } => {
                format!("the stiffening of {}", joint(index))
            }
            Self::JointWave { joint: index, wave } => format!(
                "the {} in {}'s gear that comes {} a turn",
                wave.phase.word(),
                joint(index),
                times(wave.per_turn.get())
            ),
            Self::SpringStiffness { spring } => format!("the stiffness of {}", named(spring)),
            Self::SpringRest { spring } => format!("the rest length of {}", named(spring)),
            Self::LinkPosition { link, axis } => {
                format!("link_{}'s position along {axis}", link + 1)
            }
            Self::LinkRotation { link, axis } => {
                format!("link_{}'s rotation about {axis}", link + 1)
            }
            Self::LinkMass { link } => format!("link_{}'s mass", link + 1),
            Self::LinkCentre { link, axis } => {
                format!("link_{}'s centre of mass along {axis}", link + 1)
            }
            Self::ToolPosition { tool: index, axis } => {
                format!("{}'s position along {axis}", tool(index))
            }
            Self::ToolRotation { tool: index, axis } => {
                format!("{}'s rotation about {axis}", tool(index))
            }
            Self::BasePosition { station, axis } => {
                format!("{}'s position along {axis}", base(station))
            }
            Self::BaseRotation { station, axis } => {
                format!("{}'s rotation about {axis}", base(station))
            }
            Self::PayloadMass => "the payload's mass".to_owned(),
            Self::PayloadCentre { axis } => format!("the payload's centre along {axis}"),
            Self::LoadScale => "the scale of the load".to_owned(),
            Self::LoadOffset => "the offset of the load".to_owned(),
            Self::TaskScale => "the scale of the task's load".to_owned(),
            Self::TaskForce { axis } => format!("the task's force along {axis}"),
            Self::Drift { axis } => format!("the instrument's drift along {axis}"),
        }
    }
}

/// How often, in words.
fn times(count: u32) -> String {
    match count {
        1 => "once".to_owned(),
        count => format!("{count} times"),
    }
}

/// The first of several bears the plain name.
fn numbered(name: &str, index: usize) -> String {
    match index {
        0 => name.to_owned(),
        index => format!("{name}_{}", index + 1),
    }
}

/// One unknown.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// What it is.
    pub kind: ParameterKind,
    /// Its unique name.
    pub name: String,
    /// Whether its value is a logarithm of a ratio to the nominal quantity.
    pub is_logarithmic: bool,
    /// Its value in the nominal belief: 0 for logarithms and for deviations of frames.
    pub nominal: f64,
    /// Its typical size: the prior's standard deviation where there is one. What is determined is judged
    /// in these sizes.
    pub scale: f64,
    /// The standard deviation of its own prior about the nominal value, where there is one.
    pub prior_deviation: Option<f64>,
}

impl Parameter {
    /// The unit of its value.
    pub const fn unit(&self) -> &'static str {
        self.kind.unit(self.is_logarithmic)
    }

    /// How far a fit may change it in one step, in its own unit: beyond this a linear model says nothing.
    pub(crate) fn longest_step(&self) -> f64 {
        match self.kind {
            _ if self.is_logarithmic => 1.0,
            ParameterKind::JointCompliance { .. } => 3.0 * self.nominal.max(self.scale),
            ParameterKind::SpringStiffness { .. } => 3.0 * self.nominal.abs().max(self.scale),
            ParameterKind::LinkCentre { .. }
            | ParameterKind::PayloadCentre { .. }
            | ParameterKind::SpringRest { .. } => 0.3,
            ParameterKind::LinkPosition { .. }
            | ParameterKind::ToolPosition { .. }
            | ParameterKind::BasePosition { .. }
            | ParameterKind::LoadOffset
            | ParameterKind::TaskForce { .. } => f64::INFINITY,
            _ => 1.0,
        }
    }

    /// The quantity itself, in SI units, for a value of the parameter: itself, or the nominal
    /// quantity times its exponential.
    pub fn quantity(&self, nominal: &ElasticArm, value: f64) -> f64 {
        if !self.is_logarithmic {
            return value;
        }
        let nominal = match self.kind {
            ParameterKind::JointCompliance { joint } => nominal.compliance_rad_per_nm[joint],
            ParameterKind::SpringStiffness { spring } => {
                nominal.chain.elements.springs[spring].stiffness_n_per_m
            }
            ParameterKind::LinkMass { link } => nominal.chain.joints[link].mass_kg,
            ParameterKind::PayloadMass => (nominal.payload).map_or(0.0, |payload| payload.mass_kg),
            _ => nominal.load_scale,
        };
        nominal * value.exp()
    }
}
