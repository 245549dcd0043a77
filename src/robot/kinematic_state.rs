//! The arm's geometry at one configuration, in the world frame, and what follows from it.

use nalgebra::{DMatrix, Matrix3, Matrix6xX, UnitQuaternion, Vector3, Vector6};

use super::elements::Elements;

/// A force (N) and a torque (N m) in the world frame, applied at a tool's origin; they keep their
/// direction as the tool moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Load {
    /// The force F (N).
    pub force_n: Vector3<f64>,
    /// The torque T (N m).
    pub torque_nm: Vector3<f64>,
}

impl Load {
    /// No load.
    pub const NONE: Self = Self {
        force_n: Vector3::new(0.0, 0.0, 0.0),
        torque_nm: Vector3::new(0.0, 0.0, 0.0),
    };

    /// A pure force (N).
    pub const fn force(x: f64, y: f64, z: f64) -> Self {
        Self {
            force_n: Vector3::new(x, y, z),
            torque_nm: Vector3::new(0.0, 0.0, 0.0),
        }
    }

    /// The load turned by a rotation.
    pub fn turned(&self, by: &Matrix3<f64>) -> Self {
        Self {
            force_n: by * self.force_n,
            torque_nm: by * self.torque_nm,
        }
    }

    /// So many times the load.
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            force_n: self.force_n * factor,
            torque_nm: self.torque_nm * factor,
        }
    }

    /// As it is written and set: nobody sets more than thousandths (N, N m).
    pub fn as_set(&self) -> Self {
        let three = |vector: Vector3<f64>| vector.map(|value| (value * 1e3).round() * 1e-3);
        Self {
            force_n: three(self.force_n),
            torque_nm: three(self.torque_nm),
        }
    }

    /// What tells it from others (zeros of either sign are one).
    pub fn bits(&self) -> [u64; 6] {
        <[f64; 6]>::from(self.wrench()).map(|value| (value + 0.0).to_bits())
    }

    /// The wrench W as six numbers, force then torque.
    pub fn wrench(&self) -> Vector6<f64> {
        let (f, t) = (&self.force_n, &self.torque_nm);
        Vector6::new(f.x, f.y, f.z, t.x, t.y, t.z)
    }

    /// The load of six numbers, force then torque.
    pub fn from_wrench(wrench: [f64; 6]) -> Self {
        let [fx, fy, fz, tx, ty, tz] = wrench;
        Self {
            force_n: Vector3::new(fx, fy, fz),
            torque_nm: Vector3::new(tx, ty, tz),
        }
    }
}

/// The rotation vector (rad) of a rotation matrix, precise for small angles too, where the usual
/// arc cosine loses half of the digits, or all.
pub fn rotation_vector(rotation: &Matrix3<f64>) -> Vector3<f64> {
    let skew = (rotation - rotation.transpose()) / 2.0;
    let axis = Vector3::new(skew[(2, 1)], skew[(0, 2)], skew[(1, 0)]);
    let sine = axis.norm();
    if sine > 0.0 {
        axis * (sine.atan2((rotation.trace() - 1.0) / 2.0) / sine)
    } else {
        axis
    }
}

/// Something that can tell the arm's geometry at any joint angles.
pub trait Kinematics {
    /// The acceleration of gravity in the world frame (m/s^2).
    fn gravity_m_s2(&self) -> Vector3<f64>;
    /// Whether it is an arm of commanded hinges and nothing else.
    fn is_plain(&self) -> bool;
    /// What else pulls at the joints beside gravity, the load and their own elasticity.
    fn elements(&self) -> &Elements;
    /// Writes the geometry at the joint angles `q` (n values, rad); does not allocate.
    fn update(&mut self, q: &[f64], state: &mut KinematicState);
}

/// The arm's geometry at one configuration, in the world frame; n joints from base to flange.
#[derive(Debug, Clone, PartialEq)]
pub struct KinematicState {
    /// The axis of each joint (unit vectors).
    pub axis: Vec<Vector3<f64>>,
    /// Whether each joint slides along its axis; else it turns about it.
    pub slides: Vec<bool>,
    /// The angular velocity of all beyond each joint per unit rate: its axis, or none where it slides.
    pub turning: Vec<Vector3<f64>>,
    /// A point on the axis of each joint (m); for one that slides, the origin of its frame before it has
    /// slid.
    pub anchor: Vec<Vector3<f64>>,
    /// The orientation of the frame before each link (the previous link's), and of the last link; written by serial chains alone.
    pub before: Vec<UnitQuaternion<f64>>,
    /// The mass that each joint carries (kg).
    pub distal_mass: Vec<f64>,
    /// The centre of the mass that each joint carries (m).
    pub distal_centre: Vec<Vector3<f64>>,
    /// The places that springs go through (m), see [`Elements::places`].
    pub places: Vec<Vector3<f64>>,
    /// The first hinge that is commanded: axis 1 of the robot.
    pub first_axis: usize,
    /// How many joints, from the base, move the tool.
    pub tool_joints: usize,
    /// The tool's origin (m).
    pub tool_position: Vector3<f64>,
    /// The tool's axes as columns.
    pub tool_rotation: Matrix3<f64>,
    /// The torques (N m, N) that springs beside the joints' own exert on the joints; empty where there are
    /// none.
    pub spring_torque: Vec<f64>,
    /// How these fall with each joint's coordinate (row: torque, column: joint), a symmetric matrix.
    pub spring_stiffness: DMatrix<f64>,
    /// The Jacobian's columns for each joint: asked for many times, made once.
    pub(super) position_columns: Vec<Vector3<f64>>,
    pub(super) rotation_columns: Vec<Vector3<f64>>,
}

