//! The uncertainty budget of a plan of absolute readings, and what error sources add that the planner's model does not have.
//!
//! As of [deflections](crate::plan::UncertaintyBudget::of_deflections): with the gain K = C M^-1 of the whole vector, a source that
//! adds `R_s` to the covariance R of readings leaves trace(K (sum J^T R^-1 `R_s` R^-1 J) K^T), and what is known before
//! trace(K `M_0` K^T). Squares add up.

use nalgebra::DMatrix;

use super::{
    AbsolutePlanning, PlaceRows, PredictedAccuracy, RepeatedReading, by_task, in_units, place_rows,
    stacked,
};
use crate::observation::{ReadingErrors, ReadingKind, Setup, planned_rows};
use crate::parameter::{
    ParameterKind, ParameterSet, ReadingSource, Source, SourceLevel, Uncertainty,
};
use crate::plan::UncertaintyBudget;
use crate::plan::uncertainty_budget::{Input, Squares, common};
use crate::task::{Extended, Task};

/// Less than this share of the square of the whole is rounding.
const ROUNDING: f64 = 1e-9;

/// What a plan makes of its readings.
struct WeighedReadings {
    /// K, by the unknowns in typical sizes (3 n x p).
    gain: DMatrix<f64>,
    /// The N readings by configuration,
    groups: Vec<Vec<RepeatedReading>>,
    /// and their parts of K J^T R^-1 (3 n x 6 N, in 1).
    weights: DMatrix<f64>,
}

impl WeighedReadings {
    fn readings(&self) -> Vec<&RepeatedReading> {
        self.groups.iter().flatten().collect()
    }

    /// What errors leave (m^2), each averaged over where it is new.
    fn left_by(&self, errors: impl Fn(usize) -> ReadingErrors) -> f64 {
        let mut next = 0;
        let of_group = |group: &Vec<RepeatedReading>| -> f64 {
            let mut square = 0.0;
            let mut shared: Option<DMatrix<f64>> = None;
            for each in group {
                let weight = self.weights.fixed_columns::<6>(next);
                next += 6;
                let errors = errors(each.place);
                square += (weight * errors.reading).dot(&weight) / f64::from(each.times);
                let moved = weight * each.effects_by(&errors, group);
                shared = Some(match shared {
                    Some(shared) => shared + moved,
                    None => moved,
                });
            }
            square + shared.map_or(0.0, |shared| shared.norm_squared())
        };
        self.groups.iter().map(of_group).sum()
    }
}

