//! Reads the serial chain from a compiled MJCF model.

use nalgebra::{Isometry3, Unit, UnitQuaternion, Vector3};

use super::chain::{Drive, Joint, SerialChain, Tool};
use super::elements::{Elements, JointSpring, Offset, Place, Spring};
use crate::files::FileError;
use crate::mujoco::Model;

/// Where each body of the model is fixed: the number of joints between it and the world, and its
/// frame in that of the link that carries it.
struct Mount {
    joints: usize,
    link_from_body: Isometry3<f64>,
}

impl SerialChain {
    /// Reads the arm from a model: every joint that is not locked must be a hinge or a slide, and each
    /// must move the next.
    ///
    /// # Errors
    /// The joints are not hinges and slides in one series, or the model has an element that can move the arm's rest and that
    /// the chain does not know.
    pub fn from_model(model: &Model) -> Result<Self, FileError> {
        let mut joints = Vec::new();
        let mounts = mounts(model, &mut joints)?;
        if joints.is_empty() {
            return Err(model.not_serial("it has no joint"));
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
        let chain = Self {
            joints,
            gravity_m_s2: model.gravity(),
            elements: elements(model, &mounts),
        };
        if chain.commanded().next().is_none() {
            return Err(model.not_serial("no joint is actuated"));
        }
        Ok(chain)
    }

    /// Reads a tool frame: a site of the model.
    ///
    /// # Errors
    /// The model has no site of that name, the arm is not serial, or no joint moves the site.
    pub fn tool(model: &Model, site: &str) -> Result<Tool, FileError> {
        let (body, body_from_site) = model.site_body(model.site(site)?);
        Self::frame(model, site, body, body_from_site)
    }

    /// The frame of a body.
    ///
    /// # Errors
    /// The arm is not serial, or no joint moves the body.
    pub fn on_body(model: &Model, body: usize) -> Result<Tool, FileError> {
        Self::frame(model, &model.body_name(body), body, Isometry3::identity())
    }

    /// A frame in that of a body.
    fn frame(
        model: &Model,
        name: &str,
        body: usize,
        body_from_frame: Isometry3<f64>,
    ) -> Result<Tool, FileError> {
        let mounts = mounts(model, &mut Vec::new())?;
        let mount = &mounts[body];
        if mount.joints == 0 {
            return Err(model.not_serial(format!("no joint moves the site {name:?}")));
        }
        Ok(Tool {
            name: name.to_owned(),
            joints: mount.joints,
            link_from_tool: mount.link_from_body * body_from_frame,
        })
    }
}

/// Walks the bodies from the world outwards, appends the joints that it meets, and says where each
/// body is mounted.
fn mounts(model: &Model, joints: &mut Vec<Joint>) -> Result<Vec<Mount>, FileError> {
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
            let slides = model.is_slide(joint);
            let (axis, anchor) = model.joint_axis_and_anchor(joint);
            let axis = Unit::new_normalize(axis);
            // MuJoCo's bodies stand as drawn where the coordinate equals the reference.
            let reference = model.joint_reference(joint);
            if let Some(locked) = model.locked_at(joint) {
                mount.link_from_body *= displaced(slides, &axis, &anchor, locked - reference);
                continue;
            }
            if !slides && !model.is_hinge(joint) {
                let reason = format!("joint {name:?} is neither a hinge nor a slide");
                return Err(model.not_serial(reason));
            }
            if mount.joints != joints.len() {
                let reason = format!(
                    "joint {name:?} branches off before {:?}; a scenario locks side branches (robot.locked_deg, robot.locked_mm)",
                    joints.last().map_or("", |last| last.name.as_str())
                );
                return Err(model.not_serial(reason));
            }
            let body_from_link = if slides {
                (anchor - axis.into_inner() * reference).into()
            } else {
                let turn_back = UnitQuaternion::from_axis_angle(&axis, -reference);
                Isometry3::from_parts(anchor.into(), turn_back)
            };
            let passive_at = (!model.is_actuated(joint))
                .then(|| model.joint_spring(joint).map(|[_, rest]| rest))
                .flatten();
            joints.push(Joint {
                name,
                previous_from_link: mount.link_from_body * body_from_link,
                axis,
                drive: Drive { slides, passive_at },
                range_rad: passive_at.map_or_else(|| model.joint_range(joint), |rest| [rest; 2]),
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

/// How a joint displaces its body.
fn displaced(
    slides: bool,
    axis: &Unit<Vector3<f64>>,
    anchor: &Vector3<f64>,
    by: f64,
) -> Isometry3<f64> {
    if slides {
        return (axis.into_inner() * by).into();
    }
    let turn = UnitQuaternion::from_axis_angle(axis, by);
    Isometry3::from_parts((anchor - turn * anchor).into(), turn)
}

/// What pulls at the joints beside their own elasticity.
fn elements(model: &Model, mounts: &[Mount]) -> Elements {
    let mut elements = Elements::default();
    let moving = (0..model.joints()).filter(|&joint| model.locked_at(joint).is_none());
    for (index, joint) in moving.enumerate() {
        let force = model.joint_offset(joint);
        if force != 0.0 {
            elements.offsets.push(Offset {
                joint: index,
                force,
            });
        }
        if let (true, Some([stiffness, rest])) =
            (model.is_actuated(joint), model.joint_spring(joint))
        {
            elements.joint_springs.push(JointSpring {
                joint: index,
                stiffness,
                rest,
            });
        }
    }
    for spring in model.tendon_springs() {
        let places = spring.sites.iter().map(|&site| {
            let (body, body_from_site) = model.site_body(site);
            let mount = &mounts[body];
            Place {
                joints: mount.joints,
                position_m: (mount.link_from_body * body_from_site).translation.vector,
            }
        });
        elements.springs.push(Spring {
            path: places.collect(),
            name: spring.name,
            stiffness_n_per_m: spring.stiffness_n_per_m,
            rest_m: spring.rest_m,
        });
    }
    elements
}
