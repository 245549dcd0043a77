//! What random numbers are for: one registry, so that no two uses have the same numbers.
//!
//! [`Stream`] is for [`fill_normals`](super::normal::fill_normals); all others are streams of
//! [`generator`](super::generator).

/// What normal numbers are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stream {
    /// The noise of the measurements.
    Noise = 0,
    /// The virtual robot's compliances.
    Compliances = 1,
    /// What else is uncertain in a run's laboratory.
    Circumstances = 2,
}

/// Experiment `index` of a pool of random experiments; pools count from 1.
pub const fn pool(pool: u64, index: u64) -> u64 {
    (pool << 32) + index
}

/// Search number `index` for a plan.
pub const fn search(index: u64) -> u64 {
    (1 << 48) + index
}

/// Search number `index` for a plan of a list of candidates.
pub const fn candidate_search(index: u64) -> u64 {
    (1 << 49) + index
}

/// The instrument's frames of trial number `index` of a plan of absolute readings.
pub const fn frames_of_trial(index: u64) -> u64 {
    (1 << 59) + index
}

/// The joints' error functions of the virtual robot of run number `index`.
pub const fn joint_functions(index: u64) -> u64 {
    (1 << 56) + index
}

/// Candidates that are drawn for a plan of absolute readings, in round number `index`.
pub const fn drawn_candidates(index: u64) -> u64 {
    (1 << 58) + index
}

/// Random plan number `index` of absolute readings.
pub const fn random_readings(index: u64) -> u64 {
    (1 << 57) + index
}

/// Random choice number `index` among readings that there are.
pub const fn random_choice(index: u64) -> u64 {
    (1 << 60) + index
}

/// The errors of a robot without discrepancy, each time that it is read.
pub const fn campaign_of_choices(index: u64) -> u64 {
    (1 << 61) + index
}

/// Setups that tell which parameters could be identified.
pub const UNKNOWNS: u64 = 1 << 62;

/// The random plan of run `run`.
pub const fn random_plan(run: u64) -> u64 {
    (1 << 63) + run
}

/// Experiments that tell why no experiment is feasible.
pub const EMPTY_REGION: u64 = u64::MAX - 1;
/// The first experiments of an approximate design.
pub const FIRST_SUPPORT: u64 = u64::MAX;

/// The seed of random numbers that serve a decision, which shall not depend on the scenario's seed.
pub const FIXED_SEED: u64 = 0;
/// Under [`FIXED_SEED`]: variants of an experiment in joints that do not matter.
pub const VARIANTS: u64 = 0;
/// Under [`FIXED_SEED`]: configurations that tell which joints do not matter.
pub const INDIFFERENT_JOINTS: u64 = 1;
/// Under [`FIXED_SEED`]: configurations that tell what experiments show at all.
pub const SHOWN: u64 = 2;
/// Under [`FIXED_SEED`]: configurations that ways between experiments may lead over.
pub const SAFE_POSES: u64 = 3;
