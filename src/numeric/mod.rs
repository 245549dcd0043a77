//! The mathematics that every stage uses, and that knows of no robot.
//!
//! - [`random`]: random numbers as a function of seed and run, one registry of their streams.
//! - [`correlated`]: rows that follow unknowns and processes, and what some of them tell of all.
//! - [`factorisation`]: eigenvalues and singular values, of matrices that may hold anything.
//! - [`estimable`]: what measurements determine, one decision for every stage.
//! - [`least_squares`]: the fit within it (eqs. 5, 6, 9).
//! - [`posterior`]: what is known afterwards, and the variance of anything that follows from it
//!   (eqs. 11 to 13, 20).
//! - [`quantile`]: what is exceeded with a probability.
//! - [`tolerance`]: the length that a share of errors stays below, and medians.
//! - [`likelihood`]: the likeliest values between limits, and intervals by profiles.
//! - [`quantisation`]: what errors of rounding to steps have in common.
//! - [`markov`]: processes along a coordinate that forget, of two kinds.

pub mod correlated;
pub mod estimable;
pub mod factorisation;
pub mod least_squares;
pub mod likelihood;
pub mod markov;
pub mod posterior;
pub mod quantile;
pub mod quantisation;
pub mod random;
pub mod tolerance;
