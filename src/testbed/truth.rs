//! The simulated truth, which only the testbed knows, and its compliances in a run: those of the true robot, or log-normal about them.
//!
//! In run r, joint j has the compliance `k_j` exp(`s_j` z), with its spread `s_j` and a
//! standard normal z that is a function of (seed, r, j). Those that a belief knows something of are drawn from
//! that instead.

use nalgebra::{DMatrix, Vector3};
use serde::{Serialize, Serializer};

use crate::numeric::random::normal::{LANES, fill_normals};
use crate::numeric::random::streams::Stream;
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

/// The compliance of every joint (rad/(N m)) in one run under a seed, before what its laboratory differs in, then what sources have in
/// common with an earlier campaign ([`EarlierValues`]).
pub fn values_of_run(truth: &Truth, seed: u64, run: u64) -> Vec<f64> {
    let mut drawn = TrueCompliances::new(truth, seed);
    drawn.draw(run).iter().map(|lanes| lanes[0]).collect()
}

/// Draws true compliances, [`LANES`] runs at a time, with what sources have in common with an earlier campaign.
#[derive(Debug)]
pub struct TrueCompliances<'a> {
    truth: &'a Truth,
    seed: u64,
    varies: bool,
    normals: Vec<[f64; LANES]>,
    values: Vec<[f64; LANES]>,
}

impl<'a> TrueCompliances<'a> {
    /// The compliances of a virtual robot's runs under a seed.
    pub fn new(truth: &'a Truth, seed: u64) -> Self {
        let known = &truth.robot.compliance_rad_per_nm;
        let drawn = (truth.earlier.as_ref()).map_or(0, |earlier| earlier.spread.ncols());
        let kept = truth.kept().iter().map(|_| [0.0; LANES]);
        Self {
            truth,
            seed,
            varies: truth.earlier.is_some()
                || truth.compliance_spread.iter().any(|spread| *spread > 0.0),
            normals: vec![[0.0; LANES]; known.len() + drawn],
            values: (known.iter().map(|&value| [value; LANES]))
                .chain(kept)
                .collect(),
        }
    }

    /// Whether they differ from run to run.
    pub const fn varies(&self) -> bool {
        self.varies
    }

    /// The compliance of every joint (rad/(N m)) in the runs that were drawn last, then what sources have in common.
    pub fn current(&self) -> &[[f64; LANES]] {
        &self.values
    }

    /// The same in [`LANES`] consecutive runs from `first_run`.
    pub fn draw(&mut self, first_run: u64) -> &[[f64; LANES]] {
        let known = &self.truth.robot.compliance_rad_per_nm;
        if self.varies {
            fill_normals(Stream::Compliances, self.seed, first_run, &mut self.normals);
            let spreads = &self.truth.compliance_spread;
            for (joint, compliance) in known.iter().enumerate() {
                self.values[joint] =
                    self.normals[joint].map(|z| compliance * (spreads[joint] * z).exp());
            }
        }
        if let Some(earlier) = &self.truth.earlier {
            let own = &self.normals[known.len()..];
            let places = (earlier.joints.iter().copied()).chain(known.len()..);
            for (row, place) in places.take(earlier.mean.len()).enumerate() {
                let mut lanes = [earlier.mean[row]; LANES];
                for (column, normals) in own.iter().enumerate() {
                    for (value, z) in lanes.iter_mut().zip(normals) {
                        *value += earlier.spread[(row, column)] * z;
                    }
                }
                self.values[place] = lanes;
            }
        }
        &self.values
    }
}
