//! Residuals of deflections in the form in which patterns are looked for.

use nalgebra::{Matrix3, Matrix3xX, Matrix6xX, Vector3};

use super::super::{Case, Identification};
use super::{LookedAt, ReadingRows};
use crate::robot::ObservationMatrix;

/// The positions' residuals of what was identified (m), each over its own standard deviation. `blocks` are the measurements'
/// blocks of joint space.
pub fn looked_at(
    case: &Case<'_>,
    identification: &Identification,
    left_m: &[[f64; 3]],
    blocks: &[usize],
) -> LookedAt {
    let chain = &case.nominal.chain;
    let joints: Vec<usize> = (0..chain.len()).collect();
    let readings = case.measurements.iter().enumerate().map(|(index, each)| {
        let mut state = chain.at(case.tool).state(each.configuration_rad.as_slice());
        let torque = |&joint: &usize| state.load_torque(joint, &each.load);
        let torques = joints.iter().map(torque).collect();
        state.brace_under(&identification.compliance_rad_per_nm, &each.load);
        let sigma = (each.sigma_m).unwrap_or_else(|| Vector3::repeat(identification.sigma_m));
        // What is read: all coordinates, or one along a direction.
        let axes = each.direction.map_or_else(Matrix3::identity, |direction| {
            Vector3::x() * direction.transpose()
        });
        let shown = Matrix3::from_diagonal(&sigma.map(f64::recip)) * axes;
        let rows = |of: Matrix3xX<f64>| -> Matrix6xX<f64> { of.insert_fixed_rows::<3>(3, 0.0) };
        let bent = rows(shown * ObservationMatrix::new(&state, &each.load, &joints).position);
        ReadingRows {
            residual: rows(shown * Matrix3xX::from_columns(&[left_m[index].into()]))
                .column(0)
                .into(),
            fitted: bent.select_columns(case.parameters),
            moved: bent.clone(),
            bent,
            placed: rows(shown * Matrix3xX::identity(5)),
            angles: each.configuration_rad.clone(),
            torques,
            approach: None,
            range_m: None,
            time_s: None,
            temperature_c: None,
            count: each.direction.map_or(3, |_| 1),
            block: blocks[index],
        }
    });
    LookedAt::new(chain, readings.collect(), true)
}
