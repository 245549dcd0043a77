//! The predicted accuracy of commands for absolute targets.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3xX, Matrix6xX};

use crate::files::FileError;
use crate::identification::{DiscrepancyModel, IdentificationError, StoredRobot};
use crate::numeric::estimable::Estimable;
use crate::numeric::posterior::Posterior;
use crate::observation::{
    BareArm, ObservationModel, PlannedReadings, ReadingErrors, ReadingKind, Setup,
};
use crate::parameter::{ElasticArm, ParameterKind, ParameterSet, ReadingSource, SourceLevel};
use crate::robot::Load;
use crate::task::Belief;

/// A parameter that is redundant with the unknowns at what was read moves a tool that was not read ...
const OF_ITS_OWN: f64 = 0.05;
/// ... by this share of what it moves by itself, and of the standard error: where that tool stands is then not determined.
const OF_THE_ERROR: f64 = 0.1;

/// What is known of where tools stand.
#[derive(Debug, Clone)]
pub(super) struct KnownPlaces {
    /// The arm as it was identified, with its stations, and a last one in the robot's base.
    arm: ElasticArm,
    /// Its parameters, those of the stations among them,
    set: ParameterSet,
    /// and their places among the model's.
    places: Vec<usize>,
    /// Those of the task's loads.
    of_task: ParameterSet,
    /// What is known of both.
    posterior: Posterior,
    discrepancy: DiscrepancyModel,
    /// The same parameters, then those that are redundant with them,
    with_redundant: ParameterSet,
    /// and how these change the others where what was read stays (p x r).
    shifts: DMatrix<f64>,
    /// What is new at a visit by the planner's model, where no discrepancy was found, which consists of that.
    sources: Vec<ReadingSource>,
}

/// How far a tool is from its target, rms (m).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetAccuracy {
    /// By what was identified, and by the task's uncertain load: the mean of returns to the target.
    pub mean_m: f64,
    /// One return, with what is new at a visit besides: the model discrepancy that was found, or what the planner's model says.
    pub one_return_m: f64,
}

impl KnownPlaces {
    /// From a file of absolute readings.
    pub fn new(
        stored: &StoredRobot,
        (reference, belief): (&ElasticArm, &Belief),
        tools: &[Option<usize>],
    ) -> Result<Self, FileError> {
        let stations = &stored.message.stations;
        let base = Isometry3::identity();
        let frames = stations.iter().map(|each| each.frame(&base));
        let mut reference = reference.clone();
        reference.instrument_from_base = frames.chain([base]).collect();
        let of_stations: Vec<Option<usize>> = (0..stations.len()).map(Some).collect();
        let kinds = stored.kinds(&reference, &of_stations, tools);
        let arm = stored.apply(&reference)?.under_loads_of_task();
        let (set, posterior) = known(stored, (&arm, belief), &kinds)?;
        let is_own = |&place: &usize| kinds[place].is_some();
        let places: Vec<usize> = (0..kinds.len()).filter(is_own).collect();
        let sources = belief.uncertain.sources().map(|(_, source)| source);
        let is_new = |source: &&ReadingSource| {
            !stored.has_discrepancy()
                && !source.is_function()
                && !matches!(source, ReadingSource::Range(_))
        };
        let redundant = stored.redundant(&arm, &of_stations, tools);
        let own = places.iter().filter_map(|&place| kinds[place]);
        let all = own.chain(redundant.iter().map(|each| each.0));
        let with_redundant = ParameterSet::new(&arm, all.map(|kind| (kind, None)))
            .map_err(|error| stored.wrong("left_out", error.to_string()))?;
        let values = stored.values(&reference)?;
        let shifts = DMatrix::from_fn(places.len(), redundant.len(), |row, column| {
            redundant[column].1[places[row]] * values[places[row]].factor
        });
        Ok(Self {
            with_redundant,
            shifts,
            discrepancy: stored.discrepancy_model(&arm)?,
            sources: sources.filter(is_new).cloned().collect(),
            of_task: set.subset(&(places.len()..set.len()).collect::<Vec<_>>()),
            set: set.subset(&(0..places.len()).collect::<Vec<_>>()),
            places,
            arm,
            posterior,
        })
    }

