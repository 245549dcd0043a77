//! Joint angles for absolute poses: the inverse kinematics of an identified arm at rest under gravity and a load.

use nalgebra::{DMatrix, DVector, Isometry3, UnitQuaternion, Vector3};

use crate::identification::JointError;
use crate::parameter::ElasticArm;
use crate::robot::{EquilibriumSolver, Load, SerialChain, rotation_vector};

/// The tool is where it should be when it is as near as this (m, rad).
const REACHED: f64 = 1e-10;
/// So many steps are tried from one start.
const MAXIMUM_STEPS: usize = 200;
/// So far may a joint move in one step (rad, m).
const LONGEST_STEP: f64 = 0.3;
/// The first damping, relative to the Jacobian's largest square.
const FIRST_DAMPING: f64 = 1e-6;
/// Less makes no difference but for rounding.
const LEAST_DAMPING: f64 = 1e-13;
/// A joint's limit is kept but for rounding (rad, m).
const ROUNDING: f64 = 1e-9;
/// Commands are corrected at most so often by what joints stand off: each step leaves the share by which that changes with the angle.
const OFFSET_STEPS: usize = 500;
/// Less makes no difference (rad, m).
const SETTLED: f64 = 1e-12;
/// So often the ends of joints' ranges are moved by what commands are corrected by there: each time by what the last left.
const ENDS: usize = 6;
/// So many configurations all over the joints' ranges are started from where others do not lead there.
const STARTS: usize = 48;

/// Where a tool must be, under a load.
#[derive(Debug, Clone, PartialEq)]
pub struct AbsoluteTarget {
    /// The tool's position in the frame of the robot's base (m).
    pub position_m: Vector3<f64>,
    /// The tool's axes there; any are good without.
    pub rotation: Option<UnitQuaternion<f64>>,
    /// The load at the tool, in the axes of the base.
    pub load: Load,
}

/// Why a target has no angles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Unreachable {
    /// The tool comes no nearer than this.
    TooFar {
        /// Its position (m).
        distance_m: f64,
        /// Its orientation (rad).
        angle_rad: f64,
    },
    /// What a joint stands off changes faster with its angle than the joint turns: no one command leads there.
    Unsettled {
        /// The joint's place in the chain.
        joint: usize,
    },
    /// A joint softens and cannot hold what it carries there.
    GivesWay {
        /// The joint's place in the chain.
        joint: usize,
    },
    /// It is reached only where a joint is beyond its range.
    BeyondRange {
        /// The joint's place in the chain.
        joint: usize,
        /// Where it would be (rad, m).
        coordinate: f64,
    },
}

impl AbsoluteTarget {
    /// A target that is given in another frame than the base's.
    pub fn in_frame(
        base_from_frame: &Isometry3<f64>,
        position_m: &Vector3<f64>,
        rotation: Option<UnitQuaternion<f64>>,
        load: Load,
    ) -> Self {
        Self {
            position_m: base_from_frame.rotation * position_m + base_from_frame.translation.vector,
            rotation: rotation.map(|rotation| base_from_frame.rotation * rotation),
            load,
        }
    }
}

/// Finds commands for a tool of an identified arm.
#[derive(Debug)]
pub struct InverseKinematics<'a> {
    arm: &'a ElasticArm,
    chain: SerialChain,
    tool: usize,
    errors: &'a [JointError],
    commanded: Vec<usize>,
    solver: EquilibriumSolver,
    response: DMatrix<f64>,
}

impl<'a> InverseKinematics<'a> {
    /// For one of the arm's tools, by its place, whose joints are off by these errors.
    pub fn new(arm: &'a ElasticArm, tool: usize, errors: &'a [JointError]) -> Self {
        let chain = arm.loaded_chain();
        Self {
            commanded: chain.commanded().collect(),
            solver: EquilibriumSolver::new(chain.len()),
            response: DMatrix::zeros(chain.len(), 6),
            chain,
            arm,
            tool,
            errors,
        }
    }

