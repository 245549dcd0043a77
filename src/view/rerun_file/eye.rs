//! From where the viewer shows the scene: robot, loads and tracker fill the view, whatever their size.

use nalgebra::Vector3;

use crate::view::recording::{Recording, Step};

/// Half the viewer's angle of view, from bottom to top (rad).
const HALF_VIEW_RAD: f64 = 55.0 / 2.0 * std::f64::consts::PI / 180.0;
/// The view is at least so wide for its height in the layouts here.
const ASPECT: f64 = 1.25;
/// This share of the view is filled; what is left has labels and edges of bodies.
const FILLED: f64 = 0.88;
/// How far above the scene's middle the eye is, seen from there.
const ELEVATION_RAD: f64 = 0.42;
/// How far the eye is turned from the side of the robot's line to the tracker, towards the robot.
const TURNED_RAD: f64 = 0.3;
/// A tracker's head about its centre (m).
const TRACKER_M: f64 = 0.25;

/// From where the scene is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Eye {
    /// The eye's place (m).
    pub(super) position_m: Vector3<f64>,
    /// What it looks at (m).
    pub(super) target_m: Vector3<f64>,
}

impl Eye {
    /// A place from which the arm, its loads and the tracker are seen in all steps of the main calibration: random plans
    /// reach farther, and would make everything small.
    pub(super) fn of(recording: &Recording) -> Self {
        let points = points(recording);
        Self::fitted(&points, forward(recording))
    }

    /// The nearest eye with a direction of sight (a unit vector that is not vertical) that has all points (m) in view.
    fn fitted(points: &[Vector3<f64>], forward: Vector3<f64>) -> Self {
        if points.is_empty() {
            return Self {
                position_m: -forward,
                target_m: Vector3::zeros(),
            };
        }
        let right = forward.cross(&Vector3::z()).normalize();
        let up = right.cross(&forward);
        let upwards = HALF_VIEW_RAD.tan() * FILLED;
        // A side of the view is a plane through the eye: the farthest point beyond it says where it may be.
        let farthest = |side: Vector3<f64>, slope: f64| {
            let beyond = (points.iter()).map(|point| point.dot(&(side - slope * forward)));
            beyond.fold(f64::MIN, f64::max)
        };
        let between = |side: Vector3<f64>, slope: f64| {
            let (one, other) = (farthest(side, slope), farthest(-side, slope));
            // Where both planes meet, and how far along the sight.
            ((one - other) / 2.0, -(one + other) / (2.0 * slope))
        };
        let (across, behind) = between(right, upwards * ASPECT);
        let (above, below) = between(up, upwards);
        let along = behind.min(below);
        let position_m = across * right + above * up + along * forward;
        let middle: Vector3<f64> = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
        let depth = (middle - position_m).dot(&forward).max(0.1);
        Self {
            position_m,
            target_m: position_m + depth * forward,
        }
    }
}

fn main_steps(recording: &Recording) -> impl Iterator<Item = &Step> {
    (recording.calibrations.first().into_iter()).flat_map(|calibration| &calibration.steps)
}

/// Where the eye looks to: across the line from robot to tracker, from the side to which the tools are.
fn forward(recording: &Recording) -> Vector3<f64> {
    let flat = |vector: Vector3<f64>| Vector3::new(vector.x, vector.y, 0.0);
    let base = (main_steps(recording))
        .find_map(|step| step.unloaded.world_from_link.first())
        .map_or_else(Vector3::zeros, |pose| pose.translation.vector);
    let line = (recording.tracker_m)
        .and_then(|tracker_m| flat(tracker_m - base).try_normalize(1e-3))
        .unwrap_or_else(Vector3::x);
    let mut side = line.cross(&Vector3::z());
    let towards_tools: f64 = (main_steps(recording))
        .map(|step| (step.unloaded.tool_m - base).dot(&side))
        .sum();
    if towards_tools < 0.0 {
        side = -side;
    }
    let from = side * TURNED_RAD.cos() - line * TURNED_RAD.sin();
    -(from * ELEVATION_RAD.cos() + Vector3::z() * ELEVATION_RAD.sin())
}

/// What is to be seen: the surface of each link in each step, the force's arrow, and the tracker with its stand.
fn points(recording: &Recording) -> Vec<Vector3<f64>> {
    let mut points = Vec::new();
    for step in main_steps(recording) {
        for stance in [&step.unloaded, &step.enlarged] {
            let shown = (recording.links.iter().zip(&stance.world_from_link))
                .filter(|(body, _)| body.only_with.is_none_or(|tool| tool == step.tool()));
            points.extend(shown.flat_map(|(body, pose)| {
                let vertices = body
                    .surfaces
                    .iter()
                    .flat_map(|surface| &surface.mesh.vertices);
                vertices.map(move |vertex| (pose * vertex).coords)
            }));
            points.push(stance.tool_m);
        }
        points.extend(arrow_tip(recording, step));
    }
    let floor_m = points.iter().map(|point| point.z).fold(f64::MAX, f64::min);
    if let Some(tracker_m) = recording.tracker_m {
        points.push(tracker_m + TRACKER_M * Vector3::z());
        points.push(Vector3::new(
            tracker_m.x,
            tracker_m.y,
            floor_m.min(tracker_m.z),
        ));
    }
    points
}

