//! Deflections to first order in compliance (eqs. 3, 4 and 7, extended), as planning needs them: their
//! derivatives with respect to any parameters, their covariance, and the derivatives of both with
//! respect to the configuration and the load. Does not allocate.
//!
//! Everything is made of the columns `J_n`, `z_n` of the Jacobian and the nominal compliances `k_n`:
//!
//! ```text
//! tau_n = J_n . F + z_n . T,      dp = sum k_n tau_n J_n
//! ```
//!
//! A parameter of geometry moves all that is beyond a place of the chain, as a joint there would, whose
//! columns are `J_v`, `z_v`. It changes `J_n` by `z_v` x `J_n` and `z_n` by `z_v` x `z_n` for the joints n
//! beyond it, and `J_n` by `z_n` x `J_v` for those before. The same holds for the derivatives with respect to the
//! joint angles of the columns themselves, so that a cost's derivatives with respect to all columns (adjoints `a`
//! of `J`, `c` of `z`) give its gradient in one sweep:
//!
//! ```text
//! d/dq_j = z_j . sum (J_n x a_n + z_n x c_n)  over what is at or beyond j   +   J_j . sum a_n x z_n  over the rest
//! ```

mod adjoint;
mod covariance;

use std::cell::RefCell;

use nalgebra::{Matrix3, Matrix3xX, Rotation3, Vector3};

use crate::parameter::{
    Axis, Backlash, ElasticArm, GearWave, ParameterKind, ParameterSet, ReadingSource, Unloaded,
    along,
};
use crate::robot::{Approach, KinematicState, Load};

/// What a deflection's columns are made of.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Column {
    /// `J_n tau_n` of a joint.
    Compliance(usize),
    /// What a motion of all beyond a place changes.
    Place(usize),
    /// What a joint stands off its spring by as weight and load have it.
    OffSpring(usize),
    /// What a wave in a joint's gear moves.
    Wave(usize),
    /// The deflection itself.
    LoadScale,
    /// The deflection under a force of 1 N along the load's.
    LoadOffset,
    /// The deflection turned about an axis.
    Turned(Vector3<f64>),
    /// The deflection itself, at a test pose alone.
    TaskScale,
    /// The deflection under a force of 1 N along an axis, at a test pose alone.
    TaskForce(Axis),
    /// Seen as it is, along an axis.
    Seen(Axis),
    /// It does not show in a deflection to first order.
    Silent,
}

/// A motion of all that is beyond a place of the chain.
#[derive(Debug, Clone, Copy, PartialEq)]
struct FramePlace {
    /// The first joint that it moves.
    moved_from: usize,
    motion: PlaceMotion,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum PlaceMotion {
    /// That of a joint.
    Joint,
    /// Along an axis of the frame of a link (as it is at zero angle).
    LinkAlong(Axis),
    /// About such an axis.
    LinkAbout(Axis),
    /// Along an axis of the tool.
    ToolAlong(Axis),
}

/// A joint that stands off its spring as weight and load have it: on a side of its gap, or by what it gives besides. With its lever J
/// and that shape f, a deflection follows a half width of the gap, or a share, by
///
/// ```text
/// f(tau_w + tau_l) dp_n + (f(tau_w + tau_l) - f(tau_w)) J,     tau_l = J . F + z . T
/// ```
///
/// where `tau_w` is the torque of the arm's own weight and `dp_n` what turning the joint changes of the deflection.
#[derive(Debug, Clone, Copy, PartialEq)]
struct OffSpring {
    joint: usize,
    is_gap: bool,
    came_positively: bool,
    weight_nm: f64,
}

/// Columns of a Jacobian, position rows above rotation rows, and the adjoints of both.
#[derive(Debug, Clone, Copy)]
struct Lever {
    position: Vector3<f64>,
    rotation: Vector3<f64>,
    of_position: Vector3<f64>,
    of_rotation: Vector3<f64>,
}

impl Lever {
    const NONE: Self = Self {
        position: Vector3::new(0.0, 0.0, 0.0),
        rotation: Vector3::new(0.0, 0.0, 0.0),
        of_position: Vector3::new(0.0, 0.0, 0.0),
        of_rotation: Vector3::new(0.0, 0.0, 0.0),
    };

    const fn at(position: Vector3<f64>, rotation: Vector3<f64>) -> Self {
        Self {
            position,
            rotation,
            ..Self::NONE
        }
    }

