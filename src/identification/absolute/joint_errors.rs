//! What a model leaves, as a model of its own: each joint is off by an unknown function of its own angle, and what that does not
//! explain is new at each configuration.
//!
//! ```text
//! y = h(x) + sum_j J_j (e_j(q_j) + r_j) + m + noise
//! cov(e_j(q), e_j(q')) = s_j^2 k(|q - q'| / l_j)            new functions for each joint; k exponential or Matern 3/2
//! var(r_j), cov(m) = diag(p^2, r^2)                          new at each visit
//! ```
//!
//! Gears, encoders and bearings make such errors; so do, over a part of joint space, effects that no parameter has. Readings
//! at like angles of one joint share its error, however far apart they are else: that is what makes neighbours alike, and
//! intervals from independent errors too small.

use nalgebra::{DMatrix, DVector, Matrix6, Matrix6xX};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::FisherSnedecor;

use super::super::discrepancy::six_rows;
use super::super::outliers::far_square;
use super::super::spread::logarithm;
use super::residuals::{LinearReading, with_joints};
use super::{FitResult, ReadingResidual};
use crate::numeric::markov::{Between, MarkovProcess};
use crate::numeric::quantile::exceeded_with;
use crate::numeric::tolerance::CHI_SQUARE_95;
use crate::observation::{ObservationModel, ReadingKind, Setup};
use crate::parameter::{ElasticArm, ParameterSet};
use crate::robot::nearest_turn;

/// The square that 95 % of normal errors of three coordinates stay below, over their variance.
pub const SQUARE_95: f64 = CHI_SQUARE_95[2];

/// What one joint is off by, as a function of its own angle (rad; m where it slides).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct JointError {
    /// The joint; records have its name.
    #[serde(skip)]
    pub joint: usize,
    /// The middle of the turn (rad) in which its angle counts, where it turns further: its error comes again in each turn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turn_about: Option<f64>,
    /// How its error wanders over its angle.
    #[serde(flatten)]
    pub process: MarkovProcess,
    /// Its standard deviation (rad; m where it slides).
    pub deviation: f64,
    /// How well it returns: the standard deviation of what is new at each visit (rad; m).
    #[serde(default)]
    pub repeatability: f64,
    /// By how much further than commanded the joint stands at the knots (rad; m); of a smooth error at each knot that, and its slope times
    /// the length.
    pub values: Vec<f64>,
    /// How much larger or smaller all errors of positions are at its angles: coefficients of Legendre polynomials P_k / k from the
    /// first order, from the first knot to the last, whose sum is the logarithm of a factor of their squares.
    #[serde(default)]
    pub spread_of_positions: Vec<f64>,
    /// The same of rotations.
    #[serde(default)]
    pub spread_of_rotations: Vec<f64>,
}

impl JointError {
    /// By how much further than commanded the joint stands at the knots (rad; m where it slides).
    pub fn at_knots(&self) -> impl Iterator<Item = f64> {
        let order = self.process.kernel.order();
        self.values.iter().copied().step_by(order)
    }

    /// Where among the knots the joint is commanded.
    fn angle(&self, q: &[f64]) -> f64 {
        nearest_turn(q[self.joint], self.turn_about)
    }

    /// By how much further than commanded the joint stands at a configuration (rad; m where it slides).
    pub fn at(&self, q: &[f64]) -> f64 {
        let between = self.process.between(self.angle(q));
        (between.terms())
            .map(|(state, weight)| weight * self.values[state])
            .sum()
    }
}

/// A reading beside its prediction.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadingPrognosis {
    /// Read less predicted, with what joints are off by.
    pub left: ReadingResidual,
    /// The covariance of that: of what was fitted, of what is unexplained, of the reading (m^2, m rad, rad^2).
    pub covariance: Matrix6<f64>,
    /// Whether position and rotation lie in their regions of 95 %.
    pub is_within: [Option<bool>; 2],
}

/// What readings leave unexplained by parameters, for predictions elsewhere.
#[derive(Debug, Clone, PartialEq)]
pub struct DiscrepancyModel {
    /// What joints are off by; nothing where that was not asked.
    pub joints: Vec<JointError>,
    /// By how much the parameters (p, in their units) are off together with these.
    pub shift: DVector<f64>,
    /// The covariance of the parameters and of the joints' values at their knots, one joint after the other.
    pub covariance: DMatrix<f64>,
    /// What joints do not explain: standard deviations of each coordinate of positions (m) and rotations (rad).
    pub rest: [f64; 2],
    /// By how much larger than computed the squares of errors are that were seen where visits were
    /// predicted by a fit to the others: of positions and of rotations, where joints do not say that they are larger or smaller. Regions are
    /// larger by the root.
    pub scale: [f64; 2],
    /// By how much larger than computed they are in the mean.
    pub mean_scale: [f64; 2],
}

/// The error of a place that an identified arm predicts.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaceError {
    /// How the place (m) follows the parameters (3 x p).
    pub rows: DMatrix<f64>,
    /// The mean square (m^2) by what was identified: what returns to the place have on average.
    pub identified_m2: f64,
    /// The mean square (m^2) by what is new at a visit besides: the model discrepancy, and how well joints come back where that was
    /// identified.
    pub new_m2: f64,
}

