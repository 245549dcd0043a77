//! The keys of `[instrument]` that a gauge has, and what there is not where one reads.

use nalgebra::Vector3;

use super::Checker;
use crate::files::FileError;
use crate::parameter::Unloaded;
use crate::quantities::limits::MOST_NAMED;
use crate::quantities::plausible::SIZE;
use crate::scenario::file::{File, InstrumentReads, InstrumentTable, UncertaintyKind};
use crate::task::{AccuracyKind, Gauge};

impl Checker<'_> {
    /// A gauge, where one reads.
    pub(super) fn gauge(&self, file: &File) -> Result<Option<Gauge>, FileError> {
        let table = &file.instrument;
        let own = [
            ("directions", table.directions.is_some()),
            ("range_mm", table.range_mm.is_some()),
            ("resolution_mm", table.resolution_mm.is_some()),
        ];
        let others = [
            ("tracker_site", table.tracker_site.is_some()),
            ("rotation_sigma_mrad", table.rotation_sigma_mrad.is_some()),
            ("rotation_mpe_mrad", table.rotation_mpe_mrad.is_some()),
            ("unloaded", table.unloaded == Unloaded::Shared),
        ];
        let (reads, refused) = match table.reads {
            InstrumentReads::Deflection => ("deflection", &own[..]),
            InstrumentReads::Displacement => ("displacement", &others[..]),
        };
        if let Some((key, _)) = refused.iter().find(|(_, is_given)| *is_given) {
            let problem = format!("is given, and instrument.reads is {reads:?}");
            let wrong = self.wrong(&format!("instrument.{key}"), problem);
            return Err(wrong.hint("leave it out: one gauge alone has directions, range and resolution, a tracker all else"));
        }
        if table.reads == InstrumentReads::Deflection {
            return Ok(None);
        }
        let of_tracker = [
            (
                "design.accuracy",
                file.design.accuracy == AccuracyKind::Absolute,
            ),
            ("region.line_of_sight", file.region.line_of_sight),
        ];
        if let Some((key, _)) = of_tracker.iter().find(|(_, is_given)| *is_given) {
            let problem =
                "is of an instrument that sees positions, and instrument.reads is \"displacement\"";
            return Err(self.wrong(key, problem));
        }
        let size = |name: &str, value| {
            let size = self.optional(&format!("instrument.{name}"), value, &SIZE)?;
            Ok::<_, FileError>(size.map(|mm| mm * 1e-3))
        };
        Ok(Some(Gauge {
            range_m: size("range_mm", table.range_mm)?,
            resolution_m: size("resolution_mm", table.resolution_mm)?.unwrap_or(0.0),
        }))
    }

    /// Along which directions a gauge may read; one that is none where all three coordinates are read.
    pub(super) fn directions(
        &self,
        table: &InstrumentTable,
    ) -> Result<Vec<Option<Vector3<f64>>>, FileError> {
        if table.reads == InstrumentReads::Deflection {
            return Ok(vec![None]);
        }
        let key = "instrument.directions";
        let given = table.directions.as_deref().unwrap_or_default();
        if given.is_empty() {
            let wrong = self.wrong(key, "is missing: what a gauge may read along");
            let hint = "give directions in the world frame, as [[1, 0, 0], [0, 1, 0], [0, 0, 1]]";
            return Err(wrong.hint(hint));
        }
        self.at_most(key, given.len(), MOST_NAMED)?;
        let direction =
            |(index, each): (usize, &Vec<f64>)| self.unit(&format!("{key}[{index}]"), each);
        let directions = given.iter().enumerate().map(direction);
        directions.map(|each| each.map(Some)).collect()
    }
}

/// Why an uncertainty of a kind is not of what reads, a gauge or not; nothing where it is.
pub(super) fn other_instrument(kind: UncertaintyKind, is_gauge: bool) -> Option<&'static str> {
    use UncertaintyKind as Kind;
    match kind {
        Kind::GaugeDirection if !is_gauge => {
            Some("is of a gauge, and instrument.reads is not \"displacement\"")
        }
        Kind::TrackerRange | Kind::BaseRotation if is_gauge => {
            Some("is of an instrument with a frame, and instrument.reads is \"displacement\"")
        }
        Kind::Discrepancy | Kind::TransmissionError if is_gauge => Some(
            "is shared by all deflections of a configuration, which displacements along a direction are not planned with",
        ),
        _ => None,
    }
}
