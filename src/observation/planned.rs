//! Readings that are planned: the one way in which planning, predictions and studies see them.

use std::borrow::Cow;

use nalgebra::{DMatrix, Matrix3xX, Matrix6, Matrix6xX, Vector3};

use super::braced::BareArm;
use super::compliances::ComplianceRows;
use super::first_order::{FirstOrder, stands_off_spring};
use super::observed::ObservedRows;
use super::reading::{DeflectionPrecision, of_positions};
use crate::parameter::{ElasticArm, ParameterSet, ReadingSource, Unloaded, counted_times};
use crate::robot::{Approach, KinematicState, Kinematics, Load};

/// How far joints are moved to see what follows them (rad, m).
const SHIFT: f64 = 1e-5;
/// How far a force is changed, as a share of it.
const FORCE_SHIFT: f64 = 1e-3;

/// The precision where nothing is read, as at a test pose.
pub const NOTHING_READ: DeflectionPrecision = DeflectionPrecision {
    sigma_m: 1.0,
    rotation_sigma_rad: None,
    unloaded: Unloaded::Own,
};

/// The readings of an arm at one of its tools, at nominal parameters: derivatives with respect to parameters in units
/// of their sizes, and covariances.
#[derive(Debug, Clone)]
pub struct PlannedReadings<'a> {
    arm: BareArm<'a>,
    /// The last configuration (rad).
    q: Vec<f64>,
    /// The arm's geometry there.
    state: KinematicState,
    precision: DeflectionPrecision,
    rows: PlannedRows<'a>,
}

