//! How SI values are written for people: serialisers for fields of records.

use nalgebra::Vector3;
use serde::{Serialize, Serializer};

/// What is written in thousandths of its unit: mm for m, mrad for rad.
pub trait Thousandfold {
    /// The same times 1000.
    fn thousandfold(&self) -> impl Serialize;
}

impl Thousandfold for f64 {
    fn thousandfold(&self) -> impl Serialize {
        self * 1e3
    }
}

impl Thousandfold for Vector3<f64> {
    fn thousandfold(&self) -> impl Serialize {
        <[f64; 3]>::from(self * 1e3)
    }
}

impl<T: Thousandfold> Thousandfold for Option<T> {
    fn thousandfold(&self) -> impl Serialize {
        self.as_ref().map(T::thousandfold)
    }
}

/// Writes mm for m, mrad for rad.
///
/// # Errors
/// Those of the serialiser.
pub fn thousandfold<S: Serializer>(value: &impl Thousandfold, to: S) -> Result<S::Ok, S::Error> {
    value.thousandfold().serialize(to)
}

/// Writes an index as a number from 1.
///
/// # Errors
/// Those of the serialiser.
pub fn from_one<S: Serializer>(index: &usize, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_u64(*index as u64 + 1)
}
