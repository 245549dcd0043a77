//! Arguments and subcommands, one file each.
//!
//! Every command loads the scenario, says on stderr what it does, and ends in a [`Report`]: results
//! for stdout as JSON or as text, and the conditions that must be looked at.

mod budget;
mod check;
mod command_prelude;
mod compare;
mod compensate;
mod dialect;
mod evaluate;
mod explain;
mod export;
mod given;
mod help;
mod identified;
mod identify;
mod import;
mod init;
pub mod interruption;
mod lab;
mod measure;
mod merge;
mod next;
mod plan;
mod plan_args;
mod planned;
pub mod printed_error;
pub mod process;
pub mod progress;
mod proof;
mod replay;
mod reproduce;
mod residuals;
mod run;
mod select;
mod static_compliance;
mod study;
mod table;
mod tolerance;
mod uncertainty_budget;
mod validate;
mod views;
mod written;

use std::io::Write;
use std::path::{Path, PathBuf};

use self::given::GivenOptions;
use self::written::Written;
use crate::codes::{Condition, ConditionCode, ErrorCode, condition_code};
use crate::files::output::{check_writable, write_whole};
use crate::files::{FileError, roles::Roles, shipped};
use crate::measurement::Origin;
use crate::mujoco::{Model, State, limit_process};
use crate::record::messages::{platform, results};
use crate::scenario::{Scenario, scenario_schema};
use crate::text::{diagnostics::say, plain, wording::shell_path};
use crate::understanding::{collapse, pointless};
use anyhow::Context;
use clap::{Arg, Args, Parser, Subcommand};
use serde_json::{Value, json};

/// A virtual calibration testbed for the joint stiffness of industrial robots.
#[derive(Debug, Parser)]
#[command(
    name = "elastocal",
    version,
    about,
    mut_subcommands(help::with_examples)
)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
}

/// The scenario that is taken where none is given.
const DEFAULT_SCENARIO: &str = "scenarios/kr270.toml";

/// What every command takes.
#[derive(Debug, Clone, Args)]
pub struct Common {
    /// The scenario file.
    #[arg(default_value = DEFAULT_SCENARIO)]
    scenario: Option<PathBuf>,
    /// Print results as JSON.
    #[arg(long)]
    json: bool,
    /// Replace the scenario's seed.
    #[arg(long)]
    seed: Option<u64>,
    /// How many threads to use; all cores if not given, at most four for each. Results do not depend on it.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Plan and identify with the instrument's noise alone, without the error sources that the scenario lists. The
    /// virtual robot keeps them.
    #[arg(long)]
    noise_only: bool,
    /// The folder for results.
    #[arg(long, default_value = "out")]
    out: PathBuf,
    /// Say nothing on stderr but errors.
    #[arg(long)]
    quiet: bool,
    #[command(flatten)]
    accepted: Accepted,
    #[command(flatten)]
    given: GivenOptions,
}

/// How a command without a scenario tells its results.
#[derive(Debug, Clone, Copy, Args)]
pub struct Said {
    /// Print results as JSON.
    #[arg(long)]
    json: bool,
    /// Say nothing on stderr but errors.
    #[arg(long)]
    quiet: bool,
}