    fn torque(&self, load: &Load) -> f64 {
        self.position.dot(&load.force_n) + self.rotation.dot(&load.torque_nm)
    }

    /// By how much a motion with lever `v`, of all that is beyond this joint or of this joint, too, changes its columns.
    fn moved_by(&self, v: &Self, is_before: bool) -> (Vector3<f64>, Vector3<f64>) {
        if is_before {
            (self.rotation.cross(&v.position), Vector3::zeros())
        } else {
            (
                v.rotation.cross(&self.position),
                v.rotation.cross(&self.rotation),
            )
        }
    }

    /// What turns with this lever's own motion.
    fn turned(&self) -> Vector3<f64> {
        self.position.cross(&self.of_position) + self.rotation.cross(&self.of_rotation)
    }

    /// What the motion of joints beyond it moves.
    fn carried(&self) -> Vector3<f64> {
        self.of_position.cross(&self.rotation)
    }
}

/// A believed arm's deflections at one of its tools, to first order in compliance at nominal parameters. Loads
/// are in the world frame, which is the instrument's.
#[derive(Debug, Clone)]
pub struct FirstOrder<'a> {
    arm: &'a ElasticArm,
    compliance: &'a [f64],
    columns: Vec<Column>,
    /// What each column is multiplied by.
    factors: Vec<f64>,
    /// Columns of gaps, with the joint and the size of each: the side of approach decides on their sign.
    gaps: Vec<(usize, usize, f64)>,
    off_springs: Vec<OffSpring>,
    /// Waves in the gears of joints, with the angles (rad) that these are commanded.
    waves: Vec<(usize, GearWave, f64)>,
    places: Vec<FramePlace>,
    /// The variance of each coordinate of a deflection by the instrument alone (m^2).
    variance_m2: f64,
    sources: &'a [ReadingSource],
    /// Which reading without the load deflections rest on.
    unloaded: Unloaded,
    /// How often an experiment is repeated.
    repeats: f64,
    /// The tool's place at the last configuration (m).
    tool_position: Vector3<f64>,
    joints: Vec<Lever>,
    levers: Vec<Lever>,
    /// What was seen last: its gradient is asked for next.
    seen: RefCell<SeenHere>,
}

/// What is seen at a configuration under a load.
#[derive(Debug, Clone)]
struct SeenHere {
    /// The load; none where nothing was seen yet.
    load: Option<Load>,
    whitener: Matrix3<f64>,
    /// L^-1 J (3 x p).
    whitened: Matrix3xX<f64>,
}

