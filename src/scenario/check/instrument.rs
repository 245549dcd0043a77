//! The table `[instrument]`.

use super::Checker;
use crate::files::FileError;
use crate::mujoco::Model;
use crate::parameter::SourceLevel;
use crate::quantities::plausible::{DEVIATION, ROTATION_DEVIATION};
use crate::scenario::file::File;
use crate::task::Instrument;

/// What it may be given the standard deviation of.
const SIZES: &[&str] = &["sigma_mm", "rotation_sigma_mrad"];

impl Checker<'_> {
    pub(super) fn instrument(&self, file: &File, model: &Model) -> Result<Instrument, FileError> {
        let mut table = file.instrument.clone();
        let certificate = table.certificate();
        let source = "the instrument's noise";
        let of = (source, SIZES);
        self.convert_permissible("instrument", of, &certificate, table.permissible())?;
        self.check_level("instrument", source, &certificate, SourceLevel::Reading)?;
        let sigma_mm = table.sigma_mm.ok_or_else(|| {
            let wrong = self.wrong("instrument.sigma_mm", "is missing");
            wrong.hint("give sigma_mm, or mpe_um as a certificate has it")
        })?;
        let sigma_m = self.number("instrument.sigma_mm", sigma_mm, &DEVIATION)? * 1e-3;
        let rotation = "instrument.rotation_sigma_mrad";
        let key = "instrument.tracker_site";
        let site = |name: &str| (model.site(name)).map_err(|error| self.named_file(key, error));
        let tracker_site = table.tracker_site.as_deref().map(site).transpose()?;
        // Stations are seen from where they are.
        if file.region.line_of_sight && tracker_site.is_none() && file.station.is_empty() {
            return Err(self.wrong(key, "is missing, and region.line_of_sight needs it"));
        }
        Ok(Instrument {
            sigma_m: sigma_m * table.sigma_of.deflection_factor(),
            rotation_sigma_rad: self
                .optional(rotation, table.rotation_sigma_mrad, &ROTATION_DEVIATION)?
                .map(|mrad| mrad * 1e-3),
            tracker_site,
            unloaded: table.unloaded,
            distribution: table.distribution.unwrap_or_default(),
        })
    }
}
