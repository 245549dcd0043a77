//! The bound of an approximate design, proved: the largest derivative over the class of plans is bounded by
//! [`crate::plan::proof`] instead of being searched.

use serde::Serialize;

use crate::experiment::{Loads, printed_tolerance};
use crate::plan::proof::{
    Arm, Ingredients, NoProof, ProofJoint, ProofLimits, ProofLoads, ProofObject, Proved, Question,
    SmoothRegion, Target, prove,
};
use crate::plan::widened;
use crate::robot::{Load, Tool};
use crate::task::{Belief, Task, TestPose};

use super::approximate::{ApproximateDesign, approximate_design};
use super::problem::Problem;
use super::provable::{ProvableTask, spread};

/// A proof replaces what searches found where its gap is at most this.
pub const TIGHT: f64 = 1e-3;
/// A proof that is so near is not tried again with less in it.
const NEAR: f64 = 0.01;
/// More rows for each parameter than this are gathered into fewer.
const MANY_ROWS: usize = 4;
/// A proof that no plan of a class has a `rho_0` below a number for its number of measurements.
///
/// The class is that of [`super::Bound`].
#[derive(Debug, Clone, PartialEq)]
pub struct ProvedBound {
    parameters: Vec<usize>,
    rows: Vec<Vec<f64>>,
    largest: Proved,
    /// All that it takes to check it, but for the bounds.
    file: ProofFile,
}

/// A proof with all that it takes to check it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProofFile {
    /// The bound of the largest derivative under the loads of the question, where it was recorded.
    pub proof: Option<ProofObject>,
    /// By how much loads may differ from these in force (N) and torque (N m), each.
    pub printed: f64,
    /// What must be accurate.
    pub targets: Vec<Target>,
    /// The standard deviation of each coordinate of a deflection (m).
    pub sigma_m: f64,
    /// A bound of trace(B P B^T) for the precision P of what is known before any measurement.
    pub prior: f64,
    /// P (1/(rad/(N m))^2), row by row, for the question's compliances; none where nothing is known.
    pub prior_precision: Option<Vec<Vec<f64>>>,
    /// The names of the uncertainties that are assumed exact.
    pub left_out: Vec<String>,
    /// For numbers m of measurements, what `rho_0` (m) no plan is below.
    pub bounds: Vec<(u32, f64)>,
}

impl ProvedBound {
    /// Proves the bound that an approximate design for a problem's test poses gives.
    ///
    /// # Errors
    /// Nothing was proved in time, or cannot be.
    pub fn new(
        problem: &Problem<'_>,
        approximate: &ApproximateDesign,
        effort: ProofLimits<'_>,
    ) -> Result<Self, NoProof> {
        let task = problem.task;
        if !ProvableTask::is_itself(problem) {
            return Err(NoProof::Uncertain);
        }
        let rows = bound_rows(problem, approximate).ok_or(NoProof::Singular)?;
        // A proof that is to be checked shows B as it is.
        let mut question = if effort.records {
            question(problem, rows.clone())
        } else {
            question(problem, gathered(&rows))
        };
        let found = approximate.certificate.largest_derivative;
        let printed = (task.loads.samples().iter())
            .map(printed_tolerance)
            .fold(0.0, f64::max);
        if let Some(extended) = problem.extended {
            let compliances = &task.belief.nominal.compliance_rad_per_nm;
            let sigma_m = task.belief.instrument.sigma_m;
            let spread = spread(&question, compliances, extended, sigma_m, printed);
            question.spread = Some(spread.ok_or(NoProof::Uncertain)?);
        }
        let (largest, object) = prove_printed(&question, found, printed, effort)?;
        let precision = precision(task, &question.parameters);
        let file = ProofFile {
            proof: object,
            printed,
            targets: targets(task),
            sigma_m: task.belief.instrument.sigma_m,
            prior: prior(task, precision.as_deref(), &rows),
            prior_precision: precision,
            left_out: Vec::new(),
            bounds: Vec::new(),
        };
        Ok(Self {
            parameters: question.parameters,
            rows,
            largest,
            file,
        })
    }

