//! Identification of joint compliances from measured deflections, eqs. 5 to 13.
//!
//! [`identify`] has the planner's model and measurements, never the simulated truth. It names what cannot
//! be identified instead of inverting a singular matrix, keeps its nominal value, and identifies the rest.

mod absolute;
mod case;
mod conditions;
mod covariance;
pub mod diagnoses;
mod equations;
mod error;
mod estimate;
mod extended;
mod fit;
mod frames;
mod gauss_newton;
mod misfit;
pub mod patterns;
mod prediction;
mod rejection;
mod residuals;
mod robust;
mod spread;
mod stored;
mod tails;

pub use absolute::{
    AbsoluteCase, AbsoluteError, AbsoluteFit, CONTRADICTION, Contradiction, Contradictions,
    CrossValidation, DistanceStatistics, FEWEST_BLOCKS, JointError, Ladder, LeftOut, MisfitModel,
    MovedStation, ParameterChange, ParameterGroup, PartsOfReadings, ReadingPrognosis,
    ReadingWeights, Recommendation, Rung, RungTest, SQUARE_95, SeriesEstimates, Unexplained,
};
pub use case::{Case, Sigma};
pub use conditions::IMPLAUSIBLE;
pub use covariance::{covariance_of, covariance_of_any};
pub use error::IdentificationError;
pub use estimate::{Estimate, Identification, ParameterEstimate, UncertainEstimate, identify};
pub use frames::{MountedFrames, Sight};
pub use gauss_newton::{FitError, ParameterFit, fit_parameters};
pub use misfit::{Misfit, ReadingResidual, joint_space_blocks};
pub use prediction::{Predicted, PredictionError, Predictions};
pub use rejection::RejectedReading;
pub use residuals::{MeasurementResidual, Residuals, Suspect, residuals};
pub use robust::{RobustIdentification, Robustness};
pub use spread::SPREAD_ORDERS;
pub use stored::{OtherUnknowns, StoredIdentification};
