//! The rest of any model: where MuJoCo's acceleration vanishes at zero velocity.
//!
//! Newton's method on the imbalance r(q) of all forces, with the stiffness K = -dr/dq from differences
//! and, where a step does not lower the energy, with K + lambda M instead: steps of large lambda follow
//! the forces as the robot itself would, weighted by its mass matrix M. The stiffness is kept as long as
//! steps shrink fast, since its errors cost steps and no precision.

use nalgebra::{Cholesky, DMatrix, DVector, Matrix3, Vector3};

use crate::files::FileError;
use crate::mujoco::{GivingWay, ModelChange, State, TorqueLaw};
use crate::robot::{Equilibrium, EquilibriumError, Load, TrueRobot};

/// The last step of a converged solution is no larger than this (rad, m).
const CONVERGED: f64 = 1e-12;
/// Steps below this that grow again are rounding (rad, m).
const ROUNDING: f64 = 1e-10;
/// No step is longer (rad, m).
const LONGEST_STEP: f64 = 0.3;
/// Loops need a few dozen steps at most.
const MAXIMUM_ITERATIONS: usize = 300;
/// The shift of a joint in the differences (rad, m).
const SHIFT: f64 = 1e-6;
/// A stiffness is taken again where a step is not this much shorter than the one before.
const SLOW: f64 = 0.05;
/// A joint without any stiffness is one with less than this share of what its mass would have at one
/// radian per second.
const WEIGHTLESS: f64 = 1e-9;

/// How equilibria are found, with the last of them.
pub trait RestingBody: std::fmt::Debug + Send + Sync {
    /// Replaces the compliances of the belief's joints (rad/(N m)).
    fn set_compliance(&mut self, compliance_rad_per_nm: &[f64]);
    /// Lets joints hold by laws of their own, by the belief's numbers of them; those that it has.
    fn set_torque_laws(&mut self, laws: &[(usize, TorqueLaw)]);
    /// Makes the robot a run's, which differs from the model in this alone.
    ///
    /// # Errors
    /// A site is missing.
    fn change(&mut self, robot: &TrueRobot, changes: &[ModelChange]) -> Result<(), FileError>;
    /// Lets the robot come to rest at the commands of the belief's joints (rad, m).
    fn rest(&mut self, commanded: &[f64], load: &Load) -> Result<Equilibrium, EquilibriumError>;
    /// The tool's position (m) and axes.
    fn tool(&self) -> (Vector3<f64>, Matrix3<f64>);
    /// The position (m) and axes in the world frame of another site, by its place in the model, as it came to rest last.
    fn site(&mut self, site: usize) -> (Vector3<f64>, Matrix3<f64>);
    /// The coordinates of the belief's joints that it has (rad, m).
    fn joint_angles(&self) -> Vec<f64>;
    /// MuJoCo's simulation at the last equilibrium's coordinates; of a plain chain its poses are those of Newton's last step but one.
    fn simulation(&self) -> &State;
    /// How far the model's equality constraints give way at the last equilibrium, found under this load.
    fn giving_way(&mut self, load: &Load) -> Vec<GivingWay>;
}

/// Finds the rest of a simulation; keeps its workspace.
#[derive(Debug, Clone)]
pub(super) struct RestSolver {
    /// The degrees of freedom that may move.
    free: Vec<usize>,
    left_over: Vec<f64>,
    shifted: Vec<f64>,
    displacement: Vec<f64>,
    coordinates: Vec<f64>,
    stiffness: DMatrix<f64>,
    mass: DMatrix<f64>,
    all_mass: DMatrix<f64>,
}

impl RestSolver {
    /// A solver for a model of which some degrees of freedom do not move.
    pub fn new(state: &State, held: &[usize]) -> Self {
        let model = state.model();
        let all = model.degrees_of_freedom();
        let free: Vec<usize> = (0..all).filter(|degree| !held.contains(degree)).collect();
        let size = free.len();
        Self {
            free,
            left_over: vec![0.0; all],
            shifted: vec![0.0; all],
            displacement: vec![0.0; all],
            coordinates: model.reference_coordinates().to_vec(),
            stiffness: DMatrix::zeros(size, size),
            mass: DMatrix::zeros(size, size),
            all_mass: DMatrix::zeros(all, all),
        }
    }