    /// The same for a task in which some uncertainties are assumed exact, where more follows for so many measurements than from
    /// what is known, if anything is; else `None`, or the reason why nothing is proved of either.
    pub(super) fn of_simpler(
        problem: &Problem<'_>,
        simpler: &ProvableTask,
        effort: ProofLimits<'_>,
        seed: u64,
        known: Option<&Self>,
        measurements: u32,
    ) -> Option<Result<Self, NoProof>> {
        if known.is_some_and(|known| known.largest.gap() <= NEAR) {
            return None;
        }
        let is_nearer =
            |value: Option<f64>| known.is_none_or(|known| value > known.of_size(measurements));
        let proved = match approximate_design(problem, seed) {
            Ok(design) => {
                // The same rows would give so much if no derivative were above the largest found.
                let most = design.certificate.lower_bound(measurements);
                if !is_nearer(most.map(f64::sqrt)) {
                    return None;
                }
                Self::new(problem, &design, effort)
            }
            Err(_) => Err(NoProof::Singular),
        };
        match proved {
            Ok(mut proved) => {
                proved.file.left_out.clone_from(&simpler.left_out);
                is_nearer(proved.of_size(measurements)).then_some(Ok(proved))
            }
            Err(reason) => known.is_none().then_some(Err(reason)),
        }
    }

    /// The names of the uncertainties that are assumed exact, which can only make the bound less near.
    pub fn left_out(&self) -> &[String] {
        &self.file.left_out
    }

    /// Whether nothing is left out.
    pub(super) const fn is_about_all(&self) -> bool {
        self.file.left_out.is_empty()
    }

    /// No plan of the class with so many measurements has a `rho_0` (m) below this.
    pub fn of_size(&self, measurements: u32) -> Option<f64> {
        // Rounded up: a product and a sum.
        let derivatives = self.largest.largest * f64::from(measurements);
        let most = (self.file.prior + derivatives) * (1.0 + 1e-15);
        if most.is_nan() || most <= 0.0 {
            return None;
        }
        let ingredients = Ingredients {
            targets: &self.file.targets,
            parameters: &self.parameters,
            rows: &self.rows,
            sigma_m: self.file.sigma_m,
        };
        ingredients.least_rho0_m(most)
    }

    /// What was proved of the largest derivative.
    pub const fn largest(&self) -> &Proved {
        &self.largest
    }

    /// The proof for those who want to check it, where it was recorded.
    pub fn file(&self) -> Option<ProofFile> {
        let bound = |m: u32| Some((m, self.of_size(m)?));
        (self.file.proof.is_some()).then(|| ProofFile {
            bounds: (1..=12).filter_map(bound).collect(),
            ..self.file.clone()
        })
    }

    /// Whether it is as near as what searches find, and about the same.
    pub fn is_tight(&self) -> bool {
        self.is_about_all() && self.largest.gap() <= TIGHT * (1.0 + 1e-6)
    }
}

/// The rows of B, a factor of what an approximate design's directional derivative is: d(x) = |A(x) B^T|^2 in relative units,
/// trace(A G A^T) with G = B^T B; for the joints' `tau_n` `J_n` as they are (per N m^2), for the design of a problem's test poses.
/// `None` where its information is singular.
fn bound_rows(problem: &Problem<'_>, approximate: &ApproximateDesign) -> Option<Vec<Vec<f64>>> {
    let information = approximate.information(problem);
    let solved = information.cholesky()?.solve(&problem.test_poses);
    // Columns are the rows of B; from coordinates of the basis to compliances: B is then that of the combinations that show.
    let columns = match &problem.basis {
        Some(basis) => basis * solved,
        None => solved,
    };
    let sigma_m = problem.task.belief.instrument.sigma_m;
    let row = |column: nalgebra::DVectorView<'_, f64>| {
        let values = column.iter().zip(&problem.sizes);
        values
            .map(|(value, typical)| value * typical / sigma_m)
            .collect()
    };
    let rows: Vec<Vec<f64>> = columns.column_iter().map(row).collect();
    let is_finite = (rows.iter().flatten()).all(|value| value.is_finite());
    is_finite.then(|| directed(problem.task, &rows))
}

/// The rows of B, of which test poses with a direction n need one: n^T times theirs.
fn directed(task: &Task, rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let poses = task.test_poses.iter().zip(rows.chunks(3));
    let of_pose = |(pose, three): (&TestPose, &[Vec<f64>])| match pose.direction {
        None => three.to_vec(),
        Some(direction) => {
            let along = |parameter: usize| {
                let parts = three.iter().zip(&direction);
                parts.map(|(row, n)| n * row[parameter]).sum()
            };
            vec![(0..three[0].len()).map(along).collect()]
        }
    };
    poses.flat_map(of_pose).collect()
}