    /// The commanded configuration (rad, m) within the joints' ranges in which the tool rests at the target: the first that
    /// is found from `starts`, or from others all over the ranges.
    ///
    /// # Errors
    /// The tool cannot be brought there.
    pub fn commands(
        &mut self,
        target: &AbsoluteTarget,
        starts: &[DVector<f64>],
    ) -> Result<DVector<f64>, Unreachable> {
        let others: Vec<_> = (1..=STARTS).map(|number| self.spread(number)).collect();
        let near = starts.first().unwrap_or(&others[0]).clone();
        let mut failure = NOWHERE;
        for start in starts.iter().chain(&others) {
            // Where the free way leaves the ranges, one along their ends may not: where joints stand at the ends of their commands.
            let mut ends: Option<Vec<[f64; 2]>> = None;
            for _ in 0..=ENDS {
                let found = (self.search(target, start, ends.as_deref())).and_then(|stands| {
                    // What joints are off by is told of their ranges alone.
                    let stands = self.turned(stands, &near);
                    let commands = self.before_offsets(&stands, &target.load)?;
                    ends = Some(self.ends(&(stands - &commands)));
                    self.within_range(commands)
                });
                match found {
                    Ok(commands) => return Ok(commands),
                    Err(new) => {
                        let is_beyond = matches!(new, Unreachable::BeyondRange { .. });
                        if distance(&new) < distance(&failure) {
                            failure = new;
                        }
                        if !is_beyond {
                            break;
                        }
                    }
                }
            }
        }
        Err(failure)
    }

    /// What is left to the target at these commands: position (m), then rotation vector (rad); none without a rest.
    fn left(&mut self, target: &AbsoluteTarget, commands: &DVector<f64>) -> Option<DVector<f64>> {
        let standing: Vec<f64> = (commands.iter().zip(&self.arm.zero_rad))
            .map(|(q, zero)| q + zero)
            .collect();
        let compliance = &self.arm.compliance_rad_per_nm;
        let mut arm = self.chain.at(&self.arm.tools[self.tool]);
        (self
            .solver
            .solve(&mut arm, compliance, &standing, &target.load))
        .ok()?;
        let state = self.solver.state();
        let mut left: Vec<f64> = (target.position_m - state.tool_position)
            .as_slice()
            .to_vec();
        if let Some(rotation) = target.rotation {
            let wanted = rotation.to_rotation_matrix().into_inner();
            let turned = rotation_vector(&(wanted * state.tool_rotation.transpose()));
            left.extend(turned.iter());
        }
        Some(DVector::from_vec(left))
    }

    /// The ranges within which joints stand that are commanded within theirs, by how far they stand off (rad, m).
    fn ends(&self, off: &DVector<f64>) -> Vec<[f64; 2]> {
        let joints = self.chain.joints.iter().zip(off);
        (joints.map(|(joint, off)| joint.range_rad.map(|end| end + off))).collect()
    }

    /// Levenberg and Marquardt's way from a start, within ranges where there are any.
    fn search(
        &mut self,
        target: &AbsoluteTarget,
        start: &DVector<f64>,
        ends: Option<&[[f64; 2]]>,
    ) -> Result<DVector<f64>, Unreachable> {
        let mut commands = start.clone();
        let mut damping = FIRST_DAMPING;
        let mut left = self.left(target, &commands).ok_or(NOWHERE)?;
        for _ in 0..MAXIMUM_STEPS {
            if left.amax() <= REACHED || damping > 1e6 {
                break;
            }
            (self.solver).response(&self.arm.compliance_rad_per_nm, None, &mut self.response);
            let jacobian = DMatrix::from_fn(left.len(), self.commanded.len(), |row, column| {
                self.response[(self.commanded[column], row)]
            });
            let Some(mut step) = damped(&jacobian, &left, damping) else {
                damping *= 10.0;
                continue;
            };
            step *= (LONGEST_STEP / step.amax()).min(1.0);
            let mut next = commands.clone();
            for (&joint, by) in self.commanded.iter().zip(&step) {
                next[joint] += by;
                if let Some(ends) = ends {
                    let [low, high] = ends[joint];
                    next[joint] = next[joint].max(low).min(high);
                }
            }
            match self.left(target, &next) {
                Some(nearer) if nearer.norm() < left.norm() => {
                    (commands, left) = (next, nearer);
                    damping = (damping * 0.1).max(LEAST_DAMPING);
                }
                _ => {
                    damping *= 10.0;
                    // The response is that of the last rest.
                    left = self.left(target, &commands).ok_or(NOWHERE)?;
                }
            }
        }
        if left.amax() <= REACHED {
            return Ok(commands);
        }
        let turned = left.rows(3, left.len() - 3);
        Err(Unreachable::TooFar {
            distance_m: left.rows(0, 3).norm(),
            angle_rad: turned.norm(),
        })
    }

