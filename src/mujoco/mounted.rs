//! What a scenario mounts on the robot: tools and payloads, added to a model when it is loaded.

use mujoco_rs::prelude::MjSpec;
use mujoco_rs::wrappers::mj_editing::{MjsBody, MjtInertiaFromGeom, SpecItem};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::error::unsuitable;
use super::{Model, Obstacle};
use crate::files::FileError;
use crate::text::wrong_name;

/// What the names begin with of what a calibrated model keeps: texts, and payloads.
pub const KEPT: &str = "elastocal_";

/// A tool: a frame that becomes a site of the model.
#[derive(Debug, Clone, PartialEq)]
pub struct MountedTool {
    /// The name of the new site.
    pub name: String,
    /// The body or site that it is mounted on.
    pub on: String,
    /// Its frame in that of the body or site.
    pub from_tool: Isometry3<f64>,
}

/// A mass that is fixed to a body.
#[derive(Debug, Clone, PartialEq)]
pub struct MountedPayload {
    /// The body or site that carries it.
    pub on: String,
    /// Its mass (kg).
    pub mass_kg: f64,
    /// Its centre in the frame of the body or site (m).
    pub centre_m: Vector3<f64>,
}

/// All that a scenario adds to a model.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Additions {
    /// What stands in the laboratory.
    pub obstacles: Vec<Obstacle>,
    /// Tools.
    pub tools: Vec<MountedTool>,
    /// Payloads.
    pub payloads: Vec<MountedPayload>,
}

impl Additions {
    /// Whether nothing is added.
    pub fn is_empty(&self) -> bool {
        self.obstacles.is_empty() && self.tools.is_empty() && self.payloads.is_empty()
    }
}

impl Model {
    /// The element of a body in the file, by its name or that of a site on it, and the frame of what was named in the body's.
    fn carrier<'s>(
        &self,
        spec: &'s mut MjSpec,
        name: &str,
    ) -> Result<(&'s mut MjsBody, Isometry3<f64>), FileError> {
        let (body, body_from) = self.body_or_site(name)?;
        let body = self.body_name(body);
        let found = spec.body_mut(&body).ok_or_else(|| {
            let problem = format!("the body {body:?} has no name in the file");
            unsuitable(self.path(), problem).hint("give it one, or a site, to carry a tool")
        });
        Ok((found?, body_from))
    }

    /// A body by its name or that of a site on it, and the frame of what was named in the body's.
    ///
    /// # Errors
    /// There is neither.
    pub fn body_or_site(&self, name: &str) -> Result<(usize, Isometry3<f64>), FileError> {
        if let Some(body) = self.body(name) {
            return Ok((body, Isometry3::identity()));
        }
        let site = self.site(name).map_err(|error| {
            let bodies = (1..self.bodies()).map(|body| self.body_name(body));
            let bodies = bodies.collect::<Vec<_>>().join(", ");
            let problem = format!(
                "{}; nor a body of that name; bodies: {bodies}",
                error.problem
            );
            FileError { problem, ..error }
        })?;
        Ok(self.site_body(site))
    }

    /// The model, whose payloads weigh what was added.
    pub(super) fn with_whole(self, payloads: &[MountedPayload]) -> Result<Self, FileError> {
        for (payload, number) in payloads.iter().zip(1..) {
            let body = self.body(&format!("{KEPT}payload_{number}"));
            let mass_kg = body.map_or(0.0, |body| self.inner.body_mass()[body]);
            if (mass_kg - payload.mass_kg).abs() > 1e-9 * payload.mass_kg {
                let problem = format!(
                    "the compiler's settotalmass or boundmass makes the payload of {} kg one of {mass_kg:.3} kg: give the links \
                     their masses in its place",
                    payload.mass_kg
                );
                return Err(unsuitable(self.path(), problem));
            }
        }
        Ok(self)
    }

    /// Adds tools and payloads to the file's elements; the model is what the file says alone.
    pub(super) fn mount(&self, spec: &mut MjSpec, additions: &Additions) -> Result<(), FileError> {
        let failed = |message: String| unsuitable(self.path(), message);
        for tool in &additions.tools {
            if let Some(problem) = wrong_name(&tool.name) {
                return Err(failed(problem));
            }
            if self.site(&tool.name).is_ok() {
                return Err(failed(format!(
                    "it has a site named {:?} already: leave the tool of that name out of the scenario, or name it \
                     otherwise",
                    tool.name
                )));
            }
            let (body, body_from) = self.carrier(spec, &tool.on)?;
            let frame = body_from * tool.from_tool;
            let [x, y, z, w] = frame.rotation.coords.into();
            let site = body.add_site();
            site.set_name(&tool.name)
                .map_err(|error| failed(format!("{}: {error}", tool.name)))?;
            site.with_pos(frame.translation.vector.into())
                .with_quat([w, x, y, z])
                .with_group(4);
        }
        let names = (1..self.bodies()).filter_map(|body| self.named_body(body));
        let mut own = names.filter(|name| name.starts_with(&format!("{KEPT}payload_")));
        if let (Some(name), false) = (own.next(), additions.payloads.is_empty()) {
            return Err(failed(format!(
                "the payload that it was exported with is a body of it ({name}): leave [[robot.payload]] out of the \
                 scenario, or remove that body"
            )));
        }
        if !additions.payloads.is_empty() {
            weigh_by_geometry(spec);
        }
        for (payload, number) in additions.payloads.iter().zip(1..) {
            let (body, body_from) = self.carrier(spec, &payload.on)?;
            let centre = body_from * Point3::from(payload.centre_m);
            // A point is no body to MuJoCo: a decimetre's radius of gyration, which no rest sees.
            let inertia = payload.mass_kg * 1e-2;
            let own = body.add_body();
            own.set_name(&format!("{KEPT}payload_{number}"))
                .map_err(|error| failed(error.to_string()))?;
            own.with_pos(centre.coords.into())
                // Without its own, it would be the frame's position a second time.
                .with_ipos([0.0; 3])
                .with_iquat([1.0, 0.0, 0.0, 0.0])
                .with_mass(payload.mass_kg)
                .with_inertia([inertia; 3])
                .with_explicitinertial(true);
        }
        Ok(())
    }
}

/// Where geometries alone say what weighs, whatever else bodies say, bodies say nothing else from now on: a payload has no geometry.
fn weigh_by_geometry(spec: &mut MjSpec) {
    if spec.compiler().inertiafromgeom() != MjtInertiaFromGeom::mjINERTIAFROMGEOM_TRUE {
        return;
    }
    (spec.compiler_mut()).set_inertiafromgeom(MjtInertiaFromGeom::mjINERTIAFROMGEOM_AUTO);
    forget_inertials(spec.world_body_mut());
}

fn forget_inertials(body: &mut MjsBody) {
    for each in body.body_iter_mut() {
        each.with_ipos([f64::NAN; 3]).with_explicitinertial(false);
        forget_inertials(each);
    }
}

/// A frame from a position (m) and roll, pitch and yaw (rad): about the fixed x, then y, then z axis.
pub fn frame(position_m: Vector3<f64>, [roll, pitch, yaw]: [f64; 3]) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(position_m),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}