fn arrow_tip(recording: &Recording, step: &Step) -> Option<Vector3<f64>> {
    (recording.force_arrow_m(step)).map(|force| step.enlarged.tool_m + force)
}

#[cfg(test)]
mod tests {
    use super::{ASPECT, Eye, FILLED, HALF_VIEW_RAD, forward, points};
    use crate::calibration::calibrate;
    use crate::experiment::read_plan;
    use crate::scenario::Scenario;
    use crate::view::recording::Recording;
    use nalgebra::Vector3;

    /// Places in the view: from -1 at its left and lower edges to 1 at the others.
    fn seen(eye: &Eye, points: &[Vector3<f64>]) -> Vec<[f64; 2]> {
        let forward = (eye.target_m - eye.position_m).normalize();
        let right = forward.cross(&Vector3::z()).normalize();
        let up = right.cross(&forward);
        let place = |point: &Vector3<f64>| {
            let from = point - eye.position_m;
            let depth = from.dot(&forward);
            assert!(depth > 0.0, "a point is behind the eye");
            let half = HALF_VIEW_RAD.tan() * depth;
            [from.dot(&right) / half / ASPECT, from.dot(&up) / half]
        };
        points.iter().map(place).collect()
    }

    /// How much of the view points take, across and upwards; none is outside.
    fn filled(eye: &Eye, points: &[Vector3<f64>]) -> [f64; 2] {
        let places = seen(eye, points);
        [0, 1].map(|axis| {
            let values = || places.iter().map(|place| place[axis]);
            let (low, high) = (
                values().fold(f64::MAX, f64::min),
                values().fold(f64::MIN, f64::max),
            );
            assert!(low > -1.0 && high < 1.0, "{low} to {high}");
            (high - low) / 2.0
        })
    }

    #[test]
    fn the_nearest_eye_touches_two_opposite_sides() {
        let cloud: Vec<Vector3<f64>> = (0..60)
            .map(|i| f64::from(i) * 1.7)
            .map(|t| Vector3::new(3.0 * t.sin(), 0.5 * (2.3 * t).cos(), 1.0 + (0.7 * t).sin()))
            .collect();
        for forward in [[0.2, 1.0, -0.3], [1.0, 0.1, 0.0], [-1.0, -2.0, 0.8]] {
            let forward = Vector3::from(forward).normalize();
            for scale in [0.01, 1.0, 50.0] {
                let points: Vec<_> = cloud.iter().map(|point| point * scale).collect();
                let filled = filled(&Eye::fitted(&points, forward), &points);
                assert!(
                    (filled[0].max(filled[1]) - FILLED).abs() < 1e-9,
                    "{filled:?}"
                );
            }
        }
        let nothing = Eye::fitted(&[], Vector3::x());
        assert!(nothing.position_m != nothing.target_m);
    }

    /// Robot, loads and tracker are in view in every step, and fill it.
    #[test]
    fn robot_and_tracker_fill_the_view() -> Result<(), Box<dyn std::error::Error>> {
        for (scenario, plan) in [
            ("kr270", Some("klimchik2012_m3")),
            ("klimchik2012", Some("klimchik2012_m12")),
        ] {
            let scenario = Scenario::load(format!("scenarios/{scenario}.toml").as_ref())?;
            let commands = scenario.task.belief.commands();
            let plan = plan.map(|plan| format!("scenarios/plans/{plan}.csv"));
            let plan = read_plan(plan.unwrap_or_default().as_ref(), commands)?;
            let calibration = calibrate(&scenario.task, &scenario.truth, &plan, 1, 0)?;
            let recording = Recording::new(&scenario, &[("plan".to_owned(), calibration)])?;
            let shown = points(&recording);
            let eye = Eye::of(&recording);
            let [across, upwards] = filled(&eye, &shown);
            assert!(across > 0.6 && upwards > 0.5, "{across}, {upwards}");
            // From above the floor, and the tracker is no nearer than the robot: it hides nothing.
            assert!(eye.position_m.z > 0.5);
            if let Some(tracker_m) = recording.tracker_m {
                let forward = forward(&recording);
                let base = recording.steps().next().ok_or("a step")?.2;
                let base = base.unloaded.world_from_link[0].translation.vector;
                assert!((tracker_m - base).dot(&forward) > 0.0);
            }
        }
        Ok(())
    }
}
