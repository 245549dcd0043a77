//! From a plan to the laboratory: in which order its experiments are measured, over which ways the robot
//! goes there, how long that takes, and the program that it runs.
//!
//! - [`Laboratory`]: what work in the laboratory costs, and how the robot is to move.
//! - [`PathJudge`], [`Ways`]: whether straight joint moves keep clear, and ways over safe poses where not.
//! - [`Campaign`]: the stops in their order, with the minutes that they take.
//! - [`time`]: plans by the minutes that they take.
//! - [`next`]: what to measure next, after some of a plan is measured.
//! - [`validation`]: whether a robot is as accurate as its identification predicts.
//! - [`Dialect`], [`Program`]: the robot's program; dialects are data.
//! - [`sheet`]: what a person does and writes down at each stop.
//! - [`program_to`]: back on the robot, a program that leads to compensated test poses.

mod campaign;
mod clearance;
mod dialect;
mod groups;
pub mod next;
mod order;
mod program;
mod settings;
pub mod sheet;
mod side;
pub mod time;
pub mod validation;
mod ways;

pub use campaign::{Campaign, CampaignError};
pub use clearance::PathJudge;
pub use dialect::{Dialect, DialectError};
pub use groups::{AtGauge, Stop};
pub use program::{
    Program, ProgramFile, ProgramStep, ProgramTarget, change_load, hang_or_apply, hung_kg, program,
    program_to, set_gauge, set_up, take_off,
};
pub use settings::{Costs, Laboratory};
pub use side::Side;
pub use ways::{Way, Ways};
