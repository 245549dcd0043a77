//! What is asked, over boxes: the derivative d and the margins of the limits as Taylor models.

use super::chain::Chain;
use super::constant::vector;
use super::covariance::{covariance, notable_returns, weighted_rows};
use super::domain::{Domain, LoadCase, needs_tool_axis};
use super::form::{ENTRIES, place};
use super::geometry::BoxGeometry;
use super::question::Question;
use super::rounding::{UNIT, Waves, sin_cos};
use super::rows::squares_of_rows;
use super::taylor::{LANES, Lanes, ModelVector, ModelWorkspace, TaylorModel, TermSign, VARIABLES};
use super::vectors::{Angle, NOWHERE, constant_in, cross, difference, dot, exact};
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
            .map(|range| {
                let mut half = (range.high - range.low) / 2.0;
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
        (0..=self.chain.tool_joints)
            .filter(|&joint| joint == 0 || links.get(joint).is_none_or(|link| link.starts_run))
            .collect()
    }

    pub fn link(&self, joint: usize) -> Option<&super::chain::Link> {
        self.chain.links.get(joint)
    }

    /// Whether joint angles are within the limits of joints whose variables are sums.
    #[cfg(test)]
    pub fn is_within_limits(&self, q: &[f64], margin: f64) -> bool {
        self.domain.differences.iter().all(|limit| {
            let later = Some(limit.later);
            let joint = (0..q.len()).find(|&joint| self.domain.variable[joint] == later);
            joint.is_none_or(|joint| {
                let angle = q[joint] * self.chain.links[joint].sign;
                (limit.low + margin..=limit.high - margin).contains(&angle)
            })
        })
    }

    /// The box of everything.
    pub fn whole(&self) -> Cell {
        let mut centre = [0.0; VARIABLES];
        for (centre, range) in centre.iter_mut().zip(&self.domain.ranges) {
            *centre = f64::midpoint(range.low, range.high);
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
        BoxGeometry::new(
            workspace,
            &self.chain,
            &self.domain,
            &angles,
            self.middle,
            self.question.region.torque_nm.is_some(),
        )
    }

    /// Looks at boxes.
    pub fn enclose(&self, workspace: &mut ModelWorkspace, cells: &[Cell; LANES]) -> Enclosure {
        workspace.clear();
        let question = self.question;
        let region = &question.region;
        let geometry = self.geometry(workspace, cells);
        let levers: Vec<ModelVector> = (0..self.chain.tool_joints)
            .map(|joint| geometry.moves(workspace, joint, &geometry.tool))
            .collect();
        let axes = &geometry.axis[..self.chain.tool_joints];
        let load = self.load(workspace, &geometry, cells);
        let mut spread = [[0.0; LANES]; VARIABLES];
        let derivative = match &load {
            Some(load) => {
                let torques = self.torques(workspace, axes, &levers, load);
                if let Some(more) = &question.spread {
                    let covariance = covariance(workspace, more, &geometry, &levers, load);
                    let told = (levers.as_slice(), torques.as_slice());
                    let count = covariance.columns.len();
                    let rows = weighted_rows(workspace, question, &self.is_notable, told, count);
                    Derivative::Weighted(rows, covariance)
                } else {
                    let told = (levers.as_slice(), torques.as_slice());
                    Derivative::Plain(self.plain(workspace, axes, told, &mut spread))
                }
            }
            None => Derivative::Largest(self.form(workspace, axes, &levers, &mut spread)),
        };
        let mut margins = Vec::new();
        self.add_geometric_margins(workspace, &geometry, &levers, &mut margins);
        if let (Some(limits), Some(load)) = (&region.torque_nm, &load) {
            self.add_torque_margins(workspace, (&geometry, &levers), load, limits, &mut margins);
        }
        for limit in &self.domain.differences {
            let [later, earlier] = [limit.later, limit.earlier]
                .map(|variable| self.coordinate(workspace, variable, cells));
            for (sign, bound) in [(1.0, -limit.low), (-1.0, limit.high)] {
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

    /// Force and torque, unless the force has any direction.
    fn load(
        &self,
        workspace: &mut ModelWorkspace,
        geometry: &BoxGeometry,
        cells: &[Cell; LANES],
    ) -> Option<[ModelVector; 2]> {
        let LoadCase::Wrench([fx, fy, fz, tx, ty, tz], _) = self.domain.load else {
            return None;
        };
        let none = exact(workspace, [0.0; 3]);
        let load = [[fx, fy, fz], [tx, ty, tz]]
            .map(|each| constant_in(workspace, &geometry.world, &vector(each), &none, 1.0));
        Some(match self.domain.share {
            Some(share) => {
                let share = self.coordinate(workspace, share, cells);
                load.map(|each| {
                    each.map(|part| workspace.sum().product(TermSign::Plus, part, share).end())
                })
            }
            None => load,
        })
    }

    /// Whether a joint has no torque in any experiment: the first one about the vertical under a vertical force. Its
    /// models would cancel but for their remainders, and what is known of such a compliance from before alone
    /// has a large factor.
    fn is_silent(&self, joint: usize) -> bool {
        let LoadCase::Wrench([fx, fy, _, _, _, tz], _) = self.domain.load else {
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

    /// d: the sum over rows of |sum over n of `b_n` `tau_n` `J_n`|^2, and s^2 times that of `b_n` `tau_n` `z_n` where rotations are
    /// measured.
    fn plain(
        &self,
        workspace: &mut ModelWorkspace,
        axes: &[ModelVector],
        (levers, torques): (&[ModelVector], &[Option<TaylorModel>]),
        spread: &mut [Lanes; VARIABLES],
    ) -> TaylorModel {
        let scale = self.question.rotation_scale_m;
        let mut columns = [Vec::new(), Vec::new()];
        for (&joint, torque) in self.question.parameters.iter().zip(torques) {
            let Some(torque) = *torque else {
                for each in &mut columns {
                    each.push(NOWHERE);
                }
                continue;
            };
            let mut times = |part| workspace.sum().product(TermSign::Plus, part, torque).end();
            columns[0].push(levers[joint].map(&mut times));
            if scale > 0.0 {
                columns[1].push(axes[joint].map(&mut times));
            }
        }
        let rows = &self.question.rows;
        let [moved, turned] = columns;
        let moved = squares_of_rows(workspace, rows, 1.0, &moved, spread);
        if scale == 0.0 {
            return moved;
        }
        let turned = squares_of_rows(workspace, rows, scale, &turned, spread);
        workspace.sum().add(1.0, moved).add(1.0, turned).end()
    }

    /// The form Q with d = F^T Q F: the sum over rows of the squares of W = sum over n of `b_n` `J_n` `J_n^T`, times
    /// the square of the force; where rotations are measured that of V^T V, too, V = s times the sum of `b_n` `z_n` `J_n^T`.
    fn form(
        &self,
        workspace: &mut ModelWorkspace,
        axes: &[ModelVector],
        levers: &[ModelVector],
        spread: &mut [Lanes; VARIABLES],
    ) -> [TaylorModel; 6] {
        let LoadCase::Any(size) = self.domain.load else {
            return [TaylorModel::ZERO; 6];
        };
        let dyads: Vec<[TaylorModel; 6]> = (self.question.parameters.iter())
            .map(|&joint| match levers.get(joint) {
                Some(lever) => ENTRIES.map(|[i, j]| {
                    workspace
                        .sum()
                        .product(TermSign::Plus, lever[i], lever[j])
                        .end()
                }),
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
        for row in &rows {
            for entry in row {
                workspace.add_spread(*entry, spread);
            }
        }
        let turned = self.turned_rows(workspace, axes, levers, size);
        for entry in turned.iter().flatten().flatten() {
            workspace.add_spread(*entry, spread);
        }
        ENTRIES.map(|[i, j]| {
            let mut sum = workspace.sum();
            for row in &rows {
                for k in 0..3 {
                    sum = sum.product(TermSign::Plus, row[place(i, k)], row[place(k, j)]);
                }
            }
            for row in turned.iter().flatten() {
                sum = sum.product(TermSign::Plus, row[i], row[j]);
            }
            sum.end()
        })
    }

    /// The rows of V for each row of B, times the force; none where rotations are not measured.
    fn turned_rows(
        &self,
        workspace: &mut ModelWorkspace,
        axes: &[ModelVector],
        levers: &[ModelVector],
        size: f64,
    ) -> Vec<[ModelVector; 3]> {
        let scale = self.question.rotation_scale_m;
        if scale == 0.0 {
            return Vec::new();
        }
        let parameters = &self.question.parameters;
        let dyads: Vec<[ModelVector; 3]> = (parameters.iter())
            .map(|&joint| match levers.get(joint) {
                Some(lever) => axes[joint].map(|turn| {
                    lever.map(|part| workspace.sum().product(TermSign::Plus, turn, part).end())
                }),
                None => [NOWHERE; 3],
            })
            .collect();
        (self.question.rows.iter())
            .map(|row| {
                std::array::from_fn(|k| {
                    std::array::from_fn(|i| {
                        let mut sum = workspace.sum();
                        for (factor, dyad) in row.iter().zip(&dyads) {
                            let factor = factor * size * scale;
                            sum = sum.add_constant(factor, 3.0 * UNIT * factor.abs(), dyad[k][i]);
                        }
                        sum.end()
                    })
                })
            })
            .collect()
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
        if let (true, Some(sine)) = (needs_tool_axis(region), region.elevation_sine) {
            let rise = dot(workspace, &[(&up, &geometry.tool_axis)]);
            add(workspace, rise, 1.0, sine, 0.0);
            add(workspace, rise, -1.0, sine, 0.0);
        }
    }

    /// |`J_j` . F + `z_j` . T + `z_j` . (moment of gravity)| <= limit.
    fn add_torque_margins(
        &self,
        workspace: &mut ModelWorkspace,
        (geometry, levers): (&BoxGeometry, &[ModelVector]),
        [force, torque]: &[ModelVector; 2],
        limits: &[f64],
        margins: &mut Vec<TaylorModel>,
    ) {
        let nothing = [TaylorModel::ZERO; 3];
        let gravity = vector(self.question.arm.gravity_m_s2);
        let gravity = constant_in(workspace, &geometry.world, &gravity, &nothing, 1.0);
        let one = workspace.constant(1.0, 0.0);
        let mut moment = nothing;
        for (joint, link) in self.chain.links.iter().enumerate().rev() {
            // The weights of all links behind are a force and a moment about this joint's anchor.
            moment = std::array::from_fn(|row| {
                let sum = workspace.sum().add(1.0, moment[row]);
                sum.add(link.mass, geometry.centre[joint][row]).end()
            });
            let mass: f64 = self.chain.links[joint..].iter().map(|each| each.mass).sum();
            let count = self.chain.links.len() as f64;
            let arm: ModelVector = std::array::from_fn(|row| {
                let sum = workspace.sum().add(1.0, moment[row]);
                sum.add_constant(-mass, count * UNIT * mass, geometry.anchor[joint][row])
                    .end()
            });
            let Some(limit) = limits.get(joint).filter(|limit| limit.is_finite()) else {
                continue;
            };
            let weight = cross(workspace, &arm, &gravity);
            let axis = &geometry.axis[joint];
            let total = match levers.get(joint) {
                Some(lever) => dot(
                    workspace,
                    &[(axis, &weight), (lever, force), (axis, torque)],
                ),
                None => dot(workspace, &[(axis, &weight)]),
            };
            for sign in [1.0, -1.0] {
                let sum = workspace.sum().add(sign, total);
                margins.push(sum.add(*limit, one).end());
            }
        }
    }
}
