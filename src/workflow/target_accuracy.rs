//! The predicted accuracy of commands for absolute targets.

use nalgebra::{DVector, Isometry3, Matrix3xX};

use super::known_parameters::{IdentifiedStation, known};
use crate::files::FileError;
use crate::identification::{DiscrepancyModel, IdentificationError, StoredRobot};
use crate::numeric::posterior::Posterior;
use crate::observation::{BareArm, PlannedReadings, ReadingErrors, Setup};
use crate::parameter::{ElasticArm, ParameterSet, ReadingSource};
use crate::robot::Load;
use crate::task::Belief;

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
        (stations, tools): (&[IdentifiedStation], &[Option<usize>]),
    ) -> Result<Self, FileError> {
        let frames = stations.iter().map(|each| each.instrument_from_base);
        let mut reference = reference.clone();
        reference.instrument_from_base = frames.chain([Isometry3::identity()]).collect();
        let of_stations: Vec<Option<usize>> = (0..stations.len()).map(Some).collect();
        let kinds = stored.kinds(&reference, &of_stations, tools);
        let arm = stored.apply(&reference)?;
        let (set, posterior) = known(stored, (&arm, belief), &kinds)?;
        let is_own = |&place: &usize| kinds[place].is_some();
        let places: Vec<usize> = (0..kinds.len()).filter(is_own).collect();
        let sources = belief.uncertain.sources().map(|(_, source)| source);
        let is_new = |source: &&ReadingSource| {
            !stored.has_discrepancy()
                && !source.is_function()
                && !matches!(source, ReadingSource::Range(_))
        };
        Ok(Self {
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
    ///
    /// # Errors
    /// The arm has no equilibrium there.
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
        if self.posterior.variance_of(&rows).is_err() {
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
}
