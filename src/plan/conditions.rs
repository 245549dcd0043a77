//! The conditions of a plan, by name.

use nalgebra::{DMatrix, DVector};

use super::{Experiment, Plan, posterior, rho0_m, rows_of};
use crate::codes::{Condition, ConditionCode};
use crate::compensation::{compensate_arm, test_pose_matrix};
use crate::identification::UNKNOWN_COMPLIANCE;
use crate::numeric::posterior::Posterior;
use crate::observation::PlannedReadings;
use crate::parameter::{ParameterKind, ParameterSet};
use crate::robot::{Approach, EquilibriumSolver, Load};
use crate::task::{Belief, Method, Task};
use crate::text::wording::in_um;

/// Configurations that differ by less than this in every joint (rad, m) hardly have discrepancies of their own.
const NEAR: f64 = 5.0 * std::f64::consts::PI / 180.0;
/// With one discrepancy for all of these an accuracy that is worse by a smaller share is as good.
const LITTLE_WORSE: f64 = 0.01;
/// Compensation that leaves more than this share of the task deflection gains next to nothing.
const NO_GAIN: f64 = 0.5;
/// Deflections of more than this share of the reach are not small: what is predicted to first order errs by about as large a share of them.
const SMALL: f64 = 0.05;
/// What no command makes up for does not count below this share of the predicted accuracy.
const MADE_UP: f64 = 0.1;
/// So many pairs are named.
const NAMED: usize = 4;

/// The conditions that do not hold for a plan with this predicted accuracy (m).
pub(super) fn conditions(task: &Task, plan: &Plan, rho0_m: Option<f64>) -> Vec<Condition> {
    let Some(rho0_m) = rho0_m else {
        return Vec::new();
    };
    (near(task, plan, rho0_m).into_iter())
        .chain(no_gain(task, rho0_m))
        .chain(not_made_up(task, rho0_m))
        .chain(bent_far(task, plan))
        .collect()
}

/// The compliances of which a plan tells less than their nominal values do, which identification keeps then while `rho_0` counts estimates; by
/// a prior's precision (p x p) and what is known after the plan.
pub fn less_than_nominal(
    set: &ParameterSet,
    precision: &DMatrix<f64>,
    known: &Posterior,
) -> Option<String> {
    let (mut names, mut shares) = (Vec::new(), Vec::new());
    for (place, each) in set.parameters().iter().enumerate() {
        let is_free = matches!(each.kind, ParameterKind::JointCompliance { .. })
            && precision[(place, place)] <= 0.0;
        let error = is_free.then(|| known.standard_error(place)).flatten();
        let share = error.map_or(0.0, |error| error / each.scale);
        if share > UNKNOWN_COMPLIANCE {
            names.push(each.name.as_str());
            shares.push(format!("{share:.2}"));
        }
    }
    (!names.is_empty()).then(|| {
        format!(
            "identification keeps {} nominal: predicted standard errors of {} nominal values",
            names.join(", "),
            shares.join(", ")
        )
    })
}

/// Whether the accuracy rests on discrepancies of neighbouring configurations being independent, or on the rounding of displacements that
/// hardly differ.
fn near(task: &Task, plan: &Plan, own_m: f64) -> Option<Condition> {
    let (uncertain, all) = (&task.belief.uncertain, &plan.experiments);
    let (have_discrepancies, step_m) = (uncertain.has_discrepancies(), uncertain.along_step_m());
    let [errors, error] = if have_discrepancies {
        ["model discrepancies", "discrepancy"]
    } else if step_m > 0.0 {
        ["rounding errors", "rounding error"]
    } else {
        return None;
    };
    let shown_m = all.iter().map(|each| displacement_m(&task.belief, each));
    let shown_m: Vec<f64> = shown_m.collect();
    let are_alike = |one: usize, other: usize| {
        let hung = |place: usize| (all[place].load, all[place].direction);
        let apart_m = (shown_m[one] - shown_m[other]).abs();
        have_discrepancies || hung(one) == hung(other) && apart_m < 0.5 * step_m
    };
    let is_near = |one: usize, other: usize| {
        if !are_alike(one, other) {
            return false;
        }
        let [one, other] = [one, other].map(|place| &all[place]);
        let [one_q, other_q] = [one, other].map(|each| each.configuration_rad.as_slice());
        let (_, apart) = task.belief.nominal.chain.largest_difference(one_q, other_q);
        apart < NEAR && Approach::is_same(one.approach.as_ref(), other.approach.as_ref())
    };
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for place in 0..all.len() {
        match groups.iter_mut().find(|group| is_near(group[0], place)) {
            Some(group) => group.push(place),
            None => groups.push(vec![place]),
        }
    }
    let mut as_one = plan.clone();
    let mut pairs = Vec::new();
    for group in &groups {
        for &member in &group[1..] {
            if !all[member].stands_as(&all[group[0]]) {
                pairs.push(format!("{} and {}", group[0] + 1, member + 1));
            }
            as_one.experiments[member].configuration_rad = all[group[0]].configuration_rad.clone();
        }
    }
    if pairs.is_empty() {
        return None;
    }
    let as_one_m = rho0_m(task, &posterior(&task.belief, &as_one))?;
    if as_one_m - own_m < LITTLE_WORSE * own_m {
        return None;
    }
    let more = match pairs.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(", and {more} more"),
    };
    pairs.truncate(NAMED);
    Some(ConditionCode::NearConfigurations.with(format!(
        "experiments {}{more} are within 5 deg in all joints, with independent {}: rho0 = {} um, and {} um with one {} for \
         each group",
        pairs.join(", "),
        errors,
        in_um(own_m, 3),
        in_um(as_one_m, 3),
        error
    )))
}

