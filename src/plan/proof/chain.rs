//! The arm in frames that make it simple: each joint turns about a coordinate axis of its frame, frames are
//! parallel at zero angle wherever that is exact, and joints with parallel axes form runs, whose variables are
//! the sums of their angles.

use super::constant::{
    Constant, IDENTITY, Rotation, coordinate_axis, is_permutation, product, rotation_of, towards,
    transposed, turned, vector,
};
use super::question::Arm;

/// A joint and its link.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Link {
    /// Where its frame stands in that of the link before (m).
    pub offset: [Constant; 3],
    /// How it stands there at zero angle, unless parallel.
    pub rotation: Option<Rotation>,
    /// The coordinate axis that it turns about, and which way.
    pub axis: usize,
    pub sign: f64,
    /// Whether its axis is not that of the joint before.
    pub starts_run: bool,
}

/// The joints that move the tool, in such frames.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Chain {
    pub links: Vec<Link>,
    pub tool: [Constant; 3],
    pub tool_axis: [Constant; 3],
}

impl Chain {
    pub fn new(arm: &Arm) -> Self {
        // The rotation from each model frame to the frame here.
        let mut frame = IDENTITY;
        let mut links: Vec<Link> = Vec::new();
        for joint in arm.joints.iter().take(arm.tool_joints) {
            let before = transposed(&frame);
            let turn = product(&before, &rotation_of(joint.rotation));
            let offset = turned(&before, &vector(joint.offset_m));
            let axis = vector(joint.axis);
            let (rotation, along) = match coordinate_axis(&axis) {
                Some(_) if is_permutation(&turn) => {
                    frame = transposed(&turn);
                    (None, coordinate_axis(&turned(&turn, &axis)))
                }
                Some(along) => {
                    frame = IDENTITY;
                    (Some(turn), Some(along))
                }
                None => {
                    frame = towards(joint.axis);
                    (Some(product(&turn, &frame)), Some((2, 1.0)))
                }
            };
            let (axis, sign) = along.unwrap_or((2, 1.0));
            let same_axis = links.last().is_some_and(|last| last.axis == axis);
            links.push(Link {
                offset,
                starts_run: rotation.is_some() || !same_axis,
                rotation,
                axis,
                sign,
            });
        }
        let here = transposed(&frame);
        Self {
            links,
            tool: turned(&here, &vector(arm.tool_offset_m)),
            tool_axis: turned(&here, &rotation_of(arm.tool_rotation)[2]),
        }
    }

    /// The first joint of the run that a joint is in.
    pub fn run_start(&self, joint: usize) -> usize {
        (0..=joint)
            .rev()
            .find(|&index| self.links[index].starts_run)
            .unwrap_or(0)
    }

    /// Whether the axis of the first joint is exactly vertical.
    pub fn is_first_upright(&self) -> bool {
        (self.links.first()).is_some_and(|first| first.rotation.is_none() && first.axis == 2)
    }

    /// Whether the arm is its own mirror image across the plane at right angles to a coordinate axis, with
    /// the angles of all joints but those about that axis reversed, and the ways of those along it.
    pub fn is_mirrored(&self, across: usize) -> bool {
        let flat = |vector: &[Constant; 3]| vector[across].is(0.0);
        flat(&self.tool)
            && flat(&self.tool_axis)
            && self
                .links
                .iter()
                .all(|link| link.rotation.is_none() && flat(&link.offset))
    }

    /// Whether joints k, k + 1 and k + 2 are a wrist that reaches every pose in two ways: with k and k + 2
    /// half a turn on and k + 1 reversed.
    pub fn is_wrist(&self, k: usize) -> bool {
        let Some([first, second, third]) = self.links.get(k..k + 3) else {
            return false;
        };
        let along =
            |offset: &[Constant; 3]| (0..3).all(|each| each == first.axis || offset[each].is(0.0));
        second.rotation.is_none()
            && third.rotation.is_none()
            && second.axis != first.axis
            && third.axis == first.axis
            && along(&second.offset)
            && along(&third.offset)
    }

    /// Whether the last joint moves neither the tool's position nor its z axis.
    pub fn turns_tool_on_the_spot(&self, z_axis_matters: bool) -> bool {
        self.links.last().is_some_and(|last| {
            let along =
                |vector: &[Constant; 3]| (0..3).all(|k| k == last.axis || vector[k].is(0.0));
            along(&self.tool) && (!z_axis_matters || along(&self.tool_axis))
        })
    }
}