    /// Of a tool that is commanded so, in the frame of a station, or of the robot's base where there is none; `None` where that depends on
    /// what was not determined.
    pub fn accuracy(
        &self,
        (tool, station): (usize, Option<usize>),
        commanded_rad: &DVector<f64>,
        load: &Load,
    ) -> Result<Option<TargetAccuracy>, IdentificationError> {
        let setup = Setup {
            commanded_rad: commanded_rad.clone(),
            load: *load,
            hangs_on: None,
            target: tool,
            station: station.unwrap_or(self.arm.instrument_from_base.len() - 1),
            approach: None,
        };
        let error = (self.discrepancy).place_error(&self.arm, &self.set, &self.places, &setup)?;
        let q = commanded_rad.as_slice();
        let (own, of_task) = (self.set.len(), self.of_task.len());
        let sizes = vec![1.0; of_task];
        let mut model = PlannedReadings::at_test_pose(&self.arm, tool, &self.of_task, &sizes);
        let mut by_task = Matrix3xX::zeros(of_task);
        model.move_to(q);
        model.uncompensated(load, &mut by_task);
        let mut rows = error.rows.insert_columns(own, of_task, 0.0);
        rows.columns_mut(own, of_task).copy_from(&by_task);
        let is_determined = self.posterior.variance_of(&rows).is_ok()
            && self.is_determined(setup, error.identified_m2.sqrt())?;
        if !is_determined {
            return Ok(None);
        }
        let variances = self.posterior.covariance.diagonal();
        let task_m2: f64 = (by_task.column_iter().zip(variances.iter().skip(own)))
            .map(|(column, variance)| column.norm_squared() * variance)
            .sum();
        let bare = BareArm {
            chain: &self.arm.chain,
            compliance_rad_per_nm: &self.arm.compliance_rad_per_nm,
            tool: &self.arm.tools[tool],
        };
        let carried = (bare.tool, load);
        let new = ReadingErrors::new(bare, q, carried, None, &self.sources).covariance();
        let mean_m2 = error.identified_m2 + task_m2;
        let one_return_m2 = mean_m2 + error.new_m2 + new.fixed_view::<3, 3>(0, 0).trace();
        Ok(Some(TargetAccuracy {
            mean_m: mean_m2.sqrt(),
            one_return_m: one_return_m2.sqrt(),
        }))
    }

    /// Whether a tool stands where it does, but for its standard error (m), whatever the parameters are that are redundant with the unknowns.
    /// Where the base's frame counts, it is what the first station sees of it.
    fn is_determined(
        &self,
        setup: Setup,
        standard_error_m: f64,
    ) -> Result<bool, IdentificationError> {
        if self.shifts.ncols() == 0 {
            return Ok(true);
        }
        let (all, own) = (&self.with_redundant, self.set.len());
        let last = self.arm.instrument_from_base.len() - 1;
        let setup = Setup {
            station: setup.station % last.max(1),
            ..setup
        };
        let mut by = Matrix6xX::zeros(all.len());
        (ObservationModel::new(all, &self.arm, all.prior().mean.as_slice()))
            .predict(&setup, ReadingKind::Position, &mut by)
            .map_err(|error| (0, error))?;
        all.under_loads_of_task(&mut by);
        let alone = by.view((0, own), (3, all.len() - own));
        let together = by.view((0, 0), (3, own)) * &self.shifts + alone;
        let sizes = all.scales();
        Ok((0..alone.ncols()).all(|place| {
            let size = sizes[own + place];
            let moved = together.column(place).norm() * size;
            moved <= OF_ITS_OWN * alone.column(place).norm() * size
                || moved <= OF_THE_ERROR * standard_error_m
        }))
    }
}

/// What is known of the robot's own parameters, wherever the stations are, and of the task's force, of which no reading says anything.
pub(super) fn known(
    stored: &StoredRobot,
    (arm, belief): (&ElasticArm, &Belief),
    kinds: &[Option<ParameterKind>],
) -> Result<(ParameterSet, Posterior), FileError> {
    let unknowns = &stored.message.unknowns;
    let own: Vec<(usize, ParameterKind)> = (kinds.iter().enumerate())
        .filter_map(|(index, kind)| Some((index, (*kind)?)))
        .collect();
    let of_task = belief.uncertain.set().parameters().iter();
    let of_task = of_task.filter(|each| each.kind.level() == SourceLevel::Task);
    let of_task: Vec<(ParameterKind, f64)> = of_task
        .filter_map(|each| Some((each.kind, each.prior_deviation?)))
        .collect();
    let all = own.iter().map(|&(_, kind)| kind);
    let all = all.chain(of_task.iter().map(|&(kind, _)| kind));
    let set = ParameterSet::new(arm, all.map(|kind| (kind, None)))
        .map_err(|error| stored.wrong("unknowns", error.to_string()))?;
    let hidden: Vec<usize> = (0..own.len())
        .filter(|&place| unknowns[own[place].0].standard_error.is_none())
        .collect();
    let values = stored.values(arm)?;
    let factor = |&(index, _): &(usize, ParameterKind)| values[index].factor;
    let covariance = DMatrix::from_fn(set.len(), set.len(), |row, column| {
        match (own.get(row), own.get(column)) {
            (Some(one), Some(other)) => {
                stored.covariance[(one.0, other.0)] * factor(one) * factor(other)
            }
            _ if row == column => of_task[row - own.len()].1.powi(2),
            _ => 0.0,
        }
    });
    let posterior = Posterior {
        names: (set.parameters().iter())
            .map(|each| each.name.clone())
            .collect(),
        mean: set.prior().mean.as_slice().to_vec(),
        covariance,
        estimable: Estimable::with_hidden(
            set.scales().as_slice(),
            DMatrix::identity(set.len(), set.len()).select_columns(&hidden),
        ),
    };
    Ok((set, posterior))
}
