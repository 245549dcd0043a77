//! One fit to absolute readings: where stations and targets are, joint zeros, geometry, compliances, springs and
//! masses together.
//!
//! Frames start from closed forms of the data ([`MountedFrames`](super::MountedFrames)). What cannot be told apart by any
//! reading, such as a joint's zero and the base's rotation about its axis, is left out one by one and named; what these readings
//! do not determine stays at its nominal value and is named, too.

mod blocks;
mod case;
mod contradictions;
mod error;
mod fit;
mod joint_errors;
mod ladder;
mod left;
mod looked;
mod mixed;
mod parts;
mod rejection;
mod rows;
mod transfer;
mod unknowns;
mod without;

use super::misfit::{Misfit, ReadingResidual, joint_space_blocks};
use super::rejection::RejectedReading;
pub use blocks::FEWEST_BLOCKS;
pub use case::AbsoluteCase;
pub use contradictions::{CONTRADICTION, Contradiction, Contradictions, SeriesEstimates};
pub use error::AbsoluteError;
pub use fit::{AbsoluteFit, ReadingWeights, Unexplained};
pub use joint_errors::{JointError, MisfitModel, MovedStation, ReadingPrognosis, SQUARE_95};
pub use ladder::{CrossValidation, Ladder, ParameterChange, Recommendation, Rung, RungTest};
pub use left::DistanceStatistics;
pub use parts::PartsOfReadings;
pub use unknowns::{LeftOut, ParameterGroup};
