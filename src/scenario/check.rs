//! From the file as written to a checked scenario.

mod study;

use std::path::{Path, PathBuf};

use nalgebra::{DVector, Vector3};
use sha2::{Digest, Sha256};

use super::file::{
    DesignTable, File, ForbiddenTable, InstrumentTable, LoadKind, RegionTable, SigmaOf,
    TestPoseTable, WrenchTable,
};
use super::{Design, Forbidden, Instrument, Loads, PlanFile, Region, Robot, Scenario, TestPose};
use crate::files::{FileError, hexadecimal, read_text};
use crate::mujoco::{Model, ModelError};
use crate::plan::Plan;
use crate::robot::{Load, SerialChain, Tool};

impl Scenario {
    /// Reads and checks a scenario file.
    ///
    /// # Errors
    /// The first thing that is wrong, with the dotted key path.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let text = read_text(path)?;
        Checker { path }.scenario(&text)
    }
}

/// Checks values and says where in which file they are wrong.
struct Checker<'a> {
    path: &'a Path,
}

impl Checker<'_> {
    fn scenario(&self, text: &str) -> Result<Scenario, FileError> {
        let file = self.parse(text)?;
        let mut hash = Sha256::new_with_prefix(text);

        let model = self.model("robot.model", &file.robot.model)?;
        hash.update(read_text(model.path())?);
        let chain = self.serial_chain("robot.model", &model)?;
        let nominal = Robot {
            compliance_rad_per_nm: self.compliances(
                "robot.compliance_rad_per_nm",
                &chain,
                file.robot.compliance_rad_per_nm.as_deref(),
            )?,
            chain,
            model,
        };
        let calibration_tool = self.tool(
            "robot.calibration_site",
            &nominal.model,
            &file.robot.calibration_site,
        )?;
        let machining_tool = self.tool(
            "robot.machining_site",
            &nominal.model,
            &file.robot.machining_site,
        )?;
        let parameters = self.parameters(&nominal.chain, &file.robot.parameters)?;
        let true_robot = self.true_robot(&file, &nominal)?;
        hash.update(read_text(true_robot.model.path())?);

        let joints = nominal.chain.len();
        let test_poses = self.test_poses(&file.test_pose, &nominal.chain)?;
        let design = self.design(&file.design, parameters.len(), joints)?;
        let plans = self.plans(&file.plan, joints)?;
        let context = study::Context {
            design: &design,
            plans: &plans,
            parameters: parameters.len(),
            joints,
        };
        let study = self.study(&file.study, &context)?;
        Ok(Scenario {
            path: self.path.to_owned(),
            name: self.path.file_stem().map_or_else(
                || "scenario".into(),
                |stem| stem.to_string_lossy().into_owned(),
            ),
            description: file.description,
            sha256: hexadecimal(&hash.finalize()),
            seed: file.seed,
            instrument: self.instrument(&file.instrument, &file.region, &nominal.model)?,
            method: file.identification.method,
            test_poses,
            loads: self.loads(&file.load)?,
            region: self.region(&file.region, &nominal.chain)?,
            design,
            plans,
            study,
            nominal,
            true_robot,
            calibration_tool,
            machining_tool,
            parameters,
        })
    }

    fn parse(&self, text: &str) -> Result<File, FileError> {
        let syntax = |error: &toml::de::Error| {
            let place = error.span().map(|span| line_of(text, span.start));
            let wrong = FileError::new(self.path, error.message().replace('\n', "; "));
            match place {
                Some(line) => wrong.at(format!("line {line}")),
                None => wrong,
            }
        };
        let deserializer = toml::Deserializer::parse(text).map_err(|error| syntax(&error))?;
        serde_path_to_error::deserialize(deserializer).map_err(|error| {
            let key = error.path().to_string();
            let wrong = syntax(error.inner());
            let place = match (&wrong.place, key.as_str()) {
                (Some(line), "." | "") => line.clone(),
                (Some(line), key) => format!("{key} ({line})"),
                (None, key) => key.to_owned(),
            };
            let hint = hint_for(&wrong.problem);
            let wrong = wrong.at(place);
            match hint {
                Some(hint) => wrong.hint(hint),
                None => wrong,
            }
        })
    }

    fn wrong(&self, key: &str, problem: impl Into<String>) -> FileError {
        FileError::new(self.path, problem).at(key)
    }

    /// Paths are relative to the scenario's folder.
    fn resolve(&self, path: &Path) -> PathBuf {
        self.path
            .parent()
            .map_or_else(|| path.to_owned(), |folder| folder.join(path))
    }

    fn model(&self, key: &str, path: &Path) -> Result<Model, FileError> {
        let path = self.resolve(path);
        // The same checks, and the same words, as for every other file.
        read_text(&path).map_err(|error| self.named_file(key, error))?;
        Model::load(&path).map_err(|error| self.model_error(key, &error))
    }

    /// What is wrong with a file that the scenario names.
    fn named_file(&self, key: &str, error: FileError) -> FileError {
        let wrong = self.wrong(key, error.to_string());
        match error.hint {
            Some(hint) => wrong.hint(hint),
            None if !error.file.exists() => {
                wrong.hint("paths inside a scenario are relative to the scenario's folder")
            }
            None => wrong,
        }
    }

    fn plan(&self, key: &str, path: &Path, joints: usize) -> Result<Plan, FileError> {
        crate::plan::read_plan(path, joints).map_err(|error| self.named_file(key, error))
    }

    fn model_error(&self, key: &str, error: &ModelError) -> FileError {
        self.wrong(key, error.to_string())
    }

    fn serial_chain(&self, key: &str, model: &Model) -> Result<SerialChain, FileError> {
        SerialChain::from_model(model).map_err(|error| self.model_error(key, &error))
    }

    fn tool(&self, key: &str, model: &Model, site: &str) -> Result<Tool, FileError> {
        SerialChain::tool(model, site).map_err(|error| self.model_error(key, &error))
    }

    fn finite(&self, key: &str, value: f64) -> Result<f64, FileError> {
        if value.is_finite() {
            Ok(value)
        } else {
            Err(self.wrong(key, format!("found {value}; a finite number is allowed")))
        }
    }

    fn positive(&self, key: &str, value: f64) -> Result<f64, FileError> {
        if value.is_finite() && value > 0.0 {
            Ok(value)
        } else {
            Err(self.wrong(key, format!("found {value}; a positive number is allowed")))
        }
    }

    fn not_negative(&self, key: &str, value: f64) -> Result<f64, FileError> {
        if value.is_finite() && value >= 0.0 {
            Ok(value)
        } else {
            Err(self.wrong(
                key,
                format!("found {value}; zero or a positive number is allowed"),
            ))
        }
    }

    fn one_per_joint<'a>(
        &self,
        key: &str,
        values: &'a [f64],
        joints: usize,
    ) -> Result<&'a [f64], FileError> {
        if values.len() == joints {
            Ok(values)
        } else {
            Err(self.wrong(
                key,
                format!(
                    "found {} numbers; the robot has {joints} joints",
                    values.len()
                ),
            ))
        }
    }

    fn compliances(
        &self,
        key: &str,
        chain: &SerialChain,
        given: Option<&[f64]>,
    ) -> Result<Vec<f64>, FileError> {
        match given {
            Some(values) => self
                .one_per_joint(key, values, chain.len())?
                .iter()
                .map(|&value| self.not_negative(key, value))
                .collect(),
            None => chain
                .joints
                .iter()
                .map(|joint| {
                    joint.model_compliance_rad_per_nm.ok_or_else(|| {
                        self.wrong(
                            key,
                            format!(
                                "is missing, and the model gives joint {:?} no position actuator whose gain is its stiffness",
                                joint.name
                            ),
                        )
                    })
                })
                .collect(),
        }
    }

    fn parameters(&self, chain: &SerialChain, names: &[String]) -> Result<Vec<usize>, FileError> {
        let key = "robot.parameters";
        let known = || names_of(chain);
        let mut parameters = Vec::new();
        for name in names {
            let joint = chain
                .joints
                .iter()
                .position(|joint| joint.name == *name)
                .ok_or_else(|| {
                    self.wrong(
                        key,
                        format!("found {name:?}; the robot's joints are: {}", known()),
                    )
                })?;
            if parameters.contains(&joint) {
                return Err(self.wrong(key, format!("found {name:?} twice")));
            }
            parameters.push(joint);
        }
        if parameters.is_empty() {
            let problem = format!("is empty; at least one joint is needed of: {}", known());
            return Err(self.wrong(key, problem));
        }
        parameters.sort_unstable();
        Ok(parameters)
    }

    fn true_robot(&self, file: &File, nominal: &Robot) -> Result<Robot, FileError> {
        let table = file.true_robot.as_ref();
        let Some(table) = table else {
            return Ok(nominal.clone());
        };
        let mut robot = match &table.model {
            None => nominal.clone(),
            Some(path) => {
                let key = "true_robot.model";
                let model = self.model(key, path)?;
                let chain = self.serial_chain(key, &model)?;
                if chain.len() != nominal.chain.len() {
                    let problem = format!(
                        "found {} joints; the nominal robot has {}",
                        chain.len(),
                        nominal.chain.len()
                    );
                    return Err(self.wrong(key, problem));
                }
                self.tool(key, &model, &file.robot.calibration_site)?;
                self.tool(key, &model, &file.robot.machining_site)?;
                Robot {
                    compliance_rad_per_nm: self.compliances(
                        "true_robot.compliance_rad_per_nm",
                        &chain,
                        table.compliance_rad_per_nm.as_deref(),
                    )?,
                    chain,
                    model,
                }
            }
        };
        if let Some(given) = &table.compliance_rad_per_nm {
            robot.compliance_rad_per_nm = self.compliances(
                "true_robot.compliance_rad_per_nm",
                &robot.chain,
                Some(given),
            )?;
        }
        Ok(robot)
    }

    fn instrument(
        &self,
        table: &InstrumentTable,
        region: &RegionTable,
        model: &Model,
    ) -> Result<Instrument, FileError> {
        let sigma_m = self.positive("instrument.sigma_mm", table.sigma_mm)? * 1e-3;
        let positions = match table.sigma_of {
            SigmaOf::Deflection => 1.0,
            SigmaOf::Position => 2.0_f64,
        };
        let key = "instrument.tracker_site";
        let tracker_site = table
            .tracker_site
            .as_deref()
            .map(|name| {
                model
                    .site(name)
                    .map_err(|error| self.model_error(key, &error))
            })
            .transpose()?;
        if region.line_of_sight && tracker_site.is_none() {
            return Err(self.wrong(key, "is missing, and region.line_of_sight needs it"));
        }
        Ok(Instrument {
            sigma_m: sigma_m * positions.sqrt(),
            rotation_sigma_rad: table
                .rotation_sigma_mrad
                .map(|value| self.positive("instrument.rotation_sigma_mrad", value))
                .transpose()?
                .map(|value| value * 1e-3),
            tracker_site,
        })
    }

    fn load(&self, key: &str, force: [f64; 3], torque: [f64; 3]) -> Result<Load, FileError> {
        for value in force {
            self.finite(&format!("{key}.force_n"), value)?;
        }
        for value in torque {
            self.finite(&format!("{key}.torque_nm"), value)?;
        }
        Ok(Load {
            force_n: force.into(),
            torque_nm: torque.into(),
        })
    }

    fn test_poses(
        &self,
        tables: &[TestPoseTable],
        chain: &SerialChain,
    ) -> Result<Vec<TestPose>, FileError> {
        if tables.is_empty() {
            return Err(self.wrong("test_pose", "is empty; at least one test pose is needed"));
        }
        let mut poses = Vec::new();
        for (index, table) in tables.iter().enumerate() {
            let key = format!("test_pose[{index}]");
            let q_key = format!("{key}.q_deg");
            let q_deg = self.one_per_joint(&q_key, &table.q_deg, chain.len())?;
            for (value, joint) in q_deg.iter().zip(&chain.joints) {
                self.finite(&q_key, *value)?;
                let [low, high] = joint.range_rad.map(f64::to_degrees);
                if *value < low - 1e-9 || *value > high + 1e-9 {
                    let problem = format!(
                        "found {value} for {}; its limits are {low:.4} to {high:.4}",
                        joint.name
                    );
                    return Err(self.wrong(&q_key, problem));
                }
            }
            let weight = table.weight.unwrap_or(1.0);
            poses.push(TestPose {
                name: table
                    .name
                    .clone()
                    .unwrap_or_else(|| format!("test pose {}", index + 1)),
                configuration_rad: DVector::from_iterator(
                    q_deg.len(),
                    q_deg.iter().map(|angle| angle.to_radians()),
                ),
                load: self.load(&key, table.force_n, table.torque_nm)?,
                weight: self.positive(&format!("{key}.weight"), weight)?,
            });
        }
        let total: f64 = poses.iter().map(|pose| pose.weight).sum();
        for pose in &mut poses {
            pose.weight /= total;
        }
        Ok(poses)
    }

    fn loads(&self, kind: &LoadKind) -> Result<Loads, FileError> {
        Ok(match kind {
            LoadKind::Fixed { force_n, torque_nm } => {
                Loads::Fixed(self.acting_load("load", *force_n, *torque_nm)?)
            }
            LoadKind::Direction {
                direction,
                force_min_n,
                force_max_n,
            } => {
                let key = "load.direction";
                for value in direction {
                    self.finite(key, *value)?;
                }
                let direction = Vector3::from(*direction)
                    .try_normalize(0.0)
                    .ok_or_else(|| self.wrong(key, "found 0, 0, 0; a direction is needed"))?;
                let low = self.not_negative("load.force_min_n", *force_min_n)?;
                let high = self.positive("load.force_max_n", *force_max_n)?;
                if low > high {
                    let problem =
                        format!("found {low}; at most load.force_max_n = {high} is allowed");
                    return Err(self.wrong("load.force_min_n", problem));
                }
                Loads::Direction {
                    direction,
                    force_n: [low, high],
                }
            }
            LoadKind::Any { force_max_n } => Loads::Any {
                force_max_n: self.positive("load.force_max_n", *force_max_n)?,
            },
            LoadKind::List { wrenches } => {
                if wrenches.is_empty() {
                    return Err(self.wrong("load.wrenches", "is empty"));
                }
                let load = |(index, wrench): (usize, &WrenchTable)| {
                    let key = format!("load.wrenches[{index}]");
                    self.acting_load(&key, wrench.force_n, wrench.torque_nm)
                };
                Loads::List(
                    wrenches
                        .iter()
                        .enumerate()
                        .map(load)
                        .collect::<Result<_, _>>()?,
                )
            }
        })
    }

    fn acting_load(&self, key: &str, force: [f64; 3], torque: [f64; 3]) -> Result<Load, FileError> {
        let load = self.load(key, force, torque)?;
        if load == Load::NONE {
            return Err(self.wrong(key, "found a load of zero, which deflects nothing"));
        }
        Ok(load)
    }

    fn region(&self, table: &RegionTable, chain: &SerialChain) -> Result<Region, FileError> {
        let mut joint_range_rad: Vec<_> =
            chain.joints.iter().map(|joint| joint.range_rad).collect();
        for (name, range) in &table.joint_range_deg {
            let key = format!("region.joint_range_deg.{name}");
            let index = chain
                .joints
                .iter()
                .position(|joint| joint.name == *name)
                .ok_or_else(|| {
                    let known = names_of(chain);
                    self.wrong(
                        &key,
                        format!("no such joint; the robot's joints are: {known}"),
                    )
                })?;
            let [low, high] = chain.joints[index].range_rad.map(f64::to_degrees);
            let [from, to] = *range;
            if !(from.is_finite() && to.is_finite() && from <= to)
                || from < low - 1e-9
                || to > high + 1e-9
            {
                let problem = format!(
                    "found {from} to {to}; a range within {low:.4} to {high:.4} is allowed"
                );
                return Err(self.wrong(&key, problem));
            }
            joint_range_rad[index] = range.map(f64::to_radians);
        }
        let joint_torque_max_nm = table
            .joint_torque_max_nm
            .as_deref()
            .map(|values| {
                let key = "region.joint_torque_max_nm";
                self.one_per_joint(key, values, chain.len())?
                    .iter()
                    .map(|&value| self.positive(key, value))
                    .collect::<Result<Vec<_>, _>>()
            })
            .transpose()?;
        Ok(Region {
            joint_range_rad,
            tool_height_m: self.lengths(
                "region.tool_height",
                [table.tool_height_min_mm, table.tool_height_max_mm],
            )?,
            tool_radius_m: self.lengths(
                "region.tool_radius",
                [table.tool_radius_min_mm, table.tool_radius_max_mm],
            )?,
            tool_elevation_max_rad: table
                .tool_elevation_max_deg
                .map(|value| self.not_negative("region.tool_elevation_max_deg", value))
                .transpose()?
                .map(f64::to_radians),
            joint_torque_max_nm,
            collision_clearance_m: table
                .collision_clearance_mm
                .map(|value| self.not_negative("region.collision_clearance_mm", value))
                .transpose()?
                .map(|value| value * 1e-3),
            line_of_sight: table.line_of_sight,
            forbidden: self.forbidden(&table.forbidden, chain.len())?,
        })
    }

    /// The bounds `<key>_min_mm` and `<key>_max_mm`, from mm to m.
    fn lengths(
        &self,
        key: &str,
        [low, high]: [Option<f64>; 2],
    ) -> Result<[Option<f64>; 2], FileError> {
        let keys = ["min", "max"].map(|end| format!("{key}_{end}_mm"));
        for (key, value) in keys.iter().zip([low, high]) {
            value.map(|value| self.finite(key, value)).transpose()?;
        }
        if let (Some(low), Some(high)) = (low, high)
            && low > high
        {
            let problem = format!("found {low}; at most {} = {high} is allowed", keys[1]);
            return Err(self.wrong(&keys[0], problem));
        }
        Ok([low, high].map(|value| value.map(|mm| mm * 1e-3)))
    }

    fn forbidden(
        &self,
        tables: &[ForbiddenTable],
        joints: usize,
    ) -> Result<Vec<Forbidden>, FileError> {
        let forbidden = |(index, table): (usize, &ForbiddenTable)| {
            let key = format!("region.forbidden[{index}]");
            let q_key = format!("{key}.q_deg");
            let q_deg = self
                .one_per_joint(&q_key, &table.q_deg, joints)?
                .iter()
                .map(|&angle| self.finite(&q_key, angle).map(f64::to_radians))
                .collect::<Result<Vec<_>, _>>()?;
            let within = self.positive(&format!("{key}.within_deg"), table.within_deg)?;
            Ok(Forbidden {
                configuration_rad: DVector::from_vec(q_deg),
                within_rad: within.to_radians(),
            })
        };
        tables.iter().enumerate().map(forbidden).collect()
    }

    fn design(
        &self,
        table: &DesignTable,
        parameters: usize,
        joints: usize,
    ) -> Result<Design, FileError> {
        let key = "design.experiments";
        let fewest = u32::try_from(parameters.div_ceil(3)).unwrap_or(u32::MAX);
        if table.experiments < fewest {
            let problem = format!(
                "found {}; at least {fewest} are needed, since each gives three numbers and {parameters} compliances are unknown",
                table.experiments
            );
            return Err(self.wrong(key, problem));
        }
        if let Some(configurations) = table.configurations
            && !(fewest..=table.experiments).contains(&configurations)
        {
            let problem = format!(
                "found {configurations}; {fewest} to design.experiments = {} are allowed",
                table.experiments
            );
            return Err(self.wrong("design.configurations", problem));
        }
        let mandatory = match &table.mandatory {
            Some(path) => self.plan("design.mandatory", &self.resolve(path), joints)?,
            None => Plan::default(),
        };
        if mandatory.measurements() > table.experiments {
            let problem = format!(
                "found {} experiments; at most design.experiments = {} are allowed",
                mandatory.measurements(),
                table.experiments
            );
            return Err(self.wrong("design.mandatory", problem));
        }
        Ok(Design {
            experiments: table.experiments,
            configurations: table.configurations,
            mandatory,
        })
    }

    /// Plans are read once here, so that a wrong one is found before any work is done.
    fn plans(
        &self,
        tables: &[super::file::PlanTable],
        joints: usize,
    ) -> Result<Vec<PlanFile>, FileError> {
        let mut plans: Vec<PlanFile> = Vec::new();
        for (index, table) in tables.iter().enumerate() {
            if plans.iter().any(|plan| plan.name == table.name) {
                let problem = format!("found {:?} twice", table.name);
                return Err(self.wrong(&format!("plan[{index}].name"), problem));
            }
            let path = self.resolve(&table.file);
            self.plan(&format!("plan[{index}].file"), &path, joints)?;
            plans.push(PlanFile {
                name: table.name.clone(),
                path,
            });
        }
        Ok(plans)
    }
}

fn names_of(chain: &SerialChain) -> String {
    let names: Vec<_> = (chain.joints.iter())
        .map(|joint| joint.name.as_str())
        .collect();
    names.join(", ")
}

fn line_of(text: &str, offset: usize) -> usize {
    1 + text
        .bytes()
        .take(offset)
        .filter(|&byte| byte == b'\n')
        .count()
}

/// For serde's "unknown field `x`, expected one of `a`, `b`": the likeliest of those allowed.
fn hint_for(problem: &str) -> Option<String> {
    let mut quoted = problem.split('`').skip(1).step_by(2);
    let found = quoted.next().filter(|_| problem.starts_with("unknown "))?;
    let best = quoted.max_by(|one, other| {
        strsim::jaro_winkler(found, one).total_cmp(&strsim::jaro_winkler(found, other))
    })?;
    (strsim::jaro_winkler(found, best) > 0.8).then(|| format!("did you mean `{best}`?"))
}
