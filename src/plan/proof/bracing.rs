//! What springs beside the joints' own make of the columns of an arm's Jacobian J over boxes.
//!
//! A spring along a path of length L has the energy E(L), and a stiffness about the joints
//!
//! ```text
//! S_ij = E''(L) dL/dq_i dL/dq_j + E'(L) d2L/(dq_i dq_j)
//! ```
//!
//! and what joints with the compliances k show of a load is told by J M in place of J, M = (I + k S)^-1. With X, the inverse of
//! A = I + k S at a box's centre in doubles, and E = I - A X, which is small over a small box,
//!
//! ```text
//! M = X (I - E)^-1 = X (I + E + E^2 + R),   |R_ij| <= e^3 / (1 - e),   e >= |E| the largest sum of a row
//! ```
//!
//! 1 / L for a piece of a path is the root of 1 / L^2: with y = `y_0` (1 + t), |t| <= u < 1,
//!
//! ```text
//! y^-1/2 = y_0^-1/2 (1 - t/2 + 3/8 t^2 + r),   |r| <= 5/16 u^3 (1 - u)^-7/2
//! ```
//!
//! Over boxes where E may be 1/2, a piece's length near nought, or a spring both stretched and in its dead band, less is known, or nothing.
//! Between what M's entries are over all of the region is worked out first, box by box of what springs depend on, and stands in where
//! a wide box says less.

use nalgebra::DMatrix;

use super::chain::Chain;
use super::form::centre;
use super::geometry::BoxGeometry;
use super::question::{ProofSpring, ProofSprings};
use super::rounding::{UNIT, UP};
use super::taylor::{LANES, Lanes, ModelVector, ModelWorkspace, TaylorModel, TermSign};
use super::vectors::{NOWHERE, cross, difference, dot};

/// Beyond this change of a square, as a share, nothing is known of its root.
const WIDEST: f64 = 0.9;
/// The same for E.
const LARGEST: f64 = 0.5;

/// Between what M's entries are over all of a region, row by row.
pub(super) type MobilityRange = Vec<Vec<[f64; 2]>>;

/// What springs make of the joints' columns over boxes.
#[derive(Debug, Clone)]
pub(super) struct Bracing {
    /// Joints that springs couple, in groups of their own, with M row by row.
    groups: Vec<(Vec<usize>, Vec<TaylorModel>)>,
    /// The torque of the springs about each joint.
    pub torque: Vec<TaylorModel>,
}

impl Bracing {
    /// `coordinates` are those of the joints that have springs, nought for others.
    pub fn new(
        workspace: &mut ModelWorkspace,
        springs: &ProofSprings,
        chain: &Chain,
        geometry: &BoxGeometry,
        coordinates: &[TaylorModel],
        everywhere: Option<&MobilityRange>,
    ) -> Self {
        let count = chain.links.len();
        let mut all = SpringStiffness {
            entries: vec![vec![TaylorModel::ZERO; count]; count],
            torque: vec![TaylorModel::ZERO; count],
        };
        let one = workspace.constant(1.0, 0.0);
        for &(joint, stiffness, rest) in springs.in_joints.iter().filter(|each| each.0 < count) {
            let own = workspace.constant(stiffness, 0.0);
            all.stiffen(workspace, [joint, joint], own);
            let sum = workspace.sum().add(1.0, coordinates[joint]);
            let stretched = sum.add(-rest, one).end();
            let sum = workspace.sum().add(1.0, all.torque[joint]);
            all.torque[joint] = sum.add(-stiffness, stretched).end();
        }
        let mut first = 0;
        for spring in &springs.between {
            let places = &geometry.places[first..first + spring.path.len()];
            first += spring.path.len();
            all.span(workspace, spring, places, (chain, geometry));
        }
        let groups = groups(springs, count)
            .into_iter()
            .map(|joints| {
                let mut mobility = mobility(workspace, &joints, &springs.compliance, &all.entries);
                if let Some(everywhere) = everywhere {
                    for (index, entry) in mobility.iter_mut().enumerate() {
                        let [row, column] = place(&joints, index);
                        *entry = within(workspace, *entry, everywhere[row][column]);
                    }
                }
                (joints, mobility)
            })
            .collect();
        Self {
            groups,
            torque: all.torque,
        }
    }

