//! Why no plan can be made of candidates.

use thiserror::Error;

/// Why no plan can be made of the candidates.
#[derive(Debug, Clone, Copy, Error, PartialEq, Eq)]
pub enum FiniteError {
    /// All together do not determine what is asked for.
    #[error("the candidates do not determine what is asked for, whichever are measured")]
    Undetermined,
    /// They may not be measured so often.
    #[error("the candidates allow {allowed} measurements, and {wanted} are wanted")]
    TooFew {
        /// How many measurements there can be.
        allowed: u64,
        /// How many are wanted.
        wanted: u32,
    },
    /// So few measurements determine nothing.
    #[error("{measurements} of the candidates cannot determine {unknowns} unknowns")]
    Singular {
        /// The number of measurements.
        measurements: u32,
        /// The number of unknowns.
        unknowns: usize,
    },
}