/// Bounds the largest derivative under the loads of a question and those that differ from them by no more
/// than `printed` in force (N) and torque (N m). The root of the derivative is a norm of the load, so that it is at
/// most the sum of those of both.
fn prove_printed(
    question: &Question,
    found: f64,
    printed: f64,
    effort: ProofLimits<'_>,
) -> Result<(Proved, Option<ProofObject>), NoProof> {
    let unit = question.root_of_unit_load();
    let more = printed * unit * (1.0 + f64::EPSILON);
    let without = |derivative: f64| {
        (derivative.sqrt() - more)
            .max(0.5 * derivative.sqrt())
            .powi(2)
    };
    let known = without(found);
    let gap = (without(found * (1.0 + effort.gap)) / known - 1.0).max(0.5 * effort.gap);
    let effort = ProofLimits { gap, ..effort };
    let (proved, object) = prove(question, known, effort)?;
    let proved = Proved {
        largest: (proved.largest.sqrt() + more).powi(2) * (1.0 + 8.0 * f64::EPSILON),
        found: proved.found.max(found),
        boxes: proved.boxes,
    };
    Ok((proved, object))
}

fn question(problem: &Problem<'_>, rows: Vec<Vec<f64>>) -> Question {
    let task = problem.task;
    let region = widened(&task.region);
    let [low, high] = region.tool_radius_m;
    let upright = std::f64::consts::FRAC_PI_2;
    Question {
        arm: arm(
            &task.belief,
            &task.belief.calibration_tool,
            &region.joint_range_rad,
        ),
        parameters: problem.joints(),
        rows,
        region: SmoothRegion {
            height_m: region.tool_height_m,
            radius_m: [low.filter(|low| *low > 0.0), high],
            elevation_sine: (region.tool_elevation_max_rad)
                .filter(|angle| *angle < upright)
                .map(|angle| angle.sin() * (1.0 + 4.0 * f64::EPSILON)),
        },
        loads: match &task.loads {
            Loads::Fixed(load) => ProofLoads::OneOf(vec![wrench(load)]),
            Loads::List(loads) => ProofLoads::OneOf(loads.iter().map(wrench).collect()),
            Loads::Direction { direction, force_n } => {
                // A smaller force tells less.
                let [x, y, z] = (direction * force_n[1]).into();
                ProofLoads::OneOf(vec![[x, y, z, 0.0, 0.0, 0.0]])
            }
            Loads::Any { force_max_n } => ProofLoads::AnyForce(*force_max_n),
        },
        spread: None,
    }
}

/// Where there are many more rows than parameters, as many rows as these that tell no less: the derivative is a
/// quadratic form in what an experiment shows, and only its matrix S matters. With D^2 the diagonal of S, these
/// are the columns of D L for L L^T = D^-1 S D^-1 + delta, where delta is more than what rounding leaves of
/// S (a sum over the rows) and of the factorisation can take away.
fn gathered(rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let size = rows.first().map_or(0, Vec::len);
    if rows.len() <= MANY_ROWS * size {
        return rows.to_vec();
    }
    let sum = |one: usize, other: usize| rows.iter().map(|row| row[one] * row[other]).sum::<f64>();
    let root: Vec<f64> = (0..size).map(|index| sum(index, index).sqrt()).collect();
    let rounding = 8.0 * (size * (rows.len() + size + 16)) as f64 * f64::EPSILON;
    let scaled = nalgebra::DMatrix::from_fn(size, size, |one, other| {
        let scale = root[one] * root[other];
        let value = if scale > 0.0 {
            sum(one, other) / scale
        } else {
            0.0
        };
        value + if one == other { rounding } else { 0.0 }
    });
    let Some(factor) = scaled.cholesky() else {
        return rows.to_vec();
    };
    let factor = factor.unpack();
    (0..size)
        .map(|column| {
            (0..size)
                .map(|row| root[row] * factor[(row, column)])
                .collect()
        })
        .collect()
}

