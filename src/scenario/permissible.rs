//! Which keys of a scenario take a maximum permissible error, and in place of which standard deviation.

use super::file::{InstrumentTable, UncertaintyKind, UncertaintyTable};
use crate::parameter::{ErrorDistribution, SourceLevel};

/// What a table says of its maximum permissible errors.
#[derive(Debug, Clone, Copy)]
pub(super) struct Certificate {
    pub distribution: Option<ErrorDistribution>,
    pub coverage_factor: Option<f64>,
    pub level: Option<SourceLevel>,
}

/// A maximum permissible error with its key, the standard deviation with its key in whose place it is given, and the error's unit
/// in that of the standard deviation.
pub(super) type Permissible<'a> = (
    (&'static str, Option<f64>),
    (&'static str, &'a mut Option<f64>),
    f64,
);

/// Micrometres where standard deviations are in millimetres.
const MICRO: f64 = 1e-3;

impl InstrumentTable {
    pub fn permissible(&mut self) -> [Permissible<'_>; 2] {
        let rotation = ("rotation_sigma_mrad", &mut self.rotation_sigma_mrad);
        let position = ("sigma_mm", &mut self.sigma_mm);
        [
            (("mpe_um", self.mpe_um), position, MICRO),
            (("rotation_mpe_mrad", self.rotation_mpe_mrad), rotation, 1.0),
        ]
    }

    pub const fn certificate(&self) -> Certificate {
        Certificate {
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
        let rotation = ("std_mrad", &mut self.std_mrad);
        let arcsec = ("std_arcsec", &mut self.std_arcsec);
        let across = ("std_um_per_m", &mut self.std_um_per_m);
        let along = ("along_um_per_m", &mut self.along_um_per_m);
        let per_hour = ("std_um_per_h", &mut self.std_um_per_h);
        [
            (("mpe_relative", self.mpe_relative), relative, 1.0),
            (("mpe_um", self.mpe_um), ("std_mm", &mut self.std_mm), MICRO),
            (("mpe_mrad", self.mpe_mrad), rotation, 1.0),
            (("mpe_arcsec", self.mpe_arcsec), arcsec, 1.0),
            (("mpe_n", self.mpe_n), ("std_n", &mut self.std_n), 1.0),
            (("mpe_um_per_m", self.mpe_um_per_m), across, both),
            (("mpe_along_um_per_m", self.mpe_along_um_per_m), along, both),
            (("mpe_um_per_h", self.mpe_um_per_h), per_hour, 1.0),
        ]
    }

    pub const fn certificate(&self) -> Certificate {
        Certificate {
            distribution: self.distribution,
            coverage_factor: self.coverage_factor,
            level: self.level,
        }
    }
}
