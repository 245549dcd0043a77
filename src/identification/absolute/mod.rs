//! One fit to absolute readings: where stations and targets are, joint zeros, geometry, compliances, springs and
//! masses together.
//!
//! Frames start from closed forms of the data ([`MountedFrames`](super::MountedFrames)). What cannot be told apart by any
//! reading, such as a joint's zero and the base's rotation about its axis, is left out one by one and named; what these readings
//! do not determine stays at its nominal value and is named, too.

mod case;
mod error;
mod fit;
mod left;
mod misfit;
mod transfer;
mod unknowns;

pub use case::AbsoluteCase;
pub use error::AbsoluteError;
pub use fit::{AbsoluteFit, ReadingWeights};
pub use left::{DistanceStatistics, ReadingResidual};
pub use misfit::{Misfit, joint_space_blocks};
pub use unknowns::{LeftOut, ParameterGroup};
