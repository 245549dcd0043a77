//! Where an identified arm has a tool: by what the tool is off.

use nalgebra::{DMatrix, DVector, Matrix6xX};

use super::joint_errors::DiscrepancyModel;
use super::residuals::{LinearReading, with_joints};
use crate::identification::FitResult;
use crate::observation::{ObservationModel, ReadingKind, Setup};
use crate::parameter::{ElasticArm, ParameterSet};

/// The error of a place that an identified arm predicts.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaceError {
    /// How the place (m) follows the parameters (3 x p).
    pub rows: DMatrix<f64>,
    /// The mean square (m^2) by what was identified: what returns to the place have on average.
    pub identified_m2: f64,
    /// The mean square (m^2) by what is new at a visit besides: the model discrepancy, and how well joints come back where that was
    /// identified.
    pub new_m2: f64,
}

impl DiscrepancyModel {
    /// Of a setup's target, in the frame of its station. `set` are those of the model's parameters that it depends on, at their `places`
    /// among the model's, and counted from the arm itself.
    ///
    /// # Errors
    /// The arm has no equilibrium there.
    pub fn place_error(
        &self,
        arm: &ElasticArm,
        set: &ParameterSet,
        places: &[usize],
        setup: &Setup,
    ) -> FitResult<PlaceError> {
        let joints: Vec<usize> = self.joints.iter().map(|each| each.joint).collect();
        let (all, zeros) = with_joints(set, arm, &joints);
        let mut by = Matrix6xX::zeros(all.len());
        let mean = all.prior().mean.as_slice();
        (ObservationModel::new(&all, arm, mean).predict(setup, ReadingKind::Position, &mut by))
            .map_err(|error| (0, error))?;
        let rows = LinearReading {
            residual: DVector::zeros(3),
            columns: by.view((0, 0), (3, set.len())).into_owned(),
            joints: by.rows(0, 3).select_columns(&zeros),
            own: DMatrix::zeros(3, 3),
        };
        let q = setup.commanded_rad.as_slice();
        let local = self.local(&rows, places, q);
        let known = self.by_what_is_known(&local);
        // Without joints' errors the scale is of regions alone.
        let scale = if joints.is_empty() {
            1.0
        } else {
            self.scale_at(0, q)
        };
        Ok(PlaceError {
            rows: rows.columns,
            identified_m2: scale * known.trace(),
            new_m2: scale * local.new.trace(),
        })
    }
}