/// Conditions that are accepted beforehand.
#[derive(Debug, Clone, Args)]
pub struct Accepted {
    /// Conditions that are named and do not end with code 3, such as C0105,C0207; `elastocal explain` lists all.
    #[arg(long, value_name = "CODE", value_delimiter = ',', value_parser = condition_code)]
    allow: Vec<ConditionCode>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// A first scenario for a robot's model (MJCF or URDF): what is in it, and what is implausible
    Init(init::Init),
    /// The whole loop: design a plan, measure, identify, compensate, and write it all to a folder
    Run(run::Run),
    /// Validate a scenario, and a plan against it
    Check(check::Check),
    /// Design a plan of experiments
    Plan(plan::PlanCommand),
    /// How many measurements, and in how many configurations, for a wanted accuracy
    Budget(budget::Budget),
    /// Assess a plan: accuracy at the test pose, standard errors, criteria, violations
    Evaluate(evaluate::Evaluate),
    /// Measure a plan on the virtual robot
    Measure(measure::Measure),
    /// Read a table of measurements that another program wrote, through a mapping of its columns
    Import(import::Import),
    /// Identify the compliances from measurements
    Identify(identify::Identify),
    /// Compensate the test poses with identified compliances
    Compensate(compensate::Compensate),
    /// Write the calibrated robot as a model (MJCF) with its stiffnesses
    Export(export::Export),
    /// Take a plan to the laboratory: order, run sheet, robot program, table to fill in
    Lab(lab::Lab),
    /// Plan what to measure next, after some of a plan is measured
    Next(next::Next),
    /// Validate an identification by other measurements
    Validate(validate::Validate),
    /// Compare plans over many runs (Monte Carlo)
    Study(study::StudyCommand),
    /// Choose a few of many absolute readings in several ways, calibrate with each, validate on others
    Select(select::Select),
    /// Replay one run of the study on the virtual robot, and record it
    Replay(replay::Replay),
    /// Join the shards of a study
    Merge(merge::Merge),
    /// Compare two results files against tolerances: the gate for continuous integration
    Compare(compare::Compare),
    /// The paper's tables and figure beside this program's
    Reproduce(reproduce::Reproduce),
    /// Print the JSON schema of scenarios, with which editors complete and check them
    Schema,
    /// What a code of a condition or an error means
    Explain(explain::Explain),
    /// Load a model in a process of its own
    #[command(hide = true, name = LOAD_MODEL)]
    LoadModel { model: PathBuf },
}

/// Matches commands: those of the kinds that are listed by what they have alike, then all others.
macro_rules! of_kinds {
    ($of:expr, [$($kind:ident)*] $command:ident => $value:expr, $($others:tt)*) => {
        match $of { $(Command::$kind($command) => $value,)* $($others)* }
    };
}

/// Options that every command takes and that do nothing for one: its help does not speak of them.
fn without_effect(options: &[&str]) -> impl Fn(Arg) -> Arg {
    move |argument| {
        let is_one = options.contains(&argument.get_id().as_str());
        argument.hide(is_one)
    }
}

/// The scenario of a command whose input file may name it.
fn named_by_file(argument: Arg) -> Arg {
    argument
        .default_value(None)
        .help("The scenario file; the one that the input file names if not given")
}

/// What a command ends with.
#[derive(Debug, Default)]
pub struct Report {
    /// For stdout with `--json`.
    pub json: Value,
    /// For stdout without.
    pub text: String,
    /// What must be looked at before the results are relied on.
    pub conditions: Vec<Condition>,
    /// The files that are there, and those that could not be written: these are conditions, too.
    pub written: Written,
}

impl Report {
    /// Results as JSON and as text, and what must be looked at.
    pub fn new(json: Value, text: String, conditions: Vec<Condition>) -> Self {
        Self {
            json,
            text,
            conditions,
            ..Self::default()
        }
    }

    /// Notes what became of a file, and says so if it is there.
    fn noted(&mut self, path: &Path, written: Result<(), FileError>) {
        if written.is_ok() {
            self.text += &format!("wrote {}\n", path.display());
        }
        self.written.note(path, written);
    }

    /// Writes the file that a command is for, and says so.
    fn write(&mut self, path: &Path, text: &str) -> Result<(), FileError> {
        write_whole(path, text.as_bytes())?;
        self.text += &format!("wrote {}\n", path.display());
        Ok(())
    }

    /// Writes a file of text, notes what became of it, and says so if it is there.
    fn save(&mut self, path: &Path, text: &str) {
        self.noted(path, write_whole(path, text.as_bytes()));
    }
}

impl Arguments {
    /// Runs the command and prints its results. Returns what must be looked at. `itself` is the program, where a
    /// model can be loaded by another process of it first.
    pub fn execute(&self, itself: Option<PathBuf>) -> anyhow::Result<Vec<Condition>> {
        let (json, quiet, threads) = match self.command.common() {
            Some(common) => (common.json, common.quiet, common.threads),
            None => {
                of_kinds!(&self.command, [Init Import Merge Compare] command => (command.said.json, command.said.quiet, None),
                Command::Explain(command) => (command.json, false, None),
                _ => (false, false, None))
            }
        };
        crate::mujoco::print_warnings(!quiet);
        if let Some(threads) = threads {
            rayon::ThreadPoolBuilder::new()
                .num_threads(useful(threads.into()))
                .build_global()?;
        }
        if let Command::LoadModel { model } = &self.command {
            return load_model(model);
        }
        // Every model is loaded by another process first.
        if let Some(program) = itself {
            crate::mujoco::rehearse_with(program, LOAD_MODEL);
        }
        let report = self.report()?;
        let text = if json {
            serde_json::to_string_pretty(&report.json)? + "\n"
        } else {
            plain(&report.text).into_owned()
        };
        print(&text)?;
        Ok(report.conditions)
    }