/// What the nominal robot moves along a gauge's direction in an experiment (m), to first order; endless where a gauge does not read.
fn displacement_m(belief: &Belief, experiment: &Experiment) -> f64 {
    let Some(direction) = &experiment.direction else {
        return f64::INFINITY;
    };
    let q = experiment.configuration_rad.as_slice();
    let state = (belief.nominal.chain.at(&belief.calibration_tool)).state(q);
    let joints = belief.nominal.compliance_rad_per_nm.iter().enumerate();
    joints
        .map(|(joint, k)| {
            let along = direction.dot(&state.position_column(joint));
            along * k * state.load_torque(joint, &experiment.load)
        })
        .sum()
}

/// Whether a load bends the nominal robot, to first order, by more than is small.
fn bent_far(task: &Task, plan: &Plan) -> Option<Condition> {
    let belief = &task.belief;
    let compliance = DVector::from_column_slice(&belief.nominal.compliance_rad_per_nm);
    let joints: Vec<usize> = (0..compliance.len()).collect();
    let arm = belief.arm_with(&belief.calibration_tool);
    let (sizes, precision) = (vec![1.0; joints.len()], belief.instrument.precision());
    let mut model = PlannedReadings::of_compliances(arm, &joints, &sizes, precision);
    let moved_m = |rows: DMatrix<f64>| (rows.rows(0, rows.nrows().min(3)) * &compliance).norm();
    let measured = plan.experiments.iter().enumerate().map(|(index, each)| {
        let moved_m = moved_m(rows_of(&mut model, belief, each));
        (format!("experiment {}", index + 1), moved_m)
    });
    let at_work = task.test_poses.iter().map(|pose| {
        let moved_m = moved_m(test_pose_matrix(belief, pose, &joints));
        (format!("{:?}", pose.name), moved_m)
    });
    let (what, most_m) =
        (measured.chain(at_work)).max_by(|one, other| one.1.total_cmp(&other.1))?;
    let share = most_m / belief.nominal.chain.reach_m(&belief.calibration_tool);
    (share > SMALL).then(|| {
        ConditionCode::LargeDeflection.with(format!(
            "the load of {what} bends the robot by {:.0} mm, {:.0} % of its reach, to first order, which is for small deflections",
            most_m * 1e3,
            share * 100.0
        ))
    })
}

/// Whether commanded joints cannot make up for what passive ones give, by the nominal robot.
fn not_made_up(task: &Task, rho0_m: f64) -> Option<Condition> {
    let arm = task.belief.arm();
    if arm.chain.commanded().count() == arm.chain.len() {
        return None;
    }
    let tool = arm.tools.len() - 1;
    let mut solver = EquilibriumSolver::new(arm.chain.len());
    let mut rest = |q: &DVector<f64>, load: &Load| {
        let mut at_tool = arm.chain.at(&arm.tools[tool]);
        let compliance = &arm.compliance_rad_per_nm;
        (solver.solve(&mut at_tool, compliance, q.as_slice(), load)).ok()?;
        let state = solver.state();
        Some((state.tool_position, state.tool_rotation))
    };
    let mut square_m2 = 0.0;
    for pose in &task.test_poses {
        let (wanted_m, axes) = rest(&pose.configuration_rad, &Load::NONE)?;
        let commanded = compensate_arm(&arm, tool, pose, Method::Nonlinear).ok()?;
        let (stands_m, _) = rest(&commanded, &pose.load_at(&axes))?;
        square_m2 += pose.weight * pose.counted(&(stands_m - wanted_m)).norm_squared();
    }
    let left_m = square_m2.sqrt();
    (left_m > MADE_UP * rho0_m).then(|| {
        ConditionCode::NotMadeUp.with(format!(
            "no command makes up for what passive joints give: {} um are left of the nominal robot, beside rho0 = {} um",
            in_um(left_m, 3),
            in_um(rho0_m, 3)
        ))
    })
}

/// Whether so much is left that there is nothing to gain.
fn no_gain(task: &Task, rho0_m: f64) -> Option<Condition> {
    let belief = &task.belief;
    let compliance = &belief.nominal.compliance_rad_per_nm;
    let joints: Vec<usize> = (0..compliance.len()).collect();
    let square = |pose| {
        let moved =
            test_pose_matrix(belief, pose, &joints) * DVector::from_column_slice(compliance);
        moved.norm_squared()
    };
    let poses = task.test_poses.iter();
    let bent_m = poses
        .map(|pose| pose.weight * square(pose))
        .sum::<f64>()
        .sqrt();
    (rho0_m > NO_GAIN * bent_m).then(|| {
        ConditionCode::NoGain.with(format!(
            "compensation gains next to nothing: predicted residual error {} um, deflection by the task load {} um; is a \
             load in another unit, such as kN?",
            in_um(rho0_m, 3),
            in_um(bent_m, 3)
        ))
    })
}
