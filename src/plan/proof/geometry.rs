//! The arm's geometry over boxes, in a frame in the middle of the chain: what turns with the joints before it
//! and what turns with those behind it are products of fewer sines and cosines that way.

use super::chain::Chain;
use super::constant::{Constant, transposed};
use super::domain::Domain;
use super::taylor::{ModelVector, ModelWorkspace, TaylorModel, TermSign};
use super::vectors::{
    Angle, Frame, NOWHERE, constant_in, cross, difference, parallel, rotated, turned_constant,
    turned_frame, vector_in,
};

/// What a joint does over boxes: sine and cosine of the sum of the angles of its run so far, or how far it slides (m).
#[derive(Debug, Clone, Copy)]
pub(super) enum JointMotion {
    Turns(Angle),
    Slides(TaylorModel),
}

impl JointMotion {
    const fn angle(self) -> Option<Angle> {
        match self {
            Self::Turns(angle) => Some(angle),
            Self::Slides(_) => None,
        }
    }

    const fn way(self) -> Option<TaylorModel> {
        match self {
            Self::Turns(_) => None,
            Self::Slides(way) => Some(way),
        }
    }
}

/// Where everything is, in the frame of the link before joint `middle`.
#[derive(Debug, Clone)]
pub(super) struct BoxGeometry {
    /// The world's axes.
    pub world: Frame,
    /// The world's origin.
    pub base: ModelVector,
    /// The axis of each joint, and a point on it: where it slides, where its frame stands before it does.
    pub axis: Vec<ModelVector>,
    pub anchor: Vec<ModelVector>,
    /// The axis where it turns, nothing where it slides.
    pub turning: Vec<ModelVector>,
    /// The centre of each link's mass, where asked for.
    pub centre: Vec<ModelVector>,
    pub tool: ModelVector,
    pub tool_axis: ModelVector,
    /// The places that springs go through.
    pub places: Vec<ModelVector>,
}

impl BoxGeometry {
    pub fn new(
        workspace: &mut ModelWorkspace,
        chain: &Chain,
        domain: &Domain,
        motions: &dyn Fn(usize, usize) -> JointMotion,
        middle: usize,
        needs_masses: bool,
    ) -> Self {
        let count = chain.links.len();
        let home = parallel(workspace);
        let mut geometry = Self {
            world: home,
            base: NOWHERE,
            axis: vec![NOWHERE; count],
            anchor: vec![NOWHERE; count],
            centre: vec![NOWHERE; count],
            turning: vec![NOWHERE; count],
            tool: NOWHERE,
            tool_axis: NOWHERE,
            places: vec![NOWHERE; chain.places.len()],
        };
        let motion = |joint: usize| {
            let variable = domain.variable[joint]?;
            Some(motions(joint, variable))
        };
        if middle == chain.tool_joints {
            geometry.take_tool(workspace, chain, &home, &NOWHERE);
        }
        geometry.outward(workspace, chain, &motion, middle, needs_masses);
        geometry.inward(workspace, chain, &motion, middle, needs_masses);
        for (index, (link, place)) in chain.places.iter().enumerate() {
            if link.is_none() {
                geometry.places[index] =
                    constant_in(workspace, &geometry.world, place, &geometry.base, 1.0);
            }
        }
        for (joint, link) in chain.links.iter().enumerate() {
            if !link.slides {
                geometry.turning[joint] = geometry.axis[joint];
            }
        }
        geometry
    }

    /// How a joint moves a point that it carries, for each radian or metre.
    pub fn moves(
        &self,
        workspace: &mut ModelWorkspace,
        chain: &Chain,
        joint: usize,
        point: &ModelVector,
    ) -> ModelVector {
        if chain.links[joint].slides {
            return self.axis[joint];
        }
        let arm = difference(workspace, point, &self.anchor[joint]);
        cross(workspace, &self.axis[joint], &arm)
    }

