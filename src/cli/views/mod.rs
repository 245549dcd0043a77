//! Recordings, pages and pictures: what the commands show of their results with the feature `view`, and
//! what they say without it.

#[cfg(feature = "view")]
mod study;
#[cfg(feature = "view")]
mod target;
#[cfg(feature = "view")]
mod with;
#[cfg(not(feature = "view"))]
mod without;

use elastocal::calibration::Calibration;
use elastocal::experiment::Candidate;
use elastocal::record::absolute_plan::AbsolutePlanMessage;
use elastocal::record::absolute_trials::AbsoluteTrialsMessage;
use elastocal::record::evidence::EvidenceMessage;
use elastocal::record::messages::ProvenanceMessage;
use elastocal::record::study::StudyPlanMessage;
use elastocal::record::tally_file::Header;
use elastocal::scenario::Scenario;
use elastocal::workflow::run::PlanRecords;

#[cfg(feature = "view")]
pub use with::*;
#[cfg(not(feature = "view"))]
pub use without::*;

/// The names of the targets of `--rerun`, for the help.
pub const TARGETS: &str = "spawn|connect[=URL]|save=FILE";

/// What is shown of a run.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(not(feature = "view"), expect(dead_code, reason = "nothing is shown"))]
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
    /// The named conditions that did not hold.
    pub conditions: &'a [String],
}

/// What is shown of a study under one set of conditions.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(not(feature = "view"), expect(dead_code, reason = "nothing is shown"))]
pub struct StudyShown<'a> {
    pub header: &'a Header,
    pub level: &'a str,
    pub plans: &'a [StudyPlanMessage],
    pub conditions: &'a [String],
}

/// What is shown of a plan of absolute readings.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(not(feature = "view"), expect(dead_code, reason = "nothing is shown"))]
pub struct AbsoluteShown<'a> {
    pub scenario: &'a Scenario,
    pub plan: &'a AbsolutePlanMessage,
    /// What is read, and how often.
    pub readings: &'a [(&'a Candidate, u32)],
    /// What virtual robots made of it, and the same as a study has it.
    pub trials: Option<(&'a AbsoluteTrialsMessage, &'a StudyPlanMessage)>,
    pub provenance: &'a ProvenanceMessage,
    /// The named conditions that did not hold.
    pub conditions: &'a [String],
}
