//! What this program designs for the paper's numbers of measurements and configurations.

use super::ReproductionError;
use crate::paper::published::TABLE_6;
use crate::plan::search::{Bound, PlanSize, Problem, Watch, approximate_design, exact_design};
use crate::plan::{Criterion, Plan};
use crate::scenario::Scenario;

/// The best plan that was found for so many measurements in so many configurations.
#[derive(Debug, Clone, PartialEq)]
pub struct DesignedPlan {
    /// The number of measurements.
    pub experiments: u32,
    /// The number of different configurations.
    pub configurations: u32,
    /// The plan; it shares out the repeats as is best.
    pub plan: Plan,
    /// Its predicted rms distance (m).
    pub rho0_m: f64,
    /// No plan of as many measurements has a smaller one (m), as [`Bound`] says.
    pub lower_bound_m: Option<f64>,
}

/// Designs a plan for each number of Table 6.
///
/// # Errors
/// No plan was found.
pub fn designs(
    scenario: &Scenario,
    watch: Watch<'_>,
    progress: &dyn Fn(usize, usize),
) -> Result<Vec<DesignedPlan>, ReproductionError> {
    let problem = Problem::new(&scenario.task, Criterion::TestPose);
    let approximate = approximate_design(&problem, scenario.seed)?;
    let bound = Bound::new(&scenario.task, &approximate);
    let mut designs = Vec::new();
    for (index, &(experiments, configurations, _)) in TABLE_6.iter().enumerate() {
        progress(index, TABLE_6.len());
        let size = PlanSize {
            measurements: experiments,
            configurations,
        };
        let exact = exact_design(&problem, &approximate, size, scenario.seed, watch, &[])?;
        designs.push(DesignedPlan {
            experiments,
            configurations,
            plan: exact.plan,
            rho0_m: exact.cost.sqrt(),
            lower_bound_m: bound.of_size(experiments).ok().map(|bound| bound.best),
        });
    }
    Ok(designs)
}
