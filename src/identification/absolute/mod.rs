//! One fit to absolute readings: where stations and targets are, joint zeros, geometry, compliances, springs and
//! masses together.
//!
//! Frames start from closed forms of the data ([`MountedFrames`](super::MountedFrames)). What cannot be separated by any
//! reading, such as a joint's zero and the base's rotation about its axis, is left out one by one and named; what these readings
//! do not determine stays at its nominal value and is named, too.

mod blocks;
mod case;
mod choices;
mod discrepancy;
mod fit;
mod inconsistencies;
mod joint_errors;
mod lengths;
mod mixed;
mod model_selection;
mod outliers;
mod parts;
mod pattern_rows;
mod prognoses;
mod repeat_components;
mod residuals;
mod sharing;
mod sources;
mod unexplained;
mod unknowns;
mod visits;

use super::copies::CopiedReadings;
use super::discrepancy::{ReadingResidual, joint_space_blocks};
use super::error::{FitResult, IdentificationError};
use super::outliers::RejectedReading;
pub use case::AbsoluteCase;
pub use choices::{FitChoices, ReadingWeights};
pub use fit::AbsoluteFit;
pub use inconsistencies::{CONTRADICTION, Inconsistencies, Inconsistency};
pub use joint_errors::{DiscrepancyModel, JointError, ReadingPrognosis, SQUARE_95, Unexplained};
pub use mixed::{ComponentIntervals, VarianceComponents};
pub use model_selection::{CrossValidation, ModelSelection, NestedModel, Recommendation};
pub use parts::{PartsOfReadings, PredictedPositions, SimulatedReadings};
pub use prognoses::{MovedStation, OtherReadings};
pub use repeat_components::{PoseReturn, RepeatComponent, RepeatComponents};
pub use residuals::DistanceStatistics;
pub use unknowns::{LeftOut, ParameterGroup};
pub use visits::visit_classes;