    /// Lets the simulation come to rest under a load at a site, from its present coordinates and
    /// commands.
    pub fn rest(
        &mut self,
        state: &mut State,
        site: usize,
        load: &Load,
    ) -> Result<Equilibrium, EquilibriumError> {
        let mut left_over = self.imbalance(state, site, load)?;
        self.stiffen(state, site, load, &left_over)?;
        let mut is_fresh = true;
        let mut last = f64::INFINITY;
        let mut lambda = 0.0;
        let mut iterations = 0;
        while iterations < MAXIMUM_ITERATIONS {
            iterations += 1;
            let step = self.step(&left_over, lambda);
            let size = step.as_ref().map_or(f64::INFINITY, DVector::amax);
            let Some(step) = step.filter(|_| size <= LONGEST_STEP) else {
                if !is_fresh {
                    self.stiffen(state, site, load, &left_over)?;
                    is_fresh = true;
                    continue;
                }
                lambda = self.larger(lambda);
                if !lambda.is_finite() {
                    break;
                }
                continue;
            };
            if lambda == 0.0 && (size <= CONVERGED || size < ROUNDING && size >= last) {
                self.displace(state, step.as_slice());
                let left_over = self.imbalance(state, site, load)?;
                return self.stable(state, site, load, &left_over, iterations, size);
            }
            if lambda == 0.0 && !is_fresh && size > SLOW * last {
                self.stiffen(state, site, load, &left_over)?;
                is_fresh = true;
                continue;
            }
            self.coordinates.copy_from_slice(state.coordinates().0);
            self.displace(state, step.as_slice());
            let next = self.imbalance(state, site, load)?;
            let (before, after) = (left_over.dot(&step), next.dot(&step));
            // The energy falls by the mean of the work at both ends.
            let falls = after > -0.5 * before || size < ROUNDING;
            if !falls || !next.iter().all(|force| force.is_finite()) {
                state.set_coordinates(&self.coordinates);
                if is_fresh {
                    lambda = self.larger(lambda);
                    if !lambda.is_finite() {
                        break;
                    }
                } else {
                    self.stiffen(state, site, load, &left_over)?;
                    is_fresh = true;
                }
                continue;
            }
            left_over = next;
            last = size;
            is_fresh = false;
            if lambda > 0.0 {
                lambda = self.smaller(lambda);
                self.stiffen(state, site, load, &left_over)?;
                is_fresh = true;
                last = f64::INFINITY;
            }
        }
        Err(self.not_at_rest(state, iterations))
    }

    /// The forces that are left over in the free degrees of freedom.
    fn imbalance(
        &mut self,
        state: &mut State,
        site: usize,
        load: &Load,
    ) -> Result<DVector<f64>, EquilibriumError> {
        imbalance(state, site, load, &mut self.left_over)?;
        let free = self.free.iter().map(|&degree| self.left_over[degree]);
        Ok(DVector::from_iterator(self.free.len(), free))
    }

    fn displace(&mut self, state: &mut State, step: &[f64]) {
        self.displacement.fill(0.0);
        for (&degree, &step) in self.free.iter().zip(step) {
            self.displacement[degree] = step;
        }
        state.displace(&self.displacement);
    }

    /// Takes the stiffness and the mass matrix at the present coordinates.
    fn stiffen(
        &mut self,
        state: &mut State,
        site: usize,
        load: &Load,
        left_over: &DVector<f64>,
    ) -> Result<(), EquilibriumError> {
        self.coordinates.copy_from_slice(state.coordinates().0);
        for (column, &degree) in self.free.iter().enumerate() {
            self.displacement.fill(0.0);
            self.displacement[degree] = SHIFT;
            state.displace(&self.displacement);
            imbalance(state, site, load, &mut self.shifted)?;
            state.set_coordinates(&self.coordinates);
            for (row, &other) in self.free.iter().enumerate() {
                self.stiffness[(row, column)] = (left_over[row] - self.shifted[other]) / SHIFT;
            }
        }
        state.mass_matrix(&mut self.all_mass);
        for (column, &degree) in self.free.iter().enumerate() {
            for (row, &other) in self.free.iter().enumerate() {
                self.mass[(row, column)] = self.all_mass[(other, degree)];
            }
        }
        Ok(())
    }

