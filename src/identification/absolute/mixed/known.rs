//! Variance components that are known before.

use nalgebra::{DMatrix, DVector};

use super::super::joint_errors::DiscrepancyModel;
use super::{LEAST, MixedModel, MixedVariances};
use crate::numeric::markov::{MarkovProcess, knots_among};
use crate::parameter::JointFunction;

/// The knots of no more visits are all their angles: then nothing is lost between knots.
const EXACT: usize = 120;
/// Of more visits, too, as long as all joints have no more states together.
const MOST_STATES: usize = 1500;
/// Improvements of what is new beside known functions, and the change of a deviation with which it is found.
const REMAINDER_ROUNDS: usize = 60;
const REMAINDER_FOUND: f64 = 2e-3;
/// Angles that are nearer to each other (rad) are one.
const SAME_RAD: f64 = 1e-6;

/// Joint error functions and what is new at each visit, as the planner's model or an earlier fit has them.
#[derive(Debug, Clone, PartialEq)]
pub struct VarianceComponents {
    /// The functions, of each joint one at most, in the joints' order.
    pub functions: Vec<JointFunction>,
    /// The standard deviations of each coordinate of what is new at each visit, or at each pose where poses were visited again: of
    /// positions (m) and of rotations (rad).
    pub rest: [f64; 2],
}

/// How well variance components are known from readings.
#[derive(Debug, Clone, PartialEq)]
pub struct ComponentIntervals {
    /// Intervals of 95 % of each function's standard deviation (rad; m where it slides), in the joints' order; none at the edge of what
    /// is looked for.
    pub deviations: Vec<Option<[f64; 2]>>,
    /// Of its length (rad; m).
    pub lengths: Vec<Option<[f64; 2]>>,
    /// Of how the joint returns (rad; m).
    pub repeatabilities: Vec<Option<[f64; 2]>>,
    /// Of positions' part of [`VarianceComponents::rest`] (m).
    pub rest_of_positions: Option<[f64; 2]>,
}

impl VarianceComponents {
    /// How one standard deviation of each joint's return at a visit moves the rows of a reading (r x f), which joints move so.
    pub fn returns(&self, joints: &DMatrix<f64>) -> DMatrix<f64> {
        let deviations = self.functions.iter().map(|each| each.repeatability_rad);
        let deviations = DVector::from_iterator(self.functions.len(), deviations);
        joints * DMatrix::from_diagonal(&deviations)
    }

    /// The joints that have functions.
    pub fn joints(&self) -> Vec<usize> {
        self.functions.iter().map(|each| each.joint).collect()
    }
}

impl MixedModel {
    /// What the readings say with these variance components; the model's joints are those that have functions. None where the numbers have
    /// no factorisation.
    pub fn with_known(&self, known: &VarianceComponents) -> Option<DiscrepancyModel> {
        Some(self.model(&self.solved(self.known_variances(known))?))
    }

    /// The same where what is new at visits and at configurations is as the readings show it, and no smaller than is said; with the degrees
    /// of freedom of that, infinite where it is as said.
    pub fn with_remainder(&self, known: &VarianceComponents) -> Option<(DiscrepancyModel, f64)> {
        let mut variances = self.known_variances(known);
        let said = [variances.all[0], variances.all[1]];
        let mut places = vec![0, 1];
        if self.visits.iter().any(|visit| visit.is_visited_again()) {
            let first = 2 + known.functions.len();
            variances.all.splice(first..first, said);
            variances.all[..2].fill(LEAST);
            variances.of_poses = Some(first);
            places.extend([first, first + 1]);
        }
        // The mean variance of the readings' own errors of positions (m^2).
        let each = self.visits.iter().flat_map(|visit| {
            let rows = visit.coordinates.iter().enumerate();
            rows.filter(|(_, coordinate)| **coordinate < 3)
                .map(|(row, _)| visit.own[(row, row)])
        });
        let (sum, count) = each.fold((0.0, 0), |(sum, count), own| (sum + own, count + 1));
        let own = sum / f64::from(count.max(1));
        let least = variances.clone();
        for &place in &places {
            // Of rotations the readings' own errors are small numbers, too.
            variances.all[place] = least.all[place].max(own);
        }
        let limit = |next: &mut MixedVariances| {
            let found = std::mem::replace(next, least.clone());
            for &place in &places {
                next.all[place] = found.all[place].max(least.all[place]);
            }
        };
        let (solved, numbers) =
            self.settled(variances, limit, REMAINDER_ROUNDS, REMAINDER_FOUND)?;
        let told: f64 = (places.iter().step_by(2))
            .map(|&place| numbers[place])
            .sum();
        let found = solved.variances.of_unread(0);
        let is_said = found <= 1.01 * said[0] && said[0] > LEAST;
        let degrees = if is_said {
            f64::INFINITY
        } else {
            (told * (found + own) / found).max(1.0)
        };
        Some((self.model(&solved), degrees))
    }

    fn known_variances(&self, known: &VarianceComponents) -> MixedVariances {
        let process = |(place, function): (usize, &JointFunction)| {
            let most = MOST_STATES / (function.kernel.order() * known.functions.len());
            let mut angles = self.angles(place);
            angles.sort_by(f64::total_cmp);
            angles.dedup_by(|one, other| *one - *other < SAME_RAD);
            if angles.len() > EXACT.max(most) {
                angles = knots_among(&angles, most);
            }
            MarkovProcess {
                knots: self.distinct(place, angles),
                kernel: function.kernel.again(self.period(place)),
            }
        };
        let functions = known.functions.iter();
        let rest = known.rest.iter().map(|each| (each * each).max(LEAST));
        MixedVariances {
            all: rest
                .chain(functions.clone().map(|each| each.deviation_rad.powi(2)))
                .chain(functions.map(|each| each.repeatability_rad.powi(2)))
                .collect(),
            of_poses: None,
            process: known.functions.iter().enumerate().map(process).collect(),
        }
    }
}
