//! The uncertainty budget of a plan of absolute readings, and what error sources add that the planner's model does not have.
//!
//! As of [deflections](crate::plan::UncertaintyBudget::of_deflections): with the gain K = C M^-1 of the whole vector, a source that
//! adds `R_s` to the covariance R of readings leaves trace(K (sum J^T R^-1 `R_s` R^-1 J) K^T), and what is known before
//! trace(K `M_0` K^T). Squares add up.

use nalgebra::{DMatrix, Matrix6, MatrixXx6};

use super::readable::disturbed;
use super::{AbsolutePlanning, PredictedAccuracy, in_units, place_rows, stacked};
use crate::observation::{AbsoluteErrors, ReadingKind, Setup, planned_rows};
use crate::parameter::{
    ParameterKind, ParameterSet, ReadingSource, Source, SourceLevel, Uncertainty,
};
use crate::plan::uncertainty_budget::{Input, common};
use crate::plan::{BudgetSource, CommonSources, UncertaintyBudget};
use crate::task::{Extended, Task, station_named};

/// What is known before without a name in the scenario, as of a payload that nobody weighed.
const BEFORE: &str = "known before";
/// Less than this share of the square of the whole is rounding.
const ROUNDING: f64 = 1e-9;

/// Which uncertainty a force of the task is of.
pub(super) fn is_of_task(kind: ParameterKind) -> bool {
    matches!(
        kind,
        ParameterKind::TaskScale | ParameterKind::TaskForce { .. }
    )
}

/// What a plan makes of its readings: of each the candidate, how often it is read, and K J^T R^-1 (3 n x 6, in 1).
struct WeighedReadings {
    /// K, by the unknowns in typical sizes (3 n x p).
    gain: DMatrix<f64>,
    each: Vec<(usize, u32, MatrixXx6<f64>)>,
}

