//! Cross-validation: a fit without one block of readings, and its residuals in that block.

use nalgebra::{Cholesky, DMatrix, DVector, Matrix6xX};
use rayon::prelude::*;

use super::super::gauss_newton::{FitError, ParameterFit};
use super::blocks::ReadingPart;
use super::residuals::left_of;
use super::{AbsoluteCase, ReadingResidual};
use crate::numeric::estimable::Estimable;
use crate::observation::{Form, NormalEquations, ObservationModel, SharedErrors};
use crate::parameter::{ParameterSet, relative_precision};

/// Steps of fits that start at the fit to all readings.
const MAXIMUM_STEPS: usize = 6;
/// A first step that predicts the block's sum of squares as well as this is the fit.
const AS_PREDICTED: f64 = 1e-4;
/// A fit is found when the next step is shorter than this in standard errors.
const SHORT: f64 = 1e-2;
/// A direction that the other blocks do not determine matters to a reading that a typical size moves by so many of its
/// standard deviations.
const MATTERS: f64 = 0.1;

/// One block of readings beside a fit to all others.
pub(super) struct Without {
    /// The fit's values (p), in the parameters' units.
    pub values: DVector<f64>,
    /// Which readings of the block the others tell, in the block's order.
    pub is_told: Vec<bool>,
    /// What is left of the block's readings.
    pub left: Vec<ReadingResidual>,
}

/// Parameters with their fit to all readings.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fitted<'a> {
    pub set: &'a ParameterSet,
    pub fit: &'a ParameterFit,
}

impl Fitted<'_> {
    /// The values (p), in the parameters' units.
    pub fn values(&self) -> DVector<f64> {
        DVector::from_column_slice(&self.fit.posterior.mean)
    }

    /// The standard error of a parameter, in the unit of its value: by leaving out blocks, and no less than what the weights say.
    pub fn standard_error(&self, place: usize, without: &[Without]) -> Option<f64> {
        let own = self.fit.posterior.standard_error(place)?;
        let all = self.fit.posterior.mean[place];
        let squares = without
            .iter()
            .map(|each| (each.values[place] - all).powi(2));
        let count = without.len() as f64;
        let by_blocks = (squares.sum::<f64>() * (count - 1.0) / count).sqrt();
        Some(own.max(by_blocks))
    }
}

/// The blocks of a case with their complements.
pub(super) struct Blocks<'a> {
    pub case: &'a AbsoluteCase<'a>,
    pub shared: Option<&'a SharedErrors>,
    /// Each reading's block.
    pub of_readings: &'a [usize],
    pub parts: Vec<ReadingPart>,
}

impl<'a> Blocks<'a> {
    pub fn new(
        case: &'a AbsoluteCase<'a>,
        shared: Option<&'a SharedErrors>,
        of_readings: &'a [usize],
        count: usize,
    ) -> Self {
        let parts = (0..count)
            .map(|block| case.part(shared, |index| of_readings[index] == block))
            .collect();
        Self {
            case,
            shared,
            of_readings,
            parts,
        }
    }

    /// A fit without each of the blocks.
    pub fn without(&self, fitted: Fitted<'_>) -> Result<Vec<Without>, FitError> {
        let values = fitted.values();
        let equations: Result<Vec<_>, FitError> = (self.parts.par_iter())
            .map(|part| part.equations(fitted.set, &self.case.arm, &values))
            .collect();
        let equations = equations?;
        let mut all = DMatrix::zeros(fitted.set.len(), fitted.set.len());
        let mut gradient = DVector::zeros(fitted.set.len());
        for each in &equations {
            all += &each.information;
            gradient += &each.gradient;
        }
        (0..self.parts.len())
            .into_par_iter()
            .map(|block| {
                let own = &equations[block];
                let others = (&all - &own.information, &gradient - &own.gradient);
                self.without_block(fitted, block, own, others)
            })
            .collect()
    }

