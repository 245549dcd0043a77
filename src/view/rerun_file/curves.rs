//! What was read as it stands in tables and curves: the readings, and what identification leaves of them.

use std::collections::BTreeSet;

use nalgebra::{Quaternion, UnitQuaternion};
use re_sdk::{RecordingStream, entity_path};
use re_sdk_types::archetypes::{Scalars, SeriesPoints};

use super::Logged;
use crate::record::run::ReadOnce;

/// The groups of curves.
pub(super) const DEFLECTION: &str = "deflection_mm";
pub(super) const READING: &str = "reading_mm";
pub(super) const RESIDUAL: &str = "residual_mm";

/// The coordinates, and what a gauge reads along its direction.
const AXES: [(&str, [u8; 3]); 4] = [
    ("x", [220, 60, 60]),
    ("y", [50, 160, 70]),
    ("z", [60, 110, 230]),
    ("along", [150, 90, 20]),
];

/// A vector of one reading as far as it is known.
#[derive(Debug, Clone, Copy)]
pub(super) struct ShownVector {
    /// What it is, for a table.
    pub(super) label: &'static str,
    /// The group of curves that shows it, if one does.
    pub(super) group: Option<&'static str>,
    /// Its coordinates (mm; mrad of rotations),
    pub(super) vector_mm: Option<[f64; 3]>,
    /// and what a gauge or a ballbar reads of it (mm).
    pub(super) along_mm: Option<f64>,
}

/// What was read once: of deflections the truth without the instrument's errors, whole also where a gauge reads; what was read, and
/// what identification leaves of it; of poses the orientation, too.
pub(super) fn shown(read: &ReadOnce<'_>) -> Vec<ShownVector> {
    let vector = |label, group, vector_mm, along_mm| ShownVector {
        label,
        group,
        vector_mm,
        along_mm,
    };
    let residual =
        |vector_mm, along_mm| vector("residual [mm]", Some(RESIDUAL), vector_mm, along_mm);
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

/// A vector of a reading (mm) along [`AXES`]; `styled` are the curves that have their colours.
pub(super) fn log_curves(
    stream: &RecordingStream,
    shown: &ShownVector,
    styled: &mut BTreeSet<(&'static str, &'static str)>,
) -> Logged {
    let Some(group) = shown.group else {
        return Ok(());
    };
    let values = shown.vector_mm.map_or([None; 3], |vector| vector.map(Some));
    let values = values.into_iter().chain([shown.along_mm]);
    for ((axis, colour), value) in AXES.into_iter().zip(values) {
        let Some(value) = value else { continue };
        let path = entity_path!["measurements", group, axis];
        if styled.insert((group, axis)) {
            let series = SeriesPoints::new()
                .with_colors([colour])
                .with_names([axis])
                .with_marker_sizes([4.0]);
            stream.log_static(path.clone(), &series)?;
        }
        stream.log(path, &Scalars::single(value))?;
    }
    Ok(())
}
