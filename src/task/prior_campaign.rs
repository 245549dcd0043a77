//! The error sources of the campaign behind `robot.prior`.

use nalgebra::{DMatrix, DVector};

/// The errors of an earlier identification: of its compliances, and of these together with what else was uncertain.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorCampaign {
    /// The covariance of the identified compliances (p x p, (rad/(N m))^2); zero where nothing was determined.
    pub covariance: DMatrix<f64>,
    /// What else was uncertain, by name, and its covariance with the identified compliances (p, rad/(N m) times its unit).
    pub others: Vec<(String, DVector<f64>)>,
    /// Those of the residual scale, where the covariance rests on one that was estimated.
    pub degrees_of_freedom: Option<f64>,
}
