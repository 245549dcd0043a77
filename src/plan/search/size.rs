//! How large plans are.

use crate::plan::Plan;
use crate::task::Task;

/// How large a plan is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlanSize {
    /// The number of measurements.
    pub measurements: u32,
    /// How many of them may be of different configurations.
    pub configurations: u32,
}

impl PlanSize {
    /// So many measurements in so many configurations, or in as many as there are measurements, which are never more.
    pub fn new(measurements: u32, configurations: Option<u32>) -> Self {
        Self {
            measurements,
            configurations: configurations.map_or(measurements, |most| most.min(measurements)),
        }
    }

    /// The size that a task wants.
    pub fn wanted_by(task: &Task) -> Self {
        Self::new(task.design.experiments, task.design.configurations)
    }

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

    /// What is free of it beside mandatory experiments, whose configurations may be measured again.
    pub fn beside(self, mandatory: &Plan) -> Self {
        let measurements = self.measurements.saturating_sub(mandatory.measurements());
        let visited = u32::try_from(mandatory.by_configuration().len()).unwrap_or(u32::MAX);
        let configurations = self.configurations.saturating_sub(visited);
        Self::new(measurements, Some(configurations))
    }
}
