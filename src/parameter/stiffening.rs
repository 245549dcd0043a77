//! Nonlinear joint stiffness: a joint whose compliance changes with its torque.
//!
//! Gears stiffen as teeth and bearings come to bear. With the compliance k, the torque tau of weight and load and a share e, which
//! nobody knows, of what a spring would give at the torque `tau_0`, a joint gives to first order in e
//!
//! ```text
//! k tau (1 - e (tau / tau_0)^2)
//! ```
//!
//! The virtual robot's joints hold by the [law](crate::mujoco::TorqueLaw) of which that is the beginning: K x (1 + (x/s)^2) with
//! s = k `tau_0` / sqrt(e), or, where e is negative and the joint softens, K x / (1 + (x/s)^2) with s = k `tau_0` / sqrt(-e).

/// What a joint gives besides its spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stiffening {
    /// The share e of what its spring gives at `at_nm` by which it gives less; negative where it softens.
    pub share: f64,
    /// The torque `tau_0` (N m; N where the joint slides) at which that is said; none where the joint is a spring.
    pub at_nm: Option<f64>,
}

impl Stiffening {
    /// A spring.
    pub const NONE: Self = Self {
        share: 0.0,
        at_nm: None,
    };

    /// How far a joint of this compliance (rad/(N m)) gives under a torque (N m) besides its spring for a share of one (rad).
    pub fn gives(&self, compliance_rad_per_nm: f64, torque_nm: f64) -> f64 {
        self.at_nm.map_or(0.0, |at_nm| {
            -compliance_rad_per_nm * (torque_nm / at_nm).powi(2) * torque_nm
        })
    }
}