/// One reading: what is left, what it depends on of all that is known, and what is new in it.
pub(super) struct LocalRows {
    pub index: Vec<usize>,
    pub matrix: DMatrix<f64>,
    pub left: DVector<f64>,
    pub new: DMatrix<f64>,
}

/// What parameters leave of readings, told apart.
#[derive(Debug, Clone, PartialEq)]
pub struct Unexplained {
    /// Errors of joints and what is new at each visit, to predict with.
    pub model: DiscrepancyModel,
    /// The covariance of the parameters (p x p), if that is what they leave.
    pub covariance: DMatrix<f64>,
    /// The degrees of freedom of each parameter's variance.
    pub degrees: Vec<f64>,
    /// What is left of each reading that was not rejected beside the parameters and the joints' errors.
    pub left: Vec<ReadingResidual>,
    /// Visits.
    pub visits: usize,
    /// As many with errors of their own would tell as much of the parameters.
    pub effective_sample_size: f64,
    /// The shares of positions and of rotations that lie in their regions of 95 % as computed, each predicted by a fit to other
    /// stands.
    pub predicted_by_others: [Option<f64>; 2],
}

impl DiscrepancyModel {
    /// Only parameters with their covariance, and what is new in each reading.
    pub fn plain(covariance: DMatrix<f64>, rest: [f64; 2]) -> Self {
        Self {
            joints: Vec::new(),
            shift: DVector::zeros(covariance.nrows()),
            covariance,
            rest,
            scale: [1.0; 2],
            mean_scale: [1.0; 2],
        }
    }

    /// The same where the variances were estimated with so many degrees of freedom: regions hold 95 % by Fisher's F.
    pub fn estimated(self, degrees: f64) -> Self {
        if !degrees.is_finite() {
            return self;
        }
        let fisher = FisherSnedecor::new(3.0, degrees).map(|law| 3.0 * exceeded_with(&law, 0.05));
        let scale = fisher.ok().filter(|square| square.is_finite());
        let scale = scale.map_or(1.0, |square| square / SQUARE_95);
        Self {
            scale: [scale; 2],
            ..self
        }
    }

    /// Parameters and knots before those of each joint, and all.
    pub(super) fn offsets(&self) -> Vec<usize> {
        let mut offsets = vec![self.shift.len()];
        for joint in &self.joints {
            offsets.push(offsets[offsets.len() - 1] + joint.values.len());
        }
        offsets
    }

    /// By how much further than commanded a joint of these, by its place, stands at an angle among its knots, with the standard error of that
    /// (rad; m where it slides).
    pub fn error_at(&self, place: usize, angle: f64) -> [f64; 2] {
        let (joint, first) = (&self.joints[place], self.offsets()[place]);
        let between = joint.process.between(angle);
        let terms = between.terms();
        let value = terms
            .clone()
            .map(|(state, weight)| weight * joint.values[state]);
        let pairs = terms
            .clone()
            .flat_map(|one| terms.clone().map(move |other| (one, other)));
        let known = pairs.map(|((row, one), (column, other))| {
            one * other * self.covariance[(first + row, first + column)]
        });
        let variance = known.sum::<f64>() + joint.deviation.powi(2) * between.spare;
        [value.sum(), variance.max(0.0).sqrt()]
    }

    /// Whether commanded angles are among those that were read of all joints with errors of their own.
    pub(super) fn reaches(&self, q: &[f64]) -> bool {
        (self.joints.iter()).all(|each| {
            let [low, high] = each.process.range();
            (low..=high).contains(&each.angle(q))
        })
    }

    /// What one reading's rows leave, and what moves that. `places` says which of the parameters (p) each column belongs to.
    pub(super) fn local(&self, rows: &LinearReading, places: &[usize], q: &[f64]) -> LocalRows {
        let offsets = self.offsets();
        let mut index = places.to_vec();
        let each = |joint: &JointError| joint.process.between(joint.angle(q));
        let between: Vec<Between> = self.joints.iter().map(each).collect();
        let columns = places.len() + between.iter().map(|each| each.terms().len()).sum::<usize>();
        let mut matrix = rows.columns.clone().resize_horizontally(columns, 0.0);
        let mut left = rows.residual.clone();
        let mut new = rows.own.clone();
        for (column, &place) in rows.columns.column_iter().zip(places) {
            left.axpy(-self.shift[place], &column, 1.0);
        }
        for (number, (joint, between)) in self.joints.iter().zip(between).enumerate() {
            let moved = rows.joints.column(number);
            for (state, weight) in between.terms() {
                left.axpy(-weight * joint.values[state], &moved, 1.0);
                matrix.column_mut(index.len()).copy_from(&(moved * weight));
                index.push(offsets[number] + state);
            }
            let variance = joint.deviation.powi(2) * between.spare + joint.repeatability.powi(2);
            new.ger(variance, &moved, &moved, 1.0);
        }
        for row in 0..left.len() {
            new[(row, row)] += self.rest[row / 3].powi(2);
        }
        LocalRows {
            index,
            matrix,
            left,
            new,
        }
    }

