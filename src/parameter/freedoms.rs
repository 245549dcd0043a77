//! Combinations of parameters that cannot be separated: the null space of the kinematic model.
//!
//! Two classes. *Structural*: a frame that is moved along or about its own joint's axis, and put back
//! beyond the joint; a zero and its link's rotation about the axis, or its shift along it where the joint slides, which may be shifted in
//! any direction; the base and the first link; all
//! compliances against the size of all loads. These are known beforehand, as directions of the
//! parameters, and are named. That gravity acts on a link that was moved, or that a known load does not
//! turn with the base, tells some of them apart after all, if hardly: they count as not told apart
//! where all readings together see them more than 500 times more weakly than what they are made of.
//! *Weak*: all else that the readings leave undetermined, by the rule of [`Estimable`].
//!
//! A prior settles either. Without one the direction stays at its nominal value.

use nalgebra::{Cholesky, DMatrix, Isometry3, SymmetricEigen, Vector3};

use super::words::{Freedom, SPARSE, reduced, sentences, stays_nominal};
use super::{Axis, ElasticArm, ParameterKind, ParameterSet};
use crate::numeric::estimable::Estimable;

/// A structural direction that is seen with less than this share of its parts' information is not told
/// apart: 1/500, squared.
const HARDLY_SEEN: f64 = 4e-6;
/// With less than this share it is not seen at all, but for rounding.
const NEVER_SEEN: f64 = 1e-11;
/// Information below this is none, as in [`Estimable`]: a hundredth of a standard deviation, squared.
const NOTHING: f64 = 1e-4;
/// Singular values below this share of the largest are rounding.
const ROUNDING: f64 = 1e-9;

/// All that readings of some setups do not show of a set of parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Freedoms {
    /// An orthonormal basis in typical sizes, p x f.
    pub directions: DMatrix<f64>,
    /// The same, each named.
    pub named: Vec<Freedom>,
}

impl Freedoms {
    /// What information from readings (p x p, in units of typical sizes) and the set's prior leave.
    pub fn new(belief: &ElasticArm, set: &ParameterSet, information: &DMatrix<f64>) -> Self {
        let size = set.len();
        let prior = relative_precision(set);
        let structural = held(
            set,
            &structural_directions(belief, set),
            information,
            &prior,
        );
        let nominal = set.nominal();
        let mut fixed = structural
            .clone()
            .insert_columns(structural.ncols(), nominal.len(), 0.0);
        for (index, &place) in nominal.iter().enumerate() {
            fixed[(place, structural.ncols() + index)] = 1.0;
        }
        let fixed = if nominal.is_empty() {
            structural.clone()
        } else {
            orthonormal(&fixed)
        };
        let free = complement(&fixed);
        let total = free.tr_mul(&(information + prior)) * &free;
        let within = Estimable::new(&total, &vec![1.0; free.ncols()]);
        let weak = &free * within.hidden();
        let mut directions = DMatrix::zeros(size, fixed.ncols() + weak.ncols());
        directions.columns_mut(0, fixed.ncols()).copy_from(&fixed);
        directions
            .columns_mut(fixed.ncols(), weak.ncols())
            .copy_from(&weak);
        let mut named = sentences(belief, set, &structural, &weak, information);
        named.extend(stays_nominal(belief, set));
        Self { directions, named }
    }

    /// The same as a decision about what is determined.
    pub fn estimable(&self, set: &ParameterSet) -> Estimable {
        Estimable::with_hidden(set.scales().as_slice(), self.directions.clone())
    }

    /// The parameters that can be left out without loss, as indices, in order.
    pub fn redundant(&self) -> Vec<usize> {
        let mut redundant: Vec<usize> = self.named.iter().map(|each| each.redundant).collect();
        redundant.sort_unstable();
        redundant
    }
}

/// The prior's precision in units of typical sizes, p x p.
pub(crate) fn relative_precision(set: &ParameterSet) -> DMatrix<f64> {
    set.prior().relative(set.scales().as_slice())
}

