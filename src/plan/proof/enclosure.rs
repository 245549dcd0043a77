//! What is asked, over boxes: the derivative d and the margins of the limits as Taylor models.

use super::chain::{Chain, Link};
use super::constant::vector;
use super::covariance::{covariance, notable_returns, weighted_rows};
use super::domain::{Domain, LoadCase};
use super::form::{ENTRIES, place};
use super::geometry::BoxGeometry;
use super::question::Question;
use super::rounding::{UNIT, Waves, sin_cos};
use super::rows::squares_of_rows;
use super::taylor::{LANES, Lanes, ModelVector, ModelWorkspace, TaylorModel, VARIABLES};
use super::vectors::{Angle, NOWHERE, constant_in, difference, dot};
use super::weighted::{SpreadColumns, WeightedRow};

/// How often a variable can be halved.
pub(super) const DEEPEST: u8 = 30;

/// A box: its centre, and how often each variable's range was halved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cell {
    pub centre: [f64; VARIABLES],
    pub depth: [u8; VARIABLES],
}

/// What is asked under one load, ready to be looked at over boxes.
#[derive(Debug, Clone)]
pub(super) struct ProofTask<'a> {
    question: &'a Question,
    chain: Chain,
    pub domain: Domain,
    /// The joint before which the frame stands in which everything is told.
    pub middle: usize,
    /// Half-width and waves of each variable at each depth.
    widths: Vec<Vec<(f64, Waves)>>,
    /// The joints whose returns tell their shares, where there is more than noise.
    is_notable: Vec<bool>,
}

/// The derivative over boxes.
#[derive(Debug, Clone)]
pub(super) enum Derivative {
    /// As it is.
    Plain(TaylorModel),
    /// For a force of any direction, the largest eigenvalue of this form: its entries 11, 22, 33, 12, 13, 23.
    Largest([TaylorModel; 6]),
    /// Of rows v, the sum of v^T R^-1 v, R the covariance.
    Weighted(Vec<WeightedRow>, SpreadColumns),
}

/// What is known over [`LANES`] boxes.
#[derive(Debug, Clone)]
pub(super) struct Enclosure {
    pub derivative: Derivative,
    /// Not negative where experiments are possible.
    pub margins: Vec<TaylorModel>,
    /// How much each variable changes the deflections, roughly.
    pub spread: [Lanes; VARIABLES],
}

impl<'a> ProofTask<'a> {
    pub fn new(question: &'a Question, chain: Chain, domain: Domain) -> Self {
        let widths = (domain.ranges.iter())
            .map(|[low, high]| {
                let mut half = (high - low) / 2.0;
                (0..=DEEPEST)
                    .map(|_| {
                        let width = (half, Waves::new(half));
                        half /= 2.0;
                        width
                    })
                    .collect()
            })
            .collect();
        Self {
            middle: 0,
            is_notable: notable_returns(question),
            question,
            chain,
            domain,
            widths,
        }
    }

    /// The number of variables.
    pub fn variables(&self) -> usize {
        self.widths.len()
    }

    /// Where the frame of the middle may stand: between runs.
    pub fn middles(&self) -> Vec<usize> {
        let links = &self.chain.links;
        (0..=links.len())
            .filter(|&joint| joint == 0 || links.get(joint).is_none_or(|link| link.starts_run))
            .collect()
    }

    pub fn links(&self) -> &[Link] {
        &self.chain.links
    }

    /// Whether joint angles are within the limits of joints whose variables are sums.
    #[cfg(test)]
    pub fn is_within_limits(&self, q: &[f64], margin: f64) -> bool {
        (self.domain.differences.iter()).all(|&(later, _, [low, high])| {
            let joints = &mut self.domain.variable.iter();
            let joint = joints.position(|variable| *variable == Some(later));
            joint.is_none_or(|joint| {
                let angle = q[joint] * self.chain.links[joint].sign;
                (low + margin..=high - margin).contains(&angle)
            })
        })
    }

    /// The box of everything.
    pub fn whole(&self) -> Cell {
        let mut centre = [0.0; VARIABLES];
        for (centre, range) in centre.iter_mut().zip(&self.domain.ranges) {
            *centre = f64::midpoint(range[0], range[1]);
        }
        Cell {
            centre,
            depth: [0; VARIABLES],
        }
    }

