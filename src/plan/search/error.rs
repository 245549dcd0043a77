//! Why there is no plan.

use thiserror::Error;

use super::candidate_error::CandidateError;

/// Why there is no plan.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum SearchError {
    /// No sampled experiment is feasible.
    #[error("no experiment is feasible: of {samples} random ones, {}", rejections.join(", "))]
    EmptyRegion {
        /// How many were tried.
        samples: usize,
        /// How many each constraint rejected.
        rejections: Vec<String>,
    },
    /// The test pose depends on the compliances of these joints, which no feasible experiment shows.
    #[error(
        "no feasible experiment shows the compliance of {}: no load has a torque on it",
        .0.join(", ")
    )]
    NotExcited(Vec<String>),
    /// The test pose depends on the compliances of these joints, by which loads move the tool next to nothing.
    #[error(
        "no feasible experiment shows the compliance of {}: the deflection by it is less than a hundredth of the noise",
        .0.join(", ")
    )]
    Faint(Vec<String>),
    /// What is asked for depends on the compliances of these joints, of which feasible experiments show combinations only.
    #[error(
        "no feasible experiments separate the compliances of {}: they show in combinations only",
        .0.join(", ")
    )]
    Inseparable(Vec<String>),
    /// The test pose depends on these unknowns, not compliances alone, of which no feasible experiment shows more than
    /// combinations.
    #[error(
        "no feasible experiments determine {}: deflections do not show them, or in combinations only",
        .0.join(", ")
    )]
    Undetermined(Vec<String>),
    /// A criterion of Table 1 is about the compliances alone, and these are to be found, too.
    #[error(
        "the criterion is about compliances alone, and robot.parameters names {}, too: plan for the test pose",
        .0.join(", ")
    )]
    CompliancesAlone(Vec<String>),
    /// Plans over a region are not optimised by a criterion of this name, and no bound by it is searched.
    #[error(
        "plans are optimised and bounded by test_pose, a, d and o1: for {0}, choose from candidates (plan --candidates FILE)"
    )]
    NotOptimised(&'static str),
    /// No plan can be made of a list of candidates.
    #[error("{0}")]
    Candidates(CandidateError),
    /// So few experiments cannot determine the compliances.
    #[error("{experiments} experiments cannot determine {parameters} compliances in this region")]
    Singular {
        /// The number of different configurations.
        experiments: u32,
        /// The number of unknown compliances.
        parameters: usize,
    },
}
