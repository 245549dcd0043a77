//! What is kept of results: serde records with the unit of every number in its key.
//!
//! - [`messages`]: a calibration, what a plan promises, and where results come from; `--json`,
//!   results.json and the MCAP file share them.
//! - [`platform`]: what results may depend on beyond the program, the scenario and the seed.
//! - [`contradictions`]: two series of readings that cannot both be right.
//! - [`ladder`]: models with more and more parameters, compared.
//! - [`residuals`], [`patterns`]: what `identify` says of residuals and likely mistakes.
//! - [`selection`]: choices of readings, and what came of them.
//! - [`study`]: a Monte Carlo study.
//! - [`tally_file`]: tallies of parts of a study, to join or to go on from.
//! - [`understanding`]: a robot as it was understood.
//! - [`campaign`]: a plan as it is carried out in the laboratory.
//! - [`candidates`]: what a plan was chosen from; [`absolute_plan`]: a plan of absolute readings; [`absolute_trials`]: what
//!   was seen of one.
//! - [`evidence`]: what a plan is shown beside; [`exchanges`]: what exchanging one measurement of it can gain.

pub mod absolute;
pub mod absolute_plan;
pub mod absolute_trials;
pub mod account;
pub mod campaign;
pub mod candidates;
pub mod contradictions;
pub mod evidence;
pub mod exchanges;
mod header_check;
pub mod json;
pub mod ladder;
pub mod messages;
pub mod patterns;
pub mod platform;
pub mod residuals;
pub mod selection;
pub mod study;
pub mod tally_file;
pub mod understanding;
