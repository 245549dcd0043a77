//! The simulated truth, which only the testbed knows.

use nalgebra::{DMatrix, Vector3};
use serde::{Serialize, Serializer};

use crate::parameter::{ParameterKind, Uncertainty};
use crate::quantities::units::thousandths;
use crate::robot::TrueRobot;

/// The virtual robot, and how it varies.
#[derive(Debug, Clone)]
pub struct Truth {
    /// The virtual robot.
    pub robot: TrueRobot,
    /// Its compliances vary from run to run of a study about those of the robot, log-normally: the standard
    /// deviation of each joint's logarithm.
    pub compliance_spread: Vec<f64>,
    /// What every run of a study samples anew from what the campaign of `robot.prior` says, so that this knowledge is as good as it
    /// says.
    pub earlier: Option<EarlierValues>,
    /// What every run draws anew besides: all that the scenario lists as uncertain, whether the belief knows of it or
    /// not.
    pub uncertainties: Vec<Uncertainty>,
}

impl Truth {
    /// The parameters of error sources that the campaign of `robot.prior` has in common with this one.
    pub fn kept(&self) -> &[ParameterKind] {
        self.earlier.as_ref().map_or(&[], |earlier| &earlier.kept)
    }

    /// Whether errors are made of more than the instrument's noise and other compliances.
    pub const fn leaves_more_than_noise(&self) -> bool {
        !self.uncertainties.is_empty() || !self.robot.torque_laws.is_empty()
    }
}

/// The simulated truth of one run: what was sampled, and what an instrument without errors would have read.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct RunTruth {
    /// The run's number.
    pub run: u64,
    /// The compliances of the identified joints (rad/(N m)).
    pub compliance_rad_per_nm: Vec<f64>,
    /// All that a run samples once; compliances as the logarithm of their ratio to the virtual robot's.
    pub sampled: Vec<SampledValue>,
    /// How far the load moved the tool in each reading (m, world frame), with what no model explains and without the
    /// instrument's errors.
    #[serde(rename = "deflections_mm", serialize_with = "in_mm")]
    pub deflections_m: Vec<Vector3<f64>>,
    /// The quantities that absolute readings identified, in their order.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unknowns: Option<Vec<TrueUnknown>>,
}

fn in_mm<S: Serializer>(vectors: &[Vector3<f64>], to: S) -> Result<S::Ok, S::Error> {
    let in_mm = |vector: &Vector3<f64>| <[f64; 3]>::from(vector.map(thousandths));
    to.collect_seq(vectors.iter().map(in_mm))
}

/// The simulated truth of what was identified.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrueUnknown {
    /// Its name.
    pub name: String,
    /// Its value; none where a run does not say it.
    pub value: Option<f64>,
}

/// Something that a run samples once.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SampledValue {
    /// Its name, as that of an unknown.
    pub name: String,
    /// The unit of the value; "1" for the logarithm of a ratio to what is nominal.
    pub unit: &'static str,
    /// The value in this run.
    pub value: f64,
}

/// Compliances and error sources with a joint normal distribution.
#[derive(Debug, Clone, PartialEq)]
pub struct EarlierValues {
    /// The joints.
    pub joints: Vec<usize>,
    /// The parameters of error sources that two campaigns have in common.
    pub kept: Vec<ParameterKind>,
    /// The means: of compliances (rad/(N m)), then by how much parameters differ from what is nominal, in their units.
    pub mean: Vec<f64>,
    /// L: mean + L z for independent standard normals z.
    pub spread: DMatrix<f64>,
}
