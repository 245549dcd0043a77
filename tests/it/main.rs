//! Tests from outside the library, in one binary.
//!
//! - `published`: numbers that the paper prints, with the tolerance that its printing supports.
//! - `judges`: the analytic model and MuJoCo judge each other.
//! - `known_optima`: arms of three joints, for which the best plan can be derived by hand.
//! - `search`: the search for plans and its certificate, on the KR-270.

mod judges;
mod known_optima;
mod published;
mod search;
mod support;
