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
    /// No measurement depends on any of the compliances.
    #[error("no measurement depends on any of the compliances: no load has a torque on the joints")]
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
    /// The nominal model has no equilibrium where one was measured.
    #[error("measurement {measurement}: with the compliances that fit so far, {source}")]
    Equilibrium {
        /// The measurement's number, from 1.
        measurement: usize,
        /// What is wrong.
        source: EquilibriumError,
    },
    /// The non-linear estimate did not converge.
    #[error(
        "the non-linear estimate did not converge: the last step changed a compliance by {change:.1e} of itself"
    )]
    NotConverged {
        /// The last relative change.
        change: f64,
    },
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