impl KinematicState {
    /// Room for the state of an arm of n joints.
    pub fn new(joints: usize) -> Self {
        Self {
            axis: vec![Vector3::zeros(); joints],
            slides: vec![false; joints],
            turning: vec![Vector3::zeros(); joints],
            places: Vec::new(),
            first_axis: 0,
            anchor: vec![Vector3::zeros(); joints],
            before: vec![UnitQuaternion::identity(); joints + 1],
            distal_mass: vec![0.0; joints],
            distal_centre: vec![Vector3::zeros(); joints],
            tool_joints: joints,
            tool_position: Vector3::zeros(),
            tool_rotation: Matrix3::identity(),
            spring_torque: Vec::new(),
            spring_stiffness: DMatrix::zeros(0, 0),
            position_columns: vec![Vector3::zeros(); joints],
            rotation_columns: vec![Vector3::zeros(); joints],
        }
    }

    /// Writes a joint's axis, through its anchor (m), along which it slides or about which it turns.
    #[inline]
    pub(crate) fn place_joint(
        &mut self,
        joint: usize,
        slides: bool,
        axis: Vector3<f64>,
        anchor: Vector3<f64>,
    ) {
        self.axis[joint] = axis;
        self.anchor[joint] = anchor;
        self.slides[joint] = slides;
        self.turning[joint] = if slides { Vector3::zeros() } else { axis };
    }

    /// Writes where the tool is (m, its axes as columns) that so many joints move; the joints have their
    /// places by then. Within [`Kinematics::update`] it would take registers from the loop over the joints.
    #[inline(never)]
    pub(crate) fn place_tool(
        &mut self,
        joints: usize,
        position: Vector3<f64>,
        rotation: Matrix3<f64>,
    ) {
        self.tool_joints = joints;
        self.tool_position = position;
        self.tool_rotation = rotation;
        let columns = (self.position_columns.iter_mut()).zip(&mut self.rotation_columns);
        let axes = self.axis.iter().zip(&self.anchor).zip(&self.slides);
        for (joint, ((moved, turned), ((axis, anchor), &slides))) in columns.zip(axes).enumerate() {
            (*moved, *turned) = if joint >= joints {
                (Vector3::zeros(), Vector3::zeros())
            } else if slides {
                (*axis, Vector3::zeros())
            } else {
                (axis.cross(&(position - anchor)), *axis)
            };
        }
    }

    /// Moves the tool's place by a step of joints that turn (rad), to second order in it; nothing else moves.
    pub(super) fn follow(&mut self, step: &[f64]) {
        let (mut moved, mut turned) = (Vector3::zeros(), Vector3::zeros());
        for (joint, step) in step.iter().enumerate() {
            let (column, turn) = (
                self.position_columns[joint],
                self.rotation_columns[joint] * *step,
            );
            moved += (column + (turned + turn * 0.5).cross(&column)) * *step;
            turned += turn + turned.cross(&turn) * 0.5;
        }
        let turned = turned.cross_matrix();
        self.tool_position += moved;
        self.tool_rotation += (turned + turned * turned * 0.5) * self.tool_rotation;
    }

    /// The number of joints n.
    pub fn joints(&self) -> usize {
        self.axis.len()
    }

    /// Turns the mass and centre of each single link into those of all that its joint carries. Not inlined for the
    /// same reason as [`Self::place_tool`].
    #[inline(never)]
    pub(super) fn gather_distal_masses(&mut self) {
        for joint in (1..self.joints()).rev() {
            let (outer, inner) = (self.distal_mass[joint], self.distal_mass[joint - 1]);
            let total = outer + inner;
            if total > 0.0 {
                self.distal_centre[joint - 1] = (self.distal_centre[joint] * outer
                    + self.distal_centre[joint - 1] * inner)
                    / total;
            }
            self.distal_mass[joint - 1] = total;
        }
    }

