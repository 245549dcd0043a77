//! The keys of `[instrument]` that a gauge has, for displacements or distances, alone or beside a tracker, and what there is not where
//! one reads.

use nalgebra::Vector3;
use toml::Table;

use super::Checker;
use crate::files::FileError;
use crate::parameter::Unloaded;
use crate::quantities::limits::MOST_NAMED;
use crate::quantities::plausible::{DEVIATION, RESOLUTION, SIZE};
use crate::robot::ReadsAlong;
use crate::scenario::file::{
    File, InstrumentReads, InstrumentTable, SigmaOf, UncertaintyKind, UncertaintyTable,
};
use crate::task::{AccuracyKind, Gauge};

impl Checker<'_> {
    /// A gauge, where one reads; of the table's keys these are given.
    pub(super) fn gauge(&self, file: &File, given: &Table) -> Result<Option<Gauge>, FileError> {
        use InstrumentReads::{Deflection, Displacement, Distance};
        let table = &file.instrument;
        let reads = table.reads;
        let keys: [(&str, &[InstrumentReads]); 9] = [
            ("directions", &[Displacement]),
            ("range_mm", &[Displacement]),
            ("resolution_mm", &[Displacement, Distance]),
            ("tracker_site", &[Deflection]),
            ("rotation_sigma_mrad", &[Deflection]),
            ("rotation_mpe_mrad", &[Deflection]),
            ("unloaded", &[Deflection]),
            ("gauge", &[Deflection]),
            ("distance", &[Deflection]),
        ];
        let is_usual = |key: &str| key == "unloaded" && table.unloaded == Unloaded::Own;
        let is_refused = |(key, of): &&(&str, &[InstrumentReads])| {
            given.contains_key(*key) && !is_usual(key) && !of.contains(&reads)
        };
        if let Some((key, _)) = keys.iter().find(is_refused) {
            let problem = format!("is given, and instrument.reads is {:?}", reads.word());
            let wrong = self.wrong(&format!("instrument.{key}"), problem);
            return Err(wrong.hint(
                "leave it out: a gauge alone has directions, range and resolution, distances have a resolution and the range of \
                 their [[station]], a tracker all else",
            ));
        }
        self.check_others(file)?;
        if (table.sigma_of == SigmaOf::Distance) != (reads == Distance) {
            let problem = format!("does not go with instrument.reads = {:?}", reads.word());
            let wrong = self.wrong("instrument.sigma_of", problem);
            return Err(wrong.hint(
                "\"distance\" is of distances, \"deflection\" and \"position\" are of all else",
            ));
        }
        let (key, range_mm, resolution_mm) = match &table.gauge {
            None if reads == Deflection => return Ok(None),
            None => ("instrument", table.range_mm, table.resolution_mm),
            Some(gauge) => ("instrument.gauge", gauge.range_mm, gauge.resolution_mm),
        };
        let size = |name: &str, value, kind| {
            let size = self.optional(&format!("{key}.{name}"), value, kind)?;
            Ok::<_, FileError>(size.map(|mm| mm * 1e-3))
        };
        let mut gauge = Gauge {
            beside_m: None,
            range_m: size("range_mm", range_mm, &SIZE)?,
            resolution_m: size("resolution_mm", resolution_mm, &RESOLUTION)?.unwrap_or(0.0),
            drift_share: 1.0,
        };
        if let Some(beside) = &table.gauge {
            let sigma_mm = self.number("instrument.gauge.sigma_mm", beside.sigma_mm, &DEVIATION)?;
            let sigma_m = 1e-3 * sigma_mm * table.sigma_of.deflection_factor();
            gauge.beside_m = Some(sigma_m.hypot(gauge.rounding_m2().sqrt()));
        }
        Ok(Some(gauge))
    }

    /// Refuses what there is not where a gauge reads, and what distances need and have not.
    fn check_others(&self, file: &File) -> Result<(), FileError> {
        use InstrumentReads::{Displacement, Distance};
        let table = &file.instrument;
        let reads = table.reads;
        let is_absolute = file.design.accuracy == AccuracyKind::Absolute;
        let rotates = table
            .rotation_sigma_mrad
            .or(table.rotation_mpe_mrad)
            .is_some();
        let [gauge, distances] = [
            reads == Displacement || table.gauge.is_some(),
            reads == Distance || table.distance.is_some(),
        ];
        let positions = "is of an instrument that sees positions alone";
        let hidden = file.region.line_of_sight && reads == Displacement;
        let shared = table.unloaded == Unloaded::Shared;
        let refused = [
            ("design.accuracy", gauge && is_absolute, positions),
            ("region.line_of_sight", hidden, positions),
            ("instrument.unloaded", gauge && shared, positions),
            (
                "instrument.rotation_sigma_mrad",
                gauge && rotates,
                positions,
            ),
            (
                "design.accuracy",
                distances && !is_absolute,
                "is not \"absolute\"",
            ),
            (
                "station",
                distances && file.station.is_empty(),
                "is missing: where distances are read from",
            ),
        ];
        if let Some((key, _, problem)) = refused.into_iter().find(|(_, is_wrong, _)| *is_wrong) {
            let beside = match (&table.gauge, &table.distance) {
                (_, Some(_)) => " with instrument.distance",
                (Some(_), _) => " with a gauge",
                _ => "",
            };
            let problem = format!(
                "{problem}, and instrument.reads is {:?}{beside}",
                reads.word()
            );
            return Err(self.wrong(key, problem));
        }
        Ok(())
    }

    /// Along which directions a gauge may read; one that is none where all three coordinates are read.
    pub(super) fn directions(
        &self,
        table: &InstrumentTable,
    ) -> Result<Vec<Option<Vector3<f64>>>, FileError> {
        let (key, given) = match &table.gauge {
            Some(gauge) => ("instrument.gauge.directions", Some(&gauge.directions)),
            None => ("instrument.directions", table.directions.as_ref()),
        };
        let is_gauge = table.gauge.is_some() || table.reads == InstrumentReads::Displacement;
        if !is_gauge {
            return Ok(vec![None]);
        }
        let given = given.map_or(&[][..], Vec::as_slice);
        if given.is_empty() {
            let wrong = self.wrong(key, "is missing: what a gauge may read along");
            let hint = "give directions in the world frame, as [[1, 0, 0], [0, 1, 0], [0, 0, 1]]";
            return Err(wrong.hint(hint));
        }
        let unit = |key: &str, each: &Vec<f64>| self.unit(key, each).map(Some);
        let mut directions = self.each(key, MOST_NAMED, given, unit)?;
        if table.gauge.is_some() {
            directions.insert(0, None);
        }
        Ok(directions)
    }
}

/// Why an uncertainty of a kind is not of what reads, a gauge or not; nothing where it is.
pub(super) fn other_instrument(
    table: &UncertaintyTable,
    reads_along: ReadsAlong,
) -> Option<&'static str> {
    use ReadsAlong::{Always, Never};
    use UncertaintyKind as Kind;
    match table.kind {
        Kind::GaugeDirection if reads_along == Never => {
            Some("is of a gauge, and instrument.reads is not \"displacement\"")
        }
        Kind::TrackerRange if reads_along == Always => {
            Some("is of an instrument with a frame, and instrument.reads is \"displacement\"")
        }
        Kind::BaseRotation if reads_along != Never => Some(
            "is of an instrument with a frame, and a gauge reads, alone or beside one, along the directions of the world",
        ),
        // Harmonics are the robot's own.
        Kind::TransmissionError if table.harmonics.is_some() => None,
        Kind::Discrepancy | Kind::TransmissionError if reads_along != Never => Some(
            "is shared by all deflections of a configuration, which displacements along a direction are not planned with",
        ),
        _ => None,
    }
}
