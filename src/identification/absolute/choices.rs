//! How absolute readings are fitted.

/// How much each reading counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReadingWeights {
    /// By its own covariance alone.
    Own,
    /// By its own covariance, and by what the planner's model says of its other errors; where the residuals say that the first cannot be all,
    /// by what the model leaves unexplained in their place.
    AsNeeded,
    /// By what the model leaves unexplained, too.
    WithDiscrepancy,
}

/// How absolute readings are fitted.
#[derive(Debug, Clone, Copy)]
pub struct FitChoices {
    /// How much each reading counts.
    pub weights: ReadingWeights,
    /// Whether those that lie far out are fitted, too.
    pub keeps_all: bool,
    /// Whether joint error functions are used, those of the planner's model among them.
    pub uses_joint_errors: bool,
}

impl FitChoices {
    /// By such weights, without outliers, with joint error functions.
    pub const fn weighed(weights: ReadingWeights) -> Self {
        Self {
            weights,
            keeps_all: false,
            uses_joint_errors: true,
        }
    }
}