/// What is known of compliances before any measurement: P (1/(rad/(N m))^2), row by row; none where nothing is.
fn precision(task: &Task, parameters: &[usize]) -> Option<Vec<Vec<f64>>> {
    let belief = &task.belief;
    let known = belief.prior.as_ref()?;
    let places: Vec<usize> = (parameters.iter())
        .filter_map(|joint| belief.parameters.iter().position(|each| each == joint))
        .collect();
    let row = |one: &usize| {
        (places.iter())
            .map(|other| known.precision[(*one, *other)])
            .collect()
    };
    Some(places.iter().map(row).collect())
}

/// A bound of trace(B P B^T), with the rows of B times sigma as those of a question are: the sum of its
/// terms, and what rounding them all can hide.
fn prior(task: &Task, precision: Option<&[Vec<f64>]>, rows: &[Vec<f64>]) -> f64 {
    let Some(precision) = precision else {
        return 0.0;
    };
    let sigma_m = task.belief.instrument.sigma_m;
    let (mut sum, mut size) = (0.0, 0.0);
    for row in rows {
        for (one, line) in row.iter().zip(precision) {
            for (other, entry) in row.iter().zip(line) {
                let term = (one * sigma_m) * (other * sigma_m) * entry;
                sum += term;
                size += term.abs();
            }
        }
    }
    let terms = (rows.len() * precision.len().pow(2) + 8) as f64;
    sum + size * terms * 4.0 * f64::EPSILON
}

fn targets(task: &Task) -> Vec<Target> {
    let belief = &task.belief;
    let ranges: Vec<[f64; 2]> = belief
        .nominal
        .chain
        .joints
        .iter()
        .map(|joint| joint.range_rad)
        .collect();
    let arm = arm(belief, &belief.machining_tool, &ranges);
    (task.test_poses.iter())
        .map(|pose| Target {
            arm: arm.clone(),
            configuration_rad: pose.configuration_rad.iter().copied().collect(),
            wrench: wrench(&pose.load),
            weight: pose.weight,
            direction: pose.direction.map(Into::into),
        })
        .collect()
}

fn wrench(load: &Load) -> [f64; 6] {
    load.wrench().into()
}

fn arm(belief: &Belief, tool: &Tool, ranges_rad: &[[f64; 2]]) -> Arm {
    let chain = &belief.nominal.chain;
    let joints = chain.joints.iter().zip(ranges_rad);
    Arm {
        joints: joints
            .map(|(joint, &range_rad)| ProofJoint {
                offset_m: joint.previous_from_link.translation.vector.into(),
                rotation: joint.previous_from_link.rotation.coords.into(),
                axis: joint.axis.into_inner().into(),
                range_rad,
            })
            .collect(),
        tool_joints: tool.joints,
        tool_offset_m: tool.link_from_tool.translation.vector.into(),
        tool_rotation: tool.link_from_tool.rotation.coords.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::gathered;
    use crate::numeric::random::generator;
    use rand::RngExt;

    /// Fewer rows tell no less of anything, and hardly more, also where some depend on others.
    #[test]
    fn gathered_rows_tell_no_less() {
        let mut random = generator(4, 0);
        let mut number = || random.random::<f64>() - 0.5;
        for dependent in [false, true] {
            let rows: Vec<Vec<f64>> = (0..60)
                .map(|_| {
                    let mut row: Vec<f64> = (0..5)
                        .map(|index| number() * 10_f64.powi(3 * index))
                        .collect();
                    if dependent {
                        row[4] = 1e3 * row[2];
                    }
                    row
                })
                .collect();
            let few = gathered(&rows);
            assert_eq!(few.len(), 5);
            let told = |rows: &[Vec<f64>], x: &[f64]| -> f64 {
                let along = |row: &Vec<f64>| {
                    row.iter()
                        .zip(x)
                        .map(|(one, other)| one * other)
                        .sum::<f64>()
                };
                rows.iter().map(|row| along(row).powi(2)).sum()
            };
            for _ in 0..1000 {
                let x: Vec<f64> = (0..5)
                    .map(|index| number() * 10_f64.powi(-3 * index))
                    .collect();
                let (all, less) = (told(&rows, &x), told(&few, &x));
                assert!(
                    less >= all && less <= all * (1.0 + 1e-6),
                    "{less} against {all}"
                );
            }
        }
        let three = vec![vec![1.0, 2.0, 3.0, 4.0]; 3];
        assert_eq!(gathered(&three), three);
    }
}
