//! Tests from outside the library, in one binary.
//!
//! - `published`: numbers that the paper prints, with the tolerance that its printing supports.
//! - `judges`: the analytic model and MuJoCo judge each other.

mod judges;
mod published;
mod support;
