//! What an identification is made from.

use nalgebra::DMatrix;

use crate::measurement::Measurement;
use crate::parameter::Prior;
use crate::robot::{Robot, Tool};
use crate::task::{Belief, Extended, Method};

/// Which standard deviation of deflections the uncertainties rest on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sigma {
    /// A known one (m).
    Known(f64),
    /// The one that the residuals show; intervals follow Student's t. What the measurements determine is
    /// decided with the one that is believed (m), as it was when they were planned.
    FromResiduals(f64),
}

impl Sigma {
    /// The standard deviation that weights deflections which bring none of their own (m).
    pub(super) const fn weight_m(self) -> f64 {
        match self {
            Self::Known(sigma) | Self::FromResiduals(sigma) => sigma,
        }
    }
}

/// The arguments of [`identify`](super::identify), and what is known before.
#[derive(Debug, Clone, Copy)]
pub struct Case<'a> {
    /// The nominal robot.
    pub nominal: &'a Robot,
    /// The calibration tool.
    pub tool: &'a Tool,
    /// The identified joints.
    pub parameters: &'a [usize],
    /// What is known of their compliances before.
    pub prior: Option<&'a Prior>,
    /// What else is uncertain; the prior is then in it.
    pub uncertain: Option<&'a Extended>,
    /// The measurements.
    pub measurements: &'a [Measurement],
    /// The standard deviation of deflections.
    pub sigma: Sigma,
    /// The method.
    pub method: Method,
    /// The identified joints whose compliances stay nominal all the same, as places in `parameters`.
    pub held: &'a [usize],
}

impl<'a> Case<'a> {
    /// What a belief leaves open.
    pub const fn of_belief(
        belief: &'a Belief,
        measurements: &'a [Measurement],
        sigma: Sigma,
        method: Method,
    ) -> Self {
        Self {
            nominal: &belief.nominal,
            tool: &belief.calibration_tool,
            parameters: belief.parameters.as_slice(),
            prior: belief.prior.as_ref(),
            uncertain: belief.uncertain.as_ref(),
            measurements,
            sigma,
            method,
            held: &[],
        }
    }

    /// The same with other measurements.
    pub const fn with<'b>(self, measurements: &'b [Measurement]) -> Case<'b>
    where
        'a: 'b,
    {
        Case {
            measurements,
            ..self
        }
    }

    /// What the measurements tell of the unknowns, each with its own standard deviation where it brings one and to
    /// first order in compliance: A^T R^-1 A (p x p, in one over the unknowns' units), without what was known before.
    pub fn information(&self) -> DMatrix<f64> {
        let rows = self.first_order(&self.nominal_values()).matrix;
        rows.tr_mul(&rows)
    }
}
