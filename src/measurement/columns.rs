//! The columns of measurement files, beside those that name configuration and load.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::csv::Row;
use crate::experiment::APPROACH;
use crate::files::FileError;
use crate::quantities::plausible::{Kind, shown};

pub const DEFLECTION: [&str; 3] = ["dx_mm", "dy_mm", "dz_mm"];
pub const DEFLECTION_SIGMA: [&str; 3] = ["sx_mm", "sy_mm", "sz_mm"];
/// The displacement along a direction, in place of a deflection, and its standard deviation, or that of a length.
pub const DISPLACEMENT: &str = "displacement_mm";
pub const DISPLACEMENT_SIGMA: &str = "s_mm";
pub const ROTATION: [&str; 3] = ["rx_mrad", "ry_mrad", "rz_mrad"];
pub const ROTATION_SIGMA: [&str; 3] = ["srx_mrad", "sry_mrad", "srz_mrad"];
/// Positions that the instrument shows, in place of their difference.
pub const UNLOADED: [&str; 3] = ["unloaded_x_mm", "unloaded_y_mm", "unloaded_z_mm"];
pub const LOADED: [&str; 3] = ["loaded_x_mm", "loaded_y_mm", "loaded_z_mm"];
pub const UNLOADED_SIGMA: [&str; 3] = ["unloaded_sx_mm", "unloaded_sy_mm", "unloaded_sz_mm"];
pub const LOADED_SIGMA: [&str; 3] = ["loaded_sx_mm", "loaded_sy_mm", "loaded_sz_mm"];
/// Which readings these are: the number of the stop, and that of the reading there.
pub const PLACES: [&str; 4] = [
    "unloaded_stop",
    "unloaded_reading",
    "loaded_stop",
    "loaded_reading",
];
/// A position in the frame of the instrument.
pub const POSITION: [&str; 3] = ["x_mm", "y_mm", "z_mm"];
/// The orientation of the target's axes there, as a unit quaternion.
pub const QUATERNION: [&str; 4] = ["qw", "qx", "qy", "qz"];
/// What else a file of absolute readings may have in words.
pub const WORDS: [&str; 4] = ["target", "visit", "station", APPROACH];
pub const TIME: &str = "time_s";
pub const TEMPERATURE: &str = "temperature_c";
/// A quaternion's length may be so far from 1: four decimals and a half.
const NEARLY_ONE: f64 = 1e-3;
/// The rows and columns of a reading's covariance: a position, then the rotation vector.
const COVARIANCE_AXES: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

/// The column of a covariance's element: `cxx_mm2`, `cxy_mm2`, `cxrx_mm_mrad`, `crxry_mrad2` and so on.
pub(super) fn covariance_column(row: usize, column: usize) -> String {
    let unit = match (row < 3, column < 3) {
        (true, true) => "mm2",
        (false, false) => "mrad2",
        _ => "mm_mrad",
    };
    let [one, other] = [row, column].map(|place| COVARIANCE_AXES[place]);
    format!("c{one}{other}_{unit}")
}

/// The places of the upper triangle of a matrix of so many rows, row by row.
pub(super) fn triangle(rows: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..rows).flat_map(move |row| (row..rows).map(move |column| (row, column)))
}

/// The columns of a covariance's upper triangle, row by row, of so many rows.
pub(super) fn covariance_columns(rows: usize) -> Vec<String> {
    let names = triangle(rows).map(|(row, column)| covariance_column(row, column));
    names.collect()
}

/// Three standard deviations, told in thousandths of their unit.
pub(super) fn deviations(
    row: &Row<'_>,
    columns: [&str; 3],
    kind: &Kind,
) -> Result<Vector3<f64>, FileError> {
    let sigma = row.vector(columns);
    if sigma.iter().all(|&value| kind.allows(value)) {
        Ok(sigma * 1e-3)
    } else {
        // A length has one for all three.
        let count = if columns[0] == columns[1] { 1 } else { 3 };
        let found: Vec<String> = sigma.iter().take(count).copied().map(shown).collect();
        let (columns, found) = (columns[..count].join(","), found.join(", "));
        let problem = format!("{columns}: found {found}; {}", kind.allowed());
        Err(row.wrong(problem))
    }
}

/// The rotation of a quaternion, whose real part comes first.
pub(super) fn unit_quaternion([w, x, y, z]: [f64; 4]) -> Result<UnitQuaternion<f64>, String> {
    let quaternion = Quaternion::new(w, x, y, z);
    let norm = quaternion.norm();
    if (norm - 1.0).abs() <= NEARLY_ONE {
        return Ok(UnitQuaternion::from_quaternion(quaternion));
    }
    let found = shown((norm * 1e6).round() / 1e6);
    Err(format!(
        "found a quaternion of length {found}; 1 is allowed, to {NEARLY_ONE}"
    ))
}

/// The rotation of a row with the columns of [`QUATERNION`].
///
/// # Errors
/// Its length is not 1.
pub fn rotation_of(row: &Row<'_>) -> Result<UnitQuaternion<f64>, FileError> {
    unit_quaternion(QUATERNION.map(|column| row.get(column))).map_err(|problem| {
        row.wrong(format!("{}: {problem}", QUATERNION.join(",")))
            .hint("give more decimals; the first of the four is the real part")
    })
}
