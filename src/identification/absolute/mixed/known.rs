//! Variance components that are known before, and those that are estimated for plans.

use nalgebra::DMatrix;

use super::super::Discrepancy;
use super::super::joint_errors::{DiscrepancyModel, JointError};
use super::{FOUND, LEAST, MixedModel, MixedVariances, ROUNDS};
use crate::numeric::ornstein_uhlenbeck::{OrnsteinUhlenbeck, knots_among};
use crate::observation::Observation;
use crate::parameter::JointFunction;

/// The knots of no more visits are all their angles: then nothing is lost between knots.
const EXACT: usize = 120;
/// Knots in planning are so many correlation lengths apart, unless they would be more than so many a joint.
const APART: f64 = 0.5;
const MOST_PLANNED: u32 = 120;
/// Where components are estimated for plans, each joint has so many knots at most.
const FINE_KNOTS: usize = 128;
/// Angles that are nearer to each other (rad) are one.
const SAME_RAD: f64 = 1e-6;

/// Joint error functions and what is new at each visit, as the planner's model or an earlier fit has them.
#[derive(Debug, Clone, PartialEq)]
pub struct VarianceComponents {
    /// The functions, of each joint one at most, in the joints' order.
    pub functions: Vec<JointFunction>,
    /// The standard deviations of each coordinate of what is new at each visit: of positions (m) and of rotations (rad).
    pub rest: [f64; 2],
}

impl VarianceComponents {
    /// The joints that have functions.
    pub fn joints(&self) -> Vec<usize> {
        self.functions.iter().map(|each| each.joint).collect()
    }

    /// What is new at each visit.
    pub const fn discrepancy(&self) -> Discrepancy {
        let [position_m, rotation_rad] = self.rest;
        Discrepancy {
            position_m,
            rotation_rad,
        }
    }

    /// A model before any reading, of so many parameters of which nothing is known: functions at knots half a correlation length apart among
    /// the angles of readings, or further where that would be many.
    pub(in super::super) fn unfitted(
        &self,
        observations: &[Observation],
        parameters: usize,
    ) -> DiscrepancyModel {
        let of_function = |function: &JointFunction| {
            let angles = observations
                .iter()
                .map(|each| each.setup.commanded_rad[function.joint]);
            let angles: Vec<f64> = angles.collect();
            let low = angles.iter().copied().fold(f64::INFINITY, f64::min);
            let high = angles.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let apart = APART * function.correlation_rad;
            let count = (2..MOST_PLANNED)
                .find(|count| high - low <= apart * f64::from(count - 1))
                .unwrap_or(MOST_PLANNED);
            let knots = knots_among(&angles, count as usize);
            JointError {
                joint: function.joint,
                values: vec![0.0; knots.len()],
                process: OrnsteinUhlenbeck {
                    knots,
                    length: function.correlation_rad,
                },
                deviation: function.deviation_rad,
                spread: [Vec::new(), Vec::new()],
            }
        };
        DiscrepancyModel {
            joints: self.functions.iter().map(of_function).collect(),
            ..DiscrepancyModel::plain(DMatrix::zeros(parameters, parameters), self.discrepancy())
        }
    }
}

impl MixedModel {
    /// The likeliest variance components, with more knots than a fit has: what lies between knots looks independent from visit to visit, and
    /// functions smaller than they are. Of joints that turn.
    pub fn components(&self, turns: &[bool]) -> Option<VarianceComponents> {
        let (mut variances, _) = self.likeliest()?;
        let mut fine = self.clone();
        fine.most_knots = FINE_KNOTS;
        for (process, fine) in variances.process.iter_mut().zip(fine.first().process) {
            process.knots = fine.knots;
        }
        for _ in 0..ROUNDS {
            let solved = fine.solved(&variances)?;
            let next = fine.improved(&variances, &solved)?.next;
            let change = next.change_from(&variances);
            variances = next;
            if change < FOUND {
                break;
            }
        }
        let joints = self.joints.iter().zip(turns).enumerate();
        let functions = joints.filter(|(_, (_, turns))| **turns);
        Some(VarianceComponents {
            functions: functions
                .map(|(place, (&joint, _))| JointFunction {
                    joint,
                    deviation_rad: variances.all[2 + place].sqrt(),
                    correlation_rad: variances.process[place].length,
                })
                .collect(),
            rest: [0, 1].map(|part| (variances.all[part] + self.within[part]).sqrt()),
        })
    }

    /// What the readings say with these variance components; the model's joints are those that have functions. None where the numbers have
    /// no factorisation.
    pub fn with_known(&self, known: &VarianceComponents) -> Option<DiscrepancyModel> {
        let process = |(place, function): (usize, &JointFunction)| {
            let mut angles: Vec<f64> = self.visits.iter().map(|each| each.angles[place]).collect();
            angles.sort_by(f64::total_cmp);
            angles.dedup_by(|one, other| *one - *other < SAME_RAD);
            OrnsteinUhlenbeck {
                knots: if angles.len() <= EXACT {
                    angles
                } else {
                    knots_among(&angles, self.most_knots)
                },
                length: function.correlation_rad,
            }
        };
        let functions = known.functions.iter();
        let rest = known.rest.iter().map(|each| (each * each).max(LEAST));
        let variances = MixedVariances {
            all: rest
                .chain(functions.map(|each| each.deviation_rad.powi(2)))
                .collect(),
            process: known.functions.iter().enumerate().map(process).collect(),
        };
        let solved = self.solved(&variances)?;
        Some(self.model(&variances, &solved))
    }
}
