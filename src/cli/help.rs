//! What `--help` shows: options in groups, each on a line of its first words, on one screen; `--help all` has all of it.

use std::ffi::OsString;

use clap::builder::Resettable;
use clap::{Arg, ArgAction, Command, CommandFactory};

use super::Arguments;

/// So many of its examples a command shows on the screen.
const EXAMPLES: usize = 2;
/// The screen has so many columns, and of these the help of an option so many.
const COLUMNS: usize = 100;
const WORDS: usize = 70;
/// What is said around possible values takes so many columns.
const LABEL: usize = 20;

/// A command with its examples.
pub fn with_examples(command: Command) -> Command {
    let is_its = |line: &&str| line.split(' ').nth(1) == Some(command.get_name());
    let examples: Vec<&str> = (include_str!("examples.txt").lines())
        .filter(is_its)
        .collect();
    let head = match examples.len() {
        0 => return command,
        1 => "Example",
        _ => "Examples",
    };
    command.after_help(format!("{head}:\n  {}", examples.join("\n  ")))
}

/// The program's command line, with the help that these words ask for, if they do.
pub fn program(words: &[OsString]) -> Command {
    let is_help = |word: &OsString| word == "--help" || word == "-h";
    let program = Arguments::command();
    let Some(at) = words.iter().position(is_help) else {
        return program;
    };
    let is_whole = words.get(at + 1).is_some_and(|word| word == "all");
    program.mut_subcommands(|command| grouped(&command, is_whole))
}

/// A command that shows its options in groups, its own first, and does nothing else.
fn grouped(command: &Command, is_whole: bool) -> Command {
    let of_plans = command
        .get_arguments()
        .any(|each| each.get_id() == "candidates");
    let mut options: Vec<(Option<&'static str>, Arg)> = (command.get_arguments())
        .map(|each| (group(each, of_plans), each.clone()))
        .collect();
    options.sort_by_key(|(group, _)| GROUPS.iter().position(|each| Some(*each) == *group));
    let about = command.get_about().cloned().unwrap_or_default();
    let examples = (command.get_after_help()).map(ToString::to_string);
    let examples = examples.unwrap_or_default();
    let (lines, columns) = if is_whole {
        (usize::MAX, usize::MAX)
    } else {
        (1 + EXAMPLES, COLUMNS)
    };
    let examples: Vec<&str> = (examples.lines().filter(|line| line.len() <= columns))
        .take(lines)
        .collect();
    let action = if is_whole {
        ArgAction::HelpLong
    } else {
        ArgAction::HelpShort
    };
    let help = Arg::new("help").short('h').long("help").action(action);
    let options = (options.into_iter()).map(|(group, option)| {
        let option = option.help_heading(group);
        if is_whole { option } else { brief(option) }
    });
    Command::new(command.get_name().to_owned())
        .about(about)
        .after_help(examples.join("\n"))
        .disable_help_flag(true)
        .hide(command.is_hide_set())
        .args(options)
        .arg(
            help.help("Print this; all of it with --help all")
                .help_heading(COMMON),
        )
}

const DESIGN: &str = "Design";
const BOUND: &str = "Bound";
const OUTPUT: &str = "Output";
const COMMON: &str = "Common";
const GROUPS: [&str; 4] = [DESIGN, BOUND, OUTPUT, COMMON];

/// The group of an option, if it is none of the command's own. Plans are of certain parameters, too.
fn group(option: &Arg, of_plans: bool) -> Option<&'static str> {
    match option.get_id().as_str() {
        "experiments" | "configurations" | "minutes" | "criterion" | "candidates" | "draw"
        | "test_poses" => Some(DESIGN),
        "parameters" if of_plans => Some(DESIGN),
        "prove" | "prove_time" | "no_proof" | "proof_out" => Some(BOUND),
        "seed" | "threads" | "noise_only" | "allow" | "quiet" => Some(COMMON),
        "json" | "out" | "rerun" => Some(OUTPUT),
        other => other.ends_with("_out").then_some(OUTPUT),
    }
}

/// An option with the first words of its help.
fn brief(option: Arg) -> Arg {
    let help = (option.get_help().map(ToString::to_string)).unwrap_or_default();
    let until = |stops: &[&str], text: &str| {
        let end = stops.iter().filter_map(|stop| text.find(stop)).min();
        text[..end.unwrap_or(text.len())].to_owned()
    };
    let mut first = until(&[". ", "; ", ": "], &help);
    let is_open = first.matches('(').count() > first.matches(')').count();
    if is_open || first.len() > WORDS {
        first = until(&[", ", " ("], &first);
    }
    let values = option.get_possible_values();
    let length: usize = values.iter().map(|value| value.get_name().len() + 2).sum();
    option
        .hide_possible_values(first.len() + length + LABEL > WORDS)
        .help(first)
        .long_help(Resettable::Reset)
}
