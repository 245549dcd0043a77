//! The arm's geometry over boxes, in a frame in the middle of the chain: what turns with the joints before it
//! and what turns with those behind it are products of fewer sines and cosines that way.

use super::chain::Chain;
use super::constant::transposed;
use super::domain::Domain;
use super::taylor::{ModelVector, ModelWorkspace};
use super::vectors::{
    Angle, Frame, NOWHERE, constant_in, cross, difference, parallel, rotated, turned_constant,
    turned_frame, vector_in,
};

/// Where everything is, in the frame of the link before joint `middle`.
#[derive(Debug, Clone)]
pub(super) struct BoxGeometry {
    /// The world's axes.
    pub world: Frame,
    /// The world's origin.
    pub base: ModelVector,
    /// The axis of each joint, and a point on it.
    pub axis: Vec<ModelVector>,
    pub anchor: Vec<ModelVector>,
    pub tool: ModelVector,
    pub tool_axis: ModelVector,
}

impl BoxGeometry {
    pub fn new(
        workspace: &mut ModelWorkspace,
        chain: &Chain,
        domain: &Domain,
        angles: &[Angle],
        middle: usize,
    ) -> Self {
        let count = chain.links.len();
        let home = parallel(workspace);
        let mut geometry = Self {
            world: home,
            base: NOWHERE,
            axis: vec![NOWHERE; count],
            anchor: vec![NOWHERE; count],
            tool: NOWHERE,
            tool_axis: NOWHERE,
        };
        let angle = |joint: usize| domain.variable[joint].map(|variable| angles[variable]);
        geometry.outward(workspace, chain, &angle, middle);
        geometry.inward(workspace, chain, &angle, middle);
        geometry
    }

    /// How a joint moves a point that it carries, for each radian.
    pub fn moves(
        &self,
        workspace: &mut ModelWorkspace,
        joint: usize,
        point: &ModelVector,
    ) -> ModelVector {
        let arm = difference(workspace, point, &self.anchor[joint]);
        cross(workspace, &self.axis[joint], &arm)
    }

    /// From the middle to the tool.
    fn outward(
        &mut self,
        workspace: &mut ModelWorkspace,
        chain: &Chain,
        angle: &dyn Fn(usize) -> Option<Angle>,
        middle: usize,
    ) {
        let mut frame = self.world;
        let mut run = frame;
        let mut origin = NOWHERE;
        for (joint, link) in chain.links.iter().enumerate().skip(middle) {
            origin = constant_in(workspace, &frame, &link.offset, &origin, 1.0);
            if let Some(rotation) = &link.rotation {
                frame = rotated(workspace, &frame, rotation);
            }
            if link.starts_run || joint == middle {
                run = frame;
            }
            self.anchor[joint] = origin;
            self.axis[joint] = signed(workspace, &run[link.axis], link.sign);
            if let Some(angle) = angle(joint) {
                frame = turned_frame(workspace, &run, link.axis, angle, 1.0);
            }
        }
        self.tool = constant_in(workspace, &frame, &chain.tool, &origin, 1.0);
        self.tool_axis = constant_in(workspace, &frame, &chain.tool_axis, &NOWHERE, 1.0);
    }

    /// From the middle to the base, run by run.
    fn inward(
        &mut self,
        workspace: &mut ModelWorkspace,
        chain: &Chain,
        angle: &dyn Fn(usize) -> Option<Angle>,
        middle: usize,
    ) {
        let mut frame = self.world;
        let mut origin = NOWHERE;
        let mut end = middle;
        while end > 0 {
            let first = chain.run_start(end - 1);
            let axis = chain.links[end - 1].axis;
            let run = match angle(end - 1) {
                Some(angle) => turned_frame(workspace, &frame, axis, angle, -1.0),
                None => frame,
            };
            for joint in (first..end).rev() {
                let link = &chain.links[joint];
                self.axis[joint] = signed(workspace, &run[axis], link.sign);
                self.anchor[joint] = origin;
                if joint > first {
                    // The offset stands in the frame of the link before, which turns about the same axis.
                    origin = match angle(joint - 1) {
                        Some(angle) => {
                            let offset = turned_constant(workspace, axis, angle, &link.offset);
                            vector_in(workspace, &run, &offset, &origin, -1.0)
                        }
                        None => constant_in(workspace, &run, &link.offset, &origin, -1.0),
                    };
                }
            }
            let link = &chain.links[first];
            frame = match &link.rotation {
                Some(rotation) => rotated(workspace, &run, &transposed(rotation)),
                None => run,
            };
            origin = constant_in(workspace, &frame, &link.offset, &origin, -1.0);
            end = first;
        }
        self.world = frame;
        self.base = origin;
    }
}

fn signed(workspace: &mut ModelWorkspace, vector: &ModelVector, sign: f64) -> ModelVector {
    if sign > 0.0 {
        *vector
    } else {
        vector.map(|each| workspace.sum().add(sign, each).end())
    }
}
