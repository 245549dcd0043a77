//! The file of what was identified: its keys, and what another campaign knows by them.

mod before;
mod checks;
mod deflections;
mod file;
mod impossible;
mod readings;
mod robot;

pub use before::StoredIdentification;
pub use deflections::IdentificationMessage;
pub use file::{IdentificationBasis, IdentifiedFile, IdentifiedRecord};
pub use readings::{
    AbsoluteMessage, JointErrorMessage, MountedFrameMessage, ReadRange, UnexplainedMessage,
    UnknownMessage,
};
pub use robot::{ReadRanges, StoredRobot, UnknownValue};
