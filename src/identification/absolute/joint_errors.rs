//! What a model leaves, as a model of its own: each joint is off by an unknown function of its own angle, and what that does not
//! explain is new at each configuration.
//!
//! ```text
//! y = h(x) + sum_j J_j e_j(q_j) + m + noise
//! cov(e_j(q), e_j(q')) = s_j^2 exp(-|q - q'| / l_j)         new functions for each joint
//! cov(m) = diag(p^2, r^2)                                    new at each visit
//! ```
//!
//! Gears, encoders and bearings make such errors; so do, over a part of joint space, effects that no parameter has. Readings
//! at like angles of one joint share its error, however far apart they are else: that is what makes neighbours alike, and
//! intervals from independent errors too small.

use nalgebra::{Cholesky, DMatrix, DVector, Matrix6, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::super::FitError;
use super::super::spread::logarithm;
use super::rows::LinearReading;
use super::{AbsoluteCase, Discrepancy, ReadingResidual};
use crate::numeric::ornstein_uhlenbeck::OrnsteinUhlenbeck;
use crate::numeric::tolerance::CHI_SQUARE_95;
use crate::parameter::{Axis, ElasticArm, ParameterKind, ParameterSet};

/// The square that 95 % of normal errors of three coordinates stay below, over their variance.
pub const SQUARE_95: f64 = CHI_SQUARE_95[2];

/// Stations that stand as far off with a smaller probability were moved.
const MOVED: f64 = 1e-6;

/// Commands are corrected so often: each time what is left is smaller by the error's slope.
const CORRECTIONS: usize = 8;

/// What one joint is off by.
#[derive(Debug, Clone, PartialEq)]
pub struct JointError {
    /// The joint.
    pub joint: usize,
    /// How its error wanders over its angle.
    pub process: OrnsteinUhlenbeck,
    /// Its standard deviation (rad; m where it slides).
    pub deviation: f64,
    /// Its values at the knots: the joint stands by so much further than commanded.
    pub values: Vec<f64>,
    /// How much larger or smaller all errors of positions and of rotations are at its angles: coefficients of Legendre polynomials
    /// P_k / k from the first order, from the first knot to the last, whose sum is the logarithm of a factor of their squares.
    pub spread: [Vec<f64>; 2],
}

impl JointError {
    /// By how much further than commanded the joint stands there (rad; m where it slides).
    pub fn at(&self, commanded: f64) -> f64 {
        let between = self.process.between(commanded);
        let each = between.knots.into_iter().zip(between.weights);
        each.map(|(knot, weight)| weight * self.values[knot]).sum()
    }

    /// The logarithm of the factor by which squares of errors of positions (0) or rotations (1) are larger there.
    pub(super) fn spread_at(&self, part: usize, commanded: f64) -> f64 {
        logarithm(&self.spread[part], commanded, self.process.range())
    }

    /// The command with which the joint stands there.
    pub fn command_for(&self, wanted: f64) -> f64 {
        let mut commanded = wanted;
        for _ in 0..CORRECTIONS {
            commanded = wanted - self.at(commanded);
        }
        commanded
    }
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
    /// What joints do not explain.
    pub rest: Discrepancy,
    /// By how much larger than computed the squares of errors are that were seen where visits were
    /// predicted by a fit to the others: of positions and of rotations, where joints do not say that they are larger or smaller. Regions are
    /// larger by the root.
    pub scale: [f64; 2],
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

/// How far the base of a station stands from where it was identified.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MovedStation {
    /// Along its own axes (m).
    pub position_m: Vector3<f64>,
    /// About them (rad).
    pub rotation_rad: Vector3<f64>,
    /// The probability of so much if nobody moved it.
    pub probability: f64,
    /// How far that moves what was read, rms (m).
    pub readings_m: f64,
    /// The standard deviation of what the model leaves new in each coordinate of a reading (m): less is no sign of anything.
    pub discrepancy_m: f64,
}

impl MovedStation {
    /// Whether somebody moved it: by more than chance and what the model leaves do.
    pub fn is_moved(&self) -> bool {
        self.probability < MOVED && self.readings_m > self.discrepancy_m
    }
}

/// One reading: what is left, what it depends on of all that is known, and what is new in it.
pub(super) struct LocalRows {
    pub index: Vec<usize>,
    pub matrix: DMatrix<f64>,
    pub left: DVector<f64>,
    pub new: DMatrix<f64>,
}

impl DiscrepancyModel {
    /// Only parameters with their covariance, and what is new in each reading.
    pub fn plain(covariance: DMatrix<f64>, rest: Discrepancy) -> Self {
        Self {
            joints: Vec::new(),
            shift: DVector::zeros(covariance.nrows()),
            covariance,
            rest,
            scale: [1.0; 2],
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

    /// What one reading's rows leave, and what moves that. `places` says which of the parameters (p) each column belongs to.
    pub(super) fn local(&self, rows: &LinearReading, places: &[usize], q: &[f64]) -> LocalRows {
        let offsets = self.offsets();
        let (mut index, mut columns) = (places.to_vec(), Vec::new());
        columns.extend(rows.columns.column_iter().map(nalgebra::Matrix::into_owned));
        let mut left = rows.residual.clone();
        let mut new = rows.own.clone();
        for (column, &place) in columns.iter().zip(places) {
            left.axpy(-self.shift[place], column, 1.0);
        }
        for (number, joint) in self.joints.iter().enumerate() {
            let moved = rows.joints.column(number).into_owned();
            let between = joint.process.between(q[joint.joint]);
            for (knot, weight) in between.knots.into_iter().zip(between.weights) {
                left.axpy(-weight * joint.values[knot], &moved, 1.0);
                index.push(offsets[number] + knot);
                columns.push(&moved * weight);
            }
            let variance = joint.deviation.powi(2) * between.spare;
            new.ger(variance, &moved, &moved, 1.0);
        }
        let rest = self.rest.covariance();
        for row in 0..left.len() {
            new[(row, row)] += rest[(row, row)];
        }
        let mut matrix = DMatrix::zeros(left.len(), columns.len());
        for (mut to, column) in matrix.column_iter_mut().zip(&columns) {
            to.copy_from(column);
        }
        LocalRows {
            index,
            matrix,
            left,
            new,
        }
    }

    /// What one reading's rows leave, and the covariance of that.
    pub(super) fn prognosis(
        &self,
        rows: &LinearReading,
        places: &[usize],
        q: &[f64],
    ) -> (DVector<f64>, DMatrix<f64>) {
        let LocalRows {
            index,
            matrix,
            left,
            new,
        } = self.local(rows, places, q);
        let among = DMatrix::from_fn(index.len(), index.len(), |row, column| {
            self.covariance[(index[row], index[column])]
        });
        (left, new + &matrix * among * matrix.transpose())
    }

    /// By how much larger than computed squares of errors of positions (0) or rotations (1) are at commanded angles.
    fn scale_at(&self, part: usize, q: &[f64]) -> f64 {
        let joints = self.joints.iter();
        let logarithm: f64 = joints.map(|each| each.spread_at(part, q[each.joint])).sum();
        self.scale[part] * logarithm.exp()
    }

    /// A residual at commanded angles with its covariance, beside the regions of 95 %.
    pub(super) fn judged(
        &self,
        residual: &DVector<f64>,
        covariance: &DMatrix<f64>,
        q: &[f64],
    ) -> ReadingPrognosis {
        let part = |first: usize| -> Option<Vector3<f64>> {
            (residual.len() > first).then(|| residual.fixed_rows::<3>(first).into_owned())
        };
        let is_within = [0, 1].map(|part| {
            let square = region_square(residual, covariance, 3 * part)?;
            Some(square <= SQUARE_95 * self.scale_at(part, q))
        });
        ReadingPrognosis {
            left: ReadingResidual {
                position_m: part(0).unwrap_or_else(Vector3::zeros),
                rotation_rad: part(3),
            },
            covariance: Matrix6::from_fn(|row, column| {
                if row.max(column) < residual.len() {
                    covariance[(row, column)]
                } else {
                    0.0
                }
            }),
            is_within,
        }
    }
}

/// The square of three rows of a residual over their covariance; none where there are no such rows.
pub(super) fn region_square(
    residual: &DVector<f64>,
    covariance: &DMatrix<f64>,
    first: usize,
) -> Option<f64> {
    if residual.len() <= first {
        return None;
    }
    let part = residual.fixed_rows::<3>(first).into_owned();
    let own = covariance.fixed_view::<3, 3>(first, first).into_owned();
    Some(part.dot(&own.cholesky()?.solve(&part)))
}

impl AbsoluteCase<'_> {
    /// These readings beside what an arm with a discrepancy's model predicts for them. `set` are those of the model's
    /// parameters that the readings depend on, at their `places` among the model's, and counted from the arm itself. Frames of
    /// which `anew` has the parameters take the values that suit these readings best.
    ///
    /// # Errors
    /// The arm has no equilibrium for a reading.
    pub fn prognoses(
        &self,
        arm: &ElasticArm,
        set: &ParameterSet,
        places: &[usize],
        discrepancy: &DiscrepancyModel,
        anew: &ParameterSet,
    ) -> Result<Vec<ReadingPrognosis>, FitError> {
        let joints: Vec<usize> = discrepancy.joints.iter().map(|each| each.joint).collect();
        let rows = self.rows_at(arm, set, set.prior().mean.as_slice(), &joints)?;
        let readings = rows.iter().zip(&self.observations);
        let mut found: Vec<(DVector<f64>, DMatrix<f64>)> = readings
            .map(|(rows, each)| {
                discrepancy.prognosis(rows, places, each.setup.commanded_rad.as_slice())
            })
            .collect();
        if !anew.is_empty() {
            let frames = self.rows_at(arm, anew, anew.prior().mean.as_slice(), &[])?;
            let mut information = DMatrix::zeros(anew.len(), anew.len());
            let mut gradient = DVector::zeros(anew.len());
            for (rows, (left, covariance)) in frames.iter().zip(&found) {
                let Some(factor) = Cholesky::new(covariance.clone()) else {
                    continue;
                };
                let weighed = factor.solve(&rows.columns);
                information += weighed.tr_mul(&rows.columns);
                gradient += weighed.tr_mul(left);
            }
            if let Some(factor) = Cholesky::new(information) {
                let change = factor.solve(&gradient);
                for (rows, (left, _)) in frames.iter().zip(&mut found) {
                    *left -= &rows.columns * &change;
                }
            }
        }
        let readings = found.iter().zip(&self.observations);
        Ok(readings
            .map(|((left, covariance), each)| {
                discrepancy.judged(left, covariance, each.setup.commanded_rad.as_slice())
            })
            .collect())
    }

    /// How far the base of a station stands from where it was identified, as these readings have it: position (m) and rotation
    /// (rad) along and about its own axes, and the probability of that if nobody moved it. `set`, `places` and `discrepancy` as in
    /// [`prognoses`](Self::prognoses).
    ///
    /// # Errors
    /// The arm has no equilibrium for a reading.
    pub fn moved_station(
        &self,
        arm: &ElasticArm,
        set: &ParameterSet,
        places: &[usize],
        discrepancy: &DiscrepancyModel,
        station: usize,
    ) -> Result<Option<MovedStation>, FitError> {
        let joints: Vec<usize> = discrepancy.joints.iter().map(|each| each.joint).collect();
        let rows = self.rows_at(arm, set, set.prior().mean.as_slice(), &joints)?;
        let position = Axis::ALL.map(|axis| (ParameterKind::BasePosition { station, axis }, None));
        let rotation = Axis::ALL.map(|axis| (ParameterKind::BaseRotation { station, axis }, None));
        let Ok(base) = ParameterSet::new(arm, position.into_iter().chain(rotation)) else {
            return Ok(None);
        };
        let frames = self.rows_at(arm, &base, base.prior().mean.as_slice(), &[])?;
        let size = discrepancy.covariance.nrows();
        // Sums over readings, weighed by what is new in each: of the frame, of all that is known, of both.
        let mut of_frame = DMatrix::zeros(6, 6);
        let mut of_known = DMatrix::zeros(size, size);
        let mut of_both = DMatrix::zeros(size, 6);
        let (mut pull, mut known_pull) = (DVector::zeros(6), DVector::zeros(size));
        let (mut read, mut average) = (Vec::new(), 0.0);
        let all = rows.iter().zip(&frames).zip(&self.observations).enumerate();
        for (index, ((rows, frame), each)) in all {
            if each.setup.station != station {
                continue;
            }
            let q = each.setup.commanded_rad.as_slice();
            let local = discrepancy.local(rows, places, q);
            let new = local.new.diagonal().rows(0, 3).sum();
            let Some(factor) = Cholesky::new(local.new) else {
                continue;
            };
            read.push(index);
            average += new;
            let weighed = factor.solve(&frame.columns);
            of_frame += weighed.tr_mul(&frame.columns);
            pull += weighed.tr_mul(&local.left);
            let own = factor.solve(&local.matrix);
            let among = own.tr_mul(&local.matrix);
            let beside = own.tr_mul(&frame.columns);
            let moved = own.tr_mul(&local.left);
            for (row, &to) in local.index.iter().enumerate() {
                known_pull[to] += moved[row];
                for column in 0..6 {
                    of_both[(to, column)] += beside[(row, column)];
                }
                for (column, &from) in local.index.iter().enumerate() {
                    of_known[(to, from)] += among[(row, column)];
                }
            }
        }
        // (R + A C A^T)^-1 = R^-1 - R^-1 A C (1 + A^T R^-1 A C)^-1 A^T R^-1, where C may be singular.
        let mixed = DMatrix::identity(size, size) + &of_known * &discrepancy.covariance;
        let Some(solved) = mixed.lu().solve(&DMatrix::from_fn(size, 7, |row, column| {
            if column < 6 {
                of_both[(row, column)]
            } else {
                known_pull[row]
            }
        })) else {
            return Ok(None);
        };
        let through = of_both.tr_mul(&(&discrepancy.covariance * solved));
        of_frame -= through.columns(0, 6);
        pull -= through.column(6);
        let size = of_frame.diagonal().map(|each| each.max(0.0).sqrt().recip());
        let relative = DMatrix::from_fn(6, 6, |row, column| {
            of_frame[(row, column)] * size[row] * size[column]
        });
        let Some(factor) = Cholesky::new(relative) else {
            return Ok(None);
        };
        let change = factor
            .solve(&pull.component_mul(&size))
            .component_mul(&size);
        let of_station = read.len().max(1) as f64;
        let displaced: f64 = (read.iter())
            .map(|&index| (frames[index].columns.rows(0, 3) * &change).norm_squared())
            .sum();
        let square = change.dot(&pull) / f64::max(discrepancy.scale[0], 1.0);
        let Ok(distribution) = ChiSquared::new(6.0) else {
            return Ok(None);
        };
        Ok(Some(MovedStation {
            position_m: change.fixed_rows::<3>(0).into_owned(),
            rotation_rad: change.fixed_rows::<3>(3).into_owned(),
            probability: distribution.sf(square),
            readings_m: (displaced / of_station).sqrt(),
            discrepancy_m: (average / (3.0 * of_station)).sqrt(),
        }))
    }
}
