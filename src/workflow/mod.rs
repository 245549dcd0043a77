//! The use cases, as the command line has them: what is done in which order, without a word to anybody.
//!
//! - [`init`]: a first scenario for a model.
//! - [`design`]: a plan with its bound.
//! - [`evidence`]: what a designed plan is shown beside: rivals, other sizes, many runs.
//! - [`run`]: the designed plan beside others, through the whole loop.
//! - [`study`]: the plans of a study, and what its runs come to.
//! - [`identify`]: compliances or a robot from what was measured, with residuals and likely mistakes.
//! - [`calibrated`]: the robot as an identification left it.
//! - [`target_accuracy`]: how far its tools are from absolute targets.
//! - [`export`]: the calibrated robot as a model's file.
//! - [`validate_absolute`]: other readings beside it.

pub mod calibrated;
pub mod design;
pub mod evidence;
pub mod export;
pub mod identify;
pub mod init;
pub mod run;
pub mod study;
pub mod target_accuracy;
pub mod validate_absolute;
