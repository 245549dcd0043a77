//! What numbers can be: for each kind of quantity the range that every reader takes, in the unit of
//! the files.
//!
//! The ranges are far wider than any robot, instrument or workshop needs. They keep out slips of a
//! unit by many orders of magnitude, and numbers whose squares, products or inverses are no numbers
//! any more, before these reach a factorisation.

use nalgebra::Vector6;

/// A kind of quantity with its range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kind {
    unit: &'static str,
    sign: Sign,
    /// The smallest size; zero is told by the sign.
    least: f64,
    /// The largest size.
    most: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sign {
    Any,
    ZeroOrPositive,
    Positive,
}

/// A component of a force (N).
pub const FORCE: Kind = Kind::any("N", 1e8);
/// A component of a torque (N m).
pub const TORQUE: Kind = Kind::any("N m", 1e8);
/// A component of a direction, whose length says nothing.
pub const DIRECTION: Kind = Kind::any("", 1e9);
/// The largest size of a force (N).
pub const FORCE_LIMIT: Kind = Kind::positive("N", LEAST_LOAD, 1e8);
/// The smallest size of a force (N).
pub const LEAST_FORCE: Kind = Kind::zero_or_positive("N", LEAST_LOAD, 1e8);
/// The largest size of a torque (N m).
pub const TORQUE_LIMIT: Kind = Kind::positive("N m", 1e-6, 1e12);
/// A coordinate, a height or a deflection (mm): up to a kilometre.
pub const POSITION: Kind = Kind::any("mm", 1e6);
/// A size of a body (mm).
pub const SIZE: Kind = Kind::positive("mm", 1e-3, 1e6);
/// The step of what a gauge shows (mm).
pub const RESOLUTION: Kind = Kind::positive("mm", 1e-9, 1e4);
/// A distance that is kept (mm).
pub const CLEARANCE: Kind = Kind::zero_or_positive("mm", 1e-6, 1e5);
/// An angle (deg).
pub const ANGLE: Kind = Kind::any("deg", 1e5);
/// The largest elevation of an axis (deg).
pub const ELEVATION: Kind = Kind::zero_or_positive("deg", 1e-9, 90.0);
/// How far a reflector may turn away from the instrument, between its z axis and the way to it (deg).
pub const INCIDENCE: Kind = Kind::positive("deg", 1e-9, 180.0);
/// The width of a range of angles (deg).
pub const ANGLE_WIDTH: Kind = Kind::positive("deg", 1e-9, 1e5);
/// A coordinate of a small rotation (mrad).
pub const ROTATION: Kind = Kind::any("mrad", 1e5);
/// The standard deviation of a position or deflection (mm).
pub const DEVIATION: Kind = Kind::positive("mm", 1e-9, 1e4);
/// The standard deviation of a rotation (mrad).
pub const ROTATION_DEVIATION: Kind = Kind::positive("mrad", 1e-9, 1e4);
/// The standard deviation of half a joint's gap (arc seconds).
pub const GAP_DEVIATION: Kind = Kind::positive("arcsec", 1e-6, 1e6);
/// The standard deviation of something by shares of it.
pub const RELATIVE_DEVIATION: Kind = Kind::positive("", 1e-9, 1.0);
/// How many standard uncertainties an expanded uncertainty is.
pub const COVERAGE: Kind = Kind::positive("", 0.1, 100.0);
/// The standard deviation of a position for each metre of distance (um/m).
pub const PER_METRE_DEVIATION: Kind = Kind::positive("um/m", 1e-6, 1e6);
/// The standard deviation of what drifts in an hour (um/h).
pub const PER_HOUR_DEVIATION: Kind = Kind::positive("um/h", 1e-6, 1e6);
/// A joint's compliance, zero where it is rigid (rad/(N m)). A stiffness in its place is a likely mistake,
/// which is told with more words when the robot is judged.
pub const COMPLIANCE: Kind = Kind::zero_or_positive("rad/(N m)", 1e-15, 1e12);
/// A joint's compliance that was identified (rad/(N m)).
pub const ELASTIC_COMPLIANCE: Kind = Kind::positive("rad/(N m)", 1e-15, 1e3);
/// The variance of a compliance ((rad/(N m))^2), zero where it is not determined.
pub const VARIANCE: Kind = Kind::zero_or_positive("(rad/(N m))^2", 1e-60, 1e6);
/// A variance of a parameter of any kind, in the square of its unit.
pub const ANY_VARIANCE: Kind = Kind::zero_or_positive("", 1e-60, 1e30);
/// A mass (kg).
pub const MASS: Kind = Kind::zero_or_positive("kg", 1e-12, 1e9);
/// A component of the acceleration of gravity (m/s^2).
pub const GRAVITY: Kind = Kind::any("m/s^2", 1e4);
/// A weight among others.
pub const WEIGHT: Kind = Kind::positive("", 1e-9, 1e9);
/// How many times something is as large.
pub const FACTOR: Kind = Kind::positive("", 1e-6, 1e6);
/// The standard deviation of a compliance's logarithm: with 1, compliances are within a factor of 7 in
/// 95 % of the runs.
pub const SPREAD: Kind = Kind::zero_or_positive("", 0.0, 1.0);
/// A temperature of a workshop (deg C).
pub const TEMPERATURE: Kind = Kind::any("deg C", 200.0);
/// How many there are of something that has a limit of its own.
pub const COUNT: Kind = Kind::any("", 1e18);
/// A tolerance, in any unit.
pub const TOLERANCE: Kind = Kind::zero_or_positive("", 1e-30, 1e12);
/// How long work takes (min).
pub const MINUTES: Kind = Kind::zero_or_positive("min", 1e-6, 1e6);
/// How fast a joint turns (deg/s).
pub const AXIS_SPEED: Kind = Kind::positive("deg/s", 1e-3, 1e4);
/// How far before a configuration its approach begins (deg).
pub const APPROACH: Kind = Kind::zero_or_positive("deg", 1e-3, 90.0);
/// An accuracy that is wanted (um).
pub const ACCURACY: Kind = Kind::positive("um", 1e-6, 1e9);

