//! Backlash: the side of its gap on which a joint is.
//!
//! A joint with a gap of half width b stands at its command plus s b. Who came turning positively stopped short of the command,
//! s = -1, and with the same side of approach unloaded and loaded a deflection shows the joint a little elsewhere and nothing
//! more. What the joint carries presses it over to the side to which it turns it: with the torque tau of weight and load, and
//! tau_0 that at which this decides as much as the side of approach a (1 or -1) does,
//!
//! ```text
//! s = (-a tau_0^2 + tau |tau|) / (tau_0^2 + tau^2)
//! ```
//!
//! which has derivatives everywhere, as the hysteresis curves of gears have. Where a load turns a joint over its gap, a deflection
//! shows up to 2 b of it.

/// A joint's gap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Backlash {
    /// Half of its width (rad; m where the joint slides).
    pub half_width_rad: f64,
    /// The torque (N m; N where it slides) at which what the joint carries decides as much as the side of approach on which
    /// side of the gap it stands; none where the side of approach alone decides.
    pub turned_over_at_nm: Option<f64>,
}

impl Backlash {
    /// No gap.
    pub const NONE: Self = Self {
        half_width_rad: 0.0,
        turned_over_at_nm: None,
    };

    /// On which side of the gap the joint stands, -1 to 1, after it came turning positively or not, under a torque (N m).
    pub fn side(&self, came_positively: bool, torque_nm: f64) -> f64 {
        let of_approach = if came_positively { -1.0 } else { 1.0 };
        let Some(turned_over_at_nm) = self.turned_over_at_nm else {
            return of_approach;
        };
        let ratio = torque_nm / turned_over_at_nm;
        (of_approach + ratio * ratio.abs()) / (1.0 + ratio * ratio)
    }
}