    /// Where what is constant in a link is, told by how to tell it.
    fn take_link(
        &mut self,
        chain: &Chain,
        joint: usize,
        needs_masses: bool,
        told: &mut dyn FnMut(&[Constant; 3]) -> ModelVector,
    ) {
        if needs_masses {
            self.centre[joint] = told(&chain.links[joint].centre_of_mass);
        }
        for (index, (link, place)) in chain.places.iter().enumerate() {
            if *link == Some(joint) {
                self.places[index] = told(place);
            }
        }
    }

    fn take_tool(
        &mut self,
        workspace: &mut ModelWorkspace,
        chain: &Chain,
        frame: &Frame,
        origin: &ModelVector,
    ) {
        self.tool = constant_in(workspace, frame, &chain.tool, origin, 1.0);
        self.tool_axis = constant_in(workspace, frame, &chain.tool_axis, &NOWHERE, 1.0);
    }

    /// From the middle to the tool.
    fn outward(
        &mut self,
        workspace: &mut ModelWorkspace,
        chain: &Chain,
        motion: &dyn Fn(usize) -> Option<JointMotion>,
        middle: usize,
        needs_masses: bool,
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
            match motion(joint) {
                Some(JointMotion::Turns(angle)) => {
                    frame = turned_frame(workspace, &run, link.axis, angle, TermSign::Plus);
                }
                Some(JointMotion::Slides(way)) => {
                    origin = slid(workspace, &origin, &run[link.axis], way, TermSign::Plus);
                }
                None => {}
            }
            self.take_link(chain, joint, needs_masses, &mut |place| {
                constant_in(workspace, &frame, place, &origin, 1.0)
            });
            if joint + 1 == chain.tool_joints {
                self.take_tool(workspace, chain, &frame, &origin);
            }
        }
    }

    /// From the middle to the base, run by run.
    fn inward(
        &mut self,
        workspace: &mut ModelWorkspace,
        chain: &Chain,
        motion: &dyn Fn(usize) -> Option<JointMotion>,
        middle: usize,
        needs_masses: bool,
    ) {
        let angle = |joint: usize| motion(joint).and_then(JointMotion::angle);
        let mut frame = self.world;
        let mut origin = NOWHERE;
        let mut end = middle;
        while end > 0 {
            let first = chain.run_start(end - 1);
            let axis = chain.links[end - 1].axis;
            let run = match angle(end - 1) {
                Some(angle) => turned_frame(workspace, &frame, axis, angle, TermSign::Minus),
                None => frame,
            };
            for joint in (first..end).rev() {
                let link = &chain.links[joint];
                self.axis[joint] = signed(workspace, &run[axis], link.sign);
                self.take_link(
                    chain,
                    joint,
                    needs_masses,
                    &mut |place| match angle(joint) {
                        _ if joint + 1 == end => {
                            constant_in(workspace, &frame, place, &origin, 1.0)
                        }
                        Some(angle) => {
                            let place = turned_constant(workspace, axis, angle, place);
                            vector_in(workspace, &run, &place, &origin, TermSign::Plus)
                        }
                        None => constant_in(workspace, &run, place, &origin, 1.0),
                    },
                );
                // A joint that slides is a run of its own.
                if let Some(way) = motion(joint).and_then(JointMotion::way) {
                    origin = slid(workspace, &origin, &run[axis], way, TermSign::Minus);
                }
                self.anchor[joint] = origin;
                if joint > first {
                    // The offset stands in the frame of the link before, which turns about the same axis.
                    origin = match angle(joint - 1) {
                        Some(angle) => {
                            let offset = turned_constant(workspace, axis, angle, &link.offset);
                            vector_in(workspace, &run, &offset, &origin, TermSign::Minus)
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

/// A point moved along an axis, or back.
fn slid(
    workspace: &mut ModelWorkspace,
    point: &ModelVector,
    axis: &ModelVector,
    way: TaylorModel,
    sign: TermSign,
) -> ModelVector {
    std::array::from_fn(|row| {
        let sum = workspace.sum().add(1.0, point[row]);
        sum.product(sign, axis[row], way).end()
    })
}

fn signed(workspace: &mut ModelWorkspace, vector: &ModelVector, sign: f64) -> ModelVector {
    if sign > 0.0 {
        *vector
    } else {
        vector.map(|each: TaylorModel| workspace.sum().add(sign, each).end())
    }
}
