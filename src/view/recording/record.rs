//! What was planned, read and identified, as recordings show it.

use nalgebra::{Quaternion, UnitQuaternion};

use crate::record::recorded::ReadOnce;
use crate::record::run::{MeasuredMessage, RunMessage};

/// The groups of curves.
const DEFLECTION: &str = "deflection_mm";
const READING: &str = "reading_mm";

/// A vector of one reading as far as it is known.
#[derive(Debug, Clone, Copy)]
pub struct ShownVector {
    /// What it is, for a table.
    pub label: &'static str,
    /// The group of curves that shows it, if one does.
    pub group: Option<&'static str>,
    /// Its coordinates (mm; mrad of rotations),
    pub vector_mm: Option<[f64; 3]>,
    /// and what a gauge or a ballbar reads of it (mm).
    pub along_mm: Option<f64>,
}

impl RunMessage {
    /// The group of curves of what was read, and its name.
    pub const fn curves(&self) -> [&'static str; 2] {
        match self.measured {
            MeasuredMessage::Deflections { .. } => [DEFLECTION, "deflections [mm]"],
            MeasuredMessage::Readings { .. } => [READING, "readings [mm]"],
        }
    }
}

/// What was read once: of deflections the truth without the instrument's errors, whole also where a gauge reads; what was read, and
/// what identification leaves of it; of poses the orientation, too.
pub fn shown(read: &ReadOnce<'_>) -> Vec<ShownVector> {
    let vector = |label, group, vector_mm, along_mm| ShownVector {
        label,
        group,
        vector_mm,
        along_mm,
    };
    let residual =
        |vector_mm, along_mm| vector("residual [mm]", Some("residual_mm"), vector_mm, along_mm);
    let mut all = match read {
        ReadOnce::Deflection(read) => {
            let (true_mm, along_mm) = (read.true_deflection_mm, read.true_displacement_mm);
            let read_mm = read.measurement.deflection_mm;
            vec![
                vector("true deflection [mm]", None, true_mm, along_mm),
                vector(
                    "measured [mm]",
                    Some(DEFLECTION),
                    read_mm,
                    read.displacement_mm,
                ),
                residual(read.residual_mm, read.displacement_residual_mm),
            ]
        }
        ReadOnce::Position(read) => {
            let length_mm = read.length.0.map(|length| length.length_m * 1e3);
            let turned = read.quaternion.map(|[w, i, j, k]| {
                let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
                (rotation.scaled_axis() * 1e3).into()
            });
            let left = read.rotation_residual_mrad;
            vec![
                vector("read [mm]", Some(READING), read.position_mm, length_mm),
                residual(read.residual_mm, read.length_residual_mm),
                vector("read, rotation [mrad]", None, turned, None),
                vector("rotation residual [mrad]", None, left, None),
            ]
        }
    };
    all.retain(|each| each.vector_mm.is_some() || each.along_mm.is_some());
    all
}