/// The directions within some (p x g, orthonormal) that neither readings nor a prior tell apart.
fn held(
    set: &ParameterSet,
    candidates: &DMatrix<f64>,
    information: &DMatrix<f64>,
    prior: &DMatrix<f64>,
) -> DMatrix<f64> {
    // Row by row by its own precision: a prior that is very good hides no other one.
    let mut known = prior * candidates;
    for (mut row, own) in known.row_iter_mut().zip(&prior.diagonal()) {
        row /= if *own > 0.0 { *own } else { 1.0 };
    }
    // Of directions that no prior says anything of, rounding is all that there is.
    known.apply(|value| {
        if value.abs() < ROUNDING {
            *value = 0.0;
        }
    });
    let candidates = orthonormal(&(candidates * null_space(&known)));
    let parts = DMatrix::from_diagonal(&information.diagonal().add_scalar(NOTHING));
    // One by one first, in combinations of few parameters: one that is seen must not tinge others. Then
    // what is not seen at all of those that are.
    let (hidden, seen): (Vec<_>, Vec<_>) = reduced(set, &candidates, SPARSE)
        .into_iter()
        .map(|(_, direction)| direction)
        .partition(|direction| {
            direction.dot(&(information * direction))
                < HARDLY_SEEN * direction.dot(&(&parts * direction))
        });
    let mut held = DMatrix::zeros(set.len(), 0);
    for direction in hidden {
        let place = held.ncols();
        held = held.insert_column(place, 0.0);
        held.set_column(place, &direction.normalize());
    }
    if !seen.is_empty() {
        let seen = orthonormal(&DMatrix::from_columns(&seen));
        let share = seen.tr_mul(&(&parts * &seen));
        if let Some(factor) = Cholesky::new(share).and_then(|factor| factor.l().try_inverse()) {
            let information = seen.tr_mul(&(information * &seen));
            let share = SymmetricEigen::new(&factor * information * factor.transpose());
            let kept: Vec<usize> = (0..share.eigenvalues.len())
                .filter(|&index| share.eigenvalues[index] < NEVER_SEEN)
                .collect();
            let more = seen * factor.transpose() * share.eigenvectors.select_columns(&kept);
            let places = held.ncols();
            held = held.insert_columns(places, more.ncols(), 0.0);
            held.columns_mut(places, more.ncols()).copy_from(&more);
        }
    }
    orthonormal(&held)
}

/// Directions, in units of typical sizes, that a robot's structure does not let anybody tell apart, or
/// hardly: an orthonormal basis, p x g, of all combinations within the set.
fn structural_directions(belief: &ElasticArm, set: &ParameterSet) -> DMatrix<f64> {
    let generators = generators(belief, set);
    let size = |kind: ParameterKind| kind.typical_size(belief, false);
    let mut outside: Vec<ParameterKind> = (generators.iter().flatten())
        .map(|&(kind, _)| kind)
        .filter(|&kind| set.index_of(kind).is_none())
        .collect();
    outside.sort_unstable();
    outside.dedup();
    let mut inner = DMatrix::<f64>::zeros(set.len(), generators.len());
    let mut outer = DMatrix::<f64>::zeros(outside.len(), generators.len());
    for (column, generator) in generators.iter().enumerate() {
        for &(kind, value) in generator {
            if let Some(row) = set.index_of(kind) {
                inner[(row, column)] += value / set.parameters()[row].scale;
            } else if let Ok(row) = outside.binary_search(&kind) {
                outer[(row, column)] += value / size(kind);
            }
        }
    }
    orthonormal(&(inner * null_space(&outer)))
}

type Generator = Vec<(ParameterKind, f64)>;

