//! The tables `[robot]` and `[true_robot]`: models, joints, tools and compliances.

use std::path::Path;

use super::Checker;
use super::additions::Locked;
use super::number::names_of;
use crate::codes::ErrorCode;
use crate::files::{FileError, read_text};
use crate::mujoco::{Additions, Model, sources};
use crate::parameter::ParameterKind;
use crate::quantities::limits::MOST_JOINTS;
use crate::quantities::plausible::{ANGLE, COMPLIANCE, GRAVITY, Kind, MASS, POSITION};
use crate::robot::{Joint, KnownJoint, Robot, SerialChain, Tool, TrueRobot};
use crate::scenario::file::{Actuators, File};
use crate::task::{AccuracyKind, Belief};

/// A locked joint may be outside of its range by as much (rad, m).
const ROUNDING: f64 = 1e-9;

impl Checker<'_> {
    /// The model in its laboratory.
    pub(super) fn model(
        &self,
        key: &str,
        path: &Path,
        additions: &Additions,
    ) -> Result<Model, FileError> {
        let path = self.resolve(path);
        // The same checks, and the same words, as for every other file.
        read_text(&path).map_err(|error| self.named_file(key, error))?;
        let wrong = |error: FileError| self.named_file(key, error);
        let model = Model::load_with(&path, additions).map_err(wrong)?;
        for file in sources(&path).map_err(wrong)? {
            self.inputs.borrow_mut().add(&file)?;
        }
        Ok(model)
    }

    /// The belief's model with its locked joints.
    pub(super) fn lock(&self, model: &Model, locked: &[Locked]) -> Result<Model, FileError> {
        for Locked {
            joint,
            key,
            unit,
            at,
        } in locked
        {
            let index = (model.joint(joint)).map_err(|error| self.named_file(key, error))?;
            let slides = model.is_slide(index);
            if slides || model.is_hinge(index) {
                self.check_unit(key, joint, slides, unit, "deg")?;
                let [low, high] = model.joint_range(index);
                if !(low - ROUNDING..=high + ROUNDING).contains(at) {
                    let shown = |si: f64| if slides { si * 1e3 } else { si.to_degrees() };
                    let [found, low, high] = [*at, low, high].map(shown);
                    let problem = format!(
                        "found {found:.3}; the model's range of {joint:?} is {low:.3} to {high:.3} {unit}"
                    );
                    return Err(self.wrong(key, problem));
                }
            }
        }
        let pairs: Vec<(String, f64)> = (locked.iter())
            .map(|each| (each.joint.clone(), each.at))
            .collect();
        let key = locked.first().map_or("robot.model", |each| &each.key);
        (model.with_locked(&pairs)).map_err(|error| self.named_file(key, error))
    }

    /// The arm, with plausible numbers.
    pub(super) fn serial_chain(&self, key: &str, model: &Model) -> Result<SerialChain, FileError> {
        let chain = SerialChain::from_model(model).map_err(|error| self.named_file(key, error))?;
        self.at_most(key, chain.len(), MOST_JOINTS)?;
        let path = model.path().display();
        let check = |whose: &str, what: &str, kind: &Kind, values: &[f64]| {
            values.iter().try_for_each(|&value| {
                let wrong = |problem| self.wrong(key, format!("{path}: {whose}{what}: {problem}"));
                kind.check(value).map(drop).map_err(wrong)
            })
        };
        check("", "gravity", &GRAVITY, chain.gravity_m_s2.as_slice())?;
        for joint in &chain.joints {
            let whose = format!("joint {:?}: ", joint.name);
            let place_mm = joint.previous_from_link.translation.vector * 1e3;
            let centre_mm = joint.centre_of_mass_m * 1e3;
            let compliance = joint.model_compliance_rad_per_nm;
            let range = joint.range_rad.map(|end| joint.drive.shown(end).0);
            check(&whose, "its place", &POSITION, place_mm.as_slice())?;
            let turn = &joint.previous_from_link.rotation.coords;
            if !joint.axis.iter().chain(turn).all(|value| value.is_finite()) {
                let problem = format!("{path}: {whose}its axis or orientation is not a number");
                return Err(self.wrong(key, problem));
            }
            check(&whose, "mass that it moves", &MASS, &[joint.mass_kg])?;
            check(&whose, "centre of mass", &POSITION, centre_mm.as_slice())?;
            check(&whose, "range", &ANGLE, &range)?;
            check(&whose, "compliance", &COMPLIANCE, compliance.as_slice())?;
        }
        Ok(chain)
    }

    pub(super) fn tool(&self, key: &str, model: &Model, site: &str) -> Result<Tool, FileError> {
        let tool = SerialChain::tool(model, site).map_err(|error| self.named_file(key, error))?;
        let place_mm = tool.link_from_tool.translation.vector * 1e3;
        for &value in &place_mm {
            self.number(key, value, &POSITION)?;
        }
        let mut turn = tool.link_from_tool.rotation.coords.iter();
        if !turn.all(|value| value.is_finite()) {
            let problem = format!("the orientation of site {site:?} is not a number");
            return Err(self.wrong(key, problem));
        }
        Ok(tool)
    }

    pub(super) fn compliances(
        &self,
        key: &str,
        chain: &SerialChain,
        given: Option<&[f64]>,
    ) -> Result<Vec<f64>, FileError> {
        if let Some(values) = given {
            let own = chain
                .joints
                .iter()
                .map(|joint| joint.model_compliance_rad_per_nm);
            let own = own.map(Option::unwrap_or_default).collect();
            return self.given_compliances(key, chain, values, own);
        }
        let own = |joint: &Joint| {
            joint.model_compliance_rad_per_nm.ok_or_else(|| {
                let problem = format!(
                    "is missing, and the model gives joint {:?} no position actuator whose gain is its stiffness",
                    joint.name
                );
                self.wrong(key, problem)
            })
        };
        chain.joints.iter().map(own).collect()
    }

    /// Passive joints have what is their own, where only commanded ones are given.
    fn given_compliances(
        &self,
        key: &str,
        chain: &SerialChain,
        values: &[f64],
        own: Vec<f64>,
    ) -> Result<Vec<f64>, FileError> {
        if values.len() == chain.len() {
            let all = self.one_per_joint(key, values, chain.len())?;
            return Ok(all.to_vec());
        }
        self.one_per_command(key, values, chain, own)
    }

    /// The joints whose compliances are to be found, in ascending order, and the names of what else is; where the accuracy is absolute
    /// that may be all.
    pub(super) fn parameters<'n>(
        &self,
        chain: &SerialChain,
        file: &'n File,
    ) -> Result<(Vec<usize>, Vec<&'n str>), FileError> {
        let (key, names) = ("robot.parameters", &file.robot.parameters);
        let is_absolute = file.design.accuracy == AccuracyKind::Absolute;
        let known = || names_of(chain);
        let (mut parameters, mut others) = (Vec::new(), Vec::new());
        for name in names {
            let of_compliance = name.strip_suffix(".compliance").unwrap_or(name);
            let named = |whose: &str| chain.joints.iter().position(|joint| joint.name == whose);
            let Some(joint) = named(name).or_else(|| named(of_compliance)) else {
                others.push(name.as_str());
                continue;
            };
            if parameters.contains(&joint) {
                return Err(self.wrong(key, format!("found {name:?} twice")));
            }
            parameters.push(joint);
        }
        if parameters.is_empty() && (others.is_empty() || !is_absolute) {
            let problem = match others.first() {
                Some(name) => format!(
                    "found {name:?}; at least one joint, whose compliance is unknown, is needed of: {}",
                    known()
                ),
                None => format!("is empty; at least one joint is needed of: {}", known()),
            };
            return Err(self.wrong(key, problem));
        }
        parameters.sort_unstable();
        Ok((parameters, others))
    }

    /// What is to be found besides compliances, by the names that [`ParameterKind::name`] gives, in their order.
    pub(super) fn further(
        &self,
        belief: &Belief,
        names: &[&str],
    ) -> Result<Vec<ParameterKind>, FileError> {
        let key = "robot.parameters";
        let arm = belief.arm();
        let all = ParameterKind::all_of(&arm);
        let mut found: Vec<(usize, ParameterKind)> = Vec::new();
        for name in names {
            let Some(kind) = ParameterKind::named(name, &all, &arm) else {
                let known = names_of(&belief.nominal.chain);
                let problem = format!("found {name:?}; the robot's joints are: {known}");
                return Err(self.wrong(key, problem).hint(
                    "a joint's name stands for its compliance; `elastocal check --parameters` lists what else may be \
                     unknown, and `joint_3.gear_40_sine` is a harmonic of its transmission error, 40 periods a turn",
                ));
            };
            // Waves in gears behind all that is listed, in their order.
            let place = all.iter().position(|other| *other == kind);
            let each = (place.unwrap_or(all.len()), kind);
            if found.contains(&each) {
                return Err(self.wrong(key, format!("found {name:?} twice")));
            }
            found.push(each);
        }
        found.sort_unstable();
        Ok(found.into_iter().map(|(_, kind)| kind).collect())
    }

    pub(super) fn true_robot(
        &self,
        file: &File,
        nominal: &Robot,
        additions: &Additions,
        locked: &[Locked],
    ) -> Result<TrueRobot, FileError> {
        let table = file.true_robot.as_ref();
        let model = table.and_then(|table| table.model.as_ref());
        let given = table.and_then(|table| table.compliance_rad_per_nm.as_deref());
        // Of a simulation's actuators nothing counts, the stiffness neither.
        let is_unactuated = model.is_some() && file.robot.actuators == Actuators::Ignored;
        let commanded: Vec<f64> = (nominal.chain.commanded())
            .map(|joint| nominal.compliance_rad_per_nm[joint])
            .collect();
        let given = given.or_else(|| is_unactuated.then_some(&commanded));
        let mut robot = match model {
            None => nominal.as_believed(),
            Some(path) => {
                let key = "true_robot.model";
                let model = self.model(key, path, additions)?;
                // A truth may lack what the belief locks.
                let here = locked
                    .iter()
                    .filter(|each| model.joint(&each.joint).is_ok());
                let here: Vec<_> = here.cloned().collect();
                let mut model = self.lock(&model, &here)?;
                if is_unactuated {
                    // One that is no chain of as many commanded joints is held by its position actuators.
                    let without = model.without_actuators();
                    let chain = SerialChain::from_model(&without);
                    model = match chain {
                        Ok(chain) if chain.commanded().count() == commanded.len() => without,
                        _ => model.with_plain_actuators(),
                    };
                }
                for site in [&file.robot.calibration_site, &file.robot.machining_site] {
                    model
                        .site(site)
                        .map_err(|error| self.named_file(key, error))?;
                }
                self.true_model(key, model, nominal, given)?
            }
        };
        if let Some(values) = given {
            let key = "true_robot.compliance_rad_per_nm";
            let own = std::mem::take(&mut robot.compliance_rad_per_nm);
            robot.compliance_rad_per_nm =
                self.given_compliances(key, &nominal.chain, values, own)?;
        }
        let laws = table.map_or(&[][..], |table| &table.torque_law);
        let compliance = &robot.compliance_rad_per_nm;
        robot.torque_laws = self.torque_laws(laws, &nominal.chain, compliance)?;
        Ok(robot)
    }

    /// A model of its own for the virtual robot: a plain chain of as many joints as the belief's, or
    /// anything that has the belief's joints by their names and that MuJoCo brings to rest.
    fn true_model(
        &self,
        key: &str,
        model: Model,
        nominal: &Robot,
        given: Option<&[f64]>,
    ) -> Result<TrueRobot, FileError> {
        let own = SerialChain::from_model(&model);
        let believed = &nominal.chain.joints;
        // They move alike, and are both commanded or both passive.
        let is_held_alike = |(one, other): (&Joint, &Joint)| {
            one.drive.slides == other.drive.slides
                && one.drive.passive_at.is_some() == other.drive.passive_at.is_some()
        };
        let is_alike = own.as_ref().is_ok_and(|own| {
            let is_elsewhere = |(one, other): (&Joint, &Joint)| {
                one.name != other.name && believed.iter().any(|each| each.name == one.name)
            };
            let mut both = own.joints.iter().zip(believed);
            own.len() == believed.len()
                && both.clone().all(is_held_alike)
                && !both.any(is_elsewhere)
        });
        if is_alike {
            let chain = self.serial_chain(key, &model)?;
            let key = "true_robot.compliance_rad_per_nm";
            let compliance = self.compliances(key, &chain, given)?;
            return Ok(TrueRobot::of_chain(model, chain, compliance));
        }
        for joint in believed {
            let place = model.joint(&joint.name).ok();
            if place.is_some_and(|place| model.is_slide(place) != joint.drive.slides) {
                let [own, other] = if joint.drive.slides {
                    ["turns", "slides"]
                } else {
                    ["slides", "turns"]
                };
                let name = &joint.name;
                let problem = format!("joint {name:?} {own}, and {other} in the planner's model");
                return Err(self.wrong(key, problem));
            }
        }
        let joints = believed.iter().map(|joint| KnownJoint {
            name: joint.name.clone(),
            is_passive: joint.drive.passive_at.is_some(),
        });
        let joints: Vec<KnownJoint> = joints.collect();
        let chain = match own {
            Ok(_) => Ok(self.serial_chain(key, &model)?),
            Err(reason) => Err(reason.to_string()),
        };
        let robot = TrueRobot::of_model(model, &joints, chain);
        let robot = robot.map_err(|error| match error.code {
            ErrorCode::ModelName => self.wrong(key, error.to_string()).hint(
                "the virtual robot may have more joints than the planner's model, but needs each of that model's by its name",
            ),
            _ => self.named_file(key, error),
        })?;
        for &value in &robot.compliance_rad_per_nm {
            self.number(key, value, &COMPLIANCE)?;
        }
        Ok(robot)
    }
}
