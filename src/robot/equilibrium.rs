//! The static equilibrium of an arm with elastic joints, without linearisation.
//!
//! Each joint is an elastic element in series with its commanded angle, so at rest
//!
//! ```text
//! q = q_commanded + k * tau(q),   tau(q) = J(q)^T W + gravity's torques + those of springs
//! ```
//!
//! A passive joint is no exception: what is commanded is where its spring is relaxed.
//!
//! Newton's method on this equation converges quadratically; its matrix I - k dtau/dq also tells
//! whether the equilibrium is stable and how it moves with the compliances.

use nalgebra::{Cholesky, DMatrix, DVector, Matrix6xX};
use thiserror::Error;

use super::kinematic_state::{KinematicState, Kinematics, Load};

/// The last step of a converged solution is no larger than this (rad).
pub const CONVERGED_RAD: f64 = 1e-12;
/// A plain arm takes a last step as short as this without new torques (rad): joints are then right to some thousandths of its square, the
/// tool's place to rounding.
const CLOSE_RAD: f64 = 1e-6;
/// Newton's method needs three or four steps; more than this is a failure.
pub const MAXIMUM_ITERATIONS: usize = 30;
/// A deflection beyond this is no longer that of an elastic joint (rad).
const LARGEST_DEFLECTION_RAD: f64 = 0.5;

/// Why an arm has no static equilibrium.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum EquilibriumError {
    /// Newton's method did not converge.
    #[error(
        "no static equilibrium: joint {joint} still moved by {step_rad:.3e} rad after {iterations} iterations"
    )]
    NotConverged {
        /// The joint that moved most, counted from 1.
        joint: usize,
        /// Its last step (rad).
        step_rad: f64,
        /// The number of iterations.
        iterations: usize,
    },
    /// Nothing holds a joint of a model, neither an actuator nor a spring nor its weight.
    #[error("no static equilibrium: nothing holds joint {joint:?}")]
    NotHeld {
        /// The joint's name.
        joint: String,
    },
    /// A model with more than a chain of elastic joints does not come to rest.
    #[error(
        "no static equilibrium: joint {joint:?} is still out of balance after {iterations} iterations"
    )]
    NotAtRest {
        /// The name of the joint with the largest force left over.
        joint: String,
        /// The number of iterations.
        iterations: usize,
    },
    /// A load that moves with the tool that it moves does not come to stand.
    #[error(
        "no static equilibrium: a load that moves with the tool still moves it by {moved:.3e} (rad, m)"
    )]
    LoadMoves {
        /// The last turn (rad), or the last way (m).
        moved: f64,
    },
    /// MuJoCo cannot calculate the forces.
    #[error("no static equilibrium: {0}")]
    NoForces(String),
    /// A joint that softens carries more than it can hold.
    #[error("no static equilibrium: joint {joint:?} softens and cannot hold what it carries")]
    GivesWay {
        /// The joint's name.
        joint: String,
    },
    /// The equilibrium that was found is unstable: the load overcomes the joints' stiffness.
    #[error("the static equilibrium is unstable: the load outweighs the joints' stiffness")]
    Unstable,
}

/// An arm under a load that moves with it stands when it moves by no more (rad, m), and is found anew at most so often: each time what is
/// wrong is as much less as the angle is small by which the load bends.
const STANDS: f64 = 1e-10;
const MOST_TURNS: usize = 50;

/// An arm at rest under a load that moves with it: beginning with where it rests under one that does not, `next` finds it under the load as
/// it is where the arm was last, and by how much it moved (rad, m), until it stands.
///
/// # Errors
/// Those of `next`; the load does not stand.
pub fn until_it_stands<T>(
    mut found: T,
    mut next: impl FnMut(&T) -> Result<(T, f64), EquilibriumError>,
) -> Result<T, EquilibriumError> {
    let mut moved = f64::INFINITY;
    for _ in 0..MOST_TURNS {
        (found, moved) = next(&found)?;
        if moved <= STANDS {
            return Ok(found);
        }
    }
    Err(EquilibriumError::LoadMoves { moved })
}

