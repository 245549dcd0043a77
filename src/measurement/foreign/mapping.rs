//! The file that says what the columns of a foreign table are.

use serde::Deserialize;

use super::rotation::Convention;
use crate::csv::Separator;
use crate::quantities::plausible::{self, Kind};

/// A mapping as it is written; see `docs/files.md`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Mapping {
    /// What separates the fields; what the header has if not given.
    #[serde(default)]
    pub delimiter: Separator,
    #[serde(default)]
    pub decimal: Decimal,
    /// The line of the columns' names, from 1; 0 where there is none, and columns are named by their numbers.
    pub header_line: Option<usize>,
    /// Lines that are none of the table's.
    #[serde(default)]
    pub skip_lines: Vec<usize>,
    /// The commanded joints in the order of the model.
    pub joint: Vec<JointMapping>,
    /// Where the target is, in the instrument's frame.
    pub position: Option<VectorMapping>,
    /// How it is turned there.
    pub rotation: Option<RotationMapping>,
    /// Loaded minus unloaded position, in the world frame, in place of position and rotation.
    pub deflection: Option<VectorMapping>,
    /// The load at the calibration tool, in the world frame.
    pub force: Option<VectorMapping>,
    pub torque: Option<VectorMapping>,
    /// The size of a weight there.
    pub weight: Option<ScalarMapping>,
    pub target: Option<Word>,
    pub station: Option<Word>,
    pub visit: Option<Word>,
    pub approach: Option<Word>,
    pub time: Option<ScalarMapping>,
    pub temperature: Option<ScalarMapping>,
}

/// The decimal sign.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
pub(super) enum Decimal {
    #[default]
    #[serde(rename = ".")]
    Point,
    #[serde(rename = ",")]
    Comma,
}

/// Where a number comes from.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub(super) enum NumberSource {
    Column(String),
    /// The same in every row.
    Value(f64),
}

/// Where a word comes from.
#[derive(Debug, Clone, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Word {
    Column(String),
    /// The same in every row.
    Value(String),
}

/// A joint: the model's angle is sign times the table's plus the offset.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct JointMapping {
    pub column: NumberSource,
    pub unit: String,
    #[serde(default = "one")]
    pub sign: f64,
    /// In the same unit.
    #[serde(default)]
    pub offset: f64,
}

const fn one() -> f64 {
    1.0
}

/// Three numbers, and their standard deviations.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct VectorMapping {
    pub columns: [NumberSource; 3],
    pub unit: String,
    pub std_columns: Option<[NumberSource; 3]>,
    /// That of the values if not given.
    pub std_unit: Option<String>,
}

/// A rotation: the target's axes in the instrument's frame.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RotationMapping {
    pub convention: Convention,
    pub columns: Vec<NumberSource>,
    /// Of angles.
    pub unit: Option<String>,
    pub std_columns: Option<[NumberSource; 3]>,
    /// That of the values if not given.
    pub std_unit: Option<String>,
}

/// One number.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ScalarMapping {
    pub column: NumberSource,
    pub unit: String,
}

/// A unit: its name, factor and divisor to the unit that comes first, and what is added then.
pub(super) type Unit = (&'static str, f64, f64, f64);

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
        ("rad", 1.0, 1.0, 0.0),
        ("deg", DEGREE_RAD, 1.0, 0.0),
        ("mrad", 1e-3, 1.0, 0.0),
        ("urad", 1.0, 1e6, 0.0),
        ("arcmin", DEGREE_RAD, 60.0, 0.0),
        ("arcsec", DEGREE_RAD, 3600.0, 0.0),
    ],
    si: 1.0,
    kind: &plausible::ANGLE,
    shown: 1.0 / DEGREE_RAD,
};
// In thousandths of what files have: what is short in a table is short in the file that is written.
pub(super) const LENGTH: ForeignQuantity = ForeignQuantity {
    units: &[
        ("mm", 1.0, 1.0, 0.0),
        ("m", 1e3, 1.0, 0.0),
        ("um", 1.0, 1e3, 0.0),
        ("cm", 10.0, 1.0, 0.0),
        ("in", 25.4, 1.0, 0.0),
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
/// What has no unit, as the numbers of quaternions and matrices.
pub(super) const PURE: ForeignQuantity = ForeignQuantity {
    units: &[("", 1.0, 1.0, 0.0)],
    si: 1.0,
    kind: &plausible::COUNT,
    shown: 1.0,
};
pub(super) const FORCE: ForeignQuantity = ForeignQuantity {
    units: &[
        ("N", 1.0, 1.0, 0.0),
        ("kN", 1e3, 1.0, 0.0),
        ("daN", 10.0, 1.0, 0.0),
        ("kg", WEIGHT_N_PER_KG, 1.0, 0.0),
        ("lbf", 0.453_592_37 * WEIGHT_N_PER_KG, 1.0, 0.0),
    ],
    kind: &plausible::FORCE,
    ..PURE
};
pub(super) const TORQUE: ForeignQuantity = ForeignQuantity {
    units: &[
        ("Nm", 1.0, 1.0, 0.0),
        ("Nmm", 1.0, 1e3, 0.0),
        ("kNm", 1e3, 1.0, 0.0),
    ],
    kind: &plausible::TORQUE,
    ..PURE
};
pub(super) const TIME: ForeignQuantity = ForeignQuantity {
    units: &[
        ("s", 1.0, 1.0, 0.0),
        ("ms", 1.0, 1e3, 0.0),
        ("min", 60.0, 1.0, 0.0),
        ("h", 3600.0, 1.0, 0.0),
    ],
    ..PURE
};
pub(super) const TEMPERATURE: ForeignQuantity = ForeignQuantity {
    units: &[("C", 1.0, 1.0, 0.0), ("K", 1.0, 1.0, -273.15)],
    kind: &plausible::TEMPERATURE,
    ..PURE
};
