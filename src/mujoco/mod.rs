//! MJCF models in MuJoCo: loading, the position stage, contacts, rays and time steps.
//!
//! This is the only module that talks to `mujoco-rs`. [`Model`] is what a file says, immutable and
//! shared between threads; [`State`] is one thread's simulation of it.

mod balance;
mod changes;
mod foreign;
mod idle;
mod locked;
mod messages;
mod model;
mod mounted;
mod obstacle;
mod rehearsal;
mod scan;
mod sources;
mod state;
mod statics;
mod urdf;

pub use balance::GivingWay;
pub use changes::ModelChange;
pub use messages::print_warnings;
pub use model::{Geometry, Model, ModelError, Shape};
pub use mounted::{Additions, MountedPayload, MountedTool, frame};
pub use obstacle::Obstacle;
pub use rehearsal::{limit_process, rehearse_with};
pub use sources::sources;
pub use state::{Contact, State};
