//! `compensate`: the joint angles to command at the test poses, or for absolute targets.

mod targets;

use crate::calibration::{CompensatedPose, pose_conditions};
use crate::csv::word_field;
use crate::experiment::experiment_columns;
use crate::files::make_folder;
use crate::laboratory::{CampaignError, Dialect, Program, ProgramFile, ProgramTarget, program_to};
use crate::measurement::SimulatedRun;
use crate::record::messages::TestPoseMessage;
use crate::task::{Method, Task};
use crate::testbed::TrueRobots;

use super::command_prelude::*;
use super::dialect::dialect;
use super::identified::{ScenarioRobot, read_robot, taken_as_believed};
use super::planned::RELATIVE;
use super::static_compliance::add_static_compliance;
use super::table::numbers;
use targets::{TargetFrame, Workpiece};

#[derive(Debug, Args)]
#[command(mut_arg("scenario", named_by_file))]
#[command(mut_args(without_effect(&["seed", "threads", "out"])))]
pub struct Compensate {
    #[command(flatten)]
    pub common: Common,
    /// What `identify --identified-out` wrote.
    #[arg(long, value_name = "FILE")]
    identified: PathBuf,
    /// The method; the scenario's if not given.
    #[arg(long, value_enum)]
    method: Option<Method>,
    /// Where to write the angles to command, as CSV.
    #[arg(long, value_name = "FILE")]
    angles_out: Option<PathBuf>,
    /// The folder for a robot's program through the compensated test poses.
    #[arg(long, value_name = "FOLDER")]
    program_out: Option<PathBuf>,
    /// The dialect of the program: krl, urscript, or a file that ends in .toml; the scenario's if not given.
    #[arg(long, value_name = "NAME|FILE", requires = "program_out")]
    dialect: Option<String>,
    /// Also the static compliance of the tool at the test poses (mm/N), with 95 % intervals.
    #[arg(long, conflicts_with = "targets")]
    static_compliance: bool,
    /// Absolute positions or poses of a tool, as CSV: the angles are for these, in place of the test poses.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["program_out", "method"])]
    targets: Option<PathBuf>,
    /// The tool that must be there, by its site; the machining tool if not given.
    #[arg(long, value_name = "SITE", requires = "targets")]
    tool: Option<String>,
    /// Frame of the targets, or of the workpiece; the instrument's if absolute readings were identified from, else
    /// the base's.
    #[arg(long, value_enum, requires = "targets")]
    frame: Option<TargetFrame>,
    /// Which of several stations is meant.
    #[arg(long, value_name = "NAME", requires = "targets")]
    station: Option<String>,
    /// The targets are in the frame of a workpiece: its name, and where it is (mm, deg).
    #[arg(long, value_name = "NAME=X,Y,Z,ROLL,PITCH,YAW", requires = "targets", value_parser = Workpiece::of_word)]
    workpiece: Option<Workpiece>,
}

