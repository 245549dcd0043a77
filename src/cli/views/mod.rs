//! Recordings, pages and pictures: what the commands show of their results.

mod study;
mod target;
mod written;

use elastocal::calibration::Calibration;
use elastocal::codes::Condition;
use elastocal::plan::search::RepeatsNeeded;
use elastocal::record::evidence::EvidenceMessage;
use elastocal::scenario::Scenario;
use elastocal::workflow::run::PlanRecords;

pub use written::*;

/// The names of the targets of `--rerun`, for the help.
pub const TARGETS: &str = "spawn|connect[=URL]|save=FILE";

/// What is shown of a run.
#[derive(Debug, Clone, Copy)]
pub struct RunShown<'a> {
    pub scenario: &'a Scenario,
    /// The plans' names and calibrations, the designed plan first.
    pub calibrations: &'a [(String, Calibration)],
    /// Their records.
    pub records: &'a [PlanRecords],
    /// What the designed plan is shown beside.
    pub evidence: &'a EvidenceMessage,
    /// The number of random plans, and the median of their `rho0_mm` where there is one.
    pub random: (u64, Option<f64>),
    /// How often the plan of that median is to be repeated for the accuracy of the designed one.
    pub random_repeats: Option<RepeatsNeeded>,
    /// What must be looked at.
    pub conditions: &'a [Condition],
}
