//! The balance of all forces at zero velocity, as MuJoCo's own forward dynamics has it.
//!
//! A robot at rest has neither velocity nor acceleration. MuJoCo's acceleration is then
//!
//! ```text
//! M qacc = applied + actuator + passive - bias + J^T f,     f = f(J qacc - aref)
//! ```
//!
//! with the forces f of its constraints, which depend on the acceleration. It vanishes exactly where
//! the right-hand side with f(-aref) does: no solver of constraints is needed, nor its tolerance.

use nalgebra::{DMatrix, Vector3};

use super::servo::Servo;
use super::{Model, State};
use crate::files::FileError;

/// How far an equality constraint gives way.
#[derive(Debug, Clone, PartialEq)]
pub struct GivingWay {
    /// The element of the model, such as `equality/connect "loop"`.
    pub element: String,
    /// The length of what is between the two (m, or rad where angles are coupled).
    pub distance: f64,
    /// How far a weld lets the two turn against each other (rad).
    pub weld_rad: Option<f64>,
    /// Whether the distance is an angle.
    pub is_angle: bool,
}

impl GivingWay {
    /// The distance with its unit.
    pub fn words(&self) -> String {
        let turned = |angle: f64| format!("{:.4} deg", angle.to_degrees());
        if self.is_angle {
            return turned(self.distance);
        }
        let moved = format!("{:.4} mm", self.distance * 1e3);
        match self.weld_rad {
            Some(angle) => format!("{moved} and {}", turned(angle)),
            None => moved,
        }
    }
}

impl Model {
    /// The number of degrees of freedom.
    pub fn degrees_of_freedom(&self) -> usize {
        self.inner.dof_jntid().len()
    }

    /// The joint that a degree of freedom belongs to.
    pub fn joint_of_degree(&self, degree: usize) -> usize {
        self.inner.dof_jntid()[degree].unsigned_abs() as usize
    }

    /// The first degree of freedom of a joint.
    pub fn degree_of_joint(&self, joint: usize) -> usize {
        self.inner.jnt_dofadr()[joint].unsigned_abs() as usize
    }

    /// The index of a joint's (first) coordinate.
    pub fn coordinate_of_joint(&self, joint: usize) -> usize {
        self.inner.jnt_qposadr()[joint].unsigned_abs() as usize
    }

    /// The coordinates at which the bodies stand as the file draws them.
    pub fn reference_coordinates(&self) -> &[f64] {
        self.inner.qpos0()
    }
}

impl State {
    /// Sets the coordinates of all joints, at rest.
    pub fn set_coordinates(&mut self, coordinates: &[f64]) {
        self.data.qpos_mut().copy_from_slice(coordinates);
        self.data.qvel_mut().fill(0.0);
    }

    /// Puts another model of the same structure in the place of the simulated one, which is returned.
    pub fn replace_model(&mut self, model: &Model) -> Model {
        if self.data.try_swap_model(model.inner.clone()).is_err() {
            self.data = mujoco_rs::prelude::MjData::new(model.inner.clone());
        }
        std::mem::replace(&mut self.model, model.clone())
    }

    /// Runs MuJoCo's kinematics at the present coordinates.
    pub fn update_kinematics(&mut self) {
        self.data.kinematics();
        self.data.com_pos();
    }

    /// Moves all joints by a displacement in their degrees of freedom (rad, m).
    pub fn displace(&mut self, displacement: &[f64]) {
        let model = &self.model.inner;
        model.integrate_pos(self.data.qpos_mut(), displacement, 1.0);
    }

    /// Commands the position actuators that hold some joints (rad, m); others keep their control.
    pub fn command_joints(&mut self, joints: &[usize], commanded: &[f64]) {
        for (&joint, &value) in joints.iter().zip(commanded) {
            for servo in Servo::of(&self.model.inner, joint) {
                if servo.is_position(&self.model.inner) {
                    self.data.ctrl_mut()[servo.control] = servo.gear * value;
                }
            }
        }
    }

    /// The force (N, N m) that is left over in each degree of freedom at rest in the present
    /// coordinates, under a force (N) and a torque (N m) at a site, in the world frame.
    ///
    /// # Errors
    /// MuJoCo cannot apply the load.
    pub fn imbalance(
        &mut self,
        site: usize,
        force: &Vector3<f64>,
        torque: &Vector3<f64>,
        left_over: &mut [f64],
    ) -> Result<(), FileError> {
        self.data.fwd_position();
        self.data.fwd_velocity();
        self.data.fwd_actuation();
        // SAFETY: the position and velocity stages have just written it.
        #[expect(unsafe_code, reason = "the array is only there after these stages")]
        let reference = unsafe { self.data.efc_aref() };
        let without_acceleration: Vec<f64> = reference.iter().map(|aref| -aref).collect();
        self.data
            .constraint_update(&without_acceleration, None, false)
            .map_err(|error| self.model.not_loaded(error))?;
        let (body, _) = self.model.site_body(site);
        let point = self.data.site_xpos()[site];
        left_over.fill(0.0);
        let (force, torque) = ((*force).into(), (*torque).into());
        self.data
            .apply_ft(&force, &torque, &point, body, left_over)
            .map_err(|error| self.model.not_loaded(error))?;
        let forces = (self.data.qfrc_actuator().iter())
            .zip(self.data.qfrc_passive())
            .zip(self.data.qfrc_bias())
            .zip(self.data.qfrc_constraint());
        for (left_over, (((actuator, passive), bias), constraint)) in
            left_over.iter_mut().zip(forces)
        {
            *left_over += actuator + passive - bias + constraint;
        }
        self.add_torque_laws(left_over);
        Ok(())
    }

    /// Writes MuJoCo's mass matrix at the present coordinates.
    pub fn mass_matrix(&self, mass: &mut DMatrix<f64>) {
        if self.data.full_m(mass.as_mut_slice()).is_err() {
            mass.fill(f64::NAN);
        }
    }

    /// How far each equality constraint gives way at the present coordinates, after
    /// [`State::imbalance`].
    pub fn giving_way(&self) -> Vec<GivingWay> {
        self.model
            .equalities()
            .filter_map(|equality| {
                let residual: Vec<f64> = (self.data.efc_type().iter())
                    .zip(self.data.efc_id())
                    .zip(self.data.efc_pos())
                    .filter(|((kind, id), _)| {
                        **kind == mujoco_rs::prelude::MjtConstraint::mjCNSTR_EQUALITY
                            && usize::try_from(**id) == Ok(equality)
                    })
                    .map(|(_, position)| *position)
                    .collect();
                let length = |rows: &[f64]| rows.iter().map(|row| row * row).sum::<f64>().sqrt();
                // A weld's rotation follows its position.
                let (moved, turned) = residual.split_at(residual.len().min(3));
                let scale = self.model.weld_scale(equality);
                Some(GivingWay {
                    element: self.model.equality_element(equality),
                    distance: length(moved),
                    weld_rad: scale.map(|scale| 2.0 * (length(turned) / scale).min(1.0).asin()),
                    is_angle: self.model.couples_angles(equality)?,
                })
            })
            .collect()
    }
}
