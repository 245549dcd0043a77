//! What was planned, read and identified, as recordings show it.

use crate::record::run::{MeasuredMessage, RunMessage};

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
            MeasuredMessage::Deflections { .. } => ["deflection_mm", "deflections [mm]"],
            MeasuredMessage::Readings { .. } => ["reading_mm", "readings [mm]"],
        }
    }

    /// What was read once: of deflections the truth without the instrument's errors, whole also where a gauge reads; what was read, and
    /// what identification leaves of it; of poses the orientation, too.
    pub fn shown(&self, index: usize) -> Vec<ShownVector> {
        let [group, _] = self.curves();
        let (label, read_mm, residuals_mm) = match &self.measured {
            MeasuredMessage::Deflections {
                measurements,
                identification,
                ..
            } => (
                "measured [mm]",
                (measurements.get(index)).and_then(|each| each.deflection_mm),
                &identification.residuals_mm,
            ),
            MeasuredMessage::Readings {
                measurements,
                identification,
            } => (
                "read [mm]",
                (measurements.get(index)).map(|each| (each.position_m * 1e3).into()),
                &identification.residuals_mm,
            ),
        };
        let true_mm = self.truth.deflections_mm.get(index).copied();
        let residual_mm = residuals_mm.get(index).copied();
        let mut vectors = vec![
            ("true deflection [mm]", None, true_mm),
            (label, Some(group), read_mm),
            ("residual [mm]", Some("residual_mm"), residual_mm),
        ];
        if let MeasuredMessage::Readings {
            measurements,
            identification,
        } = &self.measured
        {
            let read = measurements.get(index).and_then(|each| each.rotation);
            let read_mrad = read.map(|turned| (turned.scaled_axis() * 1e3).into());
            let residual_mrad = identification.rotation_residual_mrad(index);
            vectors.push(("read, rotation [mrad]", None, read_mrad));
            vectors.push(("rotation residual [mrad]", None, residual_mrad));
        }
        let shown = |(label, group, whole_mm): (_, Option<_>, _)| {
            let (vector_mm, along_mm) = self.as_read(index, whole_mm)?;
            Some(ShownVector {
                label,
                group,
                vector_mm: if group.is_some() { vector_mm } else { whole_mm },
                along_mm,
            })
        };
        vectors.into_iter().filter_map(shown).collect()
    }
}