    /// Column j of the Jacobian's position rows (m): the tool's velocity per unit rate of joint j.
    pub fn position_column(&self, joint: usize) -> Vector3<f64> {
        self.position_columns[joint]
    }

    /// Column j of the Jacobian's rotation rows: the tool's angular velocity per unit rate.
    pub fn rotation_column(&self, joint: usize) -> Vector3<f64> {
        self.rotation_columns[joint]
    }

    /// The velocity per unit rate of joint j of a point that so many joints move (m).
    pub fn moves(&self, joint: usize, joints: usize, point: &Vector3<f64>) -> Vector3<f64> {
        if joint >= joints {
            Vector3::zeros()
        } else if self.slides[joint] {
            self.axis[joint]
        } else {
            self.axis[joint].cross(&(point - self.anchor[joint]))
        }
    }

    /// The tool's Jacobian J, 6 x n: position rows (m), then rotation rows, in the world frame.
    pub fn jacobian(&self) -> Matrix6xX<f64> {
        let mut jacobian = Matrix6xX::zeros(self.joints());
        for (joint, mut column) in jacobian.column_iter_mut().enumerate() {
            column
                .fixed_rows_mut::<3>(0)
                .copy_from(&self.position_column(joint));
            column
                .fixed_rows_mut::<3>(3)
                .copy_from(&self.rotation_column(joint));
        }
        jacobian
    }

    /// The torque of a load at the tool about joint j, `J_j^T` W (N m).
    pub fn load_torque(&self, joint: usize, load: &Load) -> f64 {
        self.position_column(joint).dot(&load.force_n)
            + self.rotation_column(joint).dot(&load.torque_nm)
    }

    /// The torque of gravity about joint j (N m).
    pub fn gravity_torque(&self, joint: usize, gravity_m_s2: &Vector3<f64>) -> f64 {
        if *gravity_m_s2 == Vector3::zeros() {
            return 0.0;
        }
        self.mass_column(joint).dot(gravity_m_s2)
    }

    /// What gravity's torque about joint j follows a turn of all that the joint carries by (N m).
    #[inline]
    pub(crate) fn weight_moment(&self, joint: usize, gravity_m_s2: &Vector3<f64>) -> Vector3<f64> {
        if *gravity_m_s2 == Vector3::zeros() {
            return Vector3::zeros();
        }
        self.mass_column(joint).cross(gravity_m_s2)
    }

    /// The derivative of the torque of gravity and of the load about joint j with respect to the
    /// angle of joint i (N m/rad).
    ///
    /// A point that joints a <= b both move has d2 p / (`dq_a` `dq_b`) = `z_a` x (`z_b` x (p - `o_b`)), so
    /// forces give a symmetric matrix. A torque of fixed direction is not conservative: it adds
    /// (`z_i` x `z_j`) . T for i < j only. A joint that slides turns nothing: `z_a` is then zero.
    pub fn torque_derivative(
        &self,
        joint: usize,
        by: usize,
        load: &Load,
        gravity_m_s2: &Vector3<f64>,
    ) -> f64 {
        let (inner, outer) = (joint.min(by), joint.max(by));
        let axis = &self.turning[inner];
        let forces = axis.cross(&self.position_column(outer)).dot(&load.force_n)
            + axis.cross(&self.mass_column(outer)).dot(gravity_m_s2);
        if by < joint {
            forces
                + axis
                    .cross(&self.rotation_column(joint))
                    .dot(&load.torque_nm)
        } else {
            forces
        }
    }

    /// Writes d `tau_j` / d `q_i` (row j, column i; n x n, N m/rad), see [`Self::torque_derivative`];
    /// a triple product's factors are swapped so that the sum of moments is made once a joint.
    pub fn torque_gradient(
        &self,
        load: &Load,
        gravity_m_s2: &Vector3<f64>,
        gradient: &mut DMatrix<f64>,
    ) {
        for outer in 0..self.joints() {
            let forces = self.position_column(outer).cross(&load.force_n)
                + self.weight_moment(outer, gravity_m_s2);
            let torque = self.rotation_column(outer).cross(&load.torque_nm);
            gradient[(outer, outer)] = self.turning[outer].dot(&forces);
            for (inner, axis) in self.turning[..outer].iter().enumerate() {
                let symmetric = axis.dot(&forces);
                gradient[(inner, outer)] = symmetric;
                gradient[(outer, inner)] = symmetric + axis.dot(&torque);
            }
        }
    }

    /// The first moment (kg m) by which joint j moves the mass that it carries.
    pub fn mass_column(&self, joint: usize) -> Vector3<f64> {
        if self.slides[joint] {
            return self.axis[joint] * self.distal_mass[joint];
        }
        self.axis[joint].cross(&(self.distal_centre[joint] - self.anchor[joint]))
            * self.distal_mass[joint]
    }
}