    /// Does what the command says, and prints no results.
    pub fn report(&self) -> anyhow::Result<Report> {
        let mut report = of_kinds!(&self.command, [Init Run Check Plan Budget Evaluate Measure Import Identify Compensate Export Lab
            Next Validate Study Select Replay Merge Compare Reproduce] command => command.execute(),
            // It is JSON, whether or not results are wanted as such.
            Command::Schema => {
                let json = scenario_schema();
                let text = serde_json::to_string_pretty(&json)? + "\n";
                Ok(Report::new(json, text, Vec::new()))
            },
            Command::Explain(command) => Ok(command.execute()),
            // It has nothing to report.
            Command::LoadModel { .. } => Ok(Report::default()))?;
        report
            .conditions
            .extend(std::mem::take(&mut report.written).conditions());
        let accepted = of_kinds!(&self.command, [Merge Compare] command => Some(&command.accepted),
            other => other.common().map(|common| &common.accepted));
        for condition in &mut report.conditions {
            condition.allowed = accepted.is_some_and(|each| each.allow.contains(&condition.code));
        }
        if report.json.get("schema").is_some() {
            report.json["conditions"] = serde_json::to_value(&report.conditions)?;
        }
        Ok(report)
    }
}

/// The command that only loads a model, in a process that may break down.
const LOAD_MODEL: &str = "load-model";

fn load_model(path: &Path) -> anyhow::Result<Vec<Condition>> {
    limit_process();
    let model = Model::load(path)?;
    let mut state = State::new(&model);
    state.move_to(&[]);
    state.nearest_contact(0.0);
    Ok(Vec::new())
}

impl Command {
    /// What every command takes that has a scenario.
    fn common(&self) -> Option<&Common> {
        Some(
            of_kinds!(self, [Run Check Budget Measure Identify Compensate Export Lab Next Validate Study Select Replay Reproduce]
            command => &command.common,
            Self::Plan(command) => &command.args.common,
            Self::Evaluate(command) => &command.args.common,
            _ => return None),
        )
    }
}

/// Refuses a scenario whose robot does not stand at its test poses, where nothing is predicted, or bends there by nothing that is unknown.
pub fn has_task(scenario: &Scenario) -> Result<(), FileError> {
    let wrong = |problem: String| FileError::new(&scenario.path, problem);
    if let Some(problem) = collapse(scenario) {
        let wrong = wrong(problem).at("robot").code(ErrorCode::NoEquilibrium);
        return Err(wrong.hint("`elastocal check` shows the stiffness of each joint"));
    }
    match pointless(&scenario.task) {
        None => Ok(()),
        Some(problem) => Err(wrong(problem).at("test_pose").code(ErrorCode::Scenario).hint(
            "a force through a joint's axis does not bend it: move the tool, turn the force, or name other joints as robot.parameters",
        )),
    }
}

impl Common {
    /// The scenario of a command, whose robot has something to do at its test poses.
    fn open(&self, command: &str) -> anyhow::Result<Scenario> {
        let scenario = self.load()?;
        has_task(&scenario)?;
        self.refuse_others(command, &scenario)?;
        Ok(scenario)
    }

    /// Loads the scenario, with the seed replaced where one is given.
    fn load(&self) -> anyhow::Result<Scenario> {
        self.load_file(self.scenario())
    }

    /// The scenario that was given, or the default.
    fn scenario(&self) -> &Path {
        (self.scenario.as_deref()).unwrap_or(DEFAULT_SCENARIO.as_ref())
    }

