//! Readings that are planned: the one way in which planning, predictions and studies see them.

mod rounding;
mod together;

use std::borrow::Cow;
use std::cell::RefCell;

use nalgebra::{DMatrix, Matrix3, Matrix3xX, Matrix6, Matrix6xX, SMatrix, Vector3, Vector6};

use super::compliances::{BareArm, ComplianceRows};
use super::gradient::{DeflectionGradient, WhitenedReading};
use super::observed::ObservedRows;
use super::reading::{DeflectionPrecision, Whitener};
use super::reading_errors::for_each_effect;
use super::shown::ShownRows;
use crate::experiment::Experiment;
use crate::parameter::{ElasticArm, ParameterSet, ReadingSource, Unloaded, counted_times};
use crate::robot::{Approach, KinematicState, Kinematics, Load};

pub use together::CovarianceTogether;

/// How far joints are moved to see what follows them (rad, m).
const SHIFT: f64 = 1e-5;
/// How far a force is changed, as a share of it.
const FORCE_SHIFT: f64 = 1e-3;

/// The precision where nothing is read, as at a test pose.
pub const NOTHING_READ: DeflectionPrecision = DeflectionPrecision {
    sigma_m: 1.0,
    rotation_sigma_rad: None,
    unloaded: Unloaded::Own,
    along_sigma_m: None,
    along_step_m: 0.0,
    reads_all: true,
};

/// A load, and the direction along which a deflection under it is read, where it is along one (unit vector, world frame).
type LoadAlong<'r> = (&'r Load, Option<&'r Vector3<f64>>);

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
    /// Which rows it has.
    shown: ShownRows,
    /// Whether it is along a direction.
    is_along: bool,
    /// What disturbs readings besides the instrument's noise.
    sources: &'a [ReadingSource],
    /// How often an experiment is repeated.
    repeats: f64,
    parameters: usize,
    rows: PlannedRows<'a>,
}

/// What the rows of the readings' derivatives come from.
#[derive(Debug, Clone)]
enum PlannedRows<'a> {
    /// Of compliances alone, where only the instrument's noise disturbs: in closed form, with gradients.
    Compliances(Box<ComplianceRows>),
    /// Of any parameters.
    Any(Box<ObservedRows<'a>>, Option<Box<ClosedGradient<'a>>>),
}

