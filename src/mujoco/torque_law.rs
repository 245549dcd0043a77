//! Nonlinear joint stiffness: a joint whose torque does not grow evenly with its deflection.

use super::servo::Servo;

/// A joint that gives way holds at least by this share of its stiffness where its derivative is taken.
const FLATTEST: f64 = 0.1;

/// The elastic law of a joint that is no spring, as gears stiffen whose teeth and bearings come to bear. With the stiffness K = 1/k of the
/// joint's actuator, its deflection x (command minus coordinate), and a share e of what a spring holds at s,
///
/// ```text
/// torque = K x (1 + e (x/s)^2) where e > 0: it stiffens,   or   K x / (1 - e (x/s)^2) where e < 0: it softens
/// ```
///
/// The virtual robot's joints hold by it, and those of the planner's model, under the torque that they carry as commanded, with
/// s = k `tau_0`: to first order in e a joint gives k tau (1 - e (tau / `tau_0`)^2). Deflections are in rad, in m of a joint that slides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TorqueLaw {
    /// The share e by which it holds more; negative where it softens.
    pub share: f64,
    /// Where that is said: the deflection s; in the planner's model the torque `tau_0` (N m; N where the joint slides); none of a spring.
    pub at: Option<f64>,
}

impl TorqueLaw {
    /// A spring.
    pub const SPRING: Self = Self {
        share: 0.0,
        at: None,
    };

    fn cubic(&self) -> f64 {
        self.at.map_or(0.0, |at| self.share / at.powi(2))
    }

    /// How far a joint of this compliance k (rad/(N m)) gives under a torque (N m) besides its spring, in the planner's model: `at` is the
    /// torque `tau_0` (rad).
    pub fn beside_spring(&self, compliance_rad_per_nm: f64, torque_nm: f64) -> f64 {
        if self.share == 0.0 {
            return 0.0;
        }
        let held = compliance_rad_per_nm * torque_nm;
        self.by_deflection(compliance_rad_per_nm).deflection(held) - held
    }

    /// The derivative of [that](Self::beside_spring) by the share e (rad): -k tau (tau / `tau_0`)^2 of a spring.
    pub fn gives(&self, compliance_rad_per_nm: f64, torque_nm: f64) -> f64 {
        let Some(at_nm) = self.at else {
            return 0.0;
        };
        let law = self.by_deflection(compliance_rad_per_nm);
        let deflection = law.deflection(compliance_rad_per_nm * torque_nm);
        let relative = (deflection / (compliance_rad_per_nm * at_nm)).powi(2);
        let share = self.share * relative;
        let steepness = if share >= 0.0 {
            1.0 + 3.0 * share
        } else {
            // At a share of -1 it holds most, and turns about.
            (1.0 + share).max(FLATTEST)
        };
        -deflection * relative / steepness
    }

    /// The law of the torque in the planner's model as one of the deflection: s = k `tau_0`.
    pub fn by_deflection(&self, compliance_rad_per_nm: f64) -> Self {
        Self {
            share: self.share,
            at: self.at.map(|at_nm| compliance_rad_per_nm * at_nm),
        }
    }

    /// The torque at a deflection, over the stiffness (rad, m).
    pub fn held(&self, deflection: f64) -> f64 {
        let share = self.cubic() * deflection.powi(2);
        if share >= 0.0 {
            deflection * (1.0 + share)
        } else {
            deflection / (1.0 - share)
        }
    }

    /// Whether it can hold a torque over the stiffness (rad, m).
    pub fn can_hold(&self, held: f64) -> bool {
        -4.0 * self.cubic() * held.powi(2) < 1.0
    }

    /// The deflection under a torque over the stiffness (rad, m), the nearest to none: the inverse of [`Self::held`]. As far as it
    /// holds under more than it can.
    pub fn deflection(&self, held: f64) -> f64 {
        let cubic = self.cubic();
        let (size, at) = (held.abs(), cubic.abs().sqrt().recip());
        let deflection = if cubic > 0.0 {
            // x + x^3 / s^2 = y.
            let third = (1.5 * 3.0_f64.sqrt() * size / at).asinh() / 3.0;
            2.0 * at / 3.0_f64.sqrt() * third.sinh()
        } else if cubic < 0.0 {
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
        for share in [0.0, 1e6, -1e5] {
            let at = Some(1.0);
            let law = TorqueLaw { share, at };
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
        let stiffens = TorqueLaw {
            share: 1.0,
            at: Some(2e-3),
        };
        assert!((stiffens.held(-2e-3) + 4e-3).abs() < 1e-15);
        let softens = TorqueLaw {
            share: -1.0,
            ..stiffens
        };
        assert!((softens.held(2e-3) - 1e-3).abs() < 1e-15);
        // No more than that is ever held.
        assert!(!softens.can_hold(5.0) && (softens.deflection(5.0) - 2e-3).abs() < 1e-15);
    }
}
