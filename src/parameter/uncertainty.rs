//! What nobody knows exactly, besides the instrument's noise.
//!
//! Three classes average differently: what is new in each reading belongs to the reading's covariance; what
//! is shared by the whole plan is a parameter with a prior, and no number of readings averages it away.

use nalgebra::Vector3;

use super::ParameterKind;

/// Something uncertain, as a scenario lists it.
#[derive(Debug, Clone, PartialEq)]
pub struct Uncertainty {
    /// Its unique name, which results bear.
    pub name: String,
    /// Whether the belief does not know of it: the planner is then wrong.
    pub is_hidden: bool,
    /// What is uncertain, and by how much.
    pub source: Source,
}

impl Uncertainty {
    /// Makes it certain; it still takes as many random numbers.
    pub fn switch_off(&mut self) {
        match &mut self.source {
            Source::Plan(parameters) => {
                for (_, deviation) in parameters {
                    *deviation = 0.0;
                }
            }
            Source::Reading(source) => source.switch_off(),
        }
    }
}

/// What is uncertain, by the class in which it averages.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// Shared by the whole plan: parameters, each with its standard deviation in its own unit; positive
    /// ones in their logarithm.
    Plan(Vec<(ParameterKind, f64)>),
    /// New in each reading, or in each experiment.
    Reading(ReadingSource),
}

/// What is new in each reading of a deflection, or in each experiment and shared by its repeats.
#[derive(Debug, Clone, PartialEq)]
pub enum ReadingSource {
    /// Each joint comes back to its command only within a standard deviation (rad; m where it slides)
    /// between the unloaded and the loaded reading: hysteresis, repeatability. One for each joint.
    JointReturn(Vec<f64>),
    /// The load acts in another direction: the standard deviation (rad) of each coordinate of a small rotation
    /// vector.
    LoadDirection(f64),
    /// The load acts at another point: the standard deviation (m) of each coordinate.
    LoadPoint(f64),
    /// The instrument's noise grows with the distance from where it stands.
    Range {
        /// Where the instrument stands, in the world frame (m).
        from_m: Vector3<f64>,
        /// The standard deviation of each coordinate of a deflection per metre of distance.
        per_metre: f64,
    },
    /// Each joint stands where it stands with an error of its gear (rad; m where it slides) that is another one in each
    /// configuration, loaded and unloaded the same, in all repeats. One for each joint.
    GearError(Vec<f64>),
    /// A reading is wrong: nobody notices that the reflector was touched, or the wrong place read.
    Wrong {
        /// The share of readings that are.
        share: f64,
        /// The standard deviation (m) of each coordinate of what is wrong with them.
        deviation_m: f64,
    },
    /// This share of the readings is not there: the beam was lost.
    Dropped(f64),
    /// What no parameter explains is another deflection in each configuration, the same in all repeats: the standard
    /// deviation (m) of each coordinate.
    Misfit(f64),
}

impl ReadingSource {
    fn switch_off(&mut self) {
        match self {
            Self::JointReturn(deviations) | Self::GearError(deviations) => deviations.fill(0.0),
            Self::LoadDirection(deviation)
            | Self::LoadPoint(deviation)
            | Self::Misfit(deviation) => {
                *deviation = 0.0;
            }
            Self::Range { per_metre, .. } => *per_metre = 0.0,
            Self::Wrong { share, .. } | Self::Dropped(share) => *share = 0.0,
        }
    }

    /// The variance of each coordinate of a position (m^2) of what moves nothing, where the tool stands there; `None` of
    /// what moves the robot, its load or its joints.
    #[must_use]
    pub fn variance_of_positions(&self, tool_m: &Vector3<f64>) -> Option<f64> {
        match self {
            Self::Misfit(deviation) => Some(deviation * deviation),
            Self::Range { from_m, per_metre } => {
                Some((tool_m - from_m).norm_squared() * per_metre * per_metre)
            }
            Self::Wrong { share, deviation_m } => Some(share * deviation_m * deviation_m),
            // What is not there has no error.
            Self::Dropped(_) => Some(0.0),
            _ => None,
        }
    }

    /// How many normal numbers a reading takes for it.
    #[must_use]
    pub const fn numbers(&self) -> usize {
        match self {
            Self::JointReturn(deviations) | Self::GearError(deviations) => deviations.len(),
            Self::LoadDirection(_) | Self::LoadPoint(_) | Self::Range { .. } | Self::Misfit(_) => 3,
            Self::Wrong { .. } => 4,
            Self::Dropped(_) => 1,
        }
    }

    /// Whether repeats of an experiment share it, so that they do not average it.
    #[must_use]
    pub const fn is_shared_by_repeats(&self) -> bool {
        matches!(self, Self::GearError(_) | Self::Misfit(_))
    }
}
