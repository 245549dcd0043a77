//! A joint whose torque does not grow evenly with its deflection: one law, at rest and in time.

use super::servo::Servo;

/// The elastic law of a joint that is no spring. With the stiffness K of the joint's actuator, and x what of the deflection
/// (command minus coordinate) is beyond the dead band,
///
/// ```text
/// torque = K x (1 + (x / stiffens_at)^2),   or   K x / (1 + (x / softens_at)^2),   or   K x
/// ```
///
/// Deflections are in rad, in m of a joint that slides.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TorqueLaw {
    /// How far the joint gives to either side before anything holds it.
    pub dead_band: f64,
    /// Where the joint holds twice as much as a spring would.
    pub stiffens_at: Option<f64>,
    /// Where it holds half as much. Beyond, it holds less the more it gives.
    pub softens_at: Option<f64>,
}

impl TorqueLaw {
    /// The torque at a deflection, over the stiffness (rad, m).
    pub fn held(&self, deflection: f64) -> f64 {
        let beyond = (deflection.abs() - self.dead_band).max(0.0);
        let share = |at: f64| 1.0 + (beyond / at).powi(2);
        let stiffened = beyond * self.stiffens_at.map_or(1.0, share);
        (stiffened / self.softens_at.map_or(1.0, share)).copysign(deflection)
    }

    /// The deflection under a torque over the stiffness (rad, m), the nearest to none: the inverse of [`Self::held`]. In the middle
    /// of the dead band without any; as far as it holds under more than it can.
    pub fn deflection(&self, held: f64) -> f64 {
        if held == 0.0 {
            return 0.0;
        }
        let size = held.abs();
        let beyond = match (self.stiffens_at, self.softens_at) {
            // x + x^3 / s^2 = y.
            (Some(at), _) => {
                let third = (1.5 * 3.0_f64.sqrt() * size / at).asinh() / 3.0;
                2.0 * at / 3.0_f64.sqrt() * third.sinh()
            }
            // x = y (1 + x^2 / s^2), the smaller root.
            (None, Some(at)) => {
                let root = (1.0 - (2.0 * size / at).powi(2)).max(0.0).sqrt();
                2.0 * size.min(0.5 * at) / (1.0 + root)
            }
            (None, None) => size,
        };
        (beyond + self.dead_band).copysign(held)
    }
}

/// A joint with a law, and the actuator that holds it.
#[derive(Debug, Clone, Copy)]
pub(super) struct LawAtWork {
    pub law: TorqueLaw,
    pub servo: Servo,
    /// The index of the joint's coordinate.
    pub coordinate: usize,
    /// Its degree of freedom.
    pub degree: usize,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deflections_hold_what_they_are_to_hold() {
        let laws = [
            TorqueLaw::default(),
            TorqueLaw {
                dead_band: 1e-4,
                ..TorqueLaw::default()
            },
            TorqueLaw {
                dead_band: 2e-4,
                stiffens_at: Some(1e-3),
                softens_at: None,
            },
            TorqueLaw {
                softens_at: Some(3e-3),
                ..TorqueLaw::default()
            },
        ];
        for law in laws {
            for held in [-1.4e-3, -1e-5, 1e-9, 3e-4, 1.2e-3] {
                let deflection = law.deflection(held);
                assert!((law.held(deflection) - held).abs() < 1e-15, "{law:?}");
                assert!(deflection.abs() >= law.dead_band);
            }
            assert!(law.deflection(0.0).abs() < 1e-300);
        }
    }

    /// Where it is told to, it holds twice or half of what a spring does.
    #[test]
    fn laws_double_and_halve() {
        let stiffens = TorqueLaw {
            stiffens_at: Some(2e-3),
            ..TorqueLaw::default()
        };
        assert!((stiffens.held(-2e-3) + 4e-3).abs() < 1e-15);
        let softens = TorqueLaw {
            dead_band: 1e-3,
            softens_at: Some(2e-3),
            ..TorqueLaw::default()
        };
        assert!((softens.held(3e-3) - 1e-3).abs() < 1e-15);
        assert!(softens.held(0.9e-3).abs() < 1e-300);
        // No more than that is ever held.
        assert!((softens.deflection(5.0) - 3e-3).abs() < 1e-15);
    }
}
