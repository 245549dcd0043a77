//! Digests of readings, by which those that were fitted are known again, whatever their order and units in a file.

use std::collections::BTreeSet;

use nalgebra::DVector;
use sha2::{Digest, Sha256};

use super::{AbsoluteReading, Measurement};

/// Readings (m) and angles (deg) are rounded to these: files of the same readings may have fewer digits.
const READ_M: f64 = 1e-6;
const ANGLE_DEG: f64 = 1e-4;
/// So many bytes of a hash make a number that all readers of JSON hold.
const BYTES: usize = 6;

/// What is read at a configuration.
pub trait Digested {
    /// The configuration (rad; m where joints slide), and what is read there (m).
    fn read(&self) -> (&DVector<f64>, [f64; 3]);
}

impl Digested for Measurement {
    fn read(&self) -> (&DVector<f64>, [f64; 3]) {
        (&self.configuration_rad, self.deflection_m.into())
    }
}

impl Digested for AbsoluteReading {
    fn read(&self) -> (&DVector<f64>, [f64; 3]) {
        let length = self.length.map(|length| [length.length_m, 0.0, 0.0]);
        let read = length.unwrap_or_else(|| self.position_m.into());
        (&self.configuration_rad, read)
    }
}

/// The digests of readings.
pub fn digests_of<R: Digested>(readings: &[R]) -> Vec<u64> {
    let digest = |reading: &R| {
        let (configuration_rad, read) = reading.read();
        let angles = configuration_rad.iter();
        let angles = angles.map(|angle| angle.to_degrees() / ANGLE_DEG);
        let mut hash = Sha256::new();
        for steps in angles.chain(read.map(|value_m| value_m / READ_M)) {
            // No minus zero.
            hash.update((steps.round() + 0.0).to_le_bytes());
        }
        let bytes = hash.finalize();
        (bytes.iter().take(BYTES)).fold(0, |sum, byte| sum << 8 | u64::from(*byte))
    };
    readings.iter().map(digest).collect()
}

/// How many of some readings are among others, by their digests.
pub fn count_among(digests: &[u64], others: &[u64]) -> usize {
    let others: BTreeSet<&u64> = others.iter().collect();
    let same = digests.iter().filter(|digest| others.contains(digest));
    same.count()
}
