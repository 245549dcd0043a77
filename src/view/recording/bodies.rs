//! What is drawn of the model.

use nalgebra::Isometry3;

use super::{Body, ShownTool, Surface, tool_name};
use crate::calibration::CalibrationError;
use crate::mujoco::{Geometry, Mesh, Model, Shape, State};
use crate::scenario::Scenario;
use crate::task::Instrument;

/// Geometries of the model in groups up to this one are drawn, as MuJoCo does by default.
pub const LAST_SHOWN_GROUP: i32 = 2;
/// The site where a model has its tracker.
const TRACKER: &str = "tracker";
/// The group of the tool that is not mounted; drawn where that tool is at work.
const UNMOUNTED_GROUP: i32 = 3;
/// What a plane looks like if its colour comes from a texture, which is not drawn.
const FLOOR_RGBA: [f32; 4] = [0.60, 0.62, 0.65, 1.0];

/// The bodies that stand still and those that the joints move, with their surfaces.
pub(super) fn bodies(scenario: &Scenario) -> Result<(Vec<Body>, Vec<Body>), CalibrationError> {
    let model = &scenario.truth.robot.model;
    let tool_body = |tool| -> Result<usize, CalibrationError> {
        Ok(model.site_body(model.site(tool_name(scenario, tool))?).0)
    };
    let calibration = tool_body(ShownTool::Calibration)?;
    let machining = tool_body(ShownTool::Machining)?;
    // A tool is unmounted only where it is a body of its own that does not carry the other.
    let only_with = |body| {
        let is_alone = |own: usize, other: usize| {
            body == own && ancestors(model, other).all(|carrier| carrier != body)
        };
        let of_calibration = is_alone(calibration, machining).then_some(ShownTool::Calibration);
        of_calibration.or(is_alone(machining, calibration).then_some(ShownTool::Machining))
    };
    let mut state = State::new(model);
    state.update_kinematics();
    let scenery = drawn(model, &scenario.task.belief.instrument, UNMOUNTED_GROUP);
    let (mut surroundings, mut links) = (Vec::new(), Vec::new());
    for id in 0..model.bodies() {
        let moves = is_moved(model, id);
        let world_from_frame = if moves {
            state.body_pose(id)
        } else {
            Isometry3::identity()
        };
        let shown = |each: &&Geometry| {
            model.geometry_body(each.id) == id
                && (each.group <= LAST_SHOWN_GROUP || only_with(id).is_some())
        };
        let surfaces: Vec<_> = (scenery.iter())
            .filter(shown)
            .map(|each| Surface {
                rgba: colour(each),
                mesh: Mesh::new(&each.shape)
                    .transformed(&world_from_frame.inv_mul(&state.geometry_pose(each.id))),
            })
            .collect();
        if surfaces.is_empty() {
            continue;
        }
        let body = Body {
            name: model.body_name(id),
            id,
            only_with: only_with(id),
            surfaces,
        };
        if moves { &mut links } else { &mut surroundings }.push(body);
    }
    Ok((surroundings, links))
}

/// What is drawn of a model in groups up to one: its tracker only where the scenario names the site.
pub fn drawn(model: &Model, instrument: &Instrument, last_group: i32) -> Vec<Geometry> {
    let tracker = model.site(TRACKER).ok();
    let tracker = tracker.filter(|_| instrument.tracker_site.is_none());
    let tracker = tracker.map(|site| model.site_body(site).0);
    let is_drawn = |each: &Geometry| {
        each.group <= last_group
            && tracker.is_none_or(|body| body == 0 || model.geometry_body(each.id) != body)
    };
    model.scenery().into_iter().filter(is_drawn).collect()
}

/// The model's colour, except that of a textured plane, which would be plain white.
fn colour(geometry: &Geometry) -> [f32; 4] {
    let white = geometry.rgba.iter().all(|share| *share >= 1.0);
    if geometry.shape == Shape::Plane && white {
        FLOOR_RGBA
    } else {
        geometry.rgba
    }
}

/// Whether a joint moves the body.
pub fn is_moved(model: &Model, body: usize) -> bool {
    ancestors(model, body).any(|body| model.joints_of(body).next().is_some())
}

/// A body, its parent, and so on up to the world, which is none of them.
fn ancestors(model: &Model, body: usize) -> impl Iterator<Item = usize> {
    let next = |body: &usize| Some(model.parent(*body));
    std::iter::successors(Some(body), next).take_while(|body| *body != 0)
}
