//! What leaves the program as files; computes nothing.
//!
//! - [`messages`]: the JSON records that `--json`, results.json and the MCAP file share.
//! - [`recording`]: the robot in every experiment and test pose, for both recordings.
//! - [`stills`]: a sheet of pictures of the robot in each configuration of a plan.
//! - [`plots`]: plots as SVG.
//! - [`study`]: the records of a Monte Carlo study.
//! - [`comparison`]: what changed between two results.
//! - [`study_recording`]: a study as its recordings show it.
//! - [`evidence`], [`reproduction`]: the records of what a plan is shown beside, and of the paper.
//! - [`report`]: pages to look at, on [`markup`].
//! - [`mesh`]: the model's shapes as triangles.
//! - [`rerun_file`], [`mcap_file`]: the recordings.

pub mod comparison;
pub mod evidence;
pub mod markup;
pub mod mcap_file;
pub mod mesh;
pub mod messages;
pub mod plots;
pub mod recording;
pub mod report;
pub mod reproduction;
pub mod rerun_file;
pub mod stills;
pub mod study;
pub mod study_recording;
