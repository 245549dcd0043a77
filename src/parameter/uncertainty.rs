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

/// What is uncertain, by the class in which it averages.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// Shared by the whole plan: parameters, each with its standard deviation in its own unit; positive
    /// ones in their logarithm.
    Plan(Vec<(ParameterKind, f64)>),
    /// New in each reading.
    Reading(ReadingSource),
}

/// What is new in each reading of a deflection.
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
}