    /// The joints' columns times M, of as many joints as there are.
    pub fn braced(
        &self,
        workspace: &mut ModelWorkspace,
        columns: &[ModelVector],
    ) -> Vec<ModelVector> {
        let mut all = columns.to_vec();
        all.resize(self.torque.len(), NOWHERE);
        let plain = all.clone();
        for (joints, mobility) in &self.groups {
            let size = joints.len();
            for (place, &joint) in joints.iter().enumerate() {
                all[joint] = std::array::from_fn(|axis| {
                    let mut sum = workspace.sum();
                    for (row, &other) in joints.iter().enumerate() {
                        let share = mobility[row * size + place];
                        sum = sum.product(TermSign::Plus, plain[other][axis], share);
                    }
                    sum.end()
                });
            }
        }
        all
    }

    /// Between what M's entries are, lane by lane: the joints of the row and of the column, and the range.
    pub fn ranges(&self, workspace: &mut ModelWorkspace) -> Vec<([usize; 2], [Lanes; 2])> {
        let mut ranges = Vec::new();
        for (joints, mobility) in &self.groups {
            for (index, entry) in mobility.iter().enumerate() {
                let (middle, wide) = around(workspace, *entry);
                let end = |sign: f64| -> Lanes {
                    std::array::from_fn(|lane| {
                        let rounding = 4.0 * UNIT * (middle[lane].abs() + wide[lane]);
                        middle[lane] + sign * (wide[lane] + rounding)
                    })
                };
                ranges.push((place(joints, index), [end(-1.0), end(1.0)]));
            }
        }
        ranges
    }
}

/// The joints of the row and of the column of a group's entry.
fn place(joints: &[usize], index: usize) -> [usize; 2] {
    [joints[index / joints.len()], joints[index % joints.len()]]
}

/// A model, or the range that it has everywhere, in the lanes where its remainder says less.
fn within(
    workspace: &mut ModelWorkspace,
    model: TaylorModel,
    [low, high]: [f64; 2],
) -> TaylorModel {
    let middle = f64::midpoint(low, high);
    let wide = (high - middle).max(middle - low) * UP;
    if !wide.is_finite() {
        return model;
    }
    let is_wider = workspace
        .remainder(model)
        .map(|off| off.is_nan() || off > wide);
    if is_wider.contains(&true) {
        let (values, errors) = ([middle; LANES], [wide; LANES]);
        workspace.or_constants(model, is_wider, &values, &errors)
    } else {
        model
    }
}

/// Joints that springs couple, in ascending order.
fn groups(springs: &ProofSprings, count: usize) -> Vec<Vec<usize>> {
    let mut spans: Vec<[usize; 2]> = (springs.in_joints.iter())
        .map(|&(joint, _, _)| [joint, joint + 1])
        .chain(springs.between.iter().map(|spring| {
            let joints = spring.joints();
            [joints.start, joints.end.min(count)]
        }))
        .filter(|[start, end]| start < end && *end <= count)
        .collect();
    spans.sort_unstable();
    let mut groups: Vec<[usize; 2]> = Vec::new();
    for [start, end] in spans {
        match groups.last_mut() {
            Some(last) if start < last[1] => last[1] = last[1].max(end),
            _ => groups.push([start, end]),
        }
    }
    groups
        .into_iter()
        .map(|[start, end]| (start..end).collect())
        .collect()
}

/// The springs' stiffness about the joints, and their torques.
struct SpringStiffness {
    entries: Vec<Vec<TaylorModel>>,
    torque: Vec<TaylorModel>,
}