    /// (K + lambda M)^-1 r, where the symmetric part is positive definite.
    fn step(&self, left_over: &DVector<f64>, lambda: f64) -> Option<DVector<f64>> {
        let system = &self.stiffness + &self.mass * lambda;
        definite(&system)?;
        let step = system.lu().solve(left_over)?;
        step.iter().all(|step| step.is_finite()).then_some(step)
    }

    /// The next larger lambda (1/s^2): from a thousandth of what the stiffest joint has.
    fn larger(&self, lambda: f64) -> f64 {
        if lambda > 0.0 {
            return if lambda > 1e9 * self.stiffest() {
                f64::INFINITY
            } else {
                10.0 * lambda
            };
        }
        1e-6 * self.stiffest()
    }

    fn smaller(&self, lambda: f64) -> f64 {
        if lambda > 1e-6 * self.stiffest() {
            0.1 * lambda
        } else {
            0.0
        }
    }

    fn stiffest(&self) -> f64 {
        let joints = 0..self.free.len();
        joints
            .map(|joint| self.stiffness[(joint, joint)].abs() / self.mass[(joint, joint)])
            .fold(1e-3, f64::max)
    }

    /// The equilibrium that was found, if it is stable.
    fn stable(
        &mut self,
        state: &mut State,
        site: usize,
        load: &Load,
        left_over: &DVector<f64>,
        iterations: usize,
        last_step_rad: f64,
    ) -> Result<Equilibrium, EquilibriumError> {
        self.stiffen(state, site, load, left_over)?;
        // The stiffness that decides on stability is that of the rest itself.
        match definite(&self.stiffness) {
            Some(()) => Ok(Equilibrium {
                iterations,
                last_step_rad,
            }),
            None => Err(EquilibriumError::Unstable),
        }
    }

    /// The error that names what nothing holds, or what still moved.
    fn not_at_rest(&self, state: &State, iterations: usize) -> EquilibriumError {
        let model = state.model();
        let joint = |free: usize| model.joint_name(model.joint_of_degree(self.free[free]));
        let loose = (0..self.free.len()).find(|&free| {
            self.stiffness[(free, free)].abs() <= WEIGHTLESS * self.mass[(free, free)]
        });
        if let Some(free) = loose {
            return EquilibriumError::NotHeld { joint: joint(free) };
        }
        let moves = (0..self.free.len()).max_by(|&one, &other| {
            let force = |free: usize| self.left_over[self.free[free]].abs();
            force(one).total_cmp(&force(other))
        });
        EquilibriumError::NotAtRest {
            joint: moves.map_or_else(String::new, joint),
            iterations,
        }
    }
}

/// Whether the symmetric part of a stiffness is positive definite, whatever the units.
fn definite(stiffness: &DMatrix<f64>) -> Option<()> {
    let size = stiffness.diagonal().map(f64::sqrt);
    if !size.iter().all(|&size| size > 0.0) {
        return None;
    }
    let relative = DMatrix::from_fn(stiffness.nrows(), stiffness.ncols(), |row, column| {
        0.5 * (stiffness[(row, column)] + stiffness[(column, row)]) / (size[row] * size[column])
    });
    Cholesky::new(relative).map(drop)
}

/// The forces that are left over in all degrees of freedom.
fn imbalance(
    state: &mut State,
    site: usize,
    load: &Load,
    left_over: &mut [f64],
) -> Result<(), EquilibriumError> {
    (state.imbalance(site, &load.force_n, &load.torque_nm, left_over))
        .map_err(|error| EquilibriumError::NoForces(error.to_string()))
}
