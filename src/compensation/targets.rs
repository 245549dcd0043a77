//! Files of absolute targets: where a tool must be.

use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3};

use crate::codes::ErrorCode;
use crate::csv::{Columns, Row, Table, owned};
use crate::experiment::{LOAD, load};
use crate::files::FileError;
use crate::measurement::{POSITION, QUATERNION, rotation_of};
use crate::robot::Load;

/// A row of a file of targets, in the file's frame.
#[derive(Debug, Clone, PartialEq)]
pub struct TargetRow {
    /// The number of its line.
    pub line: usize,
    /// The tool's position (m).
    pub position_m: Vector3<f64>,
    /// The tool's axes, where they count.
    pub rotation: Option<UnitQuaternion<f64>>,
    /// The load at the tool, in the axes of the robot's base.
    pub load: Load,
}

/// Reads targets: `x_mm,y_mm,z_mm`, and `qw,qx,qy,qz` and `fx_n` to `tz_nm` where they are given.
///
/// # Errors
/// The file has other columns, or what is no number or no rotation.
pub fn read_targets(path: &Path) -> Result<Vec<TargetRow>, FileError> {
    targets_of(path).map_err(|wrong| wrong.or_code(ErrorCode::Targets))
}

fn targets_of(path: &Path) -> Result<Vec<TargetRow>, FileError> {
    let optional = [&QUATERNION[..], &LOAD].concat();
    let table = Table::read_with(path, &Columns::of(owned(&POSITION), &optional, &[]))?;
    let (is_pose, has_load) = (table.has_group(&QUATERNION)?, table.has_group(&LOAD)?);
    let target = |row: Row<'_>| {
        Ok(TargetRow {
            line: row.line(),
            position_m: row.vector(POSITION) * 1e-3,
            rotation: is_pose.then(|| rotation_of(&row)).transpose()?,
            load: if has_load { load(&row)? } else { Load::NONE },
        })
    };
    table.rows().map(target).collect()
}
