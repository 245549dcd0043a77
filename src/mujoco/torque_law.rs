//! A joint whose torque does not grow evenly with its deflection: nonlinear joint stiffness.

use super::servo::Servo;

/// The elastic law of a joint that is no spring. With the stiffness K of the joint's actuator, its deflection x (command minus
/// coordinate) and the coefficient c,
///
/// ```text
/// torque = K x (1 + c x^2) where c > 0: it stiffens,   or   K x / (1 - c x^2) where c < 0: it softens
/// ```
///
/// At x = 1/sqrt(|c|) it holds twice as much as a spring would, or half as much. Deflections are in rad, in m of a joint that slides.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TorqueLaw {
    /// The coefficient c (1/rad^2, 1/m^2).
    pub cubic: f64,
}

impl TorqueLaw {
    /// The law of a joint that stiffens by this share, to first order, of what its spring holds at a deflection; it softens where the
    /// share is negative.
    pub fn of_share(share: f64, deflection: f64) -> Self {
        Self {
            cubic: share / deflection.powi(2),
        }
    }

    /// The torque at a deflection, over the stiffness (rad, m).
    pub fn held(&self, deflection: f64) -> f64 {
        let share = self.cubic * deflection.powi(2);
        if share >= 0.0 {
            deflection * (1.0 + share)
        } else {
            deflection / (1.0 - share)
        }
    }

    /// Whether it can hold a torque over the stiffness (rad, m).
    pub fn can_hold(&self, held: f64) -> bool {
        -4.0 * self.cubic * held.powi(2) < 1.0
    }

    /// The deflection under a torque over the stiffness (rad, m), the nearest to none: the inverse of [`Self::held`]. As far as it
    /// holds under more than it can.
    pub fn deflection(&self, held: f64) -> f64 {
        let (size, at) = (held.abs(), self.cubic.abs().sqrt().recip());
        let deflection = if self.cubic > 0.0 {
            // x + x^3 / s^2 = y.
            let third = (1.5 * 3.0_f64.sqrt() * size / at).asinh() / 3.0;
            2.0 * at / 3.0_f64.sqrt() * third.sinh()
        } else if self.cubic < 0.0 {
            // x = y (1 + x^2 / s^2), the smaller root.
            let root = (1.0 - (2.0 * size / at).powi(2)).max(0.0).sqrt();
            2.0 * size.min(0.5 * at) / (1.0 + root)
        } else {
            size
        };
        deflection.copysign(held)
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
        for cubic in [0.0, 1e6, -1e5] {
            let law = TorqueLaw { cubic };
            for held in [-1.4e-3, -1e-5, 0.0, 1e-9, 3e-4, 1.2e-3] {
                assert!(law.can_hold(held));
                let deflection = law.deflection(held);
                assert!((law.held(deflection) - held).abs() < 1e-15, "{law:?}");
            }
        }
    }

    /// Where it is told to, it holds twice or half of what a spring does.
    #[test]
    fn laws_double_and_halve() {
        let stiffens = TorqueLaw::of_share(1.0, 2e-3);
        assert!((stiffens.held(-2e-3) + 4e-3).abs() < 1e-15);
        let softens = TorqueLaw::of_share(-1.0, 2e-3);
        assert!((softens.held(2e-3) - 1e-3).abs() < 1e-15);
        // No more than that is ever held.
        assert!(!softens.can_hold(5.0) && (softens.deflection(5.0) - 2e-3).abs() < 1e-15);
    }
}
