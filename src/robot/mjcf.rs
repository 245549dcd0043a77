//! Reads the serial chain from a compiled MJCF model.

use nalgebra::{Isometry3, Unit, UnitQuaternion, Vector3};

use super::chain::{Joint, SerialChain, Tool};
use crate::mujoco::{Model, ModelError};

/// Where each body of the model is fixed: the number of joints between it and the world, and its
/// frame in that of the link that carries it.
struct Mount {
    joints: usize,
    link_from_body: Isometry3<f64>,
}

impl SerialChain {
    /// Reads the arm from a model: every joint must be a hinge and each must move the next.
    ///
    /// # Errors
    /// [`ModelError::NotSerial`] if the joints are not hinges in one series, [`ModelError::Statics`] if
    /// the model has an element that can move the arm's rest and that the chain does not know.
    pub fn from_model(model: &Model) -> Result<Self, ModelError> {
        let mut joints = Vec::new();
        let mounts = mounts(model, &mut joints)?;
        if joints.is_empty() {
            return Err(not_serial(model, "it has no joint".to_owned()));
        }
        model.check_statics()?;
        let mut first_moment = vec![Vector3::zeros(); joints.len()];
        for (body, mount) in mounts.iter().enumerate() {
            let Some(link) = mount.joints.checked_sub(1) else {
                continue;
            };
            let (mass, centre) = model.mass(body);
            let mass = mass * model.weighing_share(body);
            joints[link].mass_kg += mass;
            first_moment[link] +=
                (mount.link_from_body * nalgebra::Point3::from(centre)).coords * mass;
        }
        for (joint, moment) in joints.iter_mut().zip(first_moment) {
            if joint.mass_kg > 0.0 {
                joint.centre_of_mass_m = moment / joint.mass_kg;
            }
        }
        Ok(Self {
            joints,
            gravity_m_s2: model.gravity(),
        })
    }

    /// Reads a tool frame: a site of the model.
    ///
    /// # Errors
    /// The model has no site of that name, the arm is not serial, or no joint moves the site.
    pub fn tool(model: &Model, site: &str) -> Result<Tool, ModelError> {
        let (body, body_from_site) = model.site_body(model.site(site)?);
        let mounts = mounts(model, &mut Vec::new())?;
        let mount = &mounts[body];
        if mount.joints == 0 {
            return Err(not_serial(
                model,
                format!("no joint moves the site {site:?}"),
            ));
        }
        Ok(Tool {
            name: site.to_owned(),
            joints: mount.joints,
            link_from_tool: mount.link_from_body * body_from_site,
        })
    }
}

/// Walks the bodies from the world outwards, appends the joints that it meets, and says where each
/// body is mounted.
fn mounts(model: &Model, joints: &mut Vec<Joint>) -> Result<Vec<Mount>, ModelError> {
    let mut mounts: Vec<Mount> = vec![Mount {
        joints: 0,
        link_from_body: Isometry3::identity(),
    }];
    for body in 1..model.bodies() {
        let parent = &mounts[model.parent(body)];
        let mut mount = Mount {
            joints: parent.joints,
            link_from_body: parent.link_from_body * model.parent_from_body(body),
        };
        for joint in model.joints_of(body) {
            let name = model.joint_name(joint);
            if !model.is_hinge(joint) {
                return Err(not_serial(model, format!("joint {name:?} is not a hinge")));
            }
            if mount.joints != joints.len() {
                let reason = format!(
                    "joint {name:?} branches off before {:?}",
                    joints.last().map_or("", |last| last.name.as_str())
                );
                return Err(not_serial(model, reason));
            }
            let (axis, anchor) = model.joint_axis_and_anchor(joint);
            let axis = Unit::new_normalize(axis);
            // MuJoCo's bodies stand as drawn where the coordinate equals the reference.
            let turn_back = UnitQuaternion::from_axis_angle(&axis, -model.joint_reference(joint));
            let body_from_link = Isometry3::from_parts(anchor.into(), turn_back);
            joints.push(Joint {
                name,
                previous_from_link: mount.link_from_body * body_from_link,
                axis,
                range_rad: model.joint_range(joint),
                mass_kg: 0.0,
                centre_of_mass_m: Vector3::zeros(),
                model_compliance_rad_per_nm: model.joint_compliance(joint),
            });
            mount.joints = joints.len();
            mount.link_from_body =
                Isometry3::from_parts((-anchor).into(), UnitQuaternion::identity());
        }
        mounts.push(mount);
    }
    Ok(mounts)
}

fn not_serial(model: &Model, reason: String) -> ModelError {
    ModelError::NotSerial {
        path: model.path().to_owned(),
        reason,
    }
}
