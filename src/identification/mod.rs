//! Identification of joint compliances from measured deflections, eqs. 5 to 13.
//!
//! A [`Case`] has the planner's model and measurements, never the simulated truth. It names what cannot
//! be identified instead of inverting a singular matrix, keeps its nominal value, and identifies the rest.

mod absolute;
mod case;
mod conditions;
mod copies;
mod discrepancy;
mod equations;
mod error;
mod estimate;
mod fit;
mod frames;
mod identified;
pub mod input_errors;
mod nominal;
mod outliers;
pub mod patterns;
mod prediction;
mod prior_consistency;
mod repeats;
mod residuals;
mod robust;
mod spread;
mod tails;
mod whitening;

pub use absolute::{
    AbsoluteCase, AbsoluteFit, CONTRADICTION, ComponentIntervals, CrossValidation,
    DiscrepancyModel, DistanceStatistics, FitChoices, Inconsistencies, Inconsistency, JointError,
    LeftOut, ModelSelection, MovedStation, NestedModel, OtherReadings, ParameterGroup,
    PartsOfReadings, PoseReturn, PredictedPositions, ReadingPrognosis, ReadingWeights,
    Recommendation, RepeatComponent, RepeatComponents, SQUARE_95, SimulatedReadings, Unexplained,
    VarianceComponents, visit_classes,
};
pub use case::{Case, Sigma};
pub use conditions::impossible_compliance;
pub(crate) use conditions::{Told, left_out};
pub use copies::CopiedReadings;
pub use discrepancy::{ReadingResidual, with_discrepancy};
pub use error::{FitResult, IdentificationError};
pub(crate) use estimate::PreparedCase;
pub use estimate::{Estimate, Identification, ParameterEstimate, UncertainEstimate};
pub use fit::{ParameterFit, fit_parameters};
pub use frames::{MountedFrames, RobustFrames, Sight};
pub use identified::{
    AbsoluteMessage, IdentificationBasis, IdentificationMessage, IdentifiedFile, IdentifiedRecord,
    JointErrorMessage, MountedFrameMessage, ReadRange, ReadRanges, StoredIdentification,
    StoredRobot, UnexplainedMessage, UnknownMessage, UnknownValue,
};
pub use nominal::UNKNOWN as UNKNOWN_COMPLIANCE;
pub use outliers::{IMPLAUSIBLE, RejectedReading};
pub use prediction::{Predicted, Predictions};
pub use repeats::{PlaceDrift, RepeatedPose, Repeats};
pub use residuals::{MeasurementResidual, residuals};
pub use robust::{RobustIdentification, Robustness};
use spread::{MOST_SPREAD, SPREAD_ORDERS};
