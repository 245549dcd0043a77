//! The table `[instrument]`.

use toml::Table;

use super::Checker;
use super::certificate::NOISE;
use crate::files::FileError;
use crate::mujoco::Model;
use crate::scenario::file::{File, InstrumentReads};
use crate::task::Instrument;

impl Checker<'_> {
    pub(super) fn instrument(&self, file: &File, model: &Model) -> Result<Instrument, FileError> {
        let gauge = self.gauge(file)?;
        let table = &file.instrument;
        let given = Table::try_from(table).unwrap_or_default();
        self.certificate_is_used("instrument", &given, &NOISE)?;
        let [sigma, rotation] = &NOISE;
        let sigma_m = self
            .deviation("instrument", &given, sigma)?
            .ok_or_else(|| {
                let wrong = self.wrong("instrument.sigma_mm", "is missing");
                wrong.hint("give sigma_mm, or mpe_um as a certificate has it")
            })?;
        let key = "instrument.tracker_site";
        let site = |name: &str| (model.site(name)).map_err(|error| self.named_file(key, error));
        let tracker_site = table.tracker_site.as_deref().map(site).transpose()?;
        // Stations are seen from where they are.
        if file.region.line_of_sight && tracker_site.is_none() && file.station.is_empty() {
            return Err(self.wrong(key, "is missing, and region.line_of_sight needs it"));
        }
        let factor = table.sigma_of.deflection_factor();
        let rotation_sigma_rad = self.deviation("instrument", &given, rotation)?;
        let reads_distances = table.reads == InstrumentReads::Distance;
        let mut instrument = Instrument {
            sigma_m: sigma_m * factor,
            gauge: gauge.filter(|_| !reads_distances),
            distance: gauge.filter(|_| reads_distances),
            rotation_sigma_rad: rotation_sigma_rad.map(|each| each * factor),
            tracker_site,
            unloaded: table.unloaded,
            distribution: table.distribution.unwrap_or_default(),
        };
        instrument.sigma_m = instrument.sigma_m.hypot(instrument.rounding_m2().sqrt());
        Ok(instrument)
    }
}
