//! The covariance of deflections: the instrument's noise, and error sources that are new in each reading or configuration.

use nalgebra::{Cholesky, Matrix3, Vector3};

use super::{FirstOrder, Lever, by_shift, by_turn};
use crate::parameter::{ReadingSource, TransmissionError, counted_times};
use crate::robot::Load;

impl FirstOrder<'_> {
    /// The covariance of a deflection's reading (m^2), the instrument's noise among it.
    pub fn covariance(&self, load: &Load) -> Matrix3<f64> {
        Matrix3::identity() * self.noise_m2() + self.covariance_of_all(load)
    }

    /// The variance of each coordinate by the instrument alone (m^2), what repeats share as often as it is shared.
    fn noise_m2(&self) -> f64 {
        self.variance_m2 * counted_times(self.unloaded.shared_part(), self.repeats)
    }

    /// How many times the variance of a source counts.
    pub(super) fn times(&self, source: usize) -> f64 {
        let part = self.sources[source].shared_part(self.unloaded);
        counted_times(part, self.repeats)
    }

    /// What all sources add to the instrument's noise.
    pub fn covariance_of_all(&self, load: &Load) -> Matrix3<f64> {
        let sources = 0..self.sources.len();
        sources.map(|source| self.covariance_of(source, load)).sum()
    }

    /// The covariance by one of the sources of two deflections of this configuration under these loads (m^2), the one's rows
    /// by the other's columns: what of it all deflections of one configuration share.
    pub fn covariance_between(&self, source: usize, [one, other]: [&Load; 2]) -> Matrix3<f64> {
        if let ReadingSource::TransmissionError(TransmissionError { deviations, .. }) =
            &self.sources[source]
        {
            let seen = |joint: usize, load: &Load| {
                self.of_motion(joint, &self.joints[joint], load) * deviations[joint]
            };
            return (0..deviations.len())
                .map(|joint| seen(joint, one) * seen(joint, other).transpose())
                .sum();
        }
        let part = self.sources[source].shared_part(self.unloaded);
        if part > 0.0 {
            // No load decides on any other.
            self.covariance_of_one(source, one) * part
        } else {
            Matrix3::zeros()
        }
    }

    /// The same by all sources.
    pub fn covariance_shared(&self, loads: [&Load; 2]) -> Matrix3<f64> {
        let sources = 0..self.sources.len();
        sources
            .map(|source| self.covariance_between(source, loads))
            .sum()
    }

    /// What one of the sources adds to it.
    pub fn covariance_of(&self, source: usize, load: &Load) -> Matrix3<f64> {
        self.covariance_of_one(source, load) * self.times(source)
    }

    /// What one of the sources adds to a reading, whatever is repeated.
    pub fn covariance_of_one(&self, source: usize, load: &Load) -> Matrix3<f64> {
        match &self.sources[source] {
            ReadingSource::JointRepeatability(deviations) => (self.joints.iter().zip(deviations))
                .map(|(joint, deviation)| {
                    let moved = joint.position * *deviation;
                    moved * moved.transpose()
                })
                .sum(),
            ReadingSource::LoadDirection(_) | ReadingSource::LoadPoint(_) => {
                let (form, deviation) = self.load_form(source, load);
                form * form.transpose() * (deviation * deviation)
            }
            ReadingSource::TransmissionError(TransmissionError { deviations, .. }) => {
                (self.joints.iter().zip(deviations))
                    .enumerate()
                    .map(|(joint, (lever, deviation))| {
                        let seen = self.of_motion(joint, lever, load) * *deviation;
                        seen * seen.transpose()
                    })
                    .sum()
            }
            other => {
                let own = other.covariance_of_positions(&self.tool_position);
                own.unwrap_or_else(Matrix3::zeros)
            }
        }
    }

    /// For what changes the load by a small vector: how the deflection follows it, and its deviation.
    pub(super) fn load_form(&self, source: usize, load: &Load) -> (Matrix3<f64>, f64) {
        let form = |source: &dyn Fn(&Lever) -> Vector3<f64>| -> Matrix3<f64> {
            (self.joints.iter().zip(self.compliance))
                .map(|(joint, k)| joint.position * (source(joint) * *k).transpose())
                .sum()
        };
        match &self.sources[source] {
            ReadingSource::LoadDirection(deviation) => {
                (form(&|each| by_turn(each, load)), *deviation)
            }
            ReadingSource::LoadPoint(deviation) => (form(&|each| by_shift(each, load)), *deviation),
            _ => (Matrix3::zeros(), 0.0),
        }
    }

    /// L^-1 for the reading's covariance L L^T (1/m).
    pub(super) fn whitener(&self, load: &Load) -> Matrix3<f64> {
        if self.sources.is_empty() {
            return Matrix3::identity() * self.noise_m2().sqrt().recip();
        }
        (Cholesky::new(self.covariance(load)))
            .and_then(|factor| factor.l().try_inverse())
            .unwrap_or_else(|| Matrix3::identity() * self.noise_m2().sqrt().recip())
    }
}
