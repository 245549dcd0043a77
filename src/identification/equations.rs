//! The measurements as equations in the unknown compliances.

use std::convert::Infallible;
use std::ops::Range;

use nalgebra::{DMatrix, DVector, Dyn, Matrix, Matrix6xX, Storage, U3, Vector3};

use super::case::Case;
use super::error::{FitResult, IdentificationError};
use crate::measurement::Measurement;
use crate::observation::{ObservationModel, Prediction, ReadingKind, RestTorques, Setup};
use crate::robot::{
    EquilibriumSolver, KinematicState, Kinematics, Load, ObservationMatrix, rotation_vector,
};

impl Case<'_> {
    pub(super) fn rows(&self) -> usize {
        self.measurements.iter().map(rows_of).sum()
    }

    /// What is read, one measurement below the other: the deflection or what is along a direction (m), and the rotation (rad) where
    /// there is one.
    pub(super) fn read(&self) -> DVector<f64> {
        let each = self.measurements.iter().flat_map(|each| {
            let rotation = each.rotation.iter();
            let rotation = rotation.flat_map(|rotation| rotation.vector_rad.data.0[0]);
            let deflection = match &each.direction {
                Some(direction) => [direction.dot(&each.deflection_m), 0.0, 0.0],
                None => each.deflection_m.into(),
            };
            let own = deflection.into_iter().take(rows_of(each).min(3));
            own.chain(rotation)
        });
        DVector::from_iterator(self.rows(), each)
    }

    /// What is read as the model has it at nominal values of the unknowns, to first order in compliance: eq. 3 or 7 at the commanded
    /// configurations.
    pub(super) fn predicted_linearly(&self) -> PredictedRows {
        let belief = self.belief;
        if !belief.uncertain.has_closed_forms() {
            let planned = |model: &mut ObservationModel<'_>, _, setup: &_, kind, rows: &mut _| {
                Ok::<_, Infallible>(model.predict_as_planned(None, setup, kind, rows))
            };
            let Ok(rows) = self.extended_rows(&belief.values(), planned);
            return rows;
        }
        let (chain, compliance) = (&belief.nominal.chain, &belief.nominal.compliance_rad_per_nm);
        let mut arm = chain.at(&belief.calibration_tool);
        let mut state = KinematicState::new(chain.len());
        let all: Vec<usize> = (0..chain.len()).collect();
        let known = DVector::from_column_slice(compliance);
        let mut predicted = PredictedRows::new(self, belief.parameters.len());
        for each in self.measurements {
            arm.update(each.configuration_rad.as_slice(), &mut state);
            let observed = ObservationMatrix::new(&state, &each.load, &belief.parameters);
            let by_all = ObservationMatrix::new(&state, &each.load, &all);
            let moved = &by_all.position * &known;
            let turned = || &by_all.rotation * &known;
            let by = [&observed.position, &observed.rotation];
            predicted.push(each, by, moved, turned);
        }
        predicted
    }

    /// The same between the static equilibria at values of the unknowns (p), each sought near its last torques where there are some.
    pub(super) fn predicted(
        &self,
        values: &[f64],
        torques: &mut Vec<RestTorques>,
    ) -> FitResult<PredictedRows> {
        torques.resize_with(self.measurements.len(), RestTorques::default);
        let belief = self.belief;
        if !belief.uncertain.is_plain() {
            let at_rest =
                |model: &mut ObservationModel<'_>, index, setup: &_, kind, rows: &mut _| {
                    (model.predict_near(&mut torques[index], setup, kind, rows))
                        .map_err(|error| IdentificationError::from((index, error)))
                };
            return self.extended_rows(values, at_rest);
        }
        let compliance = &belief.compliance_at(values);
        let chain = &belief.nominal.chain;
        let mut arm = chain.at(&belief.calibration_tool);
        let mut solver = EquilibriumSolver::of_derivatives(chain.len());
        let mut predicted = PredictedRows::new(self, belief.parameters.len());
        for (index, (each, torques)) in self.measurements.iter().zip(torques).enumerate() {
            let commanded = each.configuration_rad.as_slice();
            let mut rest = |load: &Load, near: &mut Vec<f64>| {
                solver
                    .solve_near(&mut arm, compliance, commanded, load, near)
                    .map_err(|error| IdentificationError::from((index, error)))?;
                let sensitivity =
                    (solver.sensitivity(compliance)).select_columns(&belief.parameters);
                let (place, axes) = (solver.state().tool_position, solver.state().tool_rotation);
                Ok::<_, IdentificationError>((place, axes, sensitivity))
            };
            let (unloaded, unloaded_axes, from) = rest(&Load::NONE, &mut torques[0])?;
            let (loaded, loaded_axes, to) = rest(&each.load, &mut torques[1])?;
            let sensitivity = to - from;
            let derivatives = [0, 3].map(|row| sensitivity.fixed_rows::<3>(row));
            let turned = || rotation_vector(&(loaded_axes * unloaded_axes.transpose()));
            predicted.push(each, derivatives.each_ref(), loaded - unloaded, turned);
        }
        Ok(predicted)
    }

    /// Predictions of all measurements, by their places, at values of the unknowns.
    fn extended_rows<E>(
        &self,
        values: &[f64],
        mut predict: impl FnMut(
            &mut ObservationModel<'_>,
            usize,
            &Setup,
            ReadingKind,
            &mut Matrix6xX<f64>,
        ) -> Result<Prediction, E>,
    ) -> Result<PredictedRows, E> {
        let extended = &self.belief.uncertain;
        let mut model = ObservationModel::new(extended.set(), extended.arm(), values);
        let mut derivatives = Matrix6xX::zeros(values.len());
        let mut predicted = PredictedRows::new(self, values.len());
        for (index, each) in self.measurements.iter().enumerate() {
            let (setup, kind) = setup_of(each);
            model.read_along(each.direction.is_some());
            let found = predict(&mut model, index, &setup, kind, &mut derivatives)?;
            let by = [0, 3].map(|row| derivatives.fixed_rows::<3>(row));
            let turned = || rotation_vector(&found.rotation);
            predicted.push(each, by.each_ref(), found.position_m, turned);
        }
        Ok(predicted)
    }

    /// The standard deviation of a deflection's coordinate (m): the rms of them where measurements
    /// bring their own.
    pub(super) fn typical_sigma_m(&self) -> f64 {
        if self.measurements.iter().all(|each| each.sigma_m.is_none()) {
            return self.sigma.weight_m();
        }
        let squares = (self.measurements.iter()).map(|each| self.sigma_of(each).norm_squared());
        (squares.sum::<f64>() / (3 * self.measurements.len()) as f64).sqrt()
    }

    pub(super) fn rows_of_each(&self) -> impl Iterator<Item = Range<usize>> {
        self.measurements.iter().scan(0, |row, each| {
            let first = *row;
            *row += rows_of(each);
            Some(first..*row)
        })
    }

    pub(super) fn sigma_of(&self, measurement: &Measurement) -> Vector3<f64> {
        (measurement.sigma_m).unwrap_or(Vector3::repeat(self.sigma.weight_m()))
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

/// How a measurement was set up, and what was read.
pub(super) fn setup_of(measurement: &Measurement) -> (Setup, ReadingKind) {
    let setup = Setup {
        commanded_rad: measurement.configuration_rad.clone(),
        load: measurement.load,
        hangs_on: None,
        target: 0,
        station: 0,
        approach: measurement.approach.clone(),
    };
    let kind = match measurement.rotation {
        Some(_) => ReadingKind::DeflectionAndRotation,
        None => ReadingKind::Deflection,
    };
    (setup, kind)
}

/// What is read as the model has it (N; m, rad), with its derivatives by the unknowns (N x p).
pub(super) struct PredictedRows {
    pub derivatives: DMatrix<f64>,
    pub values: DVector<f64>,
    row: usize,
    /// What is shown on average of what moves along a gauge's direction.
    share_along: f64,
}

impl PredictedRows {
    /// Room for the measurements of a case.
    fn new(of: &Case<'_>, columns: usize) -> Self {
        let rows = of.rows();
        Self {
            derivatives: DMatrix::zeros(rows, columns),
            values: DVector::zeros(rows),
            row: 0,
            share_along: of.belief.uncertain.share_along(),
        }
    }

    /// Adds those of a measurement: of its deflection, or of what is along a direction, and of its rotation, where there is one.
    pub fn push<S: Storage<f64, U3, Dyn>>(
        &mut self,
        of: &Measurement,
        derivatives: [&Matrix<f64, U3, Dyn, S>; 2],
        moved: Vector3<f64>,
        turned: impl FnOnce() -> Vector3<f64>,
    ) {
        if let Some(direction) = &of.direction {
            let direction = &(direction * self.share_along);
            let along = derivatives[0].tr_mul(direction).transpose();
            self.derivatives.set_row(self.row, &along);
            self.values[self.row] = direction.dot(&moved);
            self.row += 1;
            return;
        }
        let values = [Some(moved), of.rotation.map(|_| turned())].into_iter();
        for (by, values) in derivatives.into_iter().zip(values.flatten()) {
            (self.derivatives.fixed_rows_mut::<3>(self.row)).copy_from(by);
            self.values.fixed_rows_mut::<3>(self.row).copy_from(&values);
            self.row += 3;
        }
    }
}
