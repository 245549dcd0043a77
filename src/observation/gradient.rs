//! The gradient of a cost of whitened deflections to first order in compliance (eqs. 3, 4 and 7, extended), in closed form.
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

use nalgebra::{Matrix3, Matrix3xX, Vector3};

use super::observed::is_by_torque;
use crate::parameter::{
    Axis, Backlash, ElasticArm, ParameterKind, ParameterSet, ReadingSource, along,
};
use crate::robot::{Approach, KinematicState, Load};

/// What a deflection's columns are made of.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Column {
    /// `J_n tau_n` of a joint.
    Compliance(usize),
    /// What a motion of all beyond a place changes.
    Place(usize),
    /// The deflection itself.
    LoadScale,
    /// The deflection under a force of 1 N along the load's.
    LoadOffset,
    /// The deflection turned about an axis.
    Turned(Vector3<f64>),
    /// Nothing that the configuration or the load changes.
    Constant,
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

    /// What turns with this lever's own motion.
    fn turned(&self) -> Vector3<f64> {
        self.position.cross(&self.of_position) + self.rotation.cross(&self.of_rotation)
    }

    /// What the motion of joints beyond it moves.
    fn carried(&self) -> Vector3<f64> {
        self.of_position.cross(&self.rotation)
    }
}

/// A reading whose cost has a gradient: under a load, whitened by L^-1 (1/m) with its covariance L L^T, and the derivatives of the
/// whitened reading, A = L^-1 J (3 x p).
#[derive(Debug, Clone)]
pub(super) struct WhitenedReading {
    pub load: Load,
    pub whitener: Matrix3<f64>,
    pub rows: Matrix3xX<f64>,
}

/// An arm's deflections at one of its tools, and their adjoints. Loads are in the world frame, which is the instrument's.
#[derive(Debug, Clone)]
pub(super) struct DeflectionGradient<'a> {
    arm: &'a ElasticArm,
    compliance: &'a [f64],
    columns: Vec<Column>,
    /// What each column is multiplied by.
    factors: Vec<f64>,
    /// Columns of gaps, with the joint and the size of each: the side of approach decides on their sign.
    gaps: Vec<(usize, usize, f64)>,
    places: Vec<FramePlace>,
    sources: &'a [ReadingSource],
    /// The tool's place (m).
    tool_position: Vector3<f64>,
    joints: Vec<Lever>,
    levers: Vec<Lever>,
}

impl<'a> DeflectionGradient<'a> {
    /// The model of a bare arm at one of its tools; none where joints stand off their springs by what they carry, or their gears err.
    /// Derivatives are in units of the parameters' `sizes` (p).
    pub fn new(
        arm: &'a ElasticArm,
        target: usize,
        set: &ParameterSet,
        sizes: &[f64],
        sources: &'a [ReadingSource],
    ) -> Option<Self> {
        let is_without =
            |kind| is_by_torque(arm, kind) || matches!(kind, ParameterKind::JointWave { .. });
        let errs = |source: &ReadingSource| matches!(source, ReadingSource::TransmissionError(_));
        if set.parameters().iter().any(|each| is_without(each.kind)) || sources.iter().any(errs) {
            return None;
        }
        let mut model = Self {
            arm,
            compliance: &arm.compliance_rad_per_nm,
            columns: Vec::new(),
            factors: Vec::new(),
            gaps: Vec::new(),
            places: Vec::new(),
            sources,
            tool_position: Vector3::zeros(),
            joints: vec![Lever::NONE; arm.chain.len()],
            levers: Vec::new(),
        };
        for (parameter, &size) in set.parameters().iter().zip(sizes) {
            let mut factor = size;
            match parameter.kind {
                ParameterKind::JointCompliance { joint } if parameter.is_logarithmic => {
                    factor *= arm.compliance_rad_per_nm[joint];
                }
                ParameterKind::JointBacklash { joint } => {
                    model.gaps.push((model.columns.len(), joint, size));
                }
                _ => {}
            }
            let column = model.column(target, parameter.kind);
            model.columns.push(column);
            model.factors.push(factor);
        }
        model.come_from(None);
        Some(model)
    }

