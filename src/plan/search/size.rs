//! How large plans are.

use crate::plan::Plan;

/// How large a plan is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlanSize {
    /// The number of measurements.
    pub measurements: u32,
    /// How many of them may be of different configurations.
    pub configurations: u32,
}

impl PlanSize {
    /// So many measurements, each of which may be of a configuration of its own.
    pub const fn all_different(measurements: u32) -> Self {
        Self {
            measurements,
            configurations: measurements,
        }
    }

    /// The size that a plan has.
    pub fn of(plan: &Plan) -> Self {
        Self {
            measurements: plan.measurements(),
            configurations: u32::try_from(plan.experiments.len()).unwrap_or(u32::MAX),
        }
    }
}