/// A straight piece of a spring.
struct Piece {
    /// Which places are its ends.
    ends: [usize; 2],
    /// From the one to the other.
    way: ModelVector,
    /// One over its length.
    inverse: TaylorModel,
}

impl SpringStiffness {
    fn stiffen(&mut self, workspace: &mut ModelWorkspace, [i, j]: [usize; 2], by: TaylorModel) {
        let sum = workspace.sum().add(1.0, self.entries[i][j]);
        let entry = sum.add(1.0, by).end();
        (self.entries[i][j], self.entries[j][i]) = (entry, entry);
    }

    /// Adds a spring through these places.
    fn span(
        &mut self,
        workspace: &mut ModelWorkspace,
        spring: &ProofSpring,
        places: &[ModelVector],
        (chain, geometry): (&Chain, &BoxGeometry),
    ) {
        let mut length = TaylorModel::ZERO;
        let mut pieces = Vec::new();
        for from in 0..places.len() - 1 {
            let way = difference(workspace, &places[from + 1], &places[from]);
            let square = dot(workspace, &[(&way, &way)]);
            let inverse = inverse_root(workspace, square);
            let sum = workspace.sum().add(1.0, length);
            length = sum.product(TermSign::Plus, square, inverse).end();
            // A piece that one link carries whole keeps its length.
            if spring.path[from].0 != spring.path[from + 1].0 {
                let ends = [from, from + 1];
                pieces.push(Piece { ends, way, inverse });
            }
        }
        let [tension, along] = tension(workspace, spring, length);
        let joints = spring.joints();
        let moved = |workspace: &mut ModelWorkspace, joint: usize| -> Vec<ModelVector> {
            (spring.path.iter().zip(places))
                .map(|(&(at, _), place)| {
                    if joint < at {
                        geometry.moves(workspace, chain, joint, place)
                    } else {
                        NOWHERE
                    }
                })
                .collect()
        };
        let moves: Vec<Vec<ModelVector>> = joints
            .clone()
            .map(|joint| moved(workspace, joint))
            .collect();
        // How each joint changes each piece, and how much of that is along it.
        let changes: Vec<Vec<(ModelVector, TaylorModel)>> = (moves.iter())
            .map(|moves| {
                let change = |piece: &Piece| {
                    let [from, to] = piece.ends;
                    let change = difference(workspace, &moves[to], &moves[from]);
                    let along = dot(workspace, &[(&change, &piece.way)]);
                    let sum = workspace.sum();
                    let along = sum.product(TermSign::Plus, along, piece.inverse).end();
                    (change, along)
                };
                pieces.iter().map(change).collect()
            })
            .collect();
        let longer: Vec<TaylorModel> = (changes.iter())
            .map(|changes| {
                let mut sum = workspace.sum();
                for (_, along) in changes {
                    sum = sum.add(1.0, *along);
                }
                sum.end()
            })
            .collect();
        for (index, joint) in joints.clone().enumerate() {
            let sum = workspace.sum().add(1.0, self.torque[joint]);
            self.torque[joint] = sum.product(TermSign::Minus, tension, longer[index]).end();
            for (before, other) in joints.clone().enumerate().take(index + 1) {
                let turning = &geometry.turning[other];
                let mut bend = TaylorModel::ZERO;
                for (number, piece) in pieces.iter().enumerate() {
                    let [(one, one_along), (two, two_along)] =
                        [&changes[index][number], &changes[before][number]];
                    let [from, to] = piece
                        .ends
                        .map(|end| cross(workspace, turning, &moves[index][end]));
                    let both = difference(workspace, &to, &from);
                    let whole = dot(workspace, &[(one, two), (&both, &piece.way)]);
                    let sum = workspace.sum().add(1.0, whole);
                    let across = sum.product(TermSign::Minus, *one_along, *two_along).end();
                    let sum = workspace.sum().add(1.0, bend);
                    bend = sum.product(TermSign::Plus, across, piece.inverse).end();
                }
                let sum = workspace.sum();
                let squared = sum
                    .product(TermSign::Plus, longer[index], longer[before])
                    .end();
                let sum = workspace.sum().product(TermSign::Plus, along, squared);
                let change = sum.product(TermSign::Plus, tension, bend).end();
                self.stiffen(workspace, [joint, other], change);
            }
        }
    }
}

