//! The planning task: the planner's model, what must be accurate, and which experiments may be
//! made. The true robot is no part of it.

mod belief;
mod extended;
mod fingerprint;
mod gauge;
mod prior_campaign;
mod region;
mod station;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use serde::Deserialize;

use crate::experiment::{Loads, Plan};
use crate::robot::{EquilibriumError, Load, until_it_stands};

pub use belief::{Belief, Instrument, Loading, Method};
pub use extended::Extended;
pub use fingerprint::{Fingerprint, robot_sha256};
pub use gauge::Gauge;
pub use prior_campaign::{LeftNominal, PriorCampaign};
pub use region::{Forbidden, Region};
pub use station::{Station, station_named, wrong_station};

/// A test pose (D3): where the robot must machine.
#[derive(Debug, Clone, PartialEq)]
pub struct TestPose {
    /// Its name.
    pub name: String,
    /// The configuration `q_0` (rad).
    pub configuration_rad: DVector<f64>,
    /// The task load `W_0`, in the world frame at the machining tool.
    pub load: Load,
    /// The nominal axes of the machining tool (as columns, in the world frame), where the load is given in its frame: in truth it
    /// turns with the true robot's tool.
    pub load_axes: Option<Matrix3<f64>>,
    /// Its weight among the test poses; the weights sum to one.
    pub weight: f64,
    /// The direction n, a unit vector in the world frame, along which alone the error counts, where it is not all of it:
    /// a surface's normal.
    pub direction: Option<Vector3<f64>>,
}

impl TestPose {
    /// The task load where the machining tool's axes are these (as columns, in the world frame): one in its frame turns with it.
    pub fn load_at(&self, axes: &Matrix3<f64>) -> Load {
        (self.load_axes).map_or(self.load, |nominal| {
            self.load.turned(&(axes * nominal.transpose()))
        })
    }

    /// The tool at rest under a load that acts there, as `rest` finds it with the tool's axes (as columns, in the world
    /// frame) under a load in the world frame: one in the tool's frame turns with the tool that it turns, until it stands.
    ///
    /// # Errors
    /// Those of `rest`; the load does not stand.
    pub fn at_rest<T>(
        &self,
        load: &Load,
        mut rest: impl FnMut(&Load) -> Result<(T, Matrix3<f64>), EquilibriumError>,
    ) -> Result<T, EquilibriumError> {
        let found = rest(load)?;
        let Some(nominal) = self.load_axes else {
            return Ok(found.0);
        };
        let stands = until_it_stands(found, |(_, before)| {
            let found = rest(&load.turned(&(before * nominal.transpose())))?;
            let turned = (found.1 - before).norm();
            Ok((found, turned))
        });
        Ok(stands?.0)
    }

    /// What counts of an error there: n n^T e, or all of it.
    pub fn counted(&self, error: &Vector3<f64>) -> Vector3<f64> {
        match &self.direction {
            Some(direction) => direction * direction.dot(error),
            None => *error,
        }
    }

    /// The same of rows C (3 x p) that errors follow from: n n^T C.
    pub fn counted_rows(&self, rows: DMatrix<f64>) -> DMatrix<f64> {
        match &self.direction {
            Some(direction) => {
                let along = direction.transpose() * &rows;
                DMatrix::from_fn(3, rows.ncols(), |axis, column| {
                    direction[axis] * along[column]
                })
            }
            None => rows,
        }
    }
}

/// What must be accurate at the test poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AccuracyKind {
    /// How far the task load moves the tool from where it stands without: the paper's accuracy. Where the unloaded robot stands is no
    /// part of it.
    #[default]
    Relative,
    /// Where the loaded tool is, in the instrument's frame: frames, geometry and elasticity together.
    Absolute,
}

impl AccuracyKind {
    /// Its name in scenarios and records.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Relative => "relative",
            Self::Absolute => "absolute",
        }
    }

    /// The other one.
    pub const fn other(self) -> Self {
        match self {
            Self::Relative => Self::Absolute,
            Self::Absolute => Self::Relative,
        }
    }

    /// What is measured for it.
    pub const fn noun(self) -> &'static str {
        match self {
            Self::Relative => "measurement",
            Self::Absolute => "absolute reading",
        }
    }
}

/// How large a plan is to be, and what it must contain.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    /// What must be accurate.
    pub accuracy: AccuracyKind,
    /// The number m of measurements.
    pub experiments: u32,
    /// The number of different configurations, where it is bounded.
    pub configurations: Option<u32>,
    /// Experiments that every plan must contain; they count among its measurements.
    pub mandatory: Plan,
}

/// What a plan is designed for.
#[derive(Debug, Clone)]
pub struct Task {
    /// What planner and identification believe.
    pub belief: Belief,
    /// Where the robot must machine.
    pub test_poses: Vec<TestPose>,
    /// The loads that a plan may use.
    pub loads: Loads,
    /// The directions (unit vectors, world frame) that a gauge may read along; one that is none where all three coordinates are read.
    pub directions: Vec<Option<Vector3<f64>>>,
    /// Where experiments are possible.
    pub region: Region,
    /// How large a plan is to be, and what it must contain.
    pub design: Design,
}

impl Task {
    /// Whether a gauge reads displacements along a direction, in all experiments or in some.
    pub const fn reads_along(&self) -> bool {
        self.belief.instrument.gauge.is_some()
    }

    /// The task of plans that a tracker reads alone though a gauge stands beside it; none without both.
    pub fn by_tracker_alone(&self) -> Option<Self> {
        (self.directions.len() > 1 && self.directions.contains(&None)).then(|| Self {
            directions: vec![None],
            ..self.clone()
        })
    }

    /// Whether bounds are of plans that hang one load in each configuration, since deflections of one share errors, where more loads could
    /// be hung.
    pub fn has_one_load_each(&self) -> bool {
        !matches!(self.loads, Loads::Fixed(_)) && self.belief.is_shared_by_configuration()
    }

    /// What of the errors counts, in words that follow "at the test pose".
    pub fn counted_words(&self) -> &'static str {
        let directed = (self.test_poses.iter()).filter(|pose| pose.direction.is_some());
        match directed.count() {
            0 => "",
            count if count == self.test_poses.len() => " along its direction",
            _ => " (along the directions that test poses have)",
        }
    }
}
