//! Which keys of a scenario take a maximum permissible error, and in place of which standard deviation.

use super::certificate::CertifiedError;
use super::file::{InstrumentTable, UncertaintyKind, UncertaintyTable};

/// A maximum permissible error.
pub(super) struct Permissible<'a> {
    pub key: &'static str,
    /// In the key's unit.
    pub value: Option<f64>,
    /// The standard deviation that it stands in place of.
    pub standard_key: &'static str,
    pub standard: &'a mut Option<f64>,
    /// The error's unit in that of the standard deviation.
    pub unit: f64,
}

/// Micrometres where standard deviations are in millimetres.
const MICRO: f64 = 1e-3;

fn permissible<'a>(
    (key, value): (&'static str, Option<f64>),
    (standard_key, standard): (&'static str, &'a mut Option<f64>),
    unit: f64,
) -> Permissible<'a> {
    Permissible {
        key,
        value,
        standard_key,
        standard,
        unit,
    }
}

impl InstrumentTable {
    pub fn permissible(&mut self) -> [Permissible<'_>; 2] {
        let rotation = ("rotation_sigma_mrad", &mut self.rotation_sigma_mrad);
        [
            permissible(
                ("mpe_um", self.mpe_um),
                ("sigma_mm", &mut self.sigma_mm),
                MICRO,
            ),
            permissible(("rotation_mpe_mrad", self.rotation_mpe_mrad), rotation, 1.0),
        ]
    }

    pub const fn certificate(&self) -> CertifiedError {
        CertifiedError {
            distribution: self.distribution,
            coverage_factor: self.coverage_factor,
            level: self.level,
        }
    }
}

impl UncertaintyTable {
    pub fn permissible(&mut self) -> [Permissible<'_>; 8] {
        // An instrument's error is of one reading, and the standard deviation of a deflection, which two readings make.
        let both = match self.kind {
            UncertaintyKind::TrackerRange => 2.0_f64.sqrt(),
            _ => 1.0,
        };
        let relative = ("std_relative", &mut self.std_relative);
        let across = ("std_um_per_m", &mut self.std_um_per_m);
        let along = ("along_um_per_m", &mut self.along_um_per_m);
        let per_hour = ("std_um_per_h", &mut self.std_um_per_h);
        let arcsec = ("std_arcsec", &mut self.std_arcsec);
        [
            permissible(("mpe_relative", self.mpe_relative), relative, 1.0),
            permissible(("mpe_um", self.mpe_um), ("std_mm", &mut self.std_mm), MICRO),
            permissible(
                ("mpe_mrad", self.mpe_mrad),
                ("std_mrad", &mut self.std_mrad),
                1.0,
            ),
            permissible(("mpe_arcsec", self.mpe_arcsec), arcsec, 1.0),
            permissible(("mpe_n", self.mpe_n), ("std_n", &mut self.std_n), 1.0),
            permissible(("mpe_um_per_m", self.mpe_um_per_m), across, both),
            permissible(("mpe_along_um_per_m", self.mpe_along_um_per_m), along, both),
            permissible(("mpe_um_per_h", self.mpe_um_per_h), per_hour, 1.0),
        ]
    }

    pub const fn certificate(&self) -> CertifiedError {
        CertifiedError {
            distribution: self.distribution,
            coverage_factor: self.coverage_factor,
            level: self.level,
        }
    }
}
