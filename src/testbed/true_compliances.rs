//! The virtual robot's compliances in a run: those of the true robot, or log-normal about them.
//!
//! In run r, joint j has the compliance `k_j` exp(`s_j` z), with its spread `s_j` and a
//! standard normal z that is a function of (seed, r, j). Those that a belief knows something of are drawn from
//! that instead.

use crate::numeric::random::normal::{LANES, fill_normals};
use crate::numeric::random::streams::Stream;

use super::truth::Truth;

/// The compliance of every joint (rad/(N m)) in one run under a seed, before what its laboratory differs in, then what sources have in
/// common with an earlier campaign ([`EarlierValues`](super::EarlierValues)).
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