    /// Half the width of a box.
    pub fn half_width(&self, cell: &Cell, variable: usize) -> f64 {
        self.widths[variable][usize::from(cell.depth[variable])].0
    }

    /// The two halves of a box.
    pub fn halves(&self, cell: &Cell, variable: usize) -> [Cell; 2] {
        [-1.0, 1.0].map(|side| {
            let mut half = *cell;
            half.depth[variable] += 1;
            half.centre[variable] += side * self.half_width(&half, variable);
            half
        })
    }

    /// Where everything is over boxes.
    fn geometry(&self, workspace: &mut ModelWorkspace, cells: &[Cell; LANES]) -> BoxGeometry {
        let angles: Vec<Angle> = (0..self.variables())
            .map(|variable| {
                let centre = cells.each_ref().map(|cell| sin_cos(cell.centre[variable]));
                let waves = cells
                    .each_ref()
                    .map(|cell| self.widths[variable][usize::from(cell.depth[variable])].1);
                workspace.sin_cos(variable, &centre, &waves)
            })
            .collect();
        BoxGeometry::new(workspace, &self.chain, &self.domain, &angles, self.middle)
    }

    /// Looks at boxes.
    pub fn enclose(&self, workspace: &mut ModelWorkspace, cells: &[Cell; LANES]) -> Enclosure {
        workspace.clear();
        let question = self.question;
        let geometry = self.geometry(workspace, cells);
        let levers: Vec<ModelVector> = (0..self.chain.links.len())
            .map(|joint| geometry.moves(workspace, joint, &geometry.tool))
            .collect();
        let mut spread = [[0.0; LANES]; VARIABLES];
        let derivative = match self.domain.load {
            LoadCase::Wrench([fx, fy, fz, tx, ty, tz]) => {
                let load = [[fx, fy, fz], [tx, ty, tz]].map(|each| {
                    constant_in(workspace, &geometry.world, &vector(each), &NOWHERE, 1.0)
                });
                let torques = self.torques(workspace, &geometry.axis, &levers, &load);
                let told = (levers.as_slice(), torques.as_slice());
                if let Some(more) = &question.spread {
                    let covariance = covariance(workspace, more, &geometry, &levers, &load);
                    let count = covariance.columns.len();
                    let rows = weighted_rows(workspace, question, &self.is_notable, told, count);
                    Derivative::Weighted(rows, covariance)
                } else {
                    Derivative::Plain(self.plain(workspace, told, &mut spread))
                }
            }
            LoadCase::Any(size) => {
                Derivative::Largest(self.form(workspace, &levers, size, &mut spread))
            }
        };
        let mut margins = Vec::new();
        self.add_geometric_margins(workspace, &geometry, &levers, &mut margins);
        for &(later, earlier, [low, high]) in &self.domain.differences {
            let [later, earlier] =
                [later, earlier].map(|variable| self.coordinate(workspace, variable, cells));
            for (sign, bound) in [(1.0, -low), (-1.0, high)] {
                let one = workspace.constant(1.0, 0.0);
                let sum = workspace.sum().add(sign, later).add(-sign, earlier);
                margins.push(sum.add(bound, one).end());
            }
        }
        Enclosure {
            derivative,
            margins,
            spread,
        }
    }

    fn coordinate(
        &self,
        workspace: &mut ModelWorkspace,
        variable: usize,
        cells: &[Cell; LANES],
    ) -> TaylorModel {
        let centre = cells.each_ref().map(|cell| cell.centre[variable]);
        let half = cells.each_ref().map(|cell| self.half_width(cell, variable));
        workspace.variable(variable, &centre, &half)
    }

    /// Whether a joint has no torque in any experiment: the first one about the vertical under a vertical force. Its
    /// models would cancel but for their remainders, and what is known of such a compliance from before alone
    /// has a large factor.
    fn is_silent(&self, joint: usize) -> bool {
        let LoadCase::Wrench([fx, fy, _, _, _, tz]) = self.domain.load else {
            return false;
        };
        joint == 0 && self.chain.is_first_upright() && [fx, fy, tz].iter().all(|part| *part == 0.0)
    }

    /// The load's torque about the joint of each parameter; none where there is none in any experiment.
    fn torques(
        &self,
        workspace: &mut ModelWorkspace,
        axes: &[ModelVector],
        levers: &[ModelVector],
        [force, torque]: &[ModelVector; 2],
    ) -> Vec<Option<TaylorModel>> {
        let parameters = self.question.parameters.iter();
        parameters
            .map(|&joint| {
                let lever = levers.get(joint).filter(|_| !self.is_silent(joint))?;
                Some(dot(workspace, &[(lever, force), (&axes[joint], torque)]))
            })
            .collect()
    }

