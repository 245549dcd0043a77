//! The robot in every configuration of a plan, as stills and the view that turns show it.

use nalgebra::{Isometry3, Point3, Vector3};

use super::STILL_PX;
use super::painter::Camera;
use crate::experiment::Candidate;
use crate::mujoco::{Geometry, Mesh, Shape, State};
use crate::plan::Plan;
use crate::robot::{SerialChain, Tool};
use crate::scenario::Scenario;
use crate::task::station_named;
use crate::view::recording::{LAST_SHOWN_GROUP, SightLine, drawn, is_moved};

/// How far above the horizontal the viewer stands (rad).
const ELEVATION: f64 = 0.33;
/// The length of the largest force's arrow (m).
const ARROW_M: f64 = 0.55;
/// Fixed things whose middle is nearer to axis 1 than this are always in the picture (m).
const NEAR_M: f64 = 1.0;
/// So much of a line of sight is in the picture, from what is read (m): the robot would be lost between it and a far instrument.
const LEAVES_M: f64 = 0.6;

/// What is drawn of the model, and where it is in each configuration of a plan.
pub struct Scenery {
    /// What is drawn.
    pub parts: Vec<ScenePart>,
    /// The configurations.
    pub scenes: Vec<Scene>,
}

/// A surface of the model.
pub struct ScenePart {
    /// In its own frame.
    pub mesh: Mesh,
    /// Red, green, blue and opacity in 0 to 1.
    pub rgba: [f32; 4],
    /// Whether a joint moves it.
    pub moves: bool,
    /// Whether it has to be in the picture: the robot, and what stands at its foot.
    pub is_robot: bool,
}

/// The robot in one configuration.
pub struct Scene {
    /// Where each part is in the world.
    pub poses: Vec<Isometry3<f64>>,
    /// Where the load acts (m).
    pub tool: Point3<f64>,
    /// Where the force's arrow ends (m).
    pub arrow_end: Point3<f64>,
    /// What is read (m).
    pub read: Point3<f64>,
    /// How that is read.
    pub sight: Option<SightLine>,
    /// The name of the station that the instrument stands at, if the plan says so: the model has nothing there.
    pub station: Option<String>,
}

impl Scenery {
    /// Of a plan; of absolute readings, `rows` say what is read in each experiment, and from where.
    pub fn new(scenario: &Scenario, plan: &Plan, rows: &[&Candidate]) -> Self {
        let robot = &scenario.task.belief.nominal;
        let calibration = &scenario.task.belief.calibration_tool;
        let instrument = &scenario.task.belief.instrument;
        let mut shown = drawn(&robot.model, instrument, LAST_SHOWN_GROUP);
        shown.retain(|each| each.shape != Shape::Plane);
        let largest_n = (plan.experiments.iter())
            .map(|each| each.load.force_n.norm())
            .fold(f64::MIN_POSITIVE, f64::max);
        let mut state = State::new(&robot.model);
        let mut scenes = Vec::new();
        for (index, experiment) in plan.experiments.iter().enumerate() {
            let q = experiment.configuration_rad.as_slice();
            let place = |tool: &Tool| Point3::from(robot.chain.at(tool).state(q).tool_position);
            let row = rows.get(index);
            let target =
                row.and_then(|row| SerialChain::tool(&robot.model, row.target.as_ref()?).ok());
            let station = row.and_then(|row| {
                station_named(&scenario.task.belief.stations, row.station.as_deref())
            });
            let tool = place(calibration);
            let read = target.as_ref().map_or(tool, place);
            state.move_to(q);
            // Where no station has a place of its own, the model's tracker is where all are.
            let from_m = station.map(|station| station.sees_from(&read.coords));
            let sight = SightLine::new(
                instrument,
                &state,
                read.coords,
                experiment.direction,
                from_m,
            );
            scenes.push(Scene {
                poses: shown
                    .iter()
                    .map(|each| state.geometry_pose(each.id))
                    .collect(),
                arrow_end: tool + experiment.load.force_n * (ARROW_M / largest_n),
                tool,
                read,
                sight,
                station: station.map(|station| station.name.clone()),
            });
        }
        let part = |each: &Geometry| {
            let moves = is_moved(&robot.model, robot.model.geometry_body(each.id));
            let pose = state.geometry_pose(each.id);
            let mesh = Mesh::new(&each.shape);
            let is_near = |corner: &Point3<f64>| (pose * corner).xy().coords.norm() < NEAR_M;
            ScenePart {
                is_robot: moves || mesh.vertices.iter().all(is_near),
                mesh,
                rgba: each.rgba,
                moves,
            }
        };
        Self {
            parts: shown.iter().map(part).collect(),
            scenes,
        }
    }

    /// The parts as they are in a scene, in world coordinates.
    pub fn surfaces(&self, scene: &Scene) -> impl Iterator<Item = (&ScenePart, Mesh)> {
        (self.parts.iter().zip(&scene.poses))
            .map(|(part, pose)| (part, part.mesh.clone().transformed(pose)))
    }

    /// A camera that sees all scenes alike, from the side that shows the arms at their widest.
    pub fn camera(&self) -> Camera {
        let margin = Vector3::repeat(0.12);
        let spread: Vec<_> = (self.framed().iter())
            .flat_map(|point| [point + margin, point - margin])
            .collect();
        Camera::new(self.azimuth(), ELEVATION, &spread, STILL_PX)
    }

    /// The side that shows the arms at their widest (rad).
    fn azimuth(&self) -> f64 {
        let reach = |azimuth: f64| -> f64 {
            let across = Vector3::new(-azimuth.sin(), azimuth.cos(), 0.0);
            (self.scenes.iter())
                .map(|scene| scene.tool.coords.dot(&across).abs())
                .sum()
        };
        // The first of equals: with the arm along x, from the right and a little from the front.
        (0..8)
            .map(|step| (f64::from(step) * 45.0 - 70.0).to_radians())
            .reduce(|best, other| {
                if reach(other) > reach(best) * 1.01 {
                    other
                } else {
                    best
                }
            })
            .unwrap_or(0.0)
    }

    /// What has to be in the picture.
    fn framed(&self) -> Vec<Point3<f64>> {
        let mut points = vec![Point3::origin()];
        for scene in &self.scenes {
            for (_, mesh) in self.surfaces(scene).filter(|(part, _)| part.is_robot) {
                points.extend(&mesh.vertices);
            }
            // A place for the arrows.
            points.extend([scene.arrow_end, scene.read]);
            for end in scene.sight.iter().flat_map(|sight| sight.ends_m) {
                let away = end - scene.read.coords;
                points.push(scene.read + away * (LEAVES_M / away.norm()).min(1.0));
            }
        }
        points
    }
}
