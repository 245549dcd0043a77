//! Foreign tables: what other programs write of a robot's calibration, read through a mapping of its columns.

mod import;
mod mapping;
mod resolved;
mod rotation;
mod units;

pub use import::{ColumnRange, ImportedTable, import};