    fn column(&mut self, target: usize, kind: ParameterKind) -> Column {
        let (moved_from, motion) = match kind {
            ParameterKind::JointCompliance { joint } => return Column::Compliance(joint),
            ParameterKind::LoadScale => return Column::LoadScale,
            ParameterKind::LoadOffset => return Column::LoadOffset,
            ParameterKind::BaseRotation { station: 0, axis } => {
                return Column::Turned(Vector3::ith(axis.index(), 1.0));
            }
            ParameterKind::JointZero { joint } | ParameterKind::JointBacklash { joint } => {
                (joint, PlaceMotion::Joint)
            }
            ParameterKind::LinkPosition { link, axis } => (link, PlaceMotion::LinkAlong(axis)),
            ParameterKind::LinkRotation { link, axis } => (link, PlaceMotion::LinkAbout(axis)),
            ParameterKind::ToolPosition { tool, axis } if tool == target => {
                (self.arm.tools[target].joints, PlaceMotion::ToolAlong(axis))
            }
            _ => return Column::Constant,
        };
        self.places.push(FramePlace { moved_from, motion });
        self.levers.push(Lever::NONE);
        Column::Place(self.places.len() - 1)
    }

    /// See [`super::PlannedReadings::come_from`].
    pub fn come_from(&mut self, approach: Option<&Approach>) {
        if self.gaps.is_empty() {
            return;
        }
        let came = Approach::of_all(approach, &self.arm.chain);
        for &(column, joint, size) in &self.gaps {
            self.factors[column] = Backlash::NONE.side(came[joint], 0.0) * size;
        }
    }

    /// Moves to where the arm with its tool has this geometry.
    fn stand(&mut self, state: &KinematicState) {
        self.tool_position = state.tool_position;
        for (joint, lever) in self.joints.iter_mut().enumerate() {
            *lever = Lever::at(state.position_column(joint), state.rotation_column(joint));
        }
        for (place, lever) in self.places.iter().zip(&mut self.levers) {
            *lever = if let PlaceMotion::ToolAlong(_) = place.motion {
                place.lever(&state.tool_rotation, state)
            } else {
                // The link's axes, as they are at zero angle.
                let link = place.moved_from;
                let own = &self.arm.chain.joints[link].previous_from_link.rotation;
                let axes = (state.before[link] * own).to_rotation_matrix();
                place.lever(axes.matrix(), state)
            };
        }
    }

    /// Adds the derivatives of a cost of the information A^T A of a reading where the arm has this geometry, with respect to the joint
    /// angles to `gradient` (n), and returns those with respect to the force. `factor` (3 x p) is the derivative
    /// with respect to A, and must be A times a symmetric matrix, as it is for such a cost. A source's variance counts so many `times`.
    ///
    /// The adjoint of J is then L^-T times the factor, and that of the covariance
    /// -1/2 L^-T factor A^T L^-1.
    pub fn pull_back(
        &mut self,
        state: &KinematicState,
        reading: &WhitenedReading,
        times: &dyn Fn(&ReadingSource) -> f64,
        factor: &Matrix3xX<f64>,
        gradient: &mut [f64],
    ) -> Vector3<f64> {
        self.stand(state);
        let (load, whitener) = (&reading.load, reading.whitener);
        let mut product = Matrix3::zeros();
        for (one, other) in factor.column_iter().zip(reading.rows.column_iter()) {
            product += one * other.transpose();
        }
        let of_covariance = whitener.transpose() * product * whitener * -0.5;
        let of_covariance = (of_covariance + of_covariance.transpose()) * 0.5;
        let mut of_force = self.adjoint_of_derivatives(load, &(whitener.transpose() * factor));
        let mut of_tool = Vector3::zeros();
        for source in self.sources {
            let of_covariance = of_covariance * times(source);
            of_force += self.adjoint_of_covariance(source, load, &of_covariance, &mut of_tool);
        }
        self.sweep(&of_tool, gradient);
        of_force
    }

