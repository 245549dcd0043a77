//! What is kept of results: serde records with the unit of every number in its key.
//!
//! - [`run`]: a plan that was carried out once; [`messages`]: the parts of it, the predicted accuracy of a plan, and where results come
//!   from; `--json`, results.json and the MCAP file share them.
//! - [`model_selection`]: models with more and more parameters, compared.
//! - [`selection`]: choices of readings, and what came of them.
//! - [`study`]: a Monte Carlo study.
//! - [`tally_file`]: tallies of parts of a study, to join or to go on from.
//! - [`understanding`]: a robot as it was understood.
//! - [`campaign`]: a plan as it is carried out in the laboratory.
//! - [`absolute_plan`]: a plan of absolute readings; [`robot_trials`]: virtual robots on which one was tried.
//! - [`joint_error_table`]: what joints are off by.

pub mod absolute_plan;
pub mod campaign;
pub mod joint_error_table;
pub mod messages;
pub mod model_selection;
pub mod robot_trials;
pub mod run;
pub mod selection;
pub mod study;
pub mod tally_file;
pub mod uncertainties;
pub mod understanding;
