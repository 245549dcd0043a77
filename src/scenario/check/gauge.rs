//! The keys of `[instrument]` that a gauge has, for displacements or lengths, alone or beside a tracker, and what there is not where
//! one reads.

use nalgebra::Vector3;
use toml::Table;

use super::Checker;
use super::certificate::NOISE;
use crate::files::FileError;
use crate::observation::LengthKind;
use crate::parameter::Unloaded;
use crate::quantities::limits::MOST_NAMED;
use crate::robot::ReadsAlong;
use crate::scenario::file::{File, UncertaintyKind, UncertaintyTable};
use crate::scenario::instrument_file::{InstrumentReads, InstrumentTable};
use crate::task::{AccuracyKind, Gauge, Instrument};

impl Checker<'_> {
    /// A gauge, where one reads; of the table's keys these are given.
    pub(super) fn gauge(&self, file: &File, given: &Table) -> Result<Option<Gauge>, FileError> {
        use InstrumentReads::{Deflection, Displacement};
        let table = &file.instrument;
        let reads = table.reads;
        let is_displacement = reads == Displacement;
        let word: &str = reads.into();
        let length = LengthKind::named(word);
        let keys = [
            ("directions", is_displacement),
            ("range_mm", is_displacement),
            ("resolution_mm", is_displacement || length.is_some()),
        ];
        let of_trackers = [
            "tracker_site",
            "rotation_sigma_mrad",
            "rotation_mpe_mrad",
            "unloaded",
            "gauge",
        ];
        let of_trackers = (of_trackers.into_iter()).chain(LengthKind::ALL.map(LengthKind::name));
        let mut keys = keys
            .into_iter()
            .chain(of_trackers.map(|key| (key, reads == Deflection)));
        let is_usual = |key: &str| key == "unloaded" && table.unloaded == Unloaded::Own;
        let is_refused =
            |(key, is_its): &(&str, bool)| given.contains_key(*key) && !is_usual(key) && !is_its;
        if let Some((key, _)) = keys.find(is_refused) {
            let problem = format!("is given, and instrument.reads is {word:?}");
            let wrong = self.wrong(&format!("instrument.{key}"), problem);
            return Err(wrong.hint(
                "leave it out: a gauge alone has directions, range and resolution, lengths have a resolution and the range of \
                 their [[station]], a tracker all else",
            ));
        }
        self.check_others(file)?;
        if LengthKind::named(table.sigma_of.into()) != length {
            let problem = format!("does not go with instrument.reads = {word:?}");
            let wrong = self.wrong("instrument.sigma_of", problem);
            return Err(wrong.hint(
                "of lengths it is what instrument.reads is, \"deflection\" and \"position\" are of all else",
            ));
        }
        let (key, range_mm, resolution_mm) = match &table.gauge {
            None if reads == Deflection => return Ok(None),
            None => ("instrument", table.range_mm, table.resolution_mm),
            Some(gauge) => ("instrument.gauge", gauge.range_mm, gauge.resolution_mm),
        };
        let mut gauge = self.shows(key, range_mm, resolution_mm)?;
        if let Some(beside) = &table.gauge {
            let given = Table::try_from(beside).unwrap_or_default();
            let sigma_m = self.sigma_m(key, &given, &NOISE[..1])?;
            let sigma_m = sigma_m * table.sigma_of.deflection_factor();
            gauge.beside_m = Some(sigma_m.hypot(gauge.rounding_m2().sqrt()));
        }
        Ok(Some(gauge))
    }

    /// What a gauge shows, by its table's range and resolution (mm).
    pub(super) fn shows(
        &self,
        key: &str,
        range_mm: Option<f64>,
        resolution_mm: Option<f64>,
    ) -> Result<Gauge, FileError> {
        if let (Some(range_mm), Some(step_mm)) = (range_mm, resolution_mm)
            && step_mm > range_mm
        {
            let problem = format!(
                "found {step_mm}, and {key}.range_mm is {range_mm}: it would show nothing but zero"
            );
            let wrong = self.wrong(&format!("{key}.resolution_mm"), problem);
            return Err(
                wrong.hint("the step is that of the last digit, the range how far the gauge goes")
            );
        }
        Ok(Gauge {
            beside_m: None,
            range_m: range_mm.map(|mm| mm * 1e-3),
            resolution_m: resolution_mm.unwrap_or(0.0) * 1e-3,
            drift_share: 1.0,
        })
    }

    /// Refuses what there is not where a gauge reads, and what lengths need and have not.
    fn check_others(&self, file: &File) -> Result<(), FileError> {
        let table = &file.instrument;
        let reads = table.reads;
        let is_absolute = file.design.accuracy == AccuracyKind::Absolute;
        let rotates = table
            .rotation_sigma_mrad
            .or(table.rotation_mpe_mrad)
            .is_some();
        let is_displacement = reads == InstrumentReads::Displacement;
        let gauge = is_displacement || table.gauge.is_some();
        let beside = |kind: &LengthKind| table.length(*kind).is_some();
        let beside = LengthKind::ALL.into_iter().find(beside);
        let word: &str = reads.into();
        let length = LengthKind::named(word).or(beside);
        let from = length.map_or_else(String::new, |kind| {
            format!("is missing: where {}s are read from", kind.name())
        });
        let positions = "is of an instrument that sees positions alone";
        let hidden = file.region.line_of_sight && is_displacement;
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
                length.is_some() && !is_absolute,
                "is not \"absolute\"",
            ),
            (
                "station",
                length.is_some() && file.station.is_empty(),
                &from,
            ),
        ];
        if let Some((key, _, problem)) = refused.into_iter().find(|(_, is_wrong, _)| *is_wrong) {
            let beside = match (&table.gauge, beside) {
                (_, Some(kind)) => format!(" with instrument.{}", kind.name()),
                (Some(_), _) => " with a gauge".to_owned(),
                _ => String::new(),
            };
            let problem = format!("{problem}, and instrument.reads is {word:?}{beside}");
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
    instrument: &Instrument,
) -> Option<&'static str> {
    use ReadsAlong::{Always, Never};
    use UncertaintyKind as Kind;
    let reads_along = instrument.reads_along();
    let length = instrument.length_alone();
    match table.kind {
        Kind::GaugeDirection if reads_along == Never => {
            Some("is of a gauge, and instrument.reads is not \"displacement\"")
        }
        Kind::TrackerRange if reads_along == Always => {
            Some("is of an instrument with a frame, and instrument.reads is \"displacement\"")
        }
        Kind::TrackerRange if length.is_some_and(|kind| !kind.is_sighted()) => Some(
            "is of an instrument that reads along a line of sight, and instrument.reads is none",
        ),
        Kind::BaseRotation if reads_along != Never => Some(
            "is of an instrument with a frame, and a gauge reads, alone or beside one, along the directions of the world",
        ),
        Kind::BaseRotation if instrument.lengths().next().is_some() => Some(
            "is of an instrument with a frame; of where lengths are read from, see station_rotation",
        ),
        Kind::StationPosition | Kind::StationRotation if instrument.lengths().next().is_none() => {
            Some("is of a place that lengths are read from, and the instrument reads none")
        }
        // Harmonics are the robot's own.
        Kind::TransmissionError if table.harmonics.is_some() => None,
        Kind::Discrepancy | Kind::TransmissionError if reads_along != Never => Some(
            "is shared by all deflections of a configuration, which displacements along a direction are not planned with",
        ),
        _ => None,
    }
}