    /// Loads the scenario that was given; if none was, the one under which an input file was made, as
    /// the file says. No other is taken for somebody's file. The input is that of an option of a command.
    fn load_for(
        &self,
        [command, option]: [&str; 2],
        file: &Path,
        origin: Option<&Origin>,
    ) -> anyhow::Result<Scenario> {
        let usage = format!("elastocal {command} SCENARIO {option} {}", shell_path(file));
        let wrong = |problem: &str, hint: String| {
            let wrong = FileError::new(file, problem).code(ErrorCode::ScenarioOfFile);
            wrong.hint(hint)
        };
        let own = origin.map(|origin| &origin.scenario);
        let Some(path) = self.scenario.as_ref().or(own) else {
            let problem =
                "no scenario was given, and the file does not say to which one it belongs";
            return Err(wrong(problem, format!("name the robot's scenario: {usage}")).into());
        };
        let scenario = self.load_file(path)?;
        let Some(origin) = origin.filter(|origin| origin.scenario_sha256 != scenario.sha256) else {
            return Ok(scenario);
        };
        let name = origin.scenario.display();
        if self.scenario.is_none() {
            let problem = format!("it belongs to {name}, which has changed since");
            let hint = format!("if that does not matter, name the scenario: {usage}");
            return Err(wrong(&problem, hint).into());
        }
        let file = file.display();
        self.say(&format!(
            "{file} was made under another scenario, or another state of it: {name}"
        ));
        Ok(scenario)
    }

    /// The scenario of a command that takes measurements, as [`Self::load_for`] has it, and where these come from.
    fn load_measured(
        &self,
        command: &str,
        measurements: &Path,
    ) -> anyhow::Result<(Scenario, Option<Origin>)> {
        let origin = Origin::read(measurements)?;
        let input = [command, "--measurements"];
        Ok((self.load_for(input, measurements, origin.as_ref())?, origin))
    }

    fn load_file(&self, path: &Path) -> anyhow::Result<Scenario> {
        let path = &*shipped::found(path);
        let mut scenario = Scenario::load(path).map_err(|error| {
            if path.exists() {
                error
            } else {
                error.hint("give the path of a scenario file after the command")
            }
        })?;
        if let Some(seed) = self.seed {
            scenario.seed = seed;
        }
        if self.noise_only {
            scenario.noise_only();
        }
        let description = match scenario.description.trim() {
            "" => String::new(),
            some => format!(": {some}"),
        };
        self.say(&format!("scenario {}{description}", path.display()));
        Ok(scenario)
    }

    /// What a command comes to, whose JSON has its keys, with where they come from.
    fn report(
        &self,
        command: &str,
        scenario: &Scenario,
        mut report: Report,
    ) -> Result<Report, FileError> {
        let keys = report.json.take();
        report.json = results(command, &self.provenance(scenario)?, [keys]);
        Ok(report)
    }

    /// The folder for the results of a scenario.
    fn folder(&self, scenario: &Scenario) -> PathBuf {
        self.out.join(&scenario.name)
    }

    /// Says on stderr what is being done.
    fn say(&self, what: &str) {
        progress::note(what, None);
        if !self.quiet {
            say(what);
        }
    }
}

/// Finds out before any work whether files named by options can be written, and no file would be lost.
fn check_outputs(roles: &mut Roles, options: &[(impl AsRef<str>, &Path)]) -> Result<(), FileError> {
    for (option, path) in options {
        roles.writes(option.as_ref(), path);
    }
    roles.check()?;
    (options.iter()).try_for_each(|(_, path)| check_writable(path))
}

/// Where results come from that no scenario is behind.
fn program() -> Value {
    json!({ "version": crate::VERSION, "commit": crate::COMMIT, "platform": platform() })
}

/// More threads than this for each core only cost time and memory.
const THREADS_PER_CORE: usize = 4;

/// As many threads as are asked for and help.
pub fn useful(threads: usize) -> usize {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    threads.min(cores * THREADS_PER_CORE)
}

fn print(text: &str) -> anyhow::Result<()> {
    let mut stdout = std::io::stdout().lock();
    let printed = stdout.write_all(text.as_bytes());
    unless_reader_is_gone(printed.and_then(|()| stdout.flush()))
}

/// A reader of stdout that has seen enough is no error.
pub fn unless_reader_is_gone(printed: std::io::Result<()>) -> anyhow::Result<()> {
    match printed {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("stdout cannot be written"),
    }
}
