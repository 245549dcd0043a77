//! The dialects of robots' programs. They are data: a file of texts with places to fill in.

use serde::Deserialize;
use thiserror::Error;

use crate::robot::Commands;
use crate::text::wording::counted;

/// The dialects that come along.
const KNOWN: [(&str, &str); 2] = [
    ("krl", include_str!("dialects/krl.toml")),
    ("urscript", include_str!("dialects/urscript.toml")),
];

/// In what angles are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Angles {
    /// Degrees, and millimetres for what slides.
    Degrees,
    /// Radians, and metres.
    Radians,
}

/// How a program is written. Places in angle brackets are filled in: `<target>`, `<text>`, `<index>`,
/// `<mass>`, `<tool>`, `<speed>` in every line; `<name>`, `<title>`, `<tool>`, `<base>`, `<speed>`, `<steps>`, `<logs>` in files.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dialect {
    /// Its name.
    pub name: String,
    /// The names of the axes: a program has a value for each.
    pub axes: Vec<String>,
    /// Those of joints that slide, then of further ones that turn.
    #[serde(default)]
    pub external_axes: Vec<String>,
    /// Whether the axes, external ones after the others, are those of the model's joints in their order, whether these turn or slide.
    #[serde(default)]
    pub in_model_order: bool,
    /// In what angles are written.
    pub angles: Angles,
    /// With how many decimals.
    pub decimals: usize,
    /// One axis of a target: `<axis>`, `<value>`.
    pub target: String,
    /// What stands between two.
    pub between: String,
    /// The longest name of a program.
    pub longest_name: usize,
    /// A move of all joints together that ends at rest.
    #[serde(rename = "move")]
    pub movement: String,
    /// A comment.
    pub comment: String,
    /// Waits for a person.
    pub halt: String,
    /// Tells the controller what hangs beside the tool: `<mass>` (kg), `<tool>`. Nothing where it is not told.
    #[serde(default)]
    pub payload: String,
    /// Tells it that nothing hangs there any more: `<tool>`.
    #[serde(default)]
    pub no_payload: String,
    /// Keeps the measured joint angles.
    pub log: String,
    /// The files of a program.
    #[serde(rename = "file")]
    pub files: Vec<DialectFile>,
}

/// One file of a program.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DialectFile {
    /// How its name ends.
    pub ending: String,
    /// What is in it.
    pub text: String,
}

/// Why there is no such dialect.
#[derive(Debug, Clone, Error, PartialEq, Eq)]
pub enum DialectError {
    /// None of this name.
    #[error("there is no dialect {0:?}; there are {known}, and files that end in .toml", known = Dialect::names().join(", "))]
    Unknown(String),
    /// A file that is none.
    #[error("is no dialect: {0}")]
    Wrong(String),
    /// The robot has other joints.
    #[error("the dialect {name} is for {axes} axes; the robot has {joints}")]
    OtherAxes {
        /// The dialect.
        name: String,
        /// How many axes it has, in words.
        axes: String,
        /// How many joints of the robot are commanded.
        joints: usize,
    },
    /// More of the robot's joints slide.
    #[error("the dialect {name} is for {axes} that slide; the robot has {slides}")]
    Slides {
        /// The dialect.
        name: String,
        /// How many joints may slide, in words.
        axes: String,
        /// How many commanded joints slide.
        slides: usize,
    },
}

impl DialectError {
    /// What to do where a dialect is for other robots.
    pub const HINT: &str =
        "write a dialect of one's own, a file that ends in .toml: see docs/laboratory.md";
}

impl Dialect {
    /// The dialects that come along.
    pub fn names() -> Vec<&'static str> {
        KNOWN.iter().map(|(name, _)| *name).collect()
    }

    /// One of those that come along.
    pub fn known(name: &str) -> Result<Self, DialectError> {
        let found = KNOWN.iter().find(|(known, _)| *known == name);
        let (_, text) = found.ok_or_else(|| DialectError::Unknown(name.to_owned()))?;
        Self::read(text)
    }

    /// A dialect from its text.
    pub fn read(text: &str) -> Result<Self, DialectError> {
        let wrong = |problem: &str| Err(DialectError::Wrong(problem.to_owned()));
        let dialect: Self = toml::from_str(text)
            .map_err(|error| DialectError::Wrong(error.message().replace('\n', "; ")))?;
        if dialect.axes.is_empty() {
            return wrong("axes is empty");
        }
        if !(3..=15).contains(&dialect.decimals) {
            return wrong("decimals: 3 to 15 are allowed");
        }
        if !(8..=200).contains(&dialect.longest_name) {
            return wrong("longest_name: 8 to 200 are allowed");
        }
        let is_ending = |file: &DialectFile| {
            let is_part = |letter: char| letter.is_ascii_alphanumeric();
            (1..=10).contains(&file.ending.len()) && file.ending.chars().all(is_part)
        };
        if dialect.files.is_empty() || !dialect.files.iter().all(is_ending) {
            return wrong("file: at least one is needed, with an ending of letters and digits");
        }
        let has = |text: &str, place: &str| text.contains(place);
        if !has(&dialect.movement, "<target>") || !has(&dialect.target, "<value>") {
            return wrong("move needs <target>, and target needs <value>");
        }
        if !dialect.files.iter().any(|file| has(&file.text, "<steps>")) {
            return wrong("file: one text needs <steps>");
        }
        Ok(dialect)
    }

    /// The axis of each commanded joint.
    ///
    /// # Errors
    /// The robot has fewer joints, or more, or more that slide.
    pub fn axes_of(&self, commands: &Commands) -> Result<Vec<&str>, DialectError> {
        let (own, external, joints) = (&self.axes, &self.external_axes, commands.len());
        let (least, most) = (own.len(), own.len() + external.len());
        if !(least..=most).contains(&joints) {
            let axes = if least == most {
                least.to_string()
            } else {
                format!("{least} to {most}")
            };
            return Err(DialectError::OtherAxes {
                name: self.name.clone(),
                axes,
                joints,
            });
        }
        let is_external = |slides: bool| slides && !self.in_model_order;
        let slides = commands
            .slides()
            .filter(|&slides| is_external(slides))
            .count();
        let Some((sliding, further)) = external.split_at_checked(slides) else {
            return Err(DialectError::Slides {
                name: self.name.clone(),
                axes: counted(external.len() as u64, "joint"),
                slides,
            });
        };
        let (mut sliding, mut turning) = (sliding.iter(), own.iter().chain(further));
        let axes = commands.slides().filter_map(|slides| {
            if is_external(slides) {
                sliding.next()
            } else {
                turning.next()
            }
        });
        Ok(axes.map(String::as_str).collect())
    }
}