/// The directions among all parameters that a robot could have, in the parameters' units.
fn generators(belief: &ElasticArm, set: &ParameterSet) -> Vec<Generator> {
    let mut all = Vec::new();
    let joints = &belief.chain.joints;
    for (index, joint) in joints.iter().enumerate() {
        let axis = joint.axis.into_inner();
        if joint.drive.slides {
            all.extend(of_slide(belief, index, &axis));
            continue;
        }
        // A shift along the axis, taken back beyond the joint.
        let mut shift = link(index, &axis, &Vector3::zeros());
        shift.extend(taken_back(belief, index, &axis, &Vector3::zeros()));
        // A turn about it.
        let mut turn = vec![(ParameterKind::JointZero { joint: index }, 1.0)];
        turn.extend(taken_back(belief, index, &Vector3::zeros(), &axis));
        let mut zero = vec![(ParameterKind::JointZero { joint: index }, 1.0)];
        zero.extend(link(index, &Vector3::zeros(), &-axis));
        all.extend([shift, turn, zero]);
    }
    if let Some(first) = joints.first() {
        let from_base = first.previous_from_link.inverse();
        for axis in Axis::ALL {
            let unit = Vector3::ith(axis.index(), 1.0);
            for (velocity, omega) in [(unit, Vector3::zeros()), (Vector3::zeros(), unit)] {
                let (back_velocity, back_omega) = seen_from(&from_base, &velocity, &omega);
                let mut generator = link(0, &-back_velocity, &-back_omega);
                // Seen from every station alike.
                for (station, frame) in belief.instrument_from_base.iter().enumerate() {
                    let position = |axis| ParameterKind::BasePosition { station, axis };
                    let rotation = |axis| ParameterKind::BaseRotation { station, axis };
                    let has_axes = set.index_of(position(Axis::X)).is_none()
                        || set.index_of(rotation(Axis::X)).is_some();
                    // A point has no axes that turn with the robot: it moves about the base instead.
                    let moved = velocity - omega.cross(&frame.translation.vector);
                    generator.extend(if has_axes {
                        motion(position, rotation, &velocity, &omega)
                    } else {
                        motion(position, rotation, &moved, &Vector3::zeros())
                    });
                }
                all.push(generator);
            }
        }
    }
    // All compliances against the size of what loads the joints.
    let mut softer: Generator = Vec::new();
    for (joint, &compliance) in belief.compliance_rad_per_nm.iter().enumerate() {
        let kind = ParameterKind::JointCompliance { joint };
        let is_logarithmic =
            (set.index_of(kind)).is_some_and(|index| set.parameters()[index].is_logarithmic);
        if compliance > 0.0 {
            softer.push((kind, if is_logarithmic { 1.0 } else { compliance }));
        }
    }
    if !softer.is_empty() {
        let with = |others: &[ParameterKind]| {
            let mut generator = softer.clone();
            generator.extend(others.iter().map(|&kind| (kind, -1.0)));
            generator
        };
        all.push(with(&[ParameterKind::LoadScale]));
        all.push(with(&[ParameterKind::PayloadMass]));
        all.push(with(&[
            ParameterKind::LoadScale,
            ParameterKind::PayloadMass,
        ]));
    }
    all
}

/// Where a joint slides, its link may be shifted anywhere and turned about the axis: all of that is taken back beyond the joint. Its zero
/// is a shift along the axis.
fn of_slide(belief: &ElasticArm, index: usize, axis: &Vector3<f64>) -> Vec<Generator> {
    let none = Vector3::zeros();
    let shifts = Axis::ALL.map(|axis| (Vector3::ith(axis.index(), 1.0), none));
    let mut all: Vec<Generator> = (shifts.into_iter().chain([(none, *axis)]))
        .map(|(velocity, omega)| {
            let mut motion = link(index, &velocity, &omega);
            motion.extend(taken_back(belief, index, &velocity, &omega));
            motion
        })
        .collect();
    let mut zero = vec![(ParameterKind::JointZero { joint: index }, 1.0)];
    zero.extend(link(index, &-axis, &none));
    all.push(zero);
    all
}