    /// The covariance of what one reading's rows leave.
    pub(super) fn covariance_of(&self, local: &LocalRows) -> DMatrix<f64> {
        &local.new + self.by_what_is_known(local)
    }

    /// The covariance that one reading's rows have by what was identified.
    fn by_what_is_known(&self, local: &LocalRows) -> DMatrix<f64> {
        let among = self.covariance.select_rows(&local.index);
        let among = among.select_columns(&local.index);
        &local.matrix * among * local.matrix.transpose()
    }

    /// By how much larger than on the whole squares of errors of positions (0) or rotations (1) are at commanded angles.
    fn relative_to_whole(&self, part: usize, q: &[f64]) -> f64 {
        self.relative_at(part, self.joints.iter().map(|each| each.angle(q)))
    }

    /// The same but for how large they are on the whole, at the angles of these joints.
    pub(super) fn relative_at(&self, part: usize, angles: impl Iterator<Item = f64>) -> f64 {
        let joints = self.joints.iter().zip(angles);
        let each = |(joint, angle): (&JointError, f64)| {
            let spread = [&joint.spread_of_positions, &joint.spread_of_rotations][part];
            logarithm(spread, angle, joint.process.range())
        };
        joints.map(each).sum::<f64>().exp()
    }

    /// A residual at commanded angles with its covariance, beside the regions of 95 %.
    pub(super) fn judged(
        &self,
        residual: &DVector<f64>,
        covariance: &DMatrix<f64>,
        q: &[f64],
    ) -> ReadingPrognosis {
        let is_within = [0, 1].map(|part| {
            let square = region_square(residual, covariance, 3 * part)?;
            Some(square <= SQUARE_95 * self.scale[part] * self.relative_to_whole(part, q))
        });
        ReadingPrognosis {
            left: ReadingResidual::of_rows(residual),
            covariance: six_rows(covariance),
            is_within,
        }
    }

    /// Whether a reading that was not fitted lies as far out of its prediction at commanded angles as no correct one does.
    pub(super) fn is_far_out(&self, local: &LocalRows, q: &[f64]) -> bool {
        let covariance = self.covariance_of(local);
        [0, 1].iter().any(|&part| {
            let square = region_square(&local.left, &covariance, 3 * part);
            let scale = self.scale[part] * self.relative_to_whole(part, q);
            square.is_some_and(|square| square > far_square(3, f64::INFINITY) * scale)
        })
    }

    /// Of a setup's target, in the frame of its station. `set` are those of the model's parameters that it depends on, at their `places`
    /// among the model's, and counted from the arm itself.
    ///
    /// # Errors
    /// The arm has no equilibrium there.
    pub fn place_error(
        &self,
        arm: &ElasticArm,
        set: &ParameterSet,
        places: &[usize],
        setup: &Setup,
    ) -> FitResult<PlaceError> {
        let joints: Vec<usize> = self.joints.iter().map(|each| each.joint).collect();
        let (all, zeros) = with_joints(set, arm, &joints);
        let mut by = Matrix6xX::zeros(all.len());
        let mean = all.prior().mean.as_slice();
        (ObservationModel::new(&all, arm, mean).predict(setup, ReadingKind::Position, &mut by))
            .map_err(|error| (0, error))?;
        all.under_loads_of_task(&mut by);
        let rows = LinearReading {
            residual: DVector::zeros(3),
            columns: by.view((0, 0), (3, set.len())).into_owned(),
            joints: by.rows(0, 3).select_columns(&zeros),
            own: DMatrix::zeros(3, 3),
        };
        let q = setup.commanded_rad.as_slice();
        let local = self.local(&rows, places, q);
        // What a function may be between knots is the robot's, too.
        let between = self.joints.iter().zip(rows.joints.column_iter());
        let between = between.map(|(joint, moved)| {
            let spare = joint.process.between(joint.angle(q)).spare;
            joint.deviation.powi(2) * spare * moved.norm_squared()
        });
        let between: f64 = between.sum();
        let known = self.by_what_is_known(&local).trace() + between;
        let scale = self.mean_scale[0] * self.relative_to_whole(0, q);
        Ok(PlaceError {
            rows: rows.columns,
            identified_m2: scale * known,
            new_m2: scale * (local.new.trace() - between),
        })
    }
}

/// The square of three rows of a residual, or of the one of a distance, over their covariance; none where there are no such rows. As if of
/// three: that of one row is as much larger as the square that 95 % stay below.
pub(super) fn region_square(
    residual: &DVector<f64>,
    covariance: &DMatrix<f64>,
    first: usize,
) -> Option<f64> {
    if residual.len() <= first {
        return None;
    }
    let rows = (residual.len() - first).min(3);
    let part = residual.rows(first, rows).into_owned();
    let own = (covariance.view((first, first), (rows, rows))).into_owned();
    let square = part.dot(&own.cholesky()?.solve(&part));
    Some(square * (SQUARE_95 / CHI_SQUARE_95[rows - 1]))
}
