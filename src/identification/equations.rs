//! The measurements as whitened equations in the unknown compliances.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, Matrix6, Matrix6xX, Vector3};

use super::error::IdentificationError;
use crate::measurement::Measurement;
use crate::numeric::estimable::Estimable;
use crate::parameter::Prior;
use crate::robot::{
    EquilibriumSolver, KinematicState, Kinematics, Load, ObservationMatrix, Robot, Tool,
    rotation_vector,
};
use crate::task::{Extended, Method};

/// What the equations are built from.
#[derive(Debug, Clone, Copy)]
pub(super) struct EquationSource<'a> {
    pub nominal: &'a Robot,
    pub tool: &'a Tool,
    pub parameters: &'a [usize],
    /// What else is uncertain: it makes the vector of unknowns longer.
    pub uncertain: Option<&'a Extended>,
    pub measurements: &'a [Measurement],
    /// The standard deviation of deflections that bring none of their own (m).
    pub sigma_m: f64,
    /// What is known of the compliances before; it stands below the measurements.
    pub prior: Option<&'a Prior>,
    /// The compliances that stay nominal all the same, as places among the unknowns.
    pub held: &'a [usize],
}

/// Whitened equations: `matrix` times (the unknowns minus the linearisation point) = `right_hand_side`.
#[derive(Debug)]
pub(super) struct Equations {
    pub matrix: DMatrix<f64>,
    pub right_hand_side: DVector<f64>,
}