/// Gradients where they are in closed form, and the reading that was observed last: its gradient is asked for next.
#[derive(Debug, Clone)]
struct ClosedGradient<'a> {
    of: DeflectionGradient<'a>,
    last: RefCell<Option<WhitenedReading>>,
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
        let observed = ObservedRows::new(arm, target, set, sizes, precision.kind(), sources);
        let gradient = (precision.rows() == 3 && observed.is_bare())
            .then(|| DeflectionGradient::new(arm, target, set, sizes, sources))
            .flatten();
        let gradient = gradient.map(|of| {
            Box::new(ClosedGradient {
                of,
                last: RefCell::new(None),
            })
        });
        let bare = BareArm {
            chain: &arm.chain,
            compliance_rad_per_nm: &arm.compliance_rad_per_nm,
            tool: &arm.tools[target],
        };
        let rows = PlannedRows::Any(Box::new(observed), gradient);
        Self::of(bare, sizes.len(), precision, rows, sources)
    }

    /// The readings where the compliances of some joints alone are to be found, and only the instrument's noise
    /// disturbs.
    pub fn of_compliances(
        arm: BareArm<'a>,
        joints: &[usize],
        sizes: &[f64],
        precision: DeflectionPrecision,
    ) -> Self {
        let rows = ComplianceRows::new(arm.chain.len(), joints, sizes, precision);
        let rows = PlannedRows::Compliances(Box::new(rows));
        Self::of(arm, sizes.len(), precision, rows, &[])
    }

    fn of(
        arm: BareArm<'a>,
        parameters: usize,
        precision: DeflectionPrecision,
        rows: PlannedRows<'a>,
        sources: &'a [ReadingSource],
    ) -> Self {
        Self {
            q: vec![0.0; arm.chain.len()],
            state: KinematicState::new(arm.chain.len()),
            arm,
            precision,
            shown: ShownRows::of(&precision, None),
            is_along: false,
            sources,
            repeats: 1.0,
            parameters,
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
        self.forget();
        self.repeats = f64::from(repeats);
    }

    /// Readings are from now on those of configurations that are approached from this side. Where joints have gaps, it decides on
    /// which side of them they stand: alone, or beside what they carry.
    pub fn come_from(&mut self, approach: Option<&Approach>) {
        self.forget();
        if let PlannedRows::Any(observed, gradient) = &mut self.rows {
            observed.come_from(approach);
            if let Some(gradient) = gradient {
                gradient.of.come_from(approach);
            }
        }
    }

    /// Readings are from now on those along a direction (unit vector, world frame), or without one of all coordinates, where such are read.
    pub fn read_along(&mut self, direction: Option<&Vector3<f64>>) {
        let share = ReadingSource::share_along(self.sources);
        let direction = direction.map(|direction| direction * share);
        let shown = ShownRows::of(&self.precision, direction.as_ref());
        if (self.shown, self.is_along) != (shown, direction.is_some()) {
            self.forget();
            (self.shown, self.is_along) = (shown, direction.is_some());
            if let PlannedRows::Any(observed, _) = &mut self.rows {
                observed.read_along(self.is_along);
            }
        }
    }

    /// What was observed last is no longer what there is.
    fn forget(&mut self) {
        if let PlannedRows::Any(_, Some(gradient)) = &mut self.rows {
            *gradient.last.get_mut() = None;
        }
    }

    /// The acceleration of gravity (m/s^2).
    pub const fn gravity_m_s2(&self) -> Vector3<f64> {
        self.arm.chain.gravity_m_s2
    }

    /// The number of a reading's rows: 3, or 6 where rotations are read.
    pub const fn rows(&self) -> usize {
        self.precision.rows()
    }

    /// The number p of parameters.
    pub const fn parameters(&self) -> usize {
        self.parameters
    }

    /// Readings are from now on those of an experiment: approached and read along as it says, where it stands.
    pub fn stand_at(&mut self, experiment: &Experiment) {
        self.come_from(experiment.approach.as_ref());
        self.read_along(experiment.direction.as_ref());
        self.move_to(experiment.configuration_rad.as_slice());
    }

    /// The same of another experiment of this configuration, as often as it is repeated.
    fn read_as(&mut self, experiment: &Experiment) {
        self.set_repeats(experiment.repeats);
        self.read_along(experiment.direction.as_ref());
    }

    /// Moves to the joint angles `q` (rad).
    pub fn move_to(&mut self, q: &[f64]) {
        self.forget();
        let BareArm { chain, tool, .. } = self.arm;
        self.q.copy_from_slice(q);
        chain.at(tool).update(q, &mut self.state);
        if let PlannedRows::Any(model, _) = &mut self.rows {
            model.move_to(q);
        }
    }

    /// The arm's geometry at the last configuration.
    pub const fn state(&self) -> &KinematicState {
        &self.state
    }

    /// The same with the springs beside the joints' own at work, see [`KinematicState::brace`].
    pub fn seen(&self) -> Cow<'_, KinematicState> {
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
            PlannedRows::Any(model, _) => model.derivatives(&self.state, load, matrix),
        }
        self.shown.of_derivatives(matrix);
    }

    /// Writes the derivatives of what is left at the loaded tool if the deflection at the parameters' nominal values is
    /// compensated (3 x p): what they change of the joints' own deflections, seen at the tool. The scale of the
    /// loads, the instrument and where things stand have no part in it; the task's force, which is not what was
    /// compensated, has. For compliances it is the matrix of a test pose (eq. 23).
    pub fn uncompensated(&self, load: &Load, matrix: &mut Matrix3xX<f64>) {
        match &self.rows {
            PlannedRows::Compliances(model) => {
                let mut six = Matrix6xX::zeros(matrix.ncols());
                model.derivatives(&self.state, load, &mut six);
                matrix.copy_from(&six.fixed_rows::<3>(0));
            }
            PlannedRows::Any(model, _) => model.uncompensated(load, matrix),
        }
    }

    /// Adds to these what they change where the load is given in the tool's frame, and turns with it. Rows in closed form do not have it.
    pub fn add_turning_load(&self, load: &Load, matrix: &mut Matrix3xX<f64>) {
        if let PlannedRows::Any(model, _) = &self.rows {
            model.add_turning_load(load, matrix);
        }
    }

    /// Tells how one standard deviation of each number of a source moves a reading (m, rad).
    fn for_each_effect(
        &self,
        source: &ReadingSource,
        load: &Load,
        tell: &mut impl FnMut(Vector6<f64>),
    ) {
        if !source.is_of_deflection(self.is_along) {
            return;
        }
        let mut tell = |effect| tell(self.shown.of_effect(effect));
        if let ReadingSource::TransmissionError(error) = source
            && let PlannedRows::Any(model, _) = &self.rows
        {
            // A joint stands elsewhere loaded and unloaded: a deflection shows what that changes.
            return model.for_each_gear(&self.state, load, &error.deviations, &mut tell);
        }
        let at_target = (load, &Vector3::zeros());
        let states = [&self.state, &*self.seen()];
        for_each_effect(source, self.arm, states, at_target, None, &mut tell);
    }

    /// How many times a source's variance counts.
    fn times(&self, source: &ReadingSource) -> f64 {
        counted_times(source.shared_part(self.unloaded()), self.repeats)
    }

    /// What one of the sources adds to the covariance of a reading's first R rows (m^2, m rad, rad^2), what repeats share as often as
    /// it is shared.
    fn added<const R: usize>(&self, source: &ReadingSource, load: &Load) -> SMatrix<f64, R, R> {
        let mut sum = SMatrix::zeros();
        self.for_each_effect(source, load, &mut |effect| {
            let effect = effect.fixed_rows::<R>(0);
            sum += effect * effect.transpose();
        });
        sum * self.times(source)
    }

    /// What all sources add to the instrument's noise.
    pub fn covariance_of_all(&self, load: &Load) -> Matrix6<f64> {
        let sources = self.sources.iter();
        sources.map(|source| self.added::<6>(source, load)).sum()
    }

    /// Which reading without the load deflections rest on.
    pub const fn unloaded(&self) -> Unloaded {
        self.precision.unloaded
    }

    /// What one of the sources adds to the covariance of two deflections of this configuration, each under a load and along a direction
    /// where it is along one.
    fn covariance_between(
        &mut self,
        source: &ReadingSource,
        [one, other]: [LoadAlong<'_>; 2],
    ) -> Matrix6<f64> {
        match source.shared_part(self.unloaded()) {
            0.0 => Matrix6::zeros(),
            part => {
                let mut effects = |(load, direction)| {
                    self.read_along(direction);
                    let mut effects = Vec::new();
                    self.for_each_effect(source, load, &mut |effect| effects.push(effect));
                    effects
                };
                let (one, other) = (effects(one), effects(other));
                let pairs = one.iter().zip(&other);
                let sum: Matrix6<f64> = pairs.map(|(one, other)| one * other.transpose()).sum();
                sum * part
            }
        }
    }

    /// What all sources add to it.
    pub fn covariance_shared(&mut self, pair: [LoadAlong<'_>; 2]) -> Matrix6<f64> {
        let sources = self.sources.iter();
        sources
            .map(|source| self.covariance_between(source, pair))
            .sum()
    }

    /// W with W C W^T = I for the covariance C of a reading, of all coordinates; rows that it does not have are zero.
    fn whitener(&self, load: &Load) -> Matrix6<f64> {
        self.shown.of_whitener(self.own_whitener(load))
    }

    /// The same of the rows that a reading has.
    fn own_whitener(&self, load: &Load) -> Matrix6<f64> {
        let noise = self.precision.covariance() * self.noise_times(load);
        let alone = |variance: f64| {
            if variance > 0.0 {
                variance.sqrt().recip()
            } else {
                0.0
            }
        };
        let alone = || Matrix6::from_diagonal(&noise.diagonal().map(alone));
        if self.sources.is_empty() {
            return alone();
        }
        if self.rows() == 6 {
            let whitener = Whitener::of_covariance(&(noise + self.covariance_of_all(load)));
            return whitener.map_or_else(alone, |whitener| *whitener.matrix());
        }
        let mut covariance: Matrix3<f64> = noise.fixed_view::<3, 3>(0, 0).into_owned();
        for source in self.sources {
            covariance += self.added::<3>(source, load);
        }
        let inverse = (covariance.cholesky()).and_then(|factor| factor.l().try_inverse());
        inverse.map_or_else(alone, |inverse| {
            let mut whitener = Matrix6::zeros();
            whitener.fixed_view_mut::<3, 3>(0, 0).copy_from(&inverse);
            whitener
        })
    }

    /// The covariance of the readings of this configuration's experiments.
    pub fn covariance_together(&mut self, experiments: &[&Experiment]) -> CovarianceTogether {
        let rows = self.rows();
        let together = |block: &mut dyn FnMut(usize, usize) -> Matrix6<f64>| {
            let size = rows * experiments.len();
            let mut all = DMatrix::zeros(size, size);
            for (row, one) in experiments.iter().enumerate() {
                for (column, other) in experiments.iter().enumerate() {
                    let mut block = block(row, column);
                    if row != column {
                        block *= (f64::from(one.repeats) * f64::from(other.repeats)).sqrt();
                    }
                    let mut place = all.view_mut((rows * row, rows * column), (rows, rows));
                    place.copy_from(&block.view((0, 0), (rows, rows)));
                }
            }
            all
        };
        let part = self.precision.unloaded.shared_part();
        let noise = self.precision.covariance();
        let noise = together(&mut |row, column| {
            self.read_as(experiments[row]);
            noise
                * if row == column {
                    self.noise_times(&experiments[row].load)
                } else {
                    part
                }
        });
        let sources = self.sources.iter().map(|source| {
            together(&mut |row, column| {
                if row == column {
                    self.read_as(experiments[row]);
                    self.added(source, &experiments[row].load)
                } else {
                    let pair = [row, column].map(|place| {
                        let experiment = experiments[place];
                        (&experiment.load, experiment.direction.as_ref())
                    });
                    self.covariance_between(source, pair)
                }
            })
        });
        CovarianceTogether {
            sources: sources.collect(),
            noise,
        }
    }

    /// The derivatives of the readings of this configuration's experiments, one below the other.
    pub fn derivatives_together(&mut self, experiments: &[&Experiment]) -> DMatrix<f64> {
        let (rows, size) = (self.rows(), self.parameters());
        let mut all = DMatrix::zeros(rows * experiments.len(), size);
        let mut derivatives = Matrix6xX::zeros(size);
        for (place, experiment) in experiments.iter().enumerate() {
            self.read_as(experiment);
            self.derivatives(&experiment.load, &mut derivatives);
            let mut own = all.rows_mut(rows * place, rows);
            own.copy_from(&derivatives.rows(0, rows));
        }
        all
    }

    /// The rows of each of this configuration's experiments, whitened together: the sum of r A^T A over them is what they tell.
    pub fn observe_together(&mut self, experiments: &[&Experiment]) -> Vec<DMatrix<f64>> {
        let mut derivatives = self.derivatives_together(experiments);
        let covariance = self.covariance_together(experiments);
        covariance.whiten(experiments, &mut derivatives);
        let rows = self.rows();
        (0..experiments.len())
            .map(|place| derivatives.rows(rows * place, rows).into_owned())
            .collect()
    }

    /// Writes the derivatives of the whitened reading: 3 x p for positions, and 3 x p for rotations beside them.
    pub fn observe(&self, load: &Load, matrix: &mut Matrix3xX<f64>) {
        match &self.rows {
            PlannedRows::Compliances(model) => {
                model.observe(&self.state, load, matrix);
                self.shown.of_rows(matrix);
            }
            PlannedRows::Any(model, gradient) => {
                let whitener = self.whitener(load);
                model.observe(&self.state, load, &whitener, matrix);
                if let Some(gradient) = gradient {
                    gradient.note(load, &whitener, matrix);
                }
            }
        }
    }

    /// Adds the derivatives of a cost of the information A^T A of the whitened rows A with respect to the joint angles
    /// to `gradient` (n). `factor` is that with respect to A, A times a symmetric matrix.
    pub fn pull_back(&mut self, load: &Load, factor: &Matrix3xX<f64>, gradient: &mut [f64]) {
        let of_all = self.shown.of_factor(factor);
        if let PlannedRows::Compliances(model) = &mut self.rows {
            model.pull_back(&self.state, load, &of_all, gradient);
        } else if self.closed_gradient(load, factor, gradient).is_none() {
            self.add_differences(load, factor, gradient);
        }
    }

    /// The same in closed form, where there is one, and with respect to the force.
    fn closed_gradient(
        &mut self,
        load: &Load,
        factor: &Matrix3xX<f64>,
        gradient: &mut [f64],
    ) -> Option<Vector3<f64>> {
        let PlannedRows::Any(_, Some(closed)) = &self.rows else {
            return None;
        };
        let is_known = (closed.last.borrow().as_ref()).is_some_and(|last| last.load == *load);
        if !is_known {
            self.observe(load, &mut Matrix3xX::zeros(factor.ncols()));
        }
        let (unloaded, repeats) = (self.unloaded(), self.repeats);
        let (is_along, of_noise) = (self.is_along, self.slope_of_noise(load));
        let times = |source: &ReadingSource| {
            let is_counted = f64::from(u8::from(source.is_of_deflection(is_along)));
            let times = counted_times(source.shared_part(unloaded), repeats);
            is_counted * (times + of_noise)
        };
        let PlannedRows::Any(_, Some(closed)) = &mut self.rows else {
            return None;
        };
        let ClosedGradient { of, last } = &mut **closed;
        let here = &self.state;
        Some(of.pull_back(here, last.get_mut().as_ref()?, &times, factor, gradient))
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
        if let PlannedRows::Compliances(model) = &self.rows {
            return model.force_gradient(&self.state, &self.shown.of_factor(factor));
        }
        if let Some(of_force) = self.closed_gradient(load, factor, &mut []) {
            return of_force;
        }
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

impl ClosedGradient<'_> {
    /// Notes what was observed.
    fn note(&self, load: &Load, whitener: &Matrix6<f64>, rows: &Matrix3xX<f64>) {
        let whitener = whitener.fixed_view::<3, 3>(0, 0).into_owned();
        match &mut *self.last.borrow_mut() {
            Some(last) => {
                (last.load, last.whitener) = (*load, whitener);
                last.rows.copy_from(rows);
            }
            last => {
                *last = Some(WhitenedReading {
                    load: *load,
                    whitener,
                    rows: rows.clone(),
                });
            }
        }
    }
}

#[cfg(test)]
pub(super) mod tests;
