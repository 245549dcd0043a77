//! What people look at: recordings, pages and pictures of records; computes nothing.
//!
//! - [`recording`]: the robot in every experiment and test pose, for both recordings.
//! - [`study_recording`]: a study as its recordings show it.
//! - [`rerun_file`], [`mcap_file`]: the recordings.
//! - [`stills`]: a sheet of pictures of the robot in each configuration of a plan.
//! - [`run_sheet`]: the sheet to take along into the laboratory.
//! - [`plots`]: plots that are files of their own, made of `charts`, as the figures of pages are.
//! - [`report`]: pages to look at, on [`markup`].
//! - [`tables`]: what pages, terminals and texts of recordings list.

mod charts;
pub mod markup;
pub mod mcap_file;
pub mod plots;
pub mod recording;
pub mod report;
pub mod rerun_file;
pub mod run_sheet;
pub mod stills;
pub mod study_recording;
pub mod tables;