impl<'a> FirstOrder<'a> {
    /// The model of an arm at one of its tools. Derivatives are in units of the parameters' `sizes` (p).
    pub fn new(
        arm: &'a ElasticArm,
        target: usize,
        set: &ParameterSet,
        sizes: &[f64],
        sigma_m: f64,
        sources: &'a [ReadingSource],
    ) -> Self {
        let mut places = Vec::new();
        let mut place = |moved_from, motion| {
            places.push(FramePlace { moved_from, motion });
            Column::Place(places.len() - 1)
        };
        let tool = &arm.tools[target];
        let mut off_springs: Vec<OffSpring> = Vec::new();
        let mut waves = Vec::new();
        let columns: Vec<Column> = (set.parameters().iter())
            .map(|parameter| match parameter.kind {
                kind if let Some(joint) = stands_off_spring(arm, kind) => {
                    off_springs.push(OffSpring {
                        joint,
                        is_gap: matches!(kind, ParameterKind::JointBacklash { .. }),
                        came_positively: true,
                        weight_nm: 0.0,
                    });
                    Column::OffSpring(off_springs.len() - 1)
                }
                ParameterKind::JointCompliance { joint } => Column::Compliance(joint),
                ParameterKind::JointWave { joint, wave } => {
                    waves.push((joint, wave, 0.0));
                    Column::Wave(waves.len() - 1)
                }
                ParameterKind::JointZero { joint } | ParameterKind::JointBacklash { joint } => {
                    place(joint, PlaceMotion::Joint)
                }
                ParameterKind::LinkPosition { link, axis } => {
                    place(link, PlaceMotion::LinkAlong(axis))
                }
                ParameterKind::LinkRotation { link, axis } => {
                    place(link, PlaceMotion::LinkAbout(axis))
                }
                ParameterKind::ToolPosition { tool: which, axis } if which == target => {
                    place(tool.joints, PlaceMotion::ToolAlong(axis))
                }
                ParameterKind::LoadScale => Column::LoadScale,
                ParameterKind::LoadOffset => Column::LoadOffset,
                ParameterKind::BaseRotation { station: 0, axis } => {
                    Column::Turned(Vector3::ith(axis.index(), 1.0))
                }
                ParameterKind::TaskScale => Column::TaskScale,
                ParameterKind::TaskForce { axis } => Column::TaskForce(axis),
                ParameterKind::Drift { axis } => Column::Seen(axis),
                ParameterKind::ToolPosition { .. }
                | ParameterKind::ToolRotation { .. }
                | ParameterKind::BasePosition { .. }
                | ParameterKind::BaseRotation { .. }
                | ParameterKind::LinkMass { .. }
                | ParameterKind::LinkCentre { .. }
                | ParameterKind::PayloadMass
                | ParameterKind::PayloadCentre { .. }
                | ParameterKind::JointStiffening { .. }
                | ParameterKind::SpringStiffness { .. }
                | ParameterKind::SpringRest { .. } => Column::Silent,
            })
            .collect();
        let factors =
            (set.parameters().iter().zip(sizes)).map(|(parameter, size)| match parameter.kind {
                ParameterKind::JointCompliance { joint } if parameter.is_logarithmic => {
                    arm.compliance_rad_per_nm[joint] * size
                }
                _ => *size,
            });
        let gaps = (set.parameters().iter().zip(sizes).enumerate()).filter_map(
            |(column, (parameter, size))| match parameter.kind {
                ParameterKind::JointBacklash { joint }
                    if matches!(columns[column], Column::Place(_)) =>
                {
                    Some((column, joint, *size))
                }
                _ => None,
            },
        );
        let mut model = Self {
            arm,
            compliance: &arm.compliance_rad_per_nm,
            factors: factors.collect(),
            gaps: gaps.collect(),
            off_springs,
            waves,
            seen: RefCell::new(SeenHere {
                load: None,
                whitener: Matrix3::zeros(),
                whitened: Matrix3xX::zeros(columns.len()),
            }),
            columns,
            levers: vec![Lever::NONE; places.len()],
            places,
            variance_m2: sigma_m * sigma_m,
            sources,
            unloaded: Unloaded::Own,
            repeats: 1.0,
            tool_position: Vector3::zeros(),
            joints: vec![Lever::NONE; arm.chain.len()],
        };
        model.come_from(None);
        model
    }

    /// See [`super::PlannedReadings::come_from`].
    pub fn come_from(&mut self, approach: Option<&Approach>) {
        if self.gaps.is_empty() && self.off_springs.is_empty() {
            return;
        }
        self.seen.get_mut().load = None;
        let came = Approach::of_all(approach, &self.arm.chain);
        for each in &mut self.off_springs {
            each.came_positively = came[each.joint];
        }
        for &(column, joint, size) in &self.gaps {
            self.factors[column] = Backlash::NONE.side(came[joint], 0.0) * size;
        }
    }

    /// Deflections rest on such readings without the load.
    pub const fn resting_on(mut self, unloaded: Unloaded) -> Self {
        self.unloaded = unloaded;
        self
    }

    /// See [`super::PlannedReadings::set_repeats`].
    pub fn set_repeats(&mut self, repeats: u32) {
        self.seen.get_mut().load = None;
        self.repeats = f64::from(repeats);
    }

    /// What is new in each reading besides the instrument's noise.
    pub const fn sources(&self) -> &[ReadingSource] {
        self.sources
    }

    /// The number p of parameters.
    pub fn parameters(&self) -> usize {
        self.columns.len()
    }

    /// Moves to the joint angles `q` (rad), where the arm with its tool has this geometry.
    pub fn stand(&mut self, q: &[f64], state: &KinematicState) {
        self.seen.get_mut().load = None;
        self.tool_position = state.tool_position;
        for (joint, lever) in self.joints.iter_mut().enumerate() {
            *lever = Lever::at(state.position_column(joint), state.rotation_column(joint));
        }
        let chain = &self.arm.chain;
        for each in &mut self.off_springs {
            each.weight_nm = state.gravity_torque(each.joint, &chain.gravity_m_s2);
        }
        for (joint, _, angle) in &mut self.waves {
            *angle = q[*joint];
        }
        let mut before = Rotation3::identity();
        for (index, (joint, &angle)) in chain.joints.iter().zip(q).enumerate() {
            // The link's axes, as they are at zero angle.
            before *= Rotation3::from(joint.previous_from_link.rotation);
            for (place, lever) in self.places.iter().zip(&mut self.levers) {
                if place.moved_from == index {
                    *lever = place.lever(before.matrix(), state);
                }
            }
            if !joint.drive.slides {
                before *= Rotation3::from_axis_angle(&joint.axis, angle);
            }
        }
        for (place, lever) in self.places.iter().zip(&mut self.levers) {
            if let PlaceMotion::ToolAlong(_) = place.motion {
                *lever = place.lever(&state.tool_rotation, state);
            }
        }
    }