impl EquationSource<'_> {
    pub(super) fn rows(&self) -> usize {
        self.measurements.iter().map(rows_of).sum()
    }

    /// The nominal values of the unknowns (p).
    pub fn nominal_values(&self) -> Vec<f64> {
        match self.uncertain {
            Some(extended) => extended.set().prior().mean.as_slice().to_vec(),
            None => (self.parameters.iter())
                .map(|&joint| self.nominal.compliance_rad_per_nm[joint])
                .collect(),
        }
    }

    /// The typical sizes of the unknowns (p).
    pub fn sizes(&self) -> Vec<f64> {
        let mut sizes = self.nominal.typical_rad_per_nm(self.parameters);
        if let Some(extended) = self.uncertain {
            sizes.extend(extended.other_sizes());
        }
        sizes
    }

    /// What whitened equations of the unknowns determine.
    pub fn estimable(&self, matrix: &DMatrix<f64>) -> Estimable {
        if self.held.is_empty() {
            return Estimable::of_equations(matrix, &self.sizes());
        }
        let mut others = matrix.clone();
        for &place in self.held {
            others.column_mut(place).fill(0.0);
        }
        Estimable::of_equations(&others, &self.sizes())
    }

    /// The names of the unknowns: joints for compliances.
    pub fn names(&self) -> Vec<String> {
        let joints = &self.nominal.chain.joints;
        let own = self
            .parameters
            .iter()
            .map(|&joint| joints[joint].name.clone());
        let others = self.uncertain.map(Extended::other_names);
        own.chain(others.into_iter().flatten()).collect()
    }

    /// The compliance of every joint (rad/(N m)) for values of the unknowns.
    pub fn compliance(&self, values: &[f64]) -> Vec<f64> {
        if let Some(extended) = self.uncertain {
            let arm = extended.set().apply(extended.arm(), values);
            return arm.compliance_rad_per_nm;
        }
        let mut compliance = self.nominal.compliance_rad_per_nm.clone();
        for (&joint, &value) in self.parameters.iter().zip(values) {
            compliance[joint] = value;
        }
        compliance
    }

    /// Eq. 3 or 7 for each measurement, at the commanded configuration. The parts of the joints that are not
    /// identified go to the right-hand side, and the equations are for k itself. Where springs brace the arm, they hold
    /// near the nominal compliances. Where more is uncertain, they
    /// are for the change of the unknowns from their nominal values.
    pub fn linear(&self) -> Equations {
        if let Some(extended) = self.uncertain {
            let values = self.nominal_values();
            let equations = self.extended(extended, Method::Linear, &values);
            // As planned there is always a prediction.
            return equations.unwrap_or_else(|_| Writer::new(0, values.len()).equations);
        }
        let (chain, compliance) = (&self.nominal.chain, &self.nominal.compliance_rad_per_nm);
        let mut arm = chain.at(self.tool);
        let mut state = KinematicState::new(chain.len());
        let others: Vec<usize> = (0..chain.len())
            .filter(|joint| !self.parameters.contains(joint))
            .collect();
        let known =
            DVector::from_iterator(others.len(), others.iter().map(|&joint| compliance[joint]));
        let mut writer = Writer::new(self.rows(), self.parameters.len());
        for each in self.measurements {
            arm.update(each.configuration_rad.as_slice(), &mut state);
            let [moved, turned] = state.brace_under(compliance, &each.load);
            let observed = ObservationMatrix::new(&state, &each.load, self.parameters);
            let rest = ObservationMatrix::new(&state, &each.load, &others);
            writer.push_deflection(
                each,
                &observed.position,
                each.deflection_m - moved - &rest.position * &known,
                &self.sigma(each),
            );
            if let Some(rotation) = &each.rotation {
                writer.push(
                    &observed.rotation,
                    rotation.vector_rad - turned - &rest.rotation * &known,
                    &rotation.sigma_rad,
                );
            }
        }
        self.push_prior(&mut writer, None);
        writer.equations
    }

    /// The displacement between the nominal model's two static equilibria, linearised at values of the unknowns
    /// (p); the equations are for their change.
    pub fn nonlinear(&self, values: &[f64]) -> Result<Equations, IdentificationError> {
        if let Some(extended) = self.uncertain {
            return self.extended(extended, Method::Nonlinear, values);
        }
        let compliance = &self.compliance(values);
        let chain = &self.nominal.chain;
        let mut arm = chain.at(self.tool);
        let mut solver = EquilibriumSolver::new(chain.len());
        let mut writer = Writer::new(self.rows(), self.parameters.len());
        for (index, each) in self.measurements.iter().enumerate() {
            let mut rest = |load: &Load| {
                solver
                    .solve(
                        &mut arm,
                        compliance,
                        each.configuration_rad.as_slice(),
                        load,
                    )
                    .map_err(|error| IdentificationError::from((index, error)))?;
                let sensitivity = solver
                    .sensitivity(compliance)
                    .select_columns(self.parameters);
                let state = solver.state();
                Ok::<_, IdentificationError>((
                    state.tool_position,
                    state.tool_rotation,
                    sensitivity,
                ))
            };
            let (unloaded, unloaded_axes, from) = rest(&Load::NONE)?;
            let (loaded, loaded_axes, to) = rest(&each.load)?;
            let sensitivity = to - from;
            writer.push_deflection(
                each,
                &sensitivity.fixed_rows::<3>(0).into_owned(),
                each.deflection_m - (loaded - unloaded),
                &self.sigma(each),
            );
            if let Some(rotation) = &each.rotation {
                let predicted = rotation_vector(&(loaded_axes * unloaded_axes.transpose()));
                writer.push(
                    &sensitivity.fixed_rows::<3>(3).into_owned(),
                    rotation.vector_rad - predicted,
                    &rotation.sigma_rad,
                );
            }
        }
        self.push_prior(&mut writer, Some(values));
        Ok(writer.equations)
    }

    /// Adds what is known before: of the unknowns, or of their change from some values.
    pub(super) fn push_prior(&self, writer: &mut Writer, from: Option<&[f64]>) {
        let (prior, rows) = match (self.uncertain, self.prior) {
            (Some(extended), _) => (extended.set().prior(), extended.prior_rows().clone()),
            (None, Some(prior)) => (prior, prior.rows(&self.sizes())),
            (None, None) => return,
        };
        let mut mean = prior.mean.clone();
        if let Some(values) = from {
            for (mean, value) in mean.iter_mut().zip(values) {
                *mean -= value;
            }
        }
        writer.extend(&rows, &(&rows * mean));
    }

    /// The standard deviation of a deflection's coordinate (m): the rms of them where measurements
    /// bring their own.
    pub fn typical_sigma_m(&self) -> f64 {
        if self.measurements.iter().all(|each| each.sigma_m.is_none()) {
            return self.sigma_m;
        }
        let squares: f64 = (self.measurements.iter())
            .map(|each| self.sigma(each).norm_squared())
            .sum();
        (squares / (3 * self.measurements.len()) as f64).sqrt()
    }

    /// The first row of each measurement.
    pub(super) fn first_rows(&self) -> impl Iterator<Item = usize> {
        self.measurements.iter().scan(0, |row, each| {
            let first = *row;
            *row += rows_of(each);
            Some(first)
        })
    }

    /// Takes the weights off the whitened rows, which are then in the readings' own units.
    pub(super) fn take_weights_off(&self, rows: &mut DMatrix<f64>) {
        if let Some(extended) = self.uncertain {
            return self.take_extended_weights_off(extended, rows);
        }
        for (each, first) in self.measurements.iter().zip(self.first_rows()) {
            for (axis, sigma) in self.sigma(each).iter().take(rows_of(each)).enumerate() {
                let mut row = rows.row_mut(first + axis);
                row *= *sigma;
            }
            for (axis, sigma) in
                (each.rotation.iter()).flat_map(|each| each.sigma_rad.iter().enumerate())
            {
                let mut row = rows.row_mut(first + 3 + axis);
                row *= *sigma;
            }
        }
    }

    /// The covariance of each measured deflection (m^2), whatever repeats it; of what is along a direction the first element.
    pub(super) fn covariances(&self) -> Vec<Matrix3<f64>> {
        let all = self.covariances_of_all().into_iter();
        all.map(|whole| whole.fixed_view::<3, 3>(0, 0).into_owned())
            .collect()
    }

    /// The same together with its rotation (m^2, m rad, rad^2).
    pub(super) fn covariances_of_all(&self) -> Vec<Matrix6<f64>> {
        let mut model = (self.uncertain).map(|extended| self.readings(extended));
        let covariance = |each: &Measurement| match &mut model {
            Some(model) => self.extended_covariance(model, each),
            None => self.noise(each),
        };
        self.measurements.iter().map(covariance).collect()
    }

    pub(super) fn sigma(&self, measurement: &Measurement) -> Vector3<f64> {
        measurement.sigma_m.unwrap_or(Vector3::repeat(self.sigma_m))
    }
}

