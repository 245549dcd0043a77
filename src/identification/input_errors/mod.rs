//! Likely input errors of a table: units, signs, frames, columns, an instrument that was moved.
//!
//! An error is supposed, the table is read without it, and both readings are judged: deflections by their evidence, absolute
//! readings by what frames alone leave of them.

mod correction;
mod deflections;
mod evidence;
mod frames;
mod words;

use nalgebra::Matrix3;

use crate::codes::{Condition, ConditionCode};

pub use deflections::{conditions_of_table, likely_input_errors, suspected_input_errors};

/// The standard gravity (m/s^2): one kilogram weighs 9.81 N.
const GRAVITY: f64 = 9.81;
/// Up to so many joints every set of signs is tried.
const ALL_SIGNS: usize = 7;

/// How a table would have to be read.
#[derive(Debug, Clone, PartialEq)]
pub enum InputError {
    /// All deflections, or all loads, have the wrong sign.
    SignsReversed,
    /// Loads must be multiplied by this to be in N and N m.
    LoadUnit(f64),
    /// Deflections must be multiplied by this to be in mm and mrad.
    DeflectionUnit(f64),
    /// Angles must be multiplied by this to be in degrees.
    AngleUnit(f64),
    /// These joints (indices) turn the other way.
    JointSigns(Vec<usize>),
    /// The columns of these two joints (indices) are swapped.
    JointsSwapped([usize; 2]),
    /// A joint's (index) angle lacks so many quarters of a turn.
    JointOffset(usize, i8),
    /// A joint's (index) angle lacks so many times that of the joint before it.
    JointFromBefore(usize, f64),
    /// Deflections must be multiplied by this orthogonal matrix to be in the world frame.
    Frame(Matrix3<f64>),
    /// Deflections are in the tool's frame.
    DeflectionsInToolFrame,
    /// Loads are in the tool's frame.
    LoadsInToolFrame,
    /// The instrument's axes are left-handed.
    LeftHanded,
    /// Positions must be multiplied by this orthogonal matrix, and rotations not.
    PositionColumns(Matrix3<f64>),
    /// Rotations are those from the instrument to the target.
    RotationsInverted,
    /// What was read as w, x, y and z of quaternions stands in these places.
    QuaternionOrder([usize; 4]),
    /// Euler angles were composed in the other order.
    EulerOrder,
    /// The instrument was moved before this reading (from 0).
    StationMoved(usize),
}

/// An input error with what speaks for it.
#[derive(Debug, Clone, PartialEq)]
pub struct LikelyInputError {
    /// The error.
    pub error: InputError,
    /// The natural logarithm of how many times more probable the measurements are with this error than without.
    pub log_evidence_ratio: f64,
    /// What may be wrong, what to do, and what is left then, in words.
    pub text: String,
}

impl LikelyInputError {
    /// The same as a condition.
    pub fn condition(&self) -> Condition {
        ConditionCode::InputError.with(format!("likely input error: {}", self.text))
    }
}

/// Sets of joints whose signs may be wrong, the smaller ones first: single ones of many joints.
fn sets_of_signs(joints: usize) -> Vec<Vec<usize>> {
    if joints > ALL_SIGNS {
        return (0..joints).map(|joint| vec![joint]).collect();
    }
    let set = |bits: usize| (0..joints).filter(|joint| bits >> joint & 1 == 1).collect();
    let mut sets: Vec<Vec<usize>> = (1..1 << joints).map(set).collect();
    sets.sort_by_key(Vec::len);
    sets
}

/// All pairs of joints.
fn swapped_joints(joints: usize) -> impl Iterator<Item = InputError> {
    let pairs = (0..joints).flat_map(|other| (0..other).map(move |one| [one, other]));
    pairs.map(InputError::JointsSwapped)
}

/// Angles in radians that were read as degrees, and the other way.
fn angle_units() -> [InputError; 2] {
    let degrees = 1_f64.to_degrees();
    [degrees, degrees.recip()].map(InputError::AngleUnit)
}
