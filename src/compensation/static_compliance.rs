//! The static compliance of a tool (ISO 9283): its displacement per force, in the axes of the robot's base.
//!
//! Column j of C is half the difference of the deflections under +F and -F along axis j, over F, through the static equilibrium
//! under gravity: the tangent of the unloaded arm, with what springs beside the joints' own hold. Its derivatives by all
//! parameters are those of these deflections, so that an entry c has u(c)^2 = g cov g^T.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Matrix6xX, Vector3};

use crate::numeric::posterior::Posterior;
use crate::numeric::tolerance::CHI_SQUARE_95;
use crate::observation::{ObservationModel, ReadingKind, Setup};
use crate::parameter::{ElasticArm, ParameterKind, ParameterSet};
use crate::robot::{EquilibriumError, Load};

/// The size of F (N): so small that no joint is nonlinear, and far above what the equilibrium is rounded by.
const FORCE_N: f64 = 10.0;
/// What an entry depends on a parameter by less than this share of the parameter's largest part in any entry is rounding.
const NOTHING: f64 = 1e-9;

/// The static compliance of a tool at one configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct StaticCompliance {
    /// The displacement along the row's axis of the base per force along the column's (m/N).
    pub m_per_n: Matrix3<f64>,
    /// The standard uncertainty of each entry (m/N); none where it depends on what is not determined.
    pub standard_uncertainty_m_per_n: [[Option<f64>; 3]; 3],
}

impl StaticCompliance {
    /// The 95 % interval of an entry (m/N), of a normal error; none where it has no uncertainty.
    pub fn interval95_m_per_n(&self, row: usize, column: usize) -> Option<[f64; 2]> {
        let value = self.m_per_n[(row, column)];
        let half = CHI_SQUARE_95[0].sqrt() * self.standard_uncertainty_m_per_n[row][column]?;
        Some([value - half, value + half])
    }
}

/// An arm with one of its tools, and what is known of its parameters: their values and their covariance.
#[derive(Debug, Clone, Copy)]
pub struct KnownArm<'a> {
    /// The arm to which the parameters' values are applied.
    pub arm: &'a ElasticArm,
    /// The tool, by its place among the arm's.
    pub tool: usize,
    /// The parameters.
    pub set: &'a ParameterSet,
    /// What is known of them.
    pub posterior: &'a Posterior,
}

impl KnownArm<'_> {
    /// The static compliance at joint angles `q` (rad) of the command.
    ///
    /// # Errors
    /// The arm has no static equilibrium there.
    pub fn static_compliance(
        &self,
        q: &DVector<f64>,
    ) -> Result<StaticCompliance, EquilibriumError> {
        let arm = self.in_base();
        let mut values = self.posterior.mean.clone();
        for (value, parameter) in values.iter_mut().zip(self.set.parameters()) {
            if !is_of_arm(parameter.kind) {
                *value = parameter.nominal;
            }
        }
        let mut model = ObservationModel::new(self.set, &arm, &values);
        let mut derivatives = Matrix6xX::zeros(self.set.len());
        let mut m_per_n = Matrix3::zeros();
        // Entry (row, column) is row 3 column + row.
        let mut rows = DMatrix::zeros(9, self.set.len());
        for axis in 0..3 {
            for sign in [1.0, -1.0] {
                let force = Vector3::ith(axis, sign * FORCE_N);
                let setup = Setup {
                    commanded_rad: q.clone(),
                    load: Load::force(force.x, force.y, force.z),
                    hangs_on: None,
                    target: self.tool,
                    station: 0,
                    approach: None,
                };
                let kind = ReadingKind::Deflection;
                let moved = model.predict(&setup, kind, &mut derivatives)?;
                let share = sign / (2.0 * FORCE_N);
                let mut column = m_per_n.column_mut(axis);
                column += moved.position_m * share;
                let mut own = rows.rows_mut(3 * axis, 3);
                own += derivatives.fixed_rows::<3>(0) * share;
            }
        }
        for (mut column, parameter) in rows.column_iter_mut().zip(self.set.parameters()) {
            let least = NOTHING * column.amax();
            let is_counted = is_of_arm(parameter.kind);
            column.apply(|value| {
                if !is_counted || value.abs() < least {
                    *value = 0.0;
                }
            });
        }
        let uncertainty = |row: usize, column: usize| {
            let gradient = rows.rows(3 * column + row, 1).into_owned();
            let variance = self.posterior.variance_of(&gradient);
            variance.ok().map(f64::sqrt)
        };
        Ok(StaticCompliance {
            m_per_n,
            standard_uncertainty_m_per_n: [0, 1, 2]
                .map(|row| [0, 1, 2].map(|column| uncertainty(row, column))),
        })
    }

    /// The joints with a compliance that is not among the parameters, by name.
    pub fn exact_compliances(&self) -> Vec<String> {
        let is_asked = |joint: usize| {
            let kind = ParameterKind::JointCompliance { joint };
            self.set.parameters().iter().any(|each| each.kind == kind)
        };
        let joints = self.arm.chain.joints.iter().enumerate();
        joints
            .filter(|&(joint, _)| self.arm.compliance_rad_per_nm[joint] > 0.0 && !is_asked(joint))
            .map(|(_, each)| each.name.clone())
            .collect()
    }

    /// The arm under loads that are what they are said to be, seen in the axes of its base.
    fn in_base(&self) -> ElasticArm {
        ElasticArm {
            instrument_from_base: vec![Isometry3::identity(); self.arm.instrument_from_base.len()],
            load_scale: 1.0,
            load_offset_n: 0.0,
            drift_m: Vector3::zeros(),
            ..self.arm.clone()
        }
    }
}

/// Whether a parameter is of the arm, and not of the instrument, the loads or the side of approach.
const fn is_of_arm(kind: ParameterKind) -> bool {
    use ParameterKind as Of;
    !matches!(
        kind,
        Of::JointBacklash { .. }
            | Of::BasePosition { .. }
            | Of::BaseRotation { .. }
            | Of::LoadScale
            | Of::LoadOffset
            | Of::TaskScale
            | Of::TaskForce { .. }
            | Of::Drift { .. }
    )
}