    /// Adds the adjoints of all levers for sum(B * J), and returns that of the force.
    fn adjoint_of_derivatives(&mut self, load: &Load, of_matrix: &Matrix3xX<f64>) -> Vector3<f64> {
        let unit = along(load);
        let size = load.force_n.norm();
        let mut of_force = Vector3::zeros();
        // Those of the deflection, and of the deflection under 1 N.
        let (mut of_deflection, mut of_unit) = (Vector3::zeros(), Vector3::zeros());
        for index in 0..self.columns.len() {
            let b = of_matrix.column(index) * self.factors[index];
            match self.columns[index] {
                Column::Compliance(joint) => {
                    of_force += adjoint_of_deflection(&mut self.joints[joint], 1.0, load, &b);
                }
                Column::Place(place) => {
                    let (from, v) = (self.places[place].moved_from, self.levers[place]);
                    let (force, position, rotation) = self.adjoint_of_motion(from, &v, load, &b);
                    of_force += force;
                    self.levers[place].of_position += position;
                    self.levers[place].of_rotation += rotation;
                }
                Column::LoadScale => of_deflection += b,
                Column::LoadOffset => of_unit += b,
                Column::Turned(axis) => of_deflection += b.cross(&axis),
                Column::Constant => {}
            }
        }
        let along = Load {
            force_n: unit,
            torque_nm: Vector3::zeros(),
        };
        let mut of_unit_force = Vector3::zeros();
        for (joint, &k) in self.joints.iter_mut().zip(self.compliance) {
            of_force += adjoint_of_deflection(joint, k, load, &of_deflection);
            of_unit_force += adjoint_of_deflection(joint, k, &along, &of_unit);
        }
        if size > 0.0 {
            of_force += (of_unit_force - unit * unit.dot(&of_unit_force)) / size;
        }
        of_force
    }

    /// Adds the adjoints for b . (what a motion with a lever changes of the deflection), and returns that of the force and those of
    /// the lever.
    fn adjoint_of_motion(
        &mut self,
        from: usize,
        v: &Lever,
        load: &Load,
        b: &Vector3<f64>,
    ) -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
        let (force, torque_nm) = (&load.force_n, &load.torque_nm);
        let (mut of_position, mut of_rotation) = (Vector3::zeros(), Vector3::zeros());
        let mut of_force = Vector3::zeros();
        for (index, (joint, &k)) in self.joints.iter_mut().zip(self.compliance).enumerate() {
            let (position, rotation) = (joint.position, joint.rotation);
            let (torque, along) = (joint.torque(load), b.dot(&position));
            if index < from {
                let moved = rotation.cross(&v.position);
                let share = b.dot(&moved);
                of_position += (b.cross(&rotation) * torque + force.cross(&rotation) * along) * k;
                joint.of_position += (force * share + b * moved.dot(force)) * k;
                joint.of_rotation += (v.position.cross(b) * torque
                    + torque_nm * share
                    + v.position.cross(force) * along)
                    * k;
                of_force += (position * share + moved * along) * k;
            } else {
                let turning = position.cross(force) + rotation.cross(torque_nm);
                let moved = v.rotation.cross(&position);
                let share = b.dot(&moved);
                of_rotation += (position.cross(b) * torque + turning * along) * k;
                joint.of_position += (b.cross(&v.rotation) * torque
                    + force * share
                    + b * v.rotation.dot(&turning)
                    + force.cross(&v.rotation) * along)
                    * k;
                joint.of_rotation += (torque_nm * share + torque_nm.cross(&v.rotation) * along) * k;
                of_force += (position * share + moved * along) * k;
            }
        }
        (of_force, of_position, of_rotation)
    }

    /// Adds the adjoints for sum(B * covariance) with a symmetric B, those of the tool's place apart, and
    /// returns that of the force.
    fn adjoint_of_covariance(
        &mut self,
        source: &ReadingSource,
        load: &Load,
        of_covariance: &Matrix3<f64>,
        of_tool: &mut Vector3<f64>,
    ) -> Vector3<f64> {
        match source {
            ReadingSource::Discrepancy(_) | ReadingSource::TransmissionError(_) => Vector3::zeros(),
            ReadingSource::JointRepeatability(deviations) => {
                for (joint, deviation) in self.joints.iter_mut().zip(deviations) {
                    joint.of_position +=
                        of_covariance * joint.position * (2.0 * deviation * deviation);
                }
                Vector3::zeros()
            }
            ReadingSource::LoadDirection(deviation) => {
                self.adjoint_of_load(true, *deviation, load, of_covariance)
            }
            ReadingSource::LoadPoint(deviation) => {
                self.adjoint_of_load(false, *deviation, load, of_covariance)
            }
            ReadingSource::GaugeDirection(deviation) => {
                let joints = self.joints.iter().zip(self.compliance);
                let moved: Vector3<f64> = joints
                    .map(|(joint, k)| joint.position * (k * joint.torque(load)))
                    .sum();
                let b = moved * of_covariance.trace() - of_covariance * moved;
                let square = deviation * deviation;
                let b = (b + of_covariance * moved * square) * (2.0 * square);
                let joints = self.joints.iter_mut().zip(self.compliance);
                joints
                    .map(|(joint, &k)| adjoint_of_deflection(joint, k, load, &b))
                    .sum()
            }
            ReadingSource::Range(noise) => {
                *of_tool += noise.adjoint(&(self.tool_position - noise.from_m), of_covariance);
                Vector3::zeros()
            }
        }
    }

    /// The same for what turns the load by a small vector of this deviation, or shifts where it acts: `form` is how the deflection
    /// follows that.
    fn adjoint_of_load(
        &mut self,
        is_turn: bool,
        deviation: f64,
        load: &Load,
        of_covariance: &Matrix3<f64>,
    ) -> Vector3<f64> {
        let (force_n, torque_nm) = (load.force_n, load.torque_nm);
        // How a joint's torque follows it.
        let by = |joint: &Lever| {
            if is_turn {
                force_n.cross(&joint.position) + torque_nm.cross(&joint.rotation)
            } else {
                force_n.cross(&joint.rotation)
            }
        };
        let form: Matrix3<f64> = (self.joints.iter().zip(self.compliance))
            .map(|(joint, k)| joint.position * (by(joint) * *k).transpose())
            .sum();
        let of_form = of_covariance * form * (2.0 * deviation * deviation);
        let mut of_force = Vector3::zeros();
        for (joint, &k) in self.joints.iter_mut().zip(self.compliance) {
            let h = of_form.tr_mul(&joint.position) * k;
            joint.of_position += of_form * by(joint) * k;
            if is_turn {
                joint.of_position += h.cross(&force_n);
                joint.of_rotation += h.cross(&torque_nm);
                of_force += joint.position.cross(&h);
            } else {
                joint.of_rotation += h.cross(&force_n);
                of_force += joint.rotation.cross(&h);
            }
        }
        of_force
    }

    /// From the adjoints of all levers and of the tool's place to the gradient.
    fn sweep(&self, of_tool: &Vector3<f64>, gradient: &mut [f64]) {
        let mut beyond: Vector3<f64> = self.joints.iter().map(Lever::turned).sum();
        let mut before = Vector3::zeros();
        for (joint, slope) in gradient.iter_mut().enumerate().take(self.joints.len()) {
            let lever = &self.joints[joint];
            let (mut of_places, mut carried) = (Vector3::zeros(), Vector3::zeros());
            for (place, each) in self.places.iter().zip(&self.levers) {
                if place.moved_from > joint {
                    of_places += each.turned();
                } else {
                    carried += each.carried();
                }
            }
            *slope += lever.rotation.dot(&(beyond + of_places))
                + lever.position.dot(&(before + carried + of_tool));
            beyond -= lever.turned();
            before += lever.carried();
        }
    }
}