/// A small motion of a frame, by the parameters of its position and rotation.
fn motion(
    position: impl Fn(Axis) -> ParameterKind,
    rotation: impl Fn(Axis) -> ParameterKind,
    velocity: &Vector3<f64>,
    omega: &Vector3<f64>,
) -> Generator {
    let parts = |axis: Axis| {
        let (moved, turned) = (velocity[axis.index()], omega[axis.index()]);
        [(position(axis), moved), (rotation(axis), turned)]
    };
    let mut generator: Generator = Axis::ALL.into_iter().flat_map(parts).collect();
    generator.retain(|(_, value)| *value != 0.0);
    generator
}

fn link(link: usize, velocity: &Vector3<f64>, omega: &Vector3<f64>) -> Generator {
    motion(
        |axis| ParameterKind::LinkPosition { link, axis },
        |axis| ParameterKind::LinkRotation { link, axis },
        velocity,
        omega,
    )
}

/// A small motion of a link, in its frame, taken back by the next link's frame and by all tools on it.
fn taken_back(
    belief: &ElasticArm,
    index: usize,
    velocity: &Vector3<f64>,
    omega: &Vector3<f64>,
) -> Generator {
    let mut generator = Vec::new();
    if let Some(next) = belief.chain.joints.get(index + 1) {
        let (velocity, omega) = seen_from(&next.previous_from_link.inverse(), velocity, omega);
        generator.extend(link(index + 1, &-velocity, &-omega));
    }
    for (tool, each) in belief.tools.iter().enumerate() {
        if each.joints == index + 1 {
            let (velocity, omega) = seen_from(&each.link_from_tool.inverse(), velocity, omega);
            generator.extend(motion(
                |axis| ParameterKind::ToolPosition { tool, axis },
                |axis| ParameterKind::ToolRotation { tool, axis },
                &-velocity,
                &-omega,
            ));
        }
    }
    generator
}

/// A small motion (v, omega) in the coordinates of another frame.
fn seen_from(
    other: &Isometry3<f64>,
    velocity: &Vector3<f64>,
    omega: &Vector3<f64>,
) -> (Vector3<f64>, Vector3<f64>) {
    let turned = other.rotation * omega;
    let moved = other.rotation * velocity + other.translation.vector.cross(&turned);
    (moved, turned)
}

/// An orthonormal basis of the x with A x = 0 (n x f for A of n columns).
pub(super) fn null_space(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let columns = matrix.ncols();
    let largest = matrix.amax();
    if matrix.nrows() == 0 || largest == 0.0 {
        return DMatrix::identity(columns, columns);
    }
    // Enough rows for all right singular vectors.
    let mut square = DMatrix::zeros(matrix.nrows().max(columns), columns);
    square.rows_mut(0, matrix.nrows()).copy_from(matrix);
    let svd = square.svd(false, true);
    let tolerance = ROUNDING * svd.singular_values.max();
    let Some(v_t) = svd.v_t else {
        return DMatrix::zeros(columns, 0);
    };
    let null: Vec<usize> = (0..columns)
        .filter(|&index| svd.singular_values[index] <= tolerance)
        .collect();
    v_t.select_rows(&null).transpose()
}

/// An orthonormal basis of the space that columns span.
fn orthonormal(columns: &DMatrix<f64>) -> DMatrix<f64> {
    let largest = columns.amax();
    if columns.ncols() == 0 || largest == 0.0 {
        return DMatrix::zeros(columns.nrows(), 0);
    }
    let svd = columns.clone().svd(true, false);
    let tolerance = ROUNDING * svd.singular_values.max();
    let Some(u) = svd.u else {
        return DMatrix::zeros(columns.nrows(), 0);
    };
    let kept: Vec<usize> = (0..svd.singular_values.len())
        .filter(|&index| svd.singular_values[index] > tolerance)
        .collect();
    u.select_columns(&kept)
}

/// An orthonormal basis of what is orthogonal to orthonormal columns.
fn complement(columns: &DMatrix<f64>) -> DMatrix<f64> {
    null_space(&columns.transpose())
}
