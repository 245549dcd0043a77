//! Units that foreign tables may have, each as a factor to the SI unit of its kind.

use crate::text::nearest;

/// What is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UnitKind {
    /// In rad.
    Angle,
    /// In m.
    Length,
    /// In N; a mass stands for its weight.
    Force,
    /// In N m.
    Torque,
    /// In s.
    Time,
    /// In deg C.
    Temperature,
}

/// How a number becomes one of SI: times, over, and in thousandths where the files of this program have those. So what
/// is short in a table is short in the file that is written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnitFactor {
    times: f64,
    over: f64,
    thousandths: bool,
}

impl UnitFactor {
    /// That of a number without a unit.
    pub const ONE: Self = Self {
        times: 1.0,
        over: 1.0,
        thousandths: false,
    };

    /// The value in SI units.
    pub fn of(self, value: f64) -> f64 {
        let value = value * self.times / self.over;
        if self.thousandths {
            value * 1e-3
        } else {
            value
        }
    }
}

/// The weight of a kilogram (N): the standard acceleration of gravity.
const WEIGHT_N_PER_KG: f64 = 9.806_65;
const DEGREE_RAD: f64 = std::f64::consts::PI / 180.0;

impl UnitKind {
    const fn units(self) -> &'static [(&'static str, f64, f64)] {
        match self {
            Self::Angle => &[
                ("deg", DEGREE_RAD, 1.0),
                ("rad", 1.0, 1.0),
                ("mrad", 1e-3, 1.0),
                ("urad", 1.0, 1e6),
                ("arcmin", DEGREE_RAD, 60.0),
                ("arcsec", DEGREE_RAD, 3600.0),
                ("turn", std::f64::consts::TAU, 1.0),
            ],
            Self::Length => &[
                ("mm", 1.0, 1.0),
                ("m", 1e3, 1.0),
                ("um", 1.0, 1e3),
                ("cm", 10.0, 1.0),
                ("in", 25.4, 1.0),
            ],
            Self::Force => &[
                ("N", 1.0, 1.0),
                ("kN", 1e3, 1.0),
                ("daN", 10.0, 1.0),
                ("kg", WEIGHT_N_PER_KG, 1.0),
                ("lbf", 0.453_592_37 * WEIGHT_N_PER_KG, 1.0),
            ],
            Self::Torque => &[
                ("Nm", 1.0, 1.0),
                ("N m", 1.0, 1.0),
                ("Nmm", 1.0, 1e3),
                ("kNm", 1e3, 1.0),
            ],
            Self::Time => &[
                ("s", 1.0, 1.0),
                ("ms", 1.0, 1e3),
                ("min", 60.0, 1.0),
                ("h", 3600.0, 1.0),
            ],
            Self::Temperature => &[("C", 1.0, 1.0), ("K", 1.0, 1.0), ("F", 5.0, 9.0)],
        }
    }

    /// A unit by its name: the factor to the SI unit, and what is added then.
    ///
    /// # Errors
    /// There is none of that name, with the names that there are and the nearest of them.
    pub fn unit(self, name: &str) -> Result<(UnitFactor, f64), (String, Option<String>)> {
        let units = self.units();
        if let Some(&(_, times, over)) = units.iter().find(|unit| unit.0 == name.trim()) {
            let offset = match (self, name.trim()) {
                (Self::Temperature, "K") => -273.15,
                (Self::Temperature, "F") => -32.0 * 5.0 / 9.0,
                _ => 0.0,
            };
            let factor = UnitFactor {
                times,
                over,
                thousandths: self == Self::Length,
            };
            return Ok((factor, offset));
        }
        let names: Vec<&str> = units.iter().map(|unit| unit.0).collect();
        let near = nearest(name, names.iter().copied());
        Err((
            format!("found {name:?}; one of {} is allowed", names.join(", ")),
            near.map(|near| format!("did you mean {near:?}?")),
        ))
    }
}
