//! The table `[instrument]`: what reads, a tracker or a gauge of displacements or lengths, alone or beside a tracker.

use std::f64::consts::SQRT_2;

use nalgebra::Vector3;
use serde::Serialize;
use toml::Table;

use super::Checker;
use super::certificate::NOISE;
use crate::files::FileError;
use crate::mujoco::Model;
use crate::observation::LengthKind;
use crate::parameter::Unloaded;
use crate::quantities::limits::MOST_NAMED;
use crate::scenario::file::File;
use crate::scenario::instrument_file::{InstrumentReads, InstrumentTable};
use crate::task::{AccuracyKind, Gauge, Instrument};

impl Checker<'_> {
    pub(super) fn instrument(&self, file: &File, model: &Model) -> Result<Instrument, FileError> {
        let table = &file.instrument;
        let gauge = self.gauge(file)?;
        let (sigma_m, rotation_sigma_rad) = self.noise("instrument", table)?;
        let key = "instrument.tracker_site";
        let site = |name: &str| (model.site(name)).map_err(|error| self.named_file(key, error));
        let tracker_site = table.tracker_site.as_deref().map(site).transpose()?;
        // Stations are seen from where they are.
        if file.region.line_of_sight && tracker_site.is_none() && file.station.is_empty() {
            return Err(self.wrong(key, "is missing, and region.line_of_sight needs it"));
        }
        let factor = table.sigma_of.deflection_factor();
        let length = LengthKind::named(table.reads.into());
        let mut by_length = [None; LengthKind::ALL.len()];
        for (kind, shows) in LengthKind::ALL.into_iter().zip(&mut by_length) {
            let beside = self.length_beside(file, kind)?;
            *shows = beside.or(gauge.filter(|_| length == Some(kind)));
        }
        let is_absolute = file.design.accuracy == AccuracyKind::Absolute;
        if is_absolute && table.unloaded == Unloaded::Shared {
            let problem = "is \"shared\", and design.accuracy is \"absolute\": no reading is less an unloaded one";
            return Err(self
                .wrong("instrument.unloaded", problem)
                .hint("leave it out"));
        }
        let mut instrument = Instrument {
            sigma_m: sigma_m * factor,
            gauge: gauge.filter(|_| length.is_none()),
            by_length,
            rotation_sigma_rad: rotation_sigma_rad.map(|each| each * factor),
            tracker_site,
            unloaded: table.unloaded,
            distribution: table.distribution.unwrap_or_default(),
        };
        instrument.sigma_m = instrument.sigma_m.hypot(instrument.rounding_m2().sqrt());
        Ok(instrument)
    }

    /// A gauge, where one reads.
    fn gauge(&self, file: &File) -> Result<Option<Gauge>, FileError> {
        use InstrumentReads::{Deflection, Displacement};
        let table = &file.instrument;
        let given = Table::try_from(table).unwrap_or_default();
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
            let (sigma_m, _) = self.noise(key, beside)?;
            let sigma_m = sigma_m * table.sigma_of.deflection_factor();
            gauge.beside_m = Some(sigma_m.hypot(gauge.rounding_m2().sqrt()));
        }
        Ok(Some(gauge))
    }

    /// What a gauge shows, by its table's range and resolution (mm).
    fn shows(
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

    /// What reads lengths of a kind beside a tracker.
    fn length_beside(&self, file: &File, kind: LengthKind) -> Result<Option<Gauge>, FileError> {
        let Some(table) = file.instrument.length(kind) else {
            return Ok(None);
        };
        let key = &format!("instrument.{}", kind.name());
        let (sigma_m, _) = self.noise(key, table)?;
        let mut shows = self.shows(key, None, table.resolution_mm)?;
        // As of two readings.
        shows.beside_m = Some(SQRT_2 * sigma_m.hypot(shows.rounding_m2().sqrt()));
        Ok(Some(shows))
    }

    /// The standard deviation of an instrument's noise (m), and that of rotations (rad) where it is given, as its table has them or a
    /// certificate.
    fn noise(&self, key: &str, table: &impl Serialize) -> Result<(f64, Option<f64>), FileError> {
        let given = Table::try_from(table).unwrap_or_default();
        let deviations = self.deviations(key, &given, &NOISE)?;
        let sigma_m = deviations.get("sigma_mm").copied().ok_or_else(|| {
            let wrong = self.wrong(&format!("{key}.sigma_mm"), "is missing");
            wrong.hint("give sigma_mm, or mpe_um as a certificate has it")
        })?;
        Ok((sigma_m, deviations.get("rotation_sigma_mrad").copied()))
    }
}
