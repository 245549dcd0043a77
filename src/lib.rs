//! elastocal
pub mod files;
pub mod measurement;
pub mod mujoco;
pub mod output;
pub mod plan;
pub mod robot;
pub mod scenario;
pub mod random;
pub mod testbed;
pub mod identification;
pub mod compensation;
pub mod calibration;
