//! elastocal
pub mod calibration;
pub mod compensation;
pub mod files;
pub mod identification;
pub mod least_squares;
pub mod measurement;
pub mod mujoco;
pub mod output;
pub mod plan;
pub mod random;
pub mod robot;
pub mod scenario;
pub mod study;
pub mod testbed;
pub mod units;
