//! A gauge: an instrument that reads one length, how far a place moves along one direction or is from another place.

use nalgebra::Vector3;

use crate::numeric::quantisation::rounding_variance;

/// What an instrument for one length shows: a dial gauge, which is set to zero without the load, a ballbar, a wire encoder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gauge {
    /// The standard deviation of what it shows (m), rounded, where it stands beside an instrument that reads all coordinates; that of
    /// the instrument where it is the instrument.
    pub beside_m: Option<f64>,
    /// The largest displacement that it shows (m), to either side; any where there is no bound. Lengths from stations have that of the station.
    pub range_m: Option<f64>,
    /// The step of what it shows (m); nothing where that is far finer than its noise.
    pub resolution_m: f64,
    /// The share of the instrument's drift between the readings of a deflection that is in a displacement, whose load is hung in place.
    pub drift_share: f64,
}

impl Gauge {
    /// The variance of rounding to the step (m^2), which is uniform.
    pub fn rounding_m2(&self) -> f64 {
        rounding_variance(self.resolution_m)
    }

    /// What it shows of a length (m).
    pub fn rounded_m(&self, length_m: f64) -> f64 {
        match self.resolution_m {
            0.0 => length_m,
            // Of 0.05 mm a whole number of twentieths: a decimal in mm, as it is written and read.
            step => (length_m / step).round() / (step * 1e3).recip() * 1e-3,
        }
    }

    /// What it shows of a displacement (m) along a direction, as a vector.
    pub fn shown(&self, displacement_m: &Vector3<f64>, direction: &Vector3<f64>) -> Vector3<f64> {
        direction * self.rounded_m(direction.dot(displacement_m))
    }
}
