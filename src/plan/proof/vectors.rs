//! Vectors and frames of Taylor models.

use super::constant::{Constant, Rotation};
use super::taylor::{ModelVector, ModelWorkspace, TaylorModel};

/// The columns of a rotation matrix.
pub(super) type Frame = [ModelVector; 3];

pub(super) const NOWHERE: ModelVector = [TaylorModel::ZERO; 3];

/// Sine and cosine of an angle.
pub(super) type Angle = [TaylorModel; 2];

pub(super) fn exact(workspace: &mut ModelWorkspace, values: [f64; 3]) -> ModelVector {
    values.map(|value| workspace.constant(value, 0.0))
}

pub(super) fn parallel(workspace: &mut ModelWorkspace) -> Frame {
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|column| exact(workspace, column))
}

/// The two axes that a turn about an axis moves: the first towards the second.
pub(super) const fn turned_axes(axis: usize) -> [usize; 2] {
    [(axis + 1) % 3, (axis + 2) % 3]
}

/// A vector that is constant in a frame, added to (or subtracted from) another.
pub(super) fn constant_in(
    workspace: &mut ModelWorkspace,
    frame: &Frame,
    vector: &[Constant; 3],
    plus: &ModelVector,
    sign: f64,
) -> ModelVector {
    std::array::from_fn(|row| {
        let mut sum = workspace.sum().add(1.0, plus[row]);
        for (column, each) in frame.iter().zip(vector) {
            sum = sum.add_constant(sign * each.value, each.error, column[row]);
        }
        sum.end()
    })
}

/// A vector in a frame, added to (or subtracted from) another.
pub(super) fn vector_in(
    workspace: &mut ModelWorkspace,
    frame: &Frame,
    vector: &ModelVector,
    plus: &ModelVector,
    sign: f64,
) -> ModelVector {
    std::array::from_fn(|row| {
        let mut sum = workspace.sum().add(1.0, plus[row]);
        for (column, each) in frame.iter().zip(vector) {
            sum = sum.product(sign, column[row], *each);
        }
        sum.end()
    })
}

/// A constant vector, turned about a coordinate axis.
pub(super) fn turned_constant(
    workspace: &mut ModelWorkspace,
    axis: usize,
    [sine, cosine]: Angle,
    vector: &[Constant; 3],
) -> ModelVector {
    let [one, other] = turned_axes(axis);
    let (a, b) = (vector[one], vector[other]);
    let mut turned = NOWHERE;
    turned[axis] = workspace.constant(vector[axis].value, vector[axis].error);
    let sum = workspace.sum().add_constant(a.value, a.error, cosine);
    turned[one] = sum.add_constant(-b.value, b.error, sine).end();
    let sum = workspace.sum().add_constant(a.value, a.error, sine);
    turned[other] = sum.add_constant(b.value, b.error, cosine).end();
    turned
}

/// A frame turned about one of its axes (sign 1) or back (-1).
pub(super) fn turned_frame(
    workspace: &mut ModelWorkspace,
    frame: &Frame,
    axis: usize,
    [sine, cosine]: Angle,
    sign: f64,
) -> Frame {
    let [one, other] = turned_axes(axis);
    let mut turned = *frame;
    for (to, from, sign) in [(one, other, sign), (other, one, -sign)] {
        turned[to] = std::array::from_fn(|row| {
            let sum = workspace.sum().product(1.0, frame[to][row], cosine);
            sum.product(sign, frame[from][row], sine).end()
        });
    }
    turned
}

/// A frame times a constant rotation.
pub(super) fn rotated(workspace: &mut ModelWorkspace, frame: &Frame, rotation: &Rotation) -> Frame {
    rotation.map(|column| constant_in(workspace, frame, &column, &NOWHERE, 1.0))
}

pub(super) fn difference(
    workspace: &mut ModelWorkspace,
    one: &ModelVector,
    other: &ModelVector,
) -> ModelVector {
    std::array::from_fn(|row| {
        let sum = workspace.sum().add(1.0, one[row]);
        sum.add(-1.0, other[row]).end()
    })
}

pub(super) fn cross(
    workspace: &mut ModelWorkspace,
    one: &ModelVector,
    other: &ModelVector,
) -> ModelVector {
    std::array::from_fn(|row| {
        let [i, j] = turned_axes(row);
        let sum = workspace.sum().product(1.0, one[i], other[j]);
        sum.product(-1.0, one[j], other[i]).end()
    })
}

/// The sum of the products of two vectors each.
pub(super) fn dot(
    workspace: &mut ModelWorkspace,
    pairs: &[(&ModelVector, &ModelVector)],
) -> TaylorModel {
    let mut sum = workspace.sum();
    for (one, other) in pairs {
        for (one, other) in one.iter().zip(*other) {
            sum = sum.product(1.0, *one, *other);
        }
    }
    sum.end()
}
