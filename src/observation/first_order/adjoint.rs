//! The derivatives of a cost of the whitened rows with respect to the configuration and the load, in one sweep over the joints.

use nalgebra::{Matrix3, Matrix3xX, Vector3};

use super::{Column, FirstOrder, Lever, by_shift, by_turn};
use crate::parameter::{ReadingSource, TransmissionError, along};
use crate::robot::Load;

impl FirstOrder<'_> {
    /// Adds the derivatives of a cost of the information A^T A, A = L^-1 J, with respect to the joint
    /// angles to `gradient` (n), and returns those with respect to the force. `factor` (3 x p) is the
    /// derivative with respect to A, and must be A times a symmetric matrix, as it is for such a cost.
    ///
    /// The adjoint of J is then L^-T times the factor, and that of the covariance
    /// -1/2 L^-T factor A^T L^-1.
    pub fn pull_back(
        &mut self,
        load: &Load,
        factor: &Matrix3xX<f64>,
        gradient: &mut [f64],
    ) -> Vector3<f64> {
        if self.seen.get_mut().load != Some(*load) {
            let mut room = Matrix3xX::zeros(self.columns.len());
            self.observe(load, &mut room);
        }
        let seen = self.seen.get_mut();
        let whitener = seen.whitener;
        let mut product = Matrix3::zeros();
        for (one, other) in factor.column_iter().zip(seen.whitened.column_iter()) {
            product += one * other.transpose();
        }
        let of_covariance = whitener.transpose() * product * whitener * -0.5;
        let of_covariance = (of_covariance + of_covariance.transpose()) * 0.5;
        for lever in self.joints.iter_mut().chain(&mut self.levers) {
            lever.of_position = Vector3::zeros();
            lever.of_rotation = Vector3::zeros();
        }
        let mut of_force = self.adjoint_of_derivatives(load, &(whitener.transpose() * factor));
        let mut of_tool = Vector3::zeros();
        for source in 0..self.sources.len() {
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
                // The first two have no gradient here, see [`FirstOrder::has_gradient`]; the others do not change.
                Column::OffSpring(_)
                | Column::Wave(_)
                | Column::TaskScale
                | Column::TaskForce(_)
                | Column::Seen(_)
                | Column::Silent => {}
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
        source: usize,
        load: &Load,
        of_covariance: &Matrix3<f64>,
        of_tool: &mut Vector3<f64>,
    ) -> Vector3<f64> {
        let mut of_force = Vector3::zeros();
        let sources = self.sources;
        let times = self.times(source);
        match &sources[source] {
            ReadingSource::Discrepancy(_) => {}
            ReadingSource::TransmissionError(TransmissionError { deviations, .. }) => {
                for (index, deviation) in deviations.iter().enumerate() {
                    let lever = self.joints[index];
                    let seen = self.of_motion(index, &lever, load);
                    let weight = 2.0 * times * deviation * deviation;
                    let b = of_covariance * seen * weight;
                    let (force, position, rotation) =
                        self.adjoint_of_motion(index, &lever, load, &b);
                    of_force += force;
                    self.joints[index].of_position += position;
                    self.joints[index].of_rotation += rotation;
                }
            }
            ReadingSource::JointRepeatability(deviations) => {
                for (joint, deviation) in self.joints.iter_mut().zip(deviations) {
                    joint.of_position +=
                        of_covariance * joint.position * (2.0 * times * deviation * deviation);
                }
            }
            ReadingSource::LoadDirection(_) | ReadingSource::LoadPoint(_) => {
                let is_turn = matches!(sources[source], ReadingSource::LoadDirection(_));
                let (form, deviation) = self.load_form(source, load);
                let of_form = of_covariance * form * (2.0 * deviation * deviation);
                for (joint, &k) in self.joints.iter_mut().zip(self.compliance) {
                    let by = if is_turn {
                        by_turn(joint, load)
                    } else {
                        by_shift(joint, load)
                    };
                    let h = of_form.tr_mul(&joint.position) * k;
                    joint.of_position += of_form * by * k;
                    if is_turn {
                        joint.of_position += h.cross(&load.force_n);
                        joint.of_rotation += h.cross(&load.torque_nm);
                        of_force += joint.position.cross(&h);
                    } else {
                        joint.of_rotation += h.cross(&load.force_n);
                        of_force += joint.rotation.cross(&h);
                    }
                }
            }
            ReadingSource::Range(noise) => {
                let apart = self.tool_position - noise.from_m;
                *of_tool += noise.adjoint(&apart, of_covariance) * times;
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