/// What the rows of the readings' derivatives come from.
#[derive(Debug, Clone)]
enum PlannedRows<'a> {
    /// Of compliances alone, where only the instrument's noise disturbs: in closed form, with gradients.
    Compliances(Box<ComplianceRows<'a>>),
    /// Of any parameters in deflections of an arm without springs beside the joints' own: the same.
    Deflections(Box<FirstOrder<'a>>),
    /// Of any others.
    Others(Box<ObservedRows<'a>>),
}

impl<'a> PlannedReadings<'a> {
    /// The readings at one of an arm's tools. Derivatives are in units of the parameters' `sizes` (p).
    pub fn new(
        arm: &'a ElasticArm,
        target: usize,
        set: &ParameterSet,
        sizes: &[f64],
        precision: DeflectionPrecision,
        sources: &'a [ReadingSource],
    ) -> Self {
        // Where joints stand off their springs by what they carry, the arm's weight counts, and with it what it carries.
        let is_laden = arm.payload.is_some()
            && (set.parameters().iter()).any(|each| stands_off_spring(arm, each.kind).is_some());
        let is_bare = !arm.chain.elements.has_springs() && !is_laden;
        let rows = if precision.rows() == 3 && is_bare {
            let sigma_m = precision.sigma_m;
            let model = FirstOrder::new(arm, target, set, sizes, sigma_m, sources);
            PlannedRows::Deflections(Box::new(model.resting_on(precision.unloaded)))
        } else {
            let model = ObservedRows::new(arm, target, set, sizes, precision, sources);
            PlannedRows::Others(Box::new(model))
        };
        let bare = BareArm {
            chain: &arm.chain,
            compliance_rad_per_nm: &arm.compliance_rad_per_nm,
            tool: &arm.tools[target],
        };
        Self::of(bare, precision, rows)
    }

    /// The readings where the compliances of some joints alone are to be found, and only the instrument's noise
    /// disturbs.
    pub fn of_compliances(
        arm: BareArm<'a>,
        joints: &[usize],
        sizes: &[f64],
        precision: DeflectionPrecision,
    ) -> Self {
        let rows = ComplianceRows::new(arm, joints, sizes, precision);
        Self::of(arm, precision, PlannedRows::Compliances(Box::new(rows)))
    }

    fn of(arm: BareArm<'a>, precision: DeflectionPrecision, rows: PlannedRows<'a>) -> Self {
        Self {
            q: vec![0.0; arm.chain.len()],
            state: KinematicState::new(arm.chain.len()),
            arm,
            precision,
            rows,
        }
    }

    /// The same where nothing is read, as at a test pose: see [`Self::uncompensated`].
    pub fn at_test_pose(
        arm: &'a ElasticArm,
        target: usize,
        set: &ParameterSet,
        sizes: &[f64],
    ) -> Self {
        Self::new(arm, target, set, sizes, NOTHING_READ, &[])
    }

    /// Readings are from now on those of experiments with so many repeats. What repeats share counts in each reading's
    /// covariance as often as it is shared: then r readings that are taken as independent tell as much as the r repeats
    /// do, J^T (`R_shared` + `R_new`/r)^-1 J.
    pub fn set_repeats(&mut self, repeats: u32) {
        match &mut self.rows {
            // Repeats share nothing of the instrument's noise.
            PlannedRows::Compliances(_) => {}
            PlannedRows::Deflections(model) => model.set_repeats(repeats),
            PlannedRows::Others(model) => model.set_repeats(repeats),
        }
    }

    /// Readings are from now on those of configurations that are approached from this side. Where joints have gaps, it decides on
    /// which side of them they stand: alone, or beside what they carry.
    pub fn come_from(&mut self, approach: Option<&Approach>) {
        match &mut self.rows {
            PlannedRows::Compliances(_) => {}
            PlannedRows::Deflections(model) => model.come_from(approach),
            PlannedRows::Others(model) => model.come_from(approach),
        }
    }

    /// The acceleration of gravity (m/s^2).
    pub const fn gravity_m_s2(&self) -> Vector3<f64> {
        self.arm.chain.gravity_m_s2
    }

    /// The number of a reading's rows: 3, or 6 where rotations are read.
    pub const fn rows(&self) -> usize {
        match &self.rows {
            PlannedRows::Compliances(model) => model.rows(),
            PlannedRows::Deflections(_) => 3,
            PlannedRows::Others(model) => model.rows(),
        }
    }

    /// The number p of parameters.
    pub fn parameters(&self) -> usize {
        match &self.rows {
            PlannedRows::Compliances(model) => model.parameters(),
            PlannedRows::Deflections(model) => model.parameters(),
            PlannedRows::Others(model) => model.parameters(),
        }
    }

    /// Moves to the joint angles `q` (rad).
    pub fn move_to(&mut self, q: &[f64]) {
        let BareArm { chain, tool, .. } = self.arm;
        self.q.copy_from_slice(q);
        chain.at(tool).update(q, &mut self.state);
        match &mut self.rows {
            PlannedRows::Compliances(model) => model.stand(q, &self.state),
            PlannedRows::Deflections(model) => model.stand(q, &self.state),
            PlannedRows::Others(model) => model.move_to(q),
        }
    }

    /// The arm's geometry at the last configuration.
    pub const fn state(&self) -> &KinematicState {
        &self.state
    }

    /// The same with the springs beside the joints' own at work, see [`KinematicState::brace`].
    pub fn seen(&self) -> Cow<'_, KinematicState> {
        if let PlannedRows::Compliances(model) = &self.rows {
            return Cow::Borrowed(model.seen(&self.state));
        }
        let mobility = self.state.mobility(self.arm.compliance_rad_per_nm);
        mobility.map_or(Cow::Borrowed(&self.state), |mobility| {
            let mut state = self.state.clone();
            state.brace(&mobility);
            Cow::Owned(state)
        })
    }

    /// Writes the derivatives of a reading (6 x p); one of three rows leaves the last three to be ignored.
    pub fn derivatives(&self, load: &Load, matrix: &mut Matrix6xX<f64>) {
        match &self.rows {
            PlannedRows::Compliances(model) => model.derivatives(&self.state, load, matrix),
            PlannedRows::Deflections(model) => {
                let mut three = Matrix3xX::zeros(matrix.ncols());
                model.derivatives(load, &mut three);
                matrix.fixed_rows_mut::<3>(0).copy_from(&three);
            }
            PlannedRows::Others(model) => model.derivatives(load, matrix),
        }
    }

    /// Writes the derivatives of what is left at the loaded tool if the deflection at the parameters' nominal values is
    /// compensated (3 x p): what they change of the joints' own deflections, seen at the tool. The scale of the
    /// loads, the instrument and where things stand have no part in it; the task's force, which is not what was
    /// compensated, has. For compliances it is the matrix of a test pose (eq. 23).
    pub fn uncompensated(&self, load: &Load, matrix: &mut Matrix3xX<f64>) {
        match &self.rows {
            PlannedRows::Compliances(model) => model.uncompensated(&self.state, load, matrix),
            PlannedRows::Deflections(model) => model.uncompensated(load, matrix),
            PlannedRows::Others(model) => model.uncompensated(load, matrix),
        }
    }

    /// What one of the sources adds to a reading's covariance (m^2, m rad, rad^2), what repeats share as often as it
    /// is shared.
    pub fn covariance_of(&self, source: usize, load: &Load) -> Matrix6<f64> {
        match &self.rows {
            PlannedRows::Compliances(_) => Matrix6::zeros(),
            PlannedRows::Deflections(model) => of_positions(&model.covariance_of(source, load)),
            PlannedRows::Others(model) => model.covariance_of(source, load),
        }
    }

    /// What all sources add to the instrument's noise.
    pub fn covariance_of_all(&self, load: &Load) -> Matrix6<f64> {
        let sources = 0..self.sources().len();
        sources.map(|source| self.covariance_of(source, load)).sum()
    }

    /// Which reading without the load deflections rest on.
    pub const fn unloaded(&self) -> Unloaded {
        self.precision.unloaded
    }

    /// What one of the sources adds to the covariance of two deflections of this configuration under these loads.
    pub fn covariance_between(&self, source: usize, loads: [&Load; 2]) -> Matrix6<f64> {
        match &self.rows {
            PlannedRows::Compliances(_) => Matrix6::zeros(),
            PlannedRows::Deflections(model) => {
                of_positions(&model.covariance_between(source, loads))
            }
            PlannedRows::Others(model) => model.covariance_between(source, loads),
        }
    }

    /// What all sources add to it.
    pub fn covariance_shared(&self, loads: [&Load; 2]) -> Matrix6<f64> {
        let sources = 0..self.sources().len();
        sources
            .map(|source| self.covariance_between(source, loads))
            .sum()
    }

    /// The covariance of the readings of this configuration's experiments: loads, and how often they are measured.
    pub fn covariance_together(&mut self, experiments: &[(Load, u32)]) -> CovarianceTogether {
        let precision = self.precision;
        let rows = self.rows();
        let parts = precision.unloaded.shared_part();
        let noise = precision.covariance();
        let blocks = |one: &mut dyn FnMut(&mut Self, usize) -> Matrix6<f64>,
                      between: &dyn Fn(&Self, usize, usize) -> Matrix6<f64>,
                      model: &mut Self| {
            let mut all = DMatrix::zeros(rows * experiments.len(), rows * experiments.len());
            for (row, &(_, repeats)) in experiments.iter().enumerate() {
                for (column, &(_, others)) in experiments.iter().enumerate() {
                    let block = if row == column {
                        one(model, row)
                    } else {
                        between(model, row, column)
                            * (f64::from(repeats) * f64::from(others)).sqrt()
                    };
                    let mut place = all.view_mut((rows * row, rows * column), (rows, rows));
                    place.copy_from(&block.view((0, 0), (rows, rows)));
                }
            }
            all
        };
        let noise = blocks(
            &mut |_, place| noise * counted_times(parts, f64::from(experiments[place].1)),
            &|_, _, _| noise * parts,
            self,
        );
        let sources: Vec<DMatrix<f64>> = (0..self.sources().len())
            .map(|source| {
                let mut one = |model: &mut Self, place: usize| {
                    let (load, repeats) = &experiments[place];
                    model.set_repeats(*repeats);
                    model.covariance_of(source, load)
                };
                let between = |model: &Self, row: usize, column: usize| {
                    model.covariance_between(source, [&experiments[row].0, &experiments[column].0])
                };
                blocks(&mut one, &between, self)
            })
            .collect();
        CovarianceTogether { noise, sources }
    }

    /// The derivatives of the readings of this configuration's experiments, one below the other.
    pub fn derivatives_together(&self, experiments: &[(Load, u32)]) -> DMatrix<f64> {
        let (rows, size) = (self.rows(), self.parameters());
        let mut all = DMatrix::zeros(rows * experiments.len(), size);
        let mut derivatives = Matrix6xX::zeros(size);
        for (place, (load, _)) in experiments.iter().enumerate() {
            self.derivatives(load, &mut derivatives);
            let mut own = all.rows_mut(rows * place, rows);
            own.copy_from(&derivatives.rows(0, rows));
        }
        all
    }

    /// The rows of each of this configuration's experiments, whitened together: the sum of r A^T A over them is what they tell.
    pub fn observe_together(&mut self, experiments: &[(Load, u32)]) -> Vec<DMatrix<f64>> {
        let mut derivatives = self.derivatives_together(experiments);
        let covariance = self.covariance_together(experiments);
        covariance.whiten(experiments, &mut derivatives);
        let rows = self.rows();
        (0..experiments.len())
            .map(|place| derivatives.rows(rows * place, rows).into_owned())
            .collect()
    }

    fn sources(&self) -> &[ReadingSource] {
        match &self.rows {
            PlannedRows::Compliances(_) => &[],
            PlannedRows::Deflections(model) => model.sources(),
            PlannedRows::Others(model) => model.sources(),
        }
    }

    /// Writes the derivatives of the whitened reading: 3 x p for positions, and 3 x p for rotations beside them.
    pub fn observe(&self, load: &Load, matrix: &mut Matrix3xX<f64>) {
        match &self.rows {
            PlannedRows::Compliances(model) => model.observe(&self.state, load, matrix),
            PlannedRows::Deflections(model) => model.observe(load, matrix),
            PlannedRows::Others(model) => model.observe(load, matrix),
        }
    }

    /// Adds the derivatives of a cost of the information A^T A of the whitened rows A with respect to the joint angles
    /// to `gradient` (n). `factor` is that with respect to A.
    pub fn pull_back(&mut self, load: &Load, factor: &Matrix3xX<f64>, gradient: &mut [f64]) {
        match &mut self.rows {
            PlannedRows::Compliances(model) => {
                model.pull_back(&self.state, load, factor, gradient);
            }
            PlannedRows::Deflections(model) if model.has_gradient() => {
                model.pull_back(load, factor, gradient);
            }
            PlannedRows::Deflections(_) | PlannedRows::Others(_) => {
                self.add_differences(load, factor, gradient);
            }
        }
    }

    /// The same by differences.
    fn add_differences(&mut self, load: &Load, factor: &Matrix3xX<f64>, gradient: &mut [f64]) {
        let here = self.q.clone();
        let mut q = here.clone();
        let mut matrix = Matrix3xX::zeros(factor.ncols());
        for (joint, slope) in gradient.iter_mut().enumerate().take(here.len()) {
            let mut at = |shift: f64| {
                q[joint] = here[joint] + shift;
                self.move_to(&q);
                self.observe(load, &mut matrix);
                factor.dot(&matrix)
            };
            *slope += (at(SHIFT) - at(-SHIFT)) / (2.0 * SHIFT);
            q[joint] = here[joint];
        }
        self.move_to(&here);
    }

    /// The same with respect to the force.
    pub fn force_gradient(&mut self, load: &Load, factor: &Matrix3xX<f64>) -> Vector3<f64> {
        match &mut self.rows {
            PlannedRows::Compliances(model) => model.force_gradient(&self.state, factor),
            PlannedRows::Deflections(model) if model.has_gradient() => {
                model.pull_back(load, factor, &mut [])
            }
            PlannedRows::Deflections(_) | PlannedRows::Others(_) => {
                let mut matrix = Matrix3xX::zeros(factor.ncols());
                let shift = FORCE_SHIFT * load.force_n.norm().max(1.0);
                Vector3::from_fn(|axis, _| {
                    let mut at = |shift: f64| {
                        let mut load = *load;
                        load.force_n[axis] += shift;
                        self.observe(&load, &mut matrix);
                        factor.dot(&matrix)
                    };
                    (at(shift) - at(-shift)) / (2.0 * shift)
                })
            }
        }
    }
}

/// The covariance of the readings of all experiments of one configuration, taken so that r readings of each that are independent
/// of one another tell as much as they do: with the mean readings' covariance C and the repeats D, it is D^1/2 C D^1/2.
#[derive(Debug, Clone)]
pub struct CovarianceTogether {
    /// By the instrument's own noise.
    pub noise: DMatrix<f64>,
    /// By each of the sources.
    pub sources: Vec<DMatrix<f64>>,
}

impl CovarianceTogether {
    /// By all.
    pub fn all(&self) -> DMatrix<f64> {
        let nothing = DMatrix::zeros(self.noise.nrows(), self.noise.ncols());
        let of_sources = self
            .sources
            .iter()
            .fold(nothing, |sum, source| sum + source);
        &self.noise + of_sources
    }

    /// Makes columns (of readings, one experiment's below the other's) those of whitened readings, each of as many as there are
    /// repeats.
    pub fn whiten(&self, experiments: &[(Load, u32)], columns: &mut DMatrix<f64>) {
        let rows = columns.nrows() / experiments.len();
        weigh_repeats(experiments, rows, columns, 1.0);
        let covariance = self.all();
        let typical = covariance.diagonal().map(f64::sqrt);
        let factor = covariance.cholesky().map(nalgebra::Cholesky::unpack);
        // It is positive definite: the instrument's noise is in it.
        let factor = factor.unwrap_or_else(|| DMatrix::from_diagonal(&typical));
        factor.solve_lower_triangular_mut(columns);
        weigh_repeats(experiments, rows, columns, -1.0);
    }
}

/// Rows of each experiment times the root of its repeats, or over it.
fn weigh_repeats(experiments: &[(Load, u32)], rows: usize, columns: &mut DMatrix<f64>, power: f64) {
    for (place, &(_, repeats)) in experiments.iter().enumerate() {
        let mut own = columns.rows_mut(rows * place, rows);
        own *= f64::from(repeats).sqrt().powf(power);
    }
}
