//! The virtual robot's compliances in a run: those of the true robot, or log-normal about them.
//!
//! In run r, joint j has the compliance `k_j` exp(`s_j` z), with its spread `s_j` and a
//! standard normal z that is a function of (seed, r, j). Those that a belief knows something of are drawn from
//! that instead.

use crate::numeric::random::normal::{LANES, fill_normals};
use crate::numeric::random::streams::Stream;

use super::truth::Truth;

/// The compliance of every joint (rad/(N m)) in one run under a seed, before what its laboratory differs in.
pub fn compliances_of_run(truth: &Truth, seed: u64, run: u64) -> Vec<f64> {
    let mut drawn = TrueCompliances::new(truth, seed);
    drawn.draw(run).iter().map(|lanes| lanes[0]).collect()
}

/// Draws true compliances, [`LANES`] runs at a time.
#[derive(Debug)]
pub struct TrueCompliances<'a> {
    truth: &'a Truth,
    seed: u64,
    varies: bool,
    normals: Vec<[f64; LANES]>,
    compliance_rad_per_nm: Vec<[f64; LANES]>,
}

impl<'a> TrueCompliances<'a> {
    /// The compliances of a virtual robot's runs under a seed.
    pub fn new(truth: &'a Truth, seed: u64) -> Self {
        let known = &truth.robot.compliance_rad_per_nm;
        let drawn = (truth.drawn.as_ref()).map_or(0, |drawn| drawn.spread.ncols());
        Self {
            truth,
            seed,
            varies: truth.drawn.is_some()
                || truth.compliance_spread.iter().any(|spread| *spread > 0.0),
            normals: vec![[0.0; LANES]; known.len() + drawn],
            compliance_rad_per_nm: known.iter().map(|&value| [value; LANES]).collect(),
        }
    }

    /// Whether they differ from run to run.
    pub const fn varies(&self) -> bool {
        self.varies
    }

    /// The compliance of every joint (rad/(N m)) in the runs that were drawn last.
    pub fn current(&self) -> &[[f64; LANES]] {
        &self.compliance_rad_per_nm
    }

    /// The compliance of every joint (rad/(N m)) in [`LANES`] consecutive runs from `first_run`.
    pub fn draw(&mut self, first_run: u64) -> &[[f64; LANES]] {
        if self.varies {
            fill_normals(Stream::Compliances, self.seed, first_run, &mut self.normals);
            let known = &self.truth.robot.compliance_rad_per_nm;
            let spreads = &self.truth.compliance_spread;
            for (joint, lanes) in self.compliance_rad_per_nm.iter_mut().enumerate() {
                *lanes = self.normals[joint].map(|z| known[joint] * (spreads[joint] * z).exp());
            }
        }
        if let Some(drawn) = &self.truth.drawn {
            let own = &self.normals[self.truth.robot.compliance_rad_per_nm.len()..];
            for (row, &joint) in drawn.joints.iter().enumerate() {
                let mut lanes = [drawn.mean_rad_per_nm[row]; LANES];
                for (column, normals) in own.iter().enumerate() {
                    for (value, z) in lanes.iter_mut().zip(normals) {
                        *value += drawn.spread[(row, column)] * z;
                    }
                }
                self.compliance_rad_per_nm[joint] = lanes;
            }
        }
        &self.compliance_rad_per_nm
    }
}