impl AbsolutePlanning<'_> {
    /// The setups of a plan's readings.
    fn setups(&self, plan: &[(usize, u32)]) -> Vec<(&Setup, ReadingKind)> {
        (plan.iter())
            .map(|&(place, _)| {
                let observation = &self.case.observations[place];
                (&observation.setup, observation.reading.kind())
            })
            .collect()
    }

    fn weighed(&self, plan: &[(usize, u32)], prediction: &PredictedAccuracy) -> WeighedReadings {
        let scales = self.set.scales();
        let rows = in_units(stacked(&self.poses, prediction.station), &scales);
        let mut gain = rows * &prediction.posterior.covariance;
        // By typical sizes: a gain in units over sizes.
        for (mut column, scale) in gain.column_iter_mut().zip(&scales) {
            column /= *scale;
        }
        let mean = &self.set.prior().mean;
        let setups = self.setups(plan);
        let derivatives = planned_rows(&self.set, &self.case.arm, mean, &setups);
        let each = (plan.iter().zip(setups).zip(&derivatives))
            .map(|((&(place, times), (_, kind)), rows)| {
                let precision = inverted(&self.covariance(place, times), kind);
                (place, times, &gain * rows.transpose() * precision)
            })
            .collect();
        WeighedReadings { gain, each }
    }

    /// What a source of errors leaves (m^2).
    fn left_by_source(&self, weighed: &WeighedReadings, source: &ReadingSource) -> f64 {
        let of_one = |(place, times, weight): &(usize, u32, MatrixXx6<f64>)| {
            let errors = self.errors_of_one(*place, source);
            added(weight, &errors.of_mean(&Matrix6::zeros(), *times))
        };
        weighed.each.iter().map(of_one).sum()
    }

    fn errors_of_one(&self, place: usize, source: &ReadingSource) -> AbsoluteErrors {
        let candidate = &self.candidates[place];
        let station = station_named(self.stations, candidate.station.as_deref());
        let setup = &self.case.observations[place].setup;
        disturbed(&self.case, station, candidate, setup, [source])
    }

    /// The uncertainty budget of a plan with this predicted accuracy; `None` where it predicts nothing.
    pub fn uncertainty_budget(
        &self,
        plan: &[(usize, u32)],
        prediction: &PredictedAccuracy,
    ) -> Option<UncertaintyBudget> {
        let rho0_m = prediction.rho0_m()?;
        let weighed = self.weighed(plan, prediction);
        let noise = (weighed.each.iter()).map(|(place, times, weight)| {
            added(
                weight,
                &(self.case.covariances[*place] / f64::from((*times).max(1))),
            )
        });
        let (noise, input) = (noise.sum(), self.noise(plan));
        let instrument = &self.case.belief.instrument;
        let mut sources = vec![BudgetSource::of_noise(instrument, input, noise)];
        let mut before = (&weighed.gain * &self.before * weighed.gain.transpose()).trace();
        let mut named = Vec::new();
        let belief = self.case.belief;
        if let Some(extended) = &belief.uncertain {
            for (name, source) in extended.sources() {
                let square = self.left_by_source(&weighed, source);
                named.push(BudgetSource::of_readings(name, source, extended, square));
            }
            let of_task = self.of_task(extended);
            for (name, places) in extended.shared() {
                let known: f64 = (places.iter())
                    .map(|&place| self.left_by_known(extended, place, &weighed))
                    .sum();
                before -= known;
                let task = of_task.iter().filter(|(place, _)| places.contains(place));
                let square = known + task.map(|(_, square)| square).sum::<f64>();
                named.push(BudgetSource::of_parameters(name, extended, places, square));
            }
        }
        if before > ROUNDING * rho0_m * rho0_m {
            let campaign = belief.prior_campaign.as_ref();
            let freedom = campaign.and_then(|each| each.degrees_of_freedom);
            sources.push(match &belief.prior {
                Some(_) => BudgetSource::earlier(before, freedom),
                None => BudgetSource::new(BEFORE, SourceLevel::Robot, None, before),
            });
        }
        sources.extend(named);
        Some(UncertaintyBudget::new(sources, prediction.quantile95_m))
    }

    /// u(x) of the noise of a plan's readings, where one number says it.
    fn noise(&self, plan: &[(usize, u32)]) -> Option<Input> {
        let is_position =
            |&(place, _): &(usize, u32)| self.case.observations[place].reading.kind().rows() == 3;
        let of_one = |&(place, _): &(usize, u32)| {
            let variances = self.case.covariances[place].diagonal();
            [0, 1, 2].map(|axis| (variances[axis].sqrt(), "m"))
        };
        let input = common(plan.iter().flat_map(of_one));
        input.filter(|_| plan.iter().all(is_position))
    }

    /// What one of the vector leaves of which an uncertainty tells (m^2).
    fn left_by_known(&self, extended: &Extended, place: usize, weighed: &WeighedReadings) -> f64 {
        let kind = extended.set().parameters()[place].kind;
        // Frames are found from readings, whatever is known of them before.
        let own = self.set.index_of(kind).filter(|_| !kind.is_mounted());
        let Some(own) = own else {
            return 0.0;
        };
        let size = self.set.parameters()[own].scale;
        let precision = extended.own_precision(place) * size * size;
        weighed.gain.column(own).norm_squared() * precision
    }

    /// The error sources in common with the campaign of the earlier identification, and the prediction with them.
    pub fn common_sources(
        &self,
        plan: &[(usize, u32)],
        prediction: &PredictedAccuracy,
    ) -> Option<CommonSources> {
        let belief = &self.case.belief;
        let extended = belief.uncertain.as_ref()?;
        let weighed = self.weighed(plan, prediction);
        CommonSources::new(belief, prediction.rho0_m()?, &|place| {
            let own = (self.set).index_of(extended.set().parameters()[place].kind)?;
            Some(weighed.gain.column(own) * self.set.parameters()[own].scale)
        })
    }

    /// What each parameter of the task's force leaves (m^2), by its place in the belief's vector.
    fn of_task(&self, extended: &Extended) -> Vec<(usize, f64)> {
        let parameters = extended.set().parameters();
        let places = (0..parameters.len()).filter(|&place| is_of_task(parameters[place].kind));
        let square = |column: usize| {
            let of_pose = (self.poses.iter())
                .map(|pose| pose.weight * pose.by_task.column(column).norm_squared());
            of_pose.sum::<f64>()
        };
        (places.enumerate())
            .map(|(column, place)| (place, square(column)))
            .collect()
    }

    /// What uncertainties of which the planner's model does not know leave besides (m), to first order; nothing is said of those that
    /// move the tool at the test poses alone, or that are no small errors, which are told as zero.
    pub fn left_by_hidden(
        &self,
        task: &Task,
        (plan, prediction): (&[(usize, u32)], &PredictedAccuracy),
        hidden: &[&Uncertainty],
    ) -> Vec<f64> {
        if hidden.is_empty() {
            return Vec::new();
        }
        let weighed = self.weighed(plan, prediction);
        let square = |uncertainty: &&Uncertainty| match &uncertainty.source {
            Source::Reading(source) => self.left_by_source(&weighed, source),
            Source::Plan(parameters) => self
                .left_by_parameters(task, (plan, prediction), &weighed, parameters)
                .unwrap_or(0.0),
        };
        (hidden.iter())
            .map(|uncertainty| square(uncertainty).max(0.0).sqrt())
            .collect()
    }

    /// |(K sum J^T R^-1 Z - C_h) d|^2 of parameters that are not in the vector; what is in it is found, whatever it is.
    fn left_by_parameters(
        &self,
        task: &Task,
        (plan, prediction): (&[(usize, u32)], &PredictedAccuracy),
        weighed: &WeighedReadings,
        parameters: &[(ParameterKind, f64)],
    ) -> Option<f64> {
        let mut known = 0.0;
        let mut foreign = Vec::new();
        for &(kind, deviation) in parameters {
            match self.set.index_of(kind) {
                Some(own) => {
                    // K M_0 d: what is believed of it pulls at it.
                    let size = self.set.parameters()[own].scale;
                    let pulled = &weighed.gain * self.before.column(own) * (deviation / size);
                    known += pulled.norm_squared();
                }
                None => foreign.push((kind, Some(deviation))),
            }
        }
        foreign
            .retain(|(kind, _)| !is_of_task(*kind) && !matches!(kind, ParameterKind::Drift { .. }));
        if foreign.is_empty() {
            return Some(known);
        }
        let arm = &self.case.arm;
        let set = ParameterSet::new(arm, foreign.iter().copied()).ok()?;
        let poses = place_rows(task, &self.case, &set, self.target);
        let mut left = -stacked(&poses, prediction.station);
        let rows = planned_rows(&set, arm, &set.prior().mean, &self.setups(plan));
        for ((_, _, weight), rows) in weighed.each.iter().zip(&rows) {
            left += weight * rows;
        }
        for ((mut column, parameter), (_, deviation)) in
            (left.column_iter_mut().zip(set.parameters())).zip(&foreign)
        {
            column *= deviation.unwrap_or(0.0) / parameter.scale;
        }
        Some(known + left.norm_squared())
    }
}

/// The inverse of the covariance of what is read, and nothing of what is not.
fn inverted(covariance: &Matrix6<f64>, kind: ReadingKind) -> Matrix6<f64> {
    let rows = kind.rows();
    let own = covariance.view((0, 0), (rows, rows)).into_owned();
    let mut precision = Matrix6::zeros();
    if let Some(factor) = own.cholesky() {
        precision
            .view_mut((0, 0), (rows, rows))
            .copy_from(&factor.inverse());
    }
    precision
}

/// What a covariance of a reading leaves through its weight.
fn added(weight: &MatrixXx6<f64>, covariance: &Matrix6<f64>) -> f64 {
    (weight * covariance).dot(weight)
}