/// A model less its constant part, that part, and a bound of the former.
fn around(workspace: &mut ModelWorkspace, model: TaylorModel) -> (Lanes, Lanes) {
    let middle = workspace.coefficients(model)[0];
    let constant = workspace.constants(&middle, &[0.0; LANES]);
    let sum = workspace.sum().add(1.0, model);
    let rest = sum.add(-1.0, constant).end();
    (middle, workspace.bound(rest))
}

/// 1 / sqrt(y); nothing is known of it where y changes too much.
fn inverse_root(workspace: &mut ModelWorkspace, y: TaylorModel) -> TaylorModel {
    let one = workspace.constant(1.0, 0.0);
    let middle = workspace.coefficients(y)[0];
    let is_known = middle.map(|middle| middle > 1e-200 && middle < 1e200);
    let over: Lanes = std::array::from_fn(|lane| {
        if is_known[lane] {
            1.0 / middle[lane]
        } else {
            1.0
        }
    });
    let off = |factors: &Lanes| {
        factors
            .iter()
            .fold(0.0_f64, |most, each| most.max(each.abs()))
    };
    let t = workspace
        .sum()
        .add_lanes(&over, 2.0 * UNIT * off(&over), y)
        .add(-1.0, one)
        .end();
    let widest = workspace.bound(t);
    let rest: Lanes = std::array::from_fn(|lane| {
        let u = widest[lane];
        if is_known[lane] && u < WIDEST {
            // Some 20 roundings.
            0.3125 * u * u * u * (1.0 - u).powf(-3.5) * (1.0 + 1e-12)
        } else {
            f64::INFINITY
        }
    });
    let rest = workspace.constants(&[0.0; LANES], &rest);
    let square = workspace.sum().square(t).end();
    let series = workspace
        .sum()
        .add(1.0, one)
        .add(-0.5, t)
        .add(0.375, square)
        .add(1.0, rest)
        .end();
    // Off by a root, a quotient and that of `over`, of which `t` knows.
    let root: Lanes = std::array::from_fn(|lane| {
        if is_known[lane] {
            1.0 / middle[lane].sqrt()
        } else {
            1.0
        }
    });
    let error = 4.0 * UNIT * off(&root);
    workspace.sum().add_lanes(&root, error, series).end()
}

/// E'(L) and E''(L).
fn tension(
    workspace: &mut ModelWorkspace,
    spring: &ProofSpring,
    length: TaylorModel,
) -> [TaylorModel; 2] {
    let stiffness = spring.stiffness_n_per_m;
    let [low, high] = spring.rest_m;
    let (middle, wide) = around(workspace, length);
    let (mut slope, mut plus, mut off) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    let (mut second, mut second_off) = ([0.0; LANES], [0.0; LANES]);
    for lane in 0..LANES {
        let shortest = middle[lane] - wide[lane] * UP - UNIT * middle[lane].abs();
        let longest = middle[lane] + wide[lane] * UP + UNIT * middle[lane].abs();
        let rest = if shortest >= high || low >= high {
            Some(high)
        } else if longest <= low {
            Some(low)
        } else {
            None
        };
        if let Some(rest) = rest {
            (slope[lane], second[lane]) = (stiffness, stiffness);
            plus[lane] = -stiffness * rest;
            off[lane] = UNIT * plus[lane].abs();
        } else if shortest < low || longest > high {
            // Both in its dead band and out of it: between the tensions at the ends.
            let least = stiffness * (shortest - low).min(0.0);
            let most = stiffness * (longest - high).max(0.0);
            plus[lane] = f64::midpoint(least, most);
            off[lane] = ((most - least) / 2.0 + 4.0 * UNIT * (most.abs() + least.abs())) * UP;
            (second[lane], second_off[lane]) = (stiffness / 2.0, stiffness / 2.0);
        }
        if !wide[lane].is_finite() {
            off[lane] = f64::INFINITY;
        }
    }
    let plus = workspace.constants(&plus, &off);
    let sum = workspace.sum().add_lanes(&slope, 0.0, length);
    let tension = sum.add(1.0, plus).end();
    [tension, workspace.constants(&second, &second_off)]
}