/// An arm at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Equilibrium {
    /// The number of Newton steps.
    pub iterations: usize,
    /// The size of the last step (rad).
    pub last_step_rad: f64,
}

/// Finds static equilibria; keeps its workspace, so that solving does not allocate.
#[derive(Debug, Clone)]
pub struct EquilibriumSolver {
    state: KinematicState,
    q: DVector<f64>,
    torque: DVector<f64>,
    gradient: DMatrix<f64>,
    system: DMatrix<f64>,
    step: DVector<f64>,
    last: LastStep,
}

/// What a plain arm's last step changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum LastStep {
    /// Nothing: it is of no account.
    Nothing,
    /// The joints' angles, the torques and the tool's place.
    Places,
    /// The same, and all geometry.
    Geometry,
}

impl EquilibriumSolver {
    /// A solver for arms of n joints.
    pub fn new(joints: usize) -> Self {
        Self {
            last: LastStep::Nothing,
            state: KinematicState::new(joints),
            q: DVector::zeros(joints),
            torque: DVector::zeros(joints),
            gradient: DMatrix::zeros(joints, joints),
            system: DMatrix::zeros(joints, joints),
            step: DVector::zeros(joints),
        }
    }

    /// The same where of the geometry at rest the tool's place alone counts.
    pub fn of_places(joints: usize) -> Self {
        Self {
            last: LastStep::Places,
            ..Self::new(joints)
        }
    }

    /// The same where the tool's place and its derivatives count.
    pub fn of_derivatives(joints: usize) -> Self {
        Self {
            last: LastStep::Geometry,
            ..Self::new(joints)
        }
    }

    /// Finds the joint angles at rest for the commanded angles (rad), the compliances (rad/(N m))
    /// and the load; they are then in [`Self::q`] and the geometry in [`Self::state`].
    ///
    /// # Errors
    /// There is no equilibrium nearby, or it is unstable.
    pub fn solve(
        &mut self,
        arm: &mut impl Kinematics,
        compliance_rad_per_nm: &[f64],
        commanded_rad: &[f64],
        load: &Load,
    ) -> Result<Equilibrium, EquilibriumError> {
        self.q.copy_from_slice(commanded_rad);
        self.solve_from_here(arm, compliance_rad_per_nm, commanded_rad, load)
    }

    /// The same, begun where the joints would stand under the torques of an equilibrium that is `near` (N m), if there are some; then
    /// they are those that were found.
    ///
    /// # Errors
    /// As [`Self::solve`].
    pub fn solve_near(
        &mut self,
        arm: &mut impl Kinematics,
        compliance_rad_per_nm: &[f64],
        commanded_rad: &[f64],
        load: &Load,
        near: &mut Vec<f64>,
    ) -> Result<Equilibrium, EquilibriumError> {
        for (joint, torque) in near.iter().enumerate() {
            self.q[joint] = commanded_rad[joint] + compliance_rad_per_nm[joint] * torque;
        }
        let found = if near.is_empty() {
            self.solve(arm, compliance_rad_per_nm, commanded_rad, load)
        } else {
            self.solve_from_here(arm, compliance_rad_per_nm, commanded_rad, load)
                .or_else(|_| self.solve(arm, compliance_rad_per_nm, commanded_rad, load))
        }?;
        near.clear();
        near.extend_from_slice(self.torque.as_slice());
        Ok(found)
    }

