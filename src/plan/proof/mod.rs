//! A bound that is proved: no experiment of a region has a larger derivative than a number, and therefore no plan
//! a smaller `rho_0` than another.
//!
//! # The theorem
//!
//! For information M = M0 + sum of `A(x)^T A(x)` / sigma^2 over m measurements, M0 what is known before,
//! target rows C, and any matrix B of C's shape, Cauchy and Schwarz give
//!
//! ```text
//! trace(C B^T)^2 <= trace(C M^-1 C^T) trace(B M B^T)
//! rho_0^2 = trace(C M^-1 C^T) >= trace(C B^T)^2 / (trace(B M0 B^T) + m max d)
//! d(x) = trace(B A(x)^T A(x) B^T) / sigma^2 = sum over rows r of |sum over n of b_rn tau_n J_n|^2 / sigma^2
//! ```
//!
//! with A's columns `tau_n J_n`, `J_n` = `z_n` x (p - `o_n`), `tau_n` = `J_n` . F + `z_n` . T. The best B is C M^-1 of the
//! approximate design. B need not be that, nor precise, and nothing is inverted here: its entries are taken as the doubles that
//! they are. What must be proved is one number, an upper bound of max d over the region.
//!
//! # Assumptions
//!
//! The chain's and the scenario's constants are the doubles that the program holds (a rotation is that of its quaternion, of
//! whatever length; an axis has the direction of its vector). The region is that of joint ranges, height, radius and
//! elevation; torque limits, collisions, sight and forbidden configurations are left out, which makes the bound
//! only weaker. Noise is of the same size in each coordinate.
//!
//! # How it is proved
//!
//! Branch and bound over boxes of joint angles. On a box every quantity is a Taylor model of second order with a rigorous
//! remainder; all rounding goes into the remainder. A box is done with where d + sum of lambda g <= T, with
//! multipliers lambda >= 0 for margins g that are not negative in the region, or where some g < 0.
//!
//! - `rounding`: what double precision can lose; sine and cosine; `taylor`, `products`: the models and their arithmetic; `vectors`: with three parts.
//! - [`question`](Question): what is to be proved, in plain numbers; `constant`, `chain`: the arm in simple frames; `domain`: the
//!   variables, and what symmetry leaves of their ranges.
//! - `geometry`: where everything is over a box, told in a frame in the middle of the chain; `enclosure`: d and the margins, `rows`: its sum of
//!   squares;
//!   `form`: d for a force of any direction; `weighted`: where more is new in each reading than the instrument's noise.
//! - `polynomial`, `judgement`: the largest value over a box, with multipliers; [`branching`](prove): all boxes.
//! - `tree`: the proof as an object that can be checked by others.
//! - [`bound`](Ingredients): from max d to `rho_0`.

#[cfg(test)]
#[path = "tests/arms.rs"]
mod arms;
mod bound;
mod branching;
mod chain;
mod constant;
mod covariance;
mod domain;
mod enclosure;
mod form;
mod geometry;
mod judgement;
mod polynomial;
mod products;
mod question;
mod rounding;
mod rows;
mod taylor;
#[cfg(test)]
mod tests;
mod tree;
mod vectors;
mod weighted;

pub use bound::{Ingredients, Target};
pub use branching::{NoProof, ProofLimits, Proved, prove};
pub use question::{Arm, ProofJoint, ProofLoads, Question, ReadingSpread, SmoothRegion};
pub use tree::{ProofObject, ProofPart};
