//! What an identification is made from.

use super::equations::EquationSource;
use super::error::IdentificationError;
use super::estimate::{Identification, Sigma, identify};
use crate::measurement::Measurement;
use crate::robot::{Robot, Tool};
use crate::task::Method;

/// The arguments of [`identify`].
#[derive(Debug, Clone, Copy)]
pub struct Case<'a> {
    /// The nominal robot.
    pub nominal: &'a Robot,
    /// The calibration tool.
    pub tool: &'a Tool,
    /// The identified joints.
    pub parameters: &'a [usize],
    /// The measurements.
    pub measurements: &'a [Measurement],
    /// The standard deviation of deflections.
    pub sigma: Sigma,
    /// The method.
    pub method: Method,
}

impl<'a> Case<'a> {
    /// The same with other measurements.
    #[must_use]
    pub const fn with(self, measurements: &'a [Measurement]) -> Self {
        Self {
            measurements,
            ..self
        }
    }

    /// See [`identify`].
    ///
    /// # Errors
    /// See [`identify`].
    pub fn identify(&self) -> Result<Identification, IdentificationError> {
        let (nominal, tool, parameters) = (self.nominal, self.tool, self.parameters);
        let (measurements, sigma, method) = (self.measurements, self.sigma, self.method);
        identify(nominal, tool, parameters, measurements, sigma, method)
    }

    pub(super) const fn equation_source(&self) -> EquationSource<'a> {
        EquationSource {
            chain: &self.nominal.chain,
            tool: self.tool,
            parameters: self.parameters,
            measurements: self.measurements,
            sigma_m: self.sigma.weight_m(),
        }
    }
}