    /// The deflection (m) under a load.
    pub fn deflection(&self, load: &Load) -> Vector3<f64> {
        (self.joints.iter().zip(self.compliance))
            .map(|(joint, k)| joint.position * (k * joint.torque(load)))
            .sum()
    }

    /// Whether its gradients are closed: those of what stands off springs and of gears' waves come from differences.
    pub const fn has_gradient(&self) -> bool {
        self.off_springs.is_empty() && self.waves.is_empty()
    }

    /// A joint that stands off its spring, and its shape with a load and without it.
    fn off_spring(&self, place: usize, load: &Load) -> (usize, [f64; 2]) {
        let each = &self.off_springs[place];
        let joint = each.joint;
        let of_load = self.joints[joint].torque(load);
        let shape = [each.weight_nm + of_load, each.weight_nm].map(|torque| {
            if each.is_gap {
                self.arm.backlash[joint].side(each.came_positively, torque)
            } else {
                self.arm.stiffening[joint].gives(self.compliance[joint], torque)
            }
        });
        (joint, shape)
    }

    /// Writes the derivatives of the deflection (3 x p), each with respect to its parameter in its size.
    pub fn derivatives(&self, load: &Load, matrix: &mut Matrix3xX<f64>) {
        let deflection = self.deflection(load);
        let along = Load {
            force_n: along(load),
            torque_nm: Vector3::zeros(),
        };
        // The waves of a joint move it alike.
        let mut moved: Option<(usize, Vector3<f64>)> = None;
        for (index, (column, factor)) in self.columns.iter().zip(&self.factors).enumerate() {
            let value = match *column {
                Column::Compliance(joint) => {
                    let joint = &self.joints[joint];
                    joint.position * joint.torque(load)
                }
                Column::Place(place) => {
                    self.of_motion(self.places[place].moved_from, &self.levers[place], load)
                }
                Column::OffSpring(place) => {
                    let (joint, [loaded, unloaded]) = self.off_spring(place, load);
                    let lever = &self.joints[joint];
                    self.of_motion(joint, lever, load) * loaded
                        + lever.position * (loaded - unloaded)
                }
                Column::Wave(wave) => {
                    let (joint, wave, angle) = self.waves[wave];
                    let all = match moved {
                        Some((other, all)) if other == joint => all,
                        _ => self.of_motion(joint, &self.joints[joint], load),
                    };
                    moved = Some((joint, all));
                    all * wave.at(angle)
                }
                Column::LoadScale => deflection,
                Column::LoadOffset => self.deflection(&along),
                Column::Turned(axis) => axis.cross(&deflection),
                Column::Seen(axis) => Vector3::ith(axis.index(), 1.0),
                Column::TaskScale | Column::TaskForce(_) | Column::Silent => Vector3::zeros(),
            };
            matrix.set_column(index, &(value * *factor));
        }
    }

    /// See [`super::PlannedReadings::uncompensated`].
    pub fn uncompensated(&self, load: &Load, matrix: &mut Matrix3xX<f64>) {
        for (index, (column, factor)) in self.columns.iter().zip(&self.factors).enumerate() {
            let value = match *column {
                Column::Compliance(joint) => {
                    let joint = &self.joints[joint];
                    joint.position * joint.torque(load)
                }
                Column::Place(place) => {
                    self.torques_of_motion(self.places[place].moved_from, &self.levers[place], load)
                }
                // It stands off its spring before the load acts; what that adds is compensated, too.
                Column::OffSpring(place) => {
                    let (joint, [loaded, unloaded]) = self.off_spring(place, load);
                    let lever = &self.joints[joint];
                    self.torques_of_motion(joint, lever, load) * unloaded
                        + lever.position * (loaded - unloaded)
                }
                // Where the joint is commanded back by what its spring gives, its gear errs by more or less.
                Column::Wave(wave) => {
                    let (joint, wave, angle) = self.waves[wave];
                    let lever = &self.joints[joint];
                    let back = self.compliance[joint] * lever.torque(load);
                    self.torques_of_motion(joint, lever, load) * wave.at(angle)
                        + lever.position * (wave.at(angle - back) - wave.at(angle))
                }
                Column::TaskScale => self.deflection(load),
                Column::TaskForce(axis) => self.deflection(&Load {
                    force_n: Vector3::ith(axis.index(), 1.0),
                    torque_nm: Vector3::zeros(),
                }),
                Column::LoadScale
                | Column::LoadOffset
                | Column::Turned(_)
                | Column::Seen(_)
                | Column::Silent => Vector3::zeros(),
            };
            matrix.set_column(index, &(value * *factor));
        }
    }

