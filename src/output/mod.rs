//! What leaves the program as files; computes nothing.
//!
//! - [`messages`]: the JSON records that `--json`, results.json and the MCAP file share.

pub mod messages;
