//! From a bound of the derivative to one of `rho_0`, with every rounding.

use serde::Serialize;

use super::chain::Chain;
use super::constant::{Constant, vector};
use super::domain::{Domain, LoadCase};
use super::geometry::BoxGeometry;
use super::question::Arm;
use super::rounding::{LARGEST_ANGLE, UNIT, UP, Waves, sin_cos};
use super::taylor::{LANES, ModelVector, ModelWorkspace, TaylorModel};
use super::vectors::{Angle, NOWHERE, constant_in, dot};

/// What must be accurate: a tool at a configuration under a load.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Target {
    /// The arm with that tool.
    pub arm: Arm,
    /// Its configuration (rad).
    pub configuration_rad: Vec<f64>,
    /// The load: force (N) and torque (N m) in the world frame.
    pub wrench: [f64; 6],
    /// The weight among all targets.
    pub weight: f64,
    /// The direction in the world frame along which alone the error counts, a unit vector but for rounding.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub direction: Option<[f64; 3]>,
}

/// What a lower bound of `rho_0` is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct Ingredients<'a> {
    /// The targets.
    pub targets: &'a [Target],
    /// The joints whose compliances are the parameters.
    pub parameters: &'a [usize],
    /// The rows of B: three for each target, for its axes; one for a target with a direction.
    pub rows: &'a [Vec<f64>],
    /// The standard deviation of each coordinate of a deflection (m).
    pub sigma_m: f64,
}

impl Ingredients<'_> {
    /// No plan has a smaller `rho_0` (m) whose derivatives add up to at most `derivatives`:
    /// sigma trace(C B^T) / sqrt(derivatives), rounded down. `None` where an angle is too large.
    pub fn least_rho0_m(&self, derivatives: f64) -> Option<f64> {
        let (mut trace, mut error, mut size) = (0.0_f64, 0.0_f64, 0.0_f64);
        let mut rows = self.rows.iter();
        for target in self.targets {
            let columns = columns(target, self.parameters)?;
            let weight = target.weight.sqrt();
            let mut first = rows.next()?;
            for axis in 0..3 {
                // Along a direction n: sum of n_k b . C_k.
                let share = target.direction.map_or(1.0, |direction| direction[axis]);
                for (factor, column) in first.iter().zip(&columns) {
                    let Constant { value, error: off } = column[axis];
                    let factor = factor * weight * share;
                    trace += factor * value;
                    size += (factor * value).abs();
                    error += factor.abs() * off * UP;
                }
                if axis < 2 && target.direction.is_none() {
                    first = rows.next()?;
                }
            }
        }
        // The root, two products, and the sum of fewer than 1e6 terms; along a direction a product more, and its length.
        let terms = (self.rows.len() * self.parameters.len()) as f64;
        let is_directed = self.targets.iter().any(|target| target.direction.is_some());
        let more = if is_directed { 16.0 } else { 8.0 };
        let error = (error + size * UNIT * (terms + more)) * UP * UP;
        let bound = self.sigma_m * ((trace.abs() - error) / derivatives.sqrt()).max(0.0);
        Some(bound * (1.0 - 16.0 * UNIT))
    }
}

/// The columns of the target's matrix: `tau_n` `J_n` for each parameter n, in the world frame.
fn columns(target: &Target, parameters: &[usize]) -> Option<Vec<[Constant; 3]>> {
    let arm = &target.arm;
    let mut chain = Chain::new(arm);
    // Every joint has an angle of its own here.
    for link in &mut chain.links {
        link.starts_run = true;
    }
    let count = chain.links.len();
    if (target.configuration_rad.iter()).any(|angle| angle.is_nan() || angle.abs() > LARGEST_ANGLE)
    {
        return None;
    }
    // One point is a box of no width, in whatever variable.
    let mut workspace = ModelWorkspace::new(1);
    let angles: Vec<Angle> = (chain.links.iter().zip(&target.configuration_rad))
        .map(|(link, angle)| {
            workspace.sin_cos(
                0,
                &[sin_cos(link.sign * angle); LANES],
                &[Waves::new(0.0); LANES],
            )
        })
        .collect();
    let domain = Domain {
        load: LoadCase::Wrench(target.wrench),
        variable: (0..count).map(Some).collect(),
        ranges: Vec::new(),
        differences: Vec::new(),
    };
    let geometry = BoxGeometry::new(&mut workspace, &chain, &domain, &angles, 0);
    let levers: Vec<ModelVector> = (0..count)
        .map(|joint| geometry.moves(&mut workspace, joint, &geometry.tool))
        .collect();
    let [fx, fy, fz, tx, ty, tz] = target.wrench;
    let [force, torque] = [[fx, fy, fz], [tx, ty, tz]].map(|each| {
        constant_in(
            &mut workspace,
            &geometry.world,
            &vector(each),
            &NOWHERE,
            1.0,
        )
    });
    let column = |&joint: &usize| {
        let Some(lever) = levers.get(joint) else {
            return [Constant::exact(0.0); 3];
        };
        let pairs = [(lever, &force), (&geometry.axis[joint], &torque)];
        let moment = dot(&mut workspace, &pairs);
        let column = workspace.scaled(lever, moment);
        column.map(|part| constant(&workspace, part))
    };
    Some(parameters.iter().map(column).collect())
}

/// The value of a model over a box of no width, whose coefficients but the first are noughts.
fn constant(workspace: &ModelWorkspace, model: TaylorModel) -> Constant {
    let others: f64 = workspace.coefficients(model)[1..]
        .iter()
        .map(|each| each[0].abs())
        .sum();
    Constant {
        value: workspace.coefficients(model)[0][0],
        error: (workspace.remainder(model)[0] + others) * UP,
    }
}
