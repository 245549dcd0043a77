//! How large things may be: beyond what anybody needs, and within what memory and an afternoon hold.

/// The largest text that is read (bytes).
pub const LARGEST_TEXT: u64 = 256 << 20;
/// Runs of a study: its statistics are exact up to so many.
pub const MOST_TRIALS: u64 = 1_000_000_000_000;
/// Parts of a study.
pub const MOST_SHARDS: u64 = 1_000_000;
/// Combinations of a study's conditions.
pub const MOST_CONDITIONS: usize = 1000;
/// Plans of a study, under all conditions together.
pub const MOST_STUDIED: usize = 10_000;
/// Measurements of a plan that is designed or studied.
pub const MOST_EXPERIMENTS: u32 = 10_000;
/// Measurements that a plan file asks for, repeats counted, and that a file holds.
pub const MOST_MEASUREMENTS: u32 = 1_000_000;
/// Candidates that a plan is chosen from, each under each load.
pub const MOST_CANDIDATES: usize = 50_000;
/// Plans, and test poses, that a scenario names.
pub const MOST_NAMED: usize = 1000;
/// Obstacles beside the model: collisions are judged with each.
pub const MOST_OBSTACLES: usize = 500;
/// Joints of a robot.
pub const MOST_JOINTS: usize = 100;
/// Forbidden configurations and loads of a list.
pub const MOST_LISTED: usize = 10_000;
