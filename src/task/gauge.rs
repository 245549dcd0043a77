//! A gauge: an instrument on a stand that reads how far a place moves along one direction.

use nalgebra::Vector3;

/// What an instrument for displacements along a direction shows, such as a dial gauge. It is set to zero without the load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gauge {
    /// The largest displacement that it shows (m), to either side; any where there is no bound.
    pub range_m: Option<f64>,
    /// The step of what it shows (m); nothing where that is far finer than its noise.
    pub resolution_m: f64,
}

impl Gauge {
    /// The variance of rounding to the step (m^2), which is uniform.
    pub fn rounding_m2(&self) -> f64 {
        self.resolution_m.powi(2) / 12.0
    }

    /// What it shows of a displacement (m) along a direction, as a vector.
    pub fn shown(&self, displacement_m: &Vector3<f64>, direction: &Vector3<f64>) -> Vector3<f64> {
        let along = direction.dot(displacement_m);
        direction
            * match self.resolution_m {
                0.0 => along,
                step => (along / step).round() * step,
            }
    }
}
