//! The table `[instrument]`.

use std::f64::consts::SQRT_2;

use toml::Table;

use super::Checker;
use super::certificate::{NOISE, Size};
use crate::files::FileError;
use crate::mujoco::Model;
use crate::observation::LengthKind;
use crate::parameter::Unloaded;
use crate::scenario::file::File;
use crate::task::{AccuracyKind, Gauge, Instrument};

impl Checker<'_> {
    pub(super) fn instrument(&self, file: &File, model: &Model) -> Result<Instrument, FileError> {
        let table = &file.instrument;
        let given = Table::try_from(table).unwrap_or_default();
        let gauge = self.gauge(file, &given)?;
        let sigma_m = self.sigma_m("instrument", &given, &NOISE)?;
        let key = "instrument.tracker_site";
        let site = |name: &str| (model.site(name)).map_err(|error| self.named_file(key, error));
        let tracker_site = table.tracker_site.as_deref().map(site).transpose()?;
        // Stations are seen from where they are.
        if file.region.line_of_sight && tracker_site.is_none() && file.station.is_empty() {
            return Err(self.wrong(key, "is missing, and region.line_of_sight needs it"));
        }
        let factor = table.sigma_of.deflection_factor();
        let rotation_sigma_rad = self.deviation("instrument", &given, &NOISE[1])?;
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

    /// What reads lengths of a kind beside a tracker.
    fn length_beside(&self, file: &File, kind: LengthKind) -> Result<Option<Gauge>, FileError> {
        let Some(table) = file.instrument.length(kind) else {
            return Ok(None);
        };
        let key = &format!("instrument.{}", kind.name());
        let given = Table::try_from(table).unwrap_or_default();
        let sigma_m = self.sigma_m(key, &given, &NOISE[..1])?;
        let mut shows = self.shows(key, None, table.resolution_mm)?;
        // As of two readings.
        shows.beside_m = Some(SQRT_2 * sigma_m.hypot(shows.rounding_m2().sqrt()));
        Ok(Some(shows))
    }

    /// The standard deviation of an instrument's noise (m) that its table gives, by itself or as a certificate has it; of which that may
    /// have these.
    pub(super) fn sigma_m(
        &self,
        key: &str,
        given: &Table,
        sizes: &[Size],
    ) -> Result<f64, FileError> {
        self.certificate_is_used(key, given, sizes)?;
        self.deviation(key, given, &NOISE[0])?.ok_or_else(|| {
            let wrong = self.wrong(&format!("{key}.sigma_mm"), "is missing");
            wrong.hint("give sigma_mm, or mpe_um as a certificate has it")
        })
    }
}
