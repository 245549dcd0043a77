//! MJCF models in MuJoCo: loading, the position stage, contacts, rays and time steps.
//!
//! This is the only module that talks to `mujoco-rs`. [`Model`] is what a file says, immutable and
//! shared between threads; [`State`] is one thread's simulation of it.

mod balance;
mod beside;
mod changes;
mod error;
mod fixed;
mod geometry;
mod holding;
mod joints;
mod kept;
mod loading;
mod locked;
mod mesh;
mod messages;
mod model;
mod mounted;
mod numbers;
mod obstacle;
mod rehearsal;
mod servo;
mod sources;
mod state;
mod statics;
mod torque_law;
mod unsuited;
mod urdf;
mod variants;
mod written;

pub use balance::GivingWay;
pub use changes::ModelChange;
pub use geometry::{Geometry, Shape};
pub use mesh::{Mesh, ShadedMesh};
pub use messages::print_warnings;
pub use model::Model;
pub use mounted::{Additions, KEPT, MountedPayload, MountedTool, frame};
pub use obstacle::Obstacle;
pub use rehearsal::{limit_process, rehearse_with};
pub use sources::sources;
pub use state::{Contact, State};
pub use torque_law::TorqueLaw;
pub use written::{ModelCalibration, RIGID, WrittenModel};
