//! Foreign tables: what other programs write of a robot's calibration, read through a mapping of its columns.

mod columns;
mod import;
mod mapping;
mod resolved;
mod rotation;
mod rows;
mod told;
mod units;

pub use import::{ImportedTable, import};
pub use told::ColumnRange;
