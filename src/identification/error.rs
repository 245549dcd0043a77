//! What can go wrong in identification.

use thiserror::Error;

use crate::codes::ErrorCode;
use crate::robot::EquilibriumError;

/// Why nothing can be identified.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum IdentificationError {
    /// There are no measurements.
    #[error("there are no measurements")]
    NoMeasurements,
    /// No measurement depends on any of the parameters: no load has a torque on a joint, for example.
    #[error("the measurements determine none of the parameters")]
    NothingObserved,
    /// Sigma cannot be estimated from as many equations as unknowns.
    #[error(
        "sigma cannot be estimated from residuals: {equations} equations determine {rank} unknowns: there are no degrees of freedom"
    )]
    NoResiduals {
        /// The number of scalar measurements.
        equations: usize,
        /// The number of determined combinations.
        rank: usize,
    },
    /// The model has no equilibrium where one was measured.
    #[error("measurement {measurement}: with the parameters that fit so far, {source}")]
    Equilibrium {
        /// The measurement's number, from 1.
        measurement: usize,
        /// What is wrong.
        source: EquilibriumError,
    },
    /// The fit did not converge.
    #[error("the fit did not converge: the last step was {step:.1e} standard errors")]
    NotConverged {
        /// The length of the last step.
        step: f64,
    },
}

/// What a fit gives, if anything.
pub type FitResult<T> = Result<T, IdentificationError>;

impl From<(usize, EquilibriumError)> for IdentificationError {
    /// Of a measurement that counts from 0.
    fn from((index, source): (usize, EquilibriumError)) -> Self {
        Self::Equilibrium {
            measurement: index + 1,
            source,
        }
    }
}

impl IdentificationError {
    /// Its kind.
    pub const fn code(&self) -> ErrorCode {
        match self {
            Self::NoMeasurements | Self::NothingObserved | Self::NoResiduals { .. } => {
                ErrorCode::NothingIdentified
            }
            Self::Equilibrium { .. } => ErrorCode::NoEquilibrium,
            Self::NotConverged { .. } => ErrorCode::NotConverged,
        }
    }
}