/// M = (I + k S)^-1 for some joints, row by row.
fn mobility(
    workspace: &mut ModelWorkspace,
    joints: &[usize],
    compliance: &[f64],
    stiffness: &[Vec<TaylorModel>],
) -> Vec<TaylorModel> {
    let size = joints.len();
    let places: Vec<[usize; 2]> = (0..size * size).map(|k| [k / size, k % size]).collect();
    let at = |row: usize, column: usize| row * size + column;
    let one = workspace.constant(1.0, 0.0);
    let unit = |row: usize, column: usize| if row == column { 1.0 } else { 0.0 };
    let mut system = Vec::new();
    for &[row, column] in &places {
        let entry = stiffness[joints[row]][joints[column]];
        let sum = workspace.sum().add(compliance[joints[row]], entry);
        system.push(sum.add(unit(row, column), one).end());
    }
    let mut inverse = vec![[0.0; LANES]; size * size];
    for lane in 0..LANES {
        let matrix = DMatrix::from_fn(size, size, |row, column| {
            centre(workspace, system[at(row, column)], lane)
        });
        // Any X will do; where there is none, E is not small.
        let matrix = (matrix.try_inverse())
            .filter(|inverse| inverse.iter().all(|value| value.is_finite()))
            .unwrap_or_else(|| DMatrix::identity(size, size));
        for &[row, column] in &places {
            inverse[at(row, column)][lane] = matrix[(row, column)];
        }
    }
    let mut missing = Vec::new();
    for &[row, column] in &places {
        let mut sum = workspace.sum().add(unit(row, column), one);
        for k in 0..size {
            let factor = inverse[at(k, column)].map(|value| -value);
            sum = sum.add_lanes(&factor, 0.0, system[at(row, k)]);
        }
        missing.push(sum.end());
    }
    let mut largest = [0.0_f64; LANES];
    for row in 0..size {
        let mut sums = [0.0; LANES];
        for column in 0..size {
            let bound = workspace.bound(missing[at(row, column)]);
            for lane in 0..LANES {
                sums[lane] += bound[lane];
            }
        }
        for lane in 0..LANES {
            // What is no number stays so.
            if sums[lane].is_nan() || sums[lane] > largest[lane] {
                largest[lane] = sums[lane];
            }
        }
    }
    let rest = largest.map(|e| {
        let e = e * UP;
        if e < LARGEST {
            e * e * e / (1.0 - e) * UP
        } else {
            f64::INFINITY
        }
    });
    let series: Vec<TaylorModel> = places
        .iter()
        .map(|&[row, column]| {
            let sum = workspace.sum().add(1.0, missing[at(row, column)]);
            let mut sum = sum.add(unit(row, column), one);
            for k in 0..size {
                let [left, right] = [missing[at(row, k)], missing[at(k, column)]];
                sum = sum.product(TermSign::Plus, left, right);
            }
            sum.end()
        })
        .collect();
    places
        .iter()
        .map(|&[row, column]| {
            let size_of =
                |lane: usize| -> f64 { (0..size).map(|k| inverse[at(row, k)][lane].abs()).sum() };
            let off: Lanes = std::array::from_fn(|lane| size_of(lane) * rest[lane] * UP);
            let off = workspace.constants(&[0.0; LANES], &off);
            let mut sum = workspace.sum().add(1.0, off);
            for k in 0..size {
                sum = sum.add_lanes(&inverse[at(row, k)], 0.0, series[at(k, column)]);
            }
            sum.end()
        })
        .collect()
}