/// How many rows a measurement has: three of a deflection, one of what is along a direction; three more of a rotation.
pub(super) const fn rows_of(measurement: &Measurement) -> usize {
    match (&measurement.direction, &measurement.rotation) {
        (Some(_), _) => 1,
        (None, Some(_)) => 6,
        (None, None) => 3,
    }
}

/// Fills the equations three rows at a time, each row divided by its standard deviation.
pub(super) struct Writer {
    pub equations: Equations,
    row: usize,
}

impl Writer {
    pub fn new(rows: usize, columns: usize) -> Self {
        Self {
            equations: Equations {
                matrix: DMatrix::zeros(rows, columns),
                right_hand_side: DVector::zeros(rows),
            },
            row: 0,
        }
    }

    pub fn push(&mut self, matrix: &Matrix3xX<f64>, value: Vector3<f64>, sigma: &Vector3<f64>) {
        for axis in 0..3 {
            let weight = sigma[axis].recip();
            for column in 0..matrix.ncols() {
                self.equations.matrix[(self.row, column)] = matrix[(axis, column)] * weight;
            }
            self.equations.right_hand_side[self.row] = value[axis] * weight;
            self.row += 1;
        }
    }

    /// Adds those of a deflection, or of what is along a direction.
    pub fn push_deflection(
        &mut self,
        of: &Measurement,
        matrix: &Matrix3xX<f64>,
        value: Vector3<f64>,
        sigma: &Vector3<f64>,
    ) {
        let Some(direction) = &of.direction else {
            return self.push(matrix, value, sigma);
        };
        let row = matrix.tr_mul(direction).transpose() / sigma.x;
        self.equations.matrix.set_row(self.row, &row);
        self.equations.right_hand_side[self.row] = direction.dot(&value) / sigma.x;
        self.row += 1;
    }

    /// Adds a reading's rows, whitened: of its derivatives (6 x p) and of what is left of it.
    pub fn push_whitened(
        &mut self,
        whitener: &DMatrix<f64>,
        derivatives: &Matrix6xX<f64>,
        left_m: &Vector3<f64>,
        left_rad: Option<&Vector3<f64>>,
    ) {
        let rows = whitener.nrows();
        let matrix = whitener * derivatives.rows(0, rows);
        let mut left = DVector::zeros(rows);
        let own = rows.min(3);
        left.rows_mut(0, own).copy_from(&left_m.rows(0, own));
        if let Some(left_rad) = left_rad {
            left.rows_mut(3, 3).copy_from(left_rad);
        }
        let mut place = self.equations.matrix.rows_mut(self.row, rows);
        place.copy_from(&matrix);
        let mut place = self.equations.right_hand_side.rows_mut(self.row, rows);
        place.copy_from(&(whitener * left));
        self.row += rows;
    }

    fn extend(&mut self, matrix: &DMatrix<f64>, right_hand_side: &DVector<f64>) {
        let Equations {
            matrix: all,
            right_hand_side: right,
        } = &mut self.equations;
        *all = all
            .clone()
            .resize_vertically(self.row + matrix.nrows(), 0.0);
        *right = right
            .clone()
            .resize_vertically(self.row + matrix.nrows(), 0.0);
        all.rows_mut(self.row, matrix.nrows()).copy_from(matrix);
        right
            .rows_mut(self.row, matrix.nrows())
            .copy_from(right_hand_side);
        self.row += matrix.nrows();
    }
}