impl Compensate {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let ScenarioRobot {
            scenario,
            robot,
            simulated,
            mut conditions,
        } = read_robot(&self.common, "compensate", &self.identified)?;
        let method = self.method.unwrap_or(scenario.task.belief.method);
        let dialect = (self.program_out.as_ref())
            .map(|_| dialect(self.dialect.as_deref(), &scenario))
            .transpose()?;
        let dialect = dialect.as_ref();
        // Their names do not depend on what is in them.
        let files = self.files(&Program::default(), &scenario, dialect)?;
        let names: Vec<&str> = files.iter().map(|file| &*file.name).collect();
        let folder = self.program_out.as_deref();
        (self.common).check_files(&scenario, folder.map(|folder| (folder, &*names)))?;
        if let Some(targets) = &self.targets {
            return self.at_targets(targets, &scenario, &robot, conditions);
        }
        self.common.say("compensating");
        // The virtual robot that was measured, where it was one.
        let mut robots = TrueRobots::new(&scenario.task.belief, &scenario.truth)?;
        if let Some(SimulatedRun {
            seed,
            run: Some(run),
            ..
        }) = simulated
        {
            robots.become_run_of(&scenario.truth, 0, seed, run)?;
        }
        let poses = robot.compensate(&scenario.task, &mut robots, method)?;
        conditions.extend(pose_conditions(&scenario.task.belief, &poses));
        let commanded = poses.iter().map(|pose| &pose.commanded_rad);
        conditions.extend(robot.read_ranges.beyond(&robot.arm, "test pose", commanded));
        let commands = scenario.task.belief.commands();
        let messages: Vec<TestPoseMessage> = (poses.iter())
            .map(|each| TestPoseMessage::new(&commands, each))
            .collect();
        let mut text = describe(&messages, commands.unit(), simulated.is_some()) + RELATIVE;
        if scenario.task.design.accuracy == AccuracyKind::Absolute {
            text += "Commands for absolute places: --targets.\n";
        }
        text += &taken_as_believed(&robot);
        let mut keys = json!({
            "accuracy": AccuracyKind::Relative.name(),
            "q_commanded_deg": messages[0].q_commanded_deg,
            "uncompensated_mm": messages[0].uncompensated_mm,
            "residual_mm": messages[0].residual_mm,
            "rho0_mm": messages[0].rho0_mm,
            "test_poses": messages,
            "simulated": simulated,
        });
        if simulated.is_none() {
            forget_observed(&mut keys);
        }
        let mut report = Report::new(keys, text, conditions);
        // Before anything is written: there may be no way.
        let files = match dialect {
            Some(_) => self.files(&self.program(&scenario, &poses)?, &scenario, dialect)?,
            None => Vec::new(),
        };
        if let Some(path) = &self.angles_out {
            report.save(path, &angles(&scenario.task, &messages));
        }
        if let Some(folder) = &self.program_out {
            make_folder(folder)?;
            for file in &files {
                let path = folder.join(&file.name);
                report.save(&path, &file.text);
            }
        }
        let mut report = (self.common).report("compensate", &scenario, report)?;
        if self.static_compliance {
            let Task {
                belief, test_poses, ..
            } = &scenario.task;
            robot.with_known(belief, |known| {
                add_static_compliance(&mut report, known, test_poses)
            })??;
        }
        Ok(report)
    }

    /// The program through the compensated test poses.
    fn program(
        &self,
        scenario: &Scenario,
        poses: &[CompensatedPose],
    ) -> Result<Program, FileError> {
        let targets: Vec<ProgramTarget> = (poses.iter())
            .map(|pose| ProgramTarget {
                name: format!("test pose {:?}", pose.name),
                configuration: pose.commanded_rad.clone(),
            })
            .collect();
        let name = &scenario.name;
        let title = format!(
            "elastocal: {name}, compensated, {}",
            self.identified.display()
        );
        let program = program_to(&scenario.task, &scenario.laboratory, &targets, &title);
        program.map_err(|error| {
            let wrong = FileError::new(&scenario.path, error.to_string());
            let wrong = wrong.code(ErrorCode::Campaign);
            match error {
                CampaignError::NoWay { .. } => wrong.hint(CampaignError::HINT),
                CampaignError::BeyondRange { .. } => wrong,
            }
        })
    }

    /// The files of a program; none without a dialect.
    fn files(
        &self,
        program: &Program,
        scenario: &Scenario,
        dialect: Option<&Dialect>,
    ) -> Result<Vec<ProgramFile>, FileError> {
        let Some(dialect) = dialect else {
            return Ok(Vec::new());
        };
        let commands = scenario.task.belief.commands();
        let name = format!("compensated_{}", scenario.name);
        let files = program.files(dialect, &scenario.laboratory, &commands, &name);
        files.map_err(|error| FileError::new(&self.identified, error.to_string()))
    }
}

/// Takes out the distances that were observed on a virtual robot, which are nobody else's.
fn forget_observed(of: &mut Value) {
    for distance in ["uncompensated", "residual"] {
        for key in ["mm", "xyz_mm"].map(|unit| format!("{distance}_{unit}")) {
            if let Some(value) = of.get_mut(key) {
                *value = Value::Null;
            }
        }
    }
    let poses = of.get_mut("test_poses").and_then(Value::as_array_mut);
    poses.into_iter().flatten().for_each(forget_observed);
}

/// The commands for a person, with what was observed where the robot is a virtual one.
fn describe(poses: &[TestPoseMessage], unit: &str, is_simulated: bool) -> String {
    let angles = format!("commanded angles [{unit}]");
    let mut header = vec!["test pose"];
    if is_simulated {
        header.extend(["uncompensated [mm]", "compensated [mm]"]);
    }
    header.extend(["predicted rms [mm]", &angles]);
    let row = |pose: &TestPoseMessage| {
        let mut row = vec![pose.name.clone()];
        if is_simulated {
            let observed = [pose.uncompensated_mm, pose.residual_mm];
            row.extend(observed.map(|distance| format!("{distance:.4}")));
        }
        row.push(number(pose.rho0_mm, 4));
        row.push(numbers(pose.q_commanded_deg.iter().copied(), 5));
        row
    };
    aligned(&header, poses.iter().map(row))
}

/// The angles to command as CSV: a row for each test pose, with the task's load and the predicted rms distance.
fn angles(task: &Task, poses: &[TestPoseMessage]) -> String {
    let commands = task.belief.commands();
    let mut text = format!(
        "test_pose,{},rho0_mm\n",
        experiment_columns(&commands).join(",")
    );
    for (pose, message) in task.test_poses.iter().zip(poses) {
        let (name, wrench) = (word_field(&message.name), pose.load.wrench());
        let numbers = message.q_commanded_deg.iter().chain(&wrench);
        let rho0_mm = joined(message.rho0_mm, "");
        text += &format!("{name},{},{rho0_mm}\n", joined(numbers, ","));
    }
    text
}
