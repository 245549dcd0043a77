//! Tests from outside the library, in one binary.
//!
//! - `published`: numbers that the paper prints, with the tolerance that its printing supports.
//! - `judges`: the analytic model and MuJoCo judge each other.
//! - `recordings`: the rerun and MCAP files, read with their own tools.

mod judges;
mod published;
mod recordings;
mod support;