impl AbsolutePlanning<'_> {
    /// What a candidate sets up, by its place, and what it reads.
    pub fn setup(&self, place: usize) -> (&Setup, ReadingKind) {
        let observation = &self.case.observations[place];
        (&observation.setup, observation.reading.kind())
    }

    fn weighed(&self, plan: &[(usize, u32)], prediction: &PredictedAccuracy) -> WeighedReadings {
        let scales = self.set.scales();
        let tied = self.tied(plan);
        let mut rows = stacked(&self.poses, prediction.station);
        for each in &tied {
            each.take_shown(&mut rows, &self.poses);
        }
        let mut gain = in_units(rows, &scales) * &prediction.posterior.covariance;
        // By typical sizes: a gain in units over sizes.
        for (mut column, scale) in gain.column_iter_mut().zip(&scales) {
            column /= *scale;
        }
        let mut weights = DMatrix::zeros(gain.nrows(), 0);
        for each in &tied {
            let (own, first) = (each.weights(&self.poses, &gain), weights.ncols());
            weights = weights.resize_horizontally(first + own.ncols(), 0.0);
            weights.columns_mut(first, own.ncols()).copy_from(&own);
        }
        WeighedReadings {
            gain,
            weights,
            groups: tied.into_iter().flat_map(|each| each.groups).collect(),
        }
    }

    /// The rows that readings have, of six each.
    pub(super) fn rows_of(&self, readings: &[&RepeatedReading]) -> Vec<usize> {
        let rows = readings.iter().enumerate().flat_map(|(index, each)| {
            let count = self.setup(each.place).1.rows();
            (0..count).map(move |row| 6 * index + row)
        });
        rows.collect()
    }

    /// The covariance of all mean readings of some configurations by themselves (6 n x 6 n), in the world frame.
    pub(super) fn covariance_of(&self, groups: &[Vec<RepeatedReading>]) -> DMatrix<f64> {
        let here = vec![nalgebra::Isometry3::identity(); self.case.stations.len()];
        let effects = self.sharing(groups, &here).effects;
        let mut covariance = DMatrix::zeros(6 * effects.len(), 6 * effects.len());
        for (row, one) in effects.iter().enumerate() {
            for (column, other) in effects.iter().enumerate() {
                let mut block = covariance.fixed_view_mut::<6, 6>(6 * row, 6 * column);
                block.copy_from(&(one * other.transpose()));
            }
        }
        for (row, each) in groups.iter().flatten().enumerate() {
            let mut block = covariance.fixed_view_mut::<6, 6>(6 * row, 6 * row);
            block += self.own_covariance(each.place, each.times);
        }
        covariance
    }

    /// What a source of errors leaves (m^2).
    fn left_by_source(&self, weighed: &WeighedReadings, source: &ReadingSource) -> f64 {
        if source.is_function() {
            return self.left_by_functions(&weighed.readings(), &weighed.weights, source);
        }
        weighed.left_by(|place| (self.case).disturbed(place, &self.load(place), [source]))
    }

    /// The uncertainty budget of a plan with this predicted accuracy; `None` where it predicts nothing.
    pub fn uncertainty_budget(
        &self,
        plan: &[(usize, u32)],
        prediction: &PredictedAccuracy,
    ) -> Option<UncertaintyBudget> {
        let rho0_m = prediction.rho0_m()?;
        let weighed = self.weighed(plan, prediction);
        let noise = weighed.left_by(|place| {
            let noise = ReadingErrors {
                reading: self.case.covariances[place],
                ..ReadingErrors::none()
            };
            noise.rounded(&self.rounding[place])
        });
        let belief = self.case.belief;
        let extended = &belief.uncertain;
        let readings = extended.sources().map(|(_, source)| {
            let left = self.left_by_source(&weighed, source);
            (source.level_of_readings(), left)
        });
        let known = self.known_before();
        let mut before = (&weighed.gain * known * weighed.gain.transpose()).trace();
        let mut parameters = Vec::new();
        let of_task = self.of_task(extended);
        // What one of the vector leaves; frames are found from readings, where nothing is known of them before.
        let about = self.about_places();
        let left_by_known = |&place: &usize| {
            let kind = self.case.kind_here(extended.set().parameters()[place].kind);
            let own = kind.and_then(|kind| self.set.index_of(kind));
            own.map_or(0.0, |own| {
                let size = self.set.parameters()[own].scale;
                let precision = extended.own_precision(place) * size * size;
                (&weighed.gain * about.row(own).transpose()).norm_squared() * precision
            })
        };
        for (_, places) in extended.shared() {
            let known: f64 = places.iter().map(left_by_known).sum();
            before -= known;
            let task = of_task.iter().filter(|(place, _)| places.contains(place));
            parameters.push(known + task.map(|(_, square)| square).sum::<f64>());
        }
        let squares = Squares {
            noise: (self.noise(plan), noise),
            before: (before > ROUNDING * rho0_m * rho0_m).then_some(before),
            readings: readings.collect(),
            parameters,
        };
        Some(squares.budget(belief, prediction.quantile95_m))
    }

    /// By what the unknowns have stations off at their own places, see [`AbsoluteCase::about_places`]; in typical sizes (p x p).
    fn about_places(&self) -> DMatrix<f64> {
        let size = |place: usize| self.set.parameters()[place].scale;
        let about = self.case.about_places(&self.set);
        about.map_with_location(|row, column, value| value * size(column) / size(row))
    }

    /// u(x) of the noise of a plan's readings, where one number says it.
    fn noise(&self, plan: &[(usize, u32)]) -> Option<Input> {
        let rows = |place: usize| self.setup(place).1.rows();
        let of_one = |&(place, _): &(usize, u32)| {
            let variances = self.case.covariances[place].diagonal();
            (0..rows(place)).map(move |row| (variances[row].sqrt(), "m"))
        };
        let input = common(plan.iter().flat_map(of_one));
        input.filter(|_| plan.iter().all(|&(place, _)| rows(place) <= 3))
    }

    /// What each parameter of the task's force leaves (m^2), by its place in the belief's vector.
    fn of_task(&self, extended: &Extended) -> Vec<(usize, f64)> {
        let parameters = extended.set().parameters();
        let places = (0..parameters.len())
            .filter(|&place| parameters[place].kind.level() == SourceLevel::Task);
        let square = |pose: &PlaceRows, column: usize| {
            pose.weight * pose.by_task.column(column).norm_squared()
        };
        (places.enumerate())
            .map(|(column, place)| {
                (
                    place,
                    self.poses.iter().map(|pose| square(pose, column)).sum(),
                )
            })
            .collect()
    }

    /// What uncertainties of which the planner's model does not know leave besides (m), to first order; none of what is no small error.
    pub fn left_by_hidden(
        &self,
        task: &Task,
        plan: &[(usize, u32)],
        prediction: &PredictedAccuracy,
        hidden: &[&Uncertainty],
    ) -> Vec<Option<f64>> {
        if hidden.is_empty() {
            return Vec::new();
        }
        let weighed = self.weighed(plan, prediction);
        let square = |uncertainty: &&Uncertainty| match &uncertainty.source {
            Source::Reading(source) => Some(self.left_by_source(&weighed, source)),
            Source::Plan(parameters) => {
                self.left_by_parameters(task, prediction, &weighed, parameters)
            }
        };
        hidden
            .iter()
            .map(|each| Some(square(each)?.max(0.0).sqrt()))
            .collect()
    }

    /// |(K sum J^T R^-1 Z - C_h) d|^2 of parameters that are not in the vector; what is in it is found, whatever it is.
    fn left_by_parameters(
        &self,
        task: &Task,
        prediction: &PredictedAccuracy,
        weighed: &WeighedReadings,
        parameters: &[(ParameterKind, f64)],
    ) -> Option<f64> {
        let known_before = self.known_before();
        // The inverse: positions follow rotations, and these nothing.
        let by_places =
            DMatrix::identity(self.set.len(), self.set.len()) * 2.0 - self.about_places();
        let (of_task, others): (Vec<_>, Vec<_>) =
            (parameters.iter()).partition(|(kind, _)| kind.level() == SourceLevel::Task);
        let at_work = (task.test_poses.iter()).zip(by_task(task, &of_task));
        let mut known: f64 = at_work
            .map(|(pose, rows)| pose.weight * rows.norm_squared())
            .sum();
        let mut foreign = Vec::new();
        let here = |(kind, deviation)| Some((self.case.kind_here(kind)?, deviation));
        for (kind, deviation) in others.into_iter().filter_map(here) {
            match self.set.index_of(kind) {
                Some(own) => {
                    // K M_0 d: what is believed of it pulls at it.
                    let size = self.set.parameters()[own].scale;
                    let off = &known_before * by_places.column(own);
                    let pulled = &weighed.gain * off * (deviation / size);
                    known += pulled.norm_squared();
                }
                None => foreign.push((kind, Some(deviation))),
            }
        }
        foreign.retain(|(kind, _)| !matches!(kind, ParameterKind::Drift { .. }));
        if foreign.is_empty() {
            return Some(known);
        }
        let arm = &self.case.arm;
        let set = ParameterSet::new(arm, foreign.iter().copied()).ok()?;
        let poses = place_rows(task, &self.case, &set, self.target);
        let mut left = -stacked(&poses, prediction.station);
        let readings = weighed.readings().into_iter();
        let setups: Vec<_> = readings.map(|each| self.setup(each.place)).collect();
        let rows = planned_rows(&set, arm, &set.prior().mean, &setups);
        for (place, rows) in rows.iter().enumerate() {
            left += weighed.weights.fixed_columns::<6>(6 * place) * rows;
        }
        for ((mut column, parameter), (_, deviation)) in
            (left.column_iter_mut().zip(set.parameters())).zip(&foreign)
        {
            column *= deviation.unwrap_or(0.0) / parameter.scale;
        }
        Some(known + left.norm_squared())
    }
}
