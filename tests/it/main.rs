//! Tests from outside the library, in one binary.
//!
//! - `published`: numbers that the paper prints, with the tolerance that its printing supports.
//! - `judges`: the analytic model and MuJoCo judge each other.
//! - `bad_input`: wrong inputs, seen from outside the process.

mod bad_input;
mod judges;
mod published;
mod support;
