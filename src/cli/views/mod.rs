//! Recordings, pages and pictures: what the commands show of their results.

mod study;
mod target;
mod written;

pub use written::*;

/// The names of the targets of `--rerun`, for the help.
pub const TARGETS: &str = "connect[=URL]|save=FILE";
