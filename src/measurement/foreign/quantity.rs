//! What is measured in foreign tables, with its units.

use crate::quantities::plausible::{self, Kind};

/// A unit: its name, and its factor and divisor to the unit that comes first.
pub(super) type Unit = (&'static str, f64, f64);

/// What is measured: its units, what makes the first one SI, and what it can be, in so many times the SI unit.
#[derive(Debug, Clone, Copy)]
pub(super) struct ForeignQuantity {
    pub units: &'static [Unit],
    pub si: f64,
    pub kind: &'static Kind,
    pub shown: f64,
}

/// The weight of a kilogram (N): the standard acceleration of gravity.
const WEIGHT_N_PER_KG: f64 = 9.806_65;
const DEGREE_RAD: f64 = std::f64::consts::PI / 180.0;

pub(super) const ANGLE: ForeignQuantity = ForeignQuantity {
    units: &[
        ("rad", 1.0, 1.0),
        ("deg", DEGREE_RAD, 1.0),
        ("mrad", 1e-3, 1.0),
        ("arcsec", DEGREE_RAD, 3600.0),
    ],
    si: 1.0,
    kind: &plausible::ANGLE,
    shown: 1.0 / DEGREE_RAD,
};
// In thousandths of what files have: what is short in a table is short in the file that is written.
pub(super) const LENGTH: ForeignQuantity = ForeignQuantity {
    units: &[
        ("mm", 1.0, 1.0),
        ("m", 1e3, 1.0),
        ("um", 1.0, 1e3),
        ("in", 25.4, 1.0),
    ],
    si: 1e-3,
    kind: &plausible::POSITION,
    shown: 1e3,
};
pub(super) const DEVIATION: ForeignQuantity = ForeignQuantity {
    kind: &plausible::DEVIATION,
    ..LENGTH
};
pub(super) const ROTATION_DEVIATION: ForeignQuantity = ForeignQuantity {
    kind: &plausible::ROTATION_DEVIATION,
    shown: 1e3,
    ..ANGLE
};
/// What has no unit, as the numbers of quaternions.
pub(super) const PURE: ForeignQuantity = ForeignQuantity {
    units: &[("", 1.0, 1.0)],
    si: 1.0,
    kind: &plausible::COUNT,
    shown: 1.0,
};
pub(super) const FORCE: ForeignQuantity = ForeignQuantity {
    units: &[
        ("N", 1.0, 1.0),
        ("kN", 1e3, 1.0),
        ("kg", WEIGHT_N_PER_KG, 1.0),
    ],
    kind: &plausible::FORCE,
    ..PURE
};
pub(super) const TORQUE: ForeignQuantity = ForeignQuantity {
    units: &[("Nm", 1.0, 1.0)],
    kind: &plausible::TORQUE,
    ..PURE
};
pub(super) const TIME: ForeignQuantity = ForeignQuantity {
    units: &[("s", 1.0, 1.0), ("ms", 1.0, 1e3)],
    ..PURE
};
pub(super) const TEMPERATURE: ForeignQuantity = ForeignQuantity {
    units: &[("C", 1.0, 1.0)],
    kind: &plausible::TEMPERATURE,
    ..PURE
};
