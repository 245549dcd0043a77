//! Readings of one configuration: visits, and the information of readings that share errors (random effects).
//!
//! With rows y = A x + `Z_c` `b_c` + `Z_v` `b_v` + e of unit normal effects b, of the configuration and of the visit, the normal
//! equations N of visits by (x, `b_c`), their own effects eliminated, add up, and the information about x is the Schur complement
//!
//! ```text
//! I = N_xx - N_xc (N_cc + 1)^-1 N_cx  =  min over K of  N_xx - N_xc K - K^T N_cx + K^T N_cc K + K^T K,
//! ```
//!
//! the same as generalised least squares with the whole covariance. Any K bounds it from above by what adds up over readings.

use nalgebra::{Cholesky, DMatrix, DVector, Matrix6xX, Vector6};

use super::information::in_sizes;
use super::model::ObservationModel;
use super::reading::PlannedReading;
use super::reading_errors::ReadingErrors;
use crate::parameter::{ElasticArm, ParameterSet};

/// So many visits of the robot, in each of which the same readings are taken.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Visits {
    /// How many.
    pub count: u32,
    /// The readings, by their places.
    pub readings: Vec<usize>,
}

/// The visits in which readings (each with its number) are taken so often: of those that one visit may hold, which are of one
/// `class`, the k-th of each belongs to visit k.
pub fn visits_of(readings: &[(usize, u32)], class: impl Fn(usize) -> usize) -> Vec<Visits> {
    let mut visits = Vec::new();
    let mut rest: Vec<(usize, u32)> = readings.to_vec();
    rest.retain(|(_, times)| *times > 0);
    while let Some(&(first, _)) = rest.first() {
        let is_here = |each: usize| class(each) == class(first);
        let here = || rest.iter().filter(|(each, _)| is_here(*each));
        let count = here().map(|(_, times)| *times).min().unwrap_or(1);
        let readings = here().map(|(each, _)| *each).collect();
        visits.push(Visits { count, readings });
        for (each, times) in &mut rest {
            *times -= if is_here(*each) { count } else { 0 };
        }
        rest.retain(|(_, times)| *times > 0);
    }
    visits
}

/// A planned reading, whitened by its own noise, with the errors that it shares.
#[derive(Debug, Clone)]
pub struct SharingReading<'a> {
    /// What is read, and how precisely by itself.
    pub planned: PlannedReading,
    /// What it shares.
    pub errors: &'a ReadingErrors,
}

/// The information of readings of one configuration about p parameters in typical sizes, to first order.
#[derive(Debug, Clone)]
pub struct ConfigurationEquations<'a> {
    model: ObservationModel<'a>,
    scales: DVector<f64>,
}

/// Upper bounds of what readings of one configuration tell, however often each is taken.
#[derive(Debug, Clone)]
pub struct Together {
    /// What is added once (p x p),
    pub once: DMatrix<f64>,
    /// and for each time that a reading is taken (p x p).
    pub each: Vec<DMatrix<f64>>,
}

impl<'a> ConfigurationEquations<'a> {
    /// At values of the parameters (p).
    pub fn new(set: &'a ParameterSet, nominal: &'a ElasticArm, values: &DVector<f64>) -> Self {
        Self {
            model: ObservationModel::new(set, nominal, values.as_slice()),
            scales: set.scales(),
        }
    }