    /// From the joint angles where it is.
    fn solve_from_here(
        &mut self,
        arm: &mut impl Kinematics,
        compliance_rad_per_nm: &[f64],
        commanded_rad: &[f64],
        load: &Load,
    ) -> Result<Equilibrium, EquilibriumError> {
        let last = if arm.is_plain() {
            self.last
        } else {
            LastStep::Nothing
        };
        let close_rad = if last == LastStep::Nothing {
            CONVERGED_RAD
        } else {
            CLOSE_RAD
        };
        let mut last_step_rad = f64::INFINITY;
        let mut iterations = 0;
        while iterations < MAXIMUM_ITERATIONS {
            iterations += 1;
            self.evaluate(arm, load);
            for joint in 0..self.q.len() {
                self.step[joint] = commanded_rad[joint]
                    + compliance_rad_per_nm[joint] * self.torque[joint]
                    - self.q[joint];
            }
            newton_matrix(&self.gradient, compliance_rad_per_nm, &mut self.system);
            if !solve_in_place(&mut self.system, self.step.as_mut_slice()) {
                return Err(EquilibriumError::Unstable);
            }
            if !self.step.iter().all(|step| step.is_finite()) {
                break;
            }
            last_step_rad = self.step.amax();
            // A step as small as this is not worth a new geometry: the last one is that of `q`. With soft
            // springs or long ways to slide it is.
            if last_step_rad <= close_rad {
                if last != LastStep::Nothing {
                    self.q += &self.step;
                    self.torque.gemv(1.0, &self.gradient, &self.step, 1.0);
                    if last == LastStep::Places {
                        self.state.follow(self.step.as_slice());
                    } else {
                        arm.update(self.q.as_slice(), &mut self.state);
                    }
                } else if !arm.is_plain() && last_step_rad > 0.0 {
                    self.q += &self.step;
                    self.evaluate(arm, load);
                }
                self.check_stability(compliance_rad_per_nm)?;
                return Ok(Equilibrium {
                    iterations,
                    last_step_rad,
                });
            }
            self.q += &self.step;
            let mut deflections = self.q.iter().zip(commanded_rad).map(|(q, c)| (q - c).abs());
            if !deflections.all(|deflection| deflection <= LARGEST_DEFLECTION_RAD) {
                break;
            }
        }
        Err(EquilibriumError::NotConverged {
            joint: self.step.iamax() + 1,
            step_rad: last_step_rad,
            iterations,
        })
    }

    /// The joint angles of the last solution (rad).
    pub fn q(&self) -> &[f64] {
        self.q.as_slice()
    }

    /// The arm's geometry at the last solution.
    pub const fn state(&self) -> &KinematicState {
        &self.state
    }

    /// How the tool of the last solution moves with each compliance: 6 x n, column j is
    /// d(position, rotation)/d `k_j` = J (I - k dtau/dq)^-1 `e_j` `tau_j`, in m and rad per rad/(N m).
    pub fn sensitivity(&self, compliance_rad_per_nm: &[f64]) -> Matrix6xX<f64> {
        let mut moved = DMatrix::from_diagonal(&self.torque);
        let mut system = self.gradient.clone();
        newton_matrix(&self.gradient, compliance_rad_per_nm, &mut system);
        if !solve_in_place(&mut system, moved.as_mut_slice()) {
            moved.fill(f64::NAN);
        }
        self.state.jacobian() * moved
    }

    /// Writes how the tool of the last solution, or another whose geometry there is given, moves with each joint's commanded angle, for
    /// the same compliances: the transpose (n x 6) of J (I - k dtau/dq)^-1, in m and rad per rad; not numbers
    /// where the matrix is singular. Does not allocate.
    pub fn response(
        &mut self,
        compliance_rad_per_nm: &[f64],
        another: Option<&KinematicState>,
        transposed: &mut DMatrix<f64>,
    ) {
        let state = another.unwrap_or(&self.state);
        for joint in 0..self.q.len() {
            let (position, rotation) = (state.position_column(joint), state.rotation_column(joint));
            for row in 0..3 {
                transposed[(joint, row)] = position[row];
                transposed[(joint, row + 3)] = rotation[row];
            }
        }
        newton_matrix(&self.gradient, compliance_rad_per_nm, &mut self.system);
        self.system.transpose_mut();
        if !solve_in_place(&mut self.system, transposed.as_mut_slice()) {
            transposed.fill(f64::NAN);
        }
    }

    /// The torques of gravity and of the load at the last solution (N m).
    pub fn torque(&self) -> &[f64] {
        self.torque.as_slice()
    }

