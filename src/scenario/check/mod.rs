//! From the file as written to a checked scenario, a file for each table.

mod additions;
mod certificate;
mod design;
mod error_source;
mod inputs;
mod instrument;
mod laboratory;
mod load;
mod number;
mod prior;
mod region;
mod repeatability;
mod robot;
mod station;
mod study;
mod test_pose;
mod torque_law;
mod transmission_error;
mod uncertainty;
mod values;

use std::cell::RefCell;
use std::ops::Deref;
use std::path::{Path, PathBuf};

use self::additions::{Locked, locked};
use self::error_source::ReadingPlaces;
use self::inputs::Inputs;
use self::prior::sampled_about_earlier;
use super::Scenario;
use super::file::{Actuators, File};
use crate::codes::ErrorCode;
use crate::experiment::{Plan, read_plan};
use crate::files::typed::from_toml;
use crate::files::{FileError, is_plain_name, read_text};
use crate::gate::Gate;
use crate::mujoco::Additions;
use crate::robot::{Commands, Robot, SerialChain};
use crate::task::{Belief, Task};
use crate::testbed::Truth;
use crate::text::{nearest, wording::joined, wrong_name};

impl Scenario {
    /// Reads and checks a scenario file.
    ///
    /// # Errors
    /// The first thing that is wrong, with the dotted key path.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        Self::check(path, &read_text(path)?)
    }

    /// Checks the text of a scenario that stands at a path, or is to.
    pub fn check(path: &Path, text: &str) -> Result<Self, FileError> {
        let inputs = RefCell::new(Inputs::default());
        let checked = Checker { path, inputs }.scenario(text);
        checked.map_err(|wrong| wrong.or_code(ErrorCode::Scenario))
    }
}

/// Checks values and says where in which file they are wrong.
struct Checker<'a> {
    path: &'a Path,
    /// The files that were read.
    inputs: RefCell<Inputs>,
}

/// The same, with the file and the arm that it is about.
struct ArmChecker<'a> {
    checker: &'a Checker<'a>,
    file: &'a File,
    chain: &'a SerialChain,
    commands: Commands,
}

impl<'a> Deref for ArmChecker<'a> {
    type Target = Checker<'a>;

    fn deref(&self) -> &Checker<'a> {
        self.checker
    }
}

