//! What is measured in foreign tables, with its units.

use crate::quantities::plausible::{self, Kind};

/// The weight of a kilogram (N): the standard acceleration of gravity.
const WEIGHT_N_PER_KG: f64 = 9.806_65;
const DEGREE_RAD: f64 = std::f64::consts::PI / 180.0;

/// Units: of what, their names, and their factors and divisors to the unit that comes first.
const UNITS: [(&str, &str, f64, f64); 16] = [
    ("angle", "rad", 1.0, 1.0),
    ("angle", "deg", DEGREE_RAD, 1.0),
    ("angle", "mrad", 1e-3, 1.0),
    ("angle", "arcsec", DEGREE_RAD, 3600.0),
    // In thousandths of what files have: what is short in a table is short in the file that is written.
    ("length", "mm", 1.0, 1.0),
    ("length", "m", 1e3, 1.0),
    ("length", "um", 1.0, 1e3),
    ("length", "in", 25.4, 1.0),
    ("force", "N", 1.0, 1.0),
    ("force", "kN", 1e3, 1.0),
    ("force", "kg", WEIGHT_N_PER_KG, 1.0),
    ("torque", "Nm", 1.0, 1.0),
    ("time", "s", 1.0, 1.0),
    ("time", "ms", 1.0, 1e3),
    ("temperature", "C", 1.0, 1.0),
    ("number", "", 1.0, 1.0),
];

/// What is measured, what makes its first unit SI, and what it can be, in so many times the SI unit.
#[derive(Debug, Clone, Copy)]
pub(super) struct ForeignQuantity(&'static str, f64, pub &'static Kind, pub f64);

impl ForeignQuantity {
    /// A value of a unit in SI units; none of no such unit.
    pub fn in_si(self, unit: &str) -> Option<impl Fn(f64) -> f64> {
        let is_it = |each: &&(&str, &str, f64, f64)| (each.0, each.1) == (self.0, unit.trim());
        let &(_, _, factor, over) = UNITS.iter().find(is_it)?;
        Some(move |value| value * factor / over * self.1)
    }

    /// The names of its units.
    pub fn units(self) -> String {
        let own = UNITS.iter().filter(|each| each.0 == self.0);
        own.map(|each| each.1).collect::<Vec<_>>().join(", ")
    }
}

pub(super) const ANGLE: ForeignQuantity =
    ForeignQuantity("angle", 1.0, &plausible::ANGLE, 1.0 / DEGREE_RAD);
pub(super) const LENGTH: ForeignQuantity =
    ForeignQuantity("length", 1e-3, &plausible::POSITION, 1e3);
pub(super) const DEVIATION: ForeignQuantity =
    ForeignQuantity("length", 1e-3, &plausible::DEVIATION, 1e3);
pub(super) const ROTATION_DEVIATION: ForeignQuantity =
    ForeignQuantity("angle", 1.0, &plausible::ROTATION_DEVIATION, 1e3);
pub(super) const FORCE: ForeignQuantity = ForeignQuantity("force", 1.0, &plausible::FORCE, 1.0);
pub(super) const TORQUE: ForeignQuantity = ForeignQuantity("torque", 1.0, &plausible::TORQUE, 1.0);
pub(super) const TIME: ForeignQuantity = ForeignQuantity("time", 1.0, &plausible::COUNT, 1.0);
pub(super) const TEMPERATURE: ForeignQuantity =
    ForeignQuantity("temperature", 1.0, &plausible::TEMPERATURE, 1.0);
/// What has no unit, as the numbers of quaternions.
pub(super) const PURE: ForeignQuantity = ForeignQuantity("number", 1.0, &plausible::COUNT, 1.0);