/// A load that is not zero has a force (N) or a torque (N m) with a component of this size.
const LEAST_LOAD: f64 = 1e-6;

impl Kind {
    const fn any(unit: &'static str, most: f64) -> Self {
        Self::of(Sign::Any, unit, [0.0, most])
    }

    const fn zero_or_positive(unit: &'static str, least: f64, most: f64) -> Self {
        Self::of(Sign::ZeroOrPositive, unit, [least, most])
    }

    const fn positive(unit: &'static str, least: f64, most: f64) -> Self {
        Self::of(Sign::Positive, unit, [least, most])
    }

    const fn of(sign: Sign, unit: &'static str, [least, most]: [f64; 2]) -> Self {
        Self {
            unit,
            sign,
            least,
            most,
        }
    }

    /// Whether a quantity of this kind can have the value.
    pub fn allows(&self, value: f64) -> bool {
        let is_in_range = (self.least..=self.most).contains(&value);
        match self.sign {
            Sign::Any => value.abs() <= self.most,
            Sign::ZeroOrPositive => value == 0.0 || is_in_range,
            Sign::Positive => is_in_range,
        }
    }

    /// The value, if it is in the range.
    ///
    /// # Errors
    /// What was found and what is allowed, in words.
    pub fn check(&self, value: f64) -> Result<f64, String> {
        if self.allows(value) {
            Ok(value)
        } else {
            Err(format!("found {}; {}", shown(value), self.allowed()))
        }
    }

    /// The value of a text, if it is allowed; otherwise what is.
    pub fn parse(&self, text: &str) -> Result<f64, String> {
        self.check(text.parse().map_err(|_| self.allowed())?)
    }

    /// What is allowed, in words.
    pub fn allowed(&self) -> String {
        let [least, most] = [self.least, self.most].map(shown);
        let unit = match self.unit {
            "" => String::new(),
            unit => format!(" {unit}"),
        };
        match self.sign {
            Sign::Any => format!("a finite number is allowed, of up to {most}{unit} in size"),
            Sign::ZeroOrPositive => {
                format!("zero or a positive number is allowed, from {least} to {most}{unit}")
            }
            Sign::Positive => format!("a positive number is allowed, from {least} to {most}{unit}"),
        }
    }
}

/// What is wrong with the size of a load whose components are each plausible: it must be zero or
/// noticeable. Single components may be as small as rounding leaves them.
pub fn faint_load(wrench: &Vector6<f64>) -> Option<String> {
    let largest = wrench.amax();
    (largest > 0.0 && largest < LEAST_LOAD).then(|| {
        format!(
            "found a load of at most {} N and N m in each direction; zero, or at least {LEAST_LOAD:e} in one, is allowed",
            shown(largest)
        )
    })
}

/// A number as people write it, however large or small.
pub fn shown(value: f64) -> String {
    if value == 0.0 || (1e-6..1e7).contains(&value.abs()) || !value.is_finite() {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_have_ends() {
        for (kind, inside, outside) in [
            (
                FORCE,
                [-1e8, 0.0, 1e8],
                [1.1e8, f64::NEG_INFINITY, f64::NAN],
            ),
            (DEVIATION, [1e-9, 0.03, 1e4], [0.0, -0.03, 1e308]),
            (COMPLIANCE, [0.0, 1e-15, 1e12], [-1e-6, 1e-308, 2e12]),
        ] {
            assert!(inside.into_iter().all(|value| kind.allows(value)));
            assert!(!outside.into_iter().any(|value| kind.allows(value)));
        }
    }

    #[test]
    fn a_load_is_zero_or_noticeable() {
        assert_eq!(faint_load(&Vector6::zeros()), None);
        assert_eq!(
            faint_load(&Vector6::new(1e-13, 0.0, -2500.0, 0.0, 0.0, 0.0)),
            None
        );
        let problem =
            faint_load(&Vector6::new(0.0, 0.0, 1e-308, 0.0, 0.0, 0.0)).expect("too small");
        assert!(problem.contains("1e-308"), "{problem}");
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!(
            [0.03, 1e8, 1e308, -1e-6, f64::NAN].map(shown).join(" "),
            "0.03 1e8 1e308 -0.000001 NaN"
        );
    }
}
