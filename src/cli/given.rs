//! Options that were given: which files they read and write, and which are about plans of one accuracy alone.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use crate::codes::ErrorCode;
use crate::files::{FileError, hexadecimal, make_folder, roles::Roles, sha256_of};
use crate::plan::Criterion;
use crate::record::messages::ProvenanceMessage;
use crate::scenario::Scenario;
use crate::task::AccuracyKind;
use clap::parser::ValueSource;
use clap::{ArgMatches, Args, Command, FromArgMatches, Id};

use super::{Common, check_outputs};

/// Options that were given on the command line, each with its first value.
#[derive(Debug, Clone)]
pub struct GivenOptions(Vec<(String, OsString)>);

/// The options whose files are read beside the scenario, with what these are.
const INPUTS: [(&str, &str); 7] = [
    ("plan", "the plan"),
    ("measurements", "the measurements"),
    ("against", "the other measurements"),
    ("identified", "what was identified"),
    ("candidates", "the candidates"),
    ("test_poses", "the test poses"),
    ("targets", "the targets"),
];

impl FromArgMatches for GivenOptions {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let value = |option: &str| {
            let values = matches.try_get_raw(option).ok().flatten();
            let first = values.and_then(|mut values| values.next());
            first.unwrap_or_default().to_owned()
        };
        let options = matches.ids().map(Id::as_str);
        let is_given =
            |option: &&str| matches.value_source(option) == Some(ValueSource::CommandLine);
        let given = options.filter(is_given);
        Ok(Self(
            given.map(|each| (each.to_owned(), value(each))).collect(),
        ))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// It has no options of its own.
impl Args for GivenOptions {
    fn augment_args(command: Command) -> Command {
        command
    }

    fn augment_args_for_update(command: Command) -> Command {
        command
    }
}

impl GivenOptions {
    /// The files that are read besides the scenario: option, what it is, and path.
    fn inputs(&self) -> impl Iterator<Item = (&'static str, &'static str, &Path)> {
        INPUTS.into_iter().filter_map(|(option, what)| {
            let (_, path) = self.0.iter().find(|(given, _)| given == option)?;
            Some((option, what, Path::new(path)))
        })
    }

    /// The files that are written, by their options as a user writes them. Programs go to a folder.
    fn outputs(&self) -> Vec<(String, &Path)> {
        let given = self.0.iter();
        let outputs = given.filter_map(|(option, value)| {
            let path = match option.as_str() {
                "program_out" => None,
                "rerun" => value.to_str()?.strip_prefix("save=").map(Path::new),
                "resume" => Some(Path::new(value)),
                other => other.ends_with("_out").then(|| Path::new(value)),
            };
            Some((named(option), path?))
        });
        outputs.collect()
    }
}

/// An option as a user writes it.
fn named(option: &str) -> String {
    format!("--{}", option.replace('_', "-"))
}

/// The accuracy that an option of a command is about, where that is one alone; with the value that is, as a user writes it.
fn about(command: &str, option: &str, value: &str) -> Option<(AccuracyKind, &'static str)> {
    use AccuracyKind::{Absolute, Relative};
    Some(match (command, option) {
        (_, "prove" | "prove_time" | "no_proof" | "proof_out" | "minutes" | "noise_free")
        | ("next", "plan") => (Relative, ""),
        (_, "criterion") if value != Criterion::TestPose.name() => (Relative, ""),
        (_, "level") if value == "model" => (Relative, " model"),
        (_, "method") if value == "linear" => (Relative, " linear"),
        ("plan" | "evaluate", "candidates") => return None,
        (
            _,
            "candidates" | "draw" | "parameters" | "report_out" | "model_selection" | "against"
            | "uncertainties_out",
        )
        | ("identify", "joint_errors") => (Absolute, ""),
        _ => return None,
    })
}

/// What is measured for an accuracy, in words.
const fn measured(accuracy: AccuracyKind) -> &'static str {
    match accuracy {
        AccuracyKind::Absolute => "absolute readings",
        AccuracyKind::Relative => "deflections",
    }
}

impl Common {
    /// Finds out before any work that no file would be lost, of a folder's results of these names, too, and that those that options
    /// name can be written.
    pub fn check_files(
        &self,
        scenario: &Scenario,
        results: Option<(&Path, &[&str])>,
    ) -> Result<(), FileError> {
        let mut roles = Roles::default();
        roles.reads("the scenario", &scenario.path);
        for file in &scenario.files {
            roles.reads("a file of the scenario", file);
        }
        for (_, what, path) in self.given.inputs() {
            roles.reads(what, path);
        }
        if let Some((folder, names)) = results {
            roles.writes_to(folder, names);
        }
        check_outputs(&mut roles, &self.given.outputs())
    }

    /// The folder for the results of a scenario, of these names; it is there, and no file would be lost.
    pub fn results_folder(
        &self,
        scenario: &Scenario,
        names: &[&str],
    ) -> Result<PathBuf, FileError> {
        let folder = self.folder(scenario);
        self.check_files(scenario, Some((&folder, names)))?;
        make_folder(&folder)?;
        Ok(folder)
    }

    /// Where results come from: a scenario, and the files that were given beside it.
    pub fn provenance(&self, scenario: &Scenario) -> Result<ProvenanceMessage, FileError> {
        let mut from = ProvenanceMessage::new(scenario);
        for (option, _, path) in self.given.inputs() {
            let hash = hexadecimal(&sha256_of(path)?);
            from.inputs_sha256.insert(option.to_owned(), hash);
        }
        Ok(from)
    }

    /// An option of a command that is about the other accuracy alone, as a user writes it.
    fn other(&self, command: &str, accuracy: AccuracyKind) -> Option<String> {
        let other = |(option, value): &(String, OsString)| {
            let (about, shown) = about(command, option, &value.to_string_lossy())?;
            (about != accuracy).then(|| named(option) + shown)
        };
        self.given.0.iter().find_map(other)
    }

    /// Refuses options of a command that are about the accuracy that a scenario has not.
    pub fn refuse_others(&self, command: &str, scenario: &Scenario) -> Result<(), FileError> {
        let own = scenario.task.design.accuracy;
        let Some(option) = self.other(command, own) else {
            return Ok(());
        };
        let (name, other) = (own.name(), own.other());
        let problem = format!(
            "is {name:?}, and {option} is for plans of {}",
            measured(other)
        );
        Err(FileError::new(&scenario.path, problem)
            .at("design.accuracy")
            .code(ErrorCode::OtherAccuracy)
            .hint(format!(
                "leave out {option}, or set accuracy = {:?}",
                other.name()
            )))
    }

    /// Refuses options of a command that a file of measurements has no use for.
    pub fn refuse_for(
        &self,
        command: &str,
        path: &Path,
        held: AccuracyKind,
    ) -> Result<(), FileError> {
        let Some(option) = self.other(command, held) else {
            return Ok(());
        };
        let [own, other] = [held, held.other()].map(measured);
        let wrong = FileError::new(path, format!("holds {own}, and {option} is for {other}"));
        let wrong = wrong.code(ErrorCode::OtherAccuracy);
        Err(wrong.hint(format!("leave out {option}")))
    }
}
