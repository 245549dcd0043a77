//! Parameters of a robot, sets of them with priors, error sources, and what is unidentifiable.
//!
//! A [`ElasticArm`] is what planner and identification believe of an arm: its chain, compliances, joint
//! zeros, tools, payload, load and the instrument's frame. A [`ParameterSet`] lists what of it is
//! unknown, with a typical size and, where there is one, a prior for each; a vector of values makes a
//! nominal belief into another one. [`Freedoms`] are the directions of that vector that readings
//! cannot show, with words for them.
//!
//! Positive quantities with a prior, and those that multiply another unknown (payload mass, scale of
//! the load), are unknown in their logarithm, so that a product is a sum; a compliance without a prior
//! is linear, as in the paper.

#[cfg(test)]
#[path = "tests/arms.rs"]
pub(crate) mod arms;
mod backlash;
mod elastic_arm;
mod frames;
mod freedoms;
mod gear;
mod kind;
mod level;
mod prior;
mod set;
mod uncertainty;
mod words;

pub use backlash::Backlash;
pub(crate) use elastic_arm::along;
pub use elastic_arm::{ElasticArm, Leaning, Payload};
pub(crate) use frames::FrameChange;
pub use freedoms::Freedoms;
pub(crate) use freedoms::relative_precision;
pub use gear::{GearWave, WaveError, WavePhase};
pub use kind::{Axis, ParameterKind, log_ratio};
pub use level::SourceLevel;
pub use prior::{Prior, PriorAt};
pub use set::{Parameter, ParameterError, ParameterSet};
pub use uncertainty::{
    DiscrepancyOf, ErrorDistribution, JointFunction, RangeNoise, ReadingSource, Source,
    TransmissionError, Uncertainty, UnexplainedError, Unloaded, counted_times,
};
pub use words::Freedom;