    /// d: the sum over rows of |sum over n of `b_n` `tau_n` `J_n`|^2.
    fn plain(
        &self,
        workspace: &mut ModelWorkspace,
        (levers, torques): (&[ModelVector], &[Option<TaylorModel>]),
        spread: &mut [Lanes; VARIABLES],
    ) -> TaylorModel {
        let columns: Vec<ModelVector> = (self.question.parameters.iter().zip(torques))
            .map(|(&joint, torque)| match torque {
                Some(torque) => workspace.scaled(&levers[joint], *torque),
                None => NOWHERE,
            })
            .collect();
        squares_of_rows(workspace, &self.question.rows, &columns, spread)
    }

    /// The form Q with d = F^T Q F: the sum over rows of the squares of W = sum over n of `b_n` `J_n` `J_n^T`, times
    /// the square of the force.
    fn form(
        &self,
        workspace: &mut ModelWorkspace,
        levers: &[ModelVector],
        size: f64,
        spread: &mut [Lanes; VARIABLES],
    ) -> [TaylorModel; 6] {
        let dyads: Vec<[TaylorModel; 6]> = (self.question.parameters.iter())
            .map(|&joint| match levers.get(joint) {
                Some(lever) => ENTRIES.map(|[i, j]| workspace.times(lever[i], lever[j])),
                None => [TaylorModel::ZERO; 6],
            })
            .collect();
        let rows: Vec<[TaylorModel; 6]> = (self.question.rows.iter())
            .map(|row| {
                std::array::from_fn(|entry| {
                    let mut sum = workspace.sum();
                    for (factor, dyad) in row.iter().zip(&dyads) {
                        let factor = factor * size;
                        sum = sum.add_constant(factor, UNIT * factor.abs(), dyad[entry]);
                    }
                    sum.end()
                })
            })
            .collect();
        for entry in rows.iter().flatten() {
            workspace.add_spread(*entry, spread);
        }
        ENTRIES.map(|[i, j]| {
            let mut sum = workspace.sum();
            for row in &rows {
                for k in 0..3 {
                    sum = sum.product(1.0, row[place(i, k)], row[place(k, j)]);
                }
            }
            sum.end()
        })
    }

    fn add_geometric_margins(
        &self,
        workspace: &mut ModelWorkspace,
        geometry: &BoxGeometry,
        levers: &[ModelVector],
        margins: &mut Vec<TaylorModel>,
    ) {
        let region = &self.question.region;
        let up = geometry.world[2];
        let one = workspace.constant(1.0, 0.0);
        let mut add =
            |workspace: &mut ModelWorkspace, value: TaylorModel, sign: f64, plus: f64, off: f64| {
                let sum = workspace.sum().add(sign, value);
                margins.push(sum.add_constant(plus, off, one).end());
            };
        if region.height_m.iter().any(Option::is_some) {
            let arm = difference(workspace, &geometry.tool, &geometry.base);
            let height = dot(workspace, &[(&up, &arm)]);
            let [low, high] = region.height_m;
            if let Some(low) = low {
                add(workspace, height, 1.0, -low, 0.0);
            }
            if let Some(high) = high {
                add(workspace, height, -1.0, high, 0.0);
            }
        }
        if let (true, Some(lever)) = (region.radius_m.iter().any(Option::is_some), levers.first()) {
            // The tool's speed per unit rate of the first joint is its distance from that axis.
            let mut sum = workspace.sum();
            for part in lever {
                sum = sum.square(*part);
            }
            let squared = sum.end();
            let [low, high] = region.radius_m;
            let off = |radius: f64| UNIT * radius * radius * 2.0;
            if let Some(low) = low {
                add(workspace, squared, 1.0, -low * low, off(low));
            }
            if let Some(high) = high {
                add(workspace, squared, -1.0, high * high, off(high));
            }
        }
        if let Some(sine) = region.elevation_sine {
            let rise = dot(workspace, &[(&up, &geometry.tool_axis)]);
            add(workspace, rise, 1.0, sine, 0.0);
            add(workspace, rise, -1.0, sine, 0.0);
        }
    }
}