    /// What readings tell together that are taken in such visits (p x p).
    pub fn information(
        &mut self,
        readings: &[SharingReading<'_>],
        visits: &[Visits],
    ) -> DMatrix<f64> {
        let each: Vec<DMatrix<f64>> = readings.iter().map(|each| self.products(each)).collect();
        let [size, outer] = [self.scales.len(), self.outer(readings)];
        let mut sum = DMatrix::zeros(outer, outer);
        for visit in visits {
            let all = summed(visit.readings.iter().map(|&place| &each[place]));
            sum += eliminated(&all, outer) * f64::from(visit.count);
        }
        eliminated(&sum, size)
    }

    /// Bounds of what readings tell, where those of each class may be of one visit: near for single readings of a visit, and for two of
    /// the configuration.
    pub fn bounds(&mut self, readings: &[SharingReading<'_>], classes: &[usize]) -> Together {
        let products: Vec<DMatrix<f64>> = readings.iter().map(|each| self.products(each)).collect();
        let [size, outer] = [self.scales.len(), self.outer(readings)];
        let of_mean = |all: &[&DMatrix<f64>], readings: f64, kept: usize| {
            let mean = summed(all.iter().copied()) / all.len() as f64;
            best_effects(&(mean * readings), kept)
        };
        let mut each: Vec<DMatrix<f64>> = (products.iter().zip(classes))
            .map(|(own, class)| {
                let here = products.iter().zip(classes);
                let here = here.filter(|(_, other)| *other == class);
                let here: Vec<&DMatrix<f64>> = here.map(|(all, _)| all).collect();
                let best = of_mean(&here, 1.0, outer);
                // A visit has one reading at least, which bears what is added for each visit.
                replaced(own, &best) + best.tr_mul(&best)
            })
            .collect();
        let best = of_mean(&each.iter().collect::<Vec<_>>(), 2.0, size);
        for own in &mut each {
            *own = replaced(own, &best);
        }
        Together {
            once: best.tr_mul(&best),
            each,
        }
    }

    fn outer(&self, readings: &[SharingReading<'_>]) -> usize {
        let errors = readings.first().map(|each| &each.errors.configuration);
        self.scales.len() + errors.map_or(0, Matrix6xX::ncols)
    }

    /// The products of a reading's whitened rows by parameters, effects of the configuration, and those of the visit.
    fn products(&mut self, reading: &SharingReading<'_>) -> DMatrix<f64> {
        let SharingReading { planned, errors } = reading;
        let mut rows = Matrix6xX::zeros(self.scales.len());
        (self.model).predict_as_planned(None, &planned.setup, planned.kind, &mut rows);
        in_sizes(&mut rows, &self.scales);
        let mut columns: Vec<Vector6<f64>> = Vec::new();
        for part in [&rows, &errors.configuration, &errors.visit] {
            columns.extend(part.column_iter().map(Vector6::from));
        }
        let mut all = Matrix6xX::from_columns(&columns);
        (planned.whitener).whiten(planned.kind, &mut Vector6::zeros(), &mut all);
        all.tr_mul(&all)
    }
}

fn summed<'m>(mut each: impl Iterator<Item = &'m DMatrix<f64>>) -> DMatrix<f64> {
    let first = each.next().cloned().unwrap_or_default();
    each.fold(first, |sum, other| sum + other)
}

/// K = (`N_cc` + 1)^-1 `N_cx`, where the first x are kept and the others are unit normal effects.
fn best_effects(equations: &DMatrix<f64>, kept: usize) -> DMatrix<f64> {
    let effects = equations.nrows() - kept;
    let own = equations.view((kept, kept), (effects, effects));
    let cross = equations.view((kept, 0), (effects, kept)).into_owned();
    // Products plus one are positive definite.
    let factor = Cholesky::new(own + DMatrix::identity(effects, effects));
    factor.map_or(cross.clone(), |factor| factor.solve(&cross))
}

/// Equations in which effects take their best values.
fn eliminated(equations: &DMatrix<f64>, kept: usize) -> DMatrix<f64> {
    let effects = equations.nrows() - kept;
    let mut left = equations.view((0, 0), (kept, kept)).into_owned();
    if effects > 0 {
        let cross = equations.view((kept, 0), (effects, kept));
        left -= cross.tr_mul(&best_effects(equations, kept));
        left.fill_upper_triangle_with_lower_triangle();
    }
    left
}

/// Equations in which effects are -K x, without the squares of these.
fn replaced(equations: &DMatrix<f64>, best: &DMatrix<f64>) -> DMatrix<f64> {
    let (effects, kept) = best.shape();
    let cross = equations.view((kept, 0), (effects, kept)).tr_mul(best);
    let own = equations.view((kept, kept), (effects, effects));
    let mut left = equations.view((0, 0), (kept, kept)) - &cross - cross.transpose();
    left += best.tr_mul(&(own * best));
    left.fill_upper_triangle_with_lower_triangle();
    left
}