    /// How a motion with this lever of all that is beyond a joint changes the joints' own deflections.
    fn torques_of_motion(&self, from: usize, v: &Lever, load: &Load) -> Vector3<f64> {
        let mut sum = Vector3::zeros();
        for (index, (joint, &k)) in self.joints.iter().zip(self.compliance).enumerate() {
            let (moved, turned) = joint.moved_by(v, index < from);
            let change = moved.dot(&load.force_n) + turned.dot(&load.torque_nm);
            sum += joint.position * (change * k);
        }
        sum
    }

    /// What a motion with this lever of all that is beyond a joint changes of the deflection.
    fn of_motion(&self, from: usize, v: &Lever, load: &Load) -> Vector3<f64> {
        let mut sum = Vector3::zeros();
        for (index, (joint, &k)) in self.joints.iter().zip(self.compliance).enumerate() {
            let (moved, turned) = joint.moved_by(v, index < from);
            let change = moved.dot(&load.force_n) + turned.dot(&load.torque_nm);
            sum += (moved * joint.torque(load) + joint.position * change) * k;
        }
        sum
    }

    /// Writes the derivatives of the whitened deflection, L^-1 J with the covariance L L^T (3 x p).
    pub fn observe(&self, load: &Load, matrix: &mut Matrix3xX<f64>) {
        self.derivatives(load, matrix);
        let whitener = self.whitener(load);
        for mut column in matrix.column_iter_mut() {
            let white = whitener * &column;
            column.copy_from(&white);
        }
        let mut seen = self.seen.borrow_mut();
        seen.load = Some(*load);
        seen.whitener = whitener;
        seen.whitened.copy_from(matrix);
    }
}

/// The joint that stands off its spring by what it carries, of which a parameter is.
pub(super) fn stands_off_spring(arm: &ElasticArm, kind: ParameterKind) -> Option<usize> {
    match kind {
        ParameterKind::JointBacklash { joint } => {
            arm.backlash[joint].turned_over_at_nm.map(|_| joint)
        }
        ParameterKind::JointStiffening { joint } => Some(joint),
        _ => None,
    }
}

impl FramePlace {
    /// Its lever at the tool; `axes` are the link's or the tool's.
    fn lever(&self, axes: &Matrix3<f64>, state: &KinematicState) -> Lever {
        let link = self.moved_from;
        let moves_tool = link < state.tool_joints;
        match self.motion {
            PlaceMotion::Joint => {
                Lever::at(state.position_column(link), state.rotation_column(link))
            }
            PlaceMotion::LinkAlong(axis) if moves_tool => {
                Lever::at(axes.column(axis.index()).into_owned(), Vector3::zeros())
            }
            PlaceMotion::LinkAbout(axis) if moves_tool => {
                let about = axes.column(axis.index()).into_owned();
                let arm = state.tool_position - state.anchor[link];
                Lever::at(about.cross(&arm), about)
            }
            PlaceMotion::ToolAlong(axis) => {
                Lever::at(axes.column(axis.index()).into_owned(), Vector3::zeros())
            }
            PlaceMotion::LinkAlong(_) | PlaceMotion::LinkAbout(_) => Lever::NONE,
        }
    }
}

/// How a joint's torque follows a small rotation of the load.
fn by_turn(joint: &Lever, load: &Load) -> Vector3<f64> {
    load.force_n.cross(&joint.position) + load.torque_nm.cross(&joint.rotation)
}

/// How it follows a small shift of the point where the load acts.
fn by_shift(joint: &Lever, load: &Load) -> Vector3<f64> {
    load.force_n.cross(&joint.rotation)
}

#[cfg(test)]
pub(super) mod tests;