/// Adds the adjoints of a joint for b . (k tau J), and returns that of the force.
fn adjoint_of_deflection(joint: &mut Lever, k: f64, load: &Load, b: &Vector3<f64>) -> Vector3<f64> {
    let along = b.dot(&joint.position) * k;
    joint.of_position += b * (k * joint.torque(load)) + load.force_n * along;
    joint.of_rotation += load.torque_nm * along;
    joint.position * along
}

impl FramePlace {
    /// Its lever at the tool; `axes` are the link's or the tool's.
    fn lever(&self, axes: &Matrix3<f64>, state: &KinematicState) -> Lever {
        let link = self.moved_from;
        let moves_tool = link < state.tool_joints;
        let along = |axis: Axis| axes.column(axis.index()).into_owned();
        match self.motion {
            PlaceMotion::Joint => {
                Lever::at(state.position_column(link), state.rotation_column(link))
            }
            PlaceMotion::LinkAlong(axis) if moves_tool => Lever::at(along(axis), Vector3::zeros()),
            PlaceMotion::LinkAbout(axis) if moves_tool => {
                let arm = state.tool_position - state.anchor[link];
                Lever::at(along(axis).cross(&arm), along(axis))
            }
            PlaceMotion::ToolAlong(axis) => Lever::at(along(axis), Vector3::zeros()),
            PlaceMotion::LinkAlong(_) | PlaceMotion::LinkAbout(_) => Lever::NONE,
        }
    }
}