    fn evaluate(&mut self, arm: &mut impl Kinematics, load: &Load) {
        let gravity = arm.gravity_m_s2();
        arm.update(self.q.as_slice(), &mut self.state);
        for joint in 0..self.q.len() {
            self.torque[joint] =
                self.state.load_torque(joint, load) + self.state.gravity_torque(joint, &gravity);
        }
        self.state
            .torque_gradient(load, &gravity, &mut self.gradient);
        if !self.state.spring_torque.is_empty() {
            for (torque, of_springs) in self.torque.iter_mut().zip(&self.state.spring_torque) {
                *torque += of_springs;
            }
            self.gradient -= &self.state.spring_stiffness;
        }
        for offset in &arm.elements().offsets {
            self.torque[offset.joint] += offset.force;
        }
    }

    /// The equilibrium is stable where the potential energy is convex: the symmetric part of
    /// I - k^1/2 dtau/dq k^1/2 is positive definite.
    fn check_stability(&mut self, compliance: &[f64]) -> Result<(), EquilibriumError> {
        let joints = self.q.len();
        // The factorisation sees no more than the lower triangle.
        for column in 0..joints {
            for row in column..joints {
                let symmetric = 0.5 * (self.gradient[(row, column)] + self.gradient[(column, row)]);
                let weight = (compliance[row].max(0.0) * compliance[column].max(0.0)).sqrt();
                let identity = f64::from(u8::from(row == column));
                self.system[(row, column)] = identity - weight * symmetric;
            }
        }
        // The factorisation takes the matrix's storage and gives it back: nothing is allocated.
        let system = std::mem::replace(&mut self.system, DMatrix::zeros(0, 0));
        if let Some(factor) = Cholesky::new(system) {
            self.system = factor.unpack_dirty();
            Ok(())
        } else {
            self.system = DMatrix::zeros(joints, joints);
            Err(EquilibriumError::Unstable)
        }
    }
}

/// Writes I - diag(k) dtau/dq, the matrix of Newton's method.
fn newton_matrix(gradient: &DMatrix<f64>, compliance: &[f64], system: &mut DMatrix<f64>) {
    for column in 0..gradient.ncols() {
        for row in 0..gradient.nrows() {
            let identity = f64::from(u8::from(row == column));
            system[(row, column)] = identity - compliance[row] * gradient[(row, column)];
        }
    }
}

/// Gaussian elimination with partial pivoting for one or more right-hand sides (column-major) that
/// are overwritten by the solutions; unlike the library's factorisation it allocates nothing.
/// Returns false for a singular matrix.
fn solve_in_place(system: &mut DMatrix<f64>, right_hand_sides: &mut [f64]) -> bool {
    // Loops of the usual length are unrolled.
    match system.nrows() {
        6 => eliminate(6, system.as_mut_slice(), right_hand_sides),
        size => eliminate(size, system.as_mut_slice(), right_hand_sides),
    }
}

#[inline(always)]
fn eliminate(size: usize, all: &mut [f64], right_hand_sides: &mut [f64]) -> bool {
    for pivot in 0..size {
        let (before, beyond) = all.split_at_mut(size * (pivot + 1));
        let own = &mut before[size * pivot..];
        // Of equals the first.
        let mut best = pivot;
        for row in pivot + 1..size {
            if own[row].abs() > own[best].abs() {
                best = row;
            }
        }
        if own[best] == 0.0 || !own[best].is_finite() {
            return false;
        }
        own.swap(pivot, best);
        let (diagonal, factors) = (own[pivot], &mut own[pivot + 1..]);
        for factor in factors.iter_mut() {
            *factor /= diagonal;
        }
        let others = beyond.chunks_exact_mut(size);
        for column in others.chain(right_hand_sides.chunks_exact_mut(size)) {
            column.swap(pivot, best);
            let (known, below) = column.split_at_mut(pivot + 1);
            for (value, factor) in below.iter_mut().zip(&*factors) {
                *value -= factor * known[pivot];
            }
        }
    }
    for column in right_hand_sides.chunks_exact_mut(size) {
        for row in (0..size).rev() {
            let known: f64 = (row + 1..size)
                .map(|other| all[size * other + row] * column[other])
                .sum();
            column[row] = (column[row] - known) / all[size * row + row];
        }
    }
    true
}