impl Checker<'_> {
    fn scenario(&self, text: &str) -> Result<Scenario, FileError> {
        let file = self.parse(text)?;
        let table = toml::from_str(text)
            .map_err(|error| FileError::new(self.path, error.message().to_owned()))?;
        self.check_table("", "", &table)?;

        let additions = self.additions(&file)?;
        let locked = locked(&file.robot);
        let mut nominal = self.nominal(&file, &additions, &locked)?;
        let tool = |key: &str, site: &str| self.tool(key, &nominal.model, site);
        let calibration_tool = tool("robot.calibration_site", &file.robot.calibration_site)?;
        let machining_tool = tool("robot.machining_site", &file.robot.machining_site)?;
        let (mut parameters, further) = self.parameters(&nominal.chain, &file)?;
        let true_robot = self.true_robot(&file, &nominal, &additions, &locked)?;
        let before = self.prior(&file, &mut nominal, &mut parameters)?;
        let is_listed = |joint: &&usize| file.knows_compliance_of(&nominal.chain, **joint);
        let known = before.known + parameters.iter().filter(is_listed).count();
        let to_find = parameters.len().saturating_sub(known);

        let instrument = self.instrument(&file, &nominal.model)?;
        let of_arm = ArmChecker {
            checker: self,
            file: &file,
            chain: &nominal.chain,
            commands: file.commands(&nominal.chain),
        };
        let joints = nominal.chain.len();
        let test_poses = of_arm.test_poses(&machining_tool)?;
        let loads = self.loads(&file.load)?;
        let design = of_arm.design(to_find, &loads)?;
        let plans = of_arm.plans()?;
        let stations = self.stations(&file, &nominal.model, &instrument)?;
        let context = study::Context {
            sigma_m: instrument.sigma_m,
            design: &design,
            plans: &plans,
            parameters: to_find,
            conditions: Vec::new(),
        };
        let study = of_arm.study(context)?;
        let compliance_spread = of_arm.spread()?;
        let region = of_arm.region()?;
        let laboratory = of_arm.laboratory()?;
        let mut belief = Belief {
            prior: before.prior,
            prior_campaign: before.campaign,
            uncertain: self.nothing_uncertain(&nominal)?,
            turned_over_at_nm: vec![None; joints],
            stiffening_at_nm: vec![None; joints],
            nominal,
            calibration_tool,
            machining_tool,
            parameters,
            instrument,
            loading: file.laboratory.loading,
            stations,
            method: file.identification.method,
        };
        let costs = &laboratory.costs;
        let between_h = file.between_readings_h(costs);
        if let Some(gauge) = (belief.instrument.gauge.as_mut()).filter(|_| between_h > 0.0) {
            // Beside a tracker a gauge is read at once.
            gauge.drift_share = costs.between_readings_h(0) / between_h;
        }
        let places = ReadingPlaces {
            between_h,
            test_pose_rad: &test_poses[0].configuration_rad,
        };
        let mut sources = self.uncertain(&mut belief, (&file, &true_robot), &further, places)?;
        self.check_directions(&test_poses, &belief)?;
        let truth = Truth {
            // A true robot that is told is as it is told.
            earlier: sampled_about_earlier(&belief, file.tells_compliances(), &mut sources),
            uncertainties: sources,
            robot: true_robot,
            compliance_spread,
        };
        Ok(Scenario {
            path: self.path.to_owned(),
            name: self.name()?,
            description: joined(file.description.split_whitespace(), " "),
            sha256: self.inputs.borrow().sha256(&self.question(table)?),
            seed: file.seed,
            task: Task {
                belief,
                test_poses,
                loads,
                directions: self.directions(&file.instrument)?,
                region,
                design,
            },
            is_noise_only: false,
            truth,
            plans,
            study,
            laboratory,
            doubts: before.doubts,
            gate: self.gate(file.gate)?,
            mounted: Additions {
                obstacles: Vec::new(),
                ..additions
            },
            files: self.inputs.borrow().files(),
        })
    }

    /// The robot as it is taken to be.
    fn nominal(
        &self,
        file: &File,
        additions: &Additions,
        locked: &[Locked],
    ) -> Result<Robot, FileError> {
        let model = self.model("robot.model", &file.robot.model, additions)?;
        let model = match file.robot.actuators {
            Actuators::Model => model,
            Actuators::Ignored => model.without_actuators(),
        };
        let model = self.lock(&model, locked)?;
        let chain = self.serial_chain("robot.model", &model)?;
        Ok(Robot {
            compliance_rad_per_nm: self.compliances(
                "robot.compliance_rad_per_nm",
                &chain,
                file.robot.compliance_rad_per_nm.as_deref(),
            )?,
            chain,
            model,
        })
    }

    fn gate(&self, gate: Gate) -> Result<Gate, FileError> {
        let wrong = |(key, problem): (_, String)| {
            let wrong = self.wrong(&format!("gate.{key}"), &*problem);
            wrong.hinted(hint_for(&problem))
        };
        gate.check().map_err(wrong)?;
        Ok(gate)
    }

    /// The scenario's name, which results and their folder bear: the file's, without ending.
    fn name(&self) -> Result<String, FileError> {
        let stem = self.path.file_stem().unwrap_or("scenario".as_ref());
        let name = stem.to_string_lossy().into_owned();
        let no_folder = || format!("found {name:?}, which names another folder or none");
        match wrong_name(&name).or_else(|| (!is_plain_name(&name)).then(no_folder)) {
            Some(problem) => {
                let wrong = FileError::new(self.path, format!("as the file's name, {problem}"));
                Err(wrong.hint("results and their folder are named after the scenario's file"))
            }
            None => Ok(name),
        }
    }

    fn parse(&self, text: &str) -> Result<File, FileError> {
        from_toml(self.path, text).map_err(|wrong| {
            let hint = hint_for(&wrong.problem);
            wrong.hinted(hint)
        })
    }

    /// All that results depend on. A tolerance, a comment or an order of keys is no such thing.
    fn question(&self, mut table: toml::Table) -> Result<String, FileError> {
        table.remove("gate");
        serde_json::to_string(&table).map_err(|error| FileError::new(self.path, error.to_string()))
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

    /// What is wrong with a file that the scenario names.
    fn named_file(&self, key: &str, error: FileError) -> FileError {
        let elsewhere = (!error.file.exists())
            .then(|| "paths inside a scenario are relative to the scenario's folder".to_owned());
        let wrong = self.wrong(key, error.to_string()).code(error.code);
        wrong.hinted(error.hint.or(elsewhere))
    }
}

impl ArmChecker<'_> {
    fn plan(&self, key: &str, path: &Path) -> Result<Plan, FileError> {
        let plan = read_plan(path, self.commands.clone());
        let plan = plan.map_err(|error| self.named_file(key, error))?;
        self.inputs.borrow_mut().add(path)?;
        Ok(plan)
    }
}

/// For serde's "unknown field `x`, expected one of `a`, `b`": the likeliest of those allowed.
fn hint_for(problem: &str) -> Option<String> {
    let mut quoted = problem.split('`').skip(1).step_by(2);
    let found = quoted.next().filter(|_| problem.starts_with("unknown "))?;
    nearest(found, quoted).map(|best| format!("did you mean `{best}`?"))
}
