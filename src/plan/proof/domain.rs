//! The variables of a question under one load, their ranges, and what symmetry leaves of them.

use std::f64::consts::PI;

use super::chain::Chain;
use super::question::Question;
use super::rounding::LARGEST_ANGLE;
use super::taylor::VARIABLES;

/// One load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum LoadCase {
    /// A wrench.
    Wrench([f64; 6]),
    /// A force of any direction and this size (N).
    Any(f64),
}

/// A limit of one joint's angle where the variables are sums, later and earlier: low <= later - earlier <= high.
pub type AngleDifference = (usize, usize, [f64; 2]);

/// The variables of a question under one load.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Domain {
    pub load: LoadCase,
    /// The variable of each joint that has one; the others stay at zero.
    pub variable: Vec<Option<usize>>,
    /// The range of each variable, the sum of a joint's angle and of those before it in its run: the box to begin with.
    pub ranges: Vec<[f64; 2]>,
    pub differences: Vec<AngleDifference>,
}

/// A grid on which boxes can be halved thirty times without rounding.
const GRID: f64 = 1_048_576.0;
/// More than pi, on the grid.
const HALF_TURN: f64 = 3_294_200.0 / GRID;

impl Domain {
    /// `None` where there are too many variables or too large angles.
    pub fn new(question: &Question, chain: &Chain, load: LoadCase) -> Option<Self> {
        let count = chain.links.len();
        let joints = question.arm.joints.iter();
        let mut ranges_rad: Vec<[f64; 2]> = joints.map(|each| each.range_rad).collect();
        let moves = moving_joints(question, chain, load);
        let mut domain = Self {
            load,
            variable: vec![None; count],
            ranges: Vec::new(),
            differences: Vec::new(),
        };
        let mut is_free = vec![false; count];
        for joint in 0..count {
            let earlier = joint
                .checked_sub(1)
                .filter(|_| !chain.links[joint].starts_run)
                .and_then(|before| domain.variable[before]);
            if !moves[joint] {
                domain.variable[joint] = earlier;
                continue;
            }
            let [low, high] = &mut ranges_rad[joint];
            if chain.links[joint].sign < 0.0 {
                (*low, *high) = (-*high, -*low);
            }
            let [low, high] = [*low, *high];
            is_free[joint] = high - low >= 2.0 * HALF_TURN;
            let variable = domain.ranges.len();
            domain.variable[joint] = Some(variable);
            domain.ranges.push(if is_free[joint] {
                [-HALF_TURN, HALF_TURN]
            } else if let Some(earlier) = earlier {
                domain.differences.push((variable, earlier, [low, high]));
                let before = domain.ranges[earlier];
                outward(before[0] + low, before[1] + high)
            } else {
                outward(low, high)
            });
        }
        domain.reduce(chain, &is_free, &ranges_rad);
        let is_small = |[low, high]: &[f64; 2]| low.abs().max(high.abs()) < LARGEST_ANGLE;
        (domain.ranges.len() <= VARIABLES && domain.ranges.iter().all(is_small)).then_some(domain)
    }

    /// Leaves out what symmetry repeats.
    fn reduce(&mut self, chain: &Chain, is_free: &[bool], ranges_rad: &[[f64; 2]]) {
        let wrist = (0..chain.links.len().saturating_sub(2)).find(|&k| {
            let [low, high] = ranges_rad[k + 1];
            chain.is_wrist(k)
                && [k, k + 1, k + 2]
                    .iter()
                    .all(|&joint| self.variable[joint].is_some())
                && is_free[k]
                && is_free[k + 2]
                && (is_free[k + 1] || low + high == 0.0)
        });
        if let Some(variable) = wrist.and_then(|k| self.variable[k + 1]) {
            self.ranges[variable][0] = 0.0;
        }
        for across in 0..2 {
            let reverses = |joint: usize| chain.links[joint].axis != across;
            let symmetric = |joint: usize| {
                let [low, high] = ranges_rad[joint];
                self.variable[joint].is_none()
                    || !reverses(joint)
                    || is_free[joint]
                    || low + high == 0.0
            };
            let wrist_stays = wrist.is_none_or(|k| !reverses(k + 1));
            let joints = 0..chain.links.len();
            if chain.is_mirrored(across)
                && load_is_mirrored(self.load, across)
                && wrist_stays
                && joints.clone().all(symmetric)
            {
                let first = joints
                    .filter(|&joint| reverses(joint))
                    .find_map(|joint| self.variable[joint]);
                if let Some(variable) = first {
                    self.ranges[variable][0] = 0.0;
                }
                return;
            }
        }
    }
}

/// Whether the mirror image of a load gives the deflections' mirror image, or its opposite.
fn load_is_mirrored(load: LoadCase, across: usize) -> bool {
    let LoadCase::Wrench([fx, fy, fz, tx, ty, tz]) = load else {
        return true;
    };
    let (force, torque) = ([fx, fy, fz], [tx, ty, tz]);
    let only = |vector: [f64; 3], inside: bool| {
        (0..3).all(|k| (k == across) == inside || vector[k] == 0.0)
    };
    // The image of a torque, an axial vector, is reversed.
    (only(force, true) && only(torque, false)) || (only(force, false) && only(torque, true))
}

/// The joints whose angle matters; where none does, one all the same, so that there is a box to halve.
fn moving_joints(question: &Question, chain: &Chain, load: LoadCase) -> Vec<bool> {
    let count = chain.links.len();
    let mut moves = vec![true; count];
    let is_vertical = match load {
        LoadCase::Wrench([fx, fy, _, tx, ty, _]) => {
            [fx, fy, tx, ty].iter().all(|part| *part == 0.0)
        }
        LoadCase::Any(_) => true,
    };
    if is_vertical && chain.is_first_upright() {
        moves[0] = false;
    }
    if chain.turns_tool_on_the_spot(question.region.elevation_sine.is_some()) {
        moves[count - 1] = false;
    }
    if !moves.contains(&true) {
        moves[0] = true;
    }
    moves
}

/// A range that holds both, on the grid.
fn outward(low: f64, high: f64) -> [f64; 2] {
    // Scaling by a power of two is exact; one step more covers the rounding of a sum.
    [
        ((low * GRID).floor() - 1.0) / GRID,
        ((high * GRID).ceil() + 1.0) / GRID,
    ]
}

const _: () = assert!(HALF_TURN > PI && HALF_TURN < PI + 1e-5);