    fn without_block(
        &self,
        fitted: Fitted<'_>,
        block: usize,
        own: &NormalEquations,
        (information, gradient): (DMatrix<f64>, DVector<f64>),
    ) -> Result<Without, FitError> {
        let (case, part) = (self.case, &self.parts[block]);
        let set = fitted.set;
        let scales = set.scales();
        let start = fitted.values();
        let others = Others::new(fitted, &information);
        let (change, _) = others.step(&information, &gradient, &start)?;
        let mut values = &start + change.component_mul(&scales);
        let found = part.equations(set, &case.arm, &values)?.square;
        let predicted = own.square - 2.0 * change.dot(&own.gradient)
            + change.dot(&(&own.information * &change));
        if (found - predicted).abs() > AS_PREDICTED * found {
            let rest = case.part(self.shared, |index| self.of_readings[index] != block);
            for _ in 0..MAXIMUM_STEPS {
                let now = rest.equations(set, &case.arm, &values)?;
                let (change, length) = others.step(&now.information, &now.gradient, &values)?;
                if length < SHORT {
                    break;
                }
                values += change.component_mul(&scales);
            }
        }
        let arm = set.apply(&case.arm, values.as_slice());
        let left =
            left_of(&part.observations, &arm).map_err(|(index, source)| FitError::Equilibrium {
                observation: index + 1,
                source,
            })?;
        Ok(Without {
            is_told: told(part, set, case, &values, &others.hidden),
            values,
            left,
        })
    }
}

/// What all blocks but one determine, of what all determine.
struct Others {
    set: ParameterSet,
    prior: DMatrix<f64>,
    /// In typical sizes, p x r.
    basis: DMatrix<f64>,
    /// What they do not, p x f.
    hidden: DMatrix<f64>,
}

impl Others {
    fn new(fitted: Fitted<'_>, information: &DMatrix<f64>) -> Self {
        let prior = relative_precision(fitted.set);
        let all = fitted.fit.posterior.estimable.basis();
        let within = all.tr_mul(&(information + &prior)) * all;
        let estimable = Estimable::new(&within, &vec![1.0; all.ncols()]);
        Self {
            set: fitted.set.clone(),
            prior,
            basis: all * estimable.basis(),
            hidden: all * estimable.hidden(),
        }
    }

    /// A step in typical sizes (p), and its length in standard errors.
    fn step(
        &self,
        information: &DMatrix<f64>,
        gradient: &DVector<f64>,
        values: &DVector<f64>,
    ) -> Result<(DVector<f64>, f64), FitError> {
        let off = (values - &self.set.prior().mean).component_div(&self.set.scales());
        let within = self.basis.tr_mul(&(information + &self.prior)) * &self.basis;
        let gradient = self.basis.tr_mul(&(gradient - &self.prior * off));
        let steps = f64::INFINITY;
        let factor = Cholesky::new(within).ok_or(FitError::NotConverged { steps })?;
        let solved = factor.solve(&gradient);
        let length = gradient.dot(&solved).max(0.0).sqrt();
        Ok((&self.basis * solved, length))
    }
}

/// Which readings of a block do not hang on what the other blocks leave open.
fn told(
    part: &ReadingPart,
    set: &ParameterSet,
    case: &AbsoluteCase<'_>,
    values: &DVector<f64>,
    hidden: &DMatrix<f64>,
) -> Vec<bool> {
    if hidden.ncols() == 0 {
        return vec![true; part.observations.len()];
    }
    let scales = set.scales();
    let mut model = ObservationModel::new(set, &case.arm, values.as_slice());
    let mut rows = Matrix6xX::zeros(set.len());
    let observations = part.observations.iter();
    let told = observations.map(|each| {
        let kind = each.reading.kind();
        let Ok(predicted) = model.predict(Form::AtRest, &each.setup, kind, &mut rows) else {
            return false;
        };
        each.whiten(&predicted, &mut rows);
        for (mut column, scale) in rows.column_iter_mut().zip(&scales) {
            column *= *scale;
        }
        (&rows * hidden)
            .column_iter()
            .all(|moved| moved.norm() < MATTERS)
    });
    told.collect()
}
