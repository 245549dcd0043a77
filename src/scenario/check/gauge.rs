//! The keys of `[instrument]` that a gauge has, for displacements or distances, and what there is not where one reads.

use nalgebra::Vector3;

use super::Checker;
use crate::files::FileError;
use crate::parameter::Unloaded;
use crate::quantities::limits::MOST_NAMED;
use crate::quantities::plausible::SIZE;
use crate::scenario::file::{File, InstrumentReads, InstrumentTable, SigmaOf, UncertaintyKind};
use crate::task::{AccuracyKind, Gauge};

impl Checker<'_> {
    /// A gauge, where one reads.
    pub(super) fn gauge(&self, file: &File) -> Result<Option<Gauge>, FileError> {
        use InstrumentReads::{Deflection, Displacement, Distance};
        let table = &file.instrument;
        let reads = table.reads;
        let rotation =
            [table.rotation_sigma_mrad, table.rotation_mpe_mrad].map(|each| each.is_some());
        let keys = [
            (
                "directions",
                table.directions.is_some(),
                &[Displacement][..],
            ),
            ("range_mm", table.range_mm.is_some(), &[Displacement]),
            (
                "resolution_mm",
                table.resolution_mm.is_some(),
                &[Displacement, Distance],
            ),
            ("tracker_site", table.tracker_site.is_some(), &[Deflection]),
            ("rotation_sigma_mrad", rotation[0], &[Deflection]),
            ("rotation_mpe_mrad", rotation[1], &[Deflection]),
            (
                "unloaded",
                table.unloaded == Unloaded::Shared,
                &[Deflection],
            ),
        ];
        let is_refused = |(_, is_given, of): &&(_, bool, &[_])| *is_given && !of.contains(&reads);
        if let Some((key, ..)) = keys.iter().find(is_refused) {
            let problem = format!("is given, and instrument.reads is {:?}", reads.word());
            let wrong = self.wrong(&format!("instrument.{key}"), problem);
            return Err(wrong.hint(
                "leave it out: a gauge alone has directions, range and resolution, distances have a resolution and the range of \
                 their [[station]], a tracker all else",
            ));
        }
        let is_absolute = file.design.accuracy == AccuracyKind::Absolute;
        let wrong = match reads {
            Displacement => [
                ("design.accuracy", is_absolute),
                ("region.line_of_sight", file.region.line_of_sight),
            ]
            .into_iter()
            .find_map(|(key, is_given)| {
                is_given.then_some((key, "is of an instrument that sees positions"))
            }),
            Distance if !is_absolute => Some(("design.accuracy", "is not \"absolute\"")),
            Distance if file.station.is_empty() => {
                Some(("station", "is missing: where distances are read from"))
            }
            Deflection | Distance => None,
        };
        if let Some((key, problem)) = wrong {
            let problem = format!("{problem}, and instrument.reads is {:?}", reads.word());
            return Err(self.wrong(key, problem));
        }
        if (table.sigma_of == SigmaOf::Distance) != (reads == Distance) {
            let problem = format!("does not go with instrument.reads = {:?}", reads.word());
            let wrong = self.wrong("instrument.sigma_of", problem);
            return Err(wrong.hint(
                "\"distance\" is of distances, \"deflection\" and \"position\" are of all else",
            ));
        }
        if reads == Deflection {
            return Ok(None);
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
        if table.reads != InstrumentReads::Displacement {
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