    /// What to command so that joints with their gears, their gaps, what they give besides their springs and their errors stand where others
    /// would with these commands; approached with all joints turning positively.
    fn before_offsets(
        &self,
        wanted: &DVector<f64>,
        load: &Load,
    ) -> Result<DVector<f64>, Unreachable> {
        let mut commands = wanted.clone();
        if !self.arm.leans() && self.arm.gear_waves.is_empty() && self.errors.is_empty() {
            return Ok(commands);
        }
        let mut moved = (0, f64::INFINITY);
        for _ in 0..OFFSET_STEPS {
            if moved.1 <= SETTLED {
                break;
            }
            let offsets = (self.arm).held_offsets_rad(commands.as_slice(), self.tool, load);
            let mut offsets = offsets.map_err(|joint| Unreachable::GivesWay { joint })?;
            for error in self.errors {
                offsets[error.joint] += error.at(commands.as_slice());
            }
            moved = (0, 0.0);
            for &joint in &self.commanded {
                let next = wanted[joint] + self.arm.zero_rad[joint] - offsets[joint];
                let by = (next - commands[joint]).abs();
                if by > moved.1 {
                    moved = (joint, by);
                }
                commands[joint] = next;
            }
        }
        match moved {
            (joint, by) if by > SETTLED => Err(Unreachable::Unsettled { joint }),
            _ => Ok(commands),
        }
    }

    /// The same configuration with hinges turned by whole turns into their ranges, or next to these, as near as can be to another one.
    fn turned(&self, mut stands: DVector<f64>, near: &DVector<f64>) -> DVector<f64> {
        for &joint in &self.commanded {
            let own = &self.chain.joints[joint];
            stands[joint] = own.turned_into(own.range_rad, stands[joint], near[joint]);
        }
        stands
    }

    /// The same commands, clear of rounding.
    fn within_range(&self, mut commands: DVector<f64>) -> Result<DVector<f64>, Unreachable> {
        for &joint in &self.commanded {
            let [low, high] = self.chain.joints[joint].range_rad;
            let range = low - ROUNDING..=high + ROUNDING;
            if !range.contains(&commands[joint]) {
                return Err(Unreachable::BeyondRange {
                    joint,
                    coordinate: commands[joint],
                });
            }
            commands[joint] = commands[joint].clamp(low, high);
        }
        Ok(commands)
    }

    /// A configuration, far from those of other numbers, with passive joints where they rest.
    fn spread(&self, number: usize) -> DVector<f64> {
        let mut q = self.chain.spread(number);
        for (coordinate, joint) in q.iter_mut().zip(&self.chain.joints) {
            *coordinate = joint.drive.passive_at.unwrap_or(*coordinate);
        }
        q
    }
}

/// The smallest step that J step = left asks for, damped: from the smaller of J^T J and J J^T, so that joints that are not
/// needed stay.
fn damped(jacobian: &DMatrix<f64>, left: &DVector<f64>, damping: f64) -> Option<DVector<f64>> {
    let is_wide = jacobian.nrows() <= jacobian.ncols();
    let mut normal = if is_wide {
        jacobian * jacobian.transpose()
    } else {
        jacobian.tr_mul(jacobian)
    };
    let scale = normal.diagonal().amax();
    for index in 0..normal.nrows() {
        normal[(index, index)] += damping * scale;
    }
    let factor = normal.cholesky()?;
    Some(if is_wide {
        jacobian.tr_mul(&factor.solve(left))
    } else {
        factor.solve(&jacobian.tr_mul(left))
    })
}

/// No start leads anywhere.
const NOWHERE: Unreachable = Unreachable::TooFar {
    distance_m: f64::INFINITY,
    angle_rad: f64::INFINITY,
};

/// How far a failure is from its target.
fn distance(failure: &Unreachable) -> f64 {
    match failure {
        Unreachable::BeyondRange { .. } | Unreachable::Unsettled { .. } => 0.0,
        Unreachable::GivesWay { .. } => f64::INFINITY,
        Unreachable::TooFar {
            distance_m,
            angle_rad,
        } => distance_m + angle_rad,
    }
}
