//! What planner and identification believe.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::parameter::Prior;
use crate::robot::{Commands, Robot, Tool};

/// How deflections are measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instrument {
    /// The standard deviation of each coordinate of a deflection (m).
    pub sigma_m: f64,
    /// The standard deviation of each coordinate of a rotation (rad), where rotations are measured.
    pub rotation_sigma_rad: Option<f64>,
    /// The site of the model where the tracker stands.
    pub tracker_site: Option<usize>,
}

/// How compliances are identified and deflections compensated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, Serialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Linear least squares (eq. 9) and linear compensation (eq. 15).
    Linear,
    /// Through the static equilibrium of the nominal model: no linearisation.
    #[default]
    Nonlinear,
}

/// What planner and identification believe of the robot, its tools and the instrument, and what they are to
/// find out.
#[derive(Debug, Clone)]
pub struct Belief {
    /// The robot as it is taken to be.
    pub nominal: Robot,
    /// The tool that carries the reflector and the weight.
    pub calibration_tool: Tool,
    /// The tool that machines.
    pub machining_tool: Tool,
    /// The joints whose compliances are identified, as indices in ascending order.
    pub parameters: Vec<usize>,
    /// What an earlier identification told of these compliances (rad/(N m)); its means are the nominal ones.
    pub prior: Option<Prior>,
    /// How deflections are measured.
    pub instrument: Instrument,
    /// The method of identification and compensation.
    pub method: Method,
}

impl Belief {
    /// How the robot is commanded: what plans and measurements have columns for.
    #[must_use]
    pub fn commands(&self) -> Commands {
        Commands::from(&self.nominal.chain)
    }

    /// The number of joints, passive ones counted.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.nominal.chain.len()
    }

    /// The precision of what is known of the compliances before any measurement, in units of typical sizes,
    /// p x p.
    #[must_use]
    pub fn prior_information(&self) -> DMatrix<f64> {
        let typical = self.nominal.typical_rad_per_nm(&self.parameters);
        match &self.prior {
            Some(prior) => prior.relative(&typical),
            None => DMatrix::zeros(typical.len(), typical.len()),
        }
    }

    /// The same as whitened equations, r x p (1/(rad/(N m))); without a prior there are none.
    #[must_use]
    pub fn prior_rows(&self) -> DMatrix<f64> {
        match &self.prior {
            Some(prior) => prior.rows(&self.nominal.typical_rad_per_nm(&self.parameters)),
            None => DMatrix::zeros(0, self.parameters.len()),
        }
    }

    /// The names of the identified joints.
    #[must_use]
    pub fn parameter_names(&self) -> Vec<String> {
        self.parameters
            .iter()
            .map(|&joint| self.nominal.chain.joints[joint].name.clone())
            .collect()
    }
}
