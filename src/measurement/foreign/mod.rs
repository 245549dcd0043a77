//! Foreign tables: what other programs write of a robot's calibration, read through a mapping of its columns.

mod import;
mod mapping;
mod quantity;
mod reader;

pub use import::{ImportedTable, import};
