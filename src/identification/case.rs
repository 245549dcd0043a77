//! What an identification is made from.

use nalgebra::{DMatrix, DVector};

use super::error::{FitResult, OFF_PRIOR};
use crate::measurement::Measurement;
use crate::task::{Belief, Method};

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
    /// What is believed, or shown by the residuals in its place.
    pub const fn of(belief: &Belief, is_from_residuals: bool) -> Self {
        let sigma_m = belief.instrument.sigma_m;
        if is_from_residuals {
            Self::FromResiduals(sigma_m)
        } else {
            Self::Known(sigma_m)
        }
    }

    /// The standard deviation that weights deflections which bring none of their own (m).
    pub(super) const fn weight_m(self) -> f64 {
        match self {
            Self::Known(sigma) | Self::FromResiduals(sigma) => sigma,
        }
    }
}

/// What is identified from.
#[derive(Debug, Clone, Copy)]
pub struct Case<'a> {
    /// The planner's model: the nominal robot, its unknowns, and what is known of them before.
    pub belief: &'a Belief,
    /// The measurements.
    pub measurements: &'a [Measurement],
    /// The standard deviation of deflections.
    pub sigma: Sigma,
    /// The method.
    pub method: Method,
    /// The identified joints whose compliances stay nominal all the same, as places in the belief's parameters.
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
            belief,
            measurements,
            sigma,
            method,
            held: &[],
        }
    }

    /// What a belief leaves open, by its method and its sigma.
    pub const fn as_believed(belief: &'a Belief, measurements: &'a [Measurement]) -> Self {
        let sigma = Sigma::of(belief, false);
        Self::of_belief(belief, measurements, sigma, belief.method)
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

    /// What is known before as whitened equations (q x p) of a change from values of the unknowns, and what these leave of each (q): by the
    /// linear method to first order about nominal values.
    pub(super) fn prior_rows_at(
        &self,
        values: &DVector<f64>,
    ) -> FitResult<(DMatrix<f64>, DVector<f64>)> {
        let (known, rows) = (
            self.belief.uncertain.set().prior(),
            self.belief.uncertain.prior_rows(),
        );
        match self.method {
            Method::Linear => Ok((rows.clone(), rows * (&known.mean - values))),
            Method::Nonlinear => known.rows_at(rows, values).ok_or(OFF_PRIOR),
        }
    }

    /// What the measurements tell of the unknowns, each with its own standard deviation where it brings one and to
    /// first order in compliance: A^T R^-1 A (p x p, in one over the unknowns' units), without what was known before.
    pub fn information(&self) -> DMatrix<f64> {
        let rows = self.first_order(&self.belief.values()).matrix;
        rows.tr_mul(&rows)
    }
}
