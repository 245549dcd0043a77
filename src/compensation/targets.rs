//! Files of absolute targets: where a tool must be.

use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::codes::ErrorCode;
use crate::csv::{Columns, Table};
use crate::experiment::LOAD;
use crate::files::FileError;
use crate::robot::Load;

/// The columns of a position.
const TARGET_POSITION: [&str; 3] = ["x_mm", "y_mm", "z_mm"];
/// Those of an orientation.
const TARGET_QUATERNION: [&str; 4] = ["qw", "qx", "qy", "qz"];
/// A quaternion's length may be so far from 1.
const NEARLY_ONE: f64 = 1e-3;

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
    let owned = |names: &[&str]| {
        names
            .iter()
            .map(|&name| name.to_owned())
            .collect::<Vec<_>>()
    };
    let columns = Columns {
        required: owned(&TARGET_POSITION),
        optional: owned(&[&TARGET_QUATERNION[..], &LOAD].concat()),
        ..Columns::default()
    };
    let table = Table::read_with(path, &columns)?;
    for group in [&TARGET_QUATERNION[..], &LOAD] {
        let has = |name: &&&str| table.has(&[**name]);
        let some = group.iter().find(has);
        let missing = group.iter().find(|name| !has(name));
        if let (Some(some), Some(missing)) = (some, missing) {
            return Err(table.wrong_header(format!("found {some:?} without {missing:?}")));
        }
    }
    let is_pose = table.has(&TARGET_QUATERNION);
    let has_load = table.has(&LOAD);
    table
        .rows()
        .map(|row| {
            let rotation = if is_pose {
                let [w, x, y, z] = TARGET_QUATERNION.map(|column| row.get(column));
                let quaternion = Quaternion::new(w, x, y, z);
                let norm = quaternion.norm();
                if (norm - 1.0).abs() > NEARLY_ONE {
                    let problem = format!(
                        "qw,qx,qy,qz: found a quaternion of length {norm:.6}; 1 is allowed"
                    );
                    return Err(row.wrong(problem));
                }
                Some(UnitQuaternion::from_quaternion(quaternion))
            } else {
                None
            };
            let load = if has_load {
                Load::from_wrench(LOAD.map(|column| row.get(column)))
            } else {
                Load::NONE
            };
            Ok(TargetRow {
                line: row.line(),
                position_m: row.vector(TARGET_POSITION) * 1e-3,
                rotation,
                load,
            })
        })
        .collect()
}
