//! Whether the robot keeps clear of its surroundings and of itself along a straight joint move.

use crate::mujoco::{Shape, State};
use crate::robot::{EquilibriumSolver, Load};
use crate::task::Task;

/// No point of the robot moves farther than this between two looks where the clearance is smaller (m).
const SHORTEST_STEP_M: f64 = 5e-3;

/// Judges moves of the nominal robot at rest under a load. At every place that it looks at the clearance
/// holds, and no point of the robot moves farther than the clearance from one to the next: in between, half
/// of it is left.
#[derive(Debug)]
pub struct PathJudge<'a> {
    task: &'a Task,
    simulation: Option<State>,
    solver: EquilibriumSolver,
    clearance_m: f64,
    /// How far each joint moves any point of the robot at most (m per rad, or per m).
    reach: Vec<f64>,
}

impl<'a> PathJudge<'a> {
    /// A judge for a task's robot and region. Without a clearance in the region nothing is judged.
    pub fn new(task: &'a Task) -> Self {
        let clearance = task.region.collision_clearance_m;
        let clearance_m = clearance.unwrap_or(0.0);
        Self {
            simulation: clearance
                .map(|clearance| State::new(&task.belief.nominal.model.with_clearance(clearance))),
            solver: EquilibriumSolver::new(task.belief.joints()),
            clearance_m,
            reach: reach(task),
            task,
        }
    }

    /// Whether collisions are looked for at all.
    pub fn looks(&self) -> bool {
        self.simulation.is_some()
    }

    /// Whether the robot is clear at commanded joint angles (rad, m) under a load.
    pub fn is_clear(&mut self, q: &[f64], load: &Load) -> bool {
        let Some(simulation) = &mut self.simulation else {
            return true;
        };
        let belief = &self.task.belief;
        let mut arm = belief.nominal.chain.at(&belief.calibration_tool);
        let compliance = &belief.nominal.compliance_rad_per_nm;
        if self.solver.solve(&mut arm, compliance, q, load).is_err() {
            return false;
        }
        simulation.move_to(self.solver.q());
        simulation.nearest_contact(self.clearance_m).is_none()
    }

    /// Whether it is clear all along the straight move between two configurations under each of the loads.
    pub fn is_straight_clear(&mut self, from: &[f64], to: &[f64], loads: &[Load]) -> bool {
        if !self.looks() {
            return true;
        }
        let steps = self.steps(from, to);
        // From coarse to fine, so that most collisions are soon found.
        let mut looked = vec![false; steps + 1];
        let mut stride = steps.next_power_of_two();
        while stride > 0 {
            for step in (0..=steps).step_by(stride) {
                if std::mem::replace(&mut looked[step], true) {
                    continue;
                }
                let share = step as f64 / steps as f64;
                let q: Vec<f64> = (from.iter().zip(to))
                    .map(|(from, to)| from + share * (to - from))
                    .collect();
                if !loads.iter().all(|load| self.is_clear(&q, load)) {
                    return false;
                }
            }
            stride /= 2;
        }
        true
    }

    /// Into how many steps a move is cut.
    fn steps(&self, from: &[f64], to: &[f64]) -> usize {
        let moved = (from.iter().zip(to)).map(|(from, to)| (to - from).abs());
        let farthest: f64 = moved.zip(&self.reach).map(|(by, reach)| by * reach).sum();
        let step = self.clearance_m.max(SHORTEST_STEP_M);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at least one; joint ranges and reaches are bounded"
        )]
        let steps = (farthest / step).ceil().max(1.0) as usize;
        steps
    }
}

/// For each joint, the largest distance of any point that it moves from its anchor: links are rigid, so that
/// anchors in turn are as far apart as they are in any configuration, but for what slides.
fn reach(task: &Task) -> Vec<f64> {
    let belief = &task.belief;
    let chain = &belief.nominal.chain;
    let joints = chain.len();
    let middle: Vec<f64> = (chain.joints.iter())
        .map(|joint| joint.drive.passive_at.unwrap_or(0.0))
        .collect();
    let state = chain.at(&belief.calibration_tool).state(&middle);
    let mut simulation = State::new(&belief.nominal.model);
    simulation.move_to(&middle);
    // What each link carries: the farthest point from its joint's anchor.
    let mut carried = vec![0.0_f64; joints];
    let model = &belief.nominal.model;
    for geometry in model.scenery() {
        let moved_by = model.joints_that_move(model.geometry_body(geometry.id));
        if let (Some(link), Some(radius)) = (moved_by.checked_sub(1), radius(&geometry.shape)) {
            let link = link.min(joints.saturating_sub(1));
            let centre = simulation.geometry_pose(geometry.id).translation.vector;
            let distance = (centre - state.anchor[link]).norm() + radius;
            carried[link] = carried[link].max(distance);
        }
    }
    let mut reach = vec![1.0; joints];
    let mut beyond = 0.0_f64;
    for joint in (0..joints).rev() {
        let [low, high] = chain.joints[joint].range_rad;
        let slides = chain.joints[joint].drive.slides;
        let next = state.anchor.get(joint + 1);
        let to_next = next.map_or(0.0, |next| (next - state.anchor[joint]).norm());
        let slide = if slides {
            high.abs().max(low.abs())
        } else {
            0.0
        };
        beyond = carried[joint].max(to_next + beyond) + slide;
        if !slides {
            reach[joint] = beyond;
        }
    }
    reach
}

/// The radius of a ball about a shape's origin that holds it (m); none for what has no end.
fn radius(shape: &Shape) -> Option<f64> {
    Some(match shape {
        Shape::Plane => return None,
        Shape::Sphere(radius) => *radius,
        Shape::Capsule(radius, half) => radius + half,
        Shape::Cylinder(radius, half) => radius.hypot(*half),
        Shape::Ellipsoid(axes) => axes.max(),
        Shape::Box(half) => half.norm(),
        Shape::Mesh(vertices, _) => (vertices.iter())
            .map(|[x, y, z]| f64::from(x * x + y * y + z * z).sqrt())
            .fold(0.0, f64::max),
    })
}
